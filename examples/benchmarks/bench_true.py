"""Cost of randomised parameters, encoders and delays in the vector environment: paired repeats in turn, best of each.

Each row is compared with the plain environment at the same number of substeps. Times are processor times of one thread
by default, so that other programs disturb them less. Compilation is not timed.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

import gymnasium as gym
import numpy as np
from machine import describe

import pendulum_env

RANGES = {"length": (0.3, 0.4), "mass": ("log", 0.03, 0.05), "max_torque": (0.04, 0.06)}
ENCODER = {"observation": "encoder", "sensor": pendulum_env.Sensor(quantum=math.tau / 2000)}
NOISY = {"observation": "encoder", "sensor": pendulum_env.Sensor(quantum=math.tau / 2000, noise=0.002)}
DELAYS = {"observation_delay": 0.01, "action_delay": 0.02}
ROWS: dict[str, dict[str, Any]] = {
    "plain": {},
    "randomised": {"randomize": RANGES},
    "encoder": ENCODER,
    "encoder with noise": NOISY,
    "delays": DELAYS,
    "random delays": {"observation_delay": (0.0, 0.02), "action_delay": (0.0, 0.02)},
    "all: randomised, encoder, delays": {"randomize": RANGES, **ENCODER, **DELAYS},
}


def made(size: int, substeps: int, threads: int, diagnostics: tuple[str, ...], options: dict[str, Any]) -> Any:
    env = gym.make_vec("LabPendulum-v0", size, vectorization_mode="vector_entry_point", substeps=substeps, copy=False,
                       diagnostics=diagnostics, num_threads=threads, **options)
    env.reset(seed=0)
    return env


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--envs", type=int, default=65_536)
    parser.add_argument("--substeps", type=int, nargs="+", default=[2, 4])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("--energy", action="store_true", help="with the energy ledger in info, the default of gym.make")
    given = parser.parse_args()
    clock = time.process_time if given.threads == 1 else time.perf_counter
    print(describe())
    print(f"{given.envs} environments, rk4, scene lab, {given.threads} thread(s); ns per environment")
    actions = np.random.default_rng(0).uniform(-1, 1, (given.envs, 1)).astype(np.float32)
    for substeps in given.substeps:
        diagnostics = ("energy",) if given.energy else ()
        envs = {name: made(given.envs, substeps, given.threads, diagnostics, options)
                for name, options in ROWS.items()}
        best = {name: [math.inf, math.inf] for name in envs}
        for _ in range(given.repeats):
            for name, env in envs.items():
                begun = clock()
                env.reset()
                begun, best[name][0] = clock(), min(best[name][0], clock() - begun)
                for _ in range(10):
                    env.step(actions)
                best[name][1] = min(best[name][1], (clock() - begun) / 10)
        print(f"\n{substeps} substeps{'':24} step   of plain    reset  beyond plain")
        for name, (reset, step) in best.items():
            base = best["plain"]
            print(f"{name:34} {1e9 * step / given.envs:6.1f} {step / base[1]:9.2f}x {1e9 * reset / given.envs:8.0f} "
                  f"{1e9 * (reset - base[0]) / given.envs:12.0f}")


if __name__ == "__main__":
    main()
