"""What a fit found: numbers with standard errors, and the scene that has them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress
from pendulum_env.lab.fitting.errors import Errors, errors_of
from pendulum_env.lab.fitting.intervals import Interval, place_of, profile, student
from pendulum_env.lab.fitting.model import START, Model, unit_of
from pendulum_env.lab.fitting.sampling import Bootstrap, bootstrap, sample
from pendulum_env.lab.fitting.shooting import Solution
from pendulum_env.lab.fitting.statistics import (
    FOUND,
    RunsTest,
    bic,
    chi_squared_p,
    correlation_time,
    reading_error,
    runs_test,
)
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.recording import Recording
from pendulum_env.physics.scene import Scene

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.choice import Comparison

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fit:
    """Least squares of one model to a recording.

    Attributes:
        recording: as fitted: from the release on.
        solution: of the least squares.
        sigma: standard deviation of one reading that the fit was weighted with [rad].
        comparison: with the other models, where several were fitted.
        rest: how much longer the bob was recorded at rest, which was not fitted [s].
    """

    recording: Recording
    solution: Solution
    sigma: float
    comparison: Comparison | None = None
    rest: float = 0.0

    @property
    def model(self) -> Model:
        """The scene and what of it is free."""
        return self.solution.model

    @property
    def damping(self) -> str:
        """The dampings of the model, as ``damping=`` takes them."""
        return self.model.title

    @property
    def names(self) -> tuple[str, ...]:
        """What was fitted, in the order of ``values`` and ``covariance``."""
        return self.model.names

    @property
    def values(self) -> Array:
        """The fitted numbers, an array in the units and the order that ``parameters`` has."""
        return self.solution.values

    @property
    def residual(self) -> Array:
        """Recording minus model [rad], an array at ``recording.time``."""
        return self.solution.residual

    @property
    def rms(self) -> float:
        """Root mean square of the residual [rad]."""
        return float(np.sqrt(np.mean(self.residual**2)))

    @property
    def degrees_of_freedom(self) -> int:
        """Readings less fitted numbers."""
        return len(self.residual) - len(self.values)

    @cached_property
    def noise(self) -> float:
        """Standard deviation of one reading [rad], quantum included, from what sets readings off their neighbours."""
        return reading_error(self.recording.time, self.residual)

    @property
    def chi2(self) -> float:
        """Sum of ``(residual / noise)²``: near ``degrees_of_freedom`` if there is nothing but noise."""
        squares = float(self.residual @ self.residual)
        return squares / self.noise**2 if self.noise > 0.0 else math.inf if squares else 0.0

    @property
    def p_value(self) -> float:
        """Chance of a chi2 at least as large, were the residual independent noise.

        The noise comes from the same readings, so that ``chi2 / degrees_of_freedom`` scatters as if of 0.62 times as
        many degrees of freedom; that is taken into account.
        """
        return chi_squared_p(FOUND * self.chi2, FOUND * self.degrees_of_freedom)

    @cached_property
    def runs(self) -> RunsTest:
        """Are the signs of the residual in random order?"""
        return runs_test(self.residual)

    @cached_property
    def correlation_time(self) -> float:
        """Readings that count as one in the residual's sum of squares."""
        return correlation_time(self.residual)

    @property
    def n_effective(self) -> float:
        """Readings that count as independent: all over ``correlation_time``."""
        return len(self.residual) / self.correlation_time

    @property
    def bic(self) -> float:
        """Bayesian information criterion; see :func:`pendulum_env.lab.fitting.statistics.bic`, and for several fits
        :func:`pendulum_env.lab.fitting.statistics.common_bic`."""
        return bic(float(self.residual @ self.residual), len(self.residual), len(self.values), self.n_effective)

    @cached_property
    def errors(self) -> Errors:
        """Covariance, its degrees of freedom, and how it was found."""
        return errors_of(self.solution, self.recording.quantum)

    @property
    def how(self) -> str:
        """How the standard errors were made, in a sentence."""
        return self.errors.how

    @property
    def covariance(self) -> Array:
        """Covariance matrix of ``values``, in their units."""
        return self.errors.covariance

    @property
    def correlations(self) -> Array:
        """Correlations of ``values``, each within [-1, 1]; 0 beside a parameter without a finite error."""
        errors = np.sqrt(np.diag(self.covariance))
        product = np.outer(errors, errors)
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.where(np.isfinite(product) & (product > 0.0), self.covariance / product, 0.0)
        np.fill_diagonal(found, 1.0)
        return np.clip(found, -1.0, 1.0)

    def correlation(self, first: str, second: str) -> float:
        """Correlation of two parameters; RecordingError for names that were not fitted."""
        return float(self.correlations[place_of(self, first), place_of(self, second)])

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """``value ± t error`` with Student's t, cut at the bound of a number that cannot be negative.

        Raises RecordingError for a name that was not fitted.
        """
        return student(self, name, level)

    def profile(self, name: str, level: float = 0.95, progress: Progress | bool = False) -> Interval:
        """The same by the profile of the likelihood: all others are fitted anew at each value that is tried.

        Slower, and right where the sum of squares is no parabola. See
        :func:`pendulum_env.lab.fitting.intervals.profile`. Raises RecordingError for a name that was not fitted.
        """
        return profile(self, name, level, progress)

    def bootstrap(self, n: int = 200, seed: int = 0, progress: Progress | bool = False) -> Bootstrap:
        """Fits to ``n`` recordings made of the model's motion and residuals in another order, in blocks.

        See :func:`pendulum_env.lab.fitting.sampling.bootstrap`. Ctrl-C ends it with what it has, and a warning.
        """
        return bootstrap(self, n, seed, progress)

    def sample(self, n: int, seed: int = 0, *, start: bool = False) -> dict[str, Any]:
        """``n`` scenes as likely as this one, as keywords: ``gym.make_vec("LabPendulum-v0", num_envs=n,
        vectorization_mode="vector_entry_point", **fit.sample(n))``.

        Args:
            start: True adds "angle" and "velocity" at time 0, for ``rollout(**fit.sample(n, start=True))``.

        Returns the scene, and an array of n values for each fitted number of it, from the normal distribution of
        ``covariance`` where no number is below its bound 0. Raises RecordingError where there is no such distribution.
        """
        return sample(self, n, seed, start)

    def against(self, **told: tuple[float, float]) -> dict[str, float]:
        """Fitted numbers less those told otherwise, over the standard deviation of the difference, as in
        ``fit.against(length=(0.65, 0.01))``; see :func:`pendulum_env.lab.fitting.choice.against`."""
        from pendulum_env.lab.fitting.choice import against

        return against(self, told)

    @cached_property
    def parameters(self) -> dict[str, Measurement]:
        """Each fitted number with its standard error and unit."""
        errors = np.sqrt(np.diag(self.covariance))
        return {name: Measurement(float(value), float(error), unit_of(self.model.scene, name))
                for name, value, error in zip(self.names, self.values, errors, strict=True)}

    @cached_property
    def scene(self) -> Scene:
        """The scene with the fitted numbers, whose usual run is the recorded one."""
        found = self.model.scene_with(self.values)
        angle, velocity = (self.parameters[name].value for name in START[:2])
        period = math.tau / found.omega0
        duration = float(self.recording.time[-1]) + self.rest
        run = {"angle": angle, "velocity": velocity, "duration": duration, "dt": float(f"{period / 100.0:.2g}")}
        return found.replace(name=f"fitted to {self.recording.source}", run={**found.to_dict()["run"], **run})
