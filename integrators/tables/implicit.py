"""Diagonally implicit Runge-Kutta methods: tables whose stages are solved one by one with Newton's method."""

from __future__ import annotations

from fractions import Fraction

from integrators.families.runge_kutta import Embedded, RungeKutta
from integrators.method import exact
from integrators.steps.continuous import Extension
from integrators.tables.butcher import bernstein, root

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
