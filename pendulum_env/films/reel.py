"""Recording of the last seconds of a motion for frames: the trail and, for some panels, samples of all energies."""

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
"""Names of the first columns of recorded samples."""
LEDGER = {"kinetic_energy": "kinetic", "potential_energy": "potential", "heat": "heat", "work": "work",
          "energy_residual": "residual"}
"""Names of energies in ``info`` -> their names in :class:`pendulum_env.render.PastSamples`."""
MOST = 2000
"""Largest number of samples that are recorded of the time before a frame."""


def motion(values: Sequence[float], h: float) -> tuple[float, float, float]:
    """Return time [s], unwrapped angle [rad] and velocity [rad/s] of a state after steps of ``h`` [s]."""
    return values[INDEX] * h, values[ANGLE] + TWO_PI * values[TURNS], values[VELOCITY]


def kept(dt: float) -> tuple[int, int]:
    """Return the number of steps of ``dt`` [s] between recorded samples, and the number of samples before a frame."""
    return max(1, math.ceil(min(WINDOW / dt / MOST, 2.0**53))), math.ceil(min(WINDOW / dt, MOST)) + 2


class Reel:
    """Recorder of the last seconds of a motion for the frames of one environment, or of a vector of environments.

    Attributes:
        trail: unwrapped angles [rad] after every step.
        past: rows of MOTION and, with ``energies``, of the entries of LEDGER in ``info``, at the start and after every
            ``every`` steps.

    Both hold floats or, for a vector, arrays with a value for each environment and nan before the start of its episode.
    They are None where no panel shows them.
    """

    def __init__(self, look: FrameStyle, dt: float, energies: bool) -> None:
        self.names = (*MOTION, *(LEDGER if energies else ()))
        self.every, length = kept(dt)
        self.trail: deque[Any] | None = deque(maxlen=trail_length(dt)) if "trail" in look.needs else None
        self.past: deque[Any] | None = deque(maxlen=length) if "past" in look.needs else None
        self._steps = 0

    def begin(self, motion: Sequence[Any], info: Mapping[str, Any]) -> None:
        """Delete all samples and record a start: (time [s], unwrapped angle [rad], velocity [rad/s]) and ``info``."""
        if self.trail is not None:
            self.trail.clear()
        if self.past is not None:
            self.past.clear()
            self.past.append(self._row(motion, info))
            self._steps = 0

    def keep(self, motion: Sequence[Any], info: Mapping[str, Any], start: bool = False) -> None:
        """Record the end of a step: (time [s], unwrapped angle [rad], velocity [rad/s]) and ``info``.

        start: True if some environment of a vector begins an episode here.
        """
        if self.trail is not None:
            self.trail.append(motion[1])
        if self.past is not None:
            self._steps += 1
            if start or self._steps % self.every == 0:
                self.past.append(self._row(motion, info))

    def cut(self, which: NDArray[np.intp]) -> None:
        """Delete all samples but the last of the environments at indices ``which``, as their episodes begin there."""
        for angles in self.trail or ():
            angles[which] = np.nan
        for rows in list(self.past or ())[:-1]:
            rows[:, which] = np.nan

    def trail_of(self, place: int) -> list[float]:
        """Return the trail [rad] of the environment at an index of a vector."""
        return [angle for angles in self.trail or () if not math.isnan(angle := float(angles[place]))]

    def past_of(self, place: int | None = None) -> PastSamples | None:
        """Return the recorded samples of an environment, or of the one at the index ``place`` of a vector."""
        if self.past is None:
            return None
        values = chain.from_iterable(self.past) if place is None else chain.from_iterable(
            row[:, place] for row in self.past)
        rows = np.fromiter(values, float).reshape(-1, len(self.names))
        rows = rows[~np.isnan(rows[:, 0])]
        return PastSamples(**{LEDGER.get(name, name): rows[:, i] for i, name in enumerate(self.names)})

    def _row(self, motion: Sequence[Any], info: Mapping[str, Any]) -> Any:
        """Return a sample in the order of ``names``: a list of floats, or an array with a column per environment."""
        values = [*motion, *(info[name] for name in self.names[len(MOTION):])]
        return np.array(values) if isinstance(values[0], np.ndarray) else values

    def saved(self) -> dict[str, Any]:
        """Return the samples of one environment as plain lists; :meth:`checked` and :meth:`restore` take them back."""
        return {"trail": list(self.trail or ()), "past": [list(row) for row in self.past or ()], "seen": self._steps}

    def checked(self, saved: Mapping[str, Any]) -> tuple[list[list[float]], int]:
        """Return the rows of saved samples and the number of steps so far, after a check.

        They are empty and 0 where no panel shows them. Raises SceneError for rows that are not saved samples.
        """
        rows, seen = saved.get("past", []), saved.get("seen", 0)
        if self.past is None:
            return [], 0
        if not (isinstance(rows, list | tuple) and all(map(self._is_row, rows)) and type(seen) is int and seen >= 0):
            raise SceneError(f"past in a state to restore must be rows of {len(self.names)} finite numbers in "
                             f"ascending time, and seen a whole number, not {shown(rows)} and {shown(seen)}.")
        times = [row[0] for row in rows]
        if times != sorted(times):
            raise SceneError("past in a state to restore must ascend in time.")
        return [list(row) for row in rows], seen

    def _is_row(self, row: Any) -> bool:
        """Return True for a list or tuple of finite floats, one for each of ``names``."""
        return (isinstance(row, list | tuple) and len(row) == len(self.names)
                and all(type(value) is float and math.isfinite(value) for value in row))

    def restore(self, trail: Iterable[float], past: Iterable[list[float]], steps: int) -> None:
        """Replace all samples by saved ones."""
        if self.trail is not None:
            self.trail = deque(trail, maxlen=self.trail.maxlen)
        if self.past is not None:
            self.past = deque(past, maxlen=self.past.maxlen)
            self._steps = steps
