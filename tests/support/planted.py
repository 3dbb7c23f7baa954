"""Folders of somebody else, with files that must not be run."""

from __future__ import annotations

from pathlib import Path
from typing import Any


class Planted:
    """A pickle that leaves a trace where it is loaded."""

    def __init__(self, trace: Path) -> None:
        self.trace = trace

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.trace,)


def code(trace: Path) -> str:
    return f"__import__('pathlib').Path({str(trace)!r}).touch()"
