"""Figures of integration methods: stability regions, the error of one step of an oscillation, growth under damping."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from integrators import Method
from integrators.analysis import (
    oscillation_errors,
    spectral_radii,
    stability_boundary,
    stability_function,
    stability_limit,
)
from pendulum_env.plots.style import Look, looks_of, styled
from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import FAINT_INK, INK

FloatArray = NDArray[np.float64]

FARTHEST = 9.0
"""Longest step shown in the figures, in units of the problem's own time."""
GRID = 480
"""Points along either axis at which the stability function R is evaluated."""
LEAST = 1e-16
"""Errors below this are not drawn."""
STABLE = 1.0 + 1e-9
"""Largest growth factor that counts as stable, with a margin for rounding."""
MAP = 141
"""Points along either axis of a map of growth."""
LONG_NAME = 24
"""Names with at least this many letters get a smaller font above a map."""
ABREAST = 4
"""Largest number of maps in a row."""
UNSTABLE = "#E2E2E2"
"""Colour of unstable regions in a map of growth."""
CRITICAL: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": (0, (4, 3))}
"""Line style of critical damping in a map of growth."""
LINE = 0.21
"""Height of one line of a legend [inch]."""


@styled()
def regions(methods: Sequence[Method], figure: Figure | None = None) -> Figure:
    """Draw the stability regions ``|R(lambda h)| <= 1`` of Runge-Kutta methods.

    The panels show explicit methods, explicit methods with the step divided by the force evaluations, and implicit
    methods. ``figure`` is drawn into and resized; by default a new figure. Raises MethodError for a method that has no
    stability function.
    """
    explicit, implicit = ([m for m in methods if m.implicit is kind] for kind in (False, True))
    looks = _looks(methods)
    panels = [("explicit: stable where shaded", explicit, False)] if explicit else []
    panels += [("explicit, per force evaluation", explicit, True)] if any(m.evaluations > 1 for m in explicit) else []
    panels += [("implicit: stable where shaded", implicit, False)] if implicit else []
    note = (r"$R(\lambda h)$: growth factor of a step on $y' = \lambda y$. Undamped oscillators stand on the "
            r"vertical axis, $\lambda = \pm i\omega_0$;" "\n" r"drag alone stands on the horizontal one, "
            r"$\lambda = -\gamma$.")
    entries = _entries(looks, {m.name: f"order {m.order}, {m.evaluations} force{'s' if m.evaluations > 1 else ''}"
                               for m in methods})
    with _panels(1, len(panels), (4.9, 4.7), figure, r"Stability regions $|R(\lambda h)| \leq 1$", entries, note) as (
            drawing, row):
        for axes, (title, shown, scaled) in zip(row, panels, strict=True):
            windows = [_window(m, scaled) for m in shown]
            left, right, top = (choose(w[i] for w in windows) for i, choose in enumerate((min, max, max)))
            half = 0.54 * max(right - left, 2.0 * top)
            middle = 0.5 * (left + right)
            edges = (middle - half, middle + half, -half, half)
            for method in shown:
                scale = method.evaluations if scaled else 1
                _region(axes, method, looks[method.name], edges, scale, min(0.13, 0.7 / len(shown)))
            for line in (axes.axhline, axes.axvline):
                line(0.0, color=FAINT_INK, linewidth=0.8, zorder=1.1)
            h = r"\lambda h/s" if scaled else r"\lambda h"
            axes.set(title=title, xlabel=f"Re ${h}$", ylabel=f"Im ${h}$", xlim=edges[:2], ylim=edges[2:])
            axes.set_aspect("equal")
    return drawing


def _window(method: Method, scaled: bool) -> tuple[float, float, float]:
    """Return the extent of a method's stability region to show: smallest and largest real part, largest imaginary part.
    """
    boundary = stability_boundary(method) / (method.evaluations if scaled else 1)
    seen = boundary[np.abs(boundary) <= FARTHEST]
    return min(float(seen.real.min()), -1.0 / 4), max(float(seen.real.max()), 1.0 / 4), float(seen.imag.max())


def _region(
    axes: Axes, method: Method, look: Look, edges: Sequence[float], scale: int, alpha: float
) -> None:
    """Draw the boundary of one method's stability region and shade the region."""
    x, y = (np.linspace(low, high, GRID) for low, high in (edges[:2], edges[2:]))
    size = np.abs(stability_function(method, scale * (x + 1j * y[:, None])))
    size = np.minimum(size, 1e3)
    axes.contourf(x, y, size, [0.0, 1.0], colors=[look.colour], alpha=alpha)
    drawn = axes.contour(x, y, size, [1.0], colors=[look.colour], linestyles=[look.dashes], linewidths=[look.width],
                         zorder=look.height)
    drawn.set(**look.edge())


@styled()
def oscillation(methods: Sequence[Method], figure: Figure | None = None) -> Figure:
    """Draw the amplitude growth and the phase error of one step of an undamped oscillation, against omega0 h.

    A cross marks the stability limit, beyond which a curve is thin. The left panels have linear axes, the right panels
    show absolute values on logarithmic axes. ``figure`` is drawn into and resized; by default a new figure.
    """
    looks = _looks(methods)
    limits = {method.name: stability_limit(method) for method in methods}
    known = [limit for limit in limits.values() if 0.0 < limit < FARTHEST]
    end = min(1.12 * max([*known, 3.0]), FARTHEST)
    z = np.unique(np.concatenate((np.geomspace(0.02, end, 120), np.linspace(0.02, end, 200))))
    note = ("Crosses mark stability limits; beyond them, curves are thin. There is no phase error if a step does "
            f"not oscillate.\nValues below {LEAST:.0e} are not drawn, so methods that conserve the amplitude have "
            "no curve up to their limit.")
    title = r"One step on the undamped oscillator $\ddot\theta = -\omega_0^2\,\theta$"
    entries = _entries(looks, {name: "no limit" if limit == math.inf else "grows at any step" if not limit else
                               rf"$\omega_0 h \leq {limit:.4g}$" for name, limit in limits.items()})
    with _panels(2, 2, (6.2, 3.6), figure, title, entries, note) as (drawing, (grown, grown_size, turned, turned_size)):
        for axes in (grown, turned):
            axes.set_xlim(0.0, end)
        for axes in (grown_size, turned_size):
            axes.set(xscale="log", yscale="log", xlim=(0.02, end), ylim=(LEAST, 10.0))
            axes.set_yticks([10.0**k for k in range(-16, 1, 4)])
            axes.minorticks_off()
            axes.set_xticks(ticks := [x for x in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0) if x < end],
                            [f"{x:g}" for x in ticks])
        for method in methods:
            limit, look = limits[method.name], looks[method.name]
            steps = np.union1d(z, [limit] if z[0] < limit < z[-1] else [])
            growth, phase = oscillation_errors(method, steps)
            turns = np.where(np.abs(np.diff(phase, prepend=phase[0])) > math.pi, math.nan, phase)
            for axes, values in ((grown, 1.0 + growth), (turned, turns), (turned_size, np.abs(turns)),
                                 (grown_size, np.abs(growth))):
                _curve(axes, steps, values, limit, look, cross=axes is not grown_size)
        grown.set(ylim=(0.0, 2.0), ylabel="amplitude after / before", title="growth of the amplitude")
        turned.set(ylim=(-1.6, 1.6), ylabel="phase error [rad]", title="error of the phase (above 0: ahead)",
                   xlabel=r"$\omega_0 h$")
        grown_size.set(ylabel="|amplitude after / before \N{MINUS SIGN} 1|", title="its size, on logarithmic axes")
        turned_size.set(ylabel="|phase error| [rad]", title="its size, on logarithmic axes", xlabel=r"$\omega_0 h$")
    return drawing


def _curve(
    axes: Axes, z: FloatArray, values: FloatArray, limit: float, look: Look, cross: bool = True
) -> None:
    """Draw one method's curve against omega0 h: full up to the stability limit, with a cross there, and thin beyond it.
    """
    drawn = np.where(values >= LEAST, values, math.nan) if axes.get_yscale() == "log" else values
    inside = (z <= limit) | (limit == 0.0)
    if np.isfinite(drawn[inside]).any():
        axes.plot(z, np.where(inside, drawn, math.nan), **look.line)
    if not 0.0 < limit < z[-1]:
        return
    axes.plot(z, np.where(z >= limit, drawn, math.nan), color=look.colour, linewidth=0.8, alpha=0.7, zorder=1.9)
    last = np.flatnonzero(inside & np.isfinite(drawn))
    if cross and last.size and last[-1] + 3 >= np.count_nonzero(inside):
        axes.plot(limit, drawn[last[-1]], "x", color=look.colour, markersize=7, markeredgewidth=2, zorder=4,
                  **look.edge(2.0))


@styled()
def damped(methods: Sequence[Method], figure: Figure | None = None) -> Figure:
    """Draw maps of the growth factor of damped motion in one step, over omega0 h and gamma h, for the exact motion and
    every method.

    ``figure`` is drawn into and resized; by default a new figure. Raises MethodError for a method that does not support
    drag.
    """
    finite = [limit for method in methods if (limit := stability_limit(method)) < FARTHEST]
    wide = min(1.2 * max([*finite, 2.5]), FARTHEST)
    x, y = np.meshgrid(np.linspace(0.0, wide, MAP), np.linspace(0.0, 2.0 * wide, MAP))
    maps = {"exact": partial(exact_growth, x, y)}
    maps |= {method.name: partial(spectral_radii, method, x, y) for method in methods}
    abreast = min(ABREAST, len(maps))
    entries = [Patch(facecolor=UNSTABLE, edgecolor=INK, label="grows: unstable"),
               Line2D([], [], label=r"critical damping $\gamma = 2\omega_0$", **CRITICAL)]
    title = r"One step on the damped oscillator $\ddot\theta = -\gamma\dot\theta - \omega_0^2\,\theta$"
    with _panels(-(-len(maps) // abreast), abreast, (3.0, 2.9), figure, title, entries, room=0, shared=True) as (
            drawing, panels):
        for axes, (name, radii) in zip(panels, maps.items(), strict=False):
            image = _map(axes, x, y, radii(), name)
        for axes in panels[len(maps) :]:
            axes.set_axis_off()
        for axes in panels[: len(maps)][-abreast:]:
            axes.set_xlabel(r"$\omega_0 h$")
            axes.xaxis.set_tick_params(labelbottom=True)
        for axes in panels[: len(maps) : abreast]:
            axes.set_ylabel(r"$\gamma h$")
        drawing.colorbar(image, ax=panels, label="growth factor of a step",
                         shrink=min(1.0, 4.5 / drawing.get_figheight()))
    return drawing


def exact_growth(z: FloatArray, g: FloatArray) -> FloatArray:
    """Return the growth factor of the exact damped motion in a step h, for ``z = omega0 h`` and ``g = gamma h``."""
    root = np.sqrt(np.maximum(g * g / 4.0 - z * z, 0.0))
    return np.exp(-g / 2.0 + root)


def _map(axes: Axes, x: FloatArray, y: FloatArray, radii: FloatArray, title: str) -> Any:
    """Draw one method's map of growth factors over omega0 h (``x``) and gamma h (``y``), and return its image."""
    stable = np.ma.masked_where(radii > STABLE, radii)
    image = axes.pcolormesh(x, y, stable, cmap="viridis", vmin=0.0, vmax=1.0, shading="gouraud", rasterized=True)
    size = np.minimum(radii, 2.0)
    if np.any(size > STABLE):
        axes.contourf(x, y, size, [STABLE, 3.0], colors=[UNSTABLE], zorder=2)
        axes.contour(x, y, size, [STABLE], colors=[INK], linewidths=1.2, zorder=2.5)
    axes.plot([0.0, x.max()], [0.0, 2.0 * x.max()], zorder=3, **CRITICAL)
    axes.grid(visible=False)
    axes.set(xlim=(0.0, x.max()), ylim=(0.0, y.max()))
    axes.set_title(for_figure(title), fontsize=12 if len(title) < LONG_NAME else 9)
    return image


# --- frames ---------------------------------------------------------------------------------------------------------


def _looks(methods: Sequence[Method]) -> dict[str, Look]:
    """Return the curve style of every method, by its name."""
    return looks_of({method.name: method.name for method in methods})


@contextmanager
def _panels(
    rows: int, columns: int, size: tuple[float, float], given: Figure | None, title: str, entries: Sequence[Any],
    note: str = "", room: int | None = None, shared: bool = False,
) -> Iterator[tuple[Figure, list[Any]]]:
    """Yield a figure and its panels of one size [inch]; at the end it gets a title and a legend below with a note.

    ``given`` is a figure to draw into; ``room`` the number of entries in the legend for which the figure is higher, by
    default that of ``entries``.
    """
    width = max(size[0] * columns, 8.0)
    abreast = max(1, round(width / 4.1))
    lines = -(-(len(entries) if room is None else room) // abreast)
    with page((width, size[1] * rows + 1.0 + LINE * lines), given, title) as drawing:
        yield drawing, list(drawing.subplots(rows, columns, squeeze=False, sharex=shared, sharey=shared).ravel())
        drawing.legend(handles=entries, loc="outside lower left", ncols=min(abreast, len(entries)), handlelength=3.4,
                       title=note or None, alignment="left", title_fontsize=9.5)


def _entries(looks: Mapping[str, Look], remarks: Mapping[str, str]) -> list[Line2D]:
    """Return the legend entries of methods: their names, with a remark on every method in brackets."""
    return [Line2D([], [], label=f"{for_figure(name)} ({remark})", **looks[name].line)
            for name, remark in remarks.items()]
