"""Module paths of version 0.1 still work in scripts, saved specs and pickles; a warning names the new path."""

from __future__ import annotations

import pickle
import subprocess
import sys
from importlib import import_module

import gymnasium as gym
import pytest
from gymnasium.envs.registration import EnvSpec

import integrators.moved
import pendulum_env.moved
from pendulum_env import LabPendulumEnv

PATHS = {**integrators.moved.MOVED, **pendulum_env.moved.MOVED}


@pytest.fixture(autouse=True)
def unloaded(monkeypatch: pytest.MonkeyPatch) -> None:
    """No old path has been imported yet."""
    for path in PATHS:
        monkeypatch.delitem(sys.modules, path, raising=False)


@pytest.mark.parametrize("old", PATHS)
def test_an_old_path_is_the_module_at_the_new_one(old: str) -> None:
    new = import_module(PATHS[old])
    with pytest.warns(DeprecationWarning, match="has moved") as caught:
        module = import_module(old)
    package = old.rpartition(".")[0]  # the warning of a moved package names its modules' new place, too
    said = {f"{path} has moved to {PATHS[path]}." for path in (old, package) if path in PATHS}
    assert said & {str(warning.message) for warning in caught}
    assert module is new
    assert new.__spec__ is not None
    assert new.__spec__.name == PATHS[old]


def test_a_spec_saved_before_the_move_makes_an_environment() -> None:
    spec = gym.make("LabPendulum-v0", backend="python").spec
    assert spec is not None
    saved = spec.to_json().replace(LabPendulumEnv.__module__, "pendulum_env.env")
    assert "pendulum_env.env:" in saved
    with pytest.warns(DeprecationWarning, match="has moved"):
        env = gym.make(EnvSpec.from_json(saved))
    assert type(env.unwrapped) is LabPendulumEnv


def test_an_environment_pickled_before_the_move_goes_on() -> None:
    env = LabPendulumEnv(backend="python")
    env.reset(seed=1)
    saved = pickle.dumps(env, protocol=0).replace(LabPendulumEnv.__module__.encode(), b"pendulum_env.env")
    with pytest.warns(DeprecationWarning, match="has moved"):
        copy = pickle.loads(saved)
    action = env.action_space.sample()
    assert copy.step(action)[4] == env.step(action)[4]


def test_python_m_takes_an_old_path() -> None:
    done = subprocess.run([sys.executable, "-m", "pendulum_env.api_pages"], capture_output=True, text=True, check=False)
    assert "pendulum_env.cli.api_pages" in done.stderr


@pytest.mark.parametrize(("module", "old", "new"), [
    ("render", "Look", "FrameStyle"), ("render.stage", "Look", "FrameStyle"),
    ("render", "Past", "PastSamples"), ("render.view", "Past", "PastSamples"),
])
def test_a_class_is_importable_by_its_old_name(module: str, old: str, new: str) -> None:
    here = import_module(f"pendulum_env.{module}")
    assert getattr(here, old) is getattr(here, new)
