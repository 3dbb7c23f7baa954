"""Dense output: the solution between the ends of its steps, as Bezier curves in q and v over each step.

For a method with an :class:`integrators.steps.continuous.Extension`, such as a Runge-Kutta table, dense output consists
of polynomials over the stages of a step, and over further stages if the extension has any. For all other methods dense
output is Hermite interpolation between the ends of a step, which needs the accelerations there; ``theta`` runs from 0
to 1 over the step:

======================  ============================================  ==============================================
order p of the method   curve in q                                    curve in v
======================  ============================================  ==============================================
below 4                 cubic through q and v at both ends            cubic through v and a at both ends
4 and more              quintic through q, v and a at both ends       the derivative of the curve in q
======================  ============================================  ==============================================

Over one step the cubic has the error O(h**4), the quintic O(h**6) in q and O(h**5) in v. Both also contain the method's
own error O(h**(p + 1)) at the end of the step, which the derivative turns into O(h**p) in v. This gives
``Method.dense_order``. Under a tolerance a pair of high order takes steps so long that the quintic would miss the
tolerance between their ends. The method then takes shorter steps within the step, and the curve goes through their
states as well: degree 8 through three of them, 14 through five (:meth:`integrators.solving.adaptive.March.record`).

References: Hairer, Norsett & Wanner 1993, Solving ODEs I, section II.6; Farin 2002, Curves and Surfaces for CAGD,
chapters 4 and 6 (Bezier form, de Casteljau's algorithm); Davis 1975, Interpolation and Approximation, section 2.3
(Hermite's polynomial through states at several places).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, reduce
from itertools import pairwise
from math import perm
from operator import add
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.errors import shown
from integrators.method import Method, MethodError, polynomial_at
from integrators.solving.values import is_finite, is_real, widened
from integrators.tables.butcher import bernstein

Points = Sequence[Any]


@dataclass(frozen=True)
class Curve:
    """Bezier curves of q and v for dense output over one step of length ``h`` from (q, v) at ``t``.

    The control points are relative to (q, v); the first one is zero and left out. The step starts exactly at
    ``t + rest``: far from t = 0 a time is rounded by more than steps of one length may differ. ``rest`` None is zero.
    """

    t: Any
    h: Any
    q: Any
    v: Any
    by_q: Points
    by_v: Points
    rest: Any = None

    def since(self, t: Any) -> Any:
        """Return the time from t to the start of the step."""
        return self.t - t if self.rest is None else (self.t - t) + self.rest

    def time(self, theta: Any) -> Any:
        """Return the time at ``theta``, a fraction of the step."""
        after = theta * self.h
        return self.t + (after if self.rest is None else self.rest + after)

    def fraction(self, t: Any) -> Any:
        """Return the fraction of the step at the time t, or at an array of times."""
        after = t - self.t
        return (after if self.rest is None else after - self.rest) / self.h

    def at(self, theta: Any) -> tuple[Any, Any]:
        """Return (q, v) of dense output at ``theta``, a fraction of the step or an array that broadcasts with q."""
        return self.q + _bezier(self.by_q, theta), self.v + _bezier(self.by_v, theta)


    def slope(self, theta: Any) -> Any:
        """Return the derivative of the velocity at ``theta``, a fraction of the step, between 0 and 1."""
        points = [0 * self.by_v[0], *self.by_v]
        steps = [later - early for early, later in pairwise(points)]
        return len(steps) * (steps[0] + _bezier([step - steps[0] for step in steps[1:]], theta)) / self.h


@dataclass(frozen=True)
class Hermite:
    """Rule for the polynomial of degree 3n + 2 through q, v and a at n + 1 equal distances of a step.

    Attributes:
        weights: for each control point of q but the first one, the weights of ``q_j - q``, ``h v_j`` and ``h**2 a_j``.
        test: place at which the polynomial is compared with the acceleration, as a fraction of the step.
        of_q, of_v: the largest errors of q and v for a difference of accelerations of 1 there, over ``h**2`` and h.
    """

    weights: tuple[tuple[Fraction, ...], ...]
    test: Fraction
    of_q: Fraction
    of_v: Fraction


@cache
def hermite(parts: int) -> Hermite:
    """Return the rule for a step in this many parts."""
    nodes = [Fraction(j, parts) for j in range(parts + 1)]
    size = 3 * len(nodes)
    rows = [[Fraction(perm(k, order)) * node ** (k - order) if k >= order else Fraction(0) for k in range(size)]
            for node in nodes for order in range(3)]
    basis = zip(*inverse(rows), strict=True)  # powers of the polynomial of each of the data q_j, v_j, a_j
    weights = zip(*(bernstein(*powers[1:]) for powers in basis), strict=True)
    left_out = [Fraction(1)]
    for node in [*nodes] * 3:
        left_out = [x - node * y for x, y in zip([Fraction(0), *left_out], [*left_out, Fraction(0)], strict=True)]
    slopes = [k * x for k, x in enumerate(left_out)][1:]
    test = Fraction(1, 2 * parts)
    there = polynomial_at(tuple(k * x for k, x in enumerate(slopes))[1:], test)
    grid = [Fraction(k, 64 * parts) for k in range(64 * parts + 1)]
    of_q, of_v = (max(abs(polynomial_at(tuple(powers), x)) for x in grid) / abs(there) for powers in (left_out, slopes))
    return Hermite(tuple(weights), test, of_q.limit_denominator(10**6), of_v.limit_denominator(10**6))


def inverse(rows: Sequence[Sequence[Fraction]]) -> list[list[Fraction]]:
    """Return the inverse of a matrix of fractions, by Gauss and Jordan's elimination."""
    size = len(rows)
    table = [[*row, *(Fraction(i == j) for j in range(size))] for i, row in enumerate(rows)]
    for k in range(size):
        pivot = next(i for i in range(k, size) if table[i][k])
        table[k], table[pivot] = table[pivot], table[k]
        table[k] = [x / table[k][k] for x in table[k]]
        for i in range(size):
            if i != k and table[i][k]:
                table[i] = [x - table[i][k] * y for x, y in zip(table[i], table[k], strict=True)]
    return [row[size:] for row in table]


def _bezier(points: Points, theta: Any) -> Any:
    """Return the point at ``theta`` of the Bezier curve with the control points zero and ``points`` (de Casteljau)."""
    row = [0 * theta, *points]
    while len(row) > 1:
        row = [(1 - theta) * p + theta * q for p, q in pairwise(row)]
    return row[0]


@dataclass(frozen=True)
class DenseOutput:
    """Solution as a function of time: ``dense(t)`` returns (q, v) at any time that the steps cover.

    Attributes:
        order: the error over one step is O(h**(order + 1)).
        curves: one curve for each step, then a constant one at the end.
    """

    order: int
    curves: tuple[Curve, ...]

    def __call__(self, t: Any) -> tuple[Any, Any]:
        """Return (q, v) at one time, or at an array of times of any shape, whose axes come before those of q.

        At the end of a step the result equals the solution there bit for bit. Raises MethodError for times that are not
        finite numbers, or that the steps do not cover.
        """
        t = widened(t)
        try:
            times = np.asarray(t, dtype=float if self._double else object) if np.ndim(t) else None
        except (TypeError, ValueError, OverflowError) as fault:
            raise MethodError(f"t must be a finite time or an array of such times, not {shown(t)}.") from fault
        if times is None:
            self._check(t)
            t = t if isinstance(t, (float, int)) or not self._double else float(t)  # a Decimal or a Fraction
            curve = self.curves[self._index(t)]
            return curve.at(curve.fraction(t))
        if not self._double:
            return self._one_by_one(times)
        for one in (times.min(), times.max()) if times.size else ():
            self._check(one)
        return self._at_many(times)

    @property
    def _double(self) -> bool:
        """True if the solution is in double precision, not in another number type such as mpmath's."""
        return isinstance(self.curves[-1].h, float)

    @property
    def _sense(self) -> int:
        """Direction of time in a dense solution: 1 forwards, -1 backwards."""
        return -1 if self.curves[-1].t < self.curves[0].t else 1

    def _check(self, t: Any) -> None:
        """Raise MethodError unless the steps of a dense solution cover the time t."""
        if not is_real(t):
            raise MethodError(f"t must be a finite time or an array of such times, not {shown(t)}.")
        first, last = self.curves[0].t, self.curves[-1].t
        if not (first <= t <= last or last <= t <= first):
            raise MethodError(f"t = {t} is not between this solution's first and last time, {first} and {last}.")

    def _index(self, t: Any) -> int:
        """Return the index of the step of a dense solution that contains the time t."""
        sense, first = self._sense, self.curves[0].t
        return bisect_right(self.curves, sense * (t - first), key=lambda curve: sense * curve.since(first)) - 1

    def _one_by_one(self, times: NDArray[Any]) -> tuple[Any, Any]:
        """Return (q, v) at an array of times, computed one by one, for numbers other than floats."""
        values = np.empty((2, times.size), dtype=object)
        for k, t in enumerate(times.flat):
            values[:, k] = self(t)
        return values[0].reshape(times.shape), values[1].reshape(times.shape)

    def _at_many(self, times: NDArray[np.float64]) -> tuple[Any, Any]:
        """Return (q, v) of a dense solution at an array of times in double precision, computed step by step."""
        shape = np.shape(self.curves[0].q)
        values = np.empty((2, times.size, *shape))
        first = self.curves[0].t
        starts = np.array([curve.since(first) for curve in self.curves])
        places = np.searchsorted(self._sense * starts, self._sense * (times.ravel() - first), side="right") - 1
        order = np.argsort(places, kind="stable")
        for members in np.split(order, np.flatnonzero(np.diff(places[order])) + 1):
            if len(members):
                curve = self.curves[places[members[0]]]
                theta = curve.fraction(times.ravel()[members])
                values[0, members], values[1, members] = curve.at(theta.reshape(-1, *[1] * len(shape)))
        return values[0].reshape(*times.shape, *shape), values[1].reshape(*times.shape, *shape)


class Recorder:
    """Recorder that collects the steps of a solution for its dense output.

    Args:
        method: the method that takes the steps.
        slope: the acceleration, evaluated at further stages of a continuous extension and at the ends of steps.
        zero: a zero of the number type to be used.
        each: receives the curve of each step; None for none.
        keep: False forgets the curves, where only ``each`` needs them.

    Attributes:
        quintic: True if the curves are quintics by Hermite interpolation.
        steps: number of curves added so far.
    """

    def __init__(
        self, method: Method, slope: Callable[[Any, Any, Any], Any], zero: Any,
        each: Callable[[Curve], None] | None = None, keep: bool = True,
    ) -> None:
        self.method, self.slope, self.zero, self.each, self.keep = method, slope, zero, each, keep
        self.extension = method.dense
        self.quintic = self.extension is None and method.order >= 4
        self.steps = 0
        self.curves: list[Curve] = []
        self._end: Any = None
        if self.extension is not None:
            ends = self.extension.ends
            self._weights = [self._numbers(row) for row in self.extension.b]
            self._rows = [(sum(row, Fraction(0)), self._numbers(row)) for row in self.extension.a]
            self._ends = [row == ends[:len(row)] for row in self.extension.a]

    def add(self, *step: Any, **more: Any) -> None:
        """Add one step; the arguments are those of :meth:`curve`. Raises what that and ``each`` raise."""
        self.put(self.curve(*step, **more))

    def curve(
        self, t: Any, h: Any, before: tuple[Any, Any], after: tuple[Any, Any], found: Sequence[Any],
        ends: tuple[Any, Any] | None = None, rest: Any = None,
    ) -> Curve:
        """Return the curve of one step of length h from the state ``before`` at time t to the state ``after``.

        Args:
            found: the values that the step returned; for a method with an extension, the last two are the velocities
                and accelerations of its stages.
            ends: the accelerations before and after the step, if they are known.
            rest: the part of the step's start that t does not hold, see :class:`Curve`; None for none.

        Raises MethodError if the acceleration fails or is not finite at a further stage or at the end.
        """
        q, v = before
        try:
            with np.errstate(all="ignore"):
                curves = (self._hermite(t, h, before, after, ends) if self.extension is None else
                          self._extended(t, h, before, after, found[-2:], None if ends is None else ends[1]))
            fault = "" if all(is_finite(point) for points in curves for point in points) else "it is not finite there"
        except (ArithmeticError, ValueError) as error:
            fault = str(error)
        if fault:
            raise self.failed(t, h, fault)
        return Curve(t, h, q, v, *curves, rest)

    def joined(self, t: Any, h: Any, states: Sequence[Sequence[Any]], rest: Any) -> Curve:
        """Return the curve through states (q, v, a) at equal distances of a step of length h; see :func:`hermite`."""
        (q, v, _), (q1, v1, _) = states[0], states[-1]
        data = [x for q_j, v_j, a_j in states for x in (q_j - q, h * v_j, h * h * a_j)]
        by_q = [_sum(self._numbers(row), data) for row in hermite(len(states) - 1).weights]
        steps = [later - early for early, later in pairwise([0 * by_q[0], *by_q])]
        by_v = [len(by_q) * step / h - v for step in steps[1:]]
        by_q[-1], by_v[-1] = q1 - q, v1 - v
        return Curve(t, h, q, v, by_q, by_v, rest)

    def failed(self, t: Any, h: Any, fault: object) -> MethodError:
        """Return the error that the dense output of the step of length h from time t cannot be computed."""
        return MethodError(f"The dense output of {self.method.name} needs the acceleration within the step of "
                           f"h = {h} from t = {t}: {fault}.")

    def put(self, curve: Curve) -> None:
        """Add the curve of one step; raises what ``each`` raises."""
        self.steps += 1
        if self.keep:
            self.curves.append(curve)
        if self.each is not None:
            self.each(curve)

    def break_off(self) -> None:
        """Let the next step begin anew, from another state than that at the end of the last one."""
        self._end = None

    def output(self, t: Any, q: Any, v: Any) -> DenseOutput:
        """Return the dense output of all steps added so far, which end at the state (q, v) at time t."""
        return DenseOutput(self.method.dense_order, (*self.curves, Curve(t, self.zero + 1, q, v, (), ())))

    def _numbers(self, row: Sequence[Fraction]) -> list[Any]:
        """Convert coefficients of a continuous extension to the problem's number type; zeros become None."""
        if isinstance(self.zero, float):
            return [float(x) if x else None for x in row]
        return [(self.zero + 1) * x.numerator / x.denominator if x else None for x in row]

    def _extended(
        self, t: Any, h: Any, before: tuple[Any, Any], after: tuple[Any, Any], stages: Sequence[Any], end: Any
    ) -> tuple[Points, Points]:
        """Return the Bezier control points of q and v over a step, from its stages and those of the extension.

        ``end`` is the acceleration at the end of the step, or None if it is not known.
        """
        (q, v), (q1, v1) = before, after
        speeds, slopes = list(stages[0]), list(stages[1])
        for (node, row), is_end in zip(self._rows, self._ends, strict=True):
            place = after if is_end else (q + h * _sum(row, speeds), v + h * _sum(row, slopes))
            speeds.append(place[1])
            known = is_end and end is not None
            slopes.append(end if known else self.slope(t + h * self._numbers([node])[0], *place))
        columns = list(zip(*self._weights, strict=True))[:-1]
        return (
            [*(h * _sum(column, speeds) for column in columns), q1 - q],
            [*(h * _sum(column, slopes) for column in columns), v1 - v],
        )

    def _hermite(
        self, t: Any, h: Any, before: tuple[Any, Any], after: tuple[Any, Any], ends: tuple[Any, Any] | None
    ) -> tuple[Points, Points]:
        """Return the Bezier control points of q and v over a step by Hermite interpolation between its ends."""
        (q, v), (q1, v1) = before, after
        if ends is None:
            a = self.slope(t, q, v) if self._end is None else self._end
            ends = a, self.slope(t + h, q1, v1)
        a, a1 = ends
        self._end = a1
        dq, dv = q1 - q, v1 - v
        if self.method.order < 4:
            return [h * v / 3, dq - h * v1 / 3, dq], [h * a / 3, dv - h * a1 / 3, dv]
        by_q = [h * v / 5, 2 * h * v / 5 + h * h * a / 20, dq - 2 * h * v1 / 5 + h * h * a1 / 20, dq - h * v1 / 5, dq]
        return by_q, [h * a / 4, 5 * (by_q[2] - by_q[1]) / h - v, dv - h * a1 / 4, dv]


def _sum(weights: Sequence[Any], values: Sequence[Any]) -> Any:
    """Return the weighted sum of values, added one after the other; weights of None are skipped.

    Python's built-in sum would differ: from 3.12 on it compensates rounding for floats, but not for arrays.
    """
    given = ((weight, value) for weight, value in zip(weights, values, strict=False) if weight is not None)
    return reduce(add, (weight * value for weight, value in given), 0)
