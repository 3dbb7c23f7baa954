"""Starting values of a fit of driven logs: a linear regression against smooth weights, which needs no derivatives.

Let phi be a smooth weight that vanishes, with its derivatives, at both ends of a stretch of a log. By parts, the
integral of phi theta'' is that of phi'' theta, so that ``theta'' = -k sin(theta - zero) - viscous theta' - dry
sign(theta') + drive u`` becomes one linear equation for each stretch, in which no reading is differentiated. Source:
Shinbrot 1957, Trans. ASME 79, 579 (method of moment functions).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.texts import listed
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.driven.drive import mean_drive

Array = NDArray[np.float64]


class Readings(Protocol):
    """Readings of a log, as arrays: times [s], angles [rad], and the drive that holds from each time to the next."""

    @property
    def time(self) -> Array: ...
    @property
    def angle(self) -> Array: ...
    @property
    def held(self) -> Array: ...
    @property
    def source(self) -> str: ...


PIECES = 48
"""Number of intervals into which a stretch is divided."""
LEAST = 8
"""Fewest readings of a stretch."""
MOST = 2000
"""Largest number of stretches of a log."""
TURNED = 2.0
"""Length of a stretch times omega0, at which the regression is taken: about a third of a swing."""
ROUNDS = 12
"""Number of times that weights of the robust regression are calculated anew."""
TRIES = (0.0, 0.01, 0.02, 0.04, 0.08, 0.16)
"""Delays that are tried, as a share of the period of small swings; of measured torques also below 0."""
LAGS = (0.0, 0.02, 0.06, 0.15)
"""Lags that are tried, as a share of the period of small swings."""

_WEIGHT = -140.0 * np.poly1d([1.0, -1.0, 0.0]) ** 3
"""The weight phi(s) = 140 (s (1 - s))³ for s from 0 to 1; its integral is 1."""


def regression(logs: Sequence[Readings], duration: float, delay: float, lag: float) -> tuple[Array, float]:
    """Return stiffness, viscous, dry, drive and zero of the regression, and the robust size of its residual [rad/s²].

    ``duration`` is the length of a stretch [s]; ``delay`` and ``lag`` are those of the drive [s].
    """
    rows, sums = zip(*(_equations(log, duration, delay, lag) for log in logs), strict=True)
    matrix, target = np.concatenate(rows), np.concatenate(sums)
    weight, size = np.ones(len(target)), 0.0
    values: Array = np.zeros(5)
    for _ in range(ROUNDS):
        values = np.asarray(np.linalg.lstsq(matrix * weight[:, None], target * weight, rcond=None)[0])
        off = target - matrix @ values
        size = 1.4826 * float(np.median(np.abs(off)))
        weight = 1.0 / (1.0 + (off / (3.0 * size + 1e-12)) ** 2)
    tilt = values[4] / values[0] if values[0] > 0.0 else 0.0
    values[4] = -math.asin(min(max(tilt, -1.0), 1.0))
    return values, float(np.sqrt(np.mean(np.minimum(np.abs(off), 4.0 * size) ** 2)))


def start_of(logs: Sequence[Readings], delays: tuple[float, ...], lags: tuple[float, ...]) -> Array:
    """Return starting values of all numbers of the equation of motion, in the order of ``windows.RATES``.

    ``delays`` and ``lags`` are the values to try: as a share of the period of small swings, or a single one in s.
    Raises RecordingError if the motion in the logs shows no restoring torque.
    """
    duration = _stretch(logs)
    values, _ = regression(logs, duration, 0.0, 0.0)
    period = math.tau / math.sqrt(values[0])
    late, slow = ([share * (period if len(tries) > 1 else 1.0) for share in tries] for tries in (delays, lags))
    best = min(((*regression(logs, duration, delay, lag), delay, lag) for delay in late for lag in slow),
               key=lambda entry: entry[1])
    (stiffness, viscous, dry, drive, zero), _, delay, lag = best
    if not stiffness > 0.0:
        raise _no_restoring(logs)
    return np.array([stiffness, max(viscous, 0.0), max(dry, 0.0), drive, delay, lag, zero])


def _stretch(logs: Sequence[Readings]) -> float:
    """Return the length of a stretch [s] nearest to TURNED/omega0, with the omega0 of its own regression."""
    least = max(LEAST * float(np.median(np.diff(log.time))) for log in logs)
    most = min(float(log.time[-1] - log.time[0]) for log in logs) / 4.0
    lengths = np.geomspace(min(least, most), most, 10)
    found = []
    for length in lengths:
        stiffness = float(regression(logs, float(length), 0.0, 0.0)[0][0])
        if stiffness > 0.0:
            found.append((abs(math.log(length * math.sqrt(stiffness) / TURNED)), float(length)))
    if not found:
        raise _no_restoring(logs)
    return min(found)[1]


def _no_restoring(logs: Sequence[Readings]) -> RecordingError:
    names = listed([log.source for log in logs])
    return RecordingError(f"{names}: the motion shows no torque towards the bottom; check that the angle is measured "
                          "from straight down (zero=) and is in the right unit (unit=)")


def _equations(log: Readings, duration: float, delay: float, lag: float) -> tuple[Array, Array]:
    """Return the equations of a log's stretches: rows of coefficients and right-hand sides [rad/s²]."""
    begin, end = float(log.time[0]), float(log.time[-1])
    count = max(1, min(MOST, int(8.0 * (end - begin) / duration)))
    h = duration / PIECES
    first = begin + np.arange(count) / count * max(end - begin - duration, 0.0)
    edges: Array = np.asarray(begin + h * np.arange(math.ceil((end - begin) / h) + 2), dtype=np.float64)
    middle = 0.5 * (edges[1:] + edges[:-1])
    angle = np.interp(middle, log.time, log.angle)
    drive = mean_drive(log.time, log.held, edges, delay, lag)
    swept = np.interp(middle + 2.0 * h, log.time, log.angle) - np.interp(middle - 2.0 * h, log.time, log.angle)
    place = np.minimum(np.round((first - begin) / h).astype(np.intp)[:, None] + np.arange(PIECES), len(middle) - 1)
    s = (np.arange(PIECES) + 0.5) / PIECES
    phi, slope, bend = (_WEIGHT.deriv(k)(s) / PIECES if k else _WEIGHT(s) / PIECES for k in range(3))
    theta = angle[place]
    near = theta - theta.mean(axis=1, keepdims=True)
    side = np.tanh(swept / (4.0 * h) / (0.02 / duration + 1e-12))
    rows = np.stack([-(np.sin(theta) @ phi), near @ slope / duration, -(side[place] @ phi), drive[place] @ phi,
                     -(np.cos(theta) @ phi)], axis=1)
    return rows, near @ bend / duration**2


def misfit(log: Readings) -> float:
    """Return the share of the acceleration that a regression with the zero at 0 leaves unexplained; inf if the motion
    shows no restoring torque."""
    try:
        duration = _stretch((log,))
    except RecordingError:
        return math.inf
    rows, target = _equations(log, duration, 0.0, 0.0)
    values = np.linalg.lstsq(rows[:, :4], target, rcond=None)[0]
    off = np.abs(target - rows[:, :4] @ values)
    return float(np.median(off) / (np.median(np.abs(target)) + 1e-300)) if values[0] > 0.0 else math.inf
