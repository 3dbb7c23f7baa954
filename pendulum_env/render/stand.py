"""What stands still: the stand, its arm, the sensor's wheel and the degree scale, painted once per size."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from . import palette
from .bars import Axis, paint_tracks
from .layout import Box, lay_out
from .paint import Image, box, disc, stroke
from .palette import gradient, rgb
from .ring import Ring
from .text import LEAST_SIZE, MINUS, measure, write
from .view import Apparatus

_WHEEL = ((1.0, palette.STEEL_DARK), (0.94, palette.STEEL_LIGHT), (0.70, palette.STEEL_DARK),
          (0.65, palette.STEEL), (0.40, palette.STEEL_DARK), (0.35, palette.STEEL_LIGHT))
_TICKS = ((30, 0.10, palette.INK), (10, 0.065, palette.FAINT_INK), (5, 0.035, palette.FAINT_INK))
_NUMBERS_END = 0.86
_TURN_RADIUS, _TURN_WIDTH = 0.38, 0.055


class Stage:
    """The still background of one apparatus at one size, and the geometry of what moves before it.

    background: (H, W, 3) uint8.  x, y: the pivot [px].  scale [px/m].
    arm, bob, rod, dial, wheel: length, bob's radius, rod's width, radius of the degree scale and wheel [px].
    reach: how far from the place of the pivot the bob may get [px].
    shaken: the pivot moves, and the wheel is left out of the background.
    path, turn: the circles of the trail and of the torque arrow.
    """

    def __init__(self, apparatus: Apparatus, width: int, height: int, bars: tuple[str, ...]) -> None:
        self.layout = lay_out(width, height, len(bars))
        body = self.layout.body
        room = min(body.width, body.height) / 2 - max(3.0, 0.015 * min(width, height))
        self.x, self.y = body.middle
        self.shaken = any(apparatus.sway)
        self.scale = room / (apparatus.length + apparatus.bob_radius + max(apparatus.sway))
        self.arm, self.bob = apparatus.length * self.scale, max(apparatus.bob_radius * self.scale, 2.5)
        thinnest = max(2.2, 0.016 * self.arm) if apparatus.suspension == "rod" else max(1.3, 0.006 * self.arm)
        self.reach = self.arm + self.bob + max(apparatus.sway) * self.scale
        self.rod = min(max(2 * apparatus.rod_radius * self.scale, thinnest), 0.2 * room + thinnest)
        self.dial = max(min(0.74 * self.arm, self.arm - self.bob - 0.08 * room), 0.3 * room)
        self.wheel = 0.18 * self.dial
        shape = (height, width)
        self.path = Ring(self.x, self.y, self.arm, max(2.0, 0.02 * self.arm, 0.5 * self.bob), shape)
        self.turn = Ring(self.x, self.y, _TURN_RADIUS * self.dial, max(2.0, _TURN_WIDTH * self.dial), shape)
        self.axis = Axis(self.layout.bars, self.layout.font, bars) if self.layout.bars else None
        self.background: Image = np.empty((height, width, 3), dtype=np.uint8)
        self.background[...] = rgb(palette.PAPER)
        _paint_stand(self.background, self)
        _paint_dial(self.background, self)
        if self.axis:
            paint_tracks(self.background, self.axis)
        self.background.flags.writeable = False

    def pivot(self, away: tuple[float, float]) -> tuple[float, float]:
        """Return the pixel (x, y) of a pivot so far to the right and upwards of its place [m]."""
        return (self.x + away[0] * self.scale, self.y - away[1] * self.scale) if self.shaken else (self.x, self.y)

    def point(self, angle: float, radius: float) -> tuple[float, float]:
        """Return the pixel (x, y) at an angle [rad] and a distance [px] from the place of the pivot."""
        return self.x + radius * math.sin(angle), self.y + radius * math.cos(angle)

    def corner(self, width: float, height: float) -> bool:
        """Whether a box of this size fits into a corner of the body, clear of the pendulum's circle."""
        body = self.layout.body
        dx, dy = body.width / 2 - width, body.height / 2 - height
        return dx > 0 and dy > 0 and math.hypot(dx, dy) > self.reach


@lru_cache(maxsize=16)
def stage(apparatus: Apparatus, width: int, height: int, bars: tuple[str, ...]) -> Stage:
    """Return the stage of an apparatus at a size, painted once and kept while it is in use."""
    return Stage(apparatus, width, height, bars)


def _paint_stand(image: Image, at: Stage) -> None:
    """An arm from the left edge to the pivot and, where there is room, the post it is clamped to."""
    body, thick = at.layout.body, max(3.0, 0.07 * at.arm)
    steel = gradient(palette.STEEL_DARK, palette.STEEL_LIGHT, palette.STEEL, palette.STEEL_DARK)
    free = at.x - at.reach - body.left
    post, standing = body.left + free / 2, free > 2.4 * thick
    if standing:
        foot = body.bottom - 0.2 * thick
        stroke(image, post, body.top + 0.4 * thick, post, foot, 0.75 * thick, steel)
        box(image, post - 1.1 * thick, foot - 0.4 * thick, post + 1.1 * thick, foot, rgb(palette.SENSOR),
            0.15 * thick)
    stroke(image, post if standing else body.left, at.y, at.x, at.y, 0.6 * thick, steel)
    if standing:
        reach = 0.75 * thick
        box(image, post - reach, at.y - reach, post + reach, at.y + reach, rgb(palette.SENSOR), 0.3 * thick)
        disc(image, post, at.y, 0.35 * thick, rgb(palette.STEEL))


def _paint_dial(image: Image, at: Stage) -> None:
    line = max(1.0, 0.008 * at.dial)
    disc(image, at.x, at.y, at.dial + 2 * line, rgb(palette.DIAL_EDGE))
    disc(image, at.x, at.y, at.dial + line, rgb(palette.DIAL))
    finest = next((step for step in (5, 10) if at.dial * math.radians(step) > 5), 30)
    for degrees in range(-180, 180, finest):
        depth, tone = next((depth, tone) for step, depth, tone in _TICKS if degrees % step == 0)
        angle = math.radians(degrees)
        stroke(image, *at.point(angle, at.dial), *at.point(angle, at.dial * (1 - depth)), line, rgb(tone))
    if at.layout.header:
        for text, size, x, y in _numbers(at):
            write(image, text, x, y, size, palette.INK, (0.5, 0.5), paper=None)
    if not at.shaken:
        paint_wheel(image, at, at.x, at.y)


def paint_wheel(image: Image, at: Stage, x: float, y: float) -> None:
    """The sensor's housing and wheel around (x, y) [px]."""
    wide, high = 1.5 * at.wheel, 1.2 * at.wheel
    box(image, x - wide, y - high, x + wide, y + high, rgb(palette.SENSOR), 0.4 * at.wheel)
    for share, tone in _WHEEL:
        disc(image, x, y, share * at.wheel, rgb(tone))


def _numbers(at: Stage) -> list[tuple[str, int, float, float]]:
    """The scale's numbers (text, font size, x, y), as many as leave room for the torque arrow.

    Those are clear of each other too.
    """
    size = max(LEAST_SIZE, round(0.82 * at.layout.font))
    clear = at.turn.radius + 2 * _TURN_WIDTH * at.dial
    for step in (30, 90):
        placed, boxes = [], []
        for degrees in range(step - 180, 181, step):
            text = f"{degrees}°".replace("-", MINUS)
            wide, high = measure(text, size)
            high = round(0.75 * high)
            angle = math.radians(degrees)
            reach = (abs(math.sin(angle)) * wide + abs(math.cos(angle)) * high) / 2
            x, y = at.point(angle, _NUMBERS_END * at.dial - reach)
            placed.append((text, size, x, y))
            boxes.append(Box(x - wide / 2, y - high / 2, x + wide / 2, y + high / 2))
        if all(area.distance(at.x, at.y) > clear for area in boxes):
            return placed
    return []
