"""Drag of the bob, with the drag coefficient at its momentary Reynolds number."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.drag_laws import LAWS, DragLaw
from pendulum_env.physics.effects.effect import BOBS_DRAG, Effect, Function, Kind, lossy
from pendulum_env.physics.flow import bottom_speed, reynolds_number, swing_loss
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, choice


class _ByLaw:
    """Class attribute (descriptor) that returns a function, such as the torque, of the drag law that an effect has; on
    the class, of the default law.
    """

    def __init__(self, role: str) -> None:
        self.role = role

    def __get__(self, effect: SphereDrag | None, owner: type[SphereDrag]) -> Function:
        function: Function = getattr(LAWS[owner.law if effect is None else effect.law], self.role)
        return function


@dataclass(frozen=True)
class SphereDrag(Effect):
    """Drag of a sphere in steady flow at any speed, by a law for C_d(Re): torque -6 pi mu a L² v multiple(Re).

    ``C_d = (24/Re) multiple(Re)``, and ``Re = rho L |v| 2a/mu`` follows the velocity: Stokes' law when slow, nearly
    quadratic when fast. :data:`pendulum_env.physics.drag_laws.LAWS` has the laws with their sources and ranges; they
    differ by 4 to 12 %. Outside its range a law's formula is still used. The flow is taken as steady, so a swing should
    be many radii wide. The second or third derivative is infinite at v = 0, so methods of order above 3 come down to
    about 3 at small steps. There is no closed flow for splitting methods and no Taylor series at rest.

    Raises SceneError in a medium without density or viscosity, and beside another model of the bob's drag.
    """

    law: str = choice(next(iter(LAWS)), LAWS, "drag coefficient by Reynolds number")

    name: ClassVar[str] = "sphere_drag"
    kind: ClassVar[Kind] = "dissipative"
    detail: ClassVar[int] = 2
    damping: ClassVar[str] = "sphere_drag"
    equation: ClassVar[str] = (
        "- {sphere_stokes_rate:.6g} theta' Re C_d(Re)/24, Re = {sphere_reynolds_rate:.6g} |theta'|"
    )
    source: ClassVar[str] = "; ".join(f"{law.name}: {law.source}" for law in LAWS.values())
    needs_medium: ClassVar[bool] = True
    number_name: ClassVar[str] = "Re at the bottom"
    torque = _ByLaw("torque")
    by_velocity = _ByLaw("by_velocity")
    by_speed = _ByLaw("by_speed")

    @property
    def drag_law(self) -> DragLaw:
        """Return the drag law that this effect uses, with its range, formula and source."""
        return LAWS[self.law]

    @property
    def models(self) -> str:
        return BOBS_DRAG

    @property
    def needs(self) -> str:
        return "sphere"

    def check(self, scene: Surroundings) -> None:
        medium = scene.medium
        if medium.density == 0.0 or medium.viscosity == 0.0:
            lacks = "viscosity" if medium.viscosity == 0.0 else "density"
            raise SceneError(f"Sphere drag has no Reynolds number in {medium.name}, which has no {lacks}.")
        for other in scene.effects:
            if other.models == self.models and other.name != self.name:
                raise SceneError(f"sphere_drag and {other.name} both model the bob's drag; leave one of them out.")

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        body, medium = scene.body, scene.medium
        stokes = 6.0 * math.pi * medium.viscosity * body.radius * body.reach * body.reach
        return {
            "sphere_stokes_rate": stokes / scene.inertia,
            "sphere_reynolds_rate": reynolds_number(body.reach, body, medium),
        }

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return reynolds_number(bottom_speed(scene, amplitude), scene.body, scene.medium)

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return lossy(scene, amplitude, swing_loss(self, scene, amplitude))

    def outside(self, scene: Surroundings, speed: float) -> str:
        reynolds, law = reynolds_number(speed, scene.body, scene.medium), self.drag_law
        if reynolds <= law.most:
            return ""
        return (
            f"Re reaches {reynolds:.3g}, but the law {law.name} was fitted up to Re = {law.most:g}; "
            "its formula is used all the same"
        )

    @classmethod
    def trial(cls, scene: Surroundings) -> SphereDrag | None:
        return cls() if scene.medium.density > 0.0 and scene.medium.viscosity > 0.0 else None
