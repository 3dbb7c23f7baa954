"""Read a sensor's file into times [s] and angles [rad], with notes on everything that was inferred."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import GAP, Drop, FloatArray, RecordingError, count, gaps_of, kept, known, one_number
from pendulum_env.lab.columns import ColumnLayout, is_absolute, layout_of
from pendulum_env.lab.containers import text_of
from pendulum_env.lab.displacement import displacement_angle
from pendulum_env.lab.inertial import Mount, along_axis, felt, integrated, with_sign
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.noise import changes_only, quantum_level
from pendulum_env.lab.plausible import refuse_axes_of_gravity, refuse_other_numbers, without_jumps
from pendulum_env.lab.quantities import (
    ANGLE,
    COUNTS,
    FORCE,
    GYROSCOPE,
    OTHER_ANGLE,
    OTHER_UNIT,
    PER_G,
    RANGES,
    RAW,
    STANDARD,
    TIME,
    TRACK,
    TURNS,
)
from pendulum_env.lab.table import DAY, DECIMALS, SEPARATORS, TextTable
from pendulum_env.lab.tracks import Y_AXES, about_pivot
from pendulum_env.lab.turning import hidden_in
from pendulum_env.physics.angles import SEE
from pendulum_env.physics.units import SceneError, number, shown

UNITS = {name: unit.size for name, unit in ANGLE.units.items()}
TIME_UNITS = {name: unit.size for name, unit in TIME.units.items()}
_PIXELS = re.compile(r"(\d+(?:[.,]\d+)?)\s*(?:px|pixels?)\s*(?:per|/|a)\s*(mm|cm|m)(?:et(?:re|er)s?)?(?![a-z])",
                     re.IGNORECASE)
"""Scale of a track in a header line, such as "480 pixels per metre"."""
_ERROR = re.compile(r"(?:angle )?error\b", re.IGNORECASE)
"""Title of the errors of the angles, in their unit."""
_RANGE = re.compile(r"(?:mpu|icm)[ -]?(?:6050|6500|9250|20948).*?(?<!\d)(250|500|1000|2000)\s*(?:°|deg|dps)",
                    re.IGNORECASE)
"""Range of a gyroscope [deg/s] in a header line, such as "MPU6050 ±250 °/s"."""
_PER_SECOND = re.compile(r"/\s*s|dps", re.IGNORECASE)
"""Unit of an angular velocity in a title, which counts do not have."""
_FASTEST = 100.0
"""No pendulum on a bench turns faster [rad/s]; one of 1 cm that falls over its top reaches 63."""
_NEAR_G = 1.25
"""Counts of an accelerometer are recognised if their mean is that of gravity within this factor."""
BENCH = (0.2, 20.0)
"""Periods of pendulums on a bench [s], of 1 cm to 100 m."""
_BACK, _LEAST = 3, 300  # times that go back so often or less, once in so many readings or more, are dropped
_LATE = 0.05  # largest share of the readings that are dropped as their time goes back
_LOST = 3  # number of successive readings of exactly 0 that show that the sensor lost its signal
_TURN = 360.0
_COARSE = 0.05  # coarser steps are not radians, since no sensor reads in steps of 3 degrees
_ROUNDED = 0.75  # steps of rounded times by which they differ from a straight line at most
COMMAS = "decimal commas need tab or ; between columns"
_SHOWN = 3  # number of gaps that are listed one by one
_WORDS: dict[str, Iterable[str]] = {
    "unit": UNITS, "time_unit": TIME_UNITS, "separator": SEPARATORS, "decimal": DECIMALS, "y_axis": Y_AXES}


class ReadOptions(NamedTuple):
    """Settings of ``Recording.read`` that the caller gave; a setting that is None is inferred from the file."""

    unit: str | None = None
    rate: float | None = None
    scale: float = 1.0
    columns: Any = None
    separator: str | None = None
    decimal: str | None = None
    pivot: Any = None
    y_axis: str | None = None
    time_unit: str | None = None
    part: str | None = None
    run: int | None = None
    sensor: float | None = None
    until: float | None = None
    drop: Drop | None = None
    jumps: bool = True

    def checked(self) -> ReadOptions:
        """Return the settings after a check, with rate and scale as floats; RecordingError for an invalid value.

        The settings for columns and pivot are checked later, where they are used.
        """
        for name, allowed in _WORDS.items():
            if getattr(self, name) is not None:
                known(getattr(self, name), name, allowed)
        if self.separator == self.decimal == ",":
            raise RecordingError("separator and decimal must be different marks, got ',' for both")
        if self.rate is not None and self.time_unit is not None:
            raise RecordingError("rate and time_unit must not both be given: a rate replaces the column of times")
        try:
            rate = None if self.rate is None else number(self.rate, "rate", above=0.0)
        except SceneError:
            problem = f"rate must be a positive number of samples per second, got {shown(self.rate)}"
            raise RecordingError(problem) from None
        try:
            scale = number(self.scale, "scale")
        except SceneError:
            scale = 0.0
        if not scale:
            raise RecordingError(f"scale must be a finite number other than 0, got {shown(self.scale)}")
        sensor = None if self.sensor is None else one_number(self.sensor, "sensor", above=0.0, unit="m")
        if not isinstance(self.jumps, bool):
            raise RecordingError(f"jumps must be True or False, got {shown(self.jumps)}")
        return self._replace(rate=rate, scale=scale, run=count(self.run, "runs", "run"), sensor=sensor)


class FileReadings(NamedTuple):
    """The readings of a file: times [s], angles [rad], notes on what was inferred, and the file's angle unit in rad.

    ``rate``: the angular velocities [rad/s] from which the angles were integrated; ``force``: the specific forces
    [m/s²] from which they were estimated, and ``mount`` that of the accelerometer; None if the file holds angles.
    ``displaced``: True if it holds a displacement; ``radius``: that of a track, [m] if its unit is known; ``error``:
    the standard errors of the angles [rad], if a column beside them has these.
    """

    time: FloatArray
    angle: FloatArray
    notes: list[str]
    unit: float
    rate: FloatArray | None = None
    force: FloatArray | None = None
    mount: Mount | None = None
    displaced: bool = False
    radius: Measurement | None = None
    error: FloatArray | None = None


def read_file(name: str, options: ReadOptions) -> FileReadings:
    """Read the times, angles and notes of a recording from a file, with the settings of ``Recording.read``."""
    options = options.checked()
    text, origin = text_of(name, options.part)
    table = TextTable(name, text, options.separator, options.decimal)
    origin += table.choose_run(options.run) if options.columns is None else []
    layout = layout_of(table, options.columns, options.rate is not None)
    if reason := useless(options, layout, table):
        raise RecordingError(f"{name}: {reason}")
    beside = _errors(table, layout)
    values, marks = table.values((*layout.values, *beside), layout.expected)
    time, timing = _times(table, layout, options.rate, options.time_unit, values)
    notes = [*origin, *table.notes, *marks, *layout.notes, *timing]
    time, values, dropped = _increasing(table, time, values)
    notes += dropped
    keep, left_out = kept(name, time, options.until, options.drop)
    time, values, notes = time[keep], values[keep], notes + left_out
    direct = len(layout.values) == 1 and not (layout.rate or layout.force)
    gaps = hidden_in(time, values[:, 0]) if direct else gaps_of(time)
    notes += _gap_notes(time, gaps)
    if layout.rate:
        return _rates(table, layout, options, time, values, notes)
    if layout.force:
        return _forces(table, layout, options, time, values, notes)
    if options.sensor is not None:
        raise RecordingError(f"{name}: sensor= is the distance of an accelerometer from the pivot; this file has no "
                             "acceleration")
    radius = None
    if layout.track:
        unit = "rad"
        try:
            if len(values) < 4:
                raise RecordingError(f"expected a track of at least 4 points, found {len(values)}")
            angle, pivot_notes, size = about_pivot(values.T, options.pivot, options.y_axis)
        except RecordingError as error:
            raise RecordingError(f"{name}: {error}") from None
        metres, scaled = _unit_of_track(table, layout)
        own = "m" if metres else "units of the track"
        radius = Measurement(size[0] * (metres or 1.0), size[1] * (metres or 1.0), own)
        notes += [*pivot_notes, *scaled]
    elif layout.length and options.unit is None:
        unit = "rad"
        try:
            angle, how = displacement_angle(time, values[:, 0] * layout.length)
        except RecordingError as error:
            raise RecordingError(f"{name}: {error}") from None
        notes.append(how)
    else:
        given = options.unit is not None or options.scale != 1.0
        turn = 0 if given else _counts_in_turn(table, layout, values[:, 0])
        values = values * 360.0 / turn if turn else values
        unit, why = ("deg", f"as the title names an encoder of {turn} counts a turn") if turn else _unit(
            table, layout, values[:, 0], options.unit)
        if options.columns is None and why.startswith("inferred") and len(values):
            _refuse_other_numbers(table, layout, values[:, 0], unit)
        notes.append(f"unit: {unit}, {why}")
        angle = values[:, 0] * UNITS[unit]
    errors = np.abs(values[:, -1] * UNITS[unit] * options.scale) if beside else None
    if not layout.track and not layout.length:
        time, angle, lost = _without_lost(time, angle)
        notes += lost
        gaps = hidden_in(time, angle) if lost else gaps
        errors = None if lost else errors
    angle, turns = _unwrapped(angle, gaps, by_track=layout.track)
    notes += turns
    if direct:
        angle, changed = _at_changes(angle)
        notes += changed
    if not layout.track and options.jumps:
        angle, jumps = without_jumps(time, angle)
        notes += jumps
    if options.scale != 1.0:
        notes.append(f"scale: angle multiplied by {options.scale:g}")
    displaced = bool(layout.length and options.unit is None)
    return FileReadings(time, angle * options.scale, notes, UNITS[unit] * options.scale, displaced=displaced,
                        radius=radius, error=errors)


def _errors(table: TextTable, layout: ColumnLayout) -> tuple[int, ...]:
    """Return the column with the error of each angle, as of a filmed bob, in a tuple; () if there is none."""
    titles = [" ".join(title) for title in table.titles]
    if len(layout.values) != 1 or layout.rate or layout.force or layout.length or not ANGLE.names(
            titles[layout.values[0]]):
        return ()
    return tuple(i for i, title in enumerate(titles) if _ERROR.match(title))[:1]


def useless(options: ReadOptions, layout: ColumnLayout, table: TextTable) -> str:
    """Return why a setting has no use for the columns of a file, "" if each has one."""
    track, clock = layout.track, layout.time is not None and table.is_clock(layout.time)
    reasons = {
        "a pivot is for x-y tracks; columns='xy' reads one": options.pivot is not None and not track,
        "y_axis is for x-y tracks; columns='xy' reads one": options.y_axis is not None and not track,
        "unit is for angles and angular velocities, but x and y of a track are read; columns= names an angle":
            options.unit is not None and track,
        "unit is for angles and angular velocities, but an acceleration is read; columns= names an angle":
            options.unit is not None and bool(layout.force),
        "time_unit is for a column of times, but times of day are read; leave it out":
            options.time_unit is not None and clock,
        "time_unit is for a column of times, but the header gives a rate; rate= replaces it":
            options.time_unit is not None and layout.time is None and table.rate is not None,
        "run and columns both choose columns; leave one of them out":
            options.run is not None and options.columns is not None,
    }
    return next((reason for reason, so in reasons.items() if so), "")


def _unit_of_track(table: TextTable, layout: ColumnLayout) -> tuple[float, list[str]]:
    """Return the unit of a track's coordinates [m], 0 if it is not known, and a list with a note on a scale in pixels.
    """
    units = TRACK.units_in(table.titles[layout.values[0]])
    if len(units) == 1:
        return TRACK.units[units.pop()].size, []
    for line in (*table.header, *table.comments):
        scale = _PIXELS.search(line)
        if scale is not None:
            size = TRACK.units[scale[2].lower()].size / float(scale[1].replace(",", "."))
            return size, [f"scale: {scale[0].strip()}, as the header says"]
    return 0.0, []


def _rates(
    table: TextTable, layout: ColumnLayout, options: ReadOptions, time: FloatArray, values: FloatArray, notes: list[str]
) -> FileReadings:
    """Return the readings of a file that holds angular velocities; RecordingError if they cannot be integrated."""
    unit, size, counted = options.unit or layout.rate, 1.0, list[str]()
    names = [" ".join(table.titles[i]) for i in layout.values]
    if options.unit is None and options.scale == 1.0:
        unit, size, counted = _unit_of_rate(table, layout, values, unit)
    try:
        rate, how = along_axis(values, names)
        if len(names) == 1 and np.min(rate) >= 0.0:
            rate, how = with_sign(rate), f"{how}, an absolute value, which changes its sign where it is nearly 0"
        rate = rate * UNITS[unit] * size * options.scale
        angle = integrated(time, rate)
    except RecordingError as error:
        raise RecordingError(f"{table.name}: {error}") from None
    notes += [*counted, how, "angle: the integral of the angular velocity; a fit compares the angular velocity itself"]
    return FileReadings(time, angle, notes, UNITS[unit] * size * options.scale, rate)


def _unit_of_rate(
    table: TextTable, layout: ColumnLayout, values: FloatArray, unit: str
) -> tuple[str, float, list[str]]:
    """Return the unit of angular velocities, the size of one count in it, and a list with a note on a size not 1.

    Raises RecordingError for readings that are too fast for a pendulum, as counts of a gyroscope are.
    """
    titles = [" ".join(table.titles[i]) for i in layout.values]
    named = next((found for line in (*table.header, *table.comments) if (found := _RANGE.search(line))), None)
    if named and not any(map(_PER_SECOND.search, titles)) and bool((values == np.round(values)).all()):
        count = RANGES[int(named[1])]
        return "deg", 1.0 / count, [f"counts: {count:g} per degree per second, as the header says ±{named[1]}"]
    if float(np.abs(values).max(initial=0.0)) * UNITS[unit] > _FASTEST:
        raise RecordingError(f"{table.name}: readings of {titles[0]!r} reach {float(np.abs(values).max()):g}, too fast "
                             f"for a pendulum in {unit}/s, as {GYROSCOPE.name} is: {GYROSCOPE.remedy}")
    return unit, 1.0, []


def _forces(
    table: TextTable, layout: ColumnLayout, options: ReadOptions, time: FloatArray, values: FloatArray, notes: list[str]
) -> FileReadings:
    """Return the readings of a file that holds accelerations; RecordingError if no angle follows from them."""
    titles = [" ".join(table.titles[i]) for i in layout.values]
    unit = layout.force if layout.force > 0.0 else _unit_of_force(values)
    counts = _counts_per_g(values, unit) if layout.force < 0.0 and options.scale == 1.0 else 0
    if counts:
        unit = STANDARD / counts
        notes.append(f"acceleration: in counts, {counts} per g, as their mean is that of gravity (scale= overrides)")
    elif unit != 1.0:
        notes.append(f"acceleration: in {'mg' if unit < 1.0 else 'g'} of {unit:g} m/s²")
    try:
        found = felt(time, values * unit * options.scale, titles, is_absolute(titles), options.sensor)
    except RecordingError as error:
        raise RecordingError(f"{table.name}: {error}") from None
    where = f"sensor: {options.sensor:g} m from the pivot, as given" if options.sensor else (
        "the distance of the sensor from the pivot is fitted, too (sensor= gives it)")
    notes += [*found.notes, f"angle: estimated from the acceleration; a fit compares the acceleration itself; {where}"]
    return FileReadings(time[:len(found.angle)], found.angle, notes, 1.0, None, found.force, found.mount)


def _unit_of_force(values: FloatArray) -> float:
    """Return the unit [m/s²] of accelerations whose titles name none: g or mg if their mean is about one of them."""
    mean = float(np.linalg.norm(values.mean(axis=0)))
    return next((unit.size for unit in FORCE.units.values() if unit.size != 1.0 and
                 0.5 < mean * unit.size / STANDARD < 2.0), 1.0)


def _counts_per_g(values: FloatArray, unit: float) -> int:
    """Return the power of two that is the mean size of accelerations in whole numbers, the counts per g; 0 if none is,
    or if the mean is that of gravity in the ``unit`` [m/s²]."""
    mean = float(np.linalg.norm(values.mean(axis=0)))
    if not bool((values == np.round(values)).all()) or 1.0 / _NEAR_G < mean * unit / STANDARD < _NEAR_G:
        return 0
    return next((count for count in PER_G if count / _NEAR_G < mean < count * _NEAR_G), 0)


def _times(
    table: TextTable, layout: ColumnLayout, given_rate: float | None, unit: str | None, values: FloatArray
) -> tuple[FloatArray, list[str]]:
    """Return the times [s] of a table's rows, NaN where one is missing, and notes on their unit or rate.

    ``given_rate``: rate [Hz] to use in place of a time column; ``unit``: unit of the time column. If it is None, the
    header names it, or it is the one in which the swing in ``values`` has the period of a pendulum on a bench.
    """
    rate, why = (given_rate, "as given") if given_rate is not None else (table.rate, "as the header says")
    if layout.time is not None and given_rate is None:
        time, _ = table.values((layout.time,), layout.expected)
        if table.is_clock(layout.time):
            time = time[:, 0] - time[0, 0]
            days = np.cumsum(np.diff(time, prepend=time[0]) < -0.5 * DAY)
            return time + DAY * days, ["time: times of day, counted from the first"]
        title = " ".join(table.titles[layout.time])
        named = next((name for name, unit in reversed(list(TIME.units.items())) if unit.form.search(title)), None)
        likely, seconds = ("s", "") if unit or named else _likely_unit(time[:, 0], values)
        guessed = f"as {seconds or 'the header names no unit'} (time_unit= overrides)"
        inferred = "as the header says" if named else guessed
        why = "as given" if unit else inferred
        chosen = unit or named or likely
        notes = [] if chosen == named == "s" and not unit else [f"time: in {chosen}, {why}"]
        return time[:, 0] * TIME_UNITS[chosen], notes
    if rate is None:
        raise RecordingError(f"{table.name}: expected times, or a rate in the header, found neither")
    if layout.time is not None:
        why = "as given, in place of the time column"
    with np.errstate(over="ignore"):
        time = np.arange(len(table.rows)) / rate
    if not np.isfinite(time[-1]):
        raise RecordingError(f"{table.name}: a rate of {rate:g} Hz gives times that are not finite")
    return time, [f"rate: {rate:g} Hz, {why}"]


def _likely_unit(time: FloatArray, values: FloatArray) -> tuple[str, str]:
    """Return the unit of times without a unit in which the readings swing as a pendulum on a bench, and why.

    It is "s" unless the period would then be outside of BENCH and inside of it in just one other unit.
    """
    seen = np.isfinite(time) & np.isfinite(values).all(axis=1)
    if not seen.any():
        return "s", ""
    swing = values[seen][:, int(np.argmax(values[seen].std(axis=0)))]
    swing = swing - 0.5 * (float(swing.max()) + float(swing.min()))
    side = np.sign(swing[np.abs(swing) > 0.25 * float(swing.max())])  # noise near the middle is no swing
    turns = np.count_nonzero(np.diff(side))
    if turns < 4:
        return "s", ""
    period = 2.0 * float(np.ptp(time[seen])) / turns
    fitting = [unit for unit, size in TIME_UNITS.items() if BENCH[0] <= period * size <= BENCH[1]]
    if "s" in fitting or len(fitting) != 1:
        return "s", ""
    return fitting[0], f"a swing would last {period:.4g} s in seconds"


def _increasing(table: TextTable, time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, list[str]]:
    """Remove the rows of a recording that lack a number or repeat a time; return times, values and notes.

    Raises RecordingError if a time is earlier than the one before, or if most rows repeat a time.
    """
    lines = np.array([line for line, _ in table.rows])
    keep = np.isfinite(time) & np.isfinite(values).all(axis=1)
    notes = _dropped(lines[~keep], "without a finite time and angle")
    time, values, lines = time[keep], values[keep], lines[keep]
    back = np.flatnonzero(np.diff(time) < 0)
    if 0 < back.size <= _BACK and len(time) >= _LEAST * back.size:
        late = time <= np.maximum.accumulate(np.concatenate([[-math.inf], time[:-1]]))
        late[back + 1] = True
        if np.count_nonzero(late) > _LATE * len(late):
            raise RecordingError(
                f"{table.name}: line {lines[back[0] + 1]}: expected a time above {time[back[0]]:g} s, found "
                f"{time[back[0] + 1]:g} s, and {np.count_nonzero(late)} of {len(late)} later times are not above it, "
                "either; if the clock began again, leave one part out by until=, or give rate=")
        notes.append(f"dropped: {np.count_nonzero(late)} lines, as the time goes back (the first: line "
                     f"{lines[np.argmax(late)]}); if readings come at a constant rate, give rate=")
        time, values, lines = time[~late], values[~late], lines[~late]
        back = np.flatnonzero(np.diff(time) < 0)
    if back.size:
        at = int(back[0])
        problem = f"expected a time above {time[at]:g} s, found {time[at + 1]:g} s"
        if (np.diff(values[:, 0]) > 0).all():
            problem += " (if the angle is the first column, give columns=(2, 1))"
        raise RecordingError(f"{table.name}: line {lines[at + 1]}: {problem}")
    again = np.flatnonzero(np.diff(time) == 0) + 1
    if 2 * len(again) > len(time):
        problem = f"{len(again)} of {len(time)} repeat one"
        split = table.separator == "," and table.width > 3  # as 0,5,12,3 with commas in both numbers
        problem += f" ({(not split and _steady_rate(time)) or COMMAS})"
        raise RecordingError(f"{table.name}: line {lines[again[0]]}: expected times that increase, {problem}")
    notes += [f"{note}; {steady}" if (steady := _steady_rate(time)) else note
              for note in _dropped(lines[again], "that repeat a time")]
    return np.delete(time, again), np.delete(values, again, axis=0), notes


def _steady_rate(time: FloatArray) -> str:
    """Return a clause on times that are those of a constant rate, rounded to few decimals; "" if they are not."""
    size = float(np.min(np.diff(np.unique(time)), initial=math.inf))
    order = np.arange(float(len(time)))
    if not math.isfinite(size) or not time[-1] > time[0]:
        return ""
    slope, start = np.polyfit(order, time, 1)
    if float(np.abs(time - start - slope * order).max()) > _ROUNDED * size:
        return ""
    rate, error = 1.0 / slope, 3.0 * size / (slope * slope * len(time) ** 1.5)  # three errors of the slope
    short = next((text for text in (f"{rate:.{digits}g}" for digits in range(1, 9)) if abs(float(text) - rate) < error),
                 f"{rate:.8g}")
    return f"they look rounded to {size:.3g} s: if readings come at a constant rate, give rate={float(short):g}"


def _counts_in_turn(table: TextTable, layout: ColumnLayout, values: FloatArray) -> int:
    """Return the counts in a turn of an encoder that a title or a header names, if the readings are such counts.

    The result is 0 for other readings. Raises RecordingError if they may be degrees, too.
    """
    title = " ".join(table.titles[layout.values[0]] if table.width > 1 else [])
    text = " ".join((title, *table.header, *table.comments)).upper()
    turn = next((counts for name, counts in TURNS.items() if name in text), 0)
    whole = bool((values == np.round(values)).all()) and bool(((values >= 0.0) & (values < turn)).all())
    if not whole or table.unit(layout.values[0]) is not None:
        return 0
    sure = RAW.names(title) or any(one in title.upper() for one in TURNS)
    if turn and float(values.max(initial=0.0)) < _TURN and not sure:
        raise RecordingError(f"{table.name}: readings of {title!r} are whole numbers below 360, which may be degrees "
                             f"or counts of the encoder: give unit=deg, or scale=360/{turn} and unit=deg; {SEE}")
    return turn


def _unit(table: TextTable, layout: ColumnLayout, angle: FloatArray, given: str | None) -> tuple[str, str]:
    """Return the unit of a file's angle, "deg" or "rad", and the reason; ``given`` is the caller's unit, or None."""
    if given is not None:
        return given, "as given"
    written = table.unit(layout.values[0])
    if written is not None:
        return written, "as the header says"
    title = " ".join(table.titles[layout.values[0]] if table.width > 1 else table.header)
    for other in (COUNTS, RAW, OTHER_ANGLE, OTHER_UNIT):
        if other.names(title):
            raise RecordingError(f"{table.name}: expected an angle in degrees or radians, the header names {title!r}, "
                                 f"{other.name}; {other.remedy}")
    largest, quantum = float(np.abs(angle).max(initial=0.0)), quantum_level(angle)
    if ANGLE.names(title) and largest > _TURN and float(angle.min()) >= 0.0 and bool((angle == np.round(angle)).all()):
        raise RecordingError(f"{table.name}: readings of {title!r} are whole numbers up to {largest:g}, which may be "
                             f"{RAW.name} or degrees: {RAW.remedy}; for degrees give unit=deg; {SEE}")
    if largest <= 2 * math.pi and quantum > _COARSE:
        return "deg", f"inferred: steps of {quantum:.3g} are too coarse for radians (unit= overrides)"
    unit, side = ("deg", "above") if largest > 2 * math.pi else ("rad", "not above")
    return unit, f"inferred: the largest |angle|, {largest:.4g}, is {side} 2 pi (unit= overrides)"


def _refuse_other_numbers(table: TextTable, layout: ColumnLayout, values: FloatArray, unit: str) -> None:
    """Raise RecordingError if readings that no title calls an angle cannot be one."""
    titles = [" ".join(title) for title in table.titles]
    if not any(titles) and table.width > 3:
        axes = table.values((1, 2, 3), layout.expected)[0]
        refuse_axes_of_gravity(table.name, axes[np.isfinite(axes).all(axis=1)])
    if not ANGLE.names(titles[layout.values[0]]):
        refuse_other_numbers(table.name, values, layout.values[0] + 1, unit)


def _without_lost(time: FloatArray, angle: FloatArray) -> tuple[FloatArray, FloatArray, list[str]]:
    """Return the readings without runs of at least three that are exactly 0, and a note; a sensor that lost its signal.

    At both ends of such a run the angle must jump, by four times the step that 95 % of all readings do not exceed. So
    a bob that is slow near 0, or at rest there, keeps its readings.
    """
    still = np.concatenate([[False], angle == 0.0, [False]])
    edges = np.flatnonzero(np.diff(still.astype(np.int8)))
    lost = np.zeros(len(angle), dtype=np.bool_)
    steps = np.abs(np.diff(angle[angle != 0.0]))
    jump = 4.0 * float(np.quantile(steps, 0.95)) if len(steps) else math.inf
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        beside = [abs(float(angle[i])) for i in (first - 1, end) if 0 <= i < len(angle)]
        if end - first >= _LOST and beside and min(beside) > jump > 0.0:
            lost[first:end] = True
    if not lost.any():
        return time, angle, []
    note = f"lost: {np.count_nonzero(lost)} readings of exactly 0 between others that are far from it, left out"
    return time[~lost], angle[~lost], [note]


def _at_changes(angle: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return the angles at which an encoder that writes a row for each change of its count changed it, and a note.

    They are midway between both counts: the count itself is half a step ahead of the bob in both directions.
    """
    one = np.concatenate([[False], changes_only(angle)])
    if not one.any():
        return angle, []
    midway = np.where(one, 0.5 * (angle + np.concatenate([angle[:1], angle[:-1]])), angle)
    return midway, ["encoder: a row for each change of its count, at which the angle is midway between both counts"]


def _gap_notes(time: FloatArray, gaps: NDArray[np.intp]) -> list[str]:
    """Return a list with a note on the first gaps in the times of a recording, or an empty list if there are no gaps.
    """
    if not len(gaps):
        return []
    first = [f"{time[at + 1] - time[at]:.3g} s after {time[at]:.6g} s" for at in gaps[:_SHOWN]]
    more = f" and {len(gaps) - _SHOWN} more" if len(gaps) > _SHOWN else ""
    return [f"gaps: {len(gaps)} longer than {GAP:g} median steps: {', '.join(first)}{more}"]


def _unwrapped(angle: FloatArray, gaps: NDArray[np.intp], by_track: bool) -> tuple[FloatArray, list[str]]:
    """Return the angle with full turns added where a sensor that reads within one turn jumps, and notes on the jumps.
    """
    jumps = np.flatnonzero(np.abs(np.diff(angle)) > math.pi)
    within = np.setdiff1d(jumps, gaps)
    if not len(jumps):
        return angle, []
    count = f"{len(jumps)} jump{'s' * (len(jumps) > 1)} of more than half a turn"
    if float(np.ptp(angle)) > 2 * math.pi * (1 + 1e-6):
        return angle, [f"not unwrapped: {count}, left as written, as the angle covers more than one turn"]
    if not len(within) and not by_track:
        return angle, [f"not unwrapped: {count}, left as written, as they are only in gaps"]
    notes = [f"unwrapped: {count}"]
    if len(gaps):
        notes.append(f"turns: unknown across {len(gaps)} gap{'s' * (len(gaps) > 1)}, the smallest number is assumed")
    return np.unwrap(angle), notes


def _dropped(lines: NDArray[np.int_], why: str) -> list[str]:
    """Return a list with a note on the dropped lines of a recording's file and the reason, or an empty list."""
    return [f"dropped: {len(lines)} lines {why} (the first: line {lines[0]})"] if len(lines) else []
