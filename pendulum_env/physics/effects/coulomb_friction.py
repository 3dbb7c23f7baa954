"""Dry friction in the bearing, with sticking."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind, lossy
from pendulum_env.physics.effects.smooth_friction import SmoothFriction
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si


def dry_glide(velocity: float, acceleration: float, limit: float, duration: float) -> tuple[float, float, float]:
    """Return the motion after ``duration`` under dry friction and a constant torque: ``v' = a - limit sign(v)``.

    The result is exact: the final velocity [rad/s], and the integrals of v and of |v| over the duration [rad].
    ``acceleration`` is a, the sum of all other torques per inertia, and ``limit`` the friction torque per inertia
    [rad/s²].
    """
    if velocity == 0.0 and abs(acceleration) <= limit:
        return 0.0, 0.0, 0.0
    side = 1.0 if velocity > 0.0 or (velocity == 0.0 and acceleration > 0.0) else -1.0
    slope = acceleration - side * limit
    end = velocity + duration * slope
    if side * end >= 0.0:
        path = 0.5 * duration * (velocity + end)
        return end, path, side * path
    stop = -velocity / slope
    path = 0.5 * stop * velocity
    if abs(acceleration) <= limit:
        return 0.0, path, side * path
    rest = duration - stop
    end = rest * (acceleration + side * limit)
    back = 0.5 * rest * end
    return end, path + back, side * path - side * back


@dataclass(frozen=True)
class CoulombFriction(Effect):
    """Dry friction of the bearing: constant torque against the motion, which holds the bob at rest up to that size.

    Per inertia ``tau = friction_torque / I``: ``-tau sign(v)`` in motion; at rest, minus the sum of all other torques
    as long as that is at most tau. The amplitude falls by 2 tau/omega0² per half swing. The torque jumps at v = 0:
    methods locate the zero of the velocity there, splitting methods solve the friction's part of a step exactly. A step
    in which a method locates more than 64 zeros ends the run as "diverged".
    """

    friction_torque: float | None = si(None, "N m", "size of the friction torque", least=0.0, optional=True)

    name: ClassVar[str] = "coulomb_friction"
    kind: ClassVar[Kind] = "dissipative"
    damping: ClassVar[str] = "coulomb"
    fitted: ClassVar[str] = "friction_torque"
    dry: ClassVar[str] = "dry_limit"
    number_name: ClassVar[str] = "tau/(omega0² A)"
    equation: ClassVar[str] = "- {dry_limit:.6g} sign(theta')"
    source: ClassVar[str] = "Coulomb 1785; Lapidus 1970, Am. J. Phys. 38, 1360"

    def check(self, scene: Surroundings) -> None:
        if self.friction_torque is None:
            raise SceneError(
                "Coulomb friction cannot be derived from geometry and medium; give a number, as in "
                "damping={'coulomb': {'friction_torque': 0.001}}."
            )

    def smoothed(self, width: float) -> Effect:
        return SmoothFriction(self.friction_torque, width)

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"dry_limit": (self.friction_torque or 0.0) / scene.inertia}

    def number(self, scene: Surroundings, amplitude: float) -> float:
        restoring = scene.omega0**2 * abs(amplitude)
        return self.coefficients(scene)["dry_limit"] / restoring if restoring else math.inf

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return lossy(scene, amplitude, 2.0 * self.number(scene, amplitude))
