"""Learn a swing-up by gradients through the simulation (analytic policy gradient), in rk4 and in forward Euler.

Needs ``pip install ".[jax]" optax``. The policy is a small network; its loss is the task's mean cost over 4 s of 64
episodes at once, and its gradient comes through 200 control steps. What is learnt is judged in rk4.
"""

import time

import jax
import jax.numpy as jnp
import optax

import pendulum_env.jax as twin

STEPS, EPISODES, TURNS = 150, 64, 150
MOTOR = {"max_torque": 0.1, "task": "swing_up", "diagnostics": (), "dt": 0.02}
judge = twin.LabPendulum(integrator="rk4", **MOTOR)


def policy(weights, observation):
    *hidden, (last, bias) = weights
    x = observation * jnp.array([1.0, 1.0, 0.1])
    for matrix, shift in hidden:
        x = jnp.tanh(x @ matrix + shift)
    return jnp.tanh(x @ last + bias)


def episode(env, weights, key):
    def turn(state, _):
        action = policy(weights, env.observation(state))
        after = env.transition(state, action)
        return after, env.reward(state, action, after)

    return jax.lax.scan(jax.checkpoint(turn), env.initial(key), None, STEPS)[1]


def learn(integrator):
    env = twin.LabPendulum(integrator=integrator, **MOTOR)
    keys = jax.random.split(jax.random.key(0), 3)
    sizes = (3, 32, 32, 1)
    weights = [(jax.random.normal(key, (a, b)) / a**0.5, jnp.zeros(b))
               for key, a, b in zip(keys, sizes, sizes[1:], strict=False)]
    solver = optax.chain(optax.clip_by_global_norm(1.0), optax.adam(optax.cosine_decay_schedule(1e-2, TURNS)))

    def loss(weights, key):
        return -jax.vmap(lambda key: episode(env, weights, key))(jax.random.split(key, EPISODES)).mean()

    @jax.jit
    def step(weights, state, key):
        change, state = solver.update(jax.grad(loss)(weights, key), state)
        return optax.apply_updates(weights, change), state

    state = solver.init(weights)
    for key in jax.random.split(jax.random.key(1), TURNS):
        weights, state = step(weights, state, key)
    return weights


for integrator in ("rk4", "forward_euler"):
    begun = time.perf_counter()
    weights = jax.block_until_ready(learn(integrator))
    rewards = jax.vmap(lambda key, w=weights: episode(judge, w, key))(jax.random.split(jax.random.key(9), 64))
    end = float(rewards[:, -25:].mean())
    print(f"{integrator}: {time.perf_counter() - begun:.0f} s, {TURNS * EPISODES * STEPS} steps; mean reward "
          f"{float(rewards.mean()):.2f}, of the last half second {end:.3f}")
    if integrator == "rk4":
        assert end > -0.1
