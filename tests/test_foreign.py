"""Foreign programs, each in an environment of its own: they stay out of the package's dependencies."""

from __future__ import annotations

import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
# One release of torch with a CPU build; Stable-Baselines3 takes it rather than gigabytes of GPU libraries.
STABLE_BASELINES = ("torch==2.13.0", "stable-baselines3>=2.3")

CHECK = """
import warnings
import gymnasium as gym
import pendulum_env
from pendulum_env.engine.machine import fitting
from pendulum_env.tasks import TASKS
from stable_baselines3.common.env_checker import check_env

warnings.simplefilter("error")
count = 0
for scene in pendulum_env.SCENES:
    for task in TASKS:
        for integrator in fitting(pendulum_env.SCENES[scene]):
            env = gym.make("LabPendulum-v0", scene=scene, task=task, integrator=integrator)
            check_env(env.unwrapped, warn=True, skip_render_check=integrator != "rk4")
            count += 1
print(count, "combinations of scene, task and method pass")
"""

TRAIN = """
from stable_baselines3 import PPO
import pendulum_env
model = PPO("MlpPolicy", "LabPendulum-v0", n_steps=64, batch_size=64, device="cpu")
model.learn(128)
print("trained", model.num_timesteps)
"""


@pytest.fixture(scope="module")
def trainer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Python of an environment with the package and Stable-Baselines3."""
    folder = tmp_path_factory.mktemp("sb3")
    venv.create(folder, with_pip=True)
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    subprocess.run([python, "-m", "pip", "install", "-q", *STABLE_BASELINES, str(ROOT)], check=True)
    return python


@pytest.mark.slow
@pytest.mark.parametrize(("script", "said"), [(CHECK, "combinations"), (TRAIN, "trained 128")], ids=["check", "train"])
def test_stable_baselines(trainer: Path, script: str, said: str, tmp_path: Path) -> None:
    done = subprocess.run([trainer, "-c", script], capture_output=True, text=True, cwd=tmp_path)
    print(done.stdout)
    assert done.returncode == 0, done.stderr
    assert said in done.stdout
