"""JavaScript from generated programs: the same names, the same arithmetic on the same doubles, and so the same bits.

A program is translated statement by statement from its syntax tree. JavaScript and Python round +, -, *, / and the
square root of doubles alike (ECMA-262, "The Number Type"; IEEE 754), and a program calls no other function of either
language that rounds: sine, cosine, exponential and logarithm are part of its text.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterable
from functools import lru_cache, singledispatchmethod
from typing import Any

from pendulum_env.common.checks import printable
from pendulum_env.common.sources import is_nan, names_set, parameters_of, parsed
from pendulum_env.engine.generate import Program
from pendulum_env.engine.reading import ProgramError
from pendulum_env.engine.source import blocks_of, words_of

EXPORTED = ("run", "info")
"""Functions of a program that its JavaScript module exports."""

RESERVED_WORDS = """
arguments await break case catch class const continue debugger default delete do else enum eval export extends false
finally for function if implements import in instanceof interface let new null package private protected public return
static super switch this throw true try typeof undefined var void while with yield NaN Infinity Math min max
"""
RESERVED = frozenset(RESERVED_WORDS.split())
"""Words that JavaScript does not allow as names, or that the translation uses; such a name gets an underscore."""

SAME = {"abs": "Math.abs", "sqrt": "Math.sqrt", "int": "Math.trunc"}
"""Functions of Python -> the functions of JavaScript that return the same doubles."""

CHOSEN = {"min": "b < a ? b : a", "max": "b > a ? b : a"}
"""min and max of two numbers as Python defines them; Math.min and Math.max differ at nan and at -0."""

OPERATORS: dict[type[ast.AST], tuple[str, int]] = {
    ast.Mult: ("*", 12), ast.Div: ("/", 12), ast.Add: ("+", 11), ast.Sub: ("-", 11), ast.BitAnd: ("&", 7),
    ast.BitOr: ("|", 5), ast.And: ("&&", 4), ast.Or: ("||", 3),
    ast.Lt: ("<", 9), ast.LtE: ("<=", 9), ast.Gt: (">", 9), ast.GtE: (">=", 9), ast.Eq: ("===", 8),
    ast.NotEq: ("!==", 8),
}
"""Operator of Python -> the operator of JavaScript and its precedence there (ECMA-262, section 13)."""

CONDITIONAL, UNARY, ATOM = 2, 14, 18
"""Precedences of ``a ? b : c``, of -a and !a, and of names, calls and numbers."""


def javascript(program: Program) -> str:
    """Return a generated program as a JavaScript module that computes the same bits.

    The module exports ``run`` and ``info``, with the arguments that they have in Python: arrays of numbers, ``out`` as
    an array of rows. Functions and variables keep their names, except that a word which JavaScript reserves gets an
    underscore after it.

    Raises ProgramError for a method that calls a function of Python, and for anything in the program that has no
    translation; nothing is guessed.
    """
    if program.python_functions:
        names = " and ".join(name for name, _ in program.python_functions)
        raise ProgramError(f"A program that calls the Python function {names} cannot be translated to JavaScript.")
    return translated(program.text)


def translated(text: str) -> str:
    """Return the JavaScript of a program's text; raises ProgramError for a statement or a name without translation."""
    blocks = blocks_of(text)
    functions, constants = (frozenset(name for block in blocks for name in _defined(block)[i]) for i in range(2))
    parts, chosen = list[str](), set[str]()
    for block in blocks:
        texts, called = _part(block, functions & words_of(block), constants & words_of(block))
        parts += texts
        chosen |= called
    own = [f"function {name}(a, b) {{\n  return {CHOSEN[name]};\n}}" for name in sorted(chosen)]
    return "\n\n".join([*parts[:1], *own, *parts[1:]]) + "\n"


@lru_cache(maxsize=4096)
def _defined(block: str) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of the functions and of the constants that a part of a program defines."""
    body = parsed(block).body
    return (frozenset(node.name for node in body if isinstance(node, ast.FunctionDef)),
            frozenset(names_set(*(node for node in body if isinstance(node, ast.Assign)))))


@lru_cache(maxsize=4096)
def _part(
    block: str, functions: frozenset[str], constants: frozenset[str]
) -> tuple[tuple[str, ...], frozenset[str]]:
    """Return the translations of a part's statements, and those of CHOSEN that they call.

    ``functions`` and ``constants`` are the names of the program's own that the part uses.
    """
    module = _Module(parsed(block), functions, constants)
    return tuple(module.parts()), frozenset(module.chosen)


class _Module:
    """The translation of a part of a program; ``functions`` and ``constants`` are names of the whole program."""

    def __init__(self, tree: ast.Module, functions: frozenset[str], constants: frozenset[str]) -> None:
        self._tree, self._functions, self._constants = tree, functions, constants
        self.chosen: set[str] = set()

    def parts(self) -> list[str]:
        """Return the translations of the statements."""
        parts: list[str] = []
        for node in self._tree.body:
            if isinstance(node, ast.Expr):
                parts.append(_comment(node))
            elif isinstance(node, ast.ImportFrom):
                for alias in node.names:
                    if alias.name not in SAME:
                        raise _unknown(node, f"the function {alias.name}")
            elif isinstance(node, ast.FunctionDef):
                parts.append("\n".join(self._function(node)))
            elif isinstance(node, ast.Assign):
                parts.append("\n".join(_Body(self, set(), self._constants).lines(node)))
            else:
                raise _unknown(node, "the statement")
        return parts

    def _function(self, node: ast.FunctionDef) -> list[str]:
        """Return the lines of one function."""
        arguments = parameters_of(node)
        everything = [child for child in ast.walk(node.args) if isinstance(child, ast.arg)]
        if len(arguments) != len(everything) or node.args.defaults:
            raise _unknown(node, "the arguments of the function")
        body, head = node.body, []
        if isinstance(body[0], ast.Expr):
            head, body = [_comment(body[0])], body[1:]
        loops = [one for statement in body for one in ast.walk(statement) if isinstance(one, ast.For)]
        counters = names_set(*(loop.target for loop in loops))
        stored = Counter(names_set(*body)) - Counter(counters)  # a loop declares its counter itself, and keeps it
        for loop in loops:
            inside = {id(one) for other in loops if ast.dump(other.target) == ast.dump(loop.target)
                      for part in (other.target, *other.body) for one in ast.walk(part)}
            if any(isinstance(one, ast.Name) and one.id in names_set(loop.target) and id(one) not in inside
                   for statement in body for one in ast.walk(statement)):
                raise _unknown(loop.target, "the counter of a loop outside of it,")
        once = {name for name in stored if stored[name] == 1} - set(arguments)
        once &= {*names_set(*(one for one in body if isinstance(one, ast.Assign) and len(one.targets) == 1))}
        later = [name for name in stored if name not in once and name not in arguments]
        inner = _Body(self, {*arguments, *names_set(*body)}, once)
        start = [f"  let {', '.join(_name(name) for name in later)};"] if later else []
        export = "export " if node.name in EXPORTED else ""
        lines = [f"{export}function {_name(node.name)}({', '.join(map(_name, arguments))}) {{", *start]
        return [*head, *lines, *(f"  {line}" for statement in body for line in inner.lines(statement)), "}"]

    def called(self, node: ast.Call) -> str:
        """Return the JavaScript name of the function that a program calls."""
        name = node.func.id if isinstance(node.func, ast.Name) and not node.keywords else ""
        if name in self._functions:
            return _name(name)
        if name in CHOSEN and len(node.args) == 2:
            self.chosen.add(name)
            return name
        if name in SAME and len(node.args) == 1:
            return SAME[name]
        raise _unknown(node, "the call")

    def known(self, name: str) -> bool:
        """Return True if a name is a constant or a function of the program."""
        return name in self._constants or name in self._functions


class _Body:
    """The translation of the statements of one function.

    Args:
        module: the program.
        names: names of the function's arguments and variables.
        once: names that are assigned once, before everything that reads them.
    """

    def __init__(self, module: _Module, names: Iterable[str], once: Iterable[str]) -> None:
        self._module, self._names, self._once = module, frozenset(names), frozenset(once)
        self._left = ""

    @singledispatchmethod
    def lines(self, node: Any) -> list[str]:
        """Return the lines of a statement."""
        raise _unknown(node, "the statement")

    @lines.register
    def _(self, node: ast.Assign) -> list[str]:
        if len(node.targets) > 1:
            if any(name in self._once for name in names_set(node)) or not all(
                    isinstance(target, ast.Name) for target in node.targets):
                raise _unknown(node, "the assignment")
            return [f"{' = '.join(map(self._target, node.targets))} = {self.value(node.value)};"]
        target = node.targets[0]
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            return self._pairs(node, target.elts, node.value.elts)
        names = names_set(node)
        fresh = [name for name in names if name in self._once]
        if fresh and len(fresh) < len(names):
            return [f"let {', '.join(map(_name, fresh))};", f"{self._target(target)} = {self.value(node.value)};"]
        return [f"{'const ' if fresh else ''}{self._target(target)} = {self.value(node.value)};"]

    def _pairs(self, node: ast.Assign, targets: list[ast.expr], values: list[ast.expr]) -> list[str]:
        """Return the lines of an assignment of several expressions to as many targets."""
        left = f"[{', '.join(self._target(target) for target in targets)}]"
        right = f"[{', '.join(self.value(value) for value in values)}]"
        if len(targets) != len(values):
            raise _unknown(node, "the assignment")
        fresh = [name for name in names_set(node) if name in self._once]
        if len(fresh) == len(targets):
            return [f"const {left} = {right};"]
        return [*([f"let {', '.join(map(_name, fresh))};"] if fresh else []), f"{left} = {right};"]

    @lines.register
    def _(self, node: ast.AugAssign) -> list[str]:
        sign, _ = _operator(node.op, node)
        return [f"{self._target(node.target)} {sign}= {self.value(node.value)};"]

    @lines.register
    def _(self, node: ast.Return) -> list[str]:
        return [f"return {self.value(node.value)};" if node.value else "return;"]

    @lines.register(ast.Break)
    @lines.register(ast.Continue)
    def _(self, node: ast.Break | ast.Continue) -> list[str]:
        return [f"break{self._left};" if isinstance(node, ast.Break) else "continue;"]

    @lines.register
    def _(self, node: ast.If) -> list[str]:
        otherwise = self._block("} else {", node.orelse)[:-1] if node.orelse else []
        return [*self._block(f"if ({self.value(node.test)}) {{", node.body)[:-1], *otherwise, "}"]

    @lines.register
    def _(self, node: ast.While) -> list[str]:
        if node.orelse:
            raise _unknown(node, "the else of the loop")
        return self._loop(f"while ({self.value(node.test)}) {{", node.body)

    @lines.register
    def _(self, node: ast.For) -> list[str]:
        counts = isinstance(node.iter, ast.Call) and isinstance(node.iter.func, ast.Name) and (
            node.iter.func.id == "range" and len(node.iter.args) == 1)
        if not counts or not isinstance(node.target, ast.Name):
            raise _unknown(node, "the loop")
        assert isinstance(node.iter, ast.Call)
        i = _name(node.target.id)
        head = f"for (let {i} = 0; {i} < {self.value(node.iter.args[0])}; {i}++) {{"
        if not node.orelse:
            return self._loop(head, node.body)
        loop = self._loop(head, node.body, " completed")
        return self._indented("completed: {", [*loop, *self._all(node.orelse)])

    def _loop(self, head: str, body: list[ast.stmt], left: str = "") -> list[str]:
        """Return the lines of a loop; ``left`` is the label, if any, of the block that its ``break`` leaves."""
        outer, self._left = self._left, left
        lines = self._block(head, body)
        self._left = outer
        return lines

    def _block(self, head: str, body: list[ast.stmt]) -> list[str]:
        """Return the lines of a block of statements in braces."""
        return self._indented(head, self._all(body))

    def _all(self, body: list[ast.stmt]) -> list[str]:
        """Return the lines of statements."""
        return [line for statement in body for line in self.lines(statement)]

    @staticmethod
    def _indented(head: str, lines: list[str]) -> list[str]:
        """Return lines in braces, after a head that opens them."""
        return [head, *(f"  {line}" for line in lines), "}"]

    def _target(self, node: ast.expr) -> str:
        """Return what an assignment assigns to."""
        if isinstance(node, ast.Name):
            return _name(node.id)
        if isinstance(node, ast.Tuple):
            return f"[{', '.join(self._target(part) for part in node.elts)}]"
        if isinstance(node, ast.Subscript):
            return self.value(node)
        raise _unknown(node, "the assignment to")

    def value(self, node: ast.expr, least: int = 0) -> str:
        """Return an expression, in parentheses if its precedence is below ``least``."""
        text, precedence = self._expression(node)
        return text if precedence >= least else f"({text})"

    @singledispatchmethod
    def _expression(self, node: Any) -> tuple[str, int]:
        """Return an expression's text and precedence."""
        raise _unknown(node, "the expression")

    @_expression.register
    def _(self, node: ast.Name) -> tuple[str, int]:
        if node.id not in self._names and not self._module.known(node.id):
            raise _unknown(node, "the name")
        return _name(node.id), ATOM

    @_expression.register
    def _(self, node: ast.Constant) -> tuple[str, int]:
        if isinstance(node.value, bool):
            return str(node.value).lower(), ATOM
        if not isinstance(node.value, (int, float)):
            raise _unknown(node, "the constant")
        text = repr(float(node.value)) if abs(node.value) < float("inf") else "Infinity"
        return text.removesuffix(".0"), ATOM

    @_expression.register
    def _(self, node: ast.BinOp) -> tuple[str, int]:
        sign, rank = _operator(node.op, node)
        return f"{self.value(node.left, rank)} {sign} {self.value(node.right, rank + 1)}", rank

    @_expression.register
    def _(self, node: ast.BoolOp) -> tuple[str, int]:
        sign, rank = _operator(node.op, node)
        return f" {sign} ".join(self.value(part, rank + 1) for part in node.values), rank

    @_expression.register
    def _(self, node: ast.UnaryOp) -> tuple[str, int]:
        if not isinstance(node.op, (ast.USub, ast.Not)):
            raise _unknown(node, "the operator of")
        return f"{'-' if isinstance(node.op, ast.USub) else '!'}{self.value(node.operand, UNARY + 1)}", UNARY

    @_expression.register
    def _(self, node: ast.Compare) -> tuple[str, int]:
        operands = [node.left, *node.comparators]
        if not all(isinstance(middle, (ast.Name, ast.Constant)) for middle in operands[1:-1]):
            raise _unknown(node, "the comparison")
        parts = []
        for left, sign_of, right in zip(operands, node.ops, operands[1:], strict=False):
            sign, rank = _operator(sign_of, node)
            parts.append(f"{self.value(left, rank + 1)} {sign} {self.value(right, rank + 1)}")
        return (parts[0], rank) if len(parts) == 1 else (" && ".join(parts), OPERATORS[ast.And][1])

    @_expression.register
    def _(self, node: ast.IfExp) -> tuple[str, int]:
        test, chosen = self.value(node.test, CONDITIONAL + 1), self.value(node.body, CONDITIONAL + 1)
        return f"{test} ? {chosen} : {self.value(node.orelse, CONDITIONAL)}", CONDITIONAL

    @_expression.register
    def _(self, node: ast.Call) -> tuple[str, int]:
        if is_nan(node):
            return "NaN", ATOM
        if ast.unparse(node.func) == "len" and len(node.args) == 1:
            return f"{self.value(node.args[0], ATOM)}.length", ATOM
        return f"{self._module.called(node)}({', '.join(self.value(part) for part in node.args)})", ATOM

    @_expression.register
    def _(self, node: ast.Subscript) -> tuple[str, int]:
        places = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        return self.value(node.value, ATOM) + "".join(f"[{self.value(place)}]" for place in places), ATOM

    @_expression.register
    def _(self, node: ast.Tuple) -> tuple[str, int]:
        return f"[{', '.join(self.value(part) for part in node.elts)}]", ATOM

    @_expression.register
    def _(self, node: ast.Dict) -> tuple[str, int]:
        pairs = []
        for key, value in zip(node.keys, node.values, strict=True):
            if not isinstance(key, ast.Constant) or not isinstance(key.value, str) or not key.value.isidentifier():
                raise _unknown(node, "the keys of")
            pairs.append(f"{key.value}: {self.value(value)}")
        return f"{{{', '.join(pairs)}}}", ATOM


def _name(name: str) -> str:
    """Return a name of a program as JavaScript allows it."""
    return f"{name}_" if name in RESERVED else name


def _operator(node: ast.AST, whole: ast.AST) -> tuple[str, int]:
    """Return the sign and the precedence of an operator."""
    if type(node) not in OPERATORS:
        raise _unknown(whole, "the operator of")
    return OPERATORS[type(node)]


def _comment(node: ast.Expr) -> str:
    """Return a docstring as a comment; raises ProgramError for any other statement that is one expression."""
    if not isinstance(node.value, ast.Constant) or not isinstance(node.value.value, str):
        raise _unknown(node, "the statement")
    lines = [printable(line.strip()) for line in node.value.value.strip().replace("*/", "* /").split("\n")]
    return "\n".join(["/**", *(f" * {line}".rstrip() for line in lines), " */"])


def _unknown(node: ast.AST, what: str) -> ProgramError:
    """Return the error for a part of a program that has no translation."""
    text = re.sub(r"\s+", " ", ast.unparse(node))
    return ProgramError(f"A program with {what} {text[:60]!r} (a {type(node).__name__}) cannot be translated to "
                        "JavaScript.")
