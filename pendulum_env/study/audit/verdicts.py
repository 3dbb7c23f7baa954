"""Results of an audit: one row per effect, what leaving effects out does, and both as text."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from pendulum_env.common.tables import Table
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.scene import Scene
from pendulum_env.study.audit.cases import cases

CALLED_FOR, NEGLIGIBLE, OUTSIDE = "called for", "negligible", "outside its validity"
NOT_JUDGED, NOT_SIMULATED = "not judged", "not simulated"
"""For effects that nothing determines, or that contradict the scene; for corrections known by formula alone."""
CHANGES = (
    ("period", "period_change"), ("formula", "period_predicted"), ("amplitude", "amplitude_change"),
    ("formula", "amplitude_predicted"), ("angle", "angle_change"),
)
"""Heads of columns, and where their values are in a row of an audit."""


@dataclass(frozen=True)
class AuditRow:
    """One effect. Numbers are nan where there is none.

    Attributes:
        effect: its name.
        present: False for one that the scene leaves out.
        number_name, number: the dimensionless number that says when it matters [1].
        period_change: relative change of the period that it makes, by simulation.
        amplitude_change: change of the amplitude in the first half swing, relative to the release angle, likewise.
        angle_change: where there are no swings to compare, the largest change of the angle, relative to the release
            angle, likewise; it decides there in place of the other two.
        period_predicted, amplitude_predicted: the textbook's formula.
        ns_per_step: what it adds to a step of rk4 [ns], measured.
        verdict: "called for", "negligible", "outside its validity", "not judged" or "not simulated".
        note: what else is to be said.
    """

    effect: str
    present: bool
    number_name: str = ""
    number: float = math.nan
    period_change: float = math.nan
    amplitude_change: float = math.nan
    angle_change: float = math.nan
    period_predicted: float = math.nan
    amplitude_predicted: float = math.nan
    ns_per_step: float = math.nan
    verdict: str = NOT_JUDGED
    note: str = ""


@dataclass(frozen=True)
class Audit:
    """Which effects a scene calls for.

    Attributes:
        scene: what was judged.
        amplitude: release angle [rad].
        tolerance: of period and amplitude, relative.
        rows: one for each effect, in the order of the scene, then of the registry.
        integration_error: how much the changes moved when the step was last halved, relative.
        steps: per period, after that.
        duration: of each simulation [s].
    """

    scene: Scene
    amplitude: float
    tolerance: float
    rows: tuple[AuditRow, ...]
    integration_error: float
    steps: int
    duration: float

    @property
    def called_for(self) -> tuple[str, ...]:
        """Names of the effects, present or absent, that the scene calls for."""
        return tuple(row.effect for row in self.rows if row.verdict == CALLED_FOR)

    @property
    def negligible(self) -> tuple[str, ...]:
        """Names of the present effects that may go."""
        return tuple(row.effect for row in self.rows if row.present and row.verdict == NEGLIGIBLE)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the absent effects that the scene calls for."""
        return tuple(row.effect for row in self.rows if not row.present and row.verdict == CALLED_FOR)


@dataclass(frozen=True)
class Simplification:
    """What leaving effects out does over a whole run.

    Attributes:
        audit: the verdicts.
        removed, added: names of the effects that went, and of those that came.
        duration: of the comparison [s].
        error: largest difference of the angle between the scene with all that it has and calls for and the one
            without what is negligible, relative to the amplitude, by simulation.
        integration_error: share of it that is the integrator's, by halving the step.
        within: True if the error is at most the tolerance.
    """

    audit: Audit
    removed: tuple[str, ...]
    added: tuple[str, ...]
    duration: float
    error: float
    integration_error: float
    within: bool

    def _left_out(self) -> list[str]:
        """Effects that are called for and still absent, several models of one thing together, the closest first."""
        groups: dict[str, list[Effect]] = {}
        for case in cases(self.audit.scene, self.audit.missing):
            if case.effect is not None:
                groups.setdefault(case.effect.models or case.name, []).append(case.effect)
        return [" or ".join(effect.name for effect in sorted(group, key=lambda effect: -effect.detail))
                for group in groups.values() if not any(effect.name in self.added for effect in group)]

    @property
    def text(self) -> str:
        """The report in a sentence or two."""
        missing = self._left_out()
        said = f" It calls for {', '.join(missing)} too, which the scene leaves out." if missing else ""
        said = f" Added: {', '.join(self.added)}.{said}" if self.added else said
        if not self.removed:
            return f"No effect of '{self.audit.scene.name}' is negligible; nothing was left out.{said}"
        verdict = "within" if self.within else "NOT within"
        return (
            f"Without {', '.join(self.removed)} the angle is off by at most {self.error:.2g} of the amplitude over "
            f"{self.duration:g} s: {verdict} the tolerance of {self.audit.tolerance:g}.{said}"
        )


def verdicts(audit: Audit) -> Table:
    """Each effect: what it changes by simulation and by formula, what it costs, and whether it is called for.

    Those that the scene leaves out stand in brackets. Columns in which nothing would stand are left out.
    """
    found = {name for _, name in CHANGES if any(math.isfinite(getattr(row, name)) for row in audit.rows)}
    shown = [(head, name) for head, name in CHANGES if name.replace("predicted", "change") in found]
    rows = tuple(
        (row.effect if row.present else f"({row.effect})", _number(row.number, ".2g"),
         *(_number(getattr(row, name), ".1e" if name == "angle_change" else "+.1e") for _, name in shown),
         _number(row.ns_per_step, ".1f"), row.verdict)
        for row in audit.rows
    )
    return Table(("effect", "number", *(head for head, _ in shown), "ns/step", "verdict"), rows)


def remarks(audit: Audit) -> str:
    """What the columns are, the effects' numbers, and what else is to be said of them."""
    texts = ["In brackets: not in the scene. Changes are relative: of the mean period, and of the amplitude in the "
             "first half swing, as simulated and by the textbook's formula."]
    if any(math.isfinite(row.angle_change) for row in audit.rows):
        texts.append(f"Where there are no free swings to compare, the largest change of the angle in "
                     f"{audit.duration:.3g} s stands under 'angle', over the release angle.")
    texts.append("ns/step is what it adds to a step of rk4, as measured here; what others need too costs it nothing.")
    lines = [" ".join(texts)]
    for row in audit.rows:
        number = f"number {row.number_name}" if math.isfinite(row.number) else ""
        said = "; ".join(text for text in (number, row.note) if text)
        if said and row.verdict != NOT_JUDGED:
            lines.append(f"{row.effect}: {said}.")
    left = [f"{row.effect} ({row.note})" for row in audit.rows if row.verdict == NOT_JUDGED]
    if left:
        lines.append(f"Not judged: {'; '.join(left)}.")
    return "\n".join(lines)


def _number(value: float, form: str) -> str:
    """As short as can be: 0, and 1.7e-2 for 1.7e-02."""
    if value == 0.0:
        return "0"
    return re.sub(r"e([+-])0", r"e\1", format(value, form)) if math.isfinite(value) else "-"
