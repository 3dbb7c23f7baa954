"""From a file of a sensor to times [s] and angles [rad], and what was inferred on the way."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import GAP, FloatArray, RecordingError, gaps_of, known
from pendulum_env.lab.columns import Layout, layout_of
from pendulum_env.lab.noise import quantum_level
from pendulum_env.lab.table import DECIMALS, SEPARATORS, Table, text_of
from pendulum_env.lab.tracks import Y_AXES, track_angle
from pendulum_env.physics.units import SceneError, number, shown

UNITS = {"deg": math.pi / 180, "rad": 1.0}
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
_TIME_WORDS = {unit: re.compile(rf"(?<![a-z])(?:{words})(?![a-z])", re.IGNORECASE) for unit, words in {
    "ms": r"ms|msecs?|milli(?:s|sec\w*)", "us": r"[uµμ]s|usecs?|micro(?:s|sec\w*)",
    "ns": r"ns|nsecs?|nano(?:s|sec\w*)", "min": r"min|minutes?|minuten", "h": r"h|hrs?|hours?|stunden",
    "s": r"s|secs?|seconds?|sekunden"}.items()}
_OTHER_UNIT = re.compile(
    r"(?<![a-z])(?:mrad|milliradians?|gon|rev|revolutions?|turns?|counts?|ticks|pulses|arcmin|arcsec|volts?)(?![a-z])"
    r"|[(\[]\s*(?:m?V|[cm]?m|px|pixels?|N|A|g|%)\s*[)\]]", re.IGNORECASE)
_COARSE = 0.05  # quanta of more are no radians: no sensor reads in steps of 3 degrees
_SHOWN = 3  # gaps that are named one by one
_WORDS: dict[str, Iterable[str]] = {
    "unit": UNITS, "time_unit": TIME_UNITS, "separator": SEPARATORS, "decimal": DECIMALS, "y_axis": Y_AXES}


class Told(NamedTuple):
    """What a file is told to be, in place of what would be inferred; see ``Recording.read``."""

    unit: str | None = None
    rate: float | None = None
    scale: float = 1.0
    columns: Any = None
    separator: str | None = None
    decimal: str | None = None
    pivot: Any = None
    y_axis: str | None = None
    time_unit: str | None = None

    def checked(self) -> Told:
        """RecordingError for a value that cannot be; columns and pivot are checked where they are used."""
        for name, allowed in _WORDS.items():
            if getattr(self, name) is not None:
                known(getattr(self, name), name, allowed)
        if self.separator == self.decimal == ",":
            raise RecordingError("separator and decimal must be different marks, got ',' for both")
        if self.rate is not None and self.time_unit is not None:
            raise RecordingError("rate and time_unit must not both be told: a rate replaces the column of times")
        try:
            rate = None if self.rate is None else number(self.rate, "rate", above=0.0)
        except SceneError:
            said = f"rate must be a positive number of samples a second, got {shown(self.rate)}"
            raise RecordingError(said) from None
        try:
            scale = number(self.scale, "scale")
        except SceneError:
            scale = 0.0
        if not scale:
            raise RecordingError(f"scale must be a finite number other than 0, got {shown(self.scale)}")
        return self._replace(rate=rate, scale=scale)


class Read(NamedTuple):
    """What a file holds: times [s], angles [rad], what was inferred, and rad per unit of the file."""

    time: FloatArray
    angle: FloatArray
    notes: list[str]
    unit: float


def read_file(name: str, told: Told) -> Read:
    """Times, angles and notes of the file, as ``Recording.read`` says."""
    told = told.checked()
    table = Table(name, text_of(name), told.separator, told.decimal)
    layout = layout_of(table, told.columns, told.rate is not None)
    if told.pivot is not None and not layout.track:
        raise RecordingError(f"{name}: a pivot is for x-y tracks; columns='xy' reads one")
    values, marks = table.values(layout.values, layout.expected)
    time, timing = _times(table, layout, told.rate, told.time_unit)
    notes = [*table.notes, *marks, *layout.notes, *timing]
    time, values, dropped = _increasing(table, time, values)
    notes += dropped
    gaps = gaps_of(time)
    notes += _gap_notes(time, gaps)
    if layout.track:
        unit = "rad"
        try:
            angle, said = track_angle(*values.T, pivot=told.pivot, y_axis=told.y_axis)
        except RecordingError as error:
            raise RecordingError(f"{name}: {error}") from None
        notes += said
    else:
        unit, why = _unit(table, layout, values[:, 0], told.unit)
        notes.append(f"unit: {unit}, {why}")
        angle = values[:, 0] * UNITS[unit]
    angle, turns = _unwrapped(angle, gaps, by_track=layout.track)
    notes += turns
    if told.scale != 1.0:
        notes.append(f"scale: angle multiplied by {told.scale:g}")
    return Read(time, angle * told.scale, notes, UNITS[unit] * told.scale)


def _times(
    table: Table, layout: Layout, told: float | None, unit: str | None
) -> tuple[FloatArray, list[str]]:
    """Times [s] of the rows, NaN where one is missing."""
    rate, why = (told, "as told") if told is not None else (table.rate, "as the header says")
    if layout.time is not None and told is None:
        time, _ = table.values((layout.time,), layout.expected)
        title = " ".join(table.titles[layout.time])
        named = next((unit for unit, form in _TIME_WORDS.items() if form.search(title)), None)
        inferred = "as the header says" if named else "for the header names no unit (time_unit= overrides)"
        why = "as told" if unit else inferred
        found = unit or named or "s"
        said = [] if found == named == "s" and not unit else [f"time: in {found}, {why}"]
        return time[:, 0] * TIME_UNITS[found], said
    if rate is None:
        raise RecordingError(f"{table.name}: expected times, or a rate in the header, found neither")
    if layout.time is not None:
        why = "as told, in place of the time column"
    with np.errstate(over="ignore"):
        time = np.arange(len(table.rows)) / rate
    if not np.isfinite(time[-1]):
        raise RecordingError(f"{table.name}: a rate of {rate:g} Hz makes times that are not finite")
    return time, [f"rate: {rate:g} Hz, {why}"]


def _increasing(table: Table, time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, list[str]]:
    """Without the rows that have no number, and those that repeat a time; RecordingError for a time that goes back."""
    lines = np.array([line for line, _ in table.rows])
    keep = np.isfinite(time) & np.isfinite(values).all(axis=1)
    notes = _dropped(lines[~keep], "without a finite time and angle")
    time, values, lines = time[keep], values[keep], lines[keep]
    back = np.flatnonzero(np.diff(time) < 0)
    if back.size:
        at = int(back[0])
        found = f"expected a time above {time[at]:g} s, found {time[at + 1]:g} s"
        if (np.diff(values[:, 0]) > 0).all():
            found += " (does the angle come first? columns=(2, 1) reads that)"
        raise RecordingError(f"{table.name}: line {lines[at + 1]}: {found}")
    again = np.flatnonzero(np.diff(time) == 0) + 1
    if 2 * len(again) > len(time):
        found = f"{len(again)} of {len(time)} repeat one (decimal commas need tab or ; between columns)"
        raise RecordingError(f"{table.name}: line {lines[again[0]]}: expected times that increase, {found}")
    notes += _dropped(lines[again], "that repeat a time")
    return np.delete(time, again), np.delete(values, again, axis=0), notes


def _unit(table: Table, layout: Layout, angle: FloatArray, told: str | None) -> tuple[str, str]:
    """The unit of the angle and how it is known."""
    if told is not None:
        return told, "as told"
    written = table.unit(layout.values[0])
    if written is not None:
        return written, "as the header says"
    title = " ".join(table.titles[layout.values[0]] if table.width > 1 else table.header)
    if _OTHER_UNIT.search(title):
        raise RecordingError(f"{table.name}: expected an angle in degrees or radians, the header names {title!r} "
                             "(unit= overrides, and scale= with it)")
    largest, quantum = float(np.abs(angle).max(initial=0.0)), quantum_level(angle)
    if largest <= 2 * math.pi and quantum > _COARSE:
        return "deg", f"inferred: steps of {quantum:.3g} are too coarse for radians (unit= overrides)"
    unit, side = ("deg", "above") if largest > 2 * math.pi else ("rad", "not above")
    return unit, f"inferred: the largest |angle|, {largest:g}, is {side} 2 pi (unit= overrides)"


def _gap_notes(time: FloatArray, gaps: NDArray[np.intp]) -> list[str]:
    if not len(gaps):
        return []
    first = [f"{time[at + 1] - time[at]:.3g} s after {time[at]:.6g} s" for at in gaps[:_SHOWN]]
    more = f" and {len(gaps) - _SHOWN} more" if len(gaps) > _SHOWN else ""
    return [f"gaps: {len(gaps)} of more than {GAP:g} usual steps: {', '.join(first)}{more}"]


def _unwrapped(angle: FloatArray, gaps: NDArray[np.intp], by_track: bool) -> tuple[FloatArray, list[str]]:
    """The angle without the jumps of a sensor that counts within one turn, and what was done about them."""
    jumps = np.flatnonzero(np.abs(np.diff(angle)) > math.pi)
    within = np.setdiff1d(jumps, gaps)
    if not len(jumps):
        return angle, []
    count = f"{len(jumps)} jump{'s' * (len(jumps) > 1)} of more than half a turn"
    if float(np.ptp(angle)) > 2 * math.pi * (1 + 1e-6):
        return angle, [f"not unwrapped: {count}, left as written, for the angle covers more than one turn"]
    if not len(within) and not by_track:
        return angle, [f"not unwrapped: {count}, left as written: across gaps alone"]
    said = [f"unwrapped: {count}"]
    if len(gaps):
        said.append(f"turns: not known across {len(gaps)} gap{'s' * (len(gaps) > 1)}, the fewest are taken")
    return np.unwrap(angle), said


def _dropped(lines: NDArray[np.int_], why: str) -> list[str]:
    return [f"dropped: {len(lines)} lines {why} (the first: line {lines[0]})"] if len(lines) else []
