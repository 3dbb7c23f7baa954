"""Drag proportional to the velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import BOBS_DRAG, Effect, Kind, lossy
from pendulum_env.physics.elementary import exp
from pendulum_env.physics.flow import boundary_layer, keulegan_carpenter, reynolds_number
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, flag, si


def linear_drag(slip: float, linear_drag_rate: float) -> float:
    return -linear_drag_rate * slip


def linear_drag_by_velocity(linear_drag_rate: float) -> float:
    return -linear_drag_rate


def linear_drag_flow(velocity: float, duration: float, linear_drag_rate: float) -> float:
    return velocity * exp(-linear_drag_rate * duration)


def linear_drag_fade(slip: float, duration: float, linear_drag_rate: float) -> tuple[float, float]:
    return slip * exp(-linear_drag_rate * duration), linear_drag_rate * duration


@dataclass(frozen=True)
class LinearDrag(Effect):
    """Viscous drag: torque -I gamma v, as measured or from geometry.

    Per inertia: ``-gamma v``; the amplitude falls as exp(-gamma t/2) and the quality factor is omega0/gamma. By default
    ``gamma = 6 pi mu a L**2 / I`` (Stokes 1851), which holds for Re below about 1. With ``boundary_layer``
    gamma is ``1 + a/delta`` times as large, ``delta = sqrt(2 nu/omega0)``: the oscillating boundary layer of a swing
    narrower than the bob.

    Raises SceneError for gamma beside ``boundary_layer``, and without gamma in a medium without viscosity.
    """

    gamma: float | None = si(None, "1/s", "damping rate; by default Stokes' law", least=0.0, optional=True)
    boundary_layer: bool = flag(False, "drag of an oscillating sphere in place of Stokes' law")

    name: ClassVar[str] = "linear_drag"
    kind: ClassVar[Kind] = "dissipative"
    damping: ClassVar[str] = "linear"
    fitted: ClassVar[str] = "gamma"
    equation: ClassVar[str] = "- {linear_drag_rate:.6g} theta'"
    source: ClassVar[str] = "Stokes 1851, Trans. Camb. Phil. Soc. 9, 8; Landau & Lifshitz, Fluid Mechanics, section 24"
    number_name: ClassVar[str] = "1/Q = gamma/omega0"
    torque = staticmethod(linear_drag)
    by_velocity = staticmethod(linear_drag_by_velocity)
    flow = staticmethod(linear_drag_flow)
    fade = staticmethod(linear_drag_fade)

    @property
    def models(self) -> str:
        """Return "the bob's drag" if gamma is derived from a drag law; "" if gamma is given, as a measured gamma
        includes all causes of damping.
        """
        return BOBS_DRAG if self.gamma is None else ""

    @property
    def needs(self) -> str:
        return "sphere" if self.gamma is None else ""

    def check(self, scene: Surroundings) -> None:
        if self.gamma is not None and self.boundary_layer:
            raise SceneError("Linear drag takes gamma or boundary_layer, not both.")
        if self.gamma is None and scene.medium.viscosity == 0.0:
            raise SceneError(
                f"Linear drag cannot be derived in {scene.medium.name}, which has no viscosity; give a number, as in "
                "damping={'linear': {'gamma': 0.1}}."
            )

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        if self.gamma is not None:
            return {"linear_drag_rate": self.gamma}
        body = scene.body
        stokes = 6.0 * math.pi * scene.medium.viscosity * body.radius * body.reach * body.reach / scene.inertia
        layer = body.radius / boundary_layer(scene.omega0, scene.medium) if self.boundary_layer else 0.0
        return {"linear_drag_rate": stokes * (1.0 + layer)}

    def number(self, scene: Surroundings, amplitude: float) -> float:
        rate = self.coefficients(scene)["linear_drag_rate"]
        return rate / scene.omega0 if scene.omega0 else math.inf

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        inverse = self.number(scene, amplitude)
        return lossy(scene, amplitude, 0.5 * math.pi * inverse, inverse * inverse / 8.0)

    def outside(self, scene: Surroundings, speed: float) -> str:
        if self.gamma is not None:
            return ""
        if not self.boundary_layer:
            reynolds = reynolds_number(speed, scene.body, scene.medium)
            return "" if reynolds <= 1.0 else (
                f"Re reaches {reynolds:.3g}, but Stokes' law holds up to Re = 1; it is used all the same, and the drag "
                "is too small"
            )
        wide = keulegan_carpenter(scene, speed / (scene.omega0 * scene.body.reach)) if scene.omega0 else math.inf
        return "" if wide <= 1.0 else (
            f"the Keulegan-Carpenter number reaches {wide:.3g}, but the boundary layer stays attached only up to "
            "about 1; the drag of an attached layer is used all the same"
        )

    @classmethod
    def trial(cls, scene: Surroundings) -> LinearDrag | None:
        return cls() if scene.medium.viscosity > 0.0 else None
