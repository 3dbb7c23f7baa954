"""Bar chart of an audit, a study of effects: changes of the motion due to every effect, against a tolerance."""

from __future__ import annotations

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import ScaledTranslation

from pendulum_env.plots.style import styled
from pendulum_env.plots.titles import fitted, for_figure, page, start
from pendulum_env.render.palette import FAINT_INK, HAIRLINE, INK, OKABE_ITO
from pendulum_env.study.audit.cases import METHOD
from pendulum_env.study.audit.verdicts import CALLED_FOR, NOT_JUDGED, Audit, AuditRow, off_by, strong_damping

QUANTITIES = (
    ("period", "of the period", OKABE_ITO["blue"]),
    ("amplitude", "of the amplitude in half a swing", OKABE_ITO["orange"]),
    ("angle", "of the angle, where nothing swings freely", OKABE_ITO["bluish_green"]),
)
"""Quantities that effects change: prefix of the row's attributes, text for the legend, colour of the bars."""
BAR = 0.36
"""Thickness of a bar [rows]."""
FADED = 0.62
"""Share of white mixed into the colours of effects that do not matter."""
FORMULA: dict[str, Any] = {
    "linestyle": "none", "marker": "D", "markersize": 5.5, "markerfacecolor": "white", "color": INK,
}
"""Marker style of textbook predictions."""
FAR: dict[str, Any] = {**FORMULA, "color": "#A8A8A8"}
"""Marker style of textbook predictions that are too large or too small by more than the factor OFF."""
OFF = 2.0
DECADES = 4
"""Changes more than this many powers of ten below the tolerance are written as numbers instead of drawn."""
WIDE, ROW, FRAME, LINE, BELOW = 10.0, 0.46, 2.3, 0.2, 0.55
"""Width of the figure, height of a row, height of everything around the rows, height of a line of text below, and the
distance of this text from the axes [inch]."""
NOTE = 480.0
"""Width of the note below the bars [points]."""


def draw(audit: Audit, figure: Figure | None = None) -> Figure:
    """Draw the bar chart of an audit, the changes due to every effect, in a new or a given figure of suitable size."""
    rows = sum(row.verdict != NOT_JUDGED for row in audit.rows)
    with page((WIDE, FRAME + ROW * rows + LINE * len(_note(audit).splitlines())), figure) as drawing:
        changes(audit, drawing.subplots())
    return drawing


@styled()
def changes(audit: Audit, axes: Axes | None = None) -> Axes:
    """Draw bars for the changes of the motion due to every effect, on a logarithmic axis; pale if they do not matter.

    A line marks the tolerance and diamonds mark textbook predictions, pale ones where these are more than a factor of 2
    (OFF) off; if the damping is too strong for textbook formulas, a sentence below the axis says so. Effects that the
    audit could not judge are named there, too.
    """
    if axes is None:
        return draw(audit).axes[0]
    rows, note = [row for row in audit.rows if row.verdict != NOT_JUDGED], _note(audit)
    axes.set(xscale="log", xlim=_span(audit))
    for i, row in enumerate(rows):
        _bars(axes, row, i, audit)
        bold = row.verdict == CALLED_FOR
        cost = "" if math.isnan(row.ns_per_step) else (
            f", {row.ns_per_step:+.1f} ns" if row.ns_per_step else ", no cost")
        axes.annotate(f"{row.verdict}{cost}", (1.015, i), xycoords=("axes fraction", "data"), va="center",
                      fontsize=10, weight="bold" if bold else "normal", color=INK if bold else FAINT_INK)
    limit = axes.axvline(audit.tolerance, color=INK, linewidth=1.2, linestyle=(0, (4, 3)),
                         label=f"tolerance {audit.tolerance:g}")
    names = [row.effect if row.present else f"({row.effect})" for row in rows]
    axes.set_yticks(range(len(rows)), list(map(for_figure, names)))
    for label, row in zip(axes.get_yticklabels(), rows, strict=True):
        label.set_color(INK if row.present else FAINT_INK)
    here = sum(row.present for row in rows)
    if here < len(rows):
        axes.axhline(here - 0.5, color=HAIRLINE, linewidth=1.0)
    axes.grid(axis="y", visible=False)
    axes.set(ylim=(len(rows) - 0.4, -0.6), xlabel="size of the relative change",
             title=f"Effects that matter for {for_figure(audit.scene.name)}, {start(audit.amplitude)} · {METHOD}, "
                   f"{audit.steps} steps per period")
    bars: list[Any] = [Patch(color=tone, label=text) for name, text, tone in QUANTITIES
                       if any(math.isfinite(getattr(row, f"{name}_change")) for row in rows)]
    if any(math.isfinite(_predicted(row, name)) for row in rows for name, _, _ in QUANTITIES):
        bars.append(Line2D([], [], label="textbook formula", **FORMULA))
    if any(off_by(audit, row, name) > OFF for row in rows for name, _, _ in QUANTITIES):
        bars.append(Line2D([], [], label=f"textbook formula, off by more than a factor of {OFF:g}", **FAR))
    below = axes.transAxes + ScaledTranslation(0.0, -BELOW, axes.figure.dpi_scale_trans)
    key = axes.legend(handles=[*bars, limit], loc="upper left", bbox_to_anchor=(0.0, 0.0), bbox_transform=below,
                      ncols=2, fontsize=9.5, title=note or None, title_fontsize=9.5, alignment="left",
                      borderpad=0.0, borderaxespad=0.0)
    key.get_title().set_color(FAINT_INK)
    return axes


def _note(audit: Audit) -> str:
    """Return the note below an audit's chart, broken into lines: on textbook formulas, and on effects not judged."""
    left = ", ".join(row.effect for row in audit.rows if row.verdict == NOT_JUDGED)
    unjudged = f"Effects not judged, because parameters or a medium are missing: {left}." if left else ""
    return "\n".join(fitted(text, 9.5, NOTE) for text in (strong_damping(audit), unjudged) if text)


def _span(audit: Audit) -> tuple[float, float]:
    """Return the limits of the logarithmic axis of an audit's chart, from the sizes of the changes and the tolerance.
    """
    values = [abs(value) for row in audit.rows for value in (
        row.period_change, row.amplitude_change, row.angle_change, row.period_predicted, row.amplitude_predicted)]
    sizes = [audit.tolerance, *(value for value in values if math.inf > value > audit.integration_error)]
    lowest = max(min(sizes), audit.tolerance * 10.0**-DECADES)
    return 10.0 ** (math.floor(math.log10(lowest)) - 1), 10.0 ** math.ceil(math.log10(max(sizes)) + 0.2)


def _bars(axes: Axes, row: AuditRow, place: float, audit: Audit) -> None:
    """Draw the bars of one effect of an audit side by side at the height ``place``, with the textbook's predictions.

    A change below the audit's integration error is written as "none".
    """
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
            _write(axes, "none" if size <= audit.integration_error else f"{size:.0e}", y)
        if formula > left:
            axes.plot(formula, y, zorder=3, **(FAR if off_by(audit, row, name) > OFF else FORMULA))


def _predicted(row: AuditRow, name: str) -> float:
    """Return the textbook prediction of an effect's change of "period", "amplitude" or "angle"; nan if there is none.
    """
    return float(getattr(row, f"{name}_predicted", math.nan))


def _write(axes: Axes, text: str, y: float) -> None:
    """Write a text at height ``y`` of an audit's chart, in place of a bar that is missing or too short to see."""
    axes.annotate(text, (axes.get_xlim()[0], y), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8,
                  color=FAINT_INK)


def _faded(tone: str) -> tuple[float, ...]:
    """Return a paler shade of a colour, mixed with white, as red, green and blue from 0 to 1."""
    return tuple(value + FADED * (1.0 - value) for value in to_rgb(tone))
