"""How an error grows with time: the law of its last decades, by a stated rule."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS = (
    "round-off", "bounded", "linear", "quadratic", "faster", "exponential", "decaying", "lost", "diverged", "not known"
)
"""Every law that :func:`law_of` finds."""
BOUNDS = ((-0.5, "decaying"), (0.5, "bounded"), (1.5, "linear"), (2.5, "quadratic"), (math.inf, "faster"))
"""Slope of log error over log time up to which a law has its name: half-way between those of two powers."""
TAIL = 10.0
"""The slope is that of points from 1/TAIL of the last one's time on."""
FEWEST = 4
"""Points that a slope takes."""
LOST = 0.5
"""Part of the motion's size from which an error is as good as any other: the motion is lost."""
SMALL = 0.25
"""Part of the motion's size below which an error grows as if there were no end to it."""
BEYOND = 10.0
"""An error that comes to so many times the motion's size does not saturate there."""
RANGE = 30.0
"""An error that grows less than this much in the tail is not called exponential."""
STEEP = 1.25
"""Nor one of a smaller slope over log time."""
EPSILON = float(np.finfo(np.float64).eps)
WALKS = {"angle": 1.5, "energy": 0.5}
"""Powers of time with which rounding at random makes errors grow; in one direction they are larger by one half."""


@dataclass(frozen=True)
class Law:
    """How an error grows.

    Attributes:
        kind: one of KINDS.
        slope: of log error over log time in the tail; nan where nothing can be fitted.
        lost: time from which the error is as large as the motion; inf if it never is.
        stopped: time at which the run diverged; inf if it did not.
    """

    kind: str
    slope: float = math.nan
    lost: float = math.inf
    stopped: float = math.inf

    def __eq__(self, other: object) -> bool:
        """True for equal numbers, nan beside nan too, of which dataclasses say otherwise from Python 3.13 on."""
        return type(other) is type(self) and [*vars(self).values()] == [*vars(other).values()]

    def text(self) -> str:
        """In words: the law, and when the motion was lost [periods]."""
        said = [self.kind] if self.kind not in ("lost", "diverged") else []
        said += [f"lost at {_plain(self.lost)}"] if self.lost < self.stopped else []
        said += [f"diverged at {_plain(self.stopped)}"] if math.isfinite(self.stopped) else []
        return ", ".join(said)


def law_of(
    time: Array, error: Array, *, floor: Array | float, steps: Array, phase: Array | None, size: float,
    stopped: float = math.inf,
) -> Law:
    """The law of an error that was looked at now and then.

    Points at or below ``floor`` say nothing. The law is that of the tail, the last decade:

    - exponential, if it rises by more than RANGE and its log is a straighter line over time than over log time: by a
      third of the mean square distance, where the slope over log time is that of a quadratic law or less;
    - round-off, if the tail is no larger than what rounding makes, see :func:`rounding_of`: at random, or, where it
      grows at least as fast as that does, in one direction; also if it is hidden by a floor that rounding makes;
    - else by the slope of log error over log time: bounded around 0, linear around 1, quadratic around 2, faster above,
      decaying below, with bounds half-way.

    An error that reaches LOST times the motion's size is named as lost from there on, and its law is that of the points
    before it is SMALL times it, since it has to saturate; these cannot be called bounded. With fewer than FEWEST points
    to go by, the law is "lost", "diverged" or "not known".

    Args:
        time: of each point, increasing, above 0.
        error: the largest around each time; nan where there is none.
        floor: errors up to this are not known.
        steps: made until each time.
        phase: passed until each time [rad], for errors of the angle; None for those of energy.
        size: of the motion, in the error's unit.
        stopped: when the run diverged.
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
    """What rounding each step makes: at random, and, at worst, always in one direction.

    A step rounds the relative energy by some EPSILON, so that its error grows with the square root of the number of
    steps, or with their number. The frequency has up to about a quarter of it, on average half of that, so that the
    angle's, where ``phase`` [rad] is given, grows with one power more.

    Source: Brouwer 1937, Astron. J. 46, 149; Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, VIII.5.
    """
    turned = 1.0 if phase is None else 4.0 + phase / 8.0
    return EPSILON * (4.0 + np.sqrt(steps)) * turned, EPSILON * (4.0 + steps) * turned


def _tail(time: Array, error: Array) -> tuple[Array, Array]:
    if not len(time):
        return time, error
    late = time >= time[-1] / TAIL
    return time[late], error[late]


def _slope(time: Array, error: Array) -> float:
    """Of log error over log time; nan for fewer than two points."""
    return float(np.polyfit(np.log(time), np.log(error), 1)[0]) if len(time) > 1 else math.nan


def _exponential(t: Array, e: Array) -> bool:
    if len(t) < FEWEST or not np.max(e) > RANGE * np.min(e) or not _slope(t, e) > STEEP:
        return False
    by_time, by_power = (_distance(x, np.log(e)) for x in (t, np.log(t)))
    return by_time < (1.0 / 3.0 if _slope(t, e) < BOUNDS[-2][0] else 1.0) * by_power


def _distance(x: Array, y: Array) -> float:
    """Mean square distance of points from their line."""
    return float(np.mean((y - np.polyval(np.polyfit(x, y, 1), x)) ** 2))


def _plain(value: float) -> str:
    """Two digits, without an exponent where that is short."""
    return f"{float(f'{value:.1e}'):,.0f}".replace(",", " ") if 10.0 <= value < 1e6 else f"{value:.2g}"


def _crossing(time: Array, error: Array, level: float, i: int) -> float:
    """When an error passed a level, between its points ``i - 1`` and ``i``: as by a power law from one to the other."""
    if i == 0 or not 0.0 < error[i - 1] < level:
        return float(time[i])
    part = math.log(level / error[i - 1]) / math.log(error[i] / error[i - 1])
    return float(time[i - 1] * (time[i] / time[i - 1]) ** part)
