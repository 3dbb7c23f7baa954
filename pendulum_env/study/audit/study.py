"""Audit of a scene: simulates it with and without every known effect to see which effects matter."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pendulum_env.common.progress import Progress, told_by, with_bar
from pendulum_env.common.results import write
from pendulum_env.engine.kernels import Backend
from pendulum_env.physics.effects.effect import OSCILLATIONS
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.study.audit.cases import AuditCase, bare, cases
from pendulum_env.study.audit.judging import Change, change_of, corrections, moved_by, row
from pendulum_env.study.audit.step_cost import step_costs
from pendulum_env.study.audit.swing import SAMPLES, Swing, swing, time_scale
from pendulum_env.study.audit.verdicts import Audit, AuditRow
from pendulum_env.truth.reference import StudyError

__all__ = ["STEPS", "Audit", "AuditRow", "Progress", "audit", "write"]

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
