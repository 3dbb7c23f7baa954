"""Painting of text into images, in a font that pygame-ce brings along; no system font or display is needed.

Pygame is imported when the first text is painted.
"""

from __future__ import annotations

import os
import re
import sys
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pendulum_env.render.paint import Image, blend
from pendulum_env.render.palette import rgb

if TYPE_CHECKING:
    import pygame.font

_FONTS: dict[int, pygame.font.Font] = {}
_MOST_FONTS, _MOST_PICTURES = 32, 512
_PART = re.compile(r"[0-9]{1,2}(?:\.(?=[0-9]))?|°|[^0-9°]+")
"""Part of a text that recurs in others: up to two digits, with a decimal point after them, or what is between."""
_DIGITS = frozenset("0123456789")
MINUS = "\N{MINUS SIGN}"
LEAST_SIZE = 14
"""Smallest font size in pixels that can still be read: its capitals are about 9 pixels high."""


def _font(size: int) -> pygame.font.Font:
    """Return pygame's font in a size [px]; it is loaded again if pygame was shut down in the meantime."""
    if size in _FONTS and sys.modules["pygame.font"].get_init():
        return _FONTS[size]
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    import pygame.font

    if not pygame.font.get_init():
        pygame.font.init()
        _FONTS.clear()
    if len(_FONTS) >= _MOST_FONTS:
        _FONTS.clear()
    return _FONTS.setdefault(size, pygame.font.Font(None, size))


def _render(text: str, size: int) -> pygame.Surface:
    """Return a pygame surface with one line of text; the font is loaded again after pygame was shut down."""
    font = _font(size)
    import pygame

    try:
        return font.render(text, True, (0, 0, 0))
    except pygame.error:  # pygame.quit() was called after the font was loaded
        _FONTS.clear()
        return _font(size).render(text, True, (0, 0, 0))


@lru_cache(maxsize=4096)
def piece(text: str, size: int) -> NDArray[np.uint8]:
    """Return the opacity, 0 to 255, of every pixel of a short text; the results for recent texts are cached.

    Digits and a point after them are painted one beside the other.
    """
    if len(text) > 1 and text[0] in _DIGITS:
        return np.concatenate([piece(sign, size) for sign in text], axis=1)
    if text == "°":
        return _degree(size)
    surface = _render(text, size)
    import pygame.surfarray

    cover = np.zeros((_height(size), surface.get_width()), dtype=np.uint8)
    rows = min(len(cover), surface.get_height())
    cover[:rows] = pygame.surfarray.pixels_alpha(surface).T[:rows]
    return cover


def _degree(size: int) -> NDArray[np.uint8]:
    """Return the opacity of every pixel of a degree sign; the font's own is a dot in small sizes."""
    digit = piece("0", size)
    top = int(np.flatnonzero(digit.max(axis=1) > 127)[0])
    side, half = max(4, round(0.26 * size)), max(0.5, 0.03 * size)
    wide = max(side + 1, _render("°", size).get_width())  # at least as wide as the font's own
    across = np.arange(wide) + 0.5 - side / 2
    down = np.arange(len(digit))[:, None] + 0.5 - top - side / 2
    cover: NDArray[np.float64] = np.clip(half + 0.5 - np.abs(np.hypot(across, down) - side / 2 + half), 0, 1)
    return np.rint(255 * cover).astype(np.uint8)


@lru_cache(maxsize=64)
def _height(size: int) -> int:
    """Return the height of a line of text [px] in a font size.

    Older versions of pygame-ce give single words without high or low letters a smaller height.
    """
    return _render("Å(gjpqy|0", size).get_height()


class _Pictures(dict[str, NDArray[np.uint8]]):
    """Pictures (H, W, 3) of short texts in one size and colour on one background, painted when first asked for."""

    def __init__(self, size: int, colour: str, paper: str) -> None:
        self.size, self.inks = size, _inks(paper, colour)

    def __missing__(self, text: str) -> NDArray[np.uint8]:
        if len(self) >= _MOST_PICTURES:
            self.clear()
        picture = self[text] = self.inks.take(piece(text, self.size), axis=0)
        return picture


_pictures = lru_cache(maxsize=32)(_Pictures)


def mask(text: str, size: int) -> NDArray[np.uint8]:
    """Return the opacity, 0 to 255, of every pixel of one line of text."""
    return np.concatenate([piece(part, size) for part in _PART.findall(text)], axis=1)


@cache
def _inks(paper: str, colour: str) -> NDArray[np.uint8]:
    """Return a table (256, 3) of RGB colours that change evenly from the hex colour ``paper`` to ``colour``."""
    share = np.arange(256, dtype=np.float32)[:, None] / 255
    return np.rint(rgb(paper) * (1 - share) + rgb(colour) * share).astype(np.uint8)


@lru_cache(maxsize=1024)
def measure(text: str, size: int) -> tuple[int, int]:
    """Return the (width, height) of one line of text in pixels."""
    pieces = [piece(part, size) for part in _PART.findall(text)] or [piece("0", size)[:, :0]]
    return sum(one.shape[1] for one in pieces), pieces[0].shape[0]


def fit(text: str, size: int, width: float) -> str:
    """Return a text, shortened with an ellipsis if it is wider than `width` pixels; "" if nothing fits."""
    if measure(text, size)[0] <= width:
        return text
    for end in range(len(text) - 1, 0, -1):
        shorter = text[:end].rstrip() + "…"
        if measure(shorter, size)[0] <= width:
            return shorter
    return ""


def write(image: Image, text: str, x: float, y: float, size: int, colour: str,
          anchor: tuple[float, float] = (0.0, 0.5), paper: str | None = None) -> None:
    """Paint one line of text in a hex colour over the image or, which is faster, on the background colour `paper`.

    anchor: point of the text's bounding box that is placed at (x, y); (0, 0) is top left, (1, 1) bottom right.
    """
    if not text:
        return
    picture = mask(text, size) if paper is None else np.concatenate(
        [*map(_pictures(size, colour, paper).__getitem__, _PART.findall(text))], axis=1)
    height, width = picture.shape[:2]
    left, top = round(x - anchor[0] * width), round(y - anchor[1] * height)
    if left < 0 or top < 0 or left + width > image.shape[1] or top + height > image.shape[0]:
        picture = picture[max(0, -top):max(0, image.shape[0] - top), max(0, -left):max(0, image.shape[1] - left)]
        left, top, (height, width) = max(left, 0), max(top, 0), picture.shape[:2]
    patch = image[top:top + height, left:left + width]
    if paper is None:
        blend(patch, picture * np.float32(1 / 255), rgb(colour))
    else:
        patch[...] = picture
