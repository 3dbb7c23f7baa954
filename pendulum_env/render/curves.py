"""Drawing of antialiased lines through many points: fading paths, and graphs over time."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.kernels import plain_functions
from pendulum_env.render import pixels
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
    rows = _pieces(_clipped(path, image.shape[1] + pad, image.shape[0] + pad, -pad))
    if not len(rows):
        return
    side = math.ceil(PIECE + width) + 3
    ends = rows[:, [0, 1, 3, 4]].reshape(-1, 2)
    (left, top), (right, bottom) = (np.floor(far - pad).astype(int) for far in (ends.min(axis=0), ends.max(axis=0)))
    shown = np.zeros((bottom - top + side, right - left + side), dtype=np.float32)
    plain_functions(pixels).pieces(shown, rows, int(left), int(top), side, width)
    x, y = max(0, -left), max(0, -top)
    patch = image[top + y : top + len(shown), left + x : left + shown.shape[1]]
    blend(patch, shown[y : y + patch.shape[0], x : x + patch.shape[1]], colour)


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
    the colour `casing`. The values xs must ascend.
    """
    left, top = max(round(area.left), 0), max(round(area.top), 0)
    right, bottom = min(round(area.right), image.shape[1]), min(round(area.bottom), image.shape[0])
    if len(xs) < 2 or right <= left or bottom <= top:
        return
    pad, step = math.ceil(width / 2 + rim), FINE // PARTS
    fine = left - pad + np.arange((right - left + 2 * pad) * FINE + 1) / FINE
    heights = (np.interp(fine, xs, ys) - top).astype(np.float32)
    begin, end = fine.searchsorted((xs[0], xs[-1]))
    bands = [(tone, thick) for tone, thick in ((casing, width + 2 * rim), (colour, width)) if tone is not None]
    shifts, rises = zip(*(_reach(thick) for _, thick in bands), strict=True)
    plain_functions(pixels).graph(
        image, left, top, right, bottom, heights, int(begin), int(end), pad * FINE + step // 2, step, np.array(shifts),
        np.array(rises), np.array([min(1.0, thick) for _, thick in bands]), np.array([tone for tone, _ in bands]),
        np.empty((len(bands), 2, PARTS), dtype=np.float32))


@lru_cache(maxsize=64)
def _reach(thick: float) -> tuple[NDArray[np.intp], Floats]:
    """Return how far a graph's line reaches from its middle in DIRECTIONS: along, in points of 1/FINE px, and up [px].
    """
    along = [round(thick / 2 * FINE * math.sin(turn)) for turn in DIRECTIONS]
    return np.array(along), np.array([thick / 2 * math.cos(turn) for turn in DIRECTIONS], dtype=np.float32)
