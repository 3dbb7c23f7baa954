"""Batches of runs: the runs advance together in blocks, and yield their recorded states row by row (time by time)."""

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
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.shape import DIVERGED, OK, STOP_REASONS

Array = NDArray[np.float64]

CHUNK = 2**22
"""Largest number of recorded numbers per call of a program: some 32 MB."""
LEDGERS = frozenset({"energy", "heat_by_effect"})
"""Diagnostics that need work and heat."""
LOOKS = 64
"""Number of rows of a chunk of records that are searched for the largest speed."""
WORK = 2**24
"""Largest number of steps, over all runs, between two reports of progress."""


@dataclass(frozen=True)
class RecordSchedule:
    """Steps at which a run of ``steps`` steps of ``h`` [s] is recorded: the start, every ``every`` steps, and the end.
    """

    h: float
    steps: int
    every: int

    @property
    def count(self) -> int:
        """Return the number of recorded states of a run."""
        return 1 + -(-self.steps // self.every)

    @property
    def marks(self) -> NDArray[np.int64]:
        """Return the number of steps taken at every recorded state of a run, as an array."""
        marks = np.arange(0, self.steps + 1, self.every)
        return marks if marks[-1] == self.steps else np.append(marks, self.steps)


class Runs(Blocks):
    """A batch of runs from given initial conditions.

    Args:
        each: scenes and parameter values of the runs.
        method, diagnostics, backend, num_threads, compensated, rtol, atol: as for Blocks.
        angle, velocity: initial conditions [rad, rad/s], one per run.
        plan: steps to take and to record.
        control: constant fraction of the motor's torque, -1 to 1.
        hold: steps per control step; the state of effects, such as gusts, changes once per control step.
        streams: random streams for the initial state of gusts.

    Attributes:
        plan, scene: the argument ``plan``, and the scene of the first run.
        names: names of the recorded quantities.
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
        plan: RecordSchedule,
        control: float,
        num_threads: int | None = None,
        compensated: bool = False,
        hold: int = 1,
        streams: Streams | None = None,
        rtol: float | None = None,
        atol: float | None = None,
    ) -> None:
        numbers = each.numbers if "energy" in diagnostics else {**each.numbers, "scale": math.inf}
        computed = dict.fromkeys(("energy", *diagnostics)) if LEDGERS & {*diagnostics} else diagnostics
        super().__init__(each.scene, method, tuple(computed), backend, numbers, size=len(angle), h=plan.h,
                         num_threads=num_threads, compensated=compensated, rtol=rtol, atol=atol)
        own: dict[str, Any] = {name: numbers[name] for name in self.layout.varying}
        drawn = {} if streams is None else self.drawn(streams, np.arange(self.size))
        self._begin(self._state, self.size, {**own, **drawn}, angle, velocity)
        self._hold, self._taken = hold, 0
        self.plan, self.scene, self._control = plan, each.scene, control
        self._speeds = np.zeros(self.size)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Return the stop reason of every run, "" for a run that did not stop early.

        The reasons are final only after :meth:`rows` has yielded the last record.
        """
        return tuple("" if code == OK else STOP_REASONS[int(code)] for code in self.get("status").tolist())

    @property
    def fastest(self) -> float:
        """Return the largest |velocity| seen in the records of runs that have not diverged [rad/s]."""
        return float(np.max(self._speeds[self.get("status") != DIVERGED], initial=0.0))

    def count(self, name: str) -> NDArray[np.int64]:
        """Return the number of adaptive steps "taken" or "rejected" of every run with a tolerance."""
        return self.get(name).astype(np.int64)

    @property
    def ends(self) -> Array:
        """Return the time of every run's last step [s]."""
        return self.get("index") * self.h

    def rows(self, progress: Progress | None = None, whole: Array | None = None) -> Iterator[Array]:
        """Yield the records of all runs, some rows (recorded times) at a time, as arrays ``(rows, names, runs)``.

        After a run has stopped, its records are nan. If ``whole``, an array for all records, is given, the yielded
        arrays are views of its parts.
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
            for velocity in out[:: -(-count // LOOKS), self.names.index("velocity")]:
                np.fmax(self._speeds, np.abs(velocity), out=self._speeds)
            done += count
            if progress is not None:
                progress(done / len(marks), "running")
            yield out

    def _record(self, out: Array, every: int) -> None:
        """Fill the rows of ``out`` with one record per ``every`` steps.

        The program is called for so few steps at a time that Ctrl-C can interrupt it.
        """
        hold = (self._hold,) if self.layout.shape.remembered else ()

        def advance(rows: int, steps: int, into: Array) -> None:
            """Take ``rows`` times ``steps`` steps of all runs, and record them in ``into`` unless it is empty."""
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
