"""Translated functions of a user: their source texts, and the functions made from these texts.

A text can be pickled and copied into a program, and equal texts give the same function.
"""

from __future__ import annotations

import hashlib
import linecache
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from types import FunctionType
from typing import Any, NamedTuple

from pendulum_env.physics import elementary
from pendulum_env.physics.arctangent import atan2

Function = Callable[..., Any]


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


LIBRARY: Mapping[str, Function] = {
    "sin": elementary.sin, "cos": elementary.cos, "exp": elementary.exp, "log": elementary.log,
    "power": elementary.power, "sqrt": elementary.sqrt, "atan2": atan2,
    **{function.__name__: function for function in POWERS.values()},
}
"""Functions of the package that translated functions may call, by name."""


class Piece(NamedTuple):
    """A translated function as text.

    Attributes:
        name: its name in programs.
        text: its source.
        calls: names of the functions that it calls, of the package or translated before it.
    """

    name: str
    text: str
    calls: tuple[str, ...]


def built(pieces: Iterable[Piece]) -> dict[str, FunctionType]:
    """Return the functions of translated pieces by name; equal texts give the same objects."""
    made: dict[str, FunctionType] = {}
    for piece in pieces:
        calls = tuple((name, made.get(name) or LIBRARY[name]) for name in piece.calls)
        made[piece.name] = _made(piece.name, piece.text, calls)
    return made


@lru_cache(maxsize=512)
def _made(name: str, text: str, calls: tuple[tuple[str, Function], ...]) -> FunctionType:
    """Return the function of a text, which inspect can read again."""
    file = f"<lab-pendulum task {hashlib.sha256(text.encode()).hexdigest()[:16]}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    namespace: dict[str, Any] = {**dict(calls), "__name__": "lab_pendulum_task"}
    exec(compile(text, file, "exec"), namespace)
    made = namespace[name]
    assert isinstance(made, FunctionType)
    return made
