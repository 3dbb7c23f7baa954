"""A scene with just the effects that it calls for, and the error that leaving out the others causes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pendulum_env.common.progress import Progress, told_by
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.effects.predictions import OSCILLATIONS
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number, truth
from pendulum_env.study.audit.cases import cases, with_effect
from pendulum_env.study.audit.study import COARSE, STEPS, audit
from pendulum_env.study.audit.swing import METHOD, SAMPLES, held_for
from pendulum_env.study.audit.verdicts import Audit, Simplification
from pendulum_env.truth.reference import StudyError


def simplify(
    scene: str | Scene | Mapping[str, Any],
    amplitude: float,
    tolerance: float,
    *,
    duration: float | None = None,
    complete: bool = False,
    progress: Progress | None = None,
    backend: Backend = "auto",
) -> tuple[Scene, Simplification]:
    """The scene with just the effects that it calls for, and the error that this causes over a run.

    Effects that the audit finds negligible go. Those that the scene leaves out although it calls for them are reported;
    with ``complete`` they are added, of several models of one thing the closest, in place of coarser ones.

    Args:
        scene, amplitude, tolerance, progress, backend: as in :func:`pendulum_env.audit`.
        duration: of the comparison [s]; by default the scene's usual run.
        complete: add what is called for and absent.

    Returns the scene and a :class:`pendulum_env.study.audit.verdicts.Simplification`. Its error is the largest
    difference of the two scenes' angles over the run, relative to the amplitude: a small change of the period adds up,
    and motion may be chaotic, so it may exceed the tolerance over a long run, and then the report says so.

    Raises as :func:`pendulum_env.audit` does.
    """
    place = find_scene(scene)
    length = number(place.run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    tell, wanted = told_by(progress), truth(complete, "complete")
    found = audit(place, amplitude=amplitude, tolerance=tolerance, backend=backend,
                  progress=lambda done, what: tell(0.9 * done, what))
    full, added = _completed(found) if wanted else (place, ())
    kept = {effect.name for effect in full.effects}
    removed = tuple(name for name in found.negligible if name in kept)
    plain = full.with_effects(effect for effect in full.effects if effect.name not in removed)
    if not removed:
        return plain, Simplification(found, (), added, length, 0.0, 0.0, True)
    tell(0.9, f"{length:g} s with and without {', '.join(removed)}")
    error, own, reached = _difference(full, plain, found, length, backend)
    return plain, Simplification(found, removed, added, reached, error, own, error + own <= found.tolerance)


def _completed(found: Audit) -> tuple[Scene, tuple[str, ...]]:
    """The scene with the absent effects that it calls for, and their names."""
    wanted = {case.name: case.effect for case in cases(found.scene) if case.name in found.missing and case.effect}
    full, added = found.scene, []
    for name, effect in wanted.items():
        rivals = [other for other in wanted.values() if effect.models and other.models == effect.models]
        if all(other.detail <= effect.detail for other in rivals):
            full = with_effect(full, effect)
            added.append(name)
    return full, tuple(added)


def _difference(
    full: Scene, plain: Scene, found: Audit, duration: float, backend: Backend
) -> tuple[float, float, float]:
    """Largest difference of the angles over the amplitude, how much of it is the integrator's, and up to when [s].

    Angles are compared at the same instants at every step; the step is halved until the difference holds still.
    """
    period = found.duration / (OSCILLATIONS + 1)
    error, own, reached = float("inf"), float("inf"), duration
    for steps in STEPS:
        before, h = error, period / steps
        usual: dict[str, Any] = {"angle": found.amplitude, "velocity": 0.0, "dt": h, "duration": duration}
        every = steps // SAMPLES
        runs = [rollout(one, integrator=METHOD, every=every, backend=backend, warn=False, **usual,
                        **held_for(one, every))
                for one in (full, plain)]
        if "diverged" in (run.stop_reason for run in runs):
            continue
        reached = min(duration, *(float(run.stop_time) for run in runs))
        shared = 1 + int((reached + 0.5 * h) / (period / SAMPLES))
        angles = [run.angle[:shared] for run in runs]
        error = float(np.max(np.abs(angles[0] - angles[1]))) / found.amplitude
        own = abs(error - before)
        if own <= COARSE * max(error, found.tolerance):
            break
    if error == float("inf"):
        raise StudyError(f"The simulation of '{full.name}' diverges however short the step of {METHOD}: too stiff.")
    return error, own, reached
