"""Methods with a memory: what linear multistep methods share.

Memory holds velocities and accelerations of earlier steps, or gains over earlier steps, and no angles: whole turns may
be taken off an angle between two steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import prod
from typing import ClassVar

from integrators.method import Method, RungeKutta
from integrators.tables.extrapolation import extrapolated_midpoint
from integrators.tables.runge_kutta import EXPLICIT

Polynomial = tuple[Fraction, ...]
"""Coefficients, that of the lowest power first."""
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
    """A method that goes on from several earlier steps.

    Under steady steps ``y' = w y/h``, or ``q'' = w**2 q/h**2`` where ``power`` is 2, has the solutions ``x**n``, x the
    roots of ``sum_m w**(power m) characteristic[m](x)`` (Hairer, Norsett & Wanner 1993, III.3 and III.10).
    """

    family: ClassVar[str] = "multistep"
    power: ClassVar[int] = 1

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
    def past(self) -> int:
        """How many earlier steps it goes on from."""
        raise NotImplementedError

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        """See the class."""
        raise NotImplementedError

    @property
    def characteristic_of_drag(self) -> tuple[Polynomial, ...]:
        """The same for ``v' = w v/h`` where that is another equation, in powers of w."""
        return self.characteristic


@dataclass(frozen=True, kw_only=True)
class Started(Multistep):
    """One whose earlier steps a one-step method takes.

    Attributes:
        starter: that method. Where it does not go ``forwards``, steps of it backwards begin, so that all steps from the
            first are the method's own.
    """

    starter: RungeKutta

    forwards: ClassVar[bool] = False

    @property
    def beginning(self) -> int:
        return self.past * (self.starter.evaluations + 1)


def starter_of(order: int) -> RungeKutta:
    """What begins an explicit method: rk4, or extrapolation of the next even order."""
    return RK4 if order <= 4 else extrapolated_midpoint(order + order % 2)
