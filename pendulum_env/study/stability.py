"""Stability limits and oscillation errors of integrators, independent of any scene, as figures and a table."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import integrators as registry
from integrators import Method, MethodError
from integrators.analysis import leading_error, stability_function
from pendulum_env.common.provenance import provenance
from pendulum_env.common.results import Columns, Result, columns_of, one_line
from pendulum_env.common.texts import Table
from pendulum_env.engine.starts import listed_methods, none_twice
from pendulum_env.study.lists.methods import SOFT, entry, shown

__all__ = ["Stability", "split_evenly", "stability"]

MOST_CURVES, MOST_MAPS = 12, 23
"""Largest number of methods in one figure of curves and in one figure of maps; more are spread over several."""
COLUMNS = (
    "method", "order", "forces_per_step", "omega0_h_limit", "omega0_h_limit_per_force", "gamma_h_limit",
    "gamma_h_limit_per_force", "leading_error",
)


@dataclass(frozen=True, repr=False)
class Stability(Result):
    """Stability limits of a list of integrators: as rows of numbers, as a table of text, and as figures."""

    methods: tuple[Method, ...]
    titled = True

    def __repr__(self) -> str:
        return one_line(self, ", ".join(method.name for method in self.methods))

    def origin(self) -> Mapping[str, str]:
        """Return the methods, with what computed their limits."""
        return provenance(integrators=[method.name for method in self.methods])

    def tables(self) -> Mapping[str, Columns]:
        """Return the table of stability limits."""
        return {"stability": columns_of(dict.fromkeys(COLUMNS, ""), self.rows)}

    def pictures(self) -> Mapping[str, str]:
        """Return the kind of each figure, by the name of its file."""
        return {name: name for name in self.figures}

    @property
    def rows(self) -> list[list[Any]]:
        """Rows of the table of stability limits: method, order, force evaluations, limits and leading error.

        An unknown limit is None. Limits per force evaluation are given for explicit methods only.
        """
        rows = []
        for method in self.methods:
            about = entry(method)
            limits = [(limit, None if limit is None or method.implicit else limit / method.evaluations)
                      for limit in (about.oscillation_limit, about.damping_limit)]
            rows.append([method.name, method.order, method.evaluations, *limits[0], *limits[1],
                         leading_error(method).text])
        return rows

    @property
    def table(self) -> Table:
        """Table of the stability limits, with the numbers as text."""
        head = ("method", "order", "forces", "omega0 h", "per force", "gamma h", "per force", "leading error")
        return Table(head, tuple(tuple(_cell(value) for value in row) for row in self.rows))

    @property
    def text(self) -> str:
        """Text that defines the limits in the table and lists the methods that some figures leave out."""
        lines = ["omega0 h: the longest stable step h on the undamped oscillator of frequency omega0; gamma h: the "
                 "longest stable step under linear drag of rate gamma alone (for methods with backward sub-steps, at "
                 f"omega0 h = {SOFT:g})."]
        for drawn, heading in ((self.drawable, "Not in the stability regions, because they have no stability function"),
                               (self.dragged, "Not in the maps of damping, because they cannot integrate drag")):
            rest = [method.name for method in self.methods if method not in drawn]
            lines += [f"{heading}: {', '.join(rest)}."] if rest else []
        return "\n".join(lines)

    @property
    def drawable(self) -> list[Method]:
        """Methods in the figures of stability regions: those with a stability function, as Runge-Kutta methods."""
        return [method for method in self.methods if _has_function(method)]

    @property
    def dragged(self) -> list[Method]:
        """Methods that the maps of damping show: those for forces that depend on the velocity, such as drag."""
        return [method for method in self.methods if "velocity_free" not in method.needs]

    @property
    def figures(self) -> dict[str, tuple[str, Sequence[Method]]]:
        """Methods in each figure: name of the figure -> function of ``pendulum_env.plots.stability``, and methods.

        Names are "regions", "oscillation" and "damping", with a number appended where there are several of a kind.
        """
        drawn: dict[str, tuple[str, Sequence[Method]]] = {}
        for name, draw, methods, most in (("regions", "regions", self.drawable, MOST_CURVES),
                                          ("oscillation", "oscillation", self.methods, MOST_CURVES),
                                          ("damping", "damped", self.dragged, MOST_MAPS)):
            parts = split_evenly(methods, most)
            drawn |= {f"{name}_{i}" if len(parts) > 1 else name: (draw, part) for i, part in enumerate(parts, start=1)}
        return drawn


def _has_function(method: Method) -> bool:
    try:
        stability_function(method, 0.0)
    except MethodError:
        return False
    return True


def _cell(value: Any) -> str:
    return shown(value) if value is None or isinstance(value, float) else str(value) or "-"


def split_evenly(methods: Sequence[Method], most: int) -> list[Sequence[Method]]:
    """Split a list of methods into parts of nearly equal size, none larger than ``most``."""
    count = math.ceil(len(methods) / most)
    edges = [round(i * len(methods) / count) for i in range(count + 1)] if count else [0]
    return [methods[low:high] for low, high in pairwise(edges)]


def stability(integrators: str | Iterable[str | Method]) -> Stability:
    """Return the stability limits of integrators, with a table and figures.

    Args:
        integrators: names or methods, or one string of names separated by commas.

    Raises MethodError for an unknown name, a repeated name or an empty list.
    """
    names = listed_methods(integrators)
    return Stability(tuple(none_twice(m if isinstance(m, Method) else registry.get(m) for m in names)))
