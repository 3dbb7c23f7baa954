"""Baseline returns of the tasks: a random policy, energy shaping with a regulator at the top, and trained agents.

Episodes have 500 steps in the default scene, as registered. Each policy without learning is run for 1000 episodes, and
so is each agent that PPO has trained (examples/11_train_swing_up.py) with its own seed. "±" is the standard deviation
over episodes, for agents over seeds; the interval is the 95 % interval of the mean (Student's t). Agents need
Stable-Baselines3; without it only the other rows are shown.

    python examples/benchmarks/baselines.py --seeds 5
"""

from __future__ import annotations

import argparse
import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from machine import describe
from scipy.stats import t as student

from pendulum_env import LabPendulumVectorEnv
from pendulum_env.controllers import RandomPolicy, SwingUp

EPISODES, STEPS, FIRST = 1000, 500, 10**6
"""Number and length of the episodes, and the seed of the first one, which is never used in training."""
TASKS = {"swing_up": 500_000, "balance": 100_000}
"""Training steps by task."""
EXAMPLE = Path(__file__).parent.parent / "11_train_swing_up.py"

Policy = Callable[[Any], Any]


def returns(policy: Policy, task: str, episodes: int = EPISODES) -> Any:
    """Return the returns of complete episodes; rewards after the end of an episode do not count."""
    env = LabPendulumVectorEnv(episodes, task=task, diagnostics=())
    seen, total, going = env.reset(seed=FIRST)[0], np.zeros(episodes), np.ones(episodes, dtype=bool)
    for _ in range(STEPS):
        seen, reward, over, _, _ = env.step(policy(seen))
        total[going] += reward[going]
        going &= ~over
    return total


def row(task: str, name: str, values: Any, of: str) -> str:
    """Return a line of the table with mean, standard deviation and interval of at least two values."""
    mean, spread = float(np.mean(values)), float(np.std(values, ddof=1))
    half = float(student.ppf(0.975, len(values) - 1)) * spread / len(values) ** 0.5
    between = f"{mean - half:.1f} to {mean + half:.1f}"
    return f"| {task} | {name} | {mean:.1f} ± {spread:.1f} | {between} | {len(values)} {of} |"


def trainer() -> Any:
    """Import example 11 as a module; return None without Stable-Baselines3."""
    if importlib.util.find_spec("stable_baselines3") is None:
        return None
    spec = importlib.util.spec_from_file_location("training", EXAMPLE)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    assert spec.loader is not None
    spec.loader.exec_module(module)
    return module


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5, help="agents trained for each task")
    parser.add_argument("--share", type=float, default=1.0, help="fraction of the training steps to take")
    options = parser.parse_args()
    if options.seeds < 2:
        parser.error("--seeds must be 2 or more, for a standard deviation")
    training = trainer()
    more = ("stable-baselines3", "torch") if training else ()
    print(describe(("gymnasium", "numpy", "numba", "scipy", *more)))
    if not training:
        print("No agents: pip install stable-baselines3 in an environment of its own, and run this there.")
    print("\n| task | policy | return | 95 % of the mean | of |\n|---|---|---|---|---|")
    for task, steps in TASKS.items():
        print(row(task, "random", returns(RandomPolicy(0), task), "episodes"), flush=True)
        print(row(task, "energy shaping, LQR", returns(SwingUp("lab", task=task), task), "episodes"), flush=True)
        if training:
            budget, began, means = int(options.share * steps), time.process_time(), []
            for seed in range(options.seeds):
                policy, _ = training.trained(task, budget, seed)
                means.append(float(returns(policy, task).mean()))
            print(row(task, f"PPO, {budget} steps", means, "seeds"), flush=True)
            print(f"|  | each: {', '.join(f'{mean:.1f}' for mean in means)}; "
                  f"{(time.process_time() - began) / options.seeds:.0f} s each on one core | | | |", flush=True)


if __name__ == "__main__":
    main()
