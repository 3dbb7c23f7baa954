"""Runs and environments, single or many, beside others at half the step.

See :mod:`pendulum_env.engine.certificate`. The second one is the same program on another state, so that nothing more is
compiled.
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
from pendulum_env.engine.batch import Batch, Results
from pendulum_env.engine.certificate import (
    ESTIMATE,
    VELOCITY_ESTIMATE,
    Past,
    Yardstick,
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
    reported,
)
from pendulum_env.engine.result import Rollout
from pendulum_env.engine.runs import Plan, Runs
from pendulum_env.engine.shape import DIVERGED, HOLD, STOP_REASONS
from pendulum_env.engine.streams import Streams
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import truth

Array = NDArray[np.float64]
Places = NDArray[np.intp]

STRETCH = 2**14
"""Steps of a single run that are compared at a time."""
PAST = ("low", "high", "fastest")
"""What an environment keeps of its episode: range of the angle [rad], largest |velocity| [rad/s]."""


def yardstick_of(machine: Machine, h: float) -> Yardstick:
    """What differences of a machine's runs with steps of ``h`` [s] are measured by."""
    numbers = {**machine.scene.coefficients, "omega0": frequency(machine.scene)}
    return Yardstick.of(machine.scene, machine.method, h, numbers, machine.compensated, bool(machine.tolerance))


def parameters_of(machine: Machine, half: bool) -> Any:
    """A machine's parameters for a run that only the finite range ends, with its steps or with half of them."""
    given = dict(zip(machine.numbers, machine.parameters, strict=True))
    return machine.array((halved(given) if half else endless(given)).values())


def checked_estimate(diagnostics: Sequence[str], asked: Any) -> tuple[tuple[str, ...], bool]:
    """What programs report, and whether the error is to be estimated: asked for by itself, or in ``diagnostics``."""
    found = check_diagnostics(diagnostics)
    return reported(found), truth(asked, "estimate_error") or reported(found) != found


# --- single runs ----------------------------------------------------------------------------------------------------


def with_estimates(machine: Machine, start: Any, run: Rollout, control: float) -> Rollout:
    """A run of a machine from a state, with estimates of its error.

    The run is made again, and another at half the step, and the two are compared after every step. From where either
    leaves the finite range, inf, and at the end of a run that diverged.
    """
    h, marks = run.dt, np.rint(run.time / run.dt)
    runs = [(machine.array(start), parameters_of(machine, half), h / (1 + half), 1 + half) for half in (False, True)]
    yardstick, first = yardstick_of(machine, h), float(start[ANGLE]) + TWO_PI * float(start[TURNS])
    past = Past(np.array([first]), np.array([float(start[VELOCITY])]))
    found = np.full((2, len(marks)), math.inf)
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
        judged = past.judged(yardstick, index, (angles[0], angles[1]), (velocities[0], velocities[1]))
        here = (marks >= done) & (marks < done + rows)
        found[:, here] = judged[(marks[here] - done).astype(np.intp), :, 0].T
        if rows <= count or total == 0:
            break
        done += count
    if run.stop_reason == STOP_REASONS[DIVERGED]:
        found[:, -1] = math.inf
    return replace(run, error_estimate=found[0], velocity_error_estimate=found[1])


# --- one environment ------------------------------------------------------------------------------------------------


class CertifiedMachine(Machine):
    """A machine whose state holds, behind its own numbers, those at half the step, PAST and the error estimate.

    ``run`` advances both; it records nothing. ``info`` has "error_estimate" beside the rest.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._told, self._own = self.info, len(self.names)
        self.names = (*self.names, *(f"half_{name}" for name in self.names), *PAST, ESTIMATE)
        self._half_parameters = parameters_of(self, half=True)
        self._unread = (*self.watched.values(), *range(self.phi, self._own))
        self._yardstick: Yardstick | None = None
        self.direct, self.info = self.run, self._with_estimate

    def state(self, angle: float, velocity: float, uniform: Sequence[float] = ()) -> Any:
        own = super().state(angle, velocity, uniform)
        half = own[: self._own]
        unwrapped = float(half[ANGLE]) + TWO_PI * float(half[TURNS])
        return self.array([*half, *half, unwrapped, unwrapped, abs(velocity), 0.0])

    def run(
        self, state: Any, parameters: Any, control: float, h: float, rows: int, every: int, speed_limit: float,
        out: Any, seen: Any,
    ) -> int:
        earlier = state.copy()
        code = super().run(state, parameters, control, h, rows, every, speed_limit, out, seen)
        own, index = self._own, float(state[INDEX])
        half = state[own : 2 * own]
        more = int(2.0 * index - half[INDEX])
        if more > 0:
            try:
                super().run(half, self._half_parameters, control, 0.5 * h, 1, more, math.inf, NOWHERE, UNSEEN.copy())
            except BaseException:
                state[:] = earlier
                raise
            for place in self._unread:
                half[place] = 0.0
            state[own : 2 * own] = half
        low, high, fastest, before = (float(value) for value in state[2 * own :])
        angles, velocities = zip(*(motion_of(values) for values in (state, half)), strict=True)
        low, high, fastest = min(low, angles[0]), max(high, angles[0]), max(fastest, abs(velocities[0]))
        found, trusted = math.inf, False
        if code != DIVERGED and float(half[INDEX]) == 2.0 * index and before != math.inf:
            if self._yardstick is None or self._yardstick.h != h:
                self._yardstick = yardstick_of(self, h)
            found, _, trusted = self._yardstick(index, angles, velocities, high - low, fastest, min, max, math.sqrt)
        for place, value in enumerate((low, high, fastest, found if trusted else math.inf), 2 * own):
            state[place] = value
        return code

    def _with_estimate(self, values: list[float]) -> dict[str, float]:
        return {**self._told(values), ESTIMATE: values[-1]}


def machine_class(diagnostics: Sequence[str]) -> type[Machine]:
    """What runs one environment with these diagnostics."""
    return CertifiedMachine if "error" in check_diagnostics(diagnostics) else Machine


# --- many -------------------------------------------------------------------------------------------------------------


class CertifiedBatch(Batch):
    """A batch beside one at half the step. The estimates stand last in ``names`` and in the results' ``info``.

    Where an environment stops within a control step, its run at half the step is made up to there by itself, by the
    interpreter, which gives the same bits.
    """

    def __init__(
        self, scene: Scene, method: str | Method, diagnostics: Sequence[str], backend: Backend,
        numbers: Mapping[str, Any], *, size: int, h: float, substeps: int, most: float, **options: Any,
    ) -> None:
        def batch(of: Mapping[str, Any], parts: int, bound: float) -> Batch:
            return Batch(scene, method, diagnostics, backend, of, size=size, h=h / parts, substeps=parts * substeps,
                         most=bound, **options)

        super().__init__(scene, method, diagnostics, backend, numbers, size=size, h=h, substeps=substeps, most=most,
                         **options)
        self.names = (*self.names, ESTIMATE)
        self._half_numbers = {**endless(numbers)}
        self._half = batch(self._half_numbers, 2, math.inf)
        self._unread = self._half.results()
        self._scene = scene
        self._alone: Machine | None = None
        self._yardstick = Yardstick.of(scene, self.method, h, numbers, self.compensated)
        self._past = Past(np.zeros(size), np.zeros(size))
        self._estimate = np.zeros(size)

    def step(self, action: NDArray[np.floating[Any]], into: Results) -> None:
        before = self.get("index")
        super().step(action, into)
        after = self.get("index")
        short = np.flatnonzero((after > before) & (after < before + self.substeps))
        alone = {int(place): self._by_itself(int(place), action, int(after[place] - before[place])) for place in short}
        self._half.go_on()
        self._half.step(action, self._unread)
        index, other, speed = self._half.motion()
        for place, motion in alone.items():
            other[place], speed[place], index[place] = motion
        good = (index == 2.0 * after) & (self.get("status") != DIVERGED)
        self._judge(np.arange(self.size), other, speed, good)
        into.info[-1] = self._estimate

    def look(self, into: Results) -> None:
        super().look(into)
        into.info[-1] = self._estimate

    def start(
        self, which: Places | None, angle: Array, velocity: Array, drawn: Mapping[str, Array], into: Results
    ) -> None:
        super().start(which, angle, velocity, drawn, into)
        self._half.start(which, angle, velocity, drawn, self._unread)
        places = np.arange(self.size) if which is None else which
        self._past.begin(places, self.angles()[places], self.get("v", places))
        _, other, speed = self._half.motion()
        self._judge(places, other, speed, np.ones(self.size, dtype=np.bool_))
        into.info[-1] = self._estimate

    def _judge(self, which: Places, other: Array, speed: Array, good: NDArray[np.bool_]) -> None:
        """Estimates of the environments at these places, from the motions at half the step."""
        self._past.trusted &= good
        found = self._past.judged(
            self._yardstick, self.get("index")[None], (self.angles()[None], other[None]),
            (self.get("v")[None], speed[None]),
        )
        self._estimate[which] = found[0, 0, which]

    def _by_itself(self, place: int, action: NDArray[np.floating[Any]], steps: int) -> tuple[float, float, float]:
        """Angle, velocity and index of one environment at half the step after so many steps of the whole one."""
        if self._alone is None:
            self._alone = Machine(self._scene, self.method, self.diagnostics, "python", compensated=self.compensated)
        machine, at, half = self._alone, np.array([place]), self._half
        values = {**self._half_numbers, HOLD[0]: 2.0 * self.substeps}
        parameters = [float(half.get(name, at)[0]) if name in half.layout.varying else float(values[name])
                      for name in machine.numbers]
        state = [float(value) for value in half.state(place, machine.names)]
        control = max(-1.0, min(1.0, float(action[place])))
        machine.run(state, parameters, control, half.h, 1, 2 * steps, math.inf, NOWHERE, UNSEEN.copy())
        return (*motion_of(state), float(state[INDEX]))


def batch_class(diagnostics: Sequence[str]) -> type[Batch]:
    """What runs a vector of environments with these diagnostics."""
    return CertifiedBatch if "error" in check_diagnostics(diagnostics) else Batch


class CertifiedRuns(Runs):
    """Runs whose records hold, behind the rest, error estimates of angle and velocity.

    Beside them each is made again with every step recorded, and at half the step.
    """

    def __init__(
        self, each: Each, method: str | Method, diagnostics: Sequence[str], backend: Backend, *, plan: Plan,
        hold: int = 1, streams: Streams | None = None, **options: Any,
    ) -> None:
        free = copy.copy(each)
        free.numbers = endless(each.numbers)
        self._pair = [
            Runs(free, method, diagnostics, backend, plan=Plan(plan.h / parts, parts * plan.steps, parts),
                 hold=parts * hold, streams=copy.deepcopy(streams), **options)
            for parts in (1, 2)
        ]
        super().__init__(each, method, diagnostics, backend, plan=plan, hold=hold, streams=streams, **options)
        self._columns = [self.names.index(name) for name in ("angle", "velocity")]
        self.names = (*self.names, ESTIMATE, VELOCITY_ESTIMATE)
        self._yardstick = Yardstick.of(each.scene, self.method, plan.h, each.numbers, self.compensated)

    def rows(self, progress: Progress | None = None, whole: Array | None = None) -> Iterator[Array]:
        """The same with the estimates; progress is told as these are made."""
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
        """Estimates at the marks, shape ``(marks, 2, runs)``, some marks at a time."""
        marks, done, past = self.plan.marks, 0, None
        for both in zip(*(runs.rows() for runs in self._pair), strict=True):
            angles, velocities = ((both[0][:, i], both[1][:, i]) for i in self._columns)
            past = Past(angles[0][0], velocities[0][0]) if past is None else past
            last = done + len(both[0])
            index = np.arange(done, last, dtype=np.float64)[:, None]
            found = past.judged(self._yardstick, index, angles, velocities)
            if progress is not None:
                progress(last / (self.plan.steps + 1), "running")
            yield found[marks[(marks >= done) & (marks < last)] - done]
            done = last
