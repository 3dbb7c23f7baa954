"""What frames show of the time before them: kept step by step, and only as far as a look asks for it."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, VELOCITY
from pendulum_env.films.picture import trail_length
from pendulum_env.physics.units import SceneError, shown
from pendulum_env.render import FrameStyle, PastSamples
from pendulum_env.render.strip import WINDOW

MOTION = ("time", "angle", "velocity")
LEDGER = {"kinetic_energy": "kinetic", "potential_energy": "potential", "heat": "heat", "work": "work",
          "energy_residual": "residual"}
"""Names in ``info`` of what a past holds -> their names there."""
MOST = 2000
"""Instants of a past, at most."""


def motion(values: Sequence[float], h: float) -> tuple[float, float, float]:
    """Time [s], unwrapped angle [rad] and velocity [rad/s] of a state after steps of ``h`` [s]."""
    return values[INDEX] * h, values[ANGLE] + TWO_PI * values[TURNS], values[VELOCITY]


def kept(dt: float) -> tuple[int, int]:
    """Steps of ``dt`` [s] from one instant of a past to the next, and how many instants it has."""
    return max(1, math.ceil(min(WINDOW / dt / MOST, 2.0**53))), math.ceil(min(WINDOW / dt, MOST)) + 2


class Reel:
    """The trail, and the past of the panels that show one, of one environment or of all of a vector.

    ``trail``: unwrapped angles [rad] after each step.  ``past``: rows of MOTION and, with ``energies``, of what
    ``info`` says of LEDGER, at the start and after each of so many steps.  Both hold floats, or arrays of one for each
    environment; nan is before the start of an environment's episode. None where the look has no use for them.
    """

    def __init__(self, look: FrameStyle, dt: float, energies: bool) -> None:
        self.names = (*MOTION, *(LEDGER if energies else ()))
        self.every, length = kept(dt)
        self.trail: deque[Any] | None = deque(maxlen=trail_length(dt)) if "trail" in look.needs else None
        self.past: deque[Any] | None = deque(maxlen=length) if "past" in look.needs else None
        self._steps = 0

    def begin(self, motion: Sequence[Any], info: Mapping[str, Any]) -> None:
        """Forget what was, and keep a start: time [s], unwrapped angle [rad], velocity [rad/s], and ``info``."""
        if self.trail is not None:
            self.trail.clear()
        if self.past is not None:
            self.past.clear()
            self.past.append(self._row(motion, info))
            self._steps = 0

    def keep(self, motion: Sequence[Any], info: Mapping[str, Any], start: bool = False) -> None:
        """Keep the end of a step: the same; of a vector it may be a start, too."""
        if self.trail is not None:
            self.trail.append(motion[1])
        if self.past is not None:
            self._steps += 1
            if start or self._steps % self.every == 0:
                self.past.append(self._row(motion, info))

    def cut(self, which: NDArray[np.intp]) -> None:
        """Forget what was before the last instant in these places of a vector, whose episodes begin there."""
        for angles in self.trail or ():
            angles[which] = np.nan
        for rows in list(self.past or ())[:-1]:
            rows[:, which] = np.nan

    def trail_of(self, place: int) -> list[float]:
        """The trail of one environment of a vector."""
        return [angle for angles in self.trail or () if not math.isnan(angle := float(angles[place]))]

    def past_of(self, place: int | None = None) -> PastSamples | None:
        """The past of an environment, of a vector where a place is given."""
        if self.past is None:
            return None
        found = chain.from_iterable(self.past) if place is None else chain.from_iterable(
            row[:, place] for row in self.past)
        rows = np.fromiter(found, float).reshape(-1, len(self.names))
        rows = rows[~np.isnan(rows[:, 0])]
        return PastSamples(**{LEDGER.get(name, name): rows[:, i] for i, name in enumerate(self.names)})

    def _row(self, motion: Sequence[Any], info: Mapping[str, Any]) -> Any:
        values = [*motion, *(info[name] for name in self.names[len(MOTION):])]
        return np.array(values) if isinstance(values[0], np.ndarray) else values

    def saved(self) -> dict[str, Any]:
        """Of one environment: what ``restore`` takes."""
        return {"trail": list(self.trail or ()), "past": [list(row) for row in self.past or ()], "seen": self._steps}

    def checked(self, saved: Mapping[str, Any]) -> tuple[list[list[float]], int]:
        """The rows of a past that was saved, and the steps it counts; none where there are none of this look's.

        Raises SceneError for what is no past.
        """
        rows, seen = saved.get("past", []), saved.get("seen", 0)
        if self.past is None:
            return [], 0
        if not (isinstance(rows, list | tuple) and all(map(self._is_row, rows)) and type(seen) is int and seen >= 0):
            raise SceneError(f"past in a state to restore must be rows of {len(self.names)} numbers that ascend in "
                             f"time, and seen a whole number, not {shown(rows)} and {shown(seen)}.")
        times = [row[0] for row in rows]
        if times != sorted(times):
            raise SceneError("past in a state to restore must ascend in time.")
        return [list(row) for row in rows], seen

    def _is_row(self, row: Any) -> bool:
        return (isinstance(row, list | tuple) and len(row) == len(self.names)
                and all(type(value) is float and math.isfinite(value) for value in row))

    def restore(self, trail: Iterable[float], past: Iterable[list[float]], steps: int) -> None:
        """Go back to what was kept."""
        if self.trail is not None:
            self.trail = deque(trail, maxlen=self.trail.maxlen)
        if self.past is not None:
            self.past = deque(past, maxlen=self.past.maxlen)
            self._steps = steps
