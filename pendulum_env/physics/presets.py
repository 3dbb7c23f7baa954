"""The scenes that come with the package: one function for each, and one list."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from os import PathLike
from types import MappingProxyType

from pendulum_env.physics.bodies import Kater, Rod, Torsion
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    AddedMass,
    BearingFriction,
    Buoyancy,
    Clip,
    CoulombFriction,
    Fibre,
    FiniteBob,
    Gravity,
    Gusts,
    HorizontalDrive,
    LinearDrag,
    Motor,
    PeriodicTorque,
    QuadraticDrag,
    SmallAngleGravity,
    SphereDrag,
    Suspension,
    VerticalDrive,
    Wind,
    WireDrag,
)
from pendulum_env.physics.medium import air, glycerol
from pendulum_env.physics.medium import water as liquid_water
from pendulum_env.physics.scene import Run, Scene
from pendulum_env.physics.units import SceneError, first_line, nearest, shown

_WIRE = Body(length=0.353, mass=0.040, radius=0.0107, suspension="wire")
_ROD = Body(length=0.353, mass=0.040, radius=0.0107, suspension="rod")
_BEARING = LinearDrag(gamma=0.02)
_MOTOR = Motor(max_torque=0.05)


def textbook() -> Scene:
    """The harmonic oscillator, exact in every textbook: 1 m, 1 kg, small angles, no losses.

    Order, growth and phase error of every method are known in closed form for this scene.
    """
    return Scene("textbook", effects=(SmallAngleGravity(),), run=Run(angle=0.1, dt=0.01, duration=10.0))


def vacuum() -> Scene:
    """The mathematical pendulum: 1 m, 1 kg on a rod, any angle, no losses.

    The exact motion is known in Jacobi's elliptic functions, so all loss of energy in a run is an error of the method.
    """
    return Scene("vacuum", effects=(Gravity(),), run=Run(angle=1.0, dt=0.01, duration=20.0))


def exercise() -> Scene:
    """The lab exercise: 40 g steel ball on a 0.353 m wire from 5 degrees, small angles, no losses, 10 s.

    Shows that forward Euler fails, backward Euler damps and symplectic Euler conserves energy.
    """
    run = Run(angle=math.radians(5.0), dt=0.01, duration=10.0)
    return Scene("exercise", _WIRE, air(20.0), (SmallAngleGravity(),), 9.8, run)


def exercise_large() -> Scene:
    """The lab exercise's second part: a 40 g steel ball from 30 degrees, full gravity, linear damping, 2 minutes.

    For comparison with a recording, and to check by the Reynolds number whether damping is linear at all.
    """
    run = Run(angle=math.radians(30.0), dt=0.01, duration=120.0)
    return Scene("exercise_large", _WIRE, air(20.0), (Gravity(), LinearDrag(gamma=0.02)), 9.8, run)


def lab() -> Scene:
    """The lab bench: a ball on a thin steel rod from a sensor's shaft, air drag, viscous bearing, a small motor.

    The default scene of the environment. The motor is too weak to lift the ball directly and has to swing it up. The
    rod's mass, 22 % of the ball's, is left out, which makes the period 1.7 % too long: ``lab_rod`` has it.
    """
    run = Run(angle=math.radians(30.0), dt=0.01, duration=60.0)
    return Scene("lab", _ROD, air(20.0), (Gravity(), QuadraticDrag(), _BEARING, _MOTOR), 9.81, run)


def lab_rod() -> Scene:
    """The lab bench with the mass of its rod: the period is 1.6 % shorter than in the scene lab."""
    gravity, *others = lab().effects
    return dataclasses.replace(lab(), name="lab_rod", effects=(gravity, Suspension(), *others))


def sticky_bearing() -> Scene:
    """The lab bench with a worn bearing: dry friction brings the ball to rest, off centre, in finite time.

    Shows amplitudes that fall by equal amounts, and tests methods that must locate the zeros of the velocity. As in
    ``lab``, the mass of the rod is left out, which makes the period 1.7 % too long.
    """
    effects = (*lab().effects, CoulombFriction(friction_torque=0.001))
    return dataclasses.replace(lab(), name="sticky_bearing", effects=effects)


def motor_bench() -> Scene:
    """A real motor bench that can swing its pendulum up: 0.5 m, a geared drive, dry friction, a torque of 1.5 N m.

    The numbers are a fit of two logs of the torque-limited simple pendulum of Wiebe et al. 2022 (J. Open Source Softw.
    7, 3884): I = 0.188 kg m^2, m g L = 3.63 N m, viscous friction 0.015 +- 0.006 N m s, dry friction 0.15 +- 0.02 N m,
    in units of the torque that the drive reports, so that its records can be replayed. By the weights of the parts,
    that torque is 1.2 to 1.35 times the true one. The bob is the point mass with the same period and moment of inertia.
    The encoder reads in steps of 0.0029 rad, and the column of the torque is late by 5 +- 4 ms.
    """
    effects = (Gravity(), BearingFriction(bearing_viscosity=0.015), CoulombFriction(friction_torque=0.15),
               Motor(max_torque=1.5))
    body = Body(length=0.507, mass=0.73, radius=0.03)
    run = Run(angle=math.radians(60.0), dt=0.005, duration=20.0)
    return Scene("motor_bench", body, effects=effects, gravity=9.81, run=run)


def moon() -> Scene:
    """The lab bench on the Moon: g = 1.62 m/s^2 and no air, so that a swing takes 2.5 times as long.

    The only damping is that of the bearing, and the motor of the bench is strong enough to lift the ball directly. As
    in ``lab``, the mass of the rod is left out, which makes the period 1.7 % too long.
    """
    run = Run(angle=math.radians(30.0), dt=0.02, duration=120.0)
    return Scene("moon", _ROD, effects=(Gravity(), _BEARING, _MOTOR), gravity=1.62, run=run)


def water() -> Scene:
    """A steel ball in a tank of water: buoyancy makes it lighter, the water that moves along makes it heavier.

    Shows drag that is neither linear nor quadratic, C_d(Re): the first oscillation loses half of its amplitude, later
    ones less and less.
    """
    effects = (Gravity(), FiniteBob(), Suspension(), Buoyancy(), AddedMass(), SphereDrag(), WireDrag())
    run = Run(angle=math.radians(30.0), dt=0.01, duration=20.0)
    return Scene("water", _WIRE, liquid_water(20.0), effects, 9.81, run)


def overdamped() -> Scene:
    """A steel bead of 8 mm in glycerol, Q = 0.1: it creeps back to the bottom and never swings.

    Shows steps limited by the drag and not by the swing: gamma is 46 1/s, and explicit methods need gamma h below
    about 2. Re stays below 1, so Stokes' law holds.
    """
    effects = (Gravity(), Suspension(), Buoyancy(), AddedMass(), LinearDrag())
    body = Body(length=0.353, mass=0.0021, radius=0.004, suspension="wire")
    run = Run(angle=math.radians(45.0), dt=0.01, duration=5.0)
    return Scene("overdamped", body, glycerol(20.0), effects, 9.81, run)


def clock_bob() -> Scene:
    """A regulator clock's pendulum that beats seconds: 6 kg of brass on a steel rod, 1 degree, Q = 54000 in air.

    Shows phase errors that accumulate almost without damping, and corrections of one part in a hundred thousand, which
    is one second a day. The loss in the suspension spring is left out.
    """
    layered = (AddedMass(boundary_layer=True), LinearDrag(boundary_layer=True))
    effects = (Gravity(), FiniteBob(), Suspension(), Buoyancy(), *layered)
    body = Body(length=0.9985, mass=6.0, radius=0.055, thickness=0.006)
    return Scene("clock_bob", body, air(20.0), effects, 9.81, Run(angle=math.radians(1.0), dt=0.02, duration=100.0))


def driven() -> Scene:
    """The lab bench's ball from rest, its pivot shaken sideways by 5 mm near resonance: beats, then a steady swing.

    Shows the amplitude that the damping allows, and the phase lag of the swing behind the pivot. As in ``lab``, the
    mass of the rod is left out, which makes the period 1.7 % too long.
    """
    effects = (
        Gravity(), BearingFriction(bearing_viscosity=5e-4), QuadraticDrag(drag_coefficient=0.46),
        HorizontalDrive(horizontal_amplitude=0.005, horizontal_rate=5.0),
    )
    return Scene("driven", _ROD, air(20.0), effects, 9.81, Run(angle=0.0, dt=0.01, duration=60.0))


def windy() -> Scene:
    """A table-tennis ball on a light rod in a gusty wind, with a motor to hold it: work by the air, heat in the air.

    The wind of 3 m/s tilts the rod by 7 degrees; gusts come and go within half a second. The seed determines the gusts.
    The mass of the rod is left out: 2 mm of steel would weigh three times as much as the ball, and without it the
    period is 12.2 % too long, so think of a straw.
    """
    effects = (
        Gravity(), QuadraticDrag(drag_coefficient=0.45), BearingFriction(bearing_viscosity=1e-5), Wind(wind_speed=3.0),
        Gusts(gust_speed=1.0, gust_time=0.5), Motor(max_torque=0.005),
    )
    body = Body(length=0.353, mass=0.0027, radius=0.020)
    return Scene("windy", body, air(20.0), effects, 9.81, Run(angle=math.radians(30.0), dt=0.01, duration=60.0))


def chaotic() -> Scene:
    """Baker and Gollub's theta'' + theta'/2 + sin(theta) = drive_torque cos(2t/3), chaotic at 1.15 and 1.5.

    At a drive_torque of 0.9 the motion repeats with the drive's period, at 1.07 with twice that period. Shows errors
    that double with every second, whatever the method.
    """
    effects = (Gravity(), LinearDrag(gamma=0.5), PeriodicTorque(drive_torque=1.5, drive_rate=2.0 / 3.0))
    return Scene("chaotic", effects=effects, gravity=1.0, run=Run(angle=0.2, dt=0.02, duration=100.0))


def kapitza() -> Scene:
    """10 cm upside down, its pivot shaken up and down by 2 cm 16 times a second: it stays up; steps of 2 ms or less.

    It falls for ``vertical_rate`` below about 70: upright is stable where (Omega b)**2 is above 2 g L.
    """
    effects = (
        Gravity(), BearingFriction(bearing_viscosity=4e-4), VerticalDrive(vertical_amplitude=0.02, vertical_rate=100.0)
    )
    body = Body(length=0.1, mass=0.040, radius=0.0107)
    return Scene("kapitza", body, air(20.0), effects, 9.81, Run(angle=math.pi - 0.3, dt=0.001, duration=5.0))


def rod() -> Scene:
    """A steel rod hung by its end in air: it swings like a ball on a wire of two thirds of its length.

    Buoyancy, the air that moves along and the drag along the length follow from the rod's measures.
    """
    effects = (
        Gravity(), Buoyancy(), AddedMass(), WireDrag(), BearingFriction(bearing_viscosity=2e-5))
    body = Rod(length=0.5, mass=0.111, width=0.006)
    return Scene("rod", body, air(20.0), effects, 9.81, Run(angle=math.radians(30.0), dt=0.01, duration=30.0))


def kater() -> Scene:
    """Kater's reversible pendulum, tuned: one period from both knife edges, which gives g without the inertia.

    ``inverted=true`` hangs it from the other edge. Shows that g is 4 pi**2 times the distance of the edges over T**2.
    """
    return Scene("kater", Kater(), effects=(Gravity(),), run=Run(angle=math.radians(5.0), dt=0.02, duration=40.0))


def torsion() -> Scene:
    """A torsion pendulum: a disc turns on a fibre. Its period of 10 s depends neither on the amplitude nor on gravity.

    Cavendish and Coulomb weighed tiny torques with it. The exact motion is the damped harmonic oscillator's.
    """
    effects = (Fibre(stiffness=0.001), LinearDrag(gamma=0.02))
    return Scene("torsion", Torsion(), effects=effects, run=Run(angle=math.radians(90.0), dt=0.1, duration=120.0))


def gymnasium() -> Scene:
    """Gymnasium's Pendulum-v1: a rod of 1 m and 1 kg, no losses, 2 N m, and its clip of the velocity at 8 rad/s.

    With the task ``gymnasium``, symplectic Euler and steps of 0.05 s, which environments of this scene take by default,
    it is that environment. The clip takes energy, ``heat_clip``; no other scene has one.
    """
    effects = (Gravity(), Motor(max_torque=2.0), Clip(clip_speed=8.0))
    body = Rod(length=1.0, mass=1.0, width=1e-9)
    return Scene("gymnasium", body, effects=effects, gravity=10.0, run=Run(angle=1.0, dt=0.05, duration=10.0))


def dm_control() -> Scene:
    """The pendulum of dm_control's suite: a ball of 1 kg at 0.5 m, a bearing of 0.1 N m s, a motor of 1 N m.

    With the task ``dm_control`` and steps of 0.02 s it is that program's swing-up, up to the integrator: MuJoCo's
    semi-implicit Euler treats the bearing implicitly.
    """
    effects = (Gravity(), FiniteBob(), BearingFriction(bearing_viscosity=0.1), Motor(max_torque=1.0))
    body = Body(length=0.5, mass=1.0, radius=0.05)
    return Scene("dm_control", body, effects=effects, gravity=9.81, run=Run(angle=1.0, dt=0.02, duration=20.0))


_ALL: tuple[Callable[[], Scene], ...] = (
    textbook, vacuum, exercise, exercise_large, lab, lab_rod, sticky_bearing, water, overdamped, driven, chaotic,
    kapitza, windy, clock_bob, moon, rod, kater, torsion, gymnasium, dm_control,
    motor_bench,
)

SCENES: Mapping[str, Scene] = MappingProxyType({preset.__name__: preset() for preset in _ALL})
"""The scenes that come with the package, by name."""

PURPOSES: Mapping[str, str] = MappingProxyType({preset.__name__: first_line(preset) for preset in _ALL})
"""One line on the purpose of each scene, by the scene's name."""


EPISODES: Mapping[str, tuple[str, float]] = MappingProxyType({
    "gymnasium": ("symplectic_euler", 0.05), "dm_control": ("symplectic_euler", 0.02),
})
"""Scene that stands for another program's environment -> the method and the control step [s] of its episodes there."""


def find_scene(scene: str | Scene | Mapping[str, object] | PathLike[str]) -> Scene:
    """Return a scene from a preset's name, a JSON file's path (as text, ending in .json), a dict, or a Scene.

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
        raise SceneError(f"There is no scene {shown(scene)}{nearest(scene, SCENES)}")
    if isinstance(scene, PathLike):
        return Scene.load(scene)
    raise SceneError(f"A scene is a preset's name, a JSON file, a dict or a Scene, not {shown(scene)}.")
