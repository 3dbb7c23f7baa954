"""The one reader of users' functions: of an effect or of a task, as plain functions whose text programs can copy.

A program is a text that Python interprets or numba compiles, with the same bits. So a user's function is read from its
source and written anew where that matters:

- a number from outside the function becomes a constant;
- sin, cos, tanh, exp, log, sqrt, atan2 and pow, of ``math`` or numpy, become the package's own, which give the same
  bits on all machines;
- a power with a whole exponent becomes a product;
- a function that it calls is read, too.

Everything else stays as it stands. :mod:`pendulum_env.tasks.translate` allows less. Nothing is compiled here.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from copy import deepcopy
from functools import cache, lru_cache
from itertools import count, pairwise
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from pendulum_env.common.checks import shown
from pendulum_env.common.sources import FunctionSource, ReadingError, executed, ours, parsed, source_of
from pendulum_env.physics import elementary
from pendulum_env.physics.elementary import atan2

Function = Callable[..., Any]
MODULE = "pendulum_env.read"
"""Module of the functions that are made here; there is no file of this name."""
SCOPES = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp, ast.Lambda, ast.FunctionDef)
"""Parts of a function that have names of their own."""
REFUSED = (ast.Global, ast.Nonlocal, ast.Import, ast.ImportFrom)
"""Statements that a program cannot have."""
PROVIDED = frozenset({"NAN", "U", "inline", "entry", "lanes"})
"""Names that every program has, and that no function of a user may have."""


class ProgramError(ValueError):
    """Error for a function that a program cannot have, or for a program that cannot be translated."""


# --- what the functions may call --------------------------------------------------------------------------------------


def power2(x: float) -> float:
    return x * x


def power3(x: float) -> float:
    return x * x * x


def power4(x: float) -> float:
    return (x * x) * (x * x)


def power5(x: float) -> float:
    return (x * x) * (x * x) * x


def power6(x: float) -> float:
    return (x * x * x) * (x * x * x)


def power7(x: float) -> float:
    return (x * x * x) * (x * x * x) * x


def power8(x: float) -> float:
    return ((x * x) * (x * x)) * ((x * x) * (x * x))


POWERS: Mapping[float, Function] = {
    2.0: power2, 3.0: power3, 4.0: power4, 5.0: power5, 6.0: power6, 7.0: power7, 8.0: power8}
"""Whole exponent -> function that multiplies, with the same bits compiled and interpreted."""

LARGEST_PRODUCT = 1024
"""Largest whole exponent of a power that becomes a product."""

LIBRARY: Mapping[str, Function] = {
    "sin": elementary.sin, "cos": elementary.cos, "exp": elementary.exp, "log": elementary.log,
    "power": elementary.power, "sqrt": elementary.sqrt, "tanh": elementary.tanh, "atan2": atan2,
    **{function.__name__: function for function in POWERS.values()},
}
"""Functions of the package that the functions made here may call, by name."""

KNOWN: Mapping[Any, Function] = {
    math.sin: elementary.sin, np.sin: elementary.sin, elementary.sin: elementary.sin,
    math.cos: elementary.cos, np.cos: elementary.cos, elementary.cos: elementary.cos,
    math.tanh: elementary.tanh, np.tanh: elementary.tanh, elementary.tanh: elementary.tanh,
    math.exp: elementary.exp, np.exp: elementary.exp, elementary.exp: elementary.exp,
    math.log: elementary.log, np.log: elementary.log, elementary.log: elementary.log,
    math.pow: elementary.power, np.power: elementary.power, elementary.power: elementary.power,
    math.sqrt: elementary.sqrt, np.sqrt: elementary.sqrt,
    math.atan2: atan2, np.arctan2: atan2, atan2: atan2,
    math.fabs: abs, np.abs: abs, abs: abs, min: min, np.minimum: min, max: max, np.maximum: max,
}
"""Functions that users' functions may call -> the function that stands for them in programs."""
CALLABLE = "abs, min, max, sin, cos, tanh, exp, log, sqrt, pow, atan2 and plain functions of your own"
"""The functions that may be called, in words."""


# --- functions from texts ---------------------------------------------------------------------------------------------


class Piece(NamedTuple):
    """A function that was read, as text: it can be pickled, and equal texts give the same function.

    Attributes:
        name: its name in programs.
        text: its source.
        calls: names of the functions that it calls, of the package or read before it.
    """

    name: str
    text: str
    calls: tuple[str, ...]


def built(pieces: Iterable[Piece]) -> dict[str, FunctionType]:
    """Return the functions of pieces by name; equal texts give the same objects."""
    made: dict[str, FunctionType] = {}
    for piece in pieces:
        made[piece.name] = _made(piece.name, piece.text, tuple(
            (name, made.get(name) or LIBRARY[name]) for name in piece.calls))
    return made


@lru_cache(maxsize=512)
def _made(name: str, text: str, calls: tuple[tuple[str, Function], ...]) -> FunctionType:
    """Return the function of a text, which inspect can read again."""
    made: FunctionType = executed(text, name, {**dict(calls), "__name__": MODULE})[name]
    return made


@cache
def arguments(function: Function) -> tuple[str, ...]:
    """Return the names of a function's parameters, those of its own code, also if it stands for another function."""
    code = function.__code__
    return code.co_varnames[:code.co_argcount + code.co_kwonlyargcount]


def float_text(value: float) -> str:
    """Return a float as source text, also one that is infinite or not a number."""
    if math.isnan(value):
        return "float('nan')"
    return repr(float(value)) if math.isfinite(value) else "1e999" if value > 0 else "-1e999"


# --- reading ----------------------------------------------------------------------------------------------------------


class Reader:
    """Reader of the functions of one program or task; helpers that several of them call are read once.

    Attributes:
        of: what the functions belong to, for messages, such as " of the task 'balance'".
        pieces: the functions that were read, helpers before what calls them.
        looked_up: writer of a function, name or attribute from outside it, and the object for which that stood.
    """

    error_class: type[ValueError] = ProgramError
    allowed = f"from outside, a formula may use numbers, {CALLABLE}"
    """What a function may use, in words."""

    def __init__(self, of: str = "", taken: Collection[str] = ()) -> None:
        self.of = of
        self.pieces: list[Piece] = []
        self.looked_up: list[tuple[FunctionWriter, ast.expr, Any]] = []
        self._taken = {*taken, *LIBRARY, *PROVIDED, *vars(builtins)}
        self._made: dict[FunctionType, FunctionType] = {}
        self._forms: dict[FunctionType, tuple[Any, ...]] = {}
        self._under_way: set[FunctionType] = set()

    def plain(self, function: Any, role: str = "") -> FunctionType:
        """Return a function as a plain one, with the same arguments, whose text can be copied.

        ``role`` is what an effect or a task uses it for, "" for a helper; helpers get a name that is free. Raises the
        reader's error for a function that cannot be read.
        """
        if self.keeps(function):
            kept: FunctionType = function
            return kept
        if function not in self._made:
            if function in self._under_way:
                raise self.error(function, "calls itself")
            self._under_way.add(function)
            self._forms[function] = form_of(function)
            writer = self.writer(function, role)
            name = self.name_of(function, role)
            self._taken.add(name)  # before helpers, which may have the same name, are read
            text = writer.written(name)
            self.pieces.append(Piece(name, text, tuple(writer.calls)))
            self._made[function] = _made(name, text, tuple(writer.calls.items()))
        return self._made[function]

    def unchanged(self) -> bool:
        """Return True if the functions, and what they take from outside, are the same now; a notebook may change both.
        """
        return all(form == form_of(function) for function, form in self._forms.items()) and all(
            writer.looked_up(node) is value for writer, node, value in self.looked_up)

    def keeps(self, function: Any) -> bool:
        """Return True for a function of the package, whose text is copied as it stands."""
        return ours(function) and function.__closure__ is None

    def writer(self, function: FunctionType, role: str) -> FunctionWriter:
        """Return what writes a function anew."""
        return FunctionWriter(self, function)

    def name_of(self, function: FunctionType, role: str) -> str:
        """Return the name of a function in programs: its own, or for helpers one that no other function has."""
        if role and function.__name__ == "<lambda>":
            raise self.error_class("A torque must be a function made with def, not a lambda, so that it has a name.")
        return function.__name__ if role else self.free_name(function.__name__.replace("<lambda>", "own_lambda"))

    def free_name(self, name: str) -> str:
        """Return a name that no other function of a program has."""
        return next(other for k in count(1) if (other := name if k == 1 else f"{name}_{k}") not in self._taken)

    def source(self, function: FunctionType) -> FunctionSource:
        """Return the source of a function; the reader's error, with the reason, where it cannot be read."""
        try:
            return source_of(function)
        except ReadingError as error:
            remedy = "; write it in a file or a notebook, not at a prompt or in a text for exec"
            raise self.error_class(f"The source of {function.__name__}{self.of} {error}"
                                   f"{remedy if str(error) == 'cannot be read' else ''}.") from None

    def error(self, function: FunctionType, why: str, node: ast.AST | None = None) -> ValueError:
        """Return the error that a function cannot be read, with its line and what is allowed."""
        line = getattr(node, "lineno", None)
        place = f" (line {line})" if line else ""
        return self.error_class(f"The function {function.__name__}{self.of}{place} {why}; {self.allowed}.")


def form_of(function: FunctionType) -> tuple[Any, ...]:
    """Return the code and the defaults of a function, which may be replaced in place."""
    return function.__code__, function.__defaults__, function.__kwdefaults__


def own_names(node: ast.AST) -> Iterator[str]:
    """Yield the names that a function, a lambda or a comprehension sets: its arguments and variables.

    Names of functions and comprehensions inside it are left out, as Python does; one that ``:=`` sets is not.
    """
    for part in ast.iter_child_nodes(node):
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
            yield part.id
        elif isinstance(part, ast.arg):
            yield part.arg
        elif isinstance(part, SCOPES):
            yield from (one.target.id for one in ast.walk(part) if isinstance(one, ast.NamedExpr))
            if isinstance(part, ast.FunctionDef):
                yield part.name
        else:
            if isinstance(part, (ast.MatchAs, ast.MatchStar, ast.ExceptHandler)) and part.name:
                yield part.name
            yield from own_names(part)


def _count_of(function: Any) -> int:
    """Return the number of arguments of a function of math or numpy that programs know; 0 for any other function."""
    if isinstance(function, FunctionType) or not getattr(function, "__hash__", None):
        return 0
    own = KNOWN.get(function)
    return 0 if own in (None, min, max) else 1 if own in (abs, elementary.sqrt) else len(arguments(own))


class FunctionWriter(ast.NodeTransformer):
    """Writer of one function anew: what comes from outside the function is replaced, all else stays as it stands.

    Attributes:
        calls: the functions that it calls, by their names in programs.
        local: names of its arguments and variables.
        renamed: variable that has the name of a function of programs -> its name in the text.
    """

    def __init__(self, reader: Reader, function: FunctionType) -> None:
        self.reader, self.function = reader, function
        self.source = reader.source(function)
        code = function.__code__
        self.outside: dict[str, Any] = dict(zip(code.co_freevars, function.__closure__ or (), strict=True))
        self.local = {*own_names(self.source.node)}
        self.given = {*arguments(function)}
        self.names = {one.id if isinstance(one, ast.Name) else one.arg for one in ast.walk(self.source.node)
                      if isinstance(one, (ast.Name, ast.arg))}
        self.renamed = self._other_names(self.local - self.given)
        self.calls: dict[str, Function] = {}
        self.counting = False

    def written(self, name: str) -> str:
        """Return the text of the function under a name; with its comments, if nothing had to be replaced."""
        head = f"def {name}({', '.join(self.arguments())}):\n"
        before = self.source.body
        after = self.statements([self.visit(deepcopy(one)) for one in before])
        variables = {one.id if isinstance(one, ast.Name) else one.arg for part in after for one in ast.walk(part)
                     if isinstance(one, ast.arg) or (isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store))}
        if both := (self.given | variables).intersection(self.calls):
            raise self.error(f"calls {min(both)}, and has an argument or a variable of this name", self.source.node)
        if [*map(ast.dump, before)] == [*map(ast.dump, after)]:
            return head + self.source.body_text()
        return head + textwrap.indent(ast.unparse(ast.fix_missing_locations(ast.Module(after, []))), "    ") + "\n"

    def arguments(self) -> list[str]:
        """Return the texts of the function's arguments, with their defaults."""
        code, names = self.function.__code__, arguments(self.function)
        if code.co_flags & (inspect.CO_VARARGS | inspect.CO_VARKEYWORDS):
            raise self.error("has * or ** among its arguments", self.source.node)
        values, count = self.function.__defaults__ or (), code.co_argcount
        defaults = {**dict(zip(names[count - len(values):count], values, strict=True)),
                    **(self.function.__kwdefaults__ or {})}
        texts = [f"{name}={self._default(name, defaults[name])}" if name in defaults else name for name in names]
        if any("=" in one and "=" not in other for one, other in pairwise(texts)):
            raise self.error("has an argument without a default behind one with a default", self.source.node)
        return texts

    def statements(self, body: list[ast.stmt]) -> list[ast.stmt]:
        """Return the statements of the function, in which what comes from outside has been replaced."""
        return body

    def _default(self, name: str, value: Any) -> str:
        """Return the text of an argument's default; the reader's error for one that is not a number."""
        self.counting, before = True, self.counting
        number = self.constant(value)
        self.counting = before
        if number is None:
            raise self.error(f"has the default {shown(value)} for {name}", self.source.node)
        return ast.unparse(number)

    def _other_names(self, names: Iterable[str]) -> dict[str, str]:
        """Return, for variables with names of functions of programs, names that the function does not have."""
        return {name: next(other for k in count(1) if (other := f"{name}_value{k if k > 1 else ''}") not in self.names)
                for name in names if name in (*LIBRARY, "abs", "min", "max")}

    def error(self, why: str, node: ast.AST | None) -> ValueError:
        """Return the error that this function cannot be read."""
        return self.reader.error(self.function, why, node)

    # --- what stands outside ------------------------------------------------------------------------------------------

    def looked_up(self, node: ast.expr) -> Any:
        """Return the object for which a name, or a chain of a module's attributes, stands now."""
        if isinstance(node, ast.Attribute):
            module = self.looked_up(node.value)
            if isinstance(module, ModuleType) and hasattr(module, node.attr):
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

    def stands_for(self, value: Any) -> Function | None:
        """Return the function that stands in programs for one that is called; None if there is none."""
        try:
            own = KNOWN.get(value)
        except TypeError:  # an object without a hash
            return None
        return self.reader.plain(value) if own is None and isinstance(value, FunctionType) else own

    def called(self, function: Function) -> ast.expr:
        """Return the name of a function of programs, which this function calls."""
        if getattr(builtins, function.__name__, None) is not function:
            self.calls[function.__name__] = function
        return ast.Name(function.__name__, ast.Load())

    def power(self, base: ast.expr, exponent: ast.expr) -> ast.expr | None:
        """Return ``base**exponent`` for a constant exponent: whole ones as products, others as calls.

        Return None for an exponent that is no constant.
        """
        negative = isinstance(exponent, ast.UnaryOp) and isinstance(exponent.op, ast.USub)
        constant = exponent.operand if isinstance(exponent, ast.UnaryOp) and negative else exponent
        if not isinstance(constant, ast.Constant) or type(constant.value) not in (int, float):
            return None
        size = float(constant.value)  # type: ignore[arg-type]
        if size == 0.5 and not negative:
            return ast.Call(self.called(elementary.sqrt), [base], [])
        if size % 1.0 or size > LARGEST_PRODUCT:
            return ast.Call(self.called(elementary.power), [base, exponent], [])
        made = self._product(base, int(size))
        return ast.BinOp(ast.Constant(1.0), ast.Div(), made) if negative else made

    def _product(self, base: ast.expr, count: int) -> ast.expr:
        """Return ``base**count`` for a whole number from 0."""
        if count < 2:
            return base if count else ast.Constant(1.0)
        if count in POWERS:
            return ast.Call(self.called(POWERS[count]), [base], [])
        half = ast.Call(self.called(power2), [self._product(base, count // 2)], [])
        return ast.BinOp(half, ast.Mult(), deepcopy(base)) if count % 2 else half

    # --- the parts of a function --------------------------------------------------------------------------------------

    def constant(self, value: Any) -> ast.expr | None:
        """Return a number or a truth value as an expression; None for anything else.

        Numbers of NumPy other than float64 are none: Python computes with them in their own precision.
        """
        if isinstance(value, bool):
            return ast.Constant(value)
        if isinstance(value, int) and self.counting:
            return ast.Constant(int(value))
        if isinstance(value, int) and abs(value) <= 2**53:
            value = float(value)  # whole numbers of compiled programs overflow
        if type(value) in (float, np.float64):
            return parsed(float_text(float(value))).body[0].value  # type: ignore[attr-defined, no-any-return]
        return None

    def visit(self, node: ast.AST) -> Any:
        """Return what stands for a part of the function; comprehensions and inner functions have names of their own."""
        if isinstance(node, REFUSED):
            raise self.error(f"has the statement {ast.unparse(node)}", node)
        return self._scope(node) if isinstance(node, SCOPES) else super().visit(node)

    def _scope(self, node: Any) -> ast.AST:
        """Return a comprehension or a function inside, which have names of their own.

        Python computes the first sequence of a comprehension, and defaults, with the names around it.
        """
        inner = isinstance(node, (ast.Lambda, ast.FunctionDef))
        holder, fields = (node.args, ("defaults", "kw_defaults")) if inner else (node.generators[0], ("iter",))
        around: dict[str, Any] = {}
        for name in fields:
            value = getattr(holder, name)
            around[name] = [one and self.visit(one) for one in value] if inner else self.visit(value)
            setattr(holder, name, [] if inner else ast.Constant(0))
        outer, own = (self.local, self.renamed), {*own_names(node)}
        self.local, self.renamed = self.local | own, {a: b for a, b in self.renamed.items() if a not in own}
        self.generic_visit(node)
        self.local, self.renamed = outer
        vars(holder).update(around)
        if isinstance(node, ast.FunctionDef):
            node.name, node.returns = self.renamed.get(node.name, node.name), None
        made: ast.AST = node
        return made

    def visit_arg(self, node: ast.arg) -> ast.arg:
        """Leave out an annotation, whose names a program does not have."""
        return ast.copy_location(ast.arg(node.arg), node)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self.local or not isinstance(node.ctx, ast.Load):
            return ast.copy_location(ast.Name(self.renamed.get(node.id, node.id), node.ctx), node)
        return ast.copy_location(self._from_outside(node), node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        root: ast.expr = node
        while isinstance(root, ast.Attribute):
            root = root.value
        outside = isinstance(root, ast.Name) and root.id not in self.local
        return ast.copy_location(self._from_outside(node), node) if outside else self.generic_visit(node)

    def _from_outside(self, node: ast.expr) -> ast.expr:
        """Return what stands in a program for a name, or a module's attribute, from outside the function."""
        value = self.looked_up(node)
        self.reader.looked_up.append((self, node, value))
        if (number := self.constant(value)) is not None:
            return number
        if (own := self.stands_for(value)) is not None:
            return self.called(own)
        if isinstance(node, ast.Name) and value is not None and vars(builtins).get(node.id) is value:
            return node
        raise self.error(f"uses {ast.unparse(node)}, which is {shown(value)}", node)

    def visit_Call(self, node: ast.Call) -> Any:
        """Take math.pow and np.power as ``**``, so that a negative base may have a whole exponent."""
        said = ast.unparse(node.func)
        if not isinstance(node.func, (ast.Name, ast.Attribute)) or said.partition(".")[0] in self.local:
            return self.generic_visit(node)
        if said == "range":
            return self._counting(node)
        called = self.looked_up(node.func)
        count = _count_of(called)
        if count and (len(node.args) != count or node.keywords):
            raise self.error(f"calls {said} with other than {count} argument{'s' * (count > 1)}", node)
        if called in (math.pow, np.power):
            return self.visit_BinOp(ast.copy_location(ast.BinOp(node.args[0], ast.Pow(), node.args[1]), node))
        return self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        node.value, node.slice = self.visit(node.value), self._counting(node.slice)
        return node

    def _counting(self, node: Any) -> Any:
        """Return a part of the function in which whole numbers from outside stay whole: indices, and calls of range."""
        before, self.counting = self.counting, True
        made = self.generic_visit(node) if isinstance(node, ast.Call) else self.visit(node)
        self.counting = before
        return made

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        self.generic_visit(node)
        power = self.power(node.left, node.right) if isinstance(node.op, ast.Pow) else None
        return node if power is None else ast.copy_location(power, node)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        if isinstance(node.op, ast.Pow) and isinstance(node.target, ast.Name):
            whole = ast.BinOp(ast.Name(node.target.id, ast.Load()), node.op, node.value)
            return ast.Assign([self.visit(node.target)], self.visit(whole), lineno=node.lineno)
        return self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        """Leave out the annotation, whose names a program does not have."""
        if node.value is None:
            return ast.Pass()
        return ast.Assign([self.visit(node.target)], self.visit(node.value), lineno=node.lineno)
