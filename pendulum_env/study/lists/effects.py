"""The effects as a list to read: what each is, its parameters, the number that says when it matters."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from dataclasses import Field, fields
from typing import Any

from pendulum_env.physics.effects import Effect
from pendulum_env.physics.units import first_line
from pendulum_env.study.lists.methods import INDENT, NARROWEST, WIDEST


def parameter(entry: Field[Any]) -> str:
    """A parameter with its unit, or with the words that it may be."""
    if "allowed" in entry.metadata:
        return f"{entry.name} ({' or '.join(entry.metadata['allowed'])})"
    return f"{entry.name} [{entry.metadata['unit']}]"


def parameters(effect: type[Effect]) -> str:
    """The parameters of an effect, with commas between."""
    return ", ".join(map(parameter, fields(effect)))  # type: ignore[arg-type]


def listing(effects: Iterable[type[Effect]], width: int = 100) -> str:
    """The effects by kind: name and ``damping=``, and a paragraph below; at most ``width`` characters wide."""
    width = min(max(width, NARROWEST), WIDEST)
    kinds: dict[str, list[type[Effect]]] = {}
    for effect in effects:
        kinds.setdefault(effect.kind, []).append(effect)
    return "\n\n".join(_block(f"{kind} ({len(found)})", found, width) for kind, found in kinds.items())


def _block(title: str, effects: list[type[Effect]], width: int) -> str:
    lines = [title, "-" * len(title)]
    for effect in effects:
        lines.append(f"{effect.name}, damping={effect.damping}" if effect.damping else effect.name)
        number = f"Matters by {effect.number_name}. " if effect.number_name else ""
        given = [f"{parameter(f)}: {f.metadata['doc']}{_default(f)}." for f in fields(effect)]  # type: ignore[arg-type]
        for said in (f"{first_line(effect)}.", *given, f"{number}{effect.source}."):
            lines += textwrap.wrap(said, width, initial_indent=INDENT, subsequent_indent=2 * INDENT,
                                   break_on_hyphens=False)
    return "\n".join(lines)


def _default(entry: Field[Any]) -> str:
    if entry.default is None:
        return ""
    return f"; by default {entry.default:g}" if isinstance(entry.default, float) else f"; by default {entry.default}"
