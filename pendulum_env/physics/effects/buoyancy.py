"""Buoyancy of the bob in the medium."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError


@dataclass(frozen=True)
class Buoyancy(Effect):
    """Buoyancy of the bob: the weight is reduced by that of the displaced fluid, moment -rho V L.

    Buoyancy of a bob's wire or rod is left out; that of other bodies acts at the
    centre of their volume. To first order in the density ratio the period grows by ``rho/(2 rho_b)``.
    Raises SceneError in a medium without density; a scene refuses a bob that floats.
    """

    name: ClassVar[str] = "buoyancy"
    kind: ClassVar[Kind] = "inertia"
    equation: ClassVar[str] = ""
    source: ClassVar[str] = "Archimedes, On Floating Bodies; Nelson & Olsson 1986, Am. J. Phys. 54, 112"
    needs_medium: ClassVar[bool] = True
    number_name: ClassVar[str] = "rho/rho_bob"

    @property
    def needs(self) -> str:
        return "volume"

    def check(self, scene: Surroundings) -> None:
        if scene.medium.density == 0.0:
            raise SceneError(f"There is no buoyancy in {scene.medium.name}, which has no density.")
        if scene.body.volume == 0.0:
            raise SceneError(f"Buoyancy needs the volume of the body '{scene.body.shape}'; give volume, in m^3.")

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {}

    def weight_moment(self, scene: Surroundings) -> float:
        return -scene.medium.density * scene.body.volume * scene.body.volume_distance

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return scene.medium.density * scene.body.volume / scene.body.mass

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return 0.5 * self.number(scene, amplitude), 0.0

    @classmethod
    def trial(cls, scene: Surroundings) -> Buoyancy | None:
        return cls() if scene.medium.density > 0.0 else None
