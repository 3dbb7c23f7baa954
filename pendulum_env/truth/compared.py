"""The motion that a comparison holds its methods against."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.kernels import resolve
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.reference import CLOSED, StudyError, reference

FloatArray = NDArray[np.float64]

FINE = 5e-4
"""Step of the numerical truth, times omega0."""
MOST = {"compiled": 30_000_000, "python": 200_000}
"""Steps that the numerical truth may take."""
MARKS = 24
"""Times at which a second solution checks the numerical truth."""
TOLERANCE = 1e-6
"""Two solutions further apart than this [rad] are no truth."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The exact motion, or the best that can be had; nan where it is not known.

    Attributes:
        time, angle, velocity: [s, rad, rad/s].
        error: of the angle, estimated [rad].
        how: where it comes from, as a sentence.
        closed: True if it is a closed form.
    """

    time: FloatArray
    angle: FloatArray
    velocity: FloatArray
    error: float
    how: str
    closed: bool = False

    @property
    def known(self) -> bool:
        """True if there is a truth at all."""
        return bool(np.isfinite(self.angle).any())


def true_motion(scene: Scene, angle: float, velocity: float, time: FloatArray) -> Truth:
    """The motion of a scene from an angle [rad] and a velocity [rad/s], with no control, at evenly spaced times [s].

    Closed form where :mod:`pendulum_env.truth.reference` has one. Else rk4 (Kutta 1901) at a step of
    ``FINE / omega0`` or less, which that module's own solutions confirm at ``MARKS`` times: the largest difference is
    the error, and beyond ``TOLERANCE`` there is no truth. Unknown after a wire goes slack.
    """
    names = {effect.name for effect in scene.effects} - {"motor"}
    if any(names <= allowed for allowed, *_ in CLOSED):
        found = reference(scene, angle, velocity, time)
        angles, speeds = _while_taut(scene, found.angle, found.velocity)
        return Truth(time, angles, speeds, found.error_estimate, found.how, closed=True)
    parts = _parts(scene, time)
    step = float(time[1]) / parts
    run = rollout(scene, integrator="rk4", angle=angle, velocity=velocity, dt=step, every=parts,
                  duration=float(time[-1]), diagnostics=(), warn=False)
    reached = min(len(run.time), len(time)) - (1 if run.stop_reason else 0)
    angles, speeds = np.full((2, len(time)), math.nan)
    angles[:reached], speeds[:reached] = run.angle[:reached], run.velocity[:reached]
    marks = np.unique(np.linspace(0, reached - 1, min(MARKS, reached)).astype(int))
    try:
        check = reference(scene, angle, velocity, time[marks])
    except StudyError as reason:
        return _unknown(time, f"none: {reason}")
    error = max(float(np.max(np.abs(angles[marks] - check.angle))), check.error_estimate)
    if run.stop_reason == "diverged" or not error <= TOLERANCE:
        return _unknown(time, f"none: rk4 at {step:.3g} s and an independent solution differ by {error:.2g} rad")
    how = f"rk4 at {step:.3g} s, confirmed to {error:.1g} rad by another: {check.how}"
    return Truth(time, angles, speeds, error, how)


def _parts(scene: Scene, time: FloatArray) -> int:
    """Steps of the numerical truth from one time to the next."""
    wanted = math.ceil(float(time[1]) * max(scene.omega0, 1.0) / FINE)
    return max(1, min(max(8, wanted), MOST[resolve("auto")] // len(time)))


def _while_taut(scene: Scene, angle: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The motion up to where a wire would have to push."""
    gravity = scene.coefficients.get("gravity_rate")
    if scene.body.suspension == "rod" or gravity is None:
        return angle, velocity
    slack = np.maximum.accumulate(velocity * velocity + gravity * np.cos(angle) < 0.0)
    return np.where(slack, math.nan, angle), np.where(slack, math.nan, velocity)


def _unknown(time: FloatArray, why: str) -> Truth:
    nothing = np.full(len(time), math.nan)
    return Truth(time, nothing, nothing, math.nan, why)
