"""Where things go: a frame is cut into header, body and energy bars, the pendulum turns in the body."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .text import LEAST_SIZE

LEAST, MOST = 50, 8192
TEXT_FROM = 120
"""Frames smaller than this in either direction show the pendulum alone, without text and bars."""


@dataclass(frozen=True)
class Box:
    """An upright rectangle in pixels."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        return self.right - self.left

    @property
    def height(self) -> float:
        return self.bottom - self.top

    @property
    def middle(self) -> tuple[float, float]:
        return (self.left + self.right) / 2, (self.top + self.bottom) / 2

    def distance(self, x: float, y: float) -> float:
        """Distance from a point to the box; 0 inside it."""
        return math.hypot(max(self.left - x, 0, x - self.right), max(self.top - y, 0, y - self.bottom))


@dataclass(frozen=True)
class Layout:
    """The parts of one frame; `header` and `bars` are None where they are not shown. `font` is in pixels."""

    font: int
    header: Box | None
    body: Box
    bars: Box | None


def font_size(width: int, height: int) -> int:
    """Return the size of a frame's main text in pixels."""
    return max(LEAST_SIZE, round(0.042 * min(width, height)))


def lay_out(width: int, height: int, bars: int) -> Layout:
    """Cut a frame for so many energy bars, or none: below the pendulum, or beside it in wide frames."""
    if min(width, height) < TEXT_FROM:
        return Layout(LEAST_SIZE, None, Box(0, 0, width, height), None)
    font = font_size(width, height)
    margin = 0.5 * font
    header = Box(margin, 0.3 * font, width - margin, 1.5 * font)
    if not bars:
        return Layout(font, header, Box(0, header.bottom, width, height), None)
    if width >= 1.4 * height:
        edge = width - max(12 * font, min(0.45 * width, 24 * font, width - height + header.bottom))
        space = min(2.4 * font * bars, height - header.bottom - margin)
        top = (header.bottom + height - space) / 2
        return Layout(font, header, Box(0, header.bottom, edge, height),
                      Box(edge, top, width - margin, top + space))
    top = height - bars * 0.88 * font - margin
    below = Box(margin, top, width - margin, height - margin)
    return Layout(font, header, Box(0, header.bottom, width, top - 0.2 * font), below)


def grid(panels: int, columns: int | None) -> tuple[int, int]:
    """Return (columns, rows) for so many panels: wider than high where the number of columns is left open.

    Raises ValueError where columns is not a whole number above 0.
    """
    if columns is None:
        columns = math.ceil(panels / max(1, round(math.sqrt(0.7 * panels))))
    elif isinstance(columns, bool) or not isinstance(columns, int) or columns < 1:
        raise ValueError(f"columns must be None or a whole number above 0, not {columns!r}")
    columns = min(columns, panels)
    return columns, math.ceil(panels / columns)
