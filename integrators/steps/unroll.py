"""The source of a method's step function: readable Python, which can run as it is or be compiled.

The source calls functions of the problem by name. They must be in the namespace in which the source runs:

====================  ======================================================================================
``acceleration``      ``(t, q, v, *extra) -> a``
``rates``             ``(t, q, v, *extra) -> (a, *rates)``, called instead where there are quadratures
``force``             ``(t, q, *extra) -> f``, the velocity-free part, for kicks and velocity-free stages
``kick``, ``push``    ``(t, q, v, a, h, *extra) -> (v, *increments)``; without them ``v + h a`` is written out
``drag``              ``(t, q, v, h, *extra) -> (v, *increments)``; without it drag flows are left out
``jacobian``          ``(t, q, v, *extra) -> (da/dq, da/dv)``, for implicit stages and force gradients
``mean_...``          ``mean_acceleration`` and ``mean_jacobian``: ``(t, q, v, spread, *extra)``, for mean forces
``added``, ``scaled`` of :mod:`integrators.steps.compensated`, for compensated steps
``series``            ``(t, q, v, *extra)`` -> Taylor coefficients; see
:func:`integrators.families.taylor.results_of_series`
``exact_flow``        ``(t, q, v, h, *extra) -> (q, v, *increments)``, the exact solution after the time h
``sin``, ``cos``, ``exp``, ``log``, ``sqrt``: of one number
====================  ======================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from integrators.method import Method, MethodError
from integrators.steps.compensated import LOST, CompensatedNotation
from integrators.steps.estimates import check_estimates
from integrators.steps.terms import Notation, Number, literal


def unroll(
    method: Method,
    *,
    quadratures: Sequence[str] = (),
    extra: Sequence[str] = (),
    hooks: Mapping[str, Sequence[str]] | None = None,
    number: Number = literal,
    exact_drag: bool = True,
    estimates: bool = False,
    dense: bool = False,
    compensated: bool = False,
    glides: bool = False,
    refines: bool = False,
) -> str:
    """Return the source of a method's ``step``, of the functions it needs, and of ``begin`` if the method has a memory.

    Args:
        method: the method.
        quadratures: names of integrals that are carried along the step, such as work; their rates come from ``rates``,
            their increments over sub-flows from ``kick``, ``push`` and ``drag``.
        extra: names of further run-time arguments, which are passed on to every function of the problem.
        hooks: name of a sub-flow that the problem brings, ``kick``, ``push`` or ``drag`` -> the quadratures to which it
            adds. With ``store``, a function of time and angle, ``kick`` also takes the angle at the step's start, and
            the change of the store between both angles, at the step's end, is subtracted from the quadratures.
        number: function that returns a coefficient as source text; the default gives a float literal.
        exact_drag: False if the hook ``drag`` is a symmetric composition of several flows, so that two calls in a row
            are not the same as one over both times.
        estimates: True for a step that also returns its estimated errors; see :mod:`integrators.steps.estimates`.
        dense: True for a Runge-Kutta step that returns, last, also the velocities and accelerations of its stages,
            including stages that only dense output needs.
        compensated: True for a step that also takes and returns the rounding errors of q and v; see
            :mod:`integrators.steps.compensated`.
        glides: True if the hooks ``kick`` and ``push`` do more than ``v + h a``, as under dry friction.
        refines: True for the source, beside every function that solves a stage, of one step of Newton's method; see
            :data:`integrators.steps.newton.REFINING`.

    Raises MethodError if the method's class writes no step, has no estimates, cannot be compensated, or adds nothing to
    the quadratures.
    """
    names = tuple(quadratures), tuple(extra), hooks or {}, number, exact_drag
    if estimates:
        check_estimates(method)
        return method.write_estimating_step(Notation(*names, dense))
    source = method.write_step(CompensatedNotation(*names, glides=glides) if compensated else
                               Notation(*names, dense, refines))
    missing = [name for name in quadratures if name not in source]
    if missing:
        raise MethodError(f"{method.name}: its step does not integrate {', '.join(missing)}.")
    if compensated and LOST[0] not in source:
        raise MethodError(
            f"{method.name} cannot be compensated: its step does not add increments to the old state."
        )
    return source
