"""A learner's loop with one version of Gymnasium; run by test_gymnasium_versions.py with the oldest and the newest."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers.vector import RecordEpisodeStatistics

import pendulum_env  # noqa: F401  # registers the environment

SIZE, STEPS = 16, 120
SETTINGS: dict[str, Any] = {"task": "balance", "diagnostics": (), "integrator": "symplectic_euler"}
COUNTS_RIGHT = tuple(map(int, gym.__version__.split(".")[:2])) >= (1, 4)
"""True for the versions whose RecordEpisodeStatistics knows SameStep."""


def vector(mode: str, **more: Any) -> Any:
    return gym.make_vec("LabPendulum-v0", num_envs=SIZE, autoreset_mode=mode, max_episode_steps=30, **SETTINGS, **more)


def test_the_checker_of_gymnasium_passes() -> None:
    check_env(gym.make("LabPendulum-v0", **SETTINGS).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("more", [{}, {"scene": "vacuum", "length": 0.4, "render_mode": "rgb_array"},
                                  {"randomize": {"length": (0.3, 0.4)}, "diagnostics": ("energy",)}])
def test_a_specification_is_that_of_its_json(more: dict[str, Any]) -> None:
    env = gym.make("LabPendulum-v0", **{"task": "balance", **more})
    for spec in (env.spec, gym.wrappers.TimeAwareObservation(env).spec, env.unwrapped.spec):
        assert spec is not None
        again = EnvSpec.from_json(spec.to_json())
        assert again == spec
        assert spec == again
        assert gym.make(again).spec == spec
        again.max_episode_steps = 7
        assert again != spec
        assert spec != again


def episodes(mode: str) -> tuple[list[tuple[float, int]], list[tuple[float, int]]]:
    """Return the returns and lengths of finished episodes, summed here and as RecordEpisodeStatistics counts them."""
    env = RecordEpisodeStatistics(vector(mode))
    env.reset(seed=1)
    source = np.random.default_rng(2)
    own, theirs = [], []
    returns, lengths, ended = np.zeros(SIZE), np.zeros(SIZE, int), np.zeros(SIZE, bool)
    for _ in range(STEPS):
        _, reward, terminated, truncated, infos = env.step(source.uniform(-1, 1, (SIZE, 1)).astype(np.float32))
        counts = ~ended if mode == "NextStep" else np.ones(SIZE, bool)  # a step that only resets
        returns[counts] += reward[counts]
        lengths[counts] += 1
        over = terminated | truncated
        for i in np.flatnonzero(over):
            own.append((float(returns[i]), int(lengths[i])))
            theirs.append((float(infos["episode"]["r"][i]), int(infos["episode"]["l"][i])))
        returns[over], lengths[over] = 0.0, 0
        ended = over
    return own, theirs


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_the_statistics_of_gymnasium_are_as_the_readme_says(mode: str) -> None:
    """In SameStep, versions below 1.4 leave out the first step of every episode but the first."""
    own, theirs = episodes(mode)
    assert len(own) > 3*SIZE
    if mode == "NextStep" or COUNTS_RIGHT:
        assert [length for _, length in own] == [length for _, length in theirs]
        assert [one for one, _ in own] == pytest.approx([one for one, _ in theirs])
        return
    short = [length - counted for (_, length), (_, counted) in zip(own, theirs, strict=True)]
    assert short.count(0) == SIZE
    assert short.count(1) == len(short) - SIZE


def test_a_learner_of_gains_learns_to_balance() -> None:
    """Random search over the gains of a linear policy, with returns summed as the README's recipe sums them."""
    env, source = gym.make_vec("LabPendulum-v0", num_envs=SIZE, autoreset_mode="SameStep", **SETTINGS), (
        np.random.default_rng(0))
    gains, best, first = np.zeros(2), -np.inf, 0.0
    for trial in range(40):
        trying = gains + (source.normal(size=2)*(4.0, 1.0) if trial else 0.0)
        seen, _ = env.reset(seed=5)
        running, done, returns = np.zeros(SIZE), np.zeros(SIZE, bool), np.zeros(SIZE)
        for _ in range(200):
            # The angle from upright is that of (-cos, -sin).
            phi = np.arctan2(-seen[:, 1], -seen[:, 0])
            seen, reward, terminated, truncated, _ = env.step(
                np.clip(trying[0]*phi + trying[1]*seen[:, 2], -1.0, 1.0)[:, None].astype(np.float32))
            running += reward
            over = terminated | truncated
            returns[over & ~done] = running[over & ~done]
            done |= over
            running[over] = 0.0
        mean = float(np.where(done, returns, running).mean())
        first = mean if trial == 0 else first
        if mean > best:
            gains, best = trying, mean
    assert first < 60.0
    assert best > 150.0
