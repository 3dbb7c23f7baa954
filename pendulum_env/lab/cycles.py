"""The period that each cycle would have at small amplitude: constant, if nothing but the amplitude changes it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError, gaps_of, series_of
from pendulum_env.lab.measures import Measurement, crossings
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.turning import CLEAR, Series, turning_points
from pendulum_env.physics import exact


@dataclass(frozen=True, eq=False)
class Cycles:
    """Cycles from one upward zero crossing to the next.

    Attributes:
        time: middle of each [s].
        amplitude: mean of its two half swings' [rad].
        period: corrected for the amplitude [s].
        left_out: stretches from one crossing to the next that are not here, because readings are missing in them.
    """

    time: FloatArray
    amplitude: FloatArray
    period: FloatArray
    left_out: int = 0

    @property
    def spread(self) -> float:
        """Largest deviation of one corrected period from their mean, relative to it."""
        mean = float(self.period.mean())
        return float(np.abs(self.period - mean).max()) / mean

    @property
    def drift(self) -> Measurement:
        """Change of the corrected period from the first cycle to the last, by a straight line [s].

        Not known, with infinite error, below three cycles.
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


def corrected_periods(series: Series) -> Cycles:
    """Each cycle's period at small amplitude, ``T0 = T / mean(2 K(sin(A/2)) / pi)`` [s].

    T is the time between upward zero crossings, A the amplitudes of the two half swings between them, K the complete
    elliptic integral of the first kind (Nelson & Olsson, Am. J. Phys. 54, 112, 1986). Damping itself lengthens the
    period by 1/(8 Q²) of it, which stays in. Angles are about the equilibrium.

    Raises RecordingError if there is no whole cycle, or where the bob goes over the top.
    """
    time, angle = series_of(series)
    points = turning_points(series)
    ends = crossings(time, angle, level=CLEAR * noise_level(time, angle))
    places, gaps = np.searchsorted(points.time, ends), np.searchsorted(time[gaps_of(time)], ends)
    whole = np.diff(places) > 0
    kept = np.flatnonzero(whole & (np.diff(gaps) == 0))
    if not len(kept):
        none = "none without a gap" if whole.any() else "none"
        raise RecordingError(f"corrected periods need a full oscillation about zero, the series has {none}")
    size = points.amplitude
    if size.max() >= math.pi:
        raise RecordingError("corrected periods are those of swings that turn back, the series goes over the top")
    ratio = exact.period(size, 2.0 * math.pi)
    found = np.array([
        (0.5 * (ends[k] + ends[k + 1]), size[part].mean(), (ends[k + 1] - ends[k]) / ratio[part].mean())
        for k in kept.tolist() for part in (slice(places[k], places[k + 1]),)
    ])
    return Cycles(found[:, 0], found[:, 1], found[:, 2], int(np.count_nonzero(whole)) - len(kept))
