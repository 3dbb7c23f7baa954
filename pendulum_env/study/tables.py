"""What studies found, as tables of text."""

from __future__ import annotations

import math

from pendulum_env.catalogue import Table
from pendulum_env.study.audit import Audit
from pendulum_env.study.cost_points import CostStudy
from pendulum_env.study.reference import StudyError

ACCURACIES = tuple(10.0**-k for k in range(1, 13))


def recommendations(study: CostStudy) -> Table:
    """For each accuracy that was reached, the cheapest method and step, and its cost per simulated second."""
    rows = []
    for accuracy in ACCURACIES:
        try:
            best = study.best(accuracy)
        except StudyError:
            break
        step, error, price = f"{best.dt:.3g}", f"{best.angle_error:.1e}", f"{best.ns_per_second:,.0f}"
        rows.append((f"{accuracy:.0e}", best.method, step, error, price))
    head = ("angle error below [rad]", "cheapest method", "step [s]", "its error [rad]", "ns per simulated second")
    return Table(head, tuple(rows))


def verdicts(audit: Audit) -> Table:
    """Each effect: what it changes by simulation and by formula, what it costs, and whether it is called for."""
    angles = any(math.isfinite(row.angle_change) for row in audit.rows)
    head = ("effect", "in it", "number", "period", "formula", "amplitude", "formula", *["angle"] * angles, "ns/step",
            "verdict")
    rows = []
    for row in audit.rows:
        number = f"{row.number_name} {row.number:.2g}" if math.isfinite(row.number) else row.number_name
        changes = [row.period_change, row.period_predicted, row.amplitude_change, row.amplitude_predicted]
        changes += [row.angle_change] * angles
        rows.append((row.effect, "yes" if row.present else "no", number, *map(_change, changes),
                     _number(row.ns_per_step, ".1f"), row.verdict))
    return Table(head, tuple(rows))


def remarks(audit: Audit) -> str:
    """What else is to be said of the effects, a line each."""
    return "\n".join(f"{row.effect}: {row.note}." for row in audit.rows if row.note)


def _change(value: float) -> str:
    return _number(value, "+.1e")


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"
