"""A sinusoidal torque on the shaft."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.elementary import cos
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si


def periodic_torque(time: float, drive_strength: float, drive_rate: float, drive_phase: float) -> float:
    return drive_strength * cos(drive_rate * time + drive_phase)


def periodic_torque_store(
    time: float, tilt: float, drive_strength: float, drive_rate: float, drive_phase: float
) -> float:
    return -drive_strength * cos(drive_rate * time + drive_phase) * tilt


@dataclass(frozen=True)
class PeriodicTorque(Effect):
    """A sinusoidal torque on the shaft: drive_torque cos(Omega t + phase).

    Per inertia: ``drive_strength cos(Omega t + phase)`` with ``drive_strength = drive_torque / I`` [1/s²]. The drive
    needs a rod: a wire cannot carry torque. Small swings settle at ``drive_strength / sqrt((omega0**2 - Omega**2)**2 +
    (gamma Omega)**2)``; large ones double their period and become chaotic. The phase ``Omega t`` has a relative error
    of 4e-16; beyond 8.4e8 rad the torque is nan and a run ends as "diverged". Steps must resolve Omega.
    """

    drive_torque: float = si(0.01, "N m", "largest torque", least=0.0)
    drive_rate: float = si(1.0, "rad/s", "angular rate of the torque", least=0.0)
    drive_phase: float = si(0.0, "rad", "phase of the torque; 0 starts at the largest torque")

    name: ClassVar[str] = "periodic_torque"
    kind: ClassVar[Kind] = "drive"
    equation: ClassVar[str] = "+ {drive_strength:.6g} cos({drive_rate:.6g} t + {drive_phase:.6g})"
    source: ClassVar[str] = "Baker & Gollub 1996, Chaotic Dynamics, chapter 3"
    torque = staticmethod(periodic_torque)
    store = staticmethod(periodic_torque_store)
    beat: ClassVar[str] = "drive_rate"
    number_name: ClassVar[str] = "drive_torque/(m g L)"

    def check(self, scene: Surroundings) -> None:
        if scene.body.suspension == "wire":
            raise SceneError("A wire cannot carry a periodic torque; use suspension='rod' or shake the pivot instead.")

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {
            "drive_strength": self.drive_torque / scene.inertia,
            "drive_rate": self.drive_rate,
            "drive_phase": self.drive_phase,
        }

    def number(self, scene: Surroundings, amplitude: float) -> float:
        """Return the ratio of the drive's largest torque to that of the weight at 90 degrees; inf without gravity."""
        return self.drive_torque / scene.inertia / scene.omega0**2 if scene.omega0 else math.inf
