"""Select the points of a curve to draw: a span of time, the turning points, or the largest value in each half swing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

FloatArray = NDArray[np.float64]
Span = tuple[float, float]

DENSE = 15.0
"""Figures of more periods than this draw thin lines, and have further axes for the first and the last swings."""
CROWDED = 150.0
"""Figures of more periods than this show bands between turning points, as single swings would not be visible."""
TURNS = 30
"""Largest number of periods in a phase portrait."""
PEAKS = 120
"""Largest number of points of an upper envelope."""


class ExactMotion(Protocol):
    """An exact motion: time [s], angle [rad], velocity [rad/s], arrays of one length; nan where it is not known."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...
    @property
    def velocity(self) -> FloatArray: ...


class ShownRecord(Protocol):
    """A recording to draw: ``time`` [s], ``angle`` [rad], and ``source``, its name in the legend."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...
    @property
    def source(self) -> str: ...


def check(runs: Mapping[str, Rollout]) -> None:
    """Check that ``runs`` is a dict of single runs by their labels; ValueError for batches and anything else."""
    if not isinstance(runs, Mapping) or not runs:
        given = "an empty one" if isinstance(runs, Mapping) else type(runs).__name__
        raise ValueError(f"runs must be a dict of one or more runs, such as {{'rk4': run}}, not {given}")
    for label, run in runs.items():
        if np.ndim(run.angle) != 1:
            raise ValueError(f"runs must be single runs, but {label!r} is a batch of shape {np.shape(run.angle)}")


def whole(runs: Mapping[str, Rollout]) -> Span:
    """Return the span of time from 0 to the end of the longest run, or over one step if all end at once [s]."""
    return 0.0, max(float(run.time[-1]) for run in runs.values()) or max(run.dt for run in runs.values())


def within(time: FloatArray, span: Span) -> slice:
    """Return the slice of the samples in a span of time, with one more on either side, so that curves reach the edges.
    """
    if not len(time) or time[-1] < span[0]:
        return slice(0, 0)
    first, last = int(np.searchsorted(time, span[0])), int(np.searchsorted(time, span[1], side="right"))
    return slice(max(0, first - 1), last + 1)


def swing(runs: Mapping[str, Rollout]) -> float:
    """Return the period of small swings of the first run's scene [s]; inf if its bob has no restoring force."""
    omega0 = next(iter(runs.values())).scene.omega0
    return 2.0 * math.pi / omega0 if omega0 else math.inf


def dense(runs: Mapping[str, Rollout], span: Span) -> bool:
    """Return True if a span of time contains so many swings that they need thin lines."""
    return span[1] - span[0] > DENSE * swing(runs)


def crowded(runs: Mapping[str, Rollout], span: Span) -> bool:
    """Return True if a span of time contains too many swings to draw them one by one."""
    return span[1] - span[0] > CROWDED * swing(runs)


def swings(values: FloatArray) -> bool:
    """Return True if all maxima of a curve lie above all minima, so that their envelopes describe the curve."""
    highs, lows = _extremes(values)
    return not len(highs) or not len(lows) or bool(np.min(values[highs]) >= np.max(values[lows]))


def turning(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the curve through the maxima of a curve and then, after a gap (nan), the curve through its minima.

    A curve with hardly any extremes, or with an extreme at nearly every sample, is returned unchanged.
    """
    highs, lows = _extremes(values)
    if len(highs) + len(lows) < 4 or len(highs) + len(lows) > 0.7 * len(values):
        return time, values
    return joined((time[highs], time[lows])), joined((values[highs], values[lows]))


def _extremes(values: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices of the maxima of a curve, and those of its minima."""
    slope = np.sign(np.diff(values))
    turns = 1 + np.flatnonzero((slope[:-1] != slope[1:]) & (slope[:-1] != 0.0))
    return turns[values[turns] >= values[turns - 1]], turns[values[turns] < values[turns - 1]]


def peaks(time: FloatArray, values: FloatArray, velocity: FloatArray, half: float) -> tuple[FloatArray, FloatArray]:
    """Return the largest value in each half swing, from turning point to turning point, with the time of its middle.

    So a curve that rises and falls with every swing gets its upper envelope, however long its swings take. ``half`` is
    half the period of small swings [s]; where the bob does not turn round for longer than four of them, windows of this
    length take the place of half swings. Neighbouring windows are joined until there are at most 120 (PEAKS).
    """
    if len(time) < 2 or not math.isfinite(half):
        return time, values
    size = max(1, round(half / float(time[1] - time[0])))
    turns = 1 + np.flatnonzero(np.signbit(velocity[1:]) != np.signbit(velocity[:-1]))
    turns = turns[np.diff(turns, prepend=0) > size // 2]
    even, edges = np.arange(size, len(time), size), np.concatenate(([0], turns, [len(time)]))
    after = np.searchsorted(edges, even, side="right")
    even = even[edges[after] - edges[after - 1] > 4 * size]
    starts = np.unique(np.concatenate((edges[:-1], even)))
    starts = starts[: max(1, len(starts) - 1)]  # the rest of the run belongs to the last whole window
    starts = starts[:: -(-len(starts) // PEAKS)]
    middles = (starts + np.append(starts[1:], len(time))) // 2
    return time[middles], np.fmax.reduceat(values, starts)


def periods(velocity: FloatArray, parts: Sequence[slice]) -> tuple[int, list[slice]]:
    """Return n, and the slices of every n-th period in ``parts`` of a motion, so that there are at most 30 (TURNS).

    A period is the time between two turning points on the side of positive angles. A motion with fewer of them stays
    whole, and n is 1.
    """
    turns = 1 + np.flatnonzero(np.signbit(velocity[1:]) & ~np.signbit(velocity[:-1]))
    inside = [[part.start, *turns[(turns > part.start + 1) & (turns < part.stop)].tolist(), part.stop]
              for part in parts]
    gap = -(-sum(len(edges) - 1 for edges in inside) // TURNS)
    if gap <= 1:
        return 1, list(parts)
    return gap, [slice(first, last + 1) for edges in inside
                 for first, last in list(pairwise(edges))[::gap]]


def joined(pieces: Iterable[FloatArray]) -> FloatArray:
    """Join pieces of a curve into one array, with nan between the pieces, so that the drawn curve has gaps there."""
    parts = [part for piece in pieces for part in (piece, np.array([math.nan]))]
    return np.concatenate(parts[:-1]) if parts else np.empty(0)


def bounds(values: FloatArray) -> Span:
    """Return the smallest and the largest finite value of an array, with 0 included in the range."""
    finite = values[np.isfinite(values)]
    return float(np.min(finite, initial=0.0)), float(np.max(finite, initial=0.0))
