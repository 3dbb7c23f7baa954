"""Truncated power series with exact rational coefficients, which steps of methods can use like numbers.

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
"""Coefficients up to this size count as zero: they are the rounding of a method's table."""


@dataclass(frozen=True)
class PowerSeries:
    """Truncated power series ``sum_k c[k] z**k``; the operands of an operation must have the same number of terms."""

    c: tuple[Fraction, ...]

    @classmethod
    def of(cls, value: Rational, terms: int) -> PowerSeries:
        """Return the power series ``[value, 0, 0, ...]`` of a constant, with ``terms`` coefficients."""
        return cls((Fraction(value), *[Fraction(0)] * (terms - 1)))

    @classmethod
    def variable(cls, terms: int) -> PowerSeries:
        """Return the power series ``[0, 1, 0, ...]`` of the variable z, with ``terms >= 2`` coefficients."""
        return cls((Fraction(0), Fraction(1), *[Fraction(0)] * (terms - 2)))

    def _lift(self, other: PowerSeries | Rational) -> PowerSeries:
        """Convert a number to a constant power series with as many terms as this one; return a series unchanged."""
        return other if isinstance(other, PowerSeries) else PowerSeries.of(other, len(self.c))

    def __add__(self, other: PowerSeries | Rational) -> PowerSeries:
        pairs = zip(self.c, self._lift(other).c, strict=True)
        return PowerSeries(tuple(x + y if x and y else x or y for x, y in pairs))

    def __neg__(self) -> PowerSeries:
        return PowerSeries(tuple(-x if x else x for x in self.c))

    def __sub__(self, other: PowerSeries | Rational) -> PowerSeries:
        return self + -self._lift(other)

    def __rsub__(self, other: Rational) -> PowerSeries:
        return -self + other

    def __mul__(self, other: PowerSeries | Rational) -> PowerSeries:
        if not isinstance(other, PowerSeries):
            return PowerSeries(tuple(x * other if x else x for x in self.c))
        c = [Fraction(0)] * len(self.c)
        factors = [(j, y) for j, y in enumerate(other.c) if y]
        for i, x in enumerate(self.c):
            if x:
                for j, y in factors:
                    if i + j < len(c):
                        c[i + j] += x * y
        return PowerSeries(tuple(c))

    __radd__ = __add__
    __rmul__ = __mul__

    def __truediv__(self, other: PowerSeries | Rational) -> PowerSeries:
        """Return the quotient of power series; raises ZeroDivisionError if the divisor's constant term is zero."""
        if not isinstance(other, PowerSeries):
            return PowerSeries(tuple(x / other if x else x for x in self.c))
        divisor, c = other.c, [Fraction(0)] * len(self.c)
        for k, x in enumerate(self.c):
            c[k] = (x - sum(c[i] * divisor[k - i] for i in range(k))) / divisor[0]
        return PowerSeries(tuple(c))

    def sqrt(self) -> PowerSeries:
        """Return the square root of a power series whose constant term is 1.

        Raises ValueError for another constant term.
        """
        if self.c[0] != 1:
            raise ValueError(f"The square root of a power series needs the constant term 1, not {self.c[0]}.")
        c = [Fraction(1)] + [Fraction(0)] * (len(self.c) - 1)
        for k in range(1, len(c)):
            c[k] = (self.c[k] - sum(c[i] * c[k - i] for i in range(1, k))) / 2
        return PowerSeries(tuple(c))

    def derivative(self) -> PowerSeries:
        """Return the derivative of a power series by z.

        Its last coefficient, which truncation makes unknown, is set to zero.
        """
        return PowerSeries((*(k * x for k, x in enumerate(self.c) if k), Fraction(0)))

    def integral(self) -> PowerSeries:
        """Return the antiderivative of a power series that vanishes at z = 0."""
        return PowerSeries((Fraction(0), *(x / (k + 1) for k, x in enumerate(self.c[:-1]))))

    def over_z(self, power: int = 1) -> PowerSeries:
        """Return a power series divided by ``z**power``; it is ``power`` terms shorter.

        Raises ValueError if a term below ``z**power`` is not zero.
        """
        if any(self.c[:power]):
            raise ValueError(f"The power series has terms below z**{power}, so it cannot be divided by z**{power}.")
        return PowerSeries(self.c[power:])

    def head(self, terms: int) -> PowerSeries:
        """Return the power series truncated to its first ``terms`` terms."""
        return PowerSeries(self.c[:terms])

    def leading(self, least: Fraction = ROUNDING) -> tuple[Fraction, int] | None:
        """Return coefficient and power of the first term larger than ``least`` in size; None if there is none."""
        return next(((x, k) for k, x in enumerate(self.c) if abs(x) > least), None)


def sine(terms: int) -> PowerSeries:
    """Return the power series of ``sin z`` with ``terms`` terms."""
    return PowerSeries(tuple(Fraction((-1) ** (k // 2) * (k % 2), factorial(k)) for k in range(terms)))


def cosine(terms: int) -> PowerSeries:
    """Return the power series of ``cos z`` with ``terms`` terms."""
    return PowerSeries(tuple(Fraction((-1) ** (k // 2) * (1 - k % 2), factorial(k)) for k in range(terms)))


def horner(coefficients: Sequence[Any], x: Any) -> Any:
    """Return the polynomial ``sum_k c[k] x**k`` by Horner's scheme, for any type of numbers."""
    total = x - x
    for c in reversed(coefficients):
        total = total * x + c
    return total
