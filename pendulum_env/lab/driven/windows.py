"""Simulation of logs in windows: short stretches, each with a start of its own, which advance together in the engine.

In a short window, an unstable motion near the top stays close to its readings, and a torque that is missing from the
log affects one window only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.batch import Batch
from pendulum_env.lab.driven.drive import mean_drive
from pendulum_env.lab.driven.log import DrivenLog
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import BearingFriction, CoulombFriction, Gravity, Motor
from pendulum_env.physics.scene import Scene
from pendulum_env.tasks import find_task

Array = NDArray[np.float64]

RATES = ("stiffness", "viscous", "dry", "drive", "delay", "lag", "zero")
"""Numbers of the equation of motion ``theta'' = -stiffness sin(theta - zero) - viscous theta' - dry sign(theta') +
drive u``, with u the lagged, delayed reading of the drive: 1/s², 1/s, rad/s², rad/s² per unit of the drive, s, s, rad.
"""
STIFFNESS, VISCOUS, DRY, DRIVE, DELAY, LAG, ZERO = range(len(RATES))
METHOD = "velocity_verlet"
"""Method of the simulation. The friction's part of its steps is exact, sticking included."""
STEP = 0.006
"""Largest step of the simulation, as a share of 1/omega0: the frequency is then right to 2e-6."""
NEAR, FEWEST = 0.1, 7
"""Readings near the start of a window, from which its start is estimated: those within this share of its length, and at
least this many."""
SHORTEST = 1e-4
"""Shortest step of the simulation [s]."""
_SCENE = Scene("driven log", Body(length=1.0, mass=1.0), effects=(
    Gravity(), BearingFriction(bearing_viscosity=1.0), CoulombFriction(friction_torque=1.0), Motor(max_torque=1.0)))
"""Scene with the effects of the simulation; its numbers are replaced."""


def start_at(log: DrivenLog, at: float, reach: float) -> tuple[float, float]:
    """Return angle [rad] and velocity [rad/s] of a log at a time [s], from a parabola through the readings within
    ``reach`` [s], or through the nearest FEWEST."""
    apart = np.abs(log.time - at)
    near = np.flatnonzero(apart < reach)
    near = near if len(near) >= FEWEST else np.argsort(apart)[:FEWEST]
    curve = np.polynomial.Polynomial.fit(log.time[near] - at, log.angle[near], 2)
    return float(curve(0.0)), float(curve.deriv()(0.0))


class Window(NamedTuple):
    """A stretch of a log: number of the log, first step of the log's grid, first reading and the one after the last."""

    log: int
    step: int
    first: int
    last: int


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of several logs, which are simulated together.

    Attributes:
        logs: the logs.
        h: step of the simulation [s].
        steps: number of steps of the longest window.
        places: the windows.
        begins: time of step 0 in each log [s].
    """

    logs: tuple[DrivenLog, ...]
    h: float
    steps: int
    places: tuple[Window, ...]
    begins: tuple[float, ...]

    @classmethod
    def of(
        cls, logs: Sequence[DrivenLog], duration: float, omega0: float, skip: float = 0.0, end: float = 0.0
    ) -> Windows:
        """Divide logs into windows of about a duration [s].

        Args:
            logs: the logs.
            duration: length of a window [s].
            omega0: angular frequency of small swings [1/s], which sets the step.
            skip, end: time at the start and at the end of each log that is left out, as the drive that acts there is
                not in the log [s].
        """
        h = max(min(STEP / omega0, *(float(np.median(np.diff(log.time))) for log in logs)), SHORTEST)
        places, begins, most = [], [], 1
        for i, log in enumerate(logs):
            begin = float(log.time[0]) + skip
            whole = float(log.time[-1]) - end - begin
            count = max(1, round(whole / duration))
            each = max(1, math.ceil(whole / count / h))
            edges = begin + h * each * np.arange(count + 1)
            marks = np.searchsorted(log.time, edges - 1e-9 * h)
            marks[-1] = np.searchsorted(log.time, log.time[-1] - end, side="right")
            places += [Window(i, k * each, int(marks[k]), int(marks[k + 1])) for k in range(count)
                       if marks[k + 1] - marks[k] > 2]
            begins.append(begin)
            most = max(most, each)
        return cls(tuple(logs), h, most, tuple(places), tuple(begins))

    def without(self, spans: Sequence[tuple[int, float, float]]) -> Windows:
        """Return the windows that do not overlap with any of the spans, each a log's number and two times in it [s]."""
        def apart(number: int) -> bool:
            log, first, last = self.span(number)
            return all(log != other or last < begin or end < first for other, begin, end in spans)

        return replace(self, places=tuple(place for i, place in enumerate(self.places) if apart(i)))

    @cached_property
    def owner(self) -> NDArray[np.intp]:
        """Number of the window to which each reading belongs, an array."""
        return np.repeat(np.arange(len(self.places)), [place.last - place.first for place in self.places])

    @cached_property
    def slices(self) -> list[slice]:
        """Slice of the readings of every window, in arrays of all readings."""
        ends = np.cumsum([0, *(place.last - place.first for place in self.places)]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def angle(self) -> Array:
        """Recorded angles of all windows, one after the other [rad]."""
        return np.concatenate([self.logs[place.log].angle[place.first : place.last] for place in self.places])

    @cached_property
    def since(self) -> Array:
        """Time of every reading since the start of its window, in steps."""
        return np.concatenate([
            (self.logs[place.log].time[place.first : place.last] - self.begins[place.log]) / self.h - place.step
            for place in self.places])

    def span(self, number: int) -> tuple[int, float, float]:
        """Return the number of the log of a window, and the times in the log of its first and last reading [s]."""
        place = self.places[number]
        time = self.logs[place.log].time
        return place.log, float(time[place.first]), float(time[place.last - 1])

    @cached_property
    def starts(self) -> Array:
        """Angle [rad] and velocity [rad/s] at the start of every window, ``(windows, 2)``, from a parabola through the
        readings near it."""
        return np.array([start_at(self.logs[place.log], self.begins[place.log] + place.step * self.h,
                                  NEAR * self.steps * self.h) for place in self.places])

    def angles(self, rates: Array, starts: Array) -> Array:
        """Return the simulated readings of the angle [rad], ``(runs, readings)``.

        Args:
            rates: numbers of the equation of motion, in the order of RATES, ``(runs, 7)``.
            starts: angle [rad] and velocity [rad/s] at the start of each window, ``(runs, windows, 2)``.
        """
        angle, velocity = self.motion(rates, starts)
        step = np.clip(np.floor(self.since).astype(np.intp), 0, self.steps - 1)
        s = (self.since - step)[:, None]
        first, last = angle[step, :, self.owner], angle[step + 1, :, self.owner]
        rise, begin, end = last - first, self.h * velocity[step, :, self.owner], self.h * velocity[step + 1, :,
                                                                                                  self.owner]
        curve = first + s * (begin + s * (3.0 * rise - 2.0 * begin - end + s * (begin + end - 2.0 * rise)))
        return np.asarray(curve.T + rates[:, ZERO, None])

    def motion(self, rates: Array, starts: Array) -> tuple[Array, Array]:
        """Return the angle from the equilibrium [rad] and the velocity [rad/s] after every step.

        Both have the shape ``(steps + 1, runs, windows)``. The arguments are those of :meth:`angles`.
        """
        runs, count = len(rates), len(self.places)
        shape, size = (self.steps + 1, runs, count), runs * count
        control, scale = self._controls(rates)
        each = np.repeat(rates, count, axis=0)
        numbers = {"gravity_rate": each[:, STIFFNESS], "bearing_rate": each[:, VISCOUS], "dry_limit": each[:, DRY],
                   "motor_rate": scale * each[:, DRIVE], "omega0": np.sqrt(np.maximum(each[:, STIFFNESS], 1e-12)),
                   "inertia": 1.0, "scale": math.inf, "speed_limit": math.inf}
        batch = Batch(_SCENE, METHOD, (), "auto", numbers, size=size, h=self.h, goal=find_task("free").goal,
                      num_threads=1, substeps=1, most=math.inf)
        results = batch.results()
        begin = starts.reshape(size, 2)
        batch.start(None, begin[:, 0] - each[:, ZERO], begin[:, 1].copy(), {}, results)
        angle, velocity = np.empty((self.steps + 1, size)), np.empty((self.steps + 1, size))
        angle[0], velocity[0] = batch.angles(), batch.get("v")
        for k in range(self.steps):
            batch.step(control[k], results)
            angle[k + 1], velocity[k + 1] = batch.angles(), batch.get("v")
        return angle.reshape(shape), velocity.reshape(shape)

    def _controls(self, rates: Array) -> tuple[NDArray[np.float32], float]:
        """Return the mean drive in every step, as a share of the largest reading, ``(steps, runs * windows)``, and that
        reading."""
        largest = max(float(np.abs(log.drive).max()) for log in self.logs) or 1.0
        control, means = np.empty((self.steps, len(rates), len(self.places)), np.float32), cache(self._means)
        for run, (delay, lag) in enumerate(rates[:, [DELAY, LAG]].tolist()):
            for i, place in enumerate(self.places):
                control[:, run, i] = means(delay, lag)[place.log][place.step : place.step + self.steps] / largest
        return control.reshape(self.steps, -1), largest

    def _means(self, delay: float, lag: float) -> list[Array]:
        """Return the mean drive in every step of each log's grid, arrays."""
        counts = [math.ceil((float(log.time[-1]) - begin) / self.h) + self.steps
                  for log, begin in zip(self.logs, self.begins, strict=True)]
        return [mean_drive(log.time, log.held, begin + self.h * np.arange(count + 1, dtype=np.float64), delay, lag)
                for log, begin, count in zip(self.logs, self.begins, counts, strict=True)]
