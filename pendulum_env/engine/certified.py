"""Single runs, environments and batches with error estimates, computed together with a second run at half the step.

The method of estimation is in :mod:`pendulum_env.engine.certificate`. The second run uses the same compiled program on
another state, so that nothing more is compiled.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.common.progress import Progress
from pendulum_env.engine.batch import UNCHANGED, Batch, Results
from pendulum_env.engine.certificate import (
    ESTIMATE,
    ROUNDOFF,
    VELOCITY_ESTIMATE,
    ErrorEstimator,
    MotionSoFar,
    endless,
    halved,
    motion_of,
)
from pendulum_env.engine.each import Each, frequency
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import (
    ANGLE,
    INDEX,
    NOWHERE,
    TURNS,
    TWO_PI,
    UNSEEN,
    VELOCITY,
    Machine,
    check_diagnostics,
)
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.result import Rollout
from pendulum_env.engine.runs import RecordSchedule, Runs
from pendulum_env.engine.sensing import Sensing
from pendulum_env.engine.shape import DIVERGED, HOLD, STOP_REASONS
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import boolean

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Motion = tuple[Array, Array, Array]
"""Steps taken, unwrapped angles [rad] and velocities [rad/s] of all environments."""

STRETCH = 2**14
"""Number of steps of a single run that are compared with the second run at a time."""
EXTREMES = ("low", "high", "fastest")
"""Entries of an environment's state for its episode so far: range of the angle [rad], largest |velocity| [rad/s]."""


def estimator_of(machine: Machine, h: float) -> ErrorEstimator:
    """Return the error estimator for runs of ``machine``, the simulator of one pendulum, with steps of ``h`` [s]."""
    numbers = {**machine.scene.coefficients, "omega0": frequency(machine.scene)}
    return ErrorEstimator.of(machine.scene, machine.method, h, numbers, machine.compensated, bool(machine.tolerance))


def parameters_of(machine: Machine, half: bool) -> Any:
    """Return a machine's parameters for one of the two runs of an error estimate, without limits that end a run.

    The result is for the run with the machine's own steps or, with ``half``, for the run with steps of half the length.
    """
    given = dict(zip(machine.numbers, machine.parameters, strict=True))
    return machine.array((halved(given) if half else endless(given)).values())


def checked_estimate(diagnostics: Sequence[str], asked: Any) -> tuple[tuple[str, ...], bool]:
    """Return the diagnostics without "error", and True if errors are to be estimated.

    Errors are estimated if ``asked``, the argument estimate_error, is True or if ``diagnostics`` contains "error".
    """
    names = check_diagnostics(diagnostics)
    return tuple(name for name in names if name != "error"), boolean(asked, "estimate_error") or "error" in names


# --- single runs ----------------------------------------------------------------------------------------------------


def with_estimates(machine: Machine, start: Any, run: Rollout, control: float) -> Rollout:
    """Return the Rollout ``run`` of a single pendulum with error estimates added.

    The machine repeats the run from its initial state ``start``, with the same step and with half the step, and
    compares the two after every step. The estimates are inf after either of them is no longer finite, and at the end of
    a run that diverged. Where a wire goes slack within a step, the estimate is that at the end of the step.
    """
    h, marks = run.dt, np.ceil(run.time / run.dt * (1.0 - 4.0 * ROUNDOFF))
    runs = [(machine.array(start), parameters_of(machine, half), h / (1 + half), 1 + half) for half in (False, True)]
    estimator, first = estimator_of(machine, h), float(start[ANGLE]) + TWO_PI * float(start[TURNS])
    so_far = MotionSoFar(np.array([first]), np.array([float(start[VELOCITY])]))
    estimates = np.full((2, len(marks)), math.inf)
    total, done = int(marks[-1]), 0
    while done < total or total == done == 0:
        count = min(STRETCH, total - done)
        columns = []
        for state, parameters, step, stride in runs:
            out = np.full((count + 1, machine.width), math.nan)
            machine.run(state, parameters, control, step, count, stride, math.inf, out, UNSEEN)
            reached = int(state[INDEX]) // stride - done
            columns.append((out[: reached + 1, ANGLE] + TWO_PI * out[: reached + 1, TURNS],
                            out[: reached + 1, VELOCITY]))
        rows = min(len(angle) for angle, _ in columns)
        angles, velocities = ([column[i][:rows, None] for column in columns] for i in (0, 1))
        index = np.arange(done, done + rows, dtype=np.float64)[:, None]
        errors = so_far.estimates(estimator, index, (angles[0], angles[1]), (velocities[0], velocities[1]))
        here = (marks >= done) & (marks < done + rows)
        estimates[:, here] = errors[(marks[here] - done).astype(np.intp), :, 0].T
        if rows <= count or total == 0:
            break
        done += count
    if run.stop_reason == STOP_REASONS[DIVERGED]:
        estimates[:, -1] = math.inf
    return replace(run, error_estimate=estimates[0], velocity_error_estimate=estimates[1])


# --- one environment ------------------------------------------------------------------------------------------------


class CertifiedMachine(Machine):
    """Machine (simulator of one pendulum) for one environment with error estimates.

    Its state holds a Machine's state, the state of the run at half the step, EXTREMES (angle range and largest velocity
    of the episode) and the error estimate. ``run`` advances both runs and records nothing; ``info`` has the further
    entry "error_estimate".
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._info_of_state, self._own = self.info, len(self.names)
        self.names = (*self.names, *(f"half_{name}" for name in self.names), *EXTREMES, ESTIMATE)
        self._set_runs()
        self._unread = (*self.watched.values(), *range(self.phi, self._own))
        self.direct, self.info = self.run, self._with_estimate

    def _set_runs(self) -> None:
        """Set the parameters of both runs from those of the machine; the estimator is made when first needed."""
        self._half_parameters, self._free_parameters = parameters_of(self, half=True), parameters_of(self, half=False)
        self._estimator: ErrorEstimator | None = None

    def take(self, scene: Scene) -> None:
        """Continue with a scene that has other parameter values; see :meth:`Machine.take`."""
        super().take(scene)
        self._set_runs()

    def state(self, angle: float, velocity: float, uniform: Sequence[float] = ()) -> Any:
        """Return the initial state of an episode, for the run and the run at half the step; see :meth:`Machine.state`.
        """
        own = super().state(angle, velocity, uniform)
        half = own[: self._own]
        unwrapped = float(half[ANGLE]) + TWO_PI * float(half[TURNS])
        return self.array([*half, *half, unwrapped, unwrapped, abs(velocity), 0.0])

    def run(
        self, state: Any, parameters: Any, control: float, h: float, rows: int, every: int, speed_limit: float,
        out: Any, seen: Any,
    ) -> int:
        """Advance the run and the run at half the step, and update the error estimate; see :meth:`Machine.run`.

        Where a wire goes slack within a step, the estimate is that at the end of the step.
        """
        earlier = state.copy()
        code = super().run(state, parameters, control, h, rows, every, speed_limit, out, seen)
        own, index = self._own, float(math.ceil(state[INDEX]))
        full, half = state, state[own : 2 * own]
        more = int(2.0 * index - half[INDEX])
        if more > 0:
            try:
                super().run(half, self._half_parameters, control, 0.5 * h, 1, more, math.inf, NOWHERE, UNSEEN.copy())
                if index > state[INDEX]:
                    full, steps = earlier[:own].copy(), int(index - earlier[INDEX])
                    super().run(full, self._free_parameters, control, h, 1, steps, math.inf, NOWHERE, UNSEEN.copy())
            except BaseException:
                state[:] = earlier
                raise
            for entry in self._unread:
                half[entry] = 0.0
            state[own : 2 * own] = half
        low, high, fastest, before = (float(value) for value in state[2 * own :])
        angles, velocities = zip(*(motion_of(values) for values in (full, half)), strict=True)
        low, high, fastest = min(low, angles[0]), max(high, angles[0]), max(fastest, abs(velocities[0]))
        error, trusted = math.inf, False
        if code != DIVERGED and float(half[INDEX]) == 2.0 * index == 2.0 * full[INDEX] and before != math.inf:
            if self._estimator is None or self._estimator.h != h:
                self._estimator = estimator_of(self, h)
            error, _, trusted = self._estimator(index, angles, velocities, high - low, fastest, min, max, math.sqrt)
        for entry, value in enumerate((low, high, fastest, error if trusted else math.inf), 2 * own):
            state[entry] = value
        return code

    def _with_estimate(self, values: list[float]) -> dict[str, float]:
        """Return the entries of the environment's ``info`` for a state, with the error estimate added."""
        return {**self._info_of_state(values), ESTIMATE: values[-1]}


# --- many -------------------------------------------------------------------------------------------------------------


class CertifiedBatch(Batch):
    """A batch of environments with error estimates, computed together with a batch at half the step.

    The estimates are the last entry of ``names`` and of the results' ``info``. If an environment stops within a control
    step, its run at half the step is continued to the same time by the interpreter, which gives the same bits.
    """

    def __init__(
        self, scene: Scene, method: str | Method, diagnostics: Sequence[str], backend: Backend,
        numbers: Mapping[str, Any], *, size: int, h: float, substeps: int, most: float, **options: Any,
    ) -> None:
        super().__init__(scene, method, diagnostics, backend, numbers, size=size, h=h, substeps=substeps, most=most,
                         **options)
        self._row, self.names = len(self.names), (*self.names, ESTIMATE)
        self._half_numbers = {**endless(numbers)}
        self._half = Batch(scene, method, diagnostics, backend, self._half_numbers, size=size, h=h / 2,
                           substeps=2 * substeps, most=math.inf, **{**options, **halved(self.tolerance)})
        self._unread = self._half.results(lasting=True)
        self._scene = scene
        self._alone: Machine | None = None
        self._estimator = ErrorEstimator.of(scene, self.method, h, numbers, self.compensated, bool(self.tolerance))
        self._so_far = MotionSoFar(np.zeros(size), np.zeros(size))
        self._estimate = np.zeros(size)

    def step(self, action: NDArray[np.floating[Any]], into: Results) -> bool:
        """Take one control step of every environment with the full and with half the step, and fill ``into``.

        The results in ``into`` include the error estimate; see :meth:`Batch.step`.
        """
        before, earlier = self.get("index"), self._state.copy()
        if not super().step(action, into):
            return False
        own = self.motion()
        after = np.ceil(own[0])
        short = np.flatnonzero((own[0] > before) & (own[0] < before + self.substeps))
        alone = {index: self._by_itself(self._half, index, action, int(after[index] - before[index]))
                 for index in map(int, short)}
        for index in map(int, np.flatnonzero(own[0] < after)):
            steps = int(after[index] - before[index])
            for values, value in zip(own, self._by_itself(self, index, action, steps, earlier), strict=True):
                values[index] = value
        self._half.go_on()
        self._half.step(action, self._unread)
        half = self._half.motion()
        for index, motion in alone.items():
            for values, value in zip(half, motion, strict=True):
                values[index] = value
        good = (half[0] == 2.0 * after) & (own[0] == after) & (self.get("status") != DIVERGED)
        self._judge(np.arange(self.size), own, half, good)
        into.info[self._row] = self._estimate
        return True

    def step_in_parts(
        self, sensing: Sensing, action: NDArray[np.floating[Any]], into: Results, seen: NDArray[np.float32]
    ) -> None:
        """Take one control step, which has only one part here; see :meth:`Batch.step_in_parts`."""
        sensing.act(action)
        self.step(sensing.acting(0), into)
        sensing.sample(self._state, sensing.turn(self.substeps), self.substeps)
        sensing.give(seen, into.info[-1])

    def look(self, into: Results) -> None:
        """Write observations, rewards and reported quantities of all environments in their present states to ``into``.
        """
        super().look(into)
        into.info[self._row] = self._estimate

    def start(
        self, which: Places | None, angle: Array, velocity: Array, drawn: Mapping[str, Array], into: Results,
        numbers: Mapping[str, Array] = UNCHANGED,
    ) -> None:
        """Start new episodes in the batch and in the batch at half the step; see :meth:`Batch.start`."""
        super().start(which, angle, velocity, drawn, into, numbers)
        self._half.start(which, angle, velocity, drawn, self._unread, endless(numbers))
        if numbers:
            self._half_numbers = {**endless(self.numbers)}
            self._estimator = ErrorEstimator.of(self._scene, self.method, self.h, self.numbers, self.compensated,
                                                bool(self.tolerance))
        places = np.arange(self.size) if which is None else which
        self._so_far.begin(places, self.angles()[places], self.get("v", places))
        self._judge(places, self.motion(), self._half.motion(), np.ones(self.size, dtype=np.bool_))
        into.info[self._row] = self._estimate

    def _judge(self, which: Places, own: Motion, half: Motion, good: NDArray[np.bool_]) -> None:
        """Update the error estimates of the environments ``which``.

        ``own`` and ``half`` are the steps taken, angles and velocities of all environments, in their own runs and at
        half the step; where ``good`` is False, they are not comparable, and the estimate is inf for the rest of the
        episode.
        """
        self._so_far.trusted &= good
        index, angles, velocities = ((one[None], other[None]) for one, other in zip(own, half, strict=True))
        errors = self._so_far.estimates(self._estimator, index[0], angles, velocities)
        self._estimate[which] = errors[0, 0, which]

    def _by_itself(
        self, batch: Batch, index: int, action: NDArray[np.floating[Any]], steps: int, blocks: Array | None = None
    ) -> tuple[float, float, float]:
        """Return step count, angle and velocity that one environment would have if it had not stopped early.

        The control step is repeated for this environment alone, by Python's interpreter, over ``steps`` steps of full
        length. ``batch`` is this batch, or the one that takes two half steps for each; ``blocks`` is a copy of its
        states at the start of the control step, by default its present states.
        """
        if self._alone is None:
            self._alone = Machine(self._scene, self.method, self.diagnostics, "python",
                                  compensated=self.compensated,
                                  rtol=self.tolerance.get("rtol"), atol=self.tolerance.get("atol"))
        machine, at, parts = self._alone, np.array([index]), batch.substeps // self.substeps
        values = {**dict(zip(machine.numbers, machine.parameters, strict=True)), **self._half_numbers,
                  HOLD[0]: float(batch.substeps), **batch.tolerance}
        parameters = [float(self._half.get(name, at)[0]) if name in self._half.layout.varying else float(values[name])
                      for name in machine.numbers]
        state = batch.state(index, machine.names, blocks)
        control = max(-1.0, min(1.0, float(action[index])))
        machine.run(state, parameters, control, batch.h, 1, parts * steps, math.inf, NOWHERE, UNSEEN.copy())
        return (float(state[INDEX]), *motion_of(state))


class CertifiedRuns(Runs):
    """A batch of runs with error estimates of angle and velocity as the last entries of their records.

    For the estimates every run is simulated twice more, with every step recorded: with the same step and with half the
    step.
    """

    def __init__(
        self, each: Each, method: str | Method, diagnostics: Sequence[str], backend: Backend, *, plan: RecordSchedule,
        hold: int = 1, streams: Streams | None = None, **options: Any,
    ) -> None:
        free = copy.copy(each)
        free.numbers = endless(each.numbers)
        twin = copy.deepcopy(streams), copy.deepcopy(streams)
        super().__init__(each, method, diagnostics, backend, plan=plan, hold=hold, streams=streams, **options)
        self._pair = [
            Runs(free, method, diagnostics, backend, plan=RecordSchedule(plan.h / parts, parts * plan.steps, parts),
                 hold=parts * hold, streams=twin[parts - 1], **{**options, **tolerance})
            for parts, tolerance in ((1, self.tolerance), (2, halved(self.tolerance)))
        ]
        self._columns = [self.names.index(name) for name in ("angle", "velocity")]
        self.names = (*self.names, ESTIMATE, VELOCITY_ESTIMATE)
        self._estimator = ErrorEstimator.of(each.scene, self.method, plan.h, each.numbers, self.compensated,
                                            bool(self.tolerance))

    def rows(self, progress: Progress | None = None, whole: Array | None = None) -> Iterator[Array]:
        """Yield the records of all runs with error estimates, some rows (recorded times) at a time.

        ``progress`` is called with the progress of the estimates, which take most of the time.
        """
        estimates = self._estimates(progress)
        ready = next(estimates)
        for rows in super().rows(None, whole):
            while len(ready) < len(rows):
                ready = np.concatenate((ready, next(estimates)))
            stopped = np.isnan(rows[:, self._columns[0]])
            rows[:, -2:] = np.where(stopped[:, None], math.nan, ready[: len(rows)])
            ready = ready[len(rows) :]
            yield rows

    def _estimates(self, progress: Progress | None) -> Iterator[Array]:
        """Yield the error estimates at the recorded steps, arrays ``(records, 2, runs)``, some records at a time."""
        marks, done, so_far = self.plan.marks, 0, None
        for both in zip(*(runs.rows() for runs in self._pair), strict=True):
            angles, velocities = ((both[0][:, i], both[1][:, i]) for i in self._columns)
            so_far = MotionSoFar(angles[0][0], velocities[0][0]) if so_far is None else so_far
            last = done + len(both[0])
            index = np.arange(done, last, dtype=np.float64)[:, None]
            errors = so_far.estimates(self._estimator, index, angles, velocities)
            if progress is not None:
                progress(last / (self.plan.steps + 1), "running")
            yield errors[marks[(marks >= done) & (marks < last)] - done]
            done = last
