"""Diagonally implicit Runge-Kutta methods: tables whose stages are solved one by one with Newton's method."""

from __future__ import annotations

from integrators.method import RungeKutta, exact

IMPLICIT = (
    RungeKutta(
        name="backward_euler",
        aliases=("implicit_euler",),
        order=1,
        a_stable=True,
        l_stable=True,
        source="Curtiss & Hirschfelder 1952, Proc. Natl. Acad. Sci. 38, 235",
        summary="everything from the new state: never unstable, loses energy at every step",
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
)
