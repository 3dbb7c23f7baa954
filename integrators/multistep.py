"""Methods with a memory: linear multistep methods for ``y' = f`` and for ``q'' = f``, by their coefficients.

Memory holds velocities and accelerations of earlier steps, or gains over earlier steps, and no angles: whole turns may
be taken off an angle between two steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from math import prod
from typing import ClassVar

from integrators.method import Method, MethodError, RungeKutta

Polynomial = tuple[Fraction, ...]
"""Coefficients, that of the lowest power first."""


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
        starter: that method. Explicit ones begin with steps of it backwards, so that all steps from the first are
            their own.
    """

    starter: RungeKutta

    @property
    def beginning(self) -> int:
        return self.past * (self.starter.evaluations + 1)


@dataclass(frozen=True, kw_only=True)
class Adams(Started):
    """``y1 = y + h sum_j b_j f_(n-j)``; with a corrector that is the predictor, at which f is asked for again.

    Then ``y1 = y + h (corrector_0 f(predicted) + sum_j corrector_(j+1) f_(n-j))``, with f at ``y1`` remembered (PECE).
    Raises MethodError if the weights do not sum to one.
    """

    b: tuple[Fraction, ...]
    corrector: tuple[Fraction, ...] = ()

    def __post_init__(self) -> None:
        for label, row in (("b", self.b), ("corrector", self.corrector)):
            if row and sum(row) != 1:
                raise MethodError(f"{self.name}: the weights {label} sum to {sum(row)}, not to 1.")

    @property
    def memory(self) -> tuple[str, ...]:
        return self.memory_with()

    def memory_with(self, quadratures: Sequence[str] = ()) -> tuple[str, ...]:
        return ago(("v", "a", *quadratures), range(1, self.past + 1))

    @property
    def past(self) -> int:
        return max(len(self.b) - 1, len(self.corrector) - 2)

    @property
    def evaluations(self) -> int:
        return 2 if self.corrector else 1

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        k = self.past
        top = [Fraction(0)] * (k + 2)
        top[k + 1], top[k] = Fraction(1), Fraction(-1)
        if not self.corrector:
            return tuple(top), _powers(self.b, k)
        last, *rest = self.corrector
        once = list(_powers(rest, k))
        once[k] -= last
        return tuple(top), tuple(once), tuple(last * x for x in _powers(self.b, k))


def _powers(row: Sequence[Fraction], highest: int) -> Polynomial:
    """``- sum_j row_j x**(highest - j)``."""
    found = [Fraction(0)] * (highest + 1)
    for j, value in enumerate(row):
        found[highest - j] -= value
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class BackwardDifference(Started):
    """``sum_j alpha_j y_(n+1-j) = h f_(n+1)``, in gains of earlier steps: one equation for the new acceleration.

    Its first steps are taken by the starter, forwards: backwards damping grows beyond all bounds. The memory counts
    them. Raises MethodError if it is not consistent.
    """

    alpha: tuple[Fraction, ...]

    def __post_init__(self) -> None:
        if sum(self.alpha) or sum(-j * x for j, x in enumerate(self.alpha)) != 1:
            raise MethodError(f"{self.name}: sum_j alpha_j must be 0 and sum_j -j alpha_j 1.")

    @property
    def memory(self) -> tuple[str, ...]:
        return self.memory_with()

    def memory_with(self, quadratures: Sequence[str] = ()) -> tuple[str, ...]:
        gains = (f"{name}{i}_gain" for name in ("q", "v", *quadratures) for i in range(1, self.past + 1))
        return ("begun", *gains)

    @property
    def past(self) -> int:
        return len(self.alpha) - 2

    @property
    def implicit(self) -> bool:
        return True

    @property
    def beginning(self) -> int:
        """What the starter asks for above the method itself, without Newton's sweeps."""
        return self.past * (self.starter.evaluations - 1)

    @property
    def share(self) -> Fraction:
        """The new slope's weight in the new gain."""
        return 1 / self.alpha[0]

    @property
    def gains(self) -> tuple[Fraction, ...]:
        """The weights of the earlier gains in the new one, the last one's first."""
        return tuple(-x / self.alpha[0] for x in list(accumulate(self.alpha))[1:-1])

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        k = len(self.alpha) - 1
        return self.alpha[::-1], (*[Fraction(0)] * k, Fraction(-1))


@dataclass(frozen=True, kw_only=True)
class SecondOrder(Started):
    """``sum_j alpha_j q_(n+1-j) = h**2 sum_j beta_j f_(n+1-j)`` for forces free of the velocity.

    It is summed once: mean velocities ``u = (q_n - q_(n-1))/h`` are added up, not angles, so that rounding does not grow
    (Henrici 1962, section 6.4). The velocity is the last mean and a quadrature of earlier accelerations,
    ``v = u + h sum_j c_j f_(n-j)``. Raises MethodError if it is not consistent.
    """

    alpha: tuple[Fraction, ...]
    beta: tuple[Fraction, ...]
    power: ClassVar[int] = 2

    def __post_init__(self) -> None:
        moments = [sum((x * (-j) ** m for j, x in enumerate(self.alpha)), Fraction(0)) for m in range(3)]
        if self.alpha[0] != 1 or moments[0] or moments[1] or moments[2] != 2 * sum(self.beta):
            raise MethodError(f"{self.name}: alpha must begin with 1 and have the moments 0, 0 and 2 sum(beta).")

    @property
    def needs(self) -> frozenset[str]:
        return super().needs | {"velocity_free"}

    @property
    def memory(self) -> tuple[str, ...]:
        return self.memory_with()

    def memory_with(self, quadratures: Sequence[str] = ()) -> tuple[str, ...]:
        means = ago(("u",), range(1, len(self.alpha) - 2))
        return ("a", *ago(("a",), range(1, self.past + 1)), *means, *ago(quadratures, range(self.past + 1)))

    @property
    def past(self) -> int:
        used = max(j for j, x in enumerate(self.beta) if x)
        return max(used - 1, len(self.alpha) - 2, self.order - 2)

    @property
    def implicit(self) -> bool:
        return self.beta[0] != 0

    @property
    def beginning(self) -> int:
        return 1 + super().beginning

    @property
    def symmetric(self) -> bool:
        """True if steps run backwards obey the same equation: coefficients that read the same from both ends."""
        length = len(self.alpha)
        beta = (*self.beta, *[Fraction(0)] * (length - len(self.beta)))
        return self.alpha == self.alpha[::-1] and len(beta) == length and beta == beta[::-1]

    @property
    def means(self) -> tuple[Fraction, ...]:
        """The weights of earlier mean velocities in the new one, the last one's first."""
        return tuple(-x for x in list(accumulate(self.alpha))[1:-1])

    @cached_property
    def velocity(self) -> tuple[Fraction, ...]:
        """``c_j`` above."""
        return over_mean(self.past + 1)

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        used = max(len(self.alpha), 1 + max(j for j, x in enumerate(self.beta) if x))
        return _powers([-x for x in self.alpha], used - 1), _powers(self.beta[:used], used - 1)
