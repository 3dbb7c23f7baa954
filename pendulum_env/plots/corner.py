"""Corner figure of a posterior: the distribution of every parameter and of every pair of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from pendulum_env.plots.series import FloatArray
from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import INK, OKABE_ITO

if TYPE_CHECKING:
    from pendulum_env.lab.fitting.posterior import Posterior

PANEL, EDGE = 1.75, 1.1
"""Width of a panel and of the margins with labels [inch]."""
SMALLEST = 6.5
"""Smallest width of the figure, which has room for its legend [inch]."""
SHARES = (0.68, 0.95)
"""Probabilities within the contours."""
CELLS = 36
"""Number of cells of a histogram along either side."""
SMOOTH = 1.2
"""Standard deviation of the smoothing of a histogram [cells]."""
REACH = 1.1
"""Half width of an axis, in multiples of the distance between the median and the farther 0.1 % quantile."""
LONG = 300.0
"""An axis shows the difference from a round value if the value is more than this number of standard deviations."""
PLAIN = (0.1, 1e4)
"""Range of an axis' largest value that is shown without a power of ten."""
NARROW = 0.8
"""Correlation above which a pair's histogram has the axes of the joint distribution, not those of the parameters."""
SAMPLE, FIT = OKABE_ITO["blue"], OKABE_ITO["vermillion"]


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
    of two parameters, dark blue and light blue, and ellipses that contain the same probabilities of the normal
    distribution. ``figure`` is drawn into and resized; by default a new figure.
    """
    axes = [_axis(posterior, i) for i in range(len(posterior.names))]
    side = max(PANEL * len(axes) + EDGE, SMALLEST)
    steps, walkers, _ = posterior.chain.shape
    title = (f"{for_figure(posterior.fit.recording.source)} · posterior of {walkers} walkers, {steps} steps, worth "
             f"{posterior.independent:.0f} independent samples")
    with page((side, side), figure, title) as drawing:
        grid = drawing.subplots(len(axes), len(axes), squeeze=False)
        for i, down in enumerate(axes):
            for j, across in enumerate(axes):
                at = grid[i, j]
                if j > i:
                    at.set_axis_off()
                elif i == j:
                    _alone(at, down)
                else:
                    _pair(at, across, down, float(posterior.fit.correlations[i, j]))
                if j <= i:
                    _ticks(at, across, down if j < i else None, bottom=i == len(axes) - 1, left=j == 0)
        drawing.legend(handles=[
            Patch(facecolor=SAMPLE, alpha=0.55, label="posterior, 68 %"),
            Patch(facecolor=SAMPLE, alpha=0.22, label="posterior, 95 %"),
            Line2D([], [], color=FIT, linestyle=(0, (4, 2)), label="normal, from the fit's errors"),
        ], loc="upper right", bbox_to_anchor=(0.99, 0.93), fontsize=11)
        drawing.align_labels()
    return drawing


def _axis(posterior: Posterior, i: int) -> _Axis:
    """Return the axis of the parameter with the index ``i``, with a reference value and a power of ten if needed."""
    values = posterior.samples[:, i]
    low, middle, high = np.quantile(values, (0.001, 0.5, 0.999))
    error, name = float(values.std()), posterior.names[i].rpartition(".")[2]
    power = math.floor(math.log10(error)) if error > 0.0 else 0
    reference = round(float(middle), -power - 1) if error > 0.0 and abs(middle) > LONG * error else 0.0
    wide = REACH * max(high - middle, middle - low)
    ends, bound = [middle - reference - wide, middle - reference + wide], posterior.priors[i].low - reference
    ends[0] = max(ends[0], bound) if math.isfinite(bound) else ends[0]
    largest, factor, unit = max(abs(end) for end in ends), 1.0, for_figure(posterior.units[i])
    if not PLAIN[0] < largest < PLAIN[1]:
        exponent = 3 * math.floor(math.log10(max(largest, 1e-300)) / 3.0)
        factor = 10.0**exponent
        unit = f"$10^{{{exponent}}}$ {unit}" if unit != "1" else f"$10^{{{exponent}}}$"
    sign = "\N{MINUS SIGN}" if reference > 0.0 else "+"
    label = f"{name} {sign} {abs(reference):.10g}" if reference else name
    fit = posterior.fit
    fitted, own = float(fit.values[i]) - reference, math.sqrt(float(fit.covariance[i, i]))
    return _Axis((values - reference) / factor, fitted / factor, own / factor, (ends[0] / factor, ends[1] / factor),
                 f"{label}\n[{unit}]")


def _alone(at: Axes, one: _Axis) -> None:
    """Draw the histogram of one parameter and the normal distribution of the fit."""
    at.hist(one.values, bins=CELLS, range=one.limits, density=True, color=SAMPLE, alpha=0.4, linewidth=0.0)
    x = np.linspace(*one.limits, 200)
    if 0.0 < one.error < math.inf:
        at.plot(x, np.exp(-0.5 * ((x - one.fitted) / one.error) ** 2) / (one.error * math.sqrt(math.tau)), color=FIT,
                linestyle=(0, (4, 2)), linewidth=1.4, label="_")
    middle = float(np.median(one.values))
    at.axvline(middle, color=INK, linewidth=0.9, label="_")
    at.set_ylim(bottom=0.0)


def _pair(at: Axes, across: _Axis, down: _Axis, correlation: float) -> None:
    """Draw the joint distribution of two parameters and the ellipses of the fit's normal distribution."""
    from scipy.ndimage import gaussian_filter

    points, turned = np.stack([across.values, down.values]), np.eye(2)
    spread = np.cov(points).reshape(2, 2)
    if spread[0, 1] ** 2 > NARROW**2 * spread[0, 0] * spread[1, 1]:
        turned = np.asarray(np.linalg.cholesky(spread))
    own = np.linalg.solve(turned, points)
    corners = np.linalg.solve(turned, np.array([across.limits, down.limits]))
    spans = [(float(line.min()), float(line.max())) for line in own] if turned[1, 0] else corners.tolist()
    counts, x, y = np.histogram2d(own[0], own[1], CELLS, spans)
    density = gaussian_filter(counts, SMOOTH, mode="nearest")
    ordered = np.sort(density.ravel())[::-1]
    cumulated = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[min(int(np.searchsorted(cumulated, share)), ordered.size - 1)]) for share in SHARES[::-1]]
    grown = [np.concatenate([edges[:1], 0.5 * (edges[1:] + edges[:-1]), edges[-1:]]) for edges in (x, y)]
    places = np.einsum("ij,jkl->ikl", turned, np.stack(np.meshgrid(*grown)))
    filled = np.pad(density, 1, mode="edge").T
    if levels[0] < levels[1] < filled.max():
        at.contourf(*places, filled, [*levels, filled.max()], colors=[SAMPLE, SAMPLE], alpha=0.22)
        at.contourf(*places, filled, [levels[1], filled.max()], colors=[SAMPLE], alpha=0.4)
    if all(0.0 < one.error < math.inf for one in (across, down)):
        turn = np.linspace(0.0, math.tau, 120)
        first = np.cos(turn)
        second = correlation * first + math.sqrt(max(1.0 - correlation**2, 0.0)) * np.sin(turn)
        for share in SHARES:
            radius = math.sqrt(-2.0 * math.log(1.0 - share))
            at.plot(across.fitted + radius * across.error * first, down.fitted + radius * down.error * second,
                    color=FIT, linestyle=(0, (4, 2)), linewidth=1.1, label="_")


def _ticks(at: Axes, across: _Axis, down: _Axis | None, *, bottom: bool, left: bool) -> None:
    """Set the limits of a panel, and ticks with labels at the left and the bottom of the figure."""
    at.set_xlim(*across.limits)
    at.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
    at.tick_params(axis="both", labelsize=9)
    at.ticklabel_format(style="plain", useOffset=False)
    if bottom:
        at.set_xlabel(across.label, fontsize=10)
    else:
        at.tick_params(axis="x", labelbottom=False)
    if down is None:
        at.set_yticks([])
        at.grid(visible=False)
        return
    at.set_ylim(*down.limits)
    at.yaxis.set_major_locator(MaxNLocator(3, prune="both"))
    if left:
        at.set_ylabel(down.label, fontsize=10)
    else:
        at.tick_params(axis="y", labelleft=False)


