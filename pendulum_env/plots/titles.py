"""Titles, legends and notes of figures, broken into lines that fit."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.textpath import TextPath

from pendulum_env.physics.scene import Scene
from pendulum_env.plots.series import Span, check, whole
from pendulum_env.plots.style import blank, panel, styled
from pendulum_env.render.palette import FAINT_INK

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

COLUMNS, MARGIN = 3, 60.0
"""Largest number of columns of a legend; width beside the axes that tick labels and gaps take [points]."""
SCREEN = 100.0
"""Resolution at which widths of texts are measured [dots per inch], because letters are fitted to dots."""
EDGES, HEAD = 24.0, 13.0
"""Free width at the edges of a figure beside its title and note, and font size of the title [points]."""


@contextmanager
def page(
    size: tuple[float, float], given: Figure | None, title: str = "", note: str = "",
    layout: Literal["constrained"] | None = "constrained",
) -> Iterator[Figure]:
    """Yield a figure to draw in the package's style; at the end it gets a title and a note.

    The arguments ``size``, ``given`` and ``layout`` are those of :func:`pendulum_env.plots.style.blank`.
    """
    with styled():
        drawing = blank(size, given, layout)
        yield drawing
        if title:
            text = fitted(title, HEAD, 72.0 * drawing.get_figwidth() - EDGES)
            drawing.suptitle(text, x=0.008, ha="left", fontsize=HEAD)
        if note:
            footnote(drawing, note)


@contextmanager
def over_time(
    runs: Mapping[str, Rollout], span: Span | None, axes: Axes | None
) -> Iterator[tuple[Axes, Span]]:
    """Yield axes to draw runs into over time [s], and the span of time to show, by default all of it.

    At the end the axes get a title and a legend. Raises ValueError for runs that cannot be drawn.
    """
    check(runs)
    shown = span or whole(runs)
    with panel(axes) as at:
        yield at, shown
        at.set(xlabel="time [s]", xlim=shown, title=describe(runs))
        legend(at)


@lru_cache(maxsize=4096)
def for_figure(text: str) -> str:
    """Return a text from outside as Matplotlib is to draw it: every ``$`` as it is, not mathematics between two, and a
    white square for letters that the font lacks, of which Matplotlib would warn one by one."""
    font = get_font(_file())
    shown = "".join(c if c == "\n" or font.get_char_index(ord(c)) else "\N{WHITE SQUARE}" for c in text)
    shown = f" {shown}" if shown.startswith("_") else shown  # Matplotlib leaves labels that begin so out of legends
    return shown.replace("$", r"\$")


def named(label: str, run: Rollout) -> str:
    """Return a run's entry in the legend: its label, with the reason and the time [s] if the run stopped early."""
    return for_figure(f"{label} ({run.stop_reason}, {run.time[-1]:.3g} s)" if run.stop_reason else label)


def describe(runs: Mapping[str, Rollout]) -> str:
    """Return a title that describes the runs: scene, damping, start, step, and the method if there is only one.

    ``runs`` are rollouts by their labels. Angles are given in degrees, velocities in rad/s and steps in seconds.
    """
    first = next(iter(runs.values()))
    parts = setting(first.scene)
    if first.angle.size:
        parts.append(start(float(first.angle.flat[0]), float(first.velocity.flat[0])))
    steps = {stepping(run) for run in runs.values()}
    parts += steps if len(steps) == 1 else []
    parts += map(for_figure, runs) if len(runs) == 1 else []
    return " · ".join(parts)


def stepping(run: Rollout) -> str:
    """Return the step of a run as text for titles or, of adapted steps, the tolerance and the time between records."""
    if not run.tolerance:
        return f"dt = {run.dt:g} s"
    gap = run.time[1] if run.time.size > 1 else run.dt
    return f"rtol = {run.tolerance['rtol']:g}, recorded every {gap:.6g} s"


def start(angle: float, velocity: float = 0.0) -> str:
    """Return the start of a run as text for titles, from its angle [rad] and, unless it is 0, its velocity [rad/s]."""
    text = f"from {math.degrees(angle):.4g}°" + (f", {velocity:.4g} rad/s" if velocity else "")
    return text.replace("-", "\N{MINUS SIGN}")


def setting(scene: Scene) -> list[str]:
    """Return the parts of a figure's title that describe a scene: its name and its damping."""
    damping = "+".join(effect.damping for effect in scene.of_kind("dissipative"))
    return [for_figure(scene.name), f"{damping} damping" if damping else "no damping"]


@styled()
def legend(axes: Axes) -> None:
    """Draw a legend above the axes and below their title, in as many columns as fit; no legend for a single entry.

    A title that is wider than the axes is broken into lines.
    """
    labels, spec = axes.get_legend_handles_labels()[1], axes.get_subplotspec()
    share = 1.0 if spec is None else len(spec.colspan) / spec.get_gridspec().ncols
    room = share * 72.0 * axes.figure.bbox.width / axes.figure.dpi - MARGIN  # before the figure is laid out
    title = fitted(axes.get_title("left"), float(rcParams["axes.titlesize"]), room)
    if len(labels) < 2:
        axes.set_title(title, loc="left")
        return
    columns = next((n for n in range(COLUMNS, 1, -1) if _width(labels, n) <= room), 1)
    axes.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2, ncols=columns, columnspacing=1.4)
    axes.set_title(title, loc="left", pad=10.0 + 16.5 * -(-len(labels) // columns))


def _width(labels: Sequence[str], columns: int) -> float:
    """Return the width of a legend with a given number of columns [points], from its texts, line samples and gaps."""
    size = float(rcParams["legend.fontsize"])
    texts = [width(label, size) for label in labels]
    return sum(float(part.max(initial=0.0)) + 4.8 * size for part in np.array_split(np.array(texts), columns))


@lru_cache(maxsize=4096)
def width(text: str, size: float) -> float:
    """Return the width of a line of text at a font size, as on a screen [points]."""
    if "$" in text:
        with styled():
            return float(TextPath((0.0, 0.0), text, size=size).get_extents().width)
    font = get_font(_file())
    font.set_size(size, SCREEN)
    font.set_text(text, 0.0)
    return float(font.get_width_height()[0]) / 64.0 * 72.0 / SCREEN


@lru_cache(maxsize=1)
@styled()
def _file() -> str:
    """Return the path of the font file that the package's style sheet selects for text."""
    return findfont(FontProperties())


def fitted(text: str, size: float, room: float) -> str:
    """Break a text into lines no wider than ``room`` [points]: at " · ", else between words, else within words."""
    return "\n".join(broken for line in text.split("\n") for broken in _broken(line, size, room, (" · ", " ", "")))


def _broken(text: str, size: float, room: float, marks: Sequence[str]) -> list[str]:
    """Return the lines of a text, none wider than ``room`` [points], broken at as few of ``marks`` as possible.

    ``marks`` are separators from coarse to fine, with "" for a break within words; only pieces that are still too wide
    are broken at the next mark.
    """
    if not marks or width(text, size) <= room:
        return [text]
    mark, *finer = marks
    lines: list[str] = []
    for piece in text.split(mark) if mark else re.findall(r"\\\$|.", text):  # \$ is one letter
        longer = f"{lines[-1]}{mark}{piece}" if lines else piece
        if lines and width(longer, size) <= room:
            lines[-1] = longer
        else:
            lines += _broken(piece, size, room, finer)
    return lines


def footnote(figure: Figure, text: str, size: float = 9.5) -> None:
    """Write a note below a figure, broken into lines that fit."""
    figure.supxlabel(fitted(text, size, 72.0 * figure.get_figwidth() - EDGES), x=0.008, ha="left", fontsize=size,
                   color=FAINT_INK)
