"""Layout of a frame: a header line, and a rectangular area for every panel (drawing in the frame)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pendulum_env.render.text import LEAST_SIZE

Rooms = Mapping[str, tuple[float, float]]
"""Comfortable width and height of panels in font sizes, by the panel's name and in their order."""
LEAST, MOST = 50, 8192
TEXT_FROM = 120
"""Frames with a side shorter than this [px] show one panel, without text."""
ALL_FROM = 200
"""Frames with a side shorter than this [px] leave out panels that would be too small to read."""
MAIN = "apparatus"
ENERGY_ROW = 0.88
"""Height of one energy bar in font sizes."""
LEAST_ROOM = 0.6
"""Smallest share of its comfortable size at which a panel is still readable."""
SHARES = (0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65)


@dataclass(frozen=True)
class Box:
    """An upright rectangle in pixels."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        """Width of the rectangle [px]."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Height of the rectangle [px]."""
        return self.bottom - self.top

    @property
    def middle(self) -> tuple[float, float]:
        """Centre (x, y) of the rectangle [px]."""
        return (self.left + self.right) / 2, (self.top + self.bottom) / 2

    def distance(self, x: float, y: float) -> float:
        """Return the distance from a point to the rectangle [px]; 0 inside it."""
        return math.hypot(max(self.left - x, 0, x - self.right), max(self.top - y, 0, y - self.bottom))


@dataclass(frozen=True)
class FrameLayout:
    """Layout of one frame: font size [px], header rectangle (None without header), and area of every panel by name."""

    font: int
    header: Box | None
    areas: Mapping[str, Box]


def font_size(width: int, height: int) -> int:
    """Return the font size [px] of the main text in a frame of ``width`` by ``height`` pixels."""
    return max(LEAST_SIZE, round(0.042 * min(width, height)))


def lay_out(width: int, height: int, rooms: Rooms, bars: int) -> FrameLayout:
    """Divide a frame of ``width`` by ``height`` pixels into a header and an area for each of its panels (drawings).

    The apparatus takes the left part of a wide frame or the upper part of any other; the other panels follow in their
    order. ``rooms`` are their comfortable sizes by name, ``bars`` is the number of energy bars.
    """
    panels = [*rooms]
    if min(width, height) < TEXT_FROM:
        only = MAIN if MAIN in panels else panels[0]
        return FrameLayout(LEAST_SIZE, None, {only: Box(0, 0, width, height)})
    font = font_size(width, height)
    margin = 0.5 * font
    header = Box(margin, 0.3 * font, width - margin, 1.5 * font)
    body = Box(0, header.bottom, width, height)
    if set(panels) == {MAIN, "energy"}:
        return FrameLayout(font, header, _with_bars(width, height, body, font, bars))
    shown = dict(rooms)
    areas, fit = _arranged(body, shown, font)
    while min(width, height) < ALL_FROM and fit < LEAST_ROOM and len(shown) > 1:
        del shown[next(name for name in reversed(shown) if name != MAIN)]
        areas, fit = _arranged(body, shown, font)
    return FrameLayout(font, header, areas)


def _with_bars(width: int, height: int, body: Box, font: int, bars: int) -> dict[str, Box]:
    """Return areas for the drawing of the pendulum and for the energy bars below it, or beside it in a wide frame."""
    margin = 0.5 * font
    if width >= 1.4 * height:
        edge = width - max(12 * font, min(0.45 * width, 24 * font, width - height + body.top))
        space = min(2.4 * font * bars, height - body.top - margin)
        top = (body.top + height - space) / 2
        return {MAIN: Box(0, body.top, edge, height), "energy": Box(edge, top, width - margin, top + space)}
    top = height - bars * ENERGY_ROW * font - margin
    below = Box(margin, top, width - margin, height - margin)
    return {MAIN: Box(0, body.top, width, top - 0.2 * font), "energy": below}


def _arranged(body: Box, rooms: Rooms, font: int) -> tuple[dict[str, Box], float]:
    """Return the best arrangement of a frame's panels as area by name, and a measure of its worst panel.

    The measure is the smallest ratio of a panel's size to the size at which it is comfortable to read.
    """
    rest = {name: room for name, room in rooms.items() if name != MAIN}
    if not rest:
        return {MAIN: body}, 1.0
    margin = 0.5 * font
    inside = Box(body.left + margin, body.top, body.right - margin, body.bottom - margin)
    candidates = []
    for columns in range(1, len(rest) + 1):
        if MAIN not in rooms:
            candidates.append(_stacked(inside, rest, columns, font))
            continue
        for share in SHARES:
            edge, level = body.right - share * body.width, body.bottom - share * body.height
            beside = _stacked(Box(edge, inside.top, inside.right, inside.bottom), rest, columns, font)
            below = _stacked(Box(inside.left, level, inside.right, inside.bottom), rest, columns, font)
            candidates += [{MAIN: Box(body.left, body.top, edge, body.bottom), **beside},
                           {MAIN: Box(body.left, body.top, body.right, level - margin), **below}]
    areas = max(candidates, key=lambda areas: _worth(areas, body, font, rooms))
    return areas, min(_ease(rooms[name], area, font) for name, area in areas.items())


def _stacked(region: Box, rooms: Rooms, columns: int, font: int) -> dict[str, Box]:
    """Return areas for panels in rows of ``columns`` panels, which together fill a region of a frame.

    The heights of the rows are in proportion to the heights at which their panels are comfortable to read. Where there
    is less room than that, the energy bars keep their height, because their names cannot become smaller, as long as the
    graphs stay readable.
    """
    names = [*rooms]
    rows = [names[i : i + columns] for i in range(0, len(names), columns)]
    gap = 0.7 * font
    needs = [max(rooms[name][1] for name in row) for row in rows]
    room = max(region.height - gap * (len(rows) - 1), 0.0)
    heights = [need * room / sum(needs) for need in needs]
    kept = [need * font if "energy" in row else 0.0 for row, need in zip(rows, needs, strict=True)]
    graphs = sum(need for need, own in zip(needs, kept, strict=True) if not own)
    if LEAST_ROOM * font * graphs < room - sum(kept) < font * graphs:
        heights = [own or need * (room - sum(kept)) / graphs for need, own in zip(needs, kept, strict=True)]
    areas, top = {}, region.top
    for row, height in zip(rows, heights, strict=True):
        bottom = top + height
        wide = (region.width - gap * (len(row) - 1)) / len(row)
        for place, name in enumerate(row):
            left = region.left + place * (wide + gap)
            areas[name] = Box(left, top, left + wide, bottom)
        top = bottom + gap
    return areas


def _ease(room: tuple[float, float], area: Box, font: int) -> float:
    """Return the ratio of the size of an area to the size at which the panel in it is comfortable to read."""
    wide, high = room
    return min(area.width / wide, area.height / high) / font


def _worth(areas: Mapping[str, Box], body: Box, font: int, rooms: Rooms) -> float:
    """Return a score of an arrangement of panels in a frame, by which the best arrangement is chosen.

    The score is high if all panels are readable and the drawing of the pendulum is large.
    """
    ease = min(_ease(rooms[name], area, font) for name, area in areas.items())
    main = areas.get(MAIN)
    size = min(main.width, main.height) / min(body.width, body.height) if main else 0.0
    return 2.0 * min(ease, 1.0) + 0.1 * min(ease, 2.0) + size


def grid(panels: int, columns: int | None) -> tuple[int, int]:
    """Return the numbers of columns and rows in which ``panels`` pictures are arranged side by side.

    If ``columns`` is None, the grid is wider than high. Raises ValueError where columns is neither None nor a whole
    number above 0.
    """
    if columns is None:
        columns = math.ceil(panels / max(1, round(math.sqrt(0.7 * panels))))
    elif isinstance(columns, bool) or not isinstance(columns, int) or columns < 1:
        raise ValueError(f"columns must be None or a whole number above 0, not {columns!r}")
    columns = min(columns, panels)
    return columns, math.ceil(panels / columns)


def spare(panels: int, columns: int | None = None) -> int:
    """Return the number of empty places in the grid of several pictures; see :func:`grid`."""
    across, down = grid(panels, columns)
    return across * down - panels if panels > 1 else 0
