"""Closed forms of the pendulum's motion, as reference solutions for tests, studies and plots.

Angles in radians from the downward vertical, unwrapped; velocities in rad/s; times in seconds, of either
sign unless stated. A first argument of type `Real` may be a float or an array, and results have its shape.
Every function raises SceneError for an argument that is not finite or out of its range.
"""

from __future__ import annotations

from pendulum_env.physics.exact.damped import (
    coulomb_turning_points,
    coulomb_turning_points_linear,
    damped_amplitude,
    drag_only,
    euler_energy_factor,
    linear,
    quadratic_turning_point,
)
from pendulum_env.physics.exact.pendulum import flight, pendulum, period, period_rotation, small_amplitude_series

__all__ = [
    "coulomb_turning_points",
    "coulomb_turning_points_linear",
    "damped_amplitude",
    "drag_only",
    "euler_energy_factor",
    "flight",
    "linear",
    "pendulum",
    "period",
    "period_rotation",
    "quadratic_turning_point",
    "small_amplitude_series",
]
