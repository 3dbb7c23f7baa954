"""Remedies for a fit that leaves more than noise: one fault of the readings that explains the misfit, and its option.

Every fault adds a known shape to the readings: a step, a straight line, single readings, a second oscillation. These
shapes are fitted to the residual beside the derivatives of the model, which takes milliseconds. A wrong scale, unit,
column or damping is tried by a fit of its own, if there is a misfit. The fault with the lowest Bayesian information
criterion is refitted with the model, and named if the criterion falls by 10 or more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.errors import inverted
from pendulum_env.lab.fitting.model import SCALE, SENSOR, START, Model
from pendulum_env.lab.fitting.shooting import FitSolution, refit, solution_at, solve
from pendulum_env.lab.fitting.start import Measured
from pendulum_env.lab.fitting.statistics import bic, correlation_time
from pendulum_env.lab.inertial import integrated
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.noise import scatter_level
from pendulum_env.lab.recording import Recording, in_words, with_readings
from pendulum_env.physics import exact

Array = NDArray[np.float64]

JUMP, OUTLIERS, DRIFT, PERIOD, PUSH = "jump", "outliers", "drift", "period", "push"
"""Names of faults; the first three can be taken out of the readings."""
SUBTRACTED = "subtracted (--no-jumps leaves it in)"
"""Words on a jump of the zero that a fit has subtracted."""
GAIN = 10.0
"""Fall of the information criterion from which on a fault is named: "very strong" evidence (Kass & Raftery 1995)."""
MOST = 3
"""Largest number of faults that are named."""
MISFIT = 1.5
"""Residuals above this many errors of a reading are a misfit, for which faults are tried by fits of their own."""
NUMERICAL = 1e-6
"""Residuals below this share of the readings' range are errors of the simulated model; see ``model.STEPS``."""
FAR = 6.0
"""A reading is an outlier if it is this many standard deviations off."""
FEW = 0.05
"""Largest share of readings that can be outliers."""
EDGE = 0.02
"""Share of the readings at either end in which no jump of the zero is searched."""
LOCAL = 3.0
"""Standard deviations by which a step may differ from that which the readings near it show."""
DECAYS = (0.0, 2.0, 6.0, 20.0, 60.0)
"""Decay rates at which a second swing is searched, times the duration."""
STEEP = 0.1
"""Largest change of the period during a run, as a share of it, that is tried."""
SLOW = 0.3
"""Lowest frequency of a second swing, as a share of the swing's own: what is slower is a zero that moves."""
LARGEST = 0.25
"""Largest second swing, as a share of the range of the readings."""
SEEN = 15.0
"""Least peak of a periodogram, in mean powers, that is taken for a second swing; noise has peaks of 10."""
FADED = math.log(10.0)
"""A second swing counts as over when it has fallen to a tenth."""
ALIKE = 6.0
"""Faults count as alike if their criteria differ by less: "strong" evidence (Kass & Raftery 1995)."""
NEAR, SURE = 0.003, 0.03
"""A scale counts as that of a mistaken unit if it is within three errors and the first share of it, and if its error is
below the second share."""
UNITS = {
    math.pi / 180.0: ("radians that are read as degrees", "--unit rad"),
    180.0 / math.pi: ("degrees that are read as radians", "--unit deg"),
    0.5 / math.pi: ("turns that are read as radians", "--scale 6.28319"),
    1.0 / 360.0: ("turns that are read as degrees", "--scale 360"),
}
"""Ratios of the angles as they are read to the true ones that a mistaken unit makes, its words and its option."""
ALMOST = 0.97
"""A scale that leaves more than this share of the residuals explains nothing."""
DAMPINGS = ("linear", "quadratic", "coulomb")
"""Dampings of which a misfit may show that the model lacks one."""


@dataclass(frozen=True, eq=False)
class Remedy:
    """A fault of a recording that explains a misfit, and what to do about it.

    Attributes:
        name: kind of the fault: "scale", "unit", "column", "damping", "jump", "drift", "period", "push", "outliers" or
            "swing".
        text: the fault as a clause with its size.
        option: option of ``lab-pendulum fit`` that removes it; "" for none.
        number: size of the fault with its standard error.
        gain: fall of the Bayesian information criterion.
        change: what the fault adds to the readings, in their unit; 0 for a fault that only another fit removes.
        at: time of the fault on the clock of the file [s], where it has one.
        instead: True if it explains the misfit about as well as the first fault, so that only one of them is there.
        left: root mean square of the residuals that the fault does not explain, in the unit of the readings.
    """

    name: str
    text: str
    option: str
    number: Measurement
    gain: float
    change: Array
    at: float = math.nan
    instead: bool = False
    left: float = 0.0

    @property
    def sentence(self) -> str:
        """The fault and its option, such as "one reading at 12.5 s is 15° off: --robust"."""
        return f"{self.text}: {self.option}" if self.option else self.text


@dataclass(frozen=True, eq=False)
class TriedFault:
    """A fault that is tried, and what is left of the residuals with it.

    Attributes:
        name: kind of the fault; see :class:`Remedy`.
        parameters: number of its parameters: sizes, and the time, frequency or decay that were searched.
        residual: what no parameter of the model or the fault can change, in the unit of the readings.
        columns: changes of the readings by faults of size 1, ``(readings, sizes)``; None for a fit of its own.
        detail: indices of readings, or frequency [Hz] and decay rate [1/s] of a second swing.
        solution: the fit of the model without the fault.
        sizes, covariance: the sizes of the changes, in the unit of the readings.
    """

    name: str
    parameters: int
    residual: Array
    columns: Array | None = None
    detail: tuple[float, ...] = ()
    solution: FitSolution | None = None
    sizes: Array = field(default_factory=lambda: np.zeros(0))
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))


def remedies_of(solution: FitSolution, swing: Recording, measured: Measured, sigma: float) -> tuple[Remedy, ...]:
    """Return the faults of a recording that explain what a fit leaves, the one that explains most first.

    The criterion is that of the comparison of models, ``n' ln(RSS/n) + k ln n'``, with the number n' of independent
    readings of the closest fit. The next fault is searched in what the first leaves.

    Args:
        solution: the fit, with all dampings that are compared.
        swing: the fitted recording.
        measured: the turning points and the period of the recording.
        sigma: the error of a reading, in its unit.
    """
    found: list[Remedy] = []
    while len(found) < MOST:
        q = basis(solution.jacobian)
        base = _off(solution.residual, q)
        if _rms(base) < NUMERICAL * float(np.ptp(swing.readings)):
            break
        noise = MISFIT * max(scatter_level(swing.time, solution.residual), sigma)
        tried = [] if solution.lost else list(_shapes(solution, swing, measured, q, base, _rms(base) > noise))
        single, tau = [one for one in tried if one.name != JUMP or len(one.detail) == 1], math.inf
        gains = _gains(single, base, solution, 1.0)
        if gains and single[int(np.argmax(gains))].name == OUTLIERS:  # each of them is evidence of its own
            tried, tau = [one for one in single if one.name == OUTLIERS], 1.0
        gains = _gains(tried, base, solution, tau)
        best = tried[int(np.argmax(gains))] if max(gains, default=0.0) > GAIN else None
        # No scale, column or damping looks like a jump or an outlier; beside these they are tried if a misfit is left.
        sure = best is None or best.name in (JUMP, OUTLIERS)
        if not found and (not sure or _rms(base if best is None else best.residual) > noise):
            tried = [one for one in tried if one.name != PERIOD] + _fitted(solution, swing, measured, sigma)
        chosen = _best(tried, base, solution, tau)
        found += [replace(_named(fault, gain, swing), instead=i > 0, left=_rms(fault.residual))
                  for i, (fault, gain) in enumerate(chosen)]
        if len(chosen) != 1 or chosen[0][0].columns is None or chosen[0][0].name == PUSH:  # after a push, all is new
            break
        solution = chosen[0][0].solution or solution
    return tuple(found)


def _gains(tried: Sequence[TriedFault], base: Array, solution: FitSolution, tau: float) -> list[float]:
    """Return by how much every fault lowers the criterion, with the closest fit's number of independent readings, or
    with the correlation time ``tau`` if that is shorter."""
    if not tried:
        return []
    n, k = solution.jacobian.shape
    squares = [float(one.residual @ one.residual) for one in tried]
    effective = n / min(tau, correlation_time(tried[int(np.argmin(squares))].residual))
    return [bic(float(base @ base), n, k, effective) - bic(own, n, k + one.parameters, effective)
            for one, own in zip(tried, squares, strict=True)]


def _best(tried: list[TriedFault], base: Array, solution: FitSolution, tau: float) -> list[tuple[TriedFault, float]]:
    """Return the fault that lowers the criterion most, and those that lower it about as much, each with its gain.

    Faults that add a shape are confirmed by a refit of the model. The list is empty if no fault lowers it enough.
    """
    while True:
        gains = _gains(tried, base, solution, tau)
        best = {tried[i].name: i for i in sorted(range(len(tried)), key=lambda i: gains[i])}  # the best of every kind
        close = [i for i in reversed(best.values()) if gains[i] > max(GAIN, max(gains) - ALIKE)]
        close.sort(key=lambda i: -gains[i])
        rough = next((i for i in close if tried[i].solution is None), None)
        if rough is None:
            return [(tried[i], gains[i]) for i in close]
        tried[rough] = _confirmed(tried[rough], solution)


def _rms(residual: Array) -> float:
    """Return the root mean square of residuals."""
    return math.sqrt(float(np.mean(residual**2)))


def _confirmed(fault: TriedFault, solution: FitSolution) -> TriedFault:
    """Return a fault that adds a shape to the readings, with its sizes, after a refit of the model without it."""
    assert fault.columns is not None
    model, (n, k) = solution.model, solution.jacobian.shape
    readings = solution.residual + model.angles(solution.values)[0]
    sizes = _beside(solution, fault.columns)[k:]
    less = readings - fault.columns @ sizes
    values, squares = refit(model, less, solution.values, solution.jacobian)
    again = solution_at(model, values, less, np.full(n, math.sqrt(squares / n)))
    more = _beside(again, fault.columns)[k:]
    again = replace(again, residual=again.residual - fault.columns @ more)
    return _measured(replace(fault, solution=again), sizes + more)


def _measured(fault: TriedFault, sizes: Array) -> TriedFault:
    """Return a fault with its sizes and their covariance, from the fit of the model without it."""
    assert fault.columns is not None
    assert fault.solution is not None
    left, (n, k) = _beyond(fault.solution, fault.columns), fault.solution.jacobian.shape
    inverse, _ = inverted(np.column_stack([fault.solution.jacobian, fault.columns]))
    variance = float(left @ left) / max(n - k - len(sizes), 1) * correlation_time(left)
    return replace(fault, residual=left, sizes=sizes, covariance=variance * inverse[k:, k:])


def _beside(solution: FitSolution, columns: Array) -> Array:
    """Return changes of the parameters and sizes of the columns that fit the residuals best, together."""
    both = np.column_stack([solution.jacobian, columns])
    size = np.linalg.norm(both, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(both / size, solution.residual, rcond=None)[0] / size)


def _beyond(solution: FitSolution, columns: Array | None = None) -> Array:
    """Return the part of the residuals that neither the parameters nor the columns can change."""
    own = solution.jacobian if columns is None else np.column_stack([solution.jacobian, columns])
    return _off(solution.residual, basis(own))


def _off(values: Array, q: Array) -> Array:
    """Return the part of values that is orthogonal to the columns of an orthonormal basis."""
    return np.asarray(values - q @ (q.T @ values))


def basis(columns: Array) -> Array:
    """Return an orthonormal basis of the space of the columns of a matrix."""
    size = np.linalg.norm(columns, axis=0)
    q, r = np.linalg.qr(columns / np.where(size > 0.0, size, 1.0))
    return np.asarray(q[:, np.abs(np.diag(r)) > 1e-9])


def repaired(swing: Recording, remedies: Sequence[Remedy], note: str = "") -> Recording:
    """Return a recording without the jumps, the drift of the zero and the outliers among its faults, and with a note.
    """
    change = sum(one.change for one in remedies if one.name in (JUMP, OUTLIERS, DRIFT) and not swing.indirect)
    if not np.any(change):
        return swing
    return with_readings(replace(swing, notes=(*swing.notes, note)) if note else swing, swing.readings - change,
                         swing.angle - change)


# --- faults that add a shape to the readings -------------------------------------------------------------------------


def _shapes(
    solution: FitSolution, swing: Recording, measured: Measured, q: Array, base: Array, misfit: bool
) -> Iterator[TriedFault]:
    """Yield the faults that add a shape to the readings, each at its best place.

    ``base`` are the residuals that no parameter can change, ``q`` is a basis of what the parameters change; with a
    ``misfit``, several jumps are tried, too.
    """
    time = swing.time - swing.time[0]
    share = time / time[-1]

    def fault(name: str, columns: Array, parameters: int, *detail: float) -> TriedFault:
        return TriedFault(name, parameters, _off(base, basis(_off(columns, q))), columns, detail)

    yield fault(DRIFT, (share - 0.5)[:, None], 1)
    yield fault(PERIOD, (solution.velocity * _delay(time))[:, None], 1)
    for places in _jumps(q, swing.time, base, measured.period, MOST if misfit else 1):
        yield fault(JUMP, _steps(len(time), places), 2 * len(places), *places)
    motion = np.stack([swing.readings - solution.residual, solution.velocity], axis=1)
    motion[:, 0] -= solution.model.rest(solution.values)
    at = _push(q, base, motion)
    yield fault(PUSH, _steps(len(time), [at]) * motion, 3, at)
    size = np.abs(base)
    far = np.flatnonzero(size > FAR * max(1.4826 * float(np.median(size)), swing.reading_quantum))
    if 0 < len(far) <= FEW * len(base):
        single = (np.arange(len(base))[:, None] == far).astype(np.float64)
        yield fault(OUTLIERS, single, 2 * len(far), *far.tolist())
    second = _second_swing(q, time, measured.period, base)
    if second is not None:
        wave = _oscillation(time, *second)
        if np.hypot(*_beside(solution, wave)[-2:]) < LARGEST * float(np.ptp(swing.readings)):
            yield fault("swing", wave, 4, *second)


def _delay(time: Array) -> Array:
    """Return by how much a period that changes by a share of 1 during a run shifts every time [s]."""
    return np.asarray(time * (1.0 - time / time[-1]) / 2.0)


def _steps(count: int, places: Sequence[int]) -> Array:
    """Return a column for each place, 0 up to the reading there and 1 after it."""
    return (np.arange(count)[:, None] > np.asarray(places)).astype(np.float64)


def _jumps(q: Array, time: Array, base: Array, period: float, most: int) -> Iterator[list[int]]:
    """Yield the indices of the readings after which one step, two steps and more explain most of the residuals.

    Every step is placed where it explains most beside the others, which are then placed again. A step of which the two
    readings beside it, or those within a quarter of a period, show nothing is no jump, but another misfit.
    """
    places: list[int] = []
    for count in range(1, most + 1):
        places.append(_jump(q, base, places))
        for i in [*range(count)] * 2 if count > 1 else ():
            places[i] = _jump(q, base, places[:i] + places[i + 1:])
        sizes = np.linalg.lstsq(_off(_steps(len(time), places), q), base, rcond=None)[0]
        # If one step is not sudden, two may be: of two jumps, one alone is fitted between them.
        if all(_sudden(time, base, at, float(size), 0.25 * period) for at, size in zip(places, sizes, strict=True)):
            yield sorted(places)


def _sudden(time: Array, base: Array, at: int, size: float, reach: float) -> bool:
    """Return True if the residuals near a reading can have a step of this size after it, beside a parabola.

    The next reading, too, must differ by the step within the usual differences of neighbours: residuals that wander, as
    those of a smoothed sensor do, differ by less than the steps that fit them.
    """
    differences = np.diff(base)
    usual = 1.4826 * float(np.median(np.abs(differences)))
    if abs(float(differences[at]) - size) > LOCAL * usual + 0.25 * abs(size):
        return False
    near = np.flatnonzero(np.abs(time - time[at]) <= reach)
    away = (time[near] - time[at]) / reach
    columns = np.stack([np.ones(len(near)), away, away**2, near > at], axis=1)
    if len(near) < 8:
        return True
    found, squares, *_ = np.linalg.lstsq(columns, base[near], rcond=None)
    variance = float(squares.sum()) / (len(near) - 4) * float(np.linalg.pinv(columns.T @ columns)[3, 3])
    return abs(float(found[3]) - size) < LOCAL * math.sqrt(variance) + 0.25 * abs(size)


def _jump(q: Array, base: Array, others: Sequence[int]) -> int:
    """Return the index of the reading after which a step explains most of the residuals, beside steps at others."""
    def later(rows: Array) -> Array:
        return np.asarray(np.cumsum(rows[::-1], axis=0)[-2::-1])

    q = np.column_stack([q, basis(_off(_steps(len(base), others), q))]) if others else q
    left = _off(base, q)
    count = np.arange(len(base) - 1, 0, -1.0)
    own = count - np.square(later(q)).sum(axis=1)
    gain = np.square(later(left)) / np.maximum(own, 1e-6 * count)
    edge = min(max(8, int(EDGE * len(base))), len(base) // 2 - 1)
    return edge + int(np.argmax(gain[edge:-edge]))


def _push(q: Array, base: Array, motion: Array) -> int:
    """Return the index of the reading after which another amplitude and phase explain most of the residuals.

    ``motion`` are the angle and the velocity of the model as columns: their shares are changes of both.
    """
    def later(rows: Array) -> Array:
        return np.asarray(np.cumsum(rows[::-1], axis=0)[-2::-1])

    motion = motion / np.linalg.norm(motion, axis=0)
    along = later(motion * base[:, None])
    inside = later(q[:, :, None] * motion[:, None, :])
    gram = later(motion[:, :, None] * motion[:, None, :]) - np.einsum("nki,nkj->nij", inside, inside)
    gram += 1e-6 * np.eye(2)
    edge = min(max(8, int(EDGE * len(base))), len(base) // 2 - 1)
    gain = np.einsum("ni,ni->n", along, np.linalg.solve(gram, along[:, :, None])[:, :, 0])
    return edge + int(np.argmax(gain[edge:-edge]))


def _oscillation(time: Array, frequency: float, decay: float) -> Array:
    """Return cosine and sine with a frequency [Hz] and a decay rate [1/s] as columns."""
    wave = np.exp((2j * math.pi * frequency - decay) * time)
    return np.stack([wave.real, wave.imag], axis=1)


def _second_swing(q: Array, time: Array, period: float, base: Array) -> tuple[float, float] | None:
    """Return frequency [Hz] and decay rate [1/s] of the oscillation that explains most of the residuals; None without
    any, or for an overtone of the swing, which a sensor's or a model's curvature makes.

    It is searched in periodograms of residuals that are weighted by its decay, and then improved by least squares.
    """
    from scipy.fft import next_fast_len, rfft
    from scipy.optimize import least_squares

    step, duration = float(np.median(np.diff(time))), float(time[-1])

    def overtone(frequency: Array) -> NDArray[np.bool_]:
        order = np.round(frequency * period)
        near = np.abs(frequency - order / period) < np.maximum(2.0 / duration, 0.02 * frequency)
        return np.asarray((order > 1.0) & near)

    even = np.arange(0.0, duration + 0.5 * step, step)
    size = next_fast_len(4 * len(even), real=True)
    frequency = np.arange(size // 2 + 1) / (size * step)
    usable = (frequency > max(2.0 / duration, SLOW / period)) & ~overtone(frequency)
    evenly = np.interp(even, time, base)
    weights = np.exp(-np.outer(DECAYS, even / duration))
    powers = np.abs(rfft(evenly * weights, size)) ** 2 / np.square(weights).sum(axis=1)[:, None] * usable
    which, place = np.unravel_index(int(np.argmax(powers)), powers.shape)
    if powers[which, place] < SEEN * float(base @ base) / len(base):
        return None

    def left(x: Array) -> Array:
        own = _oscillation(time, x[0] / duration, abs(x[1]) / duration)
        own = _off(own, q)
        return np.asarray(base - own @ np.linalg.lstsq(own, base, rcond=None)[0])

    start = [frequency[place] * duration, DECAYS[int(which)]]
    x = least_squares(left, start, x_scale=(0.3, 1.0), max_nfev=20).x / duration
    slow = x[0] < max(2.0 / duration, SLOW / period)
    return None if slow or overtone(x[:1])[0] else (float(x[0]), abs(float(x[1])))


# --- faults that need another fit ------------------------------------------------------------------------------------


def _fitted(solution: FitSolution, swing: Recording, measured: Measured, sigma: float) -> list[TriedFault]:
    """Return the fits with a scale of the angles, with the readings as angular velocities if a scale explains some of
    the misfit, with all dampings, and with a period that changes."""
    found: list[TriedFault] = []
    model = solution.model
    drift = None if solution.lost else _with_drift(solution, swing)
    for name, fit in (("scale", _with_scale), ("column", _as_rates), ("damping", _with_all_dampings)):
        if name == "column" and found and _rms(found[0].residual) > ALMOST * _rms(solution.residual):
            continue  # to the period, rates that are taken for angles are angles with a wrong scale
        try:
            other = fit(model, swing, measured, sigma)
        except (ValueError, ArithmeticError, LookupError, np.linalg.LinAlgError):
            continue  # readings that cannot be so need no such remedy
        known = other is not None and bool(np.isfinite(np.diag(inverted(other.jacobian)[0])).all())
        if other is not None and known and not other.lost:
            more = max(len(other.model.names) - len(model.names), 1)
            found.append(TriedFault(name, more, _beyond(other), solution=other))
    return found if drift is None else [*found, drift]


def _with_drift(solution: FitSolution, swing: Recording) -> TriedFault | None:
    """Return the fit with a period that changes linearly: the model at times that are shifted accordingly.

    None if the period would have to change by more than a tenth (STEEP).
    """
    model, share, k = solution.model, 0.0, len(solution.values)
    time = swing.time - swing.time[0]
    for _ in range(5):
        column = (solution.velocity * _delay(time))[:, None]
        share += float(_beside(solution, column)[k])
        if abs(share) > STEEP:
            return None
        shifted = replace(model, time=swing.time + share * _delay(time))
        values, squares = refit(shifted, swing.readings, solution.values, solution.jacobian)
        solution = solution_at(shifted, values, swing.readings, np.full(len(time), math.sqrt(squares / len(time))))
    return _measured(TriedFault(PERIOD, 1, solution.residual, column, solution=solution), np.array([share]))


def _with_scale(model: Model, swing: Recording, measured: Measured, sigma: float) -> FitSolution | None:
    """Return the fit with the scale of the readings free; it starts where the periods of all swings agree best."""
    if SCALE in model.names:
        return None
    points = measured.points
    size, spans = 0.5 * (points.amplitude[1:] + points.amplitude[:-1]), np.diff(points.time)
    scales = np.geomspace(max(float(size.max()) / 3.0, 1e-3), 1e2, 400)
    small = spans / exact.period(size / scales[:, None], math.tau)
    away = np.median(np.abs(small / np.median(small, axis=1)[:, None] - 1.0), axis=1)
    best = int(np.argmin(away))
    scale = float(scales[best])
    found = replace(measured, angle=measured.angle / scale, velocity=measured.velocity / scale,
                    period=2.0 * float(np.median(small[best])),
                    points=replace(points, angle=points.angle / scale, error=points.error / scale))
    scaled = replace(model, names=(*START, SCALE, *model.names[len(START):]))
    start = found.start(scaled)
    start[scaled.names.index(SCALE)] = scale
    return solve(scaled, swing.readings, np.full(len(swing.time), sigma), start)


def _as_rates(model: Model, swing: Recording, measured: Measured, sigma: float) -> FitSolution | None:
    """Return the fit to the readings of an angle as angular velocities."""
    if swing.indirect or swing.displaced or swing.radius is not None:
        return None
    rates = Recording(swing.time, integrated(swing.time, swing.angle), swing.source, rate=swing.angle)
    start = Measured.of(rates).start(other := replace(model, rate=True))
    return solve(other, swing.readings, np.full(len(swing.time), sigma), start)


def _with_all_dampings(model: Model, swing: Recording, measured: Measured, sigma: float) -> FitSolution | None:
    """Return the fit with linear, quadratic and dry damping, unless the model has all of them or others."""
    if not set(model.damping) < set(DAMPINGS):
        return None
    free = tuple(name for name in model.free if name == SCALE or name not in SENSOR)
    other = Model.of(model.scene, DAMPINGS, model.time, free, DAMPINGS, model.rate, model.mount)
    return solve(other, swing.readings, np.full(len(swing.time), sigma), measured.start(other))


# --- words -----------------------------------------------------------------------------------------------------------


def _named(fault: TriedFault, gain: float, swing: Recording) -> Remedy:
    """Return a fault with its size in words, and the option that removes it."""
    assert fault.solution is not None
    solution, start = fault.solution, swing.release or 0.0
    errors = np.sqrt(np.maximum(np.diag(fault.covariance), 0.0))
    change = np.zeros(len(swing.time)) if fault.columns is None else fault.columns @ fault.sizes
    sign = {"degrees": "°", "degrees/s": "°/s"}.get(in_words(swing, 0.0)[1], " m/s²")
    end, at = float(swing.time[-1]) + start, math.nan

    def shown(size: float, error: float) -> tuple[Measurement, str]:
        number = Measurement(in_words(swing, size)[0], in_words(swing, error)[0], in_words(swing, size)[1])
        return number, f"{abs(number.value):.3g}{sign}"

    half = f"a shorter part has less of it, as --until {_clock(swing, 0.5 * (start + end))}"
    if fault.name == JUMP:
        largest = int(np.argmax(np.abs(fault.sizes)))
        times = [float(swing.time[int(place)]) + start for place in fault.detail]
        number, at = shown(float(fault.sizes[largest]), float(errors[largest]))[0], times[largest]
        steps = [f"by {in_words(swing, float(size))[0]:.3g}{sign} at {_clock(swing, time)} s"
                 for size, time in zip(fault.sizes, times, strict=True)]
        text, option = f"the zero jumps {' and '.join(steps)}", f"--until {_clock(swing, times[0])}"
    elif fault.name == DRIFT:
        number, size = shown(float(fault.sizes[0]), float(errors[0]))
        text, option = f"the zero drifts by {size} during the run", half
    elif fault.name == PUSH:
        at = float(swing.time[int(fault.detail[0])]) + start
        number = Measurement(100.0 * float(fault.sizes[0]), 100.0 * float(errors[0]), "%")
        text = f"the bob is pushed or touched at {_clock(swing, at)} s, where its amplitude changes by {number}"
        option = f"--until {_clock(swing, at)}"
    elif fault.name == PERIOD:
        number = Measurement(100.0 * float(fault.sizes[0]), 100.0 * float(errors[0]), "%")
        size_of = replace(number, value=abs(number.value))
        text = (f"the period {'grows' if number.value > 0.0 else 'falls'} by {size_of} during the run, because the "
                "length, the pivot or the clock changes")
        option = half
    elif fault.name == OUTLIERS:
        places = [int(place) for place in fault.detail]
        worst = int(np.argmax(np.abs(fault.sizes)))
        number, size = shown(float(fault.sizes[worst]), float(errors[worst]))
        at = float(swing.time[places[worst]]) + start
        text, option = _outliers(places, swing, at, size)
    elif fault.name == "swing":
        frequency, decay = fault.detail
        amplitude = float(np.hypot(*fault.sizes))
        along = fault.sizes / amplitude
        number, size = shown(amplitude, math.sqrt(float(along @ fault.covariance @ along)))
        ends = FADED / decay if decay > 0.0 else math.inf
        text, option = f"a second swing of {size} at {frequency:.3g} Hz", ""
        if ends < 0.5 * float(swing.time[-1]):
            faded = _clock(swing, ends + start)
            text, option = f"{text} until {faded} s", f"--read release={faded}"
    elif fault.name == "scale":
        return _scaled(solution, fault.residual, gain, change)
    elif fault.name == "column":
        number, size = shown(_rms(solution.residual), 0.0)
        text = f"the readings are angular velocities, not angles (as such, they are fitted within {size})"
        unit = "deg" if any(note.startswith("unit: deg") for note in swing.notes) else "rad"
        option = f"--columns time=1,rate=2 --unit {unit}"
    else:
        number, size = shown(_rms(solution.residual), 0.0)
        text, option = f"with all kinds of damping, the residual is {size} rms", "--effects auto"
    return Remedy(fault.name, text, option, number, gain, change, at)


def _outliers(places: Sequence[int], swing: Recording, worst: float, size: str) -> tuple[str, str]:
    """Return words for readings that are far off, and options."""
    start, around = swing.release or 0.0, 2.0 * float(np.median(np.diff(swing.time)))
    at = f"at {_clock(swing, worst)} s"
    if len(places) > 3:
        return f"{len(places)} readings are up to {size} off (the worst {at})", "--robust"
    spans = [":".join(_clock(swing, float(swing.time[place]) + start + side) for side in (-around, around))
             for place in places]
    what = f"one reading {at} is {size} off" if len(places) == 1 else (
        f"{len(places)} readings are up to {size} off (the worst {at})")
    return what, "--robust or " + " ".join(f"--drop {span}" for span in spans)


def _clock(swing: Recording, time: float) -> str:
    """Return a time as text, as finely as the readings follow one another, without zeros at the end."""
    digits = max(1, math.ceil(-math.log10(1.1 * float(np.median(np.diff(swing.time))))))
    return f"{time:.{digits}f}".rstrip("0").rstrip(".")


def _scaled(solution: FitSolution, residual: Array, gain: float, change: Array) -> Remedy:
    """Return the remedy for angles with a wrong scale, or in a wrong unit if the scale is that of one."""
    place = solution.model.names.index(SCALE)
    scale, inverse = float(solution.values[place]), inverted(solution.jacobian)[0]
    variance = float(residual @ residual) / max(len(residual) - len(solution.values), 1) * correlation_time(residual)
    error = math.sqrt(variance * float(inverse[place, place]))
    number = Measurement(scale, error, "1")
    for ratio, (words, option) in UNITS.items():
        if abs(scale - ratio) < 3.0 * error + NEAR * ratio and error < SURE * ratio:
            return Remedy("unit", f"the angles are {_factor(number)}: they are {words}", option, number, gain, change)
    names = [*(name for name in solution.model.free if name not in SENSOR), SCALE]
    return Remedy("scale", f"the angles are {_factor(number)}", f"--free {','.join(names)}", number, gain, change)


def _factor(scale: Measurement) -> str:
    """Return "3.02 ± 0.01 times too large", or "1.2 ± 0.1 % too small" for a scale near 1."""
    word = "large" if scale.value > 1.0 else "small"
    if abs(scale.value - 1.0) < 0.5:
        off = Measurement(100.0 * abs(scale.value - 1.0), 100.0 * scale.error, "%")
        return f"{off} too {word}"
    larger = scale if scale.value > 1.0 else Measurement(1.0 / scale.value, scale.error / scale.value**2, "1")
    return f"{str(larger).removesuffix(' 1')} times too {word}"
