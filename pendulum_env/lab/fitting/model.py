"""What is fitted: a scene with free numbers, run from a free start and seen by a sensor with a free zero.

``angle_i = zero + theta(t_i)`` at the times of a recording, theta from release on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.damping import with_damping
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

ANGLE, VELOCITY, ZERO, LENGTH = "angle", "velocity", "zero", "length"
START = (ANGLE, VELOCITY, ZERO)
"""Fitted beside the scene's own numbers."""
METHOD = "dop853"
STEPS = 100
"""Steps per small-angle period; between them cubic Hermite polynomials, to 4e-8 of the amplitude."""
UNITS = {ANGLE: "rad", VELOCITY: "rad/s", ZERO: "rad", LENGTH: "m"}


@dataclass(frozen=True, eq=False)
class Model:
    """A scene and what of it is free.

    Attributes:
        scene: with the damping of the model, whatever its numbers.
        names: what is fitted: START, then names as :meth:`Scene.replace` takes them.
        time: where the angle is wanted [s], from 0.
    """

    scene: Scene
    names: tuple[str, ...]
    time: Array

    @classmethod
    def of(cls, scene: Scene, damping: tuple[str, ...], time: Array, lengths: bool = True) -> Model:
        """The model with these dampings in place of the scene's own; ``lengths``: with the length free."""
        numbers = {name: ({DAMPINGS[name].fitted: 0.0} if DAMPINGS[name].fitted else {}) for name in damping}
        place = with_damping(scene, numbers if numbers else "none")
        free = [f"{DAMPINGS[name].name}.{DAMPINGS[name].fitted}" for name in damping if DAMPINGS[name].fitted]
        if place.body.suspension == "wire":
            place = place.replace(slack="warn")
        return cls(place, (*START, *([LENGTH] if lengths else []), *free), time)

    @property
    def damping(self) -> tuple[str, ...]:
        """The names in ``damping=`` of the model's dissipative effects."""
        return tuple(effect.damping for effect in self.scene.of_kind("dissipative"))

    @property
    def least(self) -> Array:
        """Lower bounds of the parameters: damping never drives."""
        return np.array([-math.inf if name in START else 0.0 for name in self.names])

    def until(self, count: int) -> Model:
        """The model of the first ``count`` times only."""
        return replace(self, time=self.time[:count])

    def angles(self, values: Array) -> Array:
        """Angles at the times [rad], ``(runs, times)``, for parameters ``(runs, names)``; nan after a stop."""
        return self.motion(values)[0]

    def motion(self, values: Array) -> tuple[Array, Array]:
        """Angles and velocities at the times [rad, rad/s], each of shape ``(runs, times)``."""
        from scipy.interpolate import CubicHermiteSpline

        rows = np.atleast_2d(values)
        given = dict(zip(self.names, rows.T, strict=True))
        angle, velocity, zero = (given.pop(name) for name in START)
        step = math.tau / self.scene.omega0 / STEPS
        duration = max(float(self.time[-1]), step) + step
        run = rollout(self.scene, integrator=METHOD, angle=angle, velocity=velocity, dt=step, duration=duration,
                      diagnostics=(), warn=False, **given)
        curve = CubicHermiteSpline(run.time, run.angle.T, run.velocity.T)
        return zero[:, None] + curve(self.time).T, curve(self.time, 1).T

    def scene_with(self, values: Array) -> Scene:
        """The scene with these numbers."""
        own = {name: float(x) for name, x in zip(self.names, values, strict=True) if name not in START}
        return self.scene.replace(**own)
