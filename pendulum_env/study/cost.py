"""What accuracy costs in time: every method at a ladder of steps on one scene, against the reference."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import Backend, interpreted, resolve
from pendulum_env.engine.machine import NOWHERE, UNSEEN, VELOCITY, Machine, fitting
from pendulum_env.engine.rollout import Rollout, rollout
from pendulum_env.engine.starts import checked_methods, checked_start, checked_steps
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number
from pendulum_env.progress import Progress
from pendulum_env.provenance import output_folder, provenance, write_csv
from pendulum_env.study.cost_points import FLOOR, CostPoint, CostStudy
from pendulum_env.study.reference import Reference, StudyError, reference

__all__ = ["CostPoint", "CostStudy", "Progress", "cost", "machine_name", "versions", "write"]


RECORDS = 16
"""Times per small-angle period at which errors are measured; also the fewest steps of the default ladder."""
DOUBLINGS = 13
"""Rungs of the default ladder: period/16, period/32, ... period/65536."""
MOST_STEPS = {"compiled": 2**20, "python": 2**13}
"""The default ladder ends where a run would take more steps than this."""
MOST_RECORDS = 2**20
"""Times at which errors are measured, at most."""
SHORTEST = 2e-4
"""A timing lasts at least this long [s]: short runs are repeated in it."""
SAMPLES = 32
"""Single steps, spread over a run, in which the evaluations of implicit methods are counted."""


def cost(
    scene: str | Scene | dict[str, Any] = "lab",
    integrators: Iterable[str | Method] | None = None,
    *,
    angle: float | None = None,
    velocity: float | None = None,
    duration: float | None = None,
    damping: Damping = "scene",
    steps: Sequence[float] | None = None,
    repeats: int = 5,
    progress: Progress | None = None,
    on_point: Callable[[CostPoint], None] | None = None,
    backend: Backend = "auto",
    **parameters: Any,
) -> CostStudy:
    """Measure error, time and force evaluations of methods on a scene.

    Each method runs with every step of the ladder, from long to short. Errors are the largest over common times,
    about 16 per small-angle period. Runs are timed warm, as they are everywhere in the package: with the energy ledger.
    The repeats go round all runs in turn, so that a noisy machine hurts all of them alike.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrators: names or methods, none twice; by default all that fit.
        angle, velocity, duration: the run [rad, rad/s, s]; by default the scene's usual one.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`.
        steps: the ladder [s], each rounded down to fit the common times; by default period/16, /32, ... /65536, ended
            at about a million steps per run.
        repeats: timings of each run.
        progress: called with the fraction done and what is being done.
        on_point: called with each point when its error and first time are known.
        backend: "auto", "compiled" or "python".
        **parameters: single parameters of the scene, such as ``length=0.5``.

    KeyboardInterrupt ends it early: the study then has what was measured, and ``complete`` is False.

    Raises SceneError or MethodError for anything that cannot be, StudyError for a start where nothing moves.
    """
    place = build_scene(scene, damping, parameters)
    q = number(place.run.angle if angle is None else angle, "angle", unit="rad")
    v = number(place.run.velocity if velocity is None else velocity, "velocity", unit="rad/s")
    checked_start(place, q, v)
    length = number(place.run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    if isinstance(repeats, bool) or not isinstance(repeats, int) or repeats < 1:
        raise SceneError(f"repeats must be a whole number from 1, not {repeats!r}.")
    gap, counts = _ladder(place, length, steps, MOST_STEPS[resolve(backend)])
    methods = checked_methods(fitting(place) if integrators is None else integrators, place)
    machines = [Machine(place, method, backend=backend) for method in methods]
    records = round(length / gap)
    truth = reference(place, q, v, np.arange(records + 1) * gap)
    if not truth.velocity.any():
        raise StudyError("Nothing moves from rest at the bottom; give an angle or a velocity.")
    runs = [_Run(machine, q, v, gap, count, records) for count in counts for machine in machines]
    points: list[CostPoint] = []
    tell = progress or (lambda _fraction, _what: None)
    total, done, complete = sum(run.work for run in runs) * (repeats + 1), 0.0, True
    try:
        for run in runs:
            tell(done / total, f"{run.machine.method.name}, {run.steps} steps")
            points.append(run.measured(truth))
            done += 2.0 * run.work
            if on_point:
                on_point(points[-1])
        for again in range(1, repeats):
            for i, run in enumerate(runs):
                tell(done / total, f"timing {again + 1} of {repeats}: {run.machine.method.name}")
                if points[i].times:
                    points[i] = run.timed(points[i])
                done += run.work
        tell(1.0, "done")
    except KeyboardInterrupt:
        complete = False
    order = {name: i for i, name in enumerate(dict.fromkeys(machine.method.name for machine in machines))}
    points.sort(key=lambda point: (order[point.method], -point.dt))
    return CostStudy(place, q, v, length, truth, tuple(points), repeats, complete)


def _ladder(scene: Scene, duration: float, steps: Sequence[float] | None, most: int) -> tuple[float, list[int]]:
    """Time between records [s], and the ladder as numbers of steps from one record to the next."""
    period = 2.0 * math.pi / scene.omega0 if scene.omega0 else duration
    if not duration * RECORDS / period <= MOST_RECORDS:
        raise StudyError(
            f"A run of {duration / period:.3g} periods is too long for this study, at most {MOST_RECORDS // RECORDS}; "
            "shorten the duration."
        )
    if steps is None:
        records = math.ceil(duration * RECORDS / period - 1e-9)
        counts = [2**k for k in range(DOUBLINGS) if records * 2**k <= max(most, records)]
        return duration / records, counts
    wanted = [number(step, "each step", above=0.0, unit="s") for step in steps]
    if not wanted or max(wanted) > duration:
        raise StudyError(f"steps must hold at least one step [s], none longer than the run of {duration:g} s.")
    checked_steps(duration, min(wanted))
    gap = duration / checked_steps(duration, max(period / RECORDS, max(wanted)))
    return gap, sorted({checked_steps(gap, step) for step in wanted})


def _started(machine: Machine, angle: float, velocity: float) -> Any:
    """A start with its energies filled in."""
    state = machine.state(angle, velocity)
    machine.advance(state, 0.0, 1.0, 0)
    return state


@dataclass
class _Run:
    """One method at one step, to be measured and timed."""

    machine: Machine
    angle: float
    velocity: float
    gap: float
    count: int
    records: int

    @property
    def dt(self) -> float:
        return self.gap / self.count

    @property
    def steps(self) -> int:
        return self.count * self.records

    @property
    def work(self) -> float:
        """About how long it takes, for progress."""
        return 1e4 + self.steps * self.machine.method.evaluations * (10.0 if self.machine.method.implicit else 1.0)

    def measured(self, truth: Reference) -> CostPoint:
        """Errors, evaluations and a first time."""
        method = self.machine.method
        _started(self.machine, self.angle, self.velocity)
        found = rollout(
            self.machine.scene, integrator=method, angle=self.angle, velocity=self.velocity, dt=self.dt,
            duration=self.records * self.gap, every=self.count,
            backend="compiled" if self.machine.compiled else "python",
        )
        point = CostPoint(method.name, self.dt, self.steps, math.nan, math.nan, math.nan, math.nan, (), math.nan)
        if found.stop_reason:
            return replace(point, stop_reason=str(found.stop_reason))
        errors = np.abs(found.angle - truth.angle)
        worst = float(np.max(errors))
        drift = float(np.max(np.abs(found.energy_residual)) / (found.energy[0] or np.max(found.energy)))
        return self.timed(replace(
            point, angle_error=worst, end_error=float(errors[-1]), energy_error=drift,
            evaluations=self.steps * self._evaluations(found), floor=worst <= FLOOR * truth.error_estimate,
        ))

    def timed(self, point: CostPoint) -> CostPoint:
        """The point with one more timing, the mean over as many runs as a reliable one takes."""
        once = point.time if point.times else self._clock(1)
        times = (*point.times, self._clock(max(1, math.ceil(SHORTEST / once))))
        return replace(point, times=times, ns_per_second=1e9 * min(times) / (self.records * self.gap))

    def _clock(self, runs: int) -> float:
        """Mean wall time of one run [s]."""
        machine, start = self.machine, self.machine.state(self.angle, self.velocity)
        state = machine.state(self.angle, self.velocity)
        begun = time.perf_counter()
        for _ in range(runs):
            state[:] = start
            machine.advance(state, 0.0, self.dt, self.steps)
        return (time.perf_counter() - begun) / runs

    def _evaluations(self, run: Rollout) -> float:
        """Force evaluations per step; for implicit methods counted in single steps between turning points."""
        method, scene = self.machine.method, self.machine.scene
        if not method.implicit:
            return float(method.evaluations)
        made, calls = program(scene, method, ()), [0]
        force = "mean_acceleration" if "mean" in method.needs else "acceleration"
        original = interpreted(made.text, made.title)[force]

        def counted(*arguments: float) -> float:
            calls[0] += 1
            return float(original(*arguments))

        advance = interpreted(made.text, made.title, {force: counted})["run"]
        states, before, found = Machine(scene, method, (), "python"), 0, []
        chosen = np.linspace(0, len(run.time) - 1, SAMPLES).astype(int)
        for angle, velocity in zip(run.angle[chosen], run.velocity[chosen], strict=True):
            state = states.state(float(angle), float(velocity))
            advance(state, states.parameters, 0.0, self.dt, 1, 1, math.inf, NOWHERE, UNSEEN)
            if state[VELOCITY] * velocity > 0.0:
                found.append(calls[0] - before)
            before = calls[0]
        return sum(found) / len(found) if found else math.nan


COLUMNS = (
    "method", "dt_s", "steps", "force_evaluations", "angle_error_rad", "end_angle_error_rad", "relative_energy_error",
    "time_min_s", "time_median_s", "ns_per_simulated_second", "status", "pareto",
)


def write(study: CostStudy, folder: str | Path) -> tuple[Path, Path]:
    """Write ``cost.png`` and ``cost.csv``; runs that ended early are in the table only. OutputError if it cannot."""
    from pendulum_env.plots.style import save
    from pendulum_env.study.cost_plot import draw

    place, front = output_folder(folder), set(study.front)
    facts = provenance(
        Scene=study.scene.to_dict(), Angle=study.angle, Velocity=study.velocity, Duration=study.duration,
        Reference=study.reference.how, ReferenceError=study.reference.error_estimate, Repeats=study.repeats,
        Complete=study.complete, Method=", ".join(study.methods), Machine=machine_name(), Versions=versions(),
    )
    table = place / "cost.csv"
    picture = save(draw(study), place / "cost.png", facts)
    write_csv(table, COLUMNS, (
        (p.method, p.dt, p.steps, p.evaluations, p.angle_error, p.end_error, p.energy_error, p.time, p.time_median,
         p.ns_per_second, p.stop_reason or ("floor" if p.floor else "ok"), int(p in front))
        for p in study.points
    ), facts)
    return picture, table


def machine_name() -> str:
    """The processor, as the system names it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        named = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        named = platform.processor()
    return f"{named or 'unknown processor'}, {platform.machine()}, {platform.system()}"


def versions() -> str:
    """Versions of the packages that decide speed and rounding."""
    from importlib.metadata import PackageNotFoundError, version

    found = []
    for name in ("numpy", "numba", "scipy"):
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"no {name}")
    return ", ".join(found)
