"""Shorthand for Butcher tables and for the polynomials of their dense output."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb, isqrt

from integrators.method import exact
from integrators.steps.continuous import Extension

Polynomial = tuple[Fraction, ...]


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


def bernstein(*powers: Fraction) -> Polynomial:
    """The polynomial with these coefficients of theta, theta**2, ... in Bernstein's of degree n: those of 1 to n."""
    n = len(powers)
    terms = [power / comb(n, k) for k, power in enumerate(powers, 1)]
    return tuple(sum((comb(j, k) * x for k, x in enumerate(terms[:j], 1)), Fraction(0)) for j in range(1, n + 1))


def smooth(
    order: int, b: Sequence[Fraction], end: int, inner: Sequence[Polynomial], source: str,
    further: Sequence[tuple[Fraction, ...]] = (),
) -> Extension:
    """Polynomials that begin with the slope of the first stage, and end in ``b`` with that of stage ``end``.

    ``inner`` are their other coefficients in Bernstein's form, three less than the degree; () for zeros. A stage at the
    end that is none of the method's own is the first of those that follow, before ``further``.
    """
    degree = max(map(len, inner)) + 3
    last = [*b, *[Fraction(0)] * (len(inner) - len(b))]
    polynomials = tuple(
        (Fraction(i == 0, degree), *(middle or exact(*[0] * (degree - 3))), x - Fraction(i == end, degree), x)
        for i, (x, middle) in enumerate(zip(last, inner, strict=True))
    )
    rows = [tuple(b), *further] if end == len(b) else further
    filled = ((*line, *[Fraction(0)] * (len(b) + i - len(line))) for i, line in enumerate(rows))
    return Extension(order, polynomials, source, tuple(filled))


def interpolating(order: int, c: Sequence[Fraction], source: str) -> Extension:
    """The integral of the polynomial through the slopes at the nodes c: ``b_i`` is that of Lagrange's for ``c_i``."""
    found = []
    for i, node in enumerate(c):
        lagrange = [Fraction(1)]
        for other in (*c[:i], *c[i + 1 :]):
            scale = node - other
            zero = Fraction(0)
            lagrange = [(x - other * y) / scale for x, y in zip([zero, *lagrange], [*lagrange, zero], strict=True)]
        found.append(bernstein(*(x / k for k, x in enumerate(lagrange, 1))))
    return Extension(order, tuple(found), source)
