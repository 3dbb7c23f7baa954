"""Figure of the track of a filmed bob: its way over a frame of the film, and its angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from pendulum_env.plots.style import blank, styled
from pendulum_env.plots.titles import for_figure
from pendulum_env.render.palette import INK, OKABE_ITO

if TYPE_CHECKING:
    from pendulum_env.lab.film import FilmTrack

TRACK, PIVOT = OKABE_ITO["vermillion"], OKABE_ITO["blue"]
"""Colours of the bob's places and of the pivot with its circle."""


def draw(found: FilmTrack) -> Figure:
    """Draw the bob's places over a frame of the film, with the circle through them, and the angle in degrees below."""
    with styled():
        made = blank((8.0, 9.0))
        above, below = made.subplots(2, 1, height_ratios=(2.0, 1.0))
        height, width = found.picture.shape
        above.imshow(found.picture, cmap="gray", vmin=0, vmax=255, interpolation="antialiased")
        around = np.linspace(found.angle.min(), found.angle.max(), 200) + found.roll
        x, y = found.pivot
        above.plot(x + found.radius.value * np.sin(around), y + found.radius.value * np.cos(around), color=PIVOT,
                   lw=1.0, label="circle about the pivot")
        above.plot(found.x, found.y, ".", color=TRACK, ms=2.0, label="bob")
        above.plot([x], [y], "+", color=PIVOT, ms=10.0)
        above.set(xlim=(min(0.0, x - 5.0), max(width, x + 5.0)), ylim=(height, min(0.0, y - 5.0)), xlabel="x in pixels",
                  ylabel="y in pixels", title=for_figure(f"The track in {found.source}"))
        above.grid(False)
        above.legend(loc="upper right")
        below.plot(found.time, np.degrees(found.angle), ".", color=INK, ms=2.0)
        below.set(xlabel="time in s", ylabel="angle in degrees")
    return made
