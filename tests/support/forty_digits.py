"""Predicted errors of hard cases: each method's steps in 40-digit arithmetic, written from the formulas of the books.

``python tests/support/forty_digits.py`` computes two files of ``pendulum_env/hard_cases``: ``true_motions.json`` with
the exact motion of each case, and ``predictions.json`` with the number of steps of each method in it, and the error
that exact arithmetic leaves. With names of cases as arguments only these are computed anew. Nothing here calls a step
of the package: the coefficients come from its tables, which other tests compare with the published ones; forces,
stages, starting values and the exact motion are computed here. gmpy2, if installed, makes it several times faster.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, lru_cache
from itertools import accumulate, pairwise, product
from operator import mul
from pathlib import Path
from typing import Any

import numpy as np
from hard_truths import AREA, DRAGS, airs, fallen
from readme_code import ROOT

import integrators
from integrators.method import NEEDS
from pendulum_env.engine.machine import offers
from pendulum_env.engine.starts import ENOUGH
from pendulum_env.hard_cases import chaos, fast_drive, resonance, switching
from pendulum_env.hard_cases.chaos import DOUBLINGS
from pendulum_env.hard_cases.extremes import PUSHES
from pendulum_env.hard_cases.predicted import FILE, TRUTHS, Motion
from pendulum_env.hard_cases.run import MOTIONS

try:  # ten times as fast
    import gmpy2 as numbers_of
    from gmpy2 import mpfr as mpf

    numbers_of.get_context().precision = 136
except ImportError:
    import mpmath as numbers_of
    from mpmath import mpf

    numbers_of.mp.dps = 40
DIGITS = mpf(10) ** -36
TERMS, PIECE = 36, 0.1
"""Terms of the Taylor series of the exact motion, and length of its steps times the rate of the motion."""
SLOWED = 12
"""Terms of the Taylor series of drag in wind, whose errors may be 1e-24."""
FAR = 1e15
"""Angle beyond which a run has diverged [rad]; the sine of much larger ones takes minutes."""
NODES = 12
"""Nodes of the quadrature that gives the mean force between two angles."""
MORE = 2.0
"""Ratio of successive numbers of steps that are tried, at least."""
State = tuple[Any, Any]


def dot(row: Sequence[Any], other: Sequence[Any]) -> Any:
    """Return the sum of products; 0 for empty rows."""
    return sum(map(mul, row, other))


def polynomial(row: Sequence[Any], x: Any) -> Any:
    """Return the value at x of a polynomial, given by its coefficients, the constant first."""
    value = row[-1]
    for one in row[-2::-1]:
        value = value * x + one
    return value


def zero(row: Sequence[Any], h: Any) -> Any:
    """Return the last zero before h of a polynomial with one change of sign after 0, by bisection."""
    low, high = h * mpf(10) ** -20, h
    side = polynomial(row, high) > 0
    for _ in range(140):
        middle = (low + high) / 2
        low, high = (low, middle) if (polynomial(row, middle) > 0) == side else (middle, high)
    return high


# --- power series ----------------------------------------------------------------------------------------------------


class Series(list[Any]):
    """Coefficients of a power series, the constant first, with the arithmetic that equations of motion contain."""

    def __add__(self, other: Any) -> Series:
        if isinstance(other, Series):
            return Series(x + y for x, y in zip(self, other, strict=True))
        return Series([self[0] + other, *self[1:]])

    def __mul__(self, other: Any) -> Series:  # type: ignore[override]
        if not isinstance(other, Series):
            return Series(other * x for x in self)
        return Series(dot(self[: k + 1], other[k::-1]) for k in range(len(self)))

    def __neg__(self) -> Series:
        return Series(-x for x in self)

    def __sub__(self, other: Any) -> Series:
        return self + -other

    def __rsub__(self, other: Any) -> Series:
        return -self + other

    def __abs__(self) -> Series:
        """Return the absolute value just after the series' start."""
        return self if next((x for x in self if x), 0) >= 0 else -self

    __radd__, __rmul__ = __add__, __mul__  # type: ignore[assignment]

    def turned(self) -> tuple[Series, Series]:
        """Return sine and cosine, by ``k s_k = sum_j j x_j c_(k-j)`` and ``k c_k = -sum_j j x_j s_(k-j)``."""
        sines, cosines = Series([numbers_of.sin(self[0])]), Series([numbers_of.cos(self[0])])
        for k in range(1, len(self)):
            slopes = [j * self[j] for j in range(1, k + 1)]
            rise, fall = (dot(slopes, row[::-1]) / k for row in (cosines, sines))
            sines.append(rise)
            cosines.append(-fall)
        return sines, cosines


def sin(x: Any) -> Any:
    """Return the sine of a float, of a number of 40 digits or of a series; raises ArithmeticError beyond FAR."""
    if isinstance(x, Series):
        return x.turned()[0]
    if not abs(x) < FAR:
        raise ArithmeticError("The angle is too large for its sine to mean anything.")
    return math.sin(x) if isinstance(x, float) else numbers_of.sin(x)


def root(x: Any) -> Any:
    """Return the square root of a float, of a number of 40 digits or of a series."""
    if not isinstance(x, Series):
        return math.sqrt(x) if isinstance(x, float) else numbers_of.sqrt(x)
    y = Series([numbers_of.sqrt(x[0])])
    for k in range(1, len(x)):
        y.append((x[k] - dot(y[1:], y[:0:-1])) / (2 * y[0]))
    return y


def cos(x: Any) -> Any:
    """Return the cosine of a float, of a number of 40 digits or of a series."""
    return x.turned()[1] if isinstance(x, Series) else math.cos(x) if isinstance(x, float) else numbers_of.cos(x)


# --- problems --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Problem:
    """Equation of motion ``q'' = force(t, q) - linear v - quadratic |v| v``, of angular frequency ``rate``.

    ``dry`` is the limit of dry friction, which acts against the velocity, and holds the bob while other forces are
    within it. ``wind`` is a further force that depends on angle and velocity. ``closed`` is True if the motion has a
    closed form: a strongly damped oscillator, or quadratic drag alone.
    """

    force: Callable[[Any, Any], Any]
    linear: float = 0.0
    quadratic: float = 0.0
    rate: float = 1.0
    dry: float = 0.0
    wind: Callable[[Any, Any], Any] | None = None
    closed: bool = False

    def towards(self, side: int) -> Problem:
        """Return the smooth problem of a bob that slides to one side."""
        limit = side * mpf(self.dry)
        return replace(self, force=lambda t, q: self.force(t, q) - limit, dry=0.0)

    def let_go(self, t: Any, q: Any, end: Any) -> Any:
        """Return the time at which dry friction lets go of a bob at rest, by bisection; ``end`` if it holds it there.

        Torques that exceed the limit only between two times a hundredth of the motion's radian apart are overlooked.
        """
        while t < end:
            later = min(end, t + mpf(0.01) / self.rate)
            if abs(self.force(later, q)) > self.dry:
                low, high = t, later
                for _ in range(140):
                    middle = (low + high) / 2
                    low, high = (low, middle) if abs(self.force(middle, q)) > self.dry else (middle, high)
                return high
            t = later
        return end

    def acceleration(self, t: Any, q: Any, v: Any) -> Any:
        """Return the acceleration at a time, an angle and a velocity."""
        a = self.force(t, q)
        if self.linear:
            a = a - mpf(self.linear) * v
        if self.wind is not None:
            a = a + self.wind(q, v)
        return a - mpf(self.quadratic) * (abs(v) * v) if self.quadratic else a

    def slowed(self, q: Any, v: Any, time: Any) -> Any:
        """Return the velocity after a time under drag alone, at a fixed angle.

        Without wind it solves Bernoulli's equation for both kinds together; with wind it comes from Taylor series.
        """
        if self.wind is not None:
            return self.blown(self.wind, q, v, time)
        if not self.linear:
            return v / (1 + self.quadratic * abs(v) * time)
        decay = numbers_of.exp(-self.linear * time)
        return v * decay / (1 + self.quadratic * abs(v) * (1 - decay) / self.linear)

    @staticmethod
    def blown(wind: Callable[[Any, Any], Any], q: Any, v: Any, time: Any) -> Any:
        """Return the velocity after a time under the force of the wind alone, at a fixed angle, by Taylor series."""
        left = time
        while left:
            speeds = Series([v])
            for k in range(SLOWED):
                speeds.append(wind(q, speeds)[k] / (k + 1))
            h = left
            while abs(speeds[SLOWED] * h**SLOWED) > mpf(10) ** -24:
                h = h / 2
            v, left = polynomial(speeds, h), left - h
        return v

    def series(self, t: Any, q: Any, v: Any, terms: int) -> tuple[Series, Series]:
        """Return the Taylor series of angle and velocity from a state: coefficients up to h**terms."""
        places, speeds = Series([q]), Series([v])
        for k in range(terms):
            time = Series([t, *([mpf(1)] + [mpf(0)] * k)[:k]])
            rate = self.acceleration(time, places, speeds)
            places.append(speeds[k] / (k + 1))
            speeds.append((rate[k] if isinstance(rate, Series) else rate) / (k + 1))
        return places, speeds

    def exact(self, t: Any, q: Any, v: Any, end: Any) -> State:
        """Return the state at the time ``end`` of the motion from a state, by Taylor series of many terms.

        With quadratic drag a series ends where the velocity is zero, as the force has a kink there, and with dry
        friction it starts with the direction in which the bob slides.
        """
        if self.closed:
            return self.decayed(q, v, end - t)
        while t < end:
            if self.dry:
                if v == 0:
                    t = self.let_go(t, q, end) if abs(self.force(t, q)) <= self.dry else t
                    if t >= end:
                        break
                side = 1 if (v or self.force(t, q)) > 0 else -1
                t, q, v = self.towards(side).until_rest(t, q, v, end)
                continue
            parts = max(1, math.ceil(float(end - t) * self.rate / PIECE))
            h = (end - t) / parts
            places, speeds = self.series(t, q, v, TERMS)
            while (self.wind or self.quadratic > 1.0) and abs(speeds[TERMS]) * h**TERMS > mpf(10) ** -30:
                parts, h = 2 * parts, h / 2
            after = polynomial(speeds, h)
            turn = zero(speeds, h) if self.quadratic and next((x for x in speeds if x), 0) * after < 0 else None
            if turn is not None:
                h, after = turn, mpf(0)
            q, v, t = polynomial(places, h), after, end if parts == 1 and turn is None else t + h
        return q, v

    def decayed(self, q: Any, v: Any, time: Any) -> State:
        """Return the state after a time of ``q'' = -q - linear v`` with linear > 2, or of quadratic drag alone."""
        if self.quadratic:
            divisor = 1 + mpf(self.quadratic) * v * time
            return q + numbers_of.log(divisor) / mpf(self.quadratic), v / divisor
        half = mpf(self.linear) / 2
        fast = -half - numbers_of.sqrt(half * half - 1)
        slow = 1 / fast
        b = (v - slow * q) / (fast - slow)
        parts = (q - b) * numbers_of.exp(slow * time), b * numbers_of.exp(fast * time)
        return sum(parts), slow * parts[0] + fast * parts[1]

    def until_rest(self, t: Any, q: Any, v: Any, end: Any) -> tuple[Any, Any, Any]:
        """Return time and state where the velocity next becomes zero, or at ``end``, by Taylor series."""
        while t < end:
            h = min(end - t, mpf(PIECE) / self.rate)
            places, speeds = self.series(t, q, v, TERMS)
            after = polynomial(speeds, h)
            turned = next((x for x in speeds if x), 0) * after < 0
            h = zero(speeds, h) if turned else h
            q, v, t = polynomial(places, h), mpf(0) if turned else after, t + h
            if turned:
                break
        return (end if end - t < DIGITS else t), q, v


# --- steps -----------------------------------------------------------------------------------------------------------


@cache
def _number(x: Fraction) -> Any:
    return mpf(x.numerator) / x.denominator


def numbers(row: Sequence[Any]) -> list[Any]:
    """Return a row of coefficients in 40 digits."""
    return [_number(Fraction(x)) for x in row]


def solved(p: Problem, times: Sequence[Any], q: Any, of_q: Sequence[Any], v: Any, of_v: Sequence[Any]) -> list[Any]:
    """Solve ``W = v + of_v a(t, q + of_q W)`` for the stage velocities W, by Newton's method."""
    count = len(times)
    rough, reach = (np.array([[float(x) for x in row] for row in rows]) for rows in (of_v, of_q))
    w = [mpf(v)] * count
    if p.quadratic * np.max(np.abs(rough)) * abs(float(v)) > 1.0 and abs(np.linalg.det(rough / np.max(rough))) > 1e-9:
        # Under strong drag the limit of large drag is a better start.
        w = [mpf(math.copysign(math.sqrt(abs(x)), x))
             for x in np.linalg.solve(rough, np.full(count, float(v))) / p.quadratic]

    def residual(w: Sequence[Any]) -> tuple[list[Any], list[Any]]:
        places = [q + dot(row, w) for row in of_q]
        k = [p.acceleration(*state) for state in zip(times, places, w, strict=True)]
        return places, [x - v - dot(row, k) for x, row in zip(w, of_v, strict=True)]

    places, off = residual(w)
    for _ in range(200):
        size = max(map(abs, off))
        if size <= DIGITS * (1 + abs(v)):
            return w
        slopes = np.array([_slopes(p, *map(float, state)) for state in zip(times, places, w, strict=True)])
        matrix = np.eye(count) - rough @ (np.diag(slopes[:, 0]) @ reach + np.diag(slopes[:, 1]))
        move, share = np.linalg.solve(matrix, [float(x / size) for x in off]), 1.0
        while share > 1e-6:  # shorter where it overshoots
            tried = [x - size * mpf(share * dx) for x, dx in zip(w, move, strict=True)]
            places, off = residual(tried)
            if max(map(abs, off)) < size:
                break
            share /= 2.0
        w = tried
    raise ArithmeticError("Newton's method does not converge")


def _slopes(p: Problem, t: float, q: float, v: float) -> tuple[float, float]:
    """Return the derivatives of the acceleration by angle and velocity, to six digits."""
    d, dv = 1e-6, 1e-6 * (1.0 + abs(v))
    a = p.acceleration
    return (float(a(t, q + d, v) - a(t, q - d, v)) / (2.0 * d), float(a(t, q, v + dv) - a(t, q, v - dv)) / (2.0 * dv))


def runge_kutta(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> State:
    """Return the state after a step of a Runge-Kutta method (Hairer, Norsett & Wanner 1993, II.1)."""
    b, rows = numbers(m.b), [numbers(row) for row in m.a]
    times = [t + h * sum(row) for row in rows]
    if m.implicit:
        scaled = [[h * x for x in row] for row in rows]
        w = solved(p, times, q, scaled, v, scaled)
        k = [p.acceleration(time, q + dot(row, w), x) for time, row, x in zip(times, scaled, w, strict=True)]
    else:
        w, k = [], []
        for time, row in zip(times, rows, strict=True):
            place = q + h * dot(row[: len(w)], w)
            w.append(v + h * dot(row[: len(k)], k))
            k.append(p.acceleration(time, place, w[-1]))
    return q + h * dot(b, w), v + h * dot(b, k)


def nystrom(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> State:
    """Return the state after a step of a Nyström method (Hairer, Norsett & Wanner 1993, II.14)."""
    k: list[Any] = []
    for c, a, av in zip(numbers(m.c), m.a, m.av, strict=True):
        place = q + c * h * v + h * h * dot(numbers(a)[: len(k)], k)
        k.append(p.acceleration(t + c * h, place, v + h * dot(numbers(av)[: len(k)], k)))
    return q + h * v + h * h * dot(numbers(m.bbar), k), v + h * dot(numbers(m.b), k)


def splitting(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> State:
    """Return the state after a step of a splitting (Hairer, Lubich & Wanner 2006, II.5); drifts advance the time."""
    for kind, part in m.flows:
        share = _number(part) * h
        if kind == "drift":
            q, t = q + share * v, t + share
        elif kind == "drag":
            v = p.slowed(q, v, share) if p.linear or p.quadratic or p.wind else v
        else:
            v = v + share * (p.force(t, q) if kind == "kick" else p.acceleration(t, q, v))
    return q, v


def force_gradient(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> State:
    """Return the state after a step of kicks by ``f + c h**2 f f'`` and drifts (Chin 1997)."""
    d = mpf(10) ** -13
    for kind, part, c in m.flows:
        share = _number(part) * h
        if kind == "drift":
            q, t = q + share * v, t + share
        else:
            f = p.force(t, q)
            slope = (p.force(t, q + d) - p.force(t, q - d)) / (2 * d) if c else 0
            v = v + share * f * (1 + _number(c) * h * h * slope)
    return q, v


def taylor(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> State:
    """Return the state after a step of the Taylor series up to the method's order."""
    place, speed = (polynomial(row, h) for row in p.series(t, q, v, m.order))
    return place, speed


@lru_cache(maxsize=1)
def _gauss() -> list[tuple[Any, Any]]:
    """Return nodes and weights of Gauss quadrature with NODES nodes on [-1, 1], zeros of Legendre's polynomial."""
    rows = []
    for start in np.polynomial.legendre.leggauss(NODES)[0]:
        x = mpf(start)
        for _ in range(3):
            low, high = mpf(1), x
            for k in range(2, NODES + 1):
                low, high = high, ((2 * k - 1) * x * high - (k - 1) * low) / k
            slope = NODES * (low - x * high) / (1 - x * x)
            x = x - high / slope
        rows.append((x, 2 / ((1 - x * x) * slope * slope)))
    return rows


def discrete_gradient(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> State:
    """Return the state after a step with the mean force between both angles (Quispel & McLaren 2008)."""
    half, w = h / 2, v
    for _ in range(200):
        mean = sum(b * p.force(t + half, q + half * w * (1 + x)) for x, b in _gauss()) / 2
        off = w - v - half * (mean + p.acceleration(t + half, q + half * w, w) - p.force(t + half, q + half * w))
        change = off / (1 + half * (p.linear + 2 * p.quadratic * abs(w)))
        w = w - change
        if abs(change) <= DIGITS * (1 + abs(v)):
            return q + h * w, 2 * w - v
    raise ArithmeticError("the iteration does not converge")


ONE_STEP: dict[str, Callable[..., State]] = {
    "RungeKutta": runge_kutta, "Nystrom": nystrom, "Splitting": splitting, "ForceGradient": force_gradient,
    "Taylor": taylor, "DiscreteGradient": discrete_gradient,
}


def slid(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> State:
    """Return the state after a step of a one-step method under dry friction.

    The step is cut where the velocity of a shorter step is zero. There the bob stays, or slides on as the other forces
    push it.
    """
    step, left = ONE_STEP[type(m).__name__], h
    while left > 0:
        if v == 0 and abs(p.force(t, q)) <= p.dry:
            if abs(p.force(t + left, q)) <= p.dry:
                break
            start = p.let_go(t, q, t + left)
            t, left = start, left - (start - t)
        side = 1 if (v or p.force(t, q)) > 0 else -1
        sliding = p.towards(side)
        after = step(m, sliding, t, q, v, left)
        if side * after[1] >= 0:
            return after
        low, high = left / 2, left
        while side * step(m, sliding, t, q, v, low)[1] < 0:
            low, high = low / 2, low
        for _ in range(125):
            middle = (low + high) / 2
            low, high = (low, middle) if side * step(m, sliding, t, q, v, middle)[1] < 0 else (middle, high)
        q, v = step(m, sliding, t, q, v, high)[0], mpf(0)
        t, left = t + high, left - high
    return q, v


def before(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> list[tuple[Any, Any, Any]]:
    """Return time and state now and at earlier steps, computed backwards in time by the one-step starter."""
    rows = [(t, q, v)]
    for k in range(m.past):
        rows.append((t - (k + 1) * h, *runge_kutta(m.starter, p, *rows[-1], -h)))
    return rows


def adams(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> Iterator[State]:
    """Yield the states after each step of an Adams method (Hairer, Norsett & Wanner 1993, III.1)."""
    rows = [(w, p.acceleration(s, x, w)) for s, x, w in before(m, p, t, q, v, h)]

    def ahead(weights: Sequence[Any], slopes: Sequence[State]) -> State:
        return tuple(y + h * dot(numbers(weights), column)  # type: ignore[return-value]
                     for y, column in zip((q, v), zip(*slopes[: len(weights)], strict=True), strict=True))

    while True:
        end = ahead(m.b, rows)
        t = t + h
        if m.corrector:
            end = ahead(m.corrector, [(end[1], p.acceleration(t, *end)), *rows])
        q, v = end
        rows = [(v, p.acceleration(t, q, v)), *rows[:-1]]
        yield q, v


def backward_difference(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> Iterator[State]:
    """Yield the states after each step of a BDF method, the first ones by its starter (III.1)."""
    alpha, states = numbers(m.alpha), [(q, v)]
    share = h / alpha[0]
    while True:
        if len(states) < len(alpha) - 1:
            states.append(runge_kutta(m.starter, p, t, *states[-1], h))
        else:
            known = [-dot(alpha[1:], column[::-1])/alpha[0] for column in zip(*states[1 - len(alpha):],
                                                                                     strict=True)]
            w, = solved(p, [t + h], known[0], [[share]], known[1], [[share]])
            states = [*states[-len(alpha):], (known[0] + share * w, w)]
        t = t + h
        yield states[-1]


@cache
def over_mean(count: int) -> tuple[Fraction, ...]:
    """Return weights c of accelerations at a step's end and before it: its final minus its mean velocity, over h.

    They solve ``sum_j c_j j**k = 1/((k + 1) (k + 2))``, the integral of ``(1 - x) x**k``, for all k below ``count``.
    """
    rows = [[*(Fraction(j**k) for j in range(count)), Fraction(1, (k + 1) * (k + 2))] for k in range(count)]
    for i in range(count):
        rows[i] = [x / rows[i][i] for x in rows[i]]
        for k in set(range(count)) - {i}:
            rows[k] = [x - rows[k][i] * y for x, y in zip(rows[k], rows[i], strict=True)]
    return tuple(row[-1] for row in rows)


def second_order(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> Iterator[State]:
    """Yield the states of ``sum_j alpha_j q_(n+1-j) = h**2 sum_j beta_j f_(n+1-j)``, summed once (III.10).

    The history of mean velocities comes from the starter, except the newest, which follows from the velocity.
    """
    rows = before(m, p, t, q, v, h)
    forces, means = [p.force(s, x) for s, x, _ in rows], [(new[1] - old[1]) / h for new, old in pairwise(rows)]
    beta = [*numbers(m.beta), *[mpf(0)] * (m.past + 2)]
    sums = list(accumulate(numbers(m.alpha)))[1:-1]
    count = m.past + 1
    c = numbers(over_mean(count))
    while True:
        means[:1] = [v - h * dot(c, forces)]
        mean = h * dot(beta[1: 1 + len(forces)], forces) - dot(sums, means[: len(sums)])
        t, place = t + h, q + h * mean
        if beta[0]:
            place, = solved(Problem(p.force), [t], 0, [[1]], place, [[beta[0] * h * h]])
            mean = (place - q) / h
        forces, means, q = [p.force(t, place), *forces[:-1]], [mean, *means[:-1]], place
        v = mean + h * dot(c, forces)
        yield q, v


def generalized_alpha(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> Iterator[State]:
    """Yield the states of a generalized-alpha method (Chung & Hulbert 1993), or with mean forces (Hilber et al. 1977).

    ``(1 - alpha_m) a1 + alpha_m a = k`` with the force k at the averaged state, or the average of both forces.
    """
    mean, part, beta, gamma = numbers((m.alpha_m, m.alpha_f, m.beta, m.gamma))
    averaged = type(m).__name__ == "MeanForceAlpha"
    rate = force = p.acceleration(t, q, v)
    while True:
        # With the unknown force k: a1 = known + share k; the force is taken at the state 1 - place of the way.
        place = mpf(0) if averaged else part
        known = ((part * force if averaged else 0) - mean * rate) / (1 - mean)
        share = ((1 - part) if averaged else mpf(1)) / (1 - mean)
        at_q = q + (1 - place) * h * (v + h * ((mpf(1) / 2 - beta) * rate + beta * known))
        at_v = v + (1 - place) * h * ((1 - gamma) * rate + gamma * known)
        by_q, by_v = ((1 - place) * x * share for x in (h * h * beta, h * gamma))
        w, = solved(p, [t + (1 - place) * h], at_q - by_q / by_v * at_v, [[by_q / by_v]], at_v, [[by_v]])
        force = (w - at_v) / by_v
        new = known + share * force
        q, v = (q + h * v + h * h * ((mpf(1) / 2 - beta) * rate + beta * new),
                v + h * ((1 - gamma) * rate + gamma * new))
        t, rate = t + h, new
        yield q, v


MULTISTEP: dict[str, Callable[..., Iterator[State]]] = {
    "Adams": adams, "BackwardDifference": backward_difference, "SecondOrder": second_order,
    "GeneralizedAlpha": generalized_alpha, "MeanForceAlpha": generalized_alpha,
}


def steps(m: Any, p: Problem, t: Any, q: Any, v: Any, h: Any) -> Iterator[State]:
    """Yield the states after each step of a method."""
    kind = type(m).__name__
    if kind in MULTISTEP:
        yield from MULTISTEP[kind](m, p, t, q, v, h)
    while True:
        q, v = (slid if p.dry else ONE_STEP[kind])(m, p, t, q, v, h)
        t = t + h
        yield q, v


# --- motions and their errors ----------------------------------------------------------------------------------------

def shaken(share: float) -> Problem:
    """Return Kapitza's pendulum, whose pivot is at ``share cos(20 t)`` lengths above its mean."""
    lift = mpf(share) * 400
    return Problem(lambda t, q: (lift * cos(20 * t) - 1) * sin(q), rate=20.0)


def in_wind(air: float) -> Problem:
    """Return the pendulum of the cases of wind in a wind of ``air`` [m/s], in units of time in which omega0 is 1."""
    rate, length = numbers_of.sqrt(mpf(9.81) / mpf(fast_drive.LENGTH)), mpf(fast_drive.LENGTH)
    drag = mpf(AREA) / (mpf(fast_drive.MASS) * length * rate * rate)
    linear = mpf(fast_drive.LINEAR) / (length * rate * rate)

    def wind(q: Any, v: Any) -> Any:
        slip, across = length * rate * v - air * cos(q), air * sin(q)
        return -drag * (root(slip * slip + across * across) * slip) - linear * slip

    return Problem(lambda t, q: -sin(q), wind=wind, rate=2.0)


def driven_at(strength: float) -> Problem:
    """Return the chaotic pendulum, driven at 2/3 of omega0 with this strength."""
    return Problem(lambda t, q: mpf(strength) * cos(t * mpf(2 / 3)) - sin(q), linear=0.5, rate=2.7)


def _risen_slowly(t: Any, q: Any) -> Any:
    """Return gravity and the torque of the case of 11 days."""
    return cos(mpf(switching.SLOW) * t + mpf(switching.PHASED)) - q


EQUATIONS: dict[str, Problem | tuple[Problem, ...]] = {
    "pendulum": Problem(lambda t, q: -sin(q)),
    "pendulum pushed by 0.05": Problem(lambda t, q: mpf(0.05) - sin(q)),
    "linear": Problem(lambda t, q: -q),
    "quadratic drag of 0.1": Problem(lambda t, q: -sin(q), quadratic=0.1),
    "quadratic drag of 0.3": Problem(lambda t, q: -sin(q), quadratic=0.3),
    "linear, dry friction of 0.08": Problem(lambda t, q: -q, dry=0.08),
    "dry friction of 0.11": Problem(lambda t, q: -sin(q), dry=0.11),
    "linear, dry friction, a torque": Problem(lambda t, q: mpf(1.2) * cos(mpf(1.3) * t) - q, dry=0.8, rate=1.3),
    "dry friction, a shaken pivot": Problem(
        lambda t, q: mpf(1.2) * sin(mpf(1.3) * t) * cos(q) - sin(q), dry=0.8, rate=1.3),
    "quadratic drag of 0.3, dry friction": Problem(lambda t, q: -sin(q), quadratic=0.3, dry=0.05),
    "quadratic drag of 0.2, dry friction, a torque": Problem(
        lambda t, q: mpf(1.2) * cos(mpf(1.3) * t) - sin(q), quadratic=0.2, dry=0.8, rate=1.3),
    "linear, dry friction of 0.1": Problem(lambda t, q: -q, dry=0.1),
    "linear, dry friction, a slowly rising torque": Problem(lambda t, q: sin(mpf(0.02) * t) - q, dry=0.8),
    switching.YIELDS.equation: Problem(_risen_slowly, dry=0.8),
    switching.EXCEEDS.equation: Problem(lambda t, q: -q, dry=0.5),
    resonance.TWICE.equation: Problem(lambda t, q: mpf(resonance.PUSH) * cos(2 * t) - q, linear=0.2, rate=2.0),
    fast_drive.GUSTY.equation: tuple(in_wind(air) for air in airs(fast_drive.GUSTY.name)),
    switching.REVERSES.equation: tuple(in_wind(air) for air in airs(switching.REVERSES.name)),
    "driven at 1.5": driven_at(1.5),
    **{chaos.doubled(one).equation: driven_at(one.strength) for one in DOUBLINGS},
    **{f"linear drag, gamma h = {load:g}": Problem(lambda t, q: -q, linear=load / 0.01 / math.sqrt(9.81), closed=True)
       for load in (1.5, 10.0, 1e3, 1e6)},
    **{f"quadratic drag alone, c v0 h = {load:g}": Problem(lambda t, q: 0 * q, quadratic=load / 100.0, closed=True)
       for load in (10.0, 1e3, 1e6)},
    "quadratic drag and gravity, c v0 h = 1e6": Problem(lambda t, q: -sin(q), quadratic=1e4),
    **{fast_drive.edge(share): shaken(share) for share in fast_drive.SHARES},
}
"""Equation of motion of each name that cases use, or one for each mark, in units of time in which omega0 is 1."""


def pushed(p: Problem, torque: float) -> Problem:
    """Return a problem with a constant torque, in units of m g L."""
    return replace(p, force=lambda t, q: p.force(t, q) + mpf(torque)) if torque else p


def pieces(motion: Motion) -> Iterator[tuple[Problem, bool]]:
    """Yield for each mark the problem until then, and whether methods start anew, as the torque or wind changes."""
    p = EQUATIONS[motion.equation]
    torques = motion.torques or (0.0,) * motion.marks
    for k, torque in enumerate(torques):
        if isinstance(p, tuple):
            yield p[k], True
        else:
            yield pushed(p, torque), k == 0 or torque != torques[k - 1]


def truth(motion: Motion) -> list[State]:
    """Return the exact motion at its marks."""
    gap, t, q, v, states = mpf(motion.time) / motion.marks, mpf(0), mpf(motion.angle), mpf(motion.velocity), []
    for p, _ in pieces(motion):
        (q, v), t = p.exact(t, q, v, t + gap), t + gap
        states.append((q, v))
    return states


def error(method: Any, motion: Motion, true: Sequence[State], count: int) -> float:
    """Return the largest error at the marks, relative to the motion's size, in ``count`` steps per mark."""
    gap, t, q, v = mpf(motion.time) / motion.marks, mpf(0), mpf(motion.angle), mpf(motion.velocity)
    size = abs(math.pi - float(true[-1][0])) if motion.from_top else motion.largest
    worst, walk = 0.0, iter(())
    for (place, speed), (p, anew) in zip(true, pieces(motion), strict=True):
        walk = steps(method, p, t, q, v, gap / count) if anew else walk
        for _ in range(count):
            q, v = next(walk)
            if not abs(v) < 1e6:
                return math.inf
        t = t + gap
        worst = max(worst, float(abs(q - place)) / size, float(abs(v - speed)) / size / motion.pace)
    return worst


def fits(motion: Motion, method: Any) -> bool:
    """Return True if a motion is predicted for a method: it meets its needs, and the error is not zero."""
    unmet = (frozenset(NEEDS) - offers(motion.scene)) | motion.lacks
    return not (method.exact or method.needs & unmet or (motion.explicit and method.implicit))


def least(motion: Motion, method: Any) -> int:
    """Return the fewest steps per mark of a method in a motion; a multistep method needs some times its history.

    It needs them in the whole motion or, where torques change or the motion is ``sensitive``, for each mark.
    """
    each = bool(motion.torques) or motion.sensitive
    past = ENOUGH * method.past if each else math.ceil(ENOUGH * method.past / motion.marks)
    return 1 if motion.most == 1 else max(1, past)


def predicted(method: Any, motion: Motion, true: Sequence[State]) -> tuple[int, float]:
    """Return the fewest steps per mark with which a method errs by at most the motion's goal, and its error.

    The numbers of steps double, from ``motion.fewest`` to ``motion.most``, and are skipped where the order implies that
    they are too few.
    """
    count = least(motion, method)
    while True:
        try:
            found = error(method, motion, true, count)
        except (ArithmeticError, np.linalg.LinAlgError):
            found = math.inf
        if found <= motion.goal or count >= max(motion.most, least(motion, method)):
            return count, found
        ratio = MORE
        if found < 1.0:
            ratio = max(MORE, 0.8 * (found / motion.goal) ** (1.0 / method.order))
        count = min(max(motion.most, least(motion, method)), count * 2 ** math.floor(math.log2(ratio)))


def write(file: Path, name: str, entry: str) -> None:
    """Write the entry of a motion to a file, in the place that the motion has in the catalogue."""
    entries = dict(re.findall(r'^"(.+?)": ([{[].*?[}\]])(?:,\n|\n}$)', file.read_text(encoding="utf-8"), re.M | re.S))
    entries[name] = entry
    lines = [f'"{key}": {entries[key]}' for key in (*MOTIONS, *(entries.keys() - MOTIONS.keys())) if key in entries]
    file.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def main(names: Sequence[str]) -> None:
    """Compute the predictions of these motions, by default of all, and write them to the file."""
    for name in names or MOTIONS:
        true, row = truth(MOTIONS[name]), {}
        for method in integrators.METHODS.values():
            if fits(MOTIONS[name], method):
                row[method.name] = predicted(method, MOTIONS[name], true)
        print(name, len(row), flush=True)
        rounded = {key: [count, float(f"{found:.4g}")] for key, (count, found) in row.items()}
        write(FILE, name, "{\n " + ",\n ".join(f'"{one}": {json.dumps(pair)}' for one, pair in rounded.items()) + "\n}")
        write(TRUTHS, name, json.dumps([[float(x) for x in column] for column in zip(*true, strict=True)]))
    for name, push in () if names else product(DRAGS, PUSHES):
        write(TRUTHS, f"pushed at the top, {name}, {push:g} rad/s",
              json.dumps([column[1:].tolist() for column in fallen(name, push)]))
    assert str(FILE).startswith(str(ROOT))


if __name__ == "__main__":
    main(sys.argv[1:])
