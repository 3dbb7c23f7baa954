"""Decide which columns of a recording's file hold time and angle, or time, x and y of a track.

The columns are given by the caller, or named by the header, or the first ones are taken.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError
from pendulum_env.lab.quantities import (
    ACTION,
    ANGLE,
    CORRELATION,
    COUNT,
    CURRENT,
    DISTANCE,
    FORCE,
    GATE,
    LENGTH,
    NO_FORCE,
    OTHER,
    PERIOD,
    RATE,
    RATE_OF_CHANGE,
    TIME,
    TORQUE,
    Quantity,
)
from pendulum_env.lab.table import TextTable
from pendulum_env.lab.tracks import fit_circle
from pendulum_env.physics.units import nearest, shown

_ABSOLUTE = re.compile(r"absolut|magnitude|norm|total|betrag|(?<![a-z])(?:tg?f|at)(?![a-z])", re.IGNORECASE)
RATED = "rate"
FORCED = "acceleration"
NEVER: tuple[Quantity, ...] = (CORRELATION, GATE, LENGTH, PERIOD, OTHER)
"""Quantities that are never an angle; a column with any but the last is a sign of another kind of file."""
DRIVES = (TORQUE, CURRENT, ACTION)
_ALIKE = 4
"""Most ways in which one number is written, as 0, -0 and 0.0."""
_FEW = 3
"""Number of values of each column that a refusal prints."""
_ON_CIRCLE = 0.02
"""Points of a track without names lie on their circle to this share of their extent."""
_SHORT = 0.1
"""Least extent of a track without names, as a share of the radius of its circle."""
_ARC = 300.0
"""Points of a track without names cover less than this of their circle [degrees]; those of a phase portrait more."""
_TILT = 10.0
"""Largest angle between the middle of the arc of a track without names and the vertical [degrees]."""
_X = re.compile(r"(?<![a-z])x(?![a-z])", re.IGNORECASE)
_Y = re.compile(r"(?<![a-z])y(?![a-z])", re.IGNORECASE)
_Z = re.compile(r"(?<![a-z])z(?![a-z])", re.IGNORECASE)

TRACK = "xy"


class ColumnLayout(NamedTuple):
    """Numbers, from 0, of the columns of time (None: no such column) and angle, or time, x and y; with notes.

    ``length``: the unit [m] of a column that holds a displacement or distance in place of an angle; else 0. ``rate``:
    the unit, "deg" or "rad" per s, of columns that hold an angular velocity about one or more axes; else "".
    ``force``: the unit [m/s²] of columns that hold accelerations; -1 if the titles do not say it; else 0.
    """

    time: int | None
    values: tuple[int, ...]
    notes: list[str]
    length: float = 0.0
    rate: str = ""
    force: float = 0.0

    @property
    def track(self) -> bool:
        """True if the columns hold the x and y of a track, as of a filmed bob; False if they hold an angle."""
        return len(self.values) == 2 and not self.rate and not self.force

    @property
    def expected(self) -> str:
        """Description of the values that every line of the file must have, for error messages."""
        kind = "x and y" if self.track else "an angle"
        return f"a time{',' if self.track else ' and'} {kind}" if self.time is not None else kind.replace("an ", "one ")


def layout_of(table: TextTable, columns: Any, timed: bool) -> ColumnLayout:
    """Return the columns of a recording's file to read. They are those that ``columns`` selects, else those that the
    header names, else the first ones.

    ``timed``: True if a rate is given, so that no time column is needed.

    Raises RecordingError if ``columns`` is invalid, if the header names a rate of change instead of an angle or several
    tracks, and if it names a sample number instead of a time and no rate is known.
    """
    titles = [" ".join(title) for title in table.titles]
    if columns is None:
        _refuse_axes(table, titles)
        layout = _circular(table, titles) or _named(table, titles, timed or table.rate is not None)
        if layout.length:
            return layout
        rates = _rates(titles, layout)
        if rates is not None:
            return rates
        forces = _forces(table, titles, layout)
        if forces is not None:
            return forces
        wrong = [titles[i] for i in layout.values if RATE_OF_CHANGE.names(titles[i])]
        if wrong:
            raise RecordingError(f"{table.name}: expected an angle, the header names {wrong[0]!r}; "
                                 f"{described(table, titles)}")
        for place in (*layout.values, *([] if layout.time is None else [layout.time])):
            _refuse_others(table, titles, [place])
        across, along = ([i for i in range(len(titles)) if form.search(titles[i])] for form in (_X, _Y))
        first = layout.values[0]
        axis = not layout.track and first in (*across, *along) and not ANGLE.names(titles[first])
        if axis and across and along and layout.time not in across:
            problem = "the header names several columns x and y (give columns=(time, x, y))"
            raise RecordingError(f"{table.name}: expected an angle, or one track, {problem}")
        if layout.time is not None and (_counts(titles[layout.time]) or _numbered(table, titles, layout)):
            named = f"the header names {titles[layout.time]!r}" if titles[layout.time] else (
                f"column {layout.time + 1} counts the readings")
            problem = f"{named} (give rate=, the samples per second)"
            raise RecordingError(f"{table.name}: expected times, {problem}")
        return layout
    if isinstance(columns, str) and columns == TRACK:
        layout = _track(table, titles, timed) or _first_of_track(table, timed)
    else:
        layout = _selected(table, titles, columns, timed)
        wrong = [titles[i] for i in layout.values if RATE_OF_CHANGE.names(titles[i])]
        if wrong and not layout.rate and not layout.force and not (isinstance(columns, str) and "angle" in columns):
            raise RecordingError(f"{table.name}: {RATE_OF_CHANGE.refusal(wrong[0])}")
    places = [*([] if layout.time is None else [layout.time]), *layout.values]
    note = f"columns: {_list(places, titles)}, as given"
    return ColumnLayout(layout.time, layout.values, [note], layout.length, layout.rate, layout.force)


def _rates(titles: list[str], layout: ColumnLayout) -> ColumnLayout | None:
    """Return the columns of an angular velocity whose unit is known, where the header names no angle; else None.

    Those of all axes are taken, and an absolute value only if there is nothing else.
    """
    if layout.track or layout.time is None or not RATE_OF_CHANGE.names(titles[layout.values[0]]):
        return None
    places = [i for i, title in enumerate(titles) if RATE.names(title) and i != layout.time and "accel" not in
              title.lower()]
    places = [i for i in places if not _ABSOLUTE.search(titles[i])] or places[:1]
    units = RATE.units_in(titles[i] for i in places)
    if not places or len(units) != 1:
        return None
    note = f"columns: {_list([layout.time, *places], titles)}, an angular velocity in {min(units)}/s"
    return ColumnLayout(layout.time, tuple(places), [note], rate=min(units))


def _forces(table: TextTable, titles: list[str], layout: ColumnLayout) -> ColumnLayout | None:
    """Return the columns of an acceleration with gravity, where the header names no angle; else None.

    Those of all axes are taken, and the absolute value only if there is nothing else. Raises RecordingError for an
    acceleration from which a phone has subtracted gravity.
    """
    if layout.time is None or ANGLE.names(titles[layout.values[0]]):
        return None
    places = [i for i, title in enumerate(titles) if FORCE.names(title) and i != layout.time
              and not RATE.names(title)]
    if not places or (layout.values[0] not in places and not layout.track):
        return None
    without = [i for i in places if NO_FORCE.names(titles[i])]
    if len(without) == len(places):
        raise RecordingError(f"{table.name}: {NO_FORCE.refusal(titles[places[0]])}; {described(table, titles)}")
    places = [i for i in places if i not in without]
    places = [i for i in places if not _ABSOLUTE.search(titles[i])] or places[:1]
    return _with_force(titles, layout.time, places[:3])


def _with_force(titles: list[str], time: int, places: Sequence[int]) -> ColumnLayout:
    """Return the layout of a file with a time and accelerations, whose unit is that in their titles."""
    units = FORCE.units_in(titles[i] for i in places)
    name = units.pop() if len(units) == 1 else ""
    said = f" in {name}" if name else ""
    return ColumnLayout(time, tuple(places), [f"columns: {_list([time, *places], titles)}, an acceleration{said}"],
                        force=FORCE.units[name].size if name else -1.0)


def is_absolute(titles: Sequence[str]) -> bool:
    """Return True if the titles are that of one column with an absolute value."""
    return len(titles) == 1 and bool(_ABSOLUTE.search(titles[0]))


def described(table: TextTable, titles: list[str]) -> str:
    """Return a sentence with the columns of a file, their first values, their likely quantities, and how to choose."""
    columns = []
    for i, title in enumerate(titles):
        values = [fields[i] for _, fields in table.rows[:_FEW] if len(fields) > i]
        name = f"{i + 1}{f' ({title})' if title else ''}"
        columns.append(f"{name} begins with {', '.join(values)} ({_could_be(table, i)})")
    return (f"column {'; '.join(columns)}; choose by columns='time=1,angle=2', with rate, {FORCED}, or x and y in "
            "place of angle")


def _could_be(table: TextTable, column: int) -> str:
    """Return the quantity that a column could hold, by its title and its values."""
    title = " ".join(table.titles[column])
    found = [table.number(fields[column]) for _, fields in table.rows if len(fields) > column]
    values = np.array([value for value in found if value is not None and np.isfinite(value)])
    if len(values) < 3:
        return "no numbers"
    if np.ptp(values) == 0.0:
        return "does not change"
    steps = np.diff(values)
    if (steps > 0.0).all():
        even = bool((steps == steps[0]).all()) and float(steps[0]).is_integer()
        return "a counter of readings, or a time" if even or _counts(title) else "a time"
    named = next((quantity for quantity in (FORCE, RATE, ANGLE, DISTANCE, *NEVER) if quantity.names(title)), None)
    if named is not None:
        return "no angle" if named is OTHER else named.name
    if len(np.unique(values)) == 2:
        return "a state"
    if RATE_OF_CHANGE.names(title):
        return "a rate of change"
    most = float(np.abs(values).max())
    size = "an angle in degrees" if most > 2.0 * np.pi else "an angle in radians or degrees"
    return f"{size}, an angular velocity, or a displacement"


def _refuse_axes(table: TextTable, titles: list[str]) -> None:
    """Raise RecordingError if the header names three axes x, y and z, but not the quantity that they belong to."""
    axes = [[i for i, title in enumerate(titles) if form.fullmatch(title)] for form in (_X, _Y, _Z)]
    if all(axes) and not any(quantity.names(title) for title in titles for quantity in (ANGLE, FORCE, RATE)):
        raise RecordingError(f"{table.name}: the axes x, y and z may be an angular velocity or an acceleration, the "
                             f"header does not say; choose by columns='time=1,rate=2' or 'time=1,{FORCED}=2'; "
                             f"{described(table, titles)}")


def _numbered(table: TextTable, titles: list[str], layout: ColumnLayout) -> bool:
    """Return True if the column taken as the time of a track has no title and counts in whole numbers."""
    if not layout.track or layout.time is None or not any(titles) or titles[layout.time]:
        return False
    values = table.values((layout.time,), layout.expected)[0][:, 0]
    return bool(np.all(np.diff(values) == 1.0))


def _circular(table: TextTable, titles: list[str]) -> ColumnLayout | None:
    """Return the columns of a track in a file without titles, whose second and third columns lie on an arc; else None.
    """
    if len(titles) < 3 or any(titles):
        return None
    x, y = table.values((1, 2), "a time, x and y")[0].T
    seen = np.isfinite(x) & np.isfinite(y)
    try:
        circle = fit_circle(x[seen], y[seen])
    except RecordingError:
        return None
    span = float(max(np.ptp(x[seen]), np.ptp(y[seen])))
    if not circle.rms < _ON_CIRCLE * span or not circle.error < 0.1 * circle.radius or span < _SHORT * circle.radius:
        return None
    around = np.degrees(np.arctan2(x[seen] - circle.x, circle.y - y[seen]))
    middle = 0.5 * float(around.max() + around.min())
    if np.ptp(around) > _ARC or not min(abs(middle), 180.0 - abs(middle)) < _TILT:
        return None
    return ColumnLayout(0, (1, 2), [f"columns: an x-y track, as columns 2 and 3 lie on a circle of radius "
                                    f"{circle.radius:.4g} (columns= overrides)"])


def _named(table: TextTable, titles: list[str], timed: bool) -> ColumnLayout:
    """Return the columns of time and angle, or time, x and y, that the header's titles name; else the first two.

    Columns that never hold an angle, such as counters, are passed over. Raises RecordingError if no other is left.
    """
    width = len(titles)
    if width == 1:
        return ColumnLayout(None, (0,), [])
    dead = {i for i in range(width) if _constant(table, i)}
    named = [i for i, title in enumerate(titles) if ANGLE.names(title) and not RATE_OF_CHANGE.names(title)]
    angles = [i for i in named if i not in dead]
    times = [i for i, title in enumerate(titles) if TIME.names(title) and i not in named
             and not RATE_OF_CHANGE.names(title)]
    time = next((i for i in times if i not in dead), 1 if named[:1] == [0] else 0)
    still = [i for i in named if i in dead and i != time]
    notes = [f"columns: {_list(still, titles)} left out, as {'they do' if len(still) > 1 else 'it does'} not change"
             ] if still else []
    track = None if angles else _track(table, titles, timed)
    if track is not None:
        return track._replace(notes=[*notes, *track.notes])
    angle = next((i for i in angles if i != time), None)
    if angle is None:
        others = [i for i in range(width) if i not in (time, *still, *times) and not _never(titles[i])
                  and not _counts(titles[i])]
        others = [i for i in others if i not in dead] or ([] if still else others)
        lengths = [i for i in others if (DISTANCE.names(titles[i]) or _X.search(titles[i]))
                   and not RATE_OF_CHANGE.names(titles[i])]
        if len(lengths) == 1 and not any(_Y.search(titles[i]) for i in others):
            units = DISTANCE.units_in([titles[lengths[0]]])
            if not units and (drives := [title for title in titles if any(one.names(title) for one in DRIVES)]):
                raise RecordingError(f"{table.name}: {drives[0]!r} beside {titles[lengths[0]]!r} is a log of a driven "
                                     "run; lab-pendulum fit reads it, in Python DrivenLog.read")
            unit = units.pop() if len(units) == 1 else "m"
            return ColumnLayout(time, (lengths[0],), [*notes, f"columns: {_list([time, *lengths], titles)}, a "
                                                              f"displacement in {unit}"], DISTANCE.units[unit].size)
        if not others and not still:
            _refuse_others(table, titles, [i for i in range(width) if i != time or PERIOD.names(titles[i])])
            raise RecordingError(f"{table.name}: expected an angle, found none; {described(table, titles)}")
        angle = 1 if 1 in others else [*others, *still][0]
        notes = [] if angle in still else notes
    if timed and _counts(titles[time]):
        return ColumnLayout(None, (angle,), [*notes, f"columns: {_list([angle], titles)}, as the header names them"])
    if (time, angle) == (0, 1):
        return ColumnLayout(0, (1,), [*notes, *([f"columns: the first two of {width} are read"] if width > 2 else [])])
    return ColumnLayout(time, (angle,), [*notes, f"columns: {_list([time, angle], titles)}, as the header names them"])


def _never(title: str) -> bool:
    """Return True if a title names a quantity that is never an angle."""
    return any(quantity.names(title) for quantity in NEVER) and not FORCE.names(title)


def _refuse_others(table: TextTable, titles: list[str], places: Sequence[int]) -> None:
    """Raise RecordingError if titles of columns name nothing but quantities of another kind of file."""
    named = [(titles[i], quantity) for quantity in NEVER[:-1] for i in reversed(places)
             if quantity.names(titles[i]) and not ANGLE.names(titles[i])]
    if named and len({title for title, _ in named}) == len({titles[i] for i in places}):
        title, quantity = named[0]
        raise RecordingError(f"{table.name}: {quantity.refusal(title)}; columns='time=1,angle=2' reads it as an angle")


def _track(table: TextTable, titles: list[str], timed: bool) -> ColumnLayout | None:
    """Return the columns that the header's titles name time, x and y; None if the titles do not.

    An x that increases in every row is no coordinate of a swing but the time of a plot over x. Raises RecordingError
    for a track without times.
    """
    xs, ys = ([i for i, title in enumerate(titles) if form.search(title) and not RATE_OF_CHANGE.names(title)]
              for form in (_X, _Y))
    if len(xs) != 1 or len(ys) != 1 or xs == ys:
        return None
    others = [i for i in range(len(titles)) if i not in (*xs, *ys) and not RATE_OF_CHANGE.names(titles[i])]
    times = [i for i in others if TIME.names(titles[i])] or others
    times = [i for i in times if not (timed and _counts(titles[i]))]
    if not times and _increases(table, xs[0]):
        return None
    if not times and not timed:
        raise RecordingError(f"{table.name}: expected times beside x and y, found none; {COUNT.remedy}")
    places = [*times[:1], *xs, *ys]
    note = f"columns: an x-y track, {_list(places, titles)}, as the header names them"
    return ColumnLayout(times[0] if times else None, (xs[0], ys[0]), [note])


def _first_of_track(table: TextTable, timed: bool) -> ColumnLayout:
    """Return the first three columns as time, x and y of a track; of a file with two columns and a given rate, x and y.
    """
    if table.width >= 3:
        return ColumnLayout(0, (1, 2), [])
    if table.width == 2 and timed:
        return ColumnLayout(None, (0, 1), [])
    raise RecordingError(f"{table.name}: expected three columns, t, x and y (two with rate=), found {table.width}")


def _selected(table: TextTable, titles: list[str], columns: Any, timed: bool) -> ColumnLayout:
    """Return the columns of a recording's file that the caller selects by name, or by number from 1."""
    forced = isinstance(columns, str) and re.search(rf"(?:^|,)\s*{FORCED}\s*=", columns) is not None
    rated = isinstance(columns, str) and re.search(rf"(?:^|,)\s*{RATED}\s*=", columns) is not None
    if isinstance(columns, str) and "=" in columns:
        columns = _by_kind(table, columns)
    given = list(columns) if isinstance(columns, Sequence) and not isinstance(columns, (str, bytes)) else []
    if not 1 <= len(given) <= 3:
        allowed = f"{TRACK!r}, or names or numbers of (time, angle), (time, x, y) or, with rate=, (angle,)"
        raise RecordingError(f"columns must be {allowed}, got {shown(columns)}")
    places = [place_of(table, titles, entry) for entry in given]
    if len(set(places)) < len(places):
        raise RecordingError(f"columns must be different ones, got {shown(columns)}")
    if len(places) == 1 and not timed and table.rate is None:
        raise RecordingError(f"columns must include the time unless rate= is given, got {shown(columns)}")
    if rated:
        units = RATE.units_in([titles[places[1]]])
        return ColumnLayout(places[0], tuple(places[1:]), [], rate=min(units) if len(units) == 1 else "rad")
    if forced:
        return _with_force(titles, places[0], places[1:])
    return ColumnLayout(None, (places[0],), []) if len(places) == 1 else ColumnLayout(places[0], tuple(places[1:]), [])


def _by_kind(table: TextTable, columns: str) -> tuple[str, ...]:
    """Return the columns that a text such as "time=2,angle=5" or "time=1,x=2,y=3" names, in the usual order."""
    parts = {kind.strip(): place.strip() for kind, _, place in (part.partition("=") for part in columns.split(","))}
    choices = ("time", "angle"), ("time", "x", "y"), ("time", RATED), ("time", FORCED), ("angle",), ("x", "y")
    kinds = next((kinds for kinds in choices if set(kinds) == parts.keys()), None)
    if kinds is None:
        raise RecordingError(f"{table.name}: columns={columns!r} must name time and angle, rate, {FORCED} or x and y, "
                             "as in columns='time=2,angle=5'")
    return tuple(parts[kind] for kind in kinds)


def place_of(table: TextTable, titles: list[str], entry: Any, option: str = "") -> int:
    """Return the number, from 0, of a column that is selected by name or by number from 1, which may be text.

    ``option`` names the option that selects it, for messages. Raises RecordingError if there is no such column.
    """
    names = {name.lower(): i for i, title in enumerate(table.titles) for name in (*title, titles[i]) if name}
    if isinstance(entry, str) and entry.strip().lower() in names:
        return names[entry.strip().lower()]
    if isinstance(entry, str) and entry.strip().isdecimal() and len(entry) < 9:
        entry = int(entry)
    if isinstance(entry, int) and not isinstance(entry, bool) and 1 <= entry <= table.width:
        return entry - 1
    chosen = f" for {option}=" if option else ""
    if isinstance(entry, str):
        known = nearest(entry.lower(), names) if names else "; its columns have no names."
        raise RecordingError(f"{table.name}: there is no column {shown(entry)}{chosen}{known}")
    raise RecordingError(f"{table.name}: a column{chosen} is given by its name, or a number from 1 to {table.width}, "
                         f"not {shown(entry)}")


def _constant(table: TextTable, column: int) -> bool:
    """Return True if a column has no two different numbers."""
    texts = {fields[column] for _, fields in table.rows if len(fields) > column}
    return len(texts) <= _ALIKE and len({x for x in map(table.number, texts) if x is None or not np.isnan(x)}) <= 1


def _increases(table: TextTable, column: int) -> bool:
    """Return True if the numbers of a column increase in every row."""
    values: FloatArray = np.array([table.number(fields[column]) if len(fields) > column else np.nan
                                   for _, fields in table.rows], dtype=np.float64)
    return bool((np.diff(values) > 0.0).all())


def _counts(title: str) -> bool:
    """Return True if a column's title says that it holds frame or sample numbers instead of times."""
    return bool(COUNT.names(title)) and not TIME.names(title)


def _list(places: Sequence[int], titles: list[str]) -> str:
    """Return a text that lists columns by number, from 1, and by name if they have one."""
    return ", ".join(f"{i + 1} ({titles[i]})" if titles[i] else f"{i + 1}" for i in places)
