"""gymnax's interface beside gymnax itself: its wrappers, spaces and a learner's loop; run where gymnax is."""

from __future__ import annotations

from typing import Any

import gymnax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnax.environments import spaces
from gymnax.environments.environment import Environment
from gymnax.wrappers import FlattenObservationWrapper, LegacyStepAPIWrapper, LogWrapper

import pendulum_env.jax as twin
from pendulum_env import SceneError

SETTINGS: dict[str, Any] = {"integrator": "symplectic_euler", "diagnostics": (), "task": "swing_up", "max_steps": 20}


def environment(**more: Any) -> Any:
    return twin.LabPendulum(**SETTINGS, **more).gymnax(split=True)


def test_it_has_every_public_name_of_gymnaxs_environments() -> None:
    own = environment()
    theirs, _ = gymnax.make("Pendulum-v1")
    assert not {name for name in dir(Environment) if not name.startswith("_") and not hasattr(own, name)}
    for name in ("step", "reset", "step_env", "reset_env"):
        key, action = jax.random.key(0), jnp.zeros(1)
        _, state = own.reset(key)
        _, other = theirs.reset(key)
        params = theirs.default_params
        given = {"step": (key, state, action), "step_env": (key, state, action)}.get(name, (key,))
        wanted = {"step": (key, other, action), "step_env": (key, other, action)}.get(name, (key,))
        assert len(getattr(own, name)(*given, own.default_params)) == len(getattr(theirs, name)(*wanted, params))


def test_the_log_wrapper_counts_returns_and_lengths() -> None:
    """The truth is the sum of the rewards, over episodes of 20 steps."""
    env = LogWrapper(FlattenObservationWrapper(environment()))
    key = jax.random.key(3)
    seen, state = env.reset(key)
    assert seen.shape == (3,)

    def turn(state: Any, key: Any) -> Any:
        action = env.action_space(env.default_params).sample(key)
        _, state, reward, terminated, truncated, info = env.step(key, state, action)
        return state, (reward, terminated | truncated, info["returned_episode_returns"],
                       info["returned_episode_lengths"], info["returned_episode"], action)

    _, (reward, done, returns, lengths, ended, action) = jax.lax.scan(turn, state, jax.random.split(key, 60))
    assert np.flatnonzero(done).tolist() == np.flatnonzero(ended).tolist() == [19, 39, 59]
    assert lengths[19:].tolist() == [20]*41
    assert returns[np.array([19, 39, 59])] == pytest.approx(np.asarray(reward).reshape(3, 20).sum(axis=1), rel=1e-5)
    assert -1.0 <= float(action.min()) < -0.8
    assert 0.8 < float(action.max()) <= 1.0


def test_the_wrapper_for_older_loops_takes_it() -> None:
    env = LegacyStepAPIWrapper(environment())
    key = jax.random.key(0)
    _, state = env.reset(key, env.default_params)
    _, _, _, done, info = env.step(key, state, jnp.zeros(1), env.default_params)
    assert not bool(done)
    assert {"terminated", "truncated", "final_observation"} <= {*info}


def test_spaces_sample_with_a_key_also_compiled() -> None:
    env = environment()
    keys = jax.random.split(jax.random.key(1), 500)
    for space in (env.action_space(), env.observation_space(env.default_params)):
        assert isinstance(space, spaces.Box)
        drawn = jax.jit(jax.vmap(space.sample))(keys)
        assert drawn.shape == (500, *space.shape)
        assert drawn.dtype == space.dtype
        assert bool(jnp.isfinite(drawn).all())
        assert bool(jax.jit(jax.vmap(space.contains))(drawn).all())
        assert np.asarray(drawn[:, 0]).mean() == pytest.approx(0.0, abs=0.1)
        assert space.contains(space.sample())  # Gymnasium's own way
    assert not bool(env.action_space().contains(jnp.array([1.5])))
    state = env.reset(keys[0])[1]
    space = env.state_space(env.default_params)
    assert {*space.sample(keys[0])} == {"values", "stop", "time"}
    assert bool(jax.jit(space.contains)(state))
    assert not bool(space.contains(state.replace(time=21)))


def test_observation_ends_and_discount_of_a_state() -> None:
    env = environment(speed_limit=5.0)
    key = jax.random.key(2)
    seen, state = env.reset(key)
    assert env.get_obs(state, env.default_params).tolist() == seen.tolist()
    assert env.observe(key, state, None, env.default_params).tolist() == seen.tolist()
    fast = env.env.started(0.0, 4.999)
    _, after, *_ = env.step_env(key, fast.replace(stop=jnp.float32(1.0)), jnp.zeros(1))
    late = state.replace(time=jnp.int32(20))
    for one, ends, limit in ((state, False, False), (after, True, False), (late, False, True)):
        assert bool(env.is_terminated(one)) is bool(env.is_terminal(one)) is ends
        assert bool(env.is_truncated(one, env.default_params)) is limit
        assert float(env.discount(one, env.default_params)) == (0.0 if ends else 1.0)
    older = env.env.gymnax()
    assert bool(older.is_terminal(late))
    assert [len(older.step(key, state, jnp.zeros(1))), len(older.step_env(key, state, jnp.zeros(1)))] == [5, 5]


def test_params_and_states_can_be_replaced() -> None:
    env = environment()
    key, params = jax.random.key(0), env.default_params.replace(max_steps_in_episode=1)
    assert int(env.default_params.max_steps_in_episode) == 20
    _, state = env.reset(key, params)
    *_, truncated, _ = env.step(key, state, jnp.zeros(1), params)
    assert bool(truncated)
    with pytest.raises(SceneError, match=r"EnvParams has no field 'length'.* those of get_default_params\(length=x\)"):
        params.replace(length=0.5)
    with pytest.raises(SceneError, match=r"EnvState has no field 'angle'.* use started\(angle, velocity\)"):
        state.replace(angle=0.5)


@pytest.mark.parametrize("dtype", [jnp.float32, np.float32, np.dtype("float32"), "float32", None])
def test_types_of_jax_are_taken(dtype: Any) -> None:
    env = twin.LabPendulum(dtype=dtype, **SETTINGS)
    assert env.kind == np.float32
    assert env.initial(jax.random.key(0)).values[1].dtype == jnp.float32
    assert twin.rollout("vacuum", duration=0.1, dtype=dtype).angle.dtype == jnp.float32
    for wrong in (jnp.float16, jnp.bfloat16, int, 3, "half"):
        with pytest.raises(SceneError, match="dtype"):
            twin.LabPendulum(dtype=wrong)
    with pytest.raises(SceneError, match="jax_enable_x64"):
        twin.LabPendulum(dtype=jnp.float64)
