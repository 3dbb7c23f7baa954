"""Memory layout of a block of environments: its fields (quantities such as the angle), and their positions in an array.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from pendulum_env.engine import report
from pendulum_env.engine.goal import SPAN, Goal
from pendulum_env.engine.shape import ADAPTED, TOLERANCE, Shape, derived, indent, joined
from pendulum_env.engine.stages import WHOLE, Schedule, rows_of

BLOCK = 176
"""Number of environments in a block: few enough for their data, some 30 kB, to stay in the cache, and a whole number of
vectors (see :mod:`pendulum_env.engine.lanes`).

A field is 22 cache lines of 64 bytes. With a power of 2, equal places of all fields would share a few lines of the
cache and displace each other.
"""

CACHE_LINE = 64
"""Number of bytes that the processor moves between cache and registers at once."""


def aligned(shape: tuple[int, ...], dtype: DTypeLike = np.float64, make: Callable[..., Any] = np.zeros) -> NDArray[Any]:
    """Return a zero-filled array whose memory starts at a multiple of 64 bytes, the length of a cache line.

    Eight numbers that the processor reads or writes at once then lie in one line, not in two. With ``make=np.empty``
    the array is not filled.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    room = make(size + CACHE_LINE, np.uint8)
    skip = -room.ctypes.data % CACHE_LINE
    inside: NDArray[Any] = room[skip : skip + size]
    return inside.view(dtype).reshape(shape)


LIMITS = ("omega0", "speed_limit")
"""Parameters of a batch's programs beside the scene's numbers; each is one number, or one number per environment."""


AHEAD = 8
"""Number of free fields before a history that slides, so of steps after which it moves back; see :class:`Layout`."""
FEWEST_VALUES, MOST_HISTORIES = 12, 2
"""Histories slide if they hold at least FEWEST_VALUES values together, and there are at most MOST_HISTORIES of them.

With work and heat there are three or four: a compiled loop would then compare so many addresses that it takes one
environment at a time.
"""


@dataclass(frozen=True)
class Layout:
    """Fields and results of a block of environments, and their positions in its arrays.

    Attributes:
        shape: interface of the program.
        varying: names of the parameters that differ between environments.
        goal: the task's functions and the form of its observation; None for runs without a task.
        schedule: the parts of a step that a block takes in loops of their own.
        own: True if effects of the scene are a user's; the compiler alone then looks for vectors.

    A multistep method needs values of earlier steps, such as the last 14 forces. The fields of such a *history* follow
    each other, the newest first. A long one *slides*: each step writes the newest value into the field before it, so
    that in the next step the history begins one field earlier. There are AHEAD free fields; after as many steps, the
    history is copied back to its place. That holds for runs without gusts or a lagging motor. Environments of a task,
    which may take single steps and continue after a stop, move all values in every step, as short histories do.

    Attributes derived from these:
        histories: names of the fields of each history that slides.
        numbers: names of all parameters of the generated loops, equal or not between environments.
        shared: names of the parameters that are equal in all environments, in the order of the loops' arguments.
        fields: names of a block's fields in the order in memory; a field holds one number per environment.
        reports: names of the reported quantities: the entries of ``info``, or without a task of a run's record.
        results: names of a block's results: action, observation, end of episode. Rewards and reported quantities go
            straight to the user's arrays.
        moved: names of the fields that a step changes; ``side`` is computed from ``turns``.
        moving: names of the fields that make up a state: all but the parameters.
        given: names of the values, other than the motion, that an adaptive step takes and that are not ``shared``.
        under_way: names of the values of a pendulum within an adaptive step: its index in the block (``lane``), the
            time at the start of the step, its progress, and ``given``.
        work: names of the fields of a block's work array, in which adaptive steps are under way; none for fixed steps.
    """

    shape: Shape
    varying: frozenset[str]
    goal: Goal | None
    schedule: Schedule = WHOLE
    own: bool = False

    histories: tuple[tuple[str, ...], ...] = derived()
    numbers: tuple[str, ...] = derived()
    shared: tuple[str, ...] = derived()
    fields: tuple[str, ...] = derived()
    reports: tuple[str, ...] = derived()
    results: tuple[str, ...] = derived()
    moved: tuple[str, ...] = derived()
    moving: tuple[str, ...] = derived()
    given: tuple[str, ...] = derived()
    under_way: tuple[str, ...] = derived()
    work: tuple[str, ...] = derived()

    def __post_init__(self) -> None:
        """Derive the names of a block's parameters, fields and results."""
        shape, goal = self.shape, self.goal
        tolerance = TOLERANCE if shape.adaptive else ()
        numbers = (*shape.numbers, *LIMITS, *tolerance, *((SPAN,) if goal and goal.reference else ()))
        own = tuple(name for name in numbers if name in self.varying)
        shared = tuple(name for name in numbers if name not in self.varying)
        state = ("index", "q", "turns", "v", "status")
        histories = () if goal or shape.remembered else self._histories()
        room = {names[0]: [f"{names[0]}_in_{steps}" for steps in range(AHEAD, 0, -1)] for names in histories}
        memory = ("held", *(field for name in shape.memory for field in (*room.get(name, ()), name)))
        memory = memory if shape.memory else ()
        initial = ("initial",) if shape.ledger else ()
        lost = (*shape.lost, *shape.lost_sums)
        fields = (*state, *memory, *initial, *shape.sums, *lost, *shape.remembered, *shape.slackened,
                  *(ADAPTED if shape.adaptive else ()), *(goal.before if goal else ()), *own)
        reports = shape.info if goal else report.names_recorded(shape)
        results = ("control", *((*goal.seen, "late", "ended") if goal else ()))
        moved = tuple(name for name in shape.carried if name != "side")
        pull = shape.pull[:2] if shape.slack else ()
        given = tuple(name for name in (*shape.extra, *pull, *shape.slackened) if name not in shared)
        under_way = ("lane", "t", *shape.paused, *given)
        work = (*under_way, *shape.step_results, "square", "reason") if shape.adaptive else ()
        vars(self).update(
            given=given, under_way=under_way, work=work, histories=histories,
            numbers=numbers, shared=shared, fields=fields, reports=reports, results=results, moved=moved,
            moving=tuple(name for name in fields if name not in own))

    def _histories(self) -> tuple[tuple[str, ...], ...]:
        """Return the fields of each history: a step copies each value from the field before it, but for the newest."""
        copies, histories, before = dict(self.schedule.copies), list[tuple[str, ...]](), ""
        for name in self.shape.memory:
            if before and copies.get(f"{name}1") == before:
                histories[-1] += (name,)
            else:
                histories.append((name,))
            before = name
        found = tuple(names for names in histories if len(names) > 1)
        return found if sum(map(len, found)) >= FEWEST_VALUES and len(found) <= MOST_HISTORIES else ()

    @property
    def told_at_once(self) -> bool:
        """True if observations and endings go straight to the user's arrays, from the loop that computes them.

        The compiler alone would take one environment at a time in such a loop, because the arrays have several types.
        """
        return self.goal is not None and self.goal.straight and not self.own

    @property
    def step_arguments(self) -> tuple[str, ...]:
        """Return the names of the arguments of a block's step before the parameters."""
        return ("s", "o", "n", "h", *(("slide",) if self.histories else ()))

    def sliding(self, name: str, ahead: int = 0) -> str:
        """Return the source of the array element that holds ``name`` in a step, or of that ``ahead`` fields earlier.

        ``slide`` is BLOCK times the number of free fields before every history, AHEAD where it is in its place.
        """
        if not any(name in names for names in self.histories):
            return self.at(name)
        return f"s[i + slide + U({(self.fields.index(name) - AHEAD - ahead) * BLOCK})]"

    def at(self, name: str, index: str = "i") -> str:
        """Return the source of the array element that holds the field ``name`` of environment ``i`` in a block.

        ``index`` is the source of another index to use in place of ``i``.
        """
        return f"s[{index} + U({self.fields.index(name) * BLOCK})]"

    def between(self, name: str) -> str:
        """Return the source of the array element that holds a number that a stage hands to later ones.

        It lies in the rows of results other than the action, which are written after the step, or in further rows.
        """
        return f"o[i + U({self.row(name)})]"

    def row(self, name: str) -> int:
        """Return where the row of memory begins that holds a number which a stage hands to later ones."""
        return (4 + self._rows[name]) * BLOCK

    @cached_property
    def _rows(self) -> dict[str, int]:
        return rows_of(self.schedule.stages)

    @property
    def reduced(self) -> tuple[int, int, int]:
        """Return where the rows of memory begin that hold the reduced angles of a block."""
        return BLOCK, 2 * BLOCK, 3 * BLOCK

    @property
    def room(self) -> int:
        """Return the length of the array of a block's results, with room for what stages hand to later ones."""
        return BLOCK * max(len(self.results), 5 + max(self._rows.values(), default=0))

    def slot(self, name: str, index: str = "i") -> str:
        """Return the source of the element of the work array that holds ``name`` of slot ``i``; see ``work``."""
        return f"w[{index} + U({self.work.index(name) * BLOCK})]"

    @property
    def active(self) -> str:
        """Return the source of the element of the work array that holds the number of slots in use."""
        return f"w[U({len(self.work) * BLOCK})]"

    def out(self, name: str, index: str = "i") -> str:
        """Return the source of the array element that holds the result ``name`` of environment ``i`` in a block."""
        return f"o[{index} + U({self.results.index(name) * BLOCK})]"

    @property
    def rows(self) -> list[str]:
        """Return the names of the user's arrays that reported quantities are written to."""
        return [f"row_{name}" for name in self.reports]

    def load(self, *names: str, index: str = "i", sliding: bool = False) -> list[str]:
        """Return the source lines that assign fields and the action to local names; names that are neither are skipped.

        ``index`` is the source of another environment's index to use in place of ``i``. With ``sliding``, which goes
        with ``i`` alone, histories are where they are within a step; see :meth:`sliding`.
        """
        fields = {name: self.sliding(name) if sliding else self.at(name, index) for name in self.fields}
        places = {"control": self.out("control", index), **fields}
        return [f"{name} = {places[name]}" for name in names if name in places]


def block_loop(name: str, first: str, layout: Layout, lines: Iterable[str], before: Iterable[str] = (),
               separate: bool = False, vectors: bool = True) -> str:
    """Write the source of a function ``name`` that runs ``lines``, the source for one environment, for all of a block.

    The lines ``before`` are run once, before the loop. The function's arrays must not overlap.

    With ``separate``, or if histories slide, the compiler is told that the arrays do not overlap. Where a loop is left
    to it, it still has to compare addresses within ``s``; with those of other arrays there would be too many, and the
    loop would take one environment at a time. With ``vectors`` False, the loop is left to it.
    """
    over = "lanes(n)" if vectors else "range(U(n))"
    head = f"def {name}({joined((first,), layout.shared)}):"
    inlined = "@separate" if layout.histories or separate else "@inline"
    return "\n".join([inlined, head, *indent(before, 1), f"    for i in {over}:", *indent(lines, 2), ""])


def side_of_turns(layout: Layout) -> list[str]:
    """Return the source line that sets ``side``; no line if torques are not periodic in the angle.

    ``side`` is +1 if the bob is below the horizontal and -1 above.
    """
    return ["side = side_of(turns)"] if layout.shape.periodic else []
