"""What accuracy costs in time: every method at a ladder of steps and of tolerances on one scene, against the truth."""

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
from pendulum_env.common.progress import Progress
from pendulum_env.engine.kernels import Backend, resolve
from pendulum_env.engine.machine import checked_tolerance, fitting
from pendulum_env.engine.spec import RunSpec, scene_and_shared
from pendulum_env.engine.starts import checked_methods, checked_start, checked_steps
from pendulum_env.physics.damping import Damping
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import function, naming_keywords, number, several, truth, whole_number
from pendulum_env.study.cost.files import write
from pendulum_env.study.cost.points import FLOOR, CostPoint, CostStudy
from pendulum_env.study.cost.runs import SPARSE, Setting, measure, setting_of
from pendulum_env.study.sweep.journal import OtherSweepError
from pendulum_env.study.sweep.study import sweep
from pendulum_env.truth.answer import Truth
from pendulum_env.truth.reference import StudyError

__all__ = ["CostPoint", "CostStudy", "Progress", "cost", "write"]

RECORDS = 16
"""Times per small-angle period at which errors are measured, or a few more; also the fewest steps of the default
ladder."""
DOUBLINGS = 13
"""Rungs of the default ladder: period/16, period/32, ... period/65536."""
MOST_STEPS = {"compiled": 2**20, "python": 2**13}
"""The default ladder ends where a run would take more steps than this."""
MOST_WORK = {"compiled": 2**24, "python": 2**19}
"""It also ends where a run would take more force evaluations than this."""
SWEEPS = 10.0
"""What an evaluation of an implicit method takes, with the equations that are solved, in those of an explicit one."""
COMPILING = {"compiled": 1e8, "python": 0.0}
"""The same of a program that is made for a method."""
LOOSEST = 1e-2
"""Tolerance with which about one step per SPARSE records is taken."""
MOST_RECORDS = 2**20
"""Times at which errors are measured, at most."""
MOST_REPEATS = 10**6
"""Timings of each run, at most."""
TOLERANCES = (*(10.0**-k for k in range(2, 15)), FINEST)
"""The default ladder of tolerances: down to the least that double precision allows."""


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
    progress: Progress | bool = False,
    on_point: Callable[[CostPoint], None] | None = None,
    backend: Backend = "auto",
    **parameters: Any,
) -> CostStudy:
    """Measure error, time and force evaluations of methods on a scene.

    Each method runs with every step of a ladder, from long to short; those that estimate their error run with a ladder
    of tolerances too, as a line "NAME, adaptive", where the scene has no dry friction. Errors are the largest over
    common times, about 16 per small-angle period. Adapted steps are cut where they are looked at, so that is done but
    every seventh of these times, 0.44 periods apart: in the long run all over the swing. Runs are timed warm, as they
    are everywhere in the package: with the energy ledger. The repeats go round all runs in turn, so that a noisy
    machine hurts all of them alike.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        integrators: names or methods, none twice; by default all that fit.
        angle, velocity, duration: the run [rad, rad/s, s]; by default the scene's usual one.
        damping: as in :func:`pendulum_env.physics.damping.with_damping`.
        steps: the ladder [s], each rounded down to fit the common times; by default about period/16, /32, ... /65536,
            ended where a run would take a million steps or some ten million force evaluations; what is left out so is
            said in ``left_out``.
        tolerances: rtol = atol of steps that are adapted; by default 1e-2, 1e-3, ... and the least that double
            precision allows, or none where ``steps`` are given; () for none.
        repeats: timings of each run.
        executor: what runs them, as in :func:`pendulum_env.study.sweep.study.sweep`. Times are good from workers that
        have
            a core each to themselves.
        file: a journal, into which each measurement goes as it is made. A study that was interrupted goes on with it.
        resume: False starts the journal anew.
        progress: True shows a bar; or what is called with the fraction done and what is being done.
        on_point: called with each new point when its error and first time are known.
        backend: "auto", "compiled" or "python".
        **parameters: single parameters of the scene, such as ``length=0.5``.

    KeyboardInterrupt ends it early: the study then has what was measured, and ``complete`` is False.

    Raises SceneError or MethodError for anything that cannot be; StudyError for a start where nothing moves, a journal
    of another study, or an executor that breaks down.
    """
    with naming_keywords(cost):
        place, own = scene_and_shared(scene, damping, parameters)
    q = number(place.run.angle if angle is None else angle, "angle", unit="rad")
    v = number(place.run.velocity if velocity is None else velocity, "velocity", unit="rad/s")
    checked_start(place, q, v)
    length = number(place.run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    anew, repeats = not truth(resume, "resume"), whole_number(repeats, "repeats", MOST_REPEATS)
    if on_point is not None:
        function(on_point, "on_point")
    _check_length(place, length)
    methods = checked_methods(fitting(place) if integrators is None else integrators, place)
    rtols = _tolerances(place, methods, steps, tolerances)
    records, wanted = _records(place, length, steps, bool(rtols))
    setting = Setting(place, q, v, length, records, resolve(backend))
    shared = setting.shared()
    motion = setting_of(json.dumps(shared, sort_keys=True)).truth
    if not motion.velocity.any():
        raise StudyError("Nothing moves from rest at the bottom; give an angle or a velocity.")
    RunSpec.of(place, angle=q, velocity=v, dt=setting.gap, duration=setting.gap, **own).tell()
    plan = Plan(setting, methods, wanted, rtols, repeats)
    given = {m.name: m for m in methods if known.METHODS.get(m.name) is not m}
    if given:
        shared["given"] = {name: hashlib.sha256(repr(m).encode()).hexdigest()[:16] for name, m in given.items()}
    try:
        found = sweep(
            plan.points, executor, run=partial(measure, methods=given) if given else measure, name="cost", file=file,
            anew=anew, progress=progress, work=plan.work, **shared,
            on_row=lambda point, row: _tell(on_point, point, row, setting, motion),
        )
    except OtherSweepError as error:
        raise StudyError(f"{error} Without resume, a study starts anew.") from None
    rows: dict[Rung, dict[int, Mapping[str, Any]]] = {}
    for point, row in zip(found.points, found.results, strict=True):
        if row is not None:
            rows.setdefault(Rung.of(point), {})[point["repeat"]] = row
    try:
        points = [_point(rung, rows[rung], setting, motion) for rung in plan.rungs if 0 in rows.get(rung, {})]
    except (KeyError, TypeError) as error:
        raise StudyError(f"The journal {file} has a measurement that lacks a number ({error}); remove it.") from None
    hosts = (tuple(dict.fromkeys(r[0][key] for r in rows.values() if 0 in r)) for key in ("machine", "versions"))
    return CostStudy(place, q, v, length, motion, tuple(points), repeats, found.complete, plan.left_out, *hosts)


def _tell(
    on_point: Callable[[CostPoint], None] | None, point: Mapping[str, Any], row: Mapping[str, Any], setting: Setting,
    truth: Truth,
) -> None:
    if on_point is not None and point["repeat"] == 0:
        on_point(_point(Rung.of(point), {0: row}, setting, truth))


def _point(rung: Rung, rows: Mapping[int, Mapping[str, Any]], setting: Setting, truth: Truth) -> CostPoint:
    """What the repeats of one run say together; the first has the errors."""
    first = rows[0]
    usual = (rung.method, first["dt"], first["steps"])
    if first["stop_reason"]:
        nothing = (math.nan,) * 4
        return CostPoint(*usual, *nothing, (), math.nan, stop_reason=first["stop_reason"], rtol=rung.rtol)
    times = tuple(rows[repeat]["time"] for repeat in sorted(rows))
    return CostPoint(
        *usual, first["angle_error"], first["end_error"], first["energy_error"], first["evaluations"], times,
        1e9 * min(times) / setting.duration, first["angle_error"] <= FLOOR * truth.error_estimate,
        rtol=rung.rtol, phase_error=first["phase_error"],
        span=math.nan if rung.rtol is None else SPARSE * setting.gap,
    )


def _check_length(scene: Scene, duration: float) -> None:
    period = 2.0 * math.pi / scene.omega0 if scene.omega0 else duration
    if not duration * RECORDS / period <= MOST_RECORDS:
        raise StudyError(
            f"A run of {duration / period:.3g} periods is too long for this study, at most {MOST_RECORDS // RECORDS}; "
            "shorten the duration."
        )


def _records(
    scene: Scene, duration: float, steps: Sequence[float] | None, sparse: bool
) -> tuple[int, list[int] | None]:
    """How many records follow the start, and the steps from one to the next that were asked for, if any were.

    Records are a multiple of SPARSE where adapted steps are looked at.
    """
    period = 2.0 * math.pi / scene.omega0 if scene.omega0 else duration
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
    """The ladder of tolerances, from large to small; none where nothing can be adapted."""
    able = [method for method in methods if has_estimates(method)]
    if tolerances is None:
        dry = any(effect.dry for effect in scene.effects)
        return () if steps is not None or dry or not able else TOLERANCES
    ladder = several(tolerances, "tolerances", "numbers")
    for rtol in ladder:
        for method in able or methods[:1]:
            checked_tolerance(method, scene, rtol, None)
    return tuple(sorted({number(rtol, "each tolerance", above=0.0) for rtol in ladder}, reverse=True))


# --- which runs, in which order --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Rung:
    """One method at one step or tolerance: ``substeps`` from one record to the next, or ``rtol``."""

    method: str
    substeps: int | None = None
    rtol: float | None = None

    @classmethod
    def of(cls, point: Mapping[str, Any]) -> Rung:
        return cls(point["method"], point.get("substeps"), point.get("rtol"))

    def point(self, repeat: int) -> dict[str, Any]:
        """Return the rung as :func:`pendulum_env.study.cost.runs.measure` takes it."""
        at = {"substeps": self.substeps} if self.rtol is None else {"rtol": self.rtol}
        return {"method": self.method, **at, "repeat": repeat}


@dataclass
class Plan:
    """The runs of a study.

    Args:
        setting, methods, repeats: of the study.
        wanted: steps from one record to the next; None for the default ladder.
        rtols: tolerances, from large to small.

    Attributes:
        rungs: in the order of the methods, each from long steps to short, then from loose tolerances to tight.
        points: those to measure: the repeats outermost, then the rungs from long steps to short, so that each method
            has its turn before any has the next.
        left_out: what was left out of the default ladders for the work that it would be, as a sentence; or "".
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
        self.points = [rung.point(repeat) for repeat in range(self.repeats) for rung in rounds]
        self._first = {(line[0].method, line[0].rtol is None): line[0] for line in lines if line}
        self.left_out = self._said()

    def work(self, point: Mapping[str, Any]) -> float:
        """About how much work a point is, in force evaluations."""
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
        return [rung for k, rung in enumerate(ladder) if k == 0 or self._bearable(rung)]

    def _tolerances(self, method: Method) -> list[Rung]:
        if not has_estimates(method):
            return []
        return [rung for rtol in self.rtols if self._bearable(rung := Rung(method.name, rtol=rtol))]

    def _bearable(self, rung: Rung) -> bool:
        backend = self.setting.backend
        return self._count(rung) <= MOST_STEPS[backend] and self._evaluations(rung) <= MOST_WORK[backend]

    def _count(self, rung: Rung) -> float:
        """Steps of a run, those with a tolerance by the order of the estimate."""
        if rung.rtol is None:
            return float((rung.substeps or 1) * self.setting.records)
        power = 1.0 / order_of_estimate(self._methods[rung.method])
        return self.setting.records / SPARSE * float(max(1.0, LOOSEST / rung.rtol) ** power)

    def _evaluations(self, rung: Rung) -> float:
        method = self._methods[rung.method]
        each = evaluations_tried(method) if rung.rtol is not None else method.evaluations
        return self._count(rung) * each * (SWEEPS if method.implicit else 1.0)

    def _said(self) -> str:
        """What the default ladders lack."""
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
            f"Steps down to {gap / longest:.2g} s, but for the time that they would take none "
            + "; none ".join(parts) + "."
        )
