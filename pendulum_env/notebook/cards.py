"""The HTML of every result, by the name of its class: a title, an equation, a short table, the usual figure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from integrators import html
from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY
from pendulum_env.notebook.figures import FIGURES, figure_of
from pendulum_env.physics.equation import equation_mathml
from pendulum_env.physics.scene import Scene

if TYPE_CHECKING:
    from pendulum_env.common.tables import Table

LARGEST = 5e6
"""Largest film that is put into a notebook [bytes]; of a larger one a link is shown."""
TYPES = {".mp4": "video/mp4", ".gif": "image/gif"}
"""Kinds of films, by the ending of the file."""


def html_of(result: Any) -> str:
    """Return the HTML of a result, an environment or a film."""
    name, parts = next((base.__name__, CARDS[base.__name__]) for base in type(result).__mro__
                       if base.__name__ in CARDS)
    title, *rest = parts(result)
    drawn = figure_of(result).as_html() if name in FIGURES and not _without_figure(result) else ""
    return html.block(title, *rest, drawn)


def equation(scene: Scene) -> str:
    """Return a scene's equation of motion as MathML, at the left."""
    return f'<div style="display: inline-block; margin: 0.3em 0">{equation_mathml(scene.equation())}</div>'


def table(one: Table, rest: str = "") -> str:
    """Return a table of a study as HTML; ``rest`` says where the rows are that do not fit."""
    return html.table(one.head, one.rows, rest=rest)


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
    yield html.facts((
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


def _without_figure(result: Any) -> bool:
    """Return True for a Rollout of several runs, and for the result of a study that has no figure."""
    return _batch(result) or (type(result).__name__ == "StudyResult" and not result.pictures())


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


# --- studies ----------------------------------------------------------------------------------------------------------


def comparison(one: Any) -> Iterator[str]:
    """Yield the parts of a Comparison's card."""
    yield f"Comparison in {one.scene.name}: {', '.join(one.runs)}"
    yield equation(one.scene)
    yield table(one.table)
    yield html.words("\n".join(one.text.splitlines()[1:]))


def cost(study: Any) -> Iterator[str]:
    """Yield the parts of a CostStudy's card."""
    from pendulum_env.study.cost.points import recommendations

    yield f"Cost of accuracy in {study.scene.name}, {study.duration:g} s"
    yield table(recommendations(study))
    yield html.words("\n".join(filter(None, (study.sentence(), study.left_out))))


def growth(study: Any) -> Iterator[str]:
    """Yield the parts of a Growth's card."""
    from pendulum_env.study.growth.study import remarks
    from pendulum_env.study.growth.study import table as errors

    yield f"Growth of errors in {study.scene.name}"
    yield table(errors(study))
    yield html.words(remarks(study))


def audit(one: Any) -> Iterator[str]:
    """Yield the parts of an Audit's card."""
    from pendulum_env.study.audit.verdicts import verdicts

    yield (f"Effects in {one.scene.name}, released at {math.degrees(one.amplitude):.4g}°, tolerance "
           f"{one.tolerance:g}")
    yield table(verdicts(one), "all are in .rows")


def simplification(one: Any) -> Iterator[str]:
    """Yield the parts of what a notebook shows for a Simplification, the result of ``simplify``."""
    yield f"{one.audit.scene.name} without its negligible effects"
    yield html.words(one.text)


def simplified(one: Any) -> Iterator[str]:
    """Yield the parts of what a notebook shows for the pair of scene and report that ``simplify`` returns."""
    title, *rest = simplification(one.report)
    yield title
    yield equation(one.scene)
    yield from rest
    yield figure_of(one.report).as_html()


def matrix(one: Any) -> Iterator[str]:
    """Yield the parts of the card of a matrix of hard cases."""
    yield f"Hard cases: {len(one.cases)} cases, {len(one.methods)} methods"
    yield table(one.table, "all are in .table")
    yield html.words(one.text)


def sweep(one: Any) -> Iterator[str]:
    """Yield the parts of a Sweep's card."""
    yield f"Sweep: {len(one.rows)} of {len(one.points)} points done"
    yield table(one.table, "all are in .rows")


def study(one: Any) -> Iterator[str]:
    """Yield the parts of the card of a Study's result: its title, its settings, its table and its text."""
    yield one.title
    yield html.facts((entry.name, str(getattr(one.study, entry.name))) for entry in fields(one.study))
    yield table(one.table, "all are in .rows")
    yield html.words(one.text)


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


def basins(one: Any) -> Iterator[str]:
    """Yield the parts of the card of basins of attraction."""
    yield f"Basins of attraction of {one.scene.name}"
    yield equation(one.scene)
    yield table(one.table)


# --- the lab ----------------------------------------------------------------------------------------------------------


def sheet(one: Any) -> Iterator[str]:
    """Yield the parts of a LabSheet's card."""
    yield f"Measured on {one.recording.source}"
    yield html.table(one.table.head, one.table.rows, most=None)
    yield html.words(one.text)


def fit(one: Any) -> Iterator[str]:
    """Yield the parts of a Fit's card."""
    from pendulum_env.study.fit_report import goodness, parameter_table

    yield f"Fit of {one.recording.source}, {one.damping} damping"
    yield equation(one.scene)
    yield html.table((found := parameter_table(one)).head, found.rows, most=None)
    yield html.words(goodness(one) if one.comparison is None else f"{goodness(one)}\n{one.comparison.text}")


def driven_fit(one: Any) -> Iterator[str]:
    """Yield the parts of a DrivenFit's card."""
    yield f"Fit of {one.source}, driven by the {one.kind}"
    yield equation(one.scene)
    yield html.table(one.table.head, one.table.rows, most=None)
    yield html.words(one.summary)


def posterior(one: Any) -> Iterator[str]:
    """Yield the parts of a Posterior's card."""
    yield f"Posterior of {one.fit.recording.source}, {one.fit.model.title} damping"
    yield equation(one.fit.scene)
    yield html.table(one.table.head, one.table.rows, most=None)
    yield html.words(one.text)


def transfer(one: Any) -> Iterator[str]:
    """Yield the parts of a Transfer's card: the differences, the returns and what could not be tried."""
    yield "Transfer of a policy"
    yield table(one.table, "all are in .table")
    yield html.words(one.text)


def recording(one: Any) -> Iterator[str]:
    """Yield the parts of a Recording's card."""
    title, _, text = one.text.partition("\n")
    yield title
    yield html.words(text)


CARDS: Mapping[str, Callable[[Any], Iterator[str]]] = {
    "Scene": scene, "LabPendulumEnv": environment, "LabPendulumVectorEnv": vector, "Rollout": rollout, "Filmed": film,
    "Comparison": comparison, "CostStudy": cost, "Growth": growth, "Audit": audit, "Simplification": simplification,
    "Simplified": simplified,
    "Matrix": matrix, "Sweep": sweep, "StudyResult": study, "Section": section, "Basins": basins, "LabSheet": sheet,
    "Fit": fit, "DrivenFit": driven_fit, "Posterior": posterior, "Transfer": transfer, "Recording": recording,
}
"""Class -> function that yields its title and the parts of its HTML, which the usual figure follows."""
