"""Tracked films beside OpenCV's CSRT and trackpy: share of frames found, scatter of the angle, claimed error, period.

    python examples/benchmarks/films.py [FILM ...] [--markdown] [--beside] [--other] [--minute]

Each film is drawn with its truth by tests/support/drawn_films.py. ``--beside`` gives the same files to CSRT and trackpy
(environments of their own, made in .venvs), which are helped: they are told where the bob is in the first frame, its
size, and the pivot. ``--other`` draws the same kinds with other numbers; ``--minute`` times a minute of 1080p at 60
frames a second. ``found`` counts readings within half a bob of the truth, among the frames in which the bob is seen
whole; ``held`` is the share of 95 % intervals that hold the truth; the ``claimed`` beside ``scale - 1``, of the angles
over the true ones, is the relative error of the radius.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
BESIDE = {
    "CSRT": ("numpy", "av", "opencv-contrib-python-headless"),
    "trackpy": ("numpy", "av", "trackpy", "numba"),
}
HEADS = ("film", "found", "left out", "scatter [mrad]", "claimed [mrad]", "held", "scale - 1", "claimed", "period - 1")


def frames(path: str, kind: str) -> Any:
    """Yield time and picture of each frame, as a player shows them."""
    import av

    with av.open(path) as box:
        for frame in box.decode(video=0):
            yield float(frame.time), np.rot90(frame.to_ndarray(format=kind), round(frame.rotation / 90))


def csrt(path: str, x: float, y: float, size: float, reach: float) -> list[list[float]]:
    """Follow a box around the bob, 1.3 times as wide, by OpenCV's CSRT from the first frame."""
    import cv2

    rows, tracker = [], None
    for t, picture in frames(path, "bgr24"):
        picture = np.ascontiguousarray(picture)
        if tracker is None:
            tracker = cv2.TrackerCSRT_create()
            wide = max(round(1.3 * size), 8)
            tracker.init(picture, (round(x - 0.5 * wide), round(y - 0.5 * wide), wide, wide))
            rows.append([t, x, y])
            continue
        there, box = tracker.update(picture)
        if there:
            rows.append([t, box[0] + 0.5 * (box[2] - 1.0), box[1] + 0.5 * (box[3] - 1.0)])
    return rows


def trackpy(path: str, x: float, y: float, size: float, reach: float) -> list[list[float]]:
    """Locate spots of the bob's size in every frame, link them, and take the path that begins at the bob."""
    import pandas as pd
    import trackpy as tp

    tp.quiet()
    diameter, found, times, invert, least = int(size) // 2 * 2 + 1, [], [], False, 0.0
    for k, (t, picture) in enumerate(frames(path, "gray")):
        times.append(t)
        if k == 0:
            half = max(round(0.3 * size), 1)
            inner = picture[round(y) - half : round(y) + half + 1, round(x) - half : round(x) + half + 1]
            invert = float(np.mean(inner)) < float(np.median(picture))
        spots = tp.locate(255 - picture if invert else picture, diameter, minmass=least)
        if k == 0 and len(spots):
            own = np.hypot(spots["x"] - x, spots["y"] - y).to_numpy().argmin()
            least = 0.4 * float(spots["mass"].iloc[own])
        spots["frame"] = k
        found.append(spots[spots["mass"] >= least].nlargest(30, "mass"))
    try:
        paths = tp.link(pd.concat(found), search_range=reach, memory=3)
    except Exception as error:
        print(f"trackpy: {error}", file=sys.stderr)
        return []
    first = paths[paths["frame"] == paths["frame"].min()]
    own = first["particle"].iloc[np.hypot(first["x"] - x, first["y"] - y).to_numpy().argmin()]
    path = paths[paths["particle"] == own].sort_values("frame")
    return [[times[int(k)], float(a), float(b)] for k, a, b in path[["frame", "x", "y"]].to_numpy()]


def beside(name: str, film: Path, truth: Any) -> Any:
    """Return the marks of another tracker on the same file; its readings of a file are kept."""
    from film_marks import mark
    from venvs import python_of

    reach = float(np.max(np.hypot(np.diff(truth.x), np.diff(truth.y)))) * 1.5 + 3.0
    seat = [str(value) for value in (film, truth.x[0], truth.y[0], truth.film.bob, reach)]
    python = python_of(f"films-{name.lower()}", BESIDE[name], Path(".venvs"))
    kept = python.parents[1] / f"{film.stem}-{hashlib.sha256(film.read_bytes()).hexdigest()[:12]}.json"
    if not kept.exists():
        run = subprocess.run([python, "-W", "ignore", __file__, "--follow", name.lower(), *seat], capture_output=True,
                             text=True)
        if run.returncode:
            raise RuntimeError(f"{name} failed: {run.stderr.strip().splitlines()[-1]}")
        kept.write_text(run.stdout.splitlines()[-1])
    rows = np.array(json.loads(kept.read_text()), float).reshape(-1, 3)
    at = rows[:, 0] * (truth.film.stated / truth.film.fps if truth.film.stated else 1.0)
    angle = np.arctan2(rows[:, 1] - truth.pivot[0], rows[:, 2] - truth.pivot[1])
    return mark(truth, at, angle)


def main() -> None:
    """Print a row a film."""
    sys.path[:0] = [str(HERE), str(HERE.parents[1] / "tests" / "support")]
    from drawn_films import FILMS, draw, other
    from film_marks import mark

    from pendulum_env.lab import RecordingError, track

    wanted = [word for word in sys.argv[1:] if not word.startswith("--")]
    markdown, others = "--markdown" in sys.argv, list(BESIDE) if "--beside" in sys.argv else []
    heads = [*HEADS, *(f"{name}: {word}" for name in others for word in ("found", "scatter [mrad]"))]

    def line(cells: list[str]) -> None:
        print(f"| {' | '.join(cells)} |" if markdown else "".join(f"{cell:>15s}" for cell in cells), flush=True)

    line(heads)
    if markdown:
        line(["---"] * len(heads))
    with tempfile.TemporaryDirectory() as folder:
        for film in FILMS:
            if wanted and film.name not in wanted:
                continue
            path = Path(folder) / f"{film.name}.mp4"
            truth = draw(other(film, int("--other" in sys.argv)), path)
            try:
                recording = track(path, **truth.film.options)
            except RecordingError as error:
                cells = [f"refused: {str(error).removeprefix(path.name + ': ')}", *[""] * (len(HEADS) - 2)]
            else:
                own = mark(truth, recording.time, recording.angle, recording.error)
                cells = [f"{own.found:.1%}", f"{1.0 - own.share:.1%}", f"{1e3 * own.scatter:.2f}",
                         f"{1e3 * own.claimed:.2f}", f"{own.held:.1%}", f"{own.scale - 1.0:+.1e}",
                         f"{recording.radius.error / recording.radius.value:.1e}", f"{own.period - 1.0:+.1e}"]
            for name in others:
                marks = beside(name, path, truth)
                cells += [f"{marks.found:.1%}", f"{1e3 * marks.scatter:.2f}" if marks.found else "-"]
            line([film.name, *cells])
            path.unlink()
        if "--minute" in sys.argv:
            minute(Path(folder) / "minute.mp4")


def minute(path: Path) -> None:
    """Time the tracking of a minute of 1080p at 60 frames a second."""
    from drawn_films import Film, draw

    from pendulum_env.lab import track

    draw(Film("minute", "A minute of 1080p at 60 frames a second.", size=(1920, 1080), fps=60.0, seconds=60.0,
              pivot=(960.0, 100.0), radius=800.0, bob=60.0, pattern=12.0, thread=3.0), path)
    wall, used = time.perf_counter(), time.process_time()
    recording = track(path)
    wall, used = time.perf_counter() - wall, time.process_time() - used
    print(f"a minute of 1080p at 60 frames a second, {path.stat().st_size / 1e6:.0f} MB: {wall:.1f} s, {used:.1f} s of "
          f"CPU, {len(recording.time)} readings")


if __name__ == "__main__":
    if "--follow" in sys.argv:
        name, path, *numbers = sys.argv[2:]
        rows = {"csrt": csrt, "trackpy": trackpy}[name](path, *map(float, numbers))
        print(json.dumps(rows))
    else:
        main()
