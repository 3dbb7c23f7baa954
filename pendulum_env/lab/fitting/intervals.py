"""How far fitted numbers may be off: intervals by Student's t, by profile and by bootstrap, and random draws."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.warn import warn
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.fitting.errors import Errors
from pendulum_env.lab.fitting.model import SENSOR, START, Model
from pendulum_env.lab.fitting.shooting import Solution, refit
from pendulum_env.lab.recording import Recording
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, nearest, number, shown, truth, whole_number

Array = NDArray[np.float64]

FARTHEST = 18
"""Times a search for an end of an interval is widened by half: to over a thousand times the expected."""
LONG = 5.0
"""A block of the bootstrap is at least so many correlation times long."""
LINEAR = 0.02
"""Refits of the bootstrap do with the fit's derivatives where these predict the sum of squares to this share."""
MOST_DRAWS = 2**26
PATIENCE = 10_000
"""Most draws for each that is within the bounds."""


class Fitted(Protocol):
    """The parts of a fit that intervals and draws need; :class:`pendulum_env.lab.fitting.result.Fit` has them."""

    @property
    def recording(self) -> Recording: ...
    @property
    def solution(self) -> Solution: ...
    @property
    def model(self) -> Model: ...
    @property
    def names(self) -> tuple[str, ...]: ...
    @property
    def values(self) -> Array: ...
    @property
    def residual(self) -> Array: ...
    @property
    def degrees_of_freedom(self) -> int: ...
    @property
    def correlation_time(self) -> float: ...
    @property
    def errors(self) -> Errors: ...
    @property
    def covariance(self) -> Array: ...
    @property
    def scene(self) -> Scene: ...


class Interval(NamedTuple):
    """Lower and upper end, in the parameter's unit."""

    low: float
    high: float


def place_of(fit: Fitted, name: str) -> int:
    """Where a parameter stands; RecordingError with the nearest name for one that was not fitted."""
    if not isinstance(name, str) or name not in fit.names:
        raise RecordingError(f"{shown(name)} was not fitted{nearest(name, fit.names)}")
    return fit.names.index(name)


def level_of(level: float) -> float:
    """A level within (0, 1); SceneError for another."""
    found = number(level, "level", above=0.0)
    if found >= 1.0:
        raise SceneError(f"level must be below 1, not {found!r}.")
    return found


def student(fit: Fitted, name: str, level: float) -> Interval:
    """``value ± t error``, t Student's quantile at the errors' degrees of freedom, cut at the parameter's bound."""
    from scipy.stats import t

    at = place_of(fit, name)
    reach = float(t.ppf(0.5 + 0.5 * level_of(level), fit.errors.freedom)) * math.sqrt(fit.covariance[at, at])
    value, least = float(fit.values[at]), float(fit.model.least[at])
    return Interval(max(value - reach, least), value + reach)


def profile(fit: Fitted, name: str, level: float, progress: Progress | bool) -> Interval:
    """Values at which the least squares of all other parameters rise by less than ``t² s²``.

    The likelihood ratio's interval (Bates & Watts 1988, Nonlinear Regression, section 6.1): it need not be symmetric.
    ``s²`` is the residual's variance, times the factor by which :attr:`Fit.errors` found this parameter's to be larger
    than independent residuals make it. An end is the parameter's bound where that is inside, and infinite where the
    sum of squares never rises so far.
    """
    from scipy.stats import t

    at = place_of(fit, name)
    error, plain = (math.sqrt(found[at, at]) for found in (fit.covariance, fit.errors.plain))
    if not (math.isfinite(error) and plain > 0.0):
        return Interval(float(fit.model.least[at]), math.inf)
    best, value, least = float(fit.residual @ fit.residual), float(fit.values[at]), float(fit.model.least[at])
    variance = best / fit.degrees_of_freedom
    wanted = float(t.ppf(0.5 + 0.5 * level_of(level), fit.errors.freedom)) * error / plain
    slopes = fit.solution.jacobian
    others = np.delete(np.arange(len(fit.values)), at)
    tangent = fit.errors.plain[:, at] / fit.errors.plain[at, at]
    better = False

    def rise(other: float) -> float:
        """How far the sum of squares has risen at a value, as the linear model measures it: 0 where it is wanted."""
        nonlocal better
        start = fit.values + tangent * (other - value)
        start[at] = other
        _, squares = refit(fit.model, fit.recording.angle, start, slopes, others)
        better = better or squares < best - 0.01 * variance
        return math.sqrt(max(squares - best, 0.0) / variance) - wanted

    ends: list[float] = []
    with telling_of(progress, "profile") as tell:
        for side in (-1.0, 1.0):
            tell(0.5 * len(ends), f"{'lower' if side < 0.0 else 'upper'} end of {name}")
            ends.append(_end(rise, value, side, wanted * plain, least, wanted))
    if better:
        warn(f"The profile of {name} came upon a better fit than this one: start the fit anew from there.")
    return Interval(*ends)


def _end(
    rise: Callable[[float], float], value: float, side: float, reach: float, least: float, wanted: float
) -> float:
    """Where ``rise``, ``-wanted`` at the value, is 0 on one side of it; the bound or infinity where it never is."""
    from scipy.optimize import brentq

    inner, first = value, reach
    for _ in range(FARTHEST):
        outer = max(value + side * reach, least)
        if rise(outer) > 0.0:
            return float(brentq(lambda x: rise(x) if x != value else -wanted, inner, outer,
                                xtol=1e-3 * first / wanted, rtol=1e-12))
        if outer == least:
            return least
        inner, reach = outer, 1.5 * reach
    return side * math.inf


# --- draws -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Parameters fitted to recordings that might as well have been made.

    Attributes:
        fit: whose residuals were drawn.
        values: ``(refits, parameters)``.
        asked: refits that were asked for; fewer were made if they were interrupted.
        block: length of the blocks [readings].
    """

    fit: Fitted
    values: Array
    asked: int
    block: int

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters."""
        return self.fit.names

    @property
    def covariance(self) -> Array:
        """Of the parameters, from their scatter."""
        return np.asarray(np.cov(self.values, rowvar=False))

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """Between the quantiles of the refits that leave the same share outside on either side.

        Raises RecordingError for a name that was not fitted, and where there are fewer than two refits beyond each end.
        """
        column, tail = self.values[:, place_of(self.fit, name)], 0.5 * (1.0 - level_of(level))
        if tail * len(column) < 1.0:
            needed = math.ceil(1.0 / tail)
            raise RecordingError(f"an interval of level {level:g} needs {needed} refits, there are {len(column)}")
        low, high = np.quantile(column, (tail, 1.0 - tail))
        return Interval(float(low), float(high))


def bootstrap(fit: Fitted, n: int, seed: int, progress: Progress | bool) -> Bootstrap:
    """Refits to the model's motion plus residuals in another order.

    Residuals are drawn in blocks that may overlap (Künsch 1989, Ann. Stat. 17, 1217), of ``n^(1/3)`` readings or 5
    correlation times, whichever is longer, and grow by ``sqrt(n / (n - k))`` for the k parameters that took part of
    them up. Each refit starts from the fit. Rounding that is alike in all swings stays as it is, and makes no scatter
    here; the fit's own errors allow for it. Interrupted, it returns what there is, with a warning.
    """
    count, source = whole_number(n, "n", MOST_DRAWS), np.random.default_rng(whole_number(seed, "seed", 2**63, least=0))
    residual, readings = fit.residual, len(fit.residual)
    length = math.ceil(max(readings ** (1.0 / 3.0), LONG * fit.correlation_time))
    length = min(length, max(readings // 4, 1))
    grown = (residual - residual.mean()) * math.sqrt(readings / fit.degrees_of_freedom)
    motion = fit.recording.angle - residual
    starts, within = readings - length + 1, np.arange(length)
    found: list[Array] = []
    with telling_of(progress, "bootstrap") as tell:
        try:
            for i in range(count):
                tell(i / count, f"refit {i + 1} of {count}")
                first = source.integers(0, starts, math.ceil(readings / length))
                drawn = grown[(first[:, None] + within).ravel()[:readings]]
                found.append(refit(fit.model, motion + drawn, fit.values, fit.solution.jacobian, trust=LINEAR)[0])
        except KeyboardInterrupt:
            if len(found) < 2:
                raise
            warn(f"The bootstrap was interrupted after {len(found)} of {count} refits; these are returned.")
    return Bootstrap(fit, np.array(found), count, length)


def sample(fit: Fitted, n: int, seed: int, start: bool) -> dict[str, Any]:
    """Scenes as likely as the fit's: keywords of ``gym.make_vec`` with n values of each fitted parameter.

    Drawn from the normal distribution of the fit's covariance, all parameters together, and drawn again where a number
    is below its bound 0: near it, the sample has the mean and covariance of the truncated distribution.

    Raises RecordingError where a parameter has no finite error, or hardly a draw is within the bounds.
    """
    count, source = whole_number(n, "n", MOST_DRAWS), np.random.default_rng(whole_number(seed, "seed", 2**63, least=0))
    errors = np.sqrt(np.diag(fit.covariance))
    if not np.isfinite(errors).all():
        lost = ", ".join(name for name, error in zip(fit.names, errors, strict=True) if not math.isfinite(error))
        raise RecordingError(f"{fit.recording.source}: nothing to draw {lost} from, as its error is not finite")
    scale = np.where(errors > 0.0, errors, 1.0)
    sizes, axes = np.linalg.eigh(fit.covariance / np.outer(scale, scale))
    spread = (axes * np.sqrt(np.maximum(sizes, 0.0))).T * scale
    rows, tried, kept = np.empty((0, len(errors))), 0, 0
    while kept < count:
        if tried > PATIENCE * (kept + 1):
            raise RecordingError(f"{fit.recording.source}: of {tried} draws only {kept} have no number below 0")
        draws = fit.values + source.standard_normal((2 * (count - kept) + 16, len(errors))) @ spread
        rows = np.concatenate([rows, draws[(draws >= fit.model.least).all(axis=1)]])
        tried, kept = tried + len(draws), len(rows)
    wanted = {*START[:2]} if truth(start, "start") else set()
    columns = {name: column.copy() for name, column in zip(fit.names, rows[:count].T, strict=True)
               if name not in SENSOR or name in wanted}
    return {"scene": fit.scene, **columns}
