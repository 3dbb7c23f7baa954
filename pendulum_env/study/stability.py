"""Methods alone: how long their steps may be, how they err on an oscillation, as figures and a table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import integrators as registry
from integrators import Method, MethodError
from integrators.analysis import leading_error, stability_function
from pendulum_env.common.progress import Progress, told_by
from pendulum_env.common.provenance import output_folder, provenance, write_csv
from pendulum_env.common.tables import Table
from pendulum_env.engine.starts import listed_methods, none_twice
from pendulum_env.study.lists.methods import SOFT, entry, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_CURVES, MOST_MAPS = 12, 23
"""Methods in one figure; with more there are several."""
COLUMNS = (
    "method", "order", "forces_per_step", "omega0_h_limit", "omega0_h_limit_per_force", "gamma_h_limit",
    "gamma_h_limit_per_force", "leading_error",
)


@dataclass(frozen=True)
class Stability:
    """Methods whose stability is to be shown, in the order asked for."""

    methods: tuple[Method, ...]

    @property
    def rows(self) -> list[list[Any]]:
        """A row for each method, as COLUMNS names them; "" where nothing is known, per force for explicit methods."""
        found = []
        for method in self.methods:
            about = entry(method)
            row: list[Any] = [method.name, method.order, method.evaluations]
            for limit in (about.oscillation_limit, about.damping_limit):
                row.append("" if limit is None else limit)
                row.append("" if limit is None or method.implicit else limit / method.evaluations)
            found.append([*row, leading_error(method).text])
        return found

    @property
    def table(self) -> Table:
        """The rows as text."""
        head = ("method", "order", "forces", "omega0 h", "per force", "gamma h", "per force", "leading error")
        return Table(head, tuple(tuple(_cell(value) for value in row) for row in self.rows))

    @property
    def notes(self) -> str:
        """What the limits are, and which methods some figures leave out."""
        lines = ["omega0 h: the longest step without growth on the undamped oscillator; gamma h: under drag alone, or, "
                 f"in methods with backward sub-steps, at omega0 h = {SOFT:g}."]
        for kept, what in ((self.tables, "Without a stability function, which Runge-Kutta methods have"),
                           (self.dragged, "Without drag, and so not in the maps of damping")):
            rest = [method.name for method in self.methods if method not in kept]
            lines += [f"{what}: {', '.join(rest)}."] if rest else []
        return "\n".join(lines)

    @property
    def tables(self) -> list[Method]:
        """Those with a stability function."""
        return [method for method in self.methods if _has_function(method)]

    @property
    def dragged(self) -> list[Method]:
        """Those that take drag."""
        return [method for method in self.methods if "velocity_free" not in method.needs]

    def figures(self) -> Iterator[tuple[str, Callable[[], Figure]]]:
        """Names of the figures and what draws each: "regions", "oscillation" and "damping", numbered if many."""
        from pendulum_env.plots import stability as plots

        kinds = (("regions", plots.regions, self.tables, MOST_CURVES),
                 ("oscillation", plots.oscillation, self.methods, MOST_CURVES),
                 ("damping", plots.damped, self.dragged, MOST_MAPS))
        for name, draw, methods, most in kinds:
            parts = split_evenly(methods, most)
            for i, part in enumerate(parts, start=1):
                yield (f"{name}_{i}" if len(parts) > 1 else name), lambda draw=draw, part=part: draw(part)  # type: ignore[misc]


def _has_function(method: Method) -> bool:
    try:
        stability_function(method, 0.0)
    except MethodError:
        return False
    return True


def _cell(value: Any) -> str:
    if value == "":
        return "-"
    return shown(value) if isinstance(value, float) else str(value)


def split_evenly(methods: Sequence[Method], most: int) -> list[Sequence[Method]]:
    """Split methods into parts of nearly equal size, none larger than ``most``."""
    count = math.ceil(len(methods) / most)
    edges = [round(i * len(methods) / count) for i in range(count + 1)] if count else [0]
    return [methods[low:high] for low, high in pairwise(edges)]


def stability(integrators: str | Iterable[str | Method]) -> Stability:
    """Methods to be shown: names or methods, or one string with commas between names.

    Raises MethodError for an unknown name, one that is there twice, or none at all.
    """
    names = listed_methods(integrators)
    return Stability(tuple(none_twice(m if isinstance(m, Method) else registry.get(m) for m in names)))


def write(found: Stability, folder: str | Path, progress: Progress | None = None) -> list[Path]:
    """Write the figures (PNG and SVG) and ``stability.csv``; return the paths. OutputError if it cannot."""
    from pendulum_env.plots import save_all

    place, tell = output_folder(folder), told_by(progress)
    facts = provenance(integrators=[method.name for method in found.methods])
    figures = list(found.figures())
    paths = []
    for i, (name, draw) in enumerate(figures):
        tell(i / len(figures), f"drawing {name}")
        paths += save_all(draw(), place / name, {**facts, "Title": name})
    paths.append(place / "stability.csv")
    write_csv(paths[-1], COLUMNS, found.rows, facts)
    return paths
