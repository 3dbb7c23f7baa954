"""The text of a recording as a table: header, separator, columns of numbers."""

from __future__ import annotations

import math
import re
from pathlib import Path
from statistics import mode

import numpy as np

from .checked import FloatArray, RecordingError

_SEPARATORS: dict[str, str | None] = {"tab": "\t", "semicolon": ";", "comma": ",", "white space": None}
_HEADER_LINES = 2
_MISSING = {"", "-", "--", "na", "n/a", "nan", "inf", "+inf", "-inf"}
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?", re.IGNORECASE)
_UNIT = re.compile(r"deg|°|(?<![a-z])rad", re.IGNORECASE)
_RATE = re.compile(r"(\d+\.?\d*)\s*hz|rate\D*(\d+\.?\d*)", re.IGNORECASE)
_RATE_NAME = re.compile(r"rate|hz|freq", re.IGNORECASE)
_MILLISECONDS = re.compile(r"(?<![a-z])ms(?![a-z])|millisec", re.IGNORECASE)
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")


class Table:
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
            with np.errstate(over="ignore"):
                time = np.arange(len(values)) / rate
            if not np.isfinite(time[-1]):
                raise RecordingError(f"{self.name}: a rate of {rate:g} Hz makes times that are not finite")
            return time, values[:, -1], notes
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


def text_of(name: str) -> str:
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
