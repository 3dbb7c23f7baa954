"""Periods of single cycles, corrected to small amplitude; they are constant if only the amplitude changes them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError, check_half_turn, series_of
from pendulum_env.lab.measures import FINEST, Measurement, crossings_with_errors, envelope_rate
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.turning import CLEAR, AngleSeries, hidden_in, turning_points
from pendulum_env.physics import exact

SURE = 3.0
"""A drift counts as seen if it is larger than this many errors."""
FARTHEST = 2.0
"""Largest error by a drift, in drifts over the run: where the amplitude hardly changes, it is not the reason."""
SWINGS = 3
"""The damping is divided out of the periods of more half swings than this; fewer hardly show it."""


@dataclass(frozen=True, eq=False)
class Cycles:
    """Cycles of a swing, from one upward zero crossing to the next; ``time``, ``amplitude`` and ``period`` are arrays.

    Attributes:
        time: middle of every cycle [s].
        amplitude: mean amplitude of the cycle's two half swings [rad].
        period: duration of the cycle, corrected to small amplitude [s].
        left_out: number of cycles that are left out because readings are missing in them.
        variance: variance of every corrected period, from the noise of the readings [s²].
        shared: covariance of every corrected period with the next one [s²]; below 0 where both share a crossing, else
            0.
        damped: share of the period that the damping adds, which is divided out [1].
    """

    time: FloatArray
    amplitude: FloatArray
    period: FloatArray
    left_out: int
    variance: FloatArray
    shared: FloatArray
    damped: float

    @property
    def spread(self) -> float:
        """Largest relative deviation of a cycle's period, corrected to small amplitude, from the mean of all cycles."""
        mean = float(self.period.mean())
        return float(np.abs(self.period - mean).max()) / mean

    @property
    def drift(self) -> Measurement:
        """Change of the period, corrected to small amplitude, from the first cycle to the last, by a straight line [s].

        For fewer than three cycles the value is 0 with an infinite error.
        """
        return change(self.time, self.period)

    def mean(self, count: int | None = None) -> Measurement:
        """Return the period at small amplitude [s], the mean of the corrected periods of the first ``count`` cycles
        (None: all).

        The error follows from those of the crossing times and of the amplitudes. It is enlarged if successive corrected
        periods of the run differ by more than these errors allow. A drift of the corrected period over the run that is
        clear (SURE errors) is taken for ``slope A²``, as amplitudes that are wrong by a factor cause it: the mean of
        that over the cycles is added. The correction for damping is added too, as the law may not be linear.
        """
        taken = slice(count)
        periods, shared = self.period[taken], self.shared[taken][: len(self.period[taken]) - 1]
        value, number = float(periods.mean()), len(periods)
        variance = (float(self.variance[taken].sum()) + 2.0 * float(shared.sum())) / number**2
        next_to = self.shared < 0.0
        apart = (self.variance[1:] + self.variance[:-1] - 2.0 * self.shared)[next_to]
        # The mean square of k differences that share readings is 1 within 2/sqrt(k), even if the errors are right.
        scatter = float(np.mean(np.diff(self.period)[next_to] ** 2 / apart)) - 2.0 / math.sqrt(len(apart)) if (
            len(apart)) else 0.0
        square = self.amplitude**2
        falls = abs(change(self.time, square).value)
        share = min(float(square[taken].mean()) / falls, FARTHEST) if falls > 0.0 else FARTHEST
        wrong = share**2 * max(self.drift.value**2 - (SURE * self.drift.error) ** 2, 0.0)
        return Measurement(value, math.sqrt(max(1.0, scatter) * variance + wrong + (self.damped * value) ** 2), "s")


def change(time: FloatArray, y: FloatArray) -> Measurement:
    """Return the change of ``y`` from the first to the last of its times, by a straight line through points of equal
    errors; 0 with an infinite error for fewer than three points."""
    if len(time) < 3:
        return Measurement(0.0, math.inf, "s")
    away = time - time.mean()
    square = float(away @ away)
    slope = float(away @ y) / square
    rest = y - y.mean() - slope * away
    error = math.sqrt(float(rest @ rest) / (len(rest) - 2) / square)
    length = float(np.ptp(time))
    return Measurement(slope * length, error * length, "s")


def corrected_periods(series: AngleSeries) -> Cycles:
    """Return the period of every cycle, corrected to small amplitude: ``T0 = T / mean(2 K(sin(A/2)) / pi)`` [s].

    T is the time between upward zero crossings, A the amplitudes of the two half swings between them, K the complete
    elliptic integral of the first kind (Nelson & Olsson, Am. J. Phys. 54, 112, 1986). Damping at the rate gamma
    lengthens the period by the factor ``sqrt(1 + (gamma T/(4 pi))²)``, about ``1 + 1/(8 Q²)``, which is divided out
    too; this is exact for linear damping at small angles, and right in size for other laws. Angles must be measured
    from the equilibrium.

    Raises RecordingError if there is no complete cycle, or if the bob goes over the top.
    """
    time, angle = series_of(series)
    points, sigma = turning_points(series), noise_level(time, angle)
    ends, errors = crossings_with_errors(time, angle, CLEAR * sigma)
    places, gaps = np.searchsorted(points.time, ends), np.searchsorted(time[hidden_in(time, angle)], ends)
    complete = np.diff(places) > 0
    kept = np.flatnonzero(complete & (np.diff(gaps) == 0))
    if not len(kept):
        none = "none without a gap" if complete.any() else "none"
        raise RecordingError(f"corrected periods need a full oscillation about zero, the series has {none}")
    size = points.amplitude
    check_half_turn(size, "corrected periods need")
    spans = np.diff(ends)[kept]
    rate = envelope_rate(points).value if len(size) > SWINGS else 0.0
    damped = math.hypot(1.0, max(rate, 0.0) * float(spans.mean()) / (4.0 * math.pi))
    ratio = damped * exact.period(size, math.tau)
    larger = damped * exact.period(np.minimum(size + points.error, math.pi), math.tau)
    halves = [slice(places[k], places[k + 1]) for k in kept.tolist()]
    mean = np.array([ratio[part].mean() for part in halves])
    spread = np.array([np.linalg.norm((larger - ratio)[part]) / (part.stop - part.start) for part in halves])
    own = np.maximum(sigma * errors, FINEST * np.abs(ends[-1]))
    variance = (own[kept] ** 2 + own[kept + 1] ** 2 + (spans * spread / mean) ** 2) / mean**2
    shared = np.where(np.diff(kept) == 1, -(own[kept[1:]] ** 2) / (mean[1:] * mean[:-1]), 0.0)
    return Cycles(0.5 * (ends[kept] + ends[kept + 1]), np.array([size[part].mean() for part in halves]), spans / mean,
                  int(np.count_nonzero(complete)) - len(kept), variance, shared, damped - 1.0)
