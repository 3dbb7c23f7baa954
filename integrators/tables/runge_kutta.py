"""Butcher tables of explicit Runge-Kutta methods (Butcher 2016, chapter 3)."""

from __future__ import annotations

from integrators.families.runge_kutta import Extension, RungeKutta
from integrators.method import exact
from integrators.tables.butcher import bernstein, triangle

RK4_DENSE = Extension(
    3,
    tuple(bernstein(*powers) for powers in (
        exact(1, "-3/2", "2/3"), exact(0, 1, "-2/3"), exact(0, 1, "-2/3"), exact(0, "-1/2", "2/3"),
    )),
    "Zennaro 1986, Math. Comp. 46, 119; Hairer, Norsett & Wanner 1993, II.6",
)

EXPLICIT = (
    RungeKutta(
        name="forward_euler",
        aliases=("euler", "explicit_euler"),
        order=1,
        source="Euler 1768, Institutionum calculi integralis I, section 650",
        summary="slope at the start of the step; gains energy on an undamped pendulum",
        a=(exact(0),),
        b=exact(1),
    ),
    RungeKutta(
        name="midpoint",
        aliases=("explicit_midpoint", "rk2"),
        order=2,
        source="Runge 1895, Math. Ann. 46, 167",
        summary="Euler step to the middle, then a full step with the slope there",
        a=(exact(0, 0), exact("1/2", 0)),
        b=exact(0, 1),
    ),
    RungeKutta(
        name="heun",
        aliases=("improved_euler",),
        order=2,
        source="Heun 1900, Z. Math. Phys. 45, 23",
        summary="mean of the slopes at both ends, the one at the end predicted by Euler",
        a=(exact(0, 0), exact(1, 0)),
        b=exact("1/2", "1/2"),
    ),
    RungeKutta(
        name="ralston",
        order=2,
        source="Ralston 1962, Math. Comp. 16, 431",
        summary="two stages, with the least bound on the leading error",
        a=triangle(exact("2/3")),
        b=exact("1/4", "3/4"),
    ),
    RungeKutta(
        name="kutta3",
        order=3,
        source="Kutta 1901, Z. Math. Phys. 46, 435",
        summary="Simpson's rule with predicted slopes",
        a=triangle(exact("1/2"), exact(-1, 2)),
        b=exact("1/6", "2/3", "1/6"),
    ),
    RungeKutta(
        name="ssp_rk3",
        aliases=("shu_osher3", "tvd_rk3"),
        order=3,
        source="Shu & Osher 1988, J. Comput. Phys. 77, 439",
        summary="means of Euler steps: preserves every bound that forward Euler preserves",
        a=triangle(exact(1), exact("1/4", "1/4")),
        b=exact("1/6", "1/6", "2/3"),
    ),
    RungeKutta(
        name="rk4",
        aliases=("runge_kutta_4", "kutta4"),
        order=4,
        source="Kutta 1901, Z. Math. Phys. 46, 435",
        summary="the classical four-stage method: accurate, with a slow loss of energy",
        a=(exact(0, 0, 0, 0), exact("1/2", 0, 0, 0), exact(0, "1/2", 0, 0), exact(0, 0, 1, 0)),
        b=exact("1/6", "1/3", "1/3", "1/6"),
        dense=RK4_DENSE,
    ),
    RungeKutta(
        name="rk4_38",
        aliases=("kutta38",),
        order=4,
        source="Kutta 1901, Z. Math. Phys. 46, 435 (the 3/8 rule)",
        summary="four stages like rk4, with a somewhat smaller leading error",
        a=triangle(exact("1/3"), exact("-1/3", 1), exact(1, -1, 1)),
        b=exact("1/8", "3/8", "3/8", "1/8"),
    ),
)
