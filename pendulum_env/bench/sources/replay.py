"""A recording that is played again, at true speed or another."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from pendulum_env.bench.source import ANGLE, NOTHING, Chunk, Source, SourceError
from pendulum_env.physics.units import setting, si

RATE = ("Angular velocity (deg/s)",)
NAP = 0.002
"""Time between two looks at the clock [s]."""


@dataclass(frozen=True, repr=False, eq=False)
class Replay(Source):
    """A recording, played at ``speed`` times its true speed; its times stay those of the file.

    Of a gyroscope the angular velocity is played, of all other sensors the angle.
    """

    name: ClassVar[str] = "replay"
    about: ClassVar[str] = "a recording, played again at true speed or another"
    address: ClassVar[str] = "file"
    place: ClassVar[str] = "FILE"
    tested: ClassVar[str] = "as is"
    own_clock: ClassVar[bool] = False

    file: str | None = setting(None, "recording, in any format that lab-pendulum fit reads", optional=True)
    speed: float = si(1.0, "1", "factor of the speed, 1 for true speed", above=0.0)
    _kept: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    @property
    def columns(self) -> tuple[str, ...]:
        """Title of the reading."""
        return RATE if self.quantity == "rate" else ANGLE

    @property
    def notes(self) -> tuple[str, ...]:
        """How the file was read."""
        return tuple(self._kept.get("notes", ()))

    def open(self) -> None:
        """Read the file; SourceError if it is no recording."""
        from pendulum_env.lab.recording import Recording, RecordingError

        if self.file is None:
            raise SourceError("replay needs a recording, as replay:swing.csv")
        try:
            recording = Recording.read(self.file)
        except RecordingError as error:
            raise SourceError(str(error)) from None
        if recording.rate is not None:
            object.__setattr__(self, "quantity", "rate")
        values = recording.angle if recording.rate is None else recording.rate
        speed = [] if self.speed == 1.0 else [f"speed: {self.speed:g} times the true one; times are those of the file"]
        self._kept.update(time=recording.time, values=np.degrees(values)[:, None], next=0, began=time.monotonic(),
                          notes=[*recording.notes, *speed])

    def read(self, timeout: float = 0.1) -> Chunk | None:
        """Return the readings that are due; None after the last one."""
        kept, until = self._kept, time.monotonic() + timeout
        first, times = kept["next"], kept["time"]
        if first == len(times):
            return None
        while not (count := self._due() - first) and (left := until - time.monotonic()) > 0.0:
            time.sleep(min(NAP, left))
        if not count:
            return NOTHING
        kept["next"] = first + count
        return Chunk(kept["values"][first:first + count], times[first:first + count])

    def _due(self) -> int:
        """Return the number of readings from the first one whose time has come."""
        kept = self._kept
        return int(np.searchsorted(kept["time"], kept["time"][0] + (time.monotonic() - kept["began"]) * self.speed,
                                   side="right"))

    def close(self) -> None:
        """Do nothing; the file was closed when it had been read."""
