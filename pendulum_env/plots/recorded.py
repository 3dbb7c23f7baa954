"""Report figure of a fit to a recording: angle, residual, envelope and phase portrait."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from pendulum_env.plots.series import DENSE, FloatArray, Span, joined, within
from pendulum_env.plots.style import LINES
from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.result import Fit
    from pendulum_env.lab.turning import TurningPoints

SIZE = (11.0, 12.5)
"""Size of the figure [inch]."""
FEW = 5.0
"""Number of periods in the enlarged panels of the first and the last cycles."""
POINTS = 80
"""Number of points per period of the model's curve."""
MOST = 40_000
"""Largest number of points of the model's curve."""
CLOSE = 600
"""Largest number of readings in the phase portrait."""
CROWDED = 3000
"""Largest number of residuals that are joined by a line."""
BEST = OKABE_ITO["vermillion"]
"""Colour of the fitted model."""
OTHERS = tuple(OKABE_ITO[name] for name in ("blue", "bluish_green", "orange", "reddish_purple", "sky_blue"))
"""Colours of the envelopes of other models, used again for more of them with another dash pattern."""
READING: dict[str, Any] = {"color": INK, "marker": "o", "linestyle": "none", "markeredgewidth": 0.0}


def recorded(fit: Fit, figure: Figure | None = None) -> Figure:
    """Draw the report figure of a fit, with angles in degrees about the fitted equilibrium.

    The panels are the free swing with the fitted model, its first and last cycles, the residual over time, the
    amplitudes of half swings on a logarithmic axis with the envelopes of the models within 10 of the best criterion and
    of the closest one that is ruled out, and the phase portrait of the first and last cycles. The velocity of a reading
    is the slope of a cubic fitted to the neighbouring readings. ``figure`` is drawn into and resized; by default a new
    figure.
    """
    from pendulum_env.lab.recording import Recording
    from pendulum_env.lab.turning import turning_points

    swing = fit.recording
    period, end = math.tau / fit.scene.omega0, float(swing.time[-1])
    fine = np.linspace(0.0, end, int(min(end / period * POINTS, MOST)) + 2)
    angle, velocity = fit.motion(fine)
    seen, curve = np.degrees(fit.swing), np.degrees(angle)
    few = min(FEW * period, end / 3.0)
    turns = turning_points(Recording(swing.time, fit.swing, swing.source))
    still = min(float(turns.time[-1]) + 0.5 * period, end)
    spans = (0.0, few), (still - few, still)
    rms = f"residual {fit.shown(fit.rms):.2g}{fit.sign} rms"
    title = f"{for_figure(swing.source)} · {fit.damping} damping · {rms} · {fit.grade.word}"
    with page(SIZE, figure, title) as drawing:
        grid = drawing.add_gridspec(4, 2, height_ratios=(1.0, 1.0, 0.8, 1.5))
        overview, rest = drawing.add_subplot(grid[0, :]), drawing.add_subplot(grid[2, :])
        dots = 1.6 if end > DENSE * period else 2.6
        _over_time(overview, (0.0, end), swing.time, seen, fine, curve, dots)
        for i, (span, title) in enumerate(zip(spans, ("first cycles", "last cycles"), strict=True)):
            at = drawing.add_subplot(grid[1, i])
            _over_time(at, span, swing.time, seen, fine, curve, 3.4)
            at.set_title(title, fontsize=11)
        overview.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2, ncols=2, markerscale=2.0)
        _residual(rest, fit)
        _envelope(drawing.add_subplot(grid[3, 0]), fit, turns, fine)
        _phase(drawing.add_subplot(grid[3, 1]), spans, swing.time, seen, fine, curve, velocity, period)
    return drawing


def _over_time(
    at: Axes, span: Span, time: FloatArray, seen: FloatArray, fine: FloatArray, curve: FloatArray, size: float
) -> None:
    """Draw the recorded angles and the model's curve in a span of time [s]; ``size`` is that of the dots [points]."""
    part, own = within(time, span), within(fine, span)
    at.plot(time[part], seen[part], markersize=size, label="recording", zorder=2.0, **READING)
    at.plot(fine[own], curve[own], color=BEST, linewidth=1.0 if size < 3.0 else 1.5, label="fitted model", zorder=2.5)
    at.set(xlabel="time since the release [s]", ylabel="angle [degrees]", xlim=span)


def _residual(at: Axes, fit: Fit) -> None:
    """Draw the residual of a fit over time [s], with the error of a reading shaded."""
    time, rest = fit.recording.time, fit.shown(1.0) * fit.residual
    at.axhspan(-fit.shown(fit.noise), fit.shown(fit.noise), color="#E6E6E6", zorder=1.0, linewidth=0.0,
               label=f"± {fit.shown(fit.noise):.2g}{fit.sign}, the error of a reading")
    many = len(time) > CROWDED
    at.plot(time, rest, color=FAINT_INK, linewidth=0.0 if many else 0.5, zorder=2.0)
    at.plot(time, rest, markersize=0.9 if many else 1.8, zorder=2.5, **{**READING, "color": BEST})
    at.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2)
    at.set(xlabel="time since the release [s]", ylabel=f"recording \N{MINUS SIGN} model\n[{fit.degrees}]",
           xlim=(0.0, float(time[-1])))


def _envelope(at: Axes, fit: Fit, points: TurningPoints, fine: FloatArray) -> None:
    """Draw the amplitudes of the recorded half swings, and the envelopes of the models that were compared."""
    from pendulum_env.lab.recording import Recording
    from pendulum_env.lab.turning import turning_points

    at.errorbar(points.time, np.degrees(points.amplitude), np.degrees(points.error), elinewidth=0.6, ecolor=FAINT_INK,
                markersize=3.2, label="recording", zorder=3.2, **READING)
    models = fit.comparison
    words = {one.damping: f", {word}" for one, word in zip(models.fits, models.verdicts, strict=True)
             if one.damping != fit.damping and fit.grade.usable} if models else {}
    for i, one in enumerate((fit, *models.drawn[1:]) if models else (fit,)):
        rows, _ = one.motion(fine)
        known = np.isfinite(rows)
        if np.count_nonzero(known) < 3:
            continue
        turns = turning_points(Recording(fine[known], rows[known], one.damping))
        again = (i - 1) // len(OTHERS) if i else 0  # each round of the colours takes the next dash patterns
        colour, (dashes, width) = OTHERS[i % len(OTHERS) - 1] if i else BEST, LINES[(i + again) % len(LINES)]
        at.plot(turns.time, np.degrees(turns.amplitude), color=colour, linestyle=dashes, linewidth=width,
                label=f"{one.damping} ({one.shown(one.rms):.2g}{one.sign} rms{words.get(one.damping, '')})",
                zorder=2.5 + 0.05 * i)
    amplitudes(at)
    at.legend(loc="best", fontsize=9)
    at.set(xlabel="time since the release [s]", ylabel="amplitude of half swings [degrees]",
           xlim=(0.0, float(fine[-1])))


def amplitudes(at: Axes) -> None:
    """Make the vertical axis logarithmic, with plain numbers such as 20 and 30 as tick labels."""
    at.set_yscale("log")
    at.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
    at.yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    at.yaxis.set_minor_locator(NullLocator())


def _phase(
    at: Axes, spans: tuple[Span, ...], time: FloatArray, seen: FloatArray, fine: FloatArray, curve: FloatArray,
    velocity: FloatArray, period: float,
) -> None:
    """Draw the phase portrait of a recording and its fitted model, for the given spans of time [s]."""
    parts = [within(fine, span) for span in spans]
    where = np.concatenate([np.arange(len(time))[within(time, span)] for span in spans])
    where = where[:: -(-len(where) // CLOSE)]
    at.plot(seen[where], np.radians(slopes(time, seen, where, period / 12.0)), markersize=2.8, zorder=2.0,
            label="recording", **READING)
    at.plot(joined(curve[part] for part in parts), joined(velocity[part] for part in parts), color=BEST, linewidth=1.2,
            zorder=2.5, label="fitted model")
    at.margins(0.04)
    at.set(xlabel="angle [degrees]", ylabel="velocity [rad/s]")
    at.set_title("first and last cycles", fontsize=11)


def slopes(time: FloatArray, angle: FloatArray, where: Any, reach: float) -> FloatArray:
    """Return the slope of the angle at the readings with the indices ``where``, from a cubic fitted around every one.

    The fit uses the readings within ``reach`` [s], but at least three on either side.
    """
    slope = np.empty(len(where))
    for k, i in enumerate(np.asarray(where).tolist()):
        first, last = np.searchsorted(time, (time[i] - reach, time[i] + reach)).tolist()
        part = slice(max(min(first, i - 3), 0), max(last, i + 4))
        away = (time[part] - time[i]) / reach
        degree = min(3, len(away) - 1)
        slope[k] = np.polynomial.polynomial.polyfit(away, angle[part], degree)[1] / reach
    return slope
