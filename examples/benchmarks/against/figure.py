"""Figure of the precision benchmark: accuracy against time per trajectory, with a panel for each problem."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from against.choice import Point, cheapest
from against.problem import Problem
from against.report import OWN, PEERS, of
from pendulum_env.plots import style
from pendulum_env.render.palette import INK, OKABE_ITO

HUES = ("vermillion", "sky_blue", "bluish_green", "blue", "orange", "reddish_purple", "black")
COLOURS = {name: OKABE_ITO[hue] for name, hue in zip((OWN, *PEERS), HUES, strict=False)}
"""Colour of each package; dashes and markers distinguish its solvers."""
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.6)), (0, (1.2, 1.2)), (0, (6, 1.5, 1.2, 1.5)))
MARKS = "osD^vP"
COLUMNS, WIDTH, HEIGHT = 4, 4.1, 4.0


def front(points: Sequence[Point], accuracies: Sequence[float]) -> list[tuple[float, float]]:
    """Return pairs of the shortest time and the accuracy, for the accuracies that are reached."""
    each = [(cheapest(points, accuracy), accuracy) for accuracy in accuracies]
    return [(best.time, accuracy) for best, accuracy in each if best is not None]


def save(found: Mapping[Problem, Sequence[Point]], path: Path, facts: Mapping[str, str]) -> Path:
    """Draw all panels and save the figure to a file that ends in .png or .svg."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.ticker import NullFormatter

    columns = min(COLUMNS, len(found))
    rows = -(-len(found) // columns)
    looks = _looks(found)
    with style.styled():
        figure = Figure(figsize=(max(8.0, WIDTH * columns), HEIGHT * rows + 1.3), layout="constrained")
        FigureCanvasAgg(figure)
        each = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes in each[len(found) :]:
            axes.set_visible(False)
        for i, (axes, (problem, points)) in enumerate(zip(each, found.items(), strict=False)):
            for line, look in looks.items():
                chosen = of(points, OWN) if line == OWN else [p for p in points if p.line == line]
                pairs = front(chosen, problem.accuracies)
                axes.plot([time / problem.size for time, _ in pairs], [accuracy for _, accuracy in pairs], **look)
            axes.set(xscale="log", yscale="log", title=problem.title)
            axes.margins(x=0.05, y=0.05)
            low, high = axes.get_xlim()
            axes.set_xlim(min(low, 0.9 * 10.0 ** math.floor(math.log10(high))), high)  # with a whole power of ten
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.invert_yaxis()
            axes.title.set_fontsize(10.5)
            if i % columns == 0:
                axes.set_ylabel("largest angle error below [rad]")
            if i >= len(found) - columns:
                axes.set_xlabel("time per trajectory [s]")
        handles = [Line2D([], [], label=line, **look) for line, look in looks.items()]
        figure.legend(handles=handles, loc="outside lower center", ncols=5, fontsize=9.5, handlelength=3.4,
                    title="Further left is faster, further up more accurate. lab-pendulum: the best of its methods.")
        figure.suptitle("Cost of accuracy: one pendulum on one core, the cheapest setting of each solver", x=0.008,
                      ha="left", fontsize=13, color=INK)
    return style.save(figure, path, facts)


def _looks(found: Mapping[Problem, Sequence[Point]]) -> dict[str, dict[str, Any]]:
    """Return colour, dashes and marker of each solver; the line of this package is drawn last and widest."""
    lines = sorted({point.line for points in found.values() for point in points if not point.line.startswith(OWN)})
    looks: dict[str, dict[str, Any]] = {}
    for package in PEERS:
        for i, line in enumerate(line for line in lines if line.startswith(package)):
            looks[line] = {"color": COLOURS[package], "linestyle": DASHES[i % len(DASHES)], "linewidth": 1.4,
                           "marker": MARKS[i % len(MARKS)], "markersize": 4.0}
    return {**looks, OWN: {"color": COLOURS[OWN], "linewidth": 3.0, "marker": "o", "markersize": 5.0, "zorder": 4}}


