"""Figures of a recording, and of what is measured on it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendulum_env.plots.recorded import READING, amplitudes
from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import FAINT_INK, OKABE_ITO

if TYPE_CHECKING:
    from pendulum_env.lab.recording import Recording
    from pendulum_env.lab.sheet import LabSheet

SIZE = (8.0, 6.4)
"""Size of the figure with two panels [inch]."""
MANY = 4000
"""Number of readings from which they are joined by a line, without dots."""
TURNS = OKABE_ITO["vermillion"]
"""Colour of turning points and of the envelope through them."""


def readings(recording: Recording, figure: Figure | None = None) -> Figure:
    """Draw the readings of a recording, angle [degrees] against time [s], in a new or a given figure."""
    with page((SIZE[0], 0.6 * SIZE[1]), figure, for_figure(recording.source)) as drawing:
        _readings(drawing.subplots(), recording, "time [s]")
    return drawing


def measured(sheet: LabSheet, figure: Figure | None = None) -> Figure:
    """Draw what a lab sheet is measured on: the free swing with its turning points, and their amplitudes.

    The amplitudes are on a logarithmic axis, on which exponential decay is a straight line; the line has the damping
    rate gamma of all amplitudes, ``A ~ exp(-gamma t/2)``. A given ``figure`` is drawn into and resized.
    """
    swing, points = sheet.recording, sheet.points
    with page(SIZE, figure, f"{for_figure(swing.source)} · T = {sheet.period}") as drawing:
        above, below = drawing.subplots(2, 1)
        _readings(above, swing, "time since the release [s]")
        above.plot(points.time, np.degrees(points.angle), ".", color=TURNS, label="turning points", zorder=3.0)
        above.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2, ncols=2)
        size, gamma = points.amplitude, sheet.decay.value
        middle = float(np.mean(points.time)), math.exp(float(np.mean(np.log(size))))
        below.plot(points.time, np.degrees(size), ".", color=TURNS, label="amplitude of every half swing")
        below.plot(points.time, np.degrees(middle[1]) * np.exp(-0.5 * gamma * (points.time - middle[0])),
                   color=FAINT_INK, label=f"gamma = {sheet.decay}")
        amplitudes(below)
        below.set(xlabel="time since the release [s]", ylabel="amplitude [degrees]")
        below.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2, ncols=2)
    return drawing


def _readings(axes: Axes, recording: Recording, label: str) -> None:
    """Draw the readings of a recording into axes; ``label`` is that of the axis of time."""
    many = len(recording.time) > MANY
    style = {**READING, "linestyle": "-", "linewidth": 0.4, "markersize": 0.0 if many else 1.8, "label": "recording"}
    axes.plot(recording.time, np.degrees(recording.angle), **style)
    axes.set(xlabel=label, ylabel="angle [degrees]")
