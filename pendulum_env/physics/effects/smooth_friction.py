"""Dry friction without sticking: the jump of the torque at rest is smoothed over a stated width of velocities."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind, lossy
from pendulum_env.physics.elementary import sqrt
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si

NARROWEST = 1e-9
"""Smallest width of the smoothing [rad/s]."""


def smooth_friction(velocity: float, smooth_limit: float, friction_width: float) -> float:
    return -smooth_limit * velocity / sqrt(velocity * velocity + friction_width * friction_width)


def smooth_friction_by_velocity(velocity: float, smooth_limit: float, friction_width: float) -> float:
    squares = velocity * velocity + friction_width * friction_width
    return -smooth_limit * friction_width * friction_width / (squares * sqrt(squares))


@dataclass(frozen=True)
class SmoothFriction(Effect):
    """Dry friction of the bearing, smoothed: its torque has derivatives everywhere, and a bob that would stick creeps.

    Per inertia, with ``tau = friction_torque / I`` and ``w = friction_width``: ``-tau v / sqrt(v² + w²)``. For |v| much
    above w it is that of Coulomb friction, less the share ``w²/(2 v²)``. For |v| far below w it is viscous, with the
    rate ``tau/w``: a bob that Coulomb friction would hold against a torque of ``x tau`` creeps at
    ``w x / sqrt(1 - x²)``. Explicit methods need steps shorter than about 2 w/tau. It is for derivatives, which
    sticking does not have, and for comparison with programs that smooth; otherwise take Coulomb friction.
    """

    friction_torque: float | None = si(None, "N m", "size of the friction torque", least=0.0, optional=True)
    friction_width: float = si(0.01, "rad/s", "velocity over which the torque is smoothed", least=NARROWEST)

    name: ClassVar[str] = "smooth_friction"
    kind: ClassVar[Kind] = "dissipative"
    damping: ClassVar[str] = "smooth"
    number_name: ClassVar[str] = "tau/(omega0² A)"
    equation: ClassVar[str] = "- {smooth_limit:.6g} theta'/(theta'^2 + {friction_width:.6g}^2)^(1/2)"
    source: ClassVar[str] = "Coulomb 1785; on smoothing: Andersson, Soderberg & Bjorklund 2007, Tribol. Int. 40, 580"
    torque = staticmethod(smooth_friction)
    by_velocity = staticmethod(smooth_friction_by_velocity)

    def check(self, scene: Surroundings) -> None:
        if self.friction_torque is None:
            raise SceneError(
                "Smoothed dry friction cannot be derived from geometry and medium; give a number, as in "
                "damping={'smooth': {'friction_torque': 0.001}}."
            )

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"smooth_limit": (self.friction_torque or 0.0) / scene.inertia, "friction_width": self.friction_width}

    def number(self, scene: Surroundings, amplitude: float) -> float:
        restoring = scene.omega0**2 * abs(amplitude)
        return self.coefficients(scene)["smooth_limit"] / restoring if restoring else math.inf

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return lossy(scene, amplitude, 2.0 * self.number(scene, amplitude))
