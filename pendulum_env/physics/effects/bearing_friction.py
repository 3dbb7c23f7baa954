"""Viscous friction in the bearing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind, lossy
from pendulum_env.physics.elementary import exp
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si


def bearing_friction(velocity: float, bearing_rate: float) -> float:
    return -bearing_rate * velocity


def bearing_friction_by_velocity(bearing_rate: float) -> float:
    return -bearing_rate


def bearing_friction_flow(velocity: float, duration: float, bearing_rate: float) -> float:
    return velocity * exp(-bearing_rate * duration)


@dataclass(frozen=True)
class BearingFriction(Effect):
    """Viscous friction of a lubricated bearing: torque -b v.

    Per inertia: ``-(b/I) v``, independent of the medium and its motion. The amplitude falls as exp(-b t/(2 I)) and the
    quality factor is ``I omega0 / b``. For a bearing that also sticks, add Coulomb friction. Raises SceneError
    without a number: nothing else in a scene determines b.
    """

    bearing_viscosity: float | None = si(None, "N m s", "torque of the bearing over velocity", least=0.0, optional=True)

    name: ClassVar[str] = "bearing_friction"
    kind: ClassVar[Kind] = "dissipative"
    damping: ClassVar[str] = "bearing"
    fitted: ClassVar[str] = "bearing_viscosity"
    equation: ClassVar[str] = "- {bearing_rate:.6g} theta'"
    source: ClassVar[str] = "Petrov 1883, Inzh. Zh. 1, 71; Squire 1986, Am. J. Phys. 54, 984"
    torque = staticmethod(bearing_friction)
    by_velocity = staticmethod(bearing_friction_by_velocity)
    flow = staticmethod(bearing_friction_flow)
    number_name: ClassVar[str] = "1/Q = b/(I omega0)"

    def check(self, scene: Surroundings) -> None:
        if self.bearing_viscosity is None:
            raise SceneError(
                "Viscous friction of the bearing cannot be derived from geometry and medium; give a number, as in "
                "damping={'bearing': {'bearing_viscosity': 0.0001}}."
            )

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"bearing_rate": (self.bearing_viscosity or 0.0) / scene.inertia}

    def number(self, scene: Surroundings, amplitude: float) -> float:
        """Return the inverse quality factor due to the bearing, 1/Q = b/(I omega0); inf without gravity."""
        return (self.bearing_viscosity or 0.0) / scene.inertia / scene.omega0 if scene.omega0 else math.inf

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """Return the relative changes of period, and of amplitude per half swing, that the bearing's friction causes.

        For small swings they are ``1/sqrt(1 - x²) - 1`` and ``exp(-pi x/sqrt(1 - x²)) - 1`` with ``x = 1/(2 Q)``.
        """
        share = 0.5 * self.number(scene, amplitude)
        if not share < 1.0:
            return math.nan, math.nan
        root = math.sqrt(1.0 - share * share)
        return lossy(scene, amplitude, -math.expm1(-math.pi * share / root), share * share / (root * (1.0 + root)))
