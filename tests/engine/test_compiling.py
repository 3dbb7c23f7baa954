"""What is left out when a program is compiled: it gets the same instructions, and nothing is missing later."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import pytest
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from readme_code import ROOT

from pendulum_env.engine.compiling import LEFT_OUT

ASSEMBLY = r"""
import re, sys
from contextlib import nullcontext
from pendulum_env.engine import compiling
if sys.argv[1] == "everything":
    compiling.remembered_types = nullcontext
    compiling.LEFT_OUT.clear()
from pendulum_env import rollout
from numba.core.types.functions import BaseFunction
search, compile_extra = BaseFunction.get_call_type, compiling.Entry.compile_extra


def kept(self, function):
    result = compile_extra(self, function)
    text = re.sub("0x[0-9a-f]{8,}", "", result.library.get_asm_str())  # addresses of objects, in messages of numba 0.60
    print(re.sub(r"B\d+v\d+B", "", re.sub(".*_ZN08NumbaEnv.*", "", text)))  # numbers and options of other functions
    return result


compiling.Entry.compile_extra = kept
rollout("lab", integrator="rk4", duration=0.1)
rollout("lab", integrator="rk4", angle=[0.1, 0.2], duration=0.1)
rollout("lab", integrator="dopri5", angle=[0.1, 0.2], duration=0.1, rtol=1e-6)
rollout("gymnasium", integrator="symplectic_euler", duration=0.1)
assert BaseFunction.get_call_type is search, "numba's own search is back"
print(len(compiling.SIGNATURES))
"""

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
def test_programs_have_the_instructions_that_numba_gives_them_by_itself(tmp_path: Path) -> None:
    """A run, a batch, a batch with steps of its own, and a run with a bound, which calls max and min."""
    assembly, known = zip(*(output(ASSEMBLY, kind, tmp_path / kind).rstrip().rsplit("\n", 1)
                            for kind in ("everything", "less")), strict=True)
    assert assembly[0] == assembly[1]
    assert assembly[0].count("mul") > 500, "whole programs"
    assert known[0] == "0"
    assert int(known[1]) > 20


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


def test_every_pass_that_is_left_out_is_one_of_numbas() -> None:
    passes = set()

    class Listed(CompilerBase):  # type: ignore[misc]
        def define_pipelines(self) -> list[Any]:
            pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.update(one.__name__ for one, _ in pipeline.passes)
            return [pipeline]

    assert numba.njit(pipeline_class=Listed)(lambda x: x)(1.0) == 1.0
    assert passes > LEFT_OUT


def output(script: str, argument: str, cache: Path) -> str:
    """Return what a script prints in a process of its own with an empty cache; numba numbers its functions alike then.
    """
    cache.mkdir(mode=0o700)
    return subprocess.run(
        [sys.executable, "-c", script, argument], capture_output=True, text=True, check=True, cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "LAB_PENDULUM_CACHE": str(cache)},
    ).stdout
