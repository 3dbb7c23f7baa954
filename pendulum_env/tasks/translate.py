"""Translation of a user's Python functions into plain functions that generated programs can copy.

A program is a text that Python interprets or numba compiles, with the same bits. So a function's source is read,
checked against the small part of Python that both treat alike, and written anew: numbers from outside become constants,
and sin, cos, exp, log, sqrt, atan2 and pow, of ``math`` or numpy, become the package's own, which give the same bits on
all machines. Nothing is compiled here. A function that cannot be translated is refused, with the line and the syntax
that is allowed.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import types
from collections.abc import Callable, Mapping
from itertools import count
from typing import Any

import numpy as np

from pendulum_env.common.checks import SceneError, shown
from pendulum_env.common.sources import FunctionSource, ReadingError, source_of
from pendulum_env.engine.translated import LIBRARY, POWERS, Piece, built
from pendulum_env.physics import elementary
from pendulum_env.physics.arctangent import atan2

Function = Callable[..., Any]


class TaskError(SceneError):
    """Error for a task that cannot be used: its functions, names, starts or rewards."""


KNOWN: Mapping[Any, Function] = {
    math.sin: elementary.sin, np.sin: elementary.sin, elementary.sin: elementary.sin,
    math.cos: elementary.cos, np.cos: elementary.cos, elementary.cos: elementary.cos,
    math.exp: elementary.exp, np.exp: elementary.exp, elementary.exp: elementary.exp,
    math.log: elementary.log, np.log: elementary.log, elementary.log: elementary.log,
    math.pow: elementary.power, np.power: elementary.power, elementary.power: elementary.power,
    math.sqrt: elementary.sqrt, np.sqrt: elementary.sqrt,
    math.atan2: atan2, np.arctan2: atan2, atan2: atan2,
    math.fabs: abs, np.abs: abs, abs: abs, min: min, np.minimum: min, max: max, np.maximum: max,
}
"""Functions that a task's functions may call -> the function that stands for them in programs."""
CALLABLE = "abs, min, max, sin, cos, exp, log, sqrt, pow, atan2 and plain functions of your own"
"""The functions that may be called, in words."""
ALLOWED = f"assignments, if and else, + - * / **, comparisons, and, or, not, & and |, and calls of {CALLABLE}"
"""The part of Python that may be used, in words."""
OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div)
COMPARISONS = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)


class Translator:
    """Translator of the functions of one task; helpers that several of them call are translated once.

    ``task`` is the task's name, for messages.
    """

    def __init__(self, task: str) -> None:
        self.task = task
        self.pieces: list[Piece] = []
        self.made: dict[str, types.FunctionType] = {}
        self.truths: set[str] = set()
        self._names: dict[types.FunctionType, str] = {}
        self._under_way: set[types.FunctionType] = set()

    def plain(self, function: Any, role: str = "") -> types.FunctionType:
        """Return a function as a plain one, with the same arguments, whose source can be copied.

        ``role`` is the argument of Task that holds it, "" for a helper. Raises TaskError for one that cannot be
        translated.
        """
        if not isinstance(function, types.FunctionType):
            raise TaskError(f"{role or 'A helper'} of the task {shown(self.task)} must be a plain function made with "
                            f"def or lambda, not {shown(function)}.")
        if is_ours(function):
            return function
        if function in self._names:
            return self.made[self._names[function]]
        if function in self._under_way:
            raise self.error(function, "calls itself")
        self._under_way.add(function)
        writer = _Writer(self, function, role)
        piece = writer.written(self._free_name(function))
        self.pieces.append(piece)
        self._names[function] = piece.name
        if writer.returns is True:
            self.truths.add(piece.name)
        self.made = built(self.pieces)
        return self.made[piece.name]

    def _free_name(self, function: types.FunctionType) -> str:
        """Return a name for a translated function that no other function of a program has."""
        name = "task_" + ("lambda" if function.__name__ == "<lambda>" else function.__name__)
        taken = {piece.name for piece in self.pieces}
        return name if name not in taken else next(
            other for k in count(2) if (other := f"{name}_{k}") not in taken)

    def error(self, function: types.FunctionType, why: str, node: ast.AST | None = None) -> TaskError:
        """Return the error that a function cannot be translated, with its line and the syntax that is allowed."""
        line = getattr(node, "lineno", None)
        place = f" (line {line})" if line else ""
        return TaskError(f"The function {function.__name__} of the task {shown(self.task)}{place} {why}; allowed are "
                         f"{ALLOWED}.")


def is_ours(function: types.FunctionType) -> bool:
    """Return True for a function of the package, whose source is copied as it stands."""
    return (function.__module__ or "").startswith("pendulum_env.tasks") and function.__closure__ is None


def source_in(function: types.FunctionType, task: str) -> FunctionSource:
    """Return the source of a task's function; TaskError, with the reason, where it cannot be read."""
    try:
        return source_of(function)
    except ReadingError as error:
        remedy = ("; write it in a file or a notebook, not at a prompt or in a text for exec"
                  if str(error) == "cannot be read" else "")
        raise TaskError(f"The source of {function.__name__} of the task {shown(task)} {error}{remedy}.") from None


class _Writer:
    """Writer of one translated function: its statements and expressions, each with its kind, a number or a truth."""

    def __init__(self, translator: Translator, function: types.FunctionType, role: str) -> None:
        self.translator, self.function, self.role = translator, function, role
        self.source = source_in(function, translator.task)
        self.node = self.source.node
        closure = function.__closure__ or ()
        self.outside: dict[str, Any] = dict(zip(function.__code__.co_freevars, closure, strict=True))
        self.constants: dict[str, float] = {}
        self.local: set[str] = set()
        self.kinds: dict[str, bool] = {}
        self.calls: dict[str, None] = {}
        self.returns: bool | None = None

    def written(self, name: str) -> Piece:
        """Return the translated function under a name."""
        node, given = self.node, self.node.args
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
        return Piece(name, ast.unparse(ast.fix_missing_locations(made)) + "\n", tuple(self.calls))

    def named(self, name: str) -> str:
        """Return the translated name of a local variable: another one where it is that of a function of programs."""
        return f"{name}_value" if name in self.shadows else name

    def error(self, why: str, node: ast.AST) -> TaskError:
        """Return the error that this function cannot be translated."""
        return self.translator.error(self.function, why, node)

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

    def looked_up(self, node: ast.expr) -> Any:
        """Return the object for which a name, or a chain of a module's attributes, stands when the task is made."""
        if isinstance(node, ast.Attribute):
            module = self.looked_up(node.value)
            if isinstance(module, types.ModuleType) and hasattr(module, node.attr):
                return getattr(module, node.attr)
        if not isinstance(node, ast.Name):
            raise self.error(f"uses {ast.unparse(node)}", node)
        if node.id in self.outside:
            try:
                return self.outside[node.id].cell_contents
            except ValueError:
                raise self.error(f"uses {node.id}, which has no value yet", node) from None
        for names in (self.function.__globals__, vars(builtins)):
            if node.id in names:
                return names[node.id]
        raise self.error(f"uses {node.id}, which is not defined", node)

    def operation(self, node: ast.BinOp, known: frozenset[str]) -> ast.expr:
        """Return a translated operation; powers with a whole exponent from 2 to 8 become products."""
        base, other = self.value(node.left, known), self.value(node.right, known)
        if isinstance(node.op, OPERATORS):
            return ast.BinOp(base, node.op, other)
        if not isinstance(node.op, ast.Pow):
            raise self.error(f"uses {_named(node.op)}", node)
        exponent = other.value if isinstance(other, ast.Constant) and isinstance(other.value, float) else 0.0
        if exponent == 1.0:
            return base
        if exponent in POWERS:
            return self.calling(POWERS[exponent], [base])
        return self.calling(elementary.sqrt, [base]) if exponent == 0.5 else self.calling(elementary.power,
                                                                                          [base, other])

    def calling(self, function: Function, given: list[ast.expr]) -> ast.expr:
        """Return the call of a function that programs know, or that has been translated."""
        if getattr(builtins, function.__name__, None) is not function:
            self.calls[function.__name__] = None
        return ast.Call(ast.Name(function.__name__, ast.Load()), given, [])

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
        try:
            own = KNOWN.get(function)
        except TypeError:  # an object without a hash
            own = None
        if own is not None:
            least, most = (2, 8) if own in (min, max) else (2, 2) if own in (elementary.power, atan2) else (1, 1)
        elif isinstance(function, types.FunctionType):
            own = self.translator.plain(function)
            least = most = len(inspect.signature(own).parameters)
        else:
            raise self.error(f"calls {said}", node)
        if not least <= len(given) <= most:
            wanted = f"{least}" if least == most else f"{least} or more"
            raise self.error(f"calls {said} with {len(given)} arguments and not {wanted}", node)
        return self.calling(own, given), own.__name__ in self.translator.truths


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
