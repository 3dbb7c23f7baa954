"""Status line below a frame and list of keys over it, as an interactive window shows them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pendulum_env.render.layout import Box
from pendulum_env.render.paint import Image, box
from pendulum_env.render.palette import rgb
from pendulum_env.render.text import LEAST_SIZE, fit, measure, write
from pendulum_env.render.theme import THEMES

WIDE = 32
"""Width of a window over the font size of its status line, unless that is limited by LEAST_SIZE or LARGEST."""
LARGEST = 22
"""Largest font size of the status line [px]."""


def line_font(width: int) -> int:
    """Return the font size of the status line below a frame of a given width [px]."""
    return min(max(LEAST_SIZE, round(width / WIDE)), LARGEST)


def line_height(width: int) -> int:
    """Return the height of the status line below a frame of a given width [px]."""
    return round(1.7 * line_font(width))


def with_line(picture: Image, status: str, hints: Sequence[str], theme: str) -> Image:
    """Return a picture with a line of text added below it: the status, and the first of ``hints`` that fits."""
    height, width = picture.shape[:2]
    font, high, colours = line_font(width), line_height(width), THEMES[theme]
    window = np.empty((height + high, width, 3), dtype=np.uint8)
    window[:height], window[height:] = picture, rgb(colours.track)
    line, margin = window[height:], 0.5 * font
    line[0] = rgb(colours.hairline)
    text = fit(status, font, width - 2 * margin)
    write(line, text, margin, high / 2, font, colours.ink, (0.0, 0.5), colours.track)
    room = width - 2 * margin - (measure(text, font)[0] + 2 * font if text else 0)
    for hint in hints:
        if measure(hint, font)[0] <= room:
            write(line, hint, width - margin, high / 2, font, colours.faint_ink, (1.0, 0.5), colours.track)
            break
    return window


def with_list(picture: Image, rows: Sequence[tuple[str, str]], theme: str) -> Image:
    """Return a picture with a list of (key, meaning) over its middle, in the largest font in which the list fits."""
    height, width = picture.shape[:2]
    colours, window, margin = THEMES[theme], picture.copy(), 4.0
    for font in range(line_font(width), LEAST_SIZE - 1, -1):
        names = max(measure(name, font)[0] for name, _ in rows)
        wide = names + max(measure(meaning, font)[0] for _, meaning in rows) + 4.0 * font
        high = (1.4 * len(rows) + 1.2) * font
        if wide <= width - 2 * margin and high <= height - 2 * margin:
            break
    area = _centred(width, height, min(wide, width - 2 * margin), min(high, height - 2 * margin))
    box(window, area.left, area.top, area.right, area.bottom, rgb(colours.rule), 0.6 * font)
    box(window, area.left + 1, area.top + 1, area.right - 1, area.bottom - 1, rgb(colours.paper), 0.6 * font - 1)
    first, second = area.left + 1.2 * font, area.left + 2.6 * font + names
    for i, (name, meaning) in enumerate(rows):
        y = area.top + (1.3 + 1.4 * i) * font
        if y + 0.7 * font > area.bottom:
            break
        write(window, fit(name, font, area.right - first - 0.5 * font), first, y, font, colours.ink)
        write(window, fit(meaning, font, area.right - second - 0.5 * font), second, y, font, colours.faint_ink)
    return window


def _centred(width: int, height: int, wide: float, high: float) -> Box:
    """Return the rectangle of ``wide`` by ``high`` pixels in the middle of a picture of ``width`` by ``height``."""
    left, top = (width - wide) / 2, (height - high) / 2
    return Box(left, top, left + wide, top + high)
