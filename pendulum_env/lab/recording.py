"""Recordings of a real pendulum: files read into time [s] and angle [rad], and everything inferred said."""

from __future__ import annotations

import difflib
import math
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mode

import numpy as np
from numpy.typing import NDArray

from .measures import FloatArray, TurningPoints, equilibrium, extremes, noise_level, turning_points

UNITS = {"deg": math.pi / 180, "rad": 1.0}
_SEPARATORS: dict[str, str | None] = {"tab": "\t", "semicolon": ";", "comma": ",", "white space": None}
_HEADER_LINES = 2
_MISSING = {"", "-", "--", "na", "n/a", "nan", "inf", "+inf", "-inf"}
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?", re.IGNORECASE)
_UNIT = re.compile(r"deg|°|(?<![a-z])rad", re.IGNORECASE)
_RATE = re.compile(r"(\d+\.?\d*)\s*hz|rate\D*(\d+\.?\d*)", re.IGNORECASE)
_RATE_NAME = re.compile(r"rate|hz|freq", re.IGNORECASE)
_MILLISECONDS = re.compile(r"(?<![a-z])ms(?![a-z])|millisec", re.IGNORECASE)
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")


class RecordingError(ValueError):
    """A recording that can't be read or used: where, what was expected and what was found."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded swing: ``time`` [s], strictly increasing, and ``angle`` [rad], unwrapped, from the
    equilibrium or wherever the sensor was zeroed; ``source`` names where it came from, ``notes`` say each
    thing that was inferred.

    Raises RecordingError for arrays of different shapes, fewer than 3 points, values that are not finite, or
    times that do not increase.
    """

    time: FloatArray
    angle: FloatArray
    source: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("time", "angle"):
            values = np.array(getattr(self, name), dtype=np.float64)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        if self.time.ndim != 1 or self.time.shape != self.angle.shape:
            found = f"found shapes {self.time.shape} and {self.angle.shape}"
            raise RecordingError(f"{self.source}: expected time and angle of one length, {found}")
        if len(self.time) < 3:
            raise RecordingError(f"{self.source}: expected at least 3 points, found {len(self.time)}")
        if not (np.isfinite(self.time).all() and np.isfinite(self.angle).all()):
            raise RecordingError(f"{self.source}: expected finite times and angles, found NaN or inf")
        if not (np.diff(self.time) > 0).all():
            raise RecordingError(f"{self.source}: expected times that increase")

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        unit: str | None = None,
        rate: float | None = None,
        scale: float = 1.0,
    ) -> Recording:
        """Read a text file: columns time [s] and angle (further ones are ignored), or one angle a line.

        Columns are separated by tab, semicolon, comma or white space; decimal commas, CRLF, a byte-order mark
        and lines starting with # are accepted, and up to two header lines. A file with one column takes its
        rate from ``rate`` [Hz] or its header ("100 Hz", or a line of names, one with "rate" in it, above a
        line of values). ``unit`` is "deg" or "rad"; None: as the header says, otherwise degrees if any
        |angle| > 2 pi, radians if none. ``rate`` also replaces a time column; ``scale`` multiplies the angle.
        Rows with NaN and repeated times are dropped.

        Raises RecordingError, with the line number where one line is at fault.
        """
        _check_options(unit, rate, scale)
        name = os.fspath(path)
        table = _Table(name, _text(name))
        time, angle, notes = table.columns(rate)
        lines = np.array([number for number, _ in table.rows])
        keep = np.isfinite(time) & np.isfinite(angle)
        notes += _dropped(lines[~keep], "without a finite time and angle")
        time, angle, lines = time[keep], angle[keep], lines[keep]
        back = np.flatnonzero(np.diff(time) < 0)
        if back.size:
            at = int(back[0])
            found = f"expected a time above {time[at]:g} s, found {time[at + 1]:g} s"
            raise RecordingError(f"{name}: line {lines[at + 1]}: {found}")
        again = np.flatnonzero(np.diff(time) == 0) + 1
        if 2 * len(again) > len(time):
            found = f"{len(again)} of {len(time)} repeat one (decimal commas need tab or ; between columns)"
            raise RecordingError(f"{name}: line {lines[again[0]]}: expected times that increase, {found}")
        notes += _dropped(lines[again], "that repeat a time")
        time, angle = np.delete(time, again), np.delete(angle, again)
        chosen, why = (unit, "as told") if unit is not None else table.unit(angle)
        notes.append(f"unit: {chosen}, {why}")
        notes += [f"scale: angle multiplied by {scale:g}"] if scale != 1.0 else []
        angle = angle * UNITS[chosen]
        unwrapped = np.unwrap(angle)
        jumps = np.count_nonzero(np.abs(np.diff(angle)) > math.pi)
        notes += [f"unwrapped: {jumps} jumps of more than half a turn"] if jumps else []
        return cls(time, (unwrapped if jumps else angle) * scale, Path(name).name, tuple(notes))

    def released(self) -> Recording:
        """The free swing alone: cut before the release, time zero at the turning point where it starts.

        That is the turning point before the first half swing of at least 0.9 times the largest (being pulled
        aside is half as long). A free swing takes as long down as up: where it takes over 1.1 times as long
        down, the hand still held the bob and the turning point after it is taken. A recording that starts
        there is returned as it is.

        Raises RecordingError if there is no half swing.
        """
        start = self._free()
        if start is None:
            raise RecordingError(f"{self.source}: expected a swing that turns back, found none above noise")
        step = float(np.median(np.diff(self.time)))
        if start == 0 and 0 <= self.time[0] < step:
            return self
        zero = float(turning_points(self).time[start - 1] if start else self.time[0])
        keep = self.time >= zero
        cut = f"release: time zero at {zero:g} s, {np.count_nonzero(~keep)} earlier points cut off"
        return replace(self, time=self.time[keep] - zero, angle=self.angle[keep], notes=(*self.notes, cut))

    def centred(self) -> Recording:
        """The angle about its equilibrium: the middle of the free swing's successive turning points
        (``measures.equilibrium``), or, below three of them, the resting value (median of the last tenth, if
        still).

        Raises RecordingError if there is neither.
        """
        start = self._free() or 0
        points = turning_points(self)
        points = TurningPoints(points.time[start:], points.angle[start:], points.error[start:])
        tail = self.angle[-max(3, len(self.angle) // 10) :]
        if len(points.angle) >= 3:
            offset, how = equilibrium(points), f"middle of {len(points.angle)} turning points"
        elif np.ptp(tail) <= 10 * noise_level(self.time, self.angle):
            offset, how = float(np.median(tail)), "resting value"
        else:
            found = f"found {len(points.angle)} and no rest at the end"
            raise RecordingError(f"{self.source}: expected 3 turning points of a free swing, {found}")
        if abs(offset) < 1e-9:
            return self
        said = f"equilibrium: {offset:.6g} rad subtracted ({how})"
        return replace(self, angle=self.angle - offset, notes=(*self.notes, said))

    def _free(self) -> int | None:
        """Number of the extreme (``measures.extremes``) where the free swing starts; None without one."""
        index = extremes(self.time, self.angle)
        size = np.abs(np.diff(self.angle[index]))
        if not len(size):
            return None
        first = int(np.argmax(size >= 0.9 * size.max()))
        turns = np.concatenate([self.time[index[:1]], turning_points(self).time])[first : first + 2]
        half = slice(index[first], index[first + 1] + 1)
        time, angle = self.time[half], self.angle[half] - self.angle[index[first : first + 2]].mean()
        middle = int(np.argmax(angle * angle[-1] > 0))
        across = slice(middle - 1, middle + 1)
        middle_time = time[across] @ np.abs(angle[across][::-1]) / np.abs(angle[across]).sum()
        return first + int(middle_time - turns[0] > 1.1 * (turns[1] - middle_time))


class _Table:
    """The text of a recording: header lines, rows (line number, fields), separator, number of columns."""

    def __init__(self, name: str, text: str) -> None:
        self.name = name
        self.header: list[str] = []
        self.rows: list[tuple[int, list[str]]] = []
        self.separator = ""
        titles = 0
        for number, line in enumerate(text.splitlines(), 1):
            if line.lstrip().startswith("#"):
                self.header += [] if self.rows else [line.lstrip(" \t#")]
            elif line.strip():
                self.separator = self.separator or _separator(line)
                if self.separator:
                    self.rows.append((number, _fields(line, self.separator)))
                    continue
                words = re.split(r"[\t;,]|\s+", line.strip())
                if 1 < len(words) <= 3 and _NUMBER.fullmatch(words[0]):
                    raise self.error(number, "a header or numbers", line)
                self.header.append(line)
                titles += 1
                if titles > _HEADER_LINES:
                    raise self.error(number, f"numbers after at most {_HEADER_LINES} header lines", line)
        if not self.rows:
            raise RecordingError(f"{name}: expected lines with a time [s] and an angle, found no numbers")
        self.width = mode(len(fields) for _, fields in self.rows[1:12] or self.rows)
        self.notes = [f"header: {titles or 'no'} line{'s' * (titles != 1)}"]
        self.notes += [f"separator: {self.separator}"] if self.width > 1 else []

    def error(self, number: int, expected: str, found: str) -> RecordingError:
        """One line at fault: where, what was expected, what stood there."""
        found = found.strip()[:60]
        return RecordingError(f"{self.name}: line {number}: expected {expected}, found {found!r}")

    def columns(self, rate: float | None) -> tuple[FloatArray, FloatArray, list[str]]:
        """Time [s] and angle as the file has it, NaN where a value is missing, and what was inferred."""
        notes = list(self.notes)
        single = self.width == 1
        if single:
            written = self._header_rate()
            rate, said = (rate, "as told") if rate is not None else (written, "as the header says")
            if rate is None:
                raise RecordingError(f"{self.name}: expected times, or a rate in the header, found neither")
        values = self._values("one angle" if single else "a time and an angle", 1 if single else 2)
        if self.width > 2:
            notes.append(f"columns: the first two of {self.width} are read")
        if rate is not None:
            notes.append(f"rate: {rate:g} Hz, {said if single else 'as told, in place of the time column'}")
            return np.arange(len(values)) / rate, values[:, -1], notes
        factor = 1e-3 if any(_MILLISECONDS.search(title) for title in self._titles(0)) else 1.0
        notes += ["time: in milliseconds, as the header says"] if factor != 1.0 else []
        return values[:, 0] * factor, values[:, 1], notes

    def unit(self, angle: FloatArray) -> tuple[str, str]:
        """The unit of the angle and how it is known."""
        for title in self._titles(1):
            found = _UNIT.search(title)
            if found:
                return ("rad" if found.group().lower() == "rad" else "deg"), "as the header says"
        largest = float(np.abs(angle).max(initial=0.0))
        unit, side = ("deg", "above") if largest > 2 * math.pi else ("rad", "not above")
        return unit, f"inferred: the largest |angle|, {largest:g}, is {side} 2 pi (unit= overrides)"

    def _titles(self, column: int) -> list[str]:
        """What the header lines say of one column: its field, or the whole line where it can't be split."""
        if self.width == 1 or self.separator == "white space":
            return self.header
        split = [(line, _fields(line, self.separator)) for line in self.header]
        return [fields[column] if len(fields) > 1 else line for line, fields in split]

    def _header_rate(self) -> float | None:
        """The rate [Hz] that the header gives; a line of values under its names is taken off the rows."""
        given = [float(a or b) for a, b in (m.groups() for m in map(_RATE.search, self.header) if m)]
        first = self.rows[0][1]
        if len(first) > 1:
            del self.rows[0]
            names = _fields(self.header[-1], self.separator) if self.header else []
            if len(names) == len(first):
                pairs = zip(names, first, strict=True)
                given += [_number(value) or 0.0 for name, value in pairs if _RATE_NAME.search(name)]
        return next((rate for rate in given if 0 < rate < math.inf), None)

    def _values(self, expected: str, count: int) -> FloatArray:
        values = np.empty((len(self.rows), count))
        for i, (number, fields) in enumerate(self.rows):
            row = [_number(text) for text in fields[:count]]
            if len(row) < count or None in row or (count == 1 and any(fields[1:])):
                raise self.error(number, expected, "  ".join(fields))
            values[i] = row
        return values


def _fields(line: str, separator: str) -> list[str]:
    """Fields of a line; empty ones at its end count up to the second column only."""
    fields = [text.strip(' "') for text in line.split(_SEPARATORS[separator])]
    while len(fields) > 2 and not fields[-1]:
        fields.pop()
    return fields


def _number(text: str) -> float | None:
    """The number in a field, NaN for a missing one, None for anything else."""
    text = text.replace("\N{MINUS SIGN}", "-")
    if _NUMBER.fullmatch(text):
        return float(text.replace(",", "."))
    return math.nan if text.lower() in _MISSING else None


def _separator(line: str) -> str:
    """The first separator that splits the line into numbers; none if it holds anything else."""
    for name, mark in _SEPARATORS.items():
        numbers = [_number(text) for text in _fields(line, name)] if mark is None or mark in line else [None]
        if None not in numbers and any(x is not None and not math.isnan(x) for x in numbers):
            return name
    return ""


def _dropped(lines: NDArray[np.int_], why: str) -> list[str]:
    return [f"dropped: {len(lines)} lines {why} (the first: line {lines[0]})"] if len(lines) else []


def _text(name: str) -> str:
    """The file's text: UTF-8 or UTF-16 by its mark, otherwise Latin-1 (older sensor software)."""
    try:
        data = Path(name).read_bytes()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise RecordingError(f"{name}: expected a text file that can be read: {reason}") from error
    try:
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if not text.strip():
        raise RecordingError(f"{name}: expected lines with a time [s] and an angle, the file is empty")
    if _CONTROL.search(text):
        raise RecordingError(f"{name}: expected a text file, found binary data")
    return text


def _check_options(unit: str | None, rate: float | None, scale: float) -> None:
    if unit is not None and unit not in UNITS:
        near = difflib.get_close_matches(str(unit), UNITS, 1, 0.3)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        raise RecordingError(f"unit must be 'deg' or 'rad', got {unit!r}{hint}")
    if rate is not None and not 0 < rate < math.inf:
        raise RecordingError(f"rate must be a positive number of samples a second, got {rate!r}")
    if not (math.isfinite(scale) and scale != 0):
        raise RecordingError(f"scale must be a finite number other than 0, got {scale!r}")
