"""Translation of a task's functions: a small part of Python, which blocks of environments can compute, too.

Functions are read as those of effects are (:mod:`pendulum_env.engine.reading`), and besides every expression has a
kind, a number or a condition. A function that cannot be translated is refused, with the line and the syntax that is
allowed.
"""

from __future__ import annotations

import ast
import math
from functools import reduce
from inspect import signature
from types import FunctionType
from typing import Any

import numpy as np

from pendulum_env.common.checks import SceneError, shown
from pendulum_env.engine.reading import CALLABLE, FunctionWriter, Reader, arguments, own_names
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
    """Writer of one function of a task, whose expressions each have a kind: a number or a condition."""

    def __init__(self, translator: Translator, function: FunctionType, role: str) -> None:
        super().__init__(translator, function)
        self.translator, self.role = translator, role
        names, values = arguments(function)[:function.__code__.co_argcount], function.__defaults__ or ()
        self.defaults = dict(zip(names[len(names) - len(values):], values, strict=True))
        self.local -= {*self.defaults}
        self.given -= {*self.defaults}
        self.variables = {self.renamed.get(name, name) for name in self.local}
        self.kinds = dict.fromkeys(names, False)
        self.returns: bool | None = None

    def constant(self, value: Any) -> ast.expr | None:
        return super().constant(value.item() if isinstance(value, np.generic) else value)

    def looked_up(self, node: ast.expr) -> Any:
        """Return what stands outside; so do the defaults of arguments, which are numbers that the function keeps."""
        name = node.id if isinstance(node, ast.Name) else ""
        return self.defaults[name] if name in self.defaults else super().looked_up(node)

    def written(self, name: str) -> str:
        text = super().written(name)
        if self.returns is True:
            self.translator.truths.add(name)
        return text

    def arguments(self) -> list[str]:
        node, given = self.source.node, self.source.node.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs:
            raise self.error("has *, / or ** among its arguments", node)
        if changed := {*own_names(ast.Module(self.source.body, []))} & {*self.defaults}:
            raise self.error(f"assigns {min(changed)}, an argument with a default", node)
        return [one.arg for one in given.args if one.arg not in self.defaults]

    def statements(self, body: list[ast.stmt]) -> list[ast.stmt]:
        known, lines = self.block(body, frozenset(self.arguments()))
        if known is not None:
            raise self.error("does not return a value on every path", self.source.node)
        return lines

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
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            old = ast.copy_location(ast.Name(node.target.id, ast.Load()), node)
            target, value = node.target, ast.copy_location(ast.BinOp(old, node.op, node.value), node)
        if not isinstance(target, ast.Name) or value is None:
            raise self.error(f"uses {_named(node)}", node)
        made, kind = self.expression(value, known)
        if self.kinds.setdefault(target.id, kind) is not kind:
            raise self.error(f"assigns a number and a condition to {target.id}", node)
        return known | {target.id}, ast.Assign([target], made)

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
            return (node, True) if isinstance(node.value, bool) else (self.number(node), False)
        if isinstance(node, ast.Name) and node.id in self.variables:
            if node.id not in known:
                raise self.error(f"uses {node.id.removesuffix('_value')} where it may have no value", node)
            return node, self.kinds[node.id]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            return ast.Compare(self.truth(node.operand, known), [ast.Eq()], [ast.Constant(False)]), True
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            return ast.UnaryOp(node.op, self.value(node.operand, known)), False
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.BitAnd, ast.BitOr)):
            return ast.BinOp(self.truth(node.left, known), node.op, self.truth(node.right, known)), True
        if isinstance(node, ast.BinOp):
            base, exponent = self.value(node.left, known), self.value(node.right, known)
            if isinstance(node.op, ast.Pow):
                return ast.Call(self.called(elementary.power), [base, exponent], []), False
            if not isinstance(node.op, OPERATORS):
                raise self.error(f"uses {_named(node.op)}", node)
            return ast.BinOp(base, node.op, exponent), False
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
            links: list[ast.expr] = [ast.Compare(sides[i], [op], [sides[i + 1]]) for i, op in enumerate(node.ops)]
            return reduce(lambda left, right: ast.BinOp(left, ast.BitAnd(), right), links), True
        if isinstance(node, ast.IfExp):
            test = self.truth(node.test, known)
            (first, kind), (second, other) = self.expression(node.body, known), self.expression(node.orelse, known)
            if kind is not other:
                raise self.error("chooses between a number and a condition", node)
            return ast.IfExp(test, first, second), kind
        if isinstance(node, ast.Call):
            return self.call(node, known)
        raise self.error(f"uses {_named(node)}", node)

    def number(self, node: ast.Constant) -> ast.expr:
        """Return a constant as a float; TaskError for one that is not a finite number."""
        try:
            number = float(node.value)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            raise self.error(f"uses {shown(node.value)}, which is not a finite number", node)
        return ast.Constant(number)

    def call(self, node: ast.Call, known: frozenset[str]) -> tuple[ast.expr, bool]:
        """Return a translated call, and True if it returns a condition."""
        said = ast.unparse(node.func)
        if node.keywords or any(isinstance(part, ast.Starred) for part in node.args):
            raise self.error(f"calls {said} with keywords or *", node)
        if said in self.variables:
            raise self.error(f"calls {said}, which is a number", node)
        given = [self.value(part, known) for part in node.args]
        if said == "float" and len(given) == 1:
            return given[0], False
        if said in ("abs", "min", "max"):
            least, most = (1, 1) if said == "abs" else (2, 8)
        elif said in self.calls:
            least = most = len(signature(self.calls[said]).parameters)
        else:
            raise self.error(f"calls {said}", node)
        if not least <= len(given) <= most:
            wanted = f"{least}" if least == most else f"{least} or more"
            raise self.error(f"calls {said.removeprefix('task_')} with {len(given)} arguments and not {wanted}", node)
        return ast.Call(node.func, given, []), said in self.translator.truths


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
