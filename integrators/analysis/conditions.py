"""Residuals of the order conditions, order by order, of any method that states its coefficients."""

from __future__ import annotations

from integrators.analysis.multistep_linear import order_defects
from integrators.analysis.nystrom_trees import nystrom_conditions
from integrators.analysis.splitting_conditions import violations
from integrators.analysis.trees import order_conditions
from integrators.method import Method, MethodError
from integrators.registry import named


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
    if not any(coefficients):
        raise MethodError(
            f"{chosen.name} states no coefficients that have order conditions; measure its order with observed_order.")
    highest = chosen.order + 1 if order is None else order
    if chosen.sub_flows:
        return tuple(max(violations(chosen, size)) for size in range(1, highest + 1))
    if chosen.characteristic:
        return tuple(float(abs(defect)) for defect in order_defects(chosen, highest))
    conditions = order_conditions(chosen, highest) if chosen.tableau else nystrom_conditions(chosen, highest)
    return tuple(float(max(abs(x.defect) for x in conditions if x.order == size)) for size in range(1, highest + 1))
