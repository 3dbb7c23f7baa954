"""Many environments of one scene's effects and one method, in blocks that one call advances."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from integrators.steps.compensated import check_compensated
from pendulum_env.engine import threads
from pendulum_env.engine.generate import Task, batch_program
from pendulum_env.engine.kernels import Backend, functions, resolve
from pendulum_env.engine.layout import BLOCK
from pendulum_env.engine.machine import TWO_PI, check_diagnostics, find_method, reported
from pendulum_env.engine.pieces import Pace
from pendulum_env.engine.shape import SLACKENED, STATE
from pendulum_env.engine.streams import Streams
from pendulum_env.engine.wrap import half_turns, without_half_turns
from pendulum_env.physics.random import started
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]
Places = NDArray[np.intp]

SINGLE, TRUTH = np.dtype(np.float32), np.dtype(np.bool_)

FIELD_OF = STATE[:4]
"""Entries of a Machine's state that blocks keep under shorter names."""
FEW_BLOCKS = 2**6
"""Steps of blocks in the first piece of a run; see :mod:`pendulum_env.engine.pieces`."""
Numbers = Mapping[str, float | Array]


class Results(NamedTuple):
    """What a control step of ``n`` environments gives, in the order in which programs fill it.

    Attributes:
        observation: float32 ``(n, 3)``: cosine, sine, velocity [rad/s].
        reward: ``(n,)``.
        terminated, truncated: bool ``(n,)``.
        info: ``(len(names), n)``.
    """

    observation: NDArray[np.float32]
    reward: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    info: Array

    @property
    def some_over(self) -> bool:
        """True if an episode is over."""
        return 1 in self.terminated.tobytes() or 1 in self.truncated.tobytes()  # quicker than any() of a few thousand

    def put(self, which: Places, other: Results) -> None:
        """Take over what others say of the environments at these places."""
        self.observation[which], self.reward[which] = other.observation, other.reward
        self.terminated[which], self.truncated[which] = other.terminated, other.truncated
        self.info[:, which] = other.info


class Blocks:
    """``size`` pendulums of one scene's effects with one method, in blocks.

    Args:
        scene: its effects decide the program; its numbers do not enter.
        method, diagnostics, backend: as for a Machine.
        numbers: coefficients, OWN and LIMITS by name: a number for all, or an array of ``size``.
        size: how many.
        h: integrator's step [s].
        task: None for runs without any.
        num_threads: None takes every core for many blocks, and one for few.
        compensated: keep what rounding takes; see :mod:`integrators.steps.compensated`.

    Attributes:
        names: of what is reported beside observation and reward.
        num_threads: as used.
        program: the generated program; ``call``: its entry.

    Raises MethodError if the method does not fit the scene, EngineError for a backend that cannot be had.
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
        task: Task | None = None,
        num_threads: int | None = None,
        compensated: bool = False,
    ) -> None:
        compensated = check_compensated(compensated, None)
        self.size, self.h, self.compensated = size, h, compensated
        self.method = find_method(method, scene)
        self.diagnostics = check_diagnostics(diagnostics)
        varying = frozenset(name for name, value in numbers.items() if isinstance(value, np.ndarray))
        self._backend = backend
        self.program = batch_program(scene, self.method, reported(self.diagnostics), varying, task, compensated)
        self.layout, self.names = self.program.layout, self.program.layout.reports
        self.call = self._function()
        self._compiled = resolve(backend) == "compiled"
        self._shared = [float(numbers[name]) for name in self.layout.shared]
        self._periodic = scene.periodic
        self._state = self._blocks(size)
        for name in self.layout.varying:
            self._put(self._state, name, np.asarray(numbers[name], dtype=np.float64))
        self.num_threads = threads.usual(len(self._state)) if num_threads is None else num_threads
        parts = max(1, min(self.num_threads, len(self._state)))
        self._scratch = [np.empty(len(self.layout.results) * BLOCK) for _ in range(parts)]
        self._set_pace()

    def _function(self) -> Callable[..., Any]:
        return functions(self.program, self._backend)["step_blocks" if self.layout.task else "run_blocks"]

    def __getstate__(self) -> dict[str, Any]:
        """All but the compiled function, which is made anew where blocks are unpickled or copied."""
        return {name: value for name, value in vars(self).items() if name != "call"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.call = self._function()
        self._set_pace()

    def _set_pace(self) -> None:
        """Begin with few steps at once."""
        self._pace, self._share = Pace(FEW_BLOCKS), len(self._state) / len(self._scratch)
        self._learn(0, 0.0)

    def drawn(self, streams: Streams, which: Places) -> dict[str, Array]:
        """What starts as random whole numbers, by name, of the streams at these places."""
        return {name: np.asarray(started(streams.uniform(which))) for name in self.layout.shape.drawn}

    @property
    def slackened(self) -> int:
        """Steps after which the first wire had to push, of those that may; 0 if none had to."""
        if not self.layout.shape.lenient:
            return 0
        found = self.get(SLACKENED[0])
        return int(found[found > 0.0].min(initial=0.0 if not found.any() else math.inf))

    def state(self, place: int, names: Sequence[str]) -> list[float]:
        """The state of one environment as a Machine with these names keeps it; energies not filled in."""
        fields = dict(zip(FIELD_OF, ("index", "q", "turns", "v"), strict=True))
        at = np.array([place])
        kept = [fields.get(name, name) for name in names]
        return [float(self.get(name, at)[0]) if name in self.layout.fields else 0.0 for name in kept]

    def kept(self, place: int) -> list[float]:
        """What one kept last: steps taken, angle [rad], turns, velocity [rad/s]."""
        return self.state(place, FIELD_OF)

    def angles(self) -> Array:
        """Unwrapped angles of all [rad]."""
        return self.get("q") + TWO_PI * self.get("turns")

    def motion(self) -> tuple[Array, Array, Array]:
        """Steps taken, unwrapped angles [rad] and velocities [rad/s] of all."""
        return self.get("index"), self.angles(), self.get("v")

    def get(self, name: str, which: Places | None = None) -> Array:
        """Return a copy of one field at these places, or of all."""
        column = self._fields(self._state)[:, self.layout.fields.index(name)]
        return column.flatten()[: self.size] if which is None else column[which // BLOCK, which % BLOCK]

    def go_on(self) -> None:
        """Let those that have stopped go on from where they are."""
        self._put(self._state, "status", np.zeros(self.size))

    def _begin(self, state: Array, size: int, own: Mapping[str, Array], angle: Array, velocity: Array) -> None:
        """Fill blocks with starts; ``own`` are numbers that differ."""
        turns = np.zeros(size)
        if self._periodic:
            halves: Any = half_turns(angle)  # type: ignore[arg-type]
            angle, turns = np.asarray(without_half_turns(angle, halves)), 0.5 * halves  # type: ignore[arg-type]
        state[:] = 0.0
        for name, values in {**own, "q": angle, "turns": turns, "v": velocity}.items():
            self._put(state, name, values)

    def _blocks(self, size: int) -> Array:
        return np.zeros((-(-size // BLOCK), len(self.layout.fields) * BLOCK))

    def _fields(self, state: Array) -> Array:
        """The same numbers by block, field and place in the block."""
        return state.reshape(-1, len(self.layout.fields), BLOCK)

    def _put(self, state: Array, name: str, values: Array) -> None:
        """Fill one field of blocks, from the first place on."""
        padded = np.zeros(len(state) * BLOCK)
        padded[: len(values)] = values
        self._fields(state)[:, self.layout.fields.index(name)] = padded.reshape(-1, BLOCK)

    def _spread(self, state: Array, *arguments: Any) -> None:
        """The program over all blocks, in threads where there are several."""
        def part(number: int, first: int, last: int) -> None:
            self.call(state, self._scratch[number], first, last, *arguments, *self._shared)

        if self._compiled:
            threads.spread(part, len(state), len(self._scratch), self._pace.units)
            return
        with np.errstate(all="ignore"):
            part(0, 0, len(state))

    def _learn(self, steps: int, seconds: float) -> None:
        """Adapt what may be done at once to the time that some steps of all blocks took."""
        self._pace.learn(steps * self._share, seconds)
        self._at_once = int(self._pace.units / self._share)


class Batch(Blocks):
    """Environments with a task. Beside what Blocks takes:

    Args:
        substeps: integrator's steps in a control step.
        most: control steps until an episode is truncated.
    """

    def __init__(self, *arguments: Any, substeps: int, most: float, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.substeps, self._bound = substeps, (most - 1.0) * substeps
        at_once = self._compiled and len(self._scratch) == 1 and len(self._state) * substeps <= FEW_BLOCKS
        self._usual = (self._state, self._scratch[0], 0, len(self._state), self.size, self.h, substeps, substeps,
                       self._bound) if at_once else ()

    def results(self, size: int | None = None) -> Results:
        """Arrays for results of all environments, or of so many, not yet filled."""
        count = self.size if size is None else size
        return Results(np.empty((count, 3), SINGLE), np.empty(count), np.empty(count, TRUTH), np.empty(count, TRUTH),
                       np.empty((len(self.names), count)))

    def step(self, action: NDArray[np.floating[Any]], into: Results) -> None:
        """One control step of every environment that has not stopped; interrupted, only a reset makes them agree."""
        if self._usual:
            self.call(*self._usual, action, *into, *self._shared)
            return
        substeps = self.substeps
        if substeps <= self._at_once:
            self._run(self._state, action, substeps, substeps, into)
            return
        hold, nothing = substeps, self.results(0)
        while substeps:
            now, begun = min(substeps, max(1, self._at_once)), perf_counter()
            substeps -= now
            self._run(self._state, action, now, hold, nothing if substeps else into)
            self._learn(now, perf_counter() - begun)
            hold = 0

    def look(self, into: Results) -> None:
        """What every environment reports as it stands."""
        self._run(self._state, _no_action(self.size), 0, 0, into)

    def start(
        self, which: Places | None, angle: Array, velocity: Array, drawn: Mapping[str, Array], into: Results
    ) -> None:
        """Begin anew at these angles [rad] and velocities [rad/s]; ``which`` are the places, None for all.

        ``drawn``: random whole numbers by name that some of what effects remember starts from.
        """
        size = self.size if which is None else len(which)
        state = self._state if which is None else self._blocks(size)
        own = {name: self.get(name, which) for name in self.layout.varying}
        self._begin(state, size, {**own, **drawn}, angle, velocity)
        found = into if which is None else self.results(size)
        self._run(state, _no_action(size), 0, 0, found)
        found.terminated[:], found.truncated[:] = False, False
        self._put(state, "status", np.zeros(size))
        if which is not None:
            rows = self._fields(state).swapaxes(1, 2).reshape(-1, len(self.layout.fields))[:size]
            self._fields(self._state)[which // BLOCK, :, which % BLOCK] = rows
            into.put(which, found)

    def status(self, which: Places) -> Places:
        """Codes of :mod:`pendulum_env.engine.shape`: why the environments at these places stopped."""
        return self.get("status", which).astype(np.intp)

    def _run(
        self, state: Array, action: NDArray[np.floating[Any]], substeps: int, hold: int, into: Results
    ) -> None:
        """``step_blocks`` on a state; see :mod:`pendulum_env.engine.blocks`."""
        self._spread(state, len(action), self.h, substeps, hold, self._bound, action, *into)


def _no_action(size: int) -> NDArray[np.float32]:
    """Zeros of the action space's type, so that the program is compiled for one type alone."""
    return np.zeros(size, dtype=np.float32)
