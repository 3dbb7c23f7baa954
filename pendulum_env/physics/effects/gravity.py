"""Gravity on the bob at any angle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import GRAVITY, WEIGHT, Effect, Kind
from pendulum_env.physics.elementary import cos, sin
from pendulum_env.physics.exact.pendulum import period
from pendulum_env.physics.surroundings import Surroundings


def gravity(tilt: float, side: float, gravity_rate: float) -> float:
    return -gravity_rate * side * sin(tilt)


def gravity_by_angle(tilt: float, side: float, gravity_rate: float) -> float:
    return -gravity_rate * side * cos(tilt)


def gravity_potential(half_sine: float, side: float, gravity_rate: float) -> float:
    return gravity_rate * ((1.0 - side) + side * (2.0 * half_sine * half_sine))


def gravity_mean(tilt: float, side: float, spread: float, gravity_rate: float) -> float:
    share = sin(spread) / spread if spread != 0.0 else 1.0
    return -gravity_rate * side * sin(tilt) * share


def gravity_mean_by_end(tilt: float, side: float, spread: float, gravity_rate: float) -> float:
    share = sin(spread) / spread if spread != 0.0 else 1.0
    bend = (cos(spread) - share) / spread if abs(spread) > 1e-5 else -spread / 3.0
    return -gravity_rate * side * (cos(tilt) * share + sin(tilt) * bend)


def gravity_radial(tilt: float, side: float, gravity_pull: float) -> float:
    return gravity_pull * side * cos(tilt)


@dataclass(frozen=True)
class Gravity(Effect):
    """Weight of the bob at any angle: torque -m g L sin(theta).

    Per inertia: ``-gravity_rate sin(theta)``, potential ``gravity_rate (1 - cos(theta))``, with ``gravity_rate = g
    weight_moment / I = omega0**2`` [1/s²]. The difference from small-angle gravity matters above about 4
    sqrt(tolerance) rad, where the period is longer by theta²/16.
    """

    name: ClassVar[str] = "gravity"
    kind: ClassVar[Kind] = "conservative"
    exclusive: ClassVar[str] = GRAVITY
    detail: ClassVar[int] = 1
    number_name: ClassVar[str] = "A²/16"
    equation: ClassVar[str] = "- {gravity_rate:.6g} sin(theta)"
    source: ClassVar[str] = "Huygens 1673, Horologium Oscillatorium; Nelson & Olsson 1986"
    torque = staticmethod(gravity)
    by_angle = staticmethod(gravity_by_angle)
    potential = staticmethod(gravity_potential)
    mean = staticmethod(gravity_mean)
    mean_by_end = staticmethod(gravity_mean_by_end)
    radial = staticmethod(gravity_radial)

    @property
    def needs(self) -> str:
        return WEIGHT

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return amplitude * amplitude / 16.0

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """Return the relative change of the period against small-angle gravity, ``2 K(sin(A/2))/pi - 1``, and that of
        the amplitude, 0.

        K is the complete elliptic integral and A the amplitude; as a series, A²/16 + 11 A**4/3072 + ...
        """
        return float(period(amplitude, 1.0)) / (2.0 * math.pi) - 1.0, 0.0

    @classmethod
    def trial(cls, scene: Surroundings) -> Gravity:
        return cls()

    def restoring_stiffness(self, scene: Surroundings) -> float:
        return 0.0  # but for the weight's

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"gravity_rate": scene.gravity * scene.weight_moment / scene.inertia}
