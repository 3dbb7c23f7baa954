"""Recorder of the last seconds of a motion, from which frames draw the trail and plots over time."""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
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
    """Return time [s], unwrapped angle [rad] and velocity [rad/s] of a state vector that counts steps of ``h`` [s]."""
    return values[INDEX] * h, values[ANGLE] + TWO_PI * values[TURNS], values[VELOCITY]


def kept(dt: float) -> tuple[int, int]:
    """Return the number of steps of ``dt`` [s] between two recorded samples, and the largest number of samples.

    The samples cover the ten seconds that plots in a frame show.
    """
    return max(1, math.ceil(min(WINDOW / dt / MOST, 2.0**53))), math.ceil(min(WINDOW / dt, MOST)) + 2


class Reel:
    """Recorder of the last seconds of a motion for the frames of one environment, or of a vector of environments.

    Attributes:
        trail: unwrapped angles [rad] after every step, for the trail of the bob.
        past: samples at the start and after every ``every`` steps: time, angle, velocity and, with ``energies``, the
            energies from ``info``.

    Both hold floats or, for a vector, arrays with a value for each environment and nan before the start of its episode.
    Each is None if no panel of the frames shows it.
    """

    def __init__(self, look: FrameStyle, dt: float, energies: bool) -> None:
        self.names = (*MOTION, *(LEDGER if energies else ()))
        self.trail: deque[Any] | None = deque(maxlen=trail_length(dt)) if "trail" in look.needs else None
        self.past: deque[Any] | None = None
        if "past" in look.needs:
            self.every, length = kept(dt)
            self.past = deque(maxlen=length)
        self._steps = 0

    def begin(self, motion: Sequence[Any], info: Mapping[str, Any]) -> None:
        """Delete all samples and record the first of a new episode.

        ``motion`` is (time [s], unwrapped angle [rad], velocity [rad/s]); ``info`` has the energies.
        """
        if self.trail is not None:
            self.trail.clear()
        if self.past is not None:
            self.past.clear()
            self.past.append(self._row(motion, info))
            self._steps = 0

    def keep(self, motion: Sequence[Any], info: Mapping[str, Any], start: bool = False) -> None:
        """Record the state at the end of a step.

        ``motion`` is (time [s], unwrapped angle [rad], velocity [rad/s]); ``info`` has the energies.

        start: True if some environment of a vector begins an episode here.
        """
        if self.trail is not None:
            self.trail.append(motion[1])
        if self.past is not None:
            self._steps += 1
            if start or self._steps % self.every == 0:
                self.past.append(self._row(motion, info))

    def cut(self, which: NDArray[np.intp]) -> None:
        """Delete the trail, and all but the last row of ``past``, of environments that begin a new episode.

        ``which`` are the indices of these environments.
        """
        for angles in self.trail or ():
            angles[which] = np.nan
        for rows in list(self.past or ())[:-1]:
            rows[:, which] = np.nan

    def trail_of(self, place: int) -> list[float]:
        """Return the recent angles [rad] of one environment of a vector, given by index, for the trail of its bob."""
        return [angle for angles in self.trail or () if not math.isnan(angle := float(angles[place]))]

    def past_of(self, place: int | None = None) -> PastSamples | None:
        """Return the recorded samples of the only environment, or of the one at the index ``place`` of a vector."""
        if self.past is None:
            return None
        samples = (np.frombuffer(b"".join(self.past)).reshape(-1, len(self.names)) if place is None else
                   np.array([row[:, place] for row in self.past]))
        columns = samples[~np.isnan(samples[:, 0])].T.copy()  # each in one piece, as frames read them column by column
        return PastSamples(**{LEDGER.get(name, name): columns[i] for i, name in enumerate(self.names)})

    def _row(self, motion: Sequence[Any], info: Mapping[str, Any]) -> Any:
        """Return a sample as an array of Python's or, for a vector, as one of NumPy's with a column per environment.

        The values are ``motion`` (time, angle, velocity) and, if energies are recorded, those of ``info``.
        """
        values = [*motion, *(info[name] for name in self.names[len(MOTION):])]
        return np.array(values) if isinstance(values[0], np.ndarray) else array("d", values)

    def saved(self) -> dict[str, Any]:
        """Return the samples of one environment as a dict of plain lists, to be passed to :meth:`checked` later."""
        return {"trail": list(self.trail or ()), "past": [list(row) for row in self.past or ()], "seen": self._steps}

    def checked(self, saved: Mapping[str, Any]) -> tuple[list[list[float]], int]:
        """Check saved samples, and return them as rows with the number of steps so far.

        If no panel of the frames shows samples, the result is an empty list and 0. Raises SceneError for invalid
        samples.
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
        """Return True if a sample is a list or tuple of finite floats, one for each recorded quantity."""
        return (isinstance(row, list | tuple) and len(row) == len(self.names)
                and all(type(value) is float and math.isfinite(value) for value in row))

    def restore(self, trail: Iterable[float], past: Iterable[list[float]], steps: int) -> None:
        """Replace all recorded samples by saved ones, with the number of steps so far."""
        if self.trail is not None:
            self.trail = deque(trail, maxlen=self.trail.maxlen)
        if self.past is not None:
            self.past = deque((array("d", row) for row in past), maxlen=self.past.maxlen)
            self._steps = steps
