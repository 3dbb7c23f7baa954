"""Many pendulums with the same effects and method, stored in blocks and advanced by one call of a generated program.

A block holds BLOCK pendulums in one array, so that the compiled loop over them uses SIMD instructions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from integrators.solving.equal import MOST_STEPS
from integrators.steps.compensated import check_compensated
from pendulum_env.engine import threads
from pendulum_env.engine.blocks import REFUSED, WRONG
from pendulum_env.engine.generate import batch_program
from pendulum_env.engine.goal import Goal
from pendulum_env.engine.kernels import Backend, functions, resolve
from pendulum_env.engine.layout import BLOCK, aligned
from pendulum_env.engine.machine import TWO_PI, check_diagnostics, checked_tolerance, find_method
from pendulum_env.engine.pieces import Pace
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.sensing import Sensing
from pendulum_env.engine.shape import SLACKENED, STATE
from pendulum_env.engine.spinning import SpinningPool
from pendulum_env.engine.wrap import half_turns, without_half_turns
from pendulum_env.physics.random import started
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]
Places = NDArray[np.intp]

SINGLE, TRUTH = np.dtype(np.float32), np.dtype(np.bool_)

FIELD_OF = STATE[:4]
"""Entries of a Machine's state that have shorter names in blocks."""
FEW_BLOCKS = 2**6
"""Number of steps of blocks in the first call of a program for a run; see :mod:`pendulum_env.engine.pieces`."""
GROUP = 17
"""Largest number of blocks whose parts of a control step are taken one after the other: 4096 environments at once."""
LARGE = 16_384
"""Number of environments from which a single step gains more by aligned arrays than it takes to align them."""
Numbers = Mapping[str, float | Array]
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


class Blocks:
    """``size`` pendulums with the same effects and method, stored in blocks of environments.

    Args:
        scene: scene whose effects determine the generated program; its numbers are not used.
        method, diagnostics, backend: as for a Machine, the simulator of one pendulum.
        numbers: the program's parameters by name: one number for all pendulums, or an array of ``size`` numbers.
        size: number of pendulums.
        h: integrator's step [s].
        goal: functions of the task; None for runs without a task.
        num_threads: number of threads; None uses all cores if there are many blocks, and one thread if there are few.
        compensated: True carries rounding remainders along; see :mod:`integrators.steps.compensated`.
        rtol, atol: tolerances, for which every pendulum takes adaptive steps of its own; None for fixed steps.

    Attributes:
        tolerance: "rtol" and "atol" by name; empty for fixed steps.
        names: names of the quantities reported beside observation and reward.
        num_threads: number of threads used.
        program: the generated program.
        ended: True if an episode ended in the last step of environments or before; it stays True when new ones begin.
        wrong: True if a reward of the last step was not finite, for a task with a user's functions.
        call: the program's entry function.

    Raises MethodError if the method does not fit the scene, EngineError for a backend that is not available.
    """

    def __init__(
        self,
        scene: Scene,
        method: str | Method,
        diagnostics: Sequence[str],
        backend: Backend,
        numbers: Numbers,
        *,
        size: int,
        h: float,
        goal: Goal | None = None,
        num_threads: int | None = None,
        compensated: bool = False,
        rtol: float | None = None,
        atol: float | None = None,
    ) -> None:
        compensated = check_compensated(compensated, rtol)
        self.size, self.h, self.compensated = size, h, compensated
        self.ended = self.wrong = False
        self.method = find_method(method, scene)
        self.tolerance = checked_tolerance(self.method, scene, rtol, atol)
        numbers = {**numbers, **self.tolerance}
        self.diagnostics = check_diagnostics(diagnostics)
        varying = frozenset(name for name, value in numbers.items() if isinstance(value, np.ndarray))
        self._backend, self._source = backend, (scene, goal)
        self._set_program(varying)
        self.names = self.layout.reports
        self._compiled = resolve(backend, self.method.python_functions) == "compiled"
        self._shared = [float(numbers[name]) for name in self.layout.shared]
        self._periodic = scene.periodic
        self._state = self._blocks(size)
        self._work = self._slots(self._state)
        for name in self.layout.varying:
            self._put(self._state, name, np.asarray(numbers[name], dtype=np.float64))
        self._threads_given = num_threads is not None
        self.num_threads = threads.usual(len(self._state)) if num_threads is None else num_threads
        parts = max(1, min(self.num_threads, len(self._state)))
        self._scratch = [aligned((self.layout.room,)) for _ in range(parts)]
        self._set_pace()

    def _set_program(self, varying: frozenset[str]) -> None:
        """Generate the program in which the numbers ``varying`` differ between pendulums."""
        scene, goal = self._source
        self.program = batch_program(scene, self.method, self.diagnostics, varying, goal, self.compensated,
                                     bool(self.tolerance))
        self.layout = self.program.layout
        self.call = self._function()

    def vary(self, names: Iterable[str]) -> None:
        """Give every pendulum its own value of the numbers ``names``, which were the same for all; state is unchanged.

        Another program is generated for this, and compiled when it is first called.
        """
        fields, numbers = {name: self.get(name) for name in self.layout.fields}, self.numbers
        self._set_program(self.layout.varying | frozenset(names))
        self._shared = [float(numbers[name]) for name in self.layout.shared]
        self._state = self._blocks(self.size)
        self._work = self._slots(self._state)
        for name in self.layout.fields:
            values = fields[name] if name in fields else np.full(self.size, numbers[name])
            self._put(self._state, name, values)

    @property
    def numbers(self) -> dict[str, float | Array]:
        """Return the program's parameters by name: one number for all pendulums, or an array of ``size`` numbers."""
        shared = dict(zip(self.layout.shared, self._shared, strict=True))
        return {name: shared[name] if name in shared else self.get(name) for name in self.layout.numbers}

    def _function(self) -> Callable[..., Any]:
        """Return the generated program's entry function, ``step_blocks`` or ``run_blocks``, interpreted or compiled."""
        return functions(self.program, self._backend)["step_blocks" if self.layout.goal else "run_blocks"]

    def __getstate__(self) -> dict[str, Any]:
        """Return the attributes to pickle: all but the compiled function, which is loaded again when unpickled."""
        return {name: value for name, value in vars(self).items() if name != "call"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore pickled attributes and load the compiled function."""
        vars(self).update(state)
        self.call = self._function()
        self._set_pace()

    def _set_pace(self) -> None:
        """Set the number of steps per call of the program to its initial value, 64 steps of a block.

        Long runs are divided into several calls, so that Ctrl-C can interrupt them; see
        :mod:`pendulum_env.engine.pieces`.
        """
        self._pace, self._share = Pace(FEW_BLOCKS), len(self._state) / len(self._scratch)
        self._at_once = MOST_STEPS if self.tolerance else int(self._pace.units / self._share)

    def drawn(self, streams: Streams, which: Places) -> dict[str, Array]:
        """Return the effects' state variables that start as random whole numbers, for the environments ``which``.

        The dict maps the variable's name, such as that of a gust generator's seed, to one number per environment, which
        is computed from the random streams ``streams``.
        """
        return {name: np.asarray(started(streams.uniform(which))) for name in self.layout.shape.drawn}

    @property
    def slackened(self) -> float:
        """Return 1 plus the number of steps after which a wire first went slack in any of the pendulums.

        It is 0 if all wires are taut, and without slack="warn"; see SLACKENED in :mod:`pendulum_env.engine.shape`.
        """
        if not self.layout.shape.lenient:
            return 0.0
        marks = self.get(SLACKENED[0])
        return float(np.min(marks[marks > 0.0])) if marks.any() else 0.0

    def state(self, index: int, names: Sequence[str], blocks: Array | None = None) -> list[float]:
        """Return the state of environment number ``index`` in the form of a Machine's state, with energies set to 0.

        ``names`` are the names of the entries in a Machine's state, ``blocks`` a copy of the blocks to read in place of
        the present ones.
        """
        fields = dict(zip(FIELD_OF, ("index", "q", "turns", "v"), strict=True))
        at = np.array([index])
        own = [fields.get(name, name) for name in names]
        return [float(self.get(name, at, blocks)[0]) if name in self.layout.fields else 0.0 for name in own]

    def kept(self, index: int) -> list[float]:
        """Return the last finite state of one environment: steps taken, angle [rad], turns, velocity [rad/s]."""
        return self.state(index, FIELD_OF)

    def angles(self) -> Array:
        """Return the unwrapped angles of all environments [rad], shape ``(size,)``."""
        return self.get("q") + TWO_PI * self.get("turns")

    def motion(self) -> tuple[Array, Array, Array]:
        """Return steps taken, unwrapped angles [rad] and velocities [rad/s] of all environments, arrays ``(size,)``."""
        return self.get("index"), self.angles(), self.get("v")

    def get(self, name: str, which: Places | None = None, blocks: Array | None = None) -> Array:
        """Return a copy of one field (a quantity such as the angle "q") for the environments ``which``, by default all.

        ``blocks`` is a copy of the blocks to read in place of the present ones.
        """
        column = self._fields(self._state if blocks is None else blocks)[:, self.layout.fields.index(name)]
        return column.flatten()[: self.size] if which is None else column[which // BLOCK, which % BLOCK]

    def put(self, name: str, which: Places, values: Array) -> None:
        """Set one field (a quantity such as the angle "q") of the environments ``which``."""
        self._fields(self._state)[which // BLOCK, self.layout.fields.index(name), which % BLOCK] = values

    def go_on(self) -> None:
        """Let all pendulums continue whose run has stopped, from the last state before the stop."""
        self._put(self._state, "status", np.zeros(self.size))

    def _begin(self, state: Array, size: int, own: Mapping[str, Array], angle: Array, velocity: Array) -> None:
        """Fill the blocks ``state`` with the initial angles [rad] and velocities [rad/s] of ``size`` pendulums.

        ``own`` maps the names of further fields, such as parameters that differ between pendulums, to their values.
        """
        turns = np.zeros(size)
        if self._periodic:
            halves: Any = half_turns(angle)  # type: ignore[arg-type]
            angle, turns = np.asarray(without_half_turns(angle, halves)), 0.5 * halves  # type: ignore[arg-type]
        state[:] = 0.0
        if state is self._state:
            self._work[:, -1:] = 0.0  # no slot is in use, also after an interruption
        for name, values in {**own, "q": angle, "turns": turns, "v": velocity}.items():
            self._put(state, name, values)

    def _blocks(self, size: int) -> Array:
        """Return zero-filled memory for ``size`` pendulums, an array ``(blocks, fields * BLOCK)``.

        A row is one block: for every field, such as angle or velocity, it holds the numbers of BLOCK pendulums.
        """
        return aligned((-(-size // BLOCK), len(self.layout.fields) * BLOCK))

    def _slots(self, state: Array) -> Array:
        """Return the zero-filled work arrays of blocks, ``(blocks, numbers)``; see :attr:`Layout.work`."""
        width = 1 + len(self.layout.work) * BLOCK if self.tolerance else 0
        return aligned((len(state), width))

    def _fields(self, state: Array) -> Array:
        """Return a view of the blocks in ``state`` with the shape ``(blocks, fields, BLOCK)``.

        A field is one quantity, such as angle or velocity, and BLOCK is the number of pendulums in a block.
        """
        return state.reshape(-1, len(self.layout.fields), BLOCK)

    def _put(self, state: Array, name: str, values: Array) -> None:
        """Set the field ``name`` of the first ``len(values)`` pendulums in the blocks ``state``; it is 0 in all others.
        """
        padded = np.zeros(len(state) * BLOCK)
        padded[: len(values)] = values
        self._fields(state)[:, self.layout.fields.index(name)] = padded.reshape(-1, BLOCK)

    def _spread(self, state: Array, *arguments: Any) -> None:
        """Call the generated program on all blocks of pendulums; a compiled program is called in several threads.

        Adaptive steps are taken in as many calls as they need, about 0.05 s each.
        """
        if self.tolerance:
            more, done = self._turns(state), False
            while not done:
                before, begun = more[1][:, 1].sum(), perf_counter()
                self._call_in_threads(state, *arguments, *more, max(1, int(self._pace.units / self._share)))
                self._pace.learn((more[1][:, 1].sum() - before) / len(self._scratch), perf_counter() - begun)
                done = bool((more[1][:, 0] < 0).all())
            return
        self._call_in_threads(state, *arguments)

    def _turns(self, state: Array) -> tuple[Array, NDArray[np.int64]]:
        """Return the arguments ``work`` and ``progress`` of a program for adaptive steps, at the start of its turns."""
        work = self._work if state is self._state else self._slots(state)
        return work, np.zeros((len(state), 2), dtype=np.int64)

    def _call_in_threads(self, state: Array, *arguments: Any) -> None:
        """Call the generated program once on all blocks of pendulums, in several threads if it is compiled."""
        def part(number: int, first: int, last: int) -> None:
            """Call the program on the blocks ``first`` to ``last`` (exclusive).

            Thread ``number`` has its own scratch array.
            """
            self._note(self.call(state, self._scratch[number], first, last, *arguments, *self._shared))

        if self._compiled:
            threads.spread(part, len(state), len(self._scratch), self._pace.units)
            return
        with np.errstate(all="ignore"):
            part(0, 0, len(state))

    def _note(self, found: int) -> None:
        """Note what the program has found in a range of blocks: the number that it returned."""
        if found > 0:
            self.ended = True
        if found >= WRONG:
            self.wrong = True

    def _learn(self, steps: int, seconds: float) -> None:
        """Adapt the number of steps per call of the program, after ``steps`` steps of all blocks took ``seconds``.

        Adaptive steps are divided into calls by themselves; see :meth:`_spread`.
        """
        if self.tolerance:
            return
        self._pace.learn(steps * self._share, seconds)
        self._at_once = int(self._pace.units / self._share)


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
        at_once = short and self._compiled and len(self._scratch) == 1
        self._usual = (self._state, self._scratch[0], 0, len(self._state), self.size, self.h, substeps, substeps,
                       self._bound) if at_once else ()
        self._pool: SpinningPool | None = None

    def reuse(self, into: Results) -> None:
        """Have all steps write to these results, so that threads whose number was given can share them
        as a spinning pool.

        Such a pool has at most one thread for each core, and no part in adaptive steps; see
        :mod:`pendulum_env.engine.spinning`.
        """
        fits = self._compiled and not self.tolerance and 1 < len(self._scratch) <= threads.cores()
        if fits and self._threads_given:
            self._reused = into

    def _in_pool(self, action: NDArray[np.float32], into: Results) -> int:
        """Take one control step by a spinning pool; return what the program returns."""
        pool = self._pool
        if pool is None or not pool.here:
            substeps = self.substeps
            pool = self._pool = SpinningPool(self.program, self._backend, self._state, self._scratch, (
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
        elif into is self._reused and self.substeps <= self._at_once and action.dtype == SINGLE:
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

        if self._compiled:
            at_once = max(1, min(GROUP, int(self._pace.units // self.substeps)))
            threads.spread(group, len(self._state), len(self._scratch), at_once)
            return
        with np.errstate(all="ignore"):
            group(0, 0, len(self._state))

    def _call_to_end(
        self, thread: int, first: int, last: int, steps: int, hold: int, actions: Any, into: Results
    ) -> None:
        """Take steps of the blocks ``first`` to ``last`` (exclusive), in as many calls as adaptive steps need."""
        more = (*self._turns(self._state), FEW_BLOCKS) if self.tolerance else ()
        while True:
            self._note(self.call(self._state, self._scratch[thread], first, last, self.size, self.h, steps, hold,
                                 self._bound, actions, *into, *more, *self._shared))
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
        if substeps <= self._at_once:
            self._run(self._state, action, substeps, hold, into)
            return
        unused = self.results(0)
        while substeps:
            now, begun = min(substeps, max(1, self._at_once)), perf_counter()
            substeps -= now
            self._run(self._state, action, now, hold, unused if substeps else into)
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
            functions(self.program, self._backend)["starts"](first, second, omega0, angle, velocity)
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
