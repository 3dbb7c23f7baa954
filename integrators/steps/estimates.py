"""Steps of embedded pairs that also return what they are compared with, as source.

::

    step(t, q, v, a, *rates, h, *extra)  ->  (q, v, a, *rates, *increments, *errors)

``a`` and the quadratures' ``rates`` are those at the start of the step, then those at its end: a step that is rejected
and tried again shorter, or followed by another, asks for them once. ``errors`` are the result minus each embedded one,
first in q and then in v, in the order of ``embedded``.
"""

from __future__ import annotations

from integrators.method import Method, MethodError


def has_estimates(method: Method) -> bool:
    """True for an explicit method with embedded weights, and for Taylor series."""
    return bool(method.embedded_orders)


def check_estimates(method: Method) -> None:
    """Raise MethodError for a method without estimates."""
    if not has_estimates(method):
        raise MethodError(f"{method.name} has no embedded weights that would estimate its error.")


def embedded_orders(method: Method) -> tuple[int, ...]:
    """Orders of the results that a method's own is compared with; of a Taylor series that with one term less."""
    return method.embedded_orders


def evaluations_tried(method: Method) -> int:
    """Evaluations of one step with its estimates and the slope at its end, which a Taylor series does not ask for."""
    return method.evaluations_tried


def order_of_estimate(method: Method) -> int:
    """The power of h that the estimated error goes with: p + 1 for an embedded result of order p.

    Of two of orders p and r, ``E_p**2/sqrt(E_p**2 + E_r**2/100)`` goes with 2(p + 1) - (r + 1).
    Raises MethodError for a method without estimates.
    """
    check_estimates(method)
    orders = [order + 1 for order in method.embedded_orders]
    return orders[0] if len(orders) == 1 else 2 * orders[0] - orders[1]
