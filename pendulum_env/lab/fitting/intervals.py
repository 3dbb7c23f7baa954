"""Confidence intervals of fitted parameters, by Student's t, by profile and by bootstrap, and random draws of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.checks import warn
from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.saved import Savable
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.fitting.errors import Errors
from pendulum_env.lab.fitting.grade import Grade
from pendulum_env.lab.fitting.model import SENSOR, START
from pendulum_env.lab.fitting.shooting import FitSolution, refit
from pendulum_env.lab.fitting.statistics import correlation_time
from pendulum_env.lab.recording import Recording
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, boolean, number, whole_number

Array = NDArray[np.float64]

FARTHEST = 18
"""Most steps in the search for an end of an interval, every one 1.5 times the last: over a thousand times the expected
distance."""
LONG = 5.0
"""Minimum length of a bootstrap block, in correlation times."""
LINEAR = 0.02
"""Refits of the bootstrap use the fit's derivatives if these predict the fall of the sum of squares to this share."""
MOST_DRAWS = 2**26
"""Largest number of refits or draws."""
PATIENCE = 10_000
"""Most random draws per draw within the parameters' bounds, before :func:`sample` gives up."""


class Fitted(Protocol):
    """Protocol of the attributes of a :class:`pendulum_env.lab.fitting.result.Fit` from which intervals and random
    draws are calculated.
    """

    def place(self, name: str) -> int: ...
    def origin(self, **more: Any) -> dict[str, str]: ...
    @property
    def recording(self) -> Recording: ...
    @property
    def solution(self) -> FitSolution: ...
    @property
    def errors(self) -> Errors: ...
    @property
    def correlations(self) -> Array: ...
    @property
    def grade(self) -> Grade: ...
    @property
    def scene(self) -> Scene: ...


class Scatter(NamedTuple):
    """Joint distribution of the scene's fitted parameters, for ``gym.make(..., randomize=...)``.

    Attributes:
        names: names of the parameters of the scene.
        values: their fitted values, shape ``(n,)``.
        covariance: their covariance matrix, ``(n, n)``, from which normal draws are made.
        least: lower bounds of the parameters, ``(n,)``, -inf for none; draws below are drawn again.
        rows: refits of a bootstrap, ``(refits, n)``, one of which is a draw; None for normal draws.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    least: Array
    rows: Array | None = None


def scatter_of(fit: Fitted, covariance: Array, rows: Array | None = None) -> Scatter:
    """Return the distribution of those fitted parameters that belong to the scene and not to start or sensor.

    Raises RecordingError if one of them has no finite error.
    """
    model, names = fit.solution.model, fit.solution.model.names
    own = [place for place, name in enumerate(names) if name not in SENSOR]
    _refuse_lost(fit, covariance, own)
    return Scatter(tuple(names[place] for place in own), fit.solution.values[own], covariance[np.ix_(own, own)],
                   model.least[own], None if rows is None else rows[:, own])


def _refuse_lost(fit: Fitted, covariance: Array, places: Iterable[int]) -> None:
    """Raise RecordingError if one of some parameters has no finite error."""
    lost = [fit.solution.model.names[place] for place in places if not math.isfinite(covariance[place, place])]
    if lost:
        raise RecordingError(f"{fit.recording.source}: cannot draw values of {', '.join(lost)}, as the error is not "
                             "finite")


class Interval(NamedTuple):
    """Confidence interval of a parameter: its lower and upper end, in the parameter's unit."""

    low: float
    high: float


def level_of(level: float) -> float:
    """Return a confidence level if it is between 0 and 1; SceneError for any other value."""
    checked = number(level, "level", above=0.0)
    if checked >= 1.0:
        raise SceneError(f"level must be below 1, not {checked!r}.")
    return checked


def between_quantiles(rows: Array, level: float) -> Interval:
    """Return the interval between two quantiles of an array that leave equal shares outside."""
    tail = 0.5 * (1.0 - level_of(level))
    return Interval(*map(float, np.quantile(rows, (tail, 1.0 - tail))))


def student_quantile(freedom: float, level: float) -> float:
    """Return Student's t for a confidence level and degrees of freedom: the half width of an interval, in errors."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * level_of(level)))


def profile(fit: Fitted, name: str, level: float, progress: Progress | bool | None) -> Interval:
    """Return the profile-likelihood interval of a parameter.

    It contains the values at which the sum of squares, with all other parameters fitted anew, is less than ``t² s²``
    above its minimum (Bates & Watts 1988, Nonlinear Regression, section 6.1); it need not be symmetric. ``s²`` is the
    residual variance, enlarged by the ratio of this parameter's variance in :attr:`Fit.errors` to that for independent
    residuals. An end of the interval is the parameter's bound if that lies within, and infinite if the sum of squares
    never rises far enough.
    """
    at, own = fit.place(name), fit.solution
    error, plain = (math.sqrt(matrix[at, at]) for matrix in (fit.errors.covariance, fit.errors.plain))
    value, least = float(own.values[at]), float(own.model.least[at])
    if not (math.isfinite(error) and plain > 0.0):
        return Interval(least, math.inf)
    best = float(own.residual @ own.residual)
    variance = best / (len(own.residual) - len(own.values))
    wanted = student_quantile(fit.errors.freedom, level) * error / plain
    others = np.delete(np.arange(len(own.values)), at)
    tangent = fit.errors.plain[:, at] / fit.errors.plain[at, at]
    better = False

    def rise(other: float) -> float:
        """Return the rise of the sum of squares if a parameter has the value ``other`` and all others are fitted anew.

        It is in standard deviations, minus the rise that is wanted at an end of the interval, so that it is 0 there.
        """
        nonlocal better
        start = own.values + tangent * (other - value)
        start[at] = other
        _, squares = refit(own.model, fit.recording.readings, start, own.jacobian, others)
        better = better or squares < best - 0.01 * variance
        return math.sqrt(max(squares - best, 0.0) / variance) - wanted

    ends: list[float] = []
    with telling_of(progress, "profile") as tell:
        for side in (-1.0, 1.0):
            tell(0.5 * len(ends), f"{'lower' if side < 0.0 else 'upper'} end of {name}")
            ends.append(_end(rise, value, side, wanted * plain, least, wanted))
    if better:
        warn(f"The profile of {name} reached a smaller sum of squares than the fit, so the fit is not the best one "
             "and the interval is not reliable.")
    return Interval(*ends)


def _end(
    rise: Callable[[float], float], value: float, side: float, reach: float, least: float, wanted: float
) -> float:
    """Return one end of a profile interval, where ``rise`` is 0; the bound ``least`` or infinity if it is 0 nowhere.

    ``rise`` is a function of the parameter, the rise of the sum of squares, and ``-wanted`` at the fitted ``value``.
    The search goes down from there for ``side`` -1 and up for 1, with ``reach`` as its first step.
    """
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
class Bootstrap(Savable):
    """Parameters fitted to simulated recordings: the fitted motion plus residuals in a new random order.

    Attributes:
        fit: the fit that gave the residuals.
        values: fitted parameters, ``(refits, parameters)``.
        asked: number of refits that were requested; an interrupted bootstrap has fewer ``values``.
        block: length of the blocks of residuals [readings].
    """

    fit: Fitted
    values: Array
    asked: int
    block: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the fitted parameters, in the order of the columns of ``values``."""
        return self.fit.solution.model.names

    @property
    def covariance(self) -> Array:
        """Covariance matrix of the parameters, from their scatter over the refits."""
        return np.asarray(np.cov(self.values, rowvar=False))

    @property
    def scatter(self) -> Scatter:
        """Distribution of the scene's parameters for ``gym.make(..., randomize=fit.bootstrap(200))``: its refits."""
        return scatter_of(self.fit, np.atleast_2d(self.covariance), self.values)

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """Return the interval of a parameter between two quantiles of the refits, with equal shares outside.

        ``level`` is the share of refits within the interval. Raises RecordingError for a name that was not fitted, and
        for too few refits: on average at least one must lie beyond each end.
        """
        column, tail = self.values[:, self.fit.place(name)], 0.5 * (1.0 - level_of(level))
        if tail * len(column) < 1.0:
            needed = math.ceil(1.0 / tail)
            raise RecordingError(f"an interval of level {level:g} needs {needed} refits, there are {len(column)}")
        return between_quantiles(column, level)


def bootstrap(fit: Fitted, n: int, seed: int, progress: Progress | bool | None) -> Bootstrap:
    """Refit the model to ``n`` simulated recordings: the fitted motion plus residuals in a new random order.

    Residuals are drawn in blocks that may overlap (Künsch 1989, Ann. Stat. 17, 1217), of ``n^(1/3)`` readings or 5
    correlation times, whichever is longer. They are enlarged by ``sqrt(n / (n - k))``, because the fit of k parameters
    has made them smaller. Every refit starts from the fitted values. Rounding that is equal in all swings causes no
    scatter between refits; only the standard errors of the fit allow for it. Ctrl-C returns the refits done so far,
    with a warning.
    """
    count, source = whole_number(n, "n", MOST_DRAWS), np.random.default_rng(whole_number(seed, "seed", 2**63, least=0))
    own, residual, readings = fit.solution, fit.solution.residual, len(fit.solution.residual)
    length = math.ceil(max(readings ** (1.0 / 3.0), LONG * correlation_time(residual)))
    length = min(length, max(readings // 4, 1))
    grown = (residual - residual.mean()) * math.sqrt(readings / (readings - len(own.values)))
    motion = fit.recording.readings - residual
    starts, within = readings - length + 1, np.arange(length)
    refits: list[Array] = []
    with telling_of(progress, "bootstrap") as tell:
        try:
            for i in range(count):
                tell(i / count, f"refit {i + 1} of {count}")
                first = source.integers(0, starts, math.ceil(readings / length))
                drawn = grown[(first[:, None] + within).ravel()[:readings]]
                refits.append(refit(own.model, motion + drawn, own.values, own.jacobian, trust=LINEAR)[0])
        except KeyboardInterrupt:
            if len(refits) < 2:
                raise
            warn(f"The bootstrap was interrupted after {len(refits)} of {count} refits; these are returned.")
    return Bootstrap(fit, np.array(refits), count, length)


def sample(fit: Fitted, n: int, seed: int, start: bool) -> dict[str, Any]:
    """Draw random scenes that agree with a fit: keywords of ``gym.make_vec`` with n values of every fitted parameter.

    The parameters are drawn jointly from the normal distribution with the fit's covariance, and drawn again if one is
    below its bound 0. Near a bound, the sample therefore has the mean and covariance of the truncated distribution.

    Raises RecordingError if a parameter has no finite error, or if hardly any draw is within the bounds.
    """
    count, source = whole_number(n, "n", MOST_DRAWS), np.random.default_rng(whole_number(seed, "seed", 2**63, least=0))
    values, errors = fit.solution.values, np.sqrt(np.diag(fit.errors.covariance))
    _refuse_lost(fit, fit.errors.covariance, range(len(errors)))
    rows, tried, valid = np.empty((0, len(errors))), 0, 0
    while valid < count:
        if tried > PATIENCE * (valid + 1):
            raise RecordingError(f"{fit.recording.source}: only {valid} of {tried} draws have no parameter below 0")
        draws = values + errors * source.multivariate_normal(np.zeros(len(errors)), fit.correlations,
                                                             2 * (count - valid) + 16, method="eigh")
        rows = np.concatenate([rows, draws[(draws >= fit.solution.model.least).all(axis=1)]])
        tried, valid = tried + len(draws), len(rows)
    return keywords_of(fit, rows[:count], start)


def keywords_of(fit: Fitted, rows: Array, start: bool) -> dict[str, Any]:
    """Return rows of a fit's parameters as keywords of ``gym.make_vec`` or, with ``start``, of ``rollout``."""
    wanted = {*START[:2]} if boolean(start, "start") else set()
    columns = {name: column.copy() for name, column in zip(fit.solution.model.names, rows.T, strict=True)
               if name not in SENSOR or name in wanted}
    return {"scene": fit.scene, **columns}
