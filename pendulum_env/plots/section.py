"""Figures of Poincaré sections, bifurcation diagrams and basins of attraction of driven scenes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from pendulum_env.lab.fitting.model import unit_of
from pendulum_env.plots.style import panel
from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO, PAPER
from pendulum_env.study.basins import STOPPED, UNSETTLED, Basins, percent
from pendulum_env.study.section import Section

SIZE = (8.0, 7.2)
"""Size of a figure [inch]."""
CELLS, FEW = 200, 300
"""Cells along each side of a figure, and the number of cells with points below which points are drawn large."""
LARGE, MEDIUM, SMALL, CROWD = 4.0, 1.8, 0.9, 20_000
"""Diameters of points: large, and those of figures with less and with more than CROWD points [points]."""
BASINS = tuple(OKABE_ITO[name] for name in ("blue", "orange", "bluish_green", "reddish_purple", "sky_blue", "yellow",
                                            "vermillion"))
"""Colours of the basins, the largest first; those of further attractors share the last grey."""
FURTHER, NO_ATTRACTOR, ENDED = "#9A9A9A", INK, PAPER
"""Colours of the basins of further attractors, of motions that do not repeat, and of runs that ended early."""


def draw(result: Section | Basins, figure: Figure | None = None) -> Figure:
    """Draw a section, a bifurcation diagram (a section over a parameter) or basins, with a title and a note.

    ``figure`` is drawn into and resized; by default a new figure.
    """
    over = "" if isinstance(result, Basins) else result.over
    title = "Basins of attraction" if isinstance(result, Basins) else (
        f"Bifurcation diagram over {over}" if over else "Poincaré section")
    with page(SIZE, figure, for_figure(f"{title}: {result.scene.name}"), _note(result)) as drawing:
        if isinstance(result, Basins):
            basins(result, drawing.subplots())
        elif over:
            upper, lower = drawing.subplots(2, 1, sharex=True)
            bifurcation(result, "angle", upper)
            bifurcation(result, "velocity", lower)
            upper.set_xlabel("")
        else:
            poincare(result, drawing.subplots())
    return drawing


def poincare(section: Section, axes: Axes | None = None) -> Axes:
    """Draw the points of a Poincaré section.

    A stroboscopic section shows velocity against angle; a section at passages shows velocity against the phase of the
    drive, and one at turning points the angle against that phase.
    """
    strobed = section.event == "period"
    with panel(axes, SIZE) as at:
        x, y = (section.angle if strobed else section.drive), (
            section.angle if section.event == "turning" else section.velocity)
        _points(at, x, y)
        at.set(xlabel="angle [rad]" if strobed else "phase of the drive [rad]",
               ylabel="angle [rad]" if section.event == "turning" else "velocity [rad/s]")
        if not strobed:
            at.set_xlim(0.0, 2.0 * math.pi)
        elif section.scene.periodic and np.ptp(x) > math.pi:
            at.set_xlim(-math.pi, math.pi)
    return at


def bifurcation(section: Section, quantity: str = "angle", axes: Axes | None = None) -> Axes:
    """Draw the "angle" or the "velocity" of the points of a section against the parameter that differs between runs.

    The dotted lines are at the values of the parameter between which the number of periods doubles.
    """
    angle = quantity == "angle"
    unit = for_figure(unit_of(section.scene, section.over))
    with panel(axes) as at:
        _points(at, section.value, section.angle if angle else section.velocity, few=False)
        at.set(xlabel=section.over if unit in ("", "1") else f"{section.over} [{unit}]",
               ylabel="angle [rad]" if angle else "velocity [rad/s]")
        at.set_xlim(float(section.value.min()), max(float(section.value.max()), float(section.value.min()) + 1e-12))
        if section.event == "period":
            for value, word in doublings(section):
                at.axvline(value, color=FAINT_INK, linewidth=0.8, linestyle=(0, (1, 2)), zorder=0.5)
                if angle:
                    at.annotate(word, (value, 1.0), xycoords=("data", "axes fraction"), xytext=(0, 3), ha="center",
                                textcoords="offset points", fontsize=8.5, color=FAINT_INK)
    return at


def doublings(section: Section) -> list[tuple[float, str]]:
    """Return the middle between two neighbouring values of ``over`` where the period doubles, with its new number.

    Only first doublings count: 1 to 2, 2 to 4, and so on, in ascending order of the parameter.
    """
    found: list[tuple[float, str]] = []
    known = list(section.repetitions().items())
    wanted = 2
    for (low, before), (high, after) in pairwise(known):
        if before * 2 == after == wanted:
            found.append((0.5 * (low + high), str(after)))
            wanted *= 2
    return found


def basins(result: Basins, axes: Axes | None = None) -> Axes:
    """Draw the attractor of each start as a picture over starting angle and velocity, with the attractors' states."""
    with panel(axes, SIZE) as at:
        count = len(result.attractors)
        tones = [ENDED, NO_ATTRACTOR, *(BASINS[i] if i < len(BASINS) else FURTHER for i in range(count))]
        norm = BoundaryNorm(np.arange(STOPPED - 0.5, count + 1.0), len(tones))
        half = [0.5 * (values[1] - values[0]) if len(values) > 1 else 0.5 for values in (result.angle, result.velocity)]
        low, high = (result.angle[0] - half[0], result.angle[-1] + half[0]), (
            result.velocity[0] - half[1], result.velocity[-1] + half[1])
        at.imshow(result.which, origin="lower", extent=(*low, *high), aspect="auto", cmap=ListedColormap(tones),
                  norm=norm, interpolation="nearest", rasterized=True)
        handles = []
        for i, states in enumerate(result.attractors, start=1):
            at.plot(states[:, 0], states[:, 1], "o", color=tones[i + 1], markeredgecolor=PAPER, markeredgewidth=1.6,
                    markersize=8.0, clip_on=True)
            if i <= len(BASINS):
                handles.append(Patch(color=tones[i + 1], label=f"repeats after {len(states)} "
                                     f"period{'s' * (len(states) > 1)}: {percent(result.share(i))}"))
        others = sum(result.share(i) for i in range(len(BASINS) + 1, count + 1))
        for tone, word, share in ((FURTHER, f"{count - len(BASINS)} further attractors", others),
                                  (NO_ATTRACTOR, "does not repeat", result.share(UNSETTLED)),
                                  (ENDED, "ended early", result.share(STOPPED))):
            if share:
                handles.append(Patch(facecolor=tone, edgecolor=FAINT_INK, label=f"{word}: {percent(share)}"))
        at.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=9)
        at.grid(visible=False)
        at.set(xlabel="starting angle [rad]", ylabel="starting velocity [rad/s]", xlim=low, ylim=high)
    return at


def _points(axes: Axes, x: NDArray[np.float64], y: NDArray[np.float64], few: bool = True) -> None:
    """Draw many points, small ones if they fill many cells of the figure, else large ones."""
    large = False
    if few and len(x):
        cells, _, _ = np.histogram2d(x, y, bins=CELLS)
        large = bool(np.count_nonzero(cells) < FEW)
    size = LARGE if large else MEDIUM if len(x) < CROWD else SMALL
    axes.plot(x, y, ".", color=OKABE_ITO["blue"] if large else INK, markersize=size, markeredgewidth=0.0,
              rasterized=True)


def _note(result: Section | Basins) -> str:
    """Return the note below a figure: the equation, and how the points were computed."""
    parts = [result.scene.equation()]
    if isinstance(result, Section):
        if result.over:
            parts = [f"At {result.over} = {result.value[0]:g}: {parts[0]}. Dotted: the number of periods doubles."]
        where = f"the drive's phase {math.degrees(result.phase):.4g}°" if result.event == "period" else (
            "turning points, velocity falling" if result.event == "turning" else
            f"passages through the {result.event}, velocity positive")
        runs = len(np.unique(result.run))
        parts.append(f"{len(result.angle)} points at {where}, of {runs} run{'s' * (runs != 1)} after "
                     f"{result.transient} periods of the drive; {result.method}, {result.steps} steps per period.")
        if result.stopped:
            parts.append(f"{result.stopped} runs ended early.")
    else:
        parts.append(f"{len(result.angle)} x {len(result.velocity)} starts, followed over {result.transient} periods "
                     f"of the drive; {result.method}, {result.steps} steps per period. Dots: attractors at phase 0.")
    return for_figure("\n".join(parts))
