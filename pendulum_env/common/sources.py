"""The one reader of the source of Python functions: a function's syntax tree, its lines, and questions about trees.

Users' effects and tasks and the package's own functions are read here. What is read is checked against what runs. The
questions about the tree of a program are those that each of its readers asks: for stages, LLVM, JavaScript and JAX.
"""

from __future__ import annotations
import __future__

import ast
import hashlib
import inspect
import linecache
import textwrap
from collections.abc import Callable, Iterator
from functools import lru_cache
from threading import Lock
from types import CodeType, FunctionType
from typing import Any, NamedTuple

PARSING = Lock()
"""Held while Python parses a text: in Python 3.11 threads that parse at the same time may raise a SystemError."""
FUTURE = __future__.annotations.compiler_flag
"""Flag of code that was compiled with annotations as text."""


class ReadingError(ValueError):
    """Error for a function whose source cannot be read; the message begins behind the function's name."""


def ours(one: Any) -> bool:
    """Return True for a function or a class of this package, False for one of a user."""
    return str(one.__module__).partition(".")[0] in ("pendulum_env", "integrators")


class FunctionSource(NamedTuple):
    """The source of a function.

    Attributes:
        node: its syntax tree.
        lines: all lines of its file; line numbers of the tree begin at 1.
    """

    node: ast.FunctionDef | ast.Lambda
    lines: tuple[str, ...]

    @property
    def body(self) -> list[ast.stmt]:
        """The statements of the function; of a lambda, one that returns its value."""
        node = self.node
        return [ast.copy_location(ast.Return(node.body), node)] if isinstance(node, ast.Lambda) else node.body

    def body_text(self, indent: str = "    ") -> str:
        """Return the text of the function's statements, with their comments if they stand in lines of their own.

        Statements that share a line with the ``def`` are written anew.
        """
        first, last = self.body[0], self.body[-1]
        if isinstance(self.node, ast.Lambda) or self.lines[first.lineno - 1].encode()[:first.col_offset].strip():
            return "".join(f"{indent}{line}\n" for one in self.body for line in ast.unparse(one).split("\n"))
        lines = self.lines[first.lineno - 1:last.end_lineno]
        before = lines[0][:first.col_offset]  # white space
        if before == indent or not all(line.startswith(before) or not line.strip() for line in lines):
            return "".join(lines).rstrip() + "\n"  # every line is as far in as it was, which Python allows
        return "".join(f"{indent}{line[len(before):]}" if line.strip() else "\n" for line in lines).rstrip() + "\n"


def parsed(text: str) -> ast.Module:
    """Return the syntax tree of a text, also where several threads parse at the same time."""
    with PARSING:
        return ast.parse(text)


def source_of(function: Callable[..., Any], check: bool = True) -> FunctionSource:
    """Return the source of a function made with def or lambda, from its file, notebook cell or doctest.

    With ``check`` the whole file is compiled, and compared with the code that runs; without it, for functions of the
    package made with def, the lines of the function alone are read. Raises ReadingError where the source cannot be
    read, is no longer that of the function, or has several lambdas in a line that cannot be told apart (before Python
    3.11).
    """
    if not isinstance(function, FunctionType):
        raise ReadingError("is not a function made with def or lambda")
    code = function.__code__
    first = code.co_firstlineno
    try:
        lines, start = inspect.findsource(function)
        if not check:  # a few lines are read in a third of the time that a file takes
            lines, first = textwrap.dedent("".join(inspect.getblock(lines[start:]))).splitlines(keepends=True), 1
        file = _read("".join(lines), code.co_flags & FUTURE, check)
    except (OSError, TypeError, SyntaxError, ValueError, IndexError):
        raise ReadingError("cannot be read") from None
    found: list[ast.FunctionDef | ast.Lambda] = []
    if code.co_name == "<lambda>":
        found += [node for node in ast.walk(file.tree) if isinstance(node, ast.Lambda)
                  and node.lineno == first and _holds(node, code)]
    else:
        found += [node for node in file.functions.get(first, ()) if node.name == code.co_name]
    if not found or (check and code not in file.codes):
        raise ReadingError("is not what runs: the file has changed; import it again")
    if hasattr(code, "co_positions"):  # of lambdas inside each other, the innermost holds the code
        found = found[-1:]
    if len(found) > 1 and len({ast.dump(node) for node in found}) > 1:
        raise ReadingError(f"stands in line {first} with several lambdas; write each in its own line")
    return FunctionSource(found[0], tuple(lines))


def executed(text: str, title: str, names: dict[str, Any]) -> dict[str, Any]:
    """Run a text of functions that this package has written, with these names; return the names, functions added.

    A debugger steps through its lines, and inspect shows them, as those of a file such as ``<lab-pendulum rk4 1a2b>``.
    """
    file = f"<lab-pendulum {title} {hashlib.sha256(text.encode()).hexdigest()[:16]}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    exec(compile(text, file, "exec"), names)
    return names


class _File(NamedTuple):
    """A file that was read: its syntax tree, its functions by their first lines, and the code objects in it."""

    tree: ast.Module
    functions: dict[int, list[ast.FunctionDef]]
    codes: frozenset[CodeType]


@lru_cache(maxsize=32)
def _read(text: str, flags: int, check: bool) -> _File:
    """Return a file's text as it was read; its code objects only with ``check``."""
    tree, functions = parsed(text), dict[int, list[ast.FunctionDef]]()
    for node in _statements(tree.body):
        if isinstance(node, ast.FunctionDef):
            first = min(one.lineno for one in (node, *node.decorator_list))  # type: ignore[attr-defined]
            functions.setdefault(first, []).append(node)
    if not check:
        return _File(tree, functions, frozenset())
    with PARSING:
        whole = compile(text, "<source>", "exec", flags=flags, dont_inherit=True)
    return _File(tree, functions, frozenset(_codes(whole)))


def _statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield statements and those inside them, without a walk through their expressions, which are many more."""
    for node in body:
        yield node
        for name in ("body", "orelse", "finalbody", "handlers", "cases"):
            yield from _statements(getattr(node, name, []))


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield all code objects inside a code object."""
    for const in code.co_consts:
        if isinstance(const, CodeType):
            yield const
            yield from _codes(const)


def _holds(node: ast.Lambda, code: CodeType) -> bool:
    """Return True if a lambda's arguments, and from Python 3.11 on its place in the line, are those of a code."""
    if [one.arg for one in (*node.args.posonlyargs, *node.args.args)] != [*code.co_varnames[:code.co_argcount]]:
        return False
    if not hasattr(code, "co_positions"):
        return True
    body = node.body
    start, end = (body.lineno, body.col_offset), (body.end_lineno or 0, body.end_col_offset or 0)
    places = [(row, column) for row, _, column, _ in code.co_positions()
              if row is not None and column is not None and (row, column) != (code.co_firstlineno, 0)]
    return all(start <= place <= end for place in places)


def functions_of(text: str) -> dict[str, ast.FunctionDef]:
    """Return the functions of a program's text by name."""
    return {node.name: node for node in parsed(text).body if isinstance(node, ast.FunctionDef)}


def parameters_of(function: ast.FunctionDef) -> list[str]:
    """Return the names of a function's parameters."""
    return [parameter.arg for parameter in function.args.args]


def statements_of(function: ast.FunctionDef) -> list[ast.stmt]:
    """Return the statements of a function after its docstring."""
    return function.body if ast.get_docstring(function, clean=False) is None else function.body[1:]


def names_in(*nodes: ast.AST) -> list[str]:
    """Return the names in parts of a program, once for each place; those of called functions are included."""
    return [one.id for node in nodes for one in ast.walk(node) if isinstance(one, ast.Name)]


def names_read(*nodes: ast.AST) -> list[str]:
    """Return the names that parts of a program read, once for each place."""
    return [one.id for node in nodes for one in ast.walk(node)
            if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Load)]


def names_set(*nodes: ast.AST) -> list[str]:
    """Return the names that parts of a program set, once for each place; counters of loops are included."""
    return [one.id for node in nodes for one in ast.walk(node)
            if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)]


def is_nan(node: ast.expr) -> bool:
    """Return True for ``float('nan')``, which programs write for the constant NAN."""
    match node:
        case ast.Call(func=ast.Name("float"), args=[ast.Constant("nan")]):
            return True
    return False
