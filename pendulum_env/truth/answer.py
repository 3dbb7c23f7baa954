"""Class Truth: a reference solution with its error estimate and its origin, to compare runs with."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """Reference solution to compare runs with; nan at times where the motion is not known.

    Attributes:
        time, angle, velocity: [s, rad, rad/s], one entry per time.
        error: estimated error of the angle [rad]: one number for all times, or one per time.
        how: text on how the solution was computed, for figures.
        closed: True for a closed form.
        turns: whole turns to be added to ``angle``; other than 0 only if angles are measured from the nearer of bottom
            and top, which keeps their digits near the top.
    """

    time: Array
    angle: Array
    velocity: Array
    error: float | Array
    how: str
    closed: bool = False
    turns: float | Array = 0.0

    @property
    def known(self) -> bool:
        """True if the reference solution is known at any of its times (elsewhere it is nan)."""
        return bool(np.isfinite(self.angle).any())

    @property
    def error_estimate(self) -> float:
        """Largest estimated error of the reference angle over all times [rad]."""
        return float(np.max(self.error))

    def __getitem__(self, rows: slice) -> Truth:
        """Return the reference solution at some of its times, selected by the slice ``rows``."""
        error, turns = (value[rows] if np.ndim(value) else value  # type: ignore[index]
                        for value in (self.error, self.turns))
        return replace(self, time=self.time[rows], angle=self.angle[rows], velocity=self.velocity[rows], error=error,
                       turns=turns)

    def distance(self, angle: ArrayLike, turns: ArrayLike = 0.0) -> Array:
        """Return the absolute difference of a run's angles from the reference solution at each time [rad]."""
        return np.asarray(np.abs(np.asarray(angle) - self.angle + 2.0 * math.pi * (np.asarray(turns) - self.turns)))
