"""Runs of the exercise's pendulum: theta'' = -Omega² theta at small angles, -Omega² sin(theta) - gamma theta' at large.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from integrators import Method, MethodError, solve

Array = NDArray[np.float64]

STEP = 0.01
"""Step of all runs, unless a question changes it [s]."""
LONGEST = 1.5
"""Longest step allowed, in steps: the differences of rounded times may exceed one step, and must not be halved."""
SYMPLECTIC = "symplectic_euler"
"""Method of the runs at large angles."""
OWN = "own_step"
"""Name of the student's own step in runs and tables."""


@dataclass(frozen=True, eq=False)
class ExerciseMotion:
    """A run: arrays of time [s], angle [rad] and velocity [rad/s], and of energy over the initial energy [1].

    ``method`` is the method's name and ``dt`` its step [s].
    """

    method: str
    dt: float
    time: Array
    angle: Array
    velocity: Array
    energy: Array

    @property
    def ratio(self) -> float:
        """Energy at the end over energy at the start [1]."""
        return float(self.energy[-1])


def times(duration: float, dt: float = STEP) -> Array:
    """Return the array of the times of a run [s], from 0 in steps of ``dt`` to at least ``duration``."""
    return dt * np.arange(math.ceil(duration / dt - 1e-9) + 1, dtype=np.float64)


def small(omega: float, angle: float, method: str | Method, duration: float, dt: float = STEP) -> ExerciseMotion:
    """Run ``theta'' = -omega² theta`` from rest at ``angle`` [rad]."""
    square = omega * omega
    at = times(duration, dt)
    run = solve(lambda _t, q, _v: -square * q, angle, 0.0, list(at), method=method, h=LONGEST * dt)
    name = method if isinstance(method, str) else method.name
    return ExerciseMotion(name, dt, at, run.q, run.v, (run.v**2 + square * run.q**2) / (square * angle * angle))


def large(
    omega: float, angle: float, duration: float, gamma: float = 0.0, method: str | Method = SYMPLECTIC,
    dt: float = STEP,
) -> ExerciseMotion:
    """Run ``theta'' = -omega² sin(theta) - gamma theta'`` from rest at ``angle`` [rad]."""
    square = omega * omega
    at = times(duration, dt)

    def undamped(_t: float, q: float, _v: float) -> float:
        return -square * math.sin(q)

    def damped(_t: float, q: float, v: float) -> float:
        return -square * math.sin(q) - gamma * v

    run = solve(damped if gamma else undamped, angle, 0.0, list(at), method=method, h=LONGEST * dt)
    height = 2.0 * np.sin(0.5 * run.q) ** 2
    name = method if isinstance(method, str) else method.name
    return ExerciseMotion(name, dt, at, run.q, run.v,
                  (0.5 * run.v**2 + square * height) / (2.0 * square * math.sin(0.5 * angle) ** 2))


def finite(run: Callable[[], ExerciseMotion], duration: float) -> ExerciseMotion:
    """Return a run of the student's own step; MethodError if its numbers do not stay finite."""
    try:
        with np.errstate(all="ignore"):
            made = run()
        if all(np.isfinite(part).all() for part in (made.angle, made.velocity, made.energy)):
            return made
    except (ArithmeticError, ValueError):
        pass
    raise MethodError(f"The numbers of your step do not stay finite for {duration:g} s with steps of {STEP:g} s; look "
                      "for a mistake in it.")
