"""The settings in examples/learning/settings are what RL Zoo and Stable-Baselines3 know, for environments of ours."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest
import yaml
from gymnasium.wrappers import RescaleObservation

import pendulum_env

FOLDER = Path(__file__).parents[2] / "examples" / "learning" / "settings"
ZOO = {"n_envs", "n_timesteps", "policy", "normalize", "env_kwargs", "env_wrapper"}
"""Names that RL Zoo 2.9 reads itself (rl_zoo3/exp_manager.py) and takes out before it makes the algorithm."""
ALGORITHMS = {
    "ppo": {"learning_rate", "n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "clip_range", "clip_range_vf",
            "normalize_advantage", "ent_coef", "vf_coef", "max_grad_norm", "use_sde", "sde_sample_freq", "target_kl",
            "policy_kwargs"},
    "sac": {"learning_rate", "buffer_size", "learning_starts", "batch_size", "tau", "gamma", "train_freq",
            "gradient_steps", "action_noise", "ent_coef", "target_update_interval", "target_entropy", "use_sde",
            "sde_sample_freq", "use_sde_at_warmup", "policy_kwargs"},
}
"""Arguments of Stable-Baselines3 2.9's PPO and SAC that settings may have."""
SETTINGS = [(algorithm, name, settings) for algorithm in ALGORITHMS
            for name, settings in yaml.safe_load((FOLDER / f"{algorithm}.yml").read_text(encoding="utf-8")).items()]


@pytest.mark.parametrize(("algorithm", "name", "settings"), SETTINGS, ids=[f"{one[0]}-{one[1]}" for one in SETTINGS])
def test_settings_are_known(algorithm: str, name: str, settings: dict[str, Any]) -> None:
    assert name in gym.registry
    assert ZOO >= {*settings} - ALGORITHMS[algorithm] >= {"n_timesteps", "policy"}
    assert type(settings["n_timesteps"]) is int  # YAML 1.1 reads 5e5 as a text
    if algorithm == "ppo":
        assert settings["n_envs"] * settings["n_steps"] % settings["batch_size"] == 0


@pytest.mark.parametrize(("algorithm", "name", "settings"), SETTINGS, ids=[f"{one[0]}-{one[1]}" for one in SETTINGS])
@pytest.mark.filterwarnings("ignore:.*precision lowered:UserWarning")  # of Gymnasium, for bounds given as numbers
@pytest.mark.usefixtures("interpreted")
def test_environments_of_settings_are_made_and_scaled(algorithm: str, name: str, settings: dict[str, Any]) -> None:
    """As RL Zoo makes them: keywords of gym.make, then the wrapper."""
    env: Any = gym.make(name, **settings.get("env_kwargs", {}))
    for wrapper, keywords in settings.get("env_wrapper", {}).items():
        assert wrapper == "gymnasium.wrappers.RescaleObservation"
        env = RescaleObservation(env, **keywords)
    seen, _ = env.reset(seed=0, options={"velocity": 5.0} if "Track" not in name else None)
    assert seen.shape == env.observation_space.shape
    assert abs(seen[2]) <= 1.0
    assert abs(seen[2]) > 0.1 or "Track" in name  # with an unlimited bound it would be 0


def test_settings_are_for_these_tasks() -> None:
    names = {algorithm: {name for one, name, _ in SETTINGS if one == algorithm} for algorithm in ALGORITHMS}
    assert names["ppo"] >= {pendulum_env.ENV_ID, "LabPendulumBalance-v0", "LabPendulumTrack-v0",
                            "LabPendulumGymnasium-v0", "LabPendulumMotorBench-v0"}
    assert names["sac"] >= {pendulum_env.ENV_ID, "LabPendulumBalance-v0"}
