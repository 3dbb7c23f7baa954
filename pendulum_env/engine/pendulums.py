"""Many pendulums with the same effects and method, stored in blocks and advanced by one call of a generated program.

A block holds BLOCK pendulums in one array, so that the compiled loop over them uses SIMD instructions. Layers above use
the pendulums: recorded runs (:mod:`pendulum_env.engine.runs`), episodes with a task (:mod:`pendulum_env.engine.batch`),
and error estimates of both (:mod:`pendulum_env.engine.certificate`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from integrators.solving.equal import MOST_STEPS
from pendulum_env.engine import threads
from pendulum_env.engine.blocks import WRONG
from pendulum_env.engine.generate import batch_program
from pendulum_env.engine.goal import Goal
from pendulum_env.engine.kernels import Backend, functions
from pendulum_env.engine.layout import BLOCK, aligned
from pendulum_env.engine.machine import TWO_PI, Runner
from pendulum_env.engine.pieces import Pace
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.shape import SLACKENED, STATE
from pendulum_env.engine.wrap import split_turns
from pendulum_env.physics.random import started
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Numbers = Mapping[str, float | Array]

FIELD_OF = dict(zip(STATE[:4], ("index", "q", "turns", "v"), strict=True))
"""Entry of a Machine's state -> its field in blocks, where the names differ."""
FEW_BLOCKS = 2**6
"""Number of steps of blocks in the first call of a program for a run; see :mod:`pendulum_env.engine.pieces`."""


class Blocks(Runner):
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

    Attributes, beside those of a Runner:
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
        super().__init__(scene, method, diagnostics, backend, rtol, atol, compensated)
        self.size, self.h = size, h
        self.ended = self.wrong = False
        numbers = {**numbers, **self.tolerance}
        varying = frozenset(name for name, value in numbers.items() if isinstance(value, np.ndarray))
        self._source, self._periodic = (scene, goal), scene.periodic
        self._set_program(varying, numbers)
        self.names = self.layout.reports
        self._threads_given = num_threads is not None
        self.num_threads = threads.usual(len(self._state)) if num_threads is None else num_threads
        parts = max(1, min(self.num_threads, len(self._state)))
        self._scratch = [aligned((self.layout.room,)) for _ in range(parts)]
        self._set_pace()

    def _set_program(self, varying: frozenset[str], numbers: Numbers) -> None:
        """Generate the program in which the numbers ``varying`` differ between pendulums, and its blocks."""
        scene, goal = self._source
        self.program = batch_program(scene, self.method, self.diagnostics, varying, goal, self.compensated,
                                     bool(self.tolerance))
        self.layout = self.program.layout
        self.call = self._function()
        self._shared = [float(numbers[name]) for name in self.layout.shared]
        self._state = self._blocks(self.size)
        self._work = self._slots(self._state)
        for name in self.layout.varying:
            self._put(self._state, name, np.broadcast_to(numbers[name], self.size))

    def vary(self, names: Iterable[str]) -> None:
        """Give every pendulum its own value of the numbers ``names``, which were the same for all; state is unchanged.

        Another program is generated for this, and compiled when it is first called.
        """
        fields, numbers = {name: self.get(name) for name in self.layout.fields}, self.numbers
        self._set_program(self.layout.varying | frozenset(names), numbers)
        for name, values in fields.items():
            self._put(self._state, name, values)

    @property
    def numbers(self) -> dict[str, float | Array]:
        """Return the program's parameters by name: one number for all pendulums, or an array of ``size`` numbers."""
        shared = dict(zip(self.layout.shared, self._shared, strict=True))
        return {name: shared[name] if name in shared else self.get(name) for name in self.layout.numbers}

    def _function(self) -> Callable[..., Any]:
        """Return the generated program's entry function, ``step_blocks`` or ``run_blocks``, interpreted or compiled."""
        return functions(self.program, self.backend)["step_blocks" if self.layout.goal else "run_blocks"]

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
        self._pace = Pace(FEW_BLOCKS, len(self._state) / len(self._scratch))

    @property
    def at_once(self) -> int:
        """Return the largest number of steps of all pendulums in one call of the program; 0 if one step takes longer.

        Adaptive steps are divided into calls by themselves; see :meth:`_spread`.
        """
        return MOST_STEPS if self.tolerance else self._pace.steps

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
        at = np.array([index])
        own = [FIELD_OF.get(name, name) for name in names]
        return [float(self.get(name, at, blocks)[0]) if name in self.layout.fields else 0.0 for name in own]

    def kept(self, index: int) -> list[float]:
        """Return the last finite state of one environment: steps taken, angle [rad], turns, velocity [rad/s]."""
        return self.state(index, [*FIELD_OF])

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
        angle, turns = split_turns(angle, self._periodic)
        state[:] = 0.0
        if state is self._state:
            self._work[:, -1:] = 0.0  # no slot is in use, also after an interruption
        for name, values in {**own, "q": angle, "turns": np.broadcast_to(turns, size), "v": velocity}.items():
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
                self._call_in_threads(state, *arguments, *more, max(1, self._pace.steps))
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
        self._in_threads(lambda *part: self._call(state, *part, *arguments), len(state), self._pace.units)

    def _call(self, state: Array, thread: int, first: int, last: int, *arguments: Any) -> None:
        """Call the program on the blocks ``first`` to ``last`` (exclusive), and note what it has found there.

        Every ``thread`` has a scratch array of its own.
        """
        found = self.call(state, self._scratch[thread], first, last, *arguments, *self._shared)
        if found > 0:
            self.ended = True
        if found >= WRONG:
            self.wrong = True

    def _in_threads(self, work: Callable[[int, int, int], None], blocks: int, most: int) -> None:
        """Call ``work(thread, first, last)`` on ranges of at most ``most`` blocks until all are done.

        That is done in several threads if the program is compiled.
        """
        if self.compiled:
            threads.spread(work, blocks, len(self._scratch), most)
            return
        with np.errstate(all="ignore"):
            work(0, 0, blocks)

    def _learn(self, steps: int, seconds: float) -> None:
        """Adapt the number of steps per call of the program, after ``steps`` steps of all blocks took ``seconds``.

        Adaptive steps are divided into calls by themselves; see :meth:`_spread`.
        """
        if not self.tolerance:
            self._pace.learn(steps * self._pace.share, seconds)
