"""The panel "phase": a phase portrait of the motion, with the separatrix and the exact orbit behind it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render.curves import fading
from pendulum_env.render.layout import Box
from pendulum_env.render.paint import Floats, Image, bar, disc
from pendulum_env.render.palette import Theme, rgb
from pendulum_env.render.strip import letters, round_up
from pendulum_env.render.text import MINUS, measure, write
from pendulum_env.render.view import Orbits, View

SHOWN = 3.0
"""Time before the shown instant that the portrait shows as a line [s]."""
FAINTEST = 0.25
"""Opacity of the line of the motion at its oldest point."""
TALLEST = 1.1
"""Largest ratio of the plot's height to its width."""


REACHES = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Limits that the axes of a portrait may have, times a power of ten."""
SPARE = 1.05
"""Smallest ratio of an axis' limit to the largest value that is shown."""
MOST = 1e300
"""Largest limit of an axis."""


def reach(value: float) -> float:
    """Return a round limit for an axis that shows ``value``, the next larger of ..., 1, 1.2, 1.5, 2, 2.5, 3, 4, ..."""
    return round_up(value, REACHES)


class Portrait:
    """The panel "phase" of a frame: phase portrait, angle to the right, velocity upwards, zero in the middle."""

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
        """Paint what is equal in all frames: background of the phase portrait, lines at zero angle and velocity."""
        plot, tone = self.plot, rgb(self.theme.hairline)
        bar(image, plot.left, int(plot.top), plot.right, int(plot.bottom), rgb(self.theme.track))
        x, y = (round(middle - self.rule / 2) for middle in plot.middle)
        bar(image, x, int(plot.top), x + self.rule, int(plot.bottom), tone)
        bar(image, plot.left, y, plot.right, y + self.rule, tone)

    def moving(self, image: Image, view: View, tone: Floats) -> None:
        """Paint separatrix and exact orbit, the motion of the last seconds as a line, the present as a dot."""
        curves = wide_enough(view)
        plot = self.plot
        top, bottom, left, right = int(plot.top), int(plot.bottom), int(plot.left), int(plot.right)
        if right <= left or bottom <= top:
            return
        if view.curves is not None:
            layer = _layer(view.curves, curves.angle_reach, curves.velocity_reach, right - left, bottom - top,
                           self.line, self.rule, self.theme)
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
        path = _broken(np.column_stack((places, strength)), points, curves, scale[0])
        fading(patch, path, self.line, tone)
        x, y = places[-1]
        radius = 2.4 * self.line
        x, y = (min(max(float(value), radius), most - radius) for value, most in zip((x, y), scale, strict=True))
        disc(patch, x, y, radius + 0.5 * self.line, rgb(self.theme.paper))
        disc(patch, x, y, radius, tone)
        if self.high:
            self._letters(image, curves)

    def _letters(self, image: Image, curves: Orbits) -> None:
        """Write the names and limits of both axes of a phase portrait, and the name of the exact orbit."""
        theme, font, area = self.theme, self.font, self.area
        wide = math.degrees(curves.angle_reach)
        ends = f"{wide:.0f}°" if 100.0 <= wide < 1e5 else f"{wide:.3g}°"
        above, below = area.top + self.high / 2, area.bottom - self.high / 2
        ink = theme.faint_ink
        speed = f"{curves.velocity_reach:.3g}"
        _row(image, area, above, font, theme, (("ω", ink), (f"±{speed} rad/s", ink)), curves.notes, theme.ink)
        _row(image, area, below, font, theme, ((f"{MINUS}{ends}", ink), (ends, ink)), ("θ",), ink)


def _row(image: Image, area: Box, y: float, font: int, theme: Theme, ends: tuple[tuple[str, str], tuple[str, str]],
         middles: tuple[str, ...], ink: str) -> None:
    """Write a row of texts: one left, one right and, between them, the first of ``middles`` that fits."""
    (left, left_ink), (right, right_ink) = ends
    first, last = (measure(text, font)[0] for text in (left, right))
    gap, room = 0.5 * font, area.width
    if last <= room:
        write(image, right, area.right, y, font, right_ink, (1.0, 0.5), theme.paper)
    if first + gap + last > room:
        return
    write(image, left, area.left, y, font, left_ink, (0.0, 0.5), theme.paper)
    for middle in middles:
        half = measure(middle, font)[0] / 2
        if max(first, last) + gap + half <= room / 2:
            write(image, middle, area.middle[0], y, font, ink, (0.5, 0.5), theme.paper)
            return


def wide_enough(view: View) -> Orbits:
    """Return a view's curves with limits of the axes large enough for the motion before and at the shown instant.

    The curves are the separatrix and the exact orbit of the phase portrait.
    """
    curves, past = view.curves, view.past
    speeds = abs(view.velocity)
    shown = np.array([view.angle]) if past is None else np.append(past.angle, view.angle)
    if past is not None:
        speeds = max(speeds, float(np.abs(past.velocity).max(initial=0.0)))
    if curves is None:
        return Orbits(velocity_reach=reach(min(SPARE * speeds, MOST)))
    if speeds > curves.velocity_reach:
        curves = replace(curves, velocity_reach=reach(min(SPARE * speeds, MOST)))
    if curves.periodic and curves.angle_reach >= math.pi:
        return curves
    angles = float(np.abs(_wrapped(shown) if curves.periodic else shown).max())
    if angles > curves.angle_reach:
        wide = math.radians(reach(math.degrees(min(SPARE * angles, MOST))))
        curves = replace(curves, angle_reach=min(wide, math.pi) if curves.periodic else wide)
    return curves


def _places(points: NDArray[np.float64], curves: Orbits, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the pixels (x, y) of states (angle, velocity) in a phase portrait of size (width, height) pixels."""
    angles = _wrapped(points[:, 0]) if curves.periodic else points[:, 0]
    x = (1 + angles / curves.angle_reach) * (size[0] / 2)
    y = (1 - np.clip(points[:, 1] / curves.velocity_reach, -1e3, 1e3)) * (size[1] / 2)
    return np.stack((x, y), axis=1)


def _wrapped(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles [rad] reduced to one turn, from -pi up to but not including pi."""
    return (angles + math.pi) % (2 * math.pi) - math.pi


def _broken(path: NDArray[np.float64], points: NDArray[np.float64], curves: Orbits, width: int) -> NDArray[np.float64]:
    """Return a path in a phase portrait with a gap where the angle passes from pi to -pi or back.

    There the path leaves the plot at one side and continues at the other. ``path`` has rows (x, y, opacity), ``points``
    the states (angle, velocity).
    """
    if not curves.periodic or len(path) < 2:
        return path
    turns = np.floor((points[:, 0] + math.pi) / (2 * math.pi))
    steps = np.diff(turns)
    before = np.flatnonzero(steps)
    if not before.size:
        return path
    after, ahead = before + 1, steps[before] > 0
    border = 2 * math.pi * np.where(ahead, turns[after], turns[before]) - math.pi
    share = (border - points[before, 0]) / (points[after, 0] - points[before, 0])
    edges = np.full((len(before), 3, 3), np.nan)
    edges[:, ::2, 1:] = (path[before] + share[:, None] * (path[after] - path[before]))[:, None, 1:]
    far = 0.5 * width * math.pi / curves.angle_reach * np.where(ahead, 1.0, -1.0)
    edges[:, 0, 0], edges[:, 2, 0] = 0.5 * width + far, 0.5 * width - far
    edges[np.abs(steps[before]) > 1] = np.nan
    return np.insert(path, after.repeat(3), edges.reshape(-1, 3), axis=0)


@lru_cache(maxsize=16)
def _layer(curves: Orbits, wide: float, high: float, width: int, height: int, line: float, rule: int,
           theme: Theme) -> Image:
    """Return the background of a phase portrait with separatrix and exact orbit, which do not change during a run."""
    curves = replace(curves, angle_reach=wide, velocity_reach=high)
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


def _places_plain(points: NDArray[np.float64], curves: Orbits, size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the pixels (x, y) of points (angle, velocity) of a curve; angles may exceed a full turn."""
    x = (1 + points[:, 0] / curves.angle_reach) * (size[0] / 2)
    y = (1 - points[:, 1] / curves.velocity_reach) * (size[1] / 2)
    return np.stack((x, y), axis=1)
