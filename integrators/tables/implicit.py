"""Implicit Runge-Kutta methods: diagonally implicit ones, and Gauss, Radau IIA and Lobatto IIIC.

The stages of the former are solved one by one with Newton's method, those of the latter together. The stability
functions of the latter are the Padé approximations of exp (Hairer & Wanner 1996, section IV.5).
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

from integrators.families.runge_kutta import Embedded, RungeKutta
from integrators.method import exact, total
from integrators.steps.continuous import Extension
from integrators.tables.butcher import at_zero, bernstein, cube_root, interpolating, root

ALEXANDER = 1 - root(2) / 2

IMPLICIT = (
    RungeKutta(
        name="backward_euler",
        aliases=("implicit_euler",),
        order=1,
        a_stable=True,
        l_stable=True,
        source="Curtiss & Hirschfelder 1952, Proc. Natl. Acad. Sci. 38, 235",
        summary="slope at the end of the step: never unstable; loses energy at every step",
        a=(exact(1),),
        b=exact(1),
    ),
    RungeKutta(
        name="implicit_midpoint",
        aliases=("gauss2",),
        order=2,
        a_stable=True,
        source="Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, II.1.3 (one-stage Gauss)",
        summary="slope at the middle of the step: symplectic, symmetric and A-stable",
        a=(exact("1/2"),),
        b=exact(1),
    ),
    RungeKutta(
        name="trapezoid",
        aliases=("crank_nicolson", "newmark", "average_acceleration"),
        order=2,
        a_stable=True,
        source="Crank & Nicolson 1947, Proc. Camb. Phil. Soc. 43, 50",
        summary="mean of the slopes at both ends: symmetric and A-stable",
        a=(exact(0, 0), exact("1/2", "1/2")),
        b=exact("1/2", "1/2"),
    ),
    RungeKutta(
        name="sdirk2",
        order=2,
        a_stable=True,
        l_stable=True,
        source="Alexander 1977, SIAM J. Numer. Anal. 14, 1006",
        summary="two implicit stages with the diagonal coefficient 1 - sqrt(1/2): second order and L-stable",
        a=((ALEXANDER, Fraction(0)), (1 - ALEXANDER, ALEXANDER)),
        b=(1 - ALEXANDER, ALEXANDER),
    ),
    RungeKutta(
        name="sdirk4",
        order=4,
        a_stable=True,
        l_stable=True,
        source="Hairer & Wanner 1996, Solving ODEs II, table IV.6.5",
        summary="five implicit stages with the diagonal coefficient 1/4: L-stable, with an error estimate of order 3",
        a=(
            exact("1/4", 0, 0, 0, 0),
            exact("1/2", "1/4", 0, 0, 0),
            exact("17/50", "-1/25", "1/4", 0, 0),
            exact("371/1360", "-137/2720", "15/544", "1/4", 0),
            exact("25/24", "-49/48", "125/16", "-85/12", "1/4"),
        ),
        b=exact("25/24", "-49/48", "125/16", "-85/12", "1/4"),
        embedded=(Embedded(3, exact("59/48", "-17/96", "225/32", "-85/12", 0)),),
        dense=Extension(3, tuple(bernstein(*exact(*powers)) for powers in (
            ("11/3", "-463/72", "217/36", "-20/9"),
            ("11/2", "-385/16", "661/24", "-10"),
            ("-125/18", "20125/432", "-8875/216", "250/27"),
            (0, "-85/4", "85/6", 0),
            ("-11/9", "557/108", "-359/54", "80/27"),
        )), "Hairer & Wanner 1996, section IV.6"),
    ),
)


HALF = Fraction(1, 2)
R3, R6, R15, R30 = root(3), root(6), root(15), root(30)


def _gauss8() -> tuple[tuple[tuple[Fraction, ...], ...], tuple[Fraction, ...]]:
    """Return the Butcher table (a, b) of the four-stage Gauss method.

    In the code e1, f1, ... are the numbers that Butcher calls omega1, omega1', ...
    """
    e1, f1 = Fraction(1, 8) - R30 / 144, Fraction(1, 8) + R30 / 144
    e2, f2 = root((15 + 2 * R30) / 35) / 2, root((15 - 2 * R30) / 35) / 2
    e3, f3 = e2 * (Fraction(1, 6) + R30 / 24), f2 * (Fraction(1, 6) - R30 / 24)
    e4, f4 = e2 * (Fraction(1, 21) + 5 * R30 / 168), f2 * (Fraction(1, 21) - 5 * R30 / 168)
    e5, f5 = e2 - 2 * e3, f2 - 2 * f3
    table = (
        (e1, f1 - e3 + f4, f1 - e3 - f4, e1 - e5),
        (e1 - f3 + e4, f1, f1 - f5, e1 - f3 - e4),
        (e1 + f3 + e4, f1 + f5, f1, e1 + f3 - e4),
        (e1 + e5, f1 + e3 + f4, f1 + e3 - f4, e1),
    )
    return table, (2 * e1, 2 * f1, 2 * f1, 2 * e1)


GAUSS8 = RungeKutta(
    name="gauss8",
    aliases=("kuntzmann_butcher8",),
    order=8,
    a_stable=True,
    source="Kuntzmann 1961, ZAMM 41, T28; Butcher 1964, Math. Comp. 18, 50",
    summary="four stages at the Gauss nodes, solved together: symplectic, symmetric, A-stable",
    a=_gauss8()[0],
    b=_gauss8()[1],
)

RADAU5 = (
    ((88 - 7 * R6) / 360, (296 - 169 * R6) / 1800, (-2 + 3 * R6) / 225),
    ((296 + 169 * R6) / 1800, (88 + 7 * R6) / 360, (-2 - 3 * R6) / 225),
    ((16 - R6) / 36, (16 + R6) / 36, Fraction(1, 9)),
)
RADAU5_START = (6 + cube_root(81) - cube_root(9)) / 30
"""Weight of the slope at the start of the step in radau5's estimate: the real eigenvalue of its table."""
RADAU5_LOW = tuple(x - RADAU5_START * y for x, y in zip(RADAU5[-1], at_zero([total(r) for r in RADAU5]), strict=True))
"""Weights of radau5's stages beside it, exact for slopes of degree 2 (Hairer & Wanner 1996, section IV.8)."""

TABLES = (
    RungeKutta(
        name="gauss4",
        order=4,
        a_stable=True,
        source="Hammer & Hollingsworth 1955, MTAC 9, 92; Butcher 1964, Math. Comp. 18, 50",
        summary="two stages at the Gauss nodes, solved together: symplectic, symmetric, A-stable",
        a=((Fraction(1, 4), Fraction(1, 4) - R3 / 6), (Fraction(1, 4) + R3 / 6, Fraction(1, 4))),
        b=(HALF, HALF),
    ),
    RungeKutta(
        name="gauss6",
        aliases=("kuntzmann_butcher6",),
        order=6,
        a_stable=True,
        source="Kuntzmann 1961, ZAMM 41, T28; Butcher 1964, Math. Comp. 18, 50",
        summary="three stages at the Gauss nodes, solved together: symplectic, symmetric, A-stable",
        a=(
            (Fraction(5, 36), Fraction(2, 9) - R15 / 15, Fraction(5, 36) - R15 / 30),
            (Fraction(5, 36) + R15 / 24, Fraction(2, 9), Fraction(5, 36) - R15 / 24),
            (Fraction(5, 36) + R15 / 30, Fraction(2, 9) + R15 / 15, Fraction(5, 36)),
        ),
        b=exact("5/18", "4/9", "5/18"),
    ),
    GAUSS8,
    RungeKutta(
        name="radau3",
        aliases=("radau_iia3",),
        order=3,
        a_stable=True,
        l_stable=True,
        source="Ehle 1969, Univ. of Waterloo CSRR 2010; Hairer & Wanner 1996, table IV.5.5",
        summary="two Radau IIA stages, the last at the step's end: L-stable",
        a=(exact("5/12", "-1/12"), exact("3/4", "1/4")),
        b=exact("3/4", "1/4"),
    ),
    RungeKutta(
        name="radau5",
        aliases=("radau_iia5",),
        order=5,
        a_stable=True,
        l_stable=True,
        source="Ehle 1969, Univ. of Waterloo CSRR 2010; Hairer & Wanner 1996, table IV.5.6",
        summary="three Radau IIA stages, the last at the step's end: L-stable, with an error estimate of order 3",
        a=RADAU5,
        b=RADAU5[-1],
        embedded=(Embedded(3, RADAU5_LOW, start=RADAU5_START),),
    ),
    RungeKutta(
        name="lobatto3c",
        aliases=("lobatto_iiic4",),
        order=4,
        a_stable=True,
        l_stable=True,
        source="Chipman 1971, BIT 11, 384; Hairer & Wanner 1996, table IV.5.12",
        summary="three Lobatto IIIC stages, at both ends and the middle: L-stable",
        a=(exact("1/6", "-1/3", "1/6"), exact("1/6", "5/12", "-1/12"), exact("1/6", "2/3", "1/6")),
        b=exact("1/6", "2/3", "1/6"),
    ),
)

COLLOCATION = tuple(
    replace(table, dense=interpolating(len(table.b), table.c, "Hairer, Norsett & Wanner 1993, II.7"))
    for table in TABLES
)
"""Implicit Runge-Kutta methods with dense output through the slopes of their s stages, of order s.

For all but lobatto3c, which is not a collocation method, this is the collocation polynomial.
"""
