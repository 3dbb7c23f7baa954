"""A step of 1024 environments beside one that was written by hand in C++ for this scene and method alone.

It says how far a program comes on this machine that was written for this scene and method alone: the one by hand
(by_hand.cpp) does the same operations on the same arrays in one pass, with all numbers of a step in registers. It is
compiled by every C++ compiler that is found, for this processor. First, 300 steps of both are compared bit for bit.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from machine import describe
from step_parts import KINDS, SIZE

from pendulum_env.engine.layout import BLOCK

COMPILERS = ("g++", "clang++", *(f"clang++-{version}" for version in range(22, 15, -1)))
FLAGS = ("-std=c++17", "-O3", "-march=native", "-ffp-contract=off", "-fno-math-errno", "-Wno-psabi", "-shared", "-fPIC")
NAME = "rk4, energies"
ROUNDS, CALLS, STEPS = 60, 100, 300
ACTION = np.random.default_rng(0).uniform(-1, 1, (SIZE, 1)).astype(np.float32)


def vector() -> Any:
    env = gym.make_vec("LabPendulum-v0", SIZE, vectorization_mode="vector_entry_point", num_threads=1, copy=False,
                       damping="none", max_episode_steps=10**9, **KINDS[NAME])
    env.reset(seed=0)
    return env


def compiled(compiler: str, folder: Path) -> Any:
    """Return the step by hand, compiled by one compiler; None if it fails."""
    library = folder / f"{compiler}.so"
    source = Path(__file__).with_suffix(".cpp")
    done = subprocess.run([compiler, *FLAGS, str(source), "-o", str(library)], capture_output=True, text=True)
    if done.returncode:
        print(f"{compiler} cannot compile it: {done.stderr.splitlines()[0]}")
        return None
    return ctypes.CDLL(str(library)).step


def by_hand(step: Any, env: Any, size: int = SIZE) -> tuple[Callable[[], int], Any]:
    """Return a call of the step by hand on ``size`` environments of a vector, and the arrays of its results."""
    batch = env.unwrapped._batch
    results = batch.results(lasting=True)
    fields, (gravity, motor, inertia, scale, omega0, limit) = batch.layout.fields, batch._shared
    assert fields == ("index", "q", "turns", "v", "status", "initial", "work")
    assert batch.layout.shared == ("gravity_rate", "motor_rate", "inertia", "scale", "omega0", "speed_limit")
    place, number, whole = (lambda array: ctypes.c_void_p(array.ctypes.data)), ctypes.c_double, ctypes.c_long
    given = (place(batch._state), whole(BLOCK), whole(size), number(batch.h), number(batch._bound), place(ACTION),
             *map(place, results), whole(SIZE), *map(number, (gravity, motor, inertia, scale, omega0, limit)))
    return (lambda kept=(batch, results): step(*given)), results  # kept, because only their addresses are given


def ours(env: Any, size: int = SIZE) -> tuple[Callable[[], int], Any]:
    """Return a call of the package's compiled step on ``size`` environments of a vector, and the arrays of its results.
    """
    batch = env.unwrapped._batch
    results = batch.results(lasting=True)
    state, scratch, first, last, _, *others = batch._usual
    given = (state, scratch, first, last if size else first, size, *others, ACTION.ravel(), *results, *batch._shared)
    return (lambda: batch.call(*given)), results


def same(step: Any) -> bool:
    """Return True if the step by hand gives the bits of the package's step, in several hundred steps."""
    (one, found), (other, expected) = by_hand(step, vector()), ours(vector())
    for _ in range(STEPS):
        one()
        other()
        if any(a.tobytes() != b.tobytes() for a, b in zip(found, expected, strict=True)):
            return False
    return bool(np.ptp(expected.reward))


def main() -> None:
    print(describe(("gymnasium", "numpy", "numba")))
    env = vector()
    works: dict[str, Callable[[], Any]] = {"whole step": lambda: env.step(ACTION), "compiled step": ours(vector())[0],
                                           "call of nothing": ours(vector(), 0)[0]}
    with tempfile.TemporaryDirectory() as folder:
        for compiler in filter(shutil.which, COMPILERS):
            step = compiled(compiler, Path(folder))
            if step is None:
                continue
            version = subprocess.run([compiler, "-dumpversion"], capture_output=True, text=True).stdout.strip()
            print(f"{compiler} {version}: {'the same bits' if same(step) else 'OTHER BITS'} in {STEPS} steps")
            works[f"by hand, {compiler}"] = by_hand(step, vector())[0]
            works["call of nothing by hand"] = by_hand(step, vector(), 0)[0]
        found: dict[str, list[float]] = {name: [] for name in works}
        for _ in range(ROUNDS):
            for name, work in works.items():
                begun = time.perf_counter()
                for _ in range(CALLS):
                    work()
                found[name].append(1e9 * (time.perf_counter() - begun) / CALLS / SIZE)
    for name, times in found.items():
        print(f"{name:24s} {min(times):6.2f} ns an environment, median {np.median(times):.2f}")
    best = min((name for name in works if name.startswith("by hand")), key=lambda name: min(found[name]), default=None)
    if best is None:
        return
    wholes, steps, calls = (np.array(found[name]) for name in ("whole step", "compiled step", "call of nothing"))
    hands = np.array(found[best]) - np.array(found["call of nothing by hand"])
    print(f"without the call, the compiled step takes {np.median((steps - calls) / hands):.2f} times as long as the "
          f"best by hand, with which a whole step takes {np.median((wholes - steps + calls + hands) / wholes):.2f} "
          "of its time")


if __name__ == "__main__":
    main()
