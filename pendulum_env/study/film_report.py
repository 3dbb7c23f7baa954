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
from pendulum_env.study.fit_report import drawn

WIDTH = 800
"""Largest width of the film with the track [pixels]."""
RATE = 30.0
"""Largest number of frames per second of the film with the track."""
HEAD = ("time [s]", "angle [rad]", "error [rad]", "x [px]", "y [px]")
"""Columns of track.csv."""
_TAIL = 0.5  # time for which the track is shown behind the bob [s]
_INK, _SEEN, _HELD = (0, 114, 178), (213, 94, 0), (255, 255, 255)  # of the pivot, of a reading, of its rim


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
        total = max(int(math.floor(found.end * rate)), 1)
        paths.append(write_film(place / "track.mp4", _shown(found, film, rate, total), rate, origin, total, tell))
    return paths


def _shown(found: FilmTrack, film: Path, rate: float, total: int) -> Iterator[np.ndarray[tuple[int, ...], np.dtype[np.uint8]]]:
    """Yield frames of a film with the track drawn over them, so many per second of the swing."""
    cv = packages()[1]
    source = Film(str(film), rate=None if found.rate is None else found.rate)
    size = source.size[0]
    picture, count = None, 0
    for time, coming in source.colours(WIDTH):
        while picture is not None and count < total and count / rate < time:
            yield picture
            count += 1
        share = coming.shape[1] / size
        picture = np.ascontiguousarray(coming)
        point = lambda x, y, share=share: (round(16 * share * (x + 0.5) - 8), round(16 * share * (y + 0.5) - 8))  # noqa: E731
        until = int(np.searchsorted(found.time, time + 1e-9))
        since = int(np.searchsorted(found.time, time - _TAIL))
        tail = np.array([point(x, y) for x, y in zip(found.x[since:until], found.y[since:until], strict=True)], np.int32)
        if len(tail) > 1:
            cv.polylines(picture, [tail], False, _SEEN, 1, cv.LINE_AA, 4)
        cv.drawMarker(picture, tuple(round(part / 16) for part in point(*found.pivot)), _INK, cv.MARKER_CROSS, 14, 2)
        if until > since and abs(found.time[until - 1] - time) < 0.5 * found.step:
            for colour, width in ((_HELD, 3), (_SEEN, 1)):
                cv.circle(picture, tuple(tail[-1].tolist()), round(16 * max(share * found.bob, 3.0)), colour, width,
                          cv.LINE_AA, 4)
    while picture is not None and count < total:
        yield picture
        count += 1
