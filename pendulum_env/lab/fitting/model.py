"""What is fitted: a scene with free numbers, run from a free start and seen by a sensor with a free zero.

``angle_i = zero + scale theta(t_i)`` at the times of a recording, theta from release on; scale is 1 unless it is free.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.rollout import Rollout, rollout
from pendulum_env.physics.damping import NONE, with_damping
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

ANGLE, VELOCITY, ZERO = "angle", "velocity", "zero"
LENGTH, GRAVITY = "length", "gravity"
START = (ANGLE, VELOCITY, ZERO)
"""Fitted beside the scene's own numbers."""
SCALE = "scale"
UNITS = {ANGLE: "rad", VELOCITY: "rad/s", ZERO: "rad", SCALE: "1"}
SENSOR = (*START, SCALE)
"""What can be fitted and is no number of the scene."""
METHOD = "tsit5"
STEPS = 64
"""Steps per small-angle period; with cubic Hermite polynomials between them, to 4e-7 of the amplitude up to 170
degrees."""
DECOY = 1e-3
"""Relative change of the numbers of a run before the others, by which all of them are the program's arguments."""


@dataclass(frozen=True, eq=False)
class Model:
    """A scene and what of it is free.

    Attributes:
        scene: with all dampings of ``program``, those that are not of the model at 0, so that models share compiled
            code.
        damping: the model's dampings, by their names in ``damping=``.
        names: what is fitted: START, "scale" if it is free, then names as :meth:`Scene.replace` takes them.
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
            free: what is fitted beside the dampings' numbers: the scene's own parameters, or "scale".
            program: dampings whose terms are compiled, those of the model among them.
        """
        wanted = idle(dict.fromkeys((*program, *damping)))
        own = [_fitted(name) for name in damping if DAMPINGS[name].fitted]
        return cls(with_damping(scene, wanted or NONE), damping, (*START, *free, *own), time)

    @property
    def title(self) -> str:
        """The dampings as ``damping=`` takes them."""
        return "+".join(self.damping) or NONE

    @property
    def free(self) -> tuple[str, ...]:
        """What is fitted beside the start and the dampings' numbers."""
        own = {*START, *self.numbers}
        return tuple(name for name in self.names if name not in own)

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
        """Angles as the sensor shows them [rad], ``(runs, times)``, for parameters ``(runs, names)``; nan after a
        stop."""
        return self._seen(values, 0)

    def motion(self, values: Array) -> tuple[Array, Array]:
        """Angles as the sensor shows them, and the velocities of the pendulum [rad, rad/s], ``(runs, times)`` each."""
        rows = np.atleast_2d(values)
        return self._seen(rows, 0), self._seen(rows, 1)

    def _seen(self, values: Array, derivative: int) -> Array:
        """The angles, or velocities, between the steps of a batch of runs."""
        from scipy.interpolate import CubicHermiteSpline

        rows = np.atleast_2d(values)
        run = self._runs(rows)
        angle, velocity = run.angle[1:], run.velocity[1:]
        ended = ~(np.isfinite(angle) & np.isfinite(velocity))
        angle, velocity = np.where(ended, 0.0, angle).T, np.where(ended, 0.0, velocity).T
        curve = CubicHermiteSpline(run.time, angle, velocity)(self.time, derivative).T
        if ended.any():
            curve[ended[:, np.searchsorted(run.time, self.time, side="right").clip(max=len(run.time) - 1)]] = math.nan
        if derivative:
            return np.asarray(curve)
        if SCALE in self.names:
            curve *= rows[:, self.names.index(SCALE), None]
        return np.asarray(curve + rows[:, self.names.index(ZERO), None])

    def _runs(self, rows: Array) -> Rollout:
        """The runs, behind a first one that is the same in every call and has numbers unlike theirs.

        A number that is the same in all runs would be compiled in, and each set of such numbers its own program; and
        programs are remembered by the scene of the first run.
        """
        given = dict(zip(self.names, rows.T, strict=True))
        start = [np.append(given[name][0], given[name]) for name in (ANGLE, VELOCITY)]
        numbers: dict[str, Any] = {
            name: np.append(value * (1.0 + DECOY) + 1e-9, given.get(name, np.full(len(rows), value)))
            for name, value in self._told.items()
        }
        step = math.tau / self.scene_with(rows[0]).omega0 / STEPS
        duration = max(float(self.time[-1]), step) + step
        return rollout(self._stiff, integrator=METHOD, angle=start[0], velocity=start[1], dt=step, duration=duration,
                       diagnostics=(), warn=False, num_threads=1, **numbers)

    @cached_property
    def _told(self) -> dict[str, float]:
        """The scene's values of all numbers that differ between runs: those of all dampings that are compiled in, what
        is free, and the length."""
        own = [effect for effect in self.scene.effects if effect.kind == "dissipative" and effect.fitted]
        known = {LENGTH: self.scene.body.length, **self.scene.parameters()}
        found = {name: float(known[name] or 0.0) for name in (LENGTH, *self.free) if name not in SENSOR}
        return {**found, **{_fitted(effect.damping): float(getattr(effect, effect.fitted)) for effect in own}}

    @cached_property
    def _stiff(self) -> Scene:
        """The same on a rod, as fits know of no slack wire."""
        return self.scene.replace(suspension="rod", thickness=self.scene.body.diameter)

    def scene_with(self, values: Array) -> Scene:
        """The scene with these numbers, and only the model's dampings."""
        own = {name: float(x) for name, x in zip(self.names, values, strict=True) if name not in SENSOR}
        return with_damping(self.scene, self.title).replace(**own)


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


def idle(names: Iterable[str]) -> dict[str, dict[str, float]]:
    """Dampings as ``with_damping`` takes them, each that has a number that a decay gives with that number at 0."""
    return {name: {DAMPINGS[name].fitted: 0.0} if DAMPINGS[name].fitted else {} for name in names}
