"""The order of dense output: from the conditions on trees for Runge-Kutta tables, and observed for every method."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb, lcm

from integrators.analysis.linear import named
from integrators.analysis.trees import Condition, density, elementary_weights
from integrators.method import Method, MethodError, RungeKutta
from integrators.solving.solve import solve


def dense_conditions(method: str | Method, order: int | None = None) -> tuple[Condition, ...]:
    """The conditions for all trees of at most ``order`` vertices on a table's dense output, in exact arithmetic.

    ``sum_i b_i(theta) Phi_i(t) = theta**n/gamma(t)`` for trees of n vertices (Hairer, Norsett & Wanner 1993,
    section II.6). The defect is the largest difference of the two polynomials' coefficients in Bernstein's form.

    Args:
        method: name or Method.
        order: the largest trees; None: the declared order of the dense output.

    Raises MethodError for an unknown name, or a method whose dense output does not come from a table.
    """
    chosen = named(method)
    extension = chosen.dense if isinstance(chosen, RungeKutta) else None
    if extension is None or not isinstance(chosen, RungeKutta):
        raise MethodError(f"{chosen.name}: dense output is Hermite interpolation, which has no conditions on trees.")
    largest = extension.order if order is None else order
    degree = max(largest, len(extension.b[0]))
    polynomials = [_elevated(row, degree) for row in extension.b]
    table = (*chosen.a, *extension.a)
    scale = lcm(*(x.denominator for row in (*table, *polynomials) for x in row))
    columns = [[int(x * scale) for x in column] for column in zip(*polynomials, strict=True)]
    found = []
    for tree, size, phi in elementary_weights(table, scale, largest):
        whole = comb(degree, size) * density(tree)
        defects = (
            Fraction(sum(x * y for x, y in zip(column, phi, strict=True)), scale**size) - Fraction(comb(j, size), whole)
            for j, column in enumerate(columns, 1)
        )
        found.append(Condition(tree, size, max(abs(defect) for defect in defects)))
    return tuple(found)


def _elevated(row: Sequence[Fraction], degree: int) -> tuple[Fraction, ...]:
    """The same polynomial in Bernstein's form of a higher degree (Farin 2002, section 6.1)."""
    while len(row) < degree:
        n, points = len(row) + 1, (Fraction(0), *row, Fraction(0))
        row = [Fraction(j, n) * points[j - 1] + Fraction(n - j, n) * points[j] for j in range(1, n + 1)]
    return tuple(row)


def observed_dense_order(
    method: str | Method, theta: float, *, damped: str | None = None, digits: int = 60
) -> float:
    """The order that dense output shows in one step on :func:`integrators.analysis.driven_pendulum`, at a share of it.

    One less than the slope of log error against log h, between a step so short that its error is about 1e-30, which
    stands out of the rounding of coefficients to 40 decimals, and its half.

    Args:
        method: name or Method.
        theta: where in the step, between 0 and 1.
        damped: None, "linear" or "quadratic".
        digits: decimal digits of the arithmetic.

    Raises MethodError for an unknown name or damping, or a method that cannot take this problem.
    """
    from integrators import analysis

    mpmath = analysis.mpmath_module()
    errors = []
    with mpmath.workdps(digits):
        t, q, v = (mpmath.mpf(x) for x in analysis.START)
        longest = 2.0 ** -(90 // (named(method).dense_order + 1))
        for h in (longest, longest / 2):
            way = solve(analysis.driven_pendulum(damped), q, v, [t, t + h], method=method, h=h, dense=True)
            found, truth = way(t + theta * h), analysis.reference(damped, digits, theta * h)
            errors.append(mpmath.hypot(found[0] - truth[0], found[1] - truth[1]))
        return float(mpmath.log(errors[0] / errors[1], 2)) - 1.0
