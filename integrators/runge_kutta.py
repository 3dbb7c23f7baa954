"""Explicit Runge-Kutta methods: each a Butcher table (Butcher 2016, chapter 3)."""

from __future__ import annotations

from integrators.method import RungeKutta, exact

EXPLICIT = (
    RungeKutta(
        name="forward_euler",
        aliases=("euler", "explicit_euler"),
        order=1,
        source="Euler 1768, Institutionum calculi integralis I, section 650",
        summary="everything from the old state; on the pendulum it gains energy at every step",
        a=(exact(0),),
        b=exact(1),
    ),
    RungeKutta(
        name="midpoint",
        aliases=("explicit_midpoint", "rk2"),
        order=2,
        source="Runge 1895, Math. Ann. 46, 167",
        summary="Euler to half a step, then the slope found there",
        a=(exact(0, 0), exact("1/2", 0)),
        b=exact(0, 1),
    ),
    RungeKutta(
        name="heun",
        aliases=("improved_euler",),
        order=2,
        source="Heun 1900, Z. Math. Phys. 45, 23",
        summary="mean of the slopes at both ends, the far one predicted by Euler",
        a=(exact(0, 0), exact(1, 0)),
        b=exact("1/2", "1/2"),
    ),
    RungeKutta(
        name="rk4",
        aliases=("runge_kutta_4", "kutta4"),
        order=4,
        source="Kutta 1901, Z. Math. Phys. 46, 435",
        summary="the classical four-stage method: accurate, with a slow loss of energy",
        a=(exact(0, 0, 0, 0), exact("1/2", 0, 0, 0), exact(0, "1/2", 0, 0), exact(0, 0, 1, 0)),
        b=exact("1/6", "1/3", "1/3", "1/6"),
    ),
)
