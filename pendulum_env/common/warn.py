"""Warnings that point at the line that asked, whatever of this package and of Gymnasium stands between."""

from __future__ import annotations

import sys
import warnings
from types import FrameType

BETWEEN = ("pendulum_env", "integrators", "gymnasium")


def warn(text: str) -> None:
    """A UserWarning of the nearest caller outside these packages."""
    frame: FrameType | None = sys._getframe(1)
    level = 2
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in BETWEEN:
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level)
