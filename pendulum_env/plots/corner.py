"""Corner figure of a posterior, drawn by the library corner: the distribution of every parameter and of every pair."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from pendulum_env.lab.checked import RecordingError
from pendulum_env.plots.series import FloatArray
from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import OKABE_ITO

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.posterior import Posterior

PANEL, BESIDE, ABOVE = 1.75, 0.95, 0.5
"""Width of a panel, of the margin with labels at the left and the bottom, and of the margins opposite [inch]."""
SMALLEST = 6.5
"""Smallest width of the figure, which has room for its legend [inch]."""
SHARES = (0.68, 0.95)
"""Probabilities within the contours."""
SHADES = (0.25, 0.55)
"""Opacities of the area within the wider and within the narrower contour."""
CELLS, SMOOTH = 50, 1.0
"""Number of cells of a histogram along either side, and standard deviation of its smoothing [cells]: little, so that
the contours of two correlated parameters are hardly wider than the sample."""
REACH = 1.1
"""Half width of an axis, in multiples of the distance between the median and the farther 0.1 % quantile."""
LONG = 300.0
"""An axis shows the difference from a round value if the value is more than this number of standard deviations."""
PLAIN = (0.1, 1e4)
"""Range of an axis' largest value that is shown without a power of ten."""
SAMPLE, FIT = OKABE_ITO["blue"], OKABE_ITO["vermillion"]
DASHES = (0, (4, 2))


class _Axis(NamedTuple):
    """One parameter's axis: its values in the unit of the axis, those of the fit, its limits and its label."""

    values: FloatArray
    fitted: float
    error: float
    limits: tuple[float, float]
    label: str


def corner(posterior: Posterior, figure: Figure | None = None) -> Figure:
    """Draw the corner figure of a posterior, with the normal distribution of the fit's errors for comparison.

    On the diagonal are the histograms of the parameters; below are contours that contain 68 % and 95 % of the samples
    of two parameters, and ellipses that contain the same probabilities of the normal distribution. ``figure`` is drawn
    into and resized; by default a new figure. Raises RecordingError if the library corner is not installed.
    """
    try:
        from corner import corner as drawn
    except ImportError:
        raise RecordingError("the corner figure needs corner; pip install 'lab-pendulum[posterior]'") from None
    axes = [_axis(posterior, i) for i in range(len(posterior.names))]
    side = max(PANEL * len(axes) + BESIDE + ABOVE, SMALLEST)
    steps, walkers, _ = posterior.chain.shape
    title = (f"{for_figure(posterior.fit.recording.source)} · posterior of {walkers} walkers, {steps} steps, worth "
             f"{posterior.independent:.0f} independent samples")
    with page((side, side), figure, title, layout=None) as drawing:
        drawn(np.stack([one.values for one in axes], axis=1), bins=CELLS, range=[one.limits for one in axes],
              labels=[one.label for one in axes], label_kwargs={"fontsize": 10}, labelpad=-0.04, color=SAMPLE,
              fig=drawing, smooth=SMOOTH, levels=SHARES, quiet=True, plot_datapoints=False, plot_density=False,
              fill_contours=True, contourf_kwargs={"colors": [(SAMPLE, shade) for shade in (0.0, *SHADES)]},
              max_n_ticks=3, hist_kwargs={"density": True, "linewidth": 1.4})
        drawing.subplots_adjust(BESIDE / side, BESIDE / side, 1.0 - 0.3 * ABOVE / side, 1.0 - ABOVE / side)
        for i, down in enumerate(axes):
            for j, across in enumerate(axes[: i + 1]):
                drawing.axes[len(axes) * i + j].tick_params(labelrotation=0, labelsize=9)
                _normal(drawing.axes[len(axes) * i + j], across, down, float(posterior.fit.correlations[i, j]))
        drawing.legend(handles=[
            Patch(facecolor=(SAMPLE, SHADES[1]), label="posterior, 68 %"),
            Patch(facecolor=(SAMPLE, SHADES[0]), label="posterior, 95 %"),
            Line2D([], [], color=FIT, linestyle=DASHES, label="normal, from the fit's errors"),
        ], loc="upper right", bbox_to_anchor=(0.99, 1.0 - ABOVE / side), fontsize=11)
    return drawing


def _axis(posterior: Posterior, i: int) -> _Axis:
    """Return the axis of the parameter with the index ``i``, with a reference value and a power of ten if needed."""
    values, fit = posterior.samples[:, i], posterior.fit
    low, middle, high = np.quantile(values, (0.001, 0.5, 0.999))
    error = float(values.std())
    reference = round(float(middle), -math.floor(math.log10(error)) - 1) if abs(middle) > LONG * error > 0.0 else 0.0
    wide = REACH * max(high - middle, middle - low) or 1.0
    ends = np.array([max(middle - wide, posterior.priors[i].low), middle + wide]) - reference
    name, unit, largest, factor = posterior.names[i].rpartition(".")[2], posterior.units[i], np.abs(ends).max(), 1.0
    words = [] if unit == "1" else [for_figure(unit)]
    if not PLAIN[0] < largest < PLAIN[1]:
        exponent = 3 * math.floor(math.log10(max(largest, 1e-300)) / 3.0)
        factor, words = 10.0**exponent, [f"$10^{{{exponent}}}$", *words]
    sign = "\N{MINUS SIGN}" if reference > 0.0 else "+"
    label = f"{name} {sign} {abs(reference):.10g}" if reference else name
    return _Axis((values - reference) / factor, (float(fit.solution.values[i]) - reference) / factor,
                 math.sqrt(float(fit.errors.covariance[i, i])) / factor, (ends[0] / factor, ends[1] / factor),
                 f"{label}\n[{' '.join(words) or '1'}]")


def _normal(at: Axes, across: _Axis, down: _Axis, correlation: float) -> None:
    """Draw the fit's normal distribution of one parameter, or its ellipses of two, if their errors are finite."""
    if not all(0.0 < one.error < math.inf for one in (across, down)):
        return
    if across is down:
        x = np.linspace(*across.limits, 200)
        height = np.exp(-0.5 * ((x - across.fitted) / across.error) ** 2) / (across.error * math.sqrt(math.tau))
        at.plot(x, height, color=FIT, linestyle=DASHES, linewidth=1.4, label="_")
        return
    turn = np.linspace(0.0, math.tau, 120)
    second = correlation * np.cos(turn) + math.sqrt(max(1.0 - correlation**2, 0.0)) * np.sin(turn)
    for share in SHARES:
        radius = math.sqrt(-2.0 * math.log(1.0 - share))
        at.plot(across.fitted + radius * across.error * np.cos(turn), down.fitted + radius * down.error * second,
                color=FIT, linestyle=DASHES, linewidth=1.1, label="_")
    at.set(xlim=across.limits, ylim=down.limits)
