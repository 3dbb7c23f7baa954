"""Acquisition of samples from a source: time stamps, zero and sign, runs that are written to a journal as they come."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pendulum_env.bench.journal import Journal
from pendulum_env.bench.source import Chunk, FloatArray, Source

MOST_SHOWN = 4000
"""Largest number of samples of the past that are kept in memory; beyond it, every second one is dropped."""


@dataclass(frozen=True)
class Status:
    """What is known of an acquisition: counts, rate [1/s] of samples, the latest reading in the unit of its title."""

    recording: bool = False
    ended: bool = False
    samples: int = 0
    lost: int = 0
    rate: float = math.nan
    time: float = 0.0
    reading: float = math.nan


class Past:
    """A run's samples, decimated so that memory stays flat: times [s] and readings, evenly spread over the run."""

    def __init__(self) -> None:
        self.time: list[float] = []
        self.values: list[float] = []
        self.every, self._count = 1, 0

    def add(self, time: FloatArray, values: FloatArray) -> None:
        """Add samples in their order."""
        for t, value in zip(time.tolist(), values.tolist(), strict=True):
            if self._count % self.every == 0:
                self.time.append(t)
                self.values.append(value)
            self._count += 1
        while len(self.time) > MOST_SHOWN:
            self.time, self.values, self.every = self.time[::2], self.values[::2], 2 * self.every


class Acquisition:
    """Samples of one source, with zero and sign, and the runs that are recorded of them.

    Open it, call :meth:`poll` again and again, :meth:`start` and :meth:`stop` runs, close it. One thread may call poll
    while others read ``status`` and ``past``.
    """

    def __init__(self, source: Source, *, sign: int = 1) -> None:
        self.source, self.sign, self.zero = source, sign, 0.0
        self.status, self.past = Status(), Past()
        self.journal: Journal | None = None
        self._began: float | None = None
        self._host = 0.0

    def open(self) -> None:
        """Open the source."""
        self.source.open()
        self._host = time.monotonic()

    def set_zero(self) -> None:
        """Take the latest reading as 0 from now on."""
        self.zero += self.sign * self.status.reading if math.isfinite(self.status.reading) else 0.0

    def start(self, path: Path, *, force: bool = False) -> None:
        """Begin a run and write it to a journal; its time 0 is the next sample's."""
        self.journal = Journal(path, self.source, force=force)
        self.past, self._began = Past(), None
        self.status = replace(self.status, recording=True, samples=0, lost=0, time=0.0)

    def stop(self) -> Path | None:
        """End the run; return the path of its journal."""
        journal, self.journal = self.journal, None
        self.status = replace(self.status, recording=False)
        if journal is None:
            return None
        journal.close()
        return journal.path

    def poll(self, timeout: float = 0.1, heard: Callable[[FloatArray, FloatArray], None] | None = None) -> bool:
        """Take the samples that have come; return False once the source has ended.

        ``heard`` is called with times [s] since the run's first sample and rows of readings.
        """
        chunk = self.source.read(timeout)
        if chunk is None:
            self.status = replace(self.status, ended=True)
            return False
        if not len(chunk.values):
            return True
        at, values = self._stamped(chunk), self.sign * (chunk.values - self.zero)
        self.status = replace(self.status, reading=float(values[-1, 0]), rate=self._rate(at))
        if self.journal is not None:
            self._began = float(at[0]) if self._began is None else self._began
            at = at - self._began
            self.journal.write(at, values)
            self.past.add(at, values[:, 0])
            kept = self.status
            self.status = replace(kept, samples=kept.samples + len(at), lost=kept.lost + chunk.lost,
                                  time=float(at[-1]))
        if heard is not None:
            heard(at, values)
        return True

    def _stamped(self, chunk: Chunk) -> FloatArray:
        """Return the times of samples [s], those of the host where the source has no clock."""
        if chunk.time is not None:
            return chunk.time
        now = time.monotonic() - self._host
        return now - (len(chunk.values) - 1 - np.arange(len(chunk.values))) * 1e-6

    def _rate(self, at: FloatArray) -> float:
        return (len(at) - 1) / float(at[-1] - at[0]) if len(at) > 1 and at[-1] > at[0] else self.status.rate

    def close(self) -> None:
        """Stop the run and close the source."""
        self.stop()
        self.source.close()
