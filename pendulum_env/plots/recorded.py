"""A recording and what was fitted to it: angle, residual, envelope and phase portrait in one figure."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from pendulum_env.plots.series import DENSE, FloatArray, Span, joined, within
from pendulum_env.plots.style import LINES, blank, styled
from pendulum_env.plots.titles import headline
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.result import Fit
    from pendulum_env.lab.turning import TurningPoints

SIZE = (11.0, 12.5)
FEW = 5.0
"""Periods that are shown closely, at the beginning and at the end."""
POINTS = 80
"""Points of the model's curve in a period,"""
MOST = 40_000
"""and in all."""
CLOSE = 600
"""Readings that are drawn in the phase portrait, at most."""
CROWDED = 3000
"""Residuals that are joined by a line, at most."""
MODELS = 4
"""Envelopes of models that are drawn, at most."""
BEST = OKABE_ITO["vermillion"]
OTHERS = tuple(OKABE_ITO[name] for name in ("blue", "bluish_green", "orange"))
READING: dict[str, Any] = {"color": INK, "marker": "o", "linestyle": "none", "markeredgewidth": 0.0}


def recorded(found: Fit, figure: Figure | None = None) -> Figure:
    """The report of a fit: the whole free swing with the model over it, its first and its last cycles, the residual
    over time, the amplitudes of half swings on a logarithmic axis with the envelopes of the models that were compared,
    and the phase portrait of the first and the last cycles. Angles in degrees about the fitted equilibrium.

    The velocity of a reading, which no sensor has recorded, is the slope of a cubic through its neighbours.
    ``figure``: to draw into; it gets the size that this takes.
    """
    from pendulum_env.lab.recording import Recording
    from pendulum_env.lab.turning import turning_points

    swing, zero = found.recording, found.parameters["zero"].value
    period, end = math.tau / found.scene.omega0, float(swing.time[-1])
    fine = np.linspace(0.0, end, int(min(end / period * POINTS, MOST)) + 2)
    angle, velocity = (rows[0] for rows in replace(found.model, time=fine).motion(found.values))
    seen, curve = np.degrees(swing.angle - zero), np.degrees(angle - zero)
    few = min(FEW * period, end / 3.0)
    turns = turning_points(Recording(swing.time, swing.angle - zero, swing.source))
    still = min(float(turns.time[-1]) + 0.5 * period, end)
    spans = (0.0, few), (still - few, still)
    made = blank(SIZE, figure)
    with styled():
        grid = made.add_gridspec(4, 2, height_ratios=(1.0, 1.0, 0.8, 1.5))
        whole, rest = made.add_subplot(grid[0, :]), made.add_subplot(grid[2, :])
        dots = 1.6 if end > DENSE * period else 2.6
        _over_time(whole, (0.0, end), swing.time, seen, fine, curve, dots)
        for i, (span, title) in enumerate(zip(spans, ("first cycles", "last cycles"), strict=True)):
            at = made.add_subplot(grid[1, i])
            _over_time(at, span, swing.time, seen, fine, curve, 3.4)
            at.set_title(title, fontsize=11)
        whole.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2, ncols=2, markerscale=2.0)
        _residual(rest, found)
        _envelope(made.add_subplot(grid[3, 0]), found, turns, fine)
        _phase(made.add_subplot(grid[3, 1]), spans, swing.time, seen, fine, curve, velocity, period)
        said = f"{swing.source} · {found.damping} damping · residual {math.degrees(found.rms):.2g}° rms"
        headline(made, said)
    return made


def _over_time(
    at: Axes, span: Span, time: FloatArray, seen: FloatArray, fine: FloatArray, curve: FloatArray, size: float
) -> None:
    part, own = within(time, span), within(fine, span)
    at.plot(time[part], seen[part], markersize=size, label="recording", zorder=2.0, **READING)
    at.plot(fine[own], curve[own], color=BEST, linewidth=1.0 if size < 3.0 else 1.5, label="fitted model", zorder=2.5)
    at.set(xlabel="time since the release [s]", ylabel="angle [degrees]", xlim=span)


def _residual(at: Axes, found: Fit) -> None:
    time, rest = found.recording.time, np.degrees(found.residual)
    at.axhspan(-math.degrees(found.noise), math.degrees(found.noise), color="#E6E6E6", zorder=1.0, linewidth=0.0,
               label=f"± {math.degrees(found.noise):.2g}°, one reading's scatter")
    many = len(time) > CROWDED
    at.plot(time, rest, color=FAINT_INK, linewidth=0.0 if many else 0.5, zorder=2.0)
    at.plot(time, rest, markersize=0.9 if many else 1.8, zorder=2.5, **{**READING, "color": BEST})
    at.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2)
    at.set(xlabel="time since the release [s]", ylabel="recording \N{MINUS SIGN} model\n[degrees]",
           xlim=(0.0, float(time[-1])))


def _envelope(at: Axes, found: Fit, points: TurningPoints, fine: FloatArray) -> None:
    """Amplitudes of the half swings, recorded and of each model."""
    from pendulum_env.lab.recording import Recording
    from pendulum_env.lab.turning import turning_points

    at.errorbar(points.time, np.degrees(points.amplitude), np.degrees(points.error), elinewidth=0.6, ecolor=FAINT_INK,
                markersize=3.2, label="recording", zorder=3.2, **READING)
    for i, one in enumerate(_models(found)):
        rows = replace(one.model, time=fine).motion(one.values)[0][0] - one.parameters["zero"].value
        known = np.isfinite(rows)
        if np.count_nonzero(known) < 3:
            continue
        turns = turning_points(Recording(fine[known], rows[known], one.damping))
        line = {"color": (BEST, *OTHERS)[i], "linestyle": LINES[i][0], "linewidth": 2.0 if one is found else 1.7}
        at.plot(turns.time, np.degrees(turns.amplitude), label=f"{one.damping} ({math.degrees(one.rms):.2g}° rms)",
                zorder=3.0 - 0.1 * i, **line)
    at.set_yscale("log")
    at.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
    at.yaxis.set_major_formatter(FuncFormatter(lambda value, _place: f"{value:g}"))
    at.yaxis.set_minor_locator(NullLocator())
    at.legend(loc="best", fontsize=9)
    at.set(xlabel="time since the release [s]", ylabel="amplitude of half swings [degrees]",
           xlim=(0.0, float(fine[-1])))


def _models(found: Fit) -> list[Fit]:
    """The fit itself, then damped ones that it was compared with: of one damping alone first."""
    others = [one for one in (found.comparison.fits if found.comparison else ())
              if one.damping not in (found.damping, "none")]
    return [found, *sorted(others, key=lambda one: "+" in one.damping)][:MODELS]


def _phase(
    at: Axes, spans: tuple[Span, ...], time: FloatArray, seen: FloatArray, fine: FloatArray, curve: FloatArray,
    velocity: FloatArray, period: float,
) -> None:
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
    """Slope of the cubic fitted to the readings within ``reach`` [s] of each, at least to three on either side."""
    found = np.empty(len(where))
    for k, i in enumerate(np.asarray(where).tolist()):
        first, last = np.searchsorted(time, (time[i] - reach, time[i] + reach)).tolist()
        part = slice(max(min(first, i - 3), 0), max(last, i + 4))
        away = (time[part] - time[i]) / reach
        degree = min(3, len(away) - 1)
        found[k] = np.polynomial.polynomial.polyfit(away, angle[part], degree)[1] / reach
    return found
