"""Learn a swing-up by gradients through the simulation (analytic policy gradient), in rk4 and in forward Euler.

Needs ``pip install ".[jax]" optax``. The policy is a small network; the gradient of the task's mean reward over 4 s
comes through 200 control steps of 64 episodes at once. What was learnt in either method is judged in rk4.
"""

import time
from functools import partial

import jax
import jax.numpy as jnp
import optax

import pendulum_env.jax as twin

STEPS, EPISODES, TURNS = 200, 64, 2000
judge = twin.LabPendulum("lab", integrator="rk4")


def policy(weights, observation):
    *hidden, (last, bias) = weights
    x = observation * jnp.array([1.0, 1.0, 0.1])
    for matrix, shift in hidden:
        x = jnp.tanh(x @ matrix + shift)
    return jnp.tanh(x @ last + bias)


def episode(env, weights, start):
    def turn(state, _):
        action = policy(weights, env.observation(state))
        after = env.transition(state, action)
        return after, env.reward(state, action, after)

    return jax.lax.scan(jax.checkpoint(turn), start, None, STEPS)[1]


def learn(env):
    keys = jax.random.split(jax.random.key(0), 3)
    weights = [(jax.random.normal(key, (a, b)) / a**0.5, jnp.zeros(b)) for key, a, b in zip(
        keys, (3, 32, 32), (32, 32, 1), strict=True)]
    solver = optax.chain(optax.clip_by_global_norm(1.0), optax.adam(optax.cosine_decay_schedule(3e-3, TURNS)))

    def loss(weights, key):  # from anywhere: what is learnt near the top serves on the way up
        angle, velocity = jax.random.uniform(key, (2, EPISODES), minval=-1.0) * jnp.array([[3.1416], [8.0]])
        return -jax.vmap(lambda q, v: episode(env, weights, env.started(q, v)))(angle, velocity).mean()

    def step(carry, key):
        weights, state = carry
        change, state = solver.update(jax.grad(loss)(weights, key), state)
        return (optax.apply_updates(weights, change), state), None

    keys = jax.random.split(jax.random.key(1), TURNS)
    return jax.jit(partial(jax.lax.scan, step))((weights, solver.init(weights)), keys)[0][0]


for integrator in ("rk4", "forward_euler"):
    begun = time.perf_counter()
    weights = jax.block_until_ready(learn(twin.LabPendulum("lab", integrator=integrator)))
    starts = jax.vmap(judge.initial)(jax.random.split(jax.random.key(9), EPISODES))  # hanging
    rewards = jax.jit(jax.vmap(partial(episode, judge, weights)))(starts)
    seconds, steps = time.perf_counter() - begun, TURNS * EPISODES * STEPS
    print(f"{integrator}: {seconds:.0f} s, {steps / 1e6:.1f} million steps; mean reward {float(rewards.mean()):.2f}, "
          f"in the last half second {float(rewards[:, -25:].mean()):.4f}")
    assert integrator != "rk4" or float(rewards[:, -25:].mean()) > -0.1
