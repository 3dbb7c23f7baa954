"""Bar chart of a policy's transfer: what each difference between two environments costs."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from pendulum_env.plots.titles import for_figure, page
from pendulum_env.render.palette import HAIRLINE, INK, OKABE_ITO

WIDE, ROW, FRAME, BAR = 9.0, 0.62, 1.9, 0.34
"""Width of the figure, height of a row, height of everything around the rows [inch], thickness of a bar [rows]."""
SIDES = (("alone, in the nominal one", OKABE_ITO["blue"]),
         ("beside all others, in the real one", OKABE_ITO["orange"]))
"""Meaning and colour of the two bars of a difference."""


def draw(transfer: Any, figure: Figure | None = None) -> Figure:
    """Draw the mean changes of a policy's return by each difference, with their standard errors, and the whole change.

    ``transfer`` is a :class:`pendulum_env.envs.transfer.Transfer`. ``figure`` is drawn into and resized; by default a
    new figure.
    """
    differences = transfer.differences
    title = (f"A policy's return: {transfer.nominal.mean():.4g} in the nominal environment, "
             f"{transfer.real.mean():.4g} in the real one")
    with page((WIDE, FRAME + ROW * (len(differences) + 1)), figure, title) as drawing:
        axes = drawing.subplots()
        for row, one in enumerate(differences):
            for side, change in enumerate(transfer.changes(one)):
                if change is not None:
                    axes.barh(row + BAR * (side - 0.5), change.value, BAR, color=SIDES[side][1], xerr=change.error,
                              label=SIDES[side][0] if row == 0 else None, error_kw={"ecolor": INK, "capsize": 2.5})
        gap = transfer.gap
        axes.barh(len(differences), gap.value, BAR, color="#8C8C8C", xerr=gap.error, label="all together",
                  error_kw={"ecolor": INK, "capsize": 2.5})
        names = [for_figure(f"{one.name}\n{one.values[0]}  to  {one.values[1]}") for one in differences]
        axes.set_yticks(range(len(names) + 1), [*names, "all differences"])
        axes.axvline(0.0, color=HAIRLINE, linewidth=1.0, zorder=0)
        axes.invert_yaxis()
        axes.set_xlabel("mean change of the return [reward], with standard error")
        axes.margins(x=0.08)
        drawing.legend(loc="outside lower left", ncols=3)
    return drawing
