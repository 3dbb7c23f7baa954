"""Frames of a film with their real times, read one after the other, so that memory does not grow with the film.

A frame's time is its time stamp (pts) in the file: phones record at a varying rate, and drop frames. A rotation flag is
obeyed. Only one channel is decoded to an array: the brightness or, for a bob of the wall's brightness, a difference of
colour (the planes Y, U, V of ITU-R BT.601).
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import RecordingError, one_number
from pendulum_env.physics.units import shown

if TYPE_CHECKING:
    from av.video.frame import VideoFrame

Picture = NDArray[np.uint8]
CHANNELS = ("brightness", "blue against yellow", "red against green")
"""Channels of a film, in the order in which a bob is looked for."""
ENDINGS = frozenset((".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".mts", ".m2ts", ".3gp", ".wmv",
                     ".flv", ".ogv", ".gif"))
"""Endings of films; other files are read as text."""
_LEAST = 12  # frames
_SLOWEST, _FASTEST = 0.01, 1000.0  # times the rate of the file that a camera may have had
_NEEDS = "reading a film needs PyAV and OpenCV; pip install 'lab-pendulum[video]'"


class Frame(NamedTuple):
    """A frame of a film: its number from 0, its time [s] from the first frame, and one channel of its picture."""

    number: int
    time: float
    picture: Picture


def is_film(path: str | os.PathLike[str]) -> bool:
    """Return True if the name of a file ends as a film's does."""
    return Path(path).suffix.lower() in ENDINGS


def packages(name: str = "a film") -> tuple[Any, Any]:
    """Return PyAV and OpenCV; RecordingError says how to install them."""
    try:
        import av
        import cv2
    except ImportError:
        raise RecordingError(f"{name}: {_NEEDS}") from None
    return av, cv2


def smaller(picture: Picture, by: int) -> Picture:
    """Return a picture whose pixels are the means of ``by`` x ``by`` pixels; what is left at its end is cut off."""
    cv = packages()[1]
    while by > 1:  # halving twice takes a tenth of the time of a quarter
        step = 2 if by % 2 == 0 else by
        across, along = picture.shape[1] // step, picture.shape[0] // step
        picture = cv.resize(picture[: along * step, : across * step], (across, along), interpolation=cv.INTER_AREA)
        by //= step
    return picture


class Film:
    """A film in a file: ``size`` (width, height) as shown, ``stated`` frames per second, ``slower`` than life.

    Args:
        path: the file.
        rate: frames per second at which the camera recorded [Hz], for slow motion whose file states another rate; None:
            the time stamps of the file are true.
        until: time [s] after which frames are left out.
        channel: number of the channel, of ``CHANNELS``.

    Raises RecordingError for a file that is no film, has no pictures, or fewer than 12.
    """

    def __init__(self, path: str, *, rate: float | None = None, until: float | None = None, channel: int = 0) -> None:
        self.path, self.name, self.channel = path, Path(path).name, channel
        self.until = math.inf if until is None else one_number(until, "until", above=0.0, unit="s")
        self._av, self._cv = packages(self.name)
        self.broken, self.turned = "", 0
        steps, first, shape = [], None, None
        with self._opened() as container:
            stream = container.streams.video[0]
            self.stated = float(stream.average_rate or stream.guessed_rate or 0.0)
            self.length = float(stream.duration * stream.time_base) if stream.duration else (
                container.duration / 1e6 if container.duration else 0.0)
            for time, frame in self._decoded(container):
                first = time if first is None else first
                self.turned = int(getattr(frame, "rotation", 0) or 0)
                shape = self._picture(frame).shape
                steps.append(time)
                if len(steps) > 4 * _LEAST:
                    break
        if len(steps) < _LEAST or shape is None:
            why = f" ({self.broken})" if self.broken else ""
            raise RecordingError(f"{self.name}: expected a film of at least {_LEAST} frames, found {len(steps)}{why}")
        self.size, self.first = (shape[1], shape[0]), first or 0.0
        self.step = float(np.median(np.diff(steps)))
        self.slower = 1.0 if rate is None else one_number(rate, "rate", above=0.0, unit="Hz") * self.step
        if not _SLOWEST <= self.slower <= _FASTEST:
            raise RecordingError(f"{self.name}: rate is that of the camera, from {_SLOWEST:g} to {_FASTEST:g} times "
                                 f"the {1.0 / self.step:.4g} frames per second of the file, got {shown(rate)}")
        self.step /= self.slower

    @property
    def count(self) -> int:
        """Number of frames that are expected up to ``until``, by the stated length."""
        return max(int(min(self.length / self.slower, self.until) / self.step), _LEAST)

    def frames(self) -> Iterator[Frame]:
        """Yield the frames one after the other, without those whose time does not increase."""
        last, first = -math.inf, 0.0
        with self._opened() as container:
            for number, (stamp, frame) in enumerate(self._decoded(container)):
                first = stamp if not number else first
                time = (stamp - first) / self.slower
                if time > self.until:
                    return
                if time > last:
                    last = time
                    yield Frame(number, time, self._picture(frame))

    def colours(self, width: int, start: float = 0.0) -> Iterator[tuple[float, Picture]]:
        """Yield the time [s] of each frame from ``start`` on and its picture in red, green and blue, at most ``width``
        pixels wide.
        """
        with self._opened() as container:
            first = self.first
            if start > 0.0:  # from the key frame before it
                container.seek(int((first + start * self.slower) * 1e6))
            for stamp, frame in self._decoded(container):
                time = (stamp - first) / self.slower
                if time > self.until:
                    return
                if time < start - 0.5 * self.step:
                    continue
                share = min(width / self.size[0], 1.0)
                across, along = (max(int(share * side) // 2 * 2, 2) for side in self.size)
                if self.turned % 180:
                    across, along = along, across
                shown = np.asarray(frame.reformat(width=across, height=along, format="rgb24").to_ndarray(), np.uint8)
                yield time, self._upright(shown)

    def jpeg(self, picture: Picture) -> bytes:
        """Return a picture in red, green and blue as JPEG."""
        return bytes(self._cv.imencode(".jpg", picture[..., ::-1], [self._cv.IMWRITE_JPEG_QUALITY, 90])[1])

    def _opened(self) -> Any:
        """Return the opened file; RecordingError if it is no film."""
        errors = (self._av.error.FFmpegError, OSError, ValueError)
        try:
            if not os.path.getsize(self.path):
                raise RecordingError(f"{self.name}: expected a film, the file is empty")
            container = self._av.open(self.path)
        except RecordingError:
            raise
        except FileNotFoundError:
            raise RecordingError(f"{self.name}: no such file") from None
        except errors as error:
            why = getattr(error, "strerror", None) or error
            raise RecordingError(f"{self.name}: expected a film such as .mp4 or .mov, but it cannot be read ({why}); "
                                 "it may be cut off or of another kind") from None
        if not container.streams.video:
            container.close()
            raise RecordingError(f"{self.name}: expected a film, the file has no pictures")
        container.streams.video[0].thread_type = "AUTO"
        return container

    def _decoded(self, container: Any) -> Iterator[tuple[float, VideoFrame]]:
        """Yield the time stamps [s] and frames of a file; damage ends it, and is kept in ``broken``."""
        stream = container.streams.video[0]
        step = 1.0 / float(stream.average_rate or 30)
        try:
            for number, frame in enumerate(container.decode(stream)):
                yield (number * step if frame.time is None else float(frame.time)), frame
        except self._av.error.FFmpegError as error:
            self.broken = f"the file is damaged: {error.strerror}"

    def _picture(self, frame: VideoFrame) -> Picture:
        """Return the channel of a frame as an array, as it is shown."""
        if frame.format.name not in ("yuv420p", "yuvj420p", "nv12"):
            frame = frame.reformat(format="yuv420p")
        if self.channel and frame.format.name == "nv12":
            frame = frame.reformat(format="yuv420p")
        plane = frame.planes[self.channel]
        picture = np.frombuffer(memoryview(plane), np.uint8).reshape(plane.height, plane.line_size)[:, :plane.width]
        if self.channel:
            picture = self._cv.resize(picture, (frame.width, frame.height), interpolation=self._cv.INTER_LINEAR)
        return self._upright(picture)

    def _upright(self, picture: Picture) -> Picture:
        """Return a picture turned as the file's rotation flag says."""
        return np.ascontiguousarray(np.rot90(picture, self.turned // 90)) if self.turned else picture


class Shots:
    """Frames of a film at any time, as JPEG, for a page; several threads may ask."""

    def __init__(self, film: Film, width: int = 960) -> None:
        self.film, self.width = film, width
        self._lock = threading.Lock()
        self._frames: Iterator[tuple[float, Picture]] = iter(())
        self._now: tuple[float, Picture] | None = None
        self._next: tuple[float, Picture] | None = None

    def at(self, time: float) -> tuple[float, bytes]:
        """Return the time [s] of the frame that is seen at a time, and its JPEG."""
        time = min(time, self.film.length / self.film.slower)
        late = time + 0.25 * self.film.step
        with self._lock:
            if self._now is None or not self._now[0] <= late < self._now[0] + 2.0:
                self._frames = self.film.colours(self.width, max(time - 0.5, 0.0))
                self._next = next(self._frames, None)
                self._now = self._next or self._now
            while self._next is not None and self._next[0] <= late:
                self._now, self._next = self._next, next(self._frames, None)
            if self._now is None:
                raise RecordingError(f"{self.film.name}: no frame at {time:g} s")
            shown, picture = self._now
        return shown, self.film.jpeg(picture)
