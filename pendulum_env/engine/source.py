"""Copying the source of plain functions, with what they call, into a generated file."""

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
_CALL = re.compile(r"(\w+)\(")


class SourceError(ValueError):
    """A function whose source cannot be copied into a generated step."""


@cache
def arguments(function: Plain) -> tuple[str, ...]:
    """Names of a function's parameters."""
    return tuple(inspect.signature(function).parameters)


@cache
def text_of(function: Plain) -> str:
    """The source of one function, at the left margin, without its annotations' cost."""
    if function.__name__ == "<lambda>":
        raise SourceError("A torque must be a function made with def, so that its source can be copied, not a lambda.")
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
    """Return the functions whose names are called in a text."""
    names = set(_CALL.findall(text))
    return [function for function in functions if function.__name__ in names]


def with_callees(functions: Iterable[Plain]) -> list[FunctionType]:
    """The functions and every plain function that they call, callees first, each once."""
    ordered: list[FunctionType] = []

    def visit(function: Any) -> None:
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
    """Refuse coefficients whose names a generated file uses for something of its own.

    A name may be an argument, or be set once where arguments are unpacked, and nothing else. Raises SourceError where
    the file would otherwise compute with the wrong number.
    """
    names = set(coefficients)
    taken = names & {"control", "side", "direction"}
    made = [node.name for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    for name in made:
        if made.count(name) > 1:
            raise SourceError(f"Two functions of the step have the name {name}; give one of them another.")
    for function in ast.walk(ast.parse(text)):
        if isinstance(function, ast.FunctionDef):
            nodes = [node for node in ast.walk(function) if isinstance(node, ast.Name)]
            made = [argument.arg for argument in function.args.args]
            made += [node.id for node in nodes if isinstance(node.ctx, ast.Store)]
            taken |= names & ({function.name} | {name for name in made if made.count(name) > 1})
    if taken:
        raise SourceError(
            f"The name {min(taken)} of a coefficient is taken by the generated step; give it a longer one, "
            "such as cubic_drag_rate."
        )


def constants_of(functions: Iterable[FunctionType]) -> dict[str, float]:
    """The module-level numbers that functions name, by name.

    Raises SourceError for anything else that they name and that a generated file has not.
    """
    found: dict[str, float] = {}
    for function in functions:
        for name in function.__code__.co_names:
            value = function.__globals__.get(name)
            if isinstance(value, float):
                found[name] = value
            elif value is not sqrt and value is not None and not isinstance(value, FunctionType):
                raise SourceError(
                    f"{function.__name__} names {name}, which cannot be copied into a step; a torque may use plain "
                    "functions, floats, abs and pendulum_env.physics.elementary."
                )
    return found


def copied(functions: Iterable[FunctionType]) -> str:
    """Write functions, without annotations in the signatures, for which a generated file has no names."""
    return "\n\n".join(f"@inline\n{_plain(function)}" for function in functions)


def _plain(function: FunctionType) -> str:
    lines = text_of(function).splitlines()
    end = next(i for i, line in enumerate(lines) if line.rstrip().endswith(":"))
    signature = f"def {function.__name__}({', '.join(arguments(function))}):"
    return "\n".join([signature, *lines[end + 1 :]]) + "\n"
