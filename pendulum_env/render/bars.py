"""Energy bars: one row for each entry of the ledger, with its name and its value in joules.

All rows share one axis, from -REACH[0] to REACH[1] times the energy scale, with a line at 0 and a dashed one
at the scale. A bar beyond the axis ends in an arrow head behind a cut; a negative value grows to the left of
zero and is hollow.
"""

from __future__ import annotations

import math

from . import palette
from .layout import Box
from .paint import Image, bar, polygon
from .palette import ENERGY_COLOURS, rgb
from .text import MINUS, measure, write
from .view import View

REACH = (0.25, 1.15)
_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_WIDEST = f"{MINUS}888 mJ"


def rows(view: View) -> tuple[str, ...]:
    """Return the names of the bars that a view asks for: none without a residual, no work without work."""
    if view.residual is None:
        return ()
    return tuple(name for name in ENERGY_COLOURS if getattr(view, name) is not None)


def joules(value: float) -> str:
    """Return an energy with three digits and a unit prefix, for example 12.3 mJ."""
    if value == 0:
        return "0 J"
    if math.isinf(value):
        return "inf J" if value > 0 else f"{MINUS}inf J"
    digits, _, exponent = f"{value:.2e}".partition("e")
    power = int(exponent)
    third = 3 * (power // 3)
    if third in _PREFIXES:
        more = power - third
        text = f"{float(digits) * 10**more:.{2 - more}f} {_PREFIXES[third]}J"
    else:
        text = f"{float(digits):.0f}e{power} J"
    return text.replace("-", MINUS)


def energy_scale(view: View) -> float:
    """Return the energy [J] at the dashed line; without one in the view, the largest of its sums."""
    if view.energy_scale is not None:
        return view.energy_scale
    values = [value for name in rows(view) if math.isfinite(value := getattr(view, name))]
    gained = math.fsum(value for value in values if value > 0)
    return max(gained, *map(abs, values), 0.0) or 1.0


class Axis:
    """Columns and rows of the bars inside their box [px]."""

    def __init__(self, area: Box, font: int, names: tuple[str, ...]) -> None:
        self.names, self.font = names, font
        self.pitch = area.height / len(names)
        self.rows = [area.top + (index + 0.5) * self.pitch for index in range(len(names))]
        self.thick = max(4, round(min(0.6 * self.pitch, 0.7 * font)))
        self.tops = [round(y - self.thick / 2) for y in self.rows]
        self.names_end = area.left + max(measure(name, font)[0] for name in ENERGY_COLOURS)
        values = measure(_WIDEST, font)[0]
        self.values_end = area.right if area.right - self.names_end - values > 6 * font else None
        self.left = round(self.names_end + 0.4 * font + 0.7 * self.thick)
        self.right = round(area.right - (values + 0.4 * font if self.values_end else 0) - 0.7 * self.thick)
        self.unit = round((self.right - self.left) / sum(REACH))
        self.zero = self.left + round(REACH[0] * self.unit)


def paint_tracks(image: Image, axis: Axis) -> None:
    """Paint what stays still: the names, the empty tracks and the axis' two lines."""
    line = max(1, round(axis.font / 16))
    for name, y, top in zip(axis.names, axis.rows, axis.tops, strict=True):
        write(image, name, axis.names_end, y, axis.font, palette.INK, (1.0, 0.5))
        bar(image, axis.left, top, axis.right, top + axis.thick, rgb(palette.TRACK))
    margin = max(1, round(0.2 * axis.thick))
    first, last = axis.tops[0] - margin, axis.tops[-1] + axis.thick + margin
    bar(image, axis.zero - line, first, axis.zero, last, rgb(palette.FAINT_INK))
    dash, scale = max(2, round(0.16 * axis.font)), axis.zero + axis.unit
    for y in range(first, last, 2 * dash):
        bar(image, scale, y, scale + line, min(y + dash, last), rgb(palette.FAINT_INK))


def paint_bars(image: Image, axis: Axis, view: View) -> None:
    """Paint the bars of one view over their tracks."""
    scale = float(energy_scale(view))
    rim = max(1, round(0.16 * axis.thick))
    for name, y, top in zip(axis.names, axis.rows, axis.tops, strict=True):
        value, tone, bottom = float(getattr(view, name)), rgb(ENERGY_COLOURS[name]), top + axis.thick
        end = axis.zero + min(max(value / scale, -2.0), 2.0) * axis.unit
        tip = min(max(end, axis.left), axis.right)
        if value >= 0:
            bar(image, axis.zero, top, tip, bottom, tone)
        else:
            bar(image, tip, top, axis.zero - 1, bottom, tone)
            bar(image, tip + rim, top + rim, axis.zero - 1, bottom - rim, rgb(palette.PAPER))
        if tip != end:
            _overflow(image, tip, top + axis.thick / 2, axis.thick, math.copysign(1.0, value))
        if axis.values_end:
            write(image, joules(value), axis.values_end, y, axis.font, palette.INK, (1.0, 0.5))


def _overflow(image: Image, x: float, y: float, thick: float, side: float) -> None:
    """An arrow head that leaves the track, behind a slanted cut through the bar."""
    middle, half, lean, cut = x - 0.7 * side * thick, thick / 2 + 1, 0.25 * thick, max(1.0, 0.18 * thick)
    polygon(image, [(middle - lean - cut, y + half), (middle + lean - cut, y - half),
                    (middle + lean + cut, y - half), (middle - lean + cut, y + half)], rgb(palette.PAPER))
    reach = 0.7 * thick
    polygon(image, [(x, y - reach), (x + side * reach, y), (x, y + reach)], rgb(palette.INK))
