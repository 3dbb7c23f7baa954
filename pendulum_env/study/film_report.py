"""Report of a filmed bob's track: its table, its figure, and the film with the track drawn over it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.lab.film import FilmTrack
from pendulum_env.lab.film.frames import Film, packages
from pendulum_env.render.paint import Image
from pendulum_env.render.palette import INK
from pendulum_env.render.text import LEAST_SIZE, MINUS, measure
from pendulum_env.render.text import write as write_text
from pendulum_env.study.fit_report import drawn

WIDTH = 800
"""Largest width of the film with the track [pixels]."""
RATE = 30.0
"""Largest number of frames per second of the film with the track."""
HEAD = ("time [s]", "angle [rad]", "error [rad]", "x [px]", "y [px]")
"""Columns of track.csv."""
_TAIL = 0.5  # time for which the track is shown behind the bob [s]
_PIVOT, _SEEN, _RIM = (0, 114, 178), (213, 94, 0), (255, 255, 255)  # the last makes both seen on every film


def write(found: FilmTrack, film: Path, folder: str | Path, *, filmed: bool = True,
          progress: Progress | bool | None = None) -> list[Path]:
    """Write ``track.csv``, ``track.png`` and, unless ``filmed`` is False, ``track.mp4``; return the paths.

    ``film`` is the file that was tracked. Raises OutputError where the folder cannot be written.
    """
    tell, place = told_by(progress), output_folder(folder)
    origin = provenance(film=found.source, notes=list(found.recording.notes))
    paths = [place / "track.csv"]
    write_csv(paths[0], HEAD, zip(*(column.tolist() for column in (
        found.time, found.angle, found.error, found.x, found.y)), strict=True), origin)
    paths += drawn(found.plot, place / "track", {**origin, "Title": f"track in {found.source}"}, False)
    if filmed:
        from pendulum_env.render.film import write_film

        rate = min(RATE, 1.0 / found.step)
        total = max(math.floor(found.end * rate), 1)
        paths.append(write_film(place / "track.mp4", _shown(found, film, rate, total), rate, origin, total,
                                lambda done, _: tell(done / total, "track.mp4")))
    return paths


def _shown(found: FilmTrack, film: Path, rate: float, total: int) -> Iterator[Image]:
    """Yield frames of a film with the track drawn over them, so many per second of the swing."""
    picture, count = None, 0
    for time, coming in Film(str(film), rate=found.rate).colours(WIDTH):
        while picture is not None and count < total and count / rate < time:
            yield picture
            count += 1
        picture = _drawn_over(np.ascontiguousarray(coming), found, time)
    while picture is not None and count < total:
        yield picture
        count += 1


def _drawn_over(picture: Image, found: FilmTrack, time: float) -> Image:
    """Draw into a frame the way of the bob up to a time, the bob and the pivot, and write the time and the angle."""
    cv = packages()[1]
    share = picture.shape[1] / found.size[0]

    def point(x: float, y: float) -> tuple[int, int]:
        """Return a place in sixteenths of a pixel of the frame."""
        return round(16.0 * (share * (x + 0.5) - 0.5)), round(16.0 * (share * (y + 0.5) - 0.5))

    until = int(np.searchsorted(found.time, time + 1e-9))
    since = int(np.searchsorted(found.time, time - _TAIL))
    way = np.array([point(x, y) for x, y in zip(found.x[since:until], found.y[since:until], strict=True)], np.int32)
    read = until > since and abs(found.time[until - 1] - time) < 0.5 * found.step
    for colour, rim in ((_RIM, 2), (_SEEN, 0)):
        if len(way) > 1:
            cv.polylines(picture, [way], False, colour, 1 + rim, cv.LINE_AA, 4)
        if read:
            cv.circle(picture, tuple(way[-1].tolist()), round(16.0 * max(share * found.bob, 4.0)), colour, 2 + rim,
                      cv.LINE_AA, 4)
    pivot = tuple(round(part / 16.0) for part in point(*found.pivot))
    for colour, size, width in ((_RIM, 17, 4), (_PIVOT, 15, 2)):
        cv.drawMarker(picture, pivot, colour, cv.MARKER_CROSS, size, width)
    angle = f"{math.degrees(found.angle[until - 1]):.1f}°".replace("-", MINUS) if read else "no reading"
    said = f"{time:.2f} s, {angle}"
    font = max(LEAST_SIZE + 4, round(0.05 * min(picture.shape[:2])))
    width, height = measure(said, font)
    plate = picture[-height - 12 :, : width + 24]
    plate[...] = 255 if read else _SEEN
    write_text(plate, said, 12.0, 0.5 * plate.shape[0], font, INK if read else "#FFFFFF")
    return picture
