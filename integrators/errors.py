"""The package's exception class, and a function that formats values for error messages."""

from __future__ import annotations

from typing import Any

LONGEST = 100
"""Maximum number of characters of a value in an error message."""


class MethodError(ValueError):
    """Error raised for an unknown method, a method that does not fit the problem, or a step that failed."""


def shown(value: Any) -> str:
    """Return a value as text for an error message: on one line, cut off after :data:`LONGEST` characters."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python refuses to print integers of more than some thousand digits
        text = f"a {type(value).__name__} too long to be written"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
