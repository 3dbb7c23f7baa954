"""Compensated runs against steps that are taken here in 40 digits, from the tables' coefficients, with exact sums."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

from integrators import METHODS, RungeKutta, Splitting, solve
from integrators.families.nystrom import Nystrom
from pendulum_env import rollout

EXPLICIT = [name for name, m in METHODS.items() if isinstance(m, (RungeKutta, Nystrom)) and not m.implicit]
SPLITTINGS = [name for name, m in METHODS.items() if isinstance(m, Splitting)]
Force = Callable[[Any], Any]
State = tuple[Any, Any]


def row(numbers: Any) -> list[Any]:
    """Return exact fractions as numbers of 40 digits."""
    return [mpmath.mpf(x.numerator) / x.denominator for x in numbers]


def runge_kutta(method: Any, force: Force, q: Any, v: Any, h: Any) -> State:
    """Take a step of an explicit Runge-Kutta method."""
    speeds: list[Any] = []
    forces: list[Any] = []
    for weights in method.a:
        a = row(weights)
        place = q + h * mpmath.fdot(a, speeds) if speeds else q
        speeds.append(v + h * mpmath.fdot(a, forces) if forces else v)
        forces.append(force(place))
    b = row(method.b)
    return q + h * mpmath.fdot(b, speeds), v + h * mpmath.fdot(b, forces)


def nystrom(method: Any, force: Force, q: Any, v: Any, h: Any) -> State:
    """Take a step of an explicit Nyström method, for a force of the angle."""
    forces: list[Any] = []
    for c, weights in zip(row(method.c), method.a, strict=True):
        forces.append(force(q + c * h * v + (h * h * mpmath.fdot(row(weights), forces) if forces else 0)))
    return (q + h * v + h * h * mpmath.fdot(row(method.bbar), forces), v + h * mpmath.fdot(row(method.b), forces))


def splitting(method: Any, force: Force, q: Any, v: Any, h: Any) -> State:
    """Take a step of kicks and drifts."""
    for (kind, _), part in zip(method.flows, row(part for _, part in method.flows), strict=True):
        if kind == "drift":
            q = q + part * h * v
        elif kind != "drag":
            v = v + part * h * force(q)
    return q, v


def by_hand(name: str, force: Force, q: Any, v: Any, h: Any, steps: int) -> list[State]:
    """Return the states after each step."""
    method = METHODS[name]
    step = splitting if name in SPLITTINGS else nystrom if isinstance(method, Nystrom) else runge_kutta
    states = [(q, v)]
    for _ in range(steps):
        states.append(step(method, force, *states[-1], h))
    return states


def apart(states: list[State], q: Any, lost_q: Any, v: Any, lost_v: Any) -> float:
    """Return the largest distance of a run, with its stored rounding errors, from exact states."""
    return max(float(abs(mpmath.mpf(x) + low - exact))
               for values, lows, side in ((q, lost_q, 0), (v, lost_v, 1))
               for x, low, exact in zip(values, lows, (state[side] for state in states), strict=True))


@pytest.mark.parametrize("name", EXPLICIT + SPLITTINGS)
def test_solve_loses_less_than_a_unit_in_the_last_place(name: str) -> None:
    """100 steps of 1/32 on ``q'' = q**3/6 - q``; rounding of the sums alone would lose up to 100 units of 1e-16."""
    h, steps = 2.0**-5, 100
    with mpmath.workdps(40):
        exact = by_hand(name, lambda q: q * q * q / 6 - q, mpmath.mpf(0.75), mpmath.mpf(0.5), mpmath.mpf(h), steps)
        distances = []
        for on in (True, False):
            found = solve(lambda t, q, v: q * q * q / 6 - q, 0.75, 0.5, [k * h for k in range(steps + 1)], method=name,
                          h=h * (1.0 + 1e-12), compensated=on)
            none = np.zeros(steps + 1)
            lost = (none if found.lost_q is None else found.lost_q, none if found.lost_v is None else found.lost_v)
            distances.append(apart(exact, found.q, lost[0], found.v, lost[1]))
    # Coefficients that cancel add rounding within the increments, which sums cannot remove.
    method: Any = METHODS[name]
    rows = (method.b,) if name not in SPLITTINGS else tuple(
        tuple(part for kind, part in method.flows if kind == one) for one in ("kick", "drift"))
    size = max(1.0, *(float(sum(map(abs, one))) for one in rows))
    assert distances[0] < 2.2e-16 * size
    assert distances[0] < distances[1]


@pytest.mark.parametrize("name", ["rk4", "velocity_verlet", "kahan_li6", "rkn43"])
def test_rollout_loses_as_little(name: str) -> None:
    """400 steps on the pendulum, whose sine rounds each force, so that increments err by some ulps of h omega0²."""
    h, steps = 2.0**-6, 400
    with mpmath.workdps(40):
        exact = by_hand(name, lambda q: -mpmath.mpf(9.81) * mpmath.sin(q), mpmath.mpf(2), mpmath.mpf(0), mpmath.mpf(h),
                        steps)
        distances = []
        for on in (True, False):
            run = rollout("vacuum", integrator=name, angle=2.0, velocity=0.0, dt=h, duration=steps * h,
                          backend="python", compensated=on)
            none = np.zeros(steps + 1)
            lost = (none, none) if run.lost_angle is None else (run.lost_angle, run.lost_velocity)
            distances.append(apart(exact, run.angle, lost[0], run.velocity, lost[1]))
    assert distances[0] < 5e-15
    assert distances[0] < 0.5 * distances[1]
