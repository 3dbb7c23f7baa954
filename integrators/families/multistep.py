"""Base classes of multistep methods, which continue from a history of earlier steps.

Besides ``step`` the source of such a method has ``starter(t, q, v, h, *extra)``: one step of the one-step method that
starts it. It returns the mean slopes ``(q1 - q)/h, (v1 - v)/h`` and those of the quadratures (integrals carried along
the step, such as work).

The history holds velocities and accelerations at earlier steps, or increments over earlier steps. It holds no angles,
because whole turns may be subtracted from an angle between two steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import prod
from typing import Any, ClassVar

import numpy as np

from integrators.families.runge_kutta import RungeKutta
from integrators.method import Method, Polynomial, System
from integrators.steps.arrays import stages_solver
from integrators.steps.terms import Notation, StepLines, combination, definition
from integrators.tables.butcher import extrapolated_midpoint
from integrators.tables.runge_kutta import EXPLICIT

RK4 = next(method for method in EXPLICIT if method.name == "rk4")
HNW = "Hairer, Norsett & Wanner 1993"


def weights(nodes: Sequence[int], moments: Callable[[int], Fraction]) -> tuple[Fraction, ...]:
    """Return quadrature weights w for these nodes: ``sum_j w_j nodes_j**m = moments(m)``.

    The equation holds for all ``m`` below the number of nodes.
    """
    result = []
    for x in nodes:
        others = [y for y in nodes if y != x]
        basis = [Fraction(1)]
        for y in others:
            basis = [low - y * high for low, high in zip([Fraction(0), *basis], [*basis, Fraction(0)], strict=True)]
        result.append(sum((c * moments(m) for m, c in enumerate(basis)), Fraction(0)) / prod(x - y for y in others))
    return tuple(result)


def over_step(count: int) -> tuple[Fraction, ...]:
    """Return Adams-Moulton weights: the mean of a function over a step from its last ``count`` values.

    The newest value is that at the end of the step, the others are one step apart before it.
    """
    return weights(range(count), lambda m: Fraction(1, m + 1))


def over_mean(count: int) -> tuple[Fraction, ...]:
    """Return weights of accelerations that give a step's final velocity minus its mean velocity, divided by h.

    The ``count`` accelerations are one step apart, the newest at the end of the step.
    """
    return weights(range(count), lambda m: Fraction(1, (m + 1) * (m + 2)))


def product(one: Polynomial, other: Polynomial) -> Polynomial:
    """Return the product of two polynomials."""
    result = [Fraction(0)] * (len(one) + len(other) - 1)
    for i, x in enumerate(one):
        for j, y in enumerate(other):
            result[i + j] += x * y
    return tuple(result)


def falling(row: Sequence[Fraction], highest: int) -> Polynomial:
    """Return the polynomial ``- sum_j row_j x**(highest - j)``, as coefficients with the lowest power first."""
    result = [Fraction(0)] * (highest + 1)
    for j, value in enumerate(row):
        result[highest - j] -= value
    return tuple(result)


def ago(names: Sequence[str], places: Sequence[int]) -> tuple[str, ...]:
    """Return names for earlier values in generated source, such as ``a1_ago`` for the acceleration one step ago."""
    return tuple(f"{name}{i}_ago" for name in names for i in places)


@dataclass(frozen=True, kw_only=True)
class Multistep(Method):
    """A multistep method, which continues from several earlier steps; states its ``characteristic`` polynomials."""

    family: ClassVar[str] = "multistep"

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "smooth", *(("jacobian",) if self.implicit else ())})

    @property
    def evaluations(self) -> int:
        return 1

    @property
    def symplectic(self) -> bool:
        """False, as a multistep method is symplectic only if it is equivalent to a one-step method (Tang 1993)."""
        return False

    @property
    def symmetric(self) -> bool:
        return False

    @property
    def one_step(self) -> bool:
        return False

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        return ("acceleration", *(("rates",) if quadratures else ()), *(("jacobian",) if self.implicit else ()))

    def define(
        self, begin: Sequence[str], step: StepLines, ends: Sequence[str], kept: Sequence[str], increments: Sequence[str]
    ) -> str:
        """Return the source of the functions ``begin`` and ``step`` of a multistep method.

        Args:
            begin: the lines of ``begin``, which computes the history before the first step.
            step: the lines of the step.
            ends: the names or texts of q and v at the step's end.
            kept: the names or texts of the values that the next step needs, in the order of ``memory_with``.
            increments: the texts of the increments of quadratures (integrals carried along the step).
        """
        notation = step.notation
        doc = "Compute the earlier values that the first step of a multistep method needs."
        first = definition(f"begin(t, q, v, h{notation.more})", doc, begin)
        memory = dict(zip(self.memory_with(notation.quadratures), kept, strict=True))
        return first + "\n\n" + step.source(self.title, ends, memory, increments)


@dataclass(frozen=True, kw_only=True)
class Started(Multistep):
    """A multistep method that is started by a one-step method.

    Attributes:
        starter: the one-step method. Unless the class says ``forwards``, it takes steps backwards in time from the
            start, so that already the first step is one of the multistep method.
    """

    starter: RungeKutta

    @property
    def begun_by(self) -> Method:
        return self.starter

    @property
    def beginning(self) -> int:
        return self.past * (self.starter.evaluations + 1)

    def functions(self, system: System, like: Any) -> Mapping[str, Callable[..., Any]]:
        """Return ``{"solve_stages": function}`` if the first steps are those of an implicit method and q is an array.

        Otherwise the mapping is empty, because the method's generated source contains all functions.
        """
        together = self.implicit and self.starter.coupled and isinstance(like, np.ndarray)
        return {"solve_stages": stages_solver(self.starter.a, system)} if together else {}

    def write_starter(self, notation: Notation) -> str:
        """Return the source of ``starter``, one step of the method that computes a multistep method's history."""
        riding = notation.quadratures if self.forwards else ()
        return self.starter.write_starter(replace(notation, quadratures=riding, dense=False)) + "\n\n"

    def begin_backwards(
        self, notation: Notation, speeds: Sequence[str] = (), means: Sequence[str] = ()
    ) -> list[str]:
        """Return the lines of ``begin`` that compute a history by steps of the one-step starter backwards in time.

        Args:
            notation: names and number format of the step's source.
            speeds, means: names of the history's velocities and mean velocities, the newest first.
        """
        quadratures, more = notation.quadratures, notation.more
        kept = self.memory_with(quadratures)
        earlier = {name: ago((name,), range(1, self.past + 1)) for name in ("a", *quadratures)}
        rows = {"w": speeds, **earlier, "mean_v": means}
        slopes, now = ", ".join(["a", *quadratures]), ", ".join(["a_now", *ago(quadratures, (0,))])
        lines = [f"{now} = {notation.slope}(t, q, v{more})"] if "a" in kept else []
        lines += ["x = q", "w = v", f"{' = '.join(name for row in rows.values() for name in row)} = v - v"]
        lines += [f"for i in range({self.past}):"]
        lines += [f"    mean_v, mean_a = starter(t - i*h, x, w, -h{more})"]
        lines += ["    x = x - h*mean_v", "    w = w - h*mean_a"]
        lines += [f"    {slopes} = {notation.slope}(t - (i + 1)*h, x, w{more})"]
        for newest, row in rows.items():
            if row:
                lines.append(f"    {', '.join(row)} = {', '.join([*row[1:], newest])}")
        lines.append(f"return {', '.join('a_now' if name == 'a' else name for name in kept)}")
        return lines


def starter_of(order: int) -> RungeKutta:
    """Return the one-step method that computes the history of an explicit multistep method of this order.

    It is rk4 up to order 4, else extrapolation of the midpoint rule, of the next even order.
    """
    return RK4 if order <= 4 else extrapolated_midpoint(order + order % 2)


def closed(step: StepLines, count: int) -> tuple[list[str], list[str]]:
    """Append the line that evaluates the quadratures' rates at a step's end, in a multistep method.

    Quadratures are integrals carried along the step, such as work. Returns the names of the rates to store in the
    history, and the texts of the quadratures' increments: integrals over the step from these rates and those of
    ``count - 1`` earlier times.
    """
    quadratures, more, number = step.notation.quadratures, step.notation.more, step.notation.number
    if quadratures:
        step.line(f"{', '.join(['_', *quadratures])} = rates(t + h, q_new, v_new{more})")
    kept: list[str] = []
    sums = []
    for name in quadratures:
        row = [name, *ago((name,), range(count - 1))]
        kept += row[:-1]
        sums.append(f"h*({combination(over_step(count), row, number)})")
    return kept, sums
