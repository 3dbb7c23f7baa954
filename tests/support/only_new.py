"""A plugin of pytest for a copy of the project with new entries: it runs the cases that can know of them.

These are the cases that name a new entry; the tests that read a registry, or what is made of one, otherwise than by the
name of one entry, as ``SCENES["lab"]``; and all tests of the rooms LISTING. The other cases are those of the project
itself, which its quick tests run: a new entry changes no other entry's choice.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from choice import names_in

import integrators
from pendulum_env import SCENES
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.tasks import TASKS

NEW = set(os.environ.get("LAB_PENDULUM_NEW_ENTRIES", "").split())
"""Names of the entries that the copy has and the project has not."""
LISTING = ("cli", "notebook", "project", "web")
"""Rooms whose tests look at what lists all entries: commands, READMEs, API pages, widgets, the page."""
OWN_CODE = ("test_python_blocks_run", "test_example_interpreted")
"""Tests there that run code of READMEs and examples, which names its entries itself."""
REGISTRIES = {"METHODS", "SCENES", "EFFECTS", "TASKS", "fitting"}
"""Names of the registries, and of the function that returns all methods that fit a scene."""
TESTS = Path(__file__).parents[1]


def pytest_collection_modifyitems(config: Any, items: list[Any]) -> None:
    kept = [item for item in items if can_know(item)]
    left_out = set(map(id, kept))
    config.hook.pytest_deselected(items=[item for item in items if id(item) not in left_out])
    items[:] = kept


def can_know(item: Any) -> bool:
    """Whether a case can know of a new entry."""
    case, named = getattr(item, "callspec", None), set()
    if case is not None:
        for registry in (integrators.METHODS, SCENES, EFFECTS, TASKS):
            named |= names_in(case.params, registry)
    if named:
        return bool(named & NEW)
    if item.originalname in OWN_CODE:
        return False
    return item.path.parent.name in LISTING or bool({item.originalname, *item.fixturenames} & readers(item.path))


@cache
def readers(file: Path) -> set[str]:
    """Return the names in a file of tests of what reads a registry as a whole, itself or by another of these names."""
    uses: dict[str, set[str]] = {}
    known = set(REGISTRIES)
    for statement in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.ImportFrom):
            source = TESTS / "support" / f"{statement.module}.py"
            known |= readers(source) & {each.name for each in statement.names} if source.exists() else set()
        for name in defined(statement):
            uses[name] = set(used(statement))
    while more := {name for name, others in uses.items() if name not in known and others & known}:
        known |= more
    return known


def defined(statement: ast.stmt) -> Iterator[str]:
    """Yield the names that a statement at the top of a file defines."""
    if isinstance(statement, (ast.FunctionDef, ast.ClassDef)):
        yield statement.name
    else:
        targets = getattr(statement, "targets", [getattr(statement, "target", statement)])
        yield from (node.id for target in targets for node in ast.walk(target)
                    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store))


def used(statement: ast.stmt) -> Iterator[str]:
    """Yield the names that a statement uses as a whole: of ``SCENES["lab"]`` none."""
    nodes = list(ast.walk(statement))
    by_name = {id(node.value) for node in nodes if isinstance(node, ast.Subscript)}
    for node in nodes:
        if isinstance(node, ast.Name) and id(node) not in by_name:
            yield node.id
        elif isinstance(node, ast.Attribute) and id(node) not in by_name:
            yield node.attr
