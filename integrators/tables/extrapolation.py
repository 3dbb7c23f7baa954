"""Explicit Runge-Kutta tables of any even order by extrapolation; they compute long histories of multistep methods."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from math import prod

from integrators.families.runge_kutta import RungeKutta
from integrators.method import MethodError


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
