"""Period and decay rate of a free swing, with uncertainties.

Every function takes an object with the arrays ``time`` [s] and ``angle`` [rad], such as a recording or a rollout.
Angles are measured from the equilibrium, so cut and centre a recording first: ``recording.released().centred()``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pendulum_env.lab.checked import FloatArray, RecordingError, count, numbers, one_number, readings, series_of
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.turning import CLEAR, AngleSeries, TurningPoints, hidden_in, turning_points
from pendulum_env.physics import exact
from pendulum_env.physics.units import BENCH, shown

_UNCLEAR = 0.25  # the number of oscillations estimated for a gap may differ from a whole number by less than this
_SHORT = 1 / 16  # of an oscillation: shorter gaps are interpolated, as they cannot hide an oscillation
_NEAREST = 4  # number of oscillations near a gap that give the period for counting those inside it
UNLIKELY = 0.2
"""Relative difference of a measured g from the expected one from which a length or a time base must be wrong."""
FINEST = 1e-12
"""Least error of a crossing, as a share of its time, for readings without noise."""


@dataclass(frozen=True)
class Measurement:
    """A measured value with its standard error, both in ``unit``."""

    value: float
    error: float
    unit: str

    def __truediv__(self, factor: float) -> Measurement:
        return Measurement(self.value / factor, self.error / abs(factor), self.unit)

    def __str__(self) -> str:
        size = self.error if 0 < self.error < math.inf else abs(self.value) * 1e-6
        digits = max(0, 1 - math.floor(math.log10(size))) if 0 < size < math.inf else 1
        return f"{self.value:.{digits}f} ± {self.error:.{digits}f} {self.unit}"


def bounded_text(one: Measurement, freedom: float) -> str:
    """Return the text of a quantity that cannot be negative and whose best value is 0, at this bound.

    With 95 % it is below ``t error``, with Student's one-sided quantile t for the degrees of freedom.
    """
    limit = upper_limit(one, freedom)
    return f"0 (at its bound), below {limit:.2g}{' ' * bool(one.unit)}{one.unit} with 95 %"


def upper_limit(one: Measurement, freedom: float) -> float:
    """Return the value below which a quantity is with 95 %, from its error and the degrees of freedom."""
    from scipy.special import stdtrit

    return one.value + float(stdtrit(freedom, 0.95)) * one.error


def crossings(time: ArrayLike, angle: ArrayLike, *, level: float = 0.0) -> FloatArray:
    """Return the times [s] of the upward zero crossings of an angle, an interpolated array.

    A crossing goes from below ``-level`` to above ``+level`` [rad] (0: every change of sign). Its time is the zero of
    the straight line fitted to all readings from the one to the other; for two readings, linear interpolation.

    Raises RecordingError unless time and angle are finite arrays of one length, and for a level below 0.
    """
    beyond = one_number(level, "level", least=0.0, unit="rad")
    return crossings_with_errors(*readings(time, angle), beyond)[0]


def crossings_with_errors(time: FloatArray, angle: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    """Return the times [s] of the upward zero crossings of an angle, and their errors [s] per rad of reading noise."""
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


def period(series: AngleSeries, n: int | None = None) -> Measurement:
    """Return the period [s], the mean of the first ``n`` oscillations (None: all) between upward zero crossings.

    T = (t_n - t_0) / n, with the error sqrt(s_0² + s_n²) / n. The error s_k of a crossing time follows from the noise
    of the readings that were interpolated. If the second differences of the crossing times scatter more than these
    errors allow, one common factor enlarges all of them; a period that drifts steadily with the amplitude adds nothing
    to second differences.

    Oscillations in a gap are counted with the period of the nearest complete ones. If oscillation n ends in a gap, the
    mean runs to the first crossing after the gap.

    Raises RecordingError if the series has fewer than n (at least one) oscillations, or if the number of oscillations
    in a gap is not clear.
    """
    n, (time, angle) = count(n, "oscillations"), series_of(series)
    sigma = noise_level(time, angle)
    times, errors = crossings_with_errors(time, angle, CLEAR * sigma)
    gaps = hidden_in(time, angle, _SHORT * float(np.median(np.diff(times))) if len(times) > 1 else 0.0)
    seen = ~((times[:, None] > time[gaps]) & (times[:, None] < time[gaps + 1])).any(axis=1)
    times, errors = times[seen], errors[seen]
    cycles = _cycles(times, time[gaps], n)
    available = int(cycles[-1]) if len(times) > 1 else 0
    taken = available if n is None else n
    if taken < 1 or taken > available:
        needed = f"{shown(max(taken, 1))} full oscillations about zero"
        raise RecordingError(f"the period needs {needed}, the series has {available} (is it centred?)")
    last = int(np.searchsorted(cycles, taken))
    taken = int(cycles[last])
    second = np.diff(times, 2)[np.diff(cycles, 2) == 0]
    own = np.maximum(sigma * errors, FINEST * np.abs(times[-1]))
    variance = (own[:-2] ** 2 + 4.0 * own[1:-1] ** 2 + own[2:] ** 2)[np.diff(cycles, 2) == 0]
    scatter = math.sqrt(float(np.mean(second**2 / variance))) if len(second) else 0.0
    error = max(1.0, scatter) * math.hypot(own[0], own[last])
    return Measurement(float(times[last] - times[0]) / taken, error / taken, "s")


def _cycles(times: FloatArray, gaps: FloatArray, n: int | None) -> NDArray[np.intp]:
    """Return, for every upward zero crossing, the number of oscillations since the first one, whole numbers.

    Successive crossings are one oscillation apart. Across a gap, the median of the nearest periods gives the number.

    Raises RecordingError if that number is not clear for a gap within the first n oscillations.
    """
    steps, count = np.diff(times), np.ones(max(len(times) - 1, 0))
    across = np.searchsorted(gaps, times[1:]) > np.searchsorted(gaps, times[:-1])
    for k in np.flatnonzero(across).tolist():
        if n is not None and np.round(count[:k]).sum() >= n:
            break
        near = np.flatnonzero(~across)
        near = near[np.argsort(np.abs(near - k), kind="stable")[:_NEAREST]]
        count[k] = steps[k] / np.median(steps[near]) if len(near) else math.nan
        if not abs(count[k] - max(np.round(count[k]), 1.0)) < _UNCLEAR:
            where = f"in the gap between {times[k]:.6g} s and {times[k + 1]:.6g} s"
            raise RecordingError(f"the period needs a whole number of oscillations {where}, "
                                 f"the nearest periods give {count[k]:.3g}")
    return np.concatenate([[0], np.cumsum(np.maximum(np.round(count), 1.0))]).astype(np.intp)


def decay_rate(series: AngleSeries, n: int | None = None) -> Measurement:
    """Return the damping rate gamma [1/s] of theta ~ exp(-gamma t / 2), from the first ``n`` amplitudes (None: all).

    The logarithmic decrement: -2 times the slope of ln(amplitude) against time, fitted with the weights
    (amplitude / error)². If the amplitudes scatter more than their errors, or do not decay exponentially, the error is
    multiplied by sqrt(chi² / degrees of freedom).

    This is the decay rate of the envelope. Linear drag takes a larger share of large swings, so the envelope's rate
    exceeds the drag coefficient gamma: by 0.2 % at 10 degrees, 1.5 % at 30, 6 % at 60, 16 % at 90. The error does not
    include this difference.

    Raises RecordingError for fewer than three amplitudes.
    """
    n, points = count(n, "amplitudes"), turning_points(series)
    return envelope_rate(points, slice(n))


def envelope_rate(points: TurningPoints, which: slice | NDArray[np.intp] = slice(None)) -> Measurement:
    """Return the damping rate gamma [1/s] as :func:`decay_rate` does, from the chosen turning points of a swing.

    ``which``: the turning points to use, a slice or an array of indices; by default all. Raises RecordingError for
    fewer than three.
    """
    time, size, error = points.time[which], points.amplitude[which], points.error[which]
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


def doubt_of_gravity(measured: float, expected: float) -> list[str]:
    """Return a list with a sentence if a gravity measured with a given length differs by UNLIKELY from the ``expected``
    one, both in m/s²; else an empty list."""
    off = measured / expected - 1.0
    if abs(off) < UNLIKELY:
        return []
    return [f"This g is {abs(off):.0%} {'above' if off > 0.0 else 'below'} {expected:g} m/s²: the length or the time "
            "base is wrong. Lengths are in m from the pivot to the bob's centre; --read rate=100 or time_unit=ms sets "
            "the time base."]


def doubt_of_length(period: float, length: float) -> list[str]:
    """Return a list with a question if a length [m] that follows from a period [s] is none of a bench; else an empty
    list."""
    _, long, (short, _), _ = BENCH["length"]
    if 0.1 * short < length < long:
        return []
    return [f"A period of {period:.3g} s is that of a pendulum of {length:.3g} m. If that is not meant, set the time "
            f"base by --read rate=100 or time_unit=ms; if it is, say so by --length {length:.3g}."]


P = TypeVar("P", float, Measurement)


def small_amplitude_period(period: P, amplitude: ArrayLike) -> P:
    """Return T0 = T / mean(2 K(sin(A/2)) / pi), the period [s] corrected to small amplitude.

    ``amplitude`` [rad] is one A, or an array of the A of all half swings that the period was averaged over; below pi. K
    is the complete elliptic integral of the first kind (Nelson & Olsson, Am. J. Phys. 54, 112, 1986).

    Raises RecordingError if an amplitude is negative, not finite, or not below pi.
    """
    if not isinstance(period, Measurement):
        period = one_number(period, "period", above=0.0, unit="s")
    angle = numbers(amplitude, "amplitude")
    if angle.size == 0 or not bool(np.all((angle >= 0) & (angle < math.pi))):
        raise RecordingError(f"amplitude must be between 0 and pi [rad], got {shown(amplitude)}")
    return period / float(np.mean(exact.period(angle, 2.0 * math.pi)))
