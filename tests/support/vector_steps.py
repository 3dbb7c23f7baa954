"""Steps of a vector environment beside those of another one, compared in every bit."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from pendulum_env import LabPendulumVectorEnv

MODES = [mode.value for mode in AutoresetMode]


def vector(size: int, **options: Any) -> LabPendulumVectorEnv:
    env = gym.make_vec("LabPendulum-v0", num_envs=size, **options)
    assert isinstance(env, LabPendulumVectorEnv)
    return env


def same(found: Any, wanted: Any, where: str = "") -> None:
    """Assert that two results have equal types, shapes and bits, including nested entries."""
    assert type(found) is type(wanted), where
    if isinstance(wanted, dict):
        assert set(found) == set(wanted), where
        for key in wanted:
            same(found[key], wanted[key], f"{where}/{key}")
    elif isinstance(wanted, tuple):
        for i, (mine, theirs) in enumerate(zip(found, wanted, strict=True)):
            same(mine, theirs, f"{where}/{i}")
    elif isinstance(wanted, np.ndarray):
        assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape), where
        if wanted.dtype == object:
            same(tuple(found), tuple(wanted), where)
        else:
            assert found.tobytes() == wanted.tobytes() or np.array_equal(found, wanted), where
    else:
        assert found == wanted, where


def side_by_side(mine: Any, theirs: Any, mode: str, steps: int, seed: int = 7) -> int:
    """Step two environments with equal actions, some outside the box; return the number of episodes that ended."""
    random, size, ended = np.random.default_rng(1), mine.num_envs, 0
    same(mine.reset(seed=seed), theirs.reset(seed=seed), "reset")
    for k in range(steps):
        actions = random.uniform(-1.2, 1.2, (size, 1)).astype(np.float32)
        found, wanted = mine.step(actions), theirs.step(actions)
        same(found, wanted, f"step {k}")
        over = wanted[2] | wanted[3]
        ended += int(over.sum())
        if mode == "Disabled" and over.any():
            same(mine.reset(options={"reset_mask": over.copy()}), theirs.reset(options={"reset_mask": over}), f"at {k}")
    return ended
