"""Division of a method's step into stages, each of which a block takes in a loop of its own.

A step is a chain of operations, each of which waits for the one before. A processor therefore works on several
pendulums of a block at once, as far as it looks ahead: a few hundred instructions. A whole step of several forces is
longer than that; one stage, which ends with a force, is not. The operations, and so the bits, are the same.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

from pendulum_env.engine.source import PARSING

FORCES = frozenset({"acceleration", "rates", "force", "jacobian"})
"""Functions of a program that compute a force or its slope; a stage ends with one of them, or with several for the same
place.
"""
FEWEST = 2
"""Smallest number of forces of a step that is divided."""


@dataclass(frozen=True)
class Stage:
    """Part of a step: source lines, and names of the numbers that it takes from earlier stages and hands to later ones.
    """

    lines: tuple[str, ...]
    taken: tuple[str, ...]
    handed: tuple[str, ...]


def divided(step: str, results: Iterable[str]) -> tuple[Stage, ...]:
    """Return the stages of a step from its source; none if it has few forces, or other lines than assignments.

    The last stage assigns the step's results to the names ``results``. Names that the step assigns get the prefix
    "s_", so that they differ from those of the loop.
    """
    with PARSING:
        functions = [node for node in ast.parse(step).body if isinstance(node, ast.FunctionDef)]
    function = next(function for function in functions if function.name == "step")
    body = function.body[1:] if ast.get_docstring(function) else function.body
    *lines, last = body
    if not all(isinstance(line, ast.Assign) for line in lines) or not isinstance(last, ast.Return) or not last.value:
        return ()
    arguments = {argument.arg for argument in function.args.args}
    own = {name for line in lines for name in _names(line, ast.Store)}
    for node in ast.walk(function):
        if isinstance(node, ast.Name) and node.id in own:
            node.id = f"s_{node.id}"
    groups = [[_Line(f"s_{name} = {name}", {name}, {f"s_{name}"}) for name in sorted(own & arguments)]]
    forces: set[str] = set()  # what the forces at the end of the present stage assign
    for line in (*lines, last):
        reads, stores = _names(line, ast.Load), _names(line, ast.Store)
        if forces and (FORCES.isdisjoint(reads) or not forces.isdisjoint(reads)):
            groups.append([])
            forces = set()
        forces |= stores if not FORCES.isdisjoint(reads) else set()
        text = ast.unparse(line) if line is not last else f"{', '.join(results)} = {ast.unparse(last.value)}"
        groups[-1].append(_Line(text, reads, stores))
    if len(groups) <= FEWEST:
        return ()
    stages: list[Stage] = []
    known: set[str] = set()
    for number, group in enumerate(groups):
        taken, later = _read(group), _read([line for rest in groups[number + 1:] for line in rest])
        stores = {name for line in group for name in line.stores}
        stages.append(Stage(tuple(line.text for line in group), tuple(sorted(taken & known)),
                            tuple(sorted(later & stores))))
        known |= stores
    return tuple(stages)


class _Line(NamedTuple):
    """A line of source, with the names that it reads and those that it assigns."""

    text: str
    reads: set[str]
    stores: set[str]


def _read(lines: Iterable[_Line]) -> set[str]:
    """Return the names whose values the lines take from before them."""
    read: set[str] = set()
    assigned: set[str] = set()
    for line in lines:
        read |= line.reads - assigned
        assigned |= line.stores
    return read


def _names(node: ast.AST, kind: type[ast.expr_context]) -> set[str]:
    """Return the names that a line reads (``ast.Load``) or assigns (``ast.Store``)."""
    return {name.id for name in ast.walk(node) if isinstance(name, ast.Name) and isinstance(name.ctx, kind)}
