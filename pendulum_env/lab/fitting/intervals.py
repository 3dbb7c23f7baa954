"""Intervals of fitted numbers: by Student's t, and by the profile of the likelihood."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.common.warn import warn
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.fitting.model import Model
from pendulum_env.lab.fitting.shooting import BEYOND, jacobian
from pendulum_env.physics.units import SceneError, nearest, number, shown

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.result import Fit

Array = NDArray[np.float64]

MOST = 25
"""Steps of a refit."""
CLOSE = 1e-6
"""A refit ends where a step takes so little off the sum of squares, as a share of the residual's variance."""
HONEST, NEAR = 0.8, 100.0
"""Derivatives are taken anew where the sum of squares fell by a smaller share of what they predicted, or as much more,
or by more variances of the residual."""
FARTHEST = 18
"""Times a search for an end of an interval is widened by half: to over a thousand times the expected."""


class Interval(NamedTuple):
    """Lower and upper end, in the parameter's unit."""

    low: float
    high: float


def place_of(fit: Fit, name: str) -> int:
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


def student(fit: Fit, name: str, level: float) -> Interval:
    """``value ± t error``, t Student's quantile at the errors' degrees of freedom, cut at the parameter's bound."""
    from scipy.stats import t

    at = place_of(fit, name)
    reach = float(t.ppf(0.5 + 0.5 * level_of(level), fit.errors.freedom)) * math.sqrt(fit.covariance[at, at])
    value, least = float(fit.values[at]), float(fit.model.least[at])
    return Interval(max(value - reach, least), value + reach)


def profile(fit: Fit, name: str, level: float, progress: Progress | bool) -> Interval:
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


def refit(
    model: Model,
    angle: Array,
    start: Array,
    slopes: Array,
    which: NDArray[np.intp] | None = None,
    trust: float = 0.0,
) -> tuple[Array, float]:
    """Least squares from close by, of some parameters: values and sum of squares.

    Gauss and Newton's steps within the bounds, with derivatives from where they were last taken as long as the sum of
    squares falls as these predict, and new ones at the end.

    Args:
        angle: readings [rad] at ``model.time``, of equal weights.
        slopes: derivatives of the angles near ``start``, ``(readings, parameters)``.
        which: places of the parameters that move; all by default. The others stay at ``start``.
        trust: where all the fall is what the given derivatives predicted at first, to this share of it, the model is
            linear enough to do without new ones.
    """
    from scipy.optimize import lsq_linear

    places = np.arange(len(start)) if which is None else which
    values = np.maximum(start, model.least)
    residual = _residual(model, angle, values)
    squares, fresh, falls = float(residual @ residual), False, [0.0, 0.0]
    size, q, r = _factors(slopes[:, places])
    for _ in range(MOST):
        low = (model.least - values)[places] * size
        target = q.T @ residual
        step = lsq_linear(r, target, bounds=(low, np.inf), method="bvls" if np.isfinite(low).any() else "trf").x
        predicted, fallen = float(target @ target) - float((target - r @ step) @ (target - r @ step)), 0.0
        if worth := predicted >= CLOSE * squares / len(residual):
            trial = values.copy()
            trial[places] = np.maximum(values[places] + step / size, model.least[places])
            missed = _residual(model, angle, trial)
            fallen = squares - float(missed @ missed)
            falls = [falls[0] or predicted, falls[1] + fallen]
            if fallen > 0.0:
                values, residual, squares = trial, missed, squares - fallen
        if fallen <= 0.0 and (fresh or (not worth and abs(falls[1] - falls[0]) < trust * falls[0])):
            break
        most = min(predicted / HONEST, NEAR * squares / len(residual))
        if fresh := not (fallen > 0.0 and HONEST * predicted <= fallen <= most):
            size, q, r = _factors(jacobian(model, values)[:, places])
    return values, squares


def _factors(slopes: Array) -> tuple[Array, Array, Array]:
    """Lengths of the columns, and QR of the columns at length 1."""
    size = np.sqrt(np.einsum("ij,ij->j", slopes, slopes))
    size = np.where(size > 0.0, size, 1.0)
    q, r = np.linalg.qr(slopes / size)
    return size, q, r


def _residual(model: Model, angle: Array, values: Array) -> Array:
    return np.asarray(np.nan_to_num(angle - model.angles(values)[0], nan=BEYOND))
