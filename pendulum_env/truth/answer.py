"""The one type of answer of this room: what a run ought to give, how well that is known, and where it comes from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Truth:
    """A motion to compare runs with; nan where it is not known.

    Attributes:
        time, angle, velocity: [s, rad, rad/s], one entry per time.
        error: of the angle, estimated [rad]: one number for all times, or one per time.
        how: where it comes from, as a sentence for figures.
        closed: True if it is a closed form.
        turns: what ``angle`` leaves out, in whole turns; other than 0 only where an angle is taken from the nearer of
            bottom and top, so that it keeps its digits there.
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
        """True if there is a truth at all."""
        return bool(np.isfinite(self.angle).any())

    @property
    def error_estimate(self) -> float:
        """The largest error of the angle over the times [rad]."""
        return float(np.max(self.error))

    def __getitem__(self, rows: slice) -> Truth:
        """Return the truth at some of its times."""
        error, turns = (value[rows] if np.ndim(value) else value  # type: ignore[index]
                        for value in (self.error, self.turns))
        return replace(self, time=self.time[rows], angle=self.angle[rows], velocity=self.velocity[rows], error=error,
                       turns=turns)

    def distance(self, angle: ArrayLike, turns: ArrayLike = 0.0) -> Array:
        """Return how far a run's angles are from the truth at each time [rad]."""
        return np.asarray(np.abs(np.asarray(angle) - self.angle + 2.0 * math.pi * (np.asarray(turns) - self.turns)))

    def missed(self, angle: ArrayLike, velocity: ArrayLike) -> float:
        """Return how far off a run is, at the first of these times, where that is beyond the truth's error; else 0.0.

        The error of the velocity is taken to be that of the angle, per unit of ``time``.
        """
        begun = self[: len(np.asarray(angle))]
        apart = np.maximum(begun.distance(angle), np.abs(np.asarray(velocity) - begun.velocity))
        beyond = ~(apart <= begun.error)
        return float(np.max(apart[beyond])) if beyond.any() else 0.0

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take a pickle's fields; those of version 0.1 had no times, and ``error_estimate`` in place of ``error``."""
        if "error_estimate" in state:
            state = {"time": np.full(len(state["angle"]), np.nan), "error": state["error_estimate"],
                     **{name: value for name, value in state.items() if name != "error_estimate"}}
        self.__dict__.update(state)
