"""pyproject.toml declares every package that the project imports, and its core suffices for every command."""

from __future__ import annotations

import ast
import re
import shlex
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest
import typer
from readme_code import ROOT, only
from syntax_trees import nodes_of

from pendulum_env.cli import app

(CORE,) = re.findall(
    r"^dependencies = \[\n(.*?)^\]", (ROOT / "pyproject.toml").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
DECLARED = set(re.findall(r'^    "([\w-]+)', CORE, flags=re.M))
MODULES = {"PIL": "Pillow", "pygame": "pygame-ce"}
"""Name of a module -> name of its package, where they differ by more than a dash."""
OPTIONAL = {"anywidget", "arviz_base", "av", "corner", "cv2", "distributed", "emcee", "h5py", "jax", "jinja2",
            "markupsafe", "minari", "mpmath", "python_calamine", "serial", "stable_baselines3", "tensordict",
            "torch", "torchrl", "traitlets", "godirect", "pasco", "nidaqmx", "xlrd"}
"""Modules that a user installs for one feature, which names the package where it is missing; markupsafe is jinja2's,
traitlets anywidget's, torch and tensordict TorchRL's, h5py Minari's; serial is pyserial, cv2 OpenCV."""
TOOLS = (" uv", " build twine hatchling")
"""What workflows install beside the package."""
MAIN_JOB = only(r"<!-- main job -->\n```sh\n.*?&& \.venv/bin/lab-pendulum (.*?)\n```", "the main job")
"""Words behind ``lab-pendulum`` in README's first command."""


@pytest.mark.slow
def test_every_imported_package_is_declared_and_every_declared_one_is_used() -> None:
    imported = set()
    for path in (*(ROOT / "pendulum_env").rglob("*.py"), *(ROOT / "integrators").rglob("*.py")):
        for node in nodes_of(path):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [
                node.module or ""] if isinstance(node, ast.ImportFrom) else []
            imported |= {name.partition(".")[0] for name in names}
    foreign = imported - {*sys.stdlib_module_names, "pendulum_env", "integrators"}
    assert foreign >= OPTIONAL
    packages = {MODULES.get(name, name.replace("_", "-")) for name in foreign - OPTIONAL}
    assert packages == DECLARED - {"moviepy"}  # imported by Gymnasium's RecordVideo, which films episodes


@pytest.mark.slow
def test_functions_that_are_chosen_by_type_name_one_type_each() -> None:
    """Python 3.10, the oldest that is declared, cannot import a module in which ``register`` reads ``a | b``."""
    found = []
    for path in (*(ROOT / "pendulum_env").rglob("*.py"), *(ROOT / "integrators").rglob("*.py")):
        for node in nodes_of(path):
            if isinstance(node, ast.FunctionDef) and any(
                    isinstance(one, ast.Attribute) and one.attr == "register" for one in node.decorator_list):
                chosen = next(one for one in node.args.args if one.arg != "self")
                found.append((f"{path.name}, line {node.lineno}", chosen.annotation))
    assert len(found) > 10
    assert not [place for place, kind in found if isinstance(kind, ast.BinOp)]


def test_no_class_marks_its_keywords_by_an_annotation() -> None:
    """Python 3.10 cannot read the types of a class with ``_: KW_ONLY``, from which signatures are made."""
    for path in (*(ROOT / "pendulum_env").rglob("*.py"), *(ROOT / "integrators").rglob("*.py")):
        assert "KW_ONLY" not in path.read_text(encoding="utf-8"), path


def test_workflows_install_declared_packages_and_run_actions_of_known_commits() -> None:
    """A second list of packages falls behind, and an action's tag can be moved to other code."""
    extras = re.findall(r"^(\w+) = \[", (ROOT / "pyproject.toml").read_text(encoding="utf-8"), flags=re.M)
    texts = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / ".github" / "workflows").iterdir()}
    for name, text in texts.items():
        installs = [words for words in re.findall(r"\bpip install\b(.*)", text) if words not in TOOLS]
        assert installs, name
        for words in installs:
            found = re.search(r' (?:--editable "\.|"\$\(ls dist/\*\.\S+ matrix.built \S+\))\[([\w,]+)\]"$', words)
            assert {*(found[1].split(",") if found else ["none"])} <= {*extras}, words
        for action in re.findall(r"\buses:(.*)", text):
            assert re.fullmatch(r" [\w/-]+@[0-9a-f]{40}  # v\d+\.\d+\.\d+", action), action
    assert {*re.findall(r" --editable (\S+)", texts["tests.yml"])} == {'".[test]"'}
    for tests in (texts["tests.yml"], texts["release.yml"]):
        commands = re.findall(r"\brun: lab-pendulum (.*)", tests)
        assert [shlex.split(words) for words in commands] == [shlex.split(MAIN_JOB)]
        assert [path for path in re.findall(r"\btests/[\w/.]+", tests) if not (ROOT / path).exists()] == []


def test_the_newest_numba_is_tried_because_there_is_a_bound() -> None:
    """Private names of it are used."""
    assert re.search(r'^    "numba>=[\d.]+,<[\d.]+"', CORE, flags=re.M)
    tried = (ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8").partition("\n  numba:")[2]
    assert re.search(r'echo "numba>=[\d.]+rc1" >newest.txt', tried), "an override without a bound, open to candidates"
    assert "--override newest.txt" in tried


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command ``lab-pendulum`` of an environment in which the project is installed without any extra."""
    folder = tmp_path_factory.mktemp("core")
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout.decode()
    for name in filter(None, tracked.split("\0")):
        if (ROOT / name).is_file():
            (folder / "source" / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / "source" / name)
    venv.create(folder / "core", with_pip=True)
    scripts = folder / "core" / ("Scripts" if sys.platform == "win32" else "bin")
    subprocess.run([scripts / "python", "-m", "pip", "install", "-q", "--no-compile", folder / "source"], check=True,
                   cwd=folder)
    return scripts / "lab-pendulum"


def run(command: Path, words: list[str], folder: Path) -> str:
    done = subprocess.run([command, *words], cwd=folder, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_core_runs_the_main_job_and_every_commands_help(
    command: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)
    assert "rk4" in run(command, shlex.split(MAIN_JOB), tmp_path)
    assert {path.suffix for path in (tmp_path / "out" / "compare").iterdir()} >= {".png", ".csv", ".mp4"}
    assert "rk4" in run(command, ["list", "integrators"], tmp_path)
    for name in typer.main.get_command(app).commands:  # type: ignore[attr-defined]
        assert "Usage" in run(command, [name, "--help"], tmp_path)
