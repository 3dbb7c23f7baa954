"""The bar chart of an audit: how much each effect changes period and amplitude, against the tolerance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendulum_env.plots.style import figure, styled
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO
from pendulum_env.study.verdicts import CALLED_FOR, Audit, AuditRow

QUANTITIES = (
    ("period", "relative change of the period", OKABE_ITO["blue"]),
    ("amplitude", "relative change of the amplitude in half a swing", OKABE_ITO["orange"]),
)
"""Attribute of a row, what it is, and its colour."""
BAR = 0.34
FORMULA: dict[str, Any] = {
    "linestyle": "none", "marker": "D", "markersize": 6, "markerfacecolor": "white", "color": INK,
}
"""How a prediction is marked."""
DECADES = 4
"""Changes further below the tolerance are not drawn, but written."""


def draw(found: Audit) -> Figure:
    """Two bars per effect on a logarithmic axis, the tolerance as a line, the textbook's predictions as diamonds."""
    rows = found.rows
    made, (axes,) = figure(size=(10.0, 2.3 + 0.72 * len(rows)))
    with styled():
        left, right = _span(found)
        axes.set_xscale("log")
        axes.set_xlim(left, right)
        for i, row in enumerate(rows):
            for k, (name, _, tone) in enumerate(QUANTITIES):
                _bar(axes, row, name, i + (k - 0.5) * BAR, tone, found.integration_error)
            cost = f"{row.ns_per_step:+.2g} ns per step"
            weight = "bold" if row.verdict == CALLED_FOR else "normal"
            beside: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "va": "center"}
            axes.annotate(row.verdict, (1.02, i - 0.13), weight=weight, **beside)
            axes.annotate(cost, (1.02, i + 0.22), fontsize=9, color=FAINT_INK, **beside)
        limit = axes.axvline(found.tolerance, color=INK, linewidth=1.2, linestyle=(0, (4, 3)))
        limit.set_label(f"tolerance {found.tolerance:g}")
        axes.set_yticks(range(len(rows)), [_label(row) for row in rows])
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.grid(axis="y", visible=False)
        axes.set(xlabel="size of the relative change", title=_title(found))
        bars = [Patch(color=tone, label=text) for _, text, tone in QUANTITIES]
        formula = Line2D([], [], label="textbook formula", **FORMULA)
        made.legend(handles=[*bars, formula, limit], loc="outside lower center", ncols=2, fontsize=9.5)
    return made


def _span(found: Audit) -> tuple[float, float]:
    sizes = [value for row in found.rows for value in _values(row) if value > found.integration_error]
    sizes.append(found.tolerance)
    lowest = max(min(sizes), found.tolerance * 10.0**-DECADES)
    return 10.0 ** (math.floor(math.log10(lowest)) - 1), 10.0 ** math.ceil(math.log10(max(sizes)) + 0.2)


def _values(row: AuditRow) -> Sequence[float]:
    found = (row.period_change, row.amplitude_change, row.period_predicted, row.amplitude_predicted)
    return [abs(value) for value in found if not math.isnan(value)]


def _bar(axes: Axes, row: AuditRow, name: str, y: float, tone: str, own: float) -> None:
    left = axes.get_xlim()[0]
    value, formula = getattr(row, f"{name}_change"), getattr(row, f"{name}_predicted")
    size = abs(value)
    if size > left:
        axes.barh(y, size - left, left=left, height=BAR, color=tone, zorder=2)
    else:
        said = "no swing to compare" if math.isnan(value) else "none" if size <= own else f"{size:.0e}"
        axes.annotate(said, (left, y), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8.5,
                      color=FAINT_INK)
    if abs(formula) > left:
        axes.plot(abs(formula), y, zorder=3, **FORMULA)


def _label(row: AuditRow) -> str:
    remarks = [] if row.present else ["absent"]
    remarks += ["against its linear form"] if row.effect == "gravity" else []
    return f"{row.effect}\n({', '.join(remarks)})" if remarks else row.effect


def _title(found: Audit) -> str:
    return f"Which effects {found.scene.name} calls for, from {math.degrees(found.amplitude):.4g}°"
