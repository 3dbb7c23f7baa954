"""What theory says of long steps under full gravity: the first of them, and how soon a run may say that it diverged.

In units of 1/omega0 the pendulum is ``q'' = -sin(q)``, and a step is z = omega0 h. Of A-stable methods no theorem keeps
this motion bounded: B-stability is of forces that contract, which a conservative one does not; only the discrete
gradient keeps its energy at any step (Gonzalez 1996), and the exact flow.
"""

from __future__ import annotations

import math
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root
from scipy.special import ellipk

from integrators import Method, Multistep, RungeKutta, Splitting
from integrators.families.adams import Adams
from integrators.families.backward_differences import BackwardDifference
from integrators.families.energy_preserving import DiscreteGradient
from integrators.families.nystrom import Nystrom
from integrators.families.splitting import DRAG, DRIFT
from integrators.families.structural import GeneralizedAlpha
from pendulum_env.physics.energy import ABSURD
from pendulum_env.truth.own_error import error_constant

Floats = NDArray[np.float64]
FIRST = 4
"""Steps that are looked at one by one."""
SAYS = 0.3
"""The error [rad] below which a method's order says something."""


# --- the first steps ------------------------------------------------------------------------------------------------


def _runge_kutta(method: RungeKutta, q: float, v: float, z: float) -> tuple[float, float]:
    """``K = -sin(q + c z v + z**2 A A K)``: in turn, or, of implicit tables, by MINPACK's hybrid method."""
    a, b = np.array(method.a, dtype=float), np.array(method.b, dtype=float)
    places, twice = q + z * v * a.sum(axis=1), z * z * (a @ a)
    k = -np.sin(places)
    if method.implicit:
        def missing(slopes: Floats) -> Floats:
            return np.asarray(slopes + np.sin(places + twice @ slopes))

        k = root(missing, k, tol=1e-14).x
    else:
        for i in range(len(b)):
            k[i] = -math.sin(places[i] + twice[i] @ np.where(np.arange(len(b)) < i, k, 0.0))
    return float(q + z * v + z * z * (b @ a @ k)), float(v + z * (b @ k))


def _nystrom(method: Nystrom, q: float, v: float, z: float) -> tuple[float, float]:
    a, c, bbar, b = (np.array(part, dtype=float) for part in (method.a, method.c, method.bbar, method.b))
    k = np.zeros(len(b))
    for i in range(len(b)):
        k[i] = -math.sin(q + c[i] * z * v + z * z * (a[i] @ k))
    return float(q + z * v + z * z * (bbar @ k)), float(v + z * (b @ k))


def own_steps(method: Method, angle: float, velocity: float, z: float, steps: int) -> Floats | None:
    """(q, v) of the first steps by the method's own table, written out here; None for methods that it is not of.

    Those are methods of many steps, Chin's, Taylor's and the two that keep the energy, which is looked at instead; and
    implicit tables from z = 1 on, whose equations may have several solutions (``z**2 |A A| < 1`` makes it one).
    """
    if method.implicit and z >= 1.0:
        return None
    q, v = angle, velocity
    states = [(q, v)]
    for _ in range(steps):
        if isinstance(method, RungeKutta):
            q, v = _runge_kutta(method, q, v, z)
        elif isinstance(method, Nystrom):
            q, v = _nystrom(method, q, v, z)
        elif isinstance(method, Splitting):
            for kind, part in method.flows:
                q, v = (q + float(part) * z * v, v) if kind == DRIFT else (
                    q, v - float(part) * z * math.sin(q) * (kind != DRAG))
        else:
            return None
        states.append((q, v))
    return np.array(states)


def own_size(method: Method, states: Floats, z: float) -> Floats:
    """By how much roundings of 1e-14 of each state may have grown; inf where that is too much to compare anything.

    A force and the way that it makes multiply them by (1 + z)**2 at most, e**(6 z) a step is of short steps less.
    """
    steps, largest = np.arange(len(states)), np.maximum.accumulate(1.0 + np.abs(states).max(axis=1))
    logs = np.minimum(6.0 * z * steps, 2.0 * math.log1p(z) * method.evaluations * steps)
    size = np.exp(np.minimum(logs, 600.0)) * 1e-14 * largest
    return np.asarray(np.where(size < 1e-3 * largest, size + 1e-12 * largest, math.inf))


def order_error(method: Method, angle: float, z: float, steps: int) -> Floats:
    """What the order leaves of the angle [rad] after each of the first steps of a release from rest next to the top.

    A step errs by ``C z**(p + 1)`` of the distance to the top, which grows as e**(z n), as do earlier errors. To this
    the nonlinear part comes: the Taylor coefficients of the angle end as ``(4/n) d**-n``, d being the distance to its
    logarithmic singularity, iK' above the bottom (Whittaker & Watson 1927, 22); of them C (p + 1)! is left. Twice that.
    The first steps of backward differences are their starter's. Of other methods of many steps, whose constants are
    (p + 1)! times as large beside those coefficients, of sub-steps back, which add up outside the step, and where the
    constant is cut off at 1/2, it says nothing: inf.
    """
    chosen: Method = method.starter if isinstance(method, BackwardDifference) else method
    constant = error_constant(chosen)
    back = isinstance(chosen, Splitting) and any(part < 0 for _, part in chosen.flows)
    if isinstance(chosen, Multistep) or back or math.isinf(chosen.order) or constant >= 0.5:
        return np.full(steps + 1, math.inf)
    power = chosen.order + 1
    m = math.sin(0.5 * angle) ** 2
    allowed, total = [0.0], 0.0
    for n in range(1, steps + 1):
        d = math.hypot(max(ellipk(m) - n * z, 0.0), ellipk(1.0 - m))
        smooth = constant * z**power * (math.pi - angle) * math.exp(n * z)
        rough = constant * math.factorial(power) * 4.0 / power * (z / d) ** power
        total = total * math.exp(z) + smooth + rough
        begun = chosen is method or n <= getattr(method, "past", 0)
        allowed.append(2.0 * total if begun else math.inf)
    return np.array(allowed)


# --- how soon a run may diverge -------------------------------------------------------------------------------------


def most_gained(method: Method, z: float, steps: int) -> list[float]:
    """The most that |v| may have grown by after each step: forces are at most 1, whatever the angle; inf if unknown.

    A step gains z times the sum of its |weights|; backward differences hand on earlier gains, structural methods their
    acceleration. It is unknown of Stoermer's, Chin's and Taylor's, whose velocities hold differences or derivatives.
    """
    weights: list[float] = []
    if isinstance(method, RungeKutta | Nystrom):
        weights = [float(part) for part in method.b]
    elif isinstance(method, Splitting):
        weights = [float(part) for kind, part in method.flows if kind not in (DRIFT, DRAG)]
    elif isinstance(method, Adams):
        weights = [float(part) for part in (method.corrector or method.b)]
    elif isinstance(method, DiscreteGradient):
        weights = [1.0]
    gains = [z * sum(map(abs, weights)) if weights else math.inf] * steps
    if isinstance(method, BackwardDifference):
        gains = [z * sum(abs(float(part)) for part in method.starter.b)] * method.past
        while len(gains) < steps:
            handed = sum(abs(float(part)) * gains[-1 - j] for j, part in enumerate(method.gains))
            gains.append(handed + z * float(method.share))
    if isinstance(method, GeneralizedAlpha):
        mean, gamma, rate, gains = float(method.alpha_m), float(method.gamma), 1.0, []
        for _ in range(steps):
            new = (1.0 + abs(mean) * rate) / (1.0 - mean)
            gains.append(z * (abs(1.0 - gamma) * rate + abs(gamma) * new))
            rate = new
    return [0.0, *accumulate(gains[:steps])]


def too_soon(method: Method, angle: float, velocity: float, z: float, count: int) -> str:
    """Why a run may not have left all sense by the step after ``count``; "" if it may.

    Its energy, in units of m g L, has to differ from that of its start by ABSURD times (1 + that).
    """
    start = 0.5 * velocity * velocity + 1.0 - math.cos(angle)
    needed = math.sqrt(2.0 * max(ABSURD * (1.0 + start) + start - 2.0, 0.0))
    if count > 100_000:
        return ""
    fastest = abs(velocity) + most_gained(method, z, count + 1)[-1]
    return f"it stopped after {count} steps, in which no forces make it leave all sense" if fastest < needed else ""
