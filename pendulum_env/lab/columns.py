"""Which columns of a file hold the time and the angle, or the time, x and y of a track: told, by name or by place."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.table import Table
from pendulum_env.physics.units import nearest, shown

_TIME = re.compile(r"(?<![a-z])(?:time\w*|zeit|temps|tiempo|t|seconds?|sec|s|[mµu]s|milli\w*|micro\w*)(?![a-z])",
                   re.IGNORECASE)
_COUNT = re.compile(r"(?<![a-z])(?:frames?|index|idx|samples?|no|nr|n)(?![a-z])", re.IGNORECASE)
_ANGLE = re.compile(r"angle|winkel|theta|θ|phi|φ|ϕ|°|(?<![a-z])(?:deg|degrees?|rad|radians?)(?![a-z])", re.IGNORECASE)
_RATE_OF_CHANGE = re.compile(
    r"veloc|speed|accel|gyro|omega|ω|geschw|dot(?![a-z])|\u0307|(?<![a-z])(?:rate(?![a-z])|d(?:theta|phi|θ|φ))"
    r"|(?:rad|deg\w*|°|m|1)\s*/\s*s|s\^?-\d", re.IGNORECASE)
_X = re.compile(r"(?<![a-z])x(?![a-z])", re.IGNORECASE)
_Y = re.compile(r"(?<![a-z])y(?![a-z])", re.IGNORECASE)

TRACK = "xy"


class Layout(NamedTuple):
    """Numbers of the columns, from 0: of the time (None: there is none), of the angle or of x and y; what to say."""

    time: int | None
    values: tuple[int, ...]
    notes: list[str]

    @property
    def track(self) -> bool:
        """Whether it is an x-y track."""
        return len(self.values) == 2

    @property
    def expected(self) -> str:
        """What each line has to hold."""
        what = "x and y" if self.track else "an angle"
        return f"a time{',' if self.track else ' and'} {what}" if self.time is not None else what.replace("an ", "one ")


def layout_of(table: Table, columns: Any, timed: bool) -> Layout:
    """The columns that are ``columns``, or if that is None that the header names, or the first ones.

    ``timed``: the rate is told, so that a column of times is not needed.

    Raises RecordingError where ``columns`` does not tell them, and where the header names a rate of change in place of
    an angle, or a count in place of a time that no rate makes one of.
    """
    titles = [" ".join(title) for title in table.titles]
    if columns is None:
        found = _named(titles, timed or table.rate is not None)
        wrong = [titles[i] for i in found.values if _RATE_OF_CHANGE.search(titles[i])]
        if wrong:
            raise RecordingError(f"{table.name}: expected an angle, the header names {wrong[0]!r} (columns= overrides)")
        across, along = ([i for i in range(len(titles)) if form.search(titles[i])] for form in (_X, _Y))
        axis = not found.track and found.values[0] in (*across, *along) and not _ANGLE.search(titles[found.values[0]])
        if axis and across and along:
            said = "the header names more columns x and y (columns=(time, x, y) tells which)"
            raise RecordingError(f"{table.name}: expected an angle, or one track, {said}")
        if found.time is not None and _counts(titles[found.time]):
            said = f"the header names {titles[found.time]!r} (rate= tells how many a second)"
            raise RecordingError(f"{table.name}: expected times, {said}")
        return found
    if isinstance(columns, str) and columns == TRACK:
        found = _track(titles, timed) or _first_of_track(table, timed)
    else:
        found = _told(table, titles, columns, timed)
    places = [*([] if found.time is None else [found.time]), *found.values]
    return Layout(found.time, found.values, [f"columns: {_list(places, titles)}, as told"])


def _named(titles: list[str], timed: bool) -> Layout:
    """As the header names them; a file without such names begins with the time and the angle."""
    width = len(titles)
    if width == 1:
        return Layout(None, (0,), [])
    is_angle = [bool(_ANGLE.search(title)) and not _RATE_OF_CHANGE.search(title) for title in titles]
    track = None if any(is_angle) else _track(titles, timed)
    if track is not None:
        return track
    times = [i for i, title in enumerate(titles) if _TIME.search(title) and not is_angle[i]
             and not _RATE_OF_CHANGE.search(title)]
    angles = [i for i in range(width) if is_angle[i]]
    time = times[0] if times else 1 if angles[:1] == [0] else 0
    angle = next((i for i in angles if i != time), 1 - min(time, 1))
    if timed and _counts(titles[time]):
        return Layout(None, (angle,), [f"columns: {_list([angle], titles)}, as the header names them"])
    if (time, angle) == (0, 1):
        return Layout(0, (1,), [f"columns: the first two of {width} are read"] if width > 2 else [])
    return Layout(time, (angle,), [f"columns: {_list([time, angle], titles)}, as the header names them"])


def _track(titles: list[str], timed: bool) -> Layout | None:
    """Time, x and y as the header names them; None if it does not."""
    xs, ys = ([i for i, title in enumerate(titles) if form.search(title) and not _RATE_OF_CHANGE.search(title)]
              for form in (_X, _Y))
    if len(xs) != 1 or len(ys) != 1 or xs == ys:
        return None
    others = [i for i in range(len(titles)) if i not in (*xs, *ys)]
    times = [i for i in others if _TIME.search(titles[i])] or others
    times = [i for i in times if not (timed and _counts(titles[i]))]
    if not times and not timed:
        return None
    places = [*times[:1], *xs, *ys]
    said = f"columns: an x-y track, {_list(places, titles)}, as the header names them"
    return Layout(times[0] if times else None, (xs[0], ys[0]), [said])


def _first_of_track(table: Table, timed: bool) -> Layout:
    """Time, x and y in the first columns; x and y alone where there are two, and the rate is told."""
    if table.width >= 3:
        return Layout(0, (1, 2), [])
    if table.width == 2 and timed:
        return Layout(None, (0, 1), [])
    raise RecordingError(f"{table.name}: expected three columns, t, x and y (two with rate=), found {table.width}")


def _told(table: Table, titles: list[str], columns: Any, timed: bool) -> Layout:
    """Columns told by name, or by number from 1."""
    given = list(columns) if isinstance(columns, Sequence) and not isinstance(columns, (str, bytes)) else []
    if not 1 <= len(given) <= 3:
        allowed = f"{TRACK!r}, or names or numbers of (time, angle), (time, x, y) or, with rate=, (angle,)"
        raise RecordingError(f"columns must be {allowed}, got {shown(columns)}")
    places = [_place(table, titles, entry) for entry in given]
    if len(set(places)) < len(places):
        raise RecordingError(f"columns must be different ones, got {shown(columns)}")
    if len(places) == 1 and not timed and table.rate is None:
        raise RecordingError(f"columns must name the time too, where no rate is given, got {shown(columns)}")
    return Layout(None, (places[0],), []) if len(places) == 1 else Layout(places[0], tuple(places[1:]), [])


def _place(table: Table, titles: list[str], entry: Any) -> int:
    if isinstance(entry, int) and not isinstance(entry, bool) and 1 <= entry <= table.width:
        return entry - 1
    names = {name.lower(): i for i, title in enumerate(table.titles) for name in (*title, titles[i]) if name}
    if isinstance(entry, str) and entry.strip().lower() in names:
        return names[entry.strip().lower()]
    if isinstance(entry, str):
        known = nearest(entry.lower(), names) if names else "; its columns have no names."
        raise RecordingError(f"{table.name}: there is no column {shown(entry)}{known}")
    span = f"from 1 to {table.width}"
    raise RecordingError(f"{table.name}: a column is told by its name, or a number {span}, not {shown(entry)}")


def _counts(title: str) -> bool:
    """Whether a column holds numbers of frames or samples, no times."""
    return bool(_COUNT.search(title)) and not _TIME.search(title)


def _list(places: Sequence[int], titles: list[str]) -> str:
    """Columns as they are said: their numbers, and names if they have any."""
    return ", ".join(f"{i + 1} ({titles[i]})" if titles[i] else f"{i + 1}" for i in places)
