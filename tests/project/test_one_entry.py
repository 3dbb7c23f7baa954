"""One entry is one entry: a new method, effect, scene and task, each in its one place, and the quick tests pass."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import regenerate
from choice import check_pairs, pairs
from only_new import readers
from readme_code import PATHS, ROOT, block, method_entry

from pendulum_env.tasks import TASKS

NEW = ("quarters3", "eddy_brake", "tuning_bob", "hold_still")
SCENE = '''def tuning_bob() -> Scene:
    """A small bob on a long rod, a weak motor and linear drag, to see that a new scene needs no other edit."""
    effects = (Gravity(), LinearDrag(gamma=0.1), Motor(max_torque=0.02))
    return Scene("tuning_bob", _ROD, air(20.0), effects, 9.81, Run(angle=math.radians(20.0), dt=0.01, duration=10.0))


_ALL: tuple'''
TASK = '''def _hold_still(phi: float, speed: float, action: float) -> float:
    return -speed * speed


_ALL = (
    Task("hold_still", _hold_still, start=_hanging, equation="-(velocity/omega0)²"),
'''


def replaced(path: Path, old: str, new: str) -> None:
    """Replace the one place in a file where a text stands."""
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{path} has {text.count(old)} places with {old!r}"
    path.write_text(text.replace(old, new), encoding="utf-8")


def add_method(root: Path) -> None:
    """Put the README's quarters3 into the tuple of explicit Runge-Kutta methods."""
    family = root / "integrators" / "tables" / "runge_kutta.py"
    text = family.read_text(encoding="utf-8").rstrip()
    assert text.endswith("    ),\n)")
    family.write_text(f"{text[:-1]}    {method_entry()},\n)\n", encoding="utf-8")


def add_effect(root: Path) -> None:
    """Put the README's eddy brake into a file of its own and into the tuple of effects."""
    found = re.search(r"(from dataclasses.*?)\n\nscene = ", block("adding an effect"), flags=re.S)
    assert found
    effects = root / "pendulum_env" / "physics" / "effects"
    code = found[1].replace("import gymnasium as gym, pendulum_env\n", "")
    code = code.replace("pendulum_env.physics.effects import", "pendulum_env.physics.effects.effect import")
    text = f'"""The brake of a magnet on a turning disc."""\n\nfrom __future__ import annotations\n\n{code.rstrip()}\n'
    (effects / "eddy_brake.py").write_text(text, encoding="utf-8")
    line = "from pendulum_env.physics.effects.effect import Effect\n"
    replaced(effects / "__init__.py", line, f"from pendulum_env.physics.effects.eddy_brake import EddyBrake\n{line}")
    replaced(effects / "__init__.py", "    Gravity, SmallAngle", "    EddyBrake, Gravity, SmallAngle")


def add_scene(root: Path) -> None:
    """Write a preset and put it into the tuple of presets."""
    presets = root / "pendulum_env" / "physics" / "presets.py"
    replaced(presets, "_ALL: tuple", SCENE)
    replaced(presets, "    textbook, vacuum, ", "    textbook, tuning_bob, vacuum, ")


def add_task(root: Path) -> None:
    """Write a task and put it into the tuple of tasks."""
    replaced(root / "pendulum_env" / "tasks" / "__init__.py", "_ALL = (\n", TASK)


def done(root: Path, *words: str) -> str:
    """Run Python in a copy of the project; AssertionError with all that it printed if it fails.

    The copy shares the cache of compiled kernels: a kernel is named by its source, so only new entries are compiled.
    """
    support = root / "tests" / "support"
    environment = {**os.environ, "PYTHONPATH": f"{root}{os.pathsep}{support}",
                   "LAB_PENDULUM_NEW_ENTRIES": " ".join(NEW)}
    for name in ("PYTEST_ADDOPTS", "PYTEST_XDIST_WORKER", "PYTEST_CURRENT_TEST", "LAB_PENDULUM_BACKEND"):
        environment.pop(name, None)
    ran = subprocess.run([sys.executable, *words], capture_output=True, text=True, cwd=root, env=environment,
                         check=False)
    assert ran.returncode == 0, ran.stdout[-30_000:] + ran.stderr[-5_000:]
    return ran.stdout


@pytest.mark.slow
def test_new_entries_in_their_places_are_all_that_has_to_be_written(tmp_path: Path) -> None:
    """A copy of the project with four entries more: one command stores their facts, and then its quick tests pass.

    Run are the quick tests that can know of the new entries (tests/support/only_new.py): the others are the project's.
    """
    hidden = (".ci", ".github", ".site")
    copied = (path for path in ROOT.iterdir() if not path.name.startswith(".") or path.name in hidden)
    for path in copied:
        if path.is_dir():
            shutil.copytree(path, tmp_path / path.name, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
        else:
            shutil.copy(path, tmp_path)
    for add in (add_method, add_effect, add_scene, add_task):
        add(tmp_path)
    assert done(tmp_path, "-c", "import integrators; print(integrators.get('quarters3').order)") == "3\n"
    stored = [tmp_path / path.relative_to(ROOT) for path in (
        *PATHS, ROOT / "tests" / "entries.json", ROOT / "tests" / "same_bits.json")]
    before = {path: path.read_text(encoding="utf-8") for path in stored}
    command = (str(tmp_path / "tests" / "support" / "regenerate.py"),)
    done(tmp_path, *command)
    for path, text in before.items():
        kept = path.read_text(encoding="utf-8").splitlines()
        assert all(line.rstrip(",") in (other.rstrip(",") for other in kept) for line in text.splitlines())
    assert done(tmp_path, *command) == "", "nothing is new the second time"
    tested = done(tmp_path, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "only_new")
    found = re.search(r"(\d+) passed", tested)
    assert found, tested[-3000:]
    assert int(found[1]) > 800, "cases of new entries and tests of whole registries"
    assert not re.search(r"\d failed|\d error", tested)


WITH_READERS = """
import integrators
from choice import EVERYWHERE, pairs
from pendulum_env import SCENES

ALL: list[str] = [name for name in SCENES]

def count(): return len(ALL)
def test_a_function_of_a_list(): assert count() == 18
def test_an_attribute(): assert len(integrators.METHODS) == 105
@pytest.mark.parametrize("name", sorted(SCENES))
def test_parameters(name): pass
def test_what_support_reads(): assert pairs(()) == []
def test_by_name(): assert SCENES["lab"].name == "lab"
def test_a_list_of_names(): assert "rk4" in EVERYWHERE
"""


def test_readers_of_whole_registries_are_told_from_others(tmp_path: Path) -> None:
    (tmp_path / "test_x.py").write_text(WITH_READERS, encoding="utf-8")
    assert {name for name in readers(tmp_path / "test_x.py") if name.startswith("test")} == {
        "test_a_function_of_a_list", "test_an_attribute", "test_parameters", "test_what_support_reads"}


def test_a_grid_holds_pairs_of_values_that_are_no_methods_too() -> None:
    """With one method, every pair with it is there in a few combinations, which leave out most of the others."""
    axes = (["vacuum", "lab", "windy"], ["rk4"], ["free", "balance", "swing_up"], ["NextStep", "SameStep"])
    check_pairs(pairs(axes), axes)


def test_a_row_that_has_to_change_is_refused() -> None:
    text = "<!-- list tasks -->\n\n| task | reward per step |\n| --- | --- |\n| free | 1 |\n\n<!-- end -->"
    found = regenerate.TABLE.search(text)
    assert found
    with pytest.raises(regenerate.RefusedError, match=r"The row '\| free \| 1 \|.*' in README.md is not what"):
        regenerate.table(ROOT / "README.md", found)


def test_an_entry_that_is_gone_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(regenerate, "TASKS", {"free": TASKS["free"]})
    with pytest.raises(regenerate.RefusedError, match="'swing_up' is gone from tasks"):
        regenerate.entries()


def test_a_limit_that_has_to_change_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(regenerate, "LIMITS", {"forward_euler": (0.0, 2.0 + 1e-6)})
    with pytest.raises(regenerate.RefusedError, match=r"of 'forward_euler' in .* are \(0.0, 2.000001\), and"):
        regenerate.limits()
    monkeypatch.setattr(regenerate, "LIMITS", {"forward_euler": (0.0, 2.0), "euler2": (0.0, 2.0)})
    with pytest.raises(regenerate.RefusedError, match="'euler2' is gone from METHODS"):
        regenerate.limits()
