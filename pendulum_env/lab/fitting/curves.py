"""Cubic curves between the equal steps of simulated runs, for all runs of a batch at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def hermite(x: Array, step: float, derivative: int = 0) -> Array:
    """Return the cubic Hermite basis at ``x`` (0 to 1) between two steps, or its first or second derivative in time.

    The four rows of the result, shape ``(4, x)``, belong to the value and the slope at the first and the second step,
    which are ``step`` [s] apart.
    """
    if derivative == 2:
        bend = (12.0 * x - 6.0) / step**2
        return np.stack([bend, (6.0 * x - 4.0) / step, -bend, (6.0 * x - 2.0) / step])
    if derivative == 1:
        down = (6.0 * x * x - 6.0 * x) / step
        return np.stack([down, 3.0 * x * x - 4.0 * x + 1.0, -down, 3.0 * x * x - 2.0 * x])
    up = x * x * (3.0 - 2.0 * x)
    return np.stack([1.0 - up, step * x * (1.0 - x) ** 2, up, step * x * x * (x - 1.0)])


def between(time: Array, step: float, count: int, derivative: int = 0) -> Any:
    """Return the matrix that interpolates curves at given times from ``count`` values and slopes at equal steps.

    The product of the sparse matrix and the values above the slopes, shape ``(2 count, curves)``, is the cubic Hermite
    interpolation or its derivative, ``(times, curves)``.

    Args:
        time: times [s], from 0 on.
        step: time between two steps [s]; the first one is at 0.
        count: number of steps at which the curves are known.
        derivative: 0 for the curves, 1 or 2 for their derivatives in time.
    """
    from scipy.sparse import csr_array

    cell = np.clip((time / step).astype(np.intp), 0, count - 2)
    basis = hermite(time / step - cell, step, derivative)
    places = np.stack([cell, cell + count, cell + 1, cell + 1 + count], axis=1)
    ends = np.arange(0, 4 * len(time) + 1, 4)
    return csr_array((basis.T.ravel(), places.ravel(), ends), shape=(len(time), 2 * count))


def spline_slopes(values: Array, step: float) -> Array:
    """Return the slopes at equal steps of the cubic splines through ``values``, shape ``(steps, curves)``.

    The splines have continuous second derivatives, and third derivatives that are continuous at the second and at the
    last but one step ("not-a-knot"). Source: de Boor 1978, A Practical Guide to Splines, chapter IV.

    Args:
        values: values at the steps, at least four of them.
        step: time between two steps [s].
    """
    from scipy.linalg import solve_banded

    rises = np.diff(values, axis=0) / step
    right = np.empty_like(values)
    np.add(rises[1:], rises[:-1], out=right[1:-1])
    right[1:-1] *= 3.0
    right[0], right[-1] = 2.5 * rises[0] + 0.5 * rises[1], 2.5 * rises[-1] + 0.5 * rises[-2]
    bands = np.ones((3, len(values)))
    bands[1, 1:-1] = 4.0
    bands[0, 1] = bands[2, -2] = 2.0
    return np.asarray(solve_banded((1, 1), bands, right, overwrite_ab=True, overwrite_b=True, check_finite=False))
