"""Which of a problem's functions a method's step calls: the one place of the engine that asks a method's kind."""

from __future__ import annotations

from integrators import DiscreteGradient, Exact, ForceGradient, Method, Multistep, Nystrom, Splitting, Taylor


def has_sub_flows(method: Method) -> bool:
    """Return True if a step is made of exact flows, of which one takes care of dry friction's sticking."""
    return isinstance(method, Splitting)


def called_by(method: Method, quadratures: bool, slides: bool, adaptive: bool) -> tuple[str, ...]:
    """Return the names of the functions that a step may call, in the order in which a file defines them.

    Those of sub-flows (``kick``, ``push``, ``drag``, ``gradient_kick``) are written out in the step where the problem
    has nothing to add to them; see :mod:`pendulum_env.engine.subflows`.

    Args:
        method: the table.
        quadratures: True if work or heat ride along.
        slides: True if steps are cut at the zeros of the velocity, where the acceleration at rest decides.
        adaptive: True if steps are taken as a tolerance demands.
    """
    rates = ("rates",) if quadratures else ()
    if isinstance(method, Exact):
        return ("exact_flow",)
    if isinstance(method, ForceGradient):
        return ("force", "jacobian", "gradient_kick")
    if isinstance(method, Splitting):
        return ("force", "kick", "drag") if method.needs & {"split", "velocity_free"} else ("acceleration", "push")
    if isinstance(method, Nystrom) and method.velocity_free:
        return ("force", *(rates or (("acceleration",) if adaptive else ())))
    if isinstance(method, DiscreteGradient):
        return (*(("acceleration",) if slides else ()), *rates, "mean_acceleration", "mean_jacobian")
    alone = slides or isinstance(method, Multistep) or method.implicit or not quadratures
    more = ("jacobian",) if method.implicit else ("series",) if isinstance(method, Taylor) else ()
    return (*(("acceleration",) if alone else ()), *rates, *more)
