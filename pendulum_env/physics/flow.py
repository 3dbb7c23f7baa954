"""Flow past the bob: Reynolds number, drag coefficient of a sphere, and what they mean for the damping model."""

from __future__ import annotations

import math

from pendulum_env.physics.body import Body
from pendulum_env.physics.medium import Medium

CLIFT_GAUVIN_LIMIT = 2.0e5
"""Reynolds number up to which :func:`sphere_drag_coefficient` is valid."""

STOKES_LIMIT = 0.01
"""Reynolds number below which the standard drag curve is Stokes' law (Clift, Grace & Weber 1978, table 5.2)."""

REGIMES = (
    (1.0, "creeping flow: Stokes' linear drag holds"),
    (20.0, "Stokes' linear drag is already too small (by half at Re = 10); neither linear nor quadratic"),
    (500.0, "between linear and quadratic: the drag coefficient still falls with speed, use C_d(Re)"),
    (2.0e5, "the drag coefficient is nearly constant: drag is quadratic, Stokes' linear drag is far too small"),
)
"""Upper Reynolds number of a regime, and what it says of the damping model (Clift, Grace & Weber 1978, chapter 5)."""


def reynolds_number(speed: float, body: Body, medium: Medium) -> float:
    """``Re = rho |V| 2a / mu`` of the bob at ``speed`` [m/s]; 0 at rest and in vacuum, else inf without viscosity."""
    inertia = medium.density * abs(speed) * 2.0 * body.radius
    if medium.viscosity == 0.0:
        return math.inf if inertia else 0.0
    return inertia / medium.viscosity


def boundary_layer(omega: float, medium: Medium) -> float:
    """``delta = sqrt(2 nu/omega)`` [m]: how far a wall that oscillates at ``omega`` [1/s] moves the fluid along.

    Source: Stokes 1851; Landau & Lifshitz, Fluid Mechanics, section 24. Raises ZeroDivisionError for a medium without
    density, or at rest.
    """
    return math.sqrt(2.0 * medium.viscosity / (medium.density * omega))


def sphere_drag_coefficient(reynolds: float) -> float:
    """``C_d = 24/Re (1 + 0.152 Re^0.677) + 0.417/(1 + 5070 Re^-0.94)``, 0 < Re <= 2e5.

    Source: the form of Clift & Gauvin 1971, Can. J. Chem. Eng. 49, 439, with the coefficients of Brown & Lawler 2003,
    J. Environ. Eng. 129, 222. Raises ValueError outside.
    """
    if not 0.0 < reynolds <= CLIFT_GAUVIN_LIMIT:
        raise ValueError(f"A sphere's drag coefficient is known for 0 < Re <= {CLIFT_GAUVIN_LIMIT:g}, not {reynolds}.")
    return float(24.0 / reynolds * (1.0 + 0.152 * reynolds**0.677) + 0.417 / (1.0 + 5070.0 * reynolds**-0.94))


def regime(reynolds: float) -> str:
    """What a Reynolds number says of the damping model, in a sentence."""
    for limit, meaning in REGIMES:
        if reynolds <= limit:
            return meaning
    return "the boundary layer turns turbulent and the drag coefficient drops: outside these models"
