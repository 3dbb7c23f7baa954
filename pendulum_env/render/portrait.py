"""The panel "phase": angle and velocity, with the separatrix and the exact orbit behind the motion."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .curves import fading
from .layout import Box
from .paint import Floats, Image, bar, disc
from .palette import rgb
from .strip import letters, round_up
from .text import MINUS, measure, write
from .theme import Theme
from .view import Curves, View

SHOWN = 3.0
"""How much of the past the line goes back [s]."""
FAINTEST = 0.25
"""Strength of the line at its old end."""
TALLEST = 1.1
"""Height of the plot over its width, at most."""


class Portrait:
    """Angle to the right, velocity upwards, both from their negative to their positive reach."""

    def __init__(self, area: Box, font: int, theme: Theme, lettered: bool) -> None:
        self.font, self.theme = letters(font), theme
        high = measure("0", self.font)[1]
        self.high = high if lettered and area.height > 5 * high and area.width > 6 * self.font else 0
        spare = max(0.0, (area.height - 2 * self.high - TALLEST * area.width) / 2)
        area = Box(area.left, area.top + spare, area.right, area.bottom - spare)
        plot = Box(area.left, area.top + self.high, area.right, area.bottom - self.high)
        self.area = area
        self.plot = Box(*(round(edge) for edge in (plot.left, plot.top, plot.right, plot.bottom)))
        self.line = max(1.2, 0.09 * font)
        self.rule = max(1, round(font / 16))

    def still(self, image: Image) -> None:
        """Paint the ground, the axes' lines at 0 and the angle's name."""
        plot, tone = self.plot, rgb(self.theme.hairline)
        bar(image, plot.left, int(plot.top), plot.right, int(plot.bottom), rgb(self.theme.track))
        x, y = (round(middle - self.rule / 2) for middle in plot.middle)
        bar(image, x, int(plot.top), x + self.rule, int(plot.bottom), tone)
        bar(image, plot.left, y, plot.right, y + self.rule, tone)

    def moving(self, image: Image, view: View, tone: Floats) -> None:
        """Paint separatrix, orbit, past and present."""
        curves = view.curves or _scaled(view)
        plot = self.plot
        top, bottom, left, right = int(plot.top), int(plot.bottom), int(plot.left), int(plot.right)
        if right <= left or bottom <= top:
            return
        if view.curves is not None:
            layer = _layer(view.curves, right - left, bottom - top, self.line, self.rule, self.theme)
            image[top:bottom, left:right] = layer
        patch = image[top:bottom, left:right]
        scale = (right - left, bottom - top)
        now = np.array([[view.angle, view.velocity]])
        points, strength = now, np.ones(1)
        if view.past is not None:
            past = view.past
            recent = slice(int(past.time.searchsorted(view.time - SHOWN)), None)
            points = np.vstack((np.stack((past.angle[recent], past.velocity[recent]), axis=1), now))
            ages = (view.time - np.append(past.time[recent], view.time)) / SHOWN
            strength = 1 - (1 - FAINTEST) * ages
        places = _places(points, curves, scale)
        path = _broken(np.column_stack((places, strength)), points, curves)
        fading(patch, path, self.line, tone)
        x, y = places[-1]
        radius = 2.4 * self.line
        x, y = (min(max(float(value), radius), most - radius) for value, most in zip((x, y), scale, strict=True))
        disc(patch, x, y, radius + 0.5 * self.line, rgb(self.theme.paper))
        disc(patch, x, y, radius, tone)
        if self.high:
            self._letters(image, curves)

    def _letters(self, image: Image, curves: Curves) -> None:
        theme, font, area = self.theme, self.font, self.area
        reach = math.degrees(curves.angle_reach)
        ends = f"{reach:.3g}°"
        above, below = area.top + self.high / 2, area.bottom - self.high / 2
        ink = theme.faint_ink
        speed = f"{curves.velocity_reach:.3g}"
        _row(image, area, above, font, theme, (("ω", ink), ("", ink), (f"±{speed} rad/s", ink)))
        _row(image, area, below, font, theme, ((f"{MINUS}{ends}", ink), ("θ", ink), (ends, ink)))


def _row(image: Image, area: Box, y: float, font: int, theme: Theme, texts: tuple[tuple[str, str], ...]) -> None:
    """Write texts at the left, middle and right of an area: as many of the last, first and middle one as fit."""
    (left, _), (middle, _), (right, _) = texts
    wide = [measure(text, font)[0] for text, _ in texts]
    gap, room = 0.5 * font, area.width
    if wide[2] <= room:
        write(image, right, area.right, y, font, texts[2][1], (1.0, 0.5), theme.paper)
    if wide[0] + gap + wide[2] <= room:
        write(image, left, area.left, y, font, texts[0][1], (0.0, 0.5), theme.paper)
        if max(wide[0], wide[2]) + gap + wide[1] / 2 <= room / 2:
            write(image, middle, area.middle[0], y, font, texts[1][1], (0.5, 0.5), theme.paper)


def _scaled(view: View) -> Curves:
    """Reaches for a view without curves."""
    speeds = [abs(view.velocity)] if view.past is None else [abs(view.velocity), *np.abs(view.past.velocity)]
    return Curves(velocity_reach=round_up(1.05 * max(speeds)))


def _places(points: NDArray[np.float64], curves: Curves, size: tuple[int, int]) -> NDArray[np.float64]:
    """Pixels (x, y) of points (angle, velocity) in a plot of this width and height."""
    angles = points[:, 0]
    if curves.periodic:
        angles = (angles + math.pi) % (2 * math.pi) - math.pi
    x = (1 + angles / curves.angle_reach) * (size[0] / 2)
    y = (1 - np.clip(points[:, 1] / curves.velocity_reach, -1e3, 1e3)) * (size[1] / 2)
    return np.stack((x, y), axis=1)


def _broken(path: NDArray[np.float64], points: NDArray[np.float64], curves: Curves) -> NDArray[np.float64]:
    """The path with a gap wherever it leaves at one side to come back at the other."""
    if not curves.periodic or len(path) < 2:
        return path
    turns = np.floor((points[:, 0] + math.pi) / (2 * math.pi))
    gaps = np.flatnonzero(np.diff(turns)) + 1
    return np.insert(path, gaps, np.nan, axis=0)


@lru_cache(maxsize=16)
def _layer(curves: Curves, width: int, height: int, line: float, rule: int, theme: Theme) -> Image:
    """The ground with the separatrix and the orbit, which stay as they are for a whole run."""
    image = np.empty((height, width, 3), dtype=np.uint8)
    image[...] = rgb(theme.track)
    x, y = (round(side / 2 - rule / 2) for side in (width, height))
    image[:, x:x + rule] = image[y:y + rule] = rgb(theme.hairline)
    for lines, tone, thick in ((curves.separatrix, theme.rule, 0.7 * line), (curves.orbit, theme.ink, 0.8 * line)):
        for points in lines:
            path = np.column_stack((_places_plain(points, curves, (width, height)), np.ones(len(points))))
            fading(image, path, thick, rgb(tone))
    image.flags.writeable = False
    return image


def _places_plain(points: NDArray[np.float64], curves: Curves, size: tuple[int, int]) -> NDArray[np.float64]:
    """The same of curves, whose angles are not wrapped."""
    x = (1 + points[:, 0] / curves.angle_reach) * (size[0] / 2)
    y = (1 - points[:, 1] / curves.velocity_reach) * (size[1] / 2)
    return np.stack((x, y), axis=1)
