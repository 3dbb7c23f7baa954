"""Figures of methods alone: stability regions, what a step does to an oscillation, growth under damping."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
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
from pendulum_env.plots.style import Look, blank, looks_of, styled
from pendulum_env.plots.titles import headline
from pendulum_env.render.palette import FAINT_INK, INK

FloatArray = NDArray[np.float64]

FARTHEST = 9.0
"""Figures end at steps so long, in units of the problem's own time, whatever the methods take."""
GRID = 480
"""Points along either axis at which R is evaluated."""
LEAST = 1e-16
"""Errors below this are not drawn."""
STABLE = 1.0 + 1e-9
"""What counts as no growth where numbers have rounding."""
MAP = 141
"""Points along either axis of a map of growth."""
LONG_NAME = 24
"""Names of so many letters have smaller ones above a map."""
ABREAST = 4
"""Maps, and entries of a legend, beside one another."""
UNSTABLE = "#E2E2E2"
CRITICAL: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": (0, (4, 3))}
LINE = 0.21
"""Height of a legend's line [inch]."""


def regions(methods: Sequence[Method], figure: Figure | None = None) -> Figure:
    """Stability regions ``|R(lambda h)| <= 1`` of Runge-Kutta methods: explicit, the same per force, and implicit ones.

    ``figure``: to draw into; it gets the size that this takes. Raises MethodError for a method that has no stability
    function.
    """
    explicit, implicit = ([m for m in methods if m.implicit is kind] for kind in (False, True))
    looks = _looks(methods)
    panels = [("explicit: stable inside the curves", explicit, False)] if explicit else []
    panels += [("explicit, per force evaluation", explicit, True)] if any(m.evaluations > 1 for m in explicit) else []
    panels += [("implicit: unstable where shaded", implicit, False)] if implicit else []
    made, row = _figure(1, len(panels), (4.9, 4.7), len(methods), figure)
    with styled():
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
        note = (r"$R(\lambda h)$: growth factor of a step on $y' = \lambda y$. Undamped oscillators stand on the "
                r"vertical axis, $\lambda = \pm i\omega_0$;" "\n" r"drag alone stands on the horizontal one, "
                r"$\lambda = -\gamma$.")
        _finish(made, r"Stability regions $|R(\lambda h)| \leq 1$", note, _entries(methods, looks, _order))
    return made


def _window(method: Method, scaled: bool) -> tuple[float, float, float]:
    """Real parts from and to, and the largest imaginary part, of what is to be seen of a region's boundary."""
    boundary = stability_boundary(method) / (method.evaluations if scaled else 1)
    seen = boundary[np.abs(boundary) <= FARTHEST]
    return min(float(seen.real.min()), -1.0 / 4), max(float(seen.real.max()), 1.0 / 4), float(seen.imag.max())


def _region(
    axes: Axes, method: Method, look: Look, edges: Sequence[float], scale: int, alpha: float
) -> None:
    """The boundary of one region, and a shade inside, or outside for implicit methods."""
    x, y = (np.linspace(low, high, GRID) for low, high in (edges[:2], edges[2:]))
    size = np.abs(stability_function(method, scale * (x + 1j * y[:, None])))
    size = np.minimum(size, 1e3)
    shaded = [1.0, 1e4] if method.implicit else [0.0, 1.0]
    axes.contourf(x, y, size, shaded, colors=[look.colour], alpha=alpha)
    drawn = axes.contour(x, y, size, [1.0], colors=[look.colour], linestyles=[look.dashes], linewidths=[look.width],
                         zorder=look.height)
    drawn.set(**look.edge())


def oscillation(methods: Sequence[Method], figure: Figure | None = None) -> Figure:
    """What one step does to an undamped oscillation, against omega0 h: growth of the amplitude, error of the phase.

    Curves end at a cross, the stability limit, and go on thin. Left as they are, right their sizes on logarithmic axes.
    ``figure`` as in :func:`regions`.
    """
    looks = _looks(methods)
    limits = {method.name: stability_limit(method) for method in methods}
    known = [limit for limit in limits.values() if 0.0 < limit < FARTHEST]
    end = min(1.12 * max([*known, 3.0]), FARTHEST)
    z = np.unique(np.concatenate((np.geomspace(0.02, end, 120), np.linspace(0.02, end, 200))))
    made, grid = _figure(2, 2, (6.2, 3.6), len(methods), figure)
    (grown, grown_size), (turned, turned_size) = grid[:2], grid[2:]
    with styled():
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
            for axes, values in ((grown, 1.0 + growth), (turned, turns), (turned_size, np.abs(turns))):
                _curve(axes, steps, values, limit, look)
            _curve(grown_size, steps, np.abs(growth), limit, look, cross=False)
        grown.set(ylim=(0.0, 2.0), ylabel="amplitude after / before", title="growth of the amplitude")
        turned.set(ylim=(-1.6, 1.6), ylabel="phase error [rad]", title="error of the phase (above 0: ahead)")
        grown_size.set(ylabel="|amplitude after / before \N{MINUS SIGN} 1|", title="its size, on logarithmic axes")
        turned_size.set(ylabel="|phase error| [rad]", title="its size, on logarithmic axes")
        for axes in (turned, turned_size):
            axes.set_xlabel(r"$\omega_0 h$")
        note = ("Crosses: stability limits, beyond which curves are thin. A phase error is missing where a step no "
                f"longer turns;\nsizes below {LEAST:.0e} are not drawn: methods that keep the amplitude have no curve "
                "up to their limit.")
        title = r"One step on the undamped oscillator $\ddot\theta = -\omega_0^2\,\theta$"
        _finish(made, title, note, _entries(methods, looks, lambda method: _limit(limits[method.name])))
    return made


def _curve(
    axes: Axes, z: FloatArray, values: FloatArray, limit: float, look: Look, cross: bool = True
) -> None:
    """One curve: full up to the stability limit, where a cross is, and thin beyond it."""
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


def damped(methods: Sequence[Method], figure: Figure | None = None) -> Figure:
    """Maps of the factor by which damped motion grows in one step, over omega0 h and gamma h, the true one first.

    ``figure`` as in :func:`regions`. Raises MethodError for a method that takes no drag.
    """
    finite = [limit for method in methods if (limit := stability_limit(method)) < FARTHEST]
    wide = min(1.2 * max([*finite, 2.5]), FARTHEST)
    x, y = np.meshgrid(np.linspace(0.0, wide, MAP), np.linspace(0.0, 2.0 * wide, MAP))
    maps: dict[str, Callable[[], FloatArray]] = {"exact": lambda: exact_growth(x, y)}
    maps |= {method.name: lambda method=method: spectral_radii(method, x, y) for method in methods}  # type: ignore[misc]
    abreast = min(ABREAST, len(maps))
    made, panels = _figure(-(-len(maps) // abreast), abreast, (3.0, 2.9), 0, figure, shared=True)
    with styled():
        for axes, (name, found) in zip(panels, maps.items(), strict=False):
            image = _map(axes, x, y, found(), name)
        for axes in panels[len(maps) :]:
            axes.set_axis_off()
        for axes in panels[: len(maps)][-abreast:]:
            axes.set_xlabel(r"$\omega_0 h$")
            axes.xaxis.set_tick_params(labelbottom=True)
        for axes in panels[: len(maps) : abreast]:
            axes.set_ylabel(r"$\gamma h$")
        made.colorbar(image, ax=panels, label="growth factor of a step", shrink=min(1.0, 4.5 / made.get_figheight()))
        handles = [Patch(facecolor=UNSTABLE, edgecolor=INK, label="grows: unstable"),
                   Line2D([], [], label=r"critical damping $\gamma = 2\omega_0$", **CRITICAL)]
        _finish(made, r"One step on the damped oscillator $\ddot\theta = -\gamma\dot\theta - \omega_0^2\,\theta$", "",
                handles)
    return made


def exact_growth(z: FloatArray, g: FloatArray) -> FloatArray:
    """Return the factor by which the exact motion grows in a step, for ``z = omega0 h`` and ``g = gamma h``."""
    root = np.sqrt(np.maximum(g * g / 4.0 - z * z, 0.0))
    return np.exp(-g / 2.0 + root)


def _map(axes: Axes, x: FloatArray, y: FloatArray, radii: FloatArray, title: str) -> Any:
    stable = np.ma.masked_where(radii > STABLE, radii)
    image = axes.pcolormesh(x, y, stable, cmap="viridis", vmin=0.0, vmax=1.0, shading="gouraud", rasterized=True)
    size = np.minimum(radii, 2.0)
    if np.any(size > STABLE):
        axes.contourf(x, y, size, [STABLE, 3.0], colors=[UNSTABLE], zorder=2)
        axes.contour(x, y, size, [STABLE], colors=[INK], linewidths=1.2, zorder=2.5)
    axes.plot([0.0, x.max()], [0.0, 2.0 * x.max()], zorder=3, **CRITICAL)
    axes.grid(visible=False)
    axes.set(xlim=(0.0, x.max()), ylim=(0.0, y.max()))
    axes.set_title(title, fontsize=12 if len(title) < LONG_NAME else 9)
    return image


# --- frames ---------------------------------------------------------------------------------------------------------


def _looks(methods: Sequence[Method]) -> dict[str, Look]:
    return looks_of({method.name: method.name for method in methods})


def _figure(
    rows: int, columns: int, panel: tuple[float, float], entries: int, given: Figure | None, shared: bool = False
) -> tuple[Figure, list[Any]]:
    """A figure of panels of one size [inch] with room for a title, a note and a legend of so many entries below."""
    width = max(panel[0] * columns, 8.0)
    made = blank((width, panel[1] * rows + 1.0 + LINE * -(-entries // _abreast(width))), given)
    with styled():
        return made, list(made.subplots(rows, columns, squeeze=False, sharex=shared, sharey=shared).ravel())


def _abreast(width: float) -> int:
    """Entries of a legend beside one another in a figure of this width [inch]."""
    return max(1, round(width / 4.1))


def _finish(made: Figure, title: str, note: str, entries: Sequence[Any]) -> None:
    headline(made, title)
    columns = min(_abreast(made.get_figwidth()), len(entries))
    made.legend(handles=entries, loc="outside lower left", ncols=columns, handlelength=3.4, title=note or None,
                alignment="left", title_fontsize=9.5)


def _entries(
    methods: Sequence[Method], looks: Mapping[str, Look], said: Callable[[Method], str]
) -> list[Line2D]:
    return [Line2D([], [], label=f"{method.name} ({said(method)})", **looks[method.name].line) for method in methods]


def _order(method: Method) -> str:
    count = method.evaluations
    return f"order {method.order}, {count} force{'s' if count > 1 else ''}"


def _limit(limit: float) -> str:
    if limit == math.inf:
        return "no limit"
    return rf"$\omega_0 h \leq {limit:.4g}$" if limit else "grows at any step"
