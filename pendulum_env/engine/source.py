"""Copying the source of plain functions, with what they call, into a generated file."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterable
from functools import cache
from types import FunctionType
from typing import Any

Plain = Callable[..., Any]


class SourceError(ValueError):
    """A function whose source cannot be copied into a generated step."""


def arguments(function: Plain) -> list[str]:
    """Names of a function's parameters."""
    return list(inspect.signature(function).parameters)


@cache
def text_of(function: Plain) -> str:
    """The source of one function, at the left margin, without its annotations' cost."""
    if function.__name__ == "<lambda>":
        raise SourceError("A torque must be a function made with def, so that its source can be copied, not a lambda.")
    return textwrap.dedent(inspect.getsource(function)).rstrip() + "\n"


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
            elif value is not None and not isinstance(value, FunctionType):
                raise SourceError(
                    f"{function.__name__} names {name}, which cannot be copied into a step; a torque may use plain "
                    "functions, floats, abs and pendulum_env.physics.elementary."
                )
    return found
