"""Animated gifs, written frame by frame: of a long film, too, only two frames are in memory."""

from __future__ import annotations

from collections.abc import Iterable
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

Frame = NDArray[np.uint8]
Part = tuple[Any, tuple[int, int]]

COLOURS = 256
NEAR, FAR = 16, 5e-4
"""A palette serves another frame if at most this share of its pixels is further off than NEAR in some channel."""
LONGEST = 65535
"""Delay that a frame can have [1/100 s]."""


class Palette:
    """The colours of a frame, 256 at most, by median cut (Heckbert 1982), and the nearest of them to any other."""

    def __init__(self, picture: Frame) -> None:
        from PIL import Image

        found = Image.fromarray(picture).quantize(COLOURS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        self.flat = found.getpalette() or []
        self._colours = np.reshape(self.flat, (-1, 3)).astype(np.int32)
        self._nearest = np.full(1 << 24, -1, dtype=np.int16)

    def places(self, picture: Frame) -> tuple[Frame, float]:
        """Index (H, W) of the nearest colour to each pixel, and the share of pixels that it is far from."""
        red, green, blue = np.moveaxis(picture.astype(np.int32), 2, 0)
        keys = red << 16 | green << 8 | blue
        found = self._nearest[keys]
        if (found < 0).any():
            new = np.unique(keys[found < 0])
            away = np.stack((new >> 16, new >> 8 & 255, new & 255), axis=1)[:, None] - self._colours
            best = (away * away).sum(axis=2).argmin(axis=1)
            far = np.abs(away[np.arange(len(new)), best]).max(axis=1) > NEAR
            self._nearest[new] = best + COLOURS * far
            found = self._nearest[keys]
        return (found % COLOURS).astype(np.uint8), float((found >= COLOURS).mean())

    def image(self, places: Frame) -> Any:
        """A Pillow image of these indices."""
        from PIL import Image

        made = Image.fromarray(np.ascontiguousarray(places))
        made.putpalette(self.flat)
        return made


def write_gif(file: IO[bytes], frames: Iterable[Frame], delay: int, comment: str) -> None:
    """Write frames, uint8 (H, W, 3), each shown for ``delay`` hundredths of a second, over and over again.

    Of a frame, the part that differs from the one before is written (GIF89a, CompuServe 1990); one that does not
    differ prolongs it.
    """
    from PIL import GifImagePlugin

    palette: Palette | None = None
    shown: Frame | None = None
    kept: Part | None = None
    lasting = 0
    for picture in frames:
        places, far = palette.places(picture) if palette else (None, 1.0)
        if palette is None or places is None or far > FAR:
            begun = palette is None
            palette, shown = Palette(picture), None
            places, _ = palette.places(picture)
            if begun:
                info = {"loop": 0, "comment": comment.encode()}
                file.write(b"".join(GifImagePlugin.getheader(palette.image(places), info=info)[0]))
        rows, columns = _changed(shown, places)
        if rows.size:
            _write(file, kept, lasting)
            top, left = int(rows[0]), int(columns[0])
            kept, lasting = (palette.image(places[top : rows[-1] + 1, left : columns[-1] + 1]), (left, top)), 0
        shown, lasting = places, lasting + delay
    _write(file, kept, lasting)
    file.write(b";")


def _changed(before: Frame | None, after: Frame) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns with pixels that differ; all of them where there was nothing before."""
    if before is None:
        return np.arange(after.shape[0]), np.arange(after.shape[1])
    differ = before != after
    return np.flatnonzero(differ.any(axis=1)), np.flatnonzero(differ.any(axis=0))


def _write(file: IO[bytes], kept: Part | None, lasting: int) -> None:
    """A part of a frame with its own colours at its place, for so many hundredths of a second."""
    from PIL import GifImagePlugin

    while kept is not None and lasting > 0:
        image, place = kept
        data = GifImagePlugin.getdata(image, place, duration=10 * min(lasting, LONGEST), include_color_table=True)
        file.write(b"".join(data))
        lasting -= LONGEST
