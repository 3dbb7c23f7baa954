"""How early or late a run is: the part of its error along the motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pendulum_env.physics.scene import Scene
from pendulum_env.truth.pieces import Problem
from pendulum_env.truth.reference import Reference, motion_of

Array = NDArray[np.float64]

SLOWEST = 1e-3
"""Where the motion is slower than this part of its fastest, early and late mean little, and are not looked at."""


def accelerations(scene: Scene, times: ArrayLike, truth: Reference) -> Array:
    """Acceleration [rad/s²] along a reference, given at its times [s]; 0 where dry friction holds the bob."""
    problem, marks = motion_of(scene), np.asarray(times, dtype=float)
    rows = zip(marks, truth.angle, truth.velocity, strict=True)
    return np.array([_acceleration(problem, float(t), float(q), float(v)) for t, q, v in rows])


def _acceleration(problem: Problem, t: float, q: float, v: float) -> float:
    if v == 0.0 and problem.limit:
        free = problem.acceleration(t, q, 0.0, 0.0)
        return 0.0 if abs(free) <= problem.limit else problem.acceleration(t, q, 0.0, float(np.sign(free)))
    return problem.acceleration(t, q, v, float(np.sign(v)))


def phase_errors(omega0: float, truth: Reference, pull: Array, angle: ArrayLike, velocity: ArrayLike) -> Array:
    """By how much a run is ahead of the reference, times ``omega0`` [rad]; nan where the motion is too slow to tell.

    In the plane of ``(omega0 q, v)`` the motion goes along ``(omega0 v, a)``, ``a`` the acceleration. The error
    ``(omega0 dq, dv)`` has there the part ::

        tau = (omega0² dq v + dv a)/(omega0² v² + a²)        phase = omega0 tau

    of which ``tau`` [s] is how early the run is, to first order in the error. On a harmonic oscillator whose amplitude
    is right it is the sine of the phase that the run is ahead by.

    Args:
        omega0: [rad/s]; where it is 0, all is nan.
        truth: the reference; ``pull``: its acceleration [rad/s²], as :func:`accelerations` gives it.
        angle, velocity: of the run, at the reference's times [rad, rad/s].
    """
    v = truth.velocity
    size = omega0 * omega0 * v * v + pull * pull
    known = (size > 0.0) & (size >= SLOWEST * SLOWEST * np.max(size)) & (omega0 > 0.0)
    along = omega0 * omega0 * (np.asarray(angle) - truth.angle) * v + (np.asarray(velocity) - v) * pull
    return np.where(known, omega0 * along / np.where(known, size, 1.0), np.nan)
