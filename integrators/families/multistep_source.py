"""Source of the steps of methods with a memory, and of what begins it; as :mod:`integrators.steps.unroll` writes it.

``starter(t, q, v, h, *extra)`` yields the mean slopes ``(q1 - q)/h, (v1 - v)/h`` of one step of the method that begins,
those of the quadratures after them.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from integrators.families.adams import Adams
from integrators.families.backward_differences import BackwardDifference
from integrators.families.multistep import Multistep, ago, over_step
from integrators.families.second_order import SecondOrder
from integrators.families.structural import GeneralizedAlpha
from integrators.method import MethodError
from integrators.steps.newton import one_stage
from integrators.steps.terms import Number, combination, definition, fraction_of, plus, time_at

HALF = Fraction(1, 2)


def unroll_multistep(method: Multistep, quadratures: Sequence[str], extra: Sequence[str], number: Number) -> str:
    """Source of ``begin`` and ``step``, and of the equation they solve, but for ``starter``."""
    more = "".join(f", {name}" for name in extra)
    if isinstance(method, Adams):
        newton, begun, lines = "", _past(method, quadratures, more), _adams(method, quadratures, more, number)
    elif isinstance(method, SecondOrder):
        newton = one_stage(more, apart=True) if method.implicit else ""
        begun, lines = _past(method, quadratures, more), _second_order(method, quadratures, more, number)
    elif isinstance(method, BackwardDifference):
        newton, lines = one_stage(more), _backward_difference(method, quadratures, more, number)
        zeros = ", ".join(["zero"] * (len(method.memory_with(quadratures)) - 1))
        begun = ["zero = v - v", f"return h - h, {zeros}"]
    elif isinstance(method, GeneralizedAlpha):
        newton, lines = one_stage(more, apart=True), _generalized_alpha(method, quadratures, more, number)
        begun = [f"return {_slope(quadratures)}(t, q, v{more})"]
    else:
        raise MethodError(f"There is no unrolling for methods of the kind {type(method).__name__}.")
    memory = ", ".join(method.memory_with(quadratures))
    begin = definition(f"begin(t, q, v, h{more})", "What the first step takes of earlier ones.", begun)
    return newton + begin + "\n\n" + definition(
        f"step(t, q, v, {memory}, h{more})", f"{method.name}: {method.source}", lines)


def _slope(quadratures: Sequence[str]) -> str:
    return "rates" if quadratures else "acceleration"


def _past(method: Adams | SecondOrder, quadratures: Sequence[str], more: str) -> list[str]:
    """Lines of ``begin``: steps of the starter backwards, in a row; each new value is the oldest."""
    kept = method.memory_with(quadratures)
    places = range(1, method.past + 1)
    rows = {"w": ago("v", places) if isinstance(method, Adams) else (), "a": ago("a", places)}
    rows |= {name: ago((name,), places) for name in quadratures}
    means = ago("u", range(method.past)) if isinstance(method, SecondOrder) and len(method.alpha) > 3 else ()
    rows["mean_v"] = means
    found, now = ", ".join(["a", *quadratures]), ", ".join(["a_now", *ago(quadratures, (0,))])
    lines = [f"{now} = {_slope(quadratures)}(t, q, v{more})"] if "a" in kept else []
    lines += ["x = q", "w = v", f"{' = '.join(name for row in rows.values() for name in row)} = v - v"]
    lines += [f"for i in range({method.past}):"]
    lines += [f"    mean_v, mean_a = starter(t - i*h, x, w, -h{more})"]
    lines += ["    x = x - h*mean_v", "    w = w - h*mean_a"]
    lines += [f"    {found} = {_slope(quadratures)}(t - (i + 1)*h, x, w{more})"]
    for newest, row in rows.items():
        if row:
            lines.append(f"    {', '.join(row)} = {', '.join([*row[1:], newest])}")
    lines.append(f"return {', '.join('a_now' if name == 'a' else name for name in kept)}")
    return lines


def _adams(method: Adams, quadratures: Sequence[str], more: str, number: Number) -> list[str]:
    names = ("v", "a", *quadratures)
    rows = {name: [name, *ago((name,), range(1, method.past + 1))] for name in names}
    found = ", ".join(names[1:])
    lines = [f"{found} = {_slope(quadratures)}(t, q, v{more})"]
    b = method.b
    if method.corrector:
        b = method.corrector
        used = {name: row[: len(method.b)] for name, row in rows.items()}
        lines.append(f"v_new = {plus('v', method.b, used['a'], number)}")
        lines.append(
            f"{', '.join(f'{name}_new' for name in names[1:])} = "
            f"{_slope(quadratures)}(t + h, {plus('q', method.b, used['v'], number)}, v_new{more})"
        )
    ends = {name: [*([f"{name}_new"] if method.corrector else []), *row][: len(b)] for name, row in rows.items()}
    kept = [name for row in rows.values() for name in row[:-1]]
    sums = [f"h*({combination(b, ends[name], number)})" for name in quadratures]
    states = [plus("q", b, ends["v"], number), plus("v", b, ends["a"], number)]
    return [*lines, f"return {', '.join([*states, *kept, *sums])}"]


def _second_order(method: SecondOrder, quadratures: Sequence[str], more: str, number: Number) -> list[str]:
    forces = ["a", *ago("a", range(1, method.past + 1))]
    means = ["u", *ago("u", range(1, len(method.alpha) - 2))]
    beta, c = method.beta, method.velocity
    if len(means) == 1:
        lines = _increments(method, forces, more, number)
        results = ["q_new", "v_new", "a_new", *forces[:-1]]
        return [*lines, *_closed(quadratures, method.past + 2, results, more, number)]
    lines = [
        f"u = {plus('v', [-x for x in c], forces, number)}",
        f"mean = {plus(combination(method.means, means, number), beta[1:], forces[: len(beta) - 1], number)}",
    ]
    if method.implicit:
        share = number(beta[0])
        lines += [
            f"a_new = solve_stage(t + h, q + h*mean, v, {share}*h*h, h - h{more})",
            f"u_new = mean + {share}*h*a_new",
            "q_new = q + h*u_new",
        ]
    else:
        lines += ["u_new = mean", "q_new = q + h*u_new", f"a_new = acceleration(t + h, q_new, v{more})"]
    lines.append(f"v_new = {plus('u_new', c, ['a_new', *forces[:-1]], number)}")
    kept = ["a_new", *forces[:-1], *means[:-1]]
    return [*lines, *_closed(quadratures, method.past + 2, ["q_new", "v_new", *kept], more, number)]


def _increments(method: SecondOrder, forces: Sequence[str], more: str, number: Number) -> list[str]:
    """Lines of a method without earlier mean velocities, as sums of q and v and what they gain."""
    beta, c = [*method.beta, *[Fraction(0)] * (len(forces) + 1 - len(method.beta))], method.velocity
    mean = plus("v", [x - y for x, y in zip(beta[1:], c, strict=True)], forces, number)
    if method.implicit:
        share = number(beta[0])
        lines = [
            f"a_new = solve_stage(t + h, q + h*({mean}), v, {share}*h*h, h - h{more})",
            f"q_new = q + h*({mean} + {share}*h*a_new)",
        ]
    else:
        lines = [f"q_new = q + h*({mean})", f"a_new = acceleration(t + h, q_new, v{more})"]
    weights = [c[0] + beta[0], *(x - y + z for x, y, z in zip(beta[1:], c, [*c[1:], Fraction(0)], strict=True))]
    return [*lines, f"v_new = {plus('v', weights, ['a_new', *forces], number)}"]


def _generalized_alpha(method: GeneralizedAlpha, quadratures: Sequence[str], more: str, number: Number) -> list[str]:
    part, old = 1 - method.alpha_f, method.alpha_m
    new = 1 / (1 - old)
    by_q, by_v = HALF - method.beta - method.beta * old * new, 1 - method.gamma - method.gamma * old * new
    length = fraction_of(part, number)

    def times(base: str, weights: Sequence[Fraction], names: Sequence[str]) -> str:
        return plus(base, weights, names, number)

    place = f"q + {length}*({times('v', [by_q], ['a'])})"
    speed = times("v", [part * by_v], ["a"])
    lengths = f"{number(part * method.beta * new)}*h*h, {number(part * method.gamma * new)}*h"
    lines = [
        f"k = solve_stage({time_at(part, number)}, {place}, {speed}, {lengths}{more})",
        f"a_new = {combination([new, -old * new], ['k', 'a'], number)}",
        f"q_new = q + h*({times('v', [HALF - method.beta, method.beta], ['a', 'a_new'])})",
        f"v_new = {times('v', [1 - method.gamma, method.gamma], ['a', 'a_new'])}",
    ]
    return [*lines, *_closed(quadratures, 2, ["q_new", "v_new", "a_new"], more, number)]


def _closed(
    quadratures: Sequence[str], count: int, results: Sequence[str], more: str, number: Number
) -> list[str]:
    """Quadratures from the rates at the step's end and ``count - 1`` before it, and what the step returns."""
    lines = []
    if quadratures:
        lines.append(f"{', '.join(['_', *quadratures])} = rates(t + h, q_new, v_new{more})")
    kept: list[str] = []
    sums = []
    for name in quadratures:
        row = [name, *ago((name,), range(count - 1))]
        kept += row[:-1]
        sums.append(f"h*({combination(over_step(count), row, number)})")
    return [*lines, f"return {', '.join([*results, *kept, *sums])}"]


def _backward_difference(
    method: BackwardDifference, quadratures: Sequence[str], more: str, number: Number
) -> list[str]:
    names = ("q", "v", *quadratures)
    rows = {name: [f"{name}{i}_gain" for i in range(1, method.past + 1)] for name in names}
    known = {name: combination(method.gains, row, number) for name, row in rows.items()}
    length = fraction_of(method.share, number)
    means = ", ".join(f"{name}_gain" for name in names)
    lines = [
        f"if begun < {method.past}:",
        f"    {means} = starter(t, q, v, h{more})",
        *(f"    {name}_gain = h*{name}_gain" for name in names),
        "else:",
        *(f"    {name}_gain = {known[name]}" for name in names),
        f"    a = solve_stage(t + h, q + q_gain, v + v_gain, {length}{more})",
        f"    v_gain = v_gain + {length}*a",
        f"    q_gain = q_gain + {length}*(v + v_gain)",
    ]
    if quadratures:
        lines.append(f"    {', '.join(['_', *quadratures])} = rates(t + h, q + q_gain, v + v_gain{more})")
        lines += [f"    {name}_gain = {name}_gain + {length}*{name}" for name in quadratures]
    kept = [gain for name, row in rows.items() for gain in (f"{name}_gain", *row[:-1])]
    sums = [f"{name}_gain" for name in quadratures]
    return [*lines, f"return {', '.join(['q + q_gain', 'v + v_gain', 'begun + 1', *kept, *sums])}"]
