"""How fast each method's own equation makes drag slow it: from its table, solved here, not by the step that is tried.

In units of the velocity at the start and of the step drag alone is ``x' = -load x|x|**(power - 1)``. Without drag x
stays 1, which "never faster than at its start" allows; so a run that did not diverge must also follow these numbers.
An L-stable method has lost most of x at any load, ``x1 ~ sqrt(x/load)`` of quadratic drag. Of others ``|R(-z)|``, or
``x1/x``, is 1 - O(1/load), under quadratic drag 1 - O(1/sqrt(load x)): midpoint's loss in 100 steps at 1e6 is 4e-4 of
linear drag, gauss4's 1.2e-3. That is little, but known, and far above what gravity adds.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from integrators import Method, RungeKutta, Splitting
from integrators.families.backward_differences import BackwardDifference
from integrators.families.energy_preserving import DiscreteGradient
from integrators.families.nystrom import Nystrom
from integrators.families.splitting import DRAG, DRIFT, KICK, PUSH
from integrators.families.structural import GeneralizedAlpha
from integrators.families.taylor import Taylor

Floats = NDArray[np.float64]
SAME = 1e-6
"""Part of the start's velocity within which a run is its own equation's."""


def _stages(a: Floats, x: float, load: float, power: int) -> Floats:
    """W of ``W + load A W|W|**(power - 1) = x``: Newton's method, halved where it overshoots.

    Unique for the implicit tables here under drag, which never gains (Hairer & Wanner 1996, IV.14); Newton begins at
    its limit of large loads.
    """
    ones = np.ones(len(a))
    w = x * ones
    if power == 2 and load * abs(x) > 1.0 and abs(np.linalg.det(a)) > 1e-9:
        size = np.linalg.solve(a, w) / load
        w = np.sign(size) * np.sqrt(np.abs(size))

    def left(w: Floats) -> Floats:
        return np.asarray(w + load * (a @ (w * np.abs(w) ** (power - 1))) - x)

    for _ in range(200):
        now = left(w)
        if np.max(np.abs(now)) <= 1e-14 * abs(x):
            break
        move = np.linalg.solve(np.eye(len(a)) + load * a * (power * np.abs(w) ** (power - 1)), now)
        share = 1.0
        while share > 1e-6 and np.linalg.norm(left(w - share * move)) > np.linalg.norm(now):
            share *= 0.5
        w = w - share * move
    return w


def _of_table(method: RungeKutta | Nystrom, x: float, load: float, power: int) -> float:
    a = np.array(method.a if isinstance(method, RungeKutta) else method.av, dtype=float)
    b = np.array(method.b, dtype=float)
    w = _stages(a, x, load, power)
    return float(x - load * (b @ (w * np.abs(w) ** (power - 1))))


def _rising(g: Callable[[float], float], size: float) -> float:
    """The zero of a function that rises, by Brent's method."""
    while g(size) < 0.0 or g(-size) > 0.0:
        size *= 2.0
    return float(brentq(g, -size, size, xtol=1e-18, rtol=1e-14))


def _backward(method: BackwardDifference, load: float, power: int, steps: int) -> list[float]:
    """``sum_j alpha_j x_(n+1-j) = -load x|x|**(power - 1)`` at the new x, after the starter's steps."""
    alpha, starter, x = [float(part) for part in method.alpha], method.starter, [1.0]
    assert isinstance(starter, RungeKutta)
    while len(x) <= min(method.past, steps):
        x.append(_of_table(starter, x[-1], load, power))
    while len(x) <= steps:
        known = sum(part * x[-j] for j, part in enumerate(alpha) if j)
        x.append(_rising(lambda y, known=known: alpha[0] * y + known  # type: ignore[misc]
                         + load * y * abs(y) ** (power - 1), abs(known) + 1e-12))
    return x


def _structural(method: GeneralizedAlpha, load: float, power: int, steps: int) -> list[float]:
    """Chung & Hulbert 1993, in velocities alone; the acceleration begins with the force's."""
    mean, place, gamma = float(method.alpha_m), float(method.alpha_f), float(method.gamma)
    x, rate = [1.0], -load
    for _ in range(steps):
        old = x[-1]

        def new(y: float, old: float = old, rate: float = rate) -> float:
            return (y - old - (1.0 - gamma) * rate) / gamma

        def g(y: float, old: float = old, rate: float = rate) -> float:
            between = (1.0 - place) * y + place * old
            return (1.0 - mean) * new(y) + mean * rate + load * between * abs(between) ** (power - 1)

        x.append(_rising(g, abs(old) + 1e-12))
        rate = new(x[-1])
    return x


def own_velocities(method: Method, load: float, power: int, steps: int) -> Floats | None:
    """x of each step under drag alone; None for methods whose equation is not written here.

    Those are explicit ones of many steps, which every load here lets diverge, Taylor's under quadratic drag, which does
    so, too, and splittings, whose flows are exact; :func:`own_oscillator` has them.
    """
    table = method.linear_twin if isinstance(method, DiscreteGradient) else method
    if isinstance(table, BackwardDifference):
        return np.array(_backward(table, load, power, steps))
    if isinstance(table, GeneralizedAlpha):
        return np.array(_structural(table, load, power, steps))
    if isinstance(table, Taylor) and power == 1:
        return sum((-load) ** k / math.factorial(k) for k in range(table.order + 1)) ** np.arange(steps + 1.0)
    if not isinstance(table, RungeKutta | Nystrom):
        return None
    x = [1.0]
    for _ in range(steps):
        x.append(_of_table(table, x[-1], load, power))
    return np.array(x)


def own_oscillator(method: Splitting, product: float, load: float, start: Any, steps: int) -> Floats:
    """(angle, velocity times the step) of each step of a splitting on the damped oscillator: its flows, multiplied."""
    whole = np.eye(2)
    for kind, part in method.flows:
        share = float(part)
        kick = -share * product * product
        flow = {
            KICK: ((1.0, 0.0), (kick, 1.0)),
            DRIFT: ((1.0, share), (0.0, 1.0)),
            DRAG: ((1.0, 0.0), (0.0, math.exp(min(-load * share, 700.0)))),
            PUSH: ((1.0, 0.0), (kick, 1.0 - share * load)),
        }[kind]
        whole = np.array(flow) @ whole
    states = [np.array(start, dtype=float)]
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(steps):
            states.append(whole @ states[-1])
    return np.array(states)


def unlike_own(velocity: Floats, method: Method, load: float, power: int, gravity: float) -> str:
    """Why these velocities, in units of the first, are not the method's own under drag; "" if they are.

    ``gravity``: what it changes in a step, at most; steps that never gain hand it on no larger (B-stability, Hairer &
    Wanner 1996, IV.12), but for the sizes of the weights, for which a factor of 4 is left.
    """
    own = own_velocities(method, load, power, len(velocity) - 1)
    if own is None:
        return ""
    allowed = SAME + 4.0 * gravity * np.arange(len(own))
    apart = np.abs(velocity - own) - allowed
    worst = int(np.argmax(apart))
    return "" if apart[worst] <= 0.0 else (
        f"after {worst} steps it has {velocity[worst]:.6g} of its velocity, by its own equation {own[worst]:.6g}")


def unlike_oscillator(method: Method, velocity: Floats, omega0: float, load: float, step: float, angle: float) -> str:
    """The same of the oscillator under linear drag, from ``angle`` [rad] and the first of the velocities [rad/s].

    The way under drag is ``(v0 - v)/gamma`` by any method, so that gravity pulls by ``omega0² (angle + 2 v0/gamma)``.
    """
    fast = float(velocity[0])
    if isinstance(method, Splitting):
        own = own_oscillator(method, omega0 * step, load, (angle, fast * step), len(velocity) - 1)[:, 1] / step
        apart = np.abs(velocity - own) > SAME * (fast + np.abs(own))
        return "its velocity is not that of its flows, multiplied" if np.any(apart) else ""
    pull = omega0 * omega0 * step * (angle + 2.0 * fast * step / load)
    return unlike_own(velocity / fast, method, load, 1, pull / fast)


def unlike_falling(method: Method, velocity: Floats, load: float, pull: float, back: float) -> str:
    """The same under quadratic drag and gravity, worth ``pull`` in a step; velocities in units of the first.

    An exact flow of drag leaves ``1/(1 + n load)``, and of each kick no more than it was worth. Where its time runs
    back it amplifies, without a limit worth a number; it ends forwards, so that no more than ``back``, if any, is left.
    """
    if not isinstance(method, Splitting):
        return unlike_own(velocity, method, load, 2, pull)
    kicks = sum(abs(float(part)) for kind, part in method.flows if kind == KICK)
    left = back + 1.0 / (1.0 + load * np.arange(len(velocity))) + kicks * pull
    return "drag has left too much of its velocity" if np.any((np.abs(velocity) > left)[1:]) else ""
