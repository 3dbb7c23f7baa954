"""Audit of a scene: simulates it with and without every known effect to see which effects matter, and simplifies it.

A simplification leaves negligible effects out and measures the resulting error of the angle. The computing time that an
effect adds to one integration step is measured, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

import integrators
from pendulum_env.common.progress import Progress, part_of, told_by, with_bar
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import Backend, resolve
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.rollout import rollout
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.timing import step_times
from pendulum_env.physics.effects.effect import OSCILLATIONS
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import boolean, number
from pendulum_env.study.audit.cases import (
    METHOD,
    SAMPLES,
    AuditCase,
    Swing,
    bare,
    cases,
    held_for,
    swing,
    time_scale,
    with_effect,
)
from pendulum_env.study.audit.judging import Change, change_of, corrections, moved_by, row
from pendulum_env.study.audit.verdicts import Audit, AuditRow, Simplification, Simplified
from pendulum_env.truth.reference import StudyError

STEPS_PER_PERIOD = 512
"""Steps per period in timings."""
TIMINGS: dict[str, tuple[int, int, int]] = {"compiled": (15, 5_000, 500), "python": (3, 60, 60)}
"""For each backend: number of timings, steps per timing, and steps after which the bob is released again."""


def step_costs(
    pairs: Sequence[tuple[Scene, Scene] | None], amplitude: float, period: float, backend: Backend,
    tell: Callable[[float], None],
) -> list[float]:
    """Return, for each pair of scenes, how much longer a step of rk4 takes in the first than in the second [ns].

    For an entry None instead of a pair the result is nan. ``tell`` is called with the fraction of the work done.
    """
    times = scene_times([scene for pair in pairs if pair for scene in pair], amplitude, period, backend, tell)
    return [times[pair[0]] - times[pair[1]] if pair else math.nan for pair in pairs]


def scene_times(
    scenes: Iterable[Scene], amplitude: float, period: float, backend: Backend, tell: Callable[[float], None],
    method: str = METHOD, timing: tuple[int, int, int] | None = None,
) -> dict[Scene, float]:
    """Return for each scene the computing time [ns] of one integration step, computation of energies included.

    The time is the shortest of several timings. Scenes for which the same code is generated share one timing. The
    timings alternate between scenes, so that a disturbance of the computer affects all of them alike. ``timing``
    (number of timings, steps per timing, steps between restarts) replaces the default of the backend.
    """
    keys = {scene: program(scene, integrators.get(method)).text for scene in scenes}
    rounds, steps, again = timing or TIMINGS[resolve(backend)]
    distinct = {text: scene for scene, text in reversed(keys.items())}
    machines: dict[str, Machine] = {}
    for text, scene in distinct.items():
        tell(0.8 * len(machines) / len(distinct))
        machines[text] = RunSpec.of(scene, method, backend=backend).machine()
    best = step_times(machines, amplitude, 2.0 * math.pi * amplitude / period, period / STEPS_PER_PERIOD, again,
                      rounds=rounds, runs=steps // again, tell=lambda done: tell(0.8 + 0.2 * done))
    return {scene: 1e9 * best[text] for scene, text in keys.items()}


__all__ = ["STEPS", "Audit", "AuditRow", "Progress", "audit", "simplify"]

STEPS = tuple(SAMPLES * 2**k for k in range(7))
"""Steps per period, doubled until the changes have converged."""
FINE, COARSE = 0.01, 0.1
"""Limits of the numerical error over the tolerance: below FINE a step is accepted, above COARSE the audit fails."""


@with_bar("effects")
def audit(
    scene: str | Scene | Mapping[str, Any],
    amplitude: float,
    tolerance: float,
    *,
    effects: Iterable[str] | None = None,
    progress: Progress | bool | None = None,
    backend: Backend = "auto",
) -> Audit:
    """Decide for every known effect whether it matters when a pendulum is released at rest from ``amplitude``.

    The scene is simulated with and without each of its effects, and each absent effect that geometry and medium
    determine. An effect matters if the relative change of the period (mean of the first three) or of the amplitude
    at the end of the first half swing exceeds the tolerance. Where there are fewer than three oscillations, or a force
    depends on time, the largest change of the angle in four periods decides. Textbook predictions are given for
    comparison only. The step is halved until the numerical error of the changes is far below the tolerance.

    When an absent effect is tested, it replaces the scene's models of the same phenomenon, for example of the drag. An
    effect with a control, such as a motor, is judged at full control, pushing towards the release side. An effect whose
    formula does not hold at the speeds reached is "outside its validity"; so is a simpler model that differs by more
    than the tolerance from the better one that it replaces. Two corrections known only as formulas, for the compliance
    of the support and the stiffness of the wire, are the last rows.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        amplitude: release angle [rad], above 0 and below pi.
        tolerance: relative change from which an effect matters, above 0.
        effects: names of the effects to judge; by default all.
        progress: True shows a progress bar, False none; by default a notebook shows one for work over 1.5 s. A
            function is called with the fraction done and the present activity.
        backend: "auto", "compiled" or "python".

    Returns an :class:`pendulum_env.study.audit.verdicts.Audit` with one row for each effect.

    Raises SceneError for numbers out of range or unknown names, StudyError where nothing ever moves or where the
    simulation cannot resolve the tolerance.
    """
    place = find_scene(scene)
    size = number(amplitude, "amplitude", above=0.0, unit="rad")
    limit = number(tolerance, "tolerance", above=0.0)
    if size >= math.pi:
        raise StudyError(f"amplitude must be below pi (the top position), not {size:g} rad.")
    listed = cases(place, effects)
    judged = [case for case in listed if not case.reason]
    tell = told_by(progress)
    period = max((time_scale(one, size) for case in judged for one in (case.scene, case.without)), default=0.0)
    period = period or place.run.duration / (OSCILLATIONS + 1)
    changes, moved, steps = _converged(judged, size, limit, period, backend, tell)
    still = (change.have.speed == change.lack.speed == 0.0 and not change.have.stop_reason for change in changes)
    if judged and all(still):
        raise StudyError(
            f"In the scene '{place.name}' nothing moves after a release at rest from {size:g} rad, so no effect "
            "can be judged; choose a scene with gravity or a larger amplitude."
        )
    pairs = [(case.scene, bare(case)) for case in judged]
    costs = step_costs(pairs, size, period, backend, lambda done: tell(0.7 + 0.3 * done, "timing each effect"))
    row_of = {case.name: row(case, change, cost, size, limit)
               for case, change, cost in zip(judged, changes, costs, strict=True)}
    rows = [row_of.get(case.name) or AuditRow(case.name, case.present, note=case.reason) for case in listed]
    rows += [] if effects is not None else corrections(place, limit)
    tell(1.0, "done")
    return Audit(place, size, limit, tuple(rows), moved, steps, (OSCILLATIONS + 1) * period)


def _converged(
    judged: Sequence[AuditCase], amplitude: float, limit: float, period: float, backend: Backend, tell: Progress
) -> tuple[list[Change], float, int]:
    """Return each effect's changes, simulated with ever shorter steps until they no longer depend on the step.

    The result is a triple: the changes, the largest difference from those at twice the step, and the number of steps
    per period. Changes of runs that diverge at every step are returned as they are. Raises StudyError if others do not
    converge.
    """
    before: list[Change] = []
    changes: list[Change] = []
    moved, steps = math.inf if judged else 0.0, STEPS[0]
    for i, steps in enumerate(STEPS if judged else ()):
        runs: dict[tuple[Scene, float], Swing] = {}
        before, changes = changes, []
        for k, case in enumerate(judged):
            tell(0.7 * (1.0 - 0.5**i + 0.5 ** (i + 1) * k / len(judged)), f"{case.name}, {steps} steps per period")
            for key in ((case.scene, case.control), (case.without, 0.0)):
                if key not in runs:
                    runs[key] = swing(key[0], amplitude, period, steps, control=key[1], backend=backend)
            changes.append(change_of(runs[case.scene, case.control], runs[case.without, 0.0], amplitude))
        if before:
            moved = max(map(moved_by, before, changes))
        if moved <= FINE * limit:
            break
    last = [moved_by(a, b) for a, b in zip(before, changes, strict=False) if not b.diverged]
    moved = max(last, default=0.0)
    if moved > COARSE * limit:
        raise StudyError(
            f"tolerance must be above {moved / COARSE:.1g}, the accuracy that this simulation reaches, not {limit:g}."
        )
    return changes, moved, steps


@with_bar("simplify")
def simplify(
    scene: str | Scene | Mapping[str, Any],
    amplitude: float,
    tolerance: float,
    *,
    duration: float | None = None,
    complete: bool = False,
    progress: Progress | bool | None = None,
    backend: Backend = "auto",
) -> Simplified:
    """Return a scene without its negligible effects, and the error that this causes over a run.

    Effects that the audit finds negligible are removed. Effects that matter but are not in the scene are reported; with
    ``complete`` they are added, in place of coarser models of the same effect (of several models the most detailed).

    Args:
        scene, amplitude, tolerance, progress, backend: as in :func:`pendulum_env.audit`.
        duration: length of the run in which the two scenes are compared [s]; by default the scene's usual run.
        complete: True adds the effects that matter and are not in the scene.

    Returns a pair: the scene, and a :class:`pendulum_env.study.audit.verdicts.Simplification`. Its ``change`` is what
    the removed effects together change in period or amplitude, measured as for the verdicts. Its ``error`` is the
    largest difference of the two scenes' angles over the run, relative to the amplitude. A small change of the period
    adds up, and the motion may be chaotic, so the error may exceed the tolerance over a long run.

    Raises as :func:`pendulum_env.audit` does.
    """
    place = find_scene(scene)
    length = number(place.run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    tell, wanted = told_by(progress), boolean(complete, "complete")
    verdict = audit(place, amplitude=amplitude, tolerance=tolerance, backend=backend,
                    progress=part_of(tell, 0.0, 0.9))
    full, added = _completed(verdict) if wanted else (place, ())
    present = {effect.name for effect in full.effects}
    removed = tuple(name for name in verdict.negligible if name in present)
    plain = full.with_effects(effect for effect in full.effects if effect.name not in removed)
    if not removed:
        return Simplified(plain, Simplification(verdict, (), added, length, 0.0, 0.0, True))
    tell(0.9, f"{length:g} s with and without {', '.join(removed)}")
    error, own, reached = _difference(full, plain, verdict, length, backend)
    period = verdict.duration / (OSCILLATIONS + 1)
    whole, rest = (swing(one, verdict.amplitude, period, verdict.steps, backend=backend) for one in (full, plain))
    together = change_of(whole, rest, verdict.amplitude)
    report = Simplification(verdict, removed, added, reached, error, own, error + own <= verdict.tolerance,
                            together.size, math.isnan(together.angle))
    return Simplified(plain, report)


def _completed(verdict: Audit) -> tuple[Scene, tuple[str, ...]]:
    """Return the audited scene with the missing effects that matter added, and the names of the added effects.

    Of several missing models of one phenomenon only the most detailed is added.
    """
    wanted = {case.name: case.effect for case in cases(verdict.scene) if case.name in verdict.missing and case.effect}
    full, added = verdict.scene, []
    for name, effect in wanted.items():
        rivals = [other for other in wanted.values() if effect.models and other.models == effect.models]
        if all(other.detail <= effect.detail for other in rivals):
            full = with_effect(full, effect)
            added.append(name)
    return full, tuple(added)


def _difference(
    full: Scene, plain: Scene, verdict: Audit, duration: float, backend: Backend
) -> tuple[float, float, float]:
    """Return the largest difference between the angles of two scenes' runs, relative to the amplitude.

    The result is a triple: this difference, its estimated numerical error, and the time [s] until which runs are
    compared. Angles are compared at the same instants for every step size; the step is halved until the difference has
    converged.
    """
    period = verdict.duration / (OSCILLATIONS + 1)
    error, own, end = float("inf"), float("inf"), duration
    for steps in STEPS:
        before, h = error, period / steps
        usual: dict[str, Any] = {"angle": verdict.amplitude, "velocity": 0.0, "dt": h, "duration": duration}
        every = steps // SAMPLES
        runs = [rollout(one, integrator=METHOD, every=every, backend=backend, warn=False, **usual,
                        **held_for(one, every))
                for one in (full, plain)]
        if "diverged" in (run.stop_reason for run in runs):
            continue
        end = min(duration, *(float(run.stop_time) for run in runs))
        shared = 1 + int((end + 1e-6 * h) / (period / SAMPLES))
        angles = [run.angle[:shared] for run in runs]
        error = float(np.max(np.abs(angles[0] - angles[1]))) / verdict.amplitude
        own = abs(error - before)
        if own <= COARSE * max(error, verdict.tolerance):
            break
    if error == float("inf"):
        raise StudyError(
            f"The simulation of '{full.name}' diverges at every tested step of {METHOD}, because the scene is too "
            "stiff; reduce its damping."
        )
    return error, own, end
