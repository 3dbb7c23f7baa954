"""Least-squares fit of driven logs by simulation in windows, allowing for torques missing from the logs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.driven.log import DRIVES, DrivenLog
from pendulum_env.lab.driven.start import start_of
from pendulum_env.lab.driven.windows import DELAY, DRIVE, DRY, LAG, RATES, STIFFNESS, VISCOUS, ZERO, Windows
from pendulum_env.lab.fitting.core import derivatives, refit, search
from pendulum_env.lab.noise import noise_level

Array = NDArray[np.float64]

NUDGES = {STIFFNESS: 1e-4, DRIVE: 1e-4, VISCOUS: 1e-3, DRY: 1e-3, DELAY: 1e-3, LAG: 1e-3, ZERO: 1e-4}
"""Change of a number for its numerical derivative, as a share of stiffness and drive, and in units of omega0, omega0²,
1/omega0, 1/omega0 and rad."""
AT_START = 1e-4
"""Change of the angle [rad] and of the velocity [omega0] at the start of a window for their derivatives."""
SOFTEST = 0.2
"""Smallest stiffness in a search, as a share of the one at its start."""
SEEN = 0.02
"""A change of a window's start counts if it moves the readings by more than this share of the change (rms).
Friction that holds the bob hides changes of its velocity."""
SHARES = (1.0, 0.3, 0.1, 0.03, 0.0)
"""Fractions of a proposed change of a window's start that are tried."""
SETTLE = 4
"""Number of steps in which the windows' starts are fitted alone, before the search."""
SEARCH, SHORT = 0.25, 0.5
"""Length of the first windows, and of the shortest ones of the fit, in periods of small swings."""
READINGS = 12
"""Fewest readings of a window."""
LONGER, LONGEST = 2.0, 2.0
"""Factor from one length of windows to the next, and the largest length, in periods of small swings."""
WORSE = 1.1
"""Windows are made longer as long as the residual grows by less than this factor."""
ASTRAY, FAR = 5.0, 2.0
"""A window is left out if its residual is more than ASTRAY times the usual one, and has less weight above FAR times."""
BOUNDS: dict[str, dict[int, float]] = {
    "action": {VISCOUS: 0.0, DRY: 0.0, DELAY: 0.0, LAG: 0.0},
    "torque": {VISCOUS: 0.0, DRY: 0.0, LAG: 0.0},
    "current": {VISCOUS: 0.0, DRY: 0.0, LAG: 0.0},
}
"""Lower bounds of the numbers by the kind of drive: the delay of a measured torque may be negative,
as it may be recorded later than it acts; the delay of an action may not."""
ROUGH = {"ftol": 1e-5, "xtol": 1e-8, "max_nfev": 40}
"""Termination of the least-squares search."""
ROUNDS = 2
"""Number of refits at the end, each with weights from the residuals of the one before."""
WRONSKIAN = 0.2
"""Lower bound of the Wronskian in the effect of torque noise; see :func:`_walk`."""
DEGENERATE = 1e-9
"""Smallest eigenvalue of the scaled normal equations, relative to the largest, at which the logs determine all numbers.
"""


def lower_bounds(kind: str, places: Sequence[int]) -> Array:
    """Return the lower bounds of numbers, by their places in RATES, for a kind of drive; -inf for none."""
    return np.array([BOUNDS[kind].get(place, -math.inf) for place in places])


@dataclass(frozen=True, eq=False)
class DrivenSolution:
    """Result of a fit of driven logs in the numbers of the equation of motion.

    Attributes:
        rates: the numbers, in the order of ``windows.RATES``.
        free: places of the fitted ones.
        covariance: their covariance, in the order of ``free``.
        freedom: degrees of freedom of their errors.
        windows: the windows that were fitted.
        lost: number of the log and times [s] of windows that were left out, as no torque in the log explains them.
        starts: fitted angle [rad] and velocity [rad/s] at the start of each window.
        residual: reading minus model of each reading of the windows [rad].
        sigma: standard deviation of a reading [rad], by log.
        torque_noise: size of the random torque per inertia that is missing from the log, by log: standard deviation of
            its integral over 1 s [rad/s].
    """

    rates: Array
    free: tuple[int, ...]
    covariance: Array
    freedom: float
    windows: Windows
    lost: tuple[tuple[int, float, float], ...]
    starts: Array
    residual: Array
    sigma: tuple[float, ...]
    torque_noise: tuple[float, ...]

    @property
    def rms(self) -> float:
        """Root mean square of the residual [rad]."""
        return float(np.sqrt(np.mean(self.residual**2)))


@dataclass(frozen=True, eq=False)
class Linearised:
    """Derivatives of the windows' readings at given numbers and starts.

    Attributes:
        values, starts: the free numbers, and the windows' starts.
        residual, slopes: readings minus model, and derivatives of the model by the free numbers.
        by_start: derivatives of the model by the angle and the velocity at the window's start.
        inverses: for every window, the matrix that turns residuals into changes of its start.
        own, own_slopes: residuals and derivatives less the part that changes of the windows' starts can produce.
    """

    values: Array
    starts: Array
    residual: Array
    slopes: Array
    by_start: Array
    inverses: list[Array]
    own: Array
    own_slopes: Array


class Driven:
    """Problem of :mod:`core <pendulum_env.lab.fitting.core>`: numbers of the equation of motion, and logs in windows.

    The windows' starts are eliminated: they move with the numbers as the derivatives predict, and the derivatives of
    the problem are the part of those by the numbers that no change of a start can produce.

    Attributes:
        windows: the windows.
        free: places of the free numbers in RATES.
        least: lower bounds of the free numbers, an array.
        weight: weight of every reading, an array.
        at: derivatives at the values that were accepted last.
    """

    def __init__(self, windows: Windows, rates: Array, free: tuple[int, ...], starts: Array | None = None) -> None:
        self.windows, self.free, self._rates, self.weight = windows, free, rates, np.ones(len(windows.angle))
        self.least = lower_bounds(windows.logs[0].kind, free)
        self.least[[place == STIFFNESS for place in free]] = SOFTEST * rates[STIFFNESS]
        values = rates[list(free)]
        self.at = self._linearised(values, windows.starts if starts is None else starts, central=False)
        for _ in range(SETTLE if starts is None else 1):
            self.residual(values)
            self.slopes(values)

    def rates(self, values: Array) -> Array:
        """Return all numbers, an array in the order of RATES, for values of the free ones."""
        rates = np.broadcast_to(self._rates, (*values.shape[:-1], len(RATES))).copy()
        rates[..., list(self.free)] = values
        return rates

    def sizes(self, values: Array) -> Array:
        """Return, for every free number, a change that would be large, an array."""
        return 100.0 * self._nudges(self.rates(values))

    def _nudges(self, rates: Array) -> Array:
        omega0 = math.sqrt(rates[STIFFNESS])
        units = {VISCOUS: omega0, DRY: omega0**2, DELAY: 1.0 / omega0, LAG: 1.0 / omega0, ZERO: 1.0}
        return np.array([NUDGES[place] * units.get(place, abs(rates[place])) for place in self.free])

    def moved(self, values: Array) -> tuple[Array, Array]:
        """Return the starts of the windows for values of the free numbers, and the residuals [rad] with them, arrays.

        Of the proposed change of a start, the best-fitting fraction (one of SHARES) is made: where friction holds the
        bob, or near the top, the derivatives predict the effect of small changes only.
        """
        left = self.at.residual - self.at.slopes @ (values - self.at.values)
        change = np.array([inverse @ left[part] for part, inverse in zip(
            self.windows.slices, self.at.inverses, strict=True)])
        trials = self.at.starts + np.array(SHARES)[:, None, None] * change
        missed = self.windows.angle - self.windows.angles(np.tile(self.rates(values), (len(trials), 1)), trials)
        squares = np.add.reduceat(missed**2, [part.start for part in self.windows.slices], axis=1)
        best = np.argmin(squares, axis=0)
        return trials[best, np.arange(len(best))], missed[best[self.windows.owner], np.arange(missed.shape[1])]

    def residual(self, values: Array, ahead: bool = False) -> Array:
        """Return readings minus model [rad], an array, times the roots of their weights; the starts move."""
        starts, residual = self.moved(values)
        self._latest = values.tobytes(), starts
        return np.asarray(residual * np.sqrt(self.weight))

    def slopes(self, values: Array, central: bool = False) -> Array:
        """Return the derivatives of the model, ``(readings, numbers)``, less what changes of the starts can produce,
        times the roots of the readings' weights."""
        if self._latest[0] != values.tobytes():
            self.residual(values)
        self.at = self._linearised(values.copy(), self._latest[1], central)
        return np.asarray(self.at.own_slopes * np.sqrt(self.weight)[:, None])

    def weights(self, squares: Array) -> tuple[Array, Array]:
        """Return weights of readings with these squared residuals, and the usual squares in the log of each, arrays.

        They are 1 for windows that fit, less for those that are far off, so that their pull on the result is at most
        that of FAR times the usual residual (Huber 1964, Ann. Math. Stat. 35, 73).
        """
        size = np.array([float(np.mean(squares[part])) for part in self.windows.slices])
        log = np.array([place.log for place in self.windows.places])
        usual = np.array([float(np.median(size[log == i])) for i in log]) + 1e-300
        weight = FAR / np.sqrt(np.maximum(size / usual, FAR**2))
        return weight[self.windows.owner], usual[self.windows.owner]

    def loss(self, squares: Array) -> Array:
        """Return Huber's loss of whole windows for squared residuals, and its first and second derivatives, an array
        ``(3, readings)``."""
        weight, usual = self.weights(squares)
        far = FAR**2 * usual * (2.0 / weight - 1.0)
        return np.stack([np.where(weight < 1.0, far, squares), weight, np.zeros_like(squares)])

    def _linearised(self, values: Array, starts: Array, central: bool) -> Linearised:
        """Simulate the windows with given numbers, and with slightly changed ones for the derivatives, in one batch."""
        windows, rates, count = self.windows, self.rates(values), len(self.free)
        begin = AT_START * np.array([1.0, math.sqrt(rates[STIFFNESS])])

        def simulated(rows: Array) -> Array:  # the last two numbers are changes of all starts
            return windows.angles(self.rates(rows[:, :count]), starts + rows[:, None, count:])

        seen, all_slopes = derivatives(
            simulated, np.append(values, [0.0, 0.0]), np.append(self._nudges(rates), begin),
            np.append(self.least, [-math.inf, -math.inf]), central)
        residual, slopes, by_start = windows.angle - seen, all_slopes[:, :count], all_slopes[:, count:]
        own, own_slopes, inverses = residual.copy(), slopes.copy(), []
        for part in windows.slices:
            u, s, v = np.linalg.svd(by_start[part] * begin, full_matrices=False)
            some = s >= SEEN * AT_START * math.sqrt(len(u))
            u, s, v = u[:, some], s[some], v[some]
            inverses.append(begin[:, None] * (v.T / s) @ u.T)
            own[part] -= u @ (u.T @ own[part])
            own_slopes[part] -= u @ (u.T @ own_slopes[part])
        return Linearised(values, starts, residual, slopes, by_start, inverses, own, own_slopes)


def solve(
    logs: Sequence[DrivenLog], free: tuple[int, ...], fixed: dict[int, float], delays: tuple[float, ...],
    lags: tuple[float, ...], progress: Progress,
) -> DrivenSolution:
    """Fit the numbers of the equation of motion to logs, in windows that are as long as the logs allow.

    The search begins in windows of a quarter of a period, from a linear regression. Windows that are far off are left
    out. Then, for actions, the windows are made longer as long as the residual hardly grows: without unknown torques,
    longer windows determine the numbers more accurately.

    Args:
        logs: the logs.
        free: places in RATES of the numbers to fit.
        fixed: values of the others.
        delays, lags: values to try at the start, in periods of small swings, or a single one in s.
        progress: function that is called with the fraction done and a short text.
    """
    rates = start_of(logs, delays, lags)
    for place, value in fixed.items():
        rates[place] = value
    if not rates[DRIVE] > 0.0:
        drive = logs[0].kind
        raise RecordingError(f"{logs[0].source}: a positive {drive} turns the pendulum towards negative angles; give "
                             "factor=-1 to reverse it")
    omega0 = math.sqrt(rates[STIFFNESS])
    period, usual = math.tau / omega0, max(float(np.median(np.diff(log.time))) for log in logs)
    skip, end = max(rates[DELAY] + 4.0 * rates[LAG], 0.0) * 1.5, max(-rates[DELAY], 0.0) * 1.5
    least = min(float(log.time[-1] - log.time[0]) for log in logs) - skip - end
    duration = max(SHORT * period, READINGS * usual)
    if least < 2.0 * duration:
        raise RecordingError(f"{logs[0].source}: a fit needs logs of at least {2.0 * duration + skip + end:.3g} s, the "
                             f"shortest has {least + skip + end:.3g} s")
    windows = Windows.of(logs, max(SEARCH * period, READINGS * usual), omega0, skip, end)
    measured = DRIVES[logs[0].kind].measured
    progress(0.1, "start")
    problem = _searched(Driven(windows, rates, free))
    lost = tuple(windows.span(i) for i in _astray(problem))
    windows = Windows.of(logs, duration, omega0, skip, end).without(lost)
    if len(windows.places) < 2:
        raise RecordingError(f"{logs[0].source}: the {logs[0].kind} explains the motion in hardly any part of the log")
    progress(0.3, f"windows of {duration:.2g} s")
    problem = _searched(Driven(windows, problem.rates(problem.at.values), free))
    while not (lost or measured) and duration * LONGER <= min(least, LONGEST * period):
        duration *= LONGER
        longer = Windows.of(logs, duration, omega0, skip, end)
        progress(min(0.3 + 0.6 * duration / least, 0.9), f"windows of {duration:.2g} s")
        trial = _searched(Driven(longer, problem.rates(problem.at.values), free, _continued(problem, longer)))
        if not _rms(trial) < WORSE * _rms(problem):
            break
        problem = trial
    for _ in range(ROUNDS):
        problem.weight, _ = problem.weights(problem.at.residual**2)
        values = problem.at.values
        values, _ = refit(problem, values, problem.slopes(values, central=True), fresh=True)
        problem.slopes(values, central=True)
    return _solution(problem, lost)


def _searched(problem: Driven) -> Driven:
    """Return a problem after a search that gives less weight to windows that are far off."""
    search(problem, problem.at.values, ROUGH, problem.loss)
    return problem


def _rms(problem: Driven) -> float:
    return float(np.sqrt(np.mean(problem.at.residual**2)))


def _continued(before: Driven, windows: Windows) -> Array:
    """Return starts of longer windows: those of the shorter windows that start at the same step, or measured ones."""
    known = {(place.log, place.step): start for place, start in zip(
        before.windows.places, before.at.starts, strict=True)}
    return np.array([known.get((place.log, place.step), start)
                     for place, start in zip(windows.places, windows.starts, strict=True)])


def _astray(problem: Driven) -> list[int]:
    """Return the numbers of the windows whose residual is more than ASTRAY times the usual one of their log."""
    windows, squares = problem.windows, problem.at.residual**2
    size = np.array([float(np.sqrt(np.mean(squares[part]))) for part in windows.slices])
    log = np.array([place.log for place in windows.places])
    usual = np.array([max(float(np.median(size[log == i])), windows.logs[i].noise) for i in log])
    return np.flatnonzero(size > ASTRAY * usual).tolist()


# --- errors ----------------------------------------------------------------------------------------------------------


def _solution(problem: Driven, lost: tuple[tuple[int, float, float], ...]) -> DrivenSolution:
    """Return a solution with the covariance of its numbers.

    The error of a reading is that of the sensor, plus the effect of a torque that is not in the log: white noise, as of
    a current sensor, which makes residuals within a window depend on one another. Its size follows from the residuals
    in the directions in which such a torque moves the readings. Errors of windows are independent.

    Noise of a measured torque also makes the derivative by the drive noisy, which biases least squares towards a
    smaller drive. The expected size of this part of the normal equations is subtracted (corrected score: Stefanski
    1989, Commun. Stat. Theory Methods 18, 4335). The corrected numbers stay within their BOUNDS.
    """
    windows, point, free, weights, rates = (
        problem.windows, problem.at, problem.free, problem.weight, problem.rates(problem.at.values))
    normal = (point.own_slopes * weights[:, None]).T @ point.own_slopes
    _check_determined(windows, normal, free)
    inverse: Array = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    sigma, noise = [], []
    meat, pulled, trust, loose = np.zeros_like(normal), np.zeros(len(free)), 0.0, 0.0
    for i, log in enumerate(windows.logs):
        parts = [k for k, place in enumerate(windows.places) if place.log == i]
        if not parts:
            sigma.append(log.noise)
            noise.append(0.0)
            continue
        white = _reading_error(windows, point, parts) ** 2
        walked, twice, plain_meat, walked_meat = (np.zeros_like(normal) for _ in range(4))
        first, second, fourth, seen, leaned = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in parts:
            part = windows.slices[k]
            own, slopes, weight = point.own[part], point.own_slopes[part], float(weights[part.start])
            walk = _walk(windows, point, k)
            along, square = walk @ slopes, walk @ walk
            walked += weight * slopes.T @ along
            twice += weight * along.T @ along
            plain_meat += weight * weight * slopes.T @ slopes
            walked_meat += weight * weight * slopes.T @ along
            first, second, fourth = first + np.trace(walk), second + np.sum(walk * walk), fourth + np.sum(square**2)
            seen += float(own @ walk @ own)
            leaned += weight * float(np.trace(walk))
        share = inverse @ walked
        rest = max(second - 2.0 * float(np.trace(inverse @ twice)) + float(np.trace(share @ share)), 0.2 * second)
        excess = max(seen - white * (first - float(np.trace(share))), 0.0) / rest
        sigma.append(math.sqrt(white))
        noise.append(math.sqrt(excess))
        meat += white * plain_meat + excess * walked_meat
        trust += second * rest / fourth
        loose += float(np.trace(inverse @ walked_meat)) * excess
        if DRIVES[log.kind].measured and DRIVE in free:
            step = float(np.median(np.diff(log.time)))
            known = (rates[DRIVE] * noise_level(log.time, log.drive)) ** 2 * step
            pulled[free.index(DRIVE)] += min(known, excess) * leaned / rates[DRIVE]
    covariance = inverse @ meat @ inverse
    if any(DRIVES[log.kind].measured for log in windows.logs):
        covariance = _widened(covariance, problem, inverse)
    share_of_walk = loose / float(np.trace(inverse @ meat))
    freedom = min(trust / max(share_of_walk, 1e-3) ** 2, float(len(point.own) - len(free)))
    starts, residual = point.starts, point.residual
    if pulled.any():
        least = lower_bounds(windows.logs[0].kind, free)
        change = _within_bounds(normal, point.own_slopes.T @ (weights * point.own) + pulled, least - point.values)
        values = np.maximum(point.values + change, least)
        rates, (starts, residual) = problem.rates(values), problem.moved(values)
    return DrivenSolution(rates, free, covariance, max(freedom, 2.0), windows, lost, starts, residual, tuple(sigma),
                          tuple(noise))


def _within_bounds(normal: Array, pull: Array, least: Array) -> Array:
    """Return the change of the numbers that normal equations and a pull on the numbers give, none below ``least``.

    A number that would go beyond its bound stops there, and the others are those that fit best with it.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import lsq_linear

    size = np.sqrt(np.diag(normal))
    root = np.linalg.cholesky(normal / np.outer(size, size)).T
    target = solve_triangular(root, pull / size, trans="T")
    return np.asarray(lsq_linear(root, target, (np.minimum(least * size, 0.0) - 1e-15, np.inf), method="bvls").x / size)


def _widened(covariance: Array, problem: Driven, inverse: Array) -> Array:
    """Return a covariance whose errors are at least those that the scatter between windows shows.

    Torque noise near a rest and noise of the derivatives have effects beyond the linear ones of white noise. The
    scatter is that of the windows' pulls on the numbers (sandwich estimate: White 1980, Econometrica 48, 817), with the
    factor n/(n - p) for n windows and p numbers.
    """
    point = problem.at
    pulls = np.array([problem.weight[part] * point.own[part] @ point.own_slopes[part]
                      for part in problem.windows.slices])
    count, fitted = pulls.shape
    if count < 2 * fitted:
        return covariance
    scatter = inverse @ (pulls.T @ pulls) @ inverse * count / (count - fitted)
    ratio = np.sqrt(np.maximum(np.diag(scatter) / np.diag(covariance), 1.0))
    return np.asarray(covariance * np.outer(ratio, ratio))


def _check_determined(windows: Windows, normal: Array, free: tuple[int, ...]) -> None:
    """Raise RecordingError if the logs do not determine all free numbers, with the names of those that they mix."""
    names, size = [RATES[place] for place in free], np.sqrt(np.diag(normal))
    for name, own in zip(names, size, strict=True):
        if not own > 0.0:
            raise RecordingError(f"{windows.logs[0].source}: the {name} has no effect on the motion; hold it")
    values, vectors = np.linalg.eigh(normal / np.outer(size, size))
    if values[0] < DEGENERATE * values[-1]:
        mixed = [name for name, share in zip(names, np.abs(vectors[:, 0]), strict=True) if share > 0.3]
        raise RecordingError(f"{windows.logs[0].source}: the logs do not determine {' and '.join(mixed)} separately, "
                             "as the drive excites too little; log a drive that changes more, or hold one of them")


def _reading_error(windows: Windows, point: Linearised, parts: Sequence[int]) -> float:
    """Return the standard deviation of a reading, from successive residuals; at least that of rounding [rad]."""
    log = windows.logs[windows.places[parts[0]].log]
    differences = np.concatenate([np.diff(point.residual[windows.slices[k]]) for k in parts])
    return max(float(np.sqrt(0.5 * np.mean(differences**2))), log.quantum / math.sqrt(12.0), 1e-12)


def _walk(windows: Windows, point: Linearised, number: int) -> Array:
    """Return the covariance of a window's readings for white torque noise of unit size [s³], less the part that a
    change of the window's start can produce.

    A pulse of torque at time s moves the angle at t by ``(b(t) a(s) - a(t) b(s))/w(s)``, where a and b are its
    derivatives by the angle and the velocity at the window's start, and ``w = a b' - a' b`` is their Wronskian, which
    friction makes smaller at each turning point. It is taken to be at least WRONSKIAN, as a pulse does not move a bob
    that friction holds.
    """
    part = windows.slices[number]
    time, (a, b) = windows.since[part] * windows.h, point.by_start[part].T
    earlier = np.minimum.outer(np.arange(len(time)), np.arange(len(time)))
    wronskian = np.clip(a * np.gradient(b, time) - b * np.gradient(a, time), WRONSKIAN, 1.0) ** 2
    aa, ab, bb = (_running(x / wronskian, time)[earlier] for x in (a * a, a * b, b * b))
    walk = np.outer(b, b) * aa - (np.outer(b, a) + np.outer(a, b)) * ab + np.outer(a, a) * bb
    u, s, _ = np.linalg.svd(point.inverses[number].T, full_matrices=False)
    base = u[:, s > 1e-9 * float(s[0])]
    walk -= base @ (base.T @ walk)
    return np.asarray(walk - (walk @ base) @ base.T)


def _running(values: Array, time: Array) -> Array:
    """Return the integral of values from the first time to each time, by the trapezoidal rule."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
