"""What is fitted: a scene with free numbers, run from a free start and seen by a sensor with a free zero.

``angle_i = zero + theta(t_i)`` at the times of a recording, theta from release on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.damping import with_damping
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

ANGLE, VELOCITY, ZERO = "angle", "velocity", "zero"
LENGTH, GRAVITY = "length", "gravity"
START = (ANGLE, VELOCITY, ZERO)
"""Fitted beside the scene's own numbers."""
UNITS = {ANGLE: "rad", VELOCITY: "rad/s", ZERO: "rad"}
METHOD = "dop853"
STEPS = 50
"""Steps per small-angle period; between them cubic Hermite polynomials, to 7e-7 of a small amplitude."""


@dataclass(frozen=True, eq=False)
class Model:
    """A scene and what of it is free.

    Attributes:
        scene: with all dampings of ``program``, those that are not of the model at 0, so that models share compiled
            code.
        damping: the model's dampings, by their names in ``damping=``.
        names: what is fitted: START, then names as :meth:`Scene.replace` takes them.
        time: where the angle is wanted [s], from 0.
    """

    scene: Scene
    damping: tuple[str, ...]
    names: tuple[str, ...]
    time: Array

    @classmethod
    def of(
        cls,
        scene: Scene,
        damping: tuple[str, ...],
        time: Array,
        free: tuple[str, ...] = (LENGTH,),
        program: tuple[str, ...] = (),
    ) -> Model:
        """The model with these dampings in place of the scene's own.

        Args:
            free: the scene's own parameters that are fitted beside the dampings' numbers.
            program: dampings whose terms are compiled, those of the model among them.
        """
        wanted = {name: _zero(name) for name in dict.fromkeys((*damping, *program))}
        own = [_fitted(name) for name in damping if DAMPINGS[name].fitted]
        return cls(with_damping(scene, wanted if wanted else "none"), damping, (*START, *free, *own), time)

    @property
    def free(self) -> tuple[str, ...]:
        """What is fitted beside the start and the dampings' numbers."""
        own = {_fitted(name) for name in self.damping}
        return tuple(name for name in self.names if name not in START and name not in own)

    @property
    def numbers(self) -> tuple[str, ...]:
        """The dampings' numbers that are fitted, of those that have one."""
        return tuple(_fitted(name) for name in self.damping if DAMPINGS[name].fitted)

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
        step = math.tau / self.scene_with(rows[0]).omega0 / STEPS
        duration = max(float(self.time[-1]), step) + step
        run = rollout(self._stiff, integrator=METHOD, angle=angle, velocity=velocity, dt=step, duration=duration,
                      diagnostics=(), warn=False, **given)
        curve = CubicHermiteSpline(run.time, run.angle.T, run.velocity.T)
        return zero[:, None] + curve(self.time).T, curve(self.time, 1).T

    @cached_property
    def _stiff(self) -> Scene:
        """The same on a rod, as fits know of no slack wire."""
        return self.scene.replace(suspension="rod", thickness=self.scene.body.diameter)

    def scene_with(self, values: Array) -> Scene:
        """The scene with these numbers, and only the model's dampings."""
        own = {name: float(x) for name, x in zip(self.names, values, strict=True) if name not in START}
        return with_damping(self.scene, "+".join(self.damping) or "none").replace(**own)


def unit_of(scene: Scene, name: str) -> str:
    """Unit of a fitted parameter."""
    if name in UNITS:
        return UNITS[name]
    owners = {effect.name: effect for effect in scene.effects}
    part, _, own = name.rpartition(".")
    for owner in (owners[part],) if part in owners else (scene, scene.body, scene.medium, *scene.effects):
        for entry in fields(owner):  # type: ignore[arg-type]
            if entry.name == own and "unit" in entry.metadata:
                return str(entry.metadata["unit"])
    raise KeyError(name)


def _fitted(name: str) -> str:
    """Full name of the number of a damping that a decay gives."""
    return f"{DAMPINGS[name].name}.{DAMPINGS[name].fitted}"


def _zero(name: str) -> dict[str, float]:
    return {DAMPINGS[name].fitted: 0.0} if DAMPINGS[name].fitted else {}
