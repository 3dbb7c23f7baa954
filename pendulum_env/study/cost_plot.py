"""The work-precision diagram of a cost study: error against time, and against force evaluations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import integrators
from pendulum_env.plots.style import colours, styled
from pendulum_env.render.palette import FAINT_INK, HAIRLINE, INK, TRACK
from pendulum_env.study.cost_points import FLOOR, CostPoint, CostStudy

SIZE = (13.5, 6.0)
DASHES = ("-", (0, (5, 1.6)), (0, (1.2, 1.2)))
"""Line styles of the first, second and third method that share a colour."""
MARKERS = "osD^vP<>X"
"""One marker per method, in order, so that colours are not all there is to tell them apart."""


def draw(study: CostStudy) -> Figure:
    """Error against wall time with the Pareto front, and against force evaluations; both axes logarithmic.

    Runs that ended early are left out. Errors within the reference's reach, which is shaded, are hollow. Each method's
    measured order stands in the legend.
    """
    with styled():
        made = Figure(figsize=SIZE, layout="constrained")
        FigureCanvasAgg(made)
        left, right = made.subplots(1, 2, sharey=True)
        tones = colours(study.methods)
        used: list[str] = []
        entries = []
        for i, name in enumerate(study.methods):
            dashes = DASHES[used.count(tones[name]) % len(DASHES)]
            used.append(tones[name])
            look: dict[str, Any] = {"color": tones[name], "linestyle": dashes, "marker": MARKERS[i % len(MARKERS)]}
            points = study.of(name)
            _curve(left, [point.ns_per_second * 1e-9 for point in points], points, look)
            _curve(right, [point.evaluations / study.duration for point in points], points, look)
            entries.append(Line2D([], [], linewidth=1.6, markersize=6, label=_label(study, name), **look))
        front = study.front
        (line,) = left.plot(
            [point.ns_per_second * 1e-9 for point in front], [point.angle_error for point in front],
            color=INK, alpha=0.16, linewidth=11, solid_joinstyle="round", zorder=1.4, label="Pareto front",
        )
        entries.append(line)
        if any(point.floor for point in study.points):
            entries.append(Line2D([], [], color=FAINT_INK, linestyle="none", marker="o", markerfacecolor="white",
                                  label="within reach of the reference's own error"))
        _frame(study, left, right)
        made.legend(handles=entries, loc="outside right upper", fontsize=10, handlelength=3.2, labelspacing=0.55)
        made.suptitle(_title(study), x=0.008, ha="left", fontsize=13)
        made.supxlabel(_note(study), x=0.008, ha="left", fontsize=9.5, color=FAINT_INK)
    return made


def _curve(axes: Axes, x: Sequence[float], points: Sequence[CostPoint], look: dict[str, Any]) -> None:
    """One method's line through its known errors, and hollow marks for those that are not."""
    y = [point.angle_error for point in points]
    known = [i for i, point in enumerate(points) if not point.floor]
    unknown = [i for i, point in enumerate(points) if point.floor]
    axes.plot([x[i] for i in known], [y[i] for i in known], linewidth=1.6, markersize=5, **look)
    hollow = {**look, "linestyle": "none", "markerfacecolor": "white"}
    axes.plot([x[i] for i in unknown], [y[i] for i in unknown], markersize=5, alpha=0.75, **hollow)


def _frame(study: CostStudy, left: Axes, right: Axes) -> None:
    """Axes, the shaded reach of the reference, and what it is."""
    errors = [point.angle_error for point in study.points if point.angle_error > 0.0]
    largest = float(np.max(np.abs(study.reference.angle)))
    own = FLOOR * study.reference.error_estimate
    lowest = min([own, *errors])
    for axes in (left, right):
        axes.set(xscale="log", yscale="log")
        axes.margins(x=0.04)
        axes.set_ylim(10.0 ** math.floor(math.log10(lowest)), 10.0 * largest)
        if any(error < 1e3 * own for error in errors):
            axes.axhspan(axes.get_ylim()[0], own, color=TRACK, zorder=0.5)
            axes.axhline(own, color=HAIRLINE, linewidth=1.0, zorder=0.6)
        axes.yaxis.set_tick_params(labelleft=True)
    left.set(xlabel="wall time per simulated second [s]", ylabel="largest angle error [rad]", title="against time")
    right.set(xlabel="force evaluations per simulated second", title="against force evaluations")


def _label(study: CostStudy, name: str) -> str:
    slope = study.slope(name)
    order = integrators.METHODS[name].order if name in integrators.METHODS else None
    said = [f"order {order}"] if order and math.isfinite(order) else []
    said += [f"measured {slope:.2f}"] if math.isfinite(slope) else []
    return f"{name}\n({', '.join(said)})" if said else name


def _note(study: CostStudy) -> str:
    own = f"Shaded: within {FLOOR:g} times the reference's own error, {study.reference.error_estimate:.1g} rad."
    if any(effect.dry for effect in study.scene.effects):
        own += " Evaluations: without those that find the turning points."
    return f"Reference: {study.reference.how}.\n{own} Times: the shortest of {study.repeats}, without compilation."


def _title(study: CostStudy) -> str:
    damping = "+".join(effect.damping for effect in study.scene.of_kind("dissipative"))
    parts = [study.scene.name, f"{damping} damping" if damping else "no damping"]
    parts += [f"from {math.degrees(study.angle):.4g}°" + (f", {study.velocity:.4g} rad/s" if study.velocity else "")]
    parts += [f"{study.duration:g} s"] + ([] if study.complete else ["interrupted: not all runs are here"])
    return "What accuracy costs: " + " · ".join(parts)
