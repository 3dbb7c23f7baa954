"""How results are shown in a notebook: HTML with tables and equations, figures as SVG.

Results declare no more than a line of text (:mod:`pendulum_env.common.results`); here they get their HTML, an entry of
:data:`CARDS` by the name of their class, and their figures, an entry of :data:`FIGURES` by kind; the first kind is the
usual one. What draws is imported when a figure is drawn, because matplotlib takes half a second to load.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from integrators import html
from pendulum_env.common.checks import SceneError, one_of
from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY
from pendulum_env.physics.equation import equation_mathml
from pendulum_env.physics.scene import Scene

if TYPE_CHECKING:
    from pendulum_env.common.results import Result
    from pendulum_env.common.texts import Table
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
    "AmplitudeSheet": {"amplitudes": of("by_hand", "amplitudes_by_hand")},
    "LengthSheet": {"lengths": of("by_hand", "lengths_by_hand")},
    "KaterSheet": {"periods": of("by_hand", "kater_by_hand")},
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


LARGEST = 5e6
"""Largest film that is put into a notebook [bytes]; of a larger one a link is shown."""
TYPES = {".mp4": "video/mp4", ".gif": "image/gif"}
"""Kinds of films, by the ending of the file."""


def html_of(result: Any) -> str:
    """Return the HTML of a result, an environment or a film."""
    parts = next(CARDS[base.__name__] for base in type(result).__mro__ if base.__name__ in CARDS)
    title, *rest = parts(result)
    drawn = figure_of(result).as_html() if figures(result) and not _batch(result) else ""
    return html.block(title, *rest, drawn)


def equation(scene: Scene) -> str:
    """Return a scene's equation of motion as MathML, at the left."""
    return f'<div style="display: inline-block; margin: 0.3em 0">{equation_mathml(scene.equation())}</div>'


def start(angle: float, velocity: float) -> str:
    """Return the start of a run, or another state, as text."""
    return f"{angle:.4g} rad ({math.degrees(angle):.4g}°), {velocity:.4g} rad/s"


# --- scenes and environments ------------------------------------------------------------------------------------------


def scene(one: Scene) -> Iterator[str]:
    """Yield the parts of a scene's card: its name, its equation, and the lines of its description."""
    first, *lines = one.describe().splitlines()
    pairs = (line.partition(": ") if ": " in line else ("", "", line) for line in lines)
    yield f"Scene {first.partition(': ')[0]}"
    yield equation(one)
    yield html.facts((name, text) for name, _, text in pairs)


def environment(env: Any) -> Iterator[str]:
    """Yield the parts of an environment's card: its scene, its settings and its present state."""
    state = env.get_state()["state"]
    yield f"{'LabPendulum-v0' if env.spec is None else env.spec.id}: {env.scene.name}"
    yield equation(env.scene)
    yield html.facts((
        *settings(env),
        ("render_mode", env.render_mode or "none"),
        ("state", "not reset yet" if state is None else start(state[ANGLE] + TWO_PI * state[TURNS], state[VELOCITY])),
    ))


def vector(envs: Any) -> Iterator[str]:
    """Yield the parts of a vector's card: its scene, its size and its settings."""
    yield f"{'LabPendulum-v0' if envs.spec is None else envs.spec.id}: {envs.scene.name}, {envs.num_envs} environments"
    yield equation(envs.scene)
    own = envs.own_parameters
    yield html.facts((
        ("equation", "with the numbers of environment 0" if own else ""),
        *((name, f"{values.min():g} to {values.max():g}, one for each") for name, values in own.items()),
        *settings(envs),
        ("threads", str(envs.num_threads)),
        ("autoreset_mode", str(envs.autoreset_mode.value)),
    ))


def settings(env: Any) -> Iterator[tuple[str, str]]:
    """Yield the settings that single environments and vectors share, by name."""
    yield "integrator", f"{env.integrator}, {env.substeps} steps of {env.dt / env.substeps:g} s per control step"
    yield "task", env.task.name
    yield "action", "share of the motor's torque, -1 to 1"
    yield "observation", "cos(theta), sin(theta), velocity [rad/s]"


# --- runs -------------------------------------------------------------------------------------------------------------


def _batch(result: Any) -> bool:
    """Return True for a Rollout of several runs."""
    return type(result).__name__ == "Rollout" and result.angle.ndim != 1


def rollout(run: Any) -> Iterator[str]:
    """Yield the parts of a Rollout's card."""
    limits = ", ".join(f"{name} = {value:g}" for name, value in run.tolerance.items())
    yield f"Rollout of {run.scene.name} with {run.method.name}"
    yield equation(run.scene)
    step = f"{limits}, {run.steps} steps" if limits else f"{run.dt:g} s"
    if _batch(run):
        reasons = Counter(run.stop_reason)
        yield html.facts((
            ("runs", f"{math.prod(run.angle.shape[:-1])}, arrays of shape {run.angle.shape}"),
            ("time", f"0 to {run.time[-1]:g} s"), ("step", step),
            ("ended early", ", ".join(f"{count} by {reason}" for reason, count in reasons.items() if reason)),
        ))
        return
    residual = np.asarray(run.energy_residual)
    known = residual.size > 0 and bool(np.isfinite(residual).any())
    yield html.facts((
        ("start", start(float(run.angle[0]), float(run.velocity[0]))),
        ("end", f"{run.time[-1]:g} s: {start(float(run.angle[-1]), float(run.velocity[-1]))}"),
        ("step", f"{step}; {len(run.time)} times recorded"),
        ("largest energy residual", f"{np.nanmax(np.abs(residual)):.3g} J" if known else ""),
        ("ended early", run.ending),
    ))


def film(filmed: Any) -> Iterator[str]:
    """Yield the parts of a film's card: its player, or a link to a file that is too large for a notebook."""
    from base64 import b64encode

    path = filmed.path
    yield path.name
    if not path.is_file():
        yield html.words(f"The file {path} is no longer there.")
        return
    size, kind = path.stat().st_size, TYPES[path.suffix.lower()]
    if size > LARGEST:
        yield (f'<a href="{escape(path.as_posix())}">{html.text(str(path))}</a> '
               f"({size / 1e6:.1f} MB, too large to be shown here)")
    else:
        data = f'src="data:{kind};base64,{b64encode(path.read_bytes()).decode("ascii")}" style="max-width: 100%"'
        yield (f"<div><video controls loop {data}></video></div>" if kind.startswith("video")
               else f'<div><img alt="film" {data}></div>')
    yield html.facts((name, why) for name, why in filmed.stopped.items())


# --- studies and the lab ----------------------------------------------------------------------------------------------


def study(title: str, scene: Scene | None, one: Table, text: str = "", **shown: Any) -> Iterator[str]:
    """Yield the parts of a study's card: a title, a scene's equation, a table, a text of one or more lines.

    ``shown`` says how much of the table is shown, see :func:`integrators.html.table`.
    """
    yield title
    yield "" if scene is None else equation(scene)
    yield html.table(one.head, one.rows, **({"rest": "all are in .table"} | shown))
    yield html.words(text)


def result(one: Result, title: str = "", text: str | None = None) -> Iterator[str]:
    """Yield the parts of the card of a study's result; title and text are its own line and text, or others."""
    return study(title or repr(one).strip("<>"), getattr(one, "scene", None), one.table,
                 one.text if text is None else text)


def simplified(one: Any) -> Iterator[str]:
    """Yield the parts of what a notebook shows for the pair of scene and report that ``simplify`` returns."""
    title, _, *rest = CARDS["Simplification"](one.report)
    yield from (title, equation(one.scene), *rest)


def own_study(one: Any) -> Iterator[str]:
    """Yield the parts of the card of a Study's result, with its settings below its title."""
    title, *rest = result(one, one.title)
    yield title
    values = ((entry.name, getattr(one.study, entry.name)) for entry in fields(one.study))
    yield html.facts((name, ", ".join(map(str, value)) if isinstance(value, (tuple, list, np.ndarray)) else str(value))
                     for name, value in values)  # str of a sequence shows NumPy's numbers as np.float64(0.1)
    yield from rest


def section(one: Any) -> Iterator[str]:
    """Yield the parts of a Section's card."""
    at = "whole periods of the drive" if one.event == "period" else f"the event {one.event}"
    yield f"Poincaré section of {one.scene.name}"
    yield equation(one.scene)
    yield html.facts((
        ("points", f"{len(one.angle)}, at {at}, after {one.transient} periods"), ("method", one.method),
        ("over", f"{one.over} from {one.value.min():g} to {one.value.max():g}" if one.over else ""),
        ("runs that ended early", str(one.stopped or "")),
    ))


def recording(one: Any) -> Iterator[str]:
    """Yield the parts of a Recording's card."""
    title, _, text = one.text.partition("\n")
    yield title
    yield html.words(text)


CARDS: Mapping[str, Callable[[Any], Iterator[str]]] = {
    "Scene": scene, "LabPendulumEnv": environment, "LabPendulumVectorEnv": vector, "Rollout": rollout, "Filmed": film,
    "Result": result, "Simplified": simplified, "Section": section, "Recording": recording,
    "Comparison": lambda one: result(one, f"Comparison in {one.scene.name}: {', '.join(one.runs)}",
                                     one.text.partition("\n")[2]),  # its first line has the equation
    "CostStudy": lambda one: result(one, f"Cost of accuracy in {one.scene.name}, {one.duration:g} s"),
    "Growth": lambda one: result(one, f"Growth of errors in {one.scene.name}"),
    "Audit": lambda one: result(one, f"Effects in {one.scene.name}, released at {math.degrees(one.amplitude):.4g}°, "
                                f"tolerance {one.tolerance:g}"),
    "Simplification": lambda one: result(one, f"{one.audit.scene.name} without its negligible effects"),
    "Matrix": lambda one: result(one, f"Hard cases: {len(one.cases)} cases, {len(one.methods)} methods"),
    "Basins": lambda one: result(one, f"Basins of attraction of {one.scene.name}"),
    "StudyResult": own_study,
    "Sweep": lambda one: study(
        f"Sweep: {len(one.rows)} of {len(one.points)} points done", None, one.table, rest="all are in .rows"),
    "Fit": lambda one: study(f"Fit of {one.source}, {one.damping} damping", one.scene, one.table, one.text, most=None),
    "LabSheet": lambda one: study(f"Measured on {one.recording.source}", None, one.table, one.text, most=None),
    "AmplitudeSheet": lambda one: study(f"Amplitudes of {one.source}", None, one.table, one.text, most=None),
    "LengthSheet": lambda one: study(f"Periods against lengths of {one.source}", None, one.table, one.text, most=None),
    "KaterSheet": lambda one: study(f"Reversible pendulum of {one.source}", None, one.table, one.text, most=None),
    "DrivenFit": lambda one: study(
        f"Fit of {one.source}, driven by the {one.kind}", one.scene, one.table, one.text, most=None),
    "Posterior": lambda one: study(f"Posterior of {one.fit.recording.source}, {one.fit.model.title} damping",
                                   one.fit.scene, one.table, one.text, most=None),
    "Transfer": lambda one: study("Transfer of a policy", None, one.table, one.text),
}
"""Class -> function that yields its title and the parts of its HTML, which the usual figure follows.

The results of studies have the card of their base, :class:`pendulum_env.common.results.Result`, unless they are here.
"""
