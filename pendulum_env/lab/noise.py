"""How finely and how surely a sensor reads: quantum and noise, from its readings alone."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from pendulum_env.lab.checked import FloatArray, numbers, readings

_SAME = 1e-6  # of the range: readings closer than this are one level, apart by rounding alone
_ON_GRID = 0.15  # quanta that a step may be away from a whole number of them
_MOST_QUANTA = 5.5  # steps of more quanta say nothing about the quantum
_SHARE = 0.9  # of the steps that must be whole numbers of quanta
_FEW = 8  # steps between levels, below which every level must have been read three times


def quantum_level(angle: ArrayLike) -> float:
    """Smallest step [rad] of a reading; 0 if none is seen.

    Readings of a sensor with a quantum repeat a few levels, and nine in ten steps between neighbouring levels are
    whole multiples of one step, to 15 % of it: so levels printed with few decimals still count as even. Levels apart
    by less than 1e-6 of the range are one.

    Raises RecordingError for what are no finite numbers.
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
    """The step near ``quantum`` that most ``steps`` are multiples of; 0 if there is none."""
    for _ in range(3):
        near = steps[steps < _MOST_QUANTA * quantum]
        multiples = np.round(near / quantum)
        if not multiples.any():
            return 0.0
        quantum = float(near.sum() / multiples.sum())
    multiples = steps / quantum
    even = (np.abs(multiples - np.round(multiples)) < _ON_GRID) & (multiples > 0.5)
    return quantum if float(even.mean()) >= _SHARE else 0.0


def scatter_level(time: ArrayLike, angle: ArrayLike) -> float:
    """Standard deviation [rad] of the readings about a smooth curve; 0 below five readings.

    The median distance of a reading from the cubic through its four neighbours (in time, so uneven stamps do no
    harm), as a Gaussian sigma.

    Raises RecordingError unless both are finite, and arrays of one length.
    """
    off = off_neighbours(*readings(time, angle))
    return 1.4826 * float(np.median(np.abs(off))) if len(off) else 0.0


def off_neighbours(time: FloatArray, angle: FloatArray) -> FloatArray:
    """Distance of each reading from the cubic through its two neighbours on either side [rad], over the standard
    deviation that it has where readings have 1; none for the two readings at each end."""
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
    """Standard deviation [rad] of one reading: scatter, or quantum / sqrt(12), whichever is larger.

    The latter is that of a rounding error spread evenly over a quantum (Bennett, Bell Syst. Tech. J. 27, 446, 1948).

    Raises RecordingError unless both are finite, and arrays of one length.
    """
    return max(scatter_level(time, angle), quantum_level(numbers(angle, "angle")) / math.sqrt(12))
