"""Which of a scene's effects matter: each one simulated with and without."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import INDEX, Machine
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.effects import Gravity, SmallAngleGravity
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import number
from pendulum_env.study.provenance import output_folder, provenance, write_csv
from pendulum_env.study.reference import StudyError
from pendulum_env.study.swing import METHOD, OSCILLATIONS, Swing, predicted, swing

Progress = Callable[[float, str], None]

STEPS = (512, 1024, 2048, 4096, 8192)
"""Steps per period, doubled until the changes hold still."""
FINE, COARSE = 0.01, 0.1
"""Shares of the tolerance: refined until the changes move by less than FINE of it; COARSE of it is too much."""
TIMED_STEPS, TIMINGS = 20_000, 7
CALLED_FOR, NEGLIGIBLE = "called for", "negligible"
OTHER = {"gravity": SmallAngleGravity(), "small_angle_gravity": Gravity()}
"""Each model of the weight, and the one that may stand in its place."""


@dataclass(frozen=True)
class AuditRow:
    """One effect.

    Attributes:
        effect: its name.
        present: False for one that the scene leaves out.
        period_change: relative change of the period that it makes, by simulation; nan where nothing swings without it.
        amplitude_change: change of the amplitude in the first half swing, relative to the release angle, likewise.
        period_predicted, amplitude_predicted: the textbook's formula; nan where there is none.
        ns_per_step: what it adds to a step of rk4 [ns], measured.
        verdict: "called for" or "negligible".
        note: what else is to be said.
    """

    effect: str
    present: bool
    period_change: float
    amplitude_change: float
    period_predicted: float
    amplitude_predicted: float
    ns_per_step: float
    verdict: str
    note: str = ""


@dataclass(frozen=True)
class Audit:
    """The effects of a scene at one amplitude [rad] and relative tolerance.

    ``integration_error`` is how much the changes moved when the step was last halved, to ``steps`` per period.
    """

    scene: Scene
    amplitude: float
    tolerance: float
    rows: tuple[AuditRow, ...]
    integration_error: float
    steps: int

    @property
    def called_for(self) -> tuple[str, ...]:
        """Names of the effects, present or absent, that the scene calls for."""
        return tuple(row.effect for row in self.rows if row.verdict == CALLED_FOR)

    @property
    def negligible(self) -> tuple[str, ...]:
        """Names of the present effects that may go."""
        return tuple(row.effect for row in self.rows if row.present and row.verdict == NEGLIGIBLE)


@dataclass(frozen=True)
class Simplification:
    """What leaving effects out does over a whole run.

    Attributes:
        audit: the verdicts.
        removed: names of the effects that went.
        duration: of the comparison [s].
        error: largest difference of the angle between the two scenes, relative to the amplitude, by simulation.
        integration_error: share of it that is the integrator's, by halving the step.
        within: True if the error is at most the tolerance.
    """

    audit: Audit
    removed: tuple[str, ...]
    duration: float
    error: float
    integration_error: float
    within: bool

    @property
    def text(self) -> str:
        """The report in a sentence or two."""
        missing = [row.effect for row in self.audit.rows if not row.present and row.verdict == CALLED_FOR]
        warning = f" It still calls for {', '.join(missing)}, which the scene leaves out." if missing else ""
        if not self.removed:
            return f"Every effect of '{self.audit.scene.name}' is called for; nothing was left out.{warning}"
        verdict = "within" if self.within else "NOT within"
        return (
            f"Without {', '.join(self.removed)} the angle is off by at most {self.error:.2g} of the amplitude over "
            f"{self.duration:g} s: {verdict} the tolerance of {self.audit.tolerance:g}.{warning}"
        )


@dataclass(frozen=True)
class _Case:
    """One question: ``scene`` with the effect, ``without`` it, and who answers."""

    effect: str
    present: bool
    scene: Scene
    without: Scene
    control: float = 0.0
    note: str = ""
    always: bool = field(default=False)


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
        raise StudyError(f"tolerance must be above {moved / COARSE:.1g} here, the simulation's own reach, not {limit:g}.")
    tell(0.8, "what each effect costs")
    costs = _costs(cases, size, backend)
    rows = tuple(_row(case, change, cost, size, limit) for case, change, cost in zip(cases, changes, costs, strict=True))
    tell(1.0, "done")
    return Audit(place, size, limit, rows, moved, steps)


def _cases(scene: Scene, weight: str) -> list[_Case]:
    cases = []
    for effect in scene.effects:
        rest = scene.with_effects(e for e in scene.effects if e is not effect)
        other = scene.with_effects(OTHER[weight] if e is effect else e for e in scene.effects)
        if effect.name == "gravity":
            cases.append(_Case(effect.name, True, scene, other, always=True, note=(
                "without it nothing swings; the changes are those against small_angle_gravity in its place")))
        elif effect.name == "small_angle_gravity":
            cases.append(_Case(effect.name, True, scene, scene, always=True, note="without it nothing swings"))
            cases.append(_Case(OTHER[weight].name, False, other, scene))
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
    """By how much a change still moved with the step; nan means the same kind of nothing in both."""
    pairs = [(a, b) for a, b in zip(before[:2], after[:2], strict=True) if not (math.isnan(a) and math.isnan(b))]
    return max((abs(a - b) for a, b in pairs), default=0.0)


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
    notes = "; ".join(text for text in (note, said) if text)
    return AuditRow(case.effect, case.present, period, size, *expected, cost, CALLED_FOR if matters else NEGLIGIBLE, notes)


def _sizes(*values: float) -> list[float]:
    return [abs(value) for value in values if not math.isnan(value)] or [0.0]


def _costs(cases: Sequence[_Case], amplitude: float, backend: Backend) -> list[float]:
    """What each effect adds to a step [ns]: shortest of timings that go round all variants in turn."""
    pairs = []
    for case in cases:
        bare = case.scene.with_effects(e for e in case.scene.effects if e.name != case.effect)
        pairs.append((Machine(case.scene, METHOD, backend=backend), Machine(bare, METHOD, backend=backend)))
    machines = [machine for pair in pairs for machine in pair]
    best = [math.inf] * len(machines)
    for _ in range(TIMINGS):
        for i, machine in enumerate(machines):
            best[i] = min(best[i], _step_time(machine, amplitude))
    return [best[2 * i] - best[2 * i + 1] for i in range(len(pairs))]


def _step_time(machine: Machine, amplitude: float) -> float:
    """Wall time of one step [ns]."""
    state = machine.state(amplitude, 0.0)
    h = 0.01 / (machine.scene.omega0 or 1.0)
    machine.advance(state, machine.parameters, 0.0, h, 0, math.inf)
    begun = time.perf_counter()
    machine.advance(state, machine.parameters, 0.0, h, TIMED_STEPS if machine.compiled else 100, math.inf)
    return 1e9 * (time.perf_counter() - begun) / max(float(state[INDEX]), 1.0)


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
    for h in (2.0 * math.pi / place.omega0 / n for n in STEPS[:2]):
        pair = [rollout(s, integrator=METHOD, angle=found.amplitude, velocity=0.0, dt=h, duration=length, backend=backend)
                for s in (place, plain)]
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
