"""A fibre or spring at the pivot that turns the body back."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import WEIGHT, Effect, Kind
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si


def fibre(angle: float, fibre_rate: float) -> float:
    return -fibre_rate * angle


def fibre_by_angle(fibre_rate: float) -> float:
    return -fibre_rate


def fibre_potential(angle: float, fibre_rate: float) -> float:
    return 0.5 * fibre_rate * angle * angle


def fibre_radial(fibre_pull: float) -> float:
    return fibre_pull


@dataclass(frozen=True)
class Fibre(Effect):
    """A fibre or spring at the pivot that turns the body back: torque -kappa theta.

    Per inertia: ``-(kappa/I) theta``, potential ``kappa theta**2/(2 I)``. Beside gravity, ``omega0**2 = (m g L +
    kappa)/I``. A round fibre of length l, diameter d and shear modulus G has ``kappa = pi G d**4/(32 l)`` (Coulomb
    1784). The fibre of a torsion pendulum carries its weight, too. Angles a whole turn apart have different torques.
    Raises SceneError on a wire, which carries no torque.
    """

    stiffness: float = si(0.01, "N m/rad", "torque of the fibre or spring over the angle", above=0.0)

    name: ClassVar[str] = "fibre"
    kind: ClassVar[Kind] = "conservative"
    periodic: ClassVar[bool] = False
    number_name: ClassVar[str] = "kappa/(m g L)"
    equation: ClassVar[str] = "- {fibre_rate:.6g} theta"
    source: ClassVar[str] = "Coulomb 1784, Hist. Acad. R. Sci. Paris, 229"
    torque = staticmethod(fibre)
    by_angle = staticmethod(fibre_by_angle)
    potential = staticmethod(fibre_potential)
    radial = staticmethod(fibre_radial)
    mean = staticmethod(fibre)
    mean_by_end = staticmethod(fibre_by_angle)

    def check(self, scene: Surroundings) -> None:
        if scene.body.suspension == "wire":
            raise SceneError("A wire carries no torque, so a fibre needs the suspension 'rod' or another body.")

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        body = scene.body
        weight = scene.gravity * body.mass if WEIGHT in body.lacks else 0.0
        return {"fibre_rate": self.stiffness / scene.inertia, "fibre_pull": weight * body.reach / scene.inertia}

    def restoring_stiffness(self, scene: Surroundings) -> float:
        return self.stiffness

    def number(self, scene: Surroundings, amplitude: float) -> float:
        """Return the torque of the fibre over that of the weight, near the bottom; inf without a weight's torque."""
        weight = scene.gravity * scene.weight_moment
        return self.stiffness / weight if weight > 0.0 else math.inf

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """Return the relative changes of the period of small swings, ``1/sqrt(1 + kappa/(m g L)) - 1``, and amplitude.
        """
        ratio = self.number(scene, amplitude)
        return (1.0 / math.sqrt(1.0 + ratio) - 1.0 if ratio < math.inf else math.nan), 0.0
