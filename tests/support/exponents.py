"""Largest Lyapunov exponents of the chaotic driven pendulum, by two methods that share no code, with their errors.

``python tests/support/exponents.py`` prints them, in about half an hour on one core. The pendulum is that of
:mod:`pendulum_env.hard_cases.chaos`. Nothing of the package is called.

Both methods follow independent motions from random starts, and begin to measure after SETTLE periods of the drive. The
exponent is the mean over the motions, and its standard error is their standard deviation over the root of their number,
which needs no assumption on how long a motion remembers.

- first variation: Runge and Kutta's method of order 4 advances the motion and a tangent vector.
- two motions: SciPy's DOP853 advances two motions 1e-8 apart, moved together to that distance after each period.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

DAMPING, RATE = 0.5, 2.0 / 3.0
PERIOD = 2.0 * math.pi / RATE
STRENGTHS = (1.15, 1.2, 1.5)
SETTLE = 200
"""Periods of the drive before the measurement."""
STEPS = 240
"""Steps per period of the method of order 4."""
APART, TOLERANCE = 1e-8, 1e-10
"""Distance of two motions, and tolerance of DOP853."""


class Measured(NamedTuple):
    """Result of one method, in 1/s.

    Attributes:
        value, error: mean of the exponents of all motions, and its standard error.
        spread: standard deviation of the exponent of one motion.
        least: smallest exponent of a motion; one below zero would belong to a motion that has left chaos.
    """

    value: float
    error: float
    spread: float
    least: float


def starts(motions: int, seed: int) -> Any:
    """Return random angles and velocities for a number of motions."""
    random = np.random.default_rng(seed)
    return np.array([random.uniform(-3.0, 3.0, motions), random.uniform(-2.0, 2.0, motions)])


def by_variation(strength: float, motions: int) -> Callable[[Any], tuple[Any, Any]]:
    """Return a function that advances motions and tangent vectors by a period, and returns them with their lengths."""
    h = PERIOD / STEPS
    drive = [strength * math.cos(RATE * 0.5 * h * i) for i in range(2 * STEPS + 1)]

    def rates(push: float, y: Any) -> Any:
        return np.array([y[1], push - DAMPING * y[1] - np.sin(y[0]), y[3], -DAMPING * y[3] - np.cos(y[0]) * y[2]])

    def advance(y: Any) -> tuple[Any, Any]:
        for i in range(STEPS):
            a = rates(drive[2 * i], y)
            b = rates(drive[2 * i + 1], y + 0.5 * h * a)
            c = rates(drive[2 * i + 1], y + 0.5 * h * b)
            d = rates(drive[2 * i + 2], y + h * c)
            y = y + h / 6.0 * (a + 2.0 * (b + c) + d)
        size = np.hypot(y[2], y[3])
        return np.array([np.remainder(y[0], 2.0 * math.pi), y[1], y[2] / size, y[3] / size]), size

    return advance


def by_two_motions(strength: float, motions: int) -> Callable[[Any], tuple[Any, Any]]:
    """Return a function that advances pairs of motions, given as the first one and the direction to the second."""

    def rates(t: float, flat: Any) -> Any:
        y = flat.reshape(4, motions)
        push = strength * math.cos(RATE * t)
        return np.concatenate([y[1], push - DAMPING * y[1] - np.sin(y[0]),
                               y[3], push - DAMPING * y[3] - np.sin(y[2])])

    def advance(y: Any) -> tuple[Any, Any]:
        pair = np.concatenate([y[0], y[1], y[0] + APART * y[2], y[1] + APART * y[3]])
        end = solve_ivp(rates, (0.0, PERIOD), pair, method="DOP853", rtol=TOLERANCE, atol=TOLERANCE,
                        t_eval=[PERIOD]).y[:, -1].reshape(4, motions)
        way, pace = end[2] - end[0], end[3] - end[1]
        size = np.hypot(way, pace)
        return np.array([np.remainder(end[0], 2.0 * math.pi), end[1], way / size, pace / size]), size / APART

    return advance


METHODS = {"first variation": (by_variation, 1), "two motions": (by_two_motions, 2)}
"""Method by name, and the seed of its starts."""


def measured(method: str, strength: float, motions: int, periods: int, settle: int = SETTLE) -> Measured:
    """Measure the largest exponent of a drive strength over a number of periods of each of some motions.

    They are measured after ``settle`` periods.
    """
    made, seed = METHODS[method]
    advance, grown = made(strength, motions), np.zeros(motions)
    y = np.concatenate([starts(motions, seed), np.ones((1, motions)), np.zeros((1, motions))])
    for period in range(-settle, periods):
        y, size = advance(y)
        grown += np.log(size) if period >= 0 else 0.0
    each = grown / (periods * PERIOD)
    spread = float(np.std(each, ddof=1))
    return Measured(float(np.mean(each)), spread / math.sqrt(motions), spread, float(np.min(each)))


def main() -> None:
    """Print the exponents of all drive strengths by both methods, and their weighted means."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    options.add_argument("--periods", type=int, default=2000, help="periods of the drive per motion [2000]")
    options.add_argument("--motions", type=int, default=2048, help="independent motions per method [2048]")
    given = options.parse_args()
    print(f"{given.motions} motions of {given.periods} periods each, after {SETTLE}")
    for strength in STRENGTHS:
        rows = [measured(method, strength, given.motions, given.periods) for method in METHODS]
        for name, row in zip(METHODS, rows, strict=True):
            print(f"g = {strength:<5g} {name:16} {row.value:.6f} +- {row.error:.6f} 1/s   "
                  f"one motion: spread {row.spread:.5f}, least {row.least:+.4f}", flush=True)
        weights = [row.error**-2 for row in rows]
        mean = sum(w * row.value for w, row in zip(weights, rows, strict=True)) / sum(weights)
        apart = (rows[0].value - rows[1].value) / math.hypot(rows[0].error, rows[1].error)
        print(f"g = {strength:<5g} {'mean':16} {mean:.6f} +- {sum(weights)**-0.5:.6f} 1/s   "
              f"apart by {abs(apart):.1f} standard errors", flush=True)


if __name__ == "__main__":
    main()
