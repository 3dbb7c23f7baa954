"""Source of the functions that solve implicit stages by Newton's method: one stage in a bracket, or all together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fractions import Fraction

from integrators.steps.terms import Number, combination, plus, time_at

NEWTON = '''def solve_stage(t, q, v, {lengths}{more}):
    """k = a(t, q + {way}, w{a}), w = v + d k, by Newton's method in a bracket, to round-off; nan if it fails."""
    start = {mean}acceleration(t, q{first}, v{start}{more})
    sense = 1.0 if start > 0.0 else -1.0
    k = v - v
    low = k
    high = -1.0
    last = abs(start)
    for _ in range(200):
        w = v + d*k
        p = q + {place}
        by_q, by_v = {mean}jacobian(t, p, w{spread}{more})
        residual = k - {mean}acceleration(t, p, w{spread}{more})
        slope = 1.0 - {slope}
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
"""Template of a function that solves one implicit stage; :func:`one_stage` replaces the words in braces.

Newton's method within a bracket (Press et al. 2007, section 9.4), until its steps no longer shrink.
"""


SOLVING, REFINING = "solve_", "refine_"
"""First letters of the names of functions that solve stages, and of those that take one step of Newton's method.

``refine_stage`` takes the arguments of ``solve_stage`` and then its results, and returns results with a smaller error.
From a root, its derivatives are those of the root by the implicit function theorem; two steps have them up to order 3.
"""

REFINE = '''def refine_stage(t, q, v, {lengths}{more}, k):
    """One step of Newton's method for solve_stage, from k."""
    w = v + d*k
    p = q + {place}
    by_q, by_v = {mean}jacobian(t, p, w{spread}{more})
    residual = k - {mean}acceleration(t, p, w{spread}{more})
    return k - residual/(1.0 - {slope})


'''


def one_stage(more: str, mean: bool = False, apart: bool = False, refines: bool = False) -> str:
    """Return the source of ``solve_stage(t, q, v, d)``, which solves ``k = a(t, q + d w, w)``, ``w = v + d k``.

    Args:
        more: the text of further arguments of the function, such as ``, p``.
        mean: True to average forces from the old to the new angle.
        apart: True for ``solve_stage(t, q, v, c, d)``, which solves ``k = a(t, q + c k, v + d k)``.
        refines: True for the source of ``refine_stage``, too; see :data:`REFINING`.
    """
    words = {"lengths": "d", "way": "d w", "first": " + d*v", "place": "d*w", "slope": "d*(d*by_q + by_v)"}
    if mean:
        words |= {"mean": "mean_", "a": ", d w", "start": ", d*v", "spread": ", d*w"}
    if apart:
        words |= {"lengths": "c, d", "way": "c k", "first": "", "place": "c*k", "slope": "(c*by_q + d*by_v)"}
    template = NEWTON + (REFINE if refines else "")
    return re.sub(r"{(\w+)}", lambda word: {"more": more, **words}.get(word[1], ""), template)


def simultaneous(a: Sequence[Sequence[Fraction]], nodes: Sequence[Fraction], more: str, number: Number,
                 refines: bool = False, near: bool = False) -> str:
    """Return the source of ``solve_stages(t, q, v, h)``, which solves all stages of a coupled Runge-Kutta table.

    It returns the stages' accelerations ``k_i = a(t + c_i h, q_i, v_i)``, by Newton's method with the full Jacobian,
    ``d q_i/d k_j = h**2 (A A)_ij``, which is eliminated with pivots. Steps that make the residuals larger are halved
    (Deuflhard 2011, section 3.1). The iteration ends when rounding keeps its steps from shrinking; after 200 sweeps the
    result is nan.

    Args:
        a, nodes: the coefficients a_ij and nodes c_i of the Butcher table.
        more: the text of further arguments of the function, such as ``, p``.
        number: function that returns a coefficient as source text.
        refines: True for the source of ``refine_stages``, too; see :data:`REFINING`.
        near: True to begin at accelerations of zero, not at those along a straight line, which in a long step of a
            stiff problem are so large that the iteration ends at another solution of the stage equations.
    """
    stages = range(1, len(a) + 1)
    square = [[sum((x * row[j] for x, row in zip(line, a, strict=True)), Fraction(0)) for j in range(len(a))]
              for line in a]
    times = [time_at(c, number) for c in nodes]
    ks, vs, ds = ([f"{letter}{i}" for i in stages] for letter in "kvd")
    place = [f"q + {number(c)}*h*v" if c else "q" for c in nodes]
    start = [f"{k} = v - v" if near else f"{k} = acceleration({t}, {q}, v{more})"
             for k, t, q in zip(ks, times, place, strict=True)]
    sweep = [
        *(f"{v} = {plus('v', row, ks, number)}" for v, row in zip(vs, a, strict=True)),
        *(f"q{i} = {plus('q', row, vs, number)}" for i, row in zip(stages, a, strict=True)),
        *(f"r{i} = k{i} - acceleration({t}, q{i}, v{i}{more})" for i, t in zip(stages, times, strict=True)),
        *(f"p{i}, w{i} = jacobian({t}, q{i}, v{i}{more})" for i, t in zip(stages, times, strict=True)),
        f"size = {_sizes('r', stages)}",
    ]
    matrix = [
        f"m{i}_{j} = " + _entry(i == j, square[i - 1][j - 1], a[i - 1][j - 1], i, number)
        for i in stages for j in stages
    ]
    names = {"ks": ", ".join(ks), "xs": ", ".join(f"x{i}" for i in stages), "more": more,
             "nan": ", ".join(["NAN*k1"] * len(ks)), "first": ", ".join(f"k{i} - k{i}" for i in stages),
             "ds": ", ".join(ds), "sum_d": _sizes("d", stages), "sum_k": _sizes("k", stages),
             "ends": ", ".join(f"k{i} - d{i}" for i in stages),
             "trial": ", ".join(f"x{i} - share*d{i}" for i in stages)}
    blocks = {"start": start, "sweep": sweep, "matrix": matrix, "solve": _elimination(len(ks), names["nan"]),
              "correct": _elimination(len(ks))}
    text = re.sub(r"^( *){(start|sweep|matrix|solve|correct)}", lambda place: "\n".join(
        place[1] + line for line in blocks[place[2]]), SIMULTANEOUS + (REFINES if refines else ""), flags=re.M)
    return re.sub(r"{(\w+)}", lambda word: names[word[1]], text)


def _sizes(letter: str, stages: Sequence[int]) -> str:
    """Return the source text of ``abs(k1) + abs(k2) + ...`` for ``count`` stages and the letter k."""
    return " + ".join(f"abs({letter}{i})" for i in stages)


def _entry(diagonal: bool, by_q: Fraction, by_v: Fraction, i: int, number: Number) -> str:
    """Return the source text of one entry of Newton's matrix, such as ``1.0 - h*(0.25*w1) - h*h*(0.0625*p1)``.

    The 1.0 stands on the diagonal only. p and w are the derivatives of the acceleration by q and v at a stage; ``by_q``
    and ``by_v`` are their coefficients in row i.
    """
    text = "1.0" if diagonal else ""
    for power, weight, name in (("h", by_v, "w"), ("h*h", by_q, "p")):
        if weight:
            text += f" {'-' if weight > 0 else '+'} {power}*({combination([abs(weight)], [f'{name}{i}'], number)})"
    text = text or "0.0"
    return text[3:] if text.startswith(" + ") else text.replace(" - ", "-", 1) if text.startswith(" - ") else text


def _elimination(count: int, nan: str = "") -> list[str]:
    """Return source lines that solve the linear equations ``m d = r`` by Gaussian elimination with row exchange.

    If the matrix is singular, these lines return the source text ``nan``; with "" they divide by zero.
    """
    lines = []
    stages = range(1, count + 1)
    for k in stages:
        for i in range(k + 1, count + 1):
            ours, theirs = ([*(f"m{row}_{j}" for j in range(k, count + 1)), f"r{row}"] for row in (k, i))
            lines.append(f"if abs(m{i}_{k}) > abs(m{k}_{k}):")
            lines.append(f"    {', '.join([*ours, *theirs])} = {', '.join([*theirs, *ours])}")
        lines += [f"if m{k}_{k} == 0.0:", f"    return {nan}"] if nan else []
        for i in range(k + 1, count + 1):
            lines.append(f"f = m{i}_{k}/m{k}_{k}")
            lines += [f"m{i}_{j} = m{i}_{j} - f*m{k}_{j}" for j in range(k + 1, count + 1)]
            lines.append(f"r{i} = r{i} - f*r{k}")
    for i in reversed(stages):
        known = "".join(f" - m{i}_{j}*d{j}" for j in range(i + 1, count + 1))
        lines.append(f"d{i} = {f'(r{i}{known})' if known else f'r{i}'}/m{i}_{i}")
    return lines


SIMULTANEOUS = '''def solve_stages(t, q, v, h{more}):
    """The stages' accelerations by Newton's method with halved steps, to round-off; nan if it fails."""
    {start}
    {xs} = {ks}
    {ds} = {first}
    noise = 1e-14*(abs(v/h) + abs(q/h/h))
    best = -1.0
    share = 1.0
    near = -1.0
    change = 1e300
    for _ in range(200):
        {sweep}
        if best >= 0.0 and not size < best:
            if change <= near:
                return {xs}
            share = 0.5*share
        else:
            if not size - size == 0.0:
                return {nan}
            {matrix}
            {solve}
            last = change
            change = {sum_d}
            near = 1e-6*({sum_k}) + noise
            if change <= 1e-300 or (change <= near and change + change >= last):
                return {ends}
            best = size
            share = 1.0
            {xs} = {ks}
        {ks} = {trial}
    return {nan}


'''
"""Template of a function that solves coupled stages; :func:`simultaneous` replaces the words in braces."""

REFINES = '''def refine_stages(t, q, v, h{more}, {ks}):
    """One step of Newton's method for solve_stages, from {ks}."""
    {sweep}
    {matrix}
    {correct}
    return {ends}


'''
