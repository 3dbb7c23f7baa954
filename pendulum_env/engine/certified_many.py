"""Many runs, and environments, beside others at half the step; see :mod:`pendulum_env.engine.certificate`."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.common.progress import Progress
from pendulum_env.engine.batch import Batch, Results
from pendulum_env.engine.certificate import ESTIMATE, VELOCITY_ESTIMATE, Past, Yardstick, endless, motion_of
from pendulum_env.engine.each import Each
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import INDEX, NOWHERE, UNSEEN, Machine, check_diagnostics
from pendulum_env.engine.runs import Plan, Runs
from pendulum_env.engine.shape import DIVERGED, HOLD
from pendulum_env.engine.streams import Streams
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]
Places = NDArray[np.intp]


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
        before = self._get("index")
        super().step(action, into)
        after = self._get("index")
        short = np.flatnonzero((after > before) & (after < before + self.substeps))
        alone = {int(place): self._by_itself(int(place), action, int(after[place] - before[place])) for place in short}
        self._half._put(self._half._state, "status", np.zeros(self.size))
        self._half.step(action, self._unread)
        other, speed, index = self._half.angles(), self._half._get("v"), self._half._get("index")
        for place, motion in alone.items():
            other[place], speed[place], index[place] = motion
        good = (index == 2.0 * after) & (self._get("status") != DIVERGED)
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
        self._past.begin(places, self.angles()[places], self._get("v", places))
        self._judge(places, self._half.angles(), self._half._get("v"), np.ones(self.size, dtype=np.bool_))
        into.info[-1] = self._estimate

    def _judge(self, which: Places, other: Array, speed: Array, good: NDArray[np.bool_]) -> None:
        """Estimates of the environments at these places, from the motions at half the step."""
        self._past.trusted &= good
        found = self._past.judged(
            self._yardstick, self._get("index")[None], (self.angles()[None], other[None]),
            (self._get("v")[None], speed[None]),
        )
        self._estimate[which] = found[0, 0, which]

    def _by_itself(self, place: int, action: NDArray[np.floating[Any]], steps: int) -> tuple[float, float, float]:
        """Angle, velocity and index of one environment at half the step after so many steps of the whole one."""
        if self._alone is None:
            self._alone = Machine(self._scene, self.method, self.diagnostics, "python", compensated=self.compensated)
        machine, at, half = self._alone, np.array([place]), self._half
        values = {**self._half_numbers, HOLD[0]: 2.0 * self.substeps}
        parameters = [float(half._get(name, at)[0]) if name in half.layout.varying else float(values[name])
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
