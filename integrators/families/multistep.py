"""Multistep methods, which go on from earlier steps: what all families of them share.

A step is written with ``starter(t, q, v, h, *extra)``, which yields the mean slopes ``(q1 - q)/h, (v1 - v)/h`` of one
step of the method that begins, those of the quadratures after them.

Memory holds velocities and accelerations of earlier steps, or gains over earlier steps, and no angles: whole turns may
be taken off an angle between two steps.
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
from integrators.tables.extrapolation import extrapolated_midpoint
from integrators.tables.runge_kutta import EXPLICIT

RK4 = next(method for method in EXPLICIT if method.name == "rk4")
HNW = "Hairer, Norsett & Wanner 1993"


def weights(nodes: Sequence[int], moments: Callable[[int], Fraction]) -> tuple[Fraction, ...]:
    """The weights with ``sum_j w_j nodes_j**m = moments(m)`` for all ``m`` below the number of nodes: a quadrature."""
    found = []
    for x in nodes:
        others = [y for y in nodes if y != x]
        basis = [Fraction(1)]
        for y in others:
            basis = [low - y * high for low, high in zip([Fraction(0), *basis], [*basis, Fraction(0)], strict=True)]
        found.append(sum((c * moments(m) for m, c in enumerate(basis)), Fraction(0)) / prod(x - y for y in others))
    return tuple(found)


def over_step(count: int) -> tuple[Fraction, ...]:
    """The integral over one step from a function's last ``count`` values, the newest at its end: Adams-Moulton."""
    return weights(range(count), lambda m: Fraction(1, m + 1))


def over_mean(count: int) -> tuple[Fraction, ...]:
    """The velocity at a step's end above its mean, from as many accelerations, the newest at its end."""
    return weights(range(count), lambda m: Fraction(1, (m + 1) * (m + 2)))


def product(one: Polynomial, other: Polynomial) -> Polynomial:
    """Of two polynomials."""
    found = [Fraction(0)] * (len(one) + len(other) - 1)
    for i, x in enumerate(one):
        for j, y in enumerate(other):
            found[i + j] += x * y
    return tuple(found)


def falling(row: Sequence[Fraction], highest: int) -> Polynomial:
    """``- sum_j row_j x**(highest - j)``."""
    found = [Fraction(0)] * (highest + 1)
    for j, value in enumerate(row):
        found[highest - j] -= value
    return tuple(found)


def ago(names: Sequence[str], places: Sequence[int]) -> tuple[str, ...]:
    """Names of values so many steps ago: ``a1_ago``, ``a2_ago``, ..."""
    return tuple(f"{name}{i}_ago" for name in names for i in places)


@dataclass(frozen=True, kw_only=True)
class Multistep(Method):
    """A method that goes on from several earlier steps; its ``characteristic`` is all that analysis asks for."""

    family: ClassVar[str] = "multistep"

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "smooth", *(("jacobian",) if self.implicit else ())})

    @property
    def evaluations(self) -> int:
        return 1

    @property
    def symplectic(self) -> bool:
        """False: no multistep method that is not a one-step method in disguise is symplectic (Tang 1993)."""
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
        """Return the source of ``begin`` and ``step``.

        Args:
            begin: the lines of ``begin``.
            step: the lines of the step.
            ends: the names or texts of q and v at the step's end.
            kept: those of the memory, in its order.
            increments: those of the quadratures' increments.
        """
        notation = step.notation
        first = definition(f"begin(t, q, v, h{notation.more})", "What the first step takes of earlier ones.", begin)
        memory = dict(zip(self.memory_with(notation.quadratures), kept, strict=True))
        return first + "\n\n" + step.source(self.title, ends, memory, increments)


@dataclass(frozen=True, kw_only=True)
class Started(Multistep):
    """One whose earlier steps a one-step method takes.

    Attributes:
        starter: that method. Where it does not go ``forwards``, steps of it backwards begin, so that all steps from the
            first are the method's own.
    """

    starter: RungeKutta

    @property
    def begun_by(self) -> Method:
        return self.starter

    @property
    def beginning(self) -> int:
        return self.past * (self.starter.evaluations + 1)

    def functions(self, system: System, like: Any) -> Mapping[str, Callable[..., Any]]:
        """Return ``solve_stages`` of the starter, for arrays."""
        together = self.implicit and self.starter.coupled and isinstance(like, np.ndarray)
        return {"solve_stages": stages_solver(self.starter.a, system)} if together else {}

    def write_starter(self, notation: Notation) -> str:
        """The source of ``starter``."""
        riding = notation.quadratures if self.forwards else ()
        return self.starter.write_starter(replace(notation, quadratures=riding, dense=False)) + "\n\n"

    def begin_backwards(
        self, notation: Notation, speeds: Sequence[str] = (), means: Sequence[str] = ()
    ) -> list[str]:
        """Lines of ``begin``: steps of the starter backwards, in a row; each new value is the oldest.

        Args:
            notation: of the step.
            speeds, means: names of earlier velocities and mean velocities, the last one's first.
        """
        quadratures, more = notation.quadratures, notation.more
        kept = self.memory_with(quadratures)
        earlier = {name: ago((name,), range(1, self.past + 1)) for name in ("a", *quadratures)}
        rows = {"w": speeds, **earlier, "mean_v": means}
        found, now = ", ".join(["a", *quadratures]), ", ".join(["a_now", *ago(quadratures, (0,))])
        lines = [f"{now} = {notation.slope}(t, q, v{more})"] if "a" in kept else []
        lines += ["x = q", "w = v", f"{' = '.join(name for row in rows.values() for name in row)} = v - v"]
        lines += [f"for i in range({self.past}):"]
        lines += [f"    mean_v, mean_a = starter(t - i*h, x, w, -h{more})"]
        lines += ["    x = x - h*mean_v", "    w = w - h*mean_a"]
        lines += [f"    {found} = {notation.slope}(t - (i + 1)*h, x, w{more})"]
        for newest, row in rows.items():
            if row:
                lines.append(f"    {', '.join(row)} = {', '.join([*row[1:], newest])}")
        lines.append(f"return {', '.join('a_now' if name == 'a' else name for name in kept)}")
        return lines


def starter_of(order: int) -> RungeKutta:
    """What begins an explicit method: rk4, or extrapolation of the next even order."""
    return RK4 if order <= 4 else extrapolated_midpoint(order + order % 2)


def closed(step: StepLines, count: int) -> tuple[list[str], list[str]]:
    """Append the line of the quadratures' rates at the step's end; return the rates to remember, and the increments.

    The increments are integrals over the step, from these rates and those of ``count - 1`` earlier times.
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
