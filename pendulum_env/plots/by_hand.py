"""Figures of tables by hand: amplitudes, periods against lengths, and the timings of a reversible pendulum."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendulum_env.plots.recorded import READING, amplitudes
from pendulum_env.plots.series import FloatArray
from pendulum_env.plots.style import LINES, legend_above
from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO

if TYPE_CHECKING:
    from pendulum_env.lab.amplitudes import AmplitudeSheet
    from pendulum_env.lab.kater import KaterSheet
    from pendulum_env.lab.lengths import LengthSheet

Words = Mapping[str, str]
"""Texts in a figure, by name."""
WORDS: Words = {
    "time": "time [s]", "amplitude": "amplitude [degrees]", "readings": "readings", "closest": "{} (closest)",
    "constant": "dry friction", "linear": "linear drag", "quadratic": "quadratic drag",
    "off_envelope": "reading \N{MINUS SIGN} envelope\n[degrees]",
    "length": "length [m]", "square": "T² at small amplitude [s²]", "off_line": "T² \N{MINUS SIGN} line [s²]",
    "slope": "slope {} s²/m", "zero": "zero at {}",
    "position": "position of the weight [m]", "small_period": "period at small amplitude [s]",
    "off_curve": "period \N{MINUS SIGN} curve\n[ms]", "centre": "distance h1 of the centre of mass from edge 1 [m]",
    "bessel": "g by Bessel's\nformula [m/s²]",
}
"""Texts of the figures in English; a report in another language gives its own."""
SIZE = (8.0, 4.6)
"""Size of a figure with two panels [inch]."""
COLOURS = {"constant": OKABE_ITO["orange"], "linear": OKABE_ITO["vermillion"], "quadratic": OKABE_ITO["blue"]}
"""Colour of the envelope of each law of damping."""


def amplitudes_by_hand(sheet: AmplitudeSheet, figure: Figure | None = None, words: Words = WORDS) -> Figure:
    """Draw amplitudes that were read by hand, with their errors and the envelopes of three laws of damping.

    The axis is logarithmic, so that exponential decay is a straight line. Below are the readings minus each envelope.
    With ``words`` of its own, the figure has no title, as in a report.
    """
    points = sheet.points
    size, error = np.degrees(points.amplitude), np.degrees(points.error)
    fine = np.linspace(float(points.time[0]), float(points.time[-1]), 300)
    title = f"{for_figure(sheet.source)} · gamma = {sheet.decay}" if words is WORDS else ""
    with page(SIZE, figure, title) as drawing:
        above, below = drawing.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
        errorbars(above, points.time, size, error, words["readings"])
        for k, one in enumerate(sheet.envelopes):
            curve = np.degrees(one.at(fine))
            best = one is sheet.best
            style = {"color": COLOURS[one.law], "linestyle": "-" if best else LINES[1 + k][0],
                     "linewidth": 1.8 if best else 1.2}
            name = words["closest"].format(words[one.law]) if best else words[one.law]
            above.plot(fine[curve > 0.0], curve[curve > 0.0], label=name, **style)
            below.plot(points.time, size - np.degrees(one.at(points.time)), marker="o", markersize=3.5, **style)
        amplitudes(above)
        low, high = float((size - error).min()), float((size + error).max())
        low = max(low, 0.5 * float(size.min()))
        room = (high / low) ** 0.08
        above.set_ylim(low / room, high * room)
        above.set(ylabel=words["amplitude"])
        legend_above(above, 4)
        below.axhline(0.0, color=FAINT_INK, linewidth=0.8)
        below.fill_between(points.time, -error, error, color=FAINT_INK, alpha=0.25, linewidth=0.0)
        aside(below, points.time)
        below.set(xlabel=words["time"], ylabel=words["off_envelope"])
    return drawing


def lengths_by_hand(sheet: LengthSheet, figure: Figure | None = None, words: Words = WORDS) -> Figure:
    """Draw T² against the length with the straight line, from its zero on, and the residuals of the line below."""
    x, square = sheet.length + sheet.size, sheet.period**2
    error = sheet.error if sheet.told else 2.0 * sheet.period * sheet.scatter
    from pendulum_env.lab.measures import Measurement

    start = -sheet.offset.value
    fine = np.array([min(start, 0.0) - 0.03 * float(x.max()), 1.05 * float(x.max())])
    title = f"{for_figure(sheet.source)} · g = {sheet.gravity}" if words is WORDS else ""
    with page(SIZE, figure, title) as drawing:
        above, below = drawing.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
        above.plot(fine, sheet.line.at(fine), color=OKABE_ITO["vermillion"], linewidth=1.4,
                   label=words["slope"].format(f"{sheet.line.slope:.4g}"))
        above.plot(start, 0.0, "|", color=OKABE_ITO["blue"], markersize=14, markeredgewidth=2.0,
                   label=words["zero"].format(str(Measurement(1e3 * start, 1e3 * sheet.offset.error, "mm")).replace(
                       "-", "\N{MINUS SIGN}")))
        errorbars(above, x, square, error, words["readings"])
        above.set(ylabel=words["square"], ylim=(-0.08 * float(square.max()), 1.08 * float(square.max())))
        legend_above(above, 3)
        errorbars(below, x, sheet.residual, error, words["readings"])
        below.axhline(0.0, color=OKABE_ITO["vermillion"], linewidth=1.0)
        below.set(xlabel=words["length"], xlim=(fine[0], fine[1]), ylabel=words["off_line"])
    return drawing


def kater_by_hand(sheet: KaterSheet, figure: Figure | None = None, words: Words = WORDS) -> Figure:
    """Draw both periods of a reversible pendulum against the position of the weight, with the fitted curves and their
    crossing, and the residuals below; or gravity by Bessel's formula against the distance of the centre of mass."""
    looks = (("T1", sheet.first, OKABE_ITO["blue"], "o"), ("T2", sheet.second, OKABE_ITO["vermillion"], "s"))
    title = f"{for_figure(sheet.source)} · g = {sheet.gravity}" if words is WORDS else ""
    with page(SIZE, figure, title) as drawing:
        above, below = drawing.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
        for k, (name, period, colour, mark) in enumerate(looks):
            above.plot(sheet.position, period, mark, color=colour, markersize=5, label=name)
            if sheet.crossings:
                above.plot(sheet.curve[0], sheet.curve[k + 1], color=colour, linewidth=1.0)
                rest = 1e3 * (period - np.interp(sheet.position, sheet.curve[0], sheet.curve[k + 1]))
                below.errorbar(sheet.position, rest, 1e3 * sheet.scatter, color=colour, marker=mark, markersize=4,
                               linestyle="none", elinewidth=0.8)
        for one in sheet.crossings:
            above.axvline(one.value, color=FAINT_INK, linewidth=0.8)
        if sheet.crossings:
            above.axhline(sheet.period.value, color=FAINT_INK, linewidth=0.8, linestyle=LINES[1][0],
                          label=f"T = {sheet.period}")
            below.axhline(0.0, color=FAINT_INK, linewidth=0.8)
            below.set(xlabel=words["position"], ylabel=words["off_curve"])
        else:
            below.plot(sheet.position, sheet.bessel, "o", color=INK, markersize=5)
            below.axhspan(sheet.gravity.value - sheet.gravity.error, sheet.gravity.value + sheet.gravity.error,
                          color=FAINT_INK, alpha=0.25, linewidth=0.0)
            below.ticklabel_format(axis="y", useOffset=False)
            below.set(xlabel=words["centre"], ylabel=words["bessel"])
        aside(below, sheet.position)
        above.set(ylabel=words["small_period"])
        legend_above(above, 3)
    return drawing


def aside(at: Axes, x: FloatArray) -> None:
    """Leave room beside the first and the last reading."""
    at.set_xlim(float(x.min()) - 0.03 * float(np.ptp(x)), float(x.max()) + 0.03 * float(np.ptp(x)))


def errorbars(at: Axes, x: FloatArray, y: FloatArray, error: FloatArray, label: str) -> None:
    """Draw readings with their errors."""
    at.errorbar(x, y, error, elinewidth=0.8, ecolor=FAINT_INK, capsize=2.0, markersize=4.5, label=label, zorder=3.2,
                **READING)
