"""Residuals of the order conditions, order by order, of any method that states its coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

from integrators.analysis.multistep_linear import order_defects
from integrators.analysis.nystrom_trees import NystromCondition, nystrom_conditions
from integrators.analysis.splitting_conditions import violations
from integrators.analysis.trees import Condition, dense_conditions, order_conditions
from integrators.families.force_gradient import ForceGradient
from integrators.method import Method, MethodError
from integrators.registry import METHODS, named

HOLDS = 1e-7
"""Largest residual of an order condition that may be rounding, of coefficients given as floats or to seven digits."""


def order_residuals(method: str | Method, order: int | None = None) -> tuple[float, ...]:
    """Return the largest residual of a method's order conditions, for every order from 1 up to ``order``.

    A method has order p if the first p residuals vanish up to the rounding of its table. The conditions belong to
    rooted trees for a Butcher tableau, to Nyström trees for a Nyström tableau, to words or trees for a composition of
    flows, and to polynomials for a multistep method; see :class:`integrators.Method`.

    Args:
        method: name or Method.
        order: the highest order; None: one more than the method declares.

    Raises MethodError for an unknown name, and for a method without such coefficients. The order of such a method can
    be measured with :func:`integrators.analysis.measured.observed_order`.
    """
    chosen = named(method)
    coefficients = (chosen.tableau, chosen.nystrom_tableau, chosen.sub_flows, chosen.characteristic)
    if not any(coefficients) and not isinstance(chosen, ForceGradient):
        raise MethodError(
            f"{chosen.name} states no coefficients that have order conditions; measure its order with observed_order.")
    highest = chosen.order + 1 if order is None else order
    if chosen.sub_flows or isinstance(chosen, ForceGradient):
        return tuple(max(violations(chosen, size)) for size in range(1, highest + 1))
    if chosen.characteristic:
        return tuple(float(abs(defect)) for defect in order_defects(chosen, highest))
    conditions = order_conditions(chosen, highest) if chosen.tableau else nystrom_conditions(chosen, highest)
    return _by_order(conditions)


@lru_cache(maxsize=256)
def check_order(method: Method) -> None:
    """Raise MethodError if the coefficients of a method contradict the order that it declares.

    A condition holds if its residual is at most :data:`HOLDS`. The declared orders of embedded formulas and of dense
    output are checked, too. Methods that state no coefficients are left out, and so are those of
    :data:`integrators.METHODS`, which tests check to 33 digits.
    """
    if METHODS.get(method.name) is method:
        return
    for formula in method.formulas:
        try:
            residuals = order_residuals(formula, formula.order)
        except MethodError:  # no coefficients that have order conditions
            continue
        _check(formula.name, formula.order, residuals)
    if method.dense is not None and method.tableau is not None:
        _check(f"{method.name}, dense output", method.dense.order, _by_order(dense_conditions(method)))


def _check(name: str, order: int, residuals: Sequence[float]) -> None:
    """Raise MethodError if one of the residuals, for orders from 1 on, is more than :data:`HOLDS`."""
    reached = next((size for size, gap in enumerate(residuals) if not gap <= HOLDS), order)
    if reached < order:
        raise MethodError(
            f"{name}: the coefficients have order {reached}, not {order} as declared: a condition of order "
            f"{reached + 1} is off by {residuals[reached]:.2g}; correct the coefficients or declare order {reached}.")


def _by_order(conditions: Sequence[Condition | NystromCondition]) -> tuple[float, ...]:
    """Return the largest residual of the conditions of each order, from order 1 on."""
    return tuple(float(max(abs(x.defect) for x in conditions if x.order == size))
                 for size in range(1, max(x.order for x in conditions) + 1))
