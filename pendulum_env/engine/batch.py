"""Many environments of one scene's effects and one method, in blocks that one call advances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.engine import threads
from pendulum_env.engine.blocks import BLOCK
from pendulum_env.engine.generate import batch_program
from pendulum_env.engine.kernels import Backend, functions, resolve
from pendulum_env.engine.machine import TWO_PI, check_diagnostics, find_method
from pendulum_env.engine.shape import STATE
from pendulum_env.engine.wrap import half_turns, without_half_turns
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

FIELD_OF = STATE[:4]
"""Entries of a Machine's state that blocks keep under shorter names."""
Numbers = Mapping[str, float | Array]


@dataclass(frozen=True)
class Results:
    """What a control step of ``n`` environments gives.

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

    @classmethod
    def of(cls, size: int, rows: int) -> Results:
        """Arrays for so many environments, not yet filled."""
        return cls(
            np.empty((size, 3), dtype=np.float32), np.empty(size), np.empty(size, dtype=np.bool_),
            np.empty(size, dtype=np.bool_), np.empty((rows, size)),
        )

    def put(self, which: NDArray[np.intp], other: Results) -> None:
        """Take over what others say of the environments at these places."""
        self.observation[which], self.reward[which] = other.observation, other.reward
        self.terminated[which], self.truncated[which] = other.terminated, other.truncated
        self.info[:, which] = other.info


class Batch:
    """``size`` environments, ready to run.

    Args:
        scene: its effects decide the program; its numbers do not enter.
        method, diagnostics, backend: as for a Machine.
        numbers: coefficients, OWN and LIMITS by name: a number for all, or an array of ``size``.
        reward, lost: a task's plain functions.
        size: environments.
        h: integrator's step [s].
        substeps: integrator's steps in a control step.
        most: control steps until an episode is truncated.
        num_threads: None takes every core for many environments, and one for few.

    Attributes:
        names: of the rows of a result's ``info``.
        num_threads: as used.

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
        reward: Callable[[float, float, float], float],
        lost: Callable[[float], bool],
        size: int,
        h: float,
        substeps: int,
        most: float,
        num_threads: int | None = None,
    ) -> None:
        self.size, self.h, self.substeps = size, h, substeps
        self._bound = (most - 1.0) * substeps
        self.method = find_method(method, scene)
        self.diagnostics = check_diagnostics(diagnostics)
        varying = frozenset(name for name, value in numbers.items() if isinstance(value, np.ndarray))
        made = batch_program(scene, self.method, self.diagnostics, varying, reward, lost)
        self.layout, self.names = made.layout, made.shape.info
        self._step = functions(made, backend)["step_blocks"]
        self._compiled = resolve(backend) == "compiled"
        self._shared = [float(numbers[name]) for name in self.layout.shared]
        self._periodic = scene.periodic
        self._state = self._blocks(size)
        for name in varying:
            self._put(self._state, name, np.asarray(numbers[name], dtype=np.float64))
        self.num_threads = threads.usual(len(self._state)) if num_threads is None else num_threads
        parts = max(1, min(self.num_threads, len(self._state)))
        self._scratch = [np.empty(len(self.layout.results) * BLOCK) for _ in range(parts)]

    def results(self, size: int | None = None) -> Results:
        """Arrays for results of all environments, or of so many."""
        return Results.of(self.size if size is None else size, len(self.names))

    def step(self, action: Array, into: Results) -> int:
        """One control step of every environment that has not stopped; how many episodes are over."""
        return self._run(self._state, self.size, action, self.substeps, into)

    def look(self, into: Results) -> None:
        """What every environment reports as it stands."""
        self._run(self._state, self.size, np.zeros(self.size), 0, into)

    def start(self, which: NDArray[np.intp] | None, angle: Array, velocity: Array, into: Results) -> None:
        """Begin anew at these angles [rad] and velocities [rad/s]; ``which`` are the places, None for all."""
        size = self.size if which is None else len(which)
        state = self._state if which is None else self._blocks(size)
        own = {name: self._get(name, which).copy() for name in self.layout.varying}
        turns = np.zeros(size)
        if self._periodic:
            halves: Any = half_turns(angle)  # type: ignore[arg-type]
            angle, turns = np.asarray(without_half_turns(angle, halves)), 0.5 * halves  # type: ignore[arg-type]
        state[:] = 0.0
        for name, values in {**own, "q": angle, "turns": turns, "v": velocity}.items():
            self._put(state, name, values)
        found = into if which is None else self.results(size)
        self._run(state, size, np.zeros(size), 0, found)
        found.terminated[:], found.truncated[:] = False, False
        self._put(state, "status", np.zeros(size))
        if which is not None:
            rows = self._fields(state).swapaxes(1, 2).reshape(-1, len(self.layout.fields))[:size]
            self._fields(self._state)[which // BLOCK, :, which % BLOCK] = rows
            into.put(which, found)

    def status(self, which: NDArray[np.intp]) -> NDArray[np.intp]:
        """Codes of :mod:`pendulum_env.engine.shape`: why the environments at these places stopped."""
        return self._get("status", which).astype(np.intp)

    def angles(self) -> Array:
        """Unwrapped angles of all environments [rad]."""
        return self._get("q") + TWO_PI * self._get("turns")

    def state(self, place: int, names: Sequence[str]) -> list[float]:
        """The state of one environment as a Machine with these names keeps it; energies not filled in."""
        fields = dict(zip(FIELD_OF, ("index", "q", "turns", "v"), strict=True))
        at = np.array([place])
        kept = [fields.get(name, name) for name in names]
        return [float(self._get(name, at)[0]) if name in self.layout.fields else 0.0 for name in kept]

    def _blocks(self, size: int) -> Array:
        return np.zeros((-(-size // BLOCK), len(self.layout.fields) * BLOCK))

    def _fields(self, state: Array) -> Array:
        """The same numbers by block, field and place in the block."""
        return state.reshape(-1, len(self.layout.fields), BLOCK)

    def _get(self, name: str, which: NDArray[np.intp] | None = None) -> Array:
        """One field of the environments at these places, or of all."""
        column = self._fields(self._state)[:, self.layout.fields.index(name)]
        return column.reshape(-1)[: self.size] if which is None else column[which // BLOCK, which % BLOCK]

    def _put(self, state: Array, name: str, values: Array) -> None:
        """Fill one field of blocks, from the first place on."""
        padded = np.zeros(len(state) * BLOCK)
        padded[: len(values)] = values
        self._fields(state)[:, self.layout.fields.index(name)] = padded.reshape(-1, BLOCK)

    def _run(self, state: Array, size: int, action: Array, substeps: int, into: Results) -> int:
        arguments = (
            size, self.h, substeps, self._bound, action, into.observation, into.reward,
            into.terminated, into.truncated, into.info, *self._shared,
        )

        def part(number: int, first: int, last: int) -> int:
            return int(self._step(state, self._scratch[number], first, last, *arguments))

        if self._compiled:
            return threads.spread(part, len(state), len(self._scratch))
        with np.errstate(all="ignore"):
            return part(0, 0, len(state))
