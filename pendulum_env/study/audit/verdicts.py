"""Results of an audit and of a simplification: dataclasses, the table of verdicts, and its explanation in sentences."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Columns, Result, columns_of, html_of, one_line
from pendulum_env.common.saved import save
from pendulum_env.common.texts import Table
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.scene import Scene
from pendulum_env.study.audit.cases import METHOD, cases

CALLED_FOR, NEGLIGIBLE, OUTSIDE = "matters", "negligible", "outside its validity"
"""Verdicts on effects that were simulated with and without."""
NOT_JUDGED, NOT_SIMULATED = "not judged", "not simulated"
"""Verdicts on effects that could not be simulated in the scene, and on corrections known only as a formula."""
WEAK = 0.1
"""Loss of amplitude in a half swing up to which damping is weak, as textbook formulas assume."""
CHANGES = (
    ("period", "period_change"), ("formula", "period_predicted"), ("amplitude", "amplitude_change"),
    ("formula", "amplitude_predicted"), ("angle", "angle_change"),
)
"""Column headings of the table of verdicts, and the fields of :class:`AuditRow` in these columns."""


@dataclass(frozen=True)
class AuditRow:
    """Audit of one effect: the changes that it causes, its cost and the verdict. Missing numbers are nan.

    Attributes:
        effect: name of the effect.
        present: True if the scene has the effect.
        number_name, number: name and value of the dimensionless number that indicates when the effect matters [1].
        period_change: relative change of the period caused by the effect, by simulation.
        amplitude_change: change of the amplitude in the first half swing over the release angle, by simulation.
        angle_change: largest change of the angle over the release angle, by simulation; given, and decisive, where
            there are no swings to compare.
        period_predicted, amplitude_predicted: the two changes by a textbook's formula.
        ns_per_step: measured time that the effect adds to a step of rk4 [ns].
        verdict: "matters", "negligible", "outside its validity", "not judged" or "not simulated".
        note: remarks on the comparison and the verdict.
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


UNITS = {field.name: "ns" if field.name == "ns_per_step" else "" for field in fields(AuditRow)}
"""Columns of ``effects.csv`` with their units."""


@dataclass(frozen=True, repr=False)
class Audit(Result):
    """Audit of a scene: which effects matter at a release angle and a tolerance.

    Attributes:
        scene: the audited scene.
        amplitude: release angle [rad].
        tolerance: relative change of period or amplitude from which an effect matters.
        rows: one row for each effect: first the effects of the scene, then those that are not in the scene.
        integration_error: largest difference between the relative changes computed at the last step and those
            at twice this step.
        steps: steps per period of the last simulations.
        duration: length of each simulation [s].
    """

    scene: Scene
    amplitude: float
    tolerance: float
    rows: tuple[AuditRow, ...]
    integration_error: float
    steps: int
    duration: float

    def __repr__(self) -> str:
        return one_line(self, f"{self.scene.name}: {len(self.called_for)} of {len(self.rows)} effects matter")

    def origin(self) -> Mapping[str, str]:
        """Return scene, method, release angle and tolerance, with what computed the audit."""
        return provenance(Scene=self.scene.to_dict(), Method=METHOD, Amplitude=self.amplitude, Tolerance=self.tolerance,
                          StepsPerPeriod=self.steps, IntegrationError=self.integration_error)

    def tables(self) -> Mapping[str, Columns]:
        """Return the audit of every effect."""
        return {"effects": columns_of(UNITS, map(astuple, self.rows))}

    @property
    def called_for(self) -> tuple[str, ...]:
        """Names of all effects that matter, whether or not the audited scene contains them."""
        return tuple(row.effect for row in self.rows if row.verdict == CALLED_FOR)

    @property
    def negligible(self) -> tuple[str, ...]:
        """Names of the effects in the audited scene that are negligible and can be left out."""
        return tuple(row.effect for row in self.rows if row.present and row.verdict == NEGLIGIBLE)

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the effects that matter but are not in the audited scene."""
        return tuple(row.effect for row in self.rows if not row.present and row.verdict == CALLED_FOR)

    @property
    def loss(self) -> float:
        """Share of the amplitude that the scene's losses take in a half swing by textbook formulas."""
        losses = {effect.name for effect in self.scene.of_kind("dissipative")}
        return sum(max(0.0, -row.amplitude_predicted) for row in self.rows if row.effect in losses)

    @property
    def table(self) -> Table:
        """Table of the effects: their changes by simulation and by formula, their cost and the verdict.

        Names of effects that are not in the scene are in brackets. Empty columns are left out.
        """
        filled = {name for _, name in CHANGES if any(math.isfinite(getattr(row, name)) for row in self.rows)}
        shown = [(head, name) for head, name in CHANGES if name.replace("predicted", "change") in filled]
        rows = tuple(
            (row.effect if row.present else f"({row.effect})", _number(row.number, ".2g"),
             *(_number(getattr(row, name), ".1e" if name == "angle_change" else "+.1e") for _, name in shown),
             _number(row.ns_per_step, ".1f"), row.verdict)
            for row in self.rows
        )
        return Table(("effect", "number", *(head for head, _ in shown), "ns/step", "verdict"), rows)

    @property
    def text(self) -> str:
        """Sentences that explain the columns of the table, and the note on each effect."""
        by_angle = any(math.isfinite(row.angle_change) for row in self.rows)
        texts = ("Effects in brackets are not in the scene. The columns give the relative changes that an effect "
                 "causes in the mean period and in the amplitude of the first half swing, as simulated and by a "
                 "textbook formula.",
                 f"Where an effect leaves no free swings with a period, the column 'angle' gives the largest change of "
                 f"the angle within {self.duration:.3g} s, divided by the release angle." if by_angle else "",
                 strong_damping(self),
                 "ns/step: measured time that the effect adds to a step of rk4, less terms shared with other effects.")
        notes = [(row, "; ".join(filter(None, (f"number {row.number_name}" if math.isfinite(row.number) else "",
                                               row.note)))) for row in self.rows]
        left = "; ".join(f"{row.effect} ({row.note})" for row in self.rows if row.verdict == NOT_JUDGED)
        return "\n".join([" ".join(filter(None, texts)),
                          *(f"{row.effect}: {note}." for row, note in notes if note and row.verdict != NOT_JUDGED),
                          *([f"Not judged: {left}."] if left else [])])


@dataclass(frozen=True, repr=False)
class Simplification(Result):
    """Result of leaving negligible effects out of a scene, with the error over a run.

    Attributes:
        audit: the verdicts on all effects.
        removed, added: names of the effects removed from the scene, and of those added to it.
        duration: length of the comparison [s].
        error: largest difference of the angle between the scene with and without the removed effects, over the
            amplitude, by simulation.
        integration_error: numerical error in ``error``, estimated by halving the step.
        within: True if the error, its numerical error included, is at most the tolerance.
        change: relative change that the removed effects together cause, measured as for the verdicts: of the period
            (mean of the first three) or of the amplitude (after half a swing), the larger one.
        swings: False if there are fewer than three oscillations or a force depends on time; ``change`` is then the
            largest change of the angle in the audit's runs, over the amplitude.
    """

    audit: Audit
    removed: tuple[str, ...]
    added: tuple[str, ...]
    duration: float
    error: float
    integration_error: float
    within: bool
    change: float = 0.0
    swings: bool = True

    def __repr__(self) -> str:
        return one_line(self, f"{self.audit.scene.name} without {', '.join(self.removed) or 'nothing'}")

    def origin(self) -> Mapping[str, str]:
        """Return the origin of the audit."""
        return self.audit.origin()

    def tables(self) -> Mapping[str, Columns]:
        """Return the audit of every effect."""
        return self.audit.tables()

    @property
    def table(self) -> Table:
        """Table of the effects and their verdicts."""
        return self.audit.table

    @property
    def numbers(self) -> dict[str, Any]:
        """What was left out and added, and the error of that, by the names of the attributes."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name != "audit"}

    def _left_out(self) -> list[str]:
        """Return the effects that matter but are neither in the audited scene nor added by the simplification.

        Alternative models of one phenomenon are joined by "or" into one text, the most detailed first.
        """
        groups: dict[str, list[Effect]] = {}
        for case in cases(self.audit.scene, self.audit.missing):
            if case.effect is not None:
                groups.setdefault(case.effect.models or case.name, []).append(case.effect)
        return [" or ".join(effect.name for effect in sorted(group, key=lambda effect: -effect.detail))
                for group in groups.values() if not any(effect.name in self.added for effect in group)]

    @property
    def text(self) -> str:
        """Report on the simplification in a few sentences: effects removed and added, and what that changes.

        The change of period and amplitude is compared with the tolerance, as in each verdict; the error of the angle
        over a whole run, in which a small change of the period adds up, is given beside it.
        """
        missing = self._left_out()
        rest = f" Effects that matter but are not in the scene: {', '.join(missing)}." if missing else ""
        rest = f" Added: {', '.join(self.added)}.{rest}" if self.added else rest
        if not self.removed:
            return f"No effect of '{self.audit.scene.name}' is negligible; nothing was left out.{rest}"
        limit = f"the tolerance of {self.audit.tolerance:g}"
        what = "period or amplitude changes" if self.swings else f"the angle within {self.audit.duration:.3g} s changes"
        verdict = f"within {limit}" if self.change <= self.audit.tolerance else (
            f"NOT within {limit}: each effect alone is negligible, but not all of them together")
        adds = "" if self.within or not self.swings else "Such changes add up. "
        return (f"Without {', '.join(self.removed)}, {what} by at most {self.change:.2g}: {verdict}. {adds}Over "
                f"{self.duration:g} s the angle is off by at most {self.error:.2g} of the amplitude.{rest}")


class Simplified(NamedTuple):
    """Result of ``simplify``, which unpacks into the scene and the report.

    Attributes:
        scene: the scene without its negligible effects.
        report: the verdicts, and the error that leaving these effects out causes.
    """

    scene: Scene
    report: Simplification

    def __repr__(self) -> str:
        return one_line(self, repr(self.report)[1:-1])

    def _repr_html_(self) -> str:
        """Return the scene's equation and the report as HTML, which notebooks show."""
        return html_of(self)

    def plot(self, kind: str | None = None) -> Any:
        """Draw the report's figure; see :meth:`pendulum_env.common.results.Plotted.plot`."""
        return self.report.plot(kind)

    def save(self, path: str | Path) -> Path:
        """Write the scene and the report as a file; see :meth:`pendulum_env.common.saved.Savable.save`."""
        return save(self, path)


def off_by(audit: Audit, row: AuditRow, name: str) -> float:
    """Return how many times a textbook formula is too large or too small for the change of "period" or "amplitude".

    The result is nan if there is no formula, or if the simulated change is within the integration error.
    """
    change, formula = (abs(getattr(row, f"{name}_{kind}", math.nan)) for kind in ("change", "predicted"))
    if not (change > audit.integration_error and formula > audit.integration_error):
        return math.nan
    return float(max(change / formula, formula / change))


def strong_damping(audit: Audit) -> str:
    """Return a sentence on the textbook formulas for a scene whose damping is too strong for them, else ""."""
    factors = [factor for row in audit.rows for name in ("period", "amplitude")
               if math.isfinite(factor := off_by(audit, row, name))]
    if audit.loss <= WEAK or not factors:
        return ""
    return (f"Textbook formulas assume weak damping, but here they give a loss of {100.0 * audit.loss:.0f} % of the "
            f"amplitude in each half swing; some of them are up to {max(factors):.0f} times too large or too small.")


def _number(value: float, form: str) -> str:
    """Return a number as short text, such as 0 and 1.7e-2, or "-" for nan."""
    if value == 0.0:
        return "0"
    return re.sub(r"e([+-])0", r"e\1", format(value, form)) if math.isfinite(value) else "-"
