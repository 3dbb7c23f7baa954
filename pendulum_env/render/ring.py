"""A thin circle whose pixels are found once, so that arcs and trails on it cost a look-up per frame."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .paint import Floats, Image, blend

TURN = 2 * math.pi


class Ring:
    """The pixels within `width`/2 of a circle of `radius` around (x, y), inside an image of `shape` (H, W).

    Each has its share of the line and its angle [rad] from the downward vertical, counter-clockwise positive.
    """

    def __init__(self, x: float, y: float, radius: float, width: float, shape: tuple[int, int]) -> None:
        reach = radius + width / 2 + 1
        top, left = max(math.floor(y - reach), 0), max(math.floor(x - reach), 0)
        bottom, right = min(math.ceil(y + reach), shape[0]), min(math.ceil(x + reach), shape[1])
        dx = np.arange(left, right)[None, :] + 0.5 - x
        dy = np.arange(top, bottom)[:, None] + 0.5 - y
        cover = np.clip(width / 2 + 0.5 - np.abs(np.hypot(dx, dy) - radius), 0, 1).astype(np.float32)
        rows, columns = np.nonzero(cover)
        self.cover: Floats = cover[rows, columns]
        self.angle: Floats = np.arctan2(dx[0, columns], dy[rows, 0]).astype(np.float32)
        self.rows: NDArray[np.intp] = rows + top
        self.columns: NDArray[np.intp] = columns + left
        self.radius, self.width = radius, width
        self.bins = max(8, math.ceil(2 * TURN * radius))
        self.bin: NDArray[np.intp] = np.rint(self.angle * (self.bins / TURN)).astype(np.intp) % self.bins

    def arc(self, image: Image, start: float, sweep: float, colour: Floats) -> None:
        """Paint the arc from angle `start` over `sweep` [rad], either sign, less than a turn."""
        off = np.abs((self.angle - np.float32((start + sweep / 2) % TURN) + math.pi) % TURN - math.pi)
        strength = (abs(sweep) / 2 - off) * self.radius + 0.5
        self._paint(image, np.minimum(np.maximum(strength, 0), 1).astype(np.float32), colour)

    def trail(self, image: Image, angles: NDArray[np.float64], strongest: float, colour: Floats) -> None:
        """Paint the path through `angles` [rad], oldest first, fading from `strongest` (newest) to nothing.

        Where the path covers itself the newest passage is shown.
        """
        steps = np.diff(angles)
        if not len(steps):
            return
        covered = np.clip(steps, -TURN, TURN)
        counts = np.ceil(np.abs(covered) * (self.bins / TURN)).astype(np.intp) + 1
        step = np.repeat(np.arange(len(steps)), counts)
        share = (np.arange(len(step)) - np.repeat(np.cumsum(counts) - counts, counts) + 1) / counts[step]
        path = angles[1:][step] - covered[step] * (1 - share)
        strength = np.zeros(self.bins, dtype=np.float32)
        strength[np.rint((path % TURN) * (self.bins / TURN)).astype(np.intp) % self.bins] = (
            strongest * ((step + share) / len(steps)) ** 1.5)
        self._paint(image, strength[self.bin], colour)

    def _paint(self, image: Image, strength: Floats, colour: Floats) -> None:
        seen = np.flatnonzero(strength)
        where = self.rows[seen], self.columns[seen]
        patch = image[where]
        blend(patch, self.cover[seen] * strength[seen], colour)
        image[where] = patch
