"""Choice of the settings to measure, and of the cheapest one for an accuracy, independent of any package."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

AIM = 0.8
"""Target error of refined settings, as a fraction of the accuracy."""
STALLED = 3
"""Number of settings without improvement after which a series ends, because rounding dominates."""
LARGE = 0.1
"""Error [rad] above which a series of settings does not converge yet."""


class Point(NamedTuple):
    """Measured point of a solver at one setting, a tolerance or the number of steps between records.

    ``error`` is the largest angle error [rad], ``time`` the time of the complete run [s].
    """

    line: str
    setting: float
    error: float
    time: float


Measure = Callable[[float], "Point | None"]
"""Function that measures one setting; it returns None if the run would take too long."""


def tolerances(smallest: float) -> list[float]:
    """Return the tolerances 1e-1, 1e-2, ... down to the smallest one that a package accepts."""
    return [*(float(f"1e-{k}") for k in range(1, math.ceil(-math.log10(smallest) - 1e-9))), smallest]


def step_counts(gap: float, longest: float, shortest: float = 1e-7, factor: float = 1.4) -> list[int]:
    """Return numbers of steps between records ``gap`` [s] apart, for steps from ``longest`` to ``shortest`` [s].

    Successive steps differ by about ``factor``.
    """
    first = max(1.0, gap / longest)
    count = math.ceil(math.log(max(1.0, gap / shortest / first), factor))
    return sorted({math.ceil(first * factor**k - 1e-9) for k in range(count + 1)})


def climb(measure: Measure, rungs: Iterable[float], target: float) -> list[Point]:
    """Measure settings from coarse to fine until ``target`` is reached, a run takes too long or nothing improves."""
    points: list[Point] = []
    best, stalled = math.inf, 0
    for setting in rungs:
        point = measure(setting)
        if point is None:
            break
        points.append(point)
        if point.error <= target:
            break
        stalled = stalled + 1 if best < LARGE and point.error > 0.9 * best else 0
        best = min(best, point.error)
        if stalled == STALLED:
            break
    return points


def between(points: Sequence[Point], accuracy: float, whole: bool) -> float | None:
    """Return a setting between the last one that misses an accuracy and the next, by log-log interpolation, or None.

    ``whole`` is True for numbers of steps, False for tolerances.
    """
    ordered = sorted((p for p in points if p.error > 0.0), key=lambda p: p.setting, reverse=not whole)
    for coarse, fine in pairwise(ordered):
        if coarse.error > accuracy >= fine.error and math.isfinite(coarse.error):
            share = math.log(coarse.error / (AIM * accuracy)) / math.log(coarse.error / fine.error)
            if not 0.0 < share < 1.0:
                return None
            setting = coarse.setting * (fine.setting / coarse.setting) ** share
            setting = float(math.ceil(setting - 1e-9)) if whole else float(f"{setting:.2g}")
            return None if setting in (coarse.setting, fine.setting) else setting
    return None


def refine(points: list[Point], measure: Measure, accuracies: Iterable[float], whole: bool) -> list[Point]:
    """Return the points with one more for each accuracy, which reaches it with a smaller margin, if possible."""
    refined = list(points)
    for accuracy in accuracies:
        setting = between(refined, accuracy, whole)
        point = None if setting is None else measure(setting)
        refined += [] if point is None else [point]
    return refined


def cheapest(points: Iterable[Point], accuracy: float) -> Point | None:
    """Return the fastest point that reaches an accuracy; None if none does."""
    good = [point for point in points if point.error <= accuracy]
    return min(good, key=lambda point: point.time, default=None)


def contested(
    points: Sequence[Point], rivals: Sequence[Point], accuracies: Iterable[float], within: float
) -> list[float]:
    """Return the accuracies at which a line takes at most ``within`` times as long as its fastest rival."""
    pairs = ((a, cheapest(points, a), cheapest(rivals, a)) for a in accuracies)
    return [a for a, own, other in pairs if own and (other is None or own.time <= within * other.time)]


def chosen(points: Sequence[Point], accuracies: Iterable[float], within: float = math.inf) -> list[Point]:
    """Return, for each accuracy, the fastest point of each line, up to ``within`` times the time of the best line."""
    points_chosen: dict[Point, None] = {}
    lines = dict.fromkeys(point.line for point in points)
    for accuracy in accuracies:
        each = [best for line in lines if (best := cheapest((p for p in points if p.line == line), accuracy))]
        quickest = min((point.time for point in each), default=math.inf)
        points_chosen |= dict.fromkeys(point for point in each if point.time <= within * quickest)
    return list(points_chosen)
