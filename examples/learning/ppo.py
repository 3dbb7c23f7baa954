"""Train PPO on 256 pendulums at once until it has solved a task: ``python examples/learning/ppo.py agents.jsonl``.

Needs ``pip install ".[jax]" optax``. All of proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347) is in
this file. The environments are the compiled vector of ``gym.make_vec``; with ``--twin`` they, too, are JAX's, so that a
round of steps and what is learnt from it is one program. For each seed a line of JSON goes into the file, and the
policy, for ``pendulum_env.controllers.load``, into the folder of ``--policies``. A seed that has a line is not trained
again.

Solved means: the mean return of 100 episodes that were not trained on is at most 5 % below that of the controller
``swing_up``, and all end upright. Training ends where it is at most 2 % below in 100 episodes, as the line is about
100 others, or after ROUNDS; for ``track``, which the controller cannot play, only there. Four choices make the swing-up
easy:

- advantages look a swing ahead: TRACE = 0.99 weighs the rewards of the next 67 steps, 1.3 s. With the usual 0.95, so
  of 0.35 s, the policy may learn to stand still: to swing back costs reward before it earns any;
- the mean action is bounded by tanh: actions are cut to [-1, 1], and an unbounded mean drifts to where nothing that is
  tried makes a difference;
- exploration pushes for a while in one direction, as noise of the policy's last weights (Raffin, Kober & Stulp 2021,
  arXiv:2005.05719): a new random torque in each of 50 steps a second averages to none. Its size is bounded, too;
- training begins amid pendulums that were pushed at random, in episodes that end at different times: from a common
  start at rest each round would show one part of the episode alone. (The twin's one seed that was trained so learnt to
  roll over the top, and no more.)
"""

import argparse
import json
import platform
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import gymnasium as gym
import jax
import jax.numpy as jnp
import numpy as np
import optax

import pendulum_env
import pendulum_env.jax as twin
from pendulum_env import plots
from pendulum_env.common.provenance import provenance
from pendulum_env.controllers import Policy, evaluate, load, swing_up

ENVIRONMENTS, STEPS, EPOCHS, PARTS = 256, 128, 4, 8  # a round: 256 x 128 steps, used 4 times in 8 parts
TRACE, CLIP, DIVERGENCE = 0.99, 0.2, 0.01  # lambda and epsilon of PPO; change of the policy by a part
UNITS, HELD, RATE = 32, 8, 3e-3  # of a layer; steps with the same noise; largest learning rate
MOST_NOISE = -1.2  # logarithm of the largest noise of a weight
OPTIMISER = optax.chain(optax.clip_by_global_norm(5.0), optax.scale_by_adam(eps=1e-5))
ROUNDS, OFTEN = 100, 2  # rounds at most, and after how many the policy is judged
# By task: discount (gamma of PPO), factor of rewards that makes values a few units large, logarithm of the least noise.
TASKS = {"swing_up": (0.995, 0.01, -2.2), "balance": (0.98, 0.1, -4.0), "track": (0.95, 1.0, -2.5)}
JUDGED, TRIED = 10**6, 2 * 10**6  # seeds of the first of the episodes that the line is about, and of those that end it

VERSIONS = {"python": platform.python_version(), "lab-pendulum": pendulum_env.__version__, "numpy": np.__version__,
            "jax": jax.__version__, "optax": optax.__version__}


def network(key, inputs, last):
    """Return weights of two hidden layers; ``last`` is the size of the last layer's."""
    sizes = ((inputs, UNITS, 2**0.5), (UNITS, UNITS, 2**0.5), (UNITS, 1, last))
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
    """Return the logarithm of the probability density of actions, without its constant."""
    mean, _, deviation = policy(agent, x)
    return -0.5 * ((action - mean) / deviation)**2 - jnp.log(deviation)


@jax.jit
def acted(agent, x, drawn):
    """Return actions with the noise ``drawn`` for the weights of each environment."""
    mean, hidden, _ = policy(agent, x)
    return mean + (hidden * drawn).sum(-1)


def advantages(agent, discount, seen, after, rewards, lost, over):
    """Return generalised advantages (Schulman et al. 2016, arXiv:1506.02438) and the returns that values should be."""
    value, later = (applied(agent["value"], x)[0] for x in (seen, after))
    surprise = rewards + discount * later * (1.0 - lost) - value

    def earlier(advantage, step):
        advantage = step[0] + discount * TRACE * (1.0 - step[1]) * advantage
        return advantage, advantage

    advantage = jax.lax.scan(earlier, jnp.zeros_like(value[0]), (surprise, over), reverse=True)[1]
    return advantage, advantage + value


def loss(agent, part):
    """Return PPO's loss of the policy and the value, and how far the policy has changed (a divergence)."""
    x, action, before, advantage, returned = part
    change = log_density(agent, x, action) - before
    ratio = jnp.exp(change)
    advantage = (advantage - advantage.mean()) / (advantage.std() + 1e-8)
    gain = jnp.minimum(ratio * advantage, jnp.clip(ratio, 1.0 - CLIP, 1.0 + CLIP) * advantage).mean()
    error = ((applied(agent["value"], x)[0] - returned)**2).mean()
    return error - gain, (ratio - 1.0 - change).mean()


def learnt(agent, memory, key, largest, discount, least_noise, seen, after, actions, rewards, lost, over):
    """Return the agent, and the optimiser's state and rate, after a round, given as arrays of (steps, environments).

    The rate of Adam falls where a part changes the policy by more than twice DIVERGENCE, and grows below
    half of it (Rudin et al. 2021, arXiv:2109.11978), up to ``largest``.
    """
    advantage, returned = advantages(agent, discount, seen, after, rewards, lost, over)
    rows = [x.reshape(-1, *x.shape[2:]) for x in (
        seen, actions, log_density(agent, seen, actions), advantage, returned)]

    def step(carry, chosen):
        agent, state, rate = carry
        slope, divergence = jax.grad(loss, has_aux=True)(agent, [x[chosen] for x in rows])
        rate = jnp.where(divergence > 2.0 * DIVERGENCE, jnp.maximum(rate / 1.5, 1e-5), rate)
        rate = jnp.where(divergence < 0.5 * DIVERGENCE, rate * 1.5, rate).clip(max=largest)
        change, state = OPTIMISER.update(slope, state)
        agent = jax.tree.map(lambda weight, by: weight - rate * by, agent, change)
        return (agent | {"noise": agent["noise"].clip(least_noise, MOST_NOISE)}, state, rate), None

    orders = [jax.random.permutation(one, rows[0].shape[0]) for one in jax.random.split(key, EPOCHS)]
    (agent, *memory), _ = jax.lax.scan(step, (agent, *memory), jnp.stack(orders).reshape(EPOCHS * PARTS, -1))
    return agent, tuple(memory)


class Vector:
    """Rounds of steps of the compiled vector; what is learnt from them is computed by JAX."""

    def __init__(self, name, seed, keywords):
        self.env = gym.make_vec(name, ENVIRONMENTS, diagnostics=(), autoreset_mode="SameStep", **keywords)
        self.task = self.env.unwrapped.task.name
        self.discount, self.factor, self.noise = TASKS[self.task]
        self.seen, _ = self.env.reset(seed=seed)
        self.inputs, length = self.seen.shape[1], self.env.unwrapped.max_episode_steps
        source = np.random.default_rng(seed)
        begins = source.integers(0, length, ENVIRONMENTS)  # the step at which the first episode of each begins
        for step in range(length):
            self.seen, *_ = self.env.step(source.uniform(-1.0, 1.0, (ENVIRONMENTS, 1)).astype(np.float32))
            if (begins == step).any():
                self.seen, _ = self.env.reset(options={"reset_mask": begins == step})
        self.learn = jax.jit(learnt)

    def round(self, agent, memory, key, largest, scale):
        rows, keys = [], jax.random.split(key, STEPS // HELD + 1)
        for step in range(STEPS):
            if step % HELD == 0:
                drawn = jax.random.normal(keys[step // HELD], (ENVIRONMENTS, UNITS))
            seen, action = scale * self.seen, np.asarray(acted(agent, scale * self.seen, drawn))
            self.seen, reward, lost, late, infos = self.env.step(action.clip(-1.0, 1.0)[:, None])
            after, over = self.seen.copy(), lost | late
            for i in np.flatnonzero(over):
                after[i] = infos["final_obs"][i]
            rows.append((seen, scale * after, action, *map(np.float32, (self.factor * reward, lost, over))))
        arrays = (np.stack(x) for x in zip(*rows, strict=True))
        return self.learn(agent, memory, keys[-1], largest, self.discount, self.noise, *arrays)


class Twin:
    """Rounds of steps of the twin in JAX, and what is learnt from them, as one program."""

    def __init__(self, name, seed, keywords):
        spec = gym.spec(name)
        self.env = twin.LabPendulum(**{"diagnostics": (), **spec.kwargs, **keywords}).gymnax(split=True)
        self.task = self.env.env.task.name
        self.discount, self.factor, self.noise = TASKS[self.task]
        begin, before, *keys = jax.random.split(jax.random.key(seed), ENVIRONMENTS + 2)
        self.now = jax.vmap(self.env.reset)(jnp.stack(keys))
        self.inputs = self.now[0].shape[1]
        length = spec.max_episode_steps
        begins = jax.random.randint(begin, (ENVIRONMENTS,), 0, length)  # steps that the first episode is old
        object.__setattr__(self.now[1], "time", begins)
        self.now = self._at_random(self.now, jax.random.split(before, length))

    @partial(jax.jit, static_argnums=0)
    def _at_random(self, now, keys):
        def step(now, key):
            own, new = jax.random.split(key)
            action = jax.random.uniform(new, (ENVIRONMENTS, 1), minval=-1.0)
            observation, state, *_ = jax.vmap(self.env.step)(jax.random.split(own, ENVIRONMENTS), now[1], action)
            return (observation, state), None

        return jax.lax.scan(step, now, keys)[0]

    def round(self, agent, memory, key, largest, scale):
        agent, memory, self.now = self._round(agent, memory, self.now, key, largest, scale)
        return agent, memory

    @partial(jax.jit, static_argnums=0)
    def _round(self, agent, memory, now, key, largest, scale):
        def step(carry, key):
            (observation, state), drawn, count = carry
            own, new = jax.random.split(key)
            fresh = jax.random.normal(new, (ENVIRONMENTS, UNITS))
            drawn = jnp.where(count % HELD == 0, fresh, drawn)
            seen = scale * observation
            action = acted(agent, seen, drawn)
            observation, state, reward, lost, late, info = jax.vmap(self.env.step)(
                jax.random.split(own, ENVIRONMENTS), state, action.clip(-1.0, 1.0)[:, None])
            over = lost | late
            after = scale * jnp.where(over[:, None], info["final_observation"], observation)
            row = seen, after, action, self.factor * reward, lost.astype(float), over.astype(float)
            return ((observation, state), drawn, count + 1), row

        key, last = jax.random.split(key)
        begin = now, jnp.zeros((ENVIRONMENTS, UNITS)), 0
        (now, *_), rows = jax.lax.scan(step, begin, jax.random.split(key, STEPS))
        return *learnt(agent, memory, last, largest, self.discount, self.noise, *rows), now


def train(name="LabPendulum-v0", seed=0, source=Vector, rounds=ROUNDS, often=OFTEN, **keywords) -> Iterator[Policy]:
    """Yield the policy after every ``often`` rounds of training; ``keywords`` are those of ``gym.make_vec``."""
    world = source(name, seed, keywords)
    scale = np.where(np.arange(world.inputs) == 2, 0.1, 1.0).astype(np.float32)  # of the velocity
    keys = jax.random.split(jax.random.key(seed), rounds + 2)
    agent = {"policy": network(keys[-1], world.inputs, 0.01), "value": network(keys[-2], world.inputs, 1.0),
             "noise": jnp.full(UNITS, MOST_NOISE)}
    memory = OPTIMISER.init(agent), RATE
    for turn in range(rounds):
        largest = RATE * (1.0 - turn / rounds)
        agent, memory = world.round(agent, memory, keys[turn], largest, scale)
        if (turn + 1) % often == 0:
            layers = [(np.asarray(weights), np.asarray(bias)) for weights, bias in agent["policy"]]
            yield Policy(layers, scale, {"task": world.task, "id": name, "training": {
                "program": "examples/learning/ppo.py", "environments": source.__name__.lower(), "seed": seed,
                "rounds": rounds,
                "steps": (turn + 1) * ENVIRONMENTS * STEPS, "versions": VERSIONS}})


def solve(name, seed, source, rounds) -> tuple[dict, Policy]:
    """Train until the task is solved or the rounds have passed; return a line of results, and the policy."""
    judge = gym.make_vec(name, 100, diagnostics=())
    goal = None
    if judge.unwrapped.task.goal.reference is None:
        goal = evaluate(swing_up(judge), judge, TRIED).returns.mean()
    begun, worked, curve = time.perf_counter(), time.process_time(), []
    for found in train(name, seed, source, rounds):
        earned = evaluate(found, judge, TRIED)
        steps = found.card["training"]["steps"]
        curve.append((steps, round(earned.returns.mean(), 3)))
        print(f"{name}, seed {seed}: {steps:8d} steps, {time.perf_counter() - begun:5.1f} s: return "
              f"{earned.returns.mean():8.2f}, {earned.reached.mean():4.0%} there at the end", flush=True)
        if goal is not None and earned.returns.mean() >= goal - 0.02 * abs(goal) and earned.reached.all():
            break
    took = {"seconds": time.perf_counter() - begun, "processor_seconds": time.process_time() - worked}
    earned = evaluate(found, judge, JUDGED)
    return {"algorithm": "ppo.py", "id": name, "what": source.__name__.lower(), "seed": seed,
            "return": earned.returns.mean(), "upright": earned.reached.mean(), "steps": steps, **took,
            "curve": curve, "versions": VERSIONS}, found


def draw(lines, file):
    """Draw the learning curves of one id's lines, and the return of the controller, of track that of our policy."""
    figure, (axes,) = plots.figure()
    longest = max(line["steps"] for line in lines) / 1e6
    for line in lines:
        steps, returns = np.transpose(line["curve"])
        axes.plot(steps / 1e6, returns, color="C0", marker=".", lw=1.0, alpha=0.7)
    name = lines[0]["id"]
    judge = gym.make_vec(name, 100, diagnostics=())
    follows = judge.unwrapped.task.goal.reference is not None  # which the controller cannot
    label, other = ("the package's policy", load("track")) if follows else ("controller", swing_up(judge))
    goal = evaluate(other, judge, JUDGED).returns.mean()
    axes.axhline(goal, color="C1", ls="--", label=label)
    if follows:  # the first returns, of -35, would leave no room for the last
        axes.set_ylim(5.0 * goal, 0.0)
    axes.set(xlabel="steps [million]", ylabel="return", xlim=(0.0, 1.02 * longest),
             title=f"PPO on {name}: {len(lines)} seeds" + ("" if follows else ", until each has solved it"))
    axes.legend()
    plots.save(figure, file, provenance())


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("file", type=Path, help="file of the agents' lines")
    parser.add_argument("--id", default="LabPendulum-v0")
    parser.add_argument("--seeds", type=int, nargs="*", default=[0])
    parser.add_argument("--rounds", type=int, default=ROUNDS, help=f"of {ENVIRONMENTS * STEPS} steps, at most")
    parser.add_argument("--twin", action="store_true", help="step in JAX, not in the compiled vector")
    parser.add_argument("--policies", type=Path, help="folder for the policies")
    parser.add_argument("--figure", type=Path, help="file for the learning curves of this id")
    options = parser.parse_args()
    source = Twin if options.twin else Vector
    lines = [json.loads(one) for one in options.file.read_text().splitlines()] if options.file.exists() else []
    mine = [one for one in lines if (one["algorithm"], one["id"], one["what"]) == (
        "ppo.py", options.id, source.__name__.lower())]
    for seed in options.seeds:
        if any(one["seed"] == seed for one in mine):
            continue
        line, found = solve(options.id, seed, source, options.rounds)
        mine.append(line)
        if options.policies:
            options.policies.mkdir(parents=True, exist_ok=True)
            found.save(options.policies / f"{found.card['task']}_{seed}.npz")
        with options.file.open("a") as file:
            file.write(json.dumps(line) + "\n")
        print(f"return {line['return']:.1f} in 100 other episodes, {line['upright']:.0%} there at the end", flush=True)
    if options.figure:
        draw(mine, options.figure)


if __name__ == "__main__":
    main()
