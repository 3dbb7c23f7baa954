"""The style of all figures: style sheet, colours and line styles of methods, and saving."""

from __future__ import annotations

import io
import json
import math
import os
import re
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from matplotlib import rc_params_from_file, style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke
from matplotlib.ticker import Formatter

from integrators import METHODS
from pendulum_env.common.replacing import replacing
from pendulum_env.common.texts import clean
from pendulum_env.render import palette
from pendulum_env.render.palette import FAINT_INK, METHOD_COLOURS, OKABE_ITO, colour, hues

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

STYLE: Any = rc_params_from_file(Path(__file__).with_name("figures.mplstyle"), use_default_template=False)
"""Settings of the package's style sheet."""
HEAVY = 1_000_000
"""Size of an SVG [bytes] beyond which a notebook shows the figure as PNG."""
WIDE = (8.0, 4.5)
"""Size of a figure with one pair of axes [inch]."""
BESIDE = 1.3
"""Room left of the axes, for the numbers and the label of the vertical axis [inch]."""

LINES: tuple[tuple[Any, float], ...] = (
    ("-", 2.8),
    ((0, (5, 2)), 2.2),
    ((0, (1, 1.6)), 2.0),
    ((0, (6, 1.5, 1.2, 1.5)), 1.8),
    ((0, (2.5, 2.5)), 1.6),
)
"""Dash patterns and widths of curves. Curves with entries further down the list are drawn on top; they are thinner or
have wider gaps, so that coinciding curves below remain visible."""
MARKS = ("", "o", "s", "^", "D", "v")
"""Markers that distinguish the methods of one colour on curves that are drawn solid."""
FURTHER = ("#882255", "#7A4B1E", "#6B7A1E", "#8C8C8C")
"""Additional colours for figures with many methods: P. Tol's wine, and a brown, an olive and a grey."""
DARKER = {OKABE_ITO["yellow"]: "#C7B400"}
"""Darker replacements of colours that are too pale for thin lines on white."""
ALONE = 2.0
"""Width of a curve that is alone in its figure."""
THINNER = 0.75
"""Factor on the width of every further curve with the same dash pattern in a figure."""


NUMBER = re.compile(r"\$\\mathdefault\{([^{}$\\^]*)(?:\^\{([^{}]*)\})?\}\$")
"""A tick label as Matplotlib's formatters write it: a number, or a power of ten."""
RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
"""Digits and sign of an exponent -> letters of the font."""


class Look(NamedTuple):
    """Style of one curve: colour, dash pattern, marker, widths when dashed and when solid, ``height`` (drawing order).

    If more methods share a colour than there are dash patterns, the further ones also get the marker ``more_mark``; if
    more share it than there are markers, they also get ``more_dashes``.
    """

    colour: str
    dashes: Any
    mark: str
    more_dashes: Any
    more_mark: str
    width: float
    solid_width: float
    height: float

    @property
    def line(self) -> dict[str, Any]:
        """Keyword arguments of ``Axes.plot`` for a curve with this style's dashes."""
        return {"color": self.colour, "linestyle": self.dashes, "linewidth": self.width, "zorder": self.height,
                **_marked(self.more_mark), **self.edge()}

    @property
    def solid(self) -> dict[str, Any]:
        """Keyword arguments of ``Axes.plot`` with this style's markers, not dashes, for curves that cross themselves.

        Narrow curves are on top.
        """
        return {"color": self.colour, "linestyle": self.more_dashes, "linewidth": self.solid_width,
                "zorder": 3.0 - 0.1 * self.solid_width, **_marked(self.mark), **self.edge(self.solid_width)}

    def edge(self, width: float = 0.0) -> dict[str, Any]:
        """Return keyword arguments for a thin dark edge of a curve if its colour is too pale on white, else none.

        ``width`` is the width of the line that gets the edge [points]; 0 for the width of this style.
        """
        if self.colour not in DARKER:
            return {}
        return {"path_effects": [Stroke(linewidth=(width or self.width) + 0.9, foreground=FAINT_INK), Normal()]}


def _marked(mark: str) -> dict[str, Any]:
    """Return keyword arguments of ``Axes.plot`` for markers along a curve; none for an empty ``mark``."""
    return {"marker": mark, "markersize": 4.0, "markevery": 0.15} if mark else {}


@contextmanager
def styled() -> Iterator[None]:
    """Apply the package's style sheet within a ``with`` block; the caller's settings are restored afterwards.

    The sheet stands on Matplotlib's defaults, whatever style the caller has chosen, as "dark_background".
    """
    with style.context(["default", STYLE]):
        yield


@styled()
def figure(rows: int = 1, *, size: tuple[float, float] | None = None, **ratios: Any) -> tuple[Figure, list[Axes]]:
    """Return an off-screen figure of ``size`` [inch] and its axes, one below the other.

    ``ratios`` are keyword arguments of ``Figure.subplots``, such as ``height_ratios``.
    """
    drawing = blank(size or (WIDE[0], WIDE[1] * (1.0 + 0.62 * (rows - 1))))
    return drawing, list(drawing.subplots(rows, 1, squeeze=False, **ratios)[:, 0])


@contextmanager
def panel(axes: Axes | None, size: tuple[float, float] | None = None) -> Iterator[Axes]:
    """Yield axes to draw into in the package's style: the given ones or, for None, those of a new figure."""
    with styled():
        yield axes if axes is not None else figure(size=size)[1][0]


class ShownFigure(Figure):
    """A figure that notebooks show, as SVG, without pyplot, which would show it a second time.

    It is drawn and saved in the package's style, because Matplotlib makes ticks and their labels only then.
    """

    @styled()
    def draw(self, renderer: Any) -> None:
        """Draw the figure."""
        with plain_labels(self):
            super().draw(renderer)

    @styled()
    def savefig(self, *args: Any, **keywords: Any) -> None:
        """Save the figure; the arguments are those of Matplotlib."""
        super().savefig(*args, **keywords)

    def as_html(self) -> str:
        """Return the figure as an image in HTML: SVG, or PNG if the SVG is larger than 1 MB (HEAVY)."""
        kind, file = "svg+xml", io.BytesIO()
        self.savefig(file, format="svg", metadata={"Date": None})
        if file.tell() > HEAVY:
            kind, file = "png", io.BytesIO()
            self.savefig(file, format="png")
        source = f"data:image/{kind};base64,{b64encode(file.getvalue()).decode('ascii')}"
        return f'<img alt="figure" style="max-width: 100%; background: white" src="{source}">'

    _repr_html_ = as_html


class Rewritten(Formatter):
    """Tick labels of another formatter, each changed by a function."""

    def __init__(self, usual: Formatter, rewrite: Callable[[str], str]) -> None:
        self.usual, self.rewrite = usual, rewrite

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.rewrite(self.usual(x, pos))

    def format_ticks(self, values: Any) -> list[str]:
        return [self.rewrite(label) for label in self.usual.format_ticks(values)]

    def get_offset(self) -> str:
        return self.rewrite(self.usual.get_offset())

    def set_locs(self, locs: Any) -> None:
        self.usual.set_locs(locs)


def plain(label: str) -> str:
    """Return a number or a power of ten as text, such as "10⁻³", if it is written as mathematics; others as they are.
    """
    number = NUMBER.fullmatch(label)
    return label if number is None else number[1] + (number[2] or "").translate(RAISED)


@contextmanager
def plain_labels(made: Any) -> Iterator[None]:
    """Write a figure's numbers at ticks as text in a ``with`` block; the axes' own formatters are restored afterwards.

    Matplotlib lays out text ten times as fast as mathematics, and most mathematics in a figure are its numbers.
    """
    ticks = [ticks for axes in made.axes for axis in (axes.xaxis, axes.yaxis) for ticks in (axis.major, axis.minor)]
    usual = [(one, one.formatter) for one in ticks]
    for one, formatter in usual:
        one.formatter = Rewritten(formatter, plain)
    try:
        yield
    finally:
        for one, formatter in usual:
            one.formatter = formatter


@styled()
def blank(
    size: tuple[float, float], given: Figure | None = None, layout: Literal["constrained"] | None = "constrained"
) -> Figure:
    """Return an off-screen figure of ``size`` [inch] without axes; a given figure gets the size and the layout."""
    if given is None:
        given = ShownFigure(figsize=size, layout=layout)
        FigureCanvasAgg(given)
    else:
        given.set_size_inches(*size)
        given.set_layout_engine(layout or "none")
    return given


def legend_above(at: Axes, columns: int, fontsize: float | None = None) -> None:
    """Draw a legend above the axes, in so many columns at most as fit into the figure."""
    for number in range(columns, 0, -1):
        legend = at.legend(loc="lower left", bbox_to_anchor=(-0.01, 1.0), borderaxespad=0.2, ncols=number,
                           fontsize=fontsize)
        if legend.get_window_extent().width < at.figure.bbox.width - BESIDE * at.figure.dpi:
            break


def decades(low: float, high: float) -> tuple[float, float]:
    """Return the limits of a logarithmic axis, widened if fewer than two powers of ten lie within them."""
    first, last = math.ceil(math.log10(low)), math.floor(math.log10(high))
    if last > first:
        return low, high
    return 10.0 ** math.floor(math.log10(low)), 10.0 ** math.ceil(math.log10(high))


def logarithmic(axes: Axes) -> None:
    """Make the vertical axis of finished curves logarithmic, with two powers of ten or more as tick labels."""
    axes.set_yscale("log")
    axes.minorticks_off()
    axes.set_ylim(*decades(*axes.get_ylim()))


def place(name: str) -> int:
    """Return a method's index in :data:`integrators.METHODS`, which alone determines its colour and dash pattern.

    A method that is not registered gets a larger index that is calculated from its name.
    """
    return palette.place(name, list(METHODS))


def colours(names: Iterable[str]) -> dict[str, str]:
    """Return the colour "#RRGGBB" of every named method in a figure or film of these methods.

    A method has its own colour, unless one before it has that colour, so that up to eight colours differ.
    """
    names = list(names)
    tones = palette.colours(map(place, names))
    return {name: tones[place(name)] for name in names}


def distinct(names: Iterable[str]) -> dict[str, str]:
    """Return different colours for up to a dozen methods in one figure, by name, none too pale for a thin line."""
    tones: dict[str, str] = {}
    for name, tone in colours(names).items():
        own = DARKER.get(tone, tone)
        free = [other for other in FURTHER if other not in tones.values()]
        tones[name] = free[0] if own in tones.values() and free else own
    return tones


def looks(runs: Mapping[str, Rollout]) -> dict[str, Look]:
    """Return the curve style of every run by its label, so that a method has the same style in all figures."""
    return looks_of({label: run.method.name for label, run in runs.items()})


def looks_of(names: Mapping[str, str]) -> dict[str, Look]:
    """Return the curve style of every label of ``names``, a dict of methods' names by label.

    Colour (see :func:`colours`), dash pattern and marker are those of the method, but a curve that is alone is solid
    and has no marker. Widths are chosen so that curves do not hide each other. A second curve of one method gets the
    next dash pattern.
    """
    if len(names) == 1:
        (label, name), = names.items()
        return {label: Look(colour(place(name)), "-", "", "-", "", ALONE, ALONE, 2.0)}
    styles: dict[str, Look] = {}
    methods: list[str] = []
    kinds: list[int] = []
    tones = hues(map(place, names.values()))
    for label, name in names.items():
        tone, turn = tones[place(name)]
        turns = turn + methods.count(name)
        kind = (tone + turn + turns) % len(LINES)
        dashes, width = LINES[kind]
        styles[label] = Look(
            METHOD_COLOURS[tone], dashes, MARKS[turns % len(MARKS)], LINES[turns // len(MARKS) % len(LINES)][0],
            MARKS[turns // len(LINES) % len(MARKS)], width * THINNER ** kinds.count(kind),
            max(1.0, LINES[0][1] - 0.45 * len(styles)), 2.0 + 0.1 * kind + 0.01 * kinds.count(kind))
        methods.append(name)
        kinds.append(kind)
    return styles


@styled()
def save(made: Any, path: str | os.PathLike[str], facts: Mapping[str, str] | None = None) -> Path:
    """Write a figure as PNG or SVG, depending on the file's ending, with ``facts`` as metadata; return its path.

    An error leaves no incomplete file. Raises ValueError for another ending, OSError if the file cannot be written.
    """
    target = Path(path)
    texts = {name: clean(text, None) for name, text in (facts or {}).items()}
    if target.suffix not in (".png", ".svg"):
        raise ValueError(f"A figure's name must end in .png or .svg, not {target.name!r}.")
    metadata: Mapping[str, Any] = texts if target.suffix == ".png" else {
        "Creator": texts.get("Software", "lab-pendulum"), "Description": json.dumps(texts, ensure_ascii=False),
        "Date": None}
    with replacing(target) as temporary:
        made.savefig(temporary, metadata=metadata)
    return target


def save_all(made: Any, stem: Path, facts: Mapping[str, str], svg: bool = True) -> list[Path]:
    """Write a figure as ``stem.png`` and, unless ``svg`` is False, as ``stem.svg``; return the paths.

    The figure is laid out once, for both. Raises OSError if a file cannot be written.
    """
    with laid_out(made):
        return [save(made, stem.with_name(f"{stem.name}.{ending}"), facts) for ending in ("png", "svg")[: 1 + svg]]


@contextmanager
def laid_out(made: Any) -> Iterator[None]:
    """Lay a figure out for the resolution in which it is saved, and keep the places of its axes in a ``with`` block.

    Otherwise Matplotlib lays the figure out for every file, and draws it once more to do so.
    """
    engine, shown = made.get_layout_engine(), made.dpi
    if engine is None:
        yield
        return
    with styled(), plain_labels(made):
        made.dpi = STYLE["savefig.dpi"]
        engine.execute(made)
        made.set_layout_engine(None)  # "none" would have the figure drawn once more, too
    try:
        with plain_labels(made):
            yield
    finally:
        made.set_layout_engine(engine)
        made.dpi = shown
