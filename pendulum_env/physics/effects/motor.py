"""A motor on the pivot's shaft."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.units import SceneError, si

if TYPE_CHECKING:
    from pendulum_env.physics.scene import Scene


def motor_torque(control: float, motor_rate: float) -> float:
    return control * motor_rate


@dataclass(frozen=True)
class Motor(Effect):
    """A torque motor on the shaft: torque = control * max_torque, control in [-1, 1].

    Per inertia: ``control motor_rate``. It needs a rod: a wire cannot carry torque. A motor weaker than m g L cannot
    lift the bob directly and has to pump.
    """

    max_torque: float = si(0.05, "N m", "torque at full control", above=0.0)

    name: ClassVar[str] = "motor"
    kind: ClassVar[Kind] = "drive"
    exclusive: ClassVar[str] = "motor"
    number_name: ClassVar[str] = "u/(omega0² A)"
    equation: ClassVar[str] = "+ {motor_rate:.6g} control"
    source: ClassVar[str] = "Spong 1995, IEEE Control Systems 15 (1), 49"
    torque = staticmethod(motor_torque)

    def check(self, scene: Scene) -> None:
        if scene.body.suspension == "wire":
            raise SceneError("A wire cannot carry a motor's torque; use suspension='rod' or leave the motor out.")

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"motor_rate": self.max_torque / scene.inertia}

    def number(self, scene: Scene, amplitude: float) -> float:
        restoring = scene.omega0**2 * abs(amplitude)
        return self.coefficients(scene)["motor_rate"] / restoring if restoring else math.inf

    def predicted(self, scene: Scene, amplitude: float) -> tuple[float, float]:
        """A constant full push u moves the middle of the swing to u/omega0²."""
        return math.nan, abs(1.0 - 2.0 * self.number(scene, amplitude)) - 1.0
