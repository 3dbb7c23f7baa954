"""Thin circle of pixels, sorted by angle, so that arcs and trails on the circle are painted quickly."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render.paint import FULL, NONE, Floats, Image, blend_at

TURN = 2 * math.pi
HEAD = 0.6
"""Ratio of half the width of an arrow's head to its length."""
_SLOPE = np.array(HEAD / math.hypot(1, HEAD), dtype=np.float32)


class Ring:
    """Pixels near a circle in an image, on which arcs, arrows and trails are painted.

    They are the pixels of an image of `shape` (H, W) within `reach` of a circle of `radius` around (x, y), in the order
    of their angle [rad] from the downward vertical, counter-clockwise positive. `cover` is the fraction of each pixel
    that a line of `width` along the circle covers, and `off` the pixel's distance from the circle. All lengths are in
    pixels; `reach` is half the width by default.
    """

    def __init__(self, x: float, y: float, radius: float, width: float, shape: tuple[int, int],
                 reach: float = 0.0) -> None:
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
        self.pixel: NDArray[np.intp] = (rows + top) * shape[1] + columns + left
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
        """
        end, long, half = start + sweep, np.float32(head * self.radius), np.float32(0.5)
        neck, tip = np.float32(0.9) * long - half, long + half
        for part, turns in self._between(min(start, end), max(start, end)):
            rest = np.float32(end + turns) - self.angle[part]
            rest *= math.copysign(self.radius, sweep)
            shaft = rest - neck
            np.minimum(shaft, self.side[part], out=shaft)
            np.minimum(shaft, np.float32(abs(sweep) * self.radius + 0.5) - rest, out=shaft)
            point = rest * _SLOPE
            point += self.cone[part]
            np.maximum(np.minimum(point, tip - rest, out=point), shaft, out=shaft)
            seen = (shaft > NONE).nonzero()[0]
            share = shaft.take(seen)
            blend_at(image, self.pixel[part].take(seen), np.minimum(share, FULL, out=share), colour)

    def trail(self, image: Image, angles: Sequence[float], strongest: float, colour: Floats) -> None:
        """Paint the trail of a bob that moved along the circle through `angles` [rad], oldest first.

        Where the trail covers itself, the newest passage is visible. The opacity falls from `strongest` at the newest
        angle to 0 at the oldest.
        """
        if len(angles) < 2:
            return
        path = np.array(angles, dtype=float)
        steps = path[1:] - path[:-1]
        sizes = np.abs(steps)
        low, high = min(angles), max(angles)
        if high - low > TURN and sizes.max() > TURN:
            np.minimum(np.maximum(steps, -TURN), TURN).cumsum(out=path[1:])
            path[0] = 0.0
            path += angles[-1] - path[-1]
            sizes = np.minimum(sizes, TURN)
            low, high = float(path.min()), float(path.max())
        ends = np.zeros(len(path))
        np.ceil(sizes * (self.bins / TURN) + 1).cumsum(out=ends[1:])
        moments = np.arange(1.0, ends[-1] + 1)
        places = np.rint(np.interp(moments, ends, path * (self.bins / TURN))).astype(np.intp)
        if low < -3.0 or high > 3.0:  # indices down to -bins count from the end
            places %= self.bins
        strength = np.zeros(self.bins, dtype=np.float32)
        strength.put(places, np.interp(moments, ends, _fade(len(path), strongest)))
        for part, _ in self._between(low, high):
            share = strength.take(self.bin[part])
            share *= self.cover[part]
            blend_at(image, self.pixel[part], share, colour)

    def _between(self, low: float, high: float) -> Iterator[tuple[slice, float]]:
        """Yield slices of the circle's pixels, sorted by angle, that lie between two angles [rad]: one slice or two.

        With each slice comes the multiple of a full turn [rad] to add to the two angles to get the angles of the
        pixels.
        """
        low, high = low - 2.0 / self.radius, high + 2.0 / self.radius
        if high - low >= TURN:
            yield slice(None), 0.0
            return
        turns = TURN * math.floor((low + math.pi) / TURN)
        first = int((low - turns + math.pi) * (self.bins / TURN))
        last = int((high - turns + math.pi) * (self.bins / TURN)) + 1
        yield slice(self.first[min(first, self.bins)], self.first[min(last, self.bins)]), -turns
        if last > self.bins:
            yield slice(0, self.first[min(last - self.bins, first)]), -turns - TURN


@lru_cache(maxsize=16)
def _fade(count: int, most: float) -> NDArray[np.float64]:
    """Return opacities for ``count`` points of the bob's trail, which grow from 0 to ``most``, slowly at first."""
    shares: NDArray[np.float64] = most * np.linspace(0.0, 1.0, count) ** 1.5
    return shares
