"""Policies of the package in compiled programs of JAX: the actions that NumPy computes; run where JAX is."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np
import pytest

import pendulum_env.jax as twin
from pendulum_env.controllers import POLICIES, load


@pytest.mark.parametrize("name", POLICIES)
def test_the_policy_in_a_compiled_rollout_is_that_of_numpy(name: str) -> None:
    """Actions agree to the rounding of float32, and the episode earns what the policy's card says."""
    policy = load(name)
    env = twin.LabPendulum(task=name, diagnostics=()).gymnax(split=True)

    @jax.jit
    def played(key: Any) -> Any:
        def turn(carry: Any, _: Any) -> Any:
            seen, state = carry
            action = policy.act(seen)
            after, state, reward, *_ = env.step(key, state, action)
            return (after, state), (seen, action, reward)

        return jax.lax.scan(turn, env.reset(key), None, length=500)[1]

    seen, actions, rewards = map(np.asarray, played(jax.random.key(0)))
    assert np.abs(policy(seen) - actions).max() < 2e-5
    returns = policy.card["evaluation"]["return"]
    assert abs(rewards.sum() - returns["mean"]) < 6.0 * returns["sd"]
