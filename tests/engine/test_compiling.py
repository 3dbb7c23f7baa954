"""Programs beside functions that a user has numba compile: neither changes the other."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from readme_code import ROOT

LATER = """
import sys
import gymnasium as gym, numba, numpy as np, pendulum_env
env = gym.make("LabPendulum-v0")
env.reset(seed=0)
assert not [name for name in sys.modules if name.startswith("scipy.linalg")]


@numba.njit
def product(matrix, vector):
    return np.dot(matrix, vector)


@numba.njit
def solution(matrix, vector):
    return np.linalg.solve(matrix, vector)


from numba.np import arraymath, linalg
assert arraymath.ensure_blas is linalg.ensure_blas and linalg.ensure_blas.__module__ == linalg.__name__
matrix, vector = np.array([[2.0, 1.0], [0.0, 4.0]]), np.array([3.0, 8.0])
print(product(matrix, vector).tolist(), solution(matrix, vector).tolist(), "scipy.linalg" in sys.modules)
"""


AFTER = """
import numba
from pendulum_env import SCENES
from pendulum_env.engine.machine import Machine


def fast_operations(integrator):
    machine = Machine(SCENES["gymnasium"], integrator, backend="compiled")
    machine.advance(machine.state(0.5, 0.0), 0.375, 0.004, 10)
    (text,) = machine.entry.inspect_llvm().values()
    assert text.count("fmul") > 10
    return sum(" fast " in line for line in text.split("\\n"))


@numba.njit(fastmath=True)
def user(x, bound):
    return max(-bound, min(bound, x))


print(fast_operations("symplectic_euler"), user(1.0, 2.0), fast_operations("heun"))
"""


@pytest.mark.slow
def test_options_of_a_users_function_do_not_reach_a_program(tmp_path: Path) -> None:
    """The scene has a bound: max and min, which numba compiles with the options of the function that calls them."""
    assert output(AFTER, "", tmp_path / "cache") == "0 1.0 0\n"


@pytest.mark.slow
def test_linear_algebra_is_there_for_functions_that_are_compiled_later(tmp_path: Path) -> None:
    assert output(LATER, "", tmp_path / "cache").split("\n", 1)[0] == "[14.0, 32.0] [0.5, 2.0] True"


def output(script: str, argument: str, cache: Path) -> str:
    """Return what a script prints in a process of its own with an empty cache; numba numbers its functions alike then.
    """
    cache.mkdir(mode=0o700)
    return subprocess.run(
        [sys.executable, "-c", script, argument], capture_output=True, text=True, check=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "LAB_PENDULUM_CACHE": str(cache)},
    ).stdout
