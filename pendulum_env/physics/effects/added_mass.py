"""The fluid that moves along with an accelerated bob."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.common.many import settled, sqrt
from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.flow import boundary_layer, keulegan_carpenter
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, flag, total


@dataclass(frozen=True)
class AddedMass(Effect):
    """Added mass: the bob moves fluid of half the displaced mass along, at its centre.

    Inertia ``(rho V/2) L**2`` of potential flow. A rod across the flow moves as much fluid along as it displaces (Lamb
    1932, Hydrodynamics, section 68). With ``boundary_layer`` it is ``1 + 9 delta/(2 a)`` times as much,
    ``delta = sqrt(2 nu/omega)``: the viscous layer of a sphere that oscillates by less than its radius, at the scene's
    small-angle frequency omega with the added mass included. The period grows by half of the relative growth of the
    inertia.

    Raises SceneError in a medium without density, and with ``boundary_layer`` where no weight pulls the bob back, so
    that no frequency exists.
    """

    boundary_layer: bool = flag(False, "with the viscous layer of an oscillating sphere")

    name: ClassVar[str] = "added_mass"
    kind: ClassVar[Kind] = "inertia"
    equation: ClassVar[str] = ""
    source: ClassVar[str] = "Green 1833; Stokes 1851; Landau & Lifshitz, Fluid Mechanics, sections 11 and 24"
    needs_medium: ClassVar[bool] = True
    number_name: ClassVar[str] = "added mass/m"

    @property
    def needs(self) -> str:
        return "sphere" if self.boundary_layer else "added"

    def check(self, scene: Surroundings) -> None:
        if scene.medium.density == 0.0:
            raise SceneError(f"There is no added mass in {scene.medium.name}, which has no density.")

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {}

    def mass(self, scene: Surroundings) -> float:
        """Return the mass of the fluid that moves along with the bob [kg].

        Raises SceneError with ``boundary_layer`` where no weight pulls the bob back, so that no frequency exists.
        """
        half = 0.5 * scene.medium.density * scene.body.volume
        if not self.boundary_layer or half == 0.0:
            return half
        square = scene.body.reach * scene.body.reach
        others = scene.body.inertia + total(e.inertia(scene) for e in scene.effects if not isinstance(e, AddedMass))
        torque = scene.gravity * scene.weight_moment
        if not torque > 0.0:
            raise SceneError(
                f"Added mass with boundary_layer needs a bob that swings, but the weight's torque is {torque:g} N m; "
                "use boundary_layer=False."
            )
        layer = half * square * 4.5 * boundary_layer(1.0, scene.medium) / scene.body.radius
        omega = own_frequency(torque, others + half * square, layer)
        return half + layer / sqrt(omega) / square

    def inertia(self, scene: Surroundings) -> float:
        if not self.boundary_layer:
            return scene.body.added_inertia(scene.medium.density)
        return self.mass(scene) * scene.body.reach * scene.body.reach

    def mass_moment(self, scene: Surroundings) -> float:
        if not self.boundary_layer:
            return scene.body.added_moment(scene.medium.density)
        return self.mass(scene) * scene.body.reach

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return self.inertia(scene) / scene.body.inertia

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return 0.5 * self.number(scene, amplitude), 0.0

    def outside(self, scene: Surroundings, speed: float) -> str:
        wide = keulegan_carpenter(scene, speed / (scene.omega0 * scene.body.reach)) if scene.omega0 else math.inf
        return "" if wide <= 1.0 or not self.boundary_layer else (
            f"the Keulegan-Carpenter number reaches {wide:.3g}, but the boundary layer stays attached only up to "
            "about 1; the mass of an attached layer is used all the same"
        )

    @classmethod
    def trial(cls, scene: Surroundings) -> AddedMass | None:
        return cls() if scene.medium.density > 0.0 else None


def own_frequency(torque: float, inertia: float, layer: float) -> float:
    """Return the small-angle frequency omega [1/s] of a pendulum whose inertia includes a viscous boundary layer.

    It solves ``(inertia + layer/sqrt(omega)) omega**2 = torque``, where ``torque`` is the weight's torque per angle [N
    m] and ``layer/sqrt(omega)`` the inertia of the boundary layer. All arguments are positive. Newton's method for
    ``inertia x**4 + layer x**3 = torque``, x = sqrt(omega), from the solution without layer; the left side is convex,
    so x falls in every step.
    """
    x, last = sqrt(sqrt(torque / inertia)), math.inf
    while x < last:
        last = x
        x -= ((inertia * x + layer) * x * x * x - torque) / ((4.0 * inertia * x + 3.0 * layer) * x * x)
    root = settled(last, x)
    return root * root
