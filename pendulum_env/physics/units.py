"""Dataclass fields with a unit, a range and a meaning.

One declaration serves the signature, the check, the help text, the error message and the documentation. The checks of
:mod:`pendulum_env.common.checks` can be imported from this module too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, Field, field, fields
from functools import cache, partial
from typing import Any

from pendulum_env.common.checks import (
    LONGEST_PATH,
    SceneError,
    UnknownParameterError,
    boolean,
    file_path,
    first_line,
    function,
    line,
    naming_keywords,
    nearest,
    number,
    one_of,
    several,
    shown,
    whole_number,
)

__all__ = [
    "LONGEST_PATH", "Checked", "SceneError", "UnknownParameterError", "boolean", "choice", "count", "file_path",
    "first_line", "flag", "function", "line", "naming_keywords", "nearest", "number", "one_of", "other_units",
    "setting", "several", "shown", "si", "total", "whole_number",
]
BENCH: Mapping[str, tuple[str, float, tuple[float, float], Mapping[str, float]]] = {
    "length": ("m", 10.0, (0.05, 3.0), {"cm": 1e-2, "mm": 1e-3}),
    "mass": ("kg", 20.0, (1e-3, 3.0), {"g": 1e-3}),
    "radius": ("m", 0.3, (1e-3, 0.1), {"cm": 1e-2, "mm": 1e-3}),
    "gravity": ("m/s^2", 100.0, (9.7, 9.9), {"cm/s^2": 1e-2}),
}
"""Sizes of a pendulum on a bench: SI unit, a value that is unusual from there on, the usual range, other units."""


def other_units(body: Any, gravity: float) -> Iterator[str]:
    """Yield a sentence for each size that is unusual for a bench, but usual if it was meant in another unit.

    The sizes are those that ``body.sizes`` names, and gravity [m/s²]. A length of 35.3 m is unusual, 35.3 cm is not.
    """
    for name in (*body.sizes, "gravity"):
        value = gravity if name == "gravity" else getattr(body, name)
        unit, unusual, (least, most), others = BENCH[name]
        for other, factor in others.items():
            if value >= unusual and least <= value * factor <= most:
                yield (f"{name} is in {unit}, and {value:g} {unit} is unusual for a pendulum; {value:g} {other} would "
                       f"be {name}={value * factor:.6g}.")
                break


def total(numbers: Iterable[float]) -> float:
    """Return the sum of numbers, added one after the other.

    The built-in ``sum`` compensates rounding from Python 3.12 on, and would change the last bits of the result.
    """
    result = 0.0
    for term in numbers:
        result += term
    return result


def setting(
    default: Any, doc: str, check: Any = None, *, note: str = "", optional: bool = False, **more: Any
) -> Any:
    """Return a dataclass field for a value of any kind.

    Args:
        default: default value of the field.
        doc: the meaning, in a few words.
        check: function of a value and the field's name that returns the checked value, or refuses it; None for a
            value that is checked elsewhere.
        note: what a reader needs to know beside the meaning, such as what None stands for.
        optional: None is allowed.
        more: further metadata: "unit"; "allowed" words; "form", the function that returns a value as JSON holds it;
            "acts", a function of an action, the value and two random numbers in [0, 1) that returns another action.
    """
    checks = {} if check is None else {"check": check}
    return field(default=default, metadata={"doc": doc, "note": note, "optional": optional, **checks, **more})


def si(
    default: Any, unit: str, doc: str, *, above: float | None = None, least: float | None = None,
    optional: bool = False, **more: Any,
) -> Any:
    """Return a dataclass field for a number in SI units.

    Args:
        default, doc, more: as in :func:`setting`.
        unit: for example "m" or "N m"; "1" for a pure number.
        above, least: the number must be greater than ``above``, or at least ``least``.
        optional: None is allowed, and means "derived from the scene" unless the note says otherwise.
    """
    check = partial(number, above=above, least=least, unit=unit)
    return setting(default, doc, check, optional=optional, unit=unit, **more)


def count(default: int | None, doc: str, most: int, *, note: str = "") -> Any:
    """Return a dataclass field for a whole number from 1 to ``most``; None is allowed if it is the default."""
    return setting(default, doc, partial(whole_number, most=most), note=note, optional=default is None)


def choice(default: str | None, allowed: Iterable[str], doc: str, *, note: str = "") -> Any:
    """Return a dataclass field for one of several allowed words; None is allowed if it is the default."""
    words = tuple(allowed)
    return setting(default, doc, partial(one_of, allowed=words), note=note, optional=default is None, allowed=words)


def flag(default: bool, doc: str, *, note: str = "") -> Any:
    """Return a dataclass field for True or False."""
    return setting(default, doc, boolean, note=note, allowed=("true", "false"))


@cache
def _checks(kind: Any) -> list[tuple[str, Any, Any, Any]]:
    """Return the name, the check, the default and the checked default of each field of a dataclass that has a check."""
    found = ((entry.name, check, entry.default) for entry in fields(kind) if (check := _check(entry)))
    return [(name, check, value, None if value is MISSING else check(value, name)) for name, check, value in found]


def _check(entry: Field[Any]) -> Any:
    """Return the check of a field, which lets None pass if the field allows it; None for a field without one."""
    check = entry.metadata.get("check")
    if check is None or not entry.metadata.get("optional"):
        return check
    return lambda value, name: None if value is None else check(value, name)


class Checked:
    """Base of dataclasses whose fields from :func:`si`, :func:`choice` and others here are checked on construction.

    The repr is code that recreates the instance, with only the fields that differ from their defaults; those with
    ``repr=False`` are left out.
    """

    def __init_subclass__(cls) -> None:
        if "__repr__" not in vars(cls):
            cls.__repr__ = Checked.__repr__  # type: ignore[method-assign]

    def __post_init__(self) -> None:
        kept = vars(self)
        for name, check, default, checked in _checks(type(self)):  # type: ignore[arg-type]
            value = kept[name]
            kept[name] = checked if value is default else check(value, name)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(self._changed())})"

    def _changed(self) -> list[str]:
        """Return the texts ``name=value`` for all fields of the dataclass that differ from their defaults."""
        values = ((f, getattr(self, f.name)) for f in fields(self) if f.repr)  # type: ignore[arg-type]
        return [f"{f.name}={value!r}" for f, value in values if repr(value) != repr(f.default)]
