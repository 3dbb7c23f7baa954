"""Tables of scenes, bodies, integrators, effects, tasks, policies, events, formats, sources, units; effects as text."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, fields
from types import MappingProxyType
from typing import Any

from integrators import METHODS
from pendulum_env.bench.sources import SOURCES
from pendulum_env.common.texts import Table
from pendulum_env.controllers import POLICIES
from pendulum_env.controllers import load as load_policy
from pendulum_env.engine.motion import EVENTS
from pendulum_env.lab.containers import FORMATS
from pendulum_env.lab.quantities import QUANTITIES
from pendulum_env.physics import angles
from pendulum_env.physics.bodies import BODIES
from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.presets import PURPOSES, SCENES
from pendulum_env.physics.units import first_line
from pendulum_env.study.lists.methods import COLUMNS, INDENT, entry, paragraph, shown
from pendulum_env.tasks import TASKS


def parameter(entry: Field[Any]) -> str:
    """Return the name of an effect's parameter with its unit or allowed words, such as "gamma [1/s]"."""
    if "allowed" in entry.metadata:
        return f"{entry.name} ({' or '.join(entry.metadata['allowed'])})"
    return f"{entry.name} [{entry.metadata['unit']}]"


def parameters(effect: type[Effect] | type[RigidBody]) -> str:
    """Return the parameters of an effect, or the measures of a body, with their units, separated by commas."""
    return ", ".join(map(parameter, fields(effect)))  # type: ignore[arg-type]


def effect_listing(effects: Iterable[type[Effect]], width: int = 100) -> str:
    """Return a text list of effects by kind, with a paragraph on each, in lines of at most ``width`` characters."""
    kinds: dict[str, list[type[Effect]]] = {}
    for effect in effects:
        kinds.setdefault(effect.kind, []).append(effect)
    blocks = []
    for kind, members in kinds.items():
        title = f"{kind} ({len(members)})"
        lines = [title, "-" * len(title)]
        for effect in members:
            lines.append(f"{effect.name}, damping={effect.damping}" if effect.damping else effect.name)
            number = f"Matters by {effect.number_name}. " if effect.number_name else ""
            texts = [f"{parameter(f)}: {f.metadata['doc']}{_default(f)}." for f in fields(effect)]  # type: ignore[arg-type]
            for text in (f"{first_line(effect)}.", *texts, f"{number}{effect.source}."):
                lines += paragraph(text, width, INDENT, 2 * INDENT)
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def policy_row(name: str) -> tuple[str, ...]:
    """Return the row of a policy of the package in the table of policies, from its card."""
    card = load_policy(name).card
    training, found = card["training"], card["evaluation"]
    returns = found["return"]
    others = [f"{found[other]:.5g}" if other in found else "-" for other in ("random", "controller")]
    return (name, card["id"], f"{training['steps']:,}".replace(",", " "), *others, f"{found['reached']:.1%}",
            f"{returns['worst']:.5g}", f"{returns['mean']:.5g} ± {returns['sd']:.2g}")


def _default(entry: Field[Any]) -> str:
    number = f"{entry.default:g}" if isinstance(entry.default, float) else entry.default
    return "" if entry.default is None else f"; by default {number}"


def integrators_data() -> Table:
    """Return a table of all integrators with every known property, also family, needs and other names."""
    return Table(COLUMNS, tuple(entry(method).cells for method in METHODS.values()))


TABLES: Mapping[str, Callable[[], Table]] = MappingProxyType({
    "scenes": lambda: Table(
        ("scene", "effects", "what it is for"),
        tuple((name, ", ".join(effect.name for effect in scene.effects), PURPOSES[name])
              for name, scene in SCENES.items())),
    "integrators": lambda: Table(
        ("integrator", "order", "structure", "forces per step", "omega0 h", "gamma h", "what it is", "source"),
        tuple((e.name, e.order, e.structure, str(e.evaluations), shown(e.oscillation_limit), shown(e.damping_limit),
               e.what, e.source) for e in map(entry, METHODS.values()))),
    "effects": lambda: Table(
        ("effect", "kind", "damping=", "parameters", "matters by", "what it is", "source"),
        tuple((e.name, e.kind, e.damping or "-", parameters(e) or "-", e.number_name or "-", first_line(e), e.source)
              for e in EFFECTS.values())),
    "bodies": lambda: Table(
        ("shape", "class", "measures", "what it is"),
        tuple((name, kind.__name__, parameters(kind), first_line(kind)) for name, kind in BODIES.items())),
    "tasks": lambda: Table(
        ("task", "reward per step"), tuple((task.name, task.equation) for task in TASKS.values())),
    "policies": lambda: Table(
        ("policy", "id", "steps of training", "random", "controller swing_up", "reached", "worst", "return"),
        tuple(map(policy_row, POLICIES))),
    "events": lambda: Table(("event", "what it is"), tuple(EVENTS.items())),
    "formats": lambda: Table(
        ("quantity", "words in titles", "units", "how it is read, or what to do"),
        (*(quantity.cells for quantity in QUANTITIES), *(file.cells for file in FORMATS))),
    "sources": lambda: Table(
        ("source", "what it is", "extra", "tested with"),
        tuple((kind.form(), kind.about, kind.extra or "-", kind.tested) for kind in SOURCES.values())),
    "units": lambda: Table(angles.HEAD, angles.ROWS),
})
"""Functions that return the tables, by name: of scenes (effects, purpose), integrators (order, stability limits, ...),
effects, bodies, tasks (rewards), events, quantities in files of recordings, sources of live samples, and units."""


LINES = 2
"""Largest number of lines for each list when all are printed on one screen."""
ROWS = 21
"""Largest number of rows that a list prints on a screen of 24 lines."""


def names_of(name: str, names: Iterable[str], width: int, lines: int | None = LINES) -> str:
    """Return the names in a list, after its own name and their number, in at most so many ``lines``, None for all."""
    names = list(names)
    for count in range(len(names), 0, -1):
        more = "" if count == len(names) else f", and {len(names) - count} more"
        text = textwrap.fill(f"{name} ({len(names)}): {', '.join(names[:count])}{more}", width,
                             subsequent_indent="    ", break_on_hyphens=False)
        if lines is None or text.count("\n") < lines:
            break
    return text


def brief(name: str, table: Table, width: int) -> str:
    """Return a table as text that fits one screen: a name and the beginning of its description in each line.

    Of tables with more than 21 rows (ROWS), only the names are given.
    """
    if len(table.rows) > ROWS:
        return names_of(name, (row[0] for row in table.rows), width, None)
    column = table.head.index("what it is") if "what it is" in table.head else -1
    room = max(len(row[0]) for row in table.rows)
    lines = [f"{row[0]:{room}}  {row[column]}" for row in table.rows]
    return "\n".join(one if len(one) <= width else f"{one[:width - 3].rpartition(' ')[0]} ..." for one in lines)
