"""Turning points of a swing: their times and angles with errors, and the equilibrium angle in their middle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import FloatArray, RecordingError, gaps_of, series_of
from pendulum_env.lab.noise import changes_only, noise_level, quantum_level

CLEAR = 5.0
"""A swing counts if it rises above zero by more than this many noise levels."""
_ARC = 1 / 6  # share of a half swing, on either side of a turning point, that the arc is fitted to


class AngleSeries(Protocol):
    """A swing to measure: ``time`` [s], strictly increasing, and ``angle`` [rad], arrays of one length."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...


class Angles(NamedTuple):
    """Times [s] and angles [rad] of a swing, two arrays of one length."""

    time: FloatArray
    angle: FloatArray


@dataclass(frozen=True, eq=False)
class TurningPoints:
    """Turning points of a swing, one per half swing: arrays ``time`` [s], ``angle`` [rad], standard ``error`` [rad]."""

    time: FloatArray
    angle: FloatArray
    error: FloatArray

    @property
    def amplitude(self) -> FloatArray:
        """Array of the amplitudes of the half swings about zero, |angle| [rad]."""
        return np.abs(self.angle)


def extremes(time: FloatArray, angle: FloatArray) -> NDArray[np.intp]:
    """Return the indices of the alternating highest and lowest readings of a swing, in order.

    A reversal counts only after the angle has moved back by 10 noise levels, so noise and plateaux do not count. Of
    equal readings, the middle one is taken. The first index is where the motion starts: the recording need not show the
    angle rising to it, as it does for all others.
    """
    clear = 2 * CLEAR * noise_level(time, angle)
    indices: list[int] = []
    high = low = (float(angle[0]), 0, 0)
    direction = 0
    for i, x in enumerate(angle.tolist()):
        high = (x, i, i) if x > high[0] else (x, high[1], i) if x == high[0] else high
        low = (x, i, i) if x < low[0] else (x, low[1], i) if x == low[0] else low
        if direction >= 0 and x < high[0] - clear:
            indices.append((high[1] + high[2]) // 2)
            direction, low = -1, (x, i, i)
        elif direction <= 0 and x > low[0] + clear:
            indices.append((low[1] + low[2]) // 2)
            direction, high = 1, (x, i, i)
    return np.array(indices, dtype=np.intp)


def hidden_in(time: FloatArray, angle: FloatArray, least: float = 0.0) -> NDArray[np.intp]:
    """Return the indices of the readings before a gap longer than ``least`` [s] that hides motion.

    An encoder that writes a row whenever its count changes is silent around a turning point and continues at most one
    count away. Such a gap hides no motion and is left out.
    """
    gaps = gaps_of(time, least)
    if not len(gaps) or not changes_only(angle).any():
        return gaps
    return gaps[np.abs(np.diff(angle))[gaps] > 1.5 * quantum_level(angle)]


def turning_points(series: AngleSeries) -> TurningPoints:
    """Return the turning points of ``series``, one per half swing.

    Points in gaps, and where the motion starts or stops, are left out. A turning point is the vertex of the arc
    c + a cos(w s) + b sin(w s) (a parabola to second order; exact for a harmonic swing), with w = pi / half swing,
    fitted by least squares to a third of the half swing around the extreme reading. For the error, readings on one
    quantisation level count as one. The error does not include the misfit of the arc: 2e-4 of the amplitude at
    94 degrees, less at smaller amplitudes.
    """
    points = all_turning_points(series)
    seen = np.isfinite(points.error)
    return TurningPoints(points.time[seen], points.angle[seen], points.error[seen])


def all_turning_points(series: AngleSeries) -> TurningPoints:
    """Return a turning point for every extreme reading of a swing, see :func:`extremes`, but the first.

    If a gap covers part of the arc around a turning point, the result is the bare reading with an infinite error.
    """
    time, angle = series_of(series)
    index = extremes(time, angle)
    sigma, step = noise_level(time, angle), float(np.median(np.diff(time)))
    half = np.diff(time[index])
    gaps = hidden_in(time, angle, _ARC * float(np.median(half)) if len(half) else 0.0)
    hidden = np.array([bool(((gaps >= a) & (gaps < b)).any()) for a, b in pairwise(index.tolist())], dtype=bool)
    if not hidden.all():
        half[hidden] = np.median(half[~hidden])
    rows = []
    for k in range(1, len(index)):
        swing = float(half[min(k, len(half) - 1)])
        reach = max(_ARC * float(half[k - 1 : k + 1].min()), 2.5 * step)
        at = int(index[k])
        if ((time[gaps] < time[at] + reach) & (time[gaps + 1] > time[at] - reach)).any():
            rows.append((float(time[at]), float(angle[at]), math.inf))
            continue
        sign = 1.0 if angle[at] > angle[index[k - 1]] else -1.0
        rows.append(_vertex(time, angle, at, sign, swing, reach, sigma))
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    return TurningPoints(table[:, 0], table[:, 1], table[:, 2])


def _vertex(
    time: FloatArray, angle: FloatArray, at: int, sign: float, swing: float, reach: float, sigma: float
) -> tuple[float, float, float]:
    """Return time, angle and standard error of one turning point; the bare reading if no arc can be fitted."""
    centre, best = float(time[at]), (float(time[at]), float(angle[at]), sigma)
    omega = math.pi / swing
    for _ in range(2):
        near = slice(*np.searchsorted(time, (centre - reach, centre + reach)).tolist())
        phase, y = omega * (time[near] - centre), angle[near]
        if len(y) < 4:
            break
        basis = np.stack([np.ones_like(phase), np.cos(phase), np.sin(phase)], axis=1)
        c, a, b = np.linalg.lstsq(basis, y, rcond=None)[0].tolist()
        turn = math.atan2(sign * b, sign * a)
        value = c + sign * math.hypot(a, b)
        beyond = float(np.ptp(y)) + CLEAR * sigma  # four readings beside a bad one can be on an arc of any height
        if abs(turn) > omega * reach or not y.min() - beyond <= value <= y.max() + beyond:
            break
        gradient = np.array([1.0, math.cos(turn), math.sin(turn)])
        variance = float(gradient @ np.linalg.pinv(basis.T @ basis) @ gradient)
        variance *= len(y) / min(len(y), 2 * len(np.unique(y)))
        centre += turn / omega
        best = (centre, value, sigma * math.sqrt(variance))
    return best


def equilibrium(points: TurningPoints) -> float:
    """Return the equilibrium angle [rad] of a swing, the middle of its turning points.

    It is the median of the binomial means (x0 + 4 x1 + 6 x2 + 4 x3 + x4) / 16 of five successive turning points. The
    alternating amplitude cancels in these means: exactly if it decays linearly in time (Coulomb friction), and to
    (1 - r)^4 / 16 of the amplitude if it decays by a ratio r per half swing. Means across a turning point that is
    hidden in a gap are left out; if none remain, means of four or three points are used.

    Raises RecordingError if there are no three turning points in a row.
    """
    count, turns = len(points.angle), np.sign(np.diff(points.angle))
    broken = turns[1:] * turns[:-1] >= 0
    for order in range(min(count - 1, 4), 1, -1):
        weights = np.array([math.comb(order, j) for j in range(order + 1)]) / 2.0**order
        unbroken = np.convolve(broken, np.ones(order - 1), mode="valid") == 0
        if unbroken.any():
            return float(np.median(np.convolve(points.angle, weights, mode="valid")[unbroken]))
    raise RecordingError(f"the equilibrium needs at least 3 turning points in a row, the series has {count}")
