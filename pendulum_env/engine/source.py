"""Copies of the source of Python functions, and of the functions that they call, for generated programs."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterable
from functools import cache
from tokenize import TokenError
from types import FunctionType
from typing import Any

from pendulum_env.physics.elementary import sqrt

Plain = Callable[..., Any]
"""A function made with def, of floats, whose source can be copied into a program."""
_CALL = re.compile(r"(\w+)\(")


class SourceError(ValueError):
    """Error for a function whose source cannot be copied into a generated program."""


@cache
def arguments(function: Plain) -> tuple[str, ...]:
    """Return the names of a function's parameters."""
    return tuple(inspect.signature(function).parameters)


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
        for name in function.__code__.co_names:
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
    defined = [node.name for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    for name in defined:
        if defined.count(name) > 1:
            raise SourceError(f"Two functions of the generated program have the name {name}; rename one of them.")
    for function in ast.walk(ast.parse(text)):
        if isinstance(function, ast.FunctionDef):
            nodes = [node for node in ast.walk(function) if isinstance(node, ast.Name)]
            assigned = [argument.arg for argument in function.args.args]
            assigned += [node.id for node in nodes if isinstance(node.ctx, ast.Store)]
            taken |= names & ({function.name} | {name for name in assigned if assigned.count(name) > 1})
    if taken:
        raise SourceError(
            f"The coefficient name {min(taken)} is already used in the generated program; choose a longer name, "
            "such as cubic_drag_rate."
        )


def constants_of(functions: Iterable[FunctionType]) -> dict[str, float]:
    """Return the module-level floats that functions use, a dict by name.

    Raises SourceError if the functions use a global that a generated program does not have.
    """
    constants: dict[str, float] = {}
    for function in functions:
        for name in function.__code__.co_names:
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
    return "\n\n".join(f"@inline\n{_plain(function)}" for function in functions)


def _plain(function: FunctionType) -> str:
    """Return the source of a function without annotations in its signature."""
    lines = text_of(function).splitlines()
    end = next(i for i, line in enumerate(lines) if line.rstrip().endswith(":"))
    signature = f"def {function.__name__}({', '.join(arguments(function))}):"
    return "\n".join([signature, *lines[end + 1 :]]) + "\n"
