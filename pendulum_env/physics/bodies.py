"""Compound pendulums: a rod, a disc, Kater's reversible pendulum, a body as measured, and a disc on a fibre.

Each is a dataclass of measures, from which moment of inertia, centre, volume and drag follow by geometry. BODIES lists
all bodies by name, with the bob on a wire or rod of :mod:`pendulum_env.physics.body`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any, ClassVar

from pendulum_env.common.many import applied, sqrt
from pendulum_env.physics.body import Body, Piece, RigidBody
from pendulum_env.physics.elementary import power
from pendulum_env.physics.units import SceneError, flag, nearest, one_of, shown, si

WHOLE: Mapping[str, str] = MappingProxyType({
    "bob": "its moment of inertia is already that of the whole body",
    "sphere": "the formula is that of a single ball; give a measured number instead",
})
"""Properties of a bob that no compound pendulum has, with the reason."""
UNKNOWN = "its outer form is not known; give a measured number instead"


@dataclass(frozen=True)
class Rod(RigidBody):
    """A uniform rod that swings about a pivot at its upper end or, with an overhang, further down.

    A solid cylinder of length l, diameter d and mass m whose centre is ``s = l/2 - overhang`` below the pivot: ``I = m
    (l**2/12 + d**2/16 + s**2)``. The fluid that moves along is that of a cylinder across the flow, as much as it
    displaces (Lamb 1932, Hydrodynamics, section 68).
    """

    shape: ClassVar[str] = "rod"
    sizes: ClassVar[tuple[str, ...]] = ("length", "mass")
    lacks: ClassVar[Mapping[str, str]] = {
        **WHOLE, "sphere": "the formula is that of a single ball; use wire_drag, which is that of a rod",
    }

    length: float = si(1.0, "m", "length of the whole rod", above=0.0)
    mass: float = si(0.3, "kg", "mass of the rod", above=0.0)
    width: float = si(0.01, "m", "diameter of the rod", above=0.0)
    overhang: float = si(0.0, "m", "length of the part above the pivot", least=0.0)

    @property
    def diameter(self) -> float:
        """Return the diameter of the rod [m]."""
        return self.width

    @property
    def centre(self) -> float:
        """Return the distance from the pivot to the centre of mass [m]."""
        return 0.5 * self.length - self.overhang

    @property
    def inertia(self) -> float:
        """Return the moment of inertia about the pivot, ``m (l**2/12 + d**2/16 + s**2)`` [kg m²]."""
        return self.mass * (self.length * self.length / 12.0 + self.width * self.width / 16.0
                            + self.centre * self.centre)

    @property
    def moment(self) -> float:
        """Return the mass times the distance of the centre of mass from the pivot [kg m]."""
        return self.mass * self.centre

    @property
    def reach(self) -> float:
        """Return the distance from the pivot to the lower end [m]."""
        return self.length - self.overhang

    @property
    def radius(self) -> float:
        """Return the radius of the rod [m]."""
        return 0.5 * self.width

    @property
    def section(self) -> float:
        """Return the area of the cross-section of the rod [m²]."""
        return 0.25 * math.pi * self.width * self.width

    @property
    def volume(self) -> float:
        """Return the volume of the rod [m³]."""
        return self.section * self.length

    def added_inertia(self, density: float) -> float:
        """Return the moment of inertia of the fluid that moves along, as much as the rod displaces [kg m²]."""
        return density * self.section * (self.reach * self.reach * self.reach
                                         + self.overhang * self.overhang * self.overhang) / 3.0

    def added_moment(self, density: float) -> float:
        """Return the mass of the fluid that moves along times its distance [kg m]."""
        return density * self.volume * self.centre

    def drag_moment(self, pressure: float) -> float:
        """Return ``pressure d (b**4 + a**4)/4`` for the ends at b below and a above the pivot [kg m²]."""
        below, above = self.reach * self.reach, self.overhang * self.overhang
        return 0.25 * pressure * self.width * (below * below + above * above)

    def lever(self, exponent: float) -> float:
        """Return a power of the distance from the pivot, summed over both ends of the rod."""
        return applied(power, self.reach, exponent) + applied(power, self.overhang, exponent)

    @property
    def even_lever(self) -> float:
        """Return the length times the distance of the centre from the pivot [m²]."""
        return self.length * self.centre

    @property
    def outline(self) -> tuple[Piece, ...]:
        """Return the rod as it is drawn."""
        return (("bar", -self.overhang, self.reach, self.radius),)

    def check(self) -> None:
        """Raise SceneError where the pivot is beyond the lower end of the rod."""
        if not self.reach > 0.0:
            raise SceneError(f"The overhang of a rod of {self.length:g} m must be below that length, "
                             f"not {self.overhang:g} m.")


@dataclass(frozen=True)
class Disc(RigidBody):
    """A uniform disc that swings in its own plane about a pivot at a distance from its centre.

    With the radius R, the mass m and the distance s: ``I = m (R**2/2 + s**2)``. The disc cuts the fluid with its edge.
    """

    shape: ClassVar[str] = "disc"
    lacks: ClassVar[Mapping[str, str]] = {
        **WHOLE, "added": "a disc that swings in its own plane moves no fluid along, as long as that has no viscosity",
        "cylinder": "the formula is that of a wire or rod; give a measured number instead",
    }

    fitted: ClassVar[str] = "centre"

    radius: float = si(0.1, "m", "radius of the disc", above=0.0)
    mass: float = si(0.5, "kg", "mass of the disc", above=0.0)
    thickness: float = si(0.005, "m", "thickness of the disc", above=0.0)
    centre: float = si(0.1, "m", "pivot to the disc's centre", least=0.0)

    @property
    def inertia(self) -> float:
        """Return the moment of inertia about the pivot, ``m (R**2/2 + s**2)`` [kg m²]."""
        return self.mass * (0.5 * self.radius * self.radius + self.centre * self.centre)

    @property
    def moment(self) -> float:
        """Return the mass times the distance of the centre from the pivot [kg m]."""
        return self.mass * self.centre

    @property
    def reach(self) -> float:
        """Return the distance from the pivot to the farthest point of the rim [m]."""
        return self.centre + self.radius

    @property
    def volume(self) -> float:
        """Return the volume of the disc [m³]."""
        return math.pi * self.radius * self.radius * self.thickness

    def drag_moment(self, pressure: float) -> float:
        """Return ``pressure`` times the integral of the cube of the distance over the edge across the flow [kg m²]."""
        far, near = self.reach, self.radius - self.centre
        square = near * near
        return 0.25 * pressure * self.thickness * (far * far * far * far + (square if near > 0.0 else -square) * square)

    @property
    def outline(self) -> tuple[Piece, ...]:
        """Return the disc as it is drawn, and the arm from the pivot to a disc beside it."""
        arm: tuple[Piece, ...] = (("bar", 0.0, self.centre, 0.0),) if self.centre > self.radius else ()
        return (*arm, ("plate", self.centre, self.centre, self.radius))


@dataclass(frozen=True)
class Kater(RigidBody):
    """Kater's reversible pendulum: a rod with two knife edges, a bob and a counterweight (Kater 1818).

    It swings about the upper knife edge or, ``inverted``, about the lower one. Where both periods T are equal, g is ``4
    pi**2 length / T**2``: neither the centre of mass nor the moment of inertia has to be known. :meth:`tuned` shifts
    the counterweight to make them equal. Positions count from the upper knife edge towards the lower one; bob and
    counterweight are balls on the rod's axis, and the rod's parts within them are counted with the rod, too.

    Source: Kater 1818, Phil. Trans. R. Soc. 108, 33.
    """

    shape: ClassVar[str] = "kater"
    lacks: ClassVar[Mapping[str, str]] = WHOLE
    fitted: ClassVar[str] = "counterweight_position"

    length: float = si(0.9939, "m", "distance between the knife edges", above=0.0)
    bob_mass: float = si(1.4, "kg", "mass of the bob", above=0.0)
    radius: float = si(0.034, "m", "radius of the bob", above=0.0)
    bob_position: float = si(1.07, "m", "from the upper knife edge down to the bob's centre")
    counterweight_mass: float = si(0.5, "kg", "mass of the counterweight", least=0.0)
    counterweight_radius: float = si(0.024, "m", "radius of the counterweight", above=0.0)
    counterweight_position: float = si(
        0.2450781757851181, "m", "from the upper knife edge down to the counterweight's centre")
    rod_length: float = si(1.6, "m", "length of the rod", above=0.0)
    rod_mass: float = si(1.0, "kg", "mass of the rod", above=0.0)
    width: float = si(0.01, "m", "diameter of the rod", above=0.0)
    overhang: float = si(0.2, "m", "length of the rod above the upper knife edge", least=0.0)
    inverted: bool = flag(False, "swings about the lower knife edge")

    def _below(self, position: float) -> float:
        """Return the distance below the pivot of a position below the upper knife edge [m]."""
        return self.length - position if self.inverted else position

    @property
    def balls(self) -> tuple[tuple[float, float, float], ...]:
        """Return mass [kg], distance below the pivot [m] and radius [m] of the bob and of the counterweight."""
        return ((self.bob_mass, self._below(self.bob_position), self.radius),
                (self.counterweight_mass, self._below(self.counterweight_position), self.counterweight_radius))

    @property
    def rod(self) -> Rod:
        """Return the rod, hung from the same pivot."""
        up = self.rod_length - self.overhang - self.length if self.inverted else self.overhang
        return Rod(self.rod_length, self.rod_mass, self.width, up)

    @property
    def diameter(self) -> float:
        """Return the diameter of the rod [m]."""
        return self.width

    @property
    def mass(self) -> float:
        """Return the mass of rod, bob and counterweight together [kg]."""
        return self.rod_mass + self.bob_mass + self.counterweight_mass

    @property
    def inertia(self) -> float:
        """Return the moment of inertia about the pivot: the rod's plus ``m (x**2 + 2 a**2/5)`` of each ball [kg m²]."""
        one, two = (mass * (x * x + 0.4 * a * a) for mass, x, a in self.balls)
        return self.rod.inertia + one + two

    @property
    def moment(self) -> float:
        """Return the mass times the distance of the centre of mass from the pivot [kg m]."""
        one, two = (mass * x for mass, x, _ in self.balls)
        return self.rod.moment + one + two

    @property
    def reach(self) -> float:
        """Return the distance between the knife edges [m]."""
        return self.length

    @property
    def volume(self) -> float:
        """Return the volume of rod, bob and counterweight [m³]."""
        one, two = (_ball(a) for _, _, a in self.balls)
        return self.rod.volume + one + two

    @property
    def volume_distance(self) -> float:
        """Return the distance from the pivot to the centre of the displaced volume [m]."""
        one, two = (_ball(a) * x for _, x, a in self.balls)
        return (self.rod.volume * self.rod.centre + one + two) / self.volume

    def added_inertia(self, density: float) -> float:
        """Return the moment of inertia of the fluid that rod and balls move along [kg m²]."""
        one, two = (0.5 * density * _ball(a) * x * x for _, x, a in self.balls)
        return self.rod.added_inertia(density) + one + two

    def added_moment(self, density: float) -> float:
        """Return the mass of the fluid that rod and balls move along times its distance [kg m]."""
        one, two = (0.5 * density * _ball(a) * x for _, x, a in self.balls)
        return self.rod.added_moment(density) + one + two

    def drag_moment(self, pressure: float) -> float:
        """Return ``pressure pi a**2 |x|**3`` summed over the balls, without the rod, which wire_drag has [kg m²]."""
        one, two = (pressure * math.pi * a * a * abs(x * x * x) for _, x, a in self.balls)
        return one + two

    def lever(self, exponent: float) -> float:
        """Return a power of the distance from the pivot, summed over both ends of the rod."""
        return self.rod.lever(exponent)

    @property
    def even_lever(self) -> float:
        """Return that of the rod [m²]."""
        return self.rod.even_lever

    @property
    def outline(self) -> tuple[Piece, ...]:
        """Return rod, bob and counterweight as they are drawn."""
        return (*self.rod.outline, *(("ball", x, x, a) for _, x, a in self.balls))

    def check(self) -> None:
        """Raise SceneError where the lower knife edge is not on the rod."""
        last = self.rod_length - self.overhang
        if not last >= self.length:
            raise SceneError(f"The rod ends {last:g} m below the upper knife edge, above the lower one at "
                             f"{self.length:g} m; give rod_length of at least {self.overhang + self.length:g} m.")

    def tuned(self) -> Kater:
        """Return the pendulum with its counterweight where both periods are equal, nearest to where it is.

        The moment of inertia about the upper knife edge must be ``length`` times the moment of the mass, which is a
        quadratic equation in the counterweight's position. Raises SceneError if no place on the rod fulfils it.
        """
        upright = dataclasses.replace(self, inverted=False)
        bare = dataclasses.replace(upright, counterweight_mass=0.0)
        mass, a = self.counterweight_mass, self.counterweight_radius
        own = 0.4 * mass * a * a
        room = math.nan if mass == 0.0 else (
            0.25 * self.length * self.length - (bare.inertia + own - bare.moment * self.length) / mass)
        places = [0.5 * self.length + side * sqrt(room) for side in (-1.0, 1.0)] if room >= 0.0 else []
        ends = -self.overhang, self.rod_length - self.overhang
        allowed = [place for place in places if ends[0] <= place <= ends[1]]
        if not allowed:
            raise SceneError(f"No place of a counterweight of {mass:g} kg on the rod makes both periods equal; change "
                             "its mass, or the bob's position.")
        place = min(allowed, key=lambda place: abs(place - self.counterweight_position))
        return dataclasses.replace(self, counterweight_position=place)


@dataclass(frozen=True)
class MeasuredBody(RigidBody):
    """A body of any form, as measured: its mass, its centre of mass and its moment of inertia about the pivot.

    A free swing shows only the quotient ``inertia/(mass centre)``; a balance gives the mass, an edge the centre.
    """

    shape: ClassVar[str] = "measured"
    lacks: ClassVar[Mapping[str, str]] = {**WHOLE, **dict.fromkeys(("added", "cylinder", "width", "flow"), UNKNOWN)}

    fitted: ClassVar[str] = "inertia"

    mass: float = si(1.0, "kg", "mass of the body", above=0.0)
    centre: float = si(0.5, "m", "pivot to the centre of mass", least=0.0)
    inertia: float = si(0.3, "kg m^2", "moment of inertia about the pivot", above=0.0)
    volume: float = si(0.0, "m^3", "displaced volume, with its centre at the centre of mass", least=0.0)

    @property
    def moment(self) -> float:
        """Return the mass times the distance of the centre of mass from the pivot [kg m]."""
        return self.mass * self.centre

    @property
    def reach(self) -> float:
        """Return the radius of gyration about the pivot, ``sqrt(I/m)`` [m]."""
        return sqrt(self.inertia / self.mass)

    @property
    def radius(self) -> float:
        """Return the half width with which the body is drawn, a twelfth of the reach [m]."""
        return self.reach / 12.0

    @property
    def volume_distance(self) -> float:
        """Return the distance from the pivot to the centre of mass [m]."""
        return self.centre

    @property
    def outline(self) -> tuple[Piece, ...]:
        """Return a bar to the radius of gyration with a ball at the centre of mass, as the form is not known."""
        return (("bar", 0.0, self.reach, 0.0), ("ball", self.centre, self.centre, self.radius))

    def check(self) -> None:
        """Raise SceneError where the moment of inertia is below that of the mass in its centre (Steiner's theorem)."""
        least = self.mass * self.centre * self.centre
        if not self.inertia >= least * (1.0 - 1e-12):
            raise SceneError(
                f"The moment of inertia about the pivot must be at least mass times centre squared, {least:.6g} "
                f"kg m^2, not {self.inertia:g} kg m^2. Add that number to one measured about the centre of mass.")


@dataclass(frozen=True)
class Torsion(RigidBody):
    """A torsion pendulum: a level disc that hangs by its centre from a fibre and turns about it.

    ``I = m R**2/2``. The effect fibre turns it back; weight, pivot and wind exert no torque about the fibre.
    """

    shape: ClassVar[str] = "torsion"
    lacks: ClassVar[Mapping[str, str]] = {
        **WHOLE, **dict.fromkeys(("weight", "volume", "wind"), "it acts through the axis of the fibre"),
        **dict.fromkeys(("added", "cylinder", "width", "flow"), "the disc turns in its own plane, and no part of it "
                        "moves across the fluid; give linear_drag or bearing_friction a measured number instead"),
    }

    fitted: ClassVar[str] = "mass"

    mass: float = si(0.5, "kg", "mass of the disc", above=0.0)
    radius: float = si(0.1, "m", "radius of the disc", above=0.0)

    @property
    def inertia(self) -> float:
        """Return the moment of inertia about the fibre, ``m R**2/2`` [kg m²]."""
        return 0.5 * self.mass * self.radius * self.radius

    @property
    def moment(self) -> float:
        """Return 0, as the centre of mass is on the axis [kg m]."""
        return 0.0

    @property
    def reach(self) -> float:
        """Return the radius of the disc, for the speed of its rim [m]."""
        return self.radius

    @property
    def volume_distance(self) -> float:
        """Return the radius of the disc; no effect with a volume acts on it [m]."""
        return self.radius

    @property
    def outline(self) -> tuple[Piece, ...]:
        """Return the disc as it is drawn from above, with a pointer."""
        return (("plate", 0.0, 0.0, self.radius), ("bar", 0.0, self.radius, 0.0))


def _ball(radius: float) -> float:
    """Return the volume of a ball [m³]."""
    return 4.0 / 3.0 * math.pi * radius * radius * radius


_ALL: tuple[type[RigidBody], ...] = (Body, Rod, Disc, Kater, MeasuredBody, Torsion)

BODIES: Mapping[str, type[RigidBody]] = MappingProxyType({body.shape: body for body in _ALL})
"""Every body by its name in scene files."""


def body_data(body: RigidBody) -> dict[str, Any]:
    """Return the measures of a body as a dict that JSON can hold; all but the bob's begin with the shape's name."""
    name = {} if type(body) is Body else {"shape": body.shape}
    return {**name, **dataclasses.asdict(body)}  # type: ignore[call-overload]


def body_from(data: Mapping[str, Any], label: str) -> RigidBody:
    """Return the body of a dict from :func:`body_data`, a ball without "shape".

    Raises SceneError for an unknown shape or measure, with the nearest one; the message begins with ``label``.
    """
    values = dict(data)
    kind = BODIES[one_of(values.pop("shape", Body.shape), "shape", BODIES)]
    names = [f.name for f in fields(kind)]  # type: ignore[arg-type]
    for name in values:
        if name not in names:
            raise SceneError(f"{label} has no value {shown(name)}{nearest(name, [*names, 'shape'])}")
    return kind(**values)
