"""The panel "energy": a horizontal bar for every entry of the energy ledger, with its name and its value in joules.

All bars share one axis, from -1.05 to 1.15 times the energy scale (normally the energy at the start), with a line at 0
and a dashed line at the scale. So a method may lose all the energy before its residual leaves the axis. A bar that is
longer than the axis ends in an arrow head after a cut, and has its value on it if there is no room for values beside
the bars. A negative value is a hollow bar to the left of zero.
"""

from __future__ import annotations

import math

from pendulum_env.render.layout import Box
from pendulum_env.render.paint import Floats, Image, bar, polygon
from pendulum_env.render.palette import ENERGY_COLOURS, Theme, rgb
from pendulum_env.render.text import LEAST_SIZE, MINUS, measure, write
from pendulum_env.render.view import View

REACH = (1.05, 1.15)
LEAST_PITCH = 0.8
"""Smallest distance between rows that have text, in font sizes."""
_PREFIXES = {-18: "a", -15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_WIDEST = f"{MINUS}888 mJ"


def rows(view: View) -> tuple[str, ...]:
    """Return the names of the energies that the panel "energy" draws as bars: those that the view has a value for.

    There are none if the view has no residual of the energy balance.
    """
    if view.residual is None:
        return ()
    return tuple(name for name in ENERGY_COLOURS if getattr(view, name) is not None)


def joules(value: float) -> str:
    """Return an energy [J] as text with three digits and a unit prefix, for example 12.3 mJ."""
    if value == 0:
        return "0 J"
    if math.isinf(value):
        return "inf J" if value > 0 else f"{MINUS}inf J"
    digits, _, exponent = f"{abs(value):.2e}".partition("e")
    sign, power = MINUS if value < 0 else "", int(exponent)
    more = power % 3
    if (prefix := _PREFIXES.get(power - more)) is not None:
        whole, part = digits[0] + digits[2 : 2 + more], digits[2 + more:]
        return f"{sign}{whole}{'.' if part else ''}{part} {prefix}J"
    return f"{sign}{float(digits):.0f}e{power} J".replace("-", MINUS)


def energy_scale(view: View) -> float:
    """Return the energy [J] to which the dashed line of the energy bars belongs.

    It is ``view.energy_scale`` if given, else the larger of two numbers: the sum of the view's positive energies, and
    its largest |energy|. It is 1 if all energies are 0.
    """
    if view.energy_scale is not None:
        return view.energy_scale
    values = [value for name in rows(view) if math.isfinite(value := getattr(view, name))]
    gained = math.fsum(value for value in values if value > 0)
    return max(gained, *map(abs, values), 0.0) or 1.0


class Bars:
    """The panel "energy" of a frame: bars for the energies, with the positions of bars and texts in pixels."""

    def __init__(self, area: Box, font: int, names: tuple[str, ...], theme: Theme) -> None:
        self.names, self.font, self.theme = names, font, theme
        self.inks = [rgb(ENERGY_COLOURS[name]) for name in names]
        self.pitch = min(area.height / len(names), 2.4 * font)
        first = (area.top + area.bottom - self.pitch * len(names)) / 2
        self.rows = [first + (index + 0.5) * self.pitch for index in range(len(names))]
        self.thick = max(3, round(min(0.6 * self.pitch, 0.7 * font)))
        self.tops = [round(y - self.thick / 2) for y in self.rows]
        named, values = max(measure(name, font)[0] for name in ENERGY_COLOURS), measure(_WIDEST, font)[0]
        self.lettered = self.pitch > LEAST_PITCH * font and area.width - named > 3 * font
        self.names_end = area.left + (named if self.lettered else 0)
        valued = self.lettered and area.right - self.names_end - values > 6 * font
        self.values_end = area.right if valued else None
        self.left = round(self.names_end + (0.4 * font if self.lettered else 0) + 0.7 * self.thick)
        self.right = round(area.right - (values + 0.4 * font if self.values_end else 0) - 0.7 * self.thick)
        self.unit = round((self.right - self.left) / sum(REACH))
        self.zero = self.left + round(REACH[0] * self.unit)

    def still(self, image: Image) -> None:
        """Paint what is equal in all frames: names of the energies, empty bars, lines at zero and energy scale."""
        theme, line = self.theme, max(1, round(self.font / 16))
        for name, y, top in zip(self.names, self.rows, self.tops, strict=True):
            if self.lettered:
                write(image, name, self.names_end, y, self.font, theme.ink, (1.0, 0.5), theme.paper)
            bar(image, self.left, top, self.right, top + self.thick, rgb(theme.track))
        margin = max(1, round(0.2 * self.thick))
        first, last = self.tops[0] - margin, self.tops[-1] + self.thick + margin
        bar(image, self.zero - line, first, self.zero, last, rgb(theme.rule))
        dash, scale = max(2, round(0.16 * self.font)), self.zero + self.unit
        for y in range(first, last, 2 * dash):
            bar(image, scale, y, scale + line, min(y + dash, last), rgb(theme.rule))

    def moving(self, image: Image, view: View, tone: Floats) -> None:
        """Paint the energies of one instant as bars, and their values as text; the colour ``tone`` is not used."""
        scale, theme = float(energy_scale(view)), self.theme
        rim = max(1, round(0.16 * self.thick))
        for name, y, top, ink in zip(self.names, self.rows, self.tops, self.inks, strict=True):
            value, bottom = float(getattr(view, name)), top + self.thick
            end = self.zero + min(max(value / scale, -2.0), 2.0) * self.unit
            tip = min(max(end, self.left), self.right)
            if value >= 0:
                bar(image, self.zero, top, tip, bottom, ink)
            else:
                bar(image, tip, top, self.zero - 1, bottom, ink)
                bar(image, tip + rim, top + rim, self.zero - 1, bottom - rim, rgb(theme.paper))
            if tip != end:
                side = math.copysign(1.0, value)
                self._overflow(image, tip, top + self.thick / 2, side)
                text, room = joules(value), abs(tip - self.zero) - 1.4 * self.thick
                if self.lettered and not self.values_end and measure(text, LEAST_SIZE)[0] <= room:
                    write(image, text, self.zero + side * 0.3 * self.font, y, LEAST_SIZE, theme.ink,
                          (0.0 if side > 0.0 else 1.0, 0.5))
            if self.values_end:
                write(image, joules(value), self.values_end, y, self.font, theme.ink, (1.0, 0.5), theme.paper)

    def _overflow(self, image: Image, x: float, y: float, side: float) -> None:
        """Paint a slanted cut and an arrow head at the end of a bar that is too long for the axis."""
        thick = self.thick
        middle, half, lean, cut = x - 0.7 * side * thick, thick / 2 + 1, 0.25 * thick, max(1.0, 0.18 * thick)
        polygon(image, [(middle - lean - cut, y + half), (middle + lean - cut, y - half),
                        (middle + lean + cut, y - half), (middle - lean + cut, y + half)], rgb(self.theme.paper))
        reach = 0.7 * thick
        polygon(image, [(x, y - reach), (x + side * reach, y), (x, y + reach)], rgb(self.theme.ink))
