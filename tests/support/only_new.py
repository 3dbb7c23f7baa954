"""A plugin of pytest for a copy of the project with new entries: cases that name only older entries are left out.

They are the cases of the project itself, which its quick tests run: a new entry changes no other entry's choice. What
stays are the cases of new entries, and all tests that name no entry, such as those of whole registries.
"""

from __future__ import annotations

import os
from typing import Any

from choice import names_in

import integrators
from pendulum_env import SCENES
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.tasks import TASKS

NEW = set(os.environ.get("LAB_PENDULUM_NEW_ENTRIES", "").split())
"""Names of the entries that the copy has and the project has not."""


def pytest_collection_modifyitems(config: Any, items: list[Any]) -> None:
    older = [item for item in items if names_only_older(getattr(item, "callspec", None))]
    config.hook.pytest_deselected(items=older)
    left_out = set(map(id, older))
    items[:] = [item for item in items if id(item) not in left_out]


def names_only_older(case: Any) -> bool:
    """Whether a case names entries, and none of them is new."""
    named: set[str] = set()
    if case is not None:
        for registry in (integrators.METHODS, SCENES, EFFECTS, TASKS):
            named |= names_in(case.params, registry)
    return bool(named) and not named & NEW
