"""Which effects matter in a scene, those it has and those it leaves out: each one simulated with and without."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pendulum_env.common.progress import Progress, told_by
from pendulum_env.engine.kernels import Backend
from pendulum_env.physics.effects.predictions import OSCILLATIONS
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.study.audit.cases import Case, bare, cases
from pendulum_env.study.audit.files import write
from pendulum_env.study.audit.judging import Change, change_of, corrections, moved_by, row, unjudged
from pendulum_env.study.audit.step_cost import step_costs
from pendulum_env.study.audit.swing import SAMPLES, Swing, swing, time_scale
from pendulum_env.study.audit.verdicts import Audit, AuditRow
from pendulum_env.truth.reference import StudyError

__all__ = ["STEPS", "Audit", "AuditRow", "Progress", "audit", "write"]

STEPS = tuple(SAMPLES * 2**k for k in range(7))
"""Steps per period, doubled until the changes hold still."""
FINE, COARSE = 0.01, 0.1
"""Shares of the tolerance: refined until the changes move by less than FINE of it; COARSE of it is too much."""


def audit(
    scene: str | Scene | Mapping[str, Any],
    amplitude: float,
    tolerance: float,
    *,
    effects: Iterable[str] | None = None,
    progress: Progress | None = None,
    backend: Backend = "auto",
) -> Audit:
    """Say for every known effect whether a release at rest from ``amplitude`` calls for it.

    Each effect of the scene, and each that it leaves out as far as geometry and medium determine it, is simulated with
    and without, everything else being there: the relative change of the period (mean of the first three) and of the
    amplitude at the end of the first half swing. It is called for if either exceeds the tolerance. Where there are no
    three oscillations, or something acts that changes with the time, the largest change of the angle in four periods
    decides. Textbook predictions stand beside; they decide nothing. The step is halved until the changes hold still
    far below the tolerance.

    Of several models of one thing, such as the weight's or the bob's drag, one that is left out is compared in place of
    those that are there. What takes a control, such as a motor, is judged at full control, pushing towards the release
    side. An effect whose formula does not hold at the speeds that were reached is "outside its validity", and so is a
    simpler model in place of a closer one that changes more than the tolerance. Two corrections that are known but not
    simulated, of the support and of the wire's stiffness, end the list.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        amplitude: release angle [rad], above 0 and below pi.
        tolerance: relative, above 0.
        effects: names of those to judge; by default all.
        progress: called with the fraction done and what is being done.
        backend: "auto", "compiled" or "python".

    Returns what was found: :class:`pendulum_env.study.audit.verdicts.Audit`.

    Raises SceneError for numbers out of range or unknown names, StudyError where nothing ever moves or where the
    simulation cannot resolve the tolerance.
    """
    place = find_scene(scene)
    size = number(amplitude, "amplitude", above=0.0, unit="rad")
    limit = number(tolerance, "tolerance", above=0.0)
    if size >= math.pi:
        raise StudyError(f"amplitude must be below pi, the top, not {size:g} rad.")
    found = cases(place, effects)
    judged = [case for case in found if not case.reason]
    tell = told_by(progress)
    period = max((time_scale(one, size) for case in judged for one in (case.scene, case.without)), default=0.0)
    period = period or place.run.duration / (OSCILLATIONS + 1)
    changes, moved, steps = _settled(judged, size, limit, period, backend, tell)
    if judged and all(change.have.speed == change.lack.speed == 0.0 for change in changes):
        raise StudyError(f"In the scene '{place.name}' nothing moves when released at rest: there is nothing to judge.")
    pairs = [(case.scene, bare(case)) for case in judged]
    costs = step_costs(pairs, size, period, backend, lambda done: tell(0.7 + 0.3 * done, "what each effect costs"))
    answers = {case.name: row(case, change, cost, size, limit)
               for case, change, cost in zip(judged, changes, costs, strict=True)}
    rows = [answers.get(case.name) or unjudged(case) for case in found]
    rows += [] if effects is not None else corrections(place, limit)
    tell(1.0, "done")
    return Audit(place, size, limit, tuple(rows), moved, steps, (OSCILLATIONS + 1) * period)


def _settled(
    judged: Sequence[Case], amplitude: float, limit: float, period: float, backend: Backend, tell: Progress
) -> tuple[list[Change], float, int]:
    """The changes with steps so short that they hold still, by how much they moved last, and steps per period.

    Those of runs that diverge however short the step are left as they are. Raises StudyError if the others move on.
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
            f"tolerance must be above {moved / COARSE:.1g} here, the simulation's own reach, not {limit:g}."
        )
    return changes, moved, steps
