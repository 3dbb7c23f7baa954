"""A thin circle whose pixels are found once, so that arcs and trails on it cost a look-up per frame."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .paint import Floats, Image, blend

TURN = 2 * math.pi
HEAD = 0.6
"""Half the width of an arrow's head over its length."""


class Ring:
    """The pixels within `reach` of a circle of `radius` around (x, y), inside an image of `shape` (H, W).

    They are in the order of their angle [rad] from the downward vertical, counter-clockwise positive. `cover` is
    their share of a line of `width` along the circle, `off` how far they are from the circle; all in pixels.
    reach: half the width by default.
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

    def arrow(self, image: Image, start: float, sweep: float, head: float, colour: Floats) -> None:
        """Paint an arc from angle `start` over `sweep` [rad], either sign, less than a turn; its head is as long as
        `head` [rad]."""
        margin = 1.0 / self.radius
        for part, turns in self._between(min(start, start + sweep) - margin, max(start, start + sweep) + margin):
            sign = math.copysign(1.0, sweep)
            along = (self.angle[part] - np.float32(start + turns)) * np.float32(sign * self.radius)
            rest = np.float32(abs(sweep) * self.radius) - along
            long, off = abs(head) * self.radius, self.off[part]
            shaft = np.minimum(np.minimum(along, rest - np.float32(0.9 * long)), np.float32(self.width / 2) - off)
            point = np.minimum((HEAD * rest - off) * np.float32(1 / math.hypot(1, HEAD)), np.float32(long) - rest)
            self._paint(image, part, _share(np.maximum(shaft, point) + np.float32(0.5)), colour)

    def trail(self, image: Image, angles: NDArray[np.float64], strongest: float, colour: Floats) -> None:
        """Paint the path through `angles` [rad], oldest first, fading from `strongest` (newest) to nothing.

        Where the path covers itself the newest passage is shown.
        """
        steps = np.minimum(np.maximum(angles[1:] - angles[:-1], -TURN), TURN)
        if not len(steps):
            return
        counts = np.ceil(np.abs(steps) * (self.bins / TURN)).astype(np.intp) + 1
        ends = counts.cumsum()
        step = np.arange(len(steps)).repeat(counts)
        share = (np.arange(1, ends[-1] + 1) - (ends - counts)[step]) / counts[step]
        path = angles[1:][step] - steps[step] * (1 - share)
        strength = np.zeros(self.bins, dtype=np.float32)
        strength[np.rint((path % TURN) * (self.bins / TURN)).astype(np.intp) % self.bins] = (
            strongest * ((step + share) / len(steps)) ** 1.5)
        margin = TURN / self.bins
        for part, _ in self._between(float(path.min()) - margin, float(path.max()) + margin):
            self._paint(image, part, self.cover[part] * strength[self.bin[part]], colour)

    def _between(self, low: float, high: float) -> Iterator[tuple[slice, float]]:
        """The pixels from angle to angle, in one piece or two, each with how much of `low` counts whole turns [rad]."""
        if high - low >= TURN:
            yield slice(None), 0.0
            return
        turns = TURN * math.floor((low + math.pi) / TURN)
        first, last = low - turns, high - turns
        begin, end = self.angle.searchsorted((first, last))
        yield slice(begin, end), -turns
        if last > math.pi:
            yield slice(0, self.angle.searchsorted(last - TURN)), -turns - TURN

    def _paint(self, image: Image, part: slice, share: Floats, colour: Floats) -> None:
        pixels, where = image.reshape(-1, 3), self.pixel[part]
        patch = pixels.take(where, axis=0)
        blend(patch, share, colour)
        pixels[where] = patch


def _share(values: Floats) -> Floats:
    shares: Floats = np.minimum(np.maximum(values, np.float32(0)), np.float32(1))
    return shares
