"""Shorthand for Butcher tables."""

from __future__ import annotations

from fractions import Fraction
from math import isqrt

from integrators.method import exact


def row(total: int | str | Fraction, *others: int | str | Fraction) -> tuple[Fraction, ...]:
    """Coefficients that sum to ``total``: the first is what the ``others`` leave of it.

    ``row("3/4", 0, "3/4")`` is the row of a Butcher table at the node 3/4 without its zeros at the end.
    """
    rest = exact(*others)
    return (Fraction(total) - sum(rest), *rest)


def triangle(*rows: tuple[Fraction, ...]) -> tuple[tuple[Fraction, ...], ...]:
    """The square table of an explicit method from its rows after the first, filled up with zeros."""
    return tuple((*line, *[Fraction(0)] * (len(rows) + 1 - len(line))) for line in ((), *rows))


def root(value: int | Fraction, digits: int = 60) -> Fraction:
    """The square root of a number that is not negative, to this many decimal places."""
    square = Fraction(value) * 100**digits
    return Fraction(isqrt(square.numerator // square.denominator), 10**digits)
