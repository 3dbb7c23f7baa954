"""Simple splitting methods: compositions of kicks, drifts and exact drag flows.

Drag is treated by its exact flow and does not become unstable at any step. The only exception is
``symplectic_euler``, which includes drag explicitly in the kick, as the lab exercise does.
"""

from __future__ import annotations

from fractions import Fraction

from integrators.families.splitting import DRAG, DRIFT, KICK, PUSH, Splitting

ONE, HALF = Fraction(1), Fraction(1, 2)

SPLITTING = (
    Splitting(
        name="symplectic_euler",
        aliases=("semi_implicit_euler", "euler_cromer"),
        order=1,
        source="Cromer 1981, Am. J. Phys. 49, 455; de Vogelaere 1956",
        summary="velocity first, then the angle with the new velocity; drag is explicit in the kick",
        flows=((PUSH, ONE), (DRIFT, ONE)),
    ),
    Splitting(
        name="symplectic_euler_position_first",
        order=1,
        source="Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, eq. I.1.9",
        summary="angle first, then the velocity at the new angle, then the exact drag flow",
        flows=((DRIFT, ONE), (KICK, ONE), (DRAG, ONE)),
    ),
    Splitting(
        name="conformal_symplectic_euler",
        order=1,
        source="McLachlan & Quispel 2002, Acta Numerica 11, 341, section 3.9; Bhatt, Floyd & Moore 2016",
        summary="exact drag flow, then symplectic Euler: phase-space area shrinks at exactly the true rate",
        flows=((DRAG, ONE), (KICK, ONE), (DRIFT, ONE)),
    ),
    Splitting(
        name="velocity_verlet",
        aliases=("verlet", "leapfrog", "stoermer", "stoermer_verlet"),
        order=2,
        source="Verlet 1967, Phys. Rev. 159, 98; Swope et al. 1982, J. Chem. Phys. 76, 637",
        summary="half kick, drift, half kick, with half an exact drag flow at either end; one force per step",
        flows=((DRAG, HALF), (KICK, HALF), (DRIFT, ONE), (KICK, HALF), (DRAG, HALF)),
    ),
)
