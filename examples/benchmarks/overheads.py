"""Overheads outside the simulation: a list command, new environments, and the Python of a vector environment's step.

Goals: `lab-pendulum list integrators` under 1 s; `gym.make` with new parameter values under 3 ms; `gym.make_vec` with
arrays of parameters under 20 us per environment; a step of a vector of one environment under 5 us, of which the
simulation takes less than 1 us; a long run in pieces that Ctrl-C can end, at most 1 % over a single call. Other
times are medians; programs are compiled before.
"""

from __future__ import annotations

import math
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

from pendulum_env import SCENES, LabPendulumVectorEnv
from pendulum_env.engine.machine import UNSEEN, Machine
from pendulum_env.engine.pieces import NOWHERE

MANY, STEPS, LONG = 1024, 100, 10_000_000
SOURCE = np.random.default_rng(0)
STEPPED = {"symplectic_euler, no diagnostics": {"scene": "vacuum", "integrator": "symplectic_euler", "diagnostics": ()},
           "rk4, energies": {}}


def median(work: Callable[[], object], repeats: int) -> float:
    """Return the median time of a function [s], after one call that does not count."""
    times = []
    for _ in range(1 + repeats):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return statistics.median(times[1:])


def around(value: float, size: int | None = None) -> np.ndarray | float:
    """Return new random values within 10 % of a value."""
    return value * SOURCE.uniform(0.9, 1.1, size)


def lists() -> None:
    command = [sys.executable, "-m", "pendulum_env", "list", "integrators"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=dict(os.environ))


def one() -> None:
    gym.make("LabPendulum-v0", length=around(0.35), mass=around(0.04))


def vector() -> None:
    gym.make_vec("LabPendulum-v0", MANY, length=around(0.35, MANY), mass=around(0.04, MANY), gravity=around(9.8, MANY))


def stepping(copy: bool, options: dict[str, Any]) -> Callable[[], None]:
    """Return a function that takes STEPS steps of a vector of one environment, whose episode does not end."""
    env = LabPendulumVectorEnv(1, copy=copy, **options)
    env.reset(seed=0)
    action = np.zeros((1, 1), np.float32)

    def run() -> None:
        for _ in range(STEPS):
            env.step(action)

    return run


def pieces() -> float:
    """Return the extra time of a long run in pieces over that in one compiled call [%], the shortest of 30 each."""
    machine = Machine(SCENES["vacuum"], "rk4", ())
    moved = machine.state(1.0, 0.0), machine.state(1.0, 0.0)
    further = (0.0, 1e-4, 1, LONG, math.inf, NOWHERE, UNSEEN)
    whole, parts = [], []
    for _ in range(1 + 30):
        begun = time.perf_counter()
        machine.entry(moved[0], machine.parameters, *further)
        middle = time.perf_counter()
        machine.run(moved[1], machine.parameters, *further)
        whole.append(middle - begun)
        parts.append(time.perf_counter() - middle)
    assert moved[0].tolist() == moved[1].tolist()
    return 100.0 * (min(parts[1:]) / min(whole[1:]) - 1.0)


def report(label: str, time_taken: float, unit: str, goal: float) -> None:
    """Print a time and whether it meets its goal."""
    print(f"{label:62s} {time_taken:7.2f} {unit} (goal {goal:g}: {'met' if time_taken < goal else 'MISSED'})")


def main() -> None:
    warnings.simplefilter("ignore")
    print(describe())
    report("lab-pendulum list integrators", median(lists, 5), "s", 1.0)
    report("gym.make, new values", 1e3 * median(one, 100), "ms", 3.0)
    report(f"gym.make_vec of {MANY} with three arrays, per environment", 1e6 * median(vector, 9) / MANY, "us", 20.0)
    for copy in (False, True):
        for name, options in STEPPED.items():
            spent = median(stepping(copy, options), 200) / STEPS
            report(f"a step of a vector of one, {name}, copy={copy}", 1e6 * spent, "us", 5.0)
    report(f"a run of {LONG} steps in pieces, over one call", pieces(), "%", 1.0)


if __name__ == "__main__":
    main()
