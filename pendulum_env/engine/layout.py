"""Memory layout of a block of environments: its fields, and their positions in the block's array."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pendulum_env.engine import report
from pendulum_env.engine.shape import SLACKENED, Shape, indent, joined

BLOCK = 256
"""Number of environments in a block: few enough for its fields and results, some 50 kB, to stay in the cache."""

LIMITS = ("omega0", "speed_limit")
"""Further parameters of a batch's programs beside OWN; each is one number, or one number per environment."""


@dataclass(frozen=True)
class Layout:
    """Fields and results of a block of environments, and their positions in its arrays.

    Attributes:
        shape: interface of the program.
        varying: names of the parameters that differ between environments.
        task: names of the task's functions, reward and lost; None for runs without a task.
    """

    shape: Shape
    varying: frozenset[str]
    task: tuple[str, str] | None

    @property
    def numbers(self) -> tuple[str, ...]:
        """Return the names of all parameters of the loops."""
        return (*self.shape.numbers, *LIMITS)

    @property
    def shared(self) -> tuple[str, ...]:
        """Return the names of the parameters that are equal in all environments, in the loops' order."""
        return tuple(name for name in self.numbers if name not in self.varying)

    @property
    def fields(self) -> tuple[str, ...]:
        """Return the names of the fields of a block of environments, in order."""
        memory = ("held", *self.shape.memory) if self.shape.memory else ()
        initial = ("initial",) if self.shape.ledger else ()
        own = tuple(name for name in self.numbers if name in self.varying)
        state = ("index", "q", "turns", "v", "status")
        lost = (*self.shape.lost, *self.shape.lost_sums)
        slackened = SLACKENED if self.shape.lenient else ()
        return (*state, *memory, *initial, *self.shape.quadratures, *lost, *self.shape.remembered, *slackened, *own)

    @property
    def reports(self) -> tuple[str, ...]:
        """Return the names of the reported quantities: those of ``info`` with a task, else those of a run's record."""
        return self.shape.info if self.task else report.names_recorded(self.shape)

    @property
    def results(self) -> tuple[str, ...]:
        """Return the names of the fields of a block's results: action, observation, reward, end of episode, reports."""
        seen = (*report.SEEN, "reward", "late", "ended") if self.task else ()
        return ("control", *seen, *self.reports)

    def at(self, name: str) -> str:
        """Return the source of one environment's value of a field."""
        return f"s[i + U({self.fields.index(name) * BLOCK})]"

    def out(self, name: str) -> str:
        """Return the source of one environment's value of a result."""
        return f"o[i + U({self.results.index(name) * BLOCK})]"

    def load(self, *names: str) -> list[str]:
        """Return the source lines that read fields and the action into local names; other names are skipped."""
        places = {"control": self.out("control"), **{name: self.at(name) for name in self.fields}}
        return [f"{name} = {places[name]}" for name in names if name in places]


def block_loop(name: str, first: str, layout: Layout, lines: Iterable[str]) -> str:
    """Write the source of a function that runs ``lines`` for every environment of a block."""
    signature = joined((first,), layout.shared)
    return "\n".join(["@inline", f"def {name}({signature}):", "    for i in range(U(n)):", *indent(lines, 2), ""])


def side_of_turns(layout: Layout) -> list[str]:
    """Return the source line that sets ``side`` (+1 below the horizontal, -1 above); no line if not periodic."""
    return ["side = side_of(turns)"] if layout.shape.periodic else []
