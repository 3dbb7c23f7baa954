"""Work-precision study: error and computing time of integrators at many step sizes and tolerances on one scene."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import integrators as known
from integrators import Method
from integrators.solving.adaptive import FINEST
from integrators.steps.estimates import evaluations_tried, has_estimates, order_of_estimate
from pendulum_env.common.progress import Progress, with_bar
from pendulum_env.engine.kernels import Backend, resolve
from pendulum_env.engine.machine import checked_tolerance, fitting
from pendulum_env.engine.spec import RunSpec, scene_and_shared
from pendulum_env.engine.starts import checked_methods, checked_start, checked_steps, usual_start
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import boolean, function, naming_keywords, number, several, whole_number
from pendulum_env.study.cost.points import FLOOR, CostPoint, CostStudy
from pendulum_env.study.cost.runs import SPARSE, Setting, measure, setting_of
from pendulum_env.study.sweep.journal import OtherSweepError
from pendulum_env.study.sweep.study import sweep
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import StudyError

JOURNAL = "cost.jsonl"
"""Name of the journal in a folder, to which each measurement is written, and from which a study continues."""
RECORDS = 16
"""Records per small-angle period at which errors are measured (at least), and steps per period of the longest step."""
DOUBLINGS = 13
"""Number of step sizes in the default list: period/16, period/32, ... period/65536."""
MOST_STEPS = {"compiled": 2**20, "python": 2**13}
"""Largest number of steps of a run; the default list leaves out step sizes that need more. For each backend."""
MOST_WORK = {"compiled": 2**24, "python": 2**19}
"""Largest number of force evaluations of a run; the default list leaves out others. For each backend."""
LONG = 2**20
"""Force evaluations from which on a run, of 10 ms or more, is timed half as often: disturbances average out in it."""
SWEEPS = 10.0
"""Estimated cost of an implicit method's force evaluation with its Newton solver; 1 for explicit methods."""
COMPILING = {"compiled": 1e8, "python": 0.0}
"""Compilation cost, in force evaluations, for each backend."""
LOOSEST = 1e-2
"""Tolerance at which an adaptive run takes about one step per SPARSE records."""
MOST_RECORDS = 2**20
"""Largest number of records at which errors are measured."""
MOST_REPEATS = 10**6
"""Largest number of timings of each run."""
TOLERANCES = (*(10.0**-k for k in range(2, 15)), FINEST)
"""Default tolerances of adaptive runs, down to the smallest that double precision allows."""


@with_bar("cost")
def cost(
    scene: str | Scene | dict[str, Any] = "lab",
    integrators: Iterable[str | Method] | None = None,
    *,
    angle: float | None = None,
    velocity: float | None = None,
    duration: float | None = None,
    damping: Damping = "scene",
    steps: Sequence[float] | None = None,
    tolerances: Sequence[float] | None = None,
    repeats: int = 5,
    executor: Executor | None = None,
    file: str | Path | None = None,
    resume: bool = True,
    progress: Progress | bool | None = None,
    on_point: Callable[[CostPoint], None] | None = None,
    backend: Backend = "auto",
    **parameters: Any,
) -> CostStudy:
    """Measure error, computing time and force evaluations of integrators on a scene, at many steps and tolerances.

    Each method runs with a list of steps, from long to short. Methods that estimate their error also run with a list
    of tolerances, under the name "NAME, adaptive", unless the scene has dry friction. Errors are the largest over
    common records (times of comparison with the reference solution), about 16 per small-angle period. An adaptive run
    has to end a step at each record, so only every seventh record, 0.44 periods apart, is used for it. Times include
    the energy ledger and exclude compilation. They are those of single runs; in a batch of
    :func:`pendulum_env.rollout`, runs share SIMD instructions, at fixed steps and, each with steps of its own, at
    tolerances. All runs are timed once before any is timed again, so that a disturbance
    of the computer affects all of them alike.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrators: names or methods, none twice; by default all that fit the scene.
        angle, velocity, duration: start and length of the run [rad, rad/s, s]; by default the scene's usual run.
        damping: see :func:`pendulum_env.physics.damping.with_damping`.
        steps: steps [s], each rounded down to divide the time between records; by default about period/16, /32, ...
            /65536, without runs of more than a million steps or some ten million force evaluations, which
            ``left_out`` lists.
        tolerances: rtol = atol of adaptive runs; by default 1e-2, 1e-3, ... and the smallest that double precision
            allows, or none where ``steps`` are given; () for none.
        repeats: number of timings of each run; long runs, of a million force evaluations or more, are timed half as
            often (rounded down, but at least once).
        executor: executor of the runs, see :func:`pendulum_env.study.sweep.study.sweep`. Times are reliable only if
            each worker has a processor core to itself.
        file: journal to which each measurement is written at once, and from which an interrupted study continues.
        resume: False empties the journal first.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.
        on_point: called with the :class:`CostPoint` of each run when its errors and first time are known.
        backend: "auto", "compiled" or "python".
        **parameters: single parameters of the scene, such as ``length=0.5``.

    KeyboardInterrupt ends the study early: the result then has the points measured so far, and ``complete`` is False.

    Raises SceneError or MethodError for an invalid argument; StudyError for a start where nothing moves, a journal of
    another study, or an executor that breaks down.
    """
    with naming_keywords(cost):
        place, own = scene_and_shared(scene, damping, parameters)
    q, v = usual_start(place, angle, velocity)
    checked_start(place, q, v)
    length = number(place.run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    anew, repeats = not boolean(resume, "resume"), whole_number(repeats, "repeats", MOST_REPEATS)
    if on_point is not None:
        function(on_point, "on_point")
    methods = checked_methods(fitting(place) if integrators is None else integrators, place)
    rtols = _tolerances(place, methods, steps, tolerances)
    records, wanted = _records(place, length, steps, bool(rtols))
    setting = Setting(place, q, v, length, records, resolve(backend))
    shared = setting.shared()
    motion = setting_of(json.dumps(shared, sort_keys=True)).truth
    if not motion.velocity.any():
        raise StudyError("From this start the pendulum stays at rest; give a larger angle or a velocity.")
    RunSpec.of(place, angle=q, velocity=v, dt=setting.gap, duration=setting.gap, **own).tell()
    plan = CostPlan(setting, methods, wanted, rtols, repeats)
    given = {m.name: m for m in methods if known.METHODS.get(m.name) is not m}
    if given:
        shared["given"] = {name: hashlib.sha256(m.fingerprint.encode()).hexdigest()[:16] for name, m in given.items()}
    try:
        measured = sweep(
            plan.points, executor, run=partial(measure, methods=given) if given else measure, name="cost", file=file,
            anew=anew, progress=progress, work=plan.work, **shared,
            on_row=lambda point, row: _tell(on_point, point, row, setting, motion),
        )
    except OtherSweepError as error:
        raise StudyError(f"{error} In cost, resume=False empties this one and begins again; on the command line, leave "
                         "out --resume.") from None
    rows: dict[Rung, dict[int, Mapping[str, Any]]] = {}
    for point, row in zip(measured.points, measured.results, strict=True):
        if row is not None:
            rows.setdefault(Rung.of(point), {})[point["repeat"]] = row
    try:
        points = [_point(rung, rows[rung], setting, motion) for rung in plan.rungs if 0 in rows.get(rung, {})]
    except (KeyError, TypeError) as error:
        raise StudyError(
            f"A measurement in the journal {file} has no valid entry {error}; delete the file to measure all again."
        ) from None
    hosts = (tuple(dict.fromkeys(r[0][key] for r in rows.values() if 0 in r)) for key in ("machine", "versions"))
    return CostStudy(place, q, v, length, motion, tuple(points), repeats, measured.complete, plan.left_out, *hosts)


def _tell(
    on_point: Callable[[CostPoint], None] | None, point: Mapping[str, Any], row: Mapping[str, Any], setting: Setting,
    truth: Truth,
) -> None:
    if on_point is not None and point["repeat"] == 0:
        on_point(_point(Rung.of(point), {0: row}, setting, truth))


def _point(rung: Rung, rows: Mapping[int, Mapping[str, Any]], setting: Setting, truth: Truth) -> CostPoint:
    """Return the :class:`CostPoint` of one run, from the measurements of all its timings.

    ``rows`` has the measurement of each timing by its number; number 0 also holds the errors.
    """
    first = rows[0]
    usual = (rung.method, first["dt"], first["steps"])
    if first["stop_reason"]:
        missing = (math.nan,) * 4
        return CostPoint(*usual, *missing, (), math.nan, stop_reason=first["stop_reason"], rtol=rung.rtol)
    times = tuple(rows[repeat]["time"] for repeat in sorted(rows))
    return CostPoint(
        *usual, first["angle_error"], first["end_error"], first["energy_error"], first["evaluations"], times,
        1e9 * min(times) / setting.duration, first["angle_error"] <= FLOOR * truth.error_estimate,
        rtol=rung.rtol, phase_error=first["phase_error"],
        span=math.nan if rung.rtol is None else SPARSE * setting.gap,
    )


def _records(
    scene: Scene, duration: float, steps: Sequence[float] | None, sparse: bool
) -> tuple[int, list[int] | None]:
    """Return the number of records, and for each given step the number of steps between two records.

    Records are the equally spaced times at which runs are compared with the reference solution. The second result is
    None if no steps are given. With adaptive runs (``sparse``) the number of records is a multiple of seven.
    """
    period = 2.0 * math.pi / scene.omega0 if scene.omega0 else duration
    if not duration * RECORDS / period <= MOST_RECORDS:
        raise StudyError(
            f"A run of {duration / period:.3g} periods is too long for this study, at most {MOST_RECORDS // RECORDS}; "
            "shorten the duration."
        )
    part = SPARSE if sparse else 1
    if steps is None:
        return part * math.ceil(duration * RECORDS / period / part - 1e-9), None
    wanted = [number(step, "each step", above=0.0, unit="s") for step in several(steps, "steps", "numbers")]
    if not wanted or max(wanted) > duration:
        raise StudyError(f"steps must hold at least one step [s], none longer than the run of {duration:g} s.")
    checked_steps(duration, min(wanted))
    records = part * -(-checked_steps(duration, max(period / RECORDS, max(wanted))) // part)
    return records, sorted({checked_steps(duration / records, step) for step in wanted})


def _tolerances(
    scene: Scene, methods: Sequence[Method], steps: Sequence[float] | None, tolerances: Sequence[float] | None
) -> tuple[float, ...]:
    """Return the tolerances of the adaptive runs of a study, from large to small; empty if there are no such runs."""
    able = [method for method in methods if has_estimates(method)]
    if tolerances is None:
        dry = any(effect.dry for effect in scene.effects)
        return () if steps is not None or dry or not able else TOLERANCES
    ladder = several(tolerances, "tolerances", "numbers")
    for rtol in ladder:
        for method in able or methods[:1]:
            checked_tolerance(method, scene, rtol, None)
    return tuple(sorted({number(rtol, "each tolerance", above=0.0) for rtol in ladder}, reverse=True))


# --- runs of a study and their order ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rung:
    """Run of one method at one step or at one tolerance in a work-precision study.

    ``substeps`` is the number of equal steps between two records (times of comparison with the reference solution);
    ``rtol`` is the tolerance of an adaptive run.
    """

    method: str
    substeps: int | None = None
    rtol: float | None = None

    @classmethod
    def of(cls, point: Mapping[str, Any]) -> Rung:
        """Return the run (a method at a step or a tolerance) that a dict of a sweep describes."""
        return cls(point["method"], point.get("substeps"), point.get("rtol"))

    def point(self, repeat: int) -> dict[str, Any]:
        """Return the run as a dict, a part of the argument of :func:`pendulum_env.study.cost.runs.measure`.

        ``repeat`` is the number of the timing, from 0.
        """
        at = {"substeps": self.substeps} if self.rtol is None else {"rtol": self.rtol}
        return {"method": self.method, **at, "repeat": repeat}


@dataclass
class CostPlan:
    """List of all runs of a work-precision study, in the order in which they are measured.

    Args:
        setting, methods, repeats: common setting of the runs, integrators, and number of timings.
        wanted: numbers of steps between two records (times of comparison with the reference solution); None for the
            default list.
        rtols: tolerances, from large to small.

    Attributes:
        rungs: runs, method by method, from long steps to short, then from loose tolerances to tight.
        points: dicts of the timings, in order: all first timings before all second ones, and among the first timings
            all methods at their longest step before all methods at their second longest.
        left_out: sentence on the steps that the default list leaves out to save time, or "".
    """

    setting: Setting
    methods: Sequence[Method]
    wanted: Sequence[int] | None
    rtols: Sequence[float]
    repeats: int
    rungs: list[Rung] = field(init=False)
    points: list[dict[str, Any]] = field(init=False)
    left_out: str = field(init=False)

    def __post_init__(self) -> None:
        self._methods = {method.name: method for method in self.methods}
        lines = [line for method in self.methods for line in (self._steps(method), self._tolerances(method))]
        self.rungs = [rung for line in lines for rung in line]
        rounds = [line[k] for k in range(max(map(len, lines))) for line in lines if k < len(line)]
        long, half = {rung for rung in rounds if self._evaluations(rung) >= LONG}, max(1, self.repeats // 2)
        self.points = [rung.point(repeat) for repeat in range(self.repeats) for rung in rounds
                       if repeat < half or rung not in long]
        self._first = {(line[0].method, line[0].rtol is None): line[0] for line in lines if line}
        self.left_out = self._omissions()

    def work(self, point: Mapping[str, Any]) -> float:
        """Return the estimated work of one timing, in force evaluations, from which the fraction done is computed."""
        rung = Rung.of(point)
        once = 1e4 + self._evaluations(rung)
        if point["repeat"]:
            return once
        new = self._first[rung.method, rung.rtol is None] == rung
        return 2.0 * once + new * COMPILING[self.setting.backend]

    def _steps(self, method: Method) -> list[Rung]:
        if self.wanted is not None:
            return [Rung(method.name, count) for count in self.wanted]
        ladder = [Rung(method.name, 2**k) for k in range(DOUBLINGS)]
        return [rung for k, rung in enumerate(ladder) if k == 0 or self._affordable(rung)]

    def _tolerances(self, method: Method) -> list[Rung]:
        if not has_estimates(method):
            return []
        return [rung for rtol in self.rtols if self._affordable(rung := Rung(method.name, rtol=rtol))]

    def _affordable(self, rung: Rung) -> bool:
        backend = self.setting.backend
        return self._count(rung) <= MOST_STEPS[backend] and self._evaluations(rung) <= MOST_WORK[backend]

    def _count(self, rung: Rung) -> float:
        """Return the number of steps of a run; for an adaptive run it is estimated from the tolerance."""
        if rung.rtol is None:
            return float((rung.substeps or 1) * self.setting.records)
        power = 1.0 / order_of_estimate(self._methods[rung.method])
        return self.setting.records / SPARSE * float(max(1.0, LOOSEST / rung.rtol) ** power)

    def _evaluations(self, rung: Rung) -> float:
        method = self._methods[rung.method]
        per_step = evaluations_tried(method) if rung.rtol is not None else method.evaluations
        return self._count(rung) * per_step * (SWEEPS if method.implicit else 1.0)

    def _omissions(self) -> str:
        """Return a sentence on the step sizes that the default list leaves out as too expensive, or ""."""
        if self.wanted is not None:
            return ""
        gap, ends = self.setting.gap, dict[int, list[str]]()
        for method in self.methods:
            most = max(rung.substeps or 1 for rung in self.rungs if rung.method == method.name)
            ends.setdefault(most, []).append(method.name)
        longest = max(ends)
        parts = [f"below {gap / most:.2g} s with {', '.join(ends[most])}" for most in sorted(ends) if most < longest]
        if not parts:
            return ""
        return (
            f"The shortest step is {gap / longest:.2g} s; to save time there are none "
            + "; none ".join(parts) + "."
        )
