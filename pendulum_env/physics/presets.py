"""The scenes that come with the package: a function each, and one list for all who ask."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    CoulombFriction,
    Gravity,
    LinearDrag,
    Motor,
    QuadraticDrag,
    SmallAngleGravity,
)
from pendulum_env.physics.medium import air
from pendulum_env.physics.scene import Run, Scene
from pendulum_env.physics.units import SceneError, first_line, nearest

_WIRE = Body(length=0.353, mass=0.040, radius=0.0107, suspension="wire")
_ROD = Body(length=0.353, mass=0.040, radius=0.0107, suspension="rod")
_BEARING = LinearDrag(gamma=0.02)
_MOTOR = Motor(max_torque=0.05)


def textbook() -> Scene:
    """The harmonic oscillator, exact in every textbook: 1 m, 1 kg, small angles, no losses.

    Every method's order, growth and phase error are known in closed form here.
    """
    return Scene("textbook", effects=(SmallAngleGravity(),), run=Run(angle=0.1, dt=0.01, duration=10.0))


def vacuum() -> Scene:
    """The mathematical pendulum: 1 m, 1 kg on a rod, any angle, no losses.

    Its motion is known in Jacobi's elliptic functions, so that errors of methods can be told from damping.
    """
    return Scene("vacuum", effects=(Gravity(),), run=Run(angle=1.0, dt=0.01, duration=20.0))


def exercise() -> Scene:
    """The lab exercise: 40 g steel ball on a 0.353 m wire from 5 degrees, small angles, no losses, 10 s.

    To see forward Euler fail, backward Euler damp and symplectic Euler conserve.
    """
    run = Run(angle=math.radians(5.0), dt=0.01, duration=10.0)
    return Scene("exercise", _WIRE, air(20.0), (SmallAngleGravity(),), 9.8, run)


def exercise_large() -> Scene:
    """The exercise's second part: the same ball from 30 degrees, full gravity, linear damping, 2 minutes.

    To compare with a recording, and to ask by the Reynolds number whether damping is linear at all.
    """
    run = Run(angle=math.radians(30.0), dt=0.01, duration=120.0)
    return Scene("exercise_large", _WIRE, air(20.0), (Gravity(), LinearDrag(gamma=0.02)), 9.8, run)


def lab() -> Scene:
    """The bench: the ball on a thin steel rod from the sensor's shaft, air drag, viscous bearing, a small motor.

    The default of the environment. The motor is too weak to lift the ball, and has to pump.
    """
    run = Run(angle=math.radians(30.0), dt=0.01, duration=60.0)
    return Scene("lab", _ROD, air(20.0), (Gravity(), QuadraticDrag(), _BEARING, _MOTOR), 9.81, run)


def sticky_bearing() -> Scene:
    """The bench with a worn bearing: dry friction brings it to rest, off centre, in finite time.

    To see amplitudes that fall by equal amounts, and methods that have to find where the velocity is zero.
    """
    effects = (*lab().effects, CoulombFriction(friction_torque=0.001))
    return dataclasses.replace(lab(), name="sticky_bearing", effects=effects)


def moon() -> Scene:
    """The bench on the Moon: g = 1.62 m/s^2 and no air, so that a swing takes 2.5 times as long.

    What is left of the damping is the bearing's, and the same motor now lifts the ball without pumping.
    """
    run = Run(angle=math.radians(30.0), dt=0.02, duration=120.0)
    return Scene("moon", _ROD, effects=(Gravity(), _BEARING, _MOTOR), gravity=1.62, run=run)


_ALL: tuple[Callable[[], Scene], ...] = (textbook, vacuum, exercise, exercise_large, lab, sticky_bearing, moon)

SCENES: Mapping[str, Scene] = MappingProxyType({preset.__name__: preset() for preset in _ALL})
"""Every preset by name."""

PURPOSES: Mapping[str, str] = MappingProxyType({preset.__name__: first_line(preset) for preset in _ALL})
"""What each preset is for, in a line."""


def find_scene(scene: str | Scene | Mapping[str, object]) -> Scene:
    """A scene from a preset's name, a JSON file's path (ending in .json), a dict, or itself.

    Raises SceneError for unknown names, with the nearest one.
    """
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, Mapping):
        return Scene.from_dict(scene)
    if isinstance(scene, str):
        if scene.endswith(".json"):
            return Scene.load(scene)
        if scene in SCENES:
            return SCENES[scene]
        raise SceneError(f"There is no scene '{scene}'{nearest(scene, SCENES)}")
    raise SceneError(f"A scene is a preset's name, a JSON file, a dict or a Scene, not {scene!r}.")
