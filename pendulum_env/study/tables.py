"""What studies found, as tables of text."""

from __future__ import annotations

import math
import re

from pendulum_env.common.tables import Table
from pendulum_env.study.audit.study import Audit
from pendulum_env.study.audit.verdicts import NOT_JUDGED
from pendulum_env.study.cost.points import CostStudy
from pendulum_env.truth.reference import StudyError

ACCURACIES = tuple(10.0**-k for k in range(1, 13))


def recommendations(study: CostStudy) -> Table:
    """For each accuracy that was reached, the cheapest method with its step or tolerance, and what it costs."""
    rows = []
    for accuracy in ACCURACIES:
        try:
            best = study.best(accuracy)
        except StudyError:
            break
        error, price = f"{best.angle_error:.1e}", f"{best.ns_per_second:,.0f}"
        rows.append((f"{accuracy:.0e}", best.method, best.setting, error, price))
    head = ("angle error below [rad]", "cheapest method", "with", "its error [rad]", "ns per simulated second")
    return Table(head, tuple(rows))


CHANGES = (
    ("period", "period_change"), ("formula", "period_predicted"), ("amplitude", "amplitude_change"),
    ("formula", "amplitude_predicted"), ("angle", "angle_change"),
)
"""Heads of columns, and where their values are in a row of an audit."""


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
