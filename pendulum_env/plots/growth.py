"""Figure of the growth of errors with time: angle errors, energy errors, and a list of the methods' growth laws."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pendulum_env.plots.style import distinct, panel
from pendulum_env.plots.titles import for_figure, page, setting, start
from pendulum_env.render.palette import FAINT_INK, HAIRLINE, OKABE_ITO, TRACK
from pendulum_env.study.cost.runs import energy_scale
from pendulum_env.study.growth import Growth, GrowthLine
from pendulum_env.study.growth_laws import LOST, rounding_of

Kind = Literal["angle", "energy"]

SIZE, ENTRY = (15.0, 6.4), 0.54
"""Size of the figure, and height of one method's entry in the legend [inch]."""
FEW = 12
"""Largest number of methods that get colours of their own; for more methods, the colour shows the growth law."""
LAW_COLOURS = {
    "round-off": "#8C8C8C", "bounded": OKABE_ITO["blue"], "linear": OKABE_ITO["bluish_green"],
    "quadratic": OKABE_ITO["orange"], "faster": OKABE_ITO["reddish_purple"], "exponential": OKABE_ITO["vermillion"],
    "decaying": OKABE_ITO["sky_blue"], "lost": OKABE_ITO["vermillion"], "diverged": OKABE_ITO["vermillion"],
    "not known": "#BDBDBD",
}
"""Colour of every growth law."""
LEAST = 1e-17
"""Errors below this are not drawn."""
ALIKE = 1.3
"""Costs within this factor are given as one number in the title, since those of implicit methods vary slightly."""
MOST = 1e3
"""Errors above this many times the size of the motion are not drawn."""
WIDTH = 58
"""Largest number of characters per line in the list of many methods."""


def draw(study: Growth, figure: Figure | None = None) -> Figure:
    """Draw the angle and energy errors of the methods against time, on logarithmic axes, and list every method with its
    growth laws (how errors grow with time).

    Up to 12 (FEW) methods have colours of their own. For more methods, colours show the growth laws, and the names are
    listed by law. ``figure`` is drawn into and resized; by default a new figure.
    """
    few = len(study.lines) <= FEW
    high = max(SIZE[1], 1.7 + ENTRY * len(study.lines) * few)
    shaded = ("Shaded: angle errors below ten times the reference solution's own error, and energy errors below random "
              "rounding errors.")
    with page((SIZE[0], high), figure, _title(study), for_figure(f"{study.text} {shaded}")) as drawing:
        left, right, beside = drawing.subplots(1, 3, width_ratios=(1.0, 1.0, 0.62))
        error_growth(study, "angle", left)
        error_growth(study, "energy", right)
        beside.axis("off")
        (_entries if few else _names)(study, beside)
    return drawing


def error_growth(study: Growth, kind: Kind = "angle", axes: Axes | None = None) -> Axes:
    """Draw the errors of the angle [rad] or of the energy against time [periods], one line per method.

    Guide lines have slopes 1 and 2. The shaded area is below ten times the error of the reference solution, or below
    rounding errors. A dotted line marks the error at which a method has lost the motion; later errors are faint.
    """
    angle = kind == "angle"
    size = study.size if angle else 1.0
    unit = energy_scale(study.scene, (1.0,))[1]
    look = _looks(study, kind)
    values = [line.angle_error if angle else line.energy_error for line in study.lines]
    with panel(axes, (8.0, 6.0)) as at:
        at.set(xscale="log", yscale="log", xlabel="time [periods]", title=kind,
               ylabel="angle error, largest in a period [rad]" if angle else f"|energy residual| / {unit}")
        for line, error in zip(study.lines, values, strict=True):
            shown = np.where((error > LEAST) & (error < MOST * size), error, math.nan)
            followed = study.time <= getattr(line, kind).lost
            at.plot(study.time, np.where(followed, shown, math.nan), label=line.label, **look(line))
            after = study.time >= np.max(study.time[followed], initial=0.0)
            at.plot(study.time[after], shown[after], **{**look(line), "linewidth": 0.7, "alpha": 0.25}, zorder=1.1)
        drawn = np.concatenate([[size], *values])
        drawn = drawn[(drawn > LEAST) & (drawn < MOST * size)]
        low = 10.0 ** math.floor(math.log10(drawn.min()))
        at.set(xlim=(study.time[0], max(study.time[-1], 1.5 * study.time[0])),
               ylim=(low, 10.0 ** math.ceil(math.log10(3.0 * drawn.max()))))
        _guides(at)
        floor = _floor(study, kind)
        at.fill_between(study.time, low, np.maximum(floor, low), color=TRACK, zorder=0.5)
        at.plot(study.time, floor, color=HAIRLINE, linewidth=1.0, zorder=0.6)
        at.axhline(LOST * size, color=FAINT_INK, linewidth=0.9, linestyle=(0, (1, 2)), zorder=1.3)
        at.annotate("lost", (1.0, LOST * size), xycoords=("axes fraction", "data"), xytext=(-4, 3),
                    textcoords="offset points", ha="right", fontsize=9, color=FAINT_INK)
        if angle and study.horizon < study.time[-1]:
            at.axvspan(max(study.horizon, study.time[0]), study.time[-1], color=TRACK, zorder=0.4)
            at.annotate("not known", (0.98, 0.02), xycoords="axes fraction", ha="right", color=FAINT_INK, fontsize=9)
    return at


def _looks(study: Growth, kind: Kind) -> Callable[[GrowthLine], dict[str, Any]]:
    """Return a function that gives the style of a method's error curve: by method or, for many, by growth law."""
    if len(study.lines) > FEW:
        return lambda line: {"color": LAW_COLOURS[getattr(line, kind).kind], "linewidth": 0.9, "alpha": 0.65}
    tones = distinct(line.method for line in study.lines)
    return lambda line: {"color": tones[line.method], "linewidth": 1.9}


def _guides(at: Axes) -> None:
    """Draw faint guide lines of slopes 1 and 2 from the lower left corner, for errors that grow as t and t²."""
    (first, last), (low, high) = at.get_xlim(), at.get_ylim()
    start = (first, 3.0 * low)
    for power, name in ((1, "t"), (2, "t²")):
        end = min(last, first * (0.3 * high / start[1]) ** (1.0 / power))
        top = start[1] * (end / first) ** power
        at.plot([first, end], [start[1], top], color="#B5B5B5", linewidth=1.0, linestyle=(0, (5, 3)), zorder=0.9)
        at.annotate(f"$\\propto$ {name}", (end, top), xytext=(-6, 6 if power > 1 else -14), textcoords="offset points",
                    ha="right", fontsize=9.5, color=FAINT_INK, zorder=0.9)


def _floor(study: Growth, kind: Kind) -> Any:
    """Return the smallest meaningful error of a study of error growth at every time; smaller errors are not reliable.

    For the angle it is set by the error of the reference solution, for the energy by the rounding errors of the run
    with the fewest steps.
    """
    if kind == "angle":
        floors = np.array([line.floor for line in study.lines])
        return np.fmax.reduce(floors) if len(floors) else np.zeros_like(study.time)
    longest = max((line.dt for line in study.lines), default=study.period)
    return rounding_of(study.time * study.period / longest, None)[0]


def _entries(study: Growth, beside: Axes) -> None:
    """Draw the legend of a figure of error growth: every method with the laws by which its errors grow in time."""
    look = _looks(study, "angle")
    entries = [Line2D([], [], label=f"{for_figure(line.label)}\nangle {line.angle.text()}\nenergy {line.energy.text()}",
                      **look(line)) for line in study.lines]
    beside.legend(handles=entries, loc="upper left", bbox_to_anchor=(-0.05, 1.03), fontsize=9, labelspacing=0.7,
                  handlelength=3.2)


def _names(study: Growth, beside: Axes) -> None:
    """Write the legend of a figure of error growth with many methods: their names in groups of equal growth laws of
    angle and energy, the largest group first.
    """
    groups: dict[tuple[str, str], list[str]] = {}
    for line in study.lines:
        groups.setdefault((line.angle.kind, line.energy.kind), []).append(line.method)
    blocks = [(laws, textwrap.wrap(", ".join(names), WIDTH, break_on_hyphens=False))
              for laws, names in sorted(groups.items(), key=lambda group: -len(group[1]))]
    lines = sum(len(text) + 1.7 for _, text in blocks)
    height = min(0.0272, 1.02 / max(lines, 1.0))
    size, y = 8.5 * height / 0.0272, 1.02
    for (angle, energy), text in blocks:
        for x, kind, law in ((-0.02, "angle", angle), (0.46, "energy", energy)):
            beside.text(x, y, f"{kind} {law}", color=LAW_COLOURS[law], fontsize=size + 0.7, fontweight="bold", va="top",
                        transform=beside.transAxes)
        beside.text(-0.02, y - 1.1 * height, for_figure("\n".join(text)), fontsize=size, va="top", linespacing=1.12,
                    transform=beside.transAxes)
        y -= (len(text) + 1.7) * height


def _title(study: Growth) -> str:
    """Return the title of a figure of error growth: scene, start, and the steps or the cost if all methods share them.
    """
    parts = [*setting(study.scene), start(study.angle, study.velocity)]
    costs, steps = [line.evaluations for line in study.lines], {line.dt for line in study.lines}
    if len(steps) == 1:
        parts.append(f"steps of {steps.pop():.3g} s")
    elif costs and max(costs) < ALIKE * min(costs):
        parts.append(f"{float(np.median(costs)):.0f} force evaluations per period")
    return "How errors grow: " + " · ".join(parts)
