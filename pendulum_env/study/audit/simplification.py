"""Simplification of a scene: negligible effects are removed, and the resulting error of the angle is measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pendulum_env.common.progress import Progress, part_of, told_by, with_bar
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.effects.effect import OSCILLATIONS
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import boolean, number
from pendulum_env.study.audit.cases import cases, with_effect
from pendulum_env.study.audit.judging import change_of
from pendulum_env.study.audit.study import COARSE, STEPS, audit
from pendulum_env.study.audit.swing import METHOD, SAMPLES, held_for, swing
from pendulum_env.study.audit.verdicts import Audit, Simplification, Simplified
from pendulum_env.truth.reference import StudyError


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
