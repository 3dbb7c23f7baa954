"""The rooms of the house and the arrows between them: data flows one way, and heavy packages stay where they belong.

Arrows are read from the source: imports inside functions and those for type checkers count too.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import syntax_trees

import integrators
import pendulum_env

ROOTS = {name: Path(module.__file__).parent for name, module in (
    ("integrators", integrators), ("pendulum_env", pendulum_env))}

BASE = ("pendulum_env.common", "pendulum_env.physics", "integrators")
RUNS = (*BASE, "pendulum_env.engine", "pendulum_env.truth", "pendulum_env.tasks")
PICTURES = (*RUNS, "pendulum_env.render", "pendulum_env.films")
HOUSE: dict[str, tuple[str, ...]] = {
    "integrators": (),
    "pendulum_env.common": (),
    "pendulum_env.physics": ("pendulum_env.common",),
    "pendulum_env.engine": BASE,
    "pendulum_env.truth": (*BASE, "pendulum_env.engine"),
    "pendulum_env.tasks": (*BASE, "pendulum_env.engine"),
    "pendulum_env.render": ("pendulum_env.common", "pendulum_env.engine"),
    "pendulum_env.films": (*RUNS, "pendulum_env.render"),
    "pendulum_env.controllers": RUNS,
    "pendulum_env.auto": RUNS,
    "pendulum_env.window": PICTURES,
    "pendulum_env.lab": RUNS,
    "pendulum_env.envs": (*PICTURES, "pendulum_env.auto", "pendulum_env.window"),
    "pendulum_env.bench": (*BASE, *(f"pendulum_env.{room}" for room in (
        "engine", "lab", "web", "exercise", "tasks", "envs", "controllers"))),
    "pendulum_env.study": (*PICTURES, "pendulum_env.controllers", "pendulum_env.lab", "pendulum_env.plots",
                           "pendulum_env.bench"),
    "pendulum_env.hard_cases": (*RUNS, "pendulum_env.plots"),
    "pendulum_env.plots": (*RUNS, "pendulum_env.render", "pendulum_env.lab", "pendulum_env.study",
                           "pendulum_env.hard_cases"),
    "pendulum_env.jax": (*BASE, "pendulum_env.engine", "pendulum_env.tasks", "pendulum_env.envs"),
    "pendulum_env.testing": ("pendulum_env.common",),
    "pendulum_env.adapters": ("pendulum_env.common",),
    "pendulum_env.exercise": (*BASE, *(f"pendulum_env.{room}" for room in ("engine", "lab", "render", "plots"))),
    "pendulum_env.web": (*BASE, "pendulum_env.engine", "pendulum_env.render"),
    "pendulum_env.notebook": (*BASE, *(f"pendulum_env.{room}" for room in (
        "engine", "lab", "study", "hard_cases", "plots"))),
    "pendulum_env.cli": (*PICTURES, *(f"pendulum_env.{room}" for room in (
        "controllers", "auto", "window", "lab", "envs", "study", "hard_cases", "plots", "exercise", "web", "bench"))),
}
"""Room -> the rooms that its modules may import. Modules at the top of pendulum_env are nobody's to import."""

OPENED_BY_NAME = ("pendulum_env", "pendulum_env.__main__")
"""Modules beside the rooms: the public names, loaded on first use; ``python -m``; old module paths."""

HEAVY = ("numba", "gymnasium", "scipy", "matplotlib", "pygame", "moviepy", "typer")
REACH: dict[str, tuple[str, ...]] = {
    "integrators": (),
    "pendulum_env.common": (),
    "pendulum_env.physics": ("scipy",),
    "pendulum_env.engine": ("numba", "scipy"),
    "pendulum_env.truth": ("numba", "scipy"),
    "pendulum_env.tasks": ("numba", "scipy"),
    "pendulum_env.render": ("numba", "pygame", "moviepy"),
    "pendulum_env.films": ("numba", "scipy", "pygame", "moviepy"),
    "pendulum_env.controllers": ("numba", "scipy", "gymnasium"),
    "pendulum_env.auto": ("numba", "scipy"),
    "pendulum_env.lab": ("numba", "scipy"),
    "pendulum_env.study": ("numba", "scipy", "matplotlib", "pygame", "moviepy", "gymnasium"),  # it lists the bench
    "pendulum_env.hard_cases": ("numba", "scipy", "matplotlib"),
}
"""Room -> the heavy packages that its modules may reach, themselves or through what they import."""
NUMBA_ROOMS = ("pendulum_env.engine",)
"""Rooms that may import numba themselves."""

FAMILIES: dict[frozenset[str], str] = {}
"""Circles of modules that are allowed, each inside one family of effects or methods -> the reason."""


@cache
def modules() -> dict[str, Path]:
    """Every module's name and file; a package goes by its own name."""
    found = {}
    for name, root in ROOTS.items():
        for path in sorted(root.rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join((name, *(parts[:-1] if parts[-1] == "__init__" else parts)))] = path
    return found


def tree_of(module: str) -> ast.Module:
    return syntax_trees.tree_of(modules()[module])


@cache
def imported(module: str) -> frozenset[str]:
    """Full names that a module imports anywhere in its source; and of ``from a import b`` the module a.b."""
    names: set[str] = set()
    for node in syntax_trees.nodes_of(modules()[module]):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{module} imports relatively; name modules in full"
            base = node.module or ""
            names.update(full if (full := f"{base}.{alias.name}") in modules() else base for alias in node.names)
    return frozenset(names)


def inside(module: str) -> frozenset[str]:
    """The modules of this project that a module imports."""
    return imported(module) & modules().keys() - {module}


def room_of(module: str) -> str:
    return next((room for room in HOUSE if module == room or module.startswith(f"{room}.")), "")


@cache
def reached(module: str) -> set[str]:
    """All modules that a module imports, directly or through others."""
    seen, left = {module}, [module]
    while left:
        left += (new := inside(left.pop()) - seen)
        seen |= new
    return seen


def circles() -> Iterator[frozenset[str]]:
    """The sets of modules that reach each other."""
    reach = {module: reached(module) for module in modules()}
    for module, others in reach.items():
        ring = frozenset(other for other in others if module in reach[other])
        if len(ring) > 1 and module == min(ring):
            yield ring


@pytest.mark.slow
def test_no_circle_of_modules() -> None:
    assert set(circles()) == FAMILIES.keys()


@pytest.mark.slow
def test_arrows_go_one_way() -> None:
    rooms = {module: room_of(module) for module in modules()}
    assert [module for module, room in rooms.items() if not room and module not in OPENED_BY_NAME] == []
    assert [f"{module} imports {other}, which {room} must not know" for module, room in rooms.items() if room
            for other in sorted(inside(module)) if rooms[other] not in (room, *HOUSE[room])] == []


def test_pictures_know_no_scene() -> None:
    """Of the engine they use the way to compile loops, and nothing else."""
    assert {other for module in modules() if room_of(module) == "pendulum_env.render" for other in inside(module)
            if room_of(other) == "pendulum_env.engine"} == {"pendulum_env.engine.kernels"}


@pytest.mark.slow
def test_rooms_reach_no_package_that_they_do_without() -> None:
    """Through all that they import, too; that Python loads the package's own ``__init__`` first is not counted."""
    assert [f"{module} reaches {name} by {other}" for module in modules() if (room := room_of(module)) in REACH
            for other in sorted(reached(module)) for name in sorted(imported(other))
            if (package := name.partition(".")[0]) in HEAVY and package not in REACH[room]] == []


def test_only_the_engine_imports_numba() -> None:
    assert {room_of(module) for module in modules() if any(
        name.partition(".")[0] == "numba" for name in imported(module))} <= set(NUMBA_ROOMS)


OTHERS_PRIVATE = {
    ("pendulum_env.engine.atomic", "_getvalue"): "the value of a structure, as numba's guide to extensions has it",
    ("pendulum_env.engine.compiling", "_module_pass_manager"): "numba has no public way to optimise a function once",
    ("pendulum_env.engine.compiling", "_data_layout"): "of the same class of numba",
    ("pendulum_env.engine.kernels", "_cache"): "numba has no public way to give a function another cache",
    ("pendulum_env.engine.compiling", "_reduce"): "numba's compiled result, as its own cache stores it",
    ("pendulum_env.engine.compiling", "_rebuild"): "the counterpart of _reduce",
    ("pendulum_env.lab.columns", "_replace"): "of named tuples: a documented name of Python's own",
    ("pendulum_env.bench.sources.pasco", "_loop"): "PASCO's library never closes its event loop",
    ("pendulum_env.common.checks", "_getframe"): "of sys: the way to the caller that a warning points at",
}
"""Private names of other packages that are used for want of public ones, each with its reason."""


OF_TUPLES = ("_fields", "_make", "_replace")


def private_uses(tree: ast.Module) -> set[str]:
    """Underscore names that a file takes from elsewhere: imported, or of an object and not defined in the file.

    Names that end in an underscore, such as IPython's ``_repr_html_``, are those of a protocol, which anybody may call;
    those of NamedTuples are documented, and have the underscore only because fields may have any other name.
    """
    own, named = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and private(node.attr):
            of_itself = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            (own if of_itself else named).add(node.attr)
        elif isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            own.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            own.add(node.id)
    taken = {alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names}
    return named - own | set(filter(private, taken))


def private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__") and not name.endswith("_") and name not in OF_TUPLES


@pytest.mark.slow
def test_nothing_reaches_for_another_modules_underscore() -> None:
    used = {(module, name) for module in modules() for name in private_uses(tree_of(module))}
    assert used - OTHERS_PRIVATE.keys() == set()


TESTS = Path(__file__).parents[1]
PYTHONS = {"_replace", "_fields", "_getframe", "_exit"}
"""Documented names of Python's own, of named tuples, ``sys`` and ``os``."""


@pytest.mark.slow
def test_tests_use_public_names() -> None:
    assert {(path.name, name) for path in TESTS.rglob("*.py")
            for name in private_uses(ast.parse(path.read_text(encoding="utf-8"))) - PYTHONS} == set()


def test_every_module_names_its_subject() -> None:
    assert [module for module in modules() if not (ast.get_docstring(tree_of(module)) or "").strip()] == []


def test_importing_the_package_loads_nothing_heavy() -> None:
    heavy = tuple(name for name in (*HEAVY, "rich", "mpmath") if name != "gymnasium")
    code = (
        "import sys, pendulum_env\n"
        f"print([name for name in {heavy!r} if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
