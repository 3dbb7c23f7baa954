"""Batches of environments: episodes of many pendulums, with the rewards, ends and observations of a task."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine import threads
from pendulum_env.engine.blocks import REFUSED, WRONG
from pendulum_env.engine.kernels import functions
from pendulum_env.engine.layout import BLOCK, aligned
from pendulum_env.engine.pendulums import FEW_BLOCKS, Blocks
from pendulum_env.engine.pendulums import FIELD_OF as FIELD_OF
from pendulum_env.engine.sensing import Sensing
from pendulum_env.engine.spinning import SpinningPool

Array = NDArray[np.float64]
Places = NDArray[np.intp]

SINGLE, TRUTH = np.dtype(np.float32), np.dtype(np.bool_)

GROUP = 17
"""Largest number of blocks whose parts of a control step are taken one after the other: 4096 environments at once."""
LARGE = 16_384
"""Number of environments from which a single step gains more by aligned arrays than it takes to align them."""
UNCHANGED: Mapping[str, Array] = {}
"""Numbers of new episodes that change no parameter of the program."""


class Results(NamedTuple):
    """Results of a control step of ``n`` environments, in the order of a generated program's arguments.

    Attributes:
        observation: float32 array ``(n, 3)``: cosine, sine, velocity [rad/s]; ``(n, 7)`` with a reference, see
            :data:`pendulum_env.engine.goal.AHEAD`.
        reward: array ``(n,)``.
        terminated, truncated: bool arrays ``(n,)``.
        info: array ``(len(names), n)`` of the reported quantities.
    """

    observation: NDArray[np.float32]
    reward: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    info: Array

    def put(self, which: Places, other: Results) -> None:
        """Write the results ``other`` of a few environments into these results, at the environments' indices ``which``.
        """
        self.observation[which], self.reward[which] = other.observation, other.reward
        self.terminated[which], self.truncated[which] = other.terminated, other.truncated
        self.info[:, which] = other.info


class Batch(Blocks):
    """A batch of environments with a task, such as the swing-up, that gives rewards and ends episodes.

    Args:
        arguments, options: as for Blocks.
        substeps: integrator's steps per control step.
        most: number of control steps after which an episode is truncated.
    """

    def __init__(self, *arguments: Any, substeps: int, most: float, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._reused: Results | None = None
        self._width = len(self.layout.goal.seen) if self.layout.goal else 0
        self.substeps, self._bound = substeps, (most - 1.0) * substeps
        self._set_usual()

    def _set_usual(self) -> None:
        """Set the arguments of a step of few environments, which one call of the compiled program takes at once."""
        substeps = self.substeps
        short = not self.tolerance and len(self._state) * substeps <= FEW_BLOCKS
        at_once = short and self.compiled and len(self._scratch) == 1
        self._usual = (self._state, self._scratch[0], 0, len(self._state), self.size, self.h, substeps, substeps,
                       self._bound) if at_once else ()
        self._pool: SpinningPool | None = None

    def reuse(self, into: Results) -> None:
        """Have all steps write to these results, so that threads whose number was given can share them
        as a spinning pool.

        Such a pool has at most one thread for each core, and no part in adaptive steps; see
        :mod:`pendulum_env.engine.spinning`.
        """
        fits = self.compiled and not self.tolerance and 1 < len(self._scratch) <= threads.cores()
        if fits and self._threads_given:
            self._reused = into

    def _in_pool(self, action: NDArray[np.float32], into: Results) -> int:
        """Take one control step by a spinning pool; return what the program returns."""
        pool = self._pool
        if pool is None or not pool.here:
            substeps = self.substeps
            pool = self._pool = SpinningPool(self.program, self.backend, self._state, self._scratch, (
                self.size, self.h, substeps, substeps, self._bound, *into, *self._shared))
        return pool.step(action)

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes to pickle; the threads of a spinning pool are started again when they are needed."""
        return {**super().__getstate__(), "_pool": None}

    def vary(self, names: Iterable[str]) -> None:
        """Give every environment its own value of the numbers ``names``; see :meth:`Blocks.vary`."""
        super().vary(names)
        self._set_usual()

    def results(self, size: int | None = None, lasting: bool = False) -> Results:
        """Return uninitialised arrays for the results of ``size`` environments, by default of all in the batch.

        Their memory is aligned where that saves more time than it takes: in many steps (``lasting``) or large arrays.
        """
        count = self.size if size is None else size
        make: Any = partial(aligned, make=np.empty) if lasting or count >= LARGE else np.empty
        return Results(make((count, self._width), SINGLE), make((count,)), np.empty(count, TRUTH),
                       np.empty(count, TRUTH), make((len(self.names), count)))

    def step(self, action: NDArray[np.floating[Any]], into: Results) -> bool:
        """Take one control step of every environment that has not stopped, and write the results to ``into``.

        Return True; or False, and do nothing, if an action is not finite. After an interruption by Ctrl-C some
        environments are ahead of others until the next reset.
        """
        if self._usual:
            found: int = self.call(*self._usual, action, *into, *self._shared)
        elif into is self._reused and self.substeps <= self.at_once and action.dtype == SINGLE:
            found = self._in_pool(action, into)
        elif 0 in np.isfinite(action).tobytes():  # quicker than all() for small arrays
            return False
        else:
            self.ended = self.wrong = False
            self._take(action, self.substeps, self.substeps, into)
            return True
        self.ended, self.wrong = found > 0, found >= WRONG
        return found != REFUSED

    def step_in_parts(
        self, sensing: Sensing, action: NDArray[np.floating[Any]], into: Results, seen: NDArray[np.float32]
    ) -> None:
        """Take one control step with delayed actions, and with readings after some of its parts; see :meth:`step`.

        Observations are written to ``seen``, observed angles to the last row of ``into.info``. All parts of a group of
        blocks are taken before those of the next, so that the group stays in the processor's cache.
        """
        self.ended = self.wrong = False
        unused = self.results(0)
        sensing.act(action)
        parts = [(sensing.acting(begin), end - begin, hold, into if end == self.substeps else unused,
                  sensing.turn(end) if reads else None, end) for begin, end, hold, reads in sensing.parts]

        def group(thread: int, first: int, last: int) -> None:
            """Take all parts of the control step of the blocks ``first`` to ``last`` (exclusive)."""
            for actions, steps, hold, results, slots, end in parts:
                self._call_to_end(thread, first, last, steps, hold, actions, results)
                if slots is not None:
                    sensing.sample(self._state, slots, end, thread, first, last)
            sensing.give(seen, into.info[-1], thread, first, last)

        self._in_threads(group, len(self._state), max(1, min(GROUP, self._pace.units // self.substeps)))

    def _call_to_end(
        self, thread: int, first: int, last: int, steps: int, hold: int, actions: Any, into: Results
    ) -> None:
        """Take steps of the blocks ``first`` to ``last`` (exclusive), in as many calls as adaptive steps need."""
        more = (*self._turns(self._state), FEW_BLOCKS) if self.tolerance else ()
        while True:
            self._call(self._state, thread, first, last, self.size, self.h, steps, hold, self._bound, actions, *into,
                       *more)
            if not more or (more[1][first:last, 0] < 0).all():
                return

    def begin_readings(self, sensing: Sensing, which: Places, *drawn: Any) -> None:
        """Begin the readings of new episodes in the environments ``which``; see :meth:`Sensing.begin`."""
        sensing.begin(self._state, which, *drawn)

    def also(self, name: str) -> None:
        """Add a row to the reported quantities, which the caller fills."""
        self.names = (*self.names, name)

    def _take(self, action: NDArray[np.floating[Any]], substeps: int, hold: int, into: Results) -> None:
        """Take steps with constant actions, in several calls if they are many; see :meth:`_run`."""
        if substeps <= self.at_once:
            self._run(self._state, action, substeps, hold, into)
            return
        while substeps:
            now, begun = min(substeps, max(1, self.at_once)), perf_counter()
            substeps -= now
            self._run(self._state, action, now, hold, self.results(0) if substeps else into)
            self._learn(now, perf_counter() - begun)
            hold = 0

    def look(self, into: Results) -> None:
        """Write observations, rewards and reported quantities of all environments in their present states to ``into``.
        """
        self._run(self._state, np.zeros(self.size, SINGLE), 0, 0, into)

    def start(
        self, which: Places | None, angle: Array, velocity: Array, drawn: Mapping[str, Array], into: Results,
        numbers: Mapping[str, Array] = UNCHANGED,
    ) -> None:
        """Start new episodes at these angles [rad] and velocities [rad/s].

        The first observations and reported quantities are written to ``into``. ``which`` are the indices of the
        environments, None for all. ``drawn`` holds the random initial values of the effects' state variables, such as
        gusts, by name. ``numbers`` holds the program's parameters of the new episodes by name, arrays with one number
        for each of these environments; those that are left out stay as they are.
        """
        if more := [name for name, shared in zip(self.layout.shared, self._shared, strict=True)
                    if name in numbers and np.any(numbers[name] != shared)]:
            self.vary(more)
        size = self.size if which is None else len(which)
        state = self._state if which is None else self._blocks(size)
        own = {name: numbers[name] if name in numbers else self.get(name, which) for name in self.layout.varying}
        self._begin(state, size, {**own, **drawn}, angle, velocity)
        results = into if which is None else self.results(size)
        self._run(state, np.zeros(size, SINGLE), 0, 0, results)
        results.terminated[:], results.truncated[:] = False, False
        self._put(state, "status", np.zeros(size))
        if which is not None:
            rows = self._fields(state).swapaxes(1, 2).reshape(-1, len(self.layout.fields))[:size]
            self._fields(self._state)[which // BLOCK, :, which % BLOCK] = rows
            into.put(which, results)

    def starts(self, first: Array, second: Array, omega0: Array) -> tuple[Array, Array]:
        """Return angles [rad] and velocities [rad/s] at which episodes start, by the task's own function.

        ``first`` and ``second`` are random numbers in [0, 1), ``omega0`` angular frequencies [1/s], shape ``(n,)``.
        """
        angle, velocity = np.empty(len(first)), np.empty(len(first))
        with np.errstate(all="ignore"):
            functions(self.program, self.backend)["starts"](first, second, omega0, angle, velocity)
        return angle, velocity

    def status(self, which: Places) -> Places:
        """Return the stop codes (see :mod:`pendulum_env.engine.shape`) of the environments ``which``."""
        return self.get("status", which).astype(np.intp)

    def _run(
        self, state: Array, action: NDArray[np.floating[Any]], substeps: int, hold: int, into: Results
    ) -> None:
        """Call the generated ``step_blocks`` on the blocks ``state``; see :mod:`pendulum_env.engine.blocks`.

        A control step has ``hold`` steps, of which this call takes ``substeps``; its results are written to ``into``.
        The actions are float32, as in the action space: numba would compile the program again for another type.
        """
        self._spread(state, len(action), self.h, substeps, hold, self._bound, action, *into)
