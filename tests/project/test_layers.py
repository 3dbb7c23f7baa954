"""The arrows between the rooms: data flows one way, and heavy packages stay where they belong."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import integrators
import pendulum_env

ROOTS = {name: Path(module.__file__).parent for name, module in (
    ("integrators", integrators), ("pendulum_env", pendulum_env))}

# room -> names whose import is an arrow that runs back, or a package that has no business there
FORBIDDEN = {
    "integrators": ("pendulum_env", "numba", "gymnasium", "scipy", "matplotlib", "pygame"),
    "pendulum_env/physics": ("gymnasium", "numba", "matplotlib", "pygame", "pendulum_env.engine",
                             "pendulum_env.envs.env", "pendulum_env.study", "pendulum_env.render", "pendulum_env.lab",
                             "integrators"),
    "pendulum_env/engine": ("gymnasium", "matplotlib", "pygame", "pendulum_env.envs.env", "pendulum_env.study",
                            "pendulum_env.render", "pendulum_env.lab", "pendulum_env.cli"),
    "pendulum_env/render": ("gymnasium", "numba", "matplotlib", "pendulum_env.envs.env", "pendulum_env.engine",
                            "pendulum_env.physics", "pendulum_env.study", "integrators"),
    "pendulum_env/lab": ("gymnasium", "numba", "matplotlib", "pygame", "pendulum_env.envs.env", "pendulum_env.render",
                         "pendulum_env.study", "pendulum_env.cli"),
    "pendulum_env/study": ("gymnasium", "numba", "pygame", "pendulum_env.envs.env", "pendulum_env.cli"),
    "pendulum_env/auto": ("gymnasium", "numba", "matplotlib", "pygame", "pendulum_env.envs.env", "pendulum_env.study",
                          "pendulum_env.render", "pendulum_env.lab", "pendulum_env.cli"),
    "pendulum_env/controllers": ("gymnasium", "numba", "matplotlib", "pygame", "pendulum_env.envs.env",
                                 "pendulum_env.study", "pendulum_env.render", "pendulum_env.lab", "pendulum_env.cli"),
    "pendulum_env/window": ("matplotlib", "pendulum_env.envs.env", "pendulum_env.study", "pendulum_env.lab",
                            "pendulum_env.cli"),
    "pendulum_env": ("numba",),
}
MAY_IMPORT_NUMBA = "pendulum_env/engine"


def files() -> list[tuple[str, Path]]:
    return [(f"{name}/{path.relative_to(root).as_posix()}", path)
            for name, root in ROOTS.items() for path in sorted(root.rglob("*.py"))]


def imported(path: Path) -> set[str]:
    """Full names of all imports of a file, those inside functions included, those for type checkers not."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    typing_only = {id(node) for block in ast.walk(tree) if isinstance(block, ast.If)
                   and "TYPE_CHECKING" in ast.dump(block.test) for node in ast.walk(block)}
    names: set[str] = set()
    for node in ast.walk(tree):
        if id(node) in typing_only:
            continue
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            assert node.level <= 1 or path.parent.name, path
            names.update({base, *(f"{base}.{alias.name}" for alias in node.names)})
    return names


@pytest.mark.parametrize(("label", "path"), files(), ids=[label for label, _ in files()])
def test_no_arrow_runs_back(label: str, path: Path) -> None:
    for room, names in FORBIDDEN.items():
        if not label.startswith(room + "/") or (room == "pendulum_env" and label.startswith(MAY_IMPORT_NUMBA)):
            continue
        found = {name for name in imported(path) for bad in names if name == bad or name.startswith(bad + ".")}
        assert not found, f"{label} imports {', '.join(sorted(found))}, which {room} must not know"


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = ("numba", "scipy", "matplotlib", "pygame", "moviepy", "rich", "typer", "mpmath")
    code = (
        "import sys, pendulum_env\n"
        f"print([name for name in {heavy!r} if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
