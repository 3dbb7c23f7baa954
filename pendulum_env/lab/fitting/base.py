"""Base of fits: fitted parameters with errors and correlations, as numbers, texts, tables and files."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.results import Column, Columns, Result
from pendulum_env.common.texts import Table
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.fitting.grade import Grade
from pendulum_env.lab.fitting.intervals import Interval, student_quantile
from pendulum_env.lab.measures import Measurement, bounded_text
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import nearest, shown

Array = NDArray[np.float64]


class FitResult(Result):
    """Base of fits to recordings and to logs: the fitted parameters, their errors, and what is made of them.

    A class of fits defines the abstract properties, :meth:`origin` and :meth:`tables`. Parameters at their
    lower bound have a limit instead of an error in texts.
    """

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters, in the order of ``values`` and ``covariance``."""

    @property
    @abstractmethod
    def values(self) -> Array:
        """Values of the fitted parameters, an array in the order of ``names``, in the units of ``parameters``."""

    @property
    @abstractmethod
    def units(self) -> Mapping[str, str]:
        """Units of the fitted parameters by name."""

    @property
    @abstractmethod
    def covariance(self) -> Array:
        """Covariance matrix of the fitted parameters, in the order and the units of ``values``."""

    @property
    @abstractmethod
    def least(self) -> Array:
        """Lower bounds of the fitted parameters, an array; -inf for none."""

    @property
    @abstractmethod
    def freedom(self) -> float:
        """Degrees of freedom of Student's t for intervals."""

    @property
    @abstractmethod
    def residual(self) -> Array:
        """Reading minus model of every reading, an array."""

    @property
    @abstractmethod
    def source(self) -> str:
        """Name of the recording, or names of the logs."""

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """The scene with the fitted parameters."""

    @property
    @abstractmethod
    def grade(self) -> Grade:
        """Grade of the fit: usable, usable with exceptions, or not usable, with the reasons; see its ``text``."""

    @property
    def rms(self) -> float:
        """Root mean square of the residual, in its unit."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @cached_property
    def parameters(self) -> dict[str, Measurement]:
        """Fitted parameters by name, with their standard errors and units."""
        errors, units = np.sqrt(np.diag(self.covariance)), self.units
        return {name: Measurement(float(value), float(error), units[name])
                for name, value, error in zip(self.names, self.values, errors, strict=True)}

    @property
    def correlations(self) -> Array:
        """Correlation matrix of the fitted parameters; 0 for parameters without a finite error."""
        errors = np.sqrt(np.diag(self.covariance))
        product = np.outer(errors, errors)
        with np.errstate(divide="ignore", invalid="ignore"):
            matrix = np.where(np.isfinite(product) & (product > 0.0), self.covariance / product, 0.0)
        np.fill_diagonal(matrix, 1.0)
        return np.clip(matrix, -1.0, 1.0)

    def place(self, name: str) -> int:
        """Return the index of a fitted parameter; RecordingError with the nearest name for one that was not fitted."""
        if not isinstance(name, str) or name not in self.names:
            raise RecordingError(f"{shown(name)} was not fitted{nearest(name, self.names)}")
        return self.names.index(name)

    def correlation(self, first: str, second: str) -> float:
        """Return the correlation of two fitted parameters; raises RecordingError for names that were not fitted."""
        return float(self.correlations[self.place(first)][self.place(second)])

    @property
    def at_bound(self) -> tuple[str, ...]:
        """Names of the fitted parameters whose best value is 0, at the bound that physics sets, such as a friction that
        a recording does not show."""
        return tuple(np.array(self.names)[self.values <= self.least].tolist())

    def parameter_text(self, name: str, unit: bool = True) -> str:
        """Return a fitted parameter as text: its value with error, or the limit below which a parameter at its bound
        is with 95 %; without its unit if ``unit`` is False."""
        one = self.parameters[name] if unit else replace(self.parameters[name], unit="")
        bounded = name in self.at_bound and math.isfinite(one.error)
        return bounded_text(one, self.freedom) if bounded else str(one).strip()

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """Return the confidence interval ``value ± t error`` of a parameter with Student's t, cut at a bound of 0.

        Raises RecordingError for a name that was not fitted, SceneError for a level that is not between 0 and 1.
        """
        at = self.place(name)
        reach = student_quantile(self.freedom, level) * math.sqrt(self.covariance[at, at])
        value = float(self.values[at])
        return Interval(max(value - reach, float(self.least[at])), value + reach)

    def spreads(self) -> Mapping[str, float]:
        """Return, by name, the spread of the parameters over all models that fit about as well; {} without any."""
        return {}

    @property
    def table(self) -> Table:
        """Table of the fitted parameters: value with standard error, unit, and largest difference to other models."""
        return self._rows_of(self.parameters, {})

    @property
    def detailed_table(self) -> Table:
        """Table of the fitted parameters with their correlations."""
        return self._rows_of(self.parameters, {f"r {name.rpartition('.')[2]}": row for name, row in
                                               zip(self.names, self.correlations, strict=True)})

    def _rows_of(self, names: Iterable[str], correlations: Mapping[str, Array]) -> Table:
        spreads, columns = self.spreads(), [*correlations.values()]
        spreads = spreads if any(spreads.values()) else {}
        rows = [(name, self.parameter_text(name, unit=False), self.units[name],
                 *([f"{spreads[name]:.2g}"] if spreads else []), *(f"{column[i]:+.2f}" for column in columns))
                for i, name in enumerate(names)]
        others = ["± by model"] if spreads else []
        return Table(("parameter", "value", "unit", *others, *correlations), tuple(rows))

    def parameter_columns(self, limits: Columns, beside: Columns) -> Columns:
        """Return the table of the fitted parameters with further columns before and after that of the units."""
        found = self.parameters.values()
        return {
            "parameter": Column(self.names), "value": Column([one.value for one in found]),
            "error": Column([one.error for one in found]), **limits, "unit": Column([one.unit for one in found]),
            **beside, **{f"correlation_{name}": Column(row) for name, row in
                         zip(self.names, self.correlations.tolist(), strict=True)}}

    def pictures(self) -> Mapping[str, Any]:
        """Return the name and the kind of the figure, which is the usual one."""
        return {"fit": None}

    @property
    def text(self) -> str:
        """The result in a few sentences; by default the grade."""
        return self.grade.text

    @property
    @abstractmethod
    def details(self) -> str:
        """Sentences on what the result is based on."""

    def __str__(self) -> str:
        return self.text
