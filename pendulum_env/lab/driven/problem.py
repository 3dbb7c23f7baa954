"""Driven logs as a problem of least squares: numbers of the equation of motion, with the windows' starts eliminated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.driven.windows import DELAY, DRIVE, DRY, LAG, RATES, STIFFNESS, VISCOUS, ZERO, Windows
from pendulum_env.lab.fitting.core import derivatives

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
FAR = 2.0
"""A window has less weight if its residual is more than this factor above the usual one."""
BOUNDS: dict[str, dict[int, float]] = {
    "action": {VISCOUS: 0.0, DRY: 0.0, DELAY: 0.0, LAG: 0.0},
    "torque": {VISCOUS: 0.0, DRY: 0.0, LAG: 0.0},
    "current": {VISCOUS: 0.0, DRY: 0.0, LAG: 0.0},
}
"""Lower bounds of the numbers by the kind of drive: the delay of a measured torque may be negative,
as it may be recorded later than it acts; the delay of an action may not."""


def lower_bounds(kind: str, places: Sequence[int]) -> Array:
    """Return the lower bounds of numbers, by their places in RATES, for a kind of drive; -inf for none."""
    return np.array([BOUNDS[kind].get(place, -math.inf) for place in places])


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


class DrivenResiduals:
    """Residuals of logs in windows, for :mod:`core <pendulum_env.lab.fitting.core>`, by the equation's numbers.

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
