"""Prior probabilities of fitted parameters, and the logarithm of the posterior density of many sets at once.

The sum of squares of N angles or angular velocities is a quadratic form of the simulated angles and velocities at the
steps between which the readings are interpolated. Its coefficients are sums over the readings and calculated once, so
that an evaluation takes as long as the simulation, for any number of readings. The readings of an accelerometer are not
a linear function of the motion, so that their sum of squares is computed in every evaluation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.intervals import Fitted
from pendulum_env.lab.fitting.model import Model, between, unit_of
from pendulum_env.physics.units import SceneError, nearest, number, several, shown

Array = NDArray[np.float64]

FLAT, LOG, NORMAL = "flat", "log", "normal"
FORMS = "(low, high), ('log', low, high) or ('normal', mean, error)"


@dataclass(frozen=True)
class Prior:
    """Prior probability density of one parameter.

    Attributes:
        low, high: ends of the range outside which the density is 0; infinite for none.
        kind: "flat", "log" for a density 1/x, flat in the logarithm of the parameter, or "normal".
        mean, error: mean and standard deviation of the normal density.
    """

    low: float
    high: float
    kind: str = FLAT
    mean: float = 0.0
    error: float = math.inf

    def log(self, x: Array) -> Array:
        """Return the logarithm of the density, up to a constant, at values of the parameter; -inf outside its range."""
        inside = (x >= self.low) & (x <= self.high)
        if self.kind == LOG:
            return np.where(inside, -np.log(np.where(inside, x, 1.0)), -math.inf)
        return np.where(inside, -0.5 * ((x - self.mean) / self.error) ** 2, -math.inf)

    @property
    def bounded(self) -> bool:
        """True if the density is proper, so that it alone gives the parameter a finite error."""
        return self.kind == NORMAL or math.isfinite(self.high - self.low)

    @property
    def moments(self) -> tuple[float, float]:
        """Mean and standard deviation of a bounded density, of a flat one over its range; (0, inf) of any other."""
        if self.kind == NORMAL:
            return self.mean, self.error
        wide = (self.high - self.low) / math.sqrt(12.0)
        return (0.5 * (self.low + self.high) if math.isfinite(wide) else 0.0), wide

    @property
    def text(self) -> str:
        """The density in words, such as "flat from 0.3 to 0.4"."""
        ends = f"from {self.low:g} to {self.high:g}"
        if self.kind == NORMAL:
            return f"normal, {self.mean:g} ± {self.error:g}" + (f", above {self.low:g}" if self.low > -math.inf else "")
        if self.kind == LOG:
            return f"flat in the logarithm {ends}"
        return f"flat {ends}" if math.isfinite(self.high) else f"flat above {self.low:g}" if (
            math.isfinite(self.low)) else "flat"


def priors_of(model: Model, given: Mapping[str, Any] | None) -> tuple[Prior, ...]:
    """Return the prior of every fitted parameter of a model, in the order of ``model.names``.

    ``given`` are priors by the parameter's name, in full or without its effect ("gamma" for "linear_drag.gamma"):
    ``(low, high)`` is flat, ``("log", low, high)`` is flat in the logarithm, ``("normal", mean, error)`` is a normal
    distribution. A parameter without an entry has a flat prior above its physical bound, which is 0 for all but the
    start and the sensor's zero.

    Raises SceneError for an unknown name and for a range that is upside down or below the bound.
    """
    if given is not None and not isinstance(given, Mapping):
        raise SceneError(f"priors must be a dict of name -> {FORMS}, not {shown(given)}.")
    least = dict(zip(model.names, model.least.tolist(), strict=True))
    own = {name: Prior(low, math.inf) for name, low in least.items()}
    short = {name.rpartition(".")[2]: name for name in model.names}
    for key, entry in (given or {}).items():
        name = short.get(key, key) if isinstance(key, str) else key
        if name not in own:
            raise SceneError(f"priors has {shown(key)}, which is not a fitted parameter{nearest(key, short)}")
        own[name] = _prior(key, entry, least[name], unit_of(model.scene, name))
    return tuple(own.values())


def _prior(name: str, entry: Any, least: float, unit: str) -> Prior:
    """Return the prior that an entry of ``priors`` describes; ``least`` is the parameter's physical bound."""
    words = several(entry, f"the prior of {name}", f"the form {FORMS}")
    kind = words[0] if words and isinstance(words[0], str) else FLAT
    pair = words[1:] if words and isinstance(words[0], str) else words
    if kind not in (FLAT, LOG, NORMAL) or len(pair) != 2:
        raise SceneError(f"The prior of {name} must have the form {FORMS}, not {shown(entry)}.")
    if kind == NORMAL:
        mean = number(pair[0], f"the mean of the prior of {name}", unit=unit)
        error = number(pair[1], f"the error of the prior of {name}", above=0.0, unit=unit)
        return Prior(least, math.inf, NORMAL, mean, error)
    low, high = (number(x, f"an end of the prior of {name}", unit=unit) for x in pair)
    if kind == LOG:
        number(low, f"the lower end of the log prior of {name}", above=0.0, unit=unit)
    if math.isfinite(least):
        number(low, f"the lower end of the prior of {name}", least=least, unit=unit)
    number(high, f"the upper end of the prior of {name}", above=low, unit=unit)
    return Prior(low, high, kind)


class LogDensity:
    """Logarithm of the posterior density, up to a constant, of a fit's parameters.

    Readings have independent normal errors of unknown standard deviation sigma, with the prior 1/sigma. Integrated over
    sigma, the likelihood is Student's t of the sum of squares RSS (Box & Tiao 1973, Bayesian Inference in Statistical
    Analysis, section 2.7), ``-(f + k)/2 ln(1 + (RSS - RSS_fit) / (f s²))`` with k parameters, ``f = n - k`` degrees of
    freedom and ``s² = RSS_fit / (n - k)``. This is ``-n/2 ln(RSS)``.

    Where the fit's standard errors allow for slow changes of the residuals or for rounded readings, f is the
    degrees of freedom of these errors, and RSS is taken at ``fitted + (x - fitted)/d``, for the ratio d (at least 1) of
    each parameter's standard error to that for independent residuals. The posterior is then wider by d, as the profile
    is, and keeps its shape (compare Ribatet, Cooley & Davison 2012, Statistica Sinica 22, 813).

    Args:
        fit: the fit.
        priors: prior of every parameter.

    Raises SceneError if the fit has no residual.
    """

    def __init__(self, fit: Fitted, priors: Sequence[Prior]) -> None:
        own, variances = fit.solution, np.diag(fit.errors.plain)
        self.model, self.centre, self.priors = own.model, own.values, tuple(priors)
        self.best, self.freedom = float(own.residual @ own.residual), fit.errors.freedom
        self.variance = self.best / (len(own.residual) - len(own.values))
        if not self.variance > 0.0:
            raise SceneError("The model passes through all readings exactly, so the posterior has no width.")
        with np.errstate(divide="ignore", invalid="ignore"):
            wider = np.sqrt(np.diag(fit.errors.covariance) / variances)
        self.wider = np.where(np.isfinite(wider), np.maximum(wider, 1.0), 1.0)
        self.step = self.model.step_for(self.centre)
        self._readings = fit.recording.readings
        if self.model.mount is None:
            _, value, slope = self.model.nodes(self.centre, self.step)
            self._nodes = np.concatenate([value[0], slope[0]])
            weights = between(self.model.time, self.step, value.shape[1], int(self.model.rate))
            self._squares = weights.T @ weights
            self._linear = -2.0 * (weights.T @ (self._readings - weights @ self._nodes))

    def __call__(self, rows: Array) -> Array:
        """Return the logarithm of the density for parameters of shape ``(runs, parameters)``, an array of runs.

        It is -inf outside the priors' ranges, and where a simulation stops early.
        """
        rows = np.atleast_2d(rows)
        prior = np.sum([one.log(column) for one, column in zip(self.priors, rows.T, strict=True)], axis=0)
        inside = np.isfinite(prior)
        if not inside.any():
            return np.asarray(prior)
        rise = np.full(len(rows), math.nan)
        rise[inside] = self.rises(self.centre + (rows[inside] - self.centre) / self.wider)
        share = rise / (self.freedom * self.variance)
        power = 0.5 * (self.freedom + len(self.centre))
        return np.where(np.isfinite(share), prior - power * np.log1p(np.fmax(share, -0.5)), -math.inf)

    def rises(self, rows: Array) -> Array:
        """Return the rise of the sum of squares above that of the fit for parameters of shape ``(runs, parameters)``.

        It is nan for parameters that cannot be simulated.
        """
        try:
            if self.model.mount is not None:
                return np.asarray(np.sum((self._readings - self.model.angles(rows)) ** 2, axis=1) - self.best)
            away = np.concatenate(self.model.nodes(rows, self.step)[1:], axis=1).T - self._nodes[:, None]
            with np.errstate(invalid="ignore", over="ignore"):
                return np.asarray(np.sum(away * (self._squares @ away + self._linear[:, None]), axis=0))
        except SceneError:
            if len(rows) == 1:
                return np.full(1, math.nan)
            return np.concatenate([self.rises(row[None]) for row in rows])
