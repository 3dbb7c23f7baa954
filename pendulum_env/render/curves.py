"""Drawing of antialiased lines through many points: fading paths, and graphs over time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render.layout import Box
from pendulum_env.render.paint import Floats, Image, blend

PIECE = 3.0
"""Longest straight piece in which a path is painted [px]."""
PARTS = 3
"""Number of strips into which a graph divides each column of pixels."""
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
    pieces = _pieces(_clipped(path, image.shape[1] + pad, image.shape[0] + pad, -pad))
    if not len(pieces):
        return
    x0, y0, first, x1, y1, last = (column[:, None, None] for column in pieces.T)
    side = math.ceil(PIECE + width) + 3
    offsets = np.arange(side)
    left = np.floor(np.minimum(x0, x1) - pad).astype(np.intp)
    top = np.floor(np.minimum(y0, y1) - pad).astype(np.intp)
    from_left, from_top = int(left.min()), int(top.min())
    wide, high = int(left.max()) - from_left + side, int(top.max()) - from_top + side
    dx, dy = (x1 - x0).astype(np.float32), (y1 - y0).astype(np.float32)
    xs = (left + 0.5 - x0).astype(np.float32) + offsets.astype(np.float32)
    ys = (top + 0.5 - y0).astype(np.float32) + offsets.astype(np.float32)[:, None]
    square = dx * dx + dy * dy
    along = (xs * dx + ys * dy) / np.where(square > 0, square, 1)
    along = np.minimum(np.maximum(along, 0), 1)
    away = np.hypot(xs - along * dx, ys - along * dy)
    cover = np.minimum(np.maximum(np.float32(width / 2 + 0.5) - away, 0), np.float32(min(1.0, width)))
    cover *= (first + along * (last - first)).astype(np.float32)
    where = (top - from_top + offsets[:, None]) * wide + (left - from_left + offsets)
    shown = np.zeros(high * wide, dtype=np.float32)
    np.maximum.at(shown, where.ravel(), cover.ravel())
    picture = shown.reshape(high, wide)
    x, y = max(0, -from_left), max(0, -from_top)
    patch = image[from_top + y : from_top + high, from_left + x : from_left + wide]
    blend(patch, picture[y : y + patch.shape[0], x : x + patch.shape[1]], colour)


def _clipped(path: NDArray[np.float64], right: float, bottom: float, least: float) -> NDArray[np.float64]:
    """Return the straight pieces of a path that are inside a box, as rows (x0, y0, strength, x1, y1, strength).

    Each row has the ends of a piece [px] and the opacity there. The box reaches from `least` to `right` and from
    `least` to `bottom` [px].
    """
    rows = np.hstack((path[:-1], path[1:]))
    rows = rows[~np.isnan(rows).any(axis=1)]
    begin, end = np.zeros(len(rows)), np.ones(len(rows))
    for start, stop, most in ((rows[:, 0], rows[:, 3], right), (rows[:, 1], rows[:, 4], bottom)):
        span = stop - start
        step = np.where(span == 0, 1.0, span)
        near, far = (least - start) / step, (most - start) / step
        outside = (span == 0) & ((start < least) | (start > most))
        begin = np.where(span == 0, np.where(outside, 2.0, begin), np.maximum(begin, np.minimum(near, far)))
        end = np.where(span == 0, end, np.minimum(end, np.maximum(near, far)))
    inside = begin < end
    rows, begin, end = rows[inside], begin[inside, None], end[inside, None]
    span = rows[:, 3:] - rows[:, :3]
    return np.hstack((rows[:, :3] + begin * span, rows[:, :3] + end * span))


def _pieces(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Divide the straight pieces of a path into pieces of at most three pixels.

    Rows are (x0, y0, strength, x1, y1, strength): the two ends of a piece [px], each followed by the opacity there.
    """
    steps = np.hypot(rows[:, 3] - rows[:, 0], rows[:, 4] - rows[:, 1])
    counts = np.maximum(np.ceil(steps / PIECE), 1).astype(np.intp)
    which = np.arange(len(rows)).repeat(counts)
    place = (np.arange(len(which)) - (counts.cumsum() - counts).repeat(counts))[:, None]
    start, span = rows[which, :3], (rows[:, 3:] - rows[:, :3])[which] / counts[which, None]
    return np.hstack((start + place * span, start + (place + 1) * span))


def graph(image: Image, area: Box, xs: NDArray[np.float64], ys: NDArray[np.float64], width: float, colour: Floats,
          rim: float = 0.0, casing: Floats | None = None) -> None:
    """Draw a graph, a line through points (x, y) [px], into a rectangular area of an image.

    The line is `width` pixels wide in every direction and has round ends and, on each side, a rim `rim` pixels wide in
    the colour `casing`. The image must be contiguous; xs must ascend.
    """
    left, top, right, bottom = (round(edge) for edge in (area.left, area.top, area.right, area.bottom))
    if len(xs) < 2 or right <= left or bottom <= top:
        return
    pad = math.ceil(width / 2 + rim)
    fine = left - pad + np.arange((right - left + 2 * pad) * FINE + 1) / FINE
    high = (np.interp(fine, xs, ys) - top).astype(np.float32)
    low = high.copy()
    begin, end = fine.searchsorted((xs[0], xs[-1]))
    high[:begin] = high[end + 1:] = np.inf
    low[:begin] = low[end + 1:] = -np.inf
    bands = [(tone, min(1.0, thick), *_thickened(high, low, thick / 2, pad))
             for tone, thick in ((casing, width + 2 * rim), (colour, width)) if tone is not None]
    above, below = bands[0][2:]
    first = np.clip(np.floor(above.min(axis=0)), 0, bottom - top)
    counts = np.maximum(np.clip(np.ceil(below.max(axis=0)), 0, bottom - top) - first, 0).astype(np.int32)
    begun = counts.cumsum(dtype=np.int32) - counts - first.astype(np.int32)
    row = np.arange(counts.sum(), dtype=np.int32) - begun.repeat(counts)
    where = (row + top) * image.shape[1] + np.arange(left, right, dtype=np.int32).repeat(counts)
    pixels, upper = image.reshape(-1, 3).view("V3")[:, 0], row.astype(np.float32)
    lower = upper + np.float32(1)
    planes = pixels.take(where).view(np.uint8).reshape(-1, 3).T.astype(np.float32, order="C")
    for tone, most, above, below in bands:
        cover = np.zeros_like(upper)
        for edge, end in zip(above, below, strict=True):
            part = np.minimum(lower, end.repeat(counts)) - np.maximum(upper, edge.repeat(counts))
            cover += np.maximum(part, np.float32(0), out=part)
        cover *= np.float32(most / PARTS)
        for plane, shade in zip(planes, tone, strict=True):
            plane += (shade - plane) * cover
    planes += np.float32(0.5)
    pixels[where] = planes.T.astype(np.uint8, order="C").view("V3")[:, 0]


def _thickened(high: Floats, low: Floats, half: float, pad: int) -> tuple[Floats, Floats]:
    """Return the upper and lower edges of a graph's line that is `half` pixels thick on each side of its middle.

    `high` and `low` hold the height of the line's middle at FINE points per pixel, beginning `pad` pixels before the
    first column; where there is no line they are inf and -inf, and so are the edges. Both edges have the shape (PARTS,
    columns).
    """
    step = FINE // PARTS
    first, size = pad * FINE + step // 2, (len(high) - 1 - 2 * pad * FINE) // step
    above, below = np.full((2, size), np.inf, dtype=np.float32)
    below = -below
    for turn in DIRECTIONS:
        start, rise = first + round(half * FINE * math.sin(turn)), np.float32(half * math.cos(turn))
        part = slice(start, start + size * step, step)
        np.minimum(above, high[part] - rise, out=above)
        np.maximum(below, low[part] + rise, out=below)
    upper, lower = (np.ascontiguousarray(edge.reshape(-1, PARTS).T) for edge in (above, below))
    return upper, lower
