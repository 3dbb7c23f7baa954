"""Times of a device as seconds that increase: their unit, counters that overflow, lost lines, devices that restart."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
"""Unit of a device's times -> seconds."""
WORDS = {"s": "seconds", "ms": "milliseconds", "us": "microseconds"}
COUNTER = 2.0**32
"""Where counters such as millis() and micros() start again at 0."""
LISTENING = 0.5
"""Seconds of a device's first times from which their unit is inferred."""
LONG = 20.0
"""A step between times is suspicious from this many usual steps on, if it is longer than a second, too."""


@dataclass
class DeviceClock:
    """The clock of a device, read through its lines.

    The unit of times is that of their growth in a second of the host, if it is not given: thousands are milliseconds,
    millions microseconds. The first samples wait until it is known. A time that does not fit the one before waits for
    the next line: if that goes on from it, the device has restarted, and time goes on by the host's clock; if not, the
    line was damaged and is dropped.

    Attributes:
        unit: "s", "ms" or "us"; None until it is inferred.
        notes: one line for everything that was inferred or that happened.
    """

    unit: str | None = None
    notes: list[str] = field(default_factory=list)
    _waiting: list[tuple[float, float, float]] = field(default_factory=list)  # raw time, host's time, value
    _last: tuple[float, float, float] | None = None  # raw time, host's time, seconds
    _doubted: tuple[float, float, float] | None = None
    _steps: deque[float] = field(default_factory=lambda: deque(maxlen=25))
    _interrupted: bool = False
    _repeats: int = 0

    def interrupt(self) -> None:
        """Note that the device was gone: its clock may have restarted meanwhile."""
        self._interrupted = True

    def take(self, times: Sequence[float], values: Sequence[float],
             host: float) -> tuple[list[float], list[float], int]:
        """Return seconds that increase, their values, and how many samples were lost.

        Args:
            times, values: raw times and the readings of the lines that have come.
            host: the host's time of their arrival [s].
        """
        self._waiting += [(time, host, value) for time, value in zip(times, values, strict=True)]
        if self.unit is None and not self._inferred():
            return [], [], 0
        waiting, self._waiting = self._waiting, []
        seconds: list[float] = []
        kept: list[float] = []
        lost = 0
        for sample in waiting:
            accepted, missing = self._step(*sample)
            lost += missing
            for at, value in accepted:
                seconds.append(at)
                kept.append(value)
        return seconds, kept, lost

    def _inferred(self) -> bool:
        """Infer the unit once samples have come for long enough."""
        (first, began, _), (last, now, _) = self._waiting[0], self._waiting[-1]
        if now - began < LISTENING or len(self._waiting) < 5:
            return False
        steps = [b[0] - a[0] for a, b in zip(self._waiting, self._waiting[1:], strict=False)]
        grown = median(steps) * len(steps) / (now - began)  # a restart among them does not matter
        self.unit = min(UNITS, key=lambda unit: abs(math.log(max(grown, 1e-9) * UNITS[unit])))
        self.notes.append(f"times grow by {grown:.3g} per second, read as {WORDS[self.unit]}")
        return True

    def _step(self, raw: float, host: float, value: float) -> tuple[list[tuple[float, float]], int]:
        """Return the samples that are certain now, with their seconds, and how many were lost before them."""
        if self._last is not None and not self._interrupted:
            before, _, seconds = self._last
            if self._follows(before, raw):
                step, dropped, self._doubted = self._between(before, raw), self._doubted is not None, None
                self._steps.append(step)
                self._last = raw, host, seconds + step * UNITS[self.unit or "s"]
                return [(self._last[2], value)], int(dropped)
            if raw == before:
                if not self._repeats:
                    self.notes.append("lines that repeat a time are dropped; send more digits, such as micros()")
                self._repeats += 1
                return [], 1
        doubted, self._doubted = self._doubted, (raw, host, value)
        if doubted is None or not self._follows(doubted[0], raw):
            return [], int(doubted is not None)
        first, missing = self._resumed(*doubted)
        self._doubted, self._interrupted = None, False
        accepted, more = self._step(raw, host, value)
        return [first, *accepted], missing + more

    def _resumed(self, raw: float, host: float, value: float) -> tuple[tuple[float, float], int]:
        """Return a sample after a gap with its seconds, and how many samples the gap has lost."""
        if self._last is None:
            self._last = raw, host, 0.0
            return (0.0, value), 0
        before, then, seconds = self._last
        usual = self._usual()
        gap, passed = self._between(before, raw) * UNITS[self.unit or "s"], host - then
        same_clock = gap > 0.0 and (not self._interrupted or abs(gap - passed) <= 0.5 + 0.1 * passed)
        if not same_clock:
            gap = max(passed, usual)
            self.notes.append(f"the device restarted at {seconds + gap:.3f} s: its clock began again, and so does the "
                              "count of an encoder, from where the bob was; this computer's clock bridges the gap")
        elif gap > usual:
            self.notes.append(f"no lines for {gap:.3g} s from {seconds:.3f} s on")
        self._last = raw, host, seconds + gap
        return (seconds + gap, value), max(round(gap / usual) - 1, 0) if usual else 0

    def _usual(self) -> float:
        """Return the usual step between samples [s], 0 if none is known."""
        return median(self._steps) * UNITS[self.unit or "s"] if self._steps else 0.0

    def _between(self, before: float, after: float) -> float:
        """Return the step from one raw time to another, over the end of a counter of 32 bits if it is near."""
        return after - before + (COUNTER if after < 0.01 * COUNTER and before > 0.99 * COUNTER else 0.0)

    def _follows(self, before: float, after: float) -> bool:
        """Return True if a raw time can be the next one after another."""
        step = self._between(before, after)
        return 0.0 < step and step * UNITS[self.unit or "s"] <= max(1.0, LONG * self._usual())
