"""Parse the text of a recording's file: header, separator, decimal marks and columns of numbers."""

from __future__ import annotations

import csv
import datetime
import math
import re
from itertools import pairwise
from statistics import mode

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError
from pendulum_env.lab.quantities import ANGLE, TIME
from pendulum_env.physics.units import shown

SEPARATORS: dict[str, str] = {"\t": "tab", ";": "semicolon", ",": "comma", " ": "white space"}
DECIMALS: dict[str, str] = {".": "point", ",": "comma"}
_HEADER_LINES = 12
_WORDY = 0.05
"""Lines of text between readings are left out if they are at most this share of all lines."""
_BEGINNINGS = {*"+-.,0123456789\N{MINUS SIGN}"}
"""Characters with which a number begins."""
LABELLED = re.compile(r"\s*([^\W\d_][\w °/()]*?)\s*[:=]\s*([+-]?[\d.]+(?:e[+-]?\d+)?)\s*(?:[,;\t]|$|\s)")
"""A value with its label, as the serial plotter of Arduino prints them."""
_END = 20
"""Largest number of lines at the end of a file that are left out as text after the readings."""
_RUN = re.compile(r"(?<![a-z])(?:run|set|trial|lauf|messung)\s*[#:]?\s*(\d{1,9})(?!\d)", re.IGNORECASE)
"""Number of a run in a column's title."""
_MISSING = {"", "-", "--", "na", "n/a", "nan", "#n/a", "null", "none", "inf", "+inf", "-inf", "missing", "invalid",
            "err", "error", "overflow", "no data"}
NUMBERS = {
    mark: re.compile(rf"[+-]?(\d+[{mark}]?\d*|[{mark}]\d+)(e[+-]?\d+)?", re.IGNORECASE) for mark in (*DECIMALS, ".,")
}
"""Regular expressions of a number, by the decimal marks that are allowed in it."""
_THOUSANDS = r"[1-9]\d{0,2}(?:,\d{3})+(?![\d,])"
_GIVEN = rf"(?<![\d.,])({_THOUSANDS}|\d+(?:[.,]\d*)?(?:e[+-]?\d+)?)(?!\d)"
_OF_SAMPLES = r"(?<!baud)(?<!baud[ _-])rate|sampl\w*[ _-]*freq\w*"
_RATES = tuple(re.compile(form, re.IGNORECASE) for form in (
    rf"(?:{_OF_SAMPLES})\D{{0,20}}{_GIVEN}\s*(k?)hz(?![a-z])",
    rf"{_GIVEN}\s*(k?)hz(?![a-z])",
    rf"{_GIVEN}\s*(k?)(?:samples|sa?|frames)\s*(?:/|per|a)\s*s(?:ec(?:ond)?)?(?![a-z])|{_GIVEN}\s*()fps(?![a-z])",
    rf"(?:{_OF_SAMPLES})\s*(?:[(\[]\s*hz\s*[)\]])?\s*(?:is\s|of\s)?[:=]?\s*{_GIVEN}()(?!\s*[a-zµμ])"))
_RATE_NAME = re.compile(rf"{_OF_SAMPLES}|hz|freq", re.IGNORECASE)
_BETWEEN_TITLES = (r"\s{2,}", r"\s+(?![(\[])")
"""Separators of column titles in files with white space between columns: two spaces or more, or any space that no
bracketed unit follows."""
_CLOCK = re.compile(r"(?:(\d{4}-\d\d-\d\d)[T ])?(\d{1,2}):(\d\d):(\d\d(?:[.,]\d+)?)(?:Z|[+-]\d\d:?\d\d)?")
"""A time of day, with or without a date, as in ISO 8601."""
_EPOCH = datetime.date(2020, 1, 1).toordinal()
"""Day from which the days of dates are counted, near enough that times keep their digits."""
DAY = 86400.0
"""Seconds of a day."""


class TextTable:
    """The text of a recording's file as a table: header and comment lines, rows (line number, fields), separator,
    number of columns.

    ``separator`` and ``decimal`` are the given marks. None as separator: the first of tab, semicolon, comma and white
    space that splits a line into numbers. None as decimal mark: points and commas are both accepted.
    """

    def __init__(self, name: str, text: str, separator: str | None = None, decimal: str | None = None) -> None:
        self.name = name
        self.header: list[str] = []
        self.comments: list[str] = []
        self.rows: list[tuple[int, list[str]]] = []
        self._number_form = NUMBERS[decimal or ".,"]
        self._thousands = False
        self.separator = ""
        self._titles: list[list[str]] | None = None
        text, labelled = _without_labels(text)
        marks: list[str] = [separator] if separator else [mark for mark in SEPARATORS if mark != "," or decimal != ","]
        for number, line in enumerate(text.splitlines(), 1):
            if line.lstrip().startswith("#"):
                self.comments += [] if self.rows else [line.lstrip(" \t#")]
            elif line.strip():
                self.separator = self.separator or self._separator(line, marks)
                if self.separator:
                    self.rows.append((number, split(line, self.separator, trim=False)))
                    continue
                words = re.split(r"[\t;,]|\s+", line.strip())
                if 1 < len(words) <= 3 and NUMBERS[".,"].fullmatch(words[0]):
                    raise self.error(number, "a header or numbers", line)
                self.header.append(line)
                if len(self.header) > _HEADER_LINES:
                    raise self.error(number, f"numbers after at most {_HEADER_LINES} header lines", line)
        if not self.rows:
            raise RecordingError(f"{name}: expected lines with a time [s] and an angle, found no numbers")
        self.width = self._width_with_titles(mode(len(trimmed(fields)) for _, fields in self.rows[1:12] or self.rows))
        cut = self._cut_end()
        between = self._text_between()
        self._thousands = self.separator != "," and self._has_thousands()
        self.pairs = self._pairs_above() if self.width == 1 else []
        count = len(self.header)
        self.notes = [f"header: {count or 'no'} line{'s' * (count != 1)}"]
        self.notes += [f"separator: {SEPARATORS[self.separator]}"] if self.width > 1 else []
        self.notes += [f"end: {cut} lines without all numbers left out after the last reading"] if cut else []
        self.notes += ["labels: taken from each line, as time:12"] if labelled else []
        self.notes += [f"text: {len(between)} lines without numbers left out (first: line {between[0]})"
                       ] if between else []
        self.notes += ["thousands: separated by commas, as there are decimal points"] if self._thousands else []

    def error(self, number: int, expected: str, found: str) -> RecordingError:
        """Return a RecordingError for a faulty line of a file: its number, the expected content and its text."""
        found = found.strip()[:60]
        return RecordingError(f"{self.name}: line {number}: expected {expected}, found {found!r}")

    @property
    def titles(self) -> list[list[str]]:
        """Titles of every column, taken from all header lines with one field per column, or else from a comment line.

        Header lines with the separator of the rows take precedence over those with another separator.
        """
        if self._titles is not None:
            return self._titles
        own = [fields for line in self.header if len(fields := split(line, self.separator)) == self.width > 1]
        lines = own or [fields for fields in map(self._fields_of, self.header) if fields]
        lines = lines or [fields for fields in map(self._fields_of, self.comments) if fields][-1:]
        lines = lines or self._short_titles()
        return [[fields[column] for fields in lines] for column in range(self.width)]

    def choose_run(self, run: int | None) -> list[str]:
        """Keep the columns of one of several runs, numbered in the titles or by repeated titles; return notes.

        Without a given number, the first run is kept. Raises RecordingError for a run that the file does not have.
        """
        titles = [" ".join(title) for title in self.titles] if self.width > 1 else []
        found = [_RUN.search(title) for title in titles]
        numbers = [int(match[1]) if match else None for match in found]
        if titles and not any(found) and len(titles) % 2 == 0 and titles[0]:
            size = next((i for i in range(2, len(titles)) if titles[i] == titles[0]), len(titles))
            if size < len(titles) and titles == titles[:size] * (len(titles) // size):
                numbers = [i // size + 1 for i in range(len(titles))]
        runs = list(dict.fromkeys(number for number in numbers if number is not None))
        if len(runs) < 2:
            if run not in (None, *runs):
                raise RecordingError(f"{self.name}: there is no run {shown(run)}; the file has one run")
            return []
        if run is not None and run not in runs:
            raise RecordingError(f"{self.name}: there is no run {shown(run)}; there are {', '.join(map(str, runs))}")
        chosen = runs[0] if run is None else run
        keep = [i for i, number in enumerate(numbers) if number in (None, chosen)]
        own = [i for i, number in enumerate(numbers) if number == chosen]
        kept = [[fields[i] for i in keep] for fields in ([title[k] for title in self.titles]
                                                         for k in range(len(self.titles[0])))]
        self._titles = [[fields[k] for fields in kept] for k in range(len(keep))]
        rows = [(line, fields + [""] * (self.width - len(fields))) for line, fields in self.rows]
        self.rows = [(line, [fields[i] for i in keep]) for line, fields in rows if any(fields[i] for i in own)]
        self.width = len(keep)
        why = "as given" if run is not None else "the first (run= chooses another)"
        return [f"run: {chosen} of {', '.join(map(str, runs))}, {why}"]

    @property
    def rate(self) -> float | None:
        """Sampling rate [Hz] given in the header, in words or in a line of values below their names; None without one.
        """
        given = [(self.number(value) or 0.0) * (1e3 if "khz" in name.lower() else 1.0)
                 for name, value in self.pairs if _RATE_NAME.search(name)]
        matches = (form.search(line) for form in _RATES for line in [*self.header, *self.comments])
        given += [_rate_of(match) for match in matches if match]
        return next((rate for rate in given if 0 < rate < math.inf), None)

    def unit(self, column: int) -> str | None:
        """Return the unit of a column of angles, "deg" or "rad", from its title, other header lines or comments.

        The first of these places that names exactly one unit decides; None if there is no such place.
        """
        spread = {line for line in self.header if self._fields_of(line)}
        for lines in (self.titles[column], [line for line in self.header if line not in spread], self.comments):
            units = ANGLE.units_in(lines)
            if len(units) == 1:
                return units.pop()
        fields = [fields[column] for _, fields in self.rows[:12] if len(fields) > column]
        return "deg" if fields and all(field.endswith("°") for field in fields) else None

    def values(self, columns: tuple[int, ...], expected: str) -> tuple[FloatArray, list[str]]:
        """Return the numbers in the given columns, NaN where one is missing, and a note if there are decimal commas.

        Raises RecordingError for the first line without numbers in these columns; ``expected`` describes the numbers in
        the message.
        """
        values, last = np.empty((len(self.rows), len(columns))), max(columns)
        commas = 0
        for i, (line, fields) in enumerate(self.rows):
            row = [self.number(fields[column]) for column in columns] if len(fields) > last else [None]
            if None in row or (self.width == 1 and any(fields[1:])):
                raise self.error(line, expected, "  ".join(fields))
            values[i] = row
            commas += "," in "".join(fields)
        points = commas and any("." in "".join(fields) for _, fields in self.rows)
        how = f"commas, and points: commas in {commas} of {len(self.rows)} lines" if points else "commas"
        return values, [f"decimal marks: {how}"] if commas else []

    def number(self, text: str) -> float | None:
        """Return the number in a field, NaN for a mark of a missing value, None for any other text.

        A degree sign may follow it. A time of day is a number of seconds, with those of the days since 2020 if there is
        a date.
        """
        text = text.replace("\N{MINUS SIGN}", "-").removesuffix("°")
        if self._thousands and "," in text:
            text = text.replace(",", "")
        if self._number_form.fullmatch(text):
            return float(text.replace(",", "."))
        moment = _CLOCK.fullmatch(text)
        return math.nan if text.lower() in _MISSING else None if moment is None else _seconds(moment)

    def is_clock(self, column: int) -> bool:
        """Return True if a column holds times of day."""
        fields = self.rows[0][1]
        return len(fields) > column and _CLOCK.fullmatch(fields[column]) is not None

    def _text_between(self) -> list[int]:
        """Remove lines of text between the readings, with no field that begins like a number; return the numbers.

        They stay if there are more than one in twenty (_WORDY), as such a table is no recording, and if one of them is
        the header again, as a second recording may follow it.
        """
        words = [row for row in self.rows if not any(
            field[:1] in _BEGINNINGS or field.lower() in _MISSING for field in row[1])]
        heads = {tuple(split(line, self.separator, trim=False)) for line in self.header}
        if len(words) > _WORDY * len(self.rows) or any(tuple(fields) in heads for _, fields in words):
            return []
        lines = {line for line, _ in words}
        self.rows = [row for row in self.rows if row[0] not in lines]
        return sorted(lines)

    def _short_titles(self) -> list[list[str]]:
        """Return the last header line with a few titles, one of a time, as titles of the first columns; of the last
        ones if only one is missing, the first column numbers the rows, as programs write row names without a title, and
        the second one, which the title of a time would then name, grows.
        """
        lines = [] if self.separator == " " else [split(line, self.separator) for line in self.header]
        short = [fields for fields in lines if 1 < len(fields) < self.width and any(map(TIME.names, fields))]
        if not short:
            return []
        rows, second = ([self._numbered(fields, i) for _, fields in self.rows] for i in range(2))
        missing = [""] * (self.width - len(short[-1]))
        counted = (len(missing) == 1 and rows[0] in (0.0, 1.0) and rows == [rows[0] + i for i in range(len(rows))]
                   and all(late > early for early, late in pairwise(second)))
        return [[*missing, *short[-1]] if counted else [*short[-1], *missing]]

    def _numbered(self, fields: list[str], column: int) -> float:
        """Return the number in a column of a row, NaN for none."""
        number = self.number(fields[column]) if len(fields) > column else None
        return math.nan if number is None else number

    def _width_with_titles(self, width: int) -> int:
        """Return the number of columns by the rows and the titles: ``width`` by the rows, or more if a header line
        with the separator of the rows names more columns and no other line names just ``width``.

        Rows have no number in a column at the end of which a logger exports the title alone. Of free text with commas
        in it, no field names a time.
        """
        lines = [split(line, self.separator) for line in self.header]
        if width == 1 or self.separator == " " or any(len(fields) == width for fields in lines):
            return width
        wider = [len(fields) for fields in lines if len(fields) > width and any(map(TIME.names, fields))]
        return wider[-1] if wider else width

    def _has_thousands(self) -> bool:
        """Return True if all commas separate thousands: there are decimal points, too, and three digits after each."""
        fields = [field for _, row in self.rows for field in row]
        commas = [field for field in fields if "," in field]
        return bool(commas) and any("." in field for field in fields) and all(
            re.fullmatch(rf"[+-]?{_THOUSANDS}(?:\.\d+)?", field) for field in commas)

    def _cut_end(self) -> int:
        """Remove the lines after the last reading: text, and a last line that breaks off; return their number.

        They begin with the first line without all numbers among the last 20 (_END), or the last tenth of a short file.
        """
        def whole(row: tuple[int, list[str]]) -> bool:
            return len(row[1]) >= min(self.width, 2) and None not in map(self.number, row[1])

        least = len(self.rows) - min(_END, max(len(self.rows) // 10, 1))
        keep = next((i for i in range(least, len(self.rows)) if not whole(self.rows[i])), len(self.rows))
        if not keep:
            return 0
        last = self.rows[keep - 1][1]
        keep -= len(last) < self.width and len(self.rows[keep - 2][1]) == self.width
        cut = len(self.rows) - keep
        if 2 * cut > len(self.rows):
            return 0
        del self.rows[keep:]
        return cut

    def _separator(self, line: str, marks: list[str]) -> str:
        """Return the first separator that splits a line into numbers, or "" if the line is not a row of numbers."""
        for mark in marks:
            if mark == " " or mark in line or len(marks) == 1:
                numbers = [self.number(text) for text in split(line, mark)]
                if None not in numbers and any(x is not None and not math.isnan(x) for x in numbers):
                    return mark
        return ""

    def _fields_of(self, line: str) -> list[str] | None:
        """Return the fields of a header line if it has one field for each column of the file, else None."""
        marks = (self.separator, *(mark for mark in SEPARATORS if mark != " "))
        splits = [split(line, mark) for mark in marks]
        splits += [re.split(form, line.strip()) for form in _BETWEEN_TITLES] if self.separator == " " else []
        return next((fields for fields in splits if len(fields) == self.width > 1), None)

    def _pairs_above(self) -> list[tuple[str, str]]:
        """Remove a first row of several values above rows of one value, and return these values with their names.

        Such a row, below a header line of names, is part of the header, with settings such as the rate, and not a
        reading.
        """
        first = trimmed(self.rows[0][1])
        if len(first) == 1:
            return []
        del self.rows[0]
        names = split(self.header[-1], self.separator) if self.header else []
        return list(zip(names, first, strict=True)) if len(names) == len(first) else []


def _without_labels(text: str) -> tuple[str, bool]:
    """Return a text whose lines are values with labels, "time:12,angle:3.5", as a table, and True; others unchanged.
    """
    lines = text.splitlines()
    first = next((line for line in lines if line.strip()), "")
    labels = [match[1] for match in LABELLED.finditer(first)]
    if len(labels) < 2 or LABELLED.sub("", first).strip():
        return text, False
    rows = ["\t".join(match[2] for match in LABELLED.finditer(line)) or line for line in lines]
    return "\n".join(["\t".join(labels), *rows]) + "\n", True


def _seconds(moment: re.Match[str]) -> float | None:
    """Return the seconds of a time of day since midnight, or since 2020 if it has a date; None for no day."""
    date, hours, minutes, seconds = moment.groups()
    try:
        days = datetime.date.fromisoformat(date).toordinal() - _EPOCH if date else 0
    except ValueError:  # such as 2024-13-45
        return None
    return days * DAY + int(hours) * 3600.0 + int(minutes) * 60.0 + float(seconds.replace(",", "."))


def _rate_of(match: re.Match[str]) -> float:
    """Return the rate [Hz] matched in a header; a comma before three digits separates thousands, others are decimal."""
    text, kilo = (part for part in match.groups() if part is not None)
    plain = text.replace(",", "") if re.fullmatch(_THOUSANDS, text) else text.replace(",", ".")
    return float(plain) * (1e3 if kilo else 1.0)


def split(line: str, mark: str, trim: bool = True) -> list[str]:
    """Split a line at a separator and return its fields; ``trim`` removes empty fields at the end, but leaves at least
    two.
    """
    quoted = '"' in line and mark != " " and len(line) < csv.field_size_limit()  # longer fields are an error of csv
    parts = next(csv.reader([line], delimiter=mark)) if quoted else line.split(None if mark == " " else mark)
    fields = [text.strip(' "') for text in parts]
    return trimmed(fields) if trim else fields


def trimmed(fields: list[str]) -> list[str]:
    """Return the fields of a line without the empty ones at its end, but at least the first two of them."""
    count = len(fields)
    while count > 2 and not fields[count - 1]:
        count -= 1
    return fields[:count]
