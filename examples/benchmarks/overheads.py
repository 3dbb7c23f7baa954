"""What is waited for beside the pendulums: a list, an environment with new values, a vector of them, its step's Python.

Goals: `lab-pendulum list integrators` under 1 s; `gym.make` with new parameter values under 3 ms; `gym.make_vec` with
arrays of parameters under 20 us an environment; a step of a vector of one environment, of which less than 1 us is its
pendulum, under 5 us. Medians of repeats; programs are compiled before.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from machine import describe

from pendulum_env import LabPendulumVectorEnv

MANY, STEPS = 1024, 100
SOURCE = np.random.default_rng(0)
STEPPED = {"symplectic_euler, no diagnostics": {"scene": "vacuum", "integrator": "symplectic_euler", "diagnostics": ()},
           "rk4, energies": {}}


def median(work: Callable[[], object], repeats: int) -> float:
    """Seconds that it takes, after one time that does not count."""
    times = []
    for _ in range(1 + repeats):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return statistics.median(times[1:])


def around(value: float, size: int | None = None) -> np.ndarray | float:
    """Values that were not there before, within a tenth of this one."""
    return value * SOURCE.uniform(0.9, 1.1, size)


def lists() -> None:
    command = [sys.executable, "-m", "pendulum_env", "list", "integrators"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=dict(os.environ))


def one() -> None:
    gym.make("LabPendulum-v0", length=around(0.35), mass=around(0.04))


def vector() -> None:
    gym.make_vec("LabPendulum-v0", MANY, length=around(0.35, MANY), mass=around(0.04, MANY), gravity=around(9.8, MANY))


def stepping(copy: bool, options: dict[str, Any]) -> Callable[[], None]:
    """STEPS steps of a vector of one environment, whose episode does not end."""
    env = LabPendulumVectorEnv(1, copy=copy, **options)
    env.reset(seed=0)
    action = np.zeros((1, 1), np.float32)

    def run() -> None:
        for _ in range(STEPS):
            env.step(action)

    return run


def told(what: str, found: float, unit: str, goal: float) -> None:
    print(f"{what:62s} {found:7.2f} {unit} (goal {goal:g}: {'met' if found < goal else 'MISSED'})")


def main() -> None:
    warnings.simplefilter("ignore")
    print(describe())
    told("lab-pendulum list integrators", median(lists, 5), "s", 1.0)
    told("gym.make, new values", 1e3 * median(one, 100), "ms", 3.0)
    told(f"gym.make_vec of {MANY} with three arrays, an environment", 1e6 * median(vector, 9) / MANY, "us", 20.0)
    for copy in (False, True):
        for name, options in STEPPED.items():
            spent = median(stepping(copy, options), 200) / STEPS
            told(f"a step of a vector of one, {name}, copy={copy}", 1e6 * spent, "us", 5.0)


if __name__ == "__main__":
    main()
