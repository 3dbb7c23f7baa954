"""Dataclass fields that know their unit, their range and what they mean.

One declaration serves the signature, the check, the help text, the error message and the documentation.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable
from dataclasses import field, fields
from operator import index
from typing import Any


class SceneError(ValueError):
    """A scene, or a part of one, that cannot be: an unknown name, a value out of range, a contradiction."""


class UnknownParameterError(SceneError, TypeError):
    """A keyword that is no parameter of the scene: a TypeError too, in the words of Python's own that callers read."""


def si(
    default: Any, unit: str, doc: str, *, above: float | None = None, least: float | None = None, optional: bool = False
) -> Any:
    """A dataclass field for a number in SI units.

    Args:
        default: its value where none is given.
        unit: for example "m" or "N m"; "1" for a pure number.
        doc: what it is, in a few words.
        above, least: it must be greater than ``above``, or at least ``least``.
        optional: None is allowed, and means "derived from the scene".
    """
    metadata = {"unit": unit, "doc": doc, "above": above, "least": least, "optional": optional}
    return field(default=default, metadata=metadata)


def flag(default: bool, doc: str) -> Any:
    """A dataclass field that is True or False."""
    return field(default=default, metadata={"known": (False, True), "doc": doc})


def choice(default: str, known: Iterable[str], doc: str) -> Any:
    """A dataclass field for one of some names."""
    return field(default=default, metadata={"known": tuple(known), "doc": doc})


def number(value: Any, name: str, *, above: float | None = None, least: float | None = None, unit: str = "") -> float:
    """``value`` as a float; SceneError says what is allowed if it is no finite number in its range."""
    bound = f" above {above:g}" if above is not None else f" of at least {least:g}" if least is not None else ""
    wanted = f"a finite number{bound}" + (f" [{unit}]" if unit not in ("", "1") else "")
    try:
        if isinstance(value, (bool, str, bytes)):
            raise TypeError
        found = float(value)
    except (TypeError, ValueError, OverflowError):
        raise SceneError(f"{name} must be {wanted}, not {value!r}.") from None
    if not math.isfinite(found) or (above is not None and not found > above) or (least is not None and found < least):
        raise SceneError(f"{name} must be {wanted}, not {found!r}.")
    return found


def whole_number(value: Any, name: str, most: int | None = None) -> int:
    """A whole number from 1, to ``most`` if given; SceneError for anything else."""
    found = 0 if isinstance(value, bool) or not hasattr(value, "__index__") else index(value)
    if found < 1 or (most is not None and found > most):
        raise SceneError(f"{name} must be a whole number from 1{'' if most is None else f' to {most}'}, not {value!r}.")
    return found


def text(value: Any, name: str) -> str:
    """``value`` if it is text; SceneError if not."""
    if not isinstance(value, str):
        raise SceneError(f"{name} must be text, not {value!r}.")
    return value


def check_known(value: Any, name: str, known: tuple[Any, ...]) -> None:
    """SceneError unless ``value`` is one of those known, and of their type."""
    if type(value) is type(known[0]) and value in known:
        return
    if known == (False, True):
        raise SceneError(f"{name} must be True or False, not {value!r}.")
    raise SceneError(f"There is no {name} {value!r}{nearest(value, known)}")


class Checked:
    """Base of dataclasses whose fields are checked on construction, and numbers kept as floats.

    Fields are made by :func:`si`, :func:`choice` or :func:`flag`.
    """

    def __post_init__(self) -> None:
        for entry in fields(self):  # type: ignore[arg-type]
            value = getattr(self, entry.name)
            if known := entry.metadata.get("known"):
                check_known(value, entry.name, known)
            if "unit" not in entry.metadata:
                continue
            if value is None and entry.metadata["optional"]:
                continue
            checked = number(
                value, entry.name, above=entry.metadata["above"], least=entry.metadata["least"],
                unit=entry.metadata["unit"],
            )
            object.__setattr__(self, entry.name, checked)


def nearest(name: Any, known: Iterable[str]) -> str:
    """The end of an error sentence: the close names if there are any, else all that are allowed."""
    names = list(known)
    near = difflib.get_close_matches(str(name), names, n=3, cutoff=0.5)
    return f"; did you mean {' or '.join(near)}?" if near else f"; there are {', '.join(names)}."
