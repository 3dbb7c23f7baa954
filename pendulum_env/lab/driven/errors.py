"""Errors of the numbers of driven logs, allowing for torques that are missing from the logs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.driven.log import DRIVES
from pendulum_env.lab.driven.problem import DrivenResiduals, DrivenSolution, Linearised, lower_bounds
from pendulum_env.lab.driven.windows import DRIVE, RATES, Windows
from pendulum_env.lab.fitting.core import bounded
from pendulum_env.lab.noise import noise_level

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
