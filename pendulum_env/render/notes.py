"""Picture of a window: frames with readings in large type below them, a status line, and a list of keys over them.

The type grows with the window, so that its readings can be read from the back row of a class.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from pendulum_env.render.layout import LEAST, MOST, Box
from pendulum_env.render.paint import Image, box
from pendulum_env.render.palette import THEMES, rgb
from pendulum_env.render.text import LEAST_SIZE, MINUS, fit, measure, write

STATUS = (26, 20)
"""Width and height of a window over the font size of its status line."""
READING = 16
"""Height of a window over the largest font size of the readings."""
WIDEST = f"residual {MINUS}88.8 mJ"
"""Text for which every reading has room."""
SPACING = 1.3
"""Height of a row of readings over its font size."""
SHARE = 0.35
"""Largest share of the height of a pendulum's panel that its readings take."""
STACKED = 0.75
"""Readings stand one above the other if a single row would need a font below this share of the larger one."""

LISTED = 22
"""Height of a window over the largest font size of the list of keys."""


@dataclass(frozen=True)
class Sheet:
    """Division of a window of ``width`` by ``height`` pixels into ``count`` frames, their readings and a status line.

    ``readings`` is the number of readings of every pendulum.
    """

    width: int
    height: int
    count: int = 1
    readings: int = 0

    @property
    def status_font(self) -> int:
        """Font size of the status line [px]."""
        return max(LEAST_SIZE, round(min(self.width / STATUS[0], self.height / STATUS[1])))

    @property
    def status_height(self) -> int:
        """Height of the status line [px]."""
        return round(1.7 * self.status_font)

    @cached_property
    def columns(self) -> int:
        """Number of pendulums in a row: that with the largest frames and, among these, the fewest empty places."""

        def worth(columns: int) -> tuple[float, int]:
            width, height = self._panel(columns)
            rows, font = self._rows_of_readings(columns)
            return min(width, height - rows * round(SPACING * font)), -columns * math.ceil(self.count / columns)

        return max(range(1, self.count + 1), key=worth)

    @property
    def panel(self) -> tuple[int, int]:
        """Width and height of the panel of one pendulum, its readings included [px]."""
        return self._panel(self.columns)

    @property
    def reading_font(self) -> int:
        """Font size of the readings [px]."""
        return self._rows_of_readings(self.columns)[1]

    @property
    def reading_rows(self) -> int:
        """Number of rows of the readings of one pendulum."""
        return self._rows_of_readings(self.columns)[0]

    @property
    def readings_height(self) -> int:
        """Height of the readings of one pendulum [px]."""
        return self.reading_rows * round(SPACING * self.reading_font)

    @property
    def frame(self) -> tuple[int, int]:
        """Width and height of the frame of one pendulum [px], which frames of the allowed sizes limit."""
        width, height = self.panel
        return _clamped(width), _clamped(height - self.readings_height)

    def _panel(self, columns: int) -> tuple[int, int]:
        """Return the width and height of a panel [px], for a number of panels in a row."""
        return self.width // columns, (self.height - self.status_height) // math.ceil(self.count / columns)

    def _rows_of_readings(self, columns: int) -> tuple[int, int]:
        """Return the number of rows of readings and their font size [px], for a number of panels in a row.

        The readings stand side by side, or one above the other if their type is much larger then.
        """
        if not self.readings:
            return 0, LEAST_SIZE
        width, height = self._panel(columns)
        room = 100.0 / (measure(WIDEST, 100)[0] + 100.0)
        most, high = self.height / READING, SHARE * height / SPACING
        beside, above = (min(most, high / rows, room * width * rows / self.readings) for rows in (1, self.readings))
        rows, font = (1, beside) if beside >= STACKED * above else (self.readings, above)
        return rows, max(LEAST_SIZE, round(font))

    def corner(self, place: int) -> tuple[int, int]:
        """Return the left upper corner (x, y) of the panel of the pendulum with the index ``place`` [px]."""
        row, column = divmod(place, self.columns)
        return column * self.panel[0], row * self.panel[1]

    def place(self, x: float, y: float) -> int:
        """Return the index, from 0, of the pendulum whose panel is at (x, y) [px]; 0 beside all panels, too."""
        width, height = self.panel
        place = int(y // height) * self.columns + int(x // width)
        return place if 0 <= x // width < self.columns and 0 <= place < self.count else 0

    def picture(self, frames: Sequence[Image], readings: Sequence[Sequence[str]], status: str, hints: Sequence[str],
                theme: str) -> Image:
        """Return the window's picture from the frames and the readings of its pendulums, and the status line's text.

        The status line ends with the first of ``hints`` that fits.
        """
        image = _blank(self, theme).copy()
        for place, (shown, texts) in enumerate(zip(frames, readings, strict=True)):
            x, y = self.corner(place)
            left, top = x + bool(x), y + bool(y)  # beside the lines between panels
            part = image[top : y + self.panel[1] - self.readings_height, left : x + self.panel[0]]
            inside = shown[top - y :, left - x :][: len(part), : part.shape[1]]
            part[: len(inside), : inside.shape[1]] = inside
            self._write_readings(self._below(image, place), texts, theme)
        self._write_status(image[self.height - self.status_height :], status, hints, theme)
        return image

    def _below(self, image: Image, place: int) -> Image:
        """Return the part of a picture for the readings of the pendulum with the index ``place``."""
        (x, y), (width, height) = self.corner(place), self.panel
        return image[y + height - self.readings_height : y + height, x : x + width]

    def _write_readings(self, strip: Image, texts: Sequence[str], theme: str) -> None:
        """Write the readings of one pendulum into the strip below its frame."""
        colours, font, rows = THEMES[theme], self.reading_font, self.reading_rows
        if not rows:
            return
        wide, high = strip.shape[1] / (self.readings // rows), strip.shape[0] / rows
        for place, text in enumerate(texts):
            row, column = divmod(place, self.readings // rows)
            at = (column * wide + 0.5 * font, (row + 0.5) * high)
            write(strip, fit(text, font, wide - 0.6 * font), *at, font, colours.ink, (0.0, 0.5), colours.track)

    def _write_status(self, line: Image, status: str, hints: Sequence[str], theme: str) -> None:
        """Write the status line, in smaller type if its text is long."""
        colours, (high, width) = THEMES[theme], line.shape[:2]
        margin = 0.5 * self.status_font
        room = width - 2 * margin
        sizes = range(self.status_font, LEAST_SIZE - 1, -1)
        font = next((size for size in sizes if measure(status, size)[0] <= room), LEAST_SIZE)
        text = fit(status, font, room)
        write(line, text, margin, high / 2, font, colours.ink, (0.0, 0.5), colours.track)
        faint = max(LEAST_SIZE, round(0.7 * self.status_font))
        room -= measure(text, font)[0] + font if text else 0
        for hint in hints:
            if measure(hint, faint)[0] <= room:
                write(line, hint, width - margin, high / 2, faint, colours.faint_ink, (1.0, 0.5), colours.track)
                break


@lru_cache(maxsize=8)
def _blank(sheet: Sheet, theme: str) -> Image:
    """Return the background of a window's pictures, on which frames and texts are painted."""
    colours = THEMES[theme]
    image = np.empty((sheet.height, sheet.width, 3), dtype=np.uint8)
    image[...] = rgb(colours.paper)
    strips = [image[sheet.height - sheet.status_height :]]
    for place in range(sheet.count):
        x, y = sheet.corner(place)
        strips += [sheet._below(image, place)] if sheet.readings else []
        if x:
            image[y : y + sheet.panel[1], x] = rgb(colours.hairline)
        if y:
            image[y, x : x + sheet.panel[0]] = rgb(colours.hairline)
    for strip in strips:
        strip[...] = rgb(colours.track)
        strip[0] = rgb(colours.hairline)
    image.flags.writeable = False
    return image


def sheet_around(frame: tuple[int, int], readings: int) -> Sheet:
    """Return the sheet of one pendulum whose frame has this width and height [px]."""
    width, height = frame
    sheets = (Sheet(width, high, 1, readings) for high in range(height, 3 * height + 200))
    return next(sheet for sheet in sheets if sheet.panel[1] - sheet.readings_height >= height)


def with_list(picture: Image, rows: Sequence[tuple[str, str]], theme: str) -> Image:
    """Return a picture with a list of (key, meaning) over its middle, in the largest font in which the list fits."""
    height, width = picture.shape[:2]
    colours, window, margin = THEMES[theme], picture.copy(), 4.0
    for font in range(max(LEAST_SIZE, height // LISTED), LEAST_SIZE - 1, -1):
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


def _clamped(side: int) -> int:
    """Return the nearest allowed side of a frame [px]."""
    return min(max(side, LEAST), MOST)


def _centred(width: int, height: int, wide: float, high: float) -> Box:
    """Return the rectangle of ``wide`` by ``high`` pixels in the middle of a picture of ``width`` by ``height``."""
    left, top = (width - wide) / 2, (height - high) / 2
    return Box(left, top, left + wide, top + high)
