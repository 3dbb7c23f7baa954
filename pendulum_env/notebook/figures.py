"""The figures of every result, by the name of its class and by kind; the first kind is the usual one.

What draws is imported when a figure is drawn, because matplotlib takes half a second to load.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from pendulum_env.common.checks import SceneError, one_of

if TYPE_CHECKING:
    from pendulum_env.plots.style import ShownFigure

Draw = Callable[[Any], Any]


def of(module: str, function: str) -> Draw:
    """Return a function that draws a result, from a module of :mod:`pendulum_env.plots`."""
    return lambda result: getattr(import_module(f"pendulum_env.plots.{module}"), function)(result)


def run(function: str) -> Draw:
    """Return a function that draws one Rollout by a function of :mod:`pendulum_env.plots`, which takes a dict of them.
    """
    def draw(result: Any) -> Any:
        if result.angle.ndim != 1:
            raise SceneError(f"plot draws a single run, not a batch of {math.prod(result.angle.shape[:-1])} runs; draw "
                             "its arrays, time and angle, with matplotlib.")
        return getattr(import_module("pendulum_env.plots"), function)({result.method.name: result})

    return draw


def compared(kind: str) -> Draw:
    """Return a function that draws one of the figures of a Comparison."""
    return lambda result: import_module("pendulum_env.study.compare.files").figure_of(result, kind)


def stability(result: Any) -> Mapping[str, Draw]:
    """Return the figures of the stability of methods, each of some of the result's methods."""
    def draw(name: str, methods: Any) -> Draw:
        return lambda _: of("stability", name)(methods)

    return {kind: draw(*drawn) for kind, drawn in result.figures.items()}


FIGURES: Mapping[str, Mapping[str, Draw] | Callable[[Any], Mapping[str, Draw]]] = {
    "Rollout": {kind: run(kind) for kind in ("angle", "velocity", "phase", "energy", "energy_residual")},
    "Comparison": {kind: compared(kind) for kind in ("angle", "velocity", "phase", "energy")},
    "CostStudy": {"time": of("cost", "draw"), "errors": of("cost", "draw_errors")},
    "Growth": {"growth": of("growth", "draw")},
    "Audit": {"changes": of("audit", "draw")},
    "Simplification": {"changes": lambda result: of("audit", "draw")(result.audit)},
    "Simplified": {"changes": lambda result: of("audit", "draw")(result.report.audit)},
    "Stability": stability,
    "Matrix": {"outcomes": of("hard_cases", "draw")},
    "StudyResult": lambda result: {"figure": lambda one: one.drawn()} if result.study.has_figure() else {},
    "Section": {"section": of("section", "draw")},
    "Basins": {"basins": of("section", "draw")},
    "Fit": {"fit": of("recorded", "recorded")},
    "DrivenFit": {"logs": of("driven", "driven")},
    "Posterior": {"corner": of("corner", "corner")},
    "Transfer": {"costs": of("transfer", "draw")},
    "LabSheet": {"swing": of("swing", "measured")},
    "Recording": {"angle": of("swing", "readings")},
    "FilmTrack": {"track": of("filmed", "draw")},
}
"""Class of result -> kind of figure -> function that draws it; or a function that returns its kinds."""


def figures(result: Any) -> Mapping[str, Draw]:
    """Return the kinds of a result's figures, each with the function that draws it; none for a result without."""
    kinds = next((FIGURES[base.__name__] for base in type(result).__mro__ if base.__name__ in FIGURES), {})
    return kinds(result) if callable(kinds) else kinds


def figure_of(result: Any, kind: str | None = None) -> ShownFigure:
    """Return a figure of a result: of the given kind or, for None, the usual one; SceneError for an unknown kind."""
    if not (kinds := figures(result)):
        raise SceneError(f"There is no figure of a {type(result).__name__}; its numbers are in its table.")
    name = next(iter(kinds)) if kind is None else one_of(kind, f"figure of a {type(result).__name__} called", kinds)
    made = kinds[name](result)
    return made if hasattr(made, "savefig") else made.figure  # type: ignore[no-any-return]
