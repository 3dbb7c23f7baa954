"""Reference solutions of motions with kinks: scipy's DOP853 from one zero of the velocity to the next.

The equations are written by hand; no other part of the package is used. Between zeros of the velocity
``theta'' = force(t, theta, theta') -
limit sign(theta')`` is smooth; at a zero the bob stays at rest while ``|force(t, theta, 0)| <= limit`` (Coulomb 1785;
Filippov 1988, Differential Equations with Discontinuous Righthand Sides, section 4).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pendulum_env.truth.answer import Truth

Array = NDArray[np.float64]
Force = Callable[[float, float, float], float]
"""``force(t, theta, theta')`` without dry friction, per moment of inertia [rad/s²]."""
RTOL, ATOL = 3e-14, 1e-16
LOOKS = 256
"""Times between two marks at which the force on a bob at rest is compared with the limit of dry friction."""
MOST_EVENTS = 10_000
"""Maximum number of zeros of the velocity in one motion."""
CLOSE = 1e-12
"""Error of these solutions, as a fraction of the largest angle or in rad, confirmed by closed forms and 30 digits."""


def smooth(force: Force, start: tuple[float, float], begin: float, end: float) -> tuple[float, float]:
    """Return angle and velocity at the time ``end``, by Dormand & Prince's method of order 8, for a smooth force.

    (Hairer, Norsett & Wanner 1993, II.5.) Raises ArithmeticError if the integration fails.
    """
    from scipy.integrate import DOP853

    if end == begin:
        return start
    solver = DOP853(lambda t, y: np.array([y[1], force(t, float(y[0]), float(y[1]))]), begin, np.array(start), end,
                    rtol=RTOL, atol=ATOL)
    while solver.status == "running":
        solver.step()
    if solver.status != "finished":
        raise ArithmeticError(f"The reference solution ends at {solver.t:g} s: the integration failed there.")
    return float(solver.y[0]), float(solver.y[1])


def _stop(force: Force, start: tuple[float, float], begin: float, end: float, side: float) -> float | None:
    """Return the time before ``end`` at which the velocity returns to zero; None if it does not."""
    from scipy.integrate import solve_ivp

    def turning(_t: float, y: Array) -> float:
        return side * float(y[1])

    turning.terminal, turning.direction = True, -1.0  # type: ignore[attr-defined]
    solution = solve_ivp(lambda t, y: [y[1], force(t, float(y[0]), float(y[1]))], (begin, end), start, method="DOP853",
                      rtol=RTOL, atol=ATOL, events=turning)
    times = np.concatenate(solution.t_events or [np.empty(0)])
    if not times.size:
        return None
    near = float(times[0])
    for _ in range(4):  # Newton on complete integrations, because the interpolant has a lower order
        q, v = smooth(force, start, begin, near)
        near = min(max(near - v / force(near, q, v), begin), end)
    return near


def _let_go(force: Force, limit: float, angle: float, begin: float, end: float) -> float:
    """Return the time at which the force on a bob at rest exceeds the limit of dry friction; ``end`` if it does not."""
    from scipy.optimize import brentq

    def excess(t: float) -> float:
        return abs(force(t, angle, 0.0)) - limit

    times = np.linspace(begin, end, LOOKS + 1)
    beyond = np.flatnonzero([excess(float(t)) > 0.0 for t in times])
    if not beyond.size or beyond[0] == 0:
        return end if not beyond.size else begin
    low, high = float(times[beyond[0] - 1]), float(times[beyond[0]])
    time = float(brentq(excess, low, high, xtol=1e-15, rtol=1e-15))
    while excess(time) <= 0.0:
        time = math.nextafter(time, math.inf)
    return time


def path(force: Force, limit: float, start: tuple[float, float], marks: Sequence[float]) -> Truth:
    """Return the reference solution of a motion with dry friction at the times ``marks`` [s], increasing from 0.

    ``limit`` is the largest acceleration by dry friction [rad/s²]; 0: no friction. Raises ArithmeticError if the
    integration fails, or the bob stops too often.
    """
    t, state, rows, events = 0.0, start, [], 0
    side = 0.0
    for mark in marks:
        while t < mark:
            events += 1
            if events > MOST_EVENTS + len(marks):
                raise ArithmeticError(f"The bob stops and starts too often near {t:g} s for a reference solution.")
            if state[1] == 0.0:
                push = force(t, state[0], 0.0)
                if side == 0.0 and abs(push) <= limit:
                    t = _let_go(force, limit, state[0], t, mark)
                    side = math.copysign(1.0, force(t, state[0], 0.0)) if t < mark else 0.0
                    continue
                side = side or math.copysign(1.0, push)
            else:
                side = math.copysign(1.0, state[1])

            def sliding(s: float, q: float, v: float, side: float = side) -> float:
                return force(s, q, v) - side * limit

            stop = _stop(sliding, state, t, mark, side)
            end = mark if stop is None else stop
            q, v = smooth(sliding, state, t, end)
            t, state, side = end, (q, v if stop is None else 0.0), 0.0
        rows.append(state)
    angle, velocity = np.array(rows).T
    error = CLOSE * max(1.0, float(np.max(np.abs(angle))))
    return Truth(np.array(marks), angle, velocity, error, "Dormand & Prince's order 8 between zeros of the velocity")
