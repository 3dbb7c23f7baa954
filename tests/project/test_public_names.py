"""What ``import pendulum_env`` offers: its names and rooms, found when asked for, and no others."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib.util import find_spec

from readme_code import ROOT

import pendulum_env

EXTRAS = {"jax"}
"""Rooms that need an extra of their own name."""


def rooms() -> set[str]:
    """Return the rooms that show names in their ``__init__``."""
    found = set()
    for path in (ROOT / "pendulum_env").glob("*/__init__.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            names = [ast.unparse(one) for one in getattr(node, "targets", [])]
            if "__all__" in names or (isinstance(node, ast.ImportFrom) and path.parent.name == "adapters"):
                found.add(path.parent.name)
    return found


def test_dir_has_the_public_names_and_every_room_that_shows_names() -> None:
    offered = {name for name in dir(pendulum_env) if not name.startswith("__")}
    assert offered == {*pendulum_env.__all__, *(name for name in EXTRAS if find_spec(name))}
    assert rooms() - EXTRAS <= {*pendulum_env.__all__}
    assert "__version__" in dir(pendulum_env)


def test_each_name_is_there_after_the_import_alone_and_rooms_are_imported_when_asked_for() -> None:
    asked = ("import sys, pendulum_env\n"
             "early = [name for name in sys.modules if name.startswith('pendulum_env.')]\n"
             f"print(sorted({rooms()!r} & {{name.split('.')[1] for name in early}}))\n"
             "print([name for name in dir(pendulum_env) if getattr(pendulum_env, name, None) is None])\n"
             "print(pendulum_env.lab.Recording is pendulum_env.Recording, pendulum_env.bench.acquire.__name__)")
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["[]", "[]", "True acquire"]


def test_a_name_that_is_not_there_is_said_to_be_missing() -> None:
    assert not hasattr(pendulum_env, "labs")
