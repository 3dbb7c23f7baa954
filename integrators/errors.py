"""The error of this package, and how its messages show a value."""

from __future__ import annotations

from typing import Any

LONGEST = 100
"""Most characters of a value in a message."""


class MethodError(ValueError):
    """A method that does not exist, does not fit the problem, or could not take a step."""


def shown(value: Any) -> str:
    """A value as error messages show it: one line, and not a long one."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python writes no whole number of more than some thousand digits
        text = f"a {type(value).__name__} too long to be written"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
