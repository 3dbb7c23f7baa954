"""What accuracy costs in time: every method at a ladder of steps and of tolerances on one scene, against the truth."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Any

import integrators as known
from integrators import Method
from integrators.solving.adaptive import FINEST
from integrators.steps.estimates import has_estimates
from pendulum_env.common.progress import Progress
from pendulum_env.engine.kernels import Backend, resolve
from pendulum_env.engine.machine import checked_tolerance, fitting
from pendulum_env.engine.rollout import rollout
from pendulum_env.engine.starts import checked_methods, checked_start, checked_steps
from pendulum_env.physics.damping import Damping, build_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import function, naming_keywords, number, several, truth, whole_number
from pendulum_env.study.cost.files import write
from pendulum_env.study.cost.plan import RECORDS, Plan, Rung
from pendulum_env.study.cost.points import FLOOR, CostPoint, CostStudy
from pendulum_env.study.cost.runs import SPARSE, Setting, measure, setting_of
from pendulum_env.study.sweep.journal import OtherSweepError
from pendulum_env.study.sweep.study import sweep
from pendulum_env.truth.reference import Reference, StudyError

__all__ = ["CostPoint", "CostStudy", "Progress", "cost", "write"]

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
        place = build_scene(scene, damping, parameters)
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
    rollout(place, angle=q, velocity=v, dt=setting.gap, duration=setting.gap, backend="python")  # what is to be warned
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
    truth: Reference,
) -> None:
    if on_point is not None and point["repeat"] == 0:
        on_point(_point(Rung.of(point), {0: row}, setting, truth))


def _point(rung: Rung, rows: Mapping[int, Mapping[str, Any]], setting: Setting, truth: Reference) -> CostPoint:
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
