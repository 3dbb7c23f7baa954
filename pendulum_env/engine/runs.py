"""Many runs at once: blocks of them advance together, row after row."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.common.progress import Progress
from pendulum_env.engine.batch import Blocks
from pendulum_env.engine.each import Each
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.shape import OK, STOP_REASONS
from pendulum_env.engine.streams import Streams

Array = NDArray[np.float64]

CHUNK = 2**22
"""Numbers that one call fills: some 32 MB."""
LEDGERS = frozenset({"energy", "heat_by_effect"})
"""Diagnostics for which work and heat are summed."""
WORK = 2**24
"""Steps of single runs that one call takes: a moment's work between two reports of progress."""


@dataclass(frozen=True)
class Plan:
    """When a run is recorded: its start, then every ``every`` steps of ``h`` [s] until ``steps``, and its end."""

    h: float
    steps: int
    every: int

    @property
    def count(self) -> int:
        """How many records there are."""
        return 1 + -(-self.steps // self.every)

    @property
    def marks(self) -> NDArray[np.int64]:
        """Steps taken at each record."""
        whole = np.arange(0, self.steps + 1, self.every)
        return whole if whole[-1] == self.steps else np.append(whole, self.steps)


class Runs(Blocks):
    """Runs of the scenes of ``each`` from given starts.

    Args:
        each: scenes and numbers.
        method, diagnostics, backend, num_threads, compensated: as for Blocks.
        angle, velocity: starts [rad, rad/s], one for each run.
        plan: when to record.
        control: constant share of the motor's torque.
        hold: steps for which what effects remember holds.
        streams: what gusts start from.

    Attributes:
        plan, scene: as given; the scene is the first run's.
        names: of what is recorded.
    """

    def __init__(
        self,
        each: Each,
        method: str | Method,
        diagnostics: Sequence[str],
        backend: Backend,
        *,
        angle: Array,
        velocity: Array,
        plan: Plan,
        control: float,
        num_threads: int | None = None,
        compensated: bool = False,
        hold: int = 1,
        streams: Streams | None = None,
    ) -> None:
        numbers = each.numbers if "energy" in diagnostics else {**each.numbers, "scale": math.inf}
        kept = dict.fromkeys(("energy", *diagnostics)) if LEDGERS & {*diagnostics} else diagnostics
        super().__init__(each.scene, method, tuple(kept), backend, numbers, size=len(angle), h=plan.h,
                         num_threads=num_threads, compensated=compensated)
        own: dict[str, Any] = {name: numbers[name] for name in self.layout.varying}
        drawn = {} if streams is None else self.drawn(streams, np.arange(self.size))
        self._begin(self._state, self.size, {**own, **drawn}, angle, velocity)
        self._hold, self._taken = hold, 0
        self.plan, self.scene, self._control = plan, each.scene, control

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why each run stopped, "" where it did not; complete after :meth:`rows` is."""
        return tuple("" if code == OK else STOP_REASONS[int(code)] for code in self.get("status").tolist())

    @property
    def ends(self) -> Array:
        """Time of each run's last step [s]."""
        return self.get("index") * self.h

    def rows(self, progress: Progress | None = None, whole: Array | None = None) -> Iterator[Array]:
        """The records, some rows at a time: arrays ``(rows, names, runs)``, nan after a run's end.

        They are parts of ``whole``, an array for all of them, where that is given.
        """
        marks = self.plan.marks
        most = max(1, min(CHUNK // (self.size * len(self.names)), WORK // (self.size * self.plan.every)))
        done = 0
        while done < len(marks):
            strides = np.diff(marks[max(0, done - 1) : done + most], prepend=marks[:1] if done == 0 else [])
            count = int(np.argmax(strides != strides[0])) or len(strides)
            shape = (count, len(self.names), self.size)
            out = np.empty(shape) if whole is None else whole[done : done + count]
            self._record(out, int(strides[0]))
            done += count
            if progress is not None:
                progress(done / len(marks), "running")
            yield out

    def _record(self, out: Array, every: int) -> None:
        """Fill rows of records, one after every ``every`` steps, in pieces that Ctrl-C need not wait for."""
        hold = (self._hold,) if self.layout.shape.remembered else ()

        def advance(rows: int, steps: int, into: Array) -> None:
            begun = perf_counter()
            self._spread(self._state, self.size, self.h, rows, steps, self._control, into, self._taken, *hold)
            self._learn(rows * steps, perf_counter() - begun)
            self._taken += rows * steps

        row = 0
        while row < len(out):
            left = every
            while left > max(1, self._at_once):
                now = max(1, self._at_once)
                left -= now
                advance(1, now, out[:0])
            count = min(len(out) - row, max(1, self._at_once // every)) if left == every > 0 else 1
            advance(count, left, out[row : row + count])
            row += count
