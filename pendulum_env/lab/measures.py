"""Period, decay and law of damping of a free swing, and the periods of its single cycles, with uncertainties.

Every function takes an object with the arrays ``time`` [s] and ``angle`` [rad], such as a recording or a rollout.
Angles are measured from the equilibrium, so cut and centre a recording first: ``recording.released().centred()``.

The law of the damping follows from the envelope of a swing: amplitude loss per half swing against amplitude.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pendulum_env.common.texts import NOTE, clean
from pendulum_env.lab.checked import (
    FloatArray,
    RecordingError,
    check_half_turn,
    count,
    numbers,
    one_number,
    readings,
    series_of,
)
from pendulum_env.lab.noise import noise_level
from pendulum_env.lab.turning import CLEAR, AngleSeries, TurningPoints, hidden_in, turning_points
from pendulum_env.physics import exact
from pendulum_env.physics.units import BENCH, shown

_UNCLEAR = 0.25  # the number of oscillations estimated for a gap may differ from a whole number by less than this
_SHORT = 1 / 16  # of an oscillation: shorter gaps are interpolated, as they cannot hide an oscillation
_NEAREST = 4  # number of oscillations near a gap that give the period for counting those inside it
UNLIKELY = 0.2
"""Relative difference of a measured g from the expected one from which a length or a time base must be wrong."""
FINEST = 1e-12
"""Least error of a crossing, as a share of its time, for readings without noise."""


@dataclass(frozen=True)
class Measurement:
    """A measured value with its standard error, both in ``unit``."""

    value: float
    error: float
    unit: str

    def __truediv__(self, factor: float) -> Measurement:
        return Measurement(self.value / factor, self.error / abs(factor), self.unit)

    def __str__(self) -> str:
        size = self.error if 0 < self.error < math.inf else abs(self.value) * 1e-6
        digits = max(0, 1 - math.floor(math.log10(size))) if 0 < size < math.inf else 1
        return f"{self.value:.{digits}f} ± {self.error:.{digits}f} {self.unit}"


class FromFile:
    """Base of a sheet with a ``source`` and sentences ``how`` it was read: words of a file lose what is no text."""

    source: str
    how: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "source", clean(self.source))
        object.__setattr__(self, "how", tuple(clean(sentence, NOTE) for sentence in self.how))


def scaled(one: Measurement, factor: float, unit: str) -> Measurement:
    """Return a measurement times a factor, in another unit."""
    return Measurement(one.value * factor, one.error * abs(factor), unit)


def bounded_text(one: Measurement, freedom: float) -> str:
    """Return the text of a quantity that cannot be negative and whose best value is 0, at this bound.

    With 95 % it is below ``t error``, with Student's one-sided quantile t for the degrees of freedom.
    """
    limit = upper_limit(one, freedom)
    return f"0 (at its bound), below {limit:.2g}{' ' * bool(one.unit)}{one.unit} with 95 %"


def upper_limit(one: Measurement, freedom: float) -> float:
    """Return the value below which a quantity is with 95 %, from its error and the degrees of freedom."""
    from scipy.special import stdtrit

    return one.value + float(stdtrit(freedom, 0.95)) * one.error


def crossings(time: ArrayLike, angle: ArrayLike, *, level: float = 0.0) -> FloatArray:
    """Return the times [s] of the upward zero crossings of an angle, an interpolated array.

    A crossing goes from below ``-level`` to above ``+level`` [rad] (0: every change of sign). Its time is the zero of
    the straight line fitted to all readings from the one to the other; for two readings, linear interpolation.

    Raises RecordingError unless time and angle are finite arrays of one length, and for a level below 0.
    """
    beyond = one_number(level, "level", least=0.0, unit="rad")
    return crossings_with_errors(*readings(time, angle), beyond)[0]


def crossings_with_errors(time: FloatArray, angle: FloatArray, level: float) -> tuple[FloatArray, FloatArray]:
    """Return the times [s] of the upward zero crossings of an angle, and their errors [s] per rad of reading noise."""
    side = np.where(angle > level, 1, np.where(angle < -level, -1, 0))
    decided = np.flatnonzero(side)
    up = np.flatnonzero((side[decided[:-1]] < 0) & (side[decided[1:]] > 0))
    times, errors = np.empty(len(up)), np.empty(len(up))
    for k, (first, last) in enumerate(zip(decided[up], decided[up + 1], strict=True)):
        t, y = time[first : last + 1], angle[first : last + 1]
        middle, mean = float(t.mean()), float(y.mean())
        spread = float((t - middle) @ (t - middle))
        slope = float((t - middle) @ (y - mean)) / spread
        times[k] = middle - mean / slope
        errors[k] = math.sqrt(1 / len(y) + (mean / slope) ** 2 / spread) / slope
    return times, errors


def period(series: AngleSeries, n: int | None = None) -> Measurement:
    """Return the period [s], the mean of the first ``n`` oscillations (None: all) between upward zero crossings.

    T = (t_n - t_0) / n, with the error sqrt(s_0² + s_n²) / n. The error s_k of a crossing time follows from the noise
    of the readings that were interpolated. If the second differences of the crossing times scatter more than these
    errors allow, one common factor enlarges all of them; a period that drifts steadily with the amplitude adds nothing
    to second differences.

    Oscillations in a gap are counted with the period of the nearest complete ones. If oscillation n ends in a gap, the
    mean runs to the first crossing after the gap.

    Raises RecordingError if the series has fewer than n (at least one) oscillations, or if the number of oscillations
    in a gap is not clear.
    """
    n, (time, angle) = count(n, "oscillations"), series_of(series)
    sigma = noise_level(time, angle)
    times, errors = crossings_with_errors(time, angle, CLEAR * sigma)
    gaps = hidden_in(time, angle, _SHORT * float(np.median(np.diff(times))) if len(times) > 1 else 0.0)
    seen = ~((times[:, None] > time[gaps]) & (times[:, None] < time[gaps + 1])).any(axis=1)
    times, errors = times[seen], errors[seen]
    cycles = _cycles(times, time[gaps], n)
    available = int(cycles[-1]) if len(times) > 1 else 0
    taken = available if n is None else n
    if taken < 1 or taken > available:
        needed = f"{shown(max(taken, 1))} full oscillations about zero"
        raise RecordingError(f"the period needs {needed}, the series has {available} (is it centred?)")
    last = int(np.searchsorted(cycles, taken))
    taken = int(cycles[last])
    second = np.diff(times, 2)[np.diff(cycles, 2) == 0]
    own = np.maximum(sigma * errors, FINEST * np.abs(times[-1]))
    variance = (own[:-2] ** 2 + 4.0 * own[1:-1] ** 2 + own[2:] ** 2)[np.diff(cycles, 2) == 0]
    scatter = math.sqrt(float(np.mean(second**2 / variance))) if len(second) else 0.0
    error = max(1.0, scatter) * math.hypot(own[0], own[last])
    return Measurement(float(times[last] - times[0]) / taken, error / taken, "s")


def _cycles(times: FloatArray, gaps: FloatArray, n: int | None) -> NDArray[np.intp]:
    """Return, for every upward zero crossing, the number of oscillations since the first one, whole numbers.

    Successive crossings are one oscillation apart. Across a gap, the median of the nearest periods gives the number.

    Raises RecordingError if that number is not clear for a gap within the first n oscillations.
    """
    steps, count = np.diff(times), np.ones(max(len(times) - 1, 0))
    across = np.searchsorted(gaps, times[1:]) > np.searchsorted(gaps, times[:-1])
    for k in np.flatnonzero(across).tolist():
        if n is not None and np.round(count[:k]).sum() >= n:
            break
        near = np.flatnonzero(~across)
        near = near[np.argsort(np.abs(near - k), kind="stable")[:_NEAREST]]
        count[k] = steps[k] / np.median(steps[near]) if len(near) else math.nan
        if not abs(count[k] - max(np.round(count[k]), 1.0)) < _UNCLEAR:
            where = f"in the gap between {times[k]:.6g} s and {times[k + 1]:.6g} s"
            raise RecordingError(f"the period needs a whole number of oscillations {where}, "
                                 f"the nearest periods give {count[k]:.3g}")
    return np.concatenate([[0], np.cumsum(np.maximum(np.round(count), 1.0))]).astype(np.intp)


def decay_rate(series: AngleSeries, n: int | None = None) -> Measurement:
    """Return the damping rate gamma [1/s] of theta ~ exp(-gamma t / 2), from the first ``n`` amplitudes (None: all).

    The logarithmic decrement: -2 times the slope of ln(amplitude) against time, fitted with the weights
    (amplitude / error)². If the amplitudes scatter more than their errors, or do not decay exponentially, the error is
    multiplied by sqrt(chi² / degrees of freedom).

    This is the decay rate of the envelope. Linear drag takes a larger share of large swings, so the envelope's rate
    exceeds the drag coefficient gamma: by 0.2 % at 10 degrees, 1.5 % at 30, 6 % at 60, 16 % at 90. The error does not
    include this difference.

    Raises RecordingError for fewer than three amplitudes.
    """
    n, points = count(n, "amplitudes"), turning_points(series)
    return envelope_rate(points, slice(n))


def envelope_rate(points: TurningPoints, which: slice | NDArray[np.intp] = slice(None)) -> Measurement:
    """Return the damping rate gamma [1/s] as :func:`decay_rate` does, from the chosen turning points of a swing.

    ``which``: the turning points to use, a slice or an array of indices; by default all. Raises RecordingError for
    fewer than three.
    """
    time, size, error = points.time[which], points.amplitude[which], points.error[which]
    if len(time) < 3:
        raise RecordingError(f"the decay rate needs at least 3 amplitudes, the series gives {len(time)}")
    line = line_through(time, np.log(size), (size / np.maximum(error, 1e-12 * size)) ** 2)
    inflate = max(1.0, math.sqrt(line.chi2 / (len(time) - 2)))
    return Measurement(-2 * line.slope, 2 * inflate / math.sqrt(line.spread), "1/s")


@dataclass(frozen=True)
class Line:
    """A straight line ``y = height + slope (x - middle)`` through points; slope and height are uncorrelated.

    ``weight`` is the sum of the points' weights, ``spread`` that of ``weight (x - middle)²``, ``chi2`` that of the
    weighted squares of the residuals: with weights 1/error², the errors are ``1/sqrt(weight)`` of the height and
    ``1/sqrt(spread)`` of the slope.
    """

    middle: float
    height: float
    slope: float
    weight: float
    spread: float
    chi2: float

    def at(self, x: FloatArray) -> FloatArray:
        """Return the line's heights at an array of ``x``."""
        return self.height + self.slope * (x - self.middle)


def line_through(x: FloatArray, y: FloatArray, weight: FloatArray) -> Line:
    """Return the straight line through points with weights, by least squares."""
    middle, height = float(np.average(x, weights=weight)), float(np.average(y, weights=weight))
    t, rest = x - middle, y - height
    spread = float(weight @ (t * t))
    slope = float(weight @ (t * rest)) / spread
    return Line(middle, height, slope, float(weight.sum()), spread, float(weight @ (rest - slope * t) ** 2))


def scatter_factor(chi2: float, freedom: int, least: float = 1.0) -> float:
    """Return the factor on errors of few points that scatter more than their errors, at least ``least``.

    It is ``sqrt(chi²/freedom)`` times Student's quantile of 68 %, so that the error from the scatter of few points
    covers the truth in 68 % of cases, too. With ``least`` 0, the errors follow from the scatter alone.
    """
    from scipy.special import ndtr, stdtrit

    return max(least, math.sqrt(chi2 / freedom) * float(stdtrit(freedom, ndtr(1.0))))


def doubt_of_gravity(measured: float, expected: float) -> list[str]:
    """Return a list with a sentence if a gravity measured with a given length differs by UNLIKELY from the ``expected``
    one, both in m/s²; else an empty list."""
    off = measured / expected - 1.0
    if abs(off) < UNLIKELY:
        return []
    return [f"This g is {abs(off):.0%} {'above' if off > 0.0 else 'below'} {expected:g} m/s²: the length or the time "
            "base is wrong. Lengths are in m from the pivot to the bob's centre; --read rate=100 or time_unit=ms sets "
            "the time base."]


def doubt_of_length(period: float, length: float) -> list[str]:
    """Return a list with a question if a length [m] that follows from a period [s] is none of a bench; else an empty
    list."""
    _, long, (short, _), _ = BENCH["length"]
    if 0.1 * short < length < long:
        return []
    return [f"A period of {period:.3g} s is that of a pendulum of {length:.3g} m. If that is not meant, set the time "
            f"base by --read rate=100 or time_unit=ms; if it is, say so by --length {length:.3g}."]


P = TypeVar("P", float, Measurement)


def small_amplitude_period(period: P, amplitude: ArrayLike) -> P:
    """Return T0 = T / mean(2 K(sin(A/2)) / pi), the period [s] corrected to small amplitude.

    ``amplitude`` [rad] is one A, or an array of the A of all half swings that the period was averaged over; below pi. K
    is the complete elliptic integral of the first kind (Nelson & Olsson, Am. J. Phys. 54, 112, 1986).

    Raises RecordingError if an amplitude is negative, not finite, or not below pi.
    """
    if not isinstance(period, Measurement):
        period = one_number(period, "period", above=0.0, unit="s")
    angle = numbers(amplitude, "amplitude")
    if angle.size == 0 or not bool(np.all((angle >= 0) & (angle < math.pi))):
        raise RecordingError(f"amplitude must be between 0 and pi [rad], got {shown(amplitude)}")
    return period / float(np.mean(exact.period(angle, 2.0 * math.pi)))


SURE = 3.0
"""A drift counts as seen if it is larger than this many errors."""
FARTHEST = 2.0
"""Largest error by a drift, in drifts over the run: where the amplitude hardly changes, it is not the reason."""
SWINGS = 3
"""The damping is divided out of the periods of more half swings than this; fewer hardly show it."""


@dataclass(frozen=True, eq=False)
class Cycles:
    """Cycles of a swing, from one upward zero crossing to the next; ``time``, ``amplitude`` and ``period`` are arrays.

    Attributes:
        time: middle of every cycle [s].
        amplitude: mean amplitude of the cycle's two half swings [rad].
        period: duration of the cycle, corrected to small amplitude [s].
        left_out: number of cycles that are left out because readings are missing in them.
        variance: variance of every corrected period, from the noise of the readings [s²].
        shared: covariance of every corrected period with the next one [s²]; below 0 where both share a crossing, else
            0.
        damped: share of the period that the damping adds, which is divided out [1].
    """

    time: FloatArray
    amplitude: FloatArray
    period: FloatArray
    left_out: int
    variance: FloatArray
    shared: FloatArray
    damped: float

    @property
    def spread(self) -> float:
        """Largest relative deviation of a cycle's period, corrected to small amplitude, from the mean of all cycles."""
        mean = float(self.period.mean())
        return float(np.abs(self.period - mean).max()) / mean

    @property
    def drift(self) -> Measurement:
        """Change of the period, corrected to small amplitude, from the first cycle to the last, by a straight line [s].

        For fewer than three cycles the value is 0 with an infinite error.
        """
        return change(self.time, self.period)

    def mean(self, count: int | None = None) -> Measurement:
        """Return the period at small amplitude [s], the mean of the corrected periods of the first ``count`` cycles
        (None: all).

        The error follows from those of the crossing times and of the amplitudes. It is enlarged if successive corrected
        periods of the run differ by more than these errors allow. A drift of the corrected period over the run that is
        clear (SURE errors) is taken for ``slope A²``, as amplitudes that are wrong by a factor cause it: the mean of
        that over the cycles is added. The correction for damping is added too, as the law may not be linear.
        """
        taken = slice(count)
        periods, shared = self.period[taken], self.shared[taken][: len(self.period[taken]) - 1]
        value, number = float(periods.mean()), len(periods)
        variance = (float(self.variance[taken].sum()) + 2.0 * float(shared.sum())) / number**2
        next_to = self.shared < 0.0
        apart = (self.variance[1:] + self.variance[:-1] - 2.0 * self.shared)[next_to]
        # The mean square of k differences that share readings is 1 within 2/sqrt(k), even if the errors are right.
        scatter = float(np.mean(np.diff(self.period)[next_to] ** 2 / apart)) - 2.0 / math.sqrt(len(apart)) if (
            len(apart)) else 0.0
        square = self.amplitude**2
        falls = abs(change(self.time, square).value)
        share = min(float(square[taken].mean()) / falls, FARTHEST) if falls > 0.0 else FARTHEST
        wrong = share**2 * max(self.drift.value**2 - (SURE * self.drift.error) ** 2, 0.0)
        return Measurement(value, math.sqrt(max(1.0, scatter) * variance + wrong + (self.damped * value) ** 2), "s")


def change(time: FloatArray, y: FloatArray) -> Measurement:
    """Return the change of ``y`` from the first to the last of its times, by a straight line through points of equal
    errors; 0 with an infinite error for fewer than three points."""
    if len(time) < 3:
        return Measurement(0.0, math.inf, "s")
    away = time - time.mean()
    square = float(away @ away)
    slope = float(away @ y) / square
    rest = y - y.mean() - slope * away
    error = math.sqrt(float(rest @ rest) / (len(rest) - 2) / square)
    length = float(np.ptp(time))
    return Measurement(slope * length, error * length, "s")


def corrected_periods(series: AngleSeries) -> Cycles:
    """Return the period of every cycle, corrected to small amplitude: ``T0 = T / mean(2 K(sin(A/2)) / pi)`` [s].

    T is the time between upward zero crossings, A the amplitudes of the two half swings between them, K the complete
    elliptic integral of the first kind (Nelson & Olsson, Am. J. Phys. 54, 112, 1986). Damping at the rate gamma
    lengthens the period by the factor ``sqrt(1 + (gamma T/(4 pi))²)``, about ``1 + 1/(8 Q²)``, which is divided out
    too; this is exact for linear damping at small angles, and right in size for other laws. Angles must be measured
    from the equilibrium.

    Raises RecordingError if there is no complete cycle, or if the bob goes over the top.
    """
    time, angle = series_of(series)
    points, sigma = turning_points(series), noise_level(time, angle)
    ends, errors = crossings_with_errors(time, angle, CLEAR * sigma)
    places, gaps = np.searchsorted(points.time, ends), np.searchsorted(time[hidden_in(time, angle)], ends)
    complete = np.diff(places) > 0
    kept = np.flatnonzero(complete & (np.diff(gaps) == 0))
    if not len(kept):
        none = "none without a gap" if complete.any() else "none"
        raise RecordingError(f"corrected periods need a full oscillation about zero, the series has {none}")
    size = points.amplitude
    check_half_turn(size, "corrected periods need")
    spans = np.diff(ends)[kept]
    rate = envelope_rate(points).value if len(size) > SWINGS else 0.0
    damped = math.hypot(1.0, max(rate, 0.0) * float(spans.mean()) / (4.0 * math.pi))
    ratio = damped * exact.period(size, math.tau)
    larger = damped * exact.period(np.minimum(size + points.error, math.pi), math.tau)
    halves = [slice(places[k], places[k + 1]) for k in kept.tolist()]
    mean = np.array([ratio[part].mean() for part in halves])
    spread = np.array([np.linalg.norm((larger - ratio)[part]) / (part.stop - part.start) for part in halves])
    own = np.maximum(sigma * errors, FINEST * np.abs(ends[-1]))
    variance = (own[kept] ** 2 + own[kept + 1] ** 2 + (spans * spread / mean) ** 2) / mean**2
    shared = np.where(np.diff(kept) == 1, -(own[kept[1:]] ** 2) / (mean[1:] * mean[:-1]), 0.0)
    return Cycles(0.5 * (ends[kept] + ends[kept + 1]), np.array([size[part].mean() for part in halves]), spans / mean,
                  int(np.count_nonzero(complete)) - len(kept), variance, shared, damped - 1.0)


FEWEST = 8
"""Minimum number of amplitudes; fewer cannot separate the three laws of damping."""
NEXT = 1.5
"""Largest time between successive turning points, in half swings; after a longer time, readings are missing."""
_LEAST_EIGENVALUE = 1e-12
"""Floor for the eigenvalues of the scaled normal matrix; smaller ones occur if the amplitudes hardly differ."""
TOLD = 0.5
"""Largest error of a share of the loss that is a result; a share is between 0 and 1."""
LAWS = ("constant", "linear", "quadratic")
"""Growth of the loss with the amplitude: constant for dry friction, then for linear and for quadratic drag."""


@dataclass(frozen=True, eq=False)
class Losses:
    """Amplitude loss per half swing, ``A_i - A_(i+1) = s + l A + q A²`` at small angles, with A midway between the two.

    Attributes:
        amplitude: median amplitude [rad], at which the shares are given.
        terms: s [rad], l [1], q [1/rad], none below 0: ``s = 2 tau/omega0²``, ``l = pi gamma/(2 omega0)`` and
            ``q = 4 c/3``, with the friction torque per inertia tau, linear drag gamma and quadratic drag c.
        errors: standard errors of the terms, calculated without the bound at 0.
        shares: share of the loss at ``amplitude`` due to each term [1].
        misfit: sqrt(chi² / degrees of freedom); above 1, it enlarges the errors.
    """

    amplitude: float
    terms: tuple[float, float, float]
    errors: tuple[float, float, float]
    shares: dict[str, Measurement]
    misfit: float

    @property
    def text(self) -> str:
        """Clause on the constant, linear and quadratic shares of the loss per half swing, and on those that the
        recording does not tell."""
        if not self.told:
            return "the recording does not tell constant, linear and quadratic loss apart"
        shares = ", ".join(f"{percent(part)} {law}" for law, part in self.told.items())
        rest = " or ".join(law for law in LAWS if law not in self.told)
        return (f"the loss per half swing at {math.degrees(self.amplitude):.3g}° is {shares} in the amplitude"
                + (f"; the recording does not tell how much of the rest is {rest}" if rest else ""))

    @property
    def told(self) -> dict[str, Measurement]:
        """Shares that the recording tells: those with an error below a half (TOLD)."""
        return {law: part for law, part in self.shares.items() if part.error < TOLD}


def losses(points: TurningPoints) -> Losses:
    """Split the amplitude loss per half swing into parts constant, linear and quadratic in the amplitude, with errors.

    The method is weighted least squares of the differences of successive amplitudes, allowing for the correlation of
    two differences that share an amplitude. An error of the equilibrium is fitted too, and no term may be below 0. At
    larger angles, the powers of A are replaced by the exact work of the forces sign(v), v and |v| v along an undamped
    half swing of amplitude A, divided by the slope of the potential: ``A/sin A``, ``16 (E - (1 - m) K)/(pi sin A)`` and
    ``3 (1 - A/tan A)``, with the complete elliptic integrals K and E of parameter ``m = sin²(A/2)``. The loss in a half
    swing must be small compared with the amplitude.

    Source: the small-angle laws, Nelson & Olsson, Am. J. Phys. 54, 112 (1986). Raises RecordingError unless ``points``
    are TurningPoints with at least 8 amplitudes, all below half a turn.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    if not isinstance(points, TurningPoints):
        raise RecordingError(f"points must be TurningPoints, from turning_points(recording), not {shown(points)}")
    size, error = points.amplitude, np.maximum(points.error, 1e-9 * points.amplitude)
    if len(size) < FEWEST:
        raise RecordingError(f"the law of the damping needs at least {FEWEST} amplitudes, there are {len(size)}")
    check_half_turn(size, "the law of the damping needs")
    middle = 0.5 * (size[1:] + size[:-1])
    lasted = np.diff(points.time) / exact.period(middle, math.tau)
    usable = np.flatnonzero(lasted < NEXT * np.median(lasted))
    beside = -np.square(error[1:-1])
    covariance = np.diag(np.square(error[1:]) + np.square(error[:-1])) + np.diag(beside, 1) + np.diag(beside, -1)
    root = np.linalg.cholesky(covariance[np.ix_(usable, usable)])
    table = np.column_stack([*powers(middle), np.sign(points.angle[:-1]), size[:-1] - size[1:]])[usable]
    white = solve_triangular(root, table, lower=True)
    columns, side, wanted = white[:, :3], white[:, 3:4], white[:, 4]
    across = side / np.linalg.norm(side)
    columns, wanted = columns - across @ (across.T @ columns), wanted - across[:, 0] * (across[:, 0] @ wanted)
    scale = np.linalg.norm(columns, axis=0)
    terms, rest = nnls(columns / scale, wanted)
    misfit = math.sqrt(float(rest) ** 2 / (len(wanted) - 4))
    sizes, axes = np.linalg.eigh((columns / scale).T @ (columns / scale))
    plain = (axes / np.maximum(sizes, _LEAST_EIGENVALUE)) @ axes.T * max(1.0, misfit) ** 2
    terms, plain = terms / scale, plain / np.outer(scale, scale)
    amplitude = float(np.median(middle))
    return Losses(amplitude, tuple(terms.tolist()), tuple(np.sqrt(np.diag(plain)).tolist()),
                  _shares(terms, plain, amplitude), misfit)


def percent(part: Measurement) -> str:
    """Return a share and its standard error, a :class:`Measurement`, as text in per cent."""
    return str(Measurement(100.0 * part.value, 100.0 * part.error, "%"))


def powers(amplitude: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the functions of the amplitude that replace 1, A and A² in the loss at large angles; see :func:`losses`.
    """
    from scipy.special import ellipe, ellipk

    sine, m = np.sin(amplitude), np.sin(0.5 * amplitude) ** 2
    linear = 16.0 / math.pi * (ellipe(m) - (1.0 - m) * ellipk(m)) / sine
    quadratic = np.where(amplitude < 0.01, amplitude**2, 3.0 * (1.0 - amplitude / np.tan(amplitude)))
    return amplitude / sine, linear, quadratic


def _shares(terms: NDArray[np.float64], covariance: NDArray[np.float64], amplitude: float) -> dict[str, Measurement]:
    """Return the share of every term in the loss at an amplitude [rad], with first-order errors of at most 1."""
    parts = np.array([float(law[0]) for law in powers(np.array([amplitude]))])
    total = float(parts @ terms)
    if total <= 0.0:
        return {law: Measurement(0.0, 1.0, "1") for law in LAWS}
    shares = parts * terms / total
    slopes = (np.diag(parts) - np.outer(shares, parts)) / total
    errors = np.minimum(np.sqrt(np.diag(slopes @ covariance @ slopes.T)), 1.0)
    return {law: Measurement(float(share), float(error), "1")
            for law, share, error in zip(LAWS, shares, errors, strict=True)}
