"""The bar chart of an audit: how much each effect changes period and amplitude, against the tolerance."""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendulum_env.plots.style import figure, styled
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO
from pendulum_env.study.audit import CALLED_FOR, Audit, AuditRow

QUANTITIES = (
    ("period", "relative change of the period", OKABE_ITO["blue"]),
    ("amplitude", "relative change of the amplitude in half a swing", OKABE_ITO["orange"]),
)
"""Attribute of a row, what it is, and its colour."""
BAR = 0.34
DECADES = 8
"""Changes further below the tolerance are drawn as nothing."""


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
                _bar(axes, row, name, i + (k - 0.5) * BAR, tone, left)
            cost = f"{row.ns_per_step:+.2g} ns per step"
            weight = "bold" if row.verdict == CALLED_FOR else "normal"
            axes.annotate(row.verdict, (1.02, i - 0.13), xycoords=("axes fraction", "data"), va="center", weight=weight)
            axes.annotate(cost, (1.02, i + 0.22), xycoords=("axes fraction", "data"), va="center", fontsize=9, color=FAINT_INK)
        axes.axvline(found.tolerance, color=INK, linewidth=1.2, linestyle=(0, (4, 3)))
        axes.set_yticks(range(len(rows)), [_label(row) for row in rows])
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.grid(axis="y", visible=False)
        axes.set(xlabel="size of the relative change", title=_title(found))
        keys = [Patch(color=tone, label=text) for _, text, tone in QUANTITIES]
        keys.append(Line2D([], [], linestyle="none", marker="D", markersize=6, markerfacecolor="white", color=INK,
                           label="textbook formula"))
        keys.append(Line2D([], [], color=INK, linewidth=1.2, linestyle=(0, (4, 3)), label=f"tolerance {found.tolerance:g}"))
        made.legend(handles=keys, loc="outside lower center", ncols=2, fontsize=9.5)
    return made


def _span(found: Audit) -> tuple[float, float]:
    sizes = [value for row in found.rows for value in _values(row) if value > 0.0] + [found.tolerance]
    lowest = max(min(sizes), found.tolerance * 10.0**-DECADES, found.integration_error)
    return 10.0 ** (math.floor(math.log10(lowest)) - 1), 10.0 ** math.ceil(math.log10(max(sizes)) + 0.2)


def _values(row: AuditRow) -> Sequence[float]:
    found = (row.period_change, row.amplitude_change, row.period_predicted, row.amplitude_predicted)
    return [abs(value) for value in found if not math.isnan(value)]


def _bar(axes: Axes, row: AuditRow, name: str, y: float, tone: str, left: float) -> None:
    value, formula = getattr(row, f"{name}_change"), getattr(row, f"{name}_predicted")
    size = abs(value)
    if size > left:
        axes.barh(y, size - left, left=left, height=BAR, color=tone, zorder=2)
    else:
        said = "no swing to compare" if math.isnan(value) else "none" if size == 0.0 else f"{size:.0e}"
        axes.annotate(said, (left, y), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8.5, color=FAINT_INK)
    if abs(formula) > left:
        axes.plot(abs(formula), y, marker="D", markersize=6, markerfacecolor="white", color=INK, zorder=3, linestyle="none")


def _label(row: AuditRow) -> str:
    return row.effect if row.present else f"{row.effect}\n(absent)"


def _title(found: Audit) -> str:
    return f"Which effects {found.scene.name} calls for, from {math.degrees(found.amplitude):.4g}°"
