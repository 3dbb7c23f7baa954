"""Figure of the matrix of hard cases (problems with known results) and methods, coloured by the outcome of runs."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from itertools import accumulate, groupby, pairwise
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.transforms import blended_transform_factory

from integrators import Method
from pendulum_env.hard_cases.case import ACCURATE, DIVERGED, OUTCOMES, REFUSED, STABLE, WRONG, Case
from pendulum_env.hard_cases.run import Matrix, MatrixEntry
from pendulum_env.plots.style import styled
from pendulum_env.plots.titles import fitted, for_figure, page
from pendulum_env.plots.titles import width as width_of
from pendulum_env.render.palette import FAINT_INK, INK, OKABE_ITO, PAPER

CELL, WIDEST, BREADTH = 0.2, 0.4, 4.0
"""Height and least width of a cell, its largest width, and the width up to which cells are widened [inch]."""
LABEL = 8.5
"""Font size of the labels [points]."""
HEAD, FLAT, SLANTED, BESIDE, RIGHT = 0.5, 0.3, 1.05, 0.35, 0.45
"""Space for the title, for the names of families, for those at an angle, to the left of the cases' names, and for
names that extend to the right [inch]."""
ENTRY, LINE = 3.5, 0.25
"""Width of an entry of the legend, and height of its lines [inch]."""
TALL, BROAD, LARGER = 60.0, 60, 1.5
"""Rows above which the methods' names stand below the cells, too; number of methods above which the cases' names stand
to the right, too; and the factor by which the title, names of groups and families, and legend are then larger."""
TALLEST = 1.3
"""A figure that would be higher than this multiple of its width has its groups of cases in several blocks."""
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


@styled()
def draw(matrix: Matrix, figure: Figure | None = None) -> Figure:
    """Draw the matrix of hard cases, with one row per case, in groups, and one column per method, in families.

    Of few methods, the groups stand in several blocks side by side, so that the figure is not a narrow strip.
    The colour of a cell is the outcome of a run, and an outline marks a failure. Colours are those of Okabe & Ito 2008;
    outcomes also differ in lightness and mark. Runs that did not take place are left blank. ``figure`` is drawn into
    and resized; by default a new figure.
    """
    families = [method.family for method in matrix.methods]
    methods = sorted(matrix.methods, key=lambda method: families.index(method.family))
    columns = _places((method.family for method in methods), GAP)
    cell = max(CELL, min(WIDEST, BREADTH / len(methods)))
    across = cell * (columns[-1] + 1.5)
    above = _longest(method.name for method in methods) + 0.15
    broad = len(methods) > BROAD
    larger = LARGER if broad else 1.0
    groups = [list(members) for _, members in groupby(matrix.cases, key=lambda case: case.group)]
    for count in range(1, len(groups) + 1):
        blocks = _blocks(groups, count)
        names = [_longest(case.name for case in block) + BESIDE for block in blocks]
        wide = [(1 + broad) * beside + across + RIGHT for beside in names]
        rows = [_places((case.group for case in block), HEADING) for block in blocks]
        width, high = max(sum(wide), ENTRY), CELL * (max(places[-1] for places in rows) + 2.0)
        if high <= TALLEST * width:
            break
    handles = _entries(matrix)
    entries_across = max(1, min(3, int(width / (ENTRY * larger))))
    foot = 0.15 + larger * LINE * -(-len(handles) // entries_across)
    title = fitted(_title(matrix), 13.0 * larger, 72.0 * (width - 0.24))
    flat = all(_fits(family, families.count(family), cell, larger) for family in families)
    tall = max(places[-1] for places in rows) > TALL
    low = foot + above * tall
    height = high + above + larger * ((FLAT if flat else SLANTED) + HEAD * (1 + title.count("\n"))) + low
    left, top = 0.0, low + high
    with page((width, height), figure, layout=None) as drawing:
        for block, places, own, beside in zip(blocks, rows, wide, names, strict=True):
            body = CELL * (places[-1] + 2.0)
            axes = drawing.add_axes(((left + beside) / width, (top - body) / height, across / width, body / height))
            column = {method.name: x for method, x in zip(methods, columns, strict=True)}
            row = {id(case): y for case, y in zip(block, places, strict=True)}
            entries = [entry for entry in matrix.entries if id(entry.case) in row]
            _cells(axes, entries, [(column[entry.method.name], row[id(entry.case)]) for entry in entries])
            axes.set(xlim=(-0.75, columns[-1] + 0.75), ylim=(places[-1] + 0.6, -1.4))
            axes.set_xticks(columns, [for_figure(method.name) for method in methods], rotation=90, fontsize=LABEL)
            axes.set_yticks(places, [case.name for case in block], fontsize=LABEL)
            axes.tick_params(length=0, labeltop=True, labelbottom=tall, labelright=broad, pad=2)
            axes.grid(False)
            axes.spines[:].set_visible(False)
            _families(axes, methods, columns, above, cell, larger)
            _groups(axes, block, places, left + 0.12, larger)
            left += own
        drawing.legend([*handles.values()], [*handles], loc="lower left", bbox_to_anchor=(0.0, 0.0),
                       ncols=entries_across, fontsize=9.5 * larger, handlelength=1.4, columnspacing=2.0)
        drawing.text(0.12 / width, 1.0 - 0.12 / height, title, fontsize=13.0 * larger, va="top")
    return drawing


def _blocks(groups: Sequence[Sequence[Case]], count: int) -> list[list[Case]]:
    """Return the cases of the figure's blocks, which stand side by side: whole groups, in order, of similar height."""
    sizes = [len(group) + HEADING for group in groups]
    blocks: list[list[Case]] = [[] for _ in range(count)]
    for i, group in enumerate(groups):
        middle = sum(sizes[:i]) + 0.5 * sizes[i]
        blocks[int(count * middle / sum(sizes))] += group
    return [block for block in blocks if block]


def _longest(names: Iterable[str]) -> float:
    """Return the width of the longest of these labels, case or method names, in the figure of hard cases [inch]."""
    return max(width_of(name, LABEL) for name in names) / 72.0


def _places(kinds: Iterable[Hashable], gap: float) -> list[float]:
    """Return the positions of a matrix's rows or columns, 1 apart and with a further ``gap`` wherever the kind changes.
    """
    steps = [1.0 + gap * (kind != before) for before, kind in pairwise(kinds)]
    return list(accumulate(steps, initial=0.0))


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


def _families(axes: Axes, methods: Sequence[Method], columns: Sequence[float], above: float, cell: float,
              larger: float) -> None:
    """Draw a line over the columns of every family of methods, and its name above, at an angle if it does not fit.

    ``above`` is the height of the methods' names, and ``cell`` the width of a column [inch]; ``larger`` the factor of
    the font size.
    """
    over = blended_transform_factory(axes.transData, axes.get_figure().dpi_scale_trans)  # type: ignore[union-attr]
    top = axes.get_position().y1 * axes.get_figure().get_size_inches()[1]  # type: ignore[union-attr]
    for family, members in groupby(zip(methods, columns, strict=True), key=lambda pair: pair[0].family):
        own = [x for _, x in members]
        first, last = own[0] - 0.45, own[-1] + 0.45
        axes.plot([first, last], [top + above] * 2, color=FAINT_INK, linewidth=1.2, clip_on=False, transform=over)
        fits = _fits(family, len(own), cell, larger)
        axes.text(first, top + above + 0.06, family, fontsize=9.5 * larger, transform=over, ha="left", va="bottom",
                  rotation=0 if fits else 50, rotation_mode="anchor")


def _fits(family: str, columns: int, cell: float, larger: float) -> bool:
    """Return True if a family's name fits above its columns, which are ``cell`` [inch] wide."""
    return 72.0 * cell * (columns - 0.1) > width_of(family, 9.5 * larger)


def _groups(axes: Axes, block: Sequence[Case], rows: Sequence[float], left: float, larger: float) -> None:
    """Write the name of every group of hard cases above the rows of the group, from ``left`` [inch] on."""
    along = blended_transform_factory(axes.get_figure().dpi_scale_trans, axes.transData)  # type: ignore[union-attr]
    for group, members in groupby(zip(block, rows, strict=True), key=lambda pair: pair[0].group):
        first = next(members)[1]
        axes.text(left, first - 0.95, group, fontsize=10.5 * larger, transform=along, ha="left", va="center")


def _entries(matrix: Matrix) -> dict[str, Any]:
    """Return the legend of the matrix of hard cases, text -> handle, for the outcomes and outlines in it."""
    handles: dict[str, Any] = {}
    there = {entry.finding.outcome for entry in matrix.entries}
    for outcome in [one for one in OUTCOMES if one in there]:
        tone, ink, mark, words = LOOKS[outcome]
        square = Line2D([], [], linestyle="none", marker="s", markersize=12, markerfacecolor=tone, markeredgewidth=0.0)
        handles[words] = (square, Line2D([], [], linestyle="none", marker=mark or "None", markersize=5, color=ink))
    for known in {bool(entry.known) for entry in matrix.entries if not entry.expected}:
        handles["known failure" if known else "failure: unexpected outcome"] = Rectangle(
            (0.0, 0.0), 1.0, 1.0, fill=False, edgecolor=INK, linewidth=1.8, linestyle=KNOWN if known else FAILED)
    return handles


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
