"""The scenes that come with the package, from the textbook to the lab bench."""

from __future__ import annotations

import math
from collections.abc import Mapping
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
from pendulum_env.physics.units import SceneError, nearest

_WIRE = Body(length=0.353, mass=0.040, radius=0.0107, suspension="wire")
_ROD = Body(length=0.353, mass=0.040, radius=0.0107, suspension="rod")
_LAB = (Gravity(), QuadraticDrag(), LinearDrag(gamma=0.02), Motor(max_torque=0.05))

_ALL: tuple[tuple[Scene, str], ...] = (
    (
        Scene("textbook", effects=(SmallAngleGravity(),), run=Run(angle=0.1, dt=0.01, duration=10.0)),
        "1 m, 1 kg, small angles, no losses: the harmonic oscillator, exact in every textbook",
    ),
    (
        Scene("vacuum", effects=(Gravity(),), run=Run(angle=1.0, dt=0.01, duration=20.0)),
        "1 m, 1 kg on a rod, any angle, no losses: the mathematical pendulum",
    ),
    (
        Scene("exercise", _WIRE, air(20.0), (SmallAngleGravity(),), 9.8,
              Run(angle=math.radians(5.0), dt=0.01, duration=10.0)),
        "the lab exercise: 40 g steel ball on a 0.353 m wire from 5 degrees, small angles, no losses, 10 s",
    ),
    (
        Scene("exercise_large", _WIRE, air(20.0), (Gravity(), LinearDrag(gamma=0.02)), 9.8,
              Run(angle=math.radians(30.0), dt=0.01, duration=120.0)),
        "the exercise's second part: the same ball from 30 degrees, full gravity, linear damping, 2 minutes",
    ),
    (
        Scene("lab", _ROD, air(20.0), _LAB, 9.81, Run(angle=math.radians(30.0), dt=0.01, duration=60.0)),
        "the bench: the ball on a thin steel rod from the sensor's shaft, air drag, viscous bearing, a small motor",
    ),
    (
        Scene("sticky_bearing", _ROD, air(20.0), (*_LAB, CoulombFriction(friction_torque=0.001)), 9.81,
              Run(angle=math.radians(30.0), dt=0.01, duration=60.0)),
        "the bench with a worn bearing: dry friction brings it to rest, off centre, in finite time",
    ),
)

SCENES: Mapping[str, Scene] = MappingProxyType({scene.name: scene for scene, _ in _ALL})
"""Every preset by name."""

PURPOSES: Mapping[str, str] = MappingProxyType({scene.name: purpose for scene, purpose in _ALL})
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
