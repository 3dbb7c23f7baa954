"""Checks of what users give, and the sentences that refuse it: what was wrong, what is allowed, the nearest name."""

from __future__ import annotations

import difflib
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from inspect import signature
from operator import index
from pathlib import Path
from typing import Any

from pendulum_env.common.many import Many


class SceneError(ValueError):
    """A scene, or a part of one, that cannot be: an unknown name, a value out of range, a contradiction."""


class UnknownParameterError(SceneError, TypeError):
    """A keyword that is no parameter of the scene: a TypeError too, in the words of Python's own that callers read.

    Attributes:
        given: the keyword.
    """

    def __init__(self, message: str, given: str = "") -> None:
        super().__init__(message)
        self.given = given


LONGEST = 100
"""Most characters of a name, and of a value in a message."""

LONGEST_PATH = 4096


def shown(value: Any) -> str:
    """A value as error messages show it: one line, and not a long one."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python writes no whole number of more than some thousand digits
        text = f"a {type(value).__name__} too long to be written"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


def number(value: Any, name: str, *, above: float | None = None, least: float | None = None, unit: str = "") -> float:
    """``value`` as a float; SceneError says what is allowed if it is no finite number in its range. Many stay Many."""
    if isinstance(value, Many):
        for end in (value.values.min(), value.values.max()):
            number(end, name, above=above, least=least, unit=unit)
        return value  # type: ignore[return-value]
    bound = f" above {above:g}" if above is not None else f" of at least {least:g}" if least is not None else ""
    wanted = f"a finite number{bound}" + (f" [{unit}]" if unit not in ("", "1") else "")
    try:
        plain = value.item() if getattr(value, "shape", None) == () else value
        if isinstance(plain, (bool, str, bytes)) or hasattr(plain, "__len__"):
            raise TypeError
        found = float(plain)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{name} must be {wanted}, not {shown(value)}.") from None
    if not math.isfinite(found) or (above is not None and not found > above) or (least is not None and found < least):
        raise SceneError(f"{name} must be {wanted}, not {found!r}.")
    return found


def whole_number(value: Any, name: str, most: int | None = None, least: int = 1) -> int:
    """A whole number from ``least``, to ``most`` if given; SceneError for anything else."""
    try:
        found = None if isinstance(value, bool) else index(value)
    except TypeError:
        found = None
    if found is None or found < least or (most is not None and found > most):
        span = f"from {least}{'' if most is None else f' to {most}'}"
        raise SceneError(f"{name} must be a whole number {span}, not {shown(value)}.")
    return found


def line(value: Any, name: str) -> str:
    """``value`` if it is a line of text that can stand in a title; SceneError if not."""
    if not isinstance(value, str):
        raise SceneError(f"{name} must be text, not {shown(value)}.")
    if not value.isprintable() or not 0 < len(value) <= LONGEST:
        raise SceneError(f"{name} must be one line of 1 to {LONGEST} characters, not {shown(value)}.")
    return value


def one_of(value: Any, name: str, allowed: Iterable[str]) -> str:
    """``value`` if it is among the allowed words; SceneError with the nearest one if not."""
    if not isinstance(value, str) or value not in allowed:
        raise SceneError(f"There is no {name} {shown(value)}{nearest(value, allowed)}")
    return value


def truth(value: Any, name: str) -> bool:
    """``value`` if it is True or False; SceneError if not."""
    found = value.item() if getattr(value, "shape", None) == () else value
    if not isinstance(found, bool):
        raise SceneError(f"{name} must be True or False, not {shown(value)}.")
    return found


def several(value: Any, name: str, what: str) -> tuple[Any, ...]:
    """The entries of a list or the like; SceneError for text, a dict, or what has no entries.

    ``what``: what they are, in the plural.
    """
    single = isinstance(value, (str, bytes, Mapping)) or getattr(value, "shape", None) == ()
    if single or not isinstance(value, Iterable):
        raise SceneError(f"{name} must be a list of {what}, not {shown(value)}.")
    return tuple(value)


def function(value: Any, name: str) -> Callable[..., Any]:
    """``value`` if it can be called; SceneError if not."""
    if not callable(value):
        raise SceneError(f"{name} must be a function, not {shown(value)}.")
    return value  # type: ignore[no-any-return]


def file_path(value: Any, name: str) -> Path:
    """A file's or folder's path; SceneError for what is none, an empty text, or one that no system takes."""
    try:
        found = os.fspath(value)
    except TypeError:
        found = None
    if not isinstance(found, str) or not 0 < len(found) <= LONGEST_PATH or "\0" in found:
        raise SceneError(f"{name} must be a path of 1 to {LONGEST_PATH} characters without NUL, not {shown(value)}.")
    return Path(found)


def first_line(documented: Any) -> str:
    """The first line of a docstring without its full stop."""
    return (documented.__doc__ or "").strip().partition("\n")[0].rstrip(".")


@contextmanager
def naming_keywords(function: Callable[..., Any]) -> Iterator[None]:
    """Where a scene's parameters are taken that ``function`` was given beside its own keywords: names these, too.

    UnknownParameterError by the scene's parameters is left as it is where none of the function's is near.
    """
    try:
        yield
    except UnknownParameterError as error:
        near = difflib.get_close_matches(error.given, signature(function).parameters, n=1, cutoff=0.75)
        if not near:
            raise
        said = f"unexpected keyword argument {shown(error.given)}; did you mean {near[0]}?"
        raise UnknownParameterError(said, error.given) from None


def nearest(name: Any, known: Iterable[str]) -> str:
    """The end of an error sentence: the close names if there are any, else all that are allowed."""
    names = list(known)
    near = difflib.get_close_matches(name[:LONGEST] if isinstance(name, str) else "", names, n=3, cutoff=0.5)
    return f"; did you mean {' or '.join(near)}?" if near else f"; there are {', '.join(names)}."
