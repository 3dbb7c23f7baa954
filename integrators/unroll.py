"""From a table to a straight-line step function: readable Python source, run as it is or compiled.

The source calls the problem's functions by name; whoever runs it puts them into the namespace:

====================  ======================================================================================
``acceleration``      ``(t, q, v, *extra) -> a``
``rates``             ``(t, q, v, *extra) -> (a, *rates)``, asked for instead where quadratures ride along
``force``             ``(t, q, *extra) -> f``, the velocity-free part, for kicks
``kick``, ``push``    ``(t, q, v, a, h, *extra) -> (v, *increments)``; without them ``v + h a`` is written out
``drag``              ``(t, q, v, h, *extra) -> (v, *increments)``; without it drag flows are left out
``jacobian``          ``(t, q, v, *extra) -> (da/dq, da/dv)``, for implicit stages
====================  ======================================================================================
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction

from integrators.method import DRAG, DRIFT, PUSH, Method, MethodError, RungeKutta, Splitting

Number = Callable[[Fraction], str]


def literal(value: Fraction) -> str:
    """The coefficient rounded once to double precision, as a literal."""
    return repr(float(value))


def unroll(
    method: Method,
    *,
    quadratures: Sequence[str] = (),
    extra: Sequence[str] = (),
    hooks: Mapping[str, Sequence[str]] | None = None,
    number: Number = literal,
    exact_drag: bool = True,
) -> str:
    """Source of ``step`` (and of the functions it needs) for one method.

    Args:
        method: the table.
        quadratures: names of integrals that ride along; their rates come from ``rates``, their increments
            over sub-flows from ``kick``, ``push`` and ``drag``.
        extra: names of further run-time arguments, handed through to every function of the problem.
        hooks: which of ``kick``, ``push`` and ``drag`` the problem brings, and the quadratures each adds to.
        number: writes a coefficient; the default is a float literal.
        exact_drag: False if the hook ``drag`` is a symmetric composition of several flows, of which two in a row are
            not one over both times.

    Raises MethodError if the method's kind has no unrolling.
    """
    if isinstance(method, RungeKutta):
        return _runge_kutta(method, tuple(quadratures), tuple(extra), number)
    if isinstance(method, Splitting):
        return _splitting(method, tuple(quadratures), tuple(extra), hooks or {}, number, exact_drag)
    raise MethodError(f"There is no unrolling for methods of the kind {type(method).__name__}.")


def _combination(weights: Sequence[Fraction], names: Sequence[str], number: Number) -> str:
    """``0.5*k1 - k3``: a sum without its zero terms; empty if all are zero."""
    text = ""
    for weight, name in zip(weights, names, strict=True):
        if weight == 0:
            continue
        size = name if abs(weight) == 1 else f"{number(abs(weight))}*{name}"
        text += f" - {size}" if weight < 0 else (f" + {size}" if text else size)
    return text.replace(" - ", "-", 1) if text.startswith(" - ") else text


def _plus(base: str, weights: Sequence[Fraction], names: Sequence[str], number: Number) -> str:
    """``base + h*(...)``, or ``base`` alone."""
    total = _combination(weights, names, number)
    return base if not total else f"{base} + h*{total}" if total in names else f"{base} + h*({total})"


def _fraction_of(fraction: Fraction, number: Number) -> str:
    return "h" if fraction == 1 else f"{number(fraction)}*h"


def _time(fraction: Fraction, number: Number) -> str:
    return "t" if fraction == 0 else f"t + {_fraction_of(fraction, number)}"


def _runge_kutta(
    method: RungeKutta, quadratures: tuple[str, ...], extra: tuple[str, ...], number: Number
) -> str:
    more = "".join(f", {name}" for name in extra)
    function = "rates" if quadratures else "acceleration"
    stages = [i + 1 for i in method.stages]
    weights = [method.b[i] for i in method.stages]
    lines: list[str] = []
    for i in stages:
        row, diagonal = method.a[i - 1], method.a[i - 1][i - 1]
        before = [j for j in stages if j < i]
        shares = [row[j - 1] for j in before]
        q = _plus("q", shares, [f"v{j}" for j in before], number)
        v = _plus("v", shares, [f"a{j}" for j in before], number)
        t = _time(method.c[i - 1], number)
        if diagonal:
            d = _fraction_of(diagonal, number)
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
    results = [_plus(y, weights, [f"{k}{i}" for i in stages], number) for y, k in (("q", "v"), ("v", "a"))]
    for name in quadratures:
        total = _combination(weights, [f"{name}{i}" for i in stages], number)
        results.append(f"h*({total})")
    newton = NEWTON.replace("{more}", more) if method.implicit else ""
    lines.append(f"return {', '.join(results)}")
    return newton + _function(f"step(t, q, v, h{more})", _title(method), lines)


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
    elapsed, fresh = Fraction(0), method.carry

    def call(function: str, arguments: str) -> None:
        """v and the increments from a hook; the first increment of a name starts its sum."""
        parts = hooks[function]
        lines.append(f"{', '.join(['v', *(f'd_{name}' for name in parts)])} = {function}({arguments}{more})")
        for name in parts:
            lines.append(f"{name} = {name} + d_{name}" if name in counted else f"{name} = d_{name}")
            counted.add(name)

    for kind, fraction in flows:
        t, h = _time(elapsed, number), _fraction_of(fraction, number)
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
                call(kind, f"{t}, q, v, a, {h}")
            else:
                lines.append(f"v = v + {h}*a")
    carried = ", a" if method.carry else ""
    missing = [name for name in quadratures if name not in counted]
    if missing:
        raise MethodError(f"{method.name}: no sub-flow adds to {', '.join(missing)}; hooks are missing.")
    lines.append(f"return {', '.join([f'q, v{carried}', *quadratures])}")
    return _function(f"step(t, q, v{carried}, h{more})", _title(method), lines)


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


def _function(signature: str, doc: str, lines: Sequence[str]) -> str:
    body = "\n".join(f"    {line}" for line in lines)
    return f'def {signature}:\n    """{doc}"""\n{body}\n'


NEWTON = '''def solve_stage(t, q, v, d{more}):
    """k = a(t, q + d w, w), w = v + d k, by Newton's method in a bracket, to round-off; nan if it fails."""
    start = acceleration(t, q + d*v, v{more})
    sense = 1.0 if start > 0.0 else -1.0
    k = v - v
    low = k
    high = -1.0
    last = abs(start)
    for _ in range(200):
        w = v + d*k
        p = q + d*w
        by_q, by_v = jacobian(t, p, w{more})
        residual = k - acceleration(t, p, w{more})
        slope = 1.0 - d*(d*by_q + by_v)
        if not residual - residual == 0.0:
            return residual - residual
        x = sense*k
        if sense*residual < 0.0:
            low = x if x > low else low
        elif high < 0.0 or x < high:
            high = x
        new = sense*(k - residual/slope) if slope != 0.0 else low - 1.0
        newton = new >= low and (high < 0.0 or new <= high)
        if not newton:
            new = 0.5*(low + high) if high >= 0.0 else low + low + abs(start)
        change = abs(new - x)
        k = sense*new
        if change <= 1e-300 or (newton and change <= 1e-6*abs(new) and change + change >= last):
            return k
        last = change
    return k*NAN


'''
"""Implicit stages: safeguarded Newton (Press et al. 2007, section 9.4), until its steps no longer shrink."""
