"""Drag that grows with the velocity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.elementary import exp
from pendulum_env.physics.units import SceneError, si

if TYPE_CHECKING:
    from pendulum_env.physics.scene import Scene


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
    """Viscous drag: torque -I gamma v, as measured or by Stokes' law.

    Per inertia: ``-gamma v``; the amplitude falls as exp(-gamma t/2) and the quality factor is omega0/gamma. Without
    a number, ``gamma = 6 pi mu a L**2 / I`` (Stokes 1851), which holds for Re below about 1.
    """

    gamma: float | None = si(None, "1/s", "damping rate; by default Stokes' law", least=0.0, optional=True)

    name: ClassVar[str] = "linear_drag"
    kind: ClassVar[Kind] = "dissipative"
    damping: ClassVar[str] = "linear"
    equation: ClassVar[str] = "- {linear_drag_rate:.6g} theta'"
    source: ClassVar[str] = "Stokes 1851, Trans. Camb. Phil. Soc. 9, 8"
    torque = staticmethod(linear_drag)
    by_velocity = staticmethod(linear_drag_by_velocity)
    flow = staticmethod(linear_drag_flow)
    fade = staticmethod(linear_drag_fade)

    def check(self, scene: Scene) -> None:
        if self.gamma is None and scene.medium.viscosity == 0.0:
            raise SceneError(
                f"Linear drag cannot be derived in {scene.medium.name}, which has no viscosity; give a number, as in "
                "damping={'linear': {'gamma': 0.1}}."
            )

    def coefficients(self, scene: Scene) -> dict[str, float]:
        body = scene.body
        stokes = 6.0 * math.pi * scene.medium.viscosity * body.radius * body.length * body.length / scene.inertia
        return {"linear_drag_rate": stokes if self.gamma is None else self.gamma}
