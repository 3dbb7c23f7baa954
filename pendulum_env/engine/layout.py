"""Memory layout of a block of environments: its fields (quantities such as the angle), and their positions in an array.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pendulum_env.engine import report
from pendulum_env.engine.shape import SLACKENED, Shape, indent, joined

BLOCK = 256
"""Number of environments in a block: few enough for their data, some 50 kB, to stay in the cache."""

LIMITS = ("omega0", "speed_limit")
"""Parameters of a batch's programs beside the scene's numbers; each is one number, or one number per environment."""


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
        """Return the names of all parameters of the generated loops, equal or not between environments."""
        return (*self.shape.numbers, *LIMITS)

    @property
    def shared(self) -> tuple[str, ...]:
        """Return the names of the parameters that are equal in all environments, in the order of the loops' arguments.
        """
        return tuple(name for name in self.numbers if name not in self.varying)

    @property
    def fields(self) -> tuple[str, ...]:
        """Return the names of a block's fields in the order in memory; a field holds one number per environment."""
        memory = ("held", *self.shape.memory) if self.shape.memory else ()
        initial = ("initial",) if self.shape.ledger else ()
        own = tuple(name for name in self.numbers if name in self.varying)
        state = ("index", "q", "turns", "v", "status")
        lost = (*self.shape.lost, *self.shape.lost_sums)
        slackened = SLACKENED if self.shape.lenient else ()
        return (*state, *memory, *initial, *self.shape.quadratures, *lost, *self.shape.remembered, *slackened, *own)

    @property
    def reports(self) -> tuple[str, ...]:
        """Return the names of the reported quantities: the entries of ``info``, or without a task of a run's record."""
        return self.shape.info if self.task else report.names_recorded(self.shape)

    @property
    def results(self) -> tuple[str, ...]:
        """Return the names of a block's results: action, observation, reward, end of episode, reported quantities."""
        seen = (*report.SEEN, "reward", "late", "ended") if self.task else ()
        return ("control", *seen, *self.reports)

    def at(self, name: str) -> str:
        """Return the source of the array element that holds the field ``name`` of environment ``i`` in a block."""
        return f"s[i + U({self.fields.index(name) * BLOCK})]"

    def out(self, name: str) -> str:
        """Return the source of the array element that holds the result ``name`` of environment ``i`` in a block."""
        return f"o[i + U({self.results.index(name) * BLOCK})]"

    def load(self, *names: str) -> list[str]:
        """Return the source lines that assign fields and the action to local names; names that are neither are skipped.
        """
        places = {"control": self.out("control"), **{name: self.at(name) for name in self.fields}}
        return [f"{name} = {places[name]}" for name in names if name in places]


def block_loop(name: str, first: str, layout: Layout, lines: Iterable[str]) -> str:
    """Write the source of a function ``name`` that runs ``lines``, the source for one environment, for all of a block.
    """
    signature = joined((first,), layout.shared)
    return "\n".join(["@inline", f"def {name}({signature}):", "    for i in range(U(n)):", *indent(lines, 2), ""])


def side_of_turns(layout: Layout) -> list[str]:
    """Return the source line that sets ``side``; no line if torques are not periodic in the angle.

    ``side`` is +1 if the bob is below the horizontal and -1 above.
    """
    return ["side = side_of(turns)"] if layout.shape.periodic else []
