"""What a sensor's quantum does to fitted numbers, where the readings do not scatter enough to make it look random."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.statistics import reading_error

Array = NDArray[np.float64]

DRAWS = 256
"""Motions that are rounded: a standard error from so many is good to 4 %."""


def rounding_covariance(
    seen: Array, slopes: Array, inverse: Array, quantum: float, noise: float, shift: Array
) -> Array:
    """Covariance of least-squares parameters over motions that are like the fitted one, but lie elsewhere on the grid.

    ``(J^T J)^-1 J^T e``, ``e = q round((theta + noise) / q) - theta``: each of 256 motions theta is the fitted one with
    another zero and another amplitude, both uniform over a quantum, sampled up to half a reading earlier or later.
    Rounding errors of readings that scatter by less than half a quantum are not random (Widrow & Kollar 2008,
    Quantization Noise): where the amplitude falls by less than a quantum or two, or swings are read at the same phases
    again and again, each swing is rounded as the one before, and more of them tell nothing new.

    Args:
        seen: angles of the model [rad].
        slopes: their derivatives J, ``(readings, parameters)``.
        inverse: ``(J^T J)^-1``.
        quantum, noise: of the sensor, the noise without what rounding adds [rad].
        shift: change of each angle in the time of one reading [rad].
    """
    source = np.random.default_rng(0)
    middle = seen - seen.mean()
    size = max(float(np.max(np.abs(middle))), quantum)
    found = np.empty((DRAWS, slopes.shape[1]))
    for row, (zero, grown, later) in zip(found, source.uniform(-0.5, 0.5, (DRAWS, 3)), strict=True):
        motion = seen + quantum * (zero + grown * middle / size) + later * shift
        read = motion + noise * source.standard_normal(len(motion)) if noise > 0.0 else motion
        row[:] = (quantum * np.round(read / quantum) - motion) @ slopes
    return np.asarray(inverse @ (found.T @ found / DRAWS) @ inverse)


def noise_beside(time: Array, residual: Array, quantum: float) -> float:
    """Noise of readings [rad], without the ``quantum / sqrt(12)`` of rounding.

    From the residual's root mean square, to which a misfit adds, or from what sets readings off their neighbours, to
    which steps that come every other reading add: whichever is smaller.
    """
    scatter = np.fmin(math.sqrt(float(np.mean(residual**2))), reading_error(time, residual))
    return math.sqrt(max(float(scatter) ** 2 - quantum**2 / 12.0, 0.0))
