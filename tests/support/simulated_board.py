"""A board whose time is simulated, so that the environment of a bench is tested to the tick, whatever else runs.

The bytes are those of the protocol; a test may change what comes from the board, or cut the line. The pendulum on its
shaft is a few lines of its own, and not the package's engine.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable

from pendulum_env.bench.device import Board
from pendulum_env.bench.firmware import TICK, Firmware


class Bob:
    """A ball on a rod with a motor, as the scene lab has it without its air, by symplectic Euler; and an encoder."""

    def __init__(self, angle: float = 0.0, velocity: float = 0.0, length: float = 0.353, torque: float = 0.05,
                 gamma: float = 0.02, counts: int = 2400, offset: float = 0.0, noise: float = 0.0) -> None:
        self.angle, self.velocity, self.counts = angle, velocity, counts
        self._omega2, self._rate, self._gamma = 9.81 / length, torque / (0.04 * length**2), gamma
        self.offset, self._noise, self._random = offset, noise, random.Random(0)

    @property
    def count(self) -> int:
        seen = self.angle + self.offset + self._noise * self._random.gauss(0.0, 1.0)
        return round(seen * self.counts / math.tau)

    def step(self, share: float) -> None:
        self.velocity += TICK * (share * self._rate - self._omega2 * math.sin(self.angle) - self._gamma * self.velocity)
        self.angle += TICK * self.velocity


class SimulatedBoard(Board):
    """A firmware with a bob, and a line to it, on one clock that only waiting moves.

    Attributes:
        told: times [s], drives and states of the firmware at every change.
        garble: function of the bytes that the board sends, and which come instead.
        cut: True from when on the line is dead.
    """

    real = False

    def __init__(self, **bob: float) -> None:
        super().__init__()
        self.told: list[tuple[float, int, int]] = []
        self.bob = Bob(**bob)  # type: ignore[arg-type]
        self.firmware = Firmware(self.bob, lambda *change: self.told.append(change))
        self.garble: Callable[[bytes], bytes] = lambda data: data
        self.cut, self.clock, self._waiting = False, 0.0, b""

    def __repr__(self) -> str:
        return "simulated"

    def connect(self) -> SimulatedBoard:
        return self

    def now(self) -> float:
        return self.clock

    def wait(self, until: float) -> None:
        self.clock = max(self.clock, until)

    def send(self, data: bytes) -> None:
        if self.cut:
            raise OSError("cut")
        self._waiting += self.garble(self.firmware.receive(data, self.clock))

    def receive(self, timeout: float) -> bytes:
        if self.cut:
            raise OSError("cut")
        data, self._waiting = self._waiting, b""
        if not data:
            self.clock += timeout
        return data

    def drive_at(self, time: float) -> int:
        """The drive at a time [s], by the firmware's own log."""
        self.firmware.go_on(time)
        return next((drive for at, drive, _ in reversed(self.told) if at <= time), 0)
