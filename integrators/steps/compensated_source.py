"""Steps whose additions to q and v are compensated: their source, rewritten from that of the plain step."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from fractions import Fraction

from integrators.method import MethodError
from integrators.steps.compensated import LOST
from integrators.steps.terms import Number, literal


def noting(number: Number, exact: dict[float, Fraction]) -> Number:
    """``number`` that also notes which coefficient each float literal stands for."""

    def noted(value: Fraction) -> str:
        if number is literal:
            exact[float(value)] = value
        return number(value)

    return noted


def compensate(source: str, name: str, memory: int, exact: Mapping[float, Fraction], glides: bool) -> str:
    """The source of a step, with its additions to q and v compensated; it calls ``added`` and ``scaled``.

    ::

        step(t, q, v, *memory, lost_q, lost_v, h, *extra)  ->  (q, v, *memory, lost_q, lost_v, *increments)

    Args:
        source: as :func:`integrators.unroll` writes it.
        name: of the method, for messages; ``memory``: how many values it hands on.
        exact: the coefficient of each float literal.
        glides: True if the hooks ``kick`` and ``push`` do more than ``v + h a``: their result is taken as it is, and
            a velocity of zero is zero.

    Raises MethodError for a step whose results are not sums of q and v and increments.
    """
    start = next(node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef) and node.name == "step")
    before = source.splitlines()[: start.lineno - 1]
    writer = _Writer(name, memory, exact, glides, _ends(start.body[-1]))
    for statement in start.body[1:]:
        writer.take(statement)
    names = [argument.arg for argument in start.args.args]
    at = names.index("h")
    signature = ", ".join([*names[:at], *LOST, *names[at:]])
    doc = ast.unparse(start.body[0])
    return "\n".join([*before, f"def step({signature}):",
                      *(f"    {line}" for line in [doc, *writer.scales, *writer.lines]), ""])


class _Writer:
    """Rewrites the statements of one step."""

    def __init__(
        self, name: str, memory: int, exact: Mapping[float, Fraction], glides: bool, ends: Mapping[str, str]
    ) -> None:
        self.name, self.memory, self.exact, self.glides, self.ends = name, memory, exact, glides, ends
        self.scales: list[str] = []
        self.lines: list[str] = []
        self._known: dict[str, tuple[ast.expr, ast.expr | None]] = {}

    def take(self, statement: ast.stmt) -> None:
        """One statement: additions to q or v and the results are rewritten, stages get low parts."""
        if isinstance(statement, ast.Return):
            self._return(statement)
            return
        made = _made(statement)
        if isinstance(statement, ast.If) and not {"q", "v", *self.ends} & set(made):
            self.lines += ast.unparse(statement).splitlines()
            return
        if len(made) == 1 and made[0] in self.ends and isinstance(statement, ast.Assign):
            self._add(self.ends[made[0]], made[0], statement.value)
            return
        changed = [y for y in "qv" if y in made]
        if not changed:
            self.lines.append(ast.unparse(_Stages(self._parts).visit(statement)))
        elif isinstance(statement, ast.Assign) and made == changed and len(made) == 1:
            if isinstance(statement.value, ast.Call):
                self._flow(made, statement.value)
            else:
                self._add(made[0], made[0], statement.value)
        elif isinstance(statement, ast.Assign) and changed == ["v"] == made[:1] and isinstance(
                statement.value, ast.Call):
            self._flow(made, statement.value)
        else:
            raise self._unfit()

    def _return(self, statement: ast.Return) -> None:
        if not isinstance(statement.value, ast.Tuple):
            raise self._unfit()
        results = statement.value.elts
        ends = []
        for y, result in zip("qv", results, strict=False):
            if isinstance(result, ast.Name) and (result.id == y or result.id in self.ends):
                ends.append(result.id)
                continue
            ends.append(f"{y}_end")
            self._add(y, f"{y}_end", result)
        rest = [ast.unparse(result) for result in results[2:]]
        self.lines.append(f"return {', '.join([*ends, *rest[: self.memory], *LOST, *rest[self.memory :]])}")

    def _add(self, y: str, to: str, total: ast.expr) -> None:
        """``to = total``, a sum that begins with q or v."""
        change = _without(y, total)
        if change is None:
            raise self._unfit()
        self._added(y, to, change)

    def _added(self, y: str, to: str, change: ast.expr) -> None:
        high, low = self._parts(change)
        rest = "0.0" if low is None else ast.unparse(low)
        self.lines.append(f"{to}, lost_{y} = added({y}, lost_{y}, {ast.unparse(high)}, {rest})")

    def _flow(self, made: list[str], call: ast.Call) -> None:
        """A velocity from a sub-flow, and increments of quadratures."""
        function = ast.unparse(call.func)
        if made[0] != "v":
            raise self._unfit()
        if function in ("kick", "push") and not self.glides:
            self.lines.append(f"{', '.join(['_', *made[1:]])} = {ast.unparse(call)}")
            self._added("v", "v", ast.BinOp(call.args[4], ast.Mult(), call.args[3]))
            return
        self.lines.append(f"{', '.join(['w', *made[1:]])} = {ast.unparse(call)}")
        if function != "drag":
            self.lines.append("lost_v = 0.0 if w == 0.0 else lost_v")
        self.lines.append("v, lost_v = added(v, lost_v, w - v, 0.0)")

    def _unfit(self) -> MethodError:
        return MethodError(
            f"{self.name} cannot be compensated: its step is no sum of the old state and increments."
        )

    # --- an increment and its low part --------------------------------------------------------------------------

    def _parts(self, node: ast.expr) -> tuple[ast.expr, ast.expr | None]:
        """An expression as it is computed, and what that leaves out by rounding of coefficients; None for nothing."""
        value = _number(node)
        if value is not None:
            return node, self._low(value)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            high, low = self._parts(node.operand)
            return ast.UnaryOp(node.op, high), None if low is None else ast.UnaryOp(node.op, low)
        if not isinstance(node, ast.BinOp):
            return node, None
        if isinstance(node.op, ast.Mult) and _is_step(node.right) and _fixed(node.left):
            return self._scale(node)
        (left, low_left), (right, low_right) = self._parts(node.left), self._parts(node.right)
        high = ast.BinOp(left, node.op, right)
        if isinstance(node.op, ast.Mult):
            return high, _sum(
                None if low_left is None else ast.BinOp(low_left, node.op, right),
                None if low_right is None else ast.BinOp(left, node.op, low_right),
            )
        if isinstance(node.op, (ast.Add, ast.Sub)):
            return high, _sum(low_left, low_right, node.op)
        if isinstance(node.op, ast.Div) and low_right is None:
            return high, None if low_left is None else ast.BinOp(low_left, node.op, right)
        raise self._unfit()

    def _low(self, value: float) -> ast.expr | None:
        """What a float literal leaves out of its coefficient."""
        sense = 1 if value in self.exact else -1
        low = float(sense * self.exact.get(sense * value, Fraction(sense * value)) - Fraction(value))
        return ast.parse(repr(low), mode="eval").body if low else None

    def _scale(self, node: ast.BinOp) -> tuple[ast.expr, ast.expr | None]:
        """A coefficient times the step, which are the same in all steps, made once with its low part."""
        factor, low = self._parts(node.left)
        value = _number(factor)
        if value is not None and low is None and abs(math.frexp(value)[0]) == 0.5:
            return node, None
        text = ast.unparse(node)
        if text not in self._known:
            names = f"h_{len(self.scales) + 1}", f"low_{len(self.scales) + 1}"
            rest = "0.0" if low is None else ast.unparse(low)
            self.scales.append(f"{', '.join(names)} = scaled({ast.unparse(factor)}, {rest}, h)")
            self._known[text] = ast.Name(names[0]), ast.Name(names[1])
        return self._known[text]


class _Stages(ast.NodeTransformer):
    """Puts low parts into the stages' sums, which begin with q or v."""

    def __init__(self, parts: Callable[[ast.expr], tuple[ast.expr, ast.expr | None]]) -> None:
        self.parts = parts

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        for y in "qv":
            change = _without(y, node)
            if change is not None:
                high, low = self.parts(change)
                total = high if low is None else ast.BinOp(high, ast.Add(), low)
                return ast.BinOp(ast.Name(y), ast.Add(), total)
        return node


def _ends(last: ast.stmt) -> dict[str, str]:
    """Names, other than their own, that q and v have where a step returns them, and whose they are."""
    results = last.value.elts[:2] if isinstance(last, ast.Return) and isinstance(last.value, ast.Tuple) else []
    named = {result.id: y for y, result in zip("qv", results, strict=False) if isinstance(result, ast.Name)}
    return {name: y for name, y in named.items() if name != y}


def _made(statement: ast.stmt) -> list[str]:
    """The names that a statement sets, in order."""
    return [node.id for node in ast.walk(statement) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]


def _without(y: str, node: ast.expr) -> ast.expr | None:
    """What a sum adds to its first term, y; None if that is not its first term."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub))):
        return None
    if isinstance(node.left, ast.Name) and node.left.id == y:
        return node.right if isinstance(node.op, ast.Add) else ast.UnaryOp(ast.USub(), node.right)
    left = _without(y, node.left)
    return None if left is None else ast.BinOp(left, node.op, node.right)


def _number(node: ast.expr) -> float | None:
    """The value of a float literal, with its sign."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        value = _number(node.operand)
        return None if value is None else -value
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, float) else None


def _is_step(node: ast.expr) -> bool:
    return isinstance(node, ast.Name) and node.id == "h"


def _fixed(node: ast.expr) -> bool:
    """True for products of float literals and the step."""
    if isinstance(node, ast.BinOp):
        return isinstance(node.op, ast.Mult) and _fixed(node.left) and _fixed(node.right)
    return _is_step(node) or _number(node) is not None


def _sum(left: ast.expr | None, right: ast.expr | None, op: ast.operator | None = None) -> ast.expr | None:
    """Two terms, or the one that is there."""
    op = ast.Add() if op is None else op
    if right is None:
        return left
    if left is None:
        return right if isinstance(op, ast.Add) else ast.UnaryOp(ast.USub(), right)
    return ast.BinOp(left, op, right)
