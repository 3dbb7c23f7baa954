"""Periods of pendulums of several lengths: gravity from the line of T² against the length, with its offset."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from pendulum_env.common.results import Plotted, one_line
from pendulum_env.lab.checked import FloatArray, RecordingError, count, numbers, one_number
from pendulum_env.lab.hand import (
    BENCH,
    HandTable,
    check_errors,
    check_size,
    complete,
    numbers_of,
    small_periods,
    student_range,
)
from pendulum_env.lab.measures import UNLIKELY, FromFile, Line, Measurement, line_through, scaled, scatter_factor
from pendulum_env.lab.quantities import AMPLITUDE, ANGLE, LENGTH, PERIOD, TIME
from pendulum_env.physics.units import shown

if TYPE_CHECKING:
    from pendulum_env.common.texts import Table

FEWEST = 3
"""Fewest lengths that a line with an error goes through."""
NUMBERS = (1, 5, 10, 15, 20, 25, 30, 50, 100)
"""Usual numbers of oscillations that are timed together."""
NEAR = 0.1
"""Relative distance from USUAL within which a gravity is explained by a unit or a number of oscillations."""
ALONE = 0.7
"""A residual with a larger share of chi² than this is named."""
USUAL = 9.81
"""Gravity [m/s²] that a result far from it is compared with."""
TITLES = "length (m),10 T (s)"
_ROUNDS = 4
"""The weights depend on the slope, and the bob's size on the offset: both settle in this many rounds."""


@dataclass(frozen=True, eq=False, repr=False)
class LengthSheet(FromFile, Plotted):
    """Periods against lengths, and what follows from them; :func:`measure_lengths` returns it.

    Attributes:
        source: name of the file, or "table".
        length: measured lengths [m].
        period: periods of small swings [s], corrected for the amplitudes.
        error: standard error of each T² [s²], that of the length included; only their ratios count if ``told`` is
            False.
        size: length by which the size of the bob lengthens each pendulum, 2 a²/(5 L) [m].
        line: straight line of T² against the length with ``size``.
        gravity: gravity from the slope, ``4 pi²/slope`` [m/s²], whatever the offset of the lengths.
        offset: what must be added to every length [m].
        through_origin: gravity with an offset of 0 [m/s²].
        told: False if no error was given, so that the scatter about the line tells it.
        how: sentences on how the table was read.

    Source: Nelson & Olsson, Am. J. Phys. 54, 112 (1986).
    """

    source: str
    length: FloatArray
    period: FloatArray
    error: FloatArray
    size: FloatArray
    line: Line
    gravity: Measurement
    offset: Measurement
    through_origin: Measurement
    told: bool
    how: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return one_line(self, f"{self.source}, {len(self.length)} lengths, g = {self.gravity}")

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the line, the number of lengths less 2."""
        return len(self.length) - 2

    @cached_property
    def residual(self) -> FloatArray:
        """Array of T² minus the line [s²]."""
        return np.asarray(self.period**2 - self.line.at(self.length + self.size))

    @property
    def scatter(self) -> float:
        """Standard deviation of a period about the line [s], from the residuals of T² and the degrees of freedom."""
        return math.sqrt(float(np.sum((self.residual / (2.0 * self.period)) ** 2)) / self.freedom)

    @property
    def misfit(self) -> float:
        """Square root of chi² over the degrees of freedom; 1 without given errors."""
        return math.sqrt(self.line.chi2 / self.freedom) if self.told else 1.0

    @property
    def farthest(self) -> int:
        """Index of the length whose period is farthest from the line, in units of its error."""
        return int(np.argmax(np.abs(self.residual) / self.error))

    @property
    def table(self) -> Table:
        """Table of the sheet: one row per quantity, with value, standard error and method."""
        from pendulum_env.common.texts import Table

        rows = (("gravity", str(self.gravity), f"4 pi²/slope of T² against L, {len(self.length)} lengths"),
                ("offset of the length", str(scaled(self.offset, 1e3, "mm")), "intercept/slope: added to every length"),
                ("gravity, offset 0", str(self.through_origin), "line through the origin"),
                ("slope", f"{self.line.slope:.5g} s²/m", ""),
                ("scatter of a period", f"{1e3 * self.scatter:.2g} ms", "about the line"))
        return Table(("quantity", "value", "how"), rows)

    @property
    def numbers(self) -> Table:
        """Table of the sheet for further calculation: quantity, value, standard error, ends of the 95 % interval, unit.
        """
        return numbers_of([("gravity", self.gravity), ("offset of the length", self.offset),
                           ("gravity, offset 0", self.through_origin)], self.freedom)

    @property
    def readings(self) -> Table:
        """Table of the readings: length, period of small swings, T², the line, and the residual."""
        from pendulum_env.common.texts import Table

        square = self.period**2
        return Table(("length_m", "small_period_s", "square_s2", "line_s2", "residual_s2"), tuple(
            tuple(f"{x:.9g}" for x in row)
            for row in zip(self.length, self.period, square, square - self.residual, self.residual, strict=True)))

    def _doubt(self) -> str:
        """Return a sentence on a gravity that cannot be, with the unit or the number of oscillations that would be
        right, if there is one."""
        ratio = self.gravity.value / USUAL
        remedy = ("name the units in the titles, as 'length (cm)', and the number of oscillations, as '10 T (s)' "
                  "(--oscillations)")
        for unit, counts in (("m", NUMBERS), ("cm", (1, 10, 20)), ("mm", (1, 10, 20))):
            for number in counts:
                if abs(ratio * LENGTH.units[unit].size * number**2 - 1.0) < NEAR:
                    means = [f"the lengths are in {unit}, and the title must say so"] if unit != "m" else []
                    means += [f"the times are those of {number} oscillations; name them in the title, as "
                              f"'{number} T (s)', or by --oscillations {number}"] if number > 1 else []
                    return f"This g cannot be: {' and '.join(means)}." if means else ""
        return f"This g is {ratio:.3g} times {USUAL:g} m/s²: {remedy}."

    @property
    def text(self) -> str:
        """Sentences on gravity, the offset of the lengths, and the residuals."""
        low, high = student_range(self.gravity, self.freedom)
        lines = [*self.how, f"T² against the length of {len(self.length)} pendulums gives g = {self.gravity}, with "
                 f"95 % between {low:.4g} and {high:.4g} m/s², whatever the offset of the lengths."]
        offset = scaled(self.offset, 1e3, "mm")
        if abs(offset.value) < 2.0 * offset.error:
            lines.append(f"The offset of the lengths is 0 within two errors ({offset}); if the lengths are from the "
                         f"pivot to the bob's centre, g = {self.through_origin}.")
        else:
            short, by = offset.value > 0.0, scaled(offset, math.copysign(1.0, offset.value), "mm")
            lines.append(f"The lengths are {'too short' if short else 'too long'} by {by}: measure from the pivot to "
                         "the bob's centre. g from the slope does not depend on it.")
        if self.told and self.misfit > 1.5:
            lines.append(f"The periods scatter {self.misfit:.2g} times as much as their errors; the errors above allow "
                         "for that.")
        worst = self.farthest
        share = (self.residual[worst] / self.error[worst]) ** 2 / max(self.line.chi2, 1e-300)
        if share > ALONE and len(self.length) > 4:
            lines.append(f"The period at {self.length[worst]:.4g} m is farthest from the line, by "
                         f"{1e3 * self.residual[worst] / (2.0 * self.period[worst]):.2g} ms, which is {share:.0%} of "
                         "the squares of all residuals; time it again.")
        if abs(self.gravity.value / USUAL - 1.0) > UNLIKELY and (
                abs(self.gravity.value - USUAL) > 3.0 * self.gravity.error):
            lines.append(self._doubt())
        return "\n".join(lines)


def measure_lengths(
    table: str | os.PathLike[str] | tuple[ArrayLike, ArrayLike], *, oscillations: int | None = None,
    amplitude: float | None = None, radius: float | None = None, length_error: float | None = None,
    period_error: float | None = None,
) -> LengthSheet:
    """Measure gravity from the periods of pendulums of several lengths.

    ``T0² = (4 pi²/g) (L + L0 + 2 a²/(5 L))`` is a straight line against the length, fitted by least squares with the
    gravity g and an offset L0 of all lengths as parameters, for example where they end at the top of the bob. a is the
    radius of the bob (0 unless given). T0 is the period corrected for the amplitude A, ``T/(2 K(sin(A/2))/pi)``. The
    weights are 1/error² of T0² with the error of the length, ``sqrt((2 T dT)² + (slope dL)²)`` (effective variance);
    without errors, equal errors of the periods, which follow from the scatter and are at least those of rounding the
    times of a file. The errors of g and L0 are larger if the points scatter more than their errors, and cover the truth
    in 68 % of cases for few lengths, too.

    Args:
        table: path of a file with columns such as "length (cm), 10 T (s)", with the number of oscillations in the
            title, with amplitudes "amplitude (deg)" or errors "error (cm)" behind their column or without; several
            columns of times with the same title, or t1, t2, ..., are timings of their own; or lengths [m] and periods
            [s].
        oscillations: number of oscillations in each time; None: that of the title, else 1.
        amplitude: amplitude of all swings [rad]; None: those of the file, else small.
        radius: radius of a ball [m].
        length_error, period_error: standard error of each length [m] and of each period [s], of one oscillation.

    Source: Nelson & Olsson, Am. J. Phys. 54, 112 (1986), for amplitude and bob; Orear, Am. J. Phys. 50, 912 (1982), for
    the effective variance. Raises RecordingError for a file without such columns, for fewer than three different
    lengths, and for numbers that cannot be.
    """
    swings = count(oscillations, "oscillations", "oscillations")
    angle = None if amplitude is None else one_number(amplitude, "amplitude", least=0.0, unit="rad")
    bob = 0.0 if radius is None else one_number(radius, "radius", above=0.0, unit="m")
    given = [None if one is None else one_number(one, name, above=0.0, unit=unit)
             for one, name, unit in ((length_error, "length_error", "m"), (period_error, "period_error", "s"))]
    read = _read(table)
    number = swings or read.number or 1
    check_size(read.source, "lengths", read.length, *BENCH, "m")
    period = small_periods(read.source, read.times, number, read.amplitude if angle is None else angle)
    dl = read.length_error if given[0] is None else np.full(len(period), given[0])
    dt = read.time_error if given[1] is None else np.full(len(period), given[1] * number)
    for one, whole in ((dl, read.length), (dt, read.times)):
        check_errors(read.source, one, whole)
    dt = None if dt is None else dt * period / read.times
    if len(np.unique(read.length)) < FEWEST:
        raise RecordingError(f"{read.source}: the line needs at least {FEWEST} different lengths, there are "
                             f"{len(np.unique(read.length))}")
    told = dl is not None or dt is not None
    if not told and read.rounding > 0.0:
        dt = max(read.rounding, 1e-9 * float(read.times.min())) * period / read.times
    if bob >= read.length.min():
        raise RecordingError(f"{read.source}: radius must be below the lengths, got {bob:g} m")
    x, y, slope, offset = read.length, period**2, 0.0, 0.0
    for _ in range(_ROUNDS):
        size = 0.4 * bob**2 / np.maximum(read.length + offset, bob + 1e-12)
        error = np.hypot(0.0 if dt is None and dl is not None else 2.0 * period * (1.0 if dt is None else dt),
                         0.0 if dl is None else slope * dl if slope else math.tau**2 / USUAL * dl)
        x, weight = read.length + size, error**-2.0
        line = line_through(x, y, weight)
        slope, offset = line.slope, line.height / line.slope - line.middle
        if not slope > 0.0:
            raise RecordingError(f"{read.source}: T² does not grow with the length; check the columns and their units")
    freedom, least = len(x) - 2, 0.0 if dt is None and dl is None else 1.0
    factor = scatter_factor(line.chi2, freedom, least)
    own = factor / math.sqrt(line.spread)
    gravity = math.tau**2 / slope
    moved = math.hypot(factor / math.sqrt(line.weight) / slope, line.height / slope * own / slope)
    square = float(weight @ (x * x))
    through = float(weight @ (x * y)) / square
    lone = scatter_factor(float(weight @ (y - through * x) ** 2), len(x) - 1, least) / math.sqrt(square)
    return LengthSheet(
        read.source, read.length, period, error, size, line, Measurement(gravity, gravity * own / slope, "m/s²"),
        Measurement(offset, moved, "m"), Measurement(math.tau**2 / through, math.tau**2 * lone / through**2, "m/s²"),
        told, read.how)


class _Readings(NamedTuple):
    """Lengths [m], times [s], and what stands beside them: number of oscillations, amplitudes [rad], errors [m, s]."""

    source: str
    length: FloatArray
    times: FloatArray
    number: int | None = None
    amplitude: FloatArray | None = None
    length_error: FloatArray | None = None
    time_error: FloatArray | None = None
    rounding: float = 0.0
    how: tuple[str, ...] = ()


def is_lengths(path: str | os.PathLike[str]) -> bool:
    """Return True if the titles of a file show that it has lengths and periods, and no angles but amplitudes."""
    try:
        table = HandTable(path, TITLES)
    except RecordingError:
        return False
    angles = (title for title in table.titles if ANGLE.names(title))
    place = table.find(LENGTH)
    return (place is not None and table.find(PERIOD, TIME, without=(place,)) is not None
            and all("amplitud" in title.lower() for title in angles))


def _read(table: object) -> _Readings:
    """Return the readings of a file, or of a pair of arrays."""
    if isinstance(table, tuple):
        if len(table) != 2:
            raise RecordingError(f"table must be a file or a pair of lengths and periods, got {shown(table)}")
        long, timed = (numbers(one, name) for one, name in zip(table, ("length", "period"), strict=True))
        if long.ndim != 1 or long.shape != timed.shape or not np.isfinite([long, timed]).all():
            raise RecordingError("lengths and periods must be finite arrays of one length")
        return _Readings("table", long, timed)
    hand = HandTable(table, TITLES)  # type: ignore[arg-type]
    at = hand.need("lengths", TITLES, LENGTH)
    place = hand.need("periods or times of several", TITLES, PERIOD, TIME, without=(at,))
    places, number, sized = hand.trials(place), hand.count(place), hand.find(AMPLITUDE, without=(at, place))
    parts = [complete(hand.values(at, LENGTH, "m"), hand.values(one, TIME, "s"), hand.values(sized, ANGLE, "deg"),
                      hand.error(at, LENGTH, "m"), hand.error(one, TIME, "s")) for one in places]
    lengths, times, sizes, *errors = (None if any(one is None for one in column) else np.concatenate(
        [one for one in column if one is not None]) for column in zip(*parts, strict=True))
    assert lengths is not None
    assert times is not None
    how = [f"Each time is that of {number} oscillations."] if number else []
    how += [f"Each of the {len(places)} columns of times counts as a timing of its own."] if len(places) > 1 else []
    return _Readings(hand.source, lengths, times, number, sizes, errors[0], errors[1],
                     hand.rounding(place, TIME, "s"), tuple(how))
