"""The oldest and the newest Gymnasium that the package allows, each in an environment of its own."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest
from beside import environment
from gymnasium.envs.registration import EnvSpec
from readme_code import ROOT

CHECKS = Path(__file__).with_name("gymnasium_loop.py")


def oldest() -> str:
    """Return the oldest version that pyproject.toml allows."""
    found = re.search(r'"gymnasium>=([\d.]+)', (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert found
    return found[1]


@pytest.mark.slow
@pytest.mark.parametrize("which", ["oldest", "newest"])
def test_a_learners_loop_runs(which: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    wanted = (f"gymnasium=={oldest()}",) if which == "oldest" else ("--upgrade", "gymnasium")
    python = environment(tmp_path_factory, f"gymnasium-{which}", *wanted)
    settings = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    said = subprocess.run([python, "-c", "import gymnasium; print(gymnasium.__version__)"], cwd=ROOT, env=settings,
                          capture_output=True, text=True, check=True).stdout.strip()
    assert which == "newest" or said.startswith(oldest())
    done = subprocess.run([python, "-m", "pytest", "-q", "-p", "no:cacheprovider", CHECKS], cwd=ROOT, env=settings,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-20_000:] + done.stderr[-5_000:]
    assert re.search(r"^\d+ passed in", done.stdout, flags=re.M), done.stdout


def test_a_specification_is_that_of_its_json() -> None:
    import gymnasium as gym

    env = gym.make("LabPendulum-v0", length=0.4, diagnostics=("energy", "flow"))
    assert env.spec is not None
    assert EnvSpec.from_json(env.spec.to_json()) == env.spec
    assert env.spec == gym.make(env.spec).spec
    assert env.spec != gym.make("LabPendulum-v0", length=0.5).spec
    assert env.spec != "LabPendulum-v0"
    vector = gym.make_vec("LabPendulum-v0", num_envs=2, length=[0.3, 0.4])
    assert vector.spec is not None
    assert EnvSpec.from_json(vector.spec.to_json()) == vector.spec
