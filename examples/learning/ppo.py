"""Train PPO on hundreds of pendulums at once until it swings up and balances: ``python examples/learning/ppo.py``.

Needs ``pip install ".[jax]" optax``. All of proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347) is in
this file. The environments are the compiled vector of ``gym.make_vec``; with ``--twin`` they, too, are JAX's, so that a
round of steps and what is learnt from it is one program. Four choices make the swing-up easy for it:

- advantages look a swing ahead: TRACE = 0.98 weighs the rewards of the next 40 steps, 0.8 s. With the usual 0.95, 0.35 s,
  the policy may learn to stand still: to swing back costs reward before it earns any;
- the mean action is bounded by tanh: actions are cut to [-1, 1], and an unbounded mean drifts to where nothing that is
  tried makes a difference;
- exploration pushes for a while in one direction, as noise of the policy's last weights (Raffin, Kober & Stulp 2021,
  arXiv:2005.05719): a new random torque in each of 50 steps a second averages to none. Its size is bounded, too;
- episodes end at different times: after a common start each round would show one part of the episode alone.
"""

import argparse
import time
from functools import partial
from pathlib import Path

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
import optax

import pendulum_env.jax as twin
from pendulum_env.controllers import swing_up

ENVIRONMENTS, STEPS, EPOCHS, PARTS = 256, 64, 4, 8  # a round: 256 x 64 steps, used 4 times in 8 parts
DISCOUNT, TRACE, CLIP, DIVERGENCE = 0.995, 0.99, 0.2, 0.01  # gamma, lambda, of PPO; change of the policy by a part
UNITS, HELD, RATE = 64, 8, 3e-3  # of a layer; steps with the same noise; largest learning rate
LEAST_NOISE, MOST_NOISE = -2.5, -1.5  # logarithms of the noise of a weight
OPTIMISER = optax.chain(optax.clip_by_global_norm(5.0), optax.scale_by_adam(eps=1e-5))
SCALE, REWARD = np.array([1.0, 1.0, 0.1], np.float32), 0.01  # of the observation, of the reward


def network(key, last):
    """Return weights of two hidden layers; ``last`` is the size of the last layer's."""
    sizes = ((3, UNITS, 2**0.5), (UNITS, UNITS, 2**0.5), (UNITS, 1, last))
    return [(jax.nn.initializers.orthogonal(size)(one, (rows, columns)), jnp.zeros(columns))
            for one, (rows, columns, size) in zip(jax.random.split(key, 3), sizes, strict=True)]


def applied(weights, x):
    """Return a network's output, and the numbers of its last hidden layer."""
    *hidden, (last, bias) = weights
    for matrix, shift in hidden:
        x = jnp.tanh(x @ matrix + shift)
    return (x @ last + bias)[..., 0], x


def policy(agent, x):
    """Return the mean action, the hidden numbers that the noise's weights multiply, and the noise's deviation."""
    mean, hidden = applied(agent["policy"], x)
    hidden = jax.lax.stop_gradient(hidden)
    noise = jnp.exp(agent["noise"])
    return jnp.tanh(mean), hidden * noise, jnp.sqrt((hidden**2) @ noise**2 + 1e-6)


def log_density(agent, x, action):
    mean, _, deviation = policy(agent, x)
    return -0.5 * ((action - mean) / deviation)**2 - jnp.log(deviation)


@jax.jit
def acted(agent, x, drawn):
    """Return actions with the noise ``drawn`` for the weights of each environment."""
    mean, hidden, _ = policy(agent, x)
    return mean + (hidden * drawn).sum(-1)


def advantages(agent, seen, after, rewards, lost, over):
    """Return generalised advantages (Schulman et al. 2016, arXiv:1506.02438) and the returns that values should be."""
    value, later = (applied(agent["value"], x)[0] for x in (seen, after))
    surprise = rewards + DISCOUNT * later * (1.0 - lost) - value

    def earlier(advantage, step):
        advantage = step[0] + DISCOUNT * TRACE * (1.0 - step[1]) * advantage
        return advantage, advantage

    advantage = jax.lax.scan(earlier, jnp.zeros_like(value[0]), (surprise, over), reverse=True)[1]
    return advantage, advantage + value


def loss(agent, part):
    x, action, before, advantage, returned = part
    change = log_density(agent, x, action) - before
    ratio = jnp.exp(change)
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    gain = jnp.minimum(ratio * advantage, jnp.clip(ratio, 1.0 - CLIP, 1.0 + CLIP) * advantage).mean()
    error = ((applied(agent["value"], x)[0] - returned)**2).mean()
    return error - gain, (ratio - 1.0 - change).mean()


def trained(agent, memory, key, largest, seen, after, actions, rewards, lost, over):
    """Return the agent, and the optimiser's state and rate, after a round, given as arrays of (steps, environments).

    The rate of Adam falls where a part changes the policy by more than twice DIVERGENCE, and grows below
    half of it (Rudin et al. 2021, arXiv:2109.11978), up to ``largest``.
    """
    advantage, returned = advantages(agent, seen, after, rewards, lost, over)
    rows = [x.reshape(-1, *x.shape[2:]) for x in (
        seen, actions, log_density(agent, seen, actions), advantage, returned)]

    def step(carry, chosen):
        agent, state, rate = carry
        slope, divergence = jax.grad(loss, has_aux=True)(agent, [x[chosen] for x in rows])
        rate = jnp.where(divergence > 2.0 * DIVERGENCE, jnp.maximum(rate / 1.5, 1e-5), rate)
        rate = jnp.where(divergence < 0.5 * DIVERGENCE, rate * 1.5, rate).clip(max=largest)
        change, state = OPTIMISER.update(slope, state)
        agent = jax.tree.map(lambda weight, by: weight - rate * by, agent, change)
        return (agent | {"noise": agent["noise"].clip(LEAST_NOISE, MOST_NOISE)}, state, rate), None

    orders = [jax.random.permutation(one, rows[0].shape[0]) for one in jax.random.split(key, EPOCHS)]
    (agent, *memory), _ = jax.lax.scan(step, (agent, *memory), jnp.stack(orders).reshape(EPOCHS * PARTS, -1))
    return agent, tuple(memory)


class Vector:
    """Rounds of steps of the compiled vector; what is learnt from them is computed by JAX."""

    def __init__(self, seed):
        self.env = gym.make_vec("LabPendulum-v0", ENVIRONMENTS, diagnostics=(), autoreset_mode="SameStep")
        self.seen, _ = self.env.reset(seed=seed)
        source = np.random.default_rng(seed)
        begins = source.integers(0, 500, ENVIRONMENTS)  # the step at which the first episode of each begins
        for step in range(500):
            self.seen, *_ = self.env.step(source.uniform(-1.0, 1.0, (ENVIRONMENTS, 1)).astype(np.float32))
            if (begins == step).any():
                self.seen, _ = self.env.reset(options={"reset_mask": begins == step})
        self.learn = jax.jit(trained)

    def round(self, agent, memory, key, largest):
        rows, keys = [], jax.random.split(key, STEPS // HELD + 1)
        for step in range(STEPS):
            if step % HELD == 0:
                drawn = jax.random.normal(keys[step // HELD], (ENVIRONMENTS, UNITS))
            seen, action = SCALE * self.seen, np.asarray(acted(agent, SCALE * self.seen, drawn))
            self.seen, reward, lost, late, infos = self.env.step(action.clip(-1.0, 1.0)[:, None])
            after, over = self.seen.copy(), lost | late
            for i in np.flatnonzero(over):
                after[i] = infos["final_obs"][i]
            rows.append((seen, SCALE * after, action, np.float32(REWARD * reward), np.float32(lost), np.float32(over)))
        return self.learn(agent, memory, keys[-1], largest, *(np.stack(x) for x in zip(*rows, strict=True)))


class Twin:
    """Rounds of steps of the twin in JAX, and what is learnt from them, as one program."""

    def __init__(self, seed):
        self.env = twin.LabPendulum(task="swing_up", diagnostics=()).gymnax(split=True)
        key, *keys = jax.random.split(jax.random.key(seed), ENVIRONMENTS + 1)
        self.now = jax.vmap(self.env.reset)(jnp.stack(keys))
        begins = jax.random.randint(key, (ENVIRONMENTS,), 0, 500)
        object.__setattr__(self.now[1], "time", begins)  # episodes that begin in their midst end sooner

    def round(self, agent, memory, key, largest):
        agent, memory, self.now = self._round(agent, memory, self.now, key, largest)
        return agent, memory

    @partial(jax.jit, static_argnums=0)
    def _round(self, agent, memory, now, key, largest):
        def step(carry, key):
            (observation, state), drawn, count = carry
            own, new = jax.random.split(key)
            fresh = jax.random.normal(new, (ENVIRONMENTS, UNITS))
            drawn = jnp.where(count % HELD == 0, fresh, drawn)
            seen = SCALE * observation
            action = acted(agent, seen, drawn)
            observation, state, reward, lost, late, info = jax.vmap(self.env.step)(
                jax.random.split(own, ENVIRONMENTS), state, action.clip(-1.0, 1.0)[:, None])
            over = lost | late
            after = SCALE * jnp.where(over[:, None], info["final_observation"], observation)
            row = seen, after, action, REWARD * reward, lost.astype(float), over.astype(float)
            return ((observation, state), drawn, count + 1), row

        key, last = jax.random.split(key)
        begin = now, jnp.zeros((ENVIRONMENTS, UNITS)), 0
        (now, *_), rows = jax.lax.scan(step, begin, jax.random.split(key, STEPS))
        return *trained(agent, memory, last, largest, *rows), now


def played(env, choose, seed):
    """Return the mean return of an episode of each environment, and the number that end upright, within 0.2 rad."""
    seen, _ = env.reset(seed=seed)
    total = np.zeros(env.num_envs)
    for _ in range(500):
        seen, reward, *_ = env.step(choose(seen))
        total += reward
    return total.mean(), int((seen[:, 0] < -np.cos(0.2)).sum())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path, nargs="?", help="folder for the policy's weights")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=250, help=f"of {ENVIRONMENTS * STEPS} steps, at most")
    parser.add_argument("--twin", action="store_true", help="step in JAX, not in the compiled vector")
    options = parser.parse_args()

    judge = gym.make_vec("LabPendulum-v0", 100, diagnostics=())
    goal, _ = played(judge, swing_up(judge), 10**6)
    begun = time.perf_counter()
    keys = jax.random.split(jax.random.key(options.seed), options.rounds + 2)
    agent = {"policy": network(keys[-1], 0.01), "value": network(keys[-2], 1.0), "noise": jnp.full(UNITS, MOST_NOISE)}
    memory = OPTIMISER.init(agent), RATE
    source = (Twin if options.twin else Vector)(options.seed)

    @jax.jit
    def mean(agent, seen):
        return policy(agent, SCALE * seen)[0][:, None]

    def choose(seen):
        return np.asarray(mean(agent, seen))

    for turn in range(options.rounds):
        agent, memory = source.round(agent, memory, keys[turn], RATE * (1.0 - turn / options.rounds))
        if (turn + 1) % 10 == 0:
            earned, upright = played(judge, choose, 2 * 10**6)
            steps = (turn + 1) * ENVIRONMENTS * STEPS
            took = time.perf_counter() - begun
            print(f"{steps:8d} steps, {took:5.1f} s: return {earned:6.0f}, {upright} of 100 upright", flush=True)
            if solved := (earned >= 1.05 * goal and upright == 100):
                break
    earned, upright = played(judge, choose, 10**6)
    print(f"return {earned:.0f} in 100 other episodes, {upright} upright; the controller returns {goal:.0f}")
    if options.folder:
        options.folder.mkdir(parents=True, exist_ok=True)
        arrays = {f"{name}_{i}": np.asarray(x) for i, pair in enumerate(agent["policy"])
                  for name, x in zip(("weights", "bias"), pair, strict=True)}
        np.savez(options.folder / "policy.npz", **arrays)
    if options.rounds >= 250:
        assert solved, (earned, goal)
        assert upright == 100, upright


if __name__ == "__main__":
    main()
