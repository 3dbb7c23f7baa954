"""Drag on the wire or rod along its length."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.common.many import applied
from pendulum_env.physics.effects.effect import Effect, Kind, lossy
from pendulum_env.physics.elementary import power
from pendulum_env.physics.flow import bottom_speed, swing_loss
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError

LEAST, MOST = 1.0, 2.0e5
"""Range of the cylinder's Reynolds number to which the drag coefficient was fitted."""


def wire_drag(slip: float, speed: float, wire_form_rate: float, wire_skin_rate: float) -> float:
    return -(wire_form_rate * speed + wire_skin_rate * power(speed, 0.3333333333333333)) * slip


def wire_drag_by_velocity(velocity: float, wire_form_rate: float, wire_skin_rate: float) -> float:
    skin = wire_skin_rate * power(abs(velocity), 0.3333333333333333)
    return -(2.0 * wire_form_rate * abs(velocity) + skin + 0.3333333333333333 * skin)


def wire_drag_by_speed(slip: float, speed: float, wire_form_rate: float, wire_skin_rate: float) -> float:
    skin = wire_skin_rate * power(speed, 0.3333333333333333)
    return -(wire_form_rate * speed + 0.3333333333333333 * skin) * slip


@dataclass(frozen=True)
class WireDrag(Effect):
    """Drag of the wire or rod: a cylinder with C_d = 1 + 10 Re^(-2/3), moving at s v at distance s from the pivot.

    With the thickness d, ``Re = s |v| d/nu`` at the distance s, and the force on each piece taken across it, the torque
    is ``-(rho d L**4/8) |v| v - (3/2) rho d (nu/d)**(2/3) L**(10/3) |v|**(1/3) v``. The formula is also used next to
    the pivot, where Re < 1 and the lever is short. The second derivative is infinite at v = 0, so methods of order
    above 3 come down to about 3 at small steps.

    For a rod with ends at b below and a above the pivot, powers of L are sums of powers of b and a.

    In moving air the slip at the distance s is taken as s/L times the bob's slip, as if wind and pivot moved the air
    like the swing does. On a wire at rest in a wind, the true torque is 5/3 to 2 times as large (see
    :meth:`understated`); a run in which this matters warns of the size.

    Raises SceneError in a medium without density or viscosity.
    """

    name: ClassVar[str] = "wire_drag"
    kind: ClassVar[Kind] = "dissipative"
    damping: ClassVar[str] = "wire_drag"
    equation: ClassVar[str] = "- {wire_form_rate:.6g} |theta'| theta' - {wire_skin_rate:.6g} |theta'|^(1/3) theta'"
    source: ClassVar[str] = "White 2006, Viscous Fluid Flow, section 3-9: C_d of a cylinder for 1 < Re < 2e5"
    needs_medium: ClassVar[bool] = True
    at_bob: ClassVar[bool] = False
    number_name: ClassVar[str] = "Re of the wire at the bob"
    torque = staticmethod(wire_drag)
    by_velocity = staticmethod(wire_drag_by_velocity)
    by_speed = staticmethod(wire_drag_by_speed)

    @property
    def needs(self) -> str:
        return "cylinder"

    def check(self, scene: Surroundings) -> None:
        medium = scene.medium
        if medium.density == 0.0 or medium.viscosity == 0.0:
            lacks = "viscosity" if medium.viscosity == 0.0 else "density"
            raise SceneError(f"Wire drag has no Reynolds number in {medium.name}, which has no {lacks}.")

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        thickness, lever = scene.body.diameter, scene.body.lever
        density, viscosity = scene.medium.density, scene.medium.kinematic_viscosity
        skin = 1.5 * density * thickness * applied(power, viscosity / thickness, 2.0 / 3.0) * lever(10.0 / 3.0)
        return {
            "wire_form_rate": 0.125 * density * thickness * lever(4.0) / scene.inertia,
            "wire_skin_rate": skin / scene.inertia,
        }

    def understated(self, scene: Surroundings, slip: float) -> float:
        """Return the true torque over the formula's: 2 for ``C_d = 1``, and 5/3 for ``10 Re^(-2/3)``.

        With the exponents n of 2 and 4/3, a flow of speed u has the moments ``u**n L**2/2`` about the pivot; the
        formula takes ``u**n L**2/(n + 2)``. On a rod with an overhang the flow pushes both sides against each other.
        """
        rates, body = self.coefficients(scene), scene.body
        even = body.even_lever
        form = rates["wire_form_rate"] * slip * slip
        skin = rates["wire_skin_rate"] * power(slip, 1.0 / 3.0) * slip
        double = 4.0 * even * power(body.reach, 2.0) / body.lever(4.0)
        more = 10.0 / 3.0 * even * power(body.reach, 4.0 / 3.0) / body.lever(10.0 / 3.0)
        return (double * form + more * skin) / (form + skin)

    @staticmethod
    def reynolds(scene: Surroundings, speed: float) -> float:
        """Return the Reynolds number of the wire's cross-section where the wire moves at ``speed`` [m/s]."""
        return scene.medium.density * abs(speed) * scene.body.diameter / scene.medium.viscosity

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return self.reynolds(scene, bottom_speed(scene, amplitude))

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        return lossy(scene, amplitude, swing_loss(self, scene, amplitude))

    def outside(self, scene: Surroundings, speed: float) -> str:
        reynolds = self.reynolds(scene, speed)
        if LEAST <= reynolds <= MOST:
            return ""
        side = "only" if reynolds < LEAST else "even"
        return (
            f"the wire's Re at the bob reaches {side} {reynolds:.3g}, but C_d was fitted from Re = {LEAST:g} to "
            f"{MOST:g}; its formula is used all the same"
        )

    @classmethod
    def trial(cls, scene: Surroundings) -> WireDrag | None:
        return cls() if scene.medium.density > 0.0 and scene.medium.viscosity > 0.0 else None
