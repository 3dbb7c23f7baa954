"""Copies of the source of Python functions, and of the functions that they call, for generated programs."""

from __future__ import annotations

import ast
import inspect
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from symtable import symtable
from threading import Lock
from tokenize import TokenError
from types import CodeType, FunctionType
from typing import Any

from pendulum_env.physics.elementary import sqrt

Plain = Callable[..., Any]
"""A function made with def, of floats, whose source can be copied into a program."""
PARSING = Lock()
"""Held while Python parses a text: in Python 3.11 threads that parse at the same time may raise a SystemError."""
TEXT = "_text"
"""Name in a program's module of its text, whose arithmetic may be written as instructions of LLVM."""
_CALL = re.compile(r"(\w+)\(")


class SourceError(ValueError):
    """Error for a function whose source cannot be copied into a generated program."""


@cache
def arguments(function: Plain) -> tuple[str, ...]:
    """Return the names of a function's parameters."""
    return tuple(inspect.signature(function).parameters)


def float_text(value: float) -> str:
    """Return a float as source text, also one that is infinite or not a number."""
    if math.isnan(value):
        return "float('nan')"
    return repr(value) if math.isfinite(value) else "1e999" if value > 0 else "-1e999"


@cache
def text_of(function: Plain) -> str:
    """Return the source of one function as text, without indentation; SourceError if it cannot be read."""
    if function.__name__ == "<lambda>":
        raise SourceError("A torque must be a function made with def, not a lambda, so that its source can be copied.")
    try:
        text = textwrap.dedent(inspect.getsource(function)).rstrip() + "\n"
    except (OSError, TokenError):
        text = ""
    if not text.startswith(f"def {function.__name__}("):
        raise SourceError(
            f"The source of {function.__name__} cannot be read; write an effect's functions in a file or a notebook, "
            "not at a prompt."
        )
    return text


def ours(function: Plain) -> bool:
    """Return True for a function of this package, False for one of a user."""
    return str(function.__module__).partition(".")[0] in ("pendulum_env", "integrators")


def names_of(code: CodeType) -> Iterator[str]:
    """Yield the names that a function's code takes from its module or from Python itself, and those of attributes.

    A comprehension has code of its own up to Python 3.11, and a lambda or a function inside the function always.
    """
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from names_of(constant)


def called_in(text: str, functions: Iterable[Plain]) -> list[Plain]:
    """Return those of the given functions that a source text calls by name."""
    names = set(_CALL.findall(text))
    return [function for function in functions if function.__name__ in names]


def with_callees(functions: Iterable[Plain]) -> list[FunctionType]:
    """Return the functions and all Python functions that they call, each once; called functions come first."""
    ordered: list[FunctionType] = []

    def visit(function: Any) -> None:
        """Append a function to the list ``ordered`` after all functions that it calls."""
        if not isinstance(function, FunctionType) or function in ordered:
            return
        for name in names_of(function.__code__):
            visit(function.__globals__.get(name))
        if function not in ordered:
            ordered.append(function)

    for function in functions:
        visit(function)
    return ordered


def check_names(text: str, coefficients: Iterable[str]) -> None:
    """Check that in a generated program the names of coefficients stand for nothing but these coefficients.

    The name may only be an argument, or be assigned once, where arguments are unpacked. Raises SourceError otherwise,
    since the program would compute with a wrong number, and for two functions of the same name.
    """
    names = set(coefficients)
    taken = names & {"control", "side", "direction"}
    try:
        tables = symtable(text, "<program>", "exec").get_children()
    except SyntaxError as error:  # a coefficient that is an argument twice
        twice = {name for name in names if f"'{name}'" in str(error)}
        if not twice:
            raise
        raise _taken(twice) from None
    defined = [table.get_name() for table in tables]
    for name in defined:
        if defined.count(name) > 1:
            raise SourceError(f"Two functions of the generated program have the name {name}; rename one of them.")
    taken |= names & {*defined}
    starts = [table.get_lineno() - 1 for table in tables]
    for table, start, end in zip(tables, starts, [*starts[1:], None], strict=True):
        own = {name for name in names.intersection(table.get_identifiers()) if table.lookup(name).is_assigned()}
        twice = {name for name in own if table.lookup(name).is_parameter()}
        if own - twice:
            lines = text.split("\n")[start:end]
            with PARSING:
                tree = ast.parse("\n".join(line for line in lines if not line.startswith("@")))
            stored = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name)
                      and isinstance(node.ctx, ast.Store)]
            twice |= {name for name in own if stored.count(name) > 1}
        taken |= twice
    if taken:
        raise _taken(taken)


def _taken(names: set[str]) -> SourceError:
    return SourceError(f"The coefficient name {min(names)} is already used in the generated program; choose a longer "
                       "name, such as cubic_drag_rate.")


def constants_of(functions: Iterable[FunctionType]) -> dict[str, float]:
    """Return the module-level floats that functions use, a dict by name.

    Raises SourceError if the functions use a global that a generated program does not have.
    """
    constants: dict[str, float] = {}
    for function in functions:
        for name in names_of(function.__code__):
            value = function.__globals__.get(name)
            if isinstance(value, float):
                constants[name] = value
            elif value is not sqrt and value is not None and not isinstance(value, FunctionType):
                raise SourceError(
                    f"{function.__name__} uses {name}, which cannot be copied into a program; a torque may use plain "
                    "functions, floats, abs and pendulum_env.physics.elementary."
                )
    return constants


def copied(functions: Iterable[FunctionType]) -> str:
    """Write the source of copies of functions, without type annotations, because programs cannot resolve their names.
    """
    copies = []
    for function in functions:
        lines = text_of(function).splitlines()
        end = next(i for i, line in enumerate(lines) if line.rstrip().endswith(":"))
        signature = f"def {function.__name__}({', '.join(arguments(function))}):"
        copies.append("\n".join(["@inline", signature, *lines[end + 1 :]]) + "\n")
    return "\n\n".join(copies)
