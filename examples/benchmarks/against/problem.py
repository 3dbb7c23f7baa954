"""Benchmark problem: ``theta'' = -RATE sin(theta) - gamma theta'`` from rest, recorded at common times."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATE = 9.81
"""omega0 squared [1/s²], for a length of 1 m on Earth."""
MIXED = "mixed"
"""Undamped scene in which many trajectories start from 1 degree to 1 degree below the top, in random order."""
GAMMA = {"undamped": 0.0, "damped": 0.005, MIXED: 0.0}
"""Linear drag [1/s] by scene; in 1000 s it reduces the amplitude to a twelfth."""
RECORDS = 200
"""Number of intervals between records."""
ALONE, FIRST, LAST = 2.0, 0.1, 2.5
"""Initial angle of a single trajectory, and first and last initial angle of many trajectories [rad]."""


class Problem(NamedTuple):
    """Benchmark problem: a scene of GAMMA, a duration [s], and the number of trajectories."""

    scene: str
    duration: float
    size: int

    @property
    def gamma(self) -> float:
        """Linear drag [1/s]."""
        return GAMMA[self.scene]

    @property
    def starts(self) -> Array:
        """Angles at time 0 [rad], ``(size,)``."""
        if self.size == 1:
            return np.array([ALONE])
        if self.scene == MIXED:
            return np.random.default_rng(1).permutation(np.radians(np.linspace(1.0, 179.0, self.size)))
        return np.linspace(FIRST, LAST, self.size)

    @property
    def times(self) -> Array:
        """Times of the records [s], ``(RECORDS + 1,)``."""
        return times_of(self.duration)

    @property
    def accuracies(self) -> tuple[float, ...]:
        """Accuracies to compare at [rad]: 1e-3 to 1e-12, or to 1e-10 over more than 100 s.

        After 1000 s, one ulp of omega0 changes the angle by 2e-12 rad.
        """
        return tuple(float(f"1e-{k}") for k in range(3, 13 if self.duration <= 100.0 else 11))

    @property
    def title(self) -> str:
        """Title of the problem's panel."""
        many = "1 trajectory" if self.size == 1 else f"{self.size} trajectories"
        return f"{self.scene}, {self.duration:g} s, {many}"


class Solver(Protocol):
    """Protocol of a solver prepared for one problem: ``solver(setting, duration) -> angles (size, RECORDS + 1)``."""

    def __call__(self, setting: Any, duration: float) -> Array: ...


def times_of(duration: float) -> Array:
    """Return RECORDS + 1 evenly spaced times from 0 to ``duration`` [s]."""
    return np.linspace(0.0, duration, RECORDS + 1)


def largest_error(angles: Array, truth: Array) -> float:
    """Return the largest |angle - truth| [rad]; inf if any angle is not finite."""
    error = float(np.max(np.abs(np.asarray(angles).reshape(truth.shape) - truth)))
    return error if np.isfinite(error) else float("inf")
