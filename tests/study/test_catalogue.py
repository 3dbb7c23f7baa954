"""Tests that tables list their registries completely, and that READMEs contain the present tables."""

from __future__ import annotations

import re

import pytest
from readme_code import check_listed, check_table

from pendulum_env import SCENES
from pendulum_env.bench.sources import SOURCES
from pendulum_env.controllers import POLICIES
from pendulum_env.engine.motion import EVENTS
from pendulum_env.lab.containers import FORMATS
from pendulum_env.lab.quantities import QUANTITIES
from pendulum_env.physics.bodies import BODIES
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.study.lists.tables import TABLES
from pendulum_env.tasks import TASKS

ELSEWHERE = "integrators"
"""List that another module tests, because its limits take seconds to compute."""
REGISTRIES = {"scenes": SCENES, "effects": EFFECTS, "bodies": BODIES, "events": EVENTS, "tasks": TASKS,
              "policies": POLICIES,
              "sources": [kind.form() for kind in SOURCES.values()],
              "formats": [re.sub("^an? ", "", quantity.name) for quantity in QUANTITIES] + [
                  file.name for file in FORMATS]}


@pytest.mark.parametrize("name", [name for name in TABLES if name != ELSEWHERE])
def test_a_table_lists_its_registry(name: str) -> None:
    check_table(name, REGISTRIES[name])


@pytest.mark.parametrize("name", [name for name in TABLES if name != ELSEWHERE])
def test_readmes_are_current(name: str) -> None:
    check_listed(name)
