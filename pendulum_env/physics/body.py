"""The apparatus: what every rigid body on a pivot answers, and the usual one, a spherical bob on a wire or a rod."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.common.many import applied
from pendulum_env.physics.elementary import power
from pendulum_env.physics.units import Checked, SceneError, choice, si

SUSPENSIONS = {"rod": "carries torque and pushes", "wire": "only pulls; goes slack instead of pushing"}
SLACK = {"stop": "a wire that goes slack ends the run", "warn": "the run warns once, and the wire pushes like a rod"}
THICKNESS = {"rod": 0.002, "wire": 0.0003}
"""Default diameter of a rod or wire [m]."""

Piece = tuple[str, float, float, float]
"""Part of a body as it is drawn: "bar", "ball" or "plate"; its two ends, as distances below the pivot along the body's
axis (the same distance twice for a ball or a plate); its radius or half its width. All in metres."""


class RigidBody(Checked):
    """Base of all bodies: what effects, diagnostics and frames ask of a rigid body that turns about a pivot.

    Subclasses are frozen dataclasses of the measures of one shape, and :data:`pendulum_env.physics.bodies.BODIES` lists
    them. A body lies along an axis through the pivot, and distances on it count downwards when it hangs.

    Attributes:
        shape: the body's name in scene files, such as "rod".
        lacks: properties of a body that some effects need and that this one does not have, each with the reason, as
            the end of a sentence; :attr:`pendulum_env.physics.effects.Effect.needs` names them.
        sizes: the measures whose unit is easily mistaken, for :func:`pendulum_env.physics.units.other_units`.
        fitted: the measure that a fit to a free swing determines by default, because the period depends on it.
    """

    shape: ClassVar[str]
    lacks: ClassVar[Mapping[str, str]] = {}
    sizes: ClassVar[tuple[str, ...]] = ("mass",)
    fitted: ClassVar[str] = "length"

    @property
    def mass(self) -> float:
        """Return the mass of the body [kg]."""
        raise NotImplementedError

    @property
    def inertia(self) -> float:
        """Return the moment of inertia about the pivot [kg m²]."""
        raise NotImplementedError

    @property
    def moment(self) -> float:
        """Return the mass times the distance of the centre of mass from the pivot [kg m]."""
        raise NotImplementedError

    @property
    def reach(self) -> float:
        """Return the distance from the pivot at which speeds are stated, such as that of the bob's centre [m]."""
        raise NotImplementedError

    @property
    def radius(self) -> float:
        """Return half of the width across the flow, for the Reynolds number [m]."""
        raise NotImplementedError

    @property
    def end_mass(self) -> float:
        """Return the mass of a point at the distance ``reach`` that pulls as the swinging body at the pivot [kg]."""
        return self.moment / self.reach

    @property
    def volume(self) -> float:
        """Return the displaced volume [m³]."""
        raise NotImplementedError

    @property
    def volume_distance(self) -> float:
        """Return the distance from the pivot to the centre of the displaced volume [m]."""
        return self.moment / self.mass

    @property
    def suspension(self) -> str:
        """Return "wire" for a body that hangs on a wire, which only pulls, else "rod"."""
        return "rod"

    @property
    def slack(self) -> str:
        """Return what a run does where a wire goes slack: "stop" or "warn"."""
        return "stop"

    @property
    def diameter(self) -> float:
        """Return the diameter of the wire or rod [m]; 0 for a body without one."""
        return 0.0

    @property
    def diameter_known(self) -> bool:
        """Return True if the diameter of the wire or rod was measured."""
        return self.diameter > 0.0

    @property
    def suspension_mass(self) -> float:
        """Return the mass of a bob's wire or rod [kg]."""
        raise NotImplementedError

    @property
    def outline(self) -> tuple[Piece, ...]:
        """Return the parts of the body as they are drawn; none for a bob on a wire or rod, which frames know."""
        return ()

    def added_inertia(self, density: float) -> float:
        """Return the moment of inertia of the fluid that moves along in potential flow [kg m²]; ``density`` [kg/m³]."""
        raise NotImplementedError

    def added_moment(self, density: float) -> float:
        """Return the mass of the fluid that moves along times its distance [kg m]; ``density`` [kg/m³]."""
        raise NotImplementedError

    def drag_moment(self, pressure: float) -> float:
        """Return ``pressure`` times the integral of the cube of the distance over the area across the flow.

        With ``pressure = rho C_d / 2`` [kg/m³] it is the torque of quadratic drag over the square of the angular
        velocity [kg m²].
        """
        raise NotImplementedError

    def lever(self, exponent: float) -> float:
        """Return a power of the distance from the pivot to the end of the wire or rod, summed over both of its ends."""
        raise NotImplementedError

    @property
    def even_lever(self) -> float:
        """Return the lever of a uniform flow: the distance integrated along the wire or rod, negative above the pivot
        [m²].
        """
        raise NotImplementedError

    def taut(self) -> RigidBody:
        """Return the body with a rod in place of a wire."""
        return self

    def check(self) -> None:
        """Raise SceneError where the measures contradict each other."""
        if not self.inertia > 0.0:
            raise SceneError(f"The body '{self.shape}' has a moment of inertia of {self.inertia:g} kg m^2; it must be "
                             "above 0.")


@dataclass(frozen=True)
class Body(RigidBody):
    """A spherical bob on a wire or rod that hangs from a pivot.

    The moment of inertia is ``I = m L**2`` [kg m²], as for a point mass; the effects finite_bob and suspension add the
    rest. Raises SceneError for values out of range.
    """

    shape: ClassVar[str] = "ball"
    sizes: ClassVar[tuple[str, ...]] = ("length", "mass", "radius")

    length: float = si(1.0, "m", "pivot to the bob's centre", above=0.0)
    mass: float = si(1.0, "kg", "mass of the bob", above=0.0)
    radius: float = si(0.03, "m", "radius of the bob", above=0.0)
    suspension: str = choice("rod", SUSPENSIONS, "kind of suspension of the bob")
    slack: str = choice("stop", SLACK, "what a run does where a wire goes slack")
    thickness: float | None = si(
        None, "m", "diameter of the rod or wire; by default 2 mm or 0.3 mm", above=0.0, optional=True
    )
    suspension_density: float = si(7850.0, "kg/m^3", "density of the rod or wire, by default steel's", above=0.0)

    @property
    def inertia(self) -> float:
        """Return the moment of inertia of the bob about the pivot, as a point mass: ``m L**2`` [kg m²]."""
        return self.mass * self.length * self.length

    @property
    def moment(self) -> float:
        """Return the mass times the distance of the bob from the pivot, ``m L`` [kg m]."""
        return self.mass * self.length

    @property
    def reach(self) -> float:
        """Return the length, at whose end speeds are those of the bob [m]."""
        return self.length

    @property
    def end_mass(self) -> float:
        """Return the mass of the bob [kg]."""
        return self.mass

    @property
    def volume_distance(self) -> float:
        """Return the distance from the pivot to the bob's centre [m]."""
        return self.length

    @property
    def diameter(self) -> float:
        """Return the diameter of the rod or wire [m]."""
        return THICKNESS[self.suspension] if self.thickness is None else self.thickness

    @property
    def diameter_known(self) -> bool:
        """Return True if the thickness is given and not the default."""
        return self.thickness is not None

    @property
    def suspension_mass(self) -> float:
        """Return the mass of the rod or wire, from the pivot to the bob's centre [kg]."""
        return 0.25 * math.pi * self.diameter * self.diameter * self.length * self.suspension_density

    @property
    def volume(self) -> float:
        """Return the volume of the bob [m³]."""
        return 4.0 / 3.0 * math.pi * applied(power, self.radius, 3.0)

    @property
    def frontal_area(self) -> float:
        """Return the cross-section of the bob, ``pi a**2`` [m²]."""
        return math.pi * self.radius * self.radius

    def added_inertia(self, density: float) -> float:
        """Return the moment of inertia of half the displaced fluid at the bob's centre [kg m²] (Green 1833)."""
        return 0.5 * density * self.volume * self.length * self.length

    def added_moment(self, density: float) -> float:
        """Return half the displaced mass times its distance from the pivot [kg m]."""
        return 0.5 * density * self.volume * self.length

    def drag_moment(self, pressure: float) -> float:
        """Return ``pressure pi a**2 L**3``; :meth:`RigidBody.drag_moment` explains it [kg m²]."""
        return pressure * self.frontal_area * applied(power, self.length, 3.0)

    def lever(self, exponent: float) -> float:
        """Return a power of the length."""
        return applied(power, self.length, exponent)

    @property
    def even_lever(self) -> float:
        """Return half the square of the length [m²]."""
        return 0.5 * self.length * self.length

    def taut(self) -> Body:
        """Return the body with a rod of the wire's thickness in place of the wire."""
        return dataclasses.replace(self, suspension="rod", thickness=self.diameter)

    def check(self) -> None:
        """Raise nothing: every bob within the ranges of its measures is a body, and the scene checks its inertia."""
