"""The bar chart of an audit: how much each effect changes the motion, against the tolerance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import ScaledTranslation

from pendulum_env.plots.style import blank, styled
from pendulum_env.plots.titles import fitted, start
from pendulum_env.render.palette import FAINT_INK, HAIRLINE, INK, OKABE_ITO
from pendulum_env.study.audit.swing import METHOD
from pendulum_env.study.audit.verdicts import CALLED_FOR, NOT_JUDGED, Audit, AuditRow

QUANTITIES = (
    ("period", "of the period", OKABE_ITO["blue"]),
    ("amplitude", "of the amplitude in half a swing", OKABE_ITO["orange"]),
    ("angle", "of the angle, where nothing swings freely", OKABE_ITO["bluish_green"]),
)
"""Attribute of a row, what it is a relative change of, and its colour."""
BAR = 0.36
FADED = 0.62
"""How far towards white the colours go of what is not called for."""
FORMULA: dict[str, Any] = {
    "linestyle": "none", "marker": "D", "markersize": 5.5, "markerfacecolor": "white", "color": INK,
}
"""How a prediction is marked."""
DECADES = 4
"""Changes further below the tolerance are not drawn, but written."""
WIDE, ROW, FRAME, LINE, BELOW = 10.0, 0.46, 2.3, 0.2, 0.55
"""Width of the figure, height of a row, of all around the rows, and of a line of text below, which begins so far below
the axes [inch]."""
NOTE = 480.0
"""Width of the note below [points]."""


def draw(found: Audit, figure: Figure | None = None) -> Figure:
    """The :func:`changes` as a figure of their own; ``figure``: to draw into, which gets the size that this takes."""
    rows = sum(row.verdict != NOT_JUDGED for row in found.rows)
    made = blank((WIDE, FRAME + ROW * rows + LINE * len(_left_out(found).splitlines())), figure)
    with styled():
        changes(found, made.subplots())
    return made


def changes(found: Audit, axes: Axes | None = None) -> Axes:
    """A bar for each change of each effect that was judged, on a logarithmic axis; what is not called for is pale.

    The tolerance is a line, the textbook's predictions are diamonds; what was not judged is named below.
    """
    if axes is None:
        return draw(found).axes[0]
    rows, said = [row for row in found.rows if row.verdict != NOT_JUDGED], _left_out(found)
    with styled():
        low, high = _span(found)
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        for i, row in enumerate(rows):
            _bars(axes, row, i, found.integration_error)
            bold = row.verdict == CALLED_FOR
            cost = f", {row.ns_per_step:+.1f} ns" if row.ns_per_step else ", no cost"
            cost = cost if math.isfinite(row.ns_per_step) else ""
            axes.annotate(f"{row.verdict}{cost}", (1.015, i), xycoords=("axes fraction", "data"), va="center",
                          fontsize=10, weight="bold" if bold else "normal", color=INK if bold else FAINT_INK)
        limit = axes.axvline(found.tolerance, color=INK, linewidth=1.2, linestyle=(0, (4, 3)))
        limit.set_label(f"tolerance {found.tolerance:g}")
        axes.set_yticks(range(len(rows)), [row.effect if row.present else f"({row.effect})" for row in rows])
        for label, row in zip(axes.get_yticklabels(), rows, strict=True):
            label.set_color(INK if row.present else FAINT_INK)
        here = sum(row.present for row in rows)
        if here < len(rows):
            axes.axhline(here - 0.5, color=HAIRLINE, linewidth=1.0)
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.grid(axis="y", visible=False)
        axes.set(xlabel="size of the relative change", title=_title(found))
        bars: list[Any] = [Patch(color=tone, label=text) for name, text, tone in QUANTITIES
                           if any(math.isfinite(getattr(row, f"{name}_change")) for row in rows)]
        if any(math.isfinite(_predicted(row, name)) for row in rows for name, _, _ in QUANTITIES):
            bars.append(Line2D([], [], label="textbook formula", **FORMULA))
        below = axes.transAxes + ScaledTranslation(0.0, -BELOW, axes.figure.dpi_scale_trans)
        key = axes.legend(handles=[*bars, limit], loc="upper left", bbox_to_anchor=(0.0, 0.0), bbox_transform=below,
                          ncols=2, fontsize=9.5, title=said or None, title_fontsize=9.5, alignment="left",
                          borderpad=0.0, borderaxespad=0.0)
        key.get_title().set_color(FAINT_INK)
    return axes


def _left_out(found: Audit) -> str:
    """The effects that were not judged, in lines."""
    left = ", ".join(row.effect for row in found.rows if row.verdict == NOT_JUDGED)
    return fitted(f"Not judged, for want of numbers or a medium: {left}.", 9.5, NOTE) if left else ""


def _span(found: Audit) -> tuple[float, float]:
    sizes = [value for row in found.rows for value in _values(row) if value > found.integration_error]
    sizes.append(found.tolerance)
    lowest = max(min(sizes), found.tolerance * 10.0**-DECADES)
    return 10.0 ** (math.floor(math.log10(lowest)) - 1), 10.0 ** math.ceil(math.log10(max(sizes)) + 0.2)


def _values(row: AuditRow) -> Sequence[float]:
    found = (row.period_change, row.amplitude_change, row.angle_change, row.period_predicted, row.amplitude_predicted)
    return [abs(value) for value in found if math.isfinite(value)]


def _bars(axes: Axes, row: AuditRow, place: float, own: float) -> None:
    """The bars of one effect, side by side, and its predictions on them."""
    left = axes.get_xlim()[0]
    shown = [(name, tone) for name, _, tone in QUANTITIES if math.isfinite(getattr(row, f"{name}_change"))]
    shown = shown or [(name, tone) for name, _, tone in QUANTITIES[:2] if math.isfinite(_predicted(row, name))]
    if not shown:
        _write(axes, "no number to compare with", place)
    for k, (name, tone) in enumerate(shown):
        y = place + (k - 0.5 * (len(shown) - 1)) * BAR
        size, formula = abs(getattr(row, f"{name}_change")), abs(_predicted(row, name))
        if size > left:
            axes.barh(y, size - left, left=left, height=BAR, zorder=2,
                      color=tone if row.verdict == CALLED_FOR else _faded(tone))
        elif math.isfinite(size):
            _write(axes, "none" if size <= own else f"{size:.0e}", y)
        if formula > left:
            axes.plot(formula, y, zorder=3, **FORMULA)


def _predicted(row: AuditRow, name: str) -> float:
    return float(getattr(row, f"{name}_predicted", math.nan))


def _write(axes: Axes, text: str, y: float) -> None:
    axes.annotate(text, (axes.get_xlim()[0], y), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8,
                  color=FAINT_INK)


def _faded(tone: str) -> tuple[float, float, float]:
    red, green, blue = (value + FADED * (1.0 - value) for value in to_rgb(tone))
    return red, green, blue


def _title(found: Audit) -> str:
    return (f"Which effects {found.scene.name} calls for, {start(found.amplitude)} · {METHOD}, {found.steps} steps a "
            "period")
