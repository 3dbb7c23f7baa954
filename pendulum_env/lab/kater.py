"""Kater's reversible pendulum: gravity from the periods about two knife edges and the distance between them."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
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
from pendulum_env.lab.measures import UNLIKELY, FromFile, Measurement, scatter_factor
from pendulum_env.lab.quantities import AMPLITUDE, ANGLE, DISTANCE, TIME
from pendulum_env.physics.units import shown

if TYPE_CHECKING:
    from pendulum_env.common.texts import Table

USUAL = 9.81
"""Gravity [m/s²] that a result far from it is compared with."""
TITLES = "position (cm),T1 (s),T2 (s)"
_FIRST, _SECOND = (re.compile(rf"(?<![a-z])(?:t|periods?|times?)[ _]*{number}(?!\d)", re.IGNORECASE)
                   for number in (1, 2))
_CENTRE = re.compile(r"(?<![a-z])h[ _]*1(?!\d)", re.IGNORECASE)
_PLACE = re.compile(r"(?<![a-z])x(?![a-z])|weight|mass", re.IGNORECASE)
DEGREES = (1, 2, 3)
"""Degrees of the polynomials that are tried for the periods against the position."""
FREEDOM = 4
"""Fewest degrees of freedom that a curve leaves, so that it does not follow the errors."""
SAME = 3.0
"""Periods of two crossings agree if they differ by less than this many errors."""


class Curves(NamedTuple):
    """Polynomials of equal degree through both periods against the position, with one error of a period for both.

    ``first`` and ``second``: coefficients, the lowest power first, of ``u = (x - middle)/scale``; ``covariance`` of
    both, for an error of 1; ``error`` of a period [s]; ``freedom``: degrees of freedom.
    """

    first: FloatArray
    second: FloatArray
    covariance: FloatArray
    middle: float
    scale: float
    error: float
    freedom: int

    def at(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return both periods [s] at an array of positions [m]."""
        powers = np.vander((x - self.middle) / self.scale, len(self.first), increasing=True)
        return powers @ self.first, powers @ self.second


@dataclass(frozen=True, eq=False, repr=False)
class KaterSheet(FromFile, Plotted):
    """The timings of a reversible pendulum, and what follows from them; :func:`measure_kater` returns it.

    Attributes:
        source: name of the file, or "table".
        position: positions of the movable weight [m] or, for Bessel's formula, distances h1 of the centre of mass from
            the first edge [m].
        first, second: periods of small swings about both knife edges [s].
        edges: distance between the knife edges [m].
        crossings: positions [m] where both periods are equal; none for Bessel's formula.
        period: period where both are equal [s]; for Bessel's formula that of a point pendulum of the length ``edges``.
        gravity: gravity [m/s²].
        curve: positions [m] and both fitted periods [s], three rows, for figures; empty for Bessel's formula.
        scatter: standard error of one period [s].
        freedom: degrees of freedom that the errors follow from.
        degree: degree of the polynomials through the periods; 0 for Bessel's formula.
        how: sentences on how the table was read and how gravity follows.
    """

    source: str
    position: FloatArray
    first: FloatArray
    second: FloatArray
    edges: Measurement
    crossings: tuple[Measurement, ...]
    period: Measurement
    gravity: Measurement
    curve: FloatArray
    scatter: float
    freedom: int
    degree: int = 0
    how: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return one_line(self, f"{self.source}, reversible pendulum, g = {self.gravity}")

    @property
    def _distance(self) -> str:
        """Text of the distance of the edges, without an error that was not given."""
        return str(self.edges) if self.edges.error else f"{self.edges.value:g} m"

    @property
    def bessel(self) -> FloatArray:
        """Array of gravity by Bessel's formula for each row [m/s²], if the positions are those of the centre of mass.
        """
        return bessel(self.first, self.second, self.edges.value, self.position)

    @property
    def table(self) -> Table:
        """Table of the sheet: one row per quantity, with value, standard error and method."""
        from pendulum_env.common.texts import Table

        rows = [(f"position {i + 1} of equal periods" if len(self.crossings) > 1 else "position of equal periods",
                 str(one), "where the curves of T1 and T2 cross") for i, one in enumerate(self.crossings)]
        rows += [("period T", str(self.period), "T1 = T2" if self.crossings else "2 pi sqrt(L/g)"),
                 ("distance of the edges L", self._distance, "as given"),
                 ("gravity", str(self.gravity), "4 pi² L/T²" if self.crossings else "Bessel's formula"),
                 ("error of one period", f"{1e3 * self.scatter:.2g} ms", "")]
        return Table(("quantity", "value", "how"), tuple(rows))

    @property
    def numbers(self) -> Table:
        """Table of the sheet for further calculation: quantity, value, standard error, ends of the 95 % interval, unit.
        """
        return numbers_of([*((f"position {i + 1}", one) for i, one in enumerate(self.crossings)),
                           ("period T", self.period), ("gravity", self.gravity)], self.freedom)

    @property
    def readings(self) -> Table:
        """Table of the readings: position and both periods of small swings, and gravity by Bessel's formula."""
        from pendulum_env.common.texts import Table

        columns = [self.position, self.first, self.second, *([] if self.crossings else [self.bessel])]
        head = ("position_m", "T1_s", "T2_s") if self.crossings else ("h1_m", "T1_s", "T2_s", "gravity_m_s2")
        return Table(head, tuple(tuple(f"{x:.9g}" for x in row) for row in zip(*columns, strict=True)))

    @property
    def text(self) -> str:
        """Sentences on the periods, gravity and where it comes from."""
        low, high = student_range(self.gravity, self.freedom)
        lines = [*self.how, f"With L = {self._distance} between the knife edges, g = {self.gravity}, with 95 % between "
                 f"{low:.5g} and {high:.5g} m/s²."]
        parts = 2.0 * self.period.error / self.period.value, self.edges.error / self.edges.value
        lines.append(f"The periods contribute {100.0 * parts[0]:.2g} % to its error, the distance of the edges "
                     f"{100.0 * parts[1]:.2g} %." if parts[1] else
                     "The error is that of the periods, without that of the distance (--length-error).")
        off = self.gravity.value / USUAL - 1.0
        if abs(off) > UNLIKELY:
            lines.append(f"This g is {abs(off):.0%} {'above' if off > 0.0 else 'below'} {USUAL:g} m/s²: check the "
                         "distance of the edges (--length, in m), the units in the titles, and the number of "
                         "oscillations, as '50 T1 (s)'.")
        return "\n".join(lines)


def bessel(first: FloatArray, second: FloatArray, edges: FloatArray | float, centre: FloatArray) -> FloatArray:
    """Return gravity [m/s²] by Bessel's formula from the periods about both edges [s], the distance of the edges L and
    that of the centre of mass from the first one h1 [m].

    ``8 pi²/g = (T1² + T2²)/L + (T1² - T2²)/(h1 - h2)`` with ``h2 = L - h1``. The second term is small if the periods
    are nearly equal, so that h1 needs no accuracy. Source: Bessel, Astron. Nachr. 6, 1 (1828); it follows from
    ``T_i² = 4 pi² (k² + h_i²)/(g h_i)``.
    """
    mean, apart = (first**2 + second**2) / edges, (first**2 - second**2) / (2.0 * centre - edges)
    return np.asarray(8.0 * math.pi**2 / (mean + apart))


def measure_kater(
    table: str | os.PathLike[str] | tuple[ArrayLike, ArrayLike, ArrayLike], edges: float, *,
    edges_error: float | None = None, oscillations: int | None = None, amplitude: float | None = None,
    period_error: float | None = None,
) -> KaterSheet:
    """Measure gravity by a reversible pendulum, whose periods T1 and T2 about two knife edges become equal.

    Where T1 = T2 = T, with the centre of mass not midway between the edges, ``g = 4 pi² L/T²`` with the distance L
    between the edges. Both periods, corrected for the amplitude, are fitted by polynomials of the position of the
    movable weight, of the degree 1 to 3 that the Bayesian information criterion chooses, and T is that where they
    cross. Of two crossings whose periods agree, T is the weighted mean. If the table has distances h1 of the centre of
    mass from the first edge in place of positions, each row gives g by :func:`bessel`, and the result is their mean.

    Args:
        table: path of a file with columns such as "position (cm), T1 (s), T2 (s)" or "h1 (cm), 50 T1 (s), 50 T2 (s)",
            with the number of oscillations in the titles, with amplitudes "amplitude (deg)" or without; or positions
            [m] and both periods [s].
        edges, edges_error: distance L between the knife edges, and its standard error [m].
        oscillations: number of oscillations in each time; None: that of the titles, else 1.
        amplitude: amplitude of all swings [rad]; None: those of the file, else small.
        period_error: standard error of each period [s], of one oscillation; the scatter enlarges it. None: the scatter
            tells it.

    Source: Kater, Phil. Trans. R. Soc. 108, 33 (1818). Raises RecordingError for a file without such columns, for too
    few rows, for curves that do not cross or that cross at different periods, and for numbers that cannot be.
    """
    distance = one_number(edges, "edges", above=0.0, unit="m")
    wrong = 0.0 if edges_error is None else one_number(edges_error, "edges_error", above=0.0, unit="m")
    if wrong >= distance:
        raise RecordingError(f"edges_error must be below edges, {distance:g} m")
    swings = count(oscillations, "oscillations", "oscillations")
    angle = None if amplitude is None else one_number(amplitude, "amplitude", least=0.0, unit="rad")
    sigma = None if period_error is None else one_number(period_error, "period_error", above=0.0, unit="s")
    read = _read(table)
    check_size(read.source, "positions", read.position, -BENCH[1], BENCH[1], "m")
    sizes = read.amplitude if angle is None else angle
    first, second = (small_periods(read.source, one, swings or number, sizes)
                     for one, number in ((read.first, read.numbers[0]), (read.second, read.numbers[1])))
    check_errors(read.source, None if sigma is None else np.array([sigma]), np.array([min(first.min(), second.min())]))
    long = Measurement(distance, wrong, "m")
    made = _by_bessel if read.centre else _by_crossing
    least = max(read.rounding / (swings or read.numbers[0] or 1), 1e-9 * float(first.mean()))
    return made(read, first, second, long, sigma, least)


class _Readings(NamedTuple):
    """Positions [m] and times [s], the numbers of oscillations, amplitudes [rad]; centre: positions are h1."""

    source: str
    position: FloatArray
    first: FloatArray
    second: FloatArray
    numbers: tuple[int | None, int | None] = (None, None)
    amplitude: FloatArray | None = None
    centre: bool = False
    rounding: float = 0.0


def _gravity(period: Measurement, edges: Measurement) -> Measurement:
    """Return gravity 4 pi² L/T² of the length of the edges and the common period."""
    value = math.tau**2 * edges.value / period.value**2
    return Measurement(value, value * math.hypot(2.0 * period.error / period.value, edges.error / edges.value), "m/s²")


def _by_crossing(
    read: _Readings, first: FloatArray, second: FloatArray, edges: Measurement, sigma: float | None, least: float
) -> KaterSheet:
    """Return the sheet of periods against the position of a weight; ``least`` is the least error of a period [s]."""
    x = read.position
    if len(np.unique(x)) < 3:
        raise RecordingError(f"{read.source}: the crossing needs at least 3 different positions, there are "
                             f"{len(np.unique(x))}; for fewer, give the distance h1 of the centre of mass")
    curves = _curves(x, first, second, sigma, least)
    difference = np.polynomial.Polynomial(curves.first - curves.second)
    roots = difference.roots()
    real = np.sort(roots[np.abs(roots.imag) < 1e-9].real) * curves.scale + curves.middle
    inside = [float(one) for one in real if x.min() <= one <= x.max()]
    if not inside:
        longer = "T1" if float(np.mean(first - second)) > 0.0 else "T2"
        raise RecordingError(f"{read.source}: T1 and T2 do not become equal between {x.min():g} and {x.max():g} m, "
                             f"{longer} stays longer; move the weight further")
    found = [_crossing(curves, one) for one in inside]
    times = [time for _, time in found]
    if max(one.value for one in times) - min(one.value for one in times) > SAME * math.hypot(
            *(one.error for one in times)):
        where = " and ".join(f"{one:.4g} m" for one in inside)
        raise RecordingError(f"{read.source}: T1 and T2 are equal at {where}, with different periods; leave out the "
                             "rows around the one where the centre of mass is midway between the edges, which says "
                             "nothing of g")
    weights = np.array([1.0 / max(one.error, 1e-15) ** 2 for one in times])
    period = Measurement(float(np.average([one.value for one in times], weights=weights)),
                         float(weights.sum() ** -0.5), "s")
    fine = np.linspace(x.min(), x.max(), 200)
    degree = len(curves.first) - 1
    shape = {1: "a straight line", 2: "a parabola", 3: "a cubic"}[degree]
    how = f"Each of T1 and T2 is fitted by {shape} of the position."
    return KaterSheet(read.source, x, first, second, edges, tuple(place for place, _ in found), period,
                      _gravity(period, edges), np.stack([fine, *curves.at(fine)]), curves.error, curves.freedom,
                      degree, (how,))


def _curves(x: FloatArray, first: FloatArray, second: FloatArray, sigma: float | None, least: float) -> Curves:
    """Return the polynomials through both periods, of the degree with the best Bayesian information criterion."""
    middle, scale = float(x.mean()), float(np.ptp(x)) / 2.0
    best: tuple[float, Curves] | None = None
    for degree in DEGREES:
        freedom = 2 * (len(x) - degree - 1)
        if degree > 1 and (freedom < FREEDOM or len(np.unique(x)) < degree + 2):
            break
        powers = np.vander((x - middle) / scale, degree + 1, increasing=True)
        fits = [np.asarray(np.linalg.lstsq(powers, one, rcond=None)[0], dtype=np.float64) for one in (first, second)]
        squares = sum(float(np.sum((one - powers @ fit) ** 2)) for one, fit in zip((first, second), fits, strict=True))
        score = (2 * len(x) * math.log(squares / (2 * len(x)) + least**2) if sigma is None else squares / sigma**2)
        score += 2 * (degree + 1) * math.log(2 * len(x))
        own = least if sigma is None else sigma
        error = own * scatter_factor(squares / own**2, freedom)
        covariance = np.asarray(np.linalg.pinv(powers.T @ powers), dtype=np.float64)
        curves = Curves(fits[0], fits[1], covariance, middle, scale, error, freedom)
        if best is None or score < best[0]:
            best = score, curves
    assert best is not None
    return best[1]


def _crossing(curves: Curves, x: float) -> tuple[Measurement, Measurement]:
    """Return the position [m] and the period [s] of a crossing, with errors.

    With the slopes s1 and s2, an error d1 - d2 of the difference moves the crossing by ``-(d1 - d2)/(s1 - s2)``, and
    the period there changes by ``(s1 d2 - s2 d1)/(s1 - s2)``.
    """
    u = (x - curves.middle) / curves.scale
    power = np.arange(len(curves.first))
    at, slope = u**power, np.concatenate([[0.0], power[1:] * u ** (power[1:] - 1)]) / curves.scale
    s1, s2 = float(slope @ curves.first), float(slope @ curves.second)
    error = curves.error * math.sqrt(float(at @ curves.covariance @ at))
    period = Measurement(float(at @ (curves.first + curves.second)) / 2.0, error * math.hypot(s1, s2) / abs(s1 - s2),
                         "s")
    return Measurement(x, error * math.sqrt(2.0) / abs(s1 - s2), "m"), period


def _by_bessel(
    read: _Readings, first: FloatArray, second: FloatArray, edges: Measurement, sigma: float | None, least: float
) -> KaterSheet:
    """Return the sheet of periods beside the distance of the centre of mass; ``least`` is the least error of a period.
    """
    h1, long = read.position, edges.value
    if not ((h1 > 0.0) & (h1 < long)).all() or not (np.abs(2.0 * h1 - long) > 1e-3 * long).all():
        raise RecordingError(f"{read.source}: h1 must be between 0 and the distance of the edges, {long:g} m, and the "
                             "centre of mass not midway between them")
    each = bessel(first, second, long, h1)
    if not (each > 0.0).all():
        raise RecordingError(f"{read.source}: Bessel's formula gives no gravity; h1 is the distance of the centre of "
                             "mass from the edge of T1")
    rows = len(each)
    if rows < 2 and sigma is None:
        raise RecordingError(f"{read.source}: one row does not tell its error; give period_error (--period-error)")

    def change(of: int) -> FloatArray:
        step = [1e-6 * float(one.mean()) if i == of else 0.0 for i, one in enumerate((first, second, np.array([long])))]
        return (bessel(first + step[0], second + step[1], long + step[2], h1) - each) / step[of]

    by_period = np.hypot(change(0), change(1)) * (least if sigma is None else sigma)
    mean, freedom = float(each.mean()), max(rows - 1, 1)
    own = float(np.linalg.norm(by_period)) / rows
    if rows > 1:
        own *= scatter_factor(float(np.sum(((each - mean) / by_period) ** 2)), freedom)
    by_edges = edges.error * float(np.mean(change(2)))
    period = Measurement(math.tau * math.sqrt(long / mean), 0.5 * math.tau * math.sqrt(long / mean) * own / mean, "s")
    error = own * math.sqrt(rows) / float(np.mean(by_period)) * (least if sigma is None else sigma)
    return KaterSheet(read.source, h1, first, second, edges, (), period,
                      Measurement(mean, math.hypot(own, by_edges), "m/s²"), np.empty((3, 0)), error, freedom,
                      0, (f"Bessel's formula for {rows} row{'s' * (rows > 1)}.",))


def is_kater(path: str | os.PathLike[str]) -> bool:
    """Return True if the titles of a file are those of both periods of a reversible pendulum."""
    try:
        table = HandTable(path, TITLES)
    except RecordingError:
        return False
    return None not in (table.find(_FIRST), table.find(_SECOND), table.find(_CENTRE, DISTANCE, _PLACE))


def _read(table: object) -> _Readings:
    """Return the readings of a file, or of three arrays."""
    if isinstance(table, tuple):
        if len(table) != 3:
            raise RecordingError(f"table must be a file, or positions and both periods, got {shown(table)}")
        arrays = [numbers(one, name) for one, name in zip(table, ("position", "T1", "T2"), strict=True)]
        if arrays[0].ndim != 1 or len({one.shape for one in arrays}) > 1 or not np.isfinite(arrays).all():
            raise RecordingError("positions and periods must be finite arrays of one length")
        return _Readings("table", arrays[0], arrays[1], arrays[2])
    hand = HandTable(table, TITLES)  # type: ignore[arg-type]
    places = [hand.need(f"the period {name}", TITLES, form) for name, form in (("T1", _FIRST), ("T2", _SECOND))]
    centre = hand.find(_CENTRE)
    at = centre if centre is not None else hand.need("positions", TITLES, DISTANCE, _PLACE, without=places)
    sized = hand.find(AMPLITUDE, without=(*places, at))
    columns = complete(hand.values(at, DISTANCE, "m"), *(hand.values(one, TIME, "s") for one in places),
                       hand.values(sized, ANGLE, "deg"))
    x, first, second, sizes = columns
    assert x is not None
    assert first is not None
    assert second is not None
    number = hand.count(places[0]), hand.count(places[1])
    return _Readings(hand.source, x, first, second, number, sizes, centre is not None,
                     max(hand.rounding(one, TIME, "s") for one in places))
