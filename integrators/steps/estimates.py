"""Steps of embedded pairs that also return what they are compared with, as source.

::

    step(t, q, v, a, *rates, h, *extra)  ->  (q, v, a, *rates, *increments, *errors)

``a`` and the quadratures' ``rates`` are those at the start of the step, then those at its end: a step that is rejected
and tried again shorter, or followed by another, asks for them once. ``errors`` are the result minus each embedded one,
first in q and then in v, in the order of ``embedded``.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from integrators.families.nystrom import Nystrom
from integrators.families.nystrom_steps import estimating_stages, estimating_step
from integrators.families.taylor import Taylor, taylor_step
from integrators.method import Method, MethodError, RungeKutta
from integrators.steps.terms import Number, combination, definition, plus, time_at


def embedded_orders(method: Method) -> tuple[int, ...]:
    """Orders of the results that a method's own is compared with; of a Taylor series that with one term less."""
    if isinstance(method, Taylor):
        return (method.order - 1,)
    if isinstance(method, (RungeKutta, Nystrom)) and not method.implicit:
        return tuple(pair.order for pair in method.embedded)
    return ()


def has_estimates(method: Method) -> bool:
    """True for an explicit method with embedded weights, and for Taylor series."""
    return bool(embedded_orders(method))


def _check(method: Method) -> None:
    if not has_estimates(method):
        raise MethodError(f"{method.name} has no embedded weights that would estimate its error.")


def order_of_estimate(method: Method) -> int:
    """The power of h that the estimated error goes with: p + 1 for an embedded result of order p.

    Of two of orders p and r, ``E_p**2/sqrt(E_p**2 + E_r**2/100)`` goes with 2(p + 1) - (r + 1).
    Raises MethodError for a method without estimates.
    """
    _check(method)
    orders = [order + 1 for order in embedded_orders(method)]
    return orders[0] if len(orders) == 1 else 2 * orders[0] - orders[1]


def evaluations_tried(method: Method) -> int:
    """Evaluations of one step with its estimates and the slope at its end, which a Taylor series does not ask for."""
    if isinstance(method, Nystrom):
        return len(estimating_stages(method)) - method.first_same_as_last
    return len(_reached(method)) - method.first_same_as_last if isinstance(method, RungeKutta) else method.evaluations


def unroll_estimates(
    method: Method, quadratures: Sequence[str], extra: Sequence[str], number: Number, dense: bool = False
) -> str:
    """Source of ``step`` as above; with ``dense`` its stages come last, see :func:`stages_of`.

    Raises MethodError for a method without estimates.
    """
    _check(method)
    if isinstance(method, Nystrom):
        return estimating_step(method, quadratures, extra, number)
    more = "".join(f", {name}" for name in extra)
    if isinstance(method, Taylor):
        return taylor_step(method, quadratures, more, estimates=True)
    assert isinstance(method, RungeKutta)
    slope = "rates" if quadratures else "acceleration"
    stages = _reached(method, dense)
    kept = ["a", *quadratures]

    def state(weights: Sequence[Fraction], before: Sequence[int]) -> tuple[str, str]:
        shares = [weights[i] for i in before]
        q = plus("q", shares, [f"v{i + 1}" for i in before], number)
        return q, plus("v", shares, [f"a{i + 1}" for i in before], number)

    lines = ["v1 = v", *(f"{name}1 = {name}" for name in kept)]
    inner = stages[1:-1] if method.first_same_as_last else stages[1:]
    for i in inner:
        q, v = state(method.a[i], [j for j in stages if j < i])
        lines.append(f"v{i + 1} = {v}")
        found = ", ".join(f"{name}{i + 1}" for name in kept)
        lines.append(f"{found} = {slope}({time_at(method.c[i], number)}, {q}, v{i + 1}{more})")
    final = [i for i in stages if method.b[i]]
    lines += [f"{name}_end = {formula}" for name, formula in zip("qv", state(method.b, final), strict=True)]
    last = [f"{name}{stages[-1] + 1}" if method.first_same_as_last else f"{name}_end" for name in kept]
    lines.append(f"{', '.join(last)} = {slope}(t + h, q_end, v_end{more})")
    if method.first_same_as_last:
        lines.append(f"v{stages[-1] + 1} = v_end")
    sums = [f"h*({combination([method.b[i] for i in final], [f'{name}{i + 1}' for i in final], number)})"
            for name in quadratures]
    errors = []
    for pair in method.embedded:
        differences = [method.b[i] - pair.b[i] for i in stages]
        for letter in "va":
            errors.append(f"h*({combination(differences, [f'{letter}{i + 1}' for i in stages], number)})")
    inner_stages = stages_of(method, stages) if dense else []
    lines.append(f"return {', '.join(['q_end', 'v_end', *last, *sums, *errors, *inner_stages])}")
    signature = f"step(t, q, v, {', '.join(kept)}, h{more})"
    return definition(signature, f"{method.name}: {method.source}", lines)


def stages_of(method: RungeKutta, stages: Sequence[int]) -> list[str]:
    """All stages' velocities as one result, all their accelerations as another; None for those not taken."""
    every = range(len(method.b))
    return [f"({''.join(f'{y}{i + 1}, ' if i in stages else 'None, ' for i in every)})" for y in "va"]


def _reached(method: RungeKutta, dense: bool = False) -> list[int]:
    """Stages that the weights, those of an estimate or those of dense output reach; counted from zero."""
    further = (method.dense.used(len(method.b)),) if dense and method.dense is not None else ()
    return list(method.reached(method.b, *(pair.b for pair in method.embedded), *further))
