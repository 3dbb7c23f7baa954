"""Study of error growth: errors of integrators over very many periods, at equal numbers of force evaluations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.common.progress import Progress, part_of, told_by, with_bar
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Columns, Result, columns_of, one_line
from pendulum_env.common.texts import Table
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, TWO_PI, UNSEEN, VELOCITY, Machine, fitting
from pendulum_env.engine.runs import RecordSchedule, recorded
from pendulum_env.engine.shape import STOP_REASONS
from pendulum_env.engine.spec import RunSpec, scene_and_shared
from pendulum_env.engine.starts import checked_methods, checked_start, checked_steps, usual_start
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, function, naming_keywords, number
from pendulum_env.study.cost.points import FLOOR
from pendulum_env.study.cost.runs import SAMPLES, energy_scale, evaluations_per_step
from pendulum_env.study.growth_laws import Law, law_of
from pendulum_env.truth.long_runs import LongTruth, long_truth, on, refuse_gusts
from pendulum_env.truth.reference import StudyError

__all__ = ["Growth", "GrowthLine", "growth"]

Array = NDArray[np.float64]

PERIODS = 1e5
"""Default length of a study of error growth [periods]."""
EVALUATIONS = 256.0
"""Default number of force evaluations per period."""
CLOSE = 0.9
"""Times later than this fraction of the study's end are replaced by the end itself."""
PER_DECADE = 10
"""Number of times per decade, from one period on, at which errors are recorded."""
KNOWN = 0.01
"""Largest error of the reference solution, as a fraction of the motion's size, at which the motion counts as known."""
TRUTH = 0.05
"""Fraction of the progress bar that computing the reference solution takes."""
ROWS = 24
"""Number of states around each recorded time, of which the largest error counts."""
TINY = 1e-100
"""Numbers of a state below this size are set to 0, because subnormal numbers, as of dying motions, are slow."""
ROUNDS = 3
"""Number of times the step of an implicit method is corrected by the force evaluations counted at the step before."""
AT = (10.0, 1e3, 1e5)
"""Times [periods] of the errors in the table."""
COLUMNS = {
    "method": "", "dt_s": "s", "force_evaluations_per_period": "", "time_periods": "periods", "angle_error_rad": "rad",
    "angle_floor_rad": "rad", "energy_error": "", "angle_error_grows": "", "energy_error_grows": "", "status": "",
}
"""Columns of ``growth.csv`` with their units."""


@dataclass(frozen=True)
class GrowthLine:
    """Errors of one method in a study of error growth, and the laws by which they grow.

    Attributes:
        method: name of the method; ``label``: its name with its treatment of drag.
        dt: step [s].
        evaluations: force evaluations per period; for implicit methods counted in their Newton iterations.
        angle_error: largest angle error in the period before each of the study's times [rad]; nan after a run ended,
            and where the true motion is not known.
        energy_error: largest |energy residual| in the period before each of the study's times, in units of
            :func:`pendulum_env.study.cost.runs.energy_scale`; nan after a run ended.
        floor: angle errors up to this are not reliable [rad]: ten times the error of the reference solution.
        angle, energy: laws by which the two errors grow, see :func:`pendulum_env.study.growth_laws.law_of`.
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


@dataclass(frozen=True, repr=False)
class Growth(Result):
    """Result of a study of error growth.

    Attributes:
        scene, angle, velocity: the scene and the start of the motion [rad, rad/s].
        period: period of small swings, 2 pi / omega0 [s].
        time: times at which errors were recorded [periods].
        lines: results of the methods, one :class:`GrowthLine` each.
        how: source of the reference solution, in words.
        horizon: time until which the true motion is known [periods]; inf if it is known to the end.
        size: largest angle of the motion, at most pi [rad].
        died: time at which the motion had died out, where the study ends [periods]; inf if it had not.
        complete: False if the study was interrupted, so that results are missing.
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

    def __repr__(self) -> str:
        names = ", ".join(line.method for line in self.lines)
        return one_line(self, f"{self.scene.name}, {self.time[-1]:g} periods: {names}")

    def origin(self) -> Mapping[str, str]:
        """Return scene, start, length, reference solution and methods, with what computed them."""
        return provenance(
            Scene=self.scene.to_dict(), Angle=self.angle, Velocity=self.velocity, Periods=float(self.time[-1]),
            Period=self.period, Truth=self.how, Complete=self.complete,
            EnergyError=f"|energy residual| over {energy_scale(self.scene, (1.0,))[1]}",
            Method=", ".join(line.method for line in self.lines),
        )

    def tables(self) -> Mapping[str, Columns]:
        """Return the errors of every method at every time."""
        return {"growth": columns_of(COLUMNS, (
            (line.method, line.dt, line.evaluations, time, angle, floor, energy, line.angle.kind, line.energy.kind,
             line.stop_reason if math.isnan(energy) else "floor" if angle <= floor else "ok")
            for line in self.lines
            for time, angle, floor, energy in zip(
                self.time, line.angle_error, line.floor, line.energy_error, strict=True)))}

    def grid(self) -> Sequence[str]:
        """Return the columns that number the rows."""
        return ("method", "time_periods")

    @property
    def table(self) -> Table:
        """Table of how the errors of each method grow, and of the errors after 10, 1000 and 1e5 periods."""
        places = [int(np.argmin(np.abs(np.log(self.time / at)))) for at in AT if at <= 1.01 * self.time[-1]]
        head = ["method", "angle error grows", "energy error grows"]
        head += [f"{name} at {self.time[i]:.3g}" for name in ("angle [rad]", "energy") for i in places]
        return Table(tuple(head), tuple(
            (line.label, line.angle.text(), line.energy.text(),
             *(_cell(line.angle_error[i], line.floor[i]) for i in places),
             *(_cell(line.energy_error[i], 0.0) for i in places))
            for line in self.lines))

    @property
    def text(self) -> str:
        """Sentences on the reference solution, the period, and the time until which the true motion is known."""
        sentences = [f"Reference solution: {self.how}. Times are in periods of small swings, {self.period:.4g} s; "
                     "'lost' means that the error is half as large as the motion."]
        if math.isfinite(self.died):
            sentences.append(f"The motion has died out at {self.died:.3g} periods, where the study ends.")
        if math.isfinite(self.horizon):
            sentences.append(f"After {self.horizon:.3g} periods the true angle is not known, because the reference "
                             "solutions differ by over a hundredth of the motion's size; errors of the angle end "
                             "there.")
        if not self.complete:
            sentences.append("The study was interrupted; the results measured until then are shown.")
        return " ".join(sentences)


@with_bar("growth")
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
    progress: Progress | bool | None = None,
    on_line: Callable[[GrowthLine], None] | None = None,
    backend: Backend = "auto",
    **parameters: Any,
) -> Growth:
    """Run integrators over very many periods and return how their errors grow.

    All methods take the same number of force evaluations per period, so that their steps differ, or all the same step.
    Errors are recorded ten times per decade of time, from one period on: the largest error in the period before, so
    that records are the envelope of an oscillating error. A period is that of small swings, ``2 pi/omega0``.

    Theory (Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, I.1, IX.8, X.3, XI.3): with
    symplectic or symmetric methods the energy error stays bounded and the angle error grows linearly; with others the
    energy error grows linearly and the angle error quadratically, where the period depends on the amplitude.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrators: names or methods, none twice; by default all that fit the scene.
        angle, velocity: start [rad, rad/s]; by default the scene's usual start.
        periods: length of the study [periods].
        evaluations_per_period: force evaluations per period, 256 by default; one Taylor series counts as one.
        step: step of all methods [s], in place of ``evaluations_per_period``.
        damping: see :func:`pendulum_env.physics.damping.with_damping`.
        compensated: True for compensated summation, see :mod:`integrators.steps.compensated`.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.
        on_line: called with each method's :class:`GrowthLine` as soon as it is measured.
        backend: "auto", "compiled" or "python".
        **parameters: single parameters of the scene, such as ``length=0.5``.

    KeyboardInterrupt ends the study early: the result then has the errors measured so far, and ``complete`` is False.

    Raises SceneError or MethodError for an invalid argument, StudyError for a scene with gusts, without a restoring
    torque, or where nothing moves.
    """
    with naming_keywords(growth):
        place, shared = scene_and_shared(scene, damping, parameters)
    if on_line is not None:
        function(on_line, "on_line")
    tell = told_by(progress)
    q, v, period, time, runs = planned(
        place, integrators, angle=angle, velocity=velocity, periods=periods, step=step, backend=backend,
        evaluations_per_period=evaluations_per_period, compensated=compensated, **shared)
    for run in runs:
        run.spec.tell()
    reach = max(run.reach for run in runs)
    truth = long_truth(place, q, v, time * period, reach, backend, part_of(tell, 0.0, TRUTH))
    study = Growth(place, q, v, period, time[: truth.died], (), truth.how, *_known(truth, time * period, period),
                   died=float(time[truth.died - 1]) if truth.died < len(time) else math.inf)
    total, done = sum(run.work for run in runs) * study.time[-1], 0.0
    for run in runs:

        def report(now: float, run: LongRun = run, done: float = done) -> None:
            part = (done + run.work * now / period) / total
            tell(TRUTH + (1.0 - TRUTH) * min(part, 0.999), run.machine.label)

        try:
            run.follow(study.time * period, truth, report)
        except KeyboardInterrupt:
            study = replace(study, complete=False)
        if study.complete or run.errors:
            study = replace(study, lines=(*study.lines, _line(study, run)))
            if on_line is not None:
                on_line(study.lines[-1])
        if not study.complete:
            return study
        done += run.work * study.time[-1]
    tell(1.0, "done")
    return study


class GrowthPlan(NamedTuple):
    """A checked study of error growth: start [rad, rad/s], period [s], times [periods], and the run of every method."""

    angle: float
    velocity: float
    period: float
    time: Array
    runs: list[LongRun]


def planned(
    place: Scene, integrators: Iterable[str | Method] | None = None, *, angle: float | None = None,
    velocity: float | None = None, periods: float = PERIODS, step: float | None = None,
    evaluations_per_period: float | None = None, **shared: Any,
) -> GrowthPlan:
    """Check the arguments of :func:`growth`, and return the study's plan; nothing is computed yet.

    The start is ``angle`` [rad] and ``velocity`` [rad/s]; ``shared`` are the settings that every run has. Raises the
    errors of :func:`growth`.
    """
    q, v = usual_start(place, angle, velocity)
    checked_start(place, q, v)
    if not place.omega0:
        raise StudyError(f"The scene '{place.name}' has no restoring torque and so no period; choose one with gravity.")
    if not place.inertia * (v * v + (place.omega0 * q) ** 2) and (q or v):
        raise StudyError(
            f"The energy of a start at {q:g} rad and {v:g} rad/s is too small for a float; "
            "use a larger angle or velocity."
        )
    refuse_gusts(place)
    period = TWO_PI / place.omega0
    end = number(periods, "periods", least=1.0)
    times = 10.0 ** (np.arange(math.floor(PER_DECADE * math.log10(end) + 1e-9) + 1) / PER_DECADE)
    time = np.append(times[times < CLOSE * end], end)
    if step is not None and evaluations_per_period is not None:
        raise SceneError("step and evaluations_per_period both determine the step; give only one of them.")
    fixed = None if step is None else number(step, "step", above=0.0, unit="s")
    budget = number(EVALUATIONS if evaluations_per_period is None else evaluations_per_period,
                    "evaluations_per_period", above=0.0)
    methods = checked_methods(fitting(place) if integrators is None else integrators, place)
    runs = []
    for spec in [RunSpec.of(place, method, angle=q, velocity=v, **shared) for method in methods]:
        machine = spec.machine()
        h = fixed or step_for(machine, q, v, period, budget)
        if h > period:
            raise SceneError(
                f"The step of {machine.method.name}, {h:.3g} s, is longer than a period, {period:.3g} s; "
                "give a shorter step or more evaluations_per_period."
            )
        checked_steps(end * period, h)
        runs.append(LongRun(replace(spec, h=h), machine, q, v, h, period))
    return GrowthPlan(q, v, period, time, runs)


def _known(truth: LongTruth, marks: Array, period: float) -> tuple[float, float]:
    """Return the time until which the reference solution is accurate [periods], and the largest angle until then [rad].

    It counts as accurate while its estimated error is below a hundredth of the largest angle.
    """
    size, horizon = 0.0, 0.0
    for mark in marks[: truth.died]:
        true = truth.at(np.linspace(mark - period, mark, ROWS))
        if not (true.velocity.any() or size):
            raise StudyError("From this start the pendulum stays at rest; give a larger angle or a velocity.")
        size = max(size, min(math.pi, float(np.max(np.abs(true.angle)))))
        if true.error_estimate > KNOWN * size:
            return horizon, size
        horizon = float(mark / period)
    return math.inf, size


def _line(study: Growth, run: LongRun) -> GrowthLine:
    """Return the :class:`GrowthLine` of one finished run: its errors, and the laws by which they grow."""
    time, rows = study.time, np.full((len(study.time), 3), math.nan)
    rows[:len(run.errors)] = np.reshape(run.errors, (-1, 3))
    angle, own, energy = rows.T.copy()
    angle[time > study.horizon] = math.nan
    steps, phase = time * study.period / run.h, TWO_PI * time
    stopped = run.stopped / study.period
    evaluations = cost_of_step(run.machine, run.angle, run.velocity, run.period, run.h)
    return GrowthLine(
        method=run.machine.method.name, label=run.machine.label, dt=run.h,
        evaluations=evaluations * study.period / run.h,
        angle_error=angle, energy_error=energy, floor=FLOOR * own,
        angle=law_of(time, angle, floor=FLOOR * own, steps=steps, phase=phase, size=study.size, stopped=stopped),
        energy=law_of(time, energy, floor=0.0, steps=steps, phase=None, size=1.0, stopped=stopped),
        stop_reason=run.stop_reason,
    )


# --- one long run --------------------------------------------------------------------------------------------


@dataclass
class LongRun:
    """Run of one method over very many periods, with the largest errors around selected times.

    Its fields are the settings, the machine (compiled program of scene and method), the start [rad, rad/s], the step
    ``h`` [s] and the ``period`` of small swings [s].

    Attributes:
        errors: the largest errors in the period before each selected time: of the angle [rad], of the reference
            solution itself [rad], and |energy residual| over the energy at the start (over the largest energy, where
            that is 0).
        stop_reason, stopped: why and when the run ended early [s].
    """

    spec: RunSpec
    machine: Machine
    angle: float
    velocity: float
    h: float
    period: float
    errors: list[tuple[float, float, float]] = field(default_factory=list)
    stop_reason: str = ""
    stopped: float = math.inf

    @property
    def reach(self) -> float:
        """Length [s] of the interval before each recorded time in which errors are measured.

        It is one period, or 24 steps if these are longer; the largest error in it is recorded.
        """
        return max(self.period, ROWS * self.h)

    @property
    def work(self) -> float:
        """Estimated computing work per simulated second, in force evaluations."""
        return self.machine.method.evaluations * (10.0 if self.machine.method.implicit else 1.0) / self.h

    def follow(self, marks: Array, truth: LongTruth, report: Callable[[float], None]) -> None:
        """Run to the last of the times ``marks`` [s], and record the largest errors before each of them.

        The errors are appended to the list ``errors``. ``report`` is called now and then with the simulated time
        reached [s].
        """
        machine, h = self.machine, self.h
        stride = max(1, math.floor(self.period / h / ROWS))  # about 24 states per period
        state = machine.state(self.angle, self.velocity)
        machine.advance(state, 0.0, h, 0)
        initial = most = float(machine.ledger(state, 0.0).energy)
        near = np.empty((0, 4))
        for mark in marks:
            end, now = round(mark / h), round(state[INDEX])
            rows = min(max(0, end - now), math.ceil(self.reach / h)) // stride
            code = on(machine, state, h, end - now - rows * stride, lambda steps: report(steps * h))
            out = np.empty((rows + 1, machine.width))
            if not code:
                code = machine.run(state, machine.parameters, 0.0, h, rows, stride, math.inf, out, UNSEEN)
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
            error, own, residual = near[:, 1:].max(axis=0, initial=0.0).tolist()
            self.errors.append((error, own, residual / energy_scale(machine.scene, (initial, most))[0]))
            for i, value in enumerate(state):
                state[i] = value if abs(value) > TINY else 0.0
            report(float(state[INDEX]) * h)


def cost_of_step(machine: Machine, angle: float, velocity: float, period: float, h: float) -> float:
    """Return the force evaluations per step of ``h`` [s]; for implicit methods the mean over two periods."""
    if not machine.method.implicit:
        return float(machine.method.evaluations)
    every = max(1, round(2.0 * period / h / SAMPLES))
    states, _ = recorded(machine, machine.state(angle, velocity), RecordSchedule(h, (SAMPLES - 1) * every, every))
    evaluations = evaluations_per_step(machine, states[:, ANGLE] + TWO_PI * states[:, TURNS], states[:, VELOCITY], h)
    return evaluations if math.isfinite(evaluations) else float(machine.method.evaluations)


def step_for(machine: Machine, angle: float, velocity: float, period: float, evaluations: float) -> float:
    """Return the step [s] with which a method takes ``evaluations`` force evaluations per period."""
    per_step = float(machine.method.evaluations)
    for _ in range(ROUNDS if machine.method.implicit else 0):
        per_step = cost_of_step(machine, angle, velocity, period, period * per_step / evaluations)
    return period * per_step / evaluations


def _cell(value: float, floor: float) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:.1e}" if value > floor else f"<{floor:.0e}"
