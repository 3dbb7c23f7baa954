"""Baseline returns: a random policy, energy shaping with a regulator at the top, and agents trained by PPO and SAC.

Episodes are those of the task: 500 steps in the default scene, as registered, and 200 in the scene gymnasium, which is
Pendulum-v1. Each policy without learning is run for 1000 episodes, and so is each agent with its own seed. "±" is the
standard deviation over episodes, for agents over seeds; the interval is the 95 % interval of the mean (Student's t).
Agents need Stable-Baselines3 and torch, in an environment of their own; without them only the other rows are shown.

    python examples/benchmarks/baselines.py --seeds 5

makes all rows. Every agent's result is stored in a folder as soon as it is there, so that the command can be ended and
repeated, or be run in pieces: ``--list`` names the rows, ``--rows "SAC"`` runs those whose names contain the text,
``--only-seed 3`` trains one agent of each. ``--share 0.001 --episodes 4 --seeds 2`` tries everything in seconds.

The second table shows how returns depend on integrator and step: the return in 10 s, as a rate (``reward_rate=True``),
of the controller that knows dt, and of the agents that SAC has trained in the accurate environment, at their own dt.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from agents import Policy, can_train, kept, learnt, loaded, options_of, parser_of, ppo
from machine import describe
from scipy.stats import t as student

from pendulum_env import LabPendulumVectorEnv
from pendulum_env.controllers import RandomPolicy, swing_up

FIRST = 10**6
"""Seed of the first episode, which is never used in training."""
ZOO = {"learning_rate": 1e-3, "n_steps": 1024, "gamma": 0.9, "gae_lambda": 0.95, "use_sde": True, "sde_sample_freq": 4}
"""Settings of PPO for Pendulum-v1 in the collection RL Baselines3 Zoo."""
INTEGRATORS = ("forward_euler", "symplectic_euler", "velocity_verlet", "rk4")
STEPS = (0.01, 0.02, 0.05, 0.1)
"""Control steps of the second table [s]; the integrator takes one step in each."""


class Place(NamedTuple):
    """An environment: scene, task, and the number of steps of an episode."""

    scene: str
    task: str
    steps: int

    def vector(self, count: int, **how: Any) -> LabPendulumVectorEnv:
        """Return ``count`` of these environments."""
        return LabPendulumVectorEnv(count, self.scene, task=self.task, diagnostics=(), warn=False, **how)


class Row(NamedTuple):
    """A row of the table: a place, a policy's name, and for agents the algorithm and the number of training steps."""

    place: Place
    policy: str
    trained_by: str = ""
    budget: int = 0

    @property
    def name(self) -> str:
        return f"{self.place.scene}, {self.place.task}, {self.policy}"


SWING_UP, BALANCE = Place("lab", "swing_up", 500), Place("lab", "balance", 500)
PENDULUM = Place("gymnasium", "gymnasium", 200)
ROWS = tuple(
    Row(place, name, by, budget)
    for place, budgets in ((SWING_UP, (500_000, 20_000)), (BALANCE, (100_000, 10_000)), (PENDULUM, (100_000, 20_000)))
    for name, by, budget in (("random", "", 0), ("energy shaping, LQR", "", 0),
                             (f"PPO, {budgets[0]} steps", "PPO", budgets[0]),
                             (f"SAC, {budgets[1]} steps", "SAC", budgets[1])))


def returns(policy: Policy, env: LabPendulumVectorEnv, steps: int) -> Any:
    """Return the returns of complete episodes; rewards after the end of an episode do not count."""
    count = env.num_envs
    seen, total, going = env.reset(seed=FIRST)[0], np.zeros(count), np.ones(count, dtype=bool)
    for _ in range(steps):
        seen, reward, over, _, _ = env.step(policy(seen))
        total[going] += reward[going]
        going &= ~over
    return total


def line(cells: tuple[str, ...], values: Any, of: str) -> str:
    """Return a line of a table with mean, standard deviation and interval of at least two values."""
    mean, spread = float(np.mean(values)), float(np.std(values, ddof=1))
    half = float(student.ppf(0.975, len(values) - 1)) * spread / len(values) ** 0.5
    between = f"{mean - half:.1f} to {mean + half:.1f}"
    return f"| {' | '.join(cells)} | {mean:.1f} ± {spread:.1f} | {between} | {len(values)} {of} |"


# --- agents -------------------------------------------------------------------------------------------------------


def agent(row: Row, budget: int, seed: int, path: Path) -> Policy:
    """Train an agent and store it in ``path``, if it can be stored; return its policy."""
    if row.trained_by == "PPO" and row.place.scene == "lab":
        return ppo(row.place.task, budget, seed)
    settings = ZOO if row.trained_by == "PPO" else {}
    return learnt(row.trained_by, budget, seed, path, settings, scene=row.place.scene, task=row.place.task)


def result(row: Row, seed: int, options: argparse.Namespace) -> dict[str, Any] | None:
    """Return mean return and training time [s] of an agent, from the folder or trained now; else None."""
    budget = max(1, int(options.share * row.budget))
    path = options.folder / f"{row.place.scene}-{row.place.task}-{row.trained_by}-{budget}-{seed}"

    def work() -> dict[str, Any]:
        policy = agent(row, budget, seed, path)
        return {"return": float(returns(policy, row.place.vector(options.episodes), row.place.steps).mean())}

    return kept(path, can_train() and options.only_seed in (None, seed), work)


# --- tables -------------------------------------------------------------------------------------------------------


def rows_of(row: Row, options: argparse.Namespace) -> Iterator[str]:
    """Yield the lines of a row."""
    cells = (row.place.scene, row.place.task, row.policy)
    if not row.trained_by:
        env = row.place.vector(options.episodes)
        policy: Policy = RandomPolicy(0) if row.policy == "random" else swing_up(env)
        yield line(cells, returns(policy, env, row.place.steps), "episodes")
        return
    found = [one for seed in range(options.seeds) if (one := result(row, seed, options))]
    if len(found) > 1:
        taken = max(1, int(options.share * row.budget))
        cells = (*cells[:2], f"{row.trained_by}, {taken} steps")
        yield line(cells, [one["return"] for one in found], "seeds")
        each = ", ".join(f"{one['return']:.1f}" for one in found)
        yield f"| | | each: {each}; {np.mean([one['seconds'] for one in found]):.0f} s each on one core | | | |"


def price(place: Place, options: argparse.Namespace) -> Iterator[str]:
    """Yield the lines of the second table for a place: returns by integrator and step, and of rk4 in tenths of it."""
    own = place.vector(1).dt

    def earned(make: Callable[[LabPendulumVectorEnv], Policy], dt: float, method: str, substeps: int = 1) -> str:
        env = place.vector(options.episodes, integrator=method, dt=dt, substeps=substeps, reward_rate=True)
        return f"{returns(make(env), env, round(10.0 / dt)).mean():.2f}"

    policies: list[tuple[str, Callable[[LabPendulumVectorEnv], Policy], tuple[float, ...]]] = [
        ("energy shaping, LQR, told dt", swing_up, STEPS)]
    budget = max(1, int(options.share * next(row.budget for row in ROWS if row.place == place
                                             and row.trained_by == "SAC")))
    kept = [policy for seed in range(options.seeds)
            if (policy := loaded(options.folder / f"{place.scene}-{place.task}-SAC-{budget}-{seed}"))]
    policies += [(f"SAC, seed {seed}", lambda _, policy=policy: policy, (own,))  # type: ignore[misc]
                 for seed, policy in enumerate(kept)]
    for name, make, steps in policies:
        for dt in steps:
            cells = [earned(make, dt, method) for method in INTEGRATORS]
            yield f"| {place.scene} | {name} | {dt:g} | {' | '.join(cells)} | {earned(make, dt, 'rk4', 10)} |"


def main() -> None:
    parser = parser_of(__doc__, "out/baselines")
    parser.add_argument("--list", action="store_true", help="print the names of the rows; price is the second table")
    options = options_of(parser)
    chosen = [row for row in ROWS if options.rows in row.name]
    priced = options.rows in "price"
    if options.list or not (chosen or priced):
        print("\n".join([*(row.name for row in ROWS), "price"]))
        return
    warnings.filterwarnings("ignore", "Steps of .* are too long")
    print(describe(("gymnasium", "numpy", "numba", "scipy", *(("stable-baselines3", "torch") if can_train() else ()))))
    if not can_train():
        print("No agents: pip install stable-baselines3 in an environment of its own, and run this there.")
    print("\n| scene | task | policy | return | 95 % of the mean | of |\n|---|---|---|---|---|---|")
    for row in chosen:
        for text in rows_of(row, options):
            print(text, flush=True)
    if priced:
        head = " | ".join(("scene", "policy", "dt [s]", *INTEGRATORS, "rk4, 10 substeps"))
        print(f"\n| {head} |\n|{'---|' * (len(INTEGRATORS) + 4)}")
        for place in (SWING_UP, PENDULUM):
            for text in price(place, options):
                print(text, flush=True)


if __name__ == "__main__":
    main()
