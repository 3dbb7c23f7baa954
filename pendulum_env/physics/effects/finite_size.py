"""Corrections for the size of the bob and the mass of the suspension: the compound pendulum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import si


@dataclass(frozen=True)
class FiniteBob(Effect):
    """The bob is a solid sphere that turns with its suspension: inertia (2/5) m a².

    To first order the period grows by the fraction ``(a/L)**2 / 5``.
    """

    name: ClassVar[str] = "finite_bob"
    kind: ClassVar[Kind] = "inertia"
    equation: ClassVar[str] = ""
    source: ClassVar[str] = "Huygens 1673, Horologium Oscillatorium IV; Nelson & Olsson 1986, Am. J. Phys. 54, 112"
    number_name: ClassVar[str] = "(a/L)²"

    @property
    def needs(self) -> str:
        return "bob"

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {}

    def inertia(self, scene: Surroundings) -> float:
        return 0.4 * scene.body.mass * scene.body.radius * scene.body.radius

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return (scene.body.radius / scene.body.reach) ** 2

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return 0.2 * self.number(scene, amplitude), 0.0

    @classmethod
    def trial(cls, scene: Surroundings) -> FiniteBob:
        return cls()


@dataclass(frozen=True)
class Suspension(Effect):
    """The wire or rod has a mass: inertia m_s L²/3, its centre of mass at L/2.

    By default ``m_s`` follows from the body's thickness and suspension density, for a length from the pivot to the
    bob's centre. To first order the period changes by the fraction ``-m_s/(12 m)``.
    """

    suspension_mass: float | None = si(
        None, "kg", "mass of wire or rod; by default from its thickness and density", least=0.0, optional=True
    )

    name: ClassVar[str] = "suspension"
    kind: ClassVar[Kind] = "inertia"
    equation: ClassVar[str] = ""
    source: ClassVar[str] = "Nelson & Olsson 1986, Am. J. Phys. 54, 112"
    number_name: ClassVar[str] = "m_s/m"
    at_bob: ClassVar[bool] = False

    @property
    def needs(self) -> str:
        return "bob"

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {}

    def mass(self, scene: Surroundings) -> float:
        """Return the mass of the wire or rod [kg]."""
        return scene.body.suspension_mass if self.suspension_mass is None else self.suspension_mass

    def inertia(self, scene: Surroundings) -> float:
        return self.mass(scene) * scene.body.reach * scene.body.reach / 3.0

    def weight_moment(self, scene: Surroundings) -> float:
        return 0.5 * self.mass(scene) * scene.body.reach

    def mass_moment(self, scene: Surroundings) -> float:
        return 0.5 * self.mass(scene) * scene.body.reach

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return self.mass(scene) / scene.body.mass

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return -self.number(scene, amplitude) / 12.0, 0.0

    @classmethod
    def trial(cls, scene: Surroundings) -> Suspension:
        return cls()
