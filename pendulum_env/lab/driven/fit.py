"""Fit a pendulum with a motor to logs of driven runs: least squares by simulation in windows, and the errors.

The windows are as long as the logs allow. The errors of the numbers allow for torques that are missing from the logs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.checks import warn
from pendulum_env.common.progress import Progress, telling_of
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.driven.log import DRIVES, DrivenLog
from pendulum_env.lab.driven.problem import BOUNDS, DrivenResiduals, DrivenSolution, Linearised, lower_bounds
from pendulum_env.lab.driven.result import DrivenFit
from pendulum_env.lab.driven.start import LAGS, TRIES, start_of
from pendulum_env.lab.driven.windows import DELAY, DRIVE, LAG, RATES, STIFFNESS, Windows
from pendulum_env.lab.fitting.core import bounded, refit, search
from pendulum_env.lab.noise import noise_level
from pendulum_env.physics.units import SceneError, number, one_of, several, shown

Array = NDArray[np.float64]

WRONSKIAN = 0.2
"""Lower bound of the Wronskian in the effect of torque noise; see :func:`_walk`."""
DEGENERATE = 1e-9
"""Smallest eigenvalue of the scaled normal equations, relative to the largest, at which the logs determine all numbers.
"""


def solution_of(problem: DrivenResiduals, lost: tuple[tuple[int, float, float], ...]) -> DrivenSolution:
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
        size = np.sqrt(np.diag(normal))
        root = np.linalg.cholesky(normal / np.outer(size, size)).T
        pull = (point.own_slopes.T @ (weights * point.own) + pulled) / size
        target = np.asarray(np.linalg.solve(root.T, pull), dtype=np.float64)
        change = bounded(root, target, (least - point.values) * size) / size
        values = np.maximum(point.values + change, least)
        rates, (starts, residual) = problem.rates(values), problem.moved(values)
    return DrivenSolution(rates, free, covariance, max(freedom, 2.0), windows, lost, starts, residual, tuple(sigma),
                          tuple(noise))


def _widened(covariance: Array, problem: DrivenResiduals, inverse: Array) -> Array:
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


SEARCH, SHORT = 0.25, 0.5
"""Length of the first windows, and of the shortest ones of the fit, in periods of small swings."""
READINGS = 12
"""Fewest readings of a window."""
LONGER, LONGEST = 2.0, 2.0
"""Factor from one length of windows to the next, and the largest length, in periods of small swings."""
WORSE = 1.1
"""Windows are made longer as long as the residual grows by less than this factor."""
ASTRAY = 5.0
"""A window is left out if its residual is more than this factor above the usual one."""
ROUGH = {"ftol": 1e-5, "xtol": 1e-8, "max_nfev": 40}
"""Termination of the least-squares search."""
ROUNDS = 2
"""Number of refits at the end, each with weights from the residuals of the one before."""


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
    problem = _searched(DrivenResiduals(windows, rates, free))
    lost = tuple(windows.span(i) for i in _astray(problem))
    windows = Windows.of(logs, duration, omega0, skip, end).without(lost)
    if len(windows.places) < 2:
        raise RecordingError(f"{logs[0].source}: the {logs[0].kind} explains the motion in hardly any part of the log")
    progress(0.3, f"windows of {duration:.2g} s")
    problem = _searched(DrivenResiduals(windows, problem.rates(problem.at.values), free))
    while not (lost or measured) and duration * LONGER <= min(least, LONGEST * period):
        duration *= LONGER
        longer = Windows.of(logs, duration, omega0, skip, end)
        progress(min(0.3 + 0.6 * duration / least, 0.9), f"windows of {duration:.2g} s")
        trial = _searched(DrivenResiduals(longer, problem.rates(problem.at.values), free, _continued(problem, longer)))
        if not _rms(trial) < WORSE * _rms(problem):
            break
        problem = trial
    for _ in range(ROUNDS):
        problem.weight, _ = problem.weights(problem.at.residual**2)
        values = problem.at.values
        values, _ = refit(problem, values, problem.slopes(values, central=True), fresh=True)
        problem.slopes(values, central=True)
    return solution_of(problem, lost)


def _searched(problem: DrivenResiduals) -> DrivenResiduals:
    """Return a problem after a search that gives less weight to windows that are far off."""
    search(problem, problem.at.values, ROUGH, problem.loss)
    return problem


def _rms(problem: DrivenResiduals) -> float:
    return float(np.sqrt(np.mean(problem.at.residual**2)))


def _continued(before: DrivenResiduals, windows: Windows) -> Array:
    """Return starts of longer windows: those of the shorter windows that start at the same step, or measured ones."""
    known = {(place.log, place.step): start for place, start in zip(
        before.windows.places, before.at.starts, strict=True)}
    return np.array([known.get((place.log, place.step), start)
                     for place, start in zip(windows.places, windows.starts, strict=True)])


def _astray(problem: DrivenResiduals) -> list[int]:
    """Return the numbers of the windows whose residual is more than ASTRAY times the usual one of their log."""
    windows, squares = problem.windows, problem.at.residual**2
    size = np.array([float(np.sqrt(np.mean(squares[part]))) for part in windows.slices])
    log = np.array([place.log for place in windows.places])
    usual = np.array([max(float(np.median(size[log == i])), windows.logs[i].noise) for i in log])
    return np.flatnonzero(size > ASTRAY * usual).tolist()


EARLY = tuple(-share for share in TRIES[1:])


def fit_driven(
    logs: DrivenLog | Sequence[DrivenLog],
    *,
    inertia: float | None = None,
    moment: float | None = None,
    mass: float | None = None,
    gravity: float = 9.81,
    max_torque: float | None = None,
    hold: Mapping[str, float] | None = None,
    progress: Progress | bool | None = None,
) -> DrivenFit:
    """Fit a pendulum and its motor to one or several logs of driven runs, by least squares of simulated motions.

    The model is ``I theta'' = -M g sin(theta - zero) - b theta' - F sign(theta') + K u``, with friction that also
    sticks; u is the drive of the log, held between readings, later by ``delay`` and smoothed by ``lag``. The motion is
    simulated by the package's engine in windows of half a swing or more, each with its own start, so that errors cannot
    grow near the top. Windows whose motion the drive cannot explain, for example because a hand pushes, are left out
    and listed.

    Args:
        logs: a log or several, with the same kind of drive, of one pendulum with one sensor.
        inertia, moment, mass: the moment of inertia I [kg m²], the moment M of the mass [kg m], or the mass of a bob
            that counts as a point [kg]; give one of them to set the scale of all torques. Without one, torques in N m
            set the scale, and for actions and currents a mass of 1 kg is assumed.
        gravity: gravity [m/s²].
        max_torque: largest torque of the motor of the resulting scene [N m]; by default the largest torque in the
            logs, for actions the torque at action 1.
        hold: values of numbers that are not fitted, such as ``{"viscous": 0.0, "delay": 0.01}``: numbers of the
            equation ``theta'' = -stiffness sin(theta - zero) - viscous theta' - dry sign(theta') + drive u``, which are
            torques per moment of inertia, and "delay" or "lag" [s]. By default all are fitted, but the lag of measured
            torques and currents is 0.
        progress: True shows a progress bar, False none; a function is called with the fraction done and a text.

    Returns a DrivenFit. Warns if the fit is not usable, and if a mass is assumed. Raises RecordingError for logs that
    do not determine the parameters, with the reason, and SceneError for invalid values.
    """
    several_logs = (logs,) if isinstance(logs, DrivenLog) else tuple(several(logs, "logs", "logs"))
    if not several_logs or not all(isinstance(log, DrivenLog) for log in several_logs):
        raise RecordingError(f"logs must be one or several DrivenLogs, as from DrivenLog.read, got {shown(logs)}")
    kinds = list(dict.fromkeys(log.kind for log in several_logs))
    if len(kinds) > 1:
        raise RecordingError(f"logs must have one kind of drive, got {' and '.join(kinds)}")
    kind = kinds[0]
    given: dict[str, Any] = {name: number(value, name, above=0.0) for name, value in (
        ("inertia", inertia), ("moment", moment), ("mass", mass)) if value is not None}
    if len(given) > 1:
        raise SceneError(f"Give one of inertia, moment and mass, not {' and '.join(given)}; the fit gives the others.")
    known, value = next(iter(given.items()), ("torque", 1.0) if kind == "torque" else ("", 1.0))
    g = number(gravity, "gravity", above=0.0)
    peak = None if max_torque is None else number(max_torque, "max_torque", above=0.0)
    if hold is not None and not isinstance(hold, Mapping):
        raise SceneError(f"hold must be a dict of numbers, as {{'viscous': 0.0}}, not {shown(hold)}.")
    measured = DRIVES[kind].measured
    fixed = {LAG: 0.0} if measured else {}
    for name, number_held in (hold or {}).items():
        place = RATES.index(one_of(name, "hold", RATES))
        fixed[place] = number(number_held, f"hold[{name!r}]", least=0.0 if place in BOUNDS[kind] else None,
                              above=0.0 if place in (STIFFNESS, DRIVE) else None)
    places = tuple(place for place in range(len(RATES)) if place not in fixed)
    if not places:
        raise SceneError("hold leaves nothing to fit; leave one of its numbers out.")
    delays = (fixed[DELAY],) if DELAY in fixed else (*EARLY, *TRIES) if measured else TRIES
    lags = (fixed[LAG],) if LAG in fixed else LAGS
    with telling_of(progress, "fit") as telling:
        try:
            solution = solve(several_logs, places, fixed, delays, lags, telling)
        except RecordingError as error:
            raise RecordingError(f"{error}{_other_unit(several_logs)}") from None
    result = DrivenFit(several_logs, solution, g, known, value, peak)
    if not result.grade.usable:
        warn(result.grade.text)
    if not known:
        warn("A mass of 1 kg is assumed, as the motion shows torques only per moment of inertia; give mass=, inertia= "
             "or moment=.")
    return result


def _other_unit(logs: Sequence[DrivenLog]) -> str:
    """Return a clause that names the other unit of the angles if the unit of a log was inferred from them, else ""."""
    for unit, other in (("deg", "rad"), ("rad", "deg")):
        if any(note.startswith(f"unit: {unit}, inferred") for log in logs for note in log.notes):
            return f'; the angle is read in {unit}, which was inferred: give unit="{other}" if it is in {other}'
    return ""
