"""Recorded runs: of one pendulum, and of many that advance together in blocks; and the Rollout made of their records.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from integrators.steps.compensated import LOST
from pendulum_env.common.progress import Progress
from pendulum_env.common.provenance import provenance
from pendulum_env.engine.each import Each
from pendulum_env.engine.growing_file import GrowingFile, read
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine
from pendulum_env.engine.pendulums import Blocks
from pendulum_env.engine.random_streams import Streams
from pendulum_env.engine.result import ESTIMATE, VELOCITY_ESTIMATE, Rollout
from pendulum_env.engine.shape import DIVERGED, LEFT_OUT, OK, STOP_REASONS
from pendulum_env.engine.wrap import left_out
from pendulum_env.physics.energy import Ledger

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


def recorded(
    machine: Machine, state: Any, plan: RecordSchedule, control: float = 0.0, speed_limit: float = math.inf
) -> tuple[Array, str]:
    """Return the recorded states of one run of a machine, shape ``(states, width)``, and its stop reason or "".

    The run begins at ``state``, which is changed to the final state. If it stops early, the last recorded state is that
    at the stop. ``control`` is the constant fraction of the motor's torque, ``speed_limit`` the |velocity| that ends
    the run [rad/s].
    """
    whole, rest = divmod(plan.steps, plan.every)
    out = np.empty((plan.count, machine.width))
    code = machine.run(state, machine.parameters, control, plan.h, whole, plan.every, speed_limit, out[: whole + 1],
                       UNSEEN)
    if rest and not code:
        code = machine.run(state, machine.parameters, control, plan.h, 1, rest, speed_limit, out[whole:], UNSEEN)
    return out[: 1 + math.ceil(state[INDEX] / plan.every)], STOP_REASONS.get(code, "")


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
            while left > max(1, self.at_once):
                now = max(1, self.at_once)
                left -= now
                advance(1, now, out[:0])
            count = min(len(out) - row, max(1, self.at_once // every)) if left == every > 0 else 1
            advance(count, left, out[row : row + count])
            row += count


# --- results ----------------------------------------------------------------------------------------------------------


def result_of(machine: Machine, states: Array, reason: str, h: float, state: Any) -> Rollout:
    """Return the Rollout of a single run, made from the recorded states of a machine.

    ``reason`` is the stop reason of the run, ``h`` the step [s], ``state`` the final state with all its entries.
    """
    counts = {name: int(state[place]) for name, place in machine.kept.items()}
    angle = states[:, ANGLE] + TWO_PI * states[:, TURNS]
    lost_q, lost_v = (states[:, machine.names.index(name)] if machine.compensated else None for name in LOST)
    return Rollout(
        time=states[:, INDEX] * h,
        angle=angle,
        velocity=states[:, VELOCITY],
        ledger=machine.ledger(states, machine.ledger(states[:1], 0.0).energy),
        heat_by_effect=machine.heat_by_effect(states),
        watched={name: states[:, place] for name, place in machine.watched.items()},
        stop_reason=reason,
        stop_time=float(states[-1, INDEX]) * h,
        scene=machine.scene,
        method=machine.method,
        dt=h,
        tolerance=machine.tolerance,
        steps=counts.get("taken", 0),
        rejected=counts.get("rejected", 0),
        lost_angle=None if lost_q is None else left_out(angle, states[:, ANGLE], lost_q, states[:, TURNS]),
        lost_velocity=lost_v,
    )


def result_of_all(runs: Runs, shape: tuple[int, ...], path: Path | None, progress: Progress) -> Rollout:
    """Simulate a batch of runs and return its Rollout, whose records are in memory or mapped from the file ``path``.
    """
    plan, names = runs.plan, runs.names
    time: Array = plan.marks.astype(np.float64) * plan.h
    if path is None:
        records = np.empty((len(time), len(names), runs.size))
        for _ in runs.rows(progress, records):
            pass
        by_run = records.reshape(len(time), len(names), *shape)
        series = {name: np.moveaxis(by_run[:, i], 0, -1) for i, name in enumerate(names)}
    else:
        done = 0
        facts = provenance(scene=runs.scene.to_dict(), integrator=runs.method.name, dt=plan.h, every=plan.every,
                           compensated=runs.compensated, **runs.tolerance)
        with GrowingFile(path, names, shape, facts) as file:
            for rows in runs.rows(progress):
                file.append(time[done : done + len(rows)], rows)
                done += len(rows)
        mapped = read(path)
        series = {name: np.moveaxis(mapped[name], 0, -1) for name in names}
    zeros = np.broadcast_to(0.0, series["angle"].shape)
    work, heat = (series.get(name, zeros) for name in ("work", "heat"))
    kinetic, potential = series["kinetic_energy"], series["potential_energy"]
    initial = kinetic[..., :1] + potential[..., :1]
    further: dict[str, Any] = {name: series[name] for name in (*LEFT_OUT, ESTIMATE, VELOCITY_ESTIMATE)
                               if name in series}
    return Rollout(
        time=time,
        angle=series["angle"],
        velocity=series["velocity"],
        ledger=Ledger(kinetic, potential, work, heat, initial),
        heat_by_effect={name.removeprefix("heat_"): series[name] for name in names if name.startswith("heat_")},
        watched={name: series[name] for name in runs.layout.shape.watched},
        stop_reason=runs.reasons,
        stop_time=runs.ends.reshape(shape),
        scene=runs.scene,
        method=runs.method,
        dt=plan.h,
        tolerance=runs.tolerance,
        steps=runs.count("taken").reshape(shape) if runs.tolerance else 0,
        rejected=runs.count("rejected").reshape(shape) if runs.tolerance else 0,
        **further,
    )
