"""An example of each effect, as geometry and medium determine it or with numbers where they cannot; and two made up."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    EFFECTS,
    BearingFriction,
    CoulombFriction,
    Effect,
    HorizontalDrive,
    PeriodicTorque,
    SmoothFriction,
    VerticalDrive,
)
from pendulum_env.physics.medium import air
from pendulum_env.physics.scene import Scene

GIVEN: dict[str, Effect] = {
    "bearing_friction": BearingFriction(bearing_viscosity=0.004),
    "coulomb_friction": CoulombFriction(friction_torque=0.003),
    "smooth_friction": SmoothFriction(friction_torque=0.003, friction_width=0.05),
    "periodic_torque": PeriodicTorque(drive_torque=0.02, drive_rate=4.5, drive_phase=0.4),
    "vertical_drive": VerticalDrive(vertical_amplitude=0.02, vertical_rate=40.0, vertical_phase=-1.1),
    "horizontal_drive": HorizontalDrive(horizontal_amplitude=0.03, horizontal_rate=7.0, horizontal_phase=2.0),
}
"""Effects that cannot be had without numbers."""


def scene_of(name: str) -> Scene:
    body = Body(length=0.353, mass=0.040, radius=0.0107)
    return Scene(body=body, medium=air(20.0), effects=(GIVEN.get(name) or EFFECTS[name](),))


def blow(velocity: float, blow_rate: float) -> float:
    return blow_rate * velocity * velocity * velocity


@dataclass(frozen=True)
class Blow(Effect):
    """v' = v**3/2: from v = 1 it is 1/sqrt(1 - t)."""

    name = "blow"
    kind = "drive"
    equation = "{blow_rate} theta'^3"
    source = "made up"
    torque = staticmethod(blow)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"blow_rate": 0.5}


def rub(velocity: float, rub_rate: float, rub_width: float) -> float:
    return -rub_rate * math.tanh(velocity / rub_width)


@dataclass(frozen=True)
class Rub(Effect):
    """v' = -c tanh(v/w), dry friction without its jump: sinh(v/w) falls as exp(-c t/w)."""

    rub_rate: float = 0.5
    rub_width: float = 0.05

    name = "rub"
    kind = "dissipative"
    equation = "- {rub_rate} tanh(theta'/{rub_width})"
    source = "made up"
    torque = staticmethod(rub)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"rub_rate": self.rub_rate, "rub_width": self.rub_width}
