"""Copying the source of plain functions, with what they call, into a generated file."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterable
from functools import cache
from types import FunctionType
from typing import Any

Plain = Callable[..., Any]


def arguments(function: Plain) -> list[str]:
    """Names of a function's parameters."""
    return list(inspect.signature(function).parameters)


@cache
def text_of(function: Plain) -> str:
    """The source of one function, at the left margin, without its annotations' cost."""
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
