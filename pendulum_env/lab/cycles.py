"""Periods of single cycles, corrected to small amplitude; they are constant if only the amplitude changes them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError, series_of
from pendulum_env.lab.measures import Measurement, crossings
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.turning import CLEAR, AngleSeries, hidden_in, turning_points
from pendulum_env.physics import exact


@dataclass(frozen=True, eq=False)
class Cycles:
    """Cycles of a swing, from one upward zero crossing to the next; ``time``, ``amplitude`` and ``period`` are arrays.

    Attributes:
        time: middle of every cycle [s].
        amplitude: mean amplitude of the cycle's two half swings [rad].
        period: duration of the cycle, corrected to small amplitude [s].
        left_out: number of cycles that are left out because readings are missing in them.
    """

    time: FloatArray
    amplitude: FloatArray
    period: FloatArray
    left_out: int = 0

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
        if len(self.time) < 3:
            return Measurement(0.0, math.inf, "s")
        away = self.time - self.time.mean()
        square = float(away @ away)
        slope = float(away @ self.period) / square
        rest = self.period - self.period.mean() - slope * away
        error = math.sqrt(float(rest @ rest) / (len(rest) - 2) / square)
        length = float(np.ptp(self.time))
        return Measurement(slope * length, error * length, "s")


def corrected_periods(series: AngleSeries) -> Cycles:
    """Return the period of every cycle, corrected to small amplitude: ``T0 = T / mean(2 K(sin(A/2)) / pi)`` [s].

    T is the time between upward zero crossings, A the amplitudes of the two half swings between them, K the complete
    elliptic integral of the first kind (Nelson & Olsson, Am. J. Phys. 54, 112, 1986). Damping lengthens the period by
    the relative amount 1/(8 Q²), which is not corrected. Angles must be measured from the equilibrium.

    Raises RecordingError if there is no complete cycle, or if the bob goes over the top.
    """
    time, angle = series_of(series)
    points = turning_points(series)
    ends = crossings(time, angle, level=CLEAR * noise_level(time, angle))
    places, gaps = np.searchsorted(points.time, ends), np.searchsorted(time[hidden_in(time, angle)], ends)
    complete = np.diff(places) > 0
    kept = np.flatnonzero(complete & (np.diff(gaps) == 0))
    if not len(kept):
        none = "none without a gap" if complete.any() else "none"
        raise RecordingError(f"corrected periods need a full oscillation about zero, the series has {none}")
    size = points.amplitude
    if size.max() >= math.pi:
        raise RecordingError("corrected periods need swings below half a turn, but the bob goes over the top")
    ratio = exact.period(size, 2.0 * math.pi)
    cycles = np.array([
        (0.5 * (ends[k] + ends[k + 1]), size[part].mean(), (ends[k + 1] - ends[k]) / ratio[part].mean())
        for k in kept.tolist() for part in (slice(places[k], places[k + 1]),)
    ])
    return Cycles(cycles[:, 0], cycles[:, 1], cycles[:, 2], int(np.count_nonzero(complete)) - len(kept))
