"""Pixels to files: films of frames, H.264 in mp4 or animated gif by the file's ending, written whole or not at all.

Gifs are written frame by frame: of a long film, too, only two frames are in memory.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, suppress
from fractions import Fraction
from numbers import Real
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.replacing import replacing

Frame = NDArray[np.uint8]
Progress = Callable[[int, "int | None"], None]
Part = tuple[Any, tuple[int, int]]

LEAST_GIF_DELAY = 2
"""Hundredths of a second: viewers replace a shorter delay by a tenth of a second."""
COLOURS = 256
NEAR, FAR = 16, 5e-4
"""A palette serves another frame if at most this share of its pixels is further off than NEAR in some channel."""
LONGEST = 65535
"""Delay that a frame can have [1/100 s]."""


def write_film(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    fps: float,
    metadata: Mapping[str, str] | None = None,
    total: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write frames as a film, which lasts their number over ``fps`` in seconds, and return its path.

    The film is made beside its place and moved there when it is complete: whatever goes wrong, a file that
    was there before stays as it was.

    Args:
        path: its ending chooses the kind: ".mp4" (H.264, yuv420p; an odd side is filled up with one white line) or
            ".gif".
        frames: uint8 arrays of shape (H, W, 3), all of one size.
        fps: frames per second [1/s]; of a gif 100/k with a whole k, as its delays are whole hundredths of a second.
        metadata: goes into the file as a comment in JSON; its "title", else the file's name, is the mp4's title.
        total: how many frames there must be, if known.
        progress: ``progress(done, total)`` is called after each frame.

    Raises ValueError for an unknown ending, a bad fps, no frames, unlike frames or not as many as total;
    OSError where the folder can't be written or the encoder fails.
    """
    target = check_film(path, fps)
    write = _WRITERS[target.suffix.lower()]
    if target.is_dir():
        raise IsADirectoryError(f"can't write the film {str(target)!r}: there is a folder of that name")
    tags = {"title": target.stem, **(metadata or {})}
    comment = json.dumps(dict(metadata), ensure_ascii=False) if metadata else ""
    with ExitStack() as stack:
        try:
            part = stack.enter_context(replacing(target))
        except OSError as error:
            raise OSError(f"can't write films into {str(target.parent)!r}: {error.strerror}") from error
        write(part, _checked(frames, total, progress), fps, tags["title"], comment)
    return target


def check_film(path: str | os.PathLike[str], fps: float) -> Path:
    """The path of a film of so many frames per second; ValueError for an ending or a rate that cannot be."""
    target = Path(path)
    kind = target.suffix.lower()
    if kind not in _WRITERS:
        raise ValueError(f"a film's name must end in {' or '.join(_WRITERS)}, not {target.name!r}")
    if not (isinstance(fps, Real) and math.isfinite(fps) and fps > 0):
        raise ValueError(f"a film's fps must be finite and above 0, not {fps!r}")
    if kind == ".gif":
        gif_delay(fps)
    return target


def gif_delay(fps: float) -> int:
    """Return the hundredths of a second between a gif's frames.

    Raises ValueError where that is not a whole number of at least 2, and names the nearest rates.
    """
    delay = 100 / fps
    whole = round(delay)
    if whole >= LEAST_GIF_DELAY and abs(delay - whole) <= 1e-6 * delay:
        return whole
    near = sorted({max(LEAST_GIF_DELAY, math.floor(delay)), max(LEAST_GIF_DELAY, math.ceil(delay))})
    names = " or ".join(f"{100 / n:g}" if 10000 % n == 0 else f"100/{n}" for n in near)
    raise ValueError(f"a gif's fps must be 100/n, n a whole number from {LEAST_GIF_DELAY} on (its delays are "
                     f"hundredths of a second), not {fps:g}; the nearest: {names}")


def _checked(frames: Iterable[Frame], total: int | None, progress: Progress | None) -> Iterator[Frame]:
    shape: tuple[int, ...] | None = None
    count = 0
    for count, picture in enumerate(frames, 1):
        if not isinstance(picture, np.ndarray) or picture.dtype != np.uint8 or picture.shape[2:] != (3,):
            kind = type(picture).__name__
            if isinstance(picture, np.ndarray):
                kind = f"{picture.dtype} of shape {picture.shape}"
            raise ValueError(f"frame {count} must be a uint8 array of shape (H, W, 3), not {kind}")
        if shape not in (None, picture.shape):
            raise ValueError(f"frame {count} must have shape {shape} like the first, not {picture.shape}")
        if total is not None and count > total:
            raise ValueError(f"the film must have {total} frames, but there are more")
        shape = picture.shape
        yield picture
        if progress:
            progress(count, total)
    if not count or (total is not None and count < total):
        wanted = "at least one frame" if total is None else f"{total} frames"
        raise ValueError(f"the film must have {wanted}, but there are {count}")


def _write_mp4(part: Path, frames: Iterator[Frame], fps: float, title: str, comment: str) -> None:
    import imageio_ffmpeg

    first = next(frames)
    height, width = first.shape[:2]
    even = f"pad={width + width % 2}:{height + height % 2}:0:0:white"
    options = (
        "-y -loglevel error -f rawvideo -pix_fmt rgb24 "
        f"-s {width}x{height} -framerate {Fraction(fps).limit_denominator(100_000)} -i - -an "
        f"-vf {even},scale=out_color_matrix=bt709:out_range=tv "
        "-colorspace bt709 -color_primaries bt709 -color_trc bt709 -color_range tv "
        "-c:v libx264 -crf 18 -pix_fmt yuv420p -movflags +faststart -f mp4"
    ).split()
    command = [imageio_ffmpeg.get_ffmpeg_exe(), *options, "-metadata", f"title={title}",
               "-metadata", f"comment={comment}", str(part.absolute())]
    with tempfile.TemporaryFile() as log:
        encoder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log)
        assert encoder.stdin is not None
        try:
            for picture in itertools.chain((first,), frames):
                try:
                    encoder.stdin.write(np.ascontiguousarray(picture).data)
                except BrokenPipeError:
                    break
            with suppress(BrokenPipeError):
                encoder.stdin.close()
            failed = encoder.wait() != 0
        finally:
            encoder.kill()
            encoder.wait()
            with suppress(OSError):
                encoder.stdin.close()
        if failed:
            log.seek(0)
            said = log.read().decode(errors="replace").strip().splitlines() or ["it gave no reason"]
            raise OSError(f"the mp4 encoder failed: {said[-1]}")


def _write_gif(part: Path, frames: Iterator[Frame], fps: float, title: str, comment: str) -> None:
    with part.open("wb") as file:
        write_gif(file, frames, gif_delay(fps), comment)


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
            _write_part(file, kept, lasting)
            top, left = int(rows[0]), int(columns[0])
            kept, lasting = (palette.image(places[top : rows[-1] + 1, left : columns[-1] + 1]), (left, top)), 0
        shown, lasting = places, lasting + delay
    _write_part(file, kept, lasting)
    file.write(b";")


def _changed(before: Frame | None, after: Frame) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns with pixels that differ; all of them where there was nothing before."""
    if before is None:
        return np.arange(after.shape[0]), np.arange(after.shape[1])
    differ = before != after
    return np.flatnonzero(differ.any(axis=1)), np.flatnonzero(differ.any(axis=0))


def _write_part(file: IO[bytes], kept: Part | None, lasting: int) -> None:
    """A part of a frame with its own colours at its place, for so many hundredths of a second."""
    from PIL import GifImagePlugin

    while kept is not None and lasting > 0:
        image, place = kept
        data = GifImagePlugin.getdata(image, place, duration=10 * min(lasting, LONGEST), include_color_table=True)
        file.write(b"".join(data))
        lasting -= LONGEST


_WRITERS = {".mp4": _write_mp4, ".gif": _write_gif}
