"""The scenes that come with the package, from the textbook to the lab bench."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    BearingFriction,
    CoulombFriction,
    Gravity,
    HorizontalDrive,
    LinearDrag,
    Motor,
    PeriodicTorque,
    QuadraticDrag,
    SmallAngleGravity,
    VerticalDrive,
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
    (
        Scene("driven", _ROD, air(20.0),
              (Gravity(), BearingFriction(bearing_viscosity=5e-4), QuadraticDrag(drag_coefficient=0.46),
               HorizontalDrive(horizontal_amplitude=0.005, horizontal_rate=5.0)),
              9.81, Run(angle=0.0, dt=0.01, duration=60.0)),
        "the bench's ball from rest, its pivot shaken sideways by 5 mm near resonance: beats, then a steady swing",
    ),
    (
        Scene("chaotic",
              effects=(Gravity(), LinearDrag(gamma=0.5),
                       PeriodicTorque(drive_torque=1.5, drive_rate=2.0 / 3.0)),
              gravity=1.0, run=Run(angle=0.2, dt=0.02, duration=100.0)),
        "theta'' + theta'/2 + sin(theta) = drive_torque cos(2t/3) of Baker & Gollub: 0.9 repeats, 1.07 doubles the "
        "period, 1.15 and 1.5 are chaotic",
    ),
    (
        Scene("kapitza", Body(length=0.1, mass=0.040, radius=0.0107), air(20.0),
              (Gravity(), BearingFriction(bearing_viscosity=4e-4),
               VerticalDrive(vertical_amplitude=0.02, vertical_rate=100.0)),
              9.81, Run(angle=math.pi - 0.3, dt=0.001, duration=5.0)),
        "10 cm upside down, its pivot shaken up and down by 2 cm 16 times a second: it stays up; steps of 2 ms or less",
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
