"""Figure of the matrix of hard cases (problems with known results) and methods, coloured by the outcome of runs."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from itertools import groupby
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.transforms import blended_transform_factory

from integrators import Method
from pendulum_env.hard_cases.case import ACCURATE, DIVERGED, OUTCOMES, REFUSED, STABLE, WRONG
from pendulum_env.hard_cases.matrix import Matrix, MatrixEntry
from pendulum_env.plots.style import blank, styled
from pendulum_env.plots.titles import width as width_of
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO, PAPER

CELL = 0.2
"""Side of a cell [inch]."""
LABEL = 8.5
"""Font size of the labels [points]."""
TOP, FOOT, RIGHT = 1.55, 0.95, 0.8
"""Space for the title and the names of families, for the legend, and for names that extend to the right [inch]."""
LEAST = 9.5
"""Minimum width of the figure [inch]."""
GAP, HEADING = 0.6, 1.2
"""Space between families of methods, and between groups of cases, where the group's name is written [cells]."""
LOOKS = {
    ACCURATE: (OKABE_ITO["sky_blue"], INK, "", "accurate"),
    STABLE: (OKABE_ITO["blue"], PAPER, "_", "stable, but not accurate"),
    DIVERGED: (OKABE_ITO["yellow"], INK, "^", "stopped and reported divergence"),
    REFUSED: ("#E4E4E4", FAINT_INK, ".", "refused: method does not support the scene"),
    WRONG: (OKABE_ITO["vermillion"], PAPER, "X", "wrong without a warning"),
}
"""Outcome -> colour of the cell, colour and shape of its mark, text; lightness and marks differ too, not only colours.
"""
FAILED, KNOWN = "-", (0, (1.2, 0.8))
"""Outlines of cells with an unexpected outcome, without and with a known reason."""


def draw(matrix: Matrix, figure: Figure | None = None) -> Figure:
    """Draw the matrix of hard cases, with one row per case, in groups, and one column per method, in families.

    The colour of a cell is the outcome of a run, and an outline marks a failure. Colours are those of Okabe & Ito 2008;
    outcomes also differ in lightness and mark. Runs that did not take place are left blank. ``figure`` is drawn into
    and resized; by default a new figure.
    """
    methods = _by_family(matrix.methods)
    columns = _places((method.family for method in methods), GAP)
    rows = _places((case.group for case in matrix.cases), HEADING)
    names = [case.name for case in matrix.cases]
    beside = _longest(names) + 0.7
    above = _longest(method.name for method in methods) + 0.15
    width = max(LEAST, beside + CELL * (columns[-1] + 1.5) + RIGHT)
    body = CELL * (rows[-1] + 2.0)
    height = body + above + TOP + FOOT
    with styled():
        drawing = blank((width, height), figure, None)
        wide = CELL * (columns[-1] + 1.5) / width
        axes = drawing.add_axes((beside / width, FOOT / height, wide, body / height))
        column = {method.name: x for method, x in zip(methods, columns, strict=True)}
        row = {id(case): y for case, y in zip(matrix.cases, rows, strict=True)}
        at = [(column[entry.method.name], row[id(entry.case)]) for entry in matrix.entries]
        _cells(axes, matrix.entries, at)
        axes.set(xlim=(-0.75, columns[-1] + 0.75), ylim=(rows[-1] + 0.6, -1.4))
        axes.set_xticks(columns, [method.name for method in methods], rotation=90, fontsize=LABEL)
        axes.set_yticks(rows, names, fontsize=LABEL)
        axes.tick_params(length=0, labeltop=True, labelbottom=False, pad=2)
        axes.grid(False)
        axes.spines[:].set_visible(False)
        _families(axes, methods, columns, above)
        _groups(axes, matrix, rows)
        drawing.legend(*_entries(matrix), loc="lower left", bbox_to_anchor=(0.0, 0.0), ncols=3, fontsize=9.5,
                    handlelength=1.4, columnspacing=2.0)
        drawing.text(0.12 / width, 1.0 - 0.12 / height, _title(matrix), fontsize=13, va="top")
    return drawing


def _longest(names: Iterable[str]) -> float:
    """Return the width of the longest of these labels, case or method names, in the figure of hard cases [inch]."""
    return max(width_of(name, LABEL) for name in names) / 72.0


def _by_family(methods: Sequence[Method]) -> list[Method]:
    """Return the methods sorted so that those of one family stand together."""
    families = list(dict.fromkeys(method.family for method in methods))
    return sorted(methods, key=lambda method: families.index(method.family))


def _places(kinds: Iterable[Hashable], gap: float) -> list[float]:
    """Return the positions of a matrix's rows or columns, 1 apart and with a further ``gap`` wherever the kind changes.
    """
    places: list[float] = []
    last: Hashable = None
    for kind in kinds:
        places.append(places[-1] + 1.0 + gap * (kind != last) if places else 0.0)
        last = kind
    return places


def _cells(axes: Axes, entries: Sequence[MatrixEntry], at: Sequence[tuple[float, float]]) -> None:
    """Draw the cells of the matrix of hard cases at the positions ``at``, with marks and with outlines of failures."""
    for outcome, (tone, ink, mark, _) in LOOKS.items():
        there = [place for entry, place in zip(entries, at, strict=True) if entry.finding.outcome == outcome]
        for x, y in there:
            axes.add_patch(Rectangle((x - 0.46, y - 0.46), 0.92, 0.92, facecolor=tone, linewidth=0.0))
        if mark and there:
            axes.plot([x for x, _ in there], [y for _, y in there], linestyle="none", marker=mark, markersize=5.0,
                      color=ink, zorder=2.2)
    for entry, (x, y) in zip(entries, at, strict=True):
        if not entry.expected:
            axes.add_patch(Rectangle((x - 0.47, y - 0.47), 0.94, 0.94, fill=False, edgecolor=INK, linewidth=1.8,
                                     linestyle=KNOWN if entry.known else FAILED, zorder=3.0, clip_on=False))


def _families(axes: Axes, methods: Sequence[Method], columns: Sequence[float], above: float) -> None:
    """Draw a line over the columns of every family of methods, and its name above, at an angle if it does not fit."""
    over = blended_transform_factory(axes.transData, axes.get_figure().dpi_scale_trans)  # type: ignore[union-attr]
    top = axes.get_position().y1 * axes.get_figure().get_size_inches()[1]  # type: ignore[union-attr]
    for family, members in groupby(zip(methods, columns, strict=True), key=lambda pair: pair[0].family):
        own = [x for _, x in members]
        first, last = own[0] - 0.45, own[-1] + 0.45
        axes.plot([first, last], [top + above] * 2, color=FAINT_INK, linewidth=1.2, clip_on=False, transform=over)
        fits = 72.0 * CELL * (last - first) > width_of(family, 9.5)
        axes.text(first, top + above + 0.06, family, fontsize=9.5, transform=over, ha="left", va="bottom",
                  rotation=0 if fits else 40, rotation_mode="anchor")


def _groups(axes: Axes, matrix: Matrix, rows: Sequence[float]) -> None:
    """Write the name of every group of hard cases above the rows of the group."""
    along = blended_transform_factory(axes.get_figure().dpi_scale_trans, axes.transData)  # type: ignore[union-attr]
    for group, members in groupby(zip(matrix.cases, rows, strict=True), key=lambda pair: pair[0].group):
        first = next(members)[1]
        axes.text(0.12, first - 0.95, group, fontsize=10.5, transform=along, ha="left", va="center")


def _entries(matrix: Matrix) -> tuple[list[Any], list[str]]:
    """Return the handles and texts of the legend of the matrix of hard cases, for the outcomes and outlines in it."""
    handles: dict[str, Any] = {}
    there = {entry.finding.outcome for entry in matrix.entries}
    for outcome in (outcome for outcome in OUTCOMES if outcome in there):
        tone, ink, mark, words = LOOKS[outcome]
        square = Line2D([], [], linestyle="none", marker="s", markersize=12, markerfacecolor=tone, markeredgewidth=0.0)
        handles[words] = (square, Line2D([], [], linestyle="none", marker=mark or "None", markersize=5, color=ink))
    failed = {bool(entry.known) for entry in matrix.entries if not entry.expected}
    for known in failed:
        handles["known failure" if known else "failure: unexpected outcome"] = Rectangle(
            (0.0, 0.0), 1.0, 1.0, fill=False, edgecolor=INK, linewidth=1.8, linestyle=KNOWN if known else FAILED)
    return list(handles.values()), list(handles)


def _title(matrix: Matrix) -> str:
    """Return the title of the figure of hard cases: numbers of cases, methods and failures."""
    size = f"{_count(len(matrix.cases), 'hard case')}, {_count(len(matrix.methods), 'method')}"
    failed = sum(not entry.expected for entry in matrix.entries)
    known = failed - len(matrix.failures)
    parts = [size, _count(len(matrix.failures), "failure") + (f" and {_count(known, 'known one')}" if known else "")]
    return " · ".join([*parts, *([] if matrix.complete else ["interrupted: blank cells did not run"])])


def _count(number: int, noun: str) -> str:
    """Return a number with a noun in singular or plural, such as "3 methods"."""
    return f"{number} {noun}{'s' * (number != 1)}"
