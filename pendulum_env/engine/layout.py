"""What a block of environments holds, and where."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pendulum_env.engine import report
from pendulum_env.engine.shape import SLACKENED, Shape, indent, joined

BLOCK = 256
"""Environments in a block: all its fields and results, some 50 kB, stay in the nearest caches."""

LIMITS = ("omega0", "speed_limit")
"""What a batch takes beside OWN; like coefficients, one number or one for each environment."""

@dataclass(frozen=True)
class Layout:
    """Where things are in a block.

    Attributes:
        shape: the program's.
        varying: names of the shape's numbers and of LIMITS of which each environment has a value of its own.
        task: names of the task's functions, reward and lost; None for runs without any.
    """

    shape: Shape
    varying: frozenset[str]
    task: tuple[str, str] | None

    @property
    def numbers(self) -> tuple[str, ...]:
        """Every number that the loops take."""
        return (*self.shape.numbers, *LIMITS)

    @property
    def shared(self) -> tuple[str, ...]:
        """Those that all environments have in common, in the order in which the loops take them."""
        return tuple(name for name in self.numbers if name not in self.varying)

    @property
    def fields(self) -> tuple[str, ...]:
        """Fields of a block of environments, in order."""
        memory = ("held", *self.shape.memory) if self.shape.memory else ()
        initial = ("initial",) if self.shape.ledger else ()
        own = tuple(name for name in self.numbers if name in self.varying)
        state = ("index", "q", "turns", "v", "status")
        lost = (*self.shape.lost, *self.shape.lost_sums)
        slackened = SLACKENED if self.shape.lenient else ()
        return (*state, *memory, *initial, *self.shape.quadratures, *lost, *self.shape.remembered, *slackened, *own)

    @property
    def reports(self) -> tuple[str, ...]:
        """What is reported: info, or what a record of a run holds."""
        return self.shape.info if self.task else report.names_recorded(self.shape)

    @property
    def results(self) -> tuple[str, ...]:
        """Fields of a block of results, in order: the action, what the task sees, the ending, then reports."""
        seen = (*report.SEEN, "reward", "late", "ended") if self.task else ()
        return ("control", *seen, *self.reports)

    def at(self, name: str) -> str:
        """An environment's value of a field."""
        return f"s[i + U({self.fields.index(name) * BLOCK})]"

    def out(self, name: str) -> str:
        """An environment's value of a result."""
        return f"o[i + U({self.results.index(name) * BLOCK})]"

    def load(self, *names: str) -> list[str]:
        """Lines that fetch fields and the action; names that are neither are arguments already."""
        places = {"control": self.out("control"), **{name: self.at(name) for name in self.fields}}
        return [f"{name} = {places[name]}" for name in names if name in places]


def block_loop(name: str, first: str, layout: Layout, lines: Iterable[str]) -> str:
    """One loop over a block."""
    signature = joined((first,), layout.shared)
    return "\n".join(["@inline", f"def {name}({signature}):", "    for i in range(U(n)):", *indent(lines, 2), ""])


def side_of_turns(layout: Layout) -> list[str]:
    return ["side = side_of(turns)"] if layout.shape.periodic else []
