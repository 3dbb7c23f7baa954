"""The effects that a scene may have: one file for each, and one list."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from pendulum_env.physics.effects.added_mass import AddedMass
from pendulum_env.physics.effects.bearing_friction import BearingFriction
from pendulum_env.physics.effects.buoyancy import Buoyancy
from pendulum_env.physics.effects.clip import Clip
from pendulum_env.physics.effects.coulomb_friction import CoulombFriction
from pendulum_env.physics.effects.driven_pivot import HorizontalDrive, VerticalDrive
from pendulum_env.physics.effects.effect import Effect
from pendulum_env.physics.effects.fibre import Fibre
from pendulum_env.physics.effects.finite_size import FiniteBob, Suspension
from pendulum_env.physics.effects.gravity import Gravity
from pendulum_env.physics.effects.linear_drag import LinearDrag
from pendulum_env.physics.effects.motor import Motor
from pendulum_env.physics.effects.periodic_torque import PeriodicTorque
from pendulum_env.physics.effects.quadratic_drag import QuadraticDrag
from pendulum_env.physics.effects.small_angle_gravity import SmallAngleGravity
from pendulum_env.physics.effects.smooth_friction import SmoothFriction
from pendulum_env.physics.effects.sphere_drag import SphereDrag
from pendulum_env.physics.effects.wind import Gusts, Wind
from pendulum_env.physics.effects.wire_drag import WireDrag

_ALL: tuple[type[Effect], ...] = (
    Gravity, SmallAngleGravity, Fibre, FiniteBob, Suspension, Buoyancy, AddedMass,
    LinearDrag, QuadraticDrag, SphereDrag, WireDrag, BearingFriction, CoulombFriction,
    SmoothFriction,
    Wind, Gusts,
    Motor, PeriodicTorque, VerticalDrive, HorizontalDrive,
    Clip,
)

EFFECTS: Mapping[str, type[Effect]] = MappingProxyType({effect.name: effect for effect in _ALL})
"""Every effect by name."""

DAMPINGS: Mapping[str, type[Effect]] = MappingProxyType({e.damping: e for e in _ALL if e.damping})
"""The dissipative effects by their names in ``damping=``."""

__all__ = [
    "DAMPINGS",
    "EFFECTS",
    "AddedMass",
    "BearingFriction",
    "Buoyancy",
    "Clip",
    "CoulombFriction",
    "Effect",
    "Fibre",
    "FiniteBob",
    "Gravity",
    "Gusts",
    "HorizontalDrive",
    "LinearDrag",
    "Motor",
    "PeriodicTorque",
    "QuadraticDrag",
    "SmallAngleGravity",
    "SmoothFriction",
    "SphereDrag",
    "Suspension",
    "VerticalDrive",
    "Wind",
    "WireDrag",
]
