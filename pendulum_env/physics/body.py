"""The apparatus: a spherical bob on a wire or a rod, hung from a pivot."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pendulum_env.physics.elementary import power
from pendulum_env.physics.units import Checked, choice, si

SUSPENSIONS = {"rod": "carries torque and pushes", "wire": "only pulls; goes slack instead of pushing"}
SLACK = {"stop": "a wire that goes slack ends the run", "warn": "the run warns once, and the wire pushes like a rod"}
THICKNESS = {"rod": 0.002, "wire": 0.0003}
"""Default diameter of a rod or wire [m]."""


@dataclass(frozen=True)
class Body(Checked):
    """A spherical bob on a wire or rod that hangs from a pivot.

    The moment of inertia is ``I = m L**2`` [kg m²], as for a point mass; the effects finite_bob and suspension add the
    rest. Raises SceneError for values out of range.
    """

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
    def diameter(self) -> float:
        """Return the diameter of the rod or wire [m]."""
        return THICKNESS[self.suspension] if self.thickness is None else self.thickness

    @property
    def suspension_mass(self) -> float:
        """Return the mass of the rod or wire, from the pivot to the bob's centre [kg]."""
        return 0.25 * math.pi * self.diameter * self.diameter * self.length * self.suspension_density

    @property
    def volume(self) -> float:
        """Return the volume of the bob [m³]."""
        return 4.0 / 3.0 * math.pi * power(self.radius, 3.0)

    @property
    def frontal_area(self) -> float:
        """Return the cross-section of the bob, ``pi a**2`` [m²]."""
        return math.pi * self.radius * self.radius
