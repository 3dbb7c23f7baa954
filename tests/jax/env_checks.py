"""Checks of the environment in JAX beside the one of ``gym.make``, and of its loops. Run by test_twin.py."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.experimental.functional import FuncEnv

import pendulum_env.jax as twin
from pendulum_env import Task
from pendulum_env.physics.units import SceneError
from pendulum_env.tasks import TASKS

jax.config.update("jax_enable_x64", True)
START = {"angle": 3.0, "velocity": 0.4}


def spin(velocity: float, phi: float, angle_before: float) -> float:
    return velocity - 0.1 * phi**2 if angle_before > 3.0 else 0.5 * velocity


def spun(phi: float) -> bool:
    return phi > 1.0


SPIN = Task("spin", spin, spun, start=lambda first, second, omega0: (first, omega0 * second))


def beside(keywords: dict[str, Any], steps: int = 80) -> None:
    """AssertionError unless an episode with drawn actions is that of ``gym.make``."""
    ours = twin.LabPendulum(**keywords)
    theirs = gym.make("pendulum_env:LabPendulum-v0", backend="python", max_episode_steps=-1, disable_env_checker=True,
                      **keywords)
    seen, info = theirs.reset(seed=1, options=dict(START))
    state = ours.started(START["angle"], START["velocity"])
    assert np.asarray(ours.observation(state)) == pytest.approx(seen, abs=1e-6)

    @jax.jit
    def step(state: Any, action: Any) -> Any:
        after = ours.transition(state, action)
        return (after, ours.observation(after), ours.reward(state, action, after), ours.terminal(after),
                ours.state_info(after))

    source = np.random.default_rng(2)
    for _ in range(steps):
        action = source.uniform(-1.2, 1.2, 1).astype(np.float32)
        seen, reward, ended, _, info = theirs.step(action)
        state, observed, given, ends, told = step(state, action)
        assert observed.dtype == jnp.float32
        assert np.asarray(observed) == pytest.approx(seen, abs=1e-6)
        assert float(given) == pytest.approx(reward, rel=1e-10, abs=1e-12)
        assert bool(ends) == ended
        for name in told:
            assert float(told[name]) == pytest.approx(info[name], rel=1e-9, abs=1e-12)
        if ended:
            break


@pytest.mark.parametrize("task", [*TASKS, SPIN], ids=lambda task: getattr(task, "name", task))
def test_a_task_is_that_of_gym_make(task: Any) -> None:
    beside({"task": task})


@pytest.mark.parametrize("keywords", [
    {"integrator": "ab4", "substeps": 12}, {"lag": 0.1, "substeps": 3}, {"scene": "lab_rod", "length": 0.5},
    {"task": "free", "speed_limit": 5.0}, {"integrator": "gauss4", "dt": 0.05},
    {"scene": "gymnasium", "task": "gymnasium"},
], ids=str)
def test_other_settings_are_those_of_gym_make(keywords: dict[str, Any]) -> None:
    beside(keywords)


def test_it_is_gymnasiums_functional_interface() -> None:
    env = twin.LabPendulum()
    assert isinstance(env, FuncEnv)
    state = env.initial(jax.random.key(0))
    assert env.observation_space.contains(np.asarray(env.observation(state)))
    angles = jax.vmap(lambda key: env.state_info(env.initial(key))["angle"])(jax.random.split(jax.random.key(1), 400))
    assert float(jnp.abs(angles).max()) <= 0.1
    assert float(jnp.std(angles)) == pytest.approx(0.1 / np.sqrt(3.0), rel=0.1)


@pytest.mark.parametrize("split", [False, True])
def test_a_loop_in_gymnaxs_style_starts_again_within_the_step(split: bool) -> None:
    """4 environments, episodes of 25 steps of drawn lengths; observations after an end are those of a new start."""
    env = twin.LabPendulum(task="swing_up", max_steps=25, randomize={"length": (0.3, 0.5), "mass": ("log", 0.02, 0.08),
                                                                     "max_torque": [0.02, 0.03]}).gymnax(split)
    keys = jax.random.split(jax.random.key(0), 4)
    seen, state = jax.vmap(env.reset)(keys)
    assert seen.shape == (4, 3)

    def turn(carry: Any, key: Any) -> Any:
        state, _ = carry
        results = jax.vmap(env.step)(jax.random.split(key, 4), state, jnp.ones((4, 1)))
        seen, after, reward, *ends, info = results
        return (after, seen), (ends[-1], seen, reward, after.time, after.params.omega0, info["final_observation"])

    keys = jax.random.split(jax.random.key(1), 60)
    _, (done, seen, reward, time, omega0, final) = jax.lax.scan(turn, (state, seen), keys)
    assert np.flatnonzero(np.asarray(done)[:, 0]).tolist() == [24, 49]
    assert bool(jnp.isfinite(reward).all())
    assert np.asarray(time)[24].tolist() == [0] * 4
    assert float(jnp.abs(jnp.arctan2(seen[24, :, 1], seen[24, :, 0])).max()) <= 0.1 + 1e-6
    assert float(jnp.abs(final[24] - seen[24]).max()) > 0.1
    assert np.unique(np.asarray(omega0)).size == 12  # 4 environments, 3 episodes


def test_parameters_may_differ_between_environments() -> None:
    env = twin.LabPendulum()
    lengths = jnp.array([0.3, 0.5])
    params = jax.vmap(lambda length: env.get_default_params(length=length))(lengths)
    assert np.asarray(params.omega0) == pytest.approx(
        [float(env.get_default_params(length=jnp.array(one)).omega0) for one in (0.3, 0.5)], rel=1e-14)
    states = jax.vmap(lambda p: env.transition(env.started(0.5, 0.0, None, p), jnp.zeros(1), None, p))(params)
    assert float(states.values[1][0]) != float(states.values[1][1])


def test_the_return_has_a_derivative_by_the_actions() -> None:
    env = twin.LabPendulum()
    start = env.started(0.5, 0.0)

    def total(actions: Any) -> Any:
        def turn(state: Any, action: Any) -> Any:
            after = env.transition(state, action)
            return after, env.reward(state, action, after)

        return jax.lax.scan(turn, start, actions)[1].sum()

    actions = jnp.linspace(-0.5, 0.5, 10)
    slopes, d = jax.grad(total)(actions), 1e-5
    for i in (0, 9):
        nudge = jnp.zeros(10).at[i].set(d)
        truth = float(total(actions + nudge) - total(actions - nudge)) / (2 * d)
        assert float(slopes[i]) == pytest.approx(truth, rel=1e-6)


def test_gusts_are_refused_in_the_environment() -> None:
    with pytest.raises(SceneError, match="gusts have no twin in the environment in JAX; leave the effect out"):
        twin.LabPendulum("windy")
