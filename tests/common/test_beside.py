"""Tests of the name ``integrators``: a file or a distribution of that name is named in one sentence, with the remedy.

Each case runs in a process of its own, in a folder with a copy of the two packages where files are missing or foreign.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import pendulum_env

HOUSE = Path(pendulum_env.__file__).parents[1]
WAYS = {
    "import": ["-c", "import pendulum_env"],
    "make": ["-c", "import gymnasium; gymnasium.make('pendulum_env:LabPendulum-v0')"],
    "after one's own": ["-c", "import integrators, pendulum_env"],
    "module": ["-m", "pendulum_env", "list"],
    "command": ["lab-pendulum.py", "list"],
}
"""Every way into the package; the last is the script that pip installs."""
SCRIPT = "import sys\nfrom pendulum_env.cli import main\nsys.exit(main())\n"


def said(words: list[str], folder: Path, *path: Path) -> tuple[int, str]:
    """Run Python in a folder, with further folders to import from; return the exit code and what stderr says."""
    (folder / "lab-pendulum.py").write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path)), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True,
                          timeout=120)
    return done.returncode, done.stderr


@pytest.mark.quick("integrators.py-import")
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["integrators.py", pytest.param("integrators/__init__.py", marks=pytest.mark.slow)])
def test_a_file_that_hides_the_package_is_named(name: str, way: str, tmp_path: Path) -> None:
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("def step(): pass\n")
    code, text = said(WAYS[way], tmp_path, HOUSE)
    place = tmp_path / name.partition("/")[0]
    assert code == 1
    assert text.splitlines()[-1].endswith(
        f"Error: {place} hides the package 'integrators' of lab-pendulum, because Python looks there first; rename it, "
        f"for example to my_{place.name}, and in your imports too.")
    assert "cannot import name" not in text
    assert ("Traceback" in text) == (way in ("import", "make", "after one's own"))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A folder of installed packages: the first files of ours, which are all that is read before the check."""
    place = tmp_path / "site-packages"
    (place / "pendulum_env" / "envs").mkdir(parents=True)
    for file in ("__init__.py", "limits.py"):
        shutil.copy(HOUSE / "pendulum_env" / "envs" / file, place / "pendulum_env" / "envs")
    shutil.copytree(HOUSE / "pendulum_env" / "common", place / "pendulum_env" / "common")
    for file in (HOUSE / "pendulum_env").glob("*.py"):
        shutil.copy(file, place / "pendulum_env")
    (place / "integrators").mkdir()
    shutil.copy(HOUSE / "integrators" / "__init__.py", place / "integrators")
    return place


@pytest.mark.slow
@pytest.mark.parametrize(("foreign", "sentence"), [
    (None, "is missing, as after another 'integrators' was uninstalled; reinstall ours: pip install"),
    ("x = 1\n", "belongs to another distribution named 'integrators'; uninstall that one, then reinstall ours")])
def test_files_that_another_distribution_deleted_or_overwrote(
    foreign: str | None, sentence: str, copy: Path, tmp_path: Path
) -> None:
    ours = copy / "integrators" / "__init__.py"
    ours.unlink()
    if foreign is not None:
        ours.write_text(foreign)
    code, text = said(WAYS["import"], tmp_path, copy)
    assert code == 1
    assert text.splitlines()[-1].startswith(f"ImportError: {ours}")
    assert sentence in text


@pytest.mark.slow
def test_a_distribution_in_another_folder_is_to_be_uninstalled(copy: Path, tmp_path: Path) -> None:
    other = tmp_path / "user" / "site-packages" / "integrators"
    other.mkdir(parents=True)
    (other / "__init__.py").write_text("")
    text = said(WAYS["import"], tmp_path, other.parent, copy)[1]
    assert text.strip().endswith(f"{other} hides the package 'integrators' of lab-pendulum, because Python looks there "
                                 "first; uninstall the distribution that it belongs to.")


def test_a_module_that_a_program_makes_itself(tmp_path: Path) -> None:
    made = "import sys, types; sys.modules['integrators'] = types.ModuleType('integrators'); import pendulum_env"
    assert "The program made a module 'integrators' itself" in said(["-c", made], tmp_path, HOUSE)[1]


def test_a_folder_without_code_hides_nothing(tmp_path: Path) -> None:
    (tmp_path / "integrators").mkdir()
    assert said(WAYS["import"], tmp_path, HOUSE) == (0, "")
