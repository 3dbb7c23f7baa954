"""Antialiased shapes painted straight into a (H, W, 3) uint8 image.

The pixel in row i and column j covers the unit square with its centre at (x, y) = (j + 0.5, i + 0.5), y downward. The
fraction of a pixel that a shape covers is 0.5 minus the signed distance from the pixel's centre to the shape's outline,
clipped to 0..1, so that shapes move smoothly by fractions of a pixel. Nothing is painted outside the image. Colours are
float32, 0 to 255.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.kernels import plain_functions
from pendulum_env.render import pixels
from pendulum_env.render.pixels import HALF, NONE

Image = NDArray[np.uint8]
Floats = NDArray[np.float32]

_CENTRES: Floats = np.arange(65_536, dtype=np.float32) + np.float32(0.5)
_SHADES = 256
PATIENCE = 0.15
"""Processor time [s] for which Python runs a loop that was never compiled: enough for the first frames."""
LARGE = 16.0
"""Radius from which on a disc is painted by NumPy, as the loop takes seconds where Python runs it [px]."""


def loops() -> SimpleNamespace:
    """Return the loops over pixels of :mod:`pendulum_env.render.pixels`, compiled unless programs are interpreted."""
    return plain_functions(pixels, PATIENCE)


def blend(patch: Image, cover: Floats, colour: Floats) -> None:
    """Mix a colour, (3,), into the pixels `patch` (h, w, 3) in place; `cover` (h, w) is the opacity, 0 to 1.

    Raises ValueError if the sizes differ.
    """
    if patch.shape[:2] != cover.shape:
        raise ValueError(f"cover must have the shape {patch.shape[:2]} of the pixels, not {cover.shape}")
    loops().blend(patch, cover, colour)


def _span(low: float, high: float, limit: int) -> tuple[int, int]:
    """Return the first pixel that an interval touches, and the one after the last; both limited to 0 ... ``limit``."""
    return min(max(math.floor(low), 0), limit), max(min(math.ceil(high), limit), 0)


def _window(
    image: Image, left: float, top: float, right: float, bottom: float
) -> tuple[Image, Floats, Floats]:
    """Return the part of an image inside a box, and the coordinates of its pixels' centres: x (1, w) and y (h, 1)."""
    x0, x1 = _span(left, right, image.shape[1])
    y0, y1 = _span(top, bottom, image.shape[0])
    x1, y1 = max(x0, x1), max(y0, y1)
    return image[y0:y1, x0:x1], _CENTRES[None, x0:x1], _CENTRES[y0:y1, None]


def _clip(values: Any) -> Floats:
    """Return values limited to the range from 0 to 1."""
    clipped: Floats = np.minimum(np.maximum(values, 0), 1)
    return clipped


def disc(image: Image, x: float, y: float, radius: float, colour: Floats, share: float = 1.0) -> None:
    """Fill a circle in an image, with the opacity `share` from 0 to 1."""
    if radius > LARGE:
        patch, xs, ys = _window(image, x - radius - 1, y - radius - 1, x + radius + 1, y + radius + 1)
        cover, under = _clip(radius + 0.5 - np.hypot(xs - x, ys - y))[..., None] * np.float32(share), patch + NONE
        patch[...] = (colour - under) * cover + under + HALF
        return
    left, right = _span(x - radius - 1, x + radius + 1, image.shape[1])
    top, bottom = _span(y - radius - 1, y + radius + 1, image.shape[0])
    loops().disc(image, left, top, right, bottom, float(x), float(y), float(radius), float(share), colour)


class Stamp:
    """Disc of one colour at a fixed place, computed once and then painted into many images of one size."""

    def __init__(self, shape: tuple[int, int], x: float, y: float, radius: float, colour: Floats) -> None:
        top, bottom = _span(y - radius - 1, y + radius + 1, shape[0])
        left, right = _span(x - radius - 1, x + radius + 1, shape[1])
        self.rows, self.columns = slice(top, max(top, bottom)), slice(left, max(left, right))
        away = np.hypot(_CENTRES[None, self.columns] - x, _CENTRES[self.rows, None] - y)
        share = _clip(radius + 0.5 - away)[..., None]
        self.remaining: Floats = (1 - share).repeat(3, axis=-1)
        self.added: Floats = share * colour + np.float32(0.5)

    def paint(self, image: Image) -> None:
        """Paint the disc into an image of the size that it was prepared for."""
        mixed = image[self.rows, self.columns] * self.remaining
        mixed += self.added
        image[self.rows, self.columns] = mixed


def ball(image: Image, x: float, y: float, radius: float, colour: Floats) -> None:
    """Fill a circle with the shading of a ball that is lit from the upper left."""
    left, right = _span(x - radius - 1, x + radius + 1, image.shape[1])
    top, bottom = _span(y - radius - 1, y + radius + 1, image.shape[0])
    loops().ball(image, left, top, right, bottom, float(x), float(y), float(radius),
                                 _shades(colour.tobytes()))


@lru_cache(maxsize=64)
def _shades(tone: bytes) -> Floats:
    """Return a table of the colours of a shaded ball, by distance from its brightest point (0 to 3 radii)."""
    colour = np.frombuffer(tone, dtype=np.float32)
    far = (np.arange(_SHADES, dtype=np.float32)[:, None] + np.float32(0.5)) * np.float32(2 / _SHADES)
    light, dark = _clip(0.62 - 1.5 * far), 0.34 * _clip(1.9 * far - 0.9)
    shades: Floats = ((colour + (255 - colour) * light) * (1 - dark)).astype(np.float32)
    return shades


def bar(image: Image, left: float, top: int, right: float, bottom: int, colour: Floats) -> None:
    """Fill an upright rectangle between whole rows; its left and right ends may be fractions of a pixel.

    Nothing is painted if right <= left.
    """
    if right > left:
        loops().bar(image, float(left), int(top), float(right), int(bottom), colour)


def box(
    image: Image, left: float, top: float, right: float, bottom: float, colour: Floats, corner: float
) -> None:
    """Fill an upright rectangle with corners of radius `corner` [px]."""
    patch, xs, ys = _window(image, left - 1, top - 1, right + 1, bottom + 1)
    corner = min(corner, (right - left) / 2, (bottom - top) / 2)
    dx = np.maximum(np.abs(xs - (left + right) / 2) - ((right - left) / 2 - corner), 0)
    dy = np.maximum(np.abs(ys - (top + bottom) / 2) - ((bottom - top) / 2 - corner), 0)
    blend(patch, _clip(corner + 0.5 - np.hypot(dx, dy)), colour)


def polygon(image: Image, corners: Sequence[tuple[float, float]], colour: Floats) -> None:
    """Fill a convex polygon given by its corners (x, y) in order, clockwise or counter-clockwise."""
    columns, rows = zip(*corners, strict=True)
    patch, xs, ys = _window(image, min(columns) - 1, min(rows) - 1, max(columns) + 1, max(rows) + 1)
    following = [*corners[1:], corners[0]]
    area = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(corners, following, strict=True))
    inside = np.full(np.broadcast_shapes(xs.shape, ys.shape), np.inf, dtype=np.float32)
    for (x0, y0), (x1, y1) in zip(corners, following, strict=True):
        length = math.copysign(math.hypot(x1 - x0, y1 - y0), area)
        if length:
            ux, uy = (x1 - x0) / length, (y1 - y0) / length
            np.minimum(inside, ux * (ys - y0) - uy * (xs - x0), out=inside)
    blend(patch, _clip(inside + 0.5), colour)


def stroke(image: Image, x0: float, y0: float, x1: float, y1: float, width: float,
           colour: Floats) -> None:
    """Draw a straight line with square ends, `width` pixels wide.

    `colour` is one colour (3,), or a table (n, 3) of colours across the line: from its left edge to its right edge, or
    from its top edge to its bottom edge where the line is nearer to the horizontal.
    """
    x0, y0, x1, y1, width = float(x0), float(y0), float(x1), float(y1), float(width)
    if width <= 0:
        return
    if abs(x1 - x0) > abs(y1 - y0):
        _stroke(image, True, y0, x0, y1, x1, width, colour)
    elif y1 != y0:
        _stroke(image, False, x0, y0, x1, y1, width, colour)


def _stroke(image: Image, swapped: bool, x0: float, y0: float, x1: float, y1: float, width: float,
            colour: Floats) -> None:
    """Draw a straight line that is nearer to the vertical than to the horizontal, `width` pixels wide.

    In every row of the image the same number of pixels around the line is computed. With `swapped`, rows and columns
    are exchanged.
    """
    if y1 < y0:
        x0, y0, x1, y1 = x1, y1, x0, y0
    length = math.hypot(x1 - x0, y1 - y0)
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    reach = (width / 2 + 0.5) / uy
    rows, columns = image.shape[1::-1] if swapped else image.shape[:2]
    top, bottom = _span(y0 - width / 2 - 1, y1 + width / 2 + 1, rows)
    count = min(math.ceil(2 * reach) + 1, columns)
    loops().line(image, swapped, top, bottom, count, x0, y0, ux, uy, length, reach, width,
                                 colour.reshape(-1, 3))
