"""Period, amplitudes and decay of a free swing, each with its uncertainty.

Every function takes anything that has ``time`` [s] and ``angle`` [rad] as arrays: a recording or a rollout.
Angles are about the equilibrium, so a recording is cut and centred first: ``recording.released().centred()``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pendulum_env.physics import exact
from pendulum_env.physics.units import SceneError, number, shown

from .checked import FloatArray, RecordingError, count, numbers, readings, series_of
from .noise import noise_level as noise_level

_CLEAR = 5.0  # noise levels that a swing must rise above zero to be counted
_ARC = 1 / 6  # of a half swing, on either side of a turning point: the arc fitted to find it


class Series(Protocol):
    """What is measured: ``time`` [s], strictly increasing, and ``angle`` [rad], arrays of one length."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def angle(self) -> FloatArray: ...


@dataclass(frozen=True)
class Measurement:
    """A value with its standard error, both in ``unit``."""

    value: float
    error: float
    unit: str

    def __truediv__(self, factor: float) -> Measurement:
        return Measurement(self.value / factor, self.error / abs(factor), self.unit)

    def __str__(self) -> str:
        size = self.error if 0 < self.error < math.inf else abs(self.value) * 1e-6
        digits = max(0, 1 - math.floor(math.log10(size))) if size > 0 else 1
        return f"{self.value:.{digits}f} ± {self.error:.{digits}f} {self.unit}"


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
    clear = 2 * _CLEAR * noise_level(time, angle)
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


def turning_points(series: Series) -> TurningPoints:
    """Turning points of ``series``, one per half swing; none where the motion starts or stops in the record.

    Each is the vertex of the arc c + a cos(w s) + b sin(w s) (a parabola to second order; exact for a
    harmonic swing) fitted by least squares to a third of the half swing around the extreme reading, w = pi /
    half swing. The error counts readings on one quantisation level as one. It leaves out the arc's own
    misfit: 2e-4 of an amplitude of 94 degrees, less below.
    """
    time, angle = series_of(series)
    index = extremes(time, angle)
    sigma, step = noise_level(time, angle), float(np.median(np.diff(time)))
    half = np.diff(time[index])
    rows = []
    for k in range(1, len(index)):
        swing = float(half[min(k, len(half) - 1)])
        reach = max(_ARC * float(half[k - 1 : k + 1].min()), 2.5 * step)
        sign = 1.0 if angle[index[k]] > angle[index[k - 1]] else -1.0
        rows.append(_vertex(time, angle, int(index[k]), sign, swing, reach, sigma))
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
    ratio r per half swing up to (1 - r)^4 / 16 of the amplitude.

    Raises RecordingError below three turning points.
    """
    count = len(points.angle)
    if count < 3:
        raise RecordingError(f"the equilibrium needs at least 3 turning points, the series has {count}")
    order = min(count - 1, 4)
    weights = np.array([math.comb(order, j) for j in range(order + 1)]) / 2.0**order
    return float(np.median(np.convolve(points.angle, weights, mode="valid")))


def crossings(time: ArrayLike, angle: ArrayLike, *, level: float = 0.0) -> FloatArray:
    """Times [s] of the upward zero crossings, interpolated.

    A crossing leads from below ``-level`` to above ``+level`` [rad] (0: every change of sign); its time is
    the zero of the line through all readings on the way (two readings: linear interpolation).

    Raises RecordingError for what are no readings, and a level below 0.
    """
    try:
        beyond = number(level, "level", least=0.0, unit="rad")
    except SceneError as error:
        raise RecordingError(str(error)) from None
    return _crossings(*readings(time, angle), beyond)[0]


def _crossings(time: FloatArray, angle: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    """Times [s] of the upward crossings and their standard errors [s] per rad of noise."""
    side = np.where(angle > level, 1, np.where(angle < -level, -1, 0))
    decided = np.flatnonzero(side)
    up = np.flatnonzero((side[decided[:-1]] < 0) & (side[decided[1:]] > 0))
    times, errors = np.empty(len(up)), np.empty(len(up))
    for k, (first, last) in enumerate(zip(decided[up], decided[up + 1], strict=True)):
        t, y = time[first : last + 1], angle[first : last + 1]
        middle, mean = float(t.mean()), float(y.mean())
        spread = float((t - middle) @ (t - middle))
        slope = float((t - middle) @ (y - mean)) / spread
        times[k] = middle - mean / slope
        errors[k] = math.sqrt(1 / len(y) + (mean / slope) ** 2 / spread) / slope
    return times, errors


def period(series: Series, n: int | None = None) -> Measurement:
    """Period [s]: the mean of the first ``n`` oscillations (None: all), between upward zero crossings.

    T = (t_n - t_0) / n, error sqrt(s_0² + s_n²) / n. s_k, the error of a crossing time, is that of the noise of the
    readings it was interpolated from, and for all larger by one factor where the second differences of the crossing
    times (to which a period that drifts with the amplitude adds nothing) scatter by more.

    Raises RecordingError if the series has fewer than n (at least one) oscillations.
    """
    n, (time, angle) = count(n, "oscillations"), series_of(series)
    sigma = noise_level(time, angle)
    times, errors = _crossings(time, angle, _CLEAR * sigma)
    found = max(len(times) - 1, 0)
    taken = found if n is None else n
    if taken < 1 or taken > found:
        needed = f"{shown(max(taken, 1))} full oscillations about zero"
        raise RecordingError(f"the period needs {needed}, the series has {found} (is it centred?)")
    second = np.diff(times, 2)
    own = np.maximum(sigma * errors, 1e-12 * np.abs(times[-1]))
    variance = own[:-2] ** 2 + 4.0 * own[1:-1] ** 2 + own[2:] ** 2
    scatter = math.sqrt(float(np.mean(second**2 / variance))) if len(second) else 0.0
    error = max(1.0, scatter) * math.hypot(own[0], own[taken])
    return Measurement(float(times[taken] - times[0]) / taken, error / taken, "s")


def decay_rate(series: Series, n: int | None = None) -> Measurement:
    """Damping rate gamma [1/s] of theta ~ exp(-gamma t / 2), from the first ``n`` amplitudes (None: all).

    The logarithmic decrement: -2 times the slope of ln(amplitude) over time, weighted by (amplitude /
    error)². Where the amplitudes scatter by more than their errors, or do not decay exponentially, the error
    grows by sqrt(chi² / degrees of freedom).

    Raises RecordingError below three amplitudes.
    """
    n, points = count(n, "amplitudes"), turning_points(series)
    time, size, error = points.time[:n], points.amplitude[:n], points.error[:n]
    if len(time) < 3:
        raise RecordingError(f"the decay rate needs at least 3 amplitudes, the series gives {len(time)}")
    weight = (size / np.maximum(error, 1e-12 * size)) ** 2
    log = np.log(size)
    t = time - np.average(time, weights=weight)
    y = log - np.average(log, weights=weight)
    spread = float(weight @ (t * t))
    slope = float(weight @ (t * y)) / spread
    chi2 = float(weight @ (y - slope * t) ** 2)
    inflate = max(1.0, math.sqrt(chi2 / (len(time) - 2)))
    return Measurement(-2 * slope, 2 * inflate / math.sqrt(spread), "1/s")


P = TypeVar("P", float, Measurement)


def small_amplitude_period(period: P, amplitude: ArrayLike) -> P:
    """T0 = T / mean(2 K(sin(A/2)) / pi): the period [s] that the swing would have at small amplitude.

    ``amplitude`` [rad] is one A, or those of all half swings that the period was averaged over; below pi. K
    is the complete elliptic integral of the first kind (Nelson & Olsson, Am. J. Phys. 54, 112, 1986).

    Raises RecordingError if an amplitude is negative, not finite, or not below pi.
    """
    if not isinstance(period, Measurement):
        try:
            period = number(period, "period", above=0.0, unit="s")
        except SceneError as error:
            raise RecordingError(str(error)) from None
    angle = numbers(amplitude, "amplitude")
    if angle.size == 0 or not bool(np.all((angle >= 0) & (angle < math.pi))):
        raise RecordingError(f"amplitude must be between 0 and pi [rad], got {shown(amplitude)}")
    return period / float(np.mean(exact.period(angle, 2.0 * math.pi)))
