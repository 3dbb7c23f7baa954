"""Projects of the video analysis program Tracker (.trk, XML): the track of a point mass as a table of t, x and y.

Tracker (Brown & Christian 2011, Simulating what you see, MPTL 16) stores the pixels of each frame, the time between
frames in ms, and the coordinate system: its origin and angle, and the pixels per unit of length.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from xml.etree.ElementTree import Element

from pendulum_env.lab.checked import RecordingError, chosen
from pendulum_env.lab.decoding import tree_of

_FRAME = re.compile(r"\[(\d+)\]")


def track_table(name: str, text: str, part: str | None) -> tuple[str, list[str]]:
    """Return the track of a point mass in a Tracker project as a table of t [s], x and y [m], and notes.

    ``y`` points up. ``part`` is the name of the point mass; None: the only one. Raises ParseError for text that is not
    XML, RecordingError for several point masses, and for a track without the time between frames.
    """
    root = tree_of(name, text)
    tracks = {_text(item, "name") or "mass": item for item in root.iter("object") if _kind(item) == "PointMass"}
    mass = chosen(name, "point mass", list(tracks), part)
    step = _number(root, "delta_t")
    if not step or not step > 0.0:
        raise RecordingError(f"{name}: expected the time between frames, delta_t [ms], found {step}")
    axes = next((item for item in root.iter("object") if _kind(item) == "ImageCoordSystem$FrameData"), None)
    scale_x = (_number(axes, "xscale") if axes is not None else None) or 1.0
    scale_y = (_number(axes, "yscale") if axes is not None else None) or scale_x
    x0, y0, turn = ((_number(axes, key) or 0.0) if axes is not None else 0.0 for key in (
        "xorigin", "yorigin", "xaxisangle"))
    sine, cosine = math.sin(turn), math.cos(turn)
    unit = "px" if scale_x == 1.0 else "m"
    lines = [f"t (s)\tx ({unit})\ty ({unit})"]
    for frame, x, y in _points(tracks[mass]):
        across, up = x - x0, y0 - y
        lines.append(f"{frame * step * 1e-3!r}\t{(across * cosine + up * sine) / scale_x!r}\t"
                     f"{(up * cosine - across * sine) / scale_y!r}")
    notes = [f"Tracker: point mass {mass}, {step:g} ms per frame, {scale_x:g} pixels per metre"]
    return "\n".join(lines) + "\n", notes


def _points(track: Element) -> Iterator[tuple[int, float, float]]:
    """Yield the frame and the pixels x, y (down) of each marked point of a track."""
    data = next((item for item in track.findall("property") if item.get("name") == "framedata"), None)
    for entry in [] if data is None else data.findall("property"):
        frame = _FRAME.fullmatch(entry.get("name") or "")
        point = entry.find("object")
        if frame is None or point is None:
            continue
        x, y = _number(point, "x"), _number(point, "y")
        if x is not None and y is not None:
            yield int(frame[1]), x, y


def _kind(item: Element) -> str:
    """Return the class of an object without its package."""
    return (item.get("class") or "").rpartition(".")[2]


def _text(item: Element, key: str) -> str | None:
    """Return the first property of this name within an object as text; None if there is none."""
    return next((entry.text or "" for entry in item.iter("property") if entry.get("name") == key), None)


def _number(item: Element, key: str) -> float | None:
    """Return the first property of this name within an object as a number; None if there is none."""
    text = _text(item, key)
    try:
        return None if text is None else float(text)
    except ValueError:
        return None
