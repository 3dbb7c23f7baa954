"""The problem that all solve: ``theta'' = -RATE sin(theta) - gamma theta'``, from rest, recorded at common times."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE = 9.81
"""omega0 squared [1/s²]: one metre on earth."""
GAMMA = {"undamped": 0.0, "damped": 0.005}
"""Linear drag [1/s]; in 1000 s the swing falls to a twelfth."""
RECORDS = 200
"""Intervals between records."""
ALONE, FIRST, LAST = 2.0, 0.1, 2.5
"""Start of one trajectory, and first and last of many [rad]."""


class Problem(NamedTuple):
    """One panel: a scene of GAMMA, a duration [s], and how many trajectories."""

    scene: str
    duration: float
    size: int

    @property
    def gamma(self) -> float:
        return GAMMA[self.scene]

    @property
    def starts(self) -> Array:
        """Angles at time 0 [rad], ``(size,)``."""
        return np.array([ALONE]) if self.size == 1 else np.linspace(FIRST, LAST, self.size)

    @property
    def times(self) -> Array:
        """When all are recorded [s], ``(RECORDS + 1,)``."""
        return times_of(self.duration)

    @property
    def accuracies(self) -> tuple[float, ...]:
        """1e-3 to 1e-12 [rad]; over more than 100 s to 1e-10, for one ulp of omega0 moves the angle by 2e-12 there."""
        return tuple(float(f"1e-{k}") for k in range(3, 13 if self.duration <= 100.0 else 11))

    @property
    def title(self) -> str:
        many = "1 trajectory" if self.size == 1 else f"{self.size} trajectories"
        return f"{self.scene}, {self.duration:g} s, {many}"


class Solver(Protocol):
    """One line of the diagram on one problem, prepared: ``solver(setting, duration) -> angles (size, RECORDS + 1)``."""

    def __call__(self, setting: Any, duration: float) -> Array: ...


def times_of(duration: float) -> Array:
    """RECORDS + 1 times from 0 to the end [s]."""
    return np.linspace(0.0, duration, RECORDS + 1)


def largest_error(found: Array, truth: Array) -> float:
    """The largest |angle - truth| [rad]; infinite where anything is missing."""
    error = float(np.max(np.abs(np.asarray(found).reshape(truth.shape) - truth)))
    return error if np.isfinite(error) else float("inf")
