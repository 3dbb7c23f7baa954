"""What numba does not import for a program is there for functions that a user has it compile later."""

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
