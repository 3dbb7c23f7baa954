"""Convert the x-y track of a filmed bob to its angle about the pivot.

The pivot is the centre of the circle fitted to the track. Taubin's algebraic fit (IEEE Trans. Pattern Anal. Mach.
Intell. 13, 1115, 1991) gives the starting values: unlike Kasa's (IEEE Trans. Instrum. Meas. 25, 8, 1976), it does not
yield too small a circle when only a short arc is seen. Least squares of the distances to the circle refine it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pendulum_env.lab.checked import FloatArray, RecordingError, known, numbers
from pendulum_env.physics.units import shown

Y_AXES = {"up": 1.0, "down": -1.0}
_FASTEST = 0.1  # share of the steps that are taken as those through the bottom, where a free bob is fastest
_AT_PIVOT = 1e-6  # of the median distance from the pivot: nearer points have no usable angle
_UNSURE = 0.1  # of the radius: a pivot with a larger standard error is rejected


@dataclass(frozen=True)
class Circle:
    """A circle fitted to points: centre ``x``, ``y``, ``radius``, standard ``error`` of the centre, and ``rms``
    distance of the points from the circle, all in the unit of the points."""

    x: float
    y: float
    radius: float
    error: float
    rms: float


def fit_circle(x: ArrayLike, y: ArrayLike) -> Circle:
    """Fit a circle to points by least squares: the sum of (distance from the centre - radius)² is smallest.

    Raises RecordingError unless x and y are finite arrays of one length with at least 4 points, and for points on a
    straight line.
    """
    from scipy.optimize import least_squares

    points = _points(x, y)
    middle = points.mean(axis=1, keepdims=True)
    size = float(np.sqrt(np.mean((points - middle) ** 2)))
    start = _taubin((points - middle) / size) if size > 0.0 else None
    if start is None:
        raise RecordingError("the points of the track lie on a line or in one place, not on a circle")
    u, v = (points - middle) / size

    def away(circle: FloatArray) -> FloatArray:
        return np.asarray(np.hypot(u - circle[0], v - circle[1]) - circle[2])

    def slope(circle: FloatArray) -> FloatArray:
        distance = np.maximum(np.hypot(u - circle[0], v - circle[1]), 1e-12)
        return np.stack([(circle[0] - u) / distance, (circle[1] - v) / distance, -np.ones_like(u)], axis=1)

    solution = np.asarray(least_squares(away, start, jac=slope, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14).x)
    left, matrix = away(solution), slope(solution)
    covariance = np.linalg.pinv(matrix.T @ matrix) * float(left @ left) / max(len(u) - 3, 1)
    error = math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))
    a, b, radius, rms = (size * float(value) for value in (*solution, np.sqrt(np.mean(left**2))))
    return Circle(float(middle[0, 0]) + a, float(middle[1, 0]) + b, radius, size * error, rms)


def _taubin(points: FloatArray) -> FloatArray | None:
    """Return centre and radius of Taubin's circle fit to points about their mean; None for points on a line."""
    u, v = points
    square = u * u + v * v
    mean = float(square.mean())
    scaled = (square - mean) / (2.0 * math.sqrt(mean))
    _, _, rows = np.linalg.svd(np.stack([scaled, u, v], axis=1), full_matrices=False)
    a, b, c = rows[2]
    a = float(a) / (2.0 * math.sqrt(mean))
    if abs(a) < 1e-9:
        return None
    centre = np.array([-b / a / 2.0, -c / a / 2.0])
    return np.array([*centre, math.sqrt(float(centre @ centre) + mean)])


def track_angle(
    x: ArrayLike, y: ArrayLike, *, pivot: Any = None, y_axis: str | None = None
) -> tuple[FloatArray, list[str]]:
    """Return the angle [rad] of an x-y track about its pivot, an array, and notes on the pivot and the axes.

    ``theta = atan2(x - x_pivot, +-(y_pivot - y))``: plus if the y axis points up, minus if it points down. The angle is
    measured from straight down, positive to the right.

    Args:
        x, y: the points of the track, in any unit.
        pivot: (x, y) of the pivot in the unit of the track; None: the centre of the circle fitted to the track.
        y_axis: "up" or "down", the direction in which y grows; None: the direction for which the bob is below the pivot
            where it is fastest.

    Raises RecordingError for a pivot that is not two numbers, an unknown y_axis, a track too short to find its pivot,
    and a track that passes through the pivot.
    """
    return about_pivot(_points(x, y), pivot, y_axis)[:2]


def about_pivot(
    points: FloatArray, pivot: Any, y_axis: str | None
) -> tuple[FloatArray, list[str], tuple[float, float]]:
    """Return the angle and the notes of :func:`track_angle`, and the radius of the track with its standard error.

    ``points`` are the x and y of the track as the two rows of an array. Raises RecordingError as it does.
    """
    if y_axis is not None:
        known(y_axis, "y_axis", Y_AXES)
    circle = None
    if pivot is not None:
        centre, origin = _checked_pivot(pivot), "as given"
        where = f"({centre[0]:g}, {centre[1]:g})"
    else:
        circle = fit_circle(*points)
        if not circle.error < _UNSURE * circle.radius:
            error = f"± {circle.error:.3g} at a radius of {circle.radius:.3g}; give pivot=(x, y)"
            raise RecordingError(f"the arc of the track is too short to find its pivot ({error})")
        centre = np.array([circle.x, circle.y])
        where = f"({circle.x:.6g}, {circle.y:.6g}) ± {circle.error:.2g}"
        origin = f"centre of the circle fitted to the track (radius {circle.radius:.6g}, rms distance {circle.rms:.2g})"
    away = points - centre[:, None]
    distance = np.hypot(*away)
    if not distance.min() > _AT_PIVOT * np.median(distance):
        raise RecordingError("the track must not pass through the pivot")
    up, why = ((Y_AXES[y_axis], "as given") if y_axis is not None
               else (_upward(away), "inferred: the bob hangs below the pivot"))
    sense = f"y axis: points {'up' if up > 0.0 else 'down'}, {why}"
    notes = [f"pivot: {where}, {origin}", sense, "angle: from straight down, positive to the right"]
    size = (float(distance.mean()), float(distance.std()) / math.sqrt(distance.size)) if circle is None else (
        circle.radius, circle.error)
    return np.asarray(np.arctan2(away[0], -up * away[1])), notes, size


def _upward(away: FloatArray) -> float:
    """Return 1.0 if the y axis of a track points up, -1.0 if down; ``away``: x and y of its points about the pivot."""
    speed = np.hypot(*np.diff(away, axis=1))
    fast = speed >= np.quantile(speed, 1.0 - _FASTEST)
    low = float(np.median(0.5 * (away[1, 1:] + away[1, :-1])[fast]))
    return 1.0 if low < 0.0 else -1.0


def _points(x: ArrayLike, y: ArrayLike) -> FloatArray:
    """Return the x and y of a track as the two rows of an array; RecordingError unless they are finite and at least 4.
    """
    across, along = numbers(x, "x"), numbers(y, "y")
    if across.ndim != 1 or across.shape != along.shape or len(across) < 4:
        shapes = f"{across.shape} and {along.shape}"
        raise RecordingError(f"x and y must be arrays of one length from 4, got shapes {shapes}")
    points = np.stack([across, along])
    if not np.isfinite(points).all():
        raise RecordingError("x and y must be finite, got NaN or inf")
    return points


def _checked_pivot(pivot: Any) -> FloatArray:
    """Return the pivot of a track as an array (x, y); RecordingError unless it is two finite numbers."""
    try:
        centre = numbers(pivot, "pivot")
    except RecordingError:
        centre = np.empty(0)
    if centre.shape != (2,) or not np.isfinite(centre).all():
        raise RecordingError(f"pivot must be (x, y), two numbers in the unit of the track, got {shown(pivot)}")
    return centre
