"""What there is to choose from, as tables: for the command line, the README and whoever asks.

Every table is read off a registry, so nothing is listed twice.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from types import MappingProxyType

from integrators import METHODS, Method
from integrators.multistep import Started
from pendulum_env.physics.effects import EFFECTS, Effect
from pendulum_env.physics.presets import PURPOSES, SCENES
from pendulum_env.physics.units import SceneError, nearest
from pendulum_env.tasks import TASKS


@dataclass(frozen=True)
class Table:
    """Column heads and rows of text."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """As a Markdown table."""
        lines = [self.head, tuple("---" for _ in self.head), *self.rows]
        return "\n".join(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in line)} |" for line in lines)


def _structure(method: Method) -> str:
    words = {
        "implicit" if method.implicit else "explicit": True,
        "symplectic": method.symplectic,
        "symmetric": method.symmetric,
        "A-stable": method.a_stable and not method.l_stable,
        "L-stable": method.l_stable,
        f"begun by {method.starter.name}" if isinstance(method, Started) else "": isinstance(method, Started),
    }
    return ", ".join(word for word, holds in words.items() if holds)


def integrators_table() -> Table:
    """Every method: order, structure, force evaluations per step, source."""
    rows = tuple(
        (m.name, str(m.order), _structure(m), str(m.evaluations), m.summary, m.source) for m in METHODS.values()
    )
    return Table(("integrator", "order", "structure", "forces per step", "what it is", "source"), rows)


def _parameters(effect: type[Effect]) -> str:
    texts = [f"{f.name} [{f.metadata['unit']}]" for f in fields(effect) if "unit" in f.metadata]  # type: ignore[arg-type]
    return ", ".join(texts) or "-"


def effects_table() -> Table:
    """Every effect: kind, name in ``damping=``, parameters, what it is, source."""
    rows = tuple(
        (e.name, e.kind, e.damping or "-", _parameters(e), e.summary().rstrip("."), e.source) for e in EFFECTS.values()
    )
    return Table(("effect", "kind", "damping=", "parameters", "what it is", "source"), rows)


def scenes_table() -> Table:
    """Every preset scene: its effects and what it is for."""
    rows = tuple(
        (name, ", ".join(effect.name for effect in scene.effects), PURPOSES[name]) for name, scene in SCENES.items()
    )
    return Table(("scene", "effects", "what it is for"), rows)


def tasks_table() -> Table:
    """Every task and its reward."""
    return Table(("task", "reward per step"), tuple((task.name, task.equation) for task in TASKS.values()))


TABLES: Mapping[str, Callable[[], Table]] = MappingProxyType(
    {"scenes": scenes_table, "integrators": integrators_table, "effects": effects_table, "tasks": tasks_table}
)
"""Every table by name."""


def find_table(name: str) -> Table:
    """The table of this name; SceneError with the nearest name for an unknown one."""
    if name not in TABLES:
        raise SceneError(f"There is no list of {name!r}{nearest(name, TABLES)}")
    return TABLES[name]()
