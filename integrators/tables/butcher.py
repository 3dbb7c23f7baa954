"""Functions that compute Butcher tables, and polynomials of dense output, from few coefficients or by extrapolation."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from math import comb, isqrt, prod

from integrators.families.runge_kutta import RungeKutta
from integrators.method import MethodError, exact, total
from integrators.steps.continuous import Extension

Polynomial = tuple[Fraction, ...]


def row(whole: int | str | Fraction, *others: int | str | Fraction) -> tuple[Fraction, ...]:
    """Return a row of coefficients with the given sum: ``whole`` minus the sum of the ``others``, then the ``others``.

    ``row("3/4", 0, "3/4")`` is the row of a Butcher table at the node 3/4 without its zeros at the end.
    """
    rest = exact(*others)
    return (Fraction(whole) - total(rest), *rest)


def triangle(*rows: tuple[Fraction, ...]) -> tuple[tuple[Fraction, ...], ...]:
    """Return an explicit method's square Butcher table from its rows after the first, filled with zeros."""
    return tuple((*line, *[Fraction(0)] * (len(rows) + 1 - len(line))) for line in ((), *rows))


def root(value: int | Fraction, digits: int = 60) -> Fraction:
    """Return the square root of a non-negative number, rounded down to this many decimal places."""
    square = Fraction(value) * 100**digits
    return Fraction(isqrt(square.numerator // square.denominator), 10**digits)


def cube_root(value: int, digits: int = 60) -> Fraction:
    """Return the cube root of a non-negative whole number, rounded down to this many decimal places."""
    target, low, high = value * 1000**digits, 0, (value + 1) * 10**digits
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if middle**3 <= target else (low, middle)
    return Fraction(low, 10**digits)


def at_zero(nodes: Sequence[Fraction]) -> tuple[Fraction, ...]:
    """Return the Lagrange polynomials of the nodes at 0: the weights that extrapolate from the nodes to 0."""
    return tuple(prod((other / (other - node) for other in nodes if other != node), start=Fraction(1))
                 for node in nodes)


def bernstein(*powers: Fraction) -> Polynomial:
    """Return the Bernstein coefficients 1 to n of a polynomial without a constant term.

    The arguments are its coefficients of theta, ..., theta**n.
    """
    n = len(powers)
    terms = [power / comb(n, k) for k, power in enumerate(powers, 1)]
    return tuple(total(comb(j, k) * x for k, x in enumerate(terms[:j], 1)) for j in range(1, n + 1))


def smooth(
    order: int, b: Sequence[Fraction], end: int, inner: Sequence[Polynomial], source: str,
    further: Sequence[tuple[Fraction, ...]] = (),
) -> Extension:
    """Return polynomials of dense output whose derivative at both ends of the step is the slope there.

    It is the slope of the first stage at 0, and that of stage ``end`` at 1. The polynomials have the values ``b`` at 1.
    ``inner`` holds their other Bernstein coefficients, three fewer than the degree; () means zeros. If the method has
    no stage at the end of the step, that stage is added before the stages ``further``.
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
    """Return polynomials of dense output, by integrating the polynomial through the slopes at the nodes c.

    ``b_i`` is the integral of the Lagrange polynomial for the node ``c_i``.
    """
    polynomials = []
    for i, node in enumerate(c):
        lagrange = [Fraction(1)]
        for other in (*c[:i], *c[i + 1 :]):
            scale = node - other
            zero = Fraction(0)
            lagrange = [(x - other * y) / scale for x, y in zip([zero, *lagrange], [*lagrange, zero], strict=True)]
        polynomials.append(bernstein(*(x / k for k, x in enumerate(lagrange, 1))))
    return Extension(order, tuple(polynomials), source)


@lru_cache(maxsize=16)
def extrapolated_midpoint(order: int) -> RungeKutta:
    """Return the Runge-Kutta table of the explicit midpoint rule in 2, 4, ..., ``order`` parts, extrapolated.

    With ``n`` parts ``y_1 = y + (h/n) f(y)`` and ``y_(m+1) = y_(m-1) + 2 (h/n) f(y_m)``. For even ``n`` the error of
    ``y_n`` has only even powers of ``1/n`` (Gragg 1965). The ``s = order/2`` results, with the weights
    ``prod_k n_i**2/(n_i**2 - n_k**2)`` of Aitken and Neville, cancel ``s - 1`` of them. The table has ``1 + s**2``
    stages.

    Raises MethodError unless the order is even and at least 2.
    """
    if order < 2 or order % 2:
        raise MethodError(f"The extrapolated midpoint rule needs an even order of at least 2, not {order}.")
    parts = [2 * i for i in range(1, order // 2 + 1)]
    count = 1 + sum(n - 1 for n in parts)
    rows = [[Fraction(0)] * count]
    b = [Fraction(0)] * count
    for n in parts:
        share = prod((Fraction(n * n, n * n - k * k) for k in parts if k != n), start=Fraction(1))
        first = len(rows)
        places = [0, *range(first, first + n - 1)]
        for m in range(1, n + 1):
            line = [Fraction(0)] * count
            for j in range(m - 1, -1, -2):
                line[places[j]] = Fraction(2 if j else 1, n)
            if m < n:
                rows.append(line)
            else:
                b = [x + share * y if y else x for x, y in zip(b, line, strict=True)]
    return RungeKutta(
        name=f"extrapolated_midpoint{order}",
        order=order,
        source="Gragg 1965, SIAM J. Numer. Anal. 2, 384; Hairer, Norsett & Wanner 1993, II.9",
        summary=f"explicit midpoint rule in 2, 4, ..., {order} parts, extrapolated",
        a=tuple(map(tuple, rows)),
        b=tuple(b),
    )
