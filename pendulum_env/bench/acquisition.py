"""Acquisition of samples from a source: time stamps, zero and sign, runs that are written to a journal as they come.

Stamps of the computer's clock have a jitter, from which the rate of a device's clock is found (:class:`Drift`).
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pendulum_env.bench.journal import Journal
from pendulum_env.bench.source import Chunk, FloatArray, Source, SourceError, name_and_unit

WINDOW = 1.0
"""Time over which the rate of samples is measured [s]."""
GAP = 5.0
"""A step of time stamps beyond this many usual ones is a gap, and no jitter."""
LEAST = 60.0
"""Time after which the device's clock is compared with the computer's [s]."""
FEW = 20
"""Fewest steps of time stamps from which a jitter is given."""


class Rate:
    """Number of samples per second over the last second, by their own times."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()
        self._count = 0

    def add(self, at: FloatArray) -> float:
        """Add times [s]; return the rate [1/s], nan for less than two samples."""
        self._count += len(at)
        self._seen.append((float(at[-1]), self._count))
        while len(self._seen) > 2 and self._seen[1][0] <= at[-1] - WINDOW:
            self._seen.popleft()
        (first, before), (last, count) = self._seen[0], self._seen[-1]
        if last > first:
            return (count - before) / (last - first)
        return (len(at) - 1) / float(at[-1] - at[0]) if len(at) > 1 and at[-1] > at[0] else math.nan


class Stamps:
    """Times of samples without a clock of their own, by the computer's; several that came at once are spread evenly.

    ``usual`` is the mean step [s]. The jitter is ``std(t_(k+1) - t_k) / sqrt(2)``, that of independent deviations from
    even times.
    """

    def __init__(self) -> None:
        self.last, self.usual = -math.inf, math.nan
        self._count, self._mean, self._squares = 0, 0.0, 0.0

    def of(self, count: int, now: float) -> FloatArray:
        """Return the times [s] of ``count`` samples that were read at ``now``.

        Of several that are the first ever, only the last one gets a time, as nobody knows when the others came.
        """
        if self.last == -math.inf:
            self.last = now
            return np.array([now])
        step = max(now - self.last, 1e-6) / count
        if count > 1 and math.isfinite(self.usual):  # after a gap they came at their usual rate
            step = min(step, 1.5 * self.usual)
        at = np.asarray(now - step * np.arange(count - 1, -1, -1))
        for each in [float(at[0]) - self.last, *[step] * (count - 1)]:
            self._add(each)
        self.last = now
        return at

    def _add(self, step: float) -> None:
        if self._count >= FEW and step > GAP * self.usual:
            return
        self._count += 1
        before = self._mean
        self._mean += (step - before) / self._count
        self._squares += (step - before) * (step - self._mean)
        self.usual = self._mean

    @property
    def note(self) -> str:
        """Sentence on the jitter, "" before it is known."""
        if self._count < FEW:
            return ""
        jitter = math.sqrt(self._squares / self._count / 2.0)
        return (f"jitter: {1e3 * jitter:.3g} ms, standard deviation of the computer's times about even steps of "
                f"{1e3 * self.usual:.4g} ms")


class Drift:
    """Rate of a device's clock against the computer's: the slope of the line through the pairs of their times.

    A sample is read some time after its own; the scatter of these delays gives the slope's error.
    """

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None
        self._sums = np.zeros(6)
        self._span = 0.0

    def add(self, device: float, host: float) -> None:
        """Add the time of a sample on the device's clock, and that of its arrival on the computer's [s]."""
        if self._first is None:
            self._first = device, host
        # the difference of the clocks, which is small, against the time keeps the digits
        x = host - self._first[1]
        y = (device - self._first[0]) - x
        self._sums += (1.0, x, y, x * x, x * y, y * y)
        self._span = x

    @property
    def slope(self) -> tuple[float, float]:
        """Relative difference of the device's clock and its standard error; nan before it is known."""
        n, sx, sy, sxx, sxy, syy = self._sums.tolist()
        if n < FEW or self._span < LEAST:
            return math.nan, math.nan
        across = sxx - sx * sx / n
        slope = (sxy - sx * sy / n) / across
        rest = max(syy - sy * sy / n - slope * slope * across, 0.0)
        return slope, math.sqrt(rest / (n - 2.0) / across)

    @property
    def note(self) -> str:
        """Sentence on the device's clock, "" in the first minute."""
        slope, error = self.slope
        if not math.isfinite(slope):
            return ""
        if abs(slope) <= 3.0 * error:
            return f"clock: the device's agrees with the computer's within {3e6 * error:.2g} parts per million"
        word = "fast" if slope > 0.0 else "slow"
        return (f"clock: the device's is {word} by {1e6 * abs(slope):.3g} ± {1e6 * error:.2g} parts per million by the "
                "computer's; times are the device's")


MOST_SHOWN = 4000
"""Largest number of samples of the past that are kept in memory; beyond it, every second one is dropped."""
NOTES = 60.0
"""Time between two notes on clocks and losses in a journal [s]; a killed run keeps the last ones."""
EARLY = 5.0
"""Time of a run after which these notes are written for the first time [s]."""


@dataclass(frozen=True)
class Status:
    """What is known of an acquisition: counts, rate [1/s] of samples, the latest reading in the unit of its title.

    Attributes:
        recording: True while a run is recorded.
        ended: True once the source has ended.
        full: True once the run has its duration.
        samples, lost: counts of the run's samples, and of those that are known to be lost in it.
        rate: samples per second over the last second.
        time: time of the run's last sample since its first [s].
        reading: latest reading of the first column, with zero and sign.
    """

    recording: bool = False
    ended: bool = False
    full: bool = False
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
    while others read ``status`` and ``past``. Samples that are not finite, or not later than those before, are left out
    and count as lost. An angle that is read within one turn is continued over full turns.
    """

    def __init__(self, source: Source, *, sign: int = 1) -> None:
        self.source, self.sign, self.zero = source, sign, 0.0
        self.status, self.past = Status(), Past()
        self.journal: Journal | None = None
        self._until = math.inf
        self._began: float | None = None
        self._host = 0.0
        self._last = -math.inf
        self._rate, self._stamps, self._drift = Rate(), Stamps(), Drift()
        self._raw: float | None = None
        self._turns = 0.0
        self._noted = 0.0

    def open(self) -> None:
        """Open the source; after an error it is closed again."""
        try:
            self.source.open()
        except BaseException:
            self.source.close()
            raise
        self._host = time.monotonic()

    def set_zero(self) -> None:
        """Take the latest reading as 0 from now on.

        Raises SourceError for other readings than angles: the zero of a gyroscope or an accelerometer is fitted.
        """
        if self.source.quantity != "angle":
            raise SourceError("Only an angle has a zero to set here; a fit finds that of a gyroscope or an "
                              "accelerometer")
        self.zero += self.sign * self.status.reading if math.isfinite(self.status.reading) else 0.0

    def start(self, path: Path, *, force: bool = False, duration: float = math.inf) -> None:
        """Begin a run of ``duration`` [s] and write it to a journal; its time 0 is the next sample's.

        Raises FileExistsError if the file exists, unless ``force`` is True, OSError if it cannot be written, and
        SourceError if the source cannot begin.
        """
        self.source.begin()
        self.journal = Journal(path, self.source, force=force)
        self.past, self._began, self._until, self._noted = Past(), None, duration, EARLY - NOTES
        self.status = replace(self.status, recording=True, full=False, samples=0, lost=0, time=0.0)

    def stop(self) -> Path | None:
        """End the run; return the path of its journal. Raises OSError if the last notes cannot be written."""
        journal, self.journal = self.journal, None
        self.status = replace(self.status, recording=False)
        if journal is None:
            return None
        self.source.end()
        try:
            self._note(journal)
        finally:
            journal.close()
        return journal.path

    @property
    def notes(self) -> tuple[str, ...]:
        """One line for everything that was inferred: by the source, of the clocks, and of losses."""
        lost = self.status.lost
        own = [f"lost: {lost} sample{'s' * (lost != 1)}" if lost else "", self._stamps.note, self._drift.note]
        return (*self.source.notes, *filter(None, own))

    def _note(self, journal: Journal) -> None:
        for note in self.notes:
            journal.note(note)

    def poll(self, timeout: float = 0.1, heard: Callable[[FloatArray, FloatArray], None] | None = None) -> bool:
        """Take the samples that have come; return False once the source has ended.

        ``heard`` is called with times [s] since the run's first sample and rows of readings. Raises SourceError if the
        source is lost, OSError if the journal cannot be written.
        """
        chunk = self.source.read(timeout)
        if chunk is None:
            self.status = replace(self.status, ended=True)
            return False
        at, raw, lost = self._usable(chunk)
        kept = self.status
        if lost and self.journal is not None and not kept.full:
            self.status = kept = replace(kept, lost=kept.lost + lost)
        if not len(at):
            return True
        turned = [1.0 if name_and_unit(title)[1] or self.source.quantity != "angle" else 0.0
                  for title in self.source.columns]  # the zero of an angle is not that of an action beside it
        values = self.sign * (raw - self.zero * np.array(turned[:raw.shape[1]]))
        self.status = kept = replace(kept, reading=float(values[-1, 0]), rate=self._rate.add(at))
        if self.journal is not None and not kept.full:
            self._began = float(at[0]) if self._began is None else self._began
            since = at - self._began
            count = int(np.searchsorted(since, self._until * (1.0 + 1e-12), side="right"))
            at = since[:count]
            values = values[:count]
            self.journal.write(at, values)
            self.past.add(at, values[:, 0])
            passed = float(at[-1]) if count else kept.time
            self.status = replace(kept, samples=kept.samples + count, time=passed,
                                  full=count < len(since) or passed >= self._until * (1.0 - 1e-12))
            if passed - self._noted >= NOTES:
                self._noted = passed
                self._note(self.journal)
        if heard is not None and len(at):
            heard(at, values)
        return True

    def _usable(self, chunk: Chunk) -> tuple[FloatArray, FloatArray, int]:
        """Return times and readings that are finite and in their order, and the number of those that are lost."""
        values, lost, now = chunk.values, chunk.lost, time.monotonic() - self._host
        if not len(values):
            return np.empty(0), values, lost
        if chunk.time is None:
            at = self._stamps.of(len(values), now)
            lost += len(values) - len(at)
            values = values[len(values) - len(at):]
        else:
            at = chunk.time
        good = np.isfinite(at) & np.isfinite(values).all(axis=1)
        good &= at > np.maximum.accumulate(np.concatenate([[self._last], np.where(good, at, -math.inf)[:-1]]))
        if not good.all():
            lost += int(np.count_nonzero(~good))
            at, values = at[good], values[good]
        if not len(at):
            return at, values, lost
        self._last = float(at[-1])
        if chunk.time is not None and self.source.own_clock:
            self._drift.add(self._last, now)
        return at, self._continued(values), lost

    def _continued(self, values: FloatArray) -> FloatArray:
        """Return readings with full turns added where an angle that is read within one turn jumps."""
        if self.source.quantity != "angle":
            return values
        turn = math.tau if "rad" in self.source.columns[0] else 360.0
        first = values[0, 0] if self._raw is None else self._raw
        jumps = np.round(np.diff(values[:, 0], prepend=first) / turn)
        self._raw = float(values[-1, 0])
        turns = self._turns - np.cumsum(jumps) * turn
        self._turns = float(turns[-1])
        return values + turns[:, None] if turns.any() else values

    def close(self) -> None:
        """Stop the run and close the source."""
        try:
            self.stop()
        finally:
            self.source.close()
