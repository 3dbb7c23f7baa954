"""How figures look: the style sheet, colours and line styles of methods, and saving."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from matplotlib import rc_params_from_file, style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, Stroke

from integrators import METHODS
from pendulum_env.common.replacing import replacing
from pendulum_env.render import palette
from pendulum_env.render.palette import FAINT_INK, METHOD_COLOURS, OKABE_ITO, colour, hue

if TYPE_CHECKING:
    from pendulum_env.engine.rollout import Rollout

SHEET = Path(__file__).with_name("figures.mplstyle")
WIDE = (8.0, 4.5)
"""Size of a figure with one pair of axes [inch]."""

LINES: tuple[tuple[Any, float], ...] = (
    ("-", 2.8),
    ((0, (5, 2)), 2.2),
    ((0, (1, 1.6)), 2.0),
    ((0, (6, 1.5, 1.2, 1.5)), 1.8),
    ((0, (2.5, 2.5)), 1.6),
)
"""Dashes and width; where curves lie on one another, those further down the list are on top and let the others show."""
MARKS = ("", "o", "s", "^", "D", "v")
"""Marks of the first, second, ... method of one colour, on curves that are drawn solid."""
FURTHER = ("#882255", "#7A4B1E", "#6B7A1E", "#8C8C8C")
"""Further colours, for a crowded figure: P. Tol's wine, and a brown, an olive and a grey."""
DARKER = {OKABE_ITO["yellow"]: "#C7B400"}
"""What stands for a colour that thin lines on white do not show."""
THINNER = 0.75
"""Each further curve of the same dashes in a figure is so much thinner."""


class Look(NamedTuple):
    """Colour, dashes, mark, line width, width if solid, and place in the pile of one curve.

    Where a colour has more methods than dashes, or than marks, further ones have both: ``more_dashes``, ``more_mark``.
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
        """As ``Axes.plot`` takes it."""
        line = {"color": self.colour, "linestyle": self.dashes, "linewidth": self.width, "zorder": self.height}
        return {**line, **_marked(self.more_mark), **self.edge()}

    @property
    def solid(self) -> dict[str, Any]:
        """The same with marks for dashes, for curves that run over themselves; narrow ones on top."""
        solid = {"color": self.colour, "linestyle": self.more_dashes, "linewidth": self.solid_width}
        return {**solid, "zorder": 3.0 - 0.1 * self.solid_width, **_marked(self.mark), **self.edge(self.solid_width)}

    def edge(self, width: float = 0.0) -> dict[str, Any]:
        """A thin dark edge, as artists take it, for a colour that is too pale on white; of a line so wide [points]."""
        if self.colour not in DARKER:
            return {}
        return {"path_effects": [Stroke(linewidth=(width or self.width) + 0.9, foreground=FAINT_INK), Normal()]}


def _marked(mark: str) -> dict[str, Any]:
    return {"marker": mark, "markersize": 4.0, "markevery": 0.15} if mark else {}


@contextmanager
def styled() -> Iterator[None]:
    """The package's style sheet on top of the caller's settings, which are restored afterwards."""
    with style.context(_sheet()):
        yield


@lru_cache(maxsize=1)
def _sheet() -> Any:
    return rc_params_from_file(SHEET, use_default_template=False)


def figure(rows: int = 1, *, size: tuple[float, float] | None = None, **ratios: Any) -> tuple[Figure, list[Axes]]:
    """An off-screen figure of ``size`` [inch] with axes below one another; ``ratios`` as for ``Figure.subplots``."""
    made = blank(size or (WIDE[0], WIDE[1] * (1.0 + 0.62 * (rows - 1))))
    with styled():
        return made, list(made.subplots(rows, 1, squeeze=False, **ratios)[:, 0])


def blank(
    size: tuple[float, float], given: Figure | None = None, layout: Literal["constrained"] | None = "constrained"
) -> Figure:
    """A figure of ``size`` [inch] without axes; one that is given gets the size and the layout, and is returned."""
    with styled():
        if given is None:
            made = Figure(figsize=size, layout=layout)
            FigureCanvasAgg(made)
            return made
        given.set_size_inches(*size)
        given.set_layout_engine(layout or "none")
        return given


def place(name: str) -> int:
    """A method's place in :data:`integrators.METHODS`, which its colour and dashes follow from, whatever else is drawn.

    A method that is not registered has a place of its own behind them all, found from its name.
    """
    return palette.place(name, list(METHODS))


def colours(names: Iterable[str]) -> dict[str, str]:
    """Colour "#RRGGBB" of each method: that of its :func:`place`, the same in every figure and film."""
    return {name: colour(place(name)) for name in names}


def distinct(names: Iterable[str]) -> dict[str, str]:
    """Colours of up to a dozen methods in one crowded figure, none twice: their own, or one that is free."""
    found: dict[str, str] = {}
    for name, tone in colours(names).items():
        free = [other for other in (*METHOD_COLOURS, *FURTHER) if DARKER.get(other, other) not in found.values()]
        found[name] = DARKER.get(tone, tone)
        if found[name] in list(found.values())[:-1]:
            found[name] = DARKER.get(free[0], free[0]) if free else found[name]
    return found


def looks(runs: Mapping[str, Rollout]) -> dict[str, Look]:
    """How each run is drawn, see :func:`looks_of`."""
    return looks_of({label: run.method.name for label, run in runs.items()})


def looks_of(names: Mapping[str, str]) -> dict[str, Look]:
    """How the curves of methods are drawn, by label -> method's name.

    Colour, dashes and mark are the method's; widths are such that curves do not hide one another. A further curve of
    the same method has the next dashes.
    """
    found: dict[str, Look] = {}
    methods: list[str] = []
    kinds: list[int] = []
    for label, name in names.items():
        tone, turn = hue(place(name))
        again = methods.count(name)
        kind = (tone + 2 * turn + again) % len(LINES)
        dashes, width = LINES[kind]
        thin = THINNER ** kinds.count(kind)
        mark = MARKS[(turn + again) % len(MARKS)]
        more = LINES[(turn + again) // len(MARKS) % len(LINES)][0], MARKS[(turn + again) // len(LINES) % len(MARKS)]
        solid = max(1.0, LINES[0][1] - 0.45 * len(found))
        height = 2.0 + 0.1 * kind + 0.01 * kinds.count(kind)
        found[label] = Look(METHOD_COLOURS[tone], dashes, mark, *more, width * thin, solid, height)
        methods.append(name)
        kinds.append(kind)
    return found


def save(made: Any, path: str | os.PathLike[str], facts: Mapping[str, str] | None = None) -> Path:
    """Write a figure as PNG or SVG, by the file's ending, whole or not at all; ``facts`` go into its metadata.

    Raises ValueError for another ending, OSError where the file cannot be written.
    """
    target = Path(path)
    said = dict(facts or {})
    if target.suffix == ".png":
        metadata: dict[str, Any] = said
    elif target.suffix == ".svg":
        software = said.get("Software", "lab-pendulum")
        metadata = {"Creator": software, "Description": json.dumps(said, ensure_ascii=False), "Date": None}
    else:
        raise ValueError(f"A figure's name must end in .png or .svg, not {target.name!r}.")
    with styled(), replacing(target) as temporary:
        made.savefig(temporary, metadata=metadata)
    return target


def save_all(made: Any, stem: Path, facts: Mapping[str, str], svg: bool = True) -> list[Path]:
    """The same as ``stem.png`` and, if asked for, ``stem.svg``; return the paths."""
    return [save(made, stem.with_name(f"{stem.name}.{ending}"), facts) for ending in ("png", "svg")[: 1 + svg]]
