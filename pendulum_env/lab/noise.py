"""Estimate the resolution (quantum) and the noise of a sensor from its readings alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pendulum_env.lab.checked import FloatArray, numbers, readings

_SAME = 1e-6  # of the range: readings closer than this count as one level, since they differ only by rounding
_ON_GRID = 0.15  # quanta by which a step may differ from a whole number of quanta
_MOST_QUANTA = 5.5  # steps of more quanta are not used to estimate the quantum
_SHARE = 0.9  # minimum share of the steps that must be whole numbers of quanta
_FEW = 8  # with fewer steps between levels than this, there must be three readings per level on average

CHANGES, STEPS = 0.6, 0.95
"""Smallest shares of the steps of one count, and of one count or none, in a file with a row for each change."""


def quantum_level(angle: ArrayLike) -> float:
    """Return the quantum [rad] of a sensor, the smallest step between its readings; 0 if the readings show none.

    Readings of a sensor with a quantum repeat a limited number of levels. At least nine in ten steps between
    neighbouring levels must be whole multiples of the quantum, to 15 % of it, so that levels printed with few decimals
    still count as evenly spaced. Levels that differ by less than 1e-6 of the range count as one.

    Raises RecordingError unless ``angle`` is an array of finite numbers.
    """
    values = np.sort(readings(angle, angle)[1])
    if len(values) < 3 or not values[-1] > values[0]:
        return 0.0
    fresh = np.concatenate([[True], np.diff(values) > _SAME * (values[-1] - values[0])])
    steps = np.diff(values[fresh])
    if len(steps) + 1 >= len(values) or (len(steps) < _FEW and 3 * (len(steps) + 1) > len(values)):
        return 0.0
    return max(_grid(steps, float(first)) for first in np.quantile(steps, (0.0, 0.1, 0.5)))


def _grid(steps: FloatArray, quantum: float) -> float:
    """Return the value near ``quantum`` of which at least nine in ten ``steps`` of a sensor are multiples, or 0."""
    for _ in range(3):
        near = steps[steps < _MOST_QUANTA * quantum]
        multiples = np.round(near / quantum)
        if not multiples.any():
            return 0.0
        quantum = float(near.sum() / multiples.sum())
    multiples = steps / quantum
    even = (np.abs(multiples - np.round(multiples)) < _ON_GRID) & (multiples > 0.5)
    return quantum if float(even.mean()) >= _SHARE else 0.0


def changes_only(angle: FloatArray) -> NDArray[np.bool_]:
    """Return a mask of the steps between readings that are one count of an encoder which writes a row whenever its
    count changes; all False for other sensors, whose readings repeat or skip counts.

    Nearly all steps of such an encoder (STEPS) are of one count, apart from a few repeated rows (CHANGES).
    """
    quantum = quantum_level(angle)
    if not quantum:
        return np.zeros(max(len(angle) - 1, 0), dtype=np.bool_)
    counts = np.round(np.abs(np.diff(angle)) / quantum)
    one: NDArray[np.bool_] = counts == 1.0
    if float(one.mean()) >= CHANGES and float(np.mean(counts <= 1.0)) >= STEPS:
        return one
    return np.zeros(len(one), dtype=np.bool_)


def scatter_level(time: ArrayLike, angle: ArrayLike) -> float:
    """Return the standard deviation [rad] of the readings about a smooth curve; 0 for fewer than five readings.

    It is the median distance of a reading from the cubic through its four neighbours, converted to a Gaussian sigma.
    The cubic is one in time, so uneven time stamps do no harm.

    Raises RecordingError unless time and angle are finite arrays of one length.
    """
    off = off_neighbours(*readings(time, angle))
    return 1.4826 * float(np.median(np.abs(off))) if len(off) else 0.0


def off_neighbours(time: FloatArray, angle: FloatArray) -> FloatArray:
    """Return the distances [rad] of readings from the cubic through their four neighbours, two on either side.

    They are scaled so that their standard deviation is that of a single reading if readings are independent. The first
    two and the last two readings have no distance.
    """
    if len(time) < 5:
        return np.zeros(0)
    shifts = (0, 1, 3, 4)
    near = [time[i : len(time) - 4 + i] for i in shifts]
    here = time[2:-2]
    residual, variance = angle[2:-2].copy(), np.ones(len(here))
    for i, own in enumerate(near):
        weight = np.ones(len(here))
        for j, other in enumerate(near):
            if j != i:
                weight *= (here - other) / (own - other)
        residual -= weight * angle[shifts[i] : len(time) - 4 + shifts[i]]
        variance += weight * weight
    return np.asarray(residual / np.sqrt(variance))


def noise_level(time: ArrayLike, angle: ArrayLike) -> float:
    """Return the standard deviation [rad] of one reading: its scatter, or quantum / sqrt(12), whichever is larger.

    The second value is the standard deviation of a rounding error that is distributed evenly over a quantum (Bennett,
    Bell Syst. Tech. J. 27, 446, 1948).

    Raises RecordingError unless time and angle are finite arrays of one length.
    """
    return max(scatter_level(time, angle), quantum_level(numbers(angle, "angle")) / math.sqrt(12))
