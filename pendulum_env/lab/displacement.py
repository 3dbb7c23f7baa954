"""Convert a displacement along a horizontal line, as of an ultrasonic sensor, to the angle of the swing."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError

GRAVITY = 9.81
"""Gravity with which the length of the pendulum follows from the period [m/s²]."""
_ROUNDS = 30
"""Number of times that length and amplitude are computed from each other; 10 suffice up to 60 degrees."""


def displacement_angle(time: FloatArray, x: FloatArray) -> tuple[FloatArray, str]:
    """Return the angle [rad] of a swing whose horizontal displacement is known, and a note on how.

    ``theta = asin((x - x0) / L)``, where x0 is the middle of the swing. The length L is that of a point pendulum with
    the period of the first swings, corrected for their amplitude: ``T = 2 pi sqrt(L / g) / agm(1, cos(A/2))``, which is
    exact (Carvalhaes & Suppes 2008, Am. J. Phys. 76, 1150). Whether x grows to the right, or away from the sensor, only
    changes the sign of the angle.

    Args:
        time: times [s], increasing.
        x: displacement or distance [m].

    Raises RecordingError for less than two whole swings, and for a swing that is wider than its length.
    """
    middle = _middle(x)
    away = x - middle
    crossings = _crossings(time, away)
    if len(crossings) < 5:
        raise RecordingError(f"expected at least two swings, to find the length, found {len(crossings)} passages "
                             "through the middle")
    crossings = crossings[: 2 * min((len(crossings) - 1) // 2, 5) + 1]
    period = 2.0 * float(crossings[-1] - crossings[0]) / (len(crossings) - 1)
    size = float(np.max(np.abs(away[(time >= crossings[0]) & (time <= crossings[-1])])))
    length, amplitude = GRAVITY * (period / math.tau) ** 2, 0.0
    for _ in range(_ROUNDS):
        if not size < length:
            raise RecordingError(f"a displacement of {size:.3g} m is more than the length of {length:.3g} m that "
                                 f"follows from the period of {period:.3g} s; check the unit of the displacement")
        amplitude = math.asin(size / length)
        length = GRAVITY * (period * _agm(1.0, math.cos(0.5 * amplitude)) / math.tau) ** 2
    note = (f"angle: asin(x/L) about x = {middle:.6g} m, with L = {length:.4g} m from the period of {period:.4g} s at "
            f"{math.degrees(amplitude):.3g} degrees")
    return np.arcsin(np.clip(away / length, -1.0, 1.0)), note


def _middle(x: FloatArray) -> float:
    """Return the middle of a swing that decays: the median of its upper and lower envelopes' means in ten parts."""
    parts = [part for part in np.array_split(x, 10) if len(part)]
    return float(np.median([0.5 * (float(part.max()) + float(part.min())) for part in parts]))


def _crossings(time: FloatArray, away: FloatArray) -> FloatArray:
    """Return the times at which a swing passes its middle, without those of noise near it."""
    level = 0.2 * float(np.max(np.abs(away)))
    far = np.flatnonzero(np.abs(away) > level)
    pairs = [(i, j) for i, j in pairwise(far.tolist()) if away[i] * away[j] < 0.0]
    times = []
    for i, j in pairs:
        slope, start = np.polyfit(time[i:j + 1] - time[i], away[i:j + 1], 1)
        times.append(float(time[i] - start / slope))
    return np.array(times)


def _agm(a: float, b: float) -> float:
    """Return the arithmetic-geometric mean of two positive numbers (Gauss 1799)."""
    for _ in range(8):
        a, b = 0.5 * (a + b), math.sqrt(a * b)
    return a
