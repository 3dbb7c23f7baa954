"""Continuous extensions of Runge-Kutta steps: polynomials over the stages, for dense output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction


@dataclass(frozen=True)
class Extension:
    """Polynomials that make a Runge-Kutta step continuous (Hairer, Norsett & Wanner 1993, section II.6)::

        q(t + theta h) = q + h sum_i b_i(theta) V_i        v(t + theta h) = v + h sum_i b_i(theta) K_i

    Attributes:
        order: the errors between the ends of a step are O(h**(order + 1)).
        b: for every stage, the coefficients of its polynomial in Bernstein's form of degree n, from the first to the
            n-th: ``b_i(theta) = sum_j b_ij comb(n, j) theta**j (1 - theta)**(n - j)``, so that the last is ``b_i(1)``.
        source: author, year and page or equation of the publication.
        a: rows of further stages; a row has one coefficient for every stage before it.
    """

    order: int
    b: tuple[tuple[Fraction, ...], ...]
    source: str
    a: tuple[tuple[Fraction, ...], ...] = ()

    def used(self, stages: int) -> tuple[Fraction, ...]:
        """Return a row with one entry per stage of a method: 1 if dense output needs the stage, else 0."""
        return tuple(Fraction(any(self.b[i]) or any(row[i] for row in self.a)) for i in range(stages))

    def fault(self, b: Sequence[Fraction], allowed: Fraction) -> str:
        """Return a sentence on the first contradiction between the polynomials and a method's weights b, or "".

        Args:
            b: the weights of the method.
            allowed: the largest difference between b and the polynomials at the end of the step.
        """
        lengths = [len(row) for row in self.a]
        if lengths != list(range(len(b), len(b) + len(self.a))) or len(self.b) != len(b) + len(self.a):
            return "dense must have a polynomial for each stage, and rows over all stages before"
        if len({len(row) for row in self.b}) != 1:
            return "the polynomials of dense must be of one degree"
        ends = (*b, *[Fraction(0)] * len(self.a))
        if any(abs(row[-1] - end) > allowed for row, end in zip(self.b, ends, strict=True)):
            return "the polynomials of dense must end in b; with other weights, dense is to be others or None"
        return ""

    @property
    def ends(self) -> tuple[Fraction, ...]:
        """The weights ``b_i(1)`` of dense output at the end of the step: the method's, and zero for further stages."""
        return tuple(row[-1] for row in self.b)
