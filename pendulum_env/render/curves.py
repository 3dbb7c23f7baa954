"""Drawing of antialiased lines through many points: fading paths, and graphs over time."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render.layout import Box
from pendulum_env.render.paint import Floats, Image, blend, loops
from pendulum_env.render.pixels import PARTS

PIECE = 3.0
"""Longest straight piece in which a path is painted [px]."""
FINE = 12
"""Points at which a graph is evaluated in each column of pixels; a multiple of 2 PARTS."""
DIRECTIONS = tuple(math.radians(degrees) for degrees in (-90, -67.5, -45, -22.5, 0, 22.5, 45, 67.5, 90))
"""Directions [rad] from the middle of a graph's line to its edge."""


def fading(image: Image, path: NDArray[np.float64], width: float, colour: Floats) -> None:
    """Draw straight lines from point to point of a path into an image, `width` pixels wide.

    The rows of `path` are (x, y, strength), with x and y in pixels.

    Strength, from 0 to 1, is the opacity. It changes linearly from point to point. Where lines meet or cross, the more
    opaque one is visible. A strength of nan interrupts the path.
    """
    pad = width / 2 + 1
    rows = np.empty((max(0, len(path) - 1), 6))
    count, *box = loops().clipped(path, image.shape[1] + pad, image.shape[0] + pad, -pad, rows)
    if not count:
        return
    far = pad + 1.0  # a pixel more than the pieces touch, because their ends are rounded
    left, top, right, bottom = (math.floor(end + away) for end, away in zip(box, (-far, -far, far, far), strict=True))
    shown = np.zeros((bottom - top + 1, right - left + 1), dtype=np.float32)
    loops().pieces(shown, rows, count, left, top, width, PIECE)
    x, y = max(0, -left), max(0, -top)
    patch = image[top + y : top + len(shown), left + x : left + shown.shape[1]]
    blend(patch, shown[y : y + patch.shape[0], x : x + patch.shape[1]], colour)


def graph(image: Image, area: Box, xs: NDArray[np.float64], ys: NDArray[np.float64], width: float, colour: Floats,
          rim: float = 0.0, casing: Floats | None = None) -> None:
    """Draw a graph, a line through points (x, y) [px], into a rectangular area of an image.

    The line is `width` pixels wide in every direction and has round ends and, on each side, a rim `rim` pixels wide in
    the colour `casing`. The values xs must ascend.
    """
    left, top = max(round(area.left), 0), max(round(area.top), 0)
    right, bottom = min(round(area.right), image.shape[1]), min(round(area.bottom), image.shape[0])
    if len(xs) < 2 or right <= left or bottom <= top:
        return
    pad, columns = math.ceil(width / 2 + rim), right - left
    shifts, rises, opacities, tones = _bands(width, rim, colour.tobytes(), b"" if casing is None else casing.tobytes())
    loops().graph(
        image, left, top, right, bottom, xs, ys, pad, FINE // PARTS, shifts, rises, opacities, tones,
        np.empty((columns + 2 * pad) * FINE + 1, dtype=np.float32),
        np.empty((len(tones), 2, PARTS * columns), dtype=np.float32))


@lru_cache(maxsize=64)
def _bands(width: float, rim: float, colour: bytes, casing: bytes) -> tuple[Any, ...]:
    """Return the bands of a graph's line, the casing first: how far each reaches from its middle in DIRECTIONS, along,
    in points of 1/FINE px, and up [px], and its opacity and tone. Colours are the bytes of arrays.
    """
    bands = [(tone, thick) for tone, thick in ((casing, width + 2 * rim), (colour, width)) if tone]
    along = [[round(thick / 2 * FINE * math.sin(turn)) for turn in DIRECTIONS] for _, thick in bands]
    up = [[thick / 2 * math.cos(turn) for turn in DIRECTIONS] for _, thick in bands]
    return (np.array(along), np.array(up, dtype=np.float32), np.array([min(1.0, thick) for _, thick in bands]),
            np.array([np.frombuffer(tone, dtype=np.float32) for tone, _ in bands]))
