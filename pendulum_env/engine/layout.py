"""Memory layout of a block of environments: its fields (quantities such as the angle), and their positions in an array.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from pendulum_env.engine import report
from pendulum_env.engine.goal import SPAN, Goal
from pendulum_env.engine.shape import Shape, derived, indent, joined

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
        goal: the task's functions and the form of its observation; None for runs without a task.

    Attributes derived from these:
        numbers: names of all parameters of the generated loops, equal or not between environments.
        shared: names of the parameters that are equal in all environments, in the order of the loops' arguments.
        fields: names of a block's fields in the order in memory; a field holds one number per environment.
        reports: names of the reported quantities: the entries of ``info``, or without a task of a run's record.
        results: names of a block's results: action, observation, reward, end of episode, reported quantities.
        moved: names of the fields that a step changes; ``side`` is computed from ``turns``.
        moving: names of the fields that make up a state: all but the parameters.
    """

    shape: Shape
    varying: frozenset[str]
    goal: Goal | None

    numbers: tuple[str, ...] = derived()
    shared: tuple[str, ...] = derived()
    fields: tuple[str, ...] = derived()
    reports: tuple[str, ...] = derived()
    results: tuple[str, ...] = derived()
    moved: tuple[str, ...] = derived()
    moving: tuple[str, ...] = derived()

    def __post_init__(self) -> None:
        """Derive the names of a block's parameters, fields and results."""
        shape, goal = self.shape, self.goal
        numbers = (*shape.numbers, *LIMITS, *((SPAN,) if goal and goal.reference else ()))
        own = tuple(name for name in numbers if name in self.varying)
        shared = tuple(name for name in numbers if name not in self.varying)
        state = ("index", "q", "turns", "v", "status")
        memory = ("held", *shape.memory) if shape.memory else ()
        initial = ("initial",) if shape.ledger else ()
        lost = (*shape.lost, *shape.lost_sums)
        fields = (*state, *memory, *initial, *shape.sums, *lost, *shape.remembered, *shape.slackened,
                  *(goal.before if goal else ()), *own)
        reports = shape.info if goal else report.names_recorded(shape)
        seen = (*goal.seen, "reward", "late", "ended") if goal else ()
        results = ("control", *seen, *reports)
        moved = tuple(name for name in shape.carried if name != "side")
        vars(self).update(
            numbers=numbers, shared=shared, fields=fields, reports=reports, results=results, moved=moved,
            moving=tuple(name for name in fields if name not in own))

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


def block_loop(name: str, first: str, layout: Layout, lines: Iterable[str], before: Iterable[str] = ()) -> str:
    """Write the source of a function ``name`` that runs ``lines``, the source for one environment, for all of a block.

    The lines ``before`` are run once, before the loop.
    """
    head = f"def {name}({joined((first,), layout.shared)}):"
    return "\n".join(["@inline", head, *indent(before, 1), "    for i in range(U(n)):", *indent(lines, 2), ""])


def side_of_turns(layout: Layout) -> list[str]:
    """Return the source line that sets ``side``; no line if torques are not periodic in the angle.

    ``side`` is +1 if the bob is below the horizontal and -1 above.
    """
    return ["side = side_of(turns)"] if layout.shape.periodic else []
