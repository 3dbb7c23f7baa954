"""Work-precision diagrams of a cost study of many methods: error against time and against force evaluations."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

import integrators
from pendulum_env.plots.style import decades, distinct, panel
from pendulum_env.plots.titles import for_figure, page, setting, start
from pendulum_env.render.palette import FAINT_INK, HAIRLINE, INK, TRACK
from pendulum_env.study import PLAIN
from pendulum_env.study.cost.points import FLOOR, CostPoint, CostStudy, short
from pendulum_env.truth.reference import ROUNDING

SIZE, WIDER = (14.0, 6.6), 5.0
"""Size of the figure with two panels, and width of one panel in a figure of the errors [inch]."""
FEW = 12
"""Largest number of methods whose lines all have colours; of more methods, this many lines, and the others are grey."""
ENTRIES = 16
"""Largest number of entries in one column of the legend; more entries are in two columns."""
MARKERS = "osD^vP<>Xph*"
"""Markers of the lines, in order, so that lines differ not only by colour."""
DASHED = (0, (4.5, 1.5))
"""Dash pattern of lines with adapted steps."""
BEHIND: dict[str, Any] = {"color": "#B9B9B9", "linewidth": 0.7, "alpha": 0.6, "zorder": 1.2}
"""Style of the grey lines behind the coloured ones."""
KNOWN: dict[str, Any] = {"linewidth": 1.6, "zorder": 2.2}
HOLLOW: dict[str, Any] = {"alpha": 0.7, "zorder": 2.1, "linestyle": "none", "markerfacecolor": "white"}
"""Style of the markers of errors too close to the reference solution's own error, which are not joined."""
FRONT: dict[str, Any] = {"color": INK, "alpha": 0.15, "linewidth": 11, "solid_joinstyle": "round",
                         "label": "Pareto front"}
"""Style of the broad band along the Pareto front, the least error for every wall time."""

WORK: dict[str, tuple[str, str, Callable[[CostStudy, CostPoint], float]]] = {
    "time": ("wall time per simulated second [s]", "against time", lambda study, p: p.ns_per_second * 1e-9),
    "evaluations": ("force evaluations per simulated second", "against force evaluations",
                    lambda study, p: p.evaluations / study.duration),
}
"""Quantities of the horizontal axis: label, title, and function that returns the value."""
ERRORS = {
    "angle_error": ("largest angle error [rad]", "angle"),
    "phase_error": ("largest phase error [rad]", "phase: along the motion"),
    "energy_error": ("largest relative energy error", "energy"),
}
"""Errors of the vertical axis: label and title."""


def draw(study: CostStudy, figure: Figure | None = None) -> Figure:
    """Draw the angle error of the methods in a cost study against wall time, with the Pareto front, and against force
    evaluations, with logarithmic axes.

    Runs that ended early are left out. Markers are hollow for errors that are not known, because they are too close to
    the reference solution's own error; this area is shaded. The legend gives the measured order of every line. Of more
    than 12 (FEW) methods, only the lines of :func:`leading` have colours. ``figure`` is drawn into and resized; by
    default a new figure.
    """
    with page(SIZE, figure, _title(study), _note(study)) as drawing:
        for axes, work in zip(drawing.subplots(1, 2, squeeze=False)[0], WORK, strict=True):
            work_precision(study, work, axes=axes)
        _legend(drawing, study)
    return drawing


def draw_errors(study: CostStudy, figure: Figure | None = None) -> Figure:
    """Draw the errors of angle, phase and energy in a cost study against wall time, side by side. An error that is 0
    for all methods is left out.

    The style and ``figure`` are as for :func:`draw`.
    """
    there = [error for error in ERRORS if any(getattr(p, error) > 0.0 for p in study.points)] or ["angle_error"]
    with page((3.4 + WIDER * len(there), SIZE[1]), figure, _title(study), _note(study)) as drawing:
        for axes, error in zip(drawing.subplots(1, len(there), squeeze=False)[0], there, strict=True):
            work_precision(study, "time", error, axes)
            axes.set_title(ERRORS[error][1])
        _legend(drawing, study)
    return drawing


def work_precision(
    study: CostStudy, work: str = "time", error: str = "angle_error", axes: Axes | None = None
) -> Axes:
    """Draw one error of a cost study against one kind of work. ``work`` is "time" or "evaluations"; ``error`` is
    "angle_error", "phase_error" or "energy_error".
    """
    label, title, value = WORK[work]
    looks, front = _looks(study), study.front
    with panel(axes, (8.0, 6.6)) as at:
        for name in study.series:
            points = [p for p in study.of(name) if getattr(p, error) > 0.0 and value(study, p) > 0.0]
            for hollow in (False, True):
                some = [p for p in points if (p.floor and error != "energy_error") is hollow]
                xy = [value(study, p) for p in some], [getattr(p, error) for p in some]
                if name in looks:
                    at.plot(*xy, markersize=5, **{**looks[name], **(HOLLOW if hollow else KNOWN)})
                elif not hollow:
                    at.plot(*xy, **BEHIND)
        if (work, error) == ("time", "angle_error"):
            at.plot([value(study, p) for p in front], [study.known_error(p) for p in front], zorder=1.6, **FRONT)
        at.set(xscale="log", yscale="log", xlabel=label, ylabel=ERRORS[error][0], title=title)
        at.margins(x=0.04)
        at.set_xlim(*decades(*at.get_xlim()))
        for axis in (at.xaxis, at.yaxis):
            axis.set_minor_formatter(NullFormatter())
        _floors(at, study, error)
    return at


def leading(study: CostStudy) -> tuple[str, ...]:
    """Return the names of the lines of a cost study that are drawn in colour.

    For up to 12 (FEW) methods these are all lines. Otherwise they are those of the basic methods in PLAIN, and the
    lines with the largest parts of the Pareto front.
    """
    if len(study.methods) <= FEW:
        return study.series
    held: dict[str, float] = {}
    above = float(np.max(np.abs(study.reference.angle)))
    for point in study.front:
        held[point.series] = held.get(point.series, 0.0) + math.log(above / study.known_error(point))
        above = study.known_error(point)
    first = [name for name in study.series if name in PLAIN]
    best = [name for name in sorted(held, key=lambda name: -held[name]) if name not in first]
    chosen = {*first, *best[: FEW - len(first)]}
    return tuple(name for name in study.series if name in chosen)


def _looks(study: CostStudy) -> dict[str, dict[str, Any]]:
    """Return the styles of a cost study's coloured lines: colour by method, marker by line, dashes for adapted steps.
    """
    names = leading(study)
    methods = {point.series: point.method for point in study.points}
    tones = distinct(methods[name] for name in names)
    return {name: {"color": tones[methods[name]], "marker": MARKERS[i % len(MARKERS)],
                   "linestyle": "-" if name == methods[name] else DASHED} for i, name in enumerate(names)}


def _floors(axes: Axes, study: CostStudy, error: str) -> None:
    """Set the limits of the error axis of a work-precision diagram. Errors that the reference solution cannot resolve
    are shaded, and its own error and the rounding error are marked.
    """
    sizes = [getattr(p, error) for p in study.points if getattr(p, error) > 0.0]
    energy = error == "energy_error"
    largest = 1.0 if energy else float(np.max(np.abs(study.reference.angle)))
    own = study.reference.error_estimate
    rounding = ROUNDING * (1.0 if energy else 4.0 + study.scene.omega0 * study.duration)
    low = min([0.5 * rounding, *([] if energy else [own]), *sizes])
    high = max(10.0 * largest, min(2.0 * max(sizes, default=0.0), 1e3 * largest))
    axes.set_ylim(10.0 ** math.floor(math.log10(low)), high)
    marks = [(rounding, "round-off")]
    if not energy:
        axes.axhspan(axes.get_ylim()[0], FLOOR * own, color=TRACK, zorder=0.5)
        axes.axhline(FLOOR * own, color=HAIRLINE, linewidth=1.0, zorder=0.6)
        near = 0.3 < own / rounding < 3.0
        marks = [(own, "reference's own error, round-off")] if near else [*marks, (own, "reference's own error")]
    for level, name in marks:
        axes.axhline(level, color=FAINT_INK, linewidth=0.9, linestyle=(0, (1, 2)), zorder=0.7)
        axes.annotate(name, (0.0, level), xycoords=("axes fraction", "data"), xytext=(4, 2),
                      textcoords="offset points", fontsize=8.5, color=FAINT_INK, zorder=0.8)


def _legend(drawing: Figure, study: CostStudy) -> None:
    """Add the legend at the right of a figure of work-precision diagrams."""
    entries = [Line2D([], [], linewidth=1.6, markersize=6, label=_label(study, name), **look)
               for name, look in _looks(study).items()]
    entries.append(Line2D([], [], **FRONT))
    if len(study.series) > len(entries) - 1:
        entries.append(Line2D([], [], **{**BEHIND, "linewidth": 1.4}, label="all others"))
    if any(point.floor for point in study.points):
        entries.append(Line2D([], [], color=FAINT_INK, linestyle="none", marker="o", markerfacecolor="white",
                              label="too close to the reference's error"))
    drawing.legend(handles=entries, loc="outside right upper", fontsize=9.5, handlelength=3.2, labelspacing=0.6,
                   ncols=1 + (len(entries) > ENTRIES))


def _label(study: CostStudy, name: str) -> str:
    """Return a legend entry of a work-precision diagram: a line's name, its method's order and the measured order."""
    slope = study.slope(name)
    methods = {integrators.METHODS.get(point.method) for point in study.points if point.series == name}
    orders = [f"order {method.order}" for method in methods if method is not None and math.isfinite(method.order)]
    orders += [f"measured {slope:.2f}"] if math.isfinite(slope) else []
    return f"{for_figure(name)}\n({', '.join(orders)})" if orders else for_figure(name)


def _note(study: CostStudy) -> str:
    """Return the note below work-precision diagrams: reference solution, shaded area, timing, methods not in colour."""
    rest = [name for name in dict.fromkeys(point.series for point in study.front) if name not in leading(study)]
    timings = {len(point.times) for point in study.points if point.times} or {study.repeats}
    sentences = {
        f"Reference solution: {study.reference.how}. Shaded: errors below {FLOOR:g} times its own error, "
        f"{study.reference.error_estimate:.1g} rad. Times: the shortest of "
        f"{' to '.join(map(str, sorted({min(timings), max(timings)})))} timings, without compilation.": True,
        f"Also on the Pareto front: {', '.join(map(short, rest))}.": bool(rest),
        "Methods that use a series or a closed form have no force evaluations to count.": any(
            not math.isfinite(p.evaluations) and not p.stop_reason for p in study.points),
        "Force evaluations for locating turning points are not counted.": any(
            effect.dry for effect in study.scene.effects),
    }
    return for_figure(" ".join(sentence for sentence, holds in sentences.items() if holds))


def _title(study: CostStudy) -> str:
    """Return the title of a figure of work-precision diagrams: scene, start and duration of the runs."""
    ended = [] if study.complete else ["interrupted: not all runs are shown"]
    return "What accuracy costs: " + " · ".join(
        [*setting(study.scene), start(study.angle, study.velocity), f"{study.duration:g} s", *ended])
