"""Figure of the track of a filmed bob: its way over a frame of the film, its angle, and what a smooth swing leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from pendulum_env.plots.style import blank, styled
from pendulum_env.plots.titles import for_figure
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pendulum_env.lab.film import FilmTrack

TRACK, PIVOT = OKABE_ITO["vermillion"], OKABE_ITO["blue"]
"""Colours of the bob's places, and of the pivot with its circle."""
_ROOM = 0.06  # of the picture's height, around a pivot outside it


def draw(found: FilmTrack, figure: Figure | None = None) -> Figure:
    """Draw the bob's places over a frame of the film with the circle through them, the angle against time with marks
    where a frame has no reading, and what a smooth swing leaves of it with the band of the claimed errors.
    """
    with styled():
        tall = found.picture.shape[0] > found.picture.shape[1]
        made = blank((8.0, 11.0 if tall else 9.8), figure)
        above, angle, rest = made.subplots(3, 1, height_ratios=(3.4 if tall else 2.5, 1.0, 0.8))
        angle.sharex(rest)
        _place(above, found)
        made.legend(*above.get_legend_handles_labels(), loc="outside upper left", ncols=3, markerscale=3.0)
        angle.plot(found.time, np.degrees(found.angle), ".", color=INK, ms=2.5)
        if len(found.missing):
            angle.vlines(found.missing, 0.0, 0.07, color=TRACK, lw=1.0, transform=angle.get_xaxis_transform(),
                         label="frames without a reading")
            angle.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0)
        angle.tick_params(labelbottom=False)
        angle.set(ylabel="angle [deg]", xlim=(0.0, found.end))
        band = 1.96 * np.degrees(found.error)
        rest.fill_between(found.time, -band, band, step="mid", color=FAINT_INK, alpha=0.3, lw=0.0,
                          label="95 % of the claimed error")
        rest.plot(found.time, np.degrees(found.rest), ".", color=INK, ms=2.0)
        rest.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0)
        rest.set(xlabel="time [s]", ylabel="residual [deg]")
        made.align_ylabels((angle, rest))
    return made


def _place(axes: Axes, found: FilmTrack) -> None:
    """Draw a frame of the film with the bob's places, the pivot, the circle, and the vertical of the swing."""
    height, width = found.picture.shape
    axes.imshow(found.picture, cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
    (x, y), radius = found.pivot, found.radius.value
    around = np.linspace(found.angle.min(), found.angle.max(), 200) + found.roll
    lines: tuple[tuple[Any, Any, float, dict[str, Any]], ...] = (
        (around, radius, 1.2, {"label": "circle about the pivot"}),
        (np.full(2, found.roll), np.array([0.0, radius]), 0.9, {"label": "middle of the swing", "ls": (0, (4, 3))}))
    for angle, away, wide, look in lines:
        axes.plot(x + away * np.sin(angle), y + away * np.cos(angle), color="white", lw=wide + 1.5, alpha=0.8)
        axes.plot(x + away * np.sin(angle), y + away * np.cos(angle), color=PIVOT, lw=wide, **look)
    axes.plot(found.x, found.y, ".", color=TRACK, ms=2.5, label="bob, in each frame")
    for size, wide, tone in ((13.0, 4.0, "white"), (11.0, 2.0, PIVOT)):
        axes.plot([x], [y], "+", color=tone, ms=size, mew=wide)
    room = _ROOM * height
    axes.set(xlim=(min(-0.5, x - room), max(width - 0.5, x + room)),
             ylim=(max(height - 0.5, y + room), min(-0.5, y - room)), xlabel="x [pixels]", ylabel="y [pixels]",
             title=for_figure(f"The track in {found.source}"))
    axes.grid(False)
