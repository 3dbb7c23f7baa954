"""List of the effects as text: description, parameters and the number that indicates when an effect matters."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import Field, fields
from typing import Any

from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.units import first_line
from pendulum_env.study.lists.methods import INDENT, paragraph


def parameter(entry: Field[Any]) -> str:
    """Return the name of an effect's parameter with its unit or allowed words, such as "gamma [1/s]"."""
    if "allowed" in entry.metadata:
        return f"{entry.name} ({' or '.join(entry.metadata['allowed'])})"
    return f"{entry.name} [{entry.metadata['unit']}]"


def parameters(effect: type[Effect] | type[RigidBody]) -> str:
    """Return the parameters of an effect, or the measures of a body, with their units, separated by commas."""
    return ", ".join(map(parameter, fields(effect)))  # type: ignore[arg-type]


def listing(effects: Iterable[type[Effect]], width: int = 100) -> str:
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


def _default(entry: Field[Any]) -> str:
    number = f"{entry.default:g}" if isinstance(entry.default, float) else entry.default
    return "" if entry.default is None else f"; by default {number}"
