"""Tracks of a filmed bob: x and y turned into the angle about the pivot.

The pivot is the centre of the circle that the bob keeps to: Taubin's algebraic fit (IEEE Trans. Pattern Anal. Mach.
Intell. 13, 1115, 1991), which unlike Kasa's (IEEE Trans. Instrum. Meas. 25, 8, 1976) does not shrink circles of which
a short arc is seen, and from it the least squares of the distances to the circle.
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
_FASTEST = 0.1  # of the steps: those through the bottom, where a free bob is fastest
_AT_PIVOT = 1e-6  # of the median distance: nearer points have no angle
_UNSURE = 0.1  # of the radius: a pivot with a larger standard error is not found


@dataclass(frozen=True)
class Circle:
    """Centre, radius, standard ``error`` of the centre, and ``rms`` distance of the points, all in their unit."""

    x: float
    y: float
    radius: float
    error: float
    rms: float


def fit_circle(x: ArrayLike, y: ArrayLike) -> Circle:
    """The circle from which points are least far away: sum of (distance from the centre - radius)² is smallest.

    Raises RecordingError for what are no finite arrays of one length, fewer than 4 points, and points on a line.
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
    """Centre and radius of Taubin's fit to points about their mean, by singular values; None for a line."""
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
    """The angle [rad] of a track about its pivot, from straight down, positive to the right; what was inferred.

    ``theta = atan2(x - x_pivot, +-(y_pivot - y))``: plus where the y axis points up, minus where it points down.

    Args:
        x, y: the track, in any unit.
        pivot: (x, y) of the pivot in that unit; None: the centre of the circle of the track.
        y_axis: "up" or "down", where y grows; None: so that the bob is below the pivot where it is fastest.

    Raises RecordingError for a pivot that is no two numbers, an unknown y_axis, and a track that does not show where
    its pivot is, or passes through it.
    """
    points = _points(x, y)
    if y_axis is not None:
        known(y_axis, "y_axis", Y_AXES)
    if pivot is not None:
        centre, told = _checked_pivot(pivot), "as told"
        where = f"({centre[0]:g}, {centre[1]:g})"
    else:
        circle = fit_circle(*points)
        if not circle.error < _UNSURE * circle.radius:
            found = f"± {circle.error:.3g} at a radius of {circle.radius:.3g}; pivot=(x, y) tells it"
            raise RecordingError(f"the arc of the track is too short to find its pivot ({found})")
        centre = np.array([circle.x, circle.y])
        where = f"({circle.x:.6g}, {circle.y:.6g}) ± {circle.error:.2g}"
        told = f"centre of the track's circle of radius {circle.radius:.6g} (distances {circle.rms:.2g} rms)"
    away = points - centre[:, None]
    distance = np.hypot(*away)
    if not distance.min() > _AT_PIVOT * np.median(distance):
        raise RecordingError("the track must not pass through the pivot")
    up, why = (Y_AXES[y_axis], "as told") if y_axis is not None else (_upward(away), "so that the bob hangs below it")
    sense = f"y axis: points {'up' if up > 0.0 else 'down'}, {why}"
    notes = [f"pivot: {where}, {told}", sense, "angle: from straight down, positive to the right"]
    return np.asarray(np.arctan2(away[0], -up * away[1])), notes


def _upward(away: FloatArray) -> float:
    """1.0 if the y axis points up, -1.0 if down, of points about their pivot."""
    speed = np.hypot(*np.diff(away, axis=1))
    fast = speed >= np.quantile(speed, 1.0 - _FASTEST)
    low = float(np.median(0.5 * (away[1, 1:] + away[1, :-1])[fast]))
    return 1.0 if low < 0.0 else -1.0


def _points(x: ArrayLike, y: ArrayLike) -> FloatArray:
    """x and y as rows."""
    across, along = numbers(x, "x"), numbers(y, "y")
    if across.ndim != 1 or across.shape != along.shape or len(across) < 4:
        shapes = f"{across.shape} and {along.shape}"
        raise RecordingError(f"x and y must be arrays of one length from 4, got shapes {shapes}")
    points = np.stack([across, along])
    if not np.isfinite(points).all():
        raise RecordingError("x and y must be finite, got NaN or inf")
    return points


def _checked_pivot(pivot: Any) -> FloatArray:
    try:
        found = numbers(pivot, "pivot")
    except RecordingError:
        found = np.empty(0)
    if found.shape != (2,) or not np.isfinite(found).all():
        raise RecordingError(f"pivot must be (x, y), two numbers in the unit of the track, got {shown(pivot)}")
    return found
