"""Tables come from the registries, and README holds them as they are now."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import integrators
from pendulum_env import SCENES, SceneError
from pendulum_env.catalogue import TABLES, find_table
from pendulum_env.physics.effects import EFFECTS
from pendulum_env.tasks import TASKS

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
REGISTRIES = {"scenes": SCENES, "integrators": integrators.METHODS, "effects": EFFECTS, "tasks": TASKS}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_lists_its_registry(name: str) -> None:
    table = find_table(name)
    assert [row[0] for row in table.rows] == list(REGISTRIES[name])
    assert all(len(row) == len(table.head) and all(row) for row in table.rows)


@pytest.mark.parametrize("name", ["scenes", "integrators", "effects"])
def test_readme_is_current(name: str) -> None:
    """``lab-pendulum list NAME --markdown`` prints what stands between the marks."""
    found = re.search(rf"<!-- list {name} -->\n\n(.*?)\n\n<!-- end -->", README, flags=re.S)
    assert found, f"README has no table marked '{name}'"
    assert found[1] == find_table(name).markdown()


def test_unknown_list() -> None:
    with pytest.raises(SceneError, match="did you mean scenes"):
        find_table("scene")
