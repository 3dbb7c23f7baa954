"""Correction of jumps of a sensor's zero, as where a tracker loses the bob and follows a point beside it."""

from __future__ import annotations

import numpy as np

from pendulum_env.lab.checked import FloatArray
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.turning import Angles, all_turning_points

_MOST = 5
"""Largest number of jumps that are corrected."""
_SUDDEN = 8.0
"""A step is sudden if it exceeds its neighbours by this number of noise levels, and of usual excesses."""
_LEAST = 2
"""Fewest middles of three turning points on either side of a jump."""
_ALIKE = 0.25
"""After a correction, the middles on both sides of a jump differ by less than this share of it."""
_NEAR = 12
"""Number of middles on either side of a jump from which the zero on that side is computed, as their median."""


def without_jumps(time: FloatArray, angle: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return the angles [rad] of a swing without jumps of its zero, and a note on each.

    At a jump, two successive readings differ by much more than those beside them predict, and the middles of successive
    turning points differ by as much before and after it. The medians of these middles give its size. The readings
    before the first jump stay as they are.
    """
    notes: list[str] = []
    for _ in range(_MOST):
        jump = _clearest(time, angle)
        if jump is None:
            break
        at, size = jump
        angle = _moved(angle, at, size)
        notes.append(f"zero: a jump of {np.degrees(size):.3g} degrees after {time[at]:.4g} s, subtracted from all "
                     "later readings (until= leaves them out)")
    return angle, notes


def _clearest(time: FloatArray, angle: FloatArray) -> tuple[int, float] | None:
    """Return the index of the reading before the largest jump of the zero and its size [rad]; None without any."""
    steps = np.diff(angle)
    if len(steps) < 8:
        return None
    extra = np.zeros(len(steps))
    extra[1:-1] = steps[1:-1] - 0.5 * (steps[:-2] + steps[2:])
    size = np.abs(extra)
    least = _SUDDEN * max(float(np.quantile(size, 0.75)), noise_level(time, angle))
    for at in np.argsort(-size)[:3].tolist():
        if size[at] > least:
            offset = _offset(time, _moved(angle, at, float(extra[at])), float(time[at]))
            if offset is not None and abs(offset) < _ALIKE * size[at]:
                return at, float(extra[at]) + offset
    return None


def _offset(time: FloatArray, angle: FloatArray, moment: float) -> float | None:
    """Return by how much the middles of turning points after a moment exceed those before it; None for too few."""
    points = all_turning_points(Angles(time, angle))
    if len(points.time) < 2 * _LEAST + 4:
        return None
    middle = 0.25 * (points.angle[:-2] + 2.0 * points.angle[1:-1] + points.angle[2:])
    before, after = points.time[2:] < moment, points.time[:-2] > moment
    if min(np.count_nonzero(before), np.count_nonzero(after)) < _LEAST:
        return None
    return float(np.median(middle[after][:_NEAR]) - np.median(middle[before][-_NEAR:]))


def _moved(angle: FloatArray, at: int, size: float) -> FloatArray:
    """Return angles of which those after the index ``at`` are lower by ``size``."""
    return np.concatenate([angle[:at + 1], angle[at + 1:] - size])
