"""Thin circle of pixels, sorted by angle, so that arcs and trails on the circle are painted quickly."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render import pixels
from pendulum_env.render.paint import Floats, Image, loops
from pendulum_env.render.pixels import TURN

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
