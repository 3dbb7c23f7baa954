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
from typing import Any

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Floats = NDArray[np.float32]

PIXEL = np.dtype("V3")
"""The three bytes of a pixel as one item, which is copied at once."""
NONE, HALF, FULL = (np.array(value, dtype=np.float32) for value in (0.0, 0.5, 1.0))
"""0, 0.5 and 1 as arrays without axes, which numpy's functions take in half the time of a number."""
_CENTRES: Floats = np.arange(65_536, dtype=np.float32) + np.float32(0.5)
_OFFSETS = _CENTRES - HALF
_SHADES = 256
_UNSEEN = 1 / 512
"""Opacity below which no colour changes a pixel: the change would be less than half of one step of 255."""


@lru_cache(maxsize=64)
def _tile(colour: bytes) -> Floats:
    """Return the bytes of an RGB colour (three float32) as an array of that colour, repeated for 4096 pixels."""
    return np.tile(np.frombuffer(colour, dtype=np.float32), 4096)


def spread(colour: Floats, pixels: int) -> Floats:
    """Return an RGB colour (3,) repeated for ``pixels`` pixels of a row, as an array of shape (3 * pixels,)."""
    return _tile(colour.tobytes())[: 3 * pixels] if pixels <= 4096 else np.tile(colour, pixels)


def blend(patch: Image, cover: Floats, colour: Floats) -> None:
    """Mix `colour`, (3,) or (..., 3), into pixels `patch` (..., 3) in place; `cover` (...) is the opacity, 0 to 1."""
    under = patch.astype(np.float32, order="C").reshape(*patch.shape[:-2], 3 * patch.shape[-2])
    patch[...] = _blended(under, cover, colour).reshape(patch.shape)


def blend_at(image: Image, where: NDArray[np.intp], cover: Floats, colour: Floats) -> None:
    """Mix `colour`, (3,) or (..., 3), into the pixels of an image whose flat indices are `where` (...), each once.

    `cover` (...) is the opacity, 0 to 1.
    """
    whole = np.ascontiguousarray(image)
    pixels = np.ndarray(whole.size // 3, PIXEL, whole)
    under = pixels.take(where).view(np.uint8).astype(np.float32)
    pixels.put(where, _blended(under, cover, colour).astype(np.uint8).view(PIXEL))
    if whole is not image:
        image[...] = whole


def _blended(under: Floats, cover: Floats, colour: Floats) -> Floats:
    """Return rows of pixels `under` (..., 3 n) mixed with `colour`, (3,) or (..., n, 3), plus 0.5 for rounding.

    `cover` (..., n) is the opacity, 0 to 1.
    """
    mixed = (spread(colour, cover.shape[-1]) if colour.ndim == 1 else colour.reshape(under.shape)) - under
    mixed *= cover.repeat(3, axis=-1)
    mixed += under
    mixed += HALF
    return mixed


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
    clipped: Floats = np.minimum(np.maximum(values, NONE), FULL)
    return clipped


def disc(image: Image, x: float, y: float, radius: float, colour: Floats, share: float = 1.0) -> None:
    """Fill a circle in an image, with the opacity `share` from 0 to 1."""
    patch, xs, ys = _window(image, x - radius - 1, y - radius - 1, x + radius + 1, y + radius + 1)
    blend(patch, _clip(radius + 0.5 - np.hypot(xs - x, ys - y)) * np.float32(share), colour)


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
    patch, xs, ys = _window(image, x - radius - 1, y - radius - 1, x + radius + 1, y + radius + 1)
    dx, dy = xs - x, ys - y
    far = np.hypot(dx + 0.36 * radius, dy + 0.40 * radius) * np.float32(_SHADES / (3 * radius))
    shaded = _shades(colour.tobytes()).take(far.astype(np.intp), axis=0, mode="clip")
    blend(patch, _clip(radius + 0.5 - np.hypot(dx, dy)), shaded)


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
    if right <= left:
        return
    first, last = math.ceil(left), math.floor(right)
    if first > last:
        mix(image[top:bottom, last], colour, right - left)
        return
    image[top:bottom, first:last] = _row(colour.tobytes(), last - first)
    if first - left > _UNSEEN:
        mix(image[top:bottom, first - 1], colour, first - left)
    if right - last > _UNSEEN:
        mix(image[top:bottom, last], colour, right - last)


@lru_cache(maxsize=1024)
def _row(colour: bytes, pixels: int) -> Image:
    """Return a row of pixels of an RGB colour (three float32)."""
    return np.tile(np.frombuffer(colour, dtype=np.float32).astype(np.uint8), (pixels, 1))


def mix(patch: Image, colour: Floats, share: float) -> None:
    """Mix a colour, (3,), into pixels `patch` (..., 3) in place; `share`, 0 to 1, is the fraction of the colour."""
    under = patch.astype(np.float32)
    mixed = colour - under
    mixed *= share
    mixed += under
    mixed += HALF
    patch[...] = mixed


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
    half = width / 2
    reach = (half + 0.5) / uy
    rows, columns = image.shape[1::-1] if swapped else image.shape[:2]
    down, right = (1, rows) if swapped else (columns, 1)
    top, bottom = _span(y0 - half - 1, y1 + half + 1, rows)
    if top >= bottom:
        return
    count = min(math.ceil(2 * reach) + 1, columns)
    ys = _CENTRES[top:bottom] - y0
    left = np.ceil(ys * (ux / uy) + (x0 - reach - 0.5))
    np.minimum(np.maximum(left, NONE, out=left), columns - count, out=left)
    turn, cross = np.array(((uy, ux), (-ux, uy)), dtype=np.float32)[..., None]
    ends = (left + (0.5 - x0)) * turn
    ends += ys * cross
    across, along = (_OFFSETS[:count] * turn)[..., None] + ends[:, None]
    cover = np.array(length, np.float32) - along
    np.minimum(cover, along, out=cover)
    np.minimum(cover, np.array(half, np.float32) - np.abs(across), out=cover)
    cover += HALF
    np.minimum(np.maximum(cover, NONE, out=cover), FULL if width >= 1 else width, out=cover)
    if colour.ndim == 2:
        across *= np.array((len(colour) - 1) / width, np.float32)
        across += np.array((len(colour) - 1) / 2, np.float32)
        colour = colour.take(across.astype(np.intp), axis=0, mode="clip")
    where = np.arange(top * down, bottom * down, down) + left.astype(np.intp) * right
    blend_at(image, where + np.arange(0, count * right, right)[:, None], cover, colour)
