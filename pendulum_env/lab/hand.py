"""Read tables that were written by hand: their titles, units, numbers of oscillations, and errors beside the values."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pendulum_env.lab.checked import FloatArray, RecordingError, file_name
from pendulum_env.lab.containers import text_of
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.quantities import ERROR, Quantity
from pendulum_env.lab.table import NUMBERS, TextTable
from pendulum_env.physics import exact

if TYPE_CHECKING:
    from pendulum_env.common.texts import Table

_COUNT = re.compile(r"(?<![\w.,])(\d{1,4})\s*(?:[*x·]\s*)?(?:t(?![a-z])|periods?|oscillations?|"
                    r"swings?|cycles?|perioden|schwingungen)|(?<![a-z])t[ _]?(\d{2,4})(?!\d)", re.IGNORECASE)
"""Number of oscillations in a title, as in "20 T (s)", "time of 20 oscillations" or "t20"."""
_TRIAL = re.compile(r"(?<=[a-z_ #])[1-9](?![\d.])|trial|run|#", re.IGNORECASE)
"""Number of a trial in a title, as in "t 2 (s)"."""
BENCH = (1e-3, 1e4)
"""Periods of pendulums on a bench [s], and lengths [m]."""
MOST = 1_000_000
"""Largest number of oscillations that are timed together."""
LEAST = 1e-12
"""Least error, as a share of the value."""


class HandTable:
    """A table with one title for each column; a column whose title names an error belongs to the one before it.

    Raises RecordingError for a file that cannot be read or has no titles.
    """

    def __init__(self, path: str | os.PathLike[str], example: str) -> None:
        name = file_name(path)
        self.table = TextTable(name, text_of(name)[0])
        self.source = Path(name).name
        self.titles = [" ".join(title) for title in self.table.titles] if self.table.width > 1 else []
        if not any(self.titles):
            raise RecordingError(f"{name}: the first line must name the columns and their units, as {example!r}")
        self.errors = {i for i, title in enumerate(self.titles) if i and ERROR.names(title)}

    def find(self, *quantities: Quantity | re.Pattern[str], without: Sequence[int | None] = ()) -> int | None:
        """Return the first column, no error and none of ``without``, that the first possible quantity names."""
        for one in quantities:
            for i, title in enumerate(self.titles):
                named = one.names(title) if isinstance(one, Quantity) else one.search(title) is not None
                if named and i not in self.errors and i not in without:
                    return i
        return None

    def need(self, what: str, example: str, *quantities: Quantity | re.Pattern[str],
             without: Sequence[int | None] = ()) -> int:
        """Return the column of a quantity as :meth:`find` does; RecordingError without one."""
        place = self.find(*quantities, without=without)
        if place is None:
            raise RecordingError(f"{self.table.name}: expected a column with {what}, the titles are "
                                 f"{', '.join(map(repr, self.titles))}; name the columns as in {example!r}")
        return place

    def values(self, place: int | None, units: Quantity, usual: str) -> FloatArray | None:
        """Return the numbers of a column in SI units, by the unit in its title or else the ``usual`` one; None without
        a column."""
        if place is None:
            return None
        named = units.units_in([self.titles[place]])
        unit = named.pop() if len(named) == 1 else usual
        return self.table.values((place,), "a number")[0][:, 0] * units.units[unit].size

    def error(self, place: int, units: Quantity, usual: str) -> FloatArray | None:
        """Return the errors beside a column, in the unit of their own title or else of the column's; None if there are
        none."""
        if place + 1 not in self.errors:
            return None
        own = units.units_in([self.titles[place]])
        return self.values(place + 1, units, own.pop() if len(own) == 1 else usual)

    def count(self, place: int) -> int | None:
        """Return the number of oscillations in a column's title, None without one."""
        found = _COUNT.search(self.titles[place])
        return int(found[1] or found[2]) if found else None

    def trials(self, place: int) -> list[int]:
        """Return the columns with the title of a column, which comes first; if it has the number of a trial, as "t1",
        those that differ in this number."""
        def bare(title: str) -> tuple[str, bool]:
            return "".join(_TRIAL.sub("", title.lower()).split()), _TRIAL.search(title) is not None

        return [i for i, title in enumerate(self.titles)
                if i >= place and i not in self.errors and bare(title) == bare(self.titles[place])]

    def rounding(self, place: int, units: Quantity, usual: str) -> float:
        """Return the standard error of rounding the numbers of a column, its last digit over sqrt(12), in SI units."""
        return self.half_a_digit(place, units, usual) / math.sqrt(3.0)

    def half_a_digit(self, place: int, units: Quantity, usual: str) -> float:
        """Return half a unit of the last digit of the numbers in a column, in SI units."""
        named = units.units_in([self.titles[place]])
        texts = [text for one in self.fields(place) if NUMBERS[".,"].fullmatch(text := one.removesuffix("°"))]
        return half_a_digit(texts or ["1"]) * units.units[named.pop() if len(named) == 1 else usual].size

    def fields(self, place: int) -> list[str]:
        """Return the texts of a column."""
        return [fields[place] for _, fields in self.table.rows if len(fields) > place]


def half_a_digit(texts: Sequence[str]) -> float:
    """Return half a unit of the last digit of the numbers in texts, of the one with most decimals: 0.005 for 1.19."""
    def last(text: str) -> float:
        number, _, power = text.strip().lower().replace(",", ".").partition("e")
        return float(power or 0) - len(number.partition(".")[2])  # a power of any length: 1e-99999999999999999999

    return 0.5 * math.pow(10.0, max(-300.0, min(300.0, *map(last, texts))))


def complete(*columns: FloatArray | None) -> list[FloatArray | None]:
    """Return columns without the rows in which one of them has no number; a column that is None stays so."""
    there = [column for column in columns if column is not None]
    keep = np.isfinite(np.column_stack(there)).all(axis=1)
    return [None if column is None else column[keep] for column in columns]


def student_range(one: Measurement, freedom: int) -> tuple[float, float]:
    """Return the interval around a value that contains the truth with 95 %, from its standard error, which is that of
    68 %, and the degrees of freedom."""
    from scipy.special import ndtr, stdtrit

    reach = one.error * float(stdtrit(freedom, 0.975) / stdtrit(freedom, ndtr(1.0)))
    return one.value - reach, one.value + reach


def numbers_of(values: Sequence[tuple[str, Measurement]], freedom: int) -> Table:
    """Return a table for further calculation: quantity, value, standard error, ends of the 95 % interval, unit."""
    from pendulum_env.common.texts import Table

    return Table(("quantity", "value", "error", "low_95", "high_95", "unit"), tuple(
        (name, *(f"{x:.9g}" for x in (one.value, one.error, *student_range(one, freedom))), one.unit)
        for name, one in values))


def check_errors(source: str, error: FloatArray | None, value: FloatArray) -> None:
    """Raise RecordingError unless errors, if there are any, are above 0 and below their values."""
    if error is not None and not ((error > LEAST * value) & (error < value)).all():
        raise RecordingError(f"{source}: errors must be above 0 and below their values")


def check_size(source: str, what: str, values: FloatArray, least: float, most: float, unit: str) -> None:
    """Raise RecordingError unless there are values, all from ``least`` to ``most``; ``what`` names them."""
    if not values.size or not ((values >= least) & (values <= most)).all():
        found = f", got {values[~((values >= least) & (values <= most))][0]:g}" if values.size else ", there are none"
        raise RecordingError(f"{source}: {what} must be from {least:g} to {most:g} {unit}{found}")


def small_periods(
    source: str, times: FloatArray, count: int | None, amplitude: FloatArray | float | None
) -> FloatArray:
    """Return the periods of small swings [s], ``T0 = T/(2 K(sin(A/2))/pi)``, from the times [s] of ``count``
    oscillations (None: one) at the amplitudes A [rad] (None: small).

    Raises RecordingError for times that are not above 0, and amplitudes that are not from 0 to below half a turn.
    """
    if count is not None and count > MOST:
        raise RecordingError(f"{source}: the number of oscillations must be at most {MOST}")
    sizes = np.asarray(0.0 if amplitude is None else amplitude, dtype=np.float64)
    check_size(source, "periods", times / (count or 1), *BENCH, "s")
    if not ((sizes >= 0.0) & (sizes < math.pi)).all():
        raise RecordingError(f"{source}: amplitudes must be from 0 to below 180 degrees")
    return np.asarray(times / (count or 1) / exact.period(sizes, math.tau))
