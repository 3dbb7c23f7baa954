"""Runs of the exercise's pendulum: theta'' = -Omega² theta at small angles, -Omega² sin(theta) - gamma theta' at large.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from integrators import solve

Array = NDArray[np.float64]

STEP = 0.01
"""Step of all runs, unless a question changes it [s]."""
LONGEST = 1.5
"""Longest step allowed, in steps: the differences of rounded times may exceed one step, and must not be halved."""
SYMPLECTIC = "symplectic_euler"
"""Method of the runs at large angles."""


@dataclass(frozen=True, eq=False)
class Motion:
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


def small(omega: float, angle: float, method: str, duration: float, dt: float = STEP) -> Motion:
    """Run ``theta'' = -omega² theta`` from rest at ``angle`` [rad]."""
    square = omega * omega
    at = times(duration, dt)
    run = solve(lambda _t, q, _v: -square * q, angle, 0.0, list(at), method=method, h=LONGEST * dt)
    return Motion(method, dt, at, run.q, run.v, (run.v**2 + square * run.q**2) / (square * angle * angle))


def large(
    omega: float, angle: float, duration: float, gamma: float = 0.0, method: str = SYMPLECTIC, dt: float = STEP
) -> Motion:
    """Run ``theta'' = -omega² sin(theta) - gamma theta'`` from rest at ``angle`` [rad]."""
    square = omega * omega
    at = times(duration, dt)

    def undamped(_t: float, q: float, _v: float) -> float:
        return -square * math.sin(q)

    def damped(_t: float, q: float, v: float) -> float:
        return -square * math.sin(q) - gamma * v

    run = solve(damped if gamma else undamped, angle, 0.0, list(at), method=method, h=LONGEST * dt)
    height = 2.0 * np.sin(0.5 * run.q) ** 2
    return Motion(method, dt, at, run.q, run.v,
                  (0.5 * run.v**2 + square * height) / (2.0 * square * math.sin(0.5 * angle) ** 2))
