"""The firmware of a simulated board: it obeys frames, turns a simulated pendulum's motor, and has the watchdog.

It knows no real clock: everything happens at the times that it is told, so that tests run it as fast as they like.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from pendulum_env.bench.protocol import (
    DRIVING,
    FULL,
    MICROS,
    STOPPED,
    TRIPPED,
    VERSION,
    Frame,
    Frames,
    encoded,
)
from pendulum_env.envs.env import LabPendulumEnv
from pendulum_env.physics.units import SceneError

TICK = 0.001
"""Time between two looks of the firmware at its motor [s], which is the control step of its simulated pendulum."""
FINE = 1_000_000
"""Counts in one turn of a sensor that rounds nothing."""


class Shaft(Protocol):
    """A pendulum with a motor and an encoder, in steps of ``TICK``."""

    @property
    def counts(self) -> int:
        """Counts in one turn."""

    @property
    def count(self) -> int:
        """What the encoder has counted."""

    def step(self, share: float) -> None:
        """Go on by one tick under a share of the motor's largest torque."""


Tell = Callable[[float, int, int], object]
"""Function that is told the time [s], the drive and the state whenever one of them changes."""


class Plant:
    """A simulated pendulum with its motor and its sensor, in steps of ``TICK``.

    ``keywords`` are those of ``gym.make("LabPendulum-v0", ...)``: scene, sensor, delays, noise and parameters. It hangs
    at rest at first, or as ``angle`` and ``velocity`` say.
    """

    def __init__(self, keywords: Mapping[str, Any], angle: float = 0.0, velocity: float = 0.0, seed: int = 0) -> None:
        quiet: dict[str, Any] = {"task": "free", "observation": "angle", "speed_limit": math.inf,
                                 "warn": False}
        self._env = LabPendulumEnv(**{**quiet, **keywords, "dt": TICK})
        quantum = getattr(getattr(self._env, "sensor"), "quantum", 0.0)  # noqa: B009  (an attribute by its declaration)
        self.counts = round(math.tau / quantum) if quantum else FINE
        self._action: Any = np.zeros(1)
        self._info: dict[str, Any] = self._env.reset(seed=seed, options={"angle": angle, "velocity": velocity})[1]

    @property
    def count(self) -> int:
        """What the encoder has counted."""
        return round(float(self._info["observed_angle"]) * self.counts / math.tau)

    def step(self, share: float) -> None:
        """Go on by one tick under a share of the motor's largest torque; SceneError if the motion cannot go on."""
        self._action[0] = share
        self._info = self._env.step(self._action)[4]
        if self._info["stop_reason"]:
            raise SceneError(f"the simulated motion stopped ({self._info['stop_reason']}); choose another integrator "
                             "or scene")


class Firmware:
    """The firmware of a board, as the README's sketch has it, with a simulated pendulum on its shaft.

    ``tell`` is called with the time, the drive and the state at every change: the log by which a stop is timed.
    """

    def __init__(self, plant: Shaft, tell: Tell = lambda time, drive, state: None) -> None:
        self.plant, self._tell = plant, tell
        self.state, self.drive = STOPPED, 0
        self._ticks = 0
        self._watchdog = 0.0
        self._fed: int | None = None
        self._frames = Frames()

    @property
    def time(self) -> float:
        """Time since the board was switched on [s], in whole ticks."""
        return self._ticks * TICK

    def go_on(self, until: float) -> None:
        """Let time pass up to ``until`` [s]; the watchdog acts at its own time, however late it is asked."""
        while (self._ticks + 1) * TICK <= until + 1e-9:
            self.plant.step(self.drive / FULL)
            self._ticks += 1
            if self.state == DRIVING and self._fed is not None and (
                    (self._ticks - self._fed) * TICK >= self._watchdog - 1e-9):
                self._set(0, TRIPPED)

    def _set(self, drive: int, state: int) -> None:
        if (drive, state) != (self.drive, self.state):
            self._tell(self.time, drive, state)
        self.drive, self.state = drive, state

    def receive(self, data: bytes, at: float, until: float = 0.0) -> bytes:
        """Return the answers to what came at a time [s]; a question is answered ``until`` a later one, if given."""
        self.go_on(at)
        return b"".join(self._obey(frame, until) for frame in self._frames.feed(data))

    def _obey(self, frame: Frame, until: float) -> bytes:
        letter, numbers = frame.letter, frame.numbers
        if letter == "Q":
            self.go_on(until)
        if letter == "H" and len(numbers) == 1 and 0 < numbers[0] <= 1000:
            self._watchdog, self._fed = numbers[0] / 1000.0, None
            self._set(0, DRIVING)
            return encoded(Frame("I", frame.sequence, (VERSION, self.plant.counts, numbers[0])))
        if letter == "D" and len(numbers) == 1:
            if self.state == DRIVING:
                self._fed = self._ticks
                self._set(max(-FULL, min(FULL, numbers[0])), DRIVING)
            return b""
        if letter == "S" and not numbers:
            self._set(0, STOPPED)
        elif letter != "Q" or numbers:
            return b""
        micros = round(1e6 * self.time) % MICROS
        return encoded(Frame("R", frame.sequence, (micros, self.plant.count, self.drive, self.state)))
