"""From a table to a straight-line step function: readable Python source, run as it is or compiled.

The source calls the problem's functions by name; whoever runs it puts them into the namespace:

====================  ======================================================================================
``acceleration``      ``(t, q, v, *extra) -> a``
``rates``             ``(t, q, v, *extra) -> (a, *rates)``, asked for instead where quadratures ride along
``force``             ``(t, q, *extra) -> f``, the velocity-free part, for kicks and velocity-free stages
``kick``, ``push``    ``(t, q, v, a, h, *extra) -> (v, *increments)``; without them ``v + h a`` is written out
``drag``              ``(t, q, v, h, *extra) -> (v, *increments)``; without it drag flows are left out
``jacobian``          ``(t, q, v, *extra) -> (da/dq, da/dv)``, for implicit stages and force gradients
``mean_...``          ``mean_acceleration`` and ``mean_jacobian``: ``(t, q, v, spread, *extra)``, for mean forces
``added``, ``scaled`` of :mod:`integrators.steps.compensated`, for compensated steps
``series``            ``(t, q, v, *extra)`` -> Taylor coefficients; see
:func:`integrators.families.taylor.results_of_series`
``exact_flow``        ``(t, q, v, h, *extra) -> (q, v, *increments)``, the solution
====================  ======================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from integrators.families.energy_preserving import DiscreteGradient, mean_force_step
from integrators.families.exact_flow import Exact, exact_step
from integrators.families.force_gradient import ForceGradient, force_gradient_step
from integrators.families.multistep import Multistep, Started
from integrators.families.multistep_source import unroll_multistep
from integrators.families.nystrom import Nystrom
from integrators.families.nystrom_steps import nystrom_step
from integrators.families.taylor import Taylor, taylor_step
from integrators.method import DRAG, DRIFT, PUSH, Method, MethodError, RungeKutta, Splitting
from integrators.steps.compensated_source import compensate, noting
from integrators.steps.estimates import stages_of, unroll_estimates
from integrators.steps.newton import one_stage, simultaneous
from integrators.steps.terms import (
    Number,
    begin_with_force,
    combination,
    definition,
    fraction_of,
    literal,
    plus,
    time_at,
)


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
) -> str:
    """Source of ``step`` for one method, of the functions it needs, and of ``begin`` for methods with a memory.

    Args:
        method: the table.
        quadratures: names of integrals that ride along; their rates come from ``rates``, their increments
            over sub-flows from ``kick``, ``push`` and ``drag``.
        extra: names of further run-time arguments, handed through to every function of the problem.
        hooks: which of ``kick``, ``push`` and ``drag`` the problem brings, and the quadratures each adds to. With
            ``store``, a function of time and place, the ``kick`` also takes the place at the step's start, and what
            the store at the step's end has there beyond that is taken from the quadratures.
        number: writes a coefficient; the default is a float literal.
        exact_drag: False if the hook ``drag`` is a symmetric composition of several flows, of which two in a row are
            not one over both times.
        estimates: True for a step that also returns its estimated errors; see :mod:`integrators.steps.estimates`.
        dense: True for a Runge-Kutta step that also returns the velocities and accelerations of its stages, last, with
            those that only dense output needs.
        compensated: True for a step that also takes and returns what rounding took from q and v; see
            :mod:`integrators.steps.compensated`.
        glides: True if the hooks ``kick`` and ``push`` do more than ``v + h a``, as under dry friction.

    Raises MethodError if the method's kind has no unrolling, or no estimates, or cannot be compensated.
    """
    if compensated:
        exact: dict[float, Fraction] = {}
        source = unroll(method, quadratures=quadratures, extra=extra, hooks=hooks, number=noting(number, exact),
                        exact_drag=exact_drag)
        return compensate(source, method.name, len(method.memory_with(quadratures)), exact, glides)
    if estimates:
        return unroll_estimates(method, tuple(quadratures), tuple(extra), number, dense)
    if isinstance(method, RungeKutta):
        return _runge_kutta(method, tuple(quadratures), tuple(extra), number, dense)
    if isinstance(method, Splitting):
        return _splitting(method, tuple(quadratures), tuple(extra), hooks or {}, number, exact_drag)
    if isinstance(method, Nystrom):
        return nystrom_step(method, quadratures, extra, number)
    if isinstance(method, DiscreteGradient):
        more = "".join(f", {name}" for name in extra)
        newton, lines = mean_force_step(quadratures, more)
        return newton + definition(f"step(t, q, v, h{more})", _title(method), lines)
    if isinstance(method, ForceGradient):
        more = "".join(f", {name}" for name in extra)
        return force_gradient_step(method, quadratures, more, hooks or {}, number)
    if isinstance(method, Taylor):
        return taylor_step(method, quadratures, "".join(f", {name}" for name in extra), estimates=False)
    if isinstance(method, Exact):
        more = "".join(f", {name}" for name in extra)
        return definition(f"step(t, q, v, h{more})", _title(method), exact_step(quadratures, more))
    if isinstance(method, Multistep):
        starter = ""
        if isinstance(method, Started):
            riding = tuple(quadratures) if method.forwards else ()
            starter = _runge_kutta(method.starter, riding, tuple(extra), number, starts=True) + "\n\n"
        return starter + unroll_multistep(method, quadratures, extra, number)
    raise MethodError(f"There is no unrolling for methods of the kind {type(method).__name__}.")


def _runge_kutta(
    method: RungeKutta, quadratures: tuple[str, ...], extra: tuple[str, ...], number: Number, dense: bool = False,
    starts: bool = False,
) -> str:
    """``step``, or ``starter``, which yields mean slopes over the step instead of the state and increments."""
    more = "".join(f", {name}" for name in extra)
    function = "rates" if quadratures else "acceleration"
    further = (method.dense.used(len(method.b)),) if dense and method.dense is not None else ()
    taken = method.reached(method.b, *further)
    stages, weights = [i + 1 for i in taken], [method.b[i] for i in taken]
    lines: list[str] = []
    coupled = method.coupled
    if coupled:
        lines.append(f"{', '.join(f'a{i}' for i in stages)} = solve_stages(t, q, v, h{more})")
        lines += [f"v{i} = {plus('v', method.a[i - 1], [f'a{j}' for j in stages], number)}" for i in stages]
    for i in stages:
        row, diagonal = method.a[i - 1], method.a[i - 1][i - 1]
        if coupled:
            q = plus("q", row, [f"v{j}" for j in stages], number)
            found = ["_", *(f"{name}{i}" for name in quadratures)]
            if quadratures:
                lines.append(f"{', '.join(found)} = rates({time_at(method.c[i - 1], number)}, {q}, v{i}{more})")
            continue
        before = [j for j in stages if j < i]
        shares = [row[j - 1] for j in before]
        q = plus("q", shares, [f"v{j}" for j in before], number)
        v = plus("v", shares, [f"a{j}" for j in before], number)
        t = time_at(method.c[i - 1], number)
        if diagonal:
            d = fraction_of(diagonal, number)
            lines.append(f"k{i} = solve_stage({t}, {q}, {v}, {d}{more})")
            lines.append(f"v{i} = {v} + {d}*k{i}")
            q = f"{q} + {d}*v{i}"
        else:
            lines.append(f"v{i} = {v}")
        if quadratures or not diagonal:
            found = [f"a{i}", *(f"{name}{i}" for name in quadratures)]
            lines.append(f"{', '.join(found)} = {function}({t}, {q}, v{i}{more})")
        if diagonal:
            lines.append(f"a{i} = k{i}")
    results = [plus(y, weights, [f"{k}{i}" for i in stages], number) for y, k in (("q", "v"), ("v", "a"))]
    totals = {name: combination(weights, [f"{name}{i}" for i in stages], number) for name in ("v", "a", *quadratures)}
    results = list(totals.values()) if starts else [*results, *(f"h*({totals[name]})" for name in quadratures)]
    if dense:
        results += stages_of(method, taken)
    newton = one_stage(more) if method.implicit else ""
    if coupled:
        newton = simultaneous(method, more, number)
    lines.append(f"return {', '.join(results)}")
    name = "starter" if starts else "step"
    return newton + definition(f"{name}(t, q, v, h{more})", _title(method), lines)


def _splitting(
    method: Splitting,
    quadratures: tuple[str, ...],
    extra: tuple[str, ...],
    hooks: Mapping[str, Sequence[str]],
    number: Number,
    exact_drag: bool,
) -> str:
    more = "".join(f", {name}" for name in extra)
    lines: list[str] = []
    apart = (PUSH,) if exact_drag else (PUSH, DRAG)
    flows = _joined([flow for flow in method.flows if flow[0] != DRAG or "drag" in hooks], apart)
    counted: set[str] = set()
    stored = hooks.get("store", ())
    start = ", start" if stored else ""
    lines += ["start = q"] if stored else []
    elapsed, fresh = Fraction(0), bool(method.memory)

    def call(function: str, arguments: str) -> None:
        """v and the increments from a hook; the first increment of a name starts its sum."""
        parts = hooks[function]
        lines.append(f"{', '.join(['v', *(f'd_{name}' for name in parts)])} = {function}({arguments}{more})")
        for name in parts:
            lines.append(f"{name} = {name} + d_{name}" if name in counted else f"{name} = d_{name}")
            counted.add(name)

    for kind, fraction in flows:
        t, h = time_at(elapsed, number), fraction_of(fraction, number)
        if kind == DRIFT:
            lines.append(f"q = q + {h}*v")
            elapsed += fraction
            fresh = False
        elif kind == DRAG:
            call("drag", f"{t}, q, v, {h}")
        else:
            if kind == PUSH:
                lines.append(f"a = acceleration({t}, q, v{more})")
            elif not fresh:
                lines.append(f"a = force({t}, q{more})")
            fresh = kind != PUSH
            if kind in hooks:
                call(kind, f"{t}, q, v, a, {h}{start}")
            else:
                lines.append(f"v = v + {h}*a")
    for name in stored:
        lines.append(f"{name} = {name} - (store(t + h, q{more}) - store(t + h, start{more}))")
    kept = "".join(f", {name}" for name in method.memory)
    missing = [name for name in quadratures if name not in counted]
    if missing:
        raise MethodError(f"{method.name}: no sub-flow adds to {', '.join(missing)}; hooks are missing.")
    lines.append(f"return {', '.join([f'q, v{kept}', *quadratures])}")
    begin = begin_with_force(more) if kept else ""
    return begin + definition(f"step(t, q, v{kept}, h{more})", _title(method), lines)


def _joined(flows: Sequence[tuple[str, Fraction]], apart: Sequence[str]) -> list[tuple[str, Fraction]]:
    """Neighbours of one kind as one flow, which they are; but for the kinds that are no flows."""
    found: list[tuple[str, Fraction]] = []
    for kind, fraction in flows:
        if found and found[-1][0] == kind and kind not in apart:
            found[-1] = (kind, found[-1][1] + fraction)
        else:
            found.append((kind, fraction))
    return found


def _title(method: Method) -> str:
    return f"{method.name}: {method.source}"
