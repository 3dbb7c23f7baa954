"""Part 2 at large angles without friction: two minutes from 30 degrees, and the period against the amplitude."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from integrators import Method, solve
from pendulum_env.exercise.motion import LONGEST, STEP, SYMPLECTIC, Array, ExerciseMotion, finite, large, times
from pendulum_env.lab.measures import period
from pendulum_env.physics import exact

ANGLE = math.radians(30.0)
"""Release angle [rad]."""
DURATION = 120.0
"""Length of the run [s]."""
AMPLITUDES = (5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 75.0, 90.0, 120.0, 150.0)
"""Amplitudes at which the period is measured [degrees]."""
PERIODS = 8.0
"""Length of the runs that measure it, in periods of small swings."""


@dataclass(frozen=True)
class PeriodAt:
    """Period at one amplitude.

    Attributes:
        amplitude: amplitude [rad].
        measured: period of the simulated swing [s].
        exact: 4 K(sin(amplitude/2))/Omega, with the complete elliptic integral of the first kind [s].
    """

    amplitude: float
    measured: float
    exact: float


@dataclass(frozen=True, eq=False)
class LargeAngles:
    """Numbers and runs at large angles.

    Attributes:
        omega: angular frequency of small swings [rad/s].
        run: two minutes from 30 degrees.
        period: its measured period [s].
        exact: the exact period at 30 degrees [s].
        periods: period at every amplitude.
        own: the run with the student's own step; None without one.
    """

    omega: float
    run: ExerciseMotion
    period: float
    exact: float
    periods: tuple[PeriodAt, ...]
    own: ExerciseMotion | None


@dataclass(frozen=True, eq=False)
class Series:
    """A swing to measure: arrays of time [s] and angle [rad]."""

    time: Array
    angle: Array


def large_angles(omega: float, own: Method | None = None) -> LargeAngles:
    """Run the pendulum for two minutes from 30 degrees, also with the student's own step, and measure its period at ten
    amplitudes. Raises MethodError if the own step does not stay finite.
    """
    run = large(omega, ANGLE, DURATION)
    other = None if own is None else finite(lambda: large(omega, ANGLE, DURATION, method=own), DURATION)
    return LargeAngles(omega, run, period(run).value, float(exact.period(ANGLE, omega)), periods(omega), other)


def periods(omega: float) -> tuple[PeriodAt, ...]:
    """Measure the period of swings of all AMPLITUDES, with the step of the other runs."""
    sizes, at = np.radians(AMPLITUDES), times(PERIODS * math.tau / omega)
    run = solve(lambda _t, q, _v: -omega * omega * np.sin(q), sizes, np.zeros(len(sizes)), list(at),
                method=SYMPLECTIC, h=LONGEST * STEP)
    true = exact.period(sizes, omega)
    return tuple(PeriodAt(float(size), period(Series(at, run.q[:, i])).value, float(true[i]))
                 for i, size in enumerate(sizes))
