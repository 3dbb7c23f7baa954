"""Figure of a fit of driven logs: angle, residual and drive of every log over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendulum_env.plots.recorded import BEST, READING
from pendulum_env.plots.series import joined
from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import FAINT_INK, INK

if TYPE_CHECKING:
    from pendulum_env.lab.driven.log import DrivenLog
    from pendulum_env.lab.driven.result import DrivenFit

WIDTH, HEIGHT, EDGE = 9.5, 5.6, 0.5
"""Width of the figure, height of the panels of a log, and height of the title [inch]."""
CROWDED = 2000
"""Number of readings of a log from which their dots are small."""
LEFT_OUT = "#F3D9B1"
"""Colour of the parts of a log that the fit leaves out."""


def driven(fit: DrivenFit, figure: Figure | None = None) -> Figure:
    """Draw the logs of a driven fit, each with three panels over the time in the log [s].

    They are the recorded angle and the fitted motion, which starts anew in every window of the fit, the residual with
    the error of a reading, and the action, torque or current. Parts that the fit leaves out are shaded. ``figure`` is
    drawn into and resized; by default a new figure.
    """
    count = len(fit.logs)
    rms = f"residual {np.degrees(fit.solution.rms):.2g}° rms"
    title = f"{for_figure(fit.source)} · {rms} · {fit.grade.word}"
    with page((WIDTH, EDGE + HEIGHT * count), figure, title) as drawing:
        grid = drawing.add_gridspec(3 * count, 1, height_ratios=(1.5, 0.9, 0.9) * count)
        for number, log in enumerate(fit.logs):
            angle = drawing.add_subplot(grid[3 * number])
            residual, drive = (drawing.add_subplot(grid[3 * number + row], sharex=angle) for row in (1, 2))
            _motion(angle, residual, fit, number)
            _drive(drive, log)
            lost = [(first, last) for at, first, last in fit.solution.lost if at == number]
            for panel in (angle, residual, drive):
                for i, span in enumerate(lost):
                    panel.axvspan(*span, color=LEFT_OUT, linewidth=0.0, zorder=0.5,
                                  label="left out" if panel is angle and not i else None)
            for panel in (angle, residual):
                panel.tick_params(labelbottom=False)
                panel.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2, ncols=3, markerscale=2.0)
            if count > 1:
                angle.set_title(for_figure(log.source), loc="right", fontsize=11)
    return drawing


def _motion(at: Axes, below: Axes, fit: DrivenFit, number: int) -> None:
    """Draw the recorded and the fitted angles of a log [degrees], and below their difference."""
    solution, log = fit.solution, fit.logs[number]
    parts = [(log.time[place.first : place.last], part) for place, part in
             zip(solution.windows.places, solution.windows.slices, strict=True) if place.log == number]
    rest = np.degrees(solution.residual)
    model = np.degrees(solution.windows.angle) - rest
    many = len(log.time) > CROWDED
    at.plot(log.time, np.degrees(log.angle), markersize=1.6 if many else 2.6, label="recording", zorder=2.0, **READING)
    times = joined(time for time, _ in parts)
    span = solution.windows.h * solution.windows.steps
    at.plot(times, joined(model[part] for _, part in parts), color=BEST, linewidth=1.2, zorder=2.5,
            label=f"fitted model, from a new start every {span:.2g} s")
    error = float(np.degrees(solution.sigma[number]))
    below.axhspan(-error, error, color="#E6E6E6", zorder=1.0, linewidth=0.0,
                  label=f"± {error:.2g}°, the error of a reading")
    below.plot(times, joined(rest[part] for _, part in parts), color=BEST, linewidth=0.6, marker="o",
               markersize=0.9 if many else 1.8, markeredgewidth=0.0, zorder=2.0)
    at.set(ylabel="angle [degrees]", xlim=(float(log.time[0]), float(log.time[-1])))
    below.set(ylabel="recording \N{MINUS SIGN} model\n[degrees]")


def _drive(at: Axes, log: DrivenLog) -> None:
    """Draw the drive of a log over time [s], an action as steps."""
    from pendulum_env.lab.driven.log import DRIVES

    held = "default" if DRIVES[log.kind].measured else "steps-post"
    at.plot(log.time, log.drive, color=INK, linewidth=0.8, drawstyle=held, zorder=2.0)
    at.axhline(0.0, color=FAINT_INK, linewidth=0.5, zorder=1.0)
    at.set(xlabel="time [s]", ylabel=f"{log.kind} [{log.unit}]")
