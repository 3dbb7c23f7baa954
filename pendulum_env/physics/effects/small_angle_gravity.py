"""Gravity linearised at the bottom, as in the textbook's harmonic oscillator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import GRAVITY, WEIGHT, Effect, Kind
from pendulum_env.physics.surroundings import Surroundings


def small_angle_gravity(angle: float, spring_rate: float) -> float:
    return -spring_rate * angle


def small_angle_gravity_by_angle(spring_rate: float) -> float:
    return -spring_rate


def small_angle_gravity_potential(angle: float, spring_rate: float) -> float:
    return 0.5 * spring_rate * angle * angle


def small_angle_gravity_radial(gravity_pull: float) -> float:
    return gravity_pull


@dataclass(frozen=True)
class SmallAngleGravity(Effect):
    """Weight of the bob near the bottom: torque -m g L theta.

    Per inertia: ``-spring_rate theta``, potential ``spring_rate theta**2 / 2``, with ``spring_rate = g weight_moment /
    I = omega0**2`` [1/s²]. The period is right to the fraction theta²/16. Angles a whole turn apart have different
    torques.
    """

    name: ClassVar[str] = "small_angle_gravity"
    kind: ClassVar[Kind] = "conservative"
    exclusive: ClassVar[str] = GRAVITY
    periodic: ClassVar[bool] = False
    number_name: ClassVar[str] = "A²/16"
    equation: ClassVar[str] = "- {spring_rate:.6g} theta"
    source: ClassVar[str] = "Galilei 1638, Discorsi; Nelson & Olsson 1986"
    torque = staticmethod(small_angle_gravity)
    by_angle = staticmethod(small_angle_gravity_by_angle)
    potential = staticmethod(small_angle_gravity_potential)
    radial = staticmethod(small_angle_gravity_radial)
    mean = staticmethod(small_angle_gravity)
    mean_by_end = staticmethod(small_angle_gravity_by_angle)

    @property
    def needs(self) -> str:
        return WEIGHT

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return amplitude * amplitude / 16.0

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """Return zero changes of period and amplitude: this effect defines the reference period."""
        return 0.0, 0.0

    @classmethod
    def trial(cls, scene: Surroundings) -> SmallAngleGravity:
        return cls()

    def restoring_stiffness(self, scene: Surroundings) -> float:
        return 0.0  # but for the weight's

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"spring_rate": scene.gravity * scene.weight_moment / scene.inertia}
