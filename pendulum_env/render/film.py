"""Write frames as a film, an H.264 mp4 or an animated gif; a film that cannot be completed leaves no file.

Frames go to ffmpeg one by one, so a long film takes no more memory than a short one.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from fractions import Fraction
from numbers import Real
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.replacing import replacing
from pendulum_env.common.texts import clean

Frame = NDArray[np.uint8]
Progress = Callable[[int, "int | None"], None]

LEAST_GIF_DELAY = 2
"""Shortest time between a gif's frames [1/100 s]; viewers replace a shorter one by a tenth of a second."""
MOST_GIF_DELAY = 10_000
"""Longest time between a gif's frames [1/100 s]."""
LONGEST = 65535
"""Longest time that a gif can show a picture, of one frame or of several that are equal [1/100 s]."""
QUALITY = "-preset veryfast -crf 16"
"""Options of x264. Its usual preset, with -crf 18, takes 1.6 times as long and a sixth fewer bytes, as good to look at.
"""
LOSSLESS_AND_PALETTE = (
    "-filter_complex split[film][colours];[colours]palettegen[palette] -map [film] -c:v libx264rgb -qp 0 "
    "-preset ultrafast film.mkv -map [palette] palette.png")
"""Options of ffmpeg that write a lossless copy of a film, and the palette of its colours."""
GIF = ("-i film.mkv -i palette.png -filter_complex pad=iw+16:ih+8:8:0,mpdecimate=max={repeats}:hi=0:lo=0:frac=0,"
       "crop=iw-16:ih-8:8:0[film];[film][1]paletteuse=dither=none -fps_mode passthrough -final_delay {last} film.gif")
"""Options of ffmpeg that make a gif from the lossless copy of a film and its palette.

The filter mpdecimate drops frames that equal the frame before. The border makes it compare all pixels, because it looks
at whole blocks of 8, and at none at the left edge.
"""


def write_film(
    path: str | os.PathLike[str],
    frames: Iterable[Frame],
    fps: float,
    metadata: Mapping[str, str] | None = None,
    total: int | None = None,
    progress: Progress | None = None,
) -> Path:
    """Write frames as a film and return its path; the film lasts the number of frames over ``fps`` in seconds.

    The film is written to a temporary file, which takes the place of ``path`` when it is complete. If writing fails, an
    older file at ``path`` stays as it was.

    Args:
        path: ends in ".mp4" (H.264, yuv420p; an odd width or height gets one more white line) or ".gif".
        frames: uint8 arrays of shape (H, W, 3), all of one size.
        fps: frames per second [1/s]; a gif takes 100/n, n a whole number from 2 to 10000.
        metadata: written into the file as a comment in JSON; an mp4 takes its title from the entry "title", or else
            from the file's name.
        total: the number of frames, checked if given.
        progress: ``progress(done, total)`` is called after each frame.

    Raises ValueError for an unknown ending, an fps out of range, no frames, frames of several sizes, or a number of
    frames other than total; OSError where the folder cannot be written or ffmpeg fails.
    """
    target = check_film(path, fps)
    write = _WRITERS[target.suffix.lower()]
    if target.is_dir():
        raise IsADirectoryError(f"can't write the film {str(target)!r}: there is a folder of that name")
    facts = {name: clean(text, None) for name, text in (metadata or {}).items()}
    title = facts.get("title", clean(target.stem, None))
    comment = json.dumps(facts, ensure_ascii=False) if facts else ""
    with ExitStack() as stack:
        try:
            part = stack.enter_context(replacing(target))
        except OSError as error:
            raise OSError(f"can't write films into {str(target.parent)!r}: {error.strerror}") from error
        write(part, _checked(frames, total, progress), fps, title, comment)
    return target


def check_film(path: str | os.PathLike[str], fps: float) -> Path:
    """Return the path of a film, after a check of its ending and of its frames per second.

    Raises ValueError for an unknown ending, or frames per second that the kind of film cannot have.
    """
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
    """Return the time between a gif's frames in hundredths of a second.

    Raises ValueError where this is not a whole number from 2 to 10000; the message names the nearest possible fps.
    """
    delay = 100 / fps
    whole = round(delay)
    if LEAST_GIF_DELAY <= whole <= MOST_GIF_DELAY and abs(delay - whole) <= 1e-6 * delay:
        return whole
    near = sorted({min(max(LEAST_GIF_DELAY, part), MOST_GIF_DELAY) for part in (math.floor(delay), math.ceil(delay))})
    names = " or ".join(f"{100 / n:g}" if 10000 % n == 0 else f"100/{n}" for n in near)
    raise ValueError(f"a gif's fps must be 100/n, n a whole number from {LEAST_GIF_DELAY} to {MOST_GIF_DELAY} (its "
                     f"delays are hundredths of a second), not {fps:g}; the nearest: {names}")


def _checked(frames: Iterable[Frame], total: int | None, progress: Progress | None) -> Iterator[Frame]:
    """Yield the frames of a film after a check of their type, shape and number; call ``progress`` after each frame."""
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
    """Write frames as an H.264 mp4."""
    pad = "pad=ceil(iw/2)*2:ceil(ih/2)*2:0:0:white"
    options = (f"-vf {pad},scale=out_color_matrix=bt709:out_range=tv -colorspace bt709 -color_primaries bt709 "
               f"-color_trc bt709 -color_range tv -c:v libx264 {QUALITY} -pix_fmt yuv420p -movflags +faststart -f mp4")
    _encode(frames, fps, [*options.split(), "-metadata", f"title={title}", "-metadata", f"comment={comment}",
                          str(part.absolute())])


def _write_gif(part: Path, frames: Iterator[Frame], fps: float, title: str, comment: str) -> None:
    """Write frames as a gif with one palette of colours, for which ffmpeg reads the film a second time."""
    delay, repeats = gif_delay(fps), 0
    longest = LONGEST // delay

    def counted() -> Iterator[Frame]:
        nonlocal repeats
        before: Frame | None = None
        for picture in frames:
            repeats = repeats + 1 if before is not None and np.array_equal(before, picture) else 0
            before = picture.copy()
            yield picture

    with tempfile.TemporaryDirectory(prefix="lab-pendulum-") as folder:
        _encode(counted(), Fraction(100, delay), LOSSLESS_AND_PALETTE.split(), folder)
        options = GIF.format(repeats=longest - 1, last=delay * (1 + repeats % longest))
        _ffmpeg(options.split(), (), folder)
        with Path(folder, "film.gif").open("rb") as film, part.open("wb") as file:
            head = film.read(13)
            head += film.read(3 << 1 + (head[10] & 7))
            file.write(head + _gif_comment(comment.encode()))
            shutil.copyfileobj(film, file)


def _gif_comment(text: bytes) -> bytes:
    """Return a gif's comment block with a text, as ffmpeg writes none (GIF89a, CompuServe 1990)."""
    pieces = [text[i : i + 255] for i in range(0, len(text), 255)]
    return b"".join([b"!\xfe", *(bytes([len(piece)]) + piece for piece in pieces), b"\0"]) if text else b""


def _encode(frames: Iterator[Frame], fps: float | Fraction, output: Sequence[str], folder: str | None = None) -> None:
    """Write a film with ffmpeg, with the given frames as input and the given options for the output."""
    first = next(frames)
    height, width = first.shape[:2]
    rate = Fraction(fps).limit_denominator(100_000)
    source = f"-f rawvideo -pix_fmt rgb24 -s {width}x{height} -framerate {rate} -i - -an".split()
    _ffmpeg([*source, *output], itertools.chain((first,), frames), folder)


def _ffmpeg(options: Sequence[str], frames: Iterable[Frame], folder: str | None) -> None:
    """Run ffmpeg in a folder and write frames of a film to its input; OSError with ffmpeg's last message if it fails.

    An exception from ``frames`` ends ffmpeg.
    """
    import imageio_ffmpeg

    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", *options]
    with tempfile.TemporaryFile() as log:
        encoder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log, cwd=folder)
        assert encoder.stdin is not None
        try:
            for picture in frames:
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
            messages = log.read().decode(errors="replace").strip().splitlines() or ["ffmpeg gave no reason"]
            raise OSError(f"ffmpeg could not write the film: {messages[-1]}")


_WRITERS = {".mp4": _write_mp4, ".gif": _write_gif}
