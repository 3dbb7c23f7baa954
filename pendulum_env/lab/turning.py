"""Turning points of a swing: where they are, how surely, and what they lie around."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import FloatArray, RecordingError, gaps_of, series_of
from pendulum_env.lab.noise import noise_level, quantum_level

CLEAR = 5.0
"""Noise levels that a swing must rise above zero to be counted."""
_ARC = 1 / 6  # of a half swing, on either side of a turning point: the arc fitted to find it


class Series(Protocol):
    """What is measured: ``time`` [s], strictly increasing, and ``angle`` [rad], arrays of one length."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...


@dataclass(frozen=True, eq=False)
class TurningPoints:
    """Turning points, one per half swing: ``time`` [s], ``angle`` [rad], standard ``error`` [rad]."""

    time: FloatArray
    angle: FloatArray
    error: FloatArray

    @property
    def amplitude(self) -> FloatArray:
        """|angle| [rad]: the amplitude of each half swing about zero."""
        return np.abs(self.angle)


def extremes(time: FloatArray, angle: FloatArray) -> NDArray[np.intp]:
    """Indices of alternating highest and lowest readings, in order.

    A reversal counts once the angle has moved back by 10 noise levels, so noise and plateaux make none; of
    equal readings the middle one is taken. The first index is the edge the motion starts from (nothing was
    seen to lead up to it); all others are turned through in full view.
    """
    clear = 2 * CLEAR * noise_level(time, angle)
    found: list[int] = []
    high = low = (float(angle[0]), 0, 0)
    direction = 0
    for i, x in enumerate(angle.tolist()):
        high = (x, i, i) if x > high[0] else (x, high[1], i) if x == high[0] else high
        low = (x, i, i) if x < low[0] else (x, low[1], i) if x == low[0] else low
        if direction >= 0 and x < high[0] - clear:
            found.append((high[1] + high[2]) // 2)
            direction, low = -1, (x, i, i)
        elif direction <= 0 and x > low[0] + clear:
            found.append((low[1] + low[2]) // 2)
            direction, high = 1, (x, i, i)
    return np.array(found, dtype=np.intp)


def hidden_in(time: FloatArray, angle: FloatArray, least: float) -> NDArray[np.intp]:
    """Numbers of the readings before a gap of more than ``least`` [s] in which motion is hidden.

    Where no two successive readings are the same, a sensor may have logged its changes alone: it says nothing for long
    around a turning point, and goes on one quantum away. That hides nothing.
    """
    gaps, steps = gaps_of(time, least), np.abs(np.diff(angle))
    return gaps[steps[gaps] > 1.5 * quantum_level(angle)] if len(gaps) and steps.all() else gaps


def turning_points(series: Series) -> TurningPoints:
    """Turning points of ``series``, one per half swing; none in gaps, and where the motion starts or stops.

    Each is the vertex of the arc c + a cos(w s) + b sin(w s) (a parabola to second order; exact for a
    harmonic swing) fitted by least squares to a third of the half swing around the extreme reading, w = pi /
    half swing. The error counts readings on one quantisation level as one. It leaves out the arc's own
    misfit: 2e-4 of an amplitude of 94 degrees, less below.
    """
    points = all_turning_points(series)
    seen = np.isfinite(points.error)
    return TurningPoints(points.time[seen], points.angle[seen], points.error[seen])


def all_turning_points(series: Series) -> TurningPoints:
    """One for each of the ``extremes`` after the first; where a gap takes half its arc, a reading with error inf."""
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
    """Time, angle and standard error of one turning point; the bare reading where no arc can be fitted."""
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
        if abs(turn) > omega * reach:
            break
        gradient = np.array([1.0, math.cos(turn), math.sin(turn)])
        variance = float(gradient @ np.linalg.pinv(basis.T @ basis) @ gradient)
        variance *= len(y) / min(len(y), 2 * len(np.unique(y)))
        centre += turn / omega
        best = (centre, c + sign * math.hypot(a, b), sigma * math.sqrt(variance))
    return best


def equilibrium(points: TurningPoints) -> float:
    """Angle [rad] that the turning points lie around.

    The median over binomial means of up to five successive ones, (x0 + 4 x1 + 6 x2 + 4 x3 + x4) / 16: the
    alternating amplitude cancels, with a decay linear in time (Coulomb) exactly and with a geometric one of
    ratio r per half swing up to (1 - r)^4 / 16 of the amplitude. Means across a turning point that a gap hides are
    left out; where that leaves none, there are means of fewer.

    Raises RecordingError below three turning points that follow one another.
    """
    count, turns = len(points.angle), np.sign(np.diff(points.angle))
    broken = turns[1:] * turns[:-1] >= 0
    for order in range(min(count - 1, 4), 1, -1):
        weights = np.array([math.comb(order, j) for j in range(order + 1)]) / 2.0**order
        whole = np.convolve(broken, np.ones(order - 1), mode="valid") == 0
        if whole.any():
            return float(np.median(np.convolve(points.angle, weights, mode="valid")[whole]))
    raise RecordingError(f"the equilibrium needs at least 3 turning points in a row, the series has {count}")
