"""Warnings that name the user's line of code, not a line of this package or of Gymnasium."""

from __future__ import annotations

import inspect
import warnings
from functools import cache

BETWEEN = ("pendulum_env", "integrators", "gymnasium")
"""Packages whose lines a warning does not name."""


def warn(text: str) -> None:
    """Emit a UserWarning that points to the user's line of code: the nearest caller outside this package and Gymnasium.
    """
    here = inspect.currentframe()
    frame, level = here.f_back if here is not None else None, 2
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in BETWEEN:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level)


@cache
def warn_once(text: str) -> None:
    """Emit a UserWarning as :func:`warn` does, but the same text once per process only."""
    warn(text)
