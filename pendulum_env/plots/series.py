"""What of a curve is drawn: the part within a span of time, its turning points, the largest value in each swing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

FloatArray = NDArray[np.float64]
Span = tuple[float, float]

DENSE = 15.0
"""Over more periods than this single swings can't be told apart: curves are drawn through their turning points."""


class Motion(Protocol):
    """An exact motion: time [s], angle [rad], velocity [rad/s], arrays of one length; nan where it is not known."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...
    @property
    def velocity(self) -> FloatArray: ...


class Record(Protocol):
    """A recording: time [s], angle [rad], and where it came from."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...
    @property
    def source(self) -> str: ...


def check(runs: Mapping[str, Rollout]) -> None:
    """ValueError for anything that figures cannot draw."""
    if not isinstance(runs, Mapping) or not runs:
        given = "an empty one" if isinstance(runs, Mapping) else type(runs).__name__
        raise ValueError(f"runs must be a dict of one or more runs by their labels, as {{'rk4': run}}, not {given}")
    for label, run in runs.items():
        if np.ndim(run.angle) != 1:
            raise ValueError(f"figures draw single runs, and {label!r} is a batch of shape {np.shape(run.angle)}")


def whole(runs: Mapping[str, Rollout]) -> Span:
    """From zero to the end of the longest run [s]."""
    return 0.0, max(float(run.time[-1]) for run in runs.values())


def within(time: FloatArray, span: Span) -> slice:
    """The samples in a span of time, and one on either side so that curves reach the edges."""
    if not len(time) or time[-1] < span[0]:
        return slice(0, 0)
    first, last = int(np.searchsorted(time, span[0])), int(np.searchsorted(time, span[1], side="right"))
    return slice(max(0, first - 1), last + 1)


def swing(runs: Mapping[str, Rollout]) -> float:
    """Small-amplitude period of the scene [s]."""
    omega0 = next(iter(runs.values())).scene.omega0
    return 2.0 * math.pi / omega0 if omega0 else math.inf


def dense(runs: Mapping[str, Rollout], span: Span) -> bool:
    """True if a span holds too many swings to draw each."""
    return span[1] - span[0] > DENSE * swing(runs)


def swings(values: FloatArray) -> bool:
    """True if all highs of a curve lie above all lows, so that it goes to and fro between the curves through them."""
    highs, lows = _extremes(values)
    return not len(highs) or not len(lows) or bool(np.min(values[highs]) >= np.max(values[lows]))


def turning(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The curve through its highs and then, after a gap, through its lows; the curve itself if it has hardly any."""
    highs, lows = _extremes(values)
    if len(highs) + len(lows) < 4 or len(highs) + len(lows) > 0.7 * len(values):
        return time, values
    return joined((time[highs], time[lows])), joined((values[highs], values[lows]))


def _extremes(values: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Places of the highs and of the lows."""
    slope = np.sign(np.diff(values))
    inner = 1 + np.flatnonzero((slope[:-1] != slope[1:]) & (slope[:-1] != 0.0))
    return inner[values[inner] >= values[inner - 1]], inner[values[inner] < values[inner - 1]]


def largest(time: FloatArray, values: FloatArray, window: float) -> tuple[FloatArray, FloatArray]:
    """The largest value in each window of time, at its middle; a rest of less than half goes to the last one."""
    if len(time) < 2 or not math.isfinite(window):
        return time, values
    size = max(1, round(window / float(time[1] - time[0])))
    starts = np.arange(0, len(time) - size // 2, size) if len(time) > size else np.array([0])
    return time[np.minimum(starts + size // 2, len(time) - 1)], np.fmax.reduceat(values, starts)


def joined(pieces: Iterable[FloatArray]) -> FloatArray:
    """Pieces of a curve with gaps between them."""
    parts = [part for piece in pieces for part in (piece, np.array([math.nan]))]
    return np.concatenate(parts[:-1]) if parts else np.empty(0)


def bounds(values: FloatArray) -> Span:
    """Smallest and largest finite value, and zero."""
    finite = values[np.isfinite(values)]
    return float(np.min(finite, initial=0.0)), float(np.max(finite, initial=0.0))
