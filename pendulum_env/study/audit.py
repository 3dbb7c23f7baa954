"""Which of a scene's effects matter: each one simulated with and without."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pendulum_env.engine.kernels import Backend, resolve
from pendulum_env.engine.machine import INDEX, Machine
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.effects import Gravity, SmallAngleGravity
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.progress import Progress
from pendulum_env.provenance import output_folder, provenance, write_csv
from pendulum_env.study.reference import StudyError
from pendulum_env.study.swing import METHOD, OSCILLATIONS, Swing, predicted, swing
from pendulum_env.study.verdicts import CALLED_FOR, NEGLIGIBLE, Audit, AuditRow, Simplification

__all__ = ["Audit", "AuditRow", "Progress", "Simplification", "audit", "simplify", "write"]


STEPS = (512, 1024, 2048, 4096, 8192)
"""Steps per period, doubled until the changes hold still."""
FINE, COARSE = 0.01, 0.1
"""Shares of the tolerance: refined until the changes move by less than FINE of it; COARSE of it is too much."""
TIMED_STEPS, TIMED_SWINGS, TIMINGS = 500, 40, 15
"""Steps per period of the runs that are timed, periods per timing, and timings, of which the shortest counts."""
OTHER = {"gravity": SmallAngleGravity(), "small_angle_gravity": Gravity()}
"""Each model of the weight, and the one that may stand in its place."""


@dataclass(frozen=True)
class _Case:
    """One question: ``scene`` with the effect, ``without`` it, and who answers."""

    effect: str
    present: bool
    scene: Scene
    without: Scene
    control: float = 0.0
    note: str = ""
    always: bool = False


def audit(
    scene: str | Scene | Mapping[str, Any],
    *,
    amplitude: float,
    tolerance: float,
    progress: Progress | None = None,
    backend: Backend = "auto",
) -> Audit:
    """Say for each effect of a scene whether a release from ``amplitude`` calls for it.

    Each effect is simulated with and without, everything else being there: the relative change of the period (mean of
    the first three) and of the amplitude at the end of the first half swing. It is called for if either exceeds the
    tolerance. The step is halved until the changes hold still far below the tolerance. The weight is always called
    for; its other model, linearised or full, is compared as an effect that is absent or in a note. A motor is judged at
    full control, pushing towards the release side.

    Args:
        scene: preset name, dict, Scene, or a scene's JSON file.
        amplitude: release angle [rad], above 0 and below pi.
        tolerance: relative, above 0.
        progress: called with the fraction done and what is being done.
        backend: "auto", "compiled" or "python".

    Raises SceneError for numbers out of range, StudyError where nothing swings for want of gravity or where the
    simulation cannot resolve the tolerance.
    """
    place = find_scene(scene)
    size = number(amplitude, "amplitude", above=0.0, unit="rad")
    limit = number(tolerance, "tolerance", above=0.0)
    if size >= math.pi:
        raise StudyError(f"amplitude must be below pi, the top, not {size:g} rad.")
    weight = next((effect.name for effect in place.effects if effect.name in OTHER), "")
    if not (weight and place.omega0):
        raise StudyError(f"The scene '{place.name}' has no gravity: nothing swings, and there is no period to change.")
    cases = _cases(place, weight)
    tell = progress or (lambda _fraction, _what: None)
    changes: list[tuple[float, float, str]] = []
    moved, steps = math.inf, STEPS[0]
    for i, steps in enumerate(STEPS):
        tell(0.8 * i / len(STEPS), f"{len(cases)} effects, {steps} steps per period")
        before, changes = changes, [_change(case, size, steps, backend) for case in cases]
        moved = max((_moved(a, b) for a, b in zip(before, changes, strict=True)), default=math.inf) if before else moved
        if moved <= FINE * limit:
            break
    if moved > COARSE * limit:
        reach = moved / COARSE
        raise StudyError(f"tolerance must be above {reach:.1g} here, the simulation's own reach, not {limit:g}.")
    tell(0.8, "what each effect costs")
    costs = _costs(cases, size, backend)
    answers = zip(cases, changes, costs, strict=True)
    rows = tuple(_row(case, change, cost, size, limit) for case, change, cost in answers)
    tell(1.0, "done")
    return Audit(place, size, limit, rows, moved, steps)


def _cases(scene: Scene, weight: str) -> list[_Case]:
    other = scene.with_effects(OTHER[weight] if effect.name == weight else effect for effect in scene.effects)
    cases = []
    for effect in scene.effects:
        rest = scene.with_effects(e for e in scene.effects if e is not effect)
        if effect.name == "gravity":
            cases.append(_Case(effect.name, True, scene, other, always=True, note=(
                "without it nothing swings; the changes are those against small_angle_gravity in its place")))
        elif effect.name == "small_angle_gravity":
            cases.append(_Case(effect.name, True, scene, scene, always=True, note="without it nothing swings"))
            cases.append(_Case("gravity", False, other, scene))
        elif effect.kind == "drive":
            cases.append(_Case(effect.name, True, scene, rest, control=1.0, note=(
                "at full control, towards the release side; without control it changes nothing")))
        else:
            cases.append(_Case(effect.name, True, scene, rest))
    return cases


def _change(case: _Case, amplitude: float, steps: int, backend: Backend) -> tuple[float, float, str]:
    """Relative changes of period and amplitude, and a note where there is no swing to measure."""
    have = swing(case.scene, amplitude, steps, control=case.control, backend=backend)
    lack = swing(case.without, amplitude, steps, backend=backend)
    if have.swings and lack.swings:
        period = (have.period - lack.period) / lack.period
        return period, (have.amplitude - lack.amplitude) / amplitude, ""
    if have.swings != lack.swings:
        return math.nan, math.nan, f"with it the bob {_says(have)}, without it the bob {_says(lack)}"
    shared = min(len(have.time), len(lack.time))
    return math.nan, float(np.max(np.abs(have.angle[:shared] - lack.angle[:shared]))) / amplitude, (
        f"there are no {OSCILLATIONS} oscillations: the change is the angle's largest, over the release angle"
    )


def _says(found: Swing) -> str:
    return f"makes {OSCILLATIONS} oscillations" if found.swings else f"does not make {OSCILLATIONS} oscillations"


def _moved(before: tuple[float, float, str], after: tuple[float, float, str]) -> float:
    """By how much a change still moved with the step; without end if a swing came or went."""
    sizes = [0.0 if math.isnan(a) and math.isnan(b) else abs(a - b) for a, b in zip(before[:2], after[:2], strict=True)]
    return math.inf if any(map(math.isnan, sizes)) else max(sizes)


def _row(case: _Case, change: tuple[float, float, str], cost: float, amplitude: float, tolerance: float) -> AuditRow:
    period, size, said = change
    expected = predicted(case.effect, case.scene, amplitude)
    note = case.note
    if not case.present:
        note = f"replacing small_angle_gravity by gravity changes the period by {period:.2g}"
    elif case.always and case.scene is case.without:
        period = size = math.nan
        expected = (math.nan, math.nan)
    matters = case.always or bool(said and math.isnan(size)) or not max(_sizes(period, size)) <= tolerance
    verdict = CALLED_FOR if matters else NEGLIGIBLE
    notes = "; ".join(text for text in (note, said) if text)
    return AuditRow(case.effect, case.present, period, size, *expected, cost, verdict, notes)


def _sizes(*values: float) -> list[float]:
    return [abs(value) for value in values if not math.isnan(value)] or [0.0]


def _costs(cases: Sequence[_Case], amplitude: float, backend: Backend) -> list[float]:
    """What each effect adds to a step [ns]: shortest of timings that go round all variants in turn."""
    pairs = [(case.scene, case.scene.with_effects(e for e in case.scene.effects if e.name != case.effect))
             for case in cases]
    machines = {scene: Machine(scene, METHOD, backend=backend) for pair in pairs for scene in pair}
    best = dict.fromkeys(machines, math.inf)
    for _ in range(TIMINGS if resolve(backend) == "compiled" else 3):
        for scene, machine in machines.items():
            best[scene] = min(best[scene], _step_time(machine, amplitude))
    return [best[full] - best[bare] for full, bare in pairs]


def _step_time(machine: Machine, amplitude: float) -> float:
    """Wall time of one step [ns], in swings that are released again and again, so that none comes to rest."""
    start, state = machine.state(amplitude, 0.0), machine.state(amplitude, 0.0)
    h = 2.0 * math.pi / (machine.scene.omega0 or 1.0) / TIMED_STEPS
    machine.advance(state, 0.0, h, 0)
    begun, steps = time.perf_counter(), 0.0
    for _ in range(TIMED_SWINGS if machine.compiled else 1):
        state[:] = start
        machine.advance(state, 0.0, h, TIMED_STEPS)
        steps += float(state[INDEX])
    return 1e9 * (time.perf_counter() - begun) / max(steps, 1.0)


def simplify(
    scene: str | Scene | Mapping[str, Any],
    *,
    amplitude: float,
    tolerance: float,
    duration: float | None = None,
    progress: Progress | None = None,
    backend: Backend = "auto",
) -> tuple[Scene, Simplification]:
    """The scene with only the effects that it calls for, and the error that this causes over a run.

    Args:
        scene, amplitude, tolerance, progress, backend: as in :func:`audit`.
        duration: of the comparison [s]; by default the scene's usual run.

    The error is the largest difference of the two scenes' angles over the run, relative to the amplitude: a small
    change of the period adds up, so it may exceed the tolerance over a long run, and then the report says so.
    Raises as :func:`audit` does.
    """
    place = find_scene(scene)
    length = number(place.run.duration if duration is None else duration, "duration", above=0.0, unit="s")
    found = audit(place, amplitude=amplitude, tolerance=tolerance, progress=progress, backend=backend)
    removed = found.negligible
    plain = place.with_effects(effect for effect in place.effects if effect.name not in removed)
    if not removed:
        return plain, Simplification(found, (), length, 0.0, 0.0, True)
    runs = []
    for steps in STEPS[:2]:
        h = 2.0 * math.pi / place.omega0 / steps
        usual: dict[str, Any] = {"angle": found.amplitude, "velocity": 0.0, "dt": h, "duration": length}
        pair = [rollout(one, integrator=METHOD, backend=backend, **usual) for one in (place, plain)]
        shared = min(len(run.time) for run in pair)
        runs.append(float(np.max(np.abs(pair[0].angle[:shared] - pair[1].angle[:shared]))) / found.amplitude)
    error, own = runs[1], abs(runs[1] - runs[0])
    return plain, Simplification(found, removed, length, error, own, error + own <= found.tolerance)


def write(found: Audit, folder: str | Path) -> tuple[Path, Path]:
    """Write ``effects.png`` and ``effects.csv``; OutputError if the folder cannot be written."""
    from pendulum_env.plots.style import save
    from pendulum_env.study.audit_plot import draw

    place = output_folder(folder)
    facts = provenance(
        Scene=found.scene.to_dict(), Method=METHOD, Amplitude=found.amplitude, Tolerance=found.tolerance,
        StepsPerPeriod=found.steps, IntegrationError=found.integration_error,
    )
    table = place / "effects.csv"
    names = [entry.name for entry in dataclasses.fields(AuditRow)]
    picture = save(draw(found), place / "effects.png", facts)
    write_csv(table, names, ([getattr(row, name) for name in names] for row in found.rows), facts)
    return picture, table
