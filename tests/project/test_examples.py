"""Every example runs headless, prints a number and checks it."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("[0-9][0-9]_*.py"))
FOREIGN = ("11_train_swing_up", "17_fit_by_gradient", "18_swing_up_by_gradient", "19_swing_up_with_least_work")
"""Run by test_foreign.py and tests/jax, in environments that have what they need."""
INTERPRETED = ("01_", "03_", "07_", "08_", "20_")
"""Beginnings of examples of few steps, which quick tests run; the others have many, or a film, or take real time."""
ALONE = [path for path in EXAMPLES if path.stem not in FOREIGN]


def test_examples_are_short_and_check_themselves() -> None:
    sources = {path.name: path.read_text(encoding="utf-8") for path in EXAMPLES}
    assert [name for name, source in sources.items() if "assert " not in source or source.count("\n") >= 65] == []


@pytest.mark.parametrize("path", [path for path in ALONE if path.stem.startswith(INTERPRETED)],
                         ids=lambda path: path.stem)
@pytest.mark.usefixtures("interpreted")
def test_example_interpreted(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In this process, which has imported what they need."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(path)])
    code: Any = 0
    try:
        runpy.run_path(str(path), run_name="__main__")
    except SystemExit as stop:
        code = stop.code
    assert not code
    check(path, capsys.readouterr().out, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("path", ALONE, ids=lambda path: path.stem)
def test_example(path: Path, tmp_path: Path) -> None:
    """As users run them, where every warning is an error."""
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "LAB_PENDULUM_BACKEND")}
    result = subprocess.run([sys.executable, "-W", "error", str(path)], capture_output=True, text=True, cwd=tmp_path,
                            env=environment)
    assert result.returncode == 0, result.stderr
    check(path, result.stdout, tmp_path)


def check(path: Path, printed: str, folder: Path) -> None:
    """AssertionError unless a number was printed, and the figures of the exercise were drawn."""
    assert any(character.isdigit() for character in printed)
    if path.stem == "02_the_exercise":
        drawn = {path.name for path in (folder / "out" / "exercise").iterdir()}
        assert drawn == {"angle.png", "velocity.png", "phase.png", "energy.png", "energy_residual.png"}


@pytest.mark.slow
def test_what_is_missing_for_training_is_said_in_one_sentence(tmp_path: Path) -> None:
    path = next(path for path in EXAMPLES if path.stem in FOREIGN)
    (tmp_path / "torch.py").write_text("raise ModuleNotFoundError('No module named torch', name='torch')")
    told = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, check=False,
                          env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *filter(None, sys.path)])})
    assert told.returncode == 1
    assert told.stderr == "torch is not installed; this example needs: pip install 'lab-pendulum[sb3]'\n"


def test_examples_are_numbered_without_gaps() -> None:
    assert [int(path.name[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
