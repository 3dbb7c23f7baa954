"""Every example runs headless, prints a number and checks it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("[0-9][0-9]_*.py"))
FOREIGN = ("11_train_swing_up",)
"""Run by test_foreign.py, in an environment that has what they need."""
MANY = ("10_thousands_at_once", "12_does_the_policy_exploit_the_integrator")
"""Too many steps to be interpreted."""
CASES = [
    pytest.param(path, backend, id=f"{path.stem}-{backend}", marks=[pytest.mark.slow] if backend == "compiled" else [])
    for path in EXAMPLES for backend in ("python", "compiled")
    if path.stem not in FOREIGN and not (path.stem in MANY and backend == "python")]


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_example_is_short_and_checks_itself(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    assert "assert " in source
    assert len(source.splitlines()) < 60


@pytest.mark.parametrize(("path", "backend"), CASES)
def test_example(path: Path, backend: str, tmp_path: Path) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    result = subprocess.run([sys.executable, "-W", "error", str(path)], capture_output=True, text=True, cwd=tmp_path,
                            env={**environment, "LAB_PENDULUM_BACKEND": backend})
    assert result.returncode == 0, result.stderr
    assert any(character.isdigit() for character in result.stdout)


def test_examples_are_numbered_without_gaps() -> None:
    assert [int(path.name[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))
