"""Every example runs headless, prints a number and checks it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("[0-9][0-9]_*.py"))
FOREIGN = ("11_train_swing_up", "17_fit_by_gradient", "18_swing_up_by_gradient", "19_swing_up_with_least_work")
"""Run by test_foreign.py and tests/jax, in environments that have what they need."""
MANY = ("10_thousands_at_once", "12_does_the_policy_exploit_the_integrator", "13_driven_bench", "14_posterior",
        "16_sim_to_real", "21_film_to_fit")
"""Too many steps to be interpreted, or pixels to be drawn."""
CASES = [
    pytest.param(path, backend, id=f"{path.stem}-{backend}", marks=[pytest.mark.slow] if backend == "compiled" else [])
    for path in EXAMPLES for backend in ("python", "compiled")
    if path.stem not in FOREIGN and not (path.stem in MANY and backend == "python")]


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_example_is_short_and_checks_itself(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    assert "assert " in source
    assert len(source.splitlines()) < 65


@pytest.mark.parametrize(("path", "backend"), CASES)
def test_example(path: Path, backend: str, tmp_path: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    result = subprocess.run([sys.executable, "-W", "error", str(path)], capture_output=True, text=True, cwd=tmp_path,
                            env={**environment, "LAB_PENDULUM_BACKEND": backend})
    assert result.returncode == 0, result.stderr
    assert any(character.isdigit() for character in result.stdout)
    if path.stem == "02_the_exercise":
        drawn = {path.name for path in (tmp_path / "out" / "exercise").iterdir()}
        assert drawn == {"angle.png", "velocity.png", "phase.png", "energy.png", "energy_residual.png"}


def test_what_is_missing_for_training_is_said_in_one_sentence(tmp_path: Path) -> None:
    path = next(path for path in EXAMPLES if path.stem in FOREIGN)
    (tmp_path / "torch.py").write_text("raise ModuleNotFoundError('No module named torch', name='torch')")
    told = subprocess.run([sys.executable, str(path)], capture_output=True, text=True, check=False,
                          env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *filter(None, sys.path)])})
    assert told.returncode == 1
    assert told.stderr == "torch is not installed; this example needs: pip install 'lab-pendulum[sb3]'\n"


def test_examples_are_numbered_without_gaps() -> None:
    assert [int(path.name[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
