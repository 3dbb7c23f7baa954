"""Samples in lines of text, as a microcontroller prints them: numbers between separators, values with labels, or JSON.

A line holds a time and an angle, counts of an encoder, or an angle alone. Titles, separator, decimal mark and the unit
of times are found in the first lines, or given.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from pendulum_env.bench.source import NOTHING, Chunk, Source, SourceError
from pendulum_env.common.texts import clean
from pendulum_env.lab.quantities import ANGLE, COUNTS, RATE_OF_CHANGE, TIME
from pendulum_env.lab.table import DECIMALS, LABELLED, NUMBERS, SEPARATORS, split
from pendulum_env.physics.units import choice, nearest, setting, si

ROWS = 3
"""Number of lines of one form, one after the other, by which the form is found."""
COMPARED = 0.5
"""Time on the host's clock over which the growth of times is compared with it [s]."""
UNDECIDED = 3.0
"""Time on the host's clock after which times that grow in no known unit are refused [s]."""
NEAR = 2.0
"""Largest factor between the growth of times in a unit and the host's clock."""
AHEAD = 5.0
"""Largest step of times beyond that of the host's clock [s]; a larger one must be confirmed by the next line."""
AGREED = 0.5
"""Largest difference, beside a tenth, between the clocks of a device and the host over a gap, if both went on [s]."""
LONGEST = 4096
"""Largest number of bytes of a line; what comes beyond them without a line's end is no text."""
ROLLOVER = 2.0**32
"""Count at which millis() and micros() of a microcontroller begin again at 0."""
MOST_SAID = 10
"""Largest number of a device's comments, lines that begin with #, that become notes."""
MANY = 40
"""Number of lines without any sample after which :attr:`LineReader.problem` says so."""
CLOCKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
"""Units of times, in seconds."""


class Row(NamedTuple):
    """Numbers of one line, with their titles if the line itself has them, and its separator."""

    numbers: tuple[float, ...]
    titles: tuple[str, ...] = ()
    separator: str = ""

    @property
    def form(self) -> tuple[object, ...]:
        """What lines of one form have in common."""
        return len(self.numbers), self.titles, self.separator


class Columns(NamedTuple):
    """Places, from 0, of the columns of time (None: none) and angle, and the factor from its unit to degrees."""

    time: int | None
    angle: int
    degrees: float


class Timed(NamedTuple):
    """A sample as it came: its time in the device's unit, its angle [deg], and the host's time of arrival [s]."""

    time: float
    angle: float
    at: float


@dataclass(frozen=True, repr=False, eq=False)
class LineSource(Source):
    """A source whose samples come in lines of text; put a device's own fields below these."""

    columns_of: str | None = setting(None, "columns by name or by number from 1, as time=1,angle=2 or angle=3",
                                     optional=True, option="columns", note="None: by the titles, else the first two")
    unit: str | None = choice(None, ("deg", "rad"), "unit of angles", note="None: by the titles, else deg")
    counts: float | None = si(None, "1", "counts of an encoder in one turn, if lines have counts in place of angles",
                              above=0.0, optional=True, note="None: lines have angles")
    time_unit: str | None = choice(None, CLOCKS, "unit of times", note="None: by the titles, else by their growth "
                                   "against the computer's clock")
    separator: str | None = choice(None, SEPARATORS, "separator of columns", note="None: the first of tab, ;, comma "
                                   "and space that splits lines into numbers")
    decimal: str | None = choice(None, DECIMALS, "decimal mark", note="None: point or comma")

    def reader(self, *, torn: bool = False) -> LineReader:
        """Return a parser of this source's lines; ``torn``: the first line may lack its beginning."""
        return LineReader(self.columns_of, self.unit, self.counts, self.time_unit, self.separator, self.decimal, torn)


class LineReader:
    """Parser of a stream of bytes whose lines hold samples: :meth:`feed` it what came, again and again.

    ``notes`` has one line for everything that was inferred, and grows. Lines without numbers are passed over; after the
    first sample they count as lost, and so do lines whose time does not fit. A device that begins to count time anew,
    as after a reset, is continued by the host's clock.
    """

    def __init__(self, columns: str | None = None, unit: str | None = None, counts: float | None = None,
                 time_unit: str | None = None, separator: str | None = None, decimal: str | None = None,
                 torn: bool = False) -> None:
        self.notes: list[str] = []
        self._given, self._unit, self._counts, self._decimal = columns, unit, counts, decimal
        if separator == decimal == ",":
            raise SourceError("separator and decimal must be different marks, got ',' for both")
        self._marks = (separator,) if separator else tuple(m for m in SEPARATORS if m != "," or decimal != ",")
        self._time_unit = time_unit
        self._number = NUMBERS[decimal or ".,"]
        self._rest, self._torn = b"", torn
        self._first: list[tuple[Row, float]] = []
        self._heads: list[str] = []
        self._columns: Columns | None = None
        self._form: tuple[object, ...] = ()
        self._size = 0.0 if time_unit is None else CLOCKS[time_unit]
        self._held: list[Timed] = []
        self._base: Timed | None = None
        self._interrupted, self._step = False, 0.0
        self._begun: float | None = None
        self._offset, self._last, self._suspect = 0.0, None, None  # type: float, Timed | None, Timed | None
        self._lines, self._lost = 0, 0

    @property
    def problem(self) -> str:
        """Sentence for a stream without samples so far, "" if there is none."""
        if self._columns is not None or self._lines < MANY:
            return ""
        seen = clean(self._heads[-1])[:60] if self._heads else ""
        return f"{self._lines} lines came without a sample{f', such as {seen!r}' if seen else ''}"

    def broken(self) -> None:
        """Forget the line that has begun, and the beginning of the next one, as after a cable was plugged in again.

        The device may have been without power: its clock has gone on only if it agrees with the host's.
        """
        self._rest, self._torn, self._interrupted = b"", True, True

    def feed(self, data: bytes, at: float) -> Chunk:
        """Return the samples of the lines that end in ``data``, which came at the host's time ``at`` [s].

        Times are the device's [s], or None if lines have none. Raises SourceError for columns that are not there, and
        for times whose unit is not found.
        """
        *lines, self._rest = re.split(rb"\r\n|\n|\r(?=.)", self._rest + data, flags=re.DOTALL)
        if len(self._rest) > LONGEST:
            self._rest, self._torn = b"", True
            self._lines += 1
        found: list[Timed] = []
        for line in lines:
            torn, self._torn = self._torn, False
            found += self._sample(line, at, torn)
        return self._chunk(self._in_seconds(found, at))

    def end(self, at: float) -> Chunk:
        """Return the samples that are left at the end of the stream."""
        rest, self._rest = self._rest, b""
        found = self._sample(rest, at) if rest and not self._torn else []
        if self._columns is None and self._first:
            found = self._begin(at)
        return self._chunk(self._in_seconds(found, at, ended=True))

    def _chunk(self, samples: list[Timed]) -> Chunk:
        """Return samples, whose times are seconds, as a chunk."""
        lost, self._lost = self._lost, 0
        if self._columns is None or not (samples or lost):
            return NOTHING
        values = np.array([[sample.angle] for sample in samples]).reshape(-1, 1)
        time = None if self._columns.time is None else np.array([sample.time for sample in samples])
        return Chunk(values, time, lost)

    def _sample(self, line: bytes, at: float, torn: bool = False) -> list[Timed]:
        """Return the samples that a line gives: mostly one; several once the form is found, none before.

        Numbers of a line that may lack its beginning are passed over; words may be the titles of a board that starts.
        """
        text = line.decode("utf-8", "replace").strip().lstrip("\ufeff\0")
        if not text:
            return []
        self._lines += 1
        row = self._row(text)
        if torn and (row is not None or self._columns is not None):
            return []
        if self._columns is not None:
            if text[0] == "#":
                self._say(text)
            sample = self._timed(row, at) if row is not None and row.form == self._form else None
            self._lost += sample is None and not (_is_text(text) and text.lstrip("# ")[:1].isalpha())  # a message
            return [] if sample is None else [sample]
        if row is None:
            self._first.clear()
            if _is_text(text):
                self._heads = [*self._heads[-11:], text.lstrip("# ")]
            return []
        if self._first and self._first[-1][0].form != row.form:
            self._first.clear()
        self._first.append((row, at))
        return self._begin(at) if len(self._first) >= ROWS else []

    def _say(self, text: str) -> None:
        """Note a comment of the device."""
        said = f"the device says: {clean(text.lstrip('# '))[:100]}"
        if said not in self.notes and sum(note.startswith("the device says") for note in self.notes) < MOST_SAID:
            self.notes.append(said)

    def _timed(self, row: Row, at: float) -> Timed | None:
        """Return the sample in a row; None without a finite number."""
        assert self._columns is not None
        place, angle = self._columns.time, row.numbers[self._columns.angle]
        time = 0.0 if place is None else row.numbers[place]
        return Timed(time, angle * self._columns.degrees, at) if math.isfinite(angle + time) else None

    def _row(self, text: str) -> Row | None:
        """Return the numbers of a line; None for a line of words."""
        if text[0] in "{[":
            return _json_row(text)
        labelled = list(LABELLED.finditer(text))
        if labelled and not LABELLED.sub("", text).strip():
            numbers = tuple(float(match[2]) if NUMBERS["."].fullmatch(match[2]) else math.nan for match in labelled)
            return Row(numbers, tuple(match[1] for match in labelled))
        for mark in self._marks:
            if mark in text or mark == " " or len(self._marks) == 1:
                fields = [field.removesuffix("°").strip() for field in split(text, mark)]
                fields = fields[:-1] if len(fields) > 1 and not fields[-1] else fields
                numbers = tuple(self._value(field) for field in fields)
                if fields and not all(map(math.isnan, numbers)) and all(
                        not math.isnan(number) or field.lower() in ("nan", "inf", "-inf", "") for number, field in
                        zip(numbers, fields, strict=True)):
                    return Row(numbers, (), mark if len(fields) > 1 else "")
        return None

    def _value(self, field: str) -> float:
        """Return the number in a field, NaN for other text."""
        field = field.replace("\N{MINUS SIGN}", "-")
        return float(field.replace(",", ".")) if self._number.fullmatch(field) else math.nan

    def _begin(self, at: float) -> list[Timed]:
        """Find the columns by the first rows; return the samples of these."""
        rows = [row for row, _ in self._first]
        titles = rows[0].titles or self._titles(rows[0])
        self._columns = self._chosen(titles, rows)
        self._form = rows[0].form
        place = self._columns.time
        mark = SEPARATORS.get(rows[0].separator)
        self.notes += [f"separator: {mark}"] if mark else []
        shown = [f"{i + 1}{f' ({titles[i]})' if titles else ''}" for i in (place, self._columns.angle) if i is not None]
        self.notes.append(f"columns: {', '.join(shown)}" + ("" if place is not None else "; time: the computer's"))
        if place is not None and titles and not self._size:
            named = [unit for unit in CLOCKS if TIME.units[unit].form.search(titles[place])]
            self._size = CLOCKS[named[-1]] if named else 0.0
            self.notes += [f"time: in {named[-1]}, as the titles say"] if named and named[-1] != "s" else []
        samples = (self._timed(row, came) for row, came in self._first)
        self._first = []
        return [sample for sample in samples if sample is not None]

    def _titles(self, row: Row) -> tuple[str, ...]:
        """Return the titles of columns: the last line of words with one for each, one of which names a time or angle.
        """
        for head in reversed(self._heads):
            for mark in (row.separator or "\t", *SEPARATORS):
                fields = tuple(field.strip() for field in split(head, mark))
                if len(fields) == len(row.numbers) and any(
                        kind.names(field) for field in fields for kind in (TIME, ANGLE, COUNTS)):
                    return fields
        return ()

    def _chosen(self, titles: Sequence[str], rows: Sequence[Row]) -> Columns:
        """Return the columns to read; SourceError if they are not there or unclear."""
        width = len(rows[0].numbers)
        have = f"lines have {width} columns{f', {chr(34)}' + clean(', '.join(titles)) + chr(34) if titles else ''}"
        if self._given is not None:
            time, angle = self._by_name(titles, width)
        elif width == 1:
            time, angle = None, 0
        elif titles:
            angles = [i for i, title in enumerate(titles) if ANGLE.names(title) and not RATE_OF_CHANGE.names(title)]
            angles += [i for i, title in enumerate(titles) if COUNTS.names(title)]
            if not angles:
                raise SourceError(f"{have}, none of them an angle; choose by --columns time=1,angle=2")
            times = [i for i, title in enumerate(titles) if TIME.names(title) and i not in angles
                     and not RATE_OF_CHANGE.names(title)]
            time, angle = times[0] if times else None, angles[0]
        else:
            grows = all(early.numbers[0] < late.numbers[0] for early, late in pairwise(rows))
            if not grows:
                raise SourceError(f"{have}, and the first does not grow as a time does; choose by "
                                  "--columns time=2,angle=1, or --columns angle=1")
            time, angle = 0, 1
        return Columns(time, angle, self._degrees(titles[angle] if titles else ""))

    def _by_name(self, titles: Sequence[str], width: int) -> tuple[int | None, int]:
        """Return the columns that ``columns`` names, as in "time=1,angle=2"."""
        pairs = [part.partition("=") for part in str(self._given).split(",")]
        parts = {kind.strip().lower(): place.strip() for kind, _, place in pairs}
        if set(parts) not in ({"time", "angle"}, {"angle"}) or len(pairs) != len(parts):
            raise SourceError(f"columns are chosen as time=1,angle=2 or angle=2, by number or name, not "
                              f"{clean(str(self._given))!r}")
        known = {title.lower(): i for i, title in enumerate(titles)} | {str(i + 1): i for i in range(width)}
        for place in parts.values():
            if place.lower() not in known:
                raise SourceError(f"There is no column {clean(place)!r}{nearest(place, known)}")
        time = known[parts["time"].lower()] if "time" in parts else None
        if time == known[parts["angle"].lower()]:
            raise SourceError("time and angle must be different columns")
        return time, known[parts["angle"].lower()]

    def _degrees(self, title: str) -> float:
        """Return the factor from the unit of a column to degrees."""
        units = ANGLE.units_in([title])
        if self._counts is not None:
            self.notes.append(f"unit: counts, {self._counts:g} in a turn, as given")
            return 360.0 / self._counts
        if COUNTS.names(title) and self._unit is None and not units:
            raise SourceError(f"{clean(title)!r} is a count of an encoder; give the counts in one turn, as "
                              "--counts 2400, four times the pulses of a quadrature encoder")
        why = "as given" if self._unit else "as the titles say" if len(units) == 1 else (
            "as nothing says otherwise (--unit rad, or --counts for an encoder's counts)")
        unit = self._unit or (units.pop() if len(units) == 1 else "deg")
        self.notes.append(f"unit: {unit}, {why}")
        return 1.0 if unit == "deg" else math.degrees(1.0)

    def _in_seconds(self, found: list[Timed], at: float, ended: bool = False) -> list[Timed]:
        """Return samples with times in seconds on one increasing clock; they are held until the unit is known."""
        if self._columns is None or self._columns.time is None:
            return found
        if not self._size:
            self._held += found
            self._decide(at, ended)
            if not self._size:
                return []
            found, self._held = self._held, []
        return [sample for one in found for sample in self._in_order(one)]

    def _missing(self, gap: float) -> int:
        """Return the number of samples that a gap [s] between two of them has lost."""
        return max(round(gap / self._step) - 1, 0) if self._step else 0

    def _decide(self, at: float, ended: bool) -> None:
        """Find the unit of times by their growth while the host's clock advances.

        What came at first may have waited in a buffer, so that the growth counts from the last of it.
        """
        if not self._held:
            return
        last = self._held[-1]
        self._begun = at if self._begun is None else self._begun
        if self._base is None:
            self._base = last
        passed = last.at - self._base.at
        if passed >= COMPARED:
            growth = (last.time - self._base.time) / passed
            for unit, size in CLOCKS.items():
                if 1.0 / NEAR <= growth * size <= NEAR:
                    self._size = size
                    self.notes.append(f"time: in {unit}, as it grows by {growth:.3g} a second (--time-unit overrides)")
                    return
            if at - self._begun > UNDECIDED:
                raise SourceError(f"times grow by {growth:.4g} a second, which is neither s, ms nor us; give "
                                  "--time-unit, or --columns angle=2 for lines without a time")
            self._base = last
        if ended:
            times = np.array([sample.time for sample in self._held])
            step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
            whole = bool(np.all(times == np.round(times))) and step >= 1.0
            unit = "us" if whole and step >= 1000.0 else "ms" if whole else "s"
            self._size = CLOCKS[unit]
            self.notes.append(f"time: in {unit}, by steps of {step:g}, as all came at once (--time-unit overrides)")

    def _in_order(self, sample: Timed) -> list[Timed]:
        """Return a sample on the clock of those before it; the next one decides on a sample that does not fit."""
        raw = sample.time
        time = raw * self._size + self._offset
        if self._last is not None and time < self._last.time and raw == round(raw) and self._size < 1.0:
            turn = ROLLOVER * self._size
            if 0.0 < time + turn - self._last.time <= sample.at - self._last.at + AHEAD:
                self._offset += turn
                time += turn
                self.notes.append(f"clock: the device's count of {'ms' if self._size == 1e-3 else 'us'} began again "
                                  "at 2^32, continued")
        now = Timed(time, sample.angle, sample.at)
        if self._last is None or _follows(self._last, now, self._interrupted):
            self._lost += self._suspect is not None  # a garbled time, as the clock goes on without it
            gap = 0.0 if self._last is None else now.time - self._last.time
            if self._interrupted:
                self._lost += self._missing(gap)
            elif gap:
                self._step = gap
            self._last, self._suspect, self._interrupted = now, None, False
            return [now]
        before, self._suspect = self._suspect, now if now.time != self._last.time else None
        self._lost += before is not None or self._suspect is None
        if before is None or not _follows(before, now):
            return []
        self._lost -= 1
        shift = 0.0
        if before.time < self._last.time or self._interrupted:
            shift = self._last.time + max(before.at - self._last.at, now.time - before.time) - before.time
            anew = ", and counts from where the bob was then" if self._counts is not None else ""
            self.notes.append(f"clock: the device began again at {self._last.time:.3f} s{anew}; continued by the "
                              "computer's clock")
        else:
            self.notes.append(f"gap: {before.time - self._last.time:.3g} s without samples after "
                              f"{self._last.time:.3f} s")
        if self._interrupted:
            self._lost += self._missing(before.time + shift - self._last.time)
        self._step, self._interrupted = now.time - before.time, False
        self._offset += shift
        both = [Timed(one.time + shift, one.angle, one.at) for one in (before, now)]
        self._last, self._suspect = both[-1], None
        return both


def _follows(early: Timed, late: Timed, interrupted: bool = False) -> bool:
    """Return True if one sample can be the next after another, by the device's clock and the host's."""
    step, passed = late.time - early.time, late.at - early.at
    return 0.0 < step <= passed + AHEAD and not (interrupted and abs(step - passed) > AGREED + 0.1 * passed)


def _is_text(line: str) -> bool:
    """Return True for a line without control characters."""
    return line.replace("\t", " ").isprintable()


def _json_row(text: str) -> Row | None:
    """Return the numbers of a JSON object or list of numbers; None for another text."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    titles: tuple[str, ...] = ()
    if isinstance(value, dict):
        value = {name: number for name, number in value.items() if _is_number(number)}
        titles, value = tuple(value), list(value.values())
    if not value or not isinstance(value, list) or not all(map(_is_number, value)):
        return None
    try:
        return Row(tuple(map(float, value)), titles)
    except OverflowError:
        return None


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
