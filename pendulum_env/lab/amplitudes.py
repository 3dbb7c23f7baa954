"""Amplitudes that were read by hand: gamma from the line through their logarithms, and the envelopes of three laws."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from pendulum_env.common.results import Plotted, one_line
from pendulum_env.lab.checked import FloatArray, RecordingError, one_number
from pendulum_env.lab.hand import HandTable, check_size, complete, half_a_digit, numbers_of, student_range
from pendulum_env.lab.measures import LAWS, FromFile, Line, Measurement, line_through, powers, scaled, scatter_factor
from pendulum_env.lab.quantities import AMPLITUDE, ANGLE, COUNT, DISTANCE, PERIOD, TIME
from pendulum_env.lab.turning import TurningPoints, equilibrium
from pendulum_env.physics import exact
from pendulum_env.physics.units import shown

if TYPE_CHECKING:
    from pendulum_env.common.texts import Table

FEWEST = 3
"""Fewest amplitudes that a line with an error goes through."""
RULED_OUT = 9.0
"""A law is ruled out if its chi² is larger than that of the best law by this much (three errors), in units of the
scatter."""
TINY = 1e-4
"""Amplitude [rad] below which the laws of small angles are exact to rounding."""
SMALLEST = 1e-5
"""Smallest amplitude [rad]; a smaller one is that of a bob at rest."""
LATEST = 1e7
"""Latest time [s]."""
LEAST = 1e-9
"""Least error of an amplitude, as a share of it."""
EXAMPLE = "0:30, 1.42:29.4, 2.84:28.8"
TITLES = "time (s),amplitude (deg)"
_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?"
_SWINGS = re.compile(r"swing|oscillation|cycle|schwingung", re.IGNORECASE)
_PAIR = re.compile(rf"\s*({_NUMBER})\s*s?\s*:\s*({_NUMBER})\s*(°|deg|rad|mm|cm|m|)\s*", re.IGNORECASE)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_GRID = 2000
"""Number of amplitudes between which the inverse of the line's function is interpolated."""
NAMES = {"constant": "dry friction", "linear": "linear drag", "quadratic": "quadratic drag"}
"""What causes a loss per half swing that grows as each of the laws in ``LAWS``."""


def envelope_function(amplitude: FloatArray, law: str) -> FloatArray:
    """Return the function F of an amplitude A that falls in proportion to time under one law of damping.

    At small angles F is A for dry friction ("constant"), ln A for linear drag ("linear") and -1/A for quadratic drag
    ("quadratic"), and ``dF/dt = -b`` where ``dA/dt = -b A^k``, k = 0, 1, 2: b is ``2 tau/(pi omega0)`` [rad/s],
    ``gamma/2`` [1/s] or ``4 c omega0/(3 pi)`` [1/(rad s)]. At larger angles ``F(A) = integral of dA r(A)/P(A)``, with
    the period r over that of small swings, and the exact work P of the force along a half swing, see
    :func:`pendulum_env.lab.losses`. The loss in a half swing must be small compared with the amplitude.

    Source: the small-angle laws, Nelson & Olsson, Am. J. Phys. 54, 112 (1986).
    """
    power = LAWS.index(law)
    small = (amplitude, np.log(amplitude), -1.0 / amplitude)[power]
    size = 0.5 * amplitude[:, None] * (_NODES + 1.0)
    size = np.maximum(size, TINY)  # below, the difference of both terms is rounding
    more = slope_of(size, law) - size ** -float(power)
    return np.asarray(small + 0.5 * amplitude * (more @ _WEIGHTS))


def slope_of(amplitude: FloatArray, law: str) -> FloatArray:
    """Return the slope dF/dA of :func:`envelope_function`, r(A)/P(A)."""
    return np.asarray(exact.period(amplitude, math.tau) / powers(amplitude)[LAWS.index(law)])


@dataclass(frozen=True, eq=False)
class Envelope:
    """The envelope of one law of damping, fitted to amplitudes.

    Attributes:
        law: growth of the loss per half swing with the amplitude: "constant" (dry friction), "linear" or "quadratic".
        line: straight line of :func:`envelope_function` against time.
        rate: the rate b of ``dA/dt = -b A^k``, k = 0, 1, 2 for these laws, with its error [rad/s, 1/s, 1/(rad s)].
        largest: largest fitted amplitude [rad].
    """

    law: str
    line: Line
    rate: Measurement
    largest: float

    def at(self, time: FloatArray) -> FloatArray:
        """Return the amplitudes [rad] at an array of times [s]; 0 where dry friction has stopped the swing."""
        top = min(2.0 * self.largest, math.pi - 1e-3)
        grid = np.geomspace(1e-4 * self.largest, top, _GRID)
        found = np.interp(self.line.at(time), envelope_function(grid, self.law), np.log(grid), left=-math.inf)
        return np.asarray(np.exp(found))


@dataclass(frozen=True, eq=False, repr=False)
class AmplitudeSheet(FromFile, Plotted):
    """Amplitudes read by hand, and what follows from them; :func:`measure_amplitudes` returns it.

    Attributes:
        source: name of the file, or "readings".
        points: times [s], amplitudes [rad] and their errors [rad] as read.
        decay: damping rate gamma of ``A ~ exp(-gamma t/2)`` from the line through ln A [1/s].
        envelopes: the envelopes of dry friction, linear drag and quadratic drag.
        period: period of small swings [s] that the caller gave; None without one.
        how: sentences on how the amplitudes were read.
    """

    source: str
    points: TurningPoints
    decay: Measurement
    envelopes: tuple[Envelope, ...]
    period: float | None
    how: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return one_line(self, f"{self.source}, {len(self.points.time)} amplitudes, gamma = {self.decay}")

    @property
    def freedom(self) -> int:
        """Degrees of freedom of a line through the amplitudes, their number less 2."""
        return len(self.points.time) - 2

    @cached_property
    def best(self) -> Envelope:
        """Envelope that is closest to the amplitudes, by chi²."""
        return min(self.envelopes, key=lambda one: one.line.chi2)

    def ruled_out(self, one: Envelope) -> bool:
        """Return True if the amplitudes rule a law out: its chi² is over 9 (RULED_OUT) above the best, in units of the
        scatter."""
        scale = max(1.0, self.best.line.chi2 / self.freedom)
        return one.line.chi2 - self.best.line.chi2 > RULED_OUT * scale

    @property
    def gamma(self) -> Measurement:
        """Damping rate gamma of linear drag [1/s], from its envelope at any angle; ``decay`` is that of small ones."""
        rate = self.envelopes[LAWS.index("linear")].rate
        return Measurement(2.0 * rate.value, 2.0 * rate.error, "1/s")

    @property
    def quality(self) -> Measurement | None:
        """Quality factor ``Q = 2 pi/(gamma T)`` from ``gamma`` [1]; None without a period or a decay."""
        gamma = self.gamma
        if self.period is None or gamma.value <= 0.0:
            return None
        value = math.tau / (gamma.value * self.period)
        return Measurement(value, value * gamma.error / gamma.value, "1")

    def rms(self, one: Envelope) -> float:
        """Return the root mean square of the amplitudes minus an envelope [rad]."""
        return float(np.sqrt(np.mean((self.points.amplitude - one.at(self.points.time)) ** 2)))

    def range95(self, one: Measurement) -> tuple[float, float]:
        """Return the interval that contains a value of this sheet with 95 %, by Student's distribution."""
        return student_range(one, self.freedom)

    @property
    def table(self) -> Table:
        """Table of the sheet: one row per law of damping, with its rate, standard error, misfit and verdict."""
        from pendulum_env.common.texts import Table

        rows = [("gamma, line through ln A", str(self.decay), "",
                 f"A ~ exp(-gamma t/2), {len(self.points.time)} readings")]
        for one in self.envelopes:
            name, _ = self.named(one)
            verdict = "closest" if one is self.best else "ruled out" if self.ruled_out(one) else "possible"
            rows.append((f"{NAMES[one.law]}: {name}", self.shown(one), f"{math.degrees(self.rms(one)):.2g}°", verdict))
        if self.quality is not None:
            rows.append(("quality factor", str(self.quality).removesuffix(" 1"), "", "2 pi/(gamma T), linear drag"))
        return Table(("quantity", "value", "rms", "how"), tuple(rows))

    def shown(self, one: Envelope) -> str:
        """Return the value of a law's constant with its error and its unit, if it has one, as text."""
        return str(self.named(one)[1]).removesuffix(" 1")

    def named(self, one: Envelope) -> tuple[str, Measurement]:
        """Return the name and the value of a law's constant, in the units that students use."""
        rate, omega = one.rate, None if self.period is None else math.tau / self.period
        if one.law == "linear":
            return "gamma", self.gamma
        if one.law == "quadratic":
            if omega is not None:
                return "c", scaled(rate, 0.75 * math.pi / omega, "1/rad")
            return "4 c omega0/(3 pi)", rate
        if omega is not None:
            return "torque/(m g L)", scaled(rate, 0.5 * math.pi / omega, "1")
        return "loss of amplitude", scaled(rate, math.degrees(1.0), "°/s")

    @property
    def numbers(self) -> Table:
        """Table of the sheet for further calculation: quantity, value, standard error, ends of the 95 % interval, unit.
        """
        values = [("gamma, line through ln A", self.decay), *(
            (f"{NAMES[one.law]}: {name}", value) for one in self.envelopes for name, value in [self.named(one)])]
        values += [] if self.quality is None else [("quality factor", self.quality)]
        return numbers_of(values, self.freedom)

    @property
    def readings(self) -> Table:
        """Table of the readings: time, amplitude, error, ln A, and the amplitude of each envelope."""
        from pendulum_env.common.texts import Table

        points = self.points
        curves = [np.degrees(one.at(points.time)) for one in self.envelopes]
        head = ("time_s", "amplitude_deg", "error_deg", "ln_amplitude_rad",
                *(f"{NAMES[one.law].replace(' ', '_')}_deg" for one in self.envelopes))
        return Table(head, tuple(tuple(f"{x:.9g}" for x in row) for row in zip(
            points.time, np.degrees(points.amplitude), np.degrees(points.error), np.log(points.amplitude), *curves,
            strict=True)))

    @property
    def text(self) -> str:
        """Sentences on the amplitudes, gamma, and the law of damping that the amplitudes call for."""
        low, high = self.range95(self.decay)
        size, error = self.points.amplitude, float(np.median(self.points.error))
        lines = [*self.how, f"{len(size)} amplitudes, {math.degrees(size[0]):.4g}° to {math.degrees(size[-1]):.4g}°, "
                 f"each ± {math.degrees(error):.2g}°. The line through their logarithms gives gamma = {self.decay}, "
                 f"with 95 % between {low:.3g} and {high:.3g} 1/s."]
        if self.decay.value <= 0.0:
            return "\n".join([*lines, "The amplitude does not fall: check the order and the unit of the readings."])
        away = math.sqrt(self.best.line.chi2 / self.freedom)
        if away > 1.5:
            lines.append(f"The readings scatter {away:.{0 if away > 9.5 else 1}f} times as much as their error; the "
                         "errors above allow for that.")
        possible = [one for one in self.envelopes if not self.ruled_out(one)]
        if len(possible) == 1:
            lines.append(f"The amplitudes fall as by {NAMES[self.best.law]}; the two other laws are ruled out.")
        else:
            *words, last = (NAMES[one.law] for one in possible)
            lines.append(f"The readings do not tell {', '.join(words)} and {last} apart; {NAMES[self.best.law]} is "
                         "closest. Readings over a longer time, until the amplitude is below a third, would.")
        if "linear" not in [one.law for one in possible]:
            lines.append("So gamma is only a mean over these amplitudes, and depends on them.")
        else:
            off = self.decay.value / self.gamma.value - 1.0
            if abs(off) > 0.002:
                lines.append(f"At these angles the envelope falls {100.0 * off:.1g} % faster than at small ones: "
                             f"linear drag with sin(theta) has gamma = {self.gamma}.")
        return "\n".join(lines)


def measure_amplitudes(
    readings: str | os.PathLike[str] | TurningPoints, *, error: float | None = None, length: float | None = None,
    period: float | None = None,
) -> AmplitudeSheet:
    """Measure the damping from amplitudes that were read by hand.

    gamma [1/s] of ``A = A0 exp(-gamma t/2)`` is -2 times the slope of the straight line through ln A, fitted with the
    weights (A/error)². Beside it stand the envelopes of linear drag, of quadratic drag, on which -1/A, and of dry
    friction, on which A is a straight line at small angles (:func:`envelope_function` at all), fitted alike, and which
    of them the readings rule out. All errors are at least those of the readings, and larger if the readings scatter
    more; they cover the truth in 68 % of cases for few readings, too.

    Args:
        readings: text with pairs of a time [s] and an amplitude, as "0:30, 1.42:29.4", in degrees unless a unit follows
            (rad, cm, mm, m); or the path of a file with columns such as "time (s), amplitude (deg)", with errors in a
            third column "error (deg)" or without; or turning points. Amplitudes on both sides in turn are measured from
            their middle.
        error: error of one amplitude [rad]; None: that of the file, else half a unit of the last digit.
        length: distance from the pivot to the ruler [m], for amplitudes x that were read along a ruler: A = asin(x/L).
        period: period of small swings [s], for the quality factor and the constants of the other laws, and for a file
            with numbers of swings, "n", in place of times.

    Source: the laws, Nelson & Olsson, Am. J. Phys. 54, 112 (1986). Raises RecordingError for readings that are no such
    pairs or file, for fewer than three, for times that do not increase, and for amplitudes that are not above 0 and
    below half a turn.
    """
    seconds = None if period is None else one_number(period, "period", above=0.0, unit="s")
    reach = None if length is None else one_number(length, "length", above=0.0, unit="m")
    source, time, angle, own, how = _read(readings, reach, seconds)
    sigma = own if error is None else np.full(len(time), one_number(error, "error", above=0.0, unit="rad"))
    if len(time) < FEWEST:
        raise RecordingError(f"{source}: the decay needs at least {FEWEST} amplitudes, there are {len(time)}")
    check_size(source, "times", time, -LATEST, LATEST, "s")
    if not (np.diff(time) > 0.0).all():
        at = int(np.flatnonzero(np.diff(time) <= 0.0)[0])
        raise RecordingError(f"{source}: times must increase, and {time[at + 1]:g} s follows {time[at]:g} s")
    points = TurningPoints(time, angle, sigma)
    turns = np.diff(np.sign(angle))
    if (turns != 0.0).all():
        zero = equilibrium(points)
        points = TurningPoints(time, angle - zero, sigma)
        how = (*how, f"The amplitudes are on both sides in turn, about the middle at {math.degrees(zero):.3g}°.")
    size = points.amplitude
    if not ((size > SMALLEST).all() and (size < math.pi).all()):
        raise RecordingError(f"{source}: amplitudes must be above 0 and below 180 degrees; leave out readings of a bob "
                             "at rest")
    if not ((points.error > LEAST * size) & (points.error < math.pi)).all():
        raise RecordingError(f"{source}: the error of an amplitude must be above 0 and below 180 degrees")
    logs = line_through(time, np.log(size), (size / points.error) ** 2)
    factor = scatter_factor(logs.chi2, len(time) - 2)
    decay = Measurement(-2.0 * logs.slope, 2.0 * factor / math.sqrt(logs.spread), "1/s")
    return AmplitudeSheet(source, TurningPoints(time, size, points.error), decay,
                          tuple(_envelope(time, size, points.error, law) for law in LAWS), seconds, how)


def _envelope(time: FloatArray, size: FloatArray, error: FloatArray, law: str) -> Envelope:
    """Return the envelope of a law through amplitudes."""
    line = line_through(time, envelope_function(size, law), (slope_of(size, law) * error) ** -2.0)
    unit = ("rad/s", "1/s", "1/(rad s)")[LAWS.index(law)]
    factor = scatter_factor(line.chi2, len(time) - 2)
    return Envelope(law, line, Measurement(-line.slope, factor / math.sqrt(line.spread), unit), float(size.max()))


def _read(
    readings: object, length: float | None, period: float | None
) -> tuple[str, FloatArray, FloatArray, FloatArray, tuple[str, ...]]:
    """Return source, times [s], amplitudes [rad] with their signs, errors [rad], and sentences on how they were read.
    """
    if isinstance(readings, TurningPoints):
        return "readings", readings.time, readings.angle, readings.error, ()
    text = readings if isinstance(readings, str) else ""
    typed = isinstance(readings, str) and not os.path.isfile(text)
    if typed and re.match(rf"\s*{_NUMBER}\s*s?\s*:", text):
        return _of_pairs(text, length)
    if typed and re.fullmatch(r"[\s\d.,;:]*|.*:.*", text):
        raise RecordingError(f"amplitudes must be pairs time:angle in s and degrees, as {EXAMPLE!r}, or a file with "
                             f"the columns {TITLES!r}, got {shown(text)}")
    table = HandTable(readings, TITLES)  # type: ignore[arg-type]
    at = table.find(TIME)
    swings = None if at is not None else table.find(COUNT, PERIOD, _SWINGS)
    if swings is not None and period is None:
        raise RecordingError(f"{table.source}: numbers of swings are no times; give the period (--period), or a column "
                             "of times in s")
    at = table.need("times", TITLES, TIME) if swings is None else swings
    place = table.need("amplitudes", TITLES, AMPLITUDE, DISTANCE, re.compile(r"(?<![a-z])[ax](?![a-z])", re.IGNORECASE),
                       without=(at,))
    ruler = DISTANCE.units_in([table.titles[place]])
    kind, usual = (DISTANCE, "m") if ruler else (ANGLE, "deg")
    time, size, error = complete(table.values(at, TIME, "s"), table.values(place, kind, usual),
                                 table.error(place, kind, usual))
    assert time is not None
    assert size is not None
    how: tuple[str, ...] = ()
    if swings is not None and period is not None:
        time, how = time * period, (f"Times are the numbers of swings times the period, {period:g} s.",)
    if error is None:
        least = LEAST * float(np.abs(size).max(initial=0.0))
        error = np.full(len(size), max(table.half_a_digit(place, kind, usual), least))
    if kind is DISTANCE:
        size, error = _by_ruler(table.source, size, error, length)
    return table.source, time, size, error, how


def _of_pairs(text: str, length: float | None) -> tuple[str, FloatArray, FloatArray, FloatArray, tuple[str, ...]]:
    """Return what :func:`_read` does of a text with pairs."""
    parts = [part for part in re.split(r"[;,]" if ";" not in text else ";", text) if part.strip()]
    found = []
    for part in parts:
        pair = _PAIR.fullmatch(part.replace(",", "."))
        if pair is None:
            remedy = "; separate pairs by ';' if the numbers have decimal commas" if ";" not in text else ""
            raise RecordingError(f"amplitudes must be pairs time:angle in s and degrees, as {EXAMPLE!r}, got "
                                 f"{shown(part.strip())}{remedy}")
        found.append(pair.groups())
    units = {unit.lower() for _, _, unit in found if unit}
    if len(units) > 1:
        raise RecordingError(f"amplitudes must have one unit, got {' and '.join(sorted(units))}")
    unit = (units.pop() if units else "deg").replace("°", "deg")
    kind = DISTANCE if unit in DISTANCE.units else ANGLE
    factor = kind.units[unit].size
    time, size = (np.array([float(pair[i]) for pair in found]) for i in range(2))
    size = size * factor
    digit = half_a_digit([pair[1] for pair in found]) * factor
    error = np.full(len(size), max(digit, LEAST * float(np.abs(size).max(initial=0.0))))
    if kind is DISTANCE:
        size, error = _by_ruler("readings", size, error, length)
    return "readings", time, size, error, ()


def _by_ruler(
    source: str, size: FloatArray, error: FloatArray, length: float | None
) -> tuple[FloatArray, FloatArray]:
    """Return amplitudes [rad] and their errors [rad] from those along a ruler [m], asin(x/L)."""
    if length is None:
        raise RecordingError(f"{source}: amplitudes along a ruler need the distance from the pivot to the ruler; give "
                             "length in m (--length)")
    sine = size / length
    if not (np.abs(sine) < 1.0).all():
        raise RecordingError(f"{source}: amplitudes along a ruler must be below the length, {length:g} m; check the "
                             "units")
    return np.arcsin(sine), error / (length * np.sqrt(1.0 - sine**2))
