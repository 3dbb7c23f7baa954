"""Translation of a task's functions: a small part of Python, which blocks of environments can compute, too.

Functions are read as those of effects are (:mod:`pendulum_env.engine.reading`), and besides every expression has a
kind, a number or a condition. A function that cannot be translated is refused, with the line and the syntax that is
allowed.
"""

from __future__ import annotations

import ast
import math
from inspect import signature
from types import FunctionType
from typing import Any

import numpy as np

from pendulum_env.common.checks import SceneError, shown
from pendulum_env.engine.reading import CALLABLE, LIBRARY, FunctionWriter, Reader
from pendulum_env.physics import elementary


class TaskError(SceneError):
    """Error for a task that cannot be used: its functions, names, starts or rewards."""


OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div)
COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)


class Translator(Reader):
    """Reader of the functions of one task. Helpers may return a number or a condition.

    Attributes:
        task: the task's name, for messages.
        truths: names of the helpers that return a condition.
    """

    error_class = TaskError
    allowed = "allowed are assignments, if and else, + - * / **, comparisons, and, or, not, & and |, " \
        f"and calls of {CALLABLE}"

    def __init__(self, task: str) -> None:
        super().__init__(f" of the task {shown(task)}")
        self.task = task
        self.truths: set[str] = set()

    def plain(self, function: Any, role: str = "") -> FunctionType:
        """Return a function as a plain one, as :meth:`Reader.plain` does; ``role`` is the argument of Task that holds
        it. Raises TaskError for one that cannot be translated.
        """
        if not isinstance(function, FunctionType):
            raise TaskError(f"{role or 'A helper'} of the task {shown(self.task)} must be a plain function made with "
                            f"def or lambda, not {shown(function)}.")
        return super().plain(function, role)

    def keeps(self, function: FunctionType) -> bool:
        return is_ours(function)

    def writer(self, function: FunctionType, role: str) -> TaskWriter:
        return TaskWriter(self, function, role)

    def name_of(self, function: FunctionType, role: str) -> str:
        return self.free_name("task_" + ("lambda" if function.__name__ == "<lambda>" else function.__name__))


def is_ours(function: FunctionType) -> bool:
    """Return True for a function of the package's tasks, whose source is copied as it stands."""
    return (function.__module__ or "").startswith("pendulum_env.tasks") and function.__closure__ is None


class TaskWriter(FunctionWriter):
    """Writer of one translated function: its statements and expressions, each with its kind, a number or a truth."""

    def __init__(self, translator: Translator, function: FunctionType, role: str) -> None:
        super().__init__(translator, function)
        self.translator, self.role = translator, role
        self.constants: dict[str, float] = {}
        self.kinds: dict[str, bool] = {}
        self.returns: bool | None = None

    def written(self, name: str) -> str:
        node, given = self.source.node, self.source.node.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs:
            raise self.error("has *, / or ** among its arguments", node)
        names = [argument.arg for argument in given.args]
        defaults = self.function.__defaults__ or ()
        for one, value in zip(names[len(names) - len(defaults):], defaults, strict=True):
            self.constants[one] = self.number(value, one, node)
        arguments = [one for one in names if one not in self.constants]
        assigned = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)
                    and isinstance(part.ctx, ast.Store)}
        if changed := assigned & {*self.constants}:
            raise self.error(f"assigns {min(changed)}, an argument with a default", node)
        self.local, self.kinds = {*arguments, *assigned}, dict.fromkeys(arguments, False)
        self.shadows = {*LIBRARY, "abs", "min", "max"} & self.local
        known, lines = self.block(self.source.body, frozenset(arguments))
        if known is not None:
            raise self.error("does not return a value on every path", node)
        made = ast.FunctionDef(
            name=name, args=ast.arguments(posonlyargs=[], args=[ast.arg(self.named(one)) for one in arguments],
                                          kwonlyargs=[], kw_defaults=[], defaults=[]),
            body=lines, decorator_list=[])
        made.type_params = []  # type: ignore[attr-defined]  # wanted by Python 3.12 and later
        if self.returns is True:
            self.translator.truths.add(name)
        return ast.unparse(ast.fix_missing_locations(made)) + "\n"

    def named(self, name: str) -> str:
        """Return the translated name of a local variable: another one where it is that of a function of programs."""
        return f"{name}_value" if name in self.shadows else name

    # --- statements -------------------------------------------------------------------------------------------------

    def block(
        self, statements: list[ast.stmt], known: frozenset[str]
    ) -> tuple[frozenset[str] | None, list[ast.stmt]]:
        """Return the names that have a value after statements, None if these return, and the translated statements."""
        lines: list[ast.stmt] = []
        after: frozenset[str] | None = known
        for statement in statements:
            if after is None:
                break  # never reached
            text = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
            if text or isinstance(statement, ast.Pass):
                continue
            after, line = self.statement(statement, after)
            lines.append(line)
        return after, lines or [ast.Pass()]

    def statement(self, node: ast.stmt, known: frozenset[str]) -> tuple[frozenset[str] | None, ast.stmt]:
        """Return the names that have a value after a statement, None if it returns, and the translated statement."""
        if isinstance(node, ast.Return):
            return None, self.returned(node, known)
        if isinstance(node, ast.If):
            test = self.truth(node.test, known)
            after, body = self.block(node.body, known)
            other, rest = self.block(node.orelse, known) if node.orelse else (known, [])
            both = other if after is None else after if other is None else after & other
            return both, ast.If(test, body, rest)
        target, value = None, None
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            target, value = node.targets[0], node.value
        elif isinstance(node, ast.AnnAssign):
            target, value = node.target, node.value
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            old = ast.copy_location(ast.Name(node.target.id, ast.Load()), node)
            target, value = node.target, ast.copy_location(ast.BinOp(old, node.op, node.value), node)
        if not isinstance(target, ast.Name) or value is None:
            raise self.error(f"uses {_named(node)}", node)
        made, kind = self.expression(value, known)
        if self.kinds.setdefault(target.id, kind) is not kind:
            raise self.error(f"assigns a number and a condition to {target.id}", node)
        return known | {target.id}, ast.Assign([ast.Name(self.named(target.id), ast.Store())], made)

    def returned(self, node: ast.Return, known: frozenset[str]) -> ast.stmt:
        """Return a translated return statement: of a number, of a condition (lost), or of two numbers (start)."""
        if node.value is None:
            raise self.error("returns nothing", node)
        if self.role == "start":
            if not (isinstance(node.value, ast.Tuple) and len(node.value.elts) == 2):
                raise self.error("must return two numbers, angle and velocity", node)
            return ast.Return(ast.Tuple([self.value(part, known) for part in node.value.elts], ast.Load()))
        if self.role == "lost":
            return ast.Return(self.truth(node.value, known))
        if self.role:
            return ast.Return(self.value(node.value, known))
        made, kind = self.expression(node.value, known)
        if self.returns is not None and self.returns is not kind:
            raise self.error("returns a number in one place and a condition in another", node)
        self.returns = kind
        return ast.Return(made)

    # --- expressions ------------------------------------------------------------------------------------------------

    def value(self, node: ast.expr, known: frozenset[str]) -> ast.expr:
        """Return a translated number; a condition becomes 1.0 where it is true, else 0.0."""
        made, kind = self.expression(node, known)
        return ast.IfExp(made, ast.Constant(1.0), ast.Constant(0.0)) if kind else made

    def truth(self, node: ast.expr, known: frozenset[str]) -> ast.expr:
        """Return a translated condition."""
        made, kind = self.expression(node, known)
        if not kind:
            raise self.error("has a number where a condition is wanted, such as phi > 0.5", node)
        return made

    def expression(self, node: ast.expr, known: frozenset[str]) -> tuple[ast.expr, bool]:
        """Return a translated expression, and True if it is a condition, False if it is a number."""
        if isinstance(node, ast.Constant):
            if isinstance(node.value, bool):
                return ast.Constant(node.value), True
            return _literal(self.number(node.value, "a constant", node)), False
        if isinstance(node, ast.Name) and node.id in self.local:
            if node.id not in known:
                raise self.error(f"uses {node.id} where it may have no value", node)
            return ast.Name(self.named(node.id), ast.Load()), self.kinds[node.id]
        if isinstance(node, ast.Name) and node.id in self.constants:
            return _literal(self.constants[node.id]), False
        if isinstance(node, (ast.Name, ast.Attribute)):
            return _literal(self.number(self.looked_up(node), ast.unparse(node), node)), False
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return ast.Compare(self.truth(node.operand, known), [ast.Eq()], [ast.Constant(False)]), True
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            return ast.UnaryOp(node.op, self.value(node.operand, known)), False
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.BitAnd, ast.BitOr)):
            return ast.BinOp(self.truth(node.left, known), node.op, self.truth(node.right, known)), True
        if isinstance(node, ast.BinOp):
            return self.operation(node, known), False
        if isinstance(node, ast.BoolOp):
            parts = [self.truth(part, known) for part in node.values]
            made = parts[-1]
            for part in reversed(parts[:-1]):  # as Python does, without the second part where the first decides
                made = (ast.IfExp(part, made, ast.Constant(False)) if isinstance(node.op, ast.And)
                        else ast.IfExp(part, ast.Constant(True), made))
            return made, True
        if isinstance(node, ast.Compare):
            if not all(isinstance(op, COMPARISONS) for op in node.ops):
                raise self.error("compares with is or in", node)
            sides = [self.value(side, known) for side in (node.left, *node.comparators)]
            links = [ast.Compare(sides[i], [op], [sides[i + 1]]) for i, op in enumerate(node.ops)]
            return _chained(links, ast.BitAnd()), True
        if isinstance(node, ast.IfExp):
            test = self.truth(node.test, known)
            (first, kind), (second, other) = self.expression(node.body, known), self.expression(node.orelse, known)
            if kind is not other:
                raise self.error("chooses between a number and a condition", node)
            return ast.IfExp(test, first, second), kind
        if isinstance(node, ast.Call):
            return self.call(node, known)
        raise self.error(f"uses {_named(node)}", node)

    def number(self, value: Any, name: str, node: ast.AST) -> float:
        """Return a number from outside as a float; TaskError for anything else."""
        whole = isinstance(value, (int, float, np.floating, np.integer)) and not isinstance(value, bool)
        try:
            made = float(value) if whole else math.nan
        except OverflowError:
            made = math.nan
        if not math.isfinite(made):
            raise self.error(f"uses {name}, which is {shown(value)} and not a finite number", node)
        return made

    def operation(self, node: ast.BinOp, known: frozenset[str]) -> ast.expr:
        """Return a translated operation; powers with a whole exponent from 2 to 8 become products."""
        base, other = self.value(node.left, known), self.value(node.right, known)
        if isinstance(node.op, OPERATORS):
            return ast.BinOp(base, node.op, other)
        if not isinstance(node.op, ast.Pow):
            raise self.error(f"uses {_named(node.op)}", node)
        return self.power(base, other) or ast.Call(self.called(elementary.power), [base, other], [])

    def call(self, node: ast.Call, known: frozenset[str]) -> tuple[ast.expr, bool]:
        """Return a translated call, and True if it returns a condition."""
        said = ast.unparse(node.func)
        if node.keywords or any(isinstance(part, ast.Starred) for part in node.args):
            raise self.error(f"calls {said} with keywords or *", node)
        if isinstance(node.func, ast.Name) and node.func.id in {*self.local, *self.constants}:
            raise self.error(f"calls {said}, which is a number", node)
        function, given = self.looked_up(node.func), [self.value(part, known) for part in node.args]
        if function is float and len(given) == 1:
            return given[0], False
        own = self.stands_for(function)
        if own is None:
            raise self.error(f"calls {said}", node)
        least, most = (2, 8) if own in (min, max) else (1, 1) if own is abs else [len(signature(own).parameters)] * 2
        if not least <= len(given) <= most:
            wanted = f"{least}" if least == most else f"{least} or more"
            raise self.error(f"calls {said} with {len(given)} arguments and not {wanted}", node)
        return ast.Call(self.called(own), given, []), own.__name__ in self.translator.truths


def _chained(parts: list[Any], mark: ast.operator) -> ast.expr:
    """Return conditions joined by & or |."""
    whole: ast.expr = parts[0]
    for part in parts[1:]:
        whole = ast.BinOp(whole, mark, part)
    return whole


def _literal(value: float) -> ast.expr:
    """Return a number as an expression; a negative one as a negated constant."""
    made = ast.Constant(abs(value))
    return ast.UnaryOp(ast.USub(), made) if math.copysign(1.0, value) < 0.0 else made


def _named(node: ast.AST) -> str:
    """Return a statement, expression or operator in words."""
    return {
        "For": "a for loop", "While": "a while loop", "Try": "try", "With": "with", "Subscript": "an index",
        "List": "a list", "Dict": "a dict", "ListComp": "a list", "Tuple": "a tuple", "JoinedStr": "text",
        "Import": "import", "ImportFrom": "import", "Lambda": "a lambda inside", "FunctionDef": "a function inside",
        "Global": "global", "Nonlocal": "nonlocal", "Assert": "assert", "Raise": "raise", "Mod": "%",
        "FloorDiv": "//", "NamedExpr": ":=", "Assign": "an assignment to several names", "MatMult": "@",
        "Expr": "a line without effect", "BitXor": "^",
    }.get(type(node).__name__, type(node).__name__)
