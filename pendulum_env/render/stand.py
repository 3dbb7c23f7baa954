"""The panel "apparatus": a pendulum on its stand.

The stand with its arm, the sensor's wheel and the degree scale are painted once per size. The trail, the torque arrow,
the rod or wire, the bob and the readings are painted in every frame.

Arcs and the trail are painted on a thin circle of pixels, which are sorted by angle (:class:`Ring`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render import pixels
from pendulum_env.render.curves import fading
from pendulum_env.render.layout import Box
from pendulum_env.render.paint import Floats, Image, Stamp, ball, box, disc, loops, stroke
from pendulum_env.render.palette import Theme, gradient, rgb
from pendulum_env.render.pixels import TURN
from pendulum_env.render.text import LEAST_SIZE, MINUS, measure, write
from pendulum_env.render.view import BALL, BAR, Apparatus, View

HEAD = 0.6
"""Ratio of half the width of an arrow's head to its length."""
_SLOPE = HEAD / math.hypot(1, HEAD)


class Ring:
    """Pixels near a circle in an image, on which arcs, arrows and trails are painted.

    They are the pixels of an image of `shape` (H, W) within `reach` of a circle of `radius` around (x, y), in the order
    of their angle [rad] from the downward vertical, counter-clockwise positive. `cover` is the fraction of each pixel
    that a line of `width` along the circle covers, and `off` the pixel's distance from the circle. All lengths are in
    pixels; `reach` is half the width by default.
    """

    def __init__(self, x: float, y: float, radius: float, width: float, shape: tuple[int, int],
                 reach: float = 0.0) -> None:
        self.shape = shape
        far = max(reach, width / 2) + 1
        most = radius + far
        top, left = max(math.floor(y - most), 0), max(math.floor(x - most), 0)
        bottom, right = min(math.ceil(y + most), shape[0]), min(math.ceil(x + most), shape[1])
        dx = np.arange(left, right)[None, :] + 0.5 - x
        dy = np.arange(top, bottom)[:, None] + 0.5 - y
        off = np.abs(np.hypot(dx, dy) - radius)
        rows, columns = np.nonzero(off < far - 0.5)
        angle = np.arctan2(dx[0, columns], dy[rows, 0])
        order = np.argsort(angle)
        self.angle: Floats = angle[order].astype(np.float32)
        rows, columns = rows[order], columns[order]
        self.off: Floats = off[rows, columns].astype(np.float32)
        self.cover: Floats = np.clip(width / 2 + np.float32(0.5) - self.off, 0, 1)
        self.rows, self.columns = rows + top, columns + left
        self.radius, self.width = radius, width
        self.bins = max(8, math.ceil(2 * TURN * radius))
        self.bin: NDArray[np.intp] = np.rint(self.angle * (self.bins / TURN)).astype(np.intp) % self.bins
        edges = np.linspace(-math.pi, math.pi, self.bins + 1)
        self.first: list[int] = [*angle[order].searchsorted(edges[:-1]).tolist(), len(order)]
        self.side: Floats = width / 2 + np.float32(0.5) - self.off
        self.cone: Floats = np.float32(0.5) - self.off * np.float32(1 / math.hypot(1, HEAD))

    def arrow(self, image: Image, start: float, sweep: float, head: float, colour: Floats) -> None:
        """Paint an arrow along the circle, from the angle `start` [rad] to `start` + `sweep`.

        Its head has the length `head` [rad]. `sweep` may be negative, and is less than a turn.

        Raises ValueError for an image of another size than the circle's.
        """
        self._check(image)
        end, whole = start + sweep, abs(sweep) * self.radius
        for first, last, turns in self._between(min(start, end), max(start, end)):
            loops().arrow(
                image, self.rows, self.columns, self.angle, self.side, self.cone, _SLOPE, first, last, end + turns,
                math.copysign(self.radius, sweep), head * self.radius, whole, colour)

    def trail(self, image: Image, angles: Sequence[float], strongest: float, colour: Floats) -> None:
        """Paint the trail of a bob that moved along the circle through `angles` [rad], oldest first.

        Where the trail covers itself, the newest passage is visible. The opacity falls from `strongest` at the newest
        angle to 0 at the oldest. Nothing is painted if an angle is so large that its place on the circle is lost.

        Raises ValueError for an image of another size than the circle's.
        """
        self._check(image)
        if len(angles) < 2:
            return
        strength = np.zeros(self.bins, dtype=np.float32)
        path, sizes = np.array(angles, dtype=float), np.empty(len(angles) - 1)
        low, high = loops().passages(strength, path, sizes, _fade(len(path), strongest))
        for first, last, _ in self._between(low, high):
            loops().trail(image, self.rows, self.columns, self.bin, self.cover, first, last, strength,
                                          colour)

    def _check(self, image: Image) -> None:
        """Raise ValueError for an image of another size than that which the circle was made for."""
        if image.shape[:2] != self.shape:
            raise ValueError(f"this circle is for images of the shape {self.shape}, not {image.shape[:2]}")

    def _between(self, low: float, high: float) -> Iterator[tuple[int, int, float]]:
        """Yield the ranges of the circle's pixels, sorted by angle, that lie between two angles [rad]: one or two.

        A range is its first index and the index after its last, and the multiple of a full turn [rad] to add to the two
        angles to get the angles of its pixels. There is none for angles that are too large to have a place.
        """
        if not (abs(low) < pixels.LARGEST and abs(high) < pixels.LARGEST):
            return
        low, high = low - 2.0 / self.radius, high + 2.0 / self.radius
        if high - low >= TURN:
            yield 0, len(self.angle), 0.0
            return
        turns = TURN * math.floor((low + math.pi) / TURN)
        first = int((low - turns + math.pi) * (self.bins / TURN))
        last = int((high - turns + math.pi) * (self.bins / TURN)) + 1
        yield self.first[min(first, self.bins)], self.first[min(last, self.bins)], -turns
        if last > self.bins:
            yield 0, self.first[min(last - self.bins, first)], -turns - TURN


@lru_cache(maxsize=16)
def _fade(count: int, most: float) -> NDArray[np.float64]:
    """Return opacities for ``count`` points of the bob's trail, which grow from 0 to ``most``, slowly at first."""
    shares: NDArray[np.float64] = most * np.linspace(0.0, 1.0, count) ** 1.5
    return shares


_WHEEL = ((1.0, "steel_dark"), (0.94, "steel_light"), (0.70, "steel_dark"),
          (0.65, "steel"), (0.40, "steel_dark"), (0.35, "steel_light"))
_TICKS = ((30, 0.10, "ink"), (10, 0.065, "faint_ink"), (5, 0.035, "faint_ink"), (1, 0.02, "faint_ink"))
_DIAL, _WHEEL_SHARE, _HOUSING = 0.74, 0.18, 1.2
"""Radius of the degree scale over the arm, of the wheel over that of the scale, half the housing's height over that of
the wheel."""
_NUMBERS_END = 0.86
_TURN_RADIUS, _TURN_WIDTH = 0.38, 0.055
_WITHIN = 0.6
"""Radius of a pendulum whose plate covers the pivot, over that of the room; the degree scale is around it."""
TRAIL_STRENGTH = 0.6
"""Opacity of the trail at the bob."""
PIECE, MOST_PIECES = 5.0, 200
"""With a moving pivot, trails are straight pieces of this length [px], and at most this many from state to state."""
TORQUE_SWEEP = math.radians(120)
"""Angle that the arrow of the largest torque spans [rad]."""
HEAD_LENGTH = 3.2
"""Ratio of the length of the torque arrow's head to the width of its shaft."""


class Stand:
    """The panel "apparatus" of a frame: the pendulum on its stand, with dimensions in pixels.

    The full circle of the pendulum fits into the panel or, if the apparatus has a swing, the arc of that swing, with
    the pivot near the upper edge.

    Attributes:
        x, y: position of the pivot at rest.
        scale: pixels per metre.
        arm, bob, rod, dial, wheel: length of the pendulum, radius of the bob, width of the rod, radii of the degree
            scale and of the wheel.
        reach: largest distance of the bob's edge from the pivot at rest.
        shaken: True if the pivot moves; the sensor's wheel then moves with it.
        path, turn: circles on which the bob's trail and the torque arrow are painted.
    """

    def __init__(self, apparatus: Apparatus, body: Box, font: int, theme: Theme, shape: tuple[int, int],
                 lettered: bool) -> None:
        self.apparatus, self.body, self.font, self.theme, self.lettered = apparatus, body, font, theme, lettered
        self.shape = shape
        room = min(body.width, body.height) / 2 - max(3.0, 0.015 * min(shape))
        self.x, self.y = body.middle
        self.shaken = any(apparatus.sway)
        self.scale = (_WITHIN if apparatus.covers else 1.0) * room / (apparatus.extent + max(apparatus.sway))
        if apparatus.swing is not None:
            edge, housing = max(3.0, 0.015 * min(shape)), _DIAL * _WHEEL_SHARE * _HOUSING
            aside = apparatus.length * math.sin(apparatus.swing) + apparatus.bob_radius
            self.scale = min((body.height - 2 * edge) / ((1 + housing) * apparatus.length + apparatus.bob_radius),
                             (body.width / 2 - edge) / aside)
            room = self.scale * (apparatus.length + apparatus.bob_radius)
            self.y = body.top + edge + housing * self.scale * apparatus.length
        self.arm, self.bob = apparatus.length * self.scale, max(apparatus.bob_radius * self.scale, 2.5)
        thinnest = max(2.2, 0.016 * self.arm) if apparatus.suspension == "rod" else max(1.3, 0.006 * self.arm)
        self.thinnest = thinnest
        self.reach = (apparatus.extent + max(apparatus.sway)) * self.scale if apparatus.outline else (
            self.arm + self.bob + max(apparatus.sway) * self.scale)
        self.rod = min(max(2 * apparatus.rod_radius * self.scale, thinnest), 0.2 * room + thinnest)
        self.dial = max(min(_DIAL * self.arm, self.arm - self.bob - 0.08 * room), 0.3 * room)
        if apparatus.covers:
            self.dial = self.reach = 0.97 * room
        self.wheel = _WHEEL_SHARE * self.dial
        self.hub = max(0.22 * self.wheel, 0.8 * self.rod)
        self.cap = Stamp(shape, self.x, self.y, self.hub, rgb(theme.sensor))
        self.path = Ring(self.x, self.y, self.arm,
                         max(2.0, 0.02 * self.arm, 0.0 if apparatus.outline else 0.5 * self.bob), shape)
        self.turn = self.turning(self.x, self.y)
        steel = (theme.steel_dark, theme.steel_light, theme.steel_dark)
        self.metal = gradient(*steel) if apparatus.suspension == "rod" else rgb(theme.wire)
        self.readings = self._readings() if lettered else None

    def turning(self, x: float, y: float) -> Ring:
        """Return the circle on which the torque arrow is painted, around a pivot at the pixel (x, y)."""
        width = max(2.0, _TURN_WIDTH * self.dial)
        return Ring(x, y, _TURN_RADIUS * self.dial, width, self.shape, HEAD * HEAD_LENGTH * width)

    def still(self, image: Image) -> None:
        """Paint the stand and the degree scale, which are equal in all frames."""
        body, whole = self.body, image if self.apparatus.swing is None else image.copy()
        self._paint_stand(whole)
        self._paint_dial(whole)
        if whole is not image:
            part = slice(round(body.top), round(body.bottom)), slice(round(body.left), round(body.right))
            image[part] = whole[part]

    def moving(self, image: Image, view: View, tone: Floats) -> None:
        """Paint the trail, the torque arrow, the rod or wire, the bob, and angle and velocity as text into an image."""
        hub, (x, y) = self.places(view)
        if self.shaken:
            self.paint_wheel(image, *hub)
            self._paint_trail(image, view, tone)
        elif view.trail:
            self.path.trail(image, (*view.trail, view.angle), TRAIL_STRENGTH, tone)
        if view.torque_share:
            self._paint_torque(image, hub, view.angle, view.torque_share)
        if self.apparatus.outline:
            self._paint_outline(image, hub, view.angle, tone)
        else:
            stroke(image, *hub, x, y, self.rod, self.metal)
        if self.shaken:
            disc(image, *hub, self.hub, rgb(self.theme.sensor))
        else:
            self.cap.paint(image)
        if not self.apparatus.outline:
            ball(image, x, y, self.bob, tone)
        if self.readings:
            self._paint_readings(image, view)

    def pivot(self, away: tuple[float, float]) -> tuple[float, float]:
        """Return the pixel (x, y) of the pivot, displaced by ``away`` (right, up) [m] from its position at rest."""
        if not self.shaken:
            return self.x, self.y
        return self.x + float(away[0]) * self.scale, self.y - float(away[1]) * self.scale

    def places(self, view: View) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the pixels (x, y) of the pivot and of the bob's centre at the instant of a view."""
        x, y = self.pivot(view.pivot)
        return (x, y), (x + self.arm * math.sin(view.angle), y + self.arm * math.cos(view.angle))

    def point(self, angle: float, radius: float) -> tuple[float, float]:
        """Return the pixel (x, y) at an angle [rad] from the downward vertical and a distance [px] from the pivot."""
        return self.x + radius * math.sin(angle), self.y + radius * math.cos(angle)

    def _readings(self) -> tuple[float, float, int, int] | None:
        """Return right edge, bottom, line height and width [px] of the text that gives angle and velocity.

        The result is None if there is no room for the text outside the pendulum's circle.
        """
        wide, high = measure(f"ω = {MINUS}88.88 rad/s", self.font)
        body = self.body
        dx, dy = body.width / 2 - wide - 0.5 * self.font, body.height / 2 - 2.1 * high
        clear = dx > 0 and dy > 0 and math.hypot(dx, dy) > self.reach
        if self.apparatus.swing is not None:
            dy = body.bottom - 2.1 * high - self.y
            clear = dx > self.arm * math.sin(self.apparatus.swing) + self.bob and math.hypot(dx, dy) > 1.05 * self.dial
        return (body.right - 0.5 * self.font, body.bottom, high, wide) if clear else None

    def _paint_stand(self, image: Image) -> None:
        """Paint the arm of the stand from the left edge to the pivot and, if there is room, the post below the arm."""
        body, thick = self.body, max(3.0, 0.07 * self.arm)
        steel = gradient(self.theme.steel_dark, self.theme.steel_light, self.theme.steel, self.theme.steel_dark)
        free = self.x - self.reach - body.left
        post, standing = body.left + free / 2, free > 2.4 * thick
        if standing:
            foot = body.bottom - 0.2 * thick
            stroke(image, post, body.top + 0.4 * thick, post, foot, 0.75 * thick, steel)
            box(image, post - 1.1 * thick, foot - 0.4 * thick, post + 1.1 * thick, foot, rgb(self.theme.sensor),
                0.15 * thick)
        stroke(image, post if standing else body.left, self.y, self.x, self.y, 0.6 * thick, steel)
        if standing:
            reach = 0.75 * thick
            box(image, post - reach, self.y - reach, post + reach, self.y + reach, rgb(self.theme.sensor), 0.3 * thick)
            disc(image, post, self.y, 0.35 * thick, rgb(self.theme.steel))

    def _paint_dial(self, image: Image) -> None:
        """Paint the degree scale with its ticks and numbers and, if the pivot does not move, the sensor's wheel."""
        line = max(1.0, 0.008 * self.dial)
        disc(image, self.x, self.y, self.dial + 2 * line, rgb(self.theme.dial_edge))
        disc(image, self.x, self.y, self.dial + line, rgb(self.theme.dial))
        fine = (5, 10) if self.apparatus.swing is None else (1, 5, 10)
        finest = next((step for step in fine if self.dial * math.radians(step) > 5), 30)
        for degrees in range(-180, 180, finest):
            depth, tone = next((depth, tone) for step, depth, tone in _TICKS if degrees % step == 0)
            angle = math.radians(degrees)
            stroke(image, *self.point(angle, self.dial), *self.point(angle, self.dial * (1 - depth)), line,
                   rgb(getattr(self.theme, tone)))
        if self.lettered:
            for text, size, x, y in self._numbers():
                write(image, text, x, y, size, self.theme.ink, (0.5, 0.5), paper=None)
        if not self.shaken:
            self.paint_wheel(image, self.x, self.y)

    def paint_wheel(self, image: Image, x: float, y: float) -> None:
        """Paint the angle sensor's housing and wheel around the pixel (x, y)."""
        wide, high = 1.5 * self.wheel, 1.2 * self.wheel
        box(image, x - wide, y - high, x + wide, y + high, rgb(self.theme.sensor), 0.4 * self.wheel)
        for share, tone in _WHEEL:
            disc(image, x, y, share * self.wheel, rgb(getattr(self.theme, tone)))

    def _numbers(self) -> list[tuple[str, int, float, float]]:
        """Return the texts that label the degree scale, as (text, font size, x, y) in pixels.

        Labels are 30 degrees apart, and 10 degrees if the picture is of a small swing. If these would overlap each
        other or the torque arrow, they are 90 degrees apart, or left out. Labels outside the panel are left out.
        """
        size = max(LEAST_SIZE, round(0.82 * self.font))
        clear = self.turn.radius + 2 * _TURN_WIDTH * self.dial
        near = self.apparatus.swing is not None
        for step in (10, 30, 90) if near else (30, 90):
            placed, boxes, least = [], [], math.inf
            for degrees in range(step - 180, 181, step):
                text = f"{degrees}°".replace("-", MINUS)
                wide, high = measure(text, size)
                high = round(0.75 * high)
                angle = math.radians(degrees)
                reach = (abs(math.sin(angle)) * wide + abs(math.cos(angle)) * high) / 2
                x, y = self.point(angle, _NUMBERS_END * self.dial - reach)
                area = Box(x - wide / 2, y - high / 2, x + wide / 2, y + high / 2)
                if near and not self._inside(area):
                    continue
                least = min(least, _NUMBERS_END * self.dial - reach)
                placed.append((text, size, x, y))
                boxes.append(area)
            if least > 0 and all(area.distance(self.x, self.y) > clear for area in boxes):
                return placed
        return []

    def _inside(self, area: Box) -> bool:
        """Return True if an area lies inside the panel and below the pivot, where small swings take place."""
        body = self.body
        return body.left < area.left and area.right < body.right and self.y < area.top and area.bottom < body.bottom

    def _paint_trail(self, image: Image, view: View, tone: Floats) -> None:
        """Paint the trail of the bob's past positions in a scene with a moving pivot."""
        pivots = view.trail_pivots or (view.pivot,) * len(view.trail)
        angles = np.array([*view.trail, view.angle])
        hubs = np.array([self.pivot(away) for away in (*pivots, view.pivot)])
        steps = np.hypot(np.diff(angles) * self.arm, np.hypot(*np.diff(hubs, axis=0).T))
        counts = np.clip(np.ceil(steps / PIECE), 1, MOST_PIECES).astype(int)
        ages = np.append(np.repeat(np.arange(len(steps)), counts) + np.concatenate(
            [np.arange(count) / count for count in counts] or [np.empty(0)]), len(steps))
        spread = np.arange(len(angles))
        turned = np.interp(ages, spread, angles)
        x = np.interp(ages, spread, hubs[:, 0]) + self.arm * np.sin(turned)
        y = np.interp(ages, spread, hubs[:, 1]) + self.arm * np.cos(turned)
        strength = TRAIL_STRENGTH * (ages / max(1, len(steps))) ** 1.5
        fading(image, np.stack((x, y, strength), axis=1), self.path.width, tone)

    def _paint_outline(self, image: Image, hub: tuple[float, float], angle: float, tone: Floats) -> None:
        """Paint the parts of a compound pendulum to scale, in the colour `tone`; bars beside other parts are metal."""
        across, down = self.scale * math.sin(angle), self.scale * math.cos(angle)
        metal = self.metal if any(kind != BAR for kind, *_ in self.apparatus.outline) else tone
        for kind, start, end, half in self.apparatus.outline:
            x, y = hub[0] + start * across, hub[1] + start * down
            if kind == BAR:
                width = max(2.0 * half * self.scale, self.thinnest)
                stroke(image, x, y, hub[0] + end * across, hub[1] + end * down, width, metal)
            else:
                (ball if kind == BALL else disc)(image, x, y, max(half * self.scale, 2.5), tone)

    def _paint_torque(self, image: Image, hub: tuple[float, float], angle: float, share: float) -> None:
        """Paint an arrow that starts at the rod and shows the direction and, by its length, the size of the torque."""
        ring = self.turning(*hub) if self.shaken else self.turn
        sweep = TORQUE_SWEEP * share
        head = min(HEAD_LENGTH * ring.width / ring.radius, 0.6 * abs(sweep))
        ring.arrow(image, angle, sweep, head, rgb(self.theme.torque))

    def _paint_readings(self, image: Image, view: View) -> None:
        """Write angle and angular velocity in the lower right corner, outside the pendulum's circle."""
        assert self.readings
        right, bottom, high, _ = self.readings
        degrees = round(math.degrees(math.remainder(view.angle, 2 * math.pi)), 1) + 0.0
        size = abs(view.velocity)
        speed = f"{round(view.velocity, 2) + 0.0:{'.2f' if size < 100 else '.0f' if size < 1e5 else '.0e'}}"
        for line, text in enumerate((f"ω = {speed} rad/s", f"θ = {degrees:.1f}°")):
            write(image, text.replace("-", MINUS), right, bottom - line * high, self.font, self.theme.faint_ink,
                  (1.0, 1.0), self.theme.paper)
