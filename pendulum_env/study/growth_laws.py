"""Classification of how an integration error grows with time: bounded, linear, quadratic, exponential and others."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS = (
    "round-off", "bounded", "linear", "quadratic", "faster", "exponential", "decaying", "lost", "diverged", "not known"
)
"""Kinds of error growth that :func:`law_of` distinguishes."""
BOUNDS = ((-0.5, "decaying"), (0.5, "bounded"), (1.5, "linear"), (2.5, "quadratic"), (math.inf, "faster"))
"""Upper limit of the slope of log error over log time, and the kind of growth below it: half-way between two powers."""
TAIL = 10.0
"""Factor between the last time and the first one of the tail, the points to which a law is fitted."""
FEWEST = 4
"""Smallest number of points to which a slope is fitted."""
LOST = 0.5
"""Error, as a fraction of the motion's size, from which the numerical motion has nothing to do with the true one."""
SMALL = 0.25
"""Error, as a fraction of the motion's size, below which its growth is not yet affected by saturation."""
BEYOND = 10.0
"""Error, as a multiple of the motion's size, that shows that the error does not saturate."""
RANGE = 30.0
"""Smallest growth factor within the tail for an error to count as exponential."""
STEEP = 1.25
"""Smallest slope of log error over log time for an error to count as exponential."""
EPSILON = float(np.finfo(np.float64).eps)
WALKS = {"angle": 1.5, "energy": 0.5}
"""Powers of time with which errors grow from random rounding; from rounding in one direction, 1/2 more."""


@dataclass(frozen=True)
class Law:
    """Kind and rate of an error's growth with time.

    Attributes:
        kind: "bounded", "linear", "quadratic", "exponential" or another word of KINDS.
        slope: slope of log error over log time in the last decade of time; nan with too few points for a fit.
        lost: time [periods] from which the error is at least half the size of the motion; inf if it never is.
        stopped: time [periods] at which the run diverged; inf if it did not.
    """

    kind: str
    slope: float = math.nan
    lost: float = math.inf
    stopped: float = math.inf

    def __eq__(self, other: object) -> bool:
        """Return True if all fields are equal, counting nan as equal to nan (dataclasses do so until Python 3.12)."""
        return type(other) is type(self) and [*vars(self).values()] == [*vars(other).values()]

    def text(self) -> str:
        """Return the kind of growth as text, with the times [periods] at which the motion was lost or diverged.

        Errors from rounding also say how they grow, as "round-off, as t^1.5".
        """
        parts = [self.kind] if self.kind not in ("lost", "diverged") else []
        parts += [f"as t^{self.slope:.1f}"] if self.kind == "round-off" and self.slope > 0.1 else []
        parts += [f"lost at {_plain(self.lost)}"] if self.lost < self.stopped else []
        parts += [f"diverged at {_plain(self.stopped)}"] if math.isfinite(self.stopped) else []
        return ", ".join(parts)


def law_of(
    time: Array, error: Array, *, floor: Array | float, steps: Array, phase: Array | None, size: float,
    stopped: float = math.inf,
) -> Law:
    """Return the law by which an error, sampled at increasing times, grows.

    Points at or below ``floor`` are ignored. The law is fitted to the tail, the last factor of ten in time:

    - exponential, if the error rises more than 30-fold and its logarithm is closer to a straight line over time than
      over log time (by a factor of 3 in mean square distance, unless the slope is steeper than a quadratic law's);
    - round-off, if the tail is no larger than random rounding explains, see :func:`rounding_of`, or no larger than
      rounding in one direction where it grows as fast as random rounding; also if a floor that small hides the error;
    - otherwise the kind of the slope of log error over log time: bounded around 0, linear around 1, quadratic around
      2, faster above, decaying below, with limits half-way.

    Once an error reaches half the motion's size, the motion is lost. Since such an error saturates, its law is
    fitted to the points below a quarter of the size, and is never "bounded". With fewer than four points the law is
    "lost", "diverged" or "not known".

    Args:
        time: time of each point, increasing, above 0.
        error: the largest error around each time; nan where there is none.
        floor: errors up to this value are not reliable, because the reference solution has errors too.
        steps: number of integration steps until each time.
        phase: phase of the motion at each time [rad], for errors of the angle; None for errors of the energy.
        size: size of the motion, in the error's unit.
        stopped: time at which the run diverged.
    """
    reached = np.isfinite(error)
    gone = reached & (error >= LOST * size)
    lost = _crossing(time, error, LOST * size, int(np.argmax(gone))) if gone.any() else math.inf
    known = reached & (error > floor)
    early = known & (time < lost) & (error <= SMALL * size) if gone.any() else known
    boundless = bool(np.any(error[reached] > BEYOND * size))
    for points in (known, early) if boundless else (early,):
        if _exponential(*_tail(time[points], error[points])):
            return Law("exponential", _slope(*_tail(time[points], error[points])), lost, stopped)
    seen = reached & (error > 0.0) if not gone.any() else early
    slope = _slope(*_tail(time[seen], error[seen]))
    t, e = _tail(time[early], error[early])
    if reached.any() and not gone.any():
        tail = reached & (time >= time[reached][-1] / TAIL)
        at_random, one_way = (bound[tail] for bound in rounding_of(steps, phase))
        steep = slope > WALKS["energy" if phase is None else "angle"] - 0.25
        hidden = len(t) < FEWEST and bool(np.all(np.broadcast_to(floor, time.shape)[tail] <= one_way))
        if hidden or np.all(error[tail] <= (one_way if steep else at_random)):
            return Law("round-off", slope, lost, stopped)
    if len(t) < FEWEST:
        kind = "diverged" if math.isfinite(stopped) else "lost" if gone.any() else "not known"
        return Law(kind, math.nan, lost, stopped)
    slope = _slope(t, e)
    kind = next(name for bound, name in BOUNDS if slope < bound)
    if gone.any() and kind in ("bounded", "decaying"):
        kind = "lost"
    return Law(kind, slope, lost, stopped)


def rounding_of(steps: Array, phase: Array | None) -> tuple[Array, Array]:
    """Return the errors that rounding alone causes after a number of steps, as two estimates.

    The first is for steps that round at random, the second for steps that always round in one direction.

    A step rounds the relative energy by about 2.2e-16, so the energy's error grows with the square root of the number
    of steps, or with the number itself. The relative error of the frequency is at most about a quarter of the energy's,
    on average an eighth, so the error of the angle, returned where ``phase`` [rad] is given, grows one power faster.

    Source: Brouwer 1937, Astron. J. 46, 149; Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, VIII.5.
    """
    factor = 1.0 if phase is None else 4.0 + phase / 8.0
    return EPSILON * (4.0 + np.sqrt(steps)) * factor, EPSILON * (4.0 + steps) * factor


def _tail(time: Array, error: Array) -> tuple[Array, Array]:
    if not len(time):
        return time, error
    late = time >= time[-1] / TAIL
    return time[late], error[late]


def _slope(time: Array, error: Array) -> float:
    """Return the slope of log(error) over log(time), by least squares; nan for fewer than two points."""
    return float(np.polyfit(np.log(time), np.log(error), 1)[0]) if len(time) > 1 else math.nan


def _exponential(t: Array, e: Array) -> bool:
    if len(t) < FEWEST or not np.max(e) > RANGE * np.min(e) or not _slope(t, e) > STEEP:
        return False
    by_time, by_power = (_distance(x, np.log(e)) for x in (t, np.log(t)))
    return by_time < (1.0 / 3.0 if _slope(t, e) < BOUNDS[-2][0] else 1.0) * by_power


def _distance(x: Array, y: Array) -> float:
    """Return the mean square distance in y of points (x, y) from the straight line fitted to them."""
    return float(np.mean((y - np.polyval(np.polyfit(x, y, 1), x)) ** 2))


def _plain(value: float) -> str:
    """Return a number as text with two significant digits, without exponent from 10 to a million, such as "12 000"."""
    return f"{float(f'{value:.1e}'):,.0f}".replace(",", " ") if 10.0 <= value < 1e6 else f"{value:.2g}"


def _crossing(time: Array, error: Array, level: float, i: int) -> float:
    """Return the time at which an error first exceeded ``level``.

    Between the times with index ``i - 1`` and ``i`` the error is interpolated by a power law.
    """
    if i == 0 or not 0.0 < error[i - 1] < level:
        return float(time[i])
    part = math.log(level / error[i - 1]) / math.log(error[i] / error[i - 1])
    return float(time[i - 1] * (time[i] / time[i - 1]) ** part)
