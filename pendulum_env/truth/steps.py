"""Step oracles: independent computation of the steps that a method's table of coefficients implies.

They also give the errors that the method's order and rounding allow.

An oracle reads a method's table and properties and computes the steps with its own arithmetic. It never calls the step
of a family, nor reads the generated source. One class is registered for each kind of method; user-defined kinds
register their own::

    @table.register(MyMethod)
    class MyMethodOracle(StepOracle): ...

The problem is ``q'' = -pull sin(q) - drag v|v|**(power - 1)``. Under long steps, no theorem bounds the pendulum for
A-stable methods: B-stability holds for contractive forces, and conservative forces are not contractive. Only the
discrete gradient (Gonzalez 1996) and the exact flow conserve energy at any step. A bound such as "never faster than at
its start" would accept a run that ignores drag; so a run that did not diverge must agree with the oracle.

With drag times step = load, an L-stable method loses most of a velocity x at any load: ``x1 ~ sqrt(x/load)`` under
quadratic drag. Other A-stable methods have ``x1/x = 1 - O(1/load)`` under linear and ``1 - O(1/sqrt(load x))`` under
quadratic drag: at load 1e6 of linear drag, 100 steps of midpoint lose 4e-4 of the velocity, gauss4 loses 1.2e-3.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, singledispatch
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ellipk

from integrators import Method, RungeKutta, Splitting
from integrators.families.adams import Adams
from integrators.families.backward_differences import BackwardDifference
from integrators.families.energy_preserving import DiscreteGradient
from integrators.families.exact_flow import Exact
from integrators.families.force_gradient import ForceGradient
from integrators.families.multistep import Multistep
from integrators.families.nystrom import Nystrom
from integrators.families.second_order import SecondOrder
from integrators.families.splitting import DRAG, DRIFT, KICK, PUSH
from integrators.families.structural import GeneralizedAlpha, MeanForceAlpha
from integrators.families.taylor import Taylor
from pendulum_env.physics import exact
from pendulum_env.physics.energy import ABSURD
from pendulum_env.truth.answer import Truth

Floats = NDArray[np.float64]
State = tuple[float, float]
FIRST = 4
"""Number of steps at the start of a run under full gravity that are compared one by one."""
SAYS = 0.3
"""Largest error [rad] for which the error bound from a method's order is meaningful."""
SAME = 1e-6
"""Tolerance, relative to the initial velocity, with which a run under drag must agree with the oracle."""


@dataclass(frozen=True)
class Equation:
    """Test equation ``q'' = -pull sin(q) - drag v|v|**(power - 1)`` of a pendulum, in any unit of time.

    If ``small`` is True, sin(q) is replaced by q.
    """

    pull: float = 1.0
    drag: float = 0.0
    power: int = 1
    small: bool = False

    def force(self, q: Any) -> Any:
        """Return the acceleration of the test equation by gravity at the angle q."""
        return -self.pull * (q if self.small else np.sin(q))

    def gradient(self, q: Any) -> Any:
        """Return the derivative of the gravitational acceleration by the angle q."""
        return -self.pull * (np.ones_like(q) if self.small else np.cos(q))

    def acceleration(self, q: Any, v: Any) -> Any:
        """Return the acceleration of the test equation by gravity and drag."""
        return self.force(q) - self.drag * v * np.abs(v) ** (self.power - 1)

    def slowing(self, v: Any) -> Any:
        """Return the derivative of the acceleration by the velocity, which is due to drag."""
        return -self.drag * self.power * np.abs(v) ** (self.power - 1)

    def slowed(self, v: float, time: float) -> float:
        """Return the velocity after a time under drag alone, exactly; inf if it diverges (negative times)."""
        if self.power == 1:
            return v * math.exp(min(-self.drag * time, 700.0))
        divisor = 1.0 + self.drag * abs(v) * time
        return v / divisor if divisor > 0.0 else math.inf


# --- equations ------------------------------------------------------------------------------------------------------


def _solved(problem: Equation, q: Any, of_q: Any, v: Any, of_v: Any) -> Floats:
    """Solve the equation ``W = v + of_v a(q + of_q W, W)`` for the stage velocities W of an implicit step.

    Newton's method is used, with steps halved where they overshoot. The solution is unique for the implicit tables here
    under drag, which only takes energy (Hairer & Wanner 1996, IV.14), and in short steps under gravity. Under strong
    quadratic drag Newton's method starts at the limit for large drag.
    """
    of_q, of_v = np.atleast_2d(of_q), np.atleast_2d(of_v)
    start = np.ones(len(of_v)) * v
    w: Floats = start.copy()
    if problem.power == 2 and np.max(np.abs(of_v)) * problem.drag * np.max(np.abs(w)) > 1.0 and (
            abs(np.linalg.det(of_v / np.max(np.abs(of_v)))) > 1e-9):
        size = np.linalg.solve(of_v, w) / problem.drag
        w = np.sign(size) * np.sqrt(np.abs(size))

    def residual(w: Floats) -> Floats:
        return np.asarray(w - of_v @ problem.acceleration(q + of_q @ w, w) - start, dtype=float)

    for _ in range(200):
        now = residual(w)
        if np.max(np.abs(now)) <= 1e-15 * np.max(np.abs(start)):
            break
        places = q + of_q @ w
        slope = np.eye(len(w)) - of_v @ (np.diag(problem.gradient(places)) @ of_q + np.diag(problem.slowing(w)))
        move, share = np.linalg.solve(slope, now), 1.0
        while share > 1e-6 and np.linalg.norm(residual(w - share * move)) > np.linalg.norm(now):
            share *= 0.5
        w = w - share * move
        if np.max(np.abs(move)) <= 1e-16 * np.max(np.abs(w)):
            break
    return w


def _floats(row: Sequence[Any]) -> Floats:
    """Return a row of coefficients as an array of floats."""
    return np.array(row, dtype=float)


@lru_cache(maxsize=32)
def _over_mean(count: int) -> tuple[float, ...]:
    """Return weights c of the last ``count`` accelerations that give a step's final minus its mean velocity.

    They solve ``sum_j c_j j**m = 1/((m + 1) (m + 2))`` for all m below ``count``, in exact fractions.
    """
    rows = [[*(Fraction(j**m) for j in range(count)), Fraction(1, (m + 1) * (m + 2))] for m in range(count)]
    for i in range(count):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for k in set(range(count)) - {i}:
            rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i], strict=True)]
    return tuple(float(row[-1]) for row in rows)


# --- kinds of methods -----------------------------------------------------------------------------------------------


class StepOracle:
    """Step oracle of a method: computes the steps that its table implies, without the method's own code.

    This base class serves kinds of methods for which no class is registered; it does not know their steps.

    Attributes:
        rows: rows of coefficients whose sums form the stages.
        back: True if some sub-steps run backwards.
        early: the method that takes the first steps: a BDF method's starting method, else the method.
    """

    back = False

    def __init__(self, method: Any) -> None:
        self.method = method
        self.rows: Sequence[Sequence[Fraction]] = ()
        self.early: Method = method

    def follow(self, problem: Equation, q: float, v: float, h: float, steps: int) -> list[State] | None:
        """Return the states (q, v) after 0, 1, ... steps; None if the step oracle does not know them."""
        return None

    def gains(self, z: float, steps: int) -> list[float]:
        """Return an upper bound, for each of ``steps`` steps, of what it adds to |v| if the force is at most 1.

        ``z`` is the step times omega0. A bound is inf where none is known.
        """
        return [math.inf] * steps

    def constant(self, power: int) -> float:
        """Return the constant C in the error ``C (rate h)**power`` of one step; by default that of a Taylor series."""
        return 1.0 / math.factorial(power)


@singledispatch
def table(method: Method) -> StepOracle:
    """Return the step oracle (independent computation of the steps) of a method, by the class of the method."""
    return StepOracle(method)


class OneStepOracle(StepOracle):
    """Step oracle (independent computation of the steps) of a one-step method."""

    def step(self, problem: Equation, q: float, v: float, h: float) -> State:
        """Return the state (q, v) after one step of length h that the method's table implies."""
        raise NotImplementedError

    def follow(self, problem: Equation, q: float, v: float, h: float, steps: int) -> list[State] | None:
        states = [(q, v)]
        for _ in range(steps):
            states.append(self.step(problem, *states[-1], h))
        return states


@table.register(RungeKutta)
class RungeKuttaOracle(OneStepOracle):
    """Step oracle (independent computation of the steps) of Runge-Kutta methods.

    The stages ``W = v + h A K``, ``Q = q + h A W``, ``K = a(Q, W)`` are computed in turn, or together if implicit.
    """

    def __init__(self, method: RungeKutta) -> None:
        super().__init__(method)
        self.a, self.b = _floats(method.a), _floats(method.b)
        self.rows = (method.b, *(method.a[i] for i in method.stages))

    def step(self, problem: Equation, q: float, v: float, h: float) -> State:
        w = v * np.ones(len(self.b))
        if self.method.implicit:
            w = _solved(problem, q, h * self.a, v, h * self.a)
            k = problem.acceleration(q + h * (self.a @ w), w)
        else:
            k = np.zeros(len(self.b))
            for i, row in enumerate(self.a):
                w[i] = v + h * (row[:i] @ k[:i])
                k[i] = problem.acceleration(q + h * (row[:i] @ w[:i]), w[i])
        return float(q + h * (self.b @ w)), float(v + h * (self.b @ k))

    def gains(self, z: float, steps: int) -> list[float]:
        return [z * float(np.sum(np.abs(self.b)))] * steps


@table.register(Nystrom)
class NystromOracle(OneStepOracle):
    """Step oracle of Nyström methods: ``K_i = a(q + c_i h v + h**2 sum_j a_ij K_j, v + h sum_j av_ij K_j)``."""

    def step(self, problem: Equation, q: float, v: float, h: float) -> State:
        method, k = self.method, np.zeros(len(self.method.b))
        a, av = _floats(method.a), _floats(method.av)
        for i, c in enumerate(_floats(method.c)):
            k[i] = problem.acceleration(q + c * h * v + h * h * (a[i, :i] @ k[:i]), v + h * (av[i, :i] @ k[:i]))
        return float(q + h * v + h * h * (_floats(method.bbar) @ k)), float(v + h * (_floats(method.b) @ k))

    def gains(self, z: float, steps: int) -> list[float]:
        return [z * float(sum(map(abs, self.method.b)))] * steps


@table.register(Splitting)
class SplittingOracle(OneStepOracle):
    """Step oracle (independent computation of the steps) of splittings.

    Sub-flows act one after another, with drag in closed form.
    """

    def __init__(self, method: Splitting) -> None:
        super().__init__(method)
        self.rows = tuple(tuple(part for kind, part in method.flows if kind == one) for one in (KICK, DRIFT))
        self.back = any(part < 0 for _, part in method.flows)

    def step(self, problem: Equation, q: float, v: float, h: float) -> State:
        for kind, part in self.method.flows:
            share = float(part) * h
            if kind == DRIFT:
                q += share * v
            elif kind == DRAG:
                v = problem.slowed(v, share) if problem.drag else v
            else:
                v += share * float(problem.force(q) if kind == KICK else problem.acceleration(q, v))
        return q, v

    def gains(self, z: float, steps: int) -> list[float]:
        return [z * float(sum(abs(part) for kind, part in self.method.flows if kind in (KICK, PUSH)))] * steps

    def constant(self, power: int) -> float:
        """Return the error constant C of a composition of sub-steps, for errors ``C (rate h)**power``.

        Errors of sub-steps c h add up in proportion to |c|**power.
        """
        return max(1.0, *(sum(abs(float(part)) ** power for part in row) for row in self.rows)) / math.factorial(power)


@table.register(ForceGradient)
class ForceGradientOracle(OneStepOracle):
    """Step oracle (independent computation of the steps) of force-gradient methods.

    Their steps are drifts, and kicks by ``f + c h**2 f f'``.
    """

    def step(self, problem: Equation, q: float, v: float, h: float) -> State:
        for kind, part, c in self.method.flows:
            if kind == DRIFT:
                q += float(part) * h * v
            else:
                v += float(part) * h * float(problem.force(q) * (1.0 + float(c) * h * h * problem.gradient(q)))
        return q, v


@table.register(Taylor)
class TaylorOracle(OneStepOracle):
    """Step oracle (independent computation of the steps) of Taylor series methods.

    Sine s and cosine c obey the recurrences ``k s_k = sum_j j q_j c_(k-j)`` and ``k c_k = -sum_j j q_j s_(k-j)``.
    """

    def step(self, problem: Equation, q: float, v: float, h: float) -> State:
        places, speeds, sines, cosines = [q], [v], [math.sin(q)], [math.cos(q)]
        side = math.copysign(1.0, v)
        for k in range(self.method.order):
            square = sum(x * y for x, y in zip(speeds, speeds[::-1], strict=True))
            drag = problem.drag * (speeds[k] if problem.power == 1 else side * square)
            speeds.append(-(problem.pull * (places if problem.small else sines)[k] + drag) / (k + 1))
            places.append(speeds[k] / (k + 1))
            slopes = [j * places[j] for j in range(1, k + 2)]
            rise = sum(x * y for x, y in zip(slopes, cosines[::-1], strict=True)) / (k + 1)
            fall = sum(x * y for x, y in zip(slopes, sines[::-1], strict=True)) / (k + 1)
            sines.append(rise)
            cosines.append(-fall)
        powers = h ** np.arange(self.method.order + 1.0)
        return float(powers @ places), float(powers @ speeds)


@table.register(Exact)
class ExactOracle(OneStepOracle):
    """Step oracle of the method "exact": every state is computed from the start by the closed form."""

    def follow(self, problem: Equation, q: float, v: float, h: float, steps: int) -> list[State] | None:
        times, rate = h * np.arange(steps + 1.0), math.sqrt(problem.pull)
        if not problem.pull:
            linear, quadratic = (problem.drag, 0.0) if problem.power == 1 else (0.0, problem.drag)
            way, speed = exact.drag_only(times, v, linear, quadratic)
            return list(zip(q + way, speed, strict=True))
        if problem.small and problem.power == 1:
            return list(zip(*exact.linear(times, q, v, rate, problem.drag), strict=True))
        return None if problem.drag else list(zip(*exact.pendulum(times, q, v, rate), strict=True))


@table.register(DiscreteGradient)
class DiscreteGradientOracle(OneStepOracle):
    """Step oracle of the discrete gradient method: ``w = v + (h/2) (F + N(w))`` for the mean velocity w.

    F is the mean force, minus the difference of the potential divided by the change ``h w`` of the angle; N is drag.
    """

    def step(self, problem: Equation, q: float, v: float, h: float) -> State:
        def residual(w: float) -> float:
            half = 0.5 * h * w
            mean = problem.force(q + half) * (1.0 if problem.small or not half else math.sin(half) / half)
            return float(w - v - 0.5 * h * (mean + problem.acceleration(0.0, w)))

        size = abs(v) + h * problem.pull + 1e-12
        while residual(size) < 0.0 or residual(-size) > 0.0:
            size *= 2.0
        w = brentq(residual, -size, size, xtol=1e-18, rtol=1e-14)  # the residual increases with w if h is short
        return q + h * w, 2.0 * w - v

    def gains(self, z: float, steps: int) -> list[float]:
        return [z] * steps


class MultistepOracle(StepOracle):
    """Step oracle (independent computation of the steps) of a multistep method.

    The error constant of such a method is at most 1/2 (Hairer, Norsett & Wanner 1993, III.2).
    """

    def constant(self, power: int) -> float:
        return 0.5

    def earlier(self, problem: Equation, q: float, v: float, h: float) -> list[State]:
        """Return the current state and the earlier states that the starting method computes backwards in time."""
        states = table(self.method.starter).follow(problem, q, v, -h, self.method.past)
        assert states is not None
        return states


table.register(Multistep)(MultistepOracle)


@table.register(Adams)
class AdamsOracle(MultistepOracle):
    """Step oracle of Adams methods: ``y1 = y + h sum_j b_j f_(n-j)``, then a corrector if there is one."""

    def follow(self, problem: Equation, q: float, v: float, h: float, steps: int) -> list[State] | None:
        def slope(state: Any) -> Floats:
            return np.array([state[1], problem.acceleration(state[0], state[1])])

        slopes = [slope(state) for state in self.earlier(problem, q, v, h)]
        states = [(q, v)]
        for _ in range(steps):
            new = np.array(states[-1]) + h * sum(float(b) * f for b, f in zip(self.method.b, slopes, strict=False))
            if self.method.corrector:
                row = zip(self.method.corrector, [slope(new), *slopes], strict=False)
                new = np.array(states[-1]) + h * sum(float(b) * f for b, f in row)
            states.append((float(new[0]), float(new[1])))
            slopes = [slope(new), *slopes[:-1]]
        return states

    def gains(self, z: float, steps: int) -> list[float]:
        return [z * float(sum(map(abs, self.method.corrector or self.method.b)))] * steps


@table.register(BackwardDifference)
class BackwardDifferenceOracle(MultistepOracle):
    """Step oracle of BDF methods: ``sum_j alpha_j y_(n+1-j) = h f_(n+1)``, after steps of the starting method."""

    def __init__(self, method: BackwardDifference) -> None:
        super().__init__(method)
        self.early = method.starter

    def follow(self, problem: Equation, q: float, v: float, h: float, steps: int) -> list[State] | None:
        alpha = _floats(self.method.alpha)
        states = table(self.method.starter).follow(problem, q, v, h, min(self.method.past, steps)) or []
        while len(states) <= steps:
            known = -(alpha[1:] @ np.array(states[: -len(alpha) : -1])) / alpha[0]
            share = h / alpha[0]
            w = float(_solved(problem, known[0], share, known[1], share)[0])
            states.append((float(known[0] + share * w), w))
        return states

    def gains(self, z: float, steps: int) -> list[float]:
        gains = table(self.method.starter).gains(z, self.method.past)
        while len(gains) < steps:
            handed = sum(abs(float(part)) * gains[-1 - j] for j, part in enumerate(self.method.gains))
            gains.append(handed + z * float(self.method.share))
        return gains[:steps]


@table.register(SecondOrder)
class SecondOrderOracle(MultistepOracle):
    """Step oracle of multistep methods for q'': ``sum_j alpha_j q_(n+1-j) = h**2 sum_j beta_j f_(n+1-j)``.

    The equation is summed once, which gives mean velocities u of the steps, and ``v = u + h sum_j c_j f_(n-j)``. The
    history of u comes from backward steps of the starting method, except the last value, which follows from v.
    """

    def __init__(self, method: SecondOrder) -> None:
        super().__init__(method)
        self.rows = (method.means,)

    def follow(self, problem: Equation, q: float, v: float, h: float, steps: int) -> list[State] | None:
        past = self.method.past
        before = [place for place, _ in self.earlier(problem, q, v, h)]
        forces = [float(problem.force(place)) for place in before]
        means = [(new - old) / h for new, old in pairwise(before)]
        beta = [*_floats(self.method.beta), *[0.0] * (past + 2)]
        sums = list(accumulate(_floats(self.method.alpha)))[1:-1]
        c = _floats(_over_mean(past + 1))
        states = [(q, v)]
        for _ in range(steps):
            q, v = states[-1]
            means[:1] = [v - h * float(c @ forces)]
            mean = -sum(x * u for x, u in zip(sums, means, strict=False))
            mean += h * sum(b * f for b, f in zip(beta[1:], forces, strict=False))
            place = q + h * mean
            if beta[0]:
                place = float(_solved(problem, 0.0, 1.0, place, beta[0] * h * h)[0])
                mean = (place - q) / h
            forces = [float(problem.force(place)), *forces[:-1]]
            means = [mean, *means[:-1]]
            states.append((place, mean + h * float(c @ forces)))
        return states


@table.register(GeneralizedAlpha)
class GeneralizedAlphaOracle(MultistepOracle):
    """Independent calculation of a generalized-alpha step: ``(1 - alpha_m) a1 + alpha_m a = f(Q, W)``.

    a and a1 are the method's accelerations before and after the step; Q and W are the weighted means of the angles and
    of the velocities at its ends (Chung & Hulbert 1993).

    The first acceleration a is that of the force at the start.
    """

    def follow(self, problem: Equation, q: float, v: float, h: float, steps: int) -> list[State] | None:
        method = self.method
        mean, place, beta, gamma = map(float, (method.alpha_m, method.alpha_f, method.beta, method.gamma))
        rate, states = float(problem.acceleration(q, v)), [(q, v)]
        for _ in range(steps):
            q, v = states[-1]
            # The new acceleration is (k - mean rate)/(1 - mean) with the force k, so Q and W are affine in k.
            by_q, by_v = ((1.0 - place) * size / (1.0 - mean) for size in (h * h * beta, h * gamma))
            at_q = q + (1.0 - place) * h * (v + h * (0.5 - beta) * rate) - by_q * mean * rate
            at_v = v + (1.0 - place) * h * (1.0 - gamma) * rate - by_v * mean * rate
            w = float(_solved(problem, at_q - by_q / by_v * at_v, by_q / by_v, at_v, by_v)[0])
            new = ((w - at_v) / by_v - mean * rate) / (1.0 - mean)
            states.append((q + h * v + h * h * ((0.5 - beta) * rate + beta * new),
                           v + h * ((1.0 - gamma) * rate + gamma * new)))
            rate = new
        return states

    def gains(self, z: float, steps: int) -> list[float]:
        mean, gamma, rate = float(self.method.alpha_m), float(self.method.gamma), 1.0
        gains = []
        for _ in range(steps):
            new = (1.0 + abs(mean) * rate) / (1.0 - mean)
            gains.append(z * (abs(1.0 - gamma) * rate + abs(gamma) * new))
            rate = new
        return gains


@table.register(MeanForceAlpha)
class MeanForceAlphaOracle(GeneralizedAlphaOracle):
    """Step oracle of generalized-alpha methods that average forces.

    ``(1 - alpha_m) a1 + alpha_m a = (1 - alpha_f) f1 + alpha_f f0``; the first acceleration a is that of the force at
    the start.
    """

    def follow(self, problem: Equation, q: float, v: float, h: float, steps: int) -> list[State] | None:
        method = self.method
        mean, part, beta, gamma = map(float, (method.alpha_m, method.alpha_f, method.beta, method.gamma))
        rate = force = float(problem.acceleration(q, v))
        states = [(q, v)]
        for _ in range(steps):
            q, v = states[-1]
            # The new acceleration is known + share k with the new force k, so the new state is affine in k.
            known, share = (part * force - mean * rate) / (1.0 - mean), (1.0 - part) / (1.0 - mean)
            at_q = q + h * v + h * h * ((0.5 - beta) * rate + beta * known)
            at_v = v + h * ((1.0 - gamma) * rate + gamma * known)
            by_q, by_v = h * h * beta * share, h * gamma * share
            w = float(_solved(problem, at_q - by_q / by_v * at_v, by_q / by_v, at_v, by_v)[0])
            force = (w - at_v) / by_v
            states.append((at_q + by_q * force, w))
            rate = known + share * force
        return states


# --- the steps ------------------------------------------------------------------------------------------------------


def own_steps(method: Method, problem: Equation, angle: float, velocity: float, h: float, steps: int) -> Truth | None:
    """Return the steps that a method's table implies, in the problem's unit of time; None if they are not known.

    They are not known for kinds of methods without a step oracle, and for implicit tables if ``pull h**2 >= 1``,
    because their equations may have several solutions (``pull h**2 |A A| < 1`` implies one solution).

    The error is that of rounding. Without drag, a rounding error of 1e-14 in each state grows by at most
    ``(1 + z)**2`` per evaluation with ``z = sqrt(pull) h``, and in short steps by ``e**(6 z)`` per step. The error is
    inf if this is too large for a comparison. Under drag, the error is SAME times the velocities at the start and at
    each time.
    """
    z = math.sqrt(problem.pull) * h
    if method.implicit and z >= 1.0 and not problem.small:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        states = table(method).follow(problem, angle, velocity, h, steps)
    if states is None:
        return None
    q, v = np.array(states).T
    count = np.arange(steps + 1.0)
    with np.errstate(invalid="ignore"):
        if problem.drag:
            error = SAME * (abs(velocity) + np.abs(v))
        else:
            largest = np.maximum.accumulate(1.0 + np.maximum(np.abs(q), np.abs(v)))
            initial = z * method.past + math.log(rounding_factor(method))
            logs = initial + np.minimum(6.0 * z * count, 2.0 * math.log1p(z) * method.evaluations * count)
            size = np.exp(np.minimum(logs, 600.0)) * 1e-14 * largest
            error = np.where(size < 1e-3 * largest, size + 1e-12 * largest, math.inf)
    return Truth(h * count, q, v, error, f"steps computed from the table of {method.name}, independently of its code")


def table_mismatch(method: Method, problem: Equation, angle: Floats, velocity: Floats) -> str:
    """Return the reason why a run under drag, in steps of 1, disagrees with its method's table; "" if it agrees.

    "" is also returned if the oracle does not know the motion. If backward sub-steps under quadratic drag diverge, only
    a bound is checked: the velocity is at most ``1/(1 + n load)`` of the initial one, plus what one kick may add.
    """
    fast, count = float(velocity[0]), np.arange(float(len(velocity)))
    own = own_steps(method, problem, float(angle[0]), fast, 1.0, len(velocity) - 1)
    if own is None:
        return ""
    if table(method).back and not np.all(np.isfinite(own.velocity)):
        most = 0.1 + 1.0 / (1.0 + problem.drag * abs(fast) * count)
        most = most * abs(fast) + speed_bounds(method, problem.pull, 1)[-1]
        return "drag has reduced the velocity too little" if np.any((np.abs(velocity) > most)[1:]) else ""
    missed = own.missed(angle, velocity)
    return f"it differs from the method's table by {missed / fast:.3g} of the initial velocity" if missed else ""


# --- what order and rounding leave ----------------------------------------------------------------------------------


def order_bound(method: Method, product: float, phase: float) -> float:
    """Return the relative error that a method's order allows after ``phase`` [rad] in steps of ``product`` [rad].

    It is ``product**order * phase``, because error constants are below 1, and at most 0.1; beyond that no run counts as
    accurate.
    """
    return float(min(product**method.order * phase, 0.1))


def retraces(method: Method) -> bool:
    """Return True if a method retraces its steps: a step of -h undoes a step of h.

    It is False for symmetric multistep methods, which compute a new history after a reversal.
    """
    return method.symmetric and len(method.memory) <= 1


def rounding_factor(method: Method) -> float:
    """Return the factor by which a method's step amplifies rounding: the largest sum of |coefficients| in a stage."""
    return float(max([Fraction(1), *(sum(map(abs, row), Fraction(0)) for row in table(method).rows)]))


def error_constant(method: Method) -> float:
    """Return the constant C in a bound ``C (rate h)**(p + 1)`` of a step's error, at most 1/2.

    One-step methods have the constant 1/(p + 1)! of a Taylor series, compositions more, multistep methods at most 1/2
    (Hairer, Norsett & Wanner 1993, II.3 and III.2; Hairer, Lubich & Wanner 2006, II.4).
    """
    power = method.order + 1
    return 0.5 if math.isinf(power) else min(0.5, table(method).constant(power))


def order_error(method: Method, angle: float, z: float, steps: int) -> Floats:
    """Return a bound of the angle error [rad] after each of the first steps of a release from rest near the top.

    ``z`` is omega0 h. The error of a step is ``C z**(p + 1)`` times the distance to the top; this distance and earlier
    errors grow as e**(z n). The nonlinear part is added: the Taylor coefficients of the angle decay as ``(4/n) d**-n``,
    where d is the distance to the logarithmic singularity of the angle, iK' above the bottom (Whittaker & Watson 1927,
    22), and a step has the error C (p + 1)! times the coefficient p + 1. The bound is twice the sum.

    The first steps of BDF methods are those of their starting method. The bound is inf for other multistep methods,
    whose nonlinear errors are (p + 1)! times as large, for methods with backward sub-steps, and for constants C >= 1/2.
    """
    early = table(method).early
    constant = error_constant(early)
    if table(early).back or constant >= 0.5:
        return np.full(steps + 1, math.inf)
    power = early.order + 1
    m = math.sin(0.5 * angle) ** 2
    allowed, total = [0.0], 0.0
    for n in range(1, steps + 1):
        d = math.hypot(max(ellipk(m) - n * z, 0.0), ellipk(1.0 - m))
        smooth = constant * z**power * (math.pi - angle) * math.exp(n * z)
        rough = constant * math.factorial(power) * 4.0 / power * (z / d) ** power
        total = total * math.exp(z) + smooth + rough
        is_first = early is method or n <= method.past
        allowed.append(2.0 * total if is_first else math.inf)
    return np.array(allowed)


# --- how soon a run may diverge -------------------------------------------------------------------------------------


def speed_bounds(method: Method, z: float, steps: int) -> list[float]:
    """Return upper bounds of |v| minus its initial value after each step, for forces of at most 1 at any angle.

    A step of length ``z`` adds at most z times the sum of its |weights|; BDF methods also pass on increments of earlier
    steps, structural methods their acceleration. The bounds are inf (unknown) for Stoermer, force-gradient and Taylor
    methods, whose velocities contain differences or derivatives.
    """
    return [0.0, *accumulate(table(method).gains(z, steps))]


def too_early(method: Method, angle: float, velocity: float, z: float, count: int) -> str:
    """Return the reason why a run cannot have diverged within its first ``count`` steps; "" if it can.

    A run diverges when its energy, in units of m g L, differs from the initial energy E by ABSURD times (1 + E).
    """
    start = 0.5 * velocity * velocity + 1.0 - math.cos(angle)
    needed = math.sqrt(2.0 * max(ABSURD * (1.0 + start) + start - 2.0, 0.0))
    if count > 100_000:
        return ""
    fastest = abs(velocity) + speed_bounds(method, z, count + 1)[-1]
    return f"it stopped after {count} steps, too few to gain enough energy to diverge" if fastest < needed else ""
