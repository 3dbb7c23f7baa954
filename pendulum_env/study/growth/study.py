"""How errors grow over very many periods: each method's angle and energy at log-spaced times, at one cost for all."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.tables import Table
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine, fitting, simulate
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.engine.spec import RunSpec, scene_and_shared
from pendulum_env.engine.starts import checked_methods, checked_start, checked_steps
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, function, naming_keywords, number
from pendulum_env.study.cost.points import FLOOR
from pendulum_env.study.cost.runs import SAMPLES, energy_scale, evaluations_per_step
from pendulum_env.study.growth.laws import Law, law_of
from pendulum_env.truth.long_runs import LongTruth, long_truth, on
from pendulum_env.truth.reference import StudyError

Array = NDArray[np.float64]

PERIODS = 1e5
EVALUATIONS = 256.0
"""Force evaluations in a period, by default."""
CLOSE = 0.9
"""Times closer to the end than this are left out for it."""
PER_DECADE = 10
"""Times in a decade at which errors are looked at, from one period on."""
KNOWN = 0.01
"""A motion is known until the truth's own error is this part of its size."""
TRUTH = 0.05
"""Part of the work that is the truth's, for progress."""
ROWS = 24
"""States that are looked at around each time."""
TINY = 1e-100
"""Numbers of a state below this are taken for 0: a motion that dies out would end in numbers that processors are slow
with."""
ROUNDS = 3
"""So often the step of an implicit method is chosen anew, by the evaluations counted at the one before."""
AT = (10.0, 1e3, 1e5)
"""Times whose errors stand in the table [periods]."""


@dataclass(frozen=True)
class GrowthLine:
    """One method.

    Attributes:
        method: its name; ``label``: with how it treats drag.
        dt: step [s].
        evaluations: force evaluations in a period; for implicit methods counted in their Newton sweeps.
        angle_error: the largest angle error around each of the study's times [rad]; nan after a run ended, and where
            the motion is not known.
        energy_error: the same of |energy residual|, in units of :func:`pendulum_env.study.cost.runs.energy_scale`.
        floor: errors of the angle up to this are not known [rad]: FLOOR times the truth's own.
        angle, energy: the laws by which they grow, see :func:`pendulum_env.study.growth.laws.law_of`.
        stop_reason: why the run ended early, else "".
    """

    method: str
    label: str
    dt: float
    evaluations: float
    angle_error: Array
    energy_error: Array
    floor: Array
    angle: Law
    energy: Law
    stop_reason: str = ""


@dataclass(frozen=True)
class Growth:
    """What was measured.

    Attributes:
        scene, angle, velocity: the motion [rad, rad/s].
        period: 2 pi / omega0 [s].
        time: when errors were looked at [periods].
        lines: one for each method.
        how: where the truth comes from.
        horizon: until when the motion is known [periods]; inf if all the way.
        size: of the motion, the largest angle or pi if that is less [rad].
        died: when it had died out [periods]; inf if it had not. Times end there.
        complete: False if it was interrupted; what had been measured is there.
    """

    scene: Scene
    angle: float
    velocity: float
    period: float
    time: Array
    lines: tuple[GrowthLine, ...]
    how: str
    horizon: float
    size: float
    died: float = math.inf
    complete: bool = True


def growth(
    scene: str | Scene | dict[str, Any] = "lab",
    integrators: Iterable[str | Method] | None = None,
    *,
    angle: float | None = None,
    velocity: float | None = None,
    periods: float = PERIODS,
    evaluations_per_period: float | None = None,
    step: float | None = None,
    damping: Damping = "scene",
    compensated: bool = False,
    progress: Progress | None = None,
    on_line: Callable[[GrowthLine], None] | None = None,
    backend: Backend = "auto",
    **parameters: Any,
) -> Growth:
    """Follow methods over very many periods, and say how their errors grow.

    All take as many force evaluations in a period, so that their steps differ, or all the same step. Errors are looked
    at ten times in a decade, from one period on: each the largest in the period before, so that it is the envelope of
    an error that swings. Only these records are kept. A period is that of small swings, ``2 pi/omega0``.

    Known from theory (Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, I.1, IX.8, X.3, XI.3): with
    symplectic or symmetric methods the energy's error stays bounded and the angle's grows linearly; with others the
    energy's grows linearly and the angle's quadratically, where the period depends on the amplitude.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrators: names or methods, none twice; by default all that fit.
        angle, velocity: start [rad, rad/s]; by default the scene's usual one.
        periods: how far.
        evaluations_per_period: force evaluations of each method in a period, 256 by default; a series' counts once.
        step: the step of all methods [s], in place of that.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`.
        compensated: True for compensated sums, see :mod:`integrators.steps.compensated`.
        progress: called with the fraction done and what is being done.
        on_line: called with each line when it is there.
        backend: "auto", "compiled" or "python".
        **parameters: single parameters of the scene, such as ``length=0.5``.

    KeyboardInterrupt ends it early: the study then has what was measured, and ``complete`` is False.

    Raises SceneError or MethodError for anything that cannot be, StudyError for a scene with gusts, without a restoring
    torque, or where nothing moves.
    """
    with naming_keywords(growth):
        place, shared = scene_and_shared(scene, damping, parameters)
    q = number(place.run.angle if angle is None else angle, "angle", unit="rad")
    v = number(place.run.velocity if velocity is None else velocity, "velocity", unit="rad/s")
    checked_start(place, q, v)
    if not place.omega0:
        raise StudyError(f"Nothing pulls the bob of '{place.name}' back, so it has no periods to count.")
    if not place.inertia * (v * v + (place.omega0 * q) ** 2) and (q or v):
        raise StudyError(f"A start from {q:g} rad and {v:g} rad/s has an energy that floats cannot hold; take more.")
    period, tell = TWO_PI / place.omega0, told_by(progress)
    time = _times(number(periods, "periods", least=1.0))
    step_of = _steps(step, evaluations_per_period)
    if on_line is not None:
        function(on_line, "on_line")
    methods = checked_methods(fitting(place) if integrators is None else integrators, place)
    specs = [RunSpec.of(place, method, angle=q, velocity=v, backend=backend, compensated=compensated, **shared)
             for method in methods]
    machines = [spec.machine() for spec in specs]
    runs = [LongRun(machine, q, v, step_of(machine, q, v, period), period) for machine in machines]
    for run in runs:
        if run.h > period:
            raise SceneError(
                f"A step of {run.h:.3g} s, of {run.machine.method.name}, is longer than a period, {period:.3g} s; take "
                "a shorter one, or more evaluations in a period."
            )
        checked_steps(float(time[-1]) * period, run.h)
    for spec, run in zip(specs, runs, strict=True):
        replace(spec, h=run.h).tell()
    reach = max(run.reach for run in runs)
    truth = long_truth(place, q, v, time * period, reach, backend, lambda done, what: tell(TRUTH * done, what))
    found = Growth(place, q, v, period, time[: truth.died], (), truth.how, *_known(truth, time * period, period),
                   died=float(time[truth.died - 1]) if truth.died < len(time) else math.inf)
    whole, done = sum(run.work for run in runs) * found.time[-1], 0.0
    for run in runs:

        def told(now: float, run: LongRun = run, done: float = done) -> None:
            part = (done + run.work * now / period) / whole
            tell(TRUTH + (1.0 - TRUTH) * min(part, 0.999), run.machine.label)

        try:
            run.follow(found.time * period, truth, told)
        except KeyboardInterrupt:
            found = replace(found, complete=False)
        if found.complete or run.angle_error:
            found = replace(found, lines=(*found.lines, _line(found, run)))
            if on_line is not None:
                on_line(found.lines[-1])
        if not found.complete:
            return found
        done += run.work * found.time[-1]
    tell(1.0, "done")
    return found


def _times(periods: float) -> Array:
    """When errors are looked at [periods]: PER_DECADE in a decade from one on, and the end."""
    whole = 10.0 ** (np.arange(math.floor(PER_DECADE * math.log10(periods) + 1e-9) + 1) / PER_DECADE)
    return np.append(whole[whole < CLOSE * periods], periods)


def _steps(step: float | None, evaluations: float | None) -> Callable[[Machine, float, float, float], float]:
    """What chooses a machine's step, from its start and the period."""
    if step is not None and evaluations is not None:
        raise SceneError("step and evaluations_per_period are two ways to choose the step; give one.")
    if step is not None:
        same = number(step, "step", above=0.0, unit="s")
        return lambda machine, angle, velocity, period: same
    budget = number(EVALUATIONS if evaluations is None else evaluations, "evaluations_per_period", above=0.0)
    return lambda machine, angle, velocity, period: step_for(machine, angle, velocity, period, budget)


def _known(truth: LongTruth, marks: Array, period: float) -> tuple[float, float]:
    """Until when the motion is known [periods], and its size until then [rad]."""
    size, horizon = 0.0, 0.0
    for mark in marks[: truth.died]:
        true = truth.at(np.linspace(mark - period, mark, ROWS))
        if not (true.velocity.any() or size):
            raise StudyError("Nothing moves from rest at the bottom; give an angle or a velocity.")
        size = max(size, min(math.pi, float(np.max(np.abs(true.angle)))))
        if true.error_estimate > KNOWN * size:
            return horizon, size
        horizon = float(mark / period)
    return math.inf, size


def _line(study: Growth, run: LongRun) -> GrowthLine:
    """What a run found, and the laws that it follows."""
    time, missing = study.time, [math.nan] * (len(study.time) - len(run.angle_error))
    angle, own, energy = (np.array([*values, *missing]) for values in (run.angle_error, run.own, run.energy_error))
    angle[time > study.horizon] = math.nan
    steps, phase = time * study.period / run.h, TWO_PI * time
    stopped = run.stopped / study.period
    each = cost_of_step(run.machine, run.angle, run.velocity, run.period, run.h)
    return GrowthLine(
        method=run.machine.method.name, label=run.machine.label, dt=run.h, evaluations=each * study.period / run.h,
        angle_error=angle, energy_error=energy, floor=FLOOR * own,
        angle=law_of(time, angle, floor=FLOOR * own, steps=steps, phase=phase, size=study.size, stopped=stopped),
        energy=law_of(time, energy, floor=0.0, steps=steps, phase=None, size=1.0, stopped=stopped),
        stop_reason=run.stop_reason,
    )


# --- one method, followed --------------------------------------------------------------------------------------------


@dataclass
class LongRun:
    """A machine, its start [rad, rad/s] and its step ``h`` [s]; ``period`` of small swings [s].

    Attributes:
        angle_error, own, energy_error: what was found around each mark: the largest angle error [rad], the truth's own
            [rad], and |energy residual| over the energy at the start, or over the largest where that is 0.
        stop_reason, stopped: why and when it ended early [s].
    """

    machine: Machine
    angle: float
    velocity: float
    h: float
    period: float
    angle_error: list[float] = field(default_factory=list)
    own: list[float] = field(default_factory=list)
    energy_error: list[float] = field(default_factory=list)
    stop_reason: str = ""
    stopped: float = math.inf

    @property
    def stride(self) -> int:
        """Steps between states that are looked at."""
        return max(1, math.floor(self.period / self.h / ROWS))

    @property
    def reach(self) -> float:
        """How long before a mark they begin: a period, or ROWS steps [s]."""
        return max(self.period, ROWS * self.h)

    @property
    def work(self) -> float:
        """About how long a simulated second takes, in force evaluations."""
        return self.machine.method.evaluations * (10.0 if self.machine.method.implicit else 1.0) / self.h

    def follow(self, marks: Array, truth: LongTruth, told: Callable[[float], None]) -> None:
        """Run to the last of the marks [s], told now and then of the time reached [s]; fills the lists as it goes."""
        machine, h = self.machine, self.h
        state = machine.state(self.angle, self.velocity)
        machine.advance(state, 0.0, h, 0)
        initial = most = float(machine.ledger(state, 0.0).energy)
        near = np.empty((0, 4))
        for mark in marks:
            end, now = round(mark / h), round(state[INDEX])
            rows = min(max(0, end - now), math.ceil(self.reach / h)) // self.stride
            code = on(machine, state, h, end - now - rows * self.stride, lambda steps: told(steps * h))
            out = np.empty((rows + 1, machine.width))
            if not code:
                code = machine.run(state, machine.parameters, 0.0, h, rows, self.stride, math.inf, out, UNSEEN)
            if code:
                self.stop_reason, self.stopped = STOP_REASONS[code], float(state[INDEX]) * h
                return
            near = near[near[:, 0] > end - math.ceil(self.reach / h)]
            if rows:
                true = truth.at(out[1:, INDEX] * h)
                ledger = machine.ledger(out[1:], initial)
                error = np.abs(out[1:, ANGLE] + TWO_PI * out[1:, TURNS] - true.angle)
                rows_near = np.stack([out[1:, INDEX], error, true.error, np.abs(ledger.residual)], axis=-1)
                near = np.concatenate([near, rows_near])
                most = max(most, float(np.max(ledger.energy)))
            largest = near[:, 1:].max(axis=0, initial=0.0)
            self.angle_error.append(float(largest[0]))
            self.own.append(float(largest[1]))
            self.energy_error.append(float(largest[2]) / energy_scale(machine.scene, (initial, most))[0])
            for i, value in enumerate(state):
                state[i] = value if abs(value) > TINY else 0.0
            told(float(state[INDEX]) * h)


def cost_of_step(machine: Machine, angle: float, velocity: float, period: float, h: float) -> float:
    """Force evaluations in a step of ``h`` [s], counted in two periods if implicit."""
    if not machine.method.implicit:
        return float(machine.method.evaluations)
    every = max(1, round(2.0 * period / h / SAMPLES))
    states, _ = simulate(machine, angle, velocity, h=h, rows=SAMPLES, every=every)
    found = evaluations_per_step(machine, states[:, ANGLE] + TWO_PI * states[:, TURNS], states[:, VELOCITY], h)
    return found if math.isfinite(found) else float(machine.method.evaluations)


def step_for(machine: Machine, angle: float, velocity: float, period: float, evaluations: float) -> float:
    """The step [s] with which a method takes so many force evaluations in a period."""
    each = float(machine.method.evaluations)
    for _ in range(ROUNDS if machine.method.implicit else 0):
        each = cost_of_step(machine, angle, velocity, period, period * each / evaluations)
    return period * each / evaluations


# --- the result as text ----------------------------------------------------------------------------------------------


def table(study: Growth) -> Table:
    """Each method: how its errors grow, and what they are after 10, 1000 and 100 000 periods."""
    places = [int(np.argmin(np.abs(np.log(study.time / at)))) for at in AT if at <= 1.01 * study.time[-1]]
    head = ["method", "angle error grows", "energy error grows"]
    head += [f"{what} at {study.time[i]:.3g}" for what in ("angle [rad]", "energy") for i in places]
    rows = tuple(
        (line.label, line.angle.text(), line.energy.text(),
         *(_cell(values[i], floor[i]) for values, floor in (
             (line.angle_error, line.floor), (line.energy_error, np.zeros_like(study.time))) for i in places))
        for line in study.lines
    )
    return Table(tuple(head), rows)


def _cell(value: float, floor: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.1e}" if value > floor else f"<{floor:.0e}"


def remarks(study: Growth) -> str:
    """What the truth is and how far it goes, what a period is, and what was the same for all."""
    said = [f"Truth: {study.how}. Times are in periods of small swings, {study.period:.4g} s; lost: the error is half "
            "as large as the motion."]
    if math.isfinite(study.died):
        said.append(f"The motion has died out at {study.died:.3g} periods, and the study ends there.")
    if math.isfinite(study.horizon):
        said.append(f"Beyond {study.horizon:.3g} periods the angle is not known: there the solutions that serve as "
                    "truth part, as neighbouring motions do.")
    if not study.complete:
        said.append("Interrupted: what was measured until then follows.")
    return " ".join(said)
