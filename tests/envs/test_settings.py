"""Tests that settings are declared once: signatures, docstrings and tables follow from fields; and action_noise."""

from __future__ import annotations

import inspect
from dataclasses import fields
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from readme_code import check_listed
from scipy.stats import kstest, norm

from pendulum_env import LabPendulumEnv, LabPendulumVectorEnv, SceneError, Task, rollout
from pendulum_env.engine.settings import RunSettings, declared, meaning
from pendulum_env.envs.settings import EnvSettings, VectorSettings, split_settings
from pendulum_env.physics.units import UnknownParameterError


def echo(action: float) -> float:
    """A reward: the action that acts."""
    return action


ECHO = Task("echo", echo)
NOISY: dict[str, Any] = {"action_noise": 0.3, "backend": "python", "task": "balance"}
READ = {"observation": "encoder", "action_delay": 0.02, "sensor": {"noise": 0.01}}


@pytest.fixture(autouse=True)
def _interpreted(all_interpreted: None) -> None:
    """Keep all programs interpreted."""


# --- declarations -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "settings"), [(LabPendulumEnv, EnvSettings), (LabPendulumVectorEnv, VectorSettings)])
def test_signatures_and_docstrings_are_those_of_the_fields(kind: Any, settings: type) -> None:
    known = inspect.signature(kind).parameters
    assert [*known] == [*(entry.name for entry in fields(settings) if entry.name != "parameters"), "parameters"]
    said = " ".join(f"{LabPendulumEnv.__doc__} {kind.__doc__}".split())
    for entry in declared(settings):
        assert known[entry.name].default == entry.default
        assert f"- `{entry.name}` ({entry.default!r}): {meaning(entry)}" in said


def test_rollout_has_the_declared_settings_and_their_defaults() -> None:
    known = inspect.signature(rollout).parameters
    for entry in declared(RunSettings):
        assert entry.name == "careful" or known[entry.name].default == entry.default  # careful is in **parameters
        assert f"{entry.name}: {meaning(entry)}" in " ".join((rollout.__doc__ or "").split())


def test_the_readme_has_the_table_of_settings() -> None:
    check_listed("settings")


def test_meanings_have_units_ranges_and_words() -> None:
    said = {entry.name: meaning(entry) for entry in declared(VectorSettings)}
    assert said["dt"].startswith("control step [s], above 0; ")
    assert said["speed_penalty"].endswith(", at least 0")
    assert ": full, angle, encoder, history" in said["observation"]
    assert not any("`" in text or text.endswith((" ", ".")) for text in said.values())


def test_settings_of_an_environment_can_be_read() -> None:
    env = LabPendulumEnv(duration=2.0, damping="linear", gamma=0.1, backend="python")
    assert (env.duration, env.damping, env.dt, env.gamma) == (2.0, "linear", 0.02, 0.1)
    assert LabPendulumVectorEnv(2, copy=False, backend="python").copy is False


def test_settings_are_parted_from_parameters() -> None:
    given = {"length": 0.5, "dt": 0.1, "action_noise": 0.2}
    assert split_settings(given, ["dt"]) == ({"action_noise": 0.2}, {"length": 0.5, "dt": 0.1})


@pytest.mark.parametrize("kind", [LabPendulumEnv, LabPendulumVectorEnv])
def test_a_misspelt_setting_is_named(kind: Any) -> None:
    with pytest.raises(UnknownParameterError, match="argument 'action_nois'; did you mean action_noise"):
        kind(action_nois=0.1)


# --- noise of actions -------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_noise_of_actions_is_normal_and_new_in_every_step() -> None:
    env = LabPendulumVectorEnv(4000, task=ECHO, action_noise=0.2, backend="python")
    env.reset(seed=0)
    first, second = (env.step(np.full((4000, 1), 0.1, np.float32))[1] for _ in range(2))
    for acted in (first, second):
        assert kstest(acted, norm(0.1, 0.2).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.06
    wide = LabPendulumVectorEnv(2000, task=ECHO, action_noise=5.0, backend="python")
    wide.reset(seed=0)
    acted = wide.step(np.zeros((2000, 1), np.float32))[1]
    assert np.max(np.abs(acted)) == 1.0
    assert np.mean(acted == 1.0) == pytest.approx(norm.sf(1.0, scale=5.0), abs=0.04)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("more", [{}, READ], ids=["true", "read"])
def test_environment_i_has_the_noise_of_the_single_one(mode: AutoresetMode, more: dict[str, Any]) -> None:
    how: dict[str, Any] = {"max_episode_steps": 5, **NOISY, **more}
    many = LabPendulumVectorEnv(3, autoreset_mode=mode, **how)
    one = gym.make_vec("LabPendulum-v0", 3, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **how)
    assert (many.reset(seed=5)[0] == one.reset(seed=5)[0]).all()
    for actions in np.random.default_rng(0).uniform(-1.2, 1.2, (14, 3, 1)).astype(np.float32):
        for mine, other in zip(many.step(actions)[:4], one.step(actions)[:4], strict=True):
            assert np.array_equal(mine, other)


def test_noise_of_actions_is_resumed_with_a_saved_state() -> None:
    env = LabPendulumEnv(**NOISY)
    env.reset(seed=1)
    saved = env.get_state()
    after = [env.step(np.array([0.5], np.float32))[0].tobytes() for _ in range(3)]
    env.set_state(saved)
    assert [env.step(np.array([0.5], np.float32))[0].tobytes() for _ in range(3)] == after


@pytest.mark.parametrize("more", [{}, {"action_noise": 0}, {"action_noise": 0.3}], ids=str)
def test_a_step_draws_random_numbers_only_for_noise_of_actions(more: dict[str, Any]) -> None:
    env, usual = LabPendulumEnv(backend="python", **more), LabPendulumEnv(backend="python")
    for one in (env, usual):
        one.reset(seed=3)
    before = env.get_state()["random"]
    seen, other = (one.step(np.array([0.5], np.float32))[0].tobytes() for one in (env, usual))
    assert (env.get_state()["random"] == before) is (seen == other) is (not more.get("action_noise"))


def test_noise_of_actions_is_in_the_specification() -> None:
    env = gym.make("LabPendulum-v0", **NOISY)
    assert env.spec is not None
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.get_wrapper_attr("action_noise") == 0.3


def test_bad_noise_is_refused() -> None:
    with pytest.raises(SceneError, match=r"action_noise must be a finite number of at least 0, not -1\.0"):
        LabPendulumEnv(action_noise=-1.0)
