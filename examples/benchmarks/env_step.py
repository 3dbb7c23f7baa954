"""Steps per second of one environment compared with Gymnasium's Pendulum-v1, both unwrapped, timed in turn.

RK4 with the energy ledger in `info`, random actions, one thread. Goal: at least 4 times as many steps per second.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import time

import gymnasium as gym
import numpy as np
from machine import describe

import pendulum_env  # noqa: F401

STEPS, REPEATS = 5000, 41


def ns_per_step(env: gym.Env, actions: list[np.ndarray]) -> float:
    """Return the wall time of one step [ns], without resets."""
    env.reset(seed=0)
    step = env.step
    begun = time.perf_counter()
    for action in actions:
        step(action)
    return 1e9 * (time.perf_counter() - begun) / len(actions)


def main() -> None:
    print(describe())
    actions = list(np.random.default_rng(0).uniform(-1, 1, (STEPS, 1)).astype(np.float32))
    envs = {
        "LabPendulum-v0, rk4, energies": gym.make("LabPendulum-v0", integrator="rk4").unwrapped,
        "LabPendulum-v0, rk4, no diagnostics": gym.make("LabPendulum-v0", integrator="rk4", diagnostics=()).unwrapped,
        "Pendulum-v1": gym.make("Pendulum-v1").unwrapped,
    }
    times: dict[str, list[float]] = {name: [] for name in envs}
    for env in envs.values():
        ns_per_step(env, actions[:1000])
    for _ in range(REPEATS):
        for name, env in envs.items():
            times[name].append(ns_per_step(env, actions))
    for name, taken in times.items():
        ratio = statistics.median(theirs / ours for ours, theirs in zip(taken, times["Pendulum-v1"], strict=True))
        print(f"{name:38s} {statistics.median(taken):8.0f} ns a step, {ratio:5.2f} times Pendulum-v1's rate")


if __name__ == "__main__":
    main()
