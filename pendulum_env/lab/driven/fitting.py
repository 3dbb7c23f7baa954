"""Least-squares fit of driven logs by simulation in windows that are as long as the logs allow."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.progress import Progress
from pendulum_env.lab.checked import RecordingError
from pendulum_env.lab.driven.errors import solution_of
from pendulum_env.lab.driven.log import DRIVES, DrivenLog
from pendulum_env.lab.driven.problem import DrivenResiduals, DrivenSolution
from pendulum_env.lab.driven.start import start_of
from pendulum_env.lab.driven.windows import DELAY, DRIVE, LAG, STIFFNESS, Windows
from pendulum_env.lab.fitting.core import refit, search

Array = NDArray[np.float64]

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
