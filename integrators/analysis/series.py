"""Truncated power series with exact rational coefficients: numbers that a step can be taken with.

A step on a linear problem with ``h`` replaced by the series ``z`` yields the step's matrix as series in z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial
from typing import Any

Rational = int | Fraction
ROUNDING = Fraction(1, 10**24)
"""Coefficients below this are taken for what a table of rounded numbers leaves of zero."""


@dataclass(frozen=True)
class Series:
    """``sum_k c[k] z**k`` without what lies beyond its last term; all operands must be of one length."""

    c: tuple[Fraction, ...]

    @classmethod
    def of(cls, value: Rational, terms: int) -> Series:
        """The constant ``value``, to ``terms`` terms."""
        return cls((Fraction(value), *[Fraction(0)] * (terms - 1)))

    @classmethod
    def variable(cls, terms: int) -> Series:
        """``z`` itself, to ``terms >= 2`` terms."""
        return cls((Fraction(0), Fraction(1), *[Fraction(0)] * (terms - 2)))

    def _lift(self, other: Series | Rational) -> Series:
        return other if isinstance(other, Series) else Series.of(other, len(self.c))

    def __add__(self, other: Series | Rational) -> Series:
        return Series(tuple(x + y if x and y else x or y for x, y in zip(self.c, self._lift(other).c, strict=True)))

    def __neg__(self) -> Series:
        return Series(tuple(-x if x else x for x in self.c))

    def __sub__(self, other: Series | Rational) -> Series:
        return self + -self._lift(other)

    def __rsub__(self, other: Rational) -> Series:
        return -self + other

    def __mul__(self, other: Series | Rational) -> Series:
        if not isinstance(other, Series):
            return Series(tuple(x * other if x else x for x in self.c))
        c = [Fraction(0)] * len(self.c)
        factors = [(j, y) for j, y in enumerate(other.c) if y]
        for i, x in enumerate(self.c):
            if x:
                for j, y in factors:
                    if i + j < len(c):
                        c[i + j] += x * y
        return Series(tuple(c))

    __radd__ = __add__
    __rmul__ = __mul__

    def __truediv__(self, other: Series | Rational) -> Series:
        """Quotient; raises ZeroDivisionError where the divisor's constant term is zero."""
        if not isinstance(other, Series):
            return Series(tuple(x / other if x else x for x in self.c))
        divisor, c = other.c, [Fraction(0)] * len(self.c)
        for k, x in enumerate(self.c):
            c[k] = (x - sum(c[i] * divisor[k - i] for i in range(k))) / divisor[0]
        return Series(tuple(c))

    def sqrt(self) -> Series:
        """The root with constant term 1; raises ValueError unless the series' own is 1."""
        if self.c[0] != 1:
            raise ValueError(f"Only series that begin with 1 have a root here, not with {self.c[0]}.")
        c = [Fraction(1)] + [Fraction(0)] * (len(self.c) - 1)
        for k in range(1, len(c)):
            c[k] = (self.c[k] - sum(c[i] * c[k - i] for i in range(1, k))) / 2
        return Series(tuple(c))

    def derivative(self) -> Series:
        """d/dz; the last term, which the truncation hides, is left zero."""
        return Series((*(k * x for k, x in enumerate(self.c) if k), Fraction(0)))

    def integral(self) -> Series:
        """The antiderivative that vanishes at zero."""
        return Series((Fraction(0), *(x / (k + 1) for k, x in enumerate(self.c[:-1]))))

    def over_z(self, power: int = 1) -> Series:
        """``self / z**power``, shorter by ``power`` terms; raises ValueError where that leaves a pole."""
        if any(self.c[:power]):
            raise ValueError(f"The series does not begin with z**{power}.")
        return Series(self.c[power:])

    def head(self, terms: int) -> Series:
        """The first ``terms`` terms."""
        return Series(self.c[:terms])

    def leading(self, least: Fraction = ROUNDING) -> tuple[Fraction, int] | None:
        """Coefficient and power of the first term above ``least``; None if there is none."""
        return next(((x, k) for k, x in enumerate(self.c) if abs(x) > least), None)


def sine(terms: int) -> Series:
    """``sin z`` to ``terms`` terms."""
    return Series(tuple(Fraction((-1) ** (k // 2) * (k % 2), factorial(k)) for k in range(terms)))


def cosine(terms: int) -> Series:
    """``cos z`` to ``terms`` terms."""
    return Series(tuple(Fraction((-1) ** (k // 2) * (1 - k % 2), factorial(k)) for k in range(terms)))


def horner(coefficients: Sequence[Any], x: Any) -> Any:
    """``sum_k c[k] x**k`` in any numbers."""
    total = x - x
    for c in reversed(coefficients):
        total = total * x + c
    return total
