"""Two sums of a Taylor series at once, in runs of one pendulum: one instruction multiplies or adds for both.

The coefficients of sin(x) and cos(x) are sums with the same factors v, the coefficients of the rate of x
(:mod:`integrators.steps.recurrences`)::

    s_k = 1/k*(v_0*c_(k-1) + v_1*c_(k-2) + ...)        c_k = -1/k*(v_0*s_(k-1) + v_1*s_(k-2) + ...)

Both are added in the same order, so that packed instructions, which work on two numbers at once, compute the same bits
with fewer instructions. LLVM does not find this by itself. A series of low order gains nothing: its time is that of a
chain of operations each of which takes the result of the one before. Batches do without pairs, because their
instructions work on several pendulums already.
"""

from __future__ import annotations

import ast
from typing import Any, NamedTuple

from numba.core.cgutils import ir  # that of llvmlite, on which numba is built

from pendulum_env.common.sources import parsed

LEAST = 13
"""The sums of a series are paired if the longest of them has at least so many products: from order 14 on."""
NAME = "_two_sums"
"""Name in a program of the function that :func:`write_two_sums` writes."""
_PAIR = ir.VectorType(ir.DoubleType(), 2)
_FIRST, _SECOND = ir.IntType(32)(0), ir.IntType(32)(1)


def _pair(builder: Any, one: Any, other: Any) -> Any:
    half = builder.insert_element(ir.Constant(_PAIR, ir.Undefined), one, _FIRST)
    return builder.insert_element(half, other, _SECOND)


def write_two_sums(builder: Any, scales: Any, factors: Any, first: Any, second: Any) -> list[Any]:
    """Write ``scales[0]*sum_i factors[i]*first[i]`` and ``scales[1]*sum_i factors[i]*second[i]``; return both values.

    Products are added from left to right.
    """
    total = None
    for factor, one, other in zip(factors, first, second, strict=True):
        product = builder.fmul(_pair(builder, factor, factor), _pair(builder, one, other))
        total = product if total is None else builder.fadd(total, product)
    scaled = builder.fmul(total, _pair(builder, *scales))
    return [builder.extract_element(scaled, place) for place in (_FIRST, _SECOND)]


class _Sum(NamedTuple):
    """A line ``name = scale*(x*y + ...)``: its name, its scale, and the names of all x and of all y."""

    name: str
    scale: float
    factors: tuple[str, ...]
    others: tuple[str, ...]


def paired(text: str) -> str:
    """Return a program in whose function ``series`` pairs of sums with the same factors are calls of ``_two_sums``.

    The second of the sums moves up to the first, so that all that it adds must be known there. Nothing changes if all
    sums have fewer than LEAST products, or if the function sets a name twice.
    """
    if "def series(" not in text:
        return text
    tree = parsed(text)
    for function in tree.body:
        if isinstance(function, ast.FunctionDef) and function.name == "series":
            pairs = _pairs(function)
            if max((len(one.factors) for _, _, one, _ in pairs), default=0) >= LEAST:
                for place, _, one, other in pairs:
                    function.body[place] = _call(one, other)
                for late in sorted((late for _, late, _, _ in pairs), reverse=True):
                    del function.body[late]
    return ast.unparse(tree)


def _pairs(function: ast.FunctionDef) -> list[tuple[int, int, _Sum, _Sum]]:
    """Return the places and the sums of all pairs in a function; none if it sets a name twice."""
    waiting: dict[tuple[str, ...], tuple[int, _Sum]] = {}
    known = {parameter.arg: -1 for parameter in function.args.args}
    pairs = []
    for place, line in enumerate(function.body):
        found = _sum(line)
        if found:
            begun = waiting.pop(found.factors, None)
            if begun and all(known.get(name, -1) < begun[0] for name in found.others):
                pairs.append((begun[0], place, begun[1], found))
            else:
                waiting[found.factors] = place, found
        for node in ast.walk(line):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                if node.id in known:
                    return []
                known[node.id] = place
    return pairs


def _sum(line: ast.stmt) -> _Sum | None:
    """Return the sum of two or more products of two names that a line computes, None if it computes anything else."""
    match line:
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.BinOp(left=weight, op=ast.Mult(), right=total)):
            pass
        case _:
            return None
    match weight:
        case ast.Constant(value=float(scale)):
            pass
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=float(size))):
            scale = -size
        case _:
            return None
    products: list[ast.expr] = []
    while isinstance(total, ast.BinOp) and isinstance(total.op, ast.Add):
        products.append(total.right)
        total = total.left
    factors, others = [], []
    for product in reversed([*products, total]):
        match product:
            case ast.BinOp(left=ast.Name(id=x), op=ast.Mult(), right=ast.Name(id=y)):
                factors.append(x)
                others.append(y)
            case _:
                return None
    return _Sum(name, scale, tuple(factors), tuple(others)) if products else None


def _call(one: _Sum, other: _Sum) -> ast.stmt:
    """Return the line that computes both sums."""
    given = [repr((one.scale, other.scale)), *(f"({', '.join(x)})" for x in (one.factors, one.others, other.others))]
    return parsed(f"{one.name}, {other.name} = {NAME}({', '.join(given)})").body[0]
