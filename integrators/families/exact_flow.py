"""The exact solution as a method, for problems with a solution in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from integrators.method import Method, Polynomial
from integrators.steps.terms import Notation, definition


@dataclass(frozen=True, kw_only=True)
class Exact(Method):
    """The exact solution as a method of infinite order: a step is one call of ``System.exact_flow``."""

    order: int = math.inf  # type: ignore[assignment]

    family: ClassVar[str] = "exact"

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "exact_flow"})

    @property
    def evaluations(self) -> int:
        return 1

    @property
    def symplectic(self) -> bool:
        """True, as the exact flow of a Hamiltonian system preserves areas in phase space (Poincaré 1899)."""
        return True

    @property
    def symmetric(self) -> bool:
        return True

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        return ("exact_flow",)

    def oscillator_matrix(self, terms: int) -> tuple[Polynomial, ...]:
        return rotation(terms)

    def write_step(self, notation: Notation) -> str:
        """Return the source of ``step``, which only calls the problem's ``exact_flow``.

        That function also returns the increments of the quadratures (integrals carried along the step, such as work).
        """
        results = ", ".join(["q", "v", *notation.quadratures])
        lines = [f"{results} = exact_flow(t, q, v, h{notation.more})", f"return {results}"]
        return definition(f"step(t, q, v, h{notation.more})", self.title, lines)


EXACT = (
    Exact(
        name="exact",
        a_stable=True,
        source="Whittaker 1937, Analytical Dynamics, chapter 4; Landau & Lifshitz 1976, Mechanics, section 25",
        summary="the solution in closed form, for scenes that have one: trigonometric or elliptic functions",
    ),
)


def rotation(terms: int) -> tuple[Polynomial, ...]:
    """Return the exact flow of ``q'' = -q``, a matrix of cosines and sines, as power series with ``terms`` terms."""
    powers = [Fraction((-1) ** (k // 2), math.factorial(k)) for k in range(terms)]
    cos, sin = (tuple(x if k % 2 == odd else Fraction(0) for k, x in enumerate(powers)) for odd in range(2))
    return cos, sin, tuple(-x for x in sin), cos


def oscillator_flow(square: float, gamma: float) -> Callable[[float, float, float, float], tuple[float, float]]:
    """Return the function ``exact_flow(t, q, v, h)`` of the damped oscillator ``q'' + gamma q' + square q = 0``.

    It is right for weak, critical and strong damping, without cancellation near critical damping (Landau & Lifshitz
    1976, Mechanics, section 25).

    Args:
        square: the square of the undamped angular frequency, not negative.
        gamma: the damping rate, not negative.
    """
    d, w = 0.5 * gamma, math.sqrt(square)
    apart = (w - d) * (w + d)
    n = math.sqrt(abs(apart))
    slow = 0.0 if apart > 0.0 or not d + n else square / (d + n)

    def flow(t: float, q: float, v: float, h: float) -> tuple[float, float]:
        if apart > 0.0:
            factor, risen = math.exp(-d * h), math.sin(n * h) / n
            plus, minus = math.cos(n * h) + d * risen, math.cos(n * h) - d * risen
        else:
            factor, risen = math.exp(-slow * h), -math.expm1(-2.0 * n * h) / (2.0 * n) if n else h
            plus, minus = 1.0 + slow * risen, math.exp(-2.0 * n * h) - slow * risen
        return factor * (q * plus + v * risen), factor * (v * minus - square * q * risen)

    return flow
