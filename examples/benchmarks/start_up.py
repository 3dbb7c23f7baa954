"""Start-up times: from `gym.make` to the first step, with a warm and a cold cache, and the longest compilation.

A start is the quickest of three with a cold cache and of five with a warm one: other work on the machine only adds.

Goals: 0.5 s from `gym.make` to the first step with a warm cache, 1.2 s with a cold one; no program takes longer than
4 s to compile.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile

from machine import describe

FIRST = """
import time
import gymnasium as gym, numpy as np, pendulum_env
begun = time.perf_counter()
env = gym.make("LabPendulum-v0")
env.reset(seed=0)
env.step(np.zeros(1, np.float32))
print(time.perf_counter() - begun)
"""

COLD = """
import json, sys, time
import numba
import gymnasium as gym, numpy as np, pendulum_env
from pendulum_env.engine.machine import fitting
gym.make("LabPendulum-v0", scene="textbook", integrator="forward_euler").reset(seed=0)
found = {}
for name in fitting(pendulum_env.SCENES["sticky_bearing"]):
    options = {"scene": "sticky_bearing", "integrator": name, "diagnostics": ("energy", "heat_by_effect")}
    for kind in ("one", "many"):
        begun = time.perf_counter()
        env = gym.make("LabPendulum-v0", **options) if kind == "one" else gym.make_vec("LabPendulum-v0", 4, **options)
        env.reset(seed=0)
        env.step(np.zeros((1,) if kind == "one" else (4, 1), np.float32))
        found[f"{name}, {kind}"] = time.perf_counter() - begun
print(json.dumps(found))
"""


def output_of(script: str, cache: str) -> str:
    """Run a script in a new process with this cache folder and return its output."""
    environment = {**os.environ, "LAB_PENDULUM_CACHE": cache}
    return subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True,
                          check=True).stdout


def main() -> None:
    print(describe())
    starts = []
    for _ in range(3):
        with tempfile.TemporaryDirectory() as cache:
            starts.append(float(output_of(FIRST, cache)))
    cold = min(starts)
    with tempfile.TemporaryDirectory() as cache:
        output_of(FIRST, cache)
        warm = min(float(output_of(FIRST, cache)) for _ in range(5))
        print(f"gym.make to the first step: {warm:.2f} s warm (goal: 0.5), {cold:.2f} s cold (goal: 1.2)")
        times: dict[str, float] = json.loads(output_of(COLD, cache))
    for name, seconds in sorted(times.items(), key=lambda item: -item[1])[:8]:
        print(f"{name:44s} {seconds:5.2f} s to compile in sticky_bearing with every diagnostic")
    print(f"longest compile: {max(times.values()):.2f} s of {len(times)} programs (goal: at most 4)")


if __name__ == "__main__":
    main()
