"""Warnings that point at the line that asked, whatever of this package and of Gymnasium stands between."""

from __future__ import annotations

import inspect
import warnings

BETWEEN = ("pendulum_env", "integrators", "gymnasium")


def warn(text: str) -> None:
    """A UserWarning of the nearest caller outside these packages."""
    here = inspect.currentframe()
    frame, level = here.f_back if here is not None else None, 2
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in BETWEEN:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level)
