"""Which settings are measured, and which of them is the cheapest for an accuracy: no package enters here."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

AIM = 0.8
"""Part of the accuracy at which refined settings aim."""
STALLED = 3
"""A ladder ends after so many rungs that bring nothing more: rounding rules."""
LARGE = 0.1
"""Above such errors [rad] a ladder has not begun to converge."""


class Point(NamedTuple):
    """One line at one setting: a tolerance, or steps from record to record. Error [rad], time of the whole [s]."""

    line: str
    setting: float
    error: float
    time: float


Measure = Callable[[float], "Point | None"]
"""From a setting to what it gives, or None where that takes too long."""


def tolerances(smallest: float) -> list[float]:
    """1e-1, 1e-2, ... as far as a package takes them."""
    return [*(float(f"1e-{k}") for k in range(1, math.ceil(-math.log10(smallest) - 1e-9))), smallest]


def step_counts(gap: float, longest: float, shortest: float = 1e-7, factor: float = 1.4) -> list[int]:
    """Steps from record to record, ``gap`` [s] apart: of ``longest`` [s], then ever shorter by about ``factor``."""
    first = max(1.0, gap / longest)
    count = math.ceil(math.log(max(1.0, gap / shortest / first), factor))
    return sorted({math.ceil(first * factor**k - 1e-9) for k in range(count + 1)})


def climb(measure: Measure, rungs: Iterable[float], target: float) -> list[Point]:
    """Points from coarse to fine, until ``target`` is reached, a rung takes too long or brings nothing more."""
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
    """A setting between the last rung that misses an accuracy and the next, by log-log interpolation; else None."""
    ordered = sorted((p for p in points if p.error > 0.0), key=lambda p: p.setting, reverse=not whole)
    for coarse, fine in pairwise(ordered):
        if coarse.error > accuracy >= fine.error and math.isfinite(coarse.error):
            share = math.log(coarse.error / (AIM * accuracy)) / math.log(coarse.error / fine.error)
            if not 0.0 < share < 1.0:
                return None
            found = coarse.setting * (fine.setting / coarse.setting) ** share
            found = float(math.ceil(found - 1e-9)) if whole else float(f"{found:.2g}")
            return None if found in (coarse.setting, fine.setting) else found
    return None


def refine(points: list[Point], measure: Measure, accuracies: Iterable[float], whole: bool) -> list[Point]:
    """The points, and for each accuracy one more that reaches it by less, where there is room."""
    found = list(points)
    for accuracy in accuracies:
        setting = between(found, accuracy, whole)
        point = None if setting is None else measure(setting)
        found += [] if point is None else [point]
    return found


def cheapest(points: Iterable[Point], accuracy: float) -> Point | None:
    """The quickest of those that reach an accuracy; None if none does."""
    good = [point for point in points if point.error <= accuracy]
    return min(good, key=lambda point: point.time, default=None)


def contested(
    points: Sequence[Point], rivals: Sequence[Point], accuracies: Iterable[float], within: float
) -> list[float]:
    """The accuracies at which a line takes at most ``within`` times the quickest of its rivals."""
    pairs = ((a, cheapest(points, a), cheapest(rivals, a)) for a in accuracies)
    return [a for a, own, other in pairs if own and (other is None or own.time <= within * other.time)]


def chosen(points: Sequence[Point], accuracies: Iterable[float], within: float = math.inf) -> list[Point]:
    """For each accuracy the cheapest point of each line that takes at most ``within`` times the quickest's."""
    found: dict[Point, None] = {}
    lines = dict.fromkeys(point.line for point in points)
    for accuracy in accuracies:
        each = [best for line in lines if (best := cheapest((p for p in points if p.line == line), accuracy))]
        quickest = min((point.time for point in each), default=math.inf)
        found |= dict.fromkeys(point for point in each if point.time <= within * quickest)
    return list(found)
