"""Time that the adapters to Stable-Baselines3 and TorchRL add to a step of the vector environment.

Each time is the smallest of five means, beside the vector without an adapter and the programs' own vectors of single
environments. It needs both programs: pip install 'lab-pendulum[sb3,torchrl]'.

    python examples/benchmarks/adapters.py
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from machine import describe

SIZES = (16, 256, 4096)
SINGLE = 256
"""Largest number of single environments, one object each."""
DUMMY, SERIAL = "Stable-Baselines3's DummyVecEnv", "TorchRL's SerialEnv of GymEnv"
SETTINGS = {"diagnostics": ()}


def least(work: Callable[[], object], seconds: float) -> float:
    """Return the smallest of five mean times of a function [us], after one call that does not count."""
    begun = time.perf_counter()
    work()
    calls = max(1, int(seconds / 5.0 / max(time.perf_counter() - begun, 1e-6)))
    means = []
    for _ in range(5):
        begun = time.perf_counter()
        for _ in range(calls):
            work()
        means.append((time.perf_counter() - begun) / calls)
    return 1e6 * min(means)


def stepping(env: Any, size: int) -> Callable[[], object]:
    """Return a function that takes one step of a vector of Gymnasium's or Stable-Baselines3's."""
    env.reset()
    actions = np.zeros((size, 1), np.float32)
    return lambda: env.step(actions)


def vectors() -> dict[str, Callable[[int], Callable[[], object]]]:
    """Return functions from the number of environments to a function that takes a step, by the vector's name."""
    import torch
    from stable_baselines3.common.vec_env import DummyVecEnv
    from torchrl.envs import GymEnv, SerialEnv

    from pendulum_env.adapters.sb3 import LabPendulumVecEnv
    from pendulum_env.adapters.torchrl import LabPendulumTorchEnv

    torch.set_num_threads(1)
    one, endless = "LabPendulum-v0", {"max_episode_steps": 2**40, **SETTINGS}

    def of_torch(env: Any, size: int) -> Callable[[], object]:
        data = env.reset().set("action", torch.zeros(size, 1))
        return lambda: env.step(data)

    return {
        "the native vector": lambda size: stepping(
            gym.make_vec(one, num_envs=size, autoreset_mode="SameStep", **SETTINGS), size),
        "LabPendulumVecEnv": lambda size: stepping(LabPendulumVecEnv(size, **SETTINGS), size),
        'LabPendulumVecEnv, info_names=("energy",)': lambda size: stepping(
            LabPendulumVecEnv(size, info_names=("energy",)), size),
        DUMMY: lambda size: stepping(DummyVecEnv([lambda: gym.make(one, **SETTINGS)] * size), size),
        "LabPendulumTorchEnv": lambda size: of_torch(LabPendulumTorchEnv(size, **endless), size),
        SERIAL: lambda size: of_torch(SerialEnv(size, lambda: GymEnv(one, **endless)), size),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=1.0, help="time for each measurement [s]")
    options = parser.parse_args()
    print(describe(("gymnasium", "numpy", "numba", "stable-baselines3", "torchrl", "torch")))
    print(f"\n| µs per step of | {' | '.join(map(str, SIZES))} |\n|---|{'---|' * len(SIZES)}")
    for name, make in vectors().items():
        times = [f"{least(make(size), options.seconds):.1f}" if size <= SINGLE or name not in (DUMMY, SERIAL) else "-"
                 for size in SIZES]
        print(f"| {name} | {' | '.join(times)} |", flush=True)


if __name__ == "__main__":
    main()
