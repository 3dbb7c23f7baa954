"""Steps with error estimates: which methods have them, and the orders of the results that are compared.

A step with estimates is a function::

    step(t, q, v, a, *rates, h, *extra)  ->  (q, v, a, *rates, *increments, *errors)

It takes the acceleration ``a`` and the quadratures' ``rates`` at the start of the step and returns those at its end, so
that a step which is rejected and repeated with a shorter h does not compute them again. A Taylor series needs neither;
it returns ``a`` and ``rates`` as they were given, those of the start. ``errors`` are the differences
between the result and the embedded results, first in q and then in v, in the order of ``embedded``.
"""

from __future__ import annotations

from integrators.method import Method, MethodError


def has_estimates(method: Method) -> bool:
    """Return True if a method can estimate its error: explicit with embedded weights, or a Taylor series."""
    return bool(method.embedded_orders)


def check_estimates(method: Method) -> None:
    """Raise MethodError if a method does not estimate its error."""
    if not has_estimates(method):
        raise MethodError(f"{method.name} has no embedded weights that would estimate its error.")


def embedded_orders(method: Method) -> tuple[int, ...]:
    """Return the orders of the embedded results with which a method compares its own to estimate the error.

    A Taylor series is compared with the series without its last term.
    """
    return method.embedded_orders


def evaluations_tried(method: Method) -> int:
    """Return the number of force evaluations of one step with error estimates.

    It includes the evaluation at the end of the step, if the step needs that.
    """
    return method.evaluations_tried


def order_of_estimate(method: Method) -> int:
    """Return the power of h to which the estimated error is proportional: p + 1 for an embedded result of order p.

    With two embedded results of orders p and r it is 2(p + 1) - (r + 1), that of ``E_p**2/sqrt(E_p**2 + E_r**2/100)``.
    Raises MethodError for a method without estimates.
    """
    check_estimates(method)
    orders = [order + 1 for order in method.embedded_orders]
    return orders[0] if len(orders) == 1 else 2 * orders[0] - orders[1]
