"""Loops over blocks that compute with vectors: the bits that Python computes, and nothing beyond the user's arrays."""

from __future__ import annotations

import ast
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numba
import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, Task
from pendulum_env.engine import lanes
from pendulum_env.engine.elementwise import Kernel
from pendulum_env.engine.generate import batch_program
from pendulum_env.engine.kernels import forget, functions, interpreted
from pendulum_env.engine.layout import BLOCK

ROOM = 64
SPARE = -77.0
"""Number with which arrays are filled beyond what a loop may write."""
HEAD = "@{kind}\ndef f(s, o, n, h, x, small, truth, table, grid, pairs):\n    for i in lanes(n):\n"
GO = ("\n\n@entry\ndef go(s, o, n, h, x, small, truth, table, grid, pairs):\n"
      "    f(s, o, n, h, x, small, truth, table, grid, pairs)\n    return 0\n")

VECTORS = {
    "fields of blocks": ["a = s[i + U(64)]", "o[i + U(0)] = a*s[i] - h", "o[i + U(64)], o[i + U(128)] = a/h, -a"],
    "one number for all": ["o[i] = h", "o[i + U(64)] = 2.0*h - 0.5", "o[i + U(128)] = n*h"],
    "the user's numbers": ["x[i] = s[i]*0.1 + x[i]"],
    "small numbers": ["a = small[i]*s[i]", "small[i] = a*0.1 + s[i]", "o[i] = small[i] - a"],
    "truth values": ["b = truth[i]", "truth[i] = (s[i] > 0.0) & (s[i] < 1.0) | b", "o[i] = 1.0 if truth[i] else b*2.0"],
    "truth values that are compared": ["b = (s[i] > 0.5) == False", "o[i] = s[i] if b != truth[i] else h"],
    "choices": ["o[i] = s[i] if h < 1.0 else -s[i]", "o[i + U(64)] = h if s[i] < h else (s[i] if s[i] != 0.5 else 9.0)",
                "o[i + U(128)] = 1.0 if s[i] <= h else 0.0"],
    "functions": ["o[i] = g(s[i], h) - g(h, s[i])", "o[i + U(64)], o[i + U(128)] = pair(s[i], h)",
                  "x[i] = max(min(s[i], h), 0.1) + sqrt(abs(s[i + U(64)]))"],
    "infinite numbers": ["a = 1e999 if s[i] > 1.0 else s[i]", "o[i] = a - a",
                         "o[i + U(64)] = 1.0 if a < 1e999 else 2.0"],
    "rows": ["a = s[i + U(64)]", "table[i, 0] = s[i]", "table[i, 1] = 2.0*a", "table[i, 2] = h", "x[i] = a"],
    "rows of large numbers": ["pairs[i, 0] = s[i]", "pairs[i, 1] = h"],
    "a function with a loop": ["twice(s, o, n)", "o[i] = s[i] - h"],
    "a row of a table": ["grid[2, i] = s[i]*3.0", "x[i] = grid[1, i] + grid[2, i]"],
}
"""Loops that are written with vectors."""
SCALARS = {
    "every second element": ["o[i] = s[i + i]"],
    "an index that is computed with": ["o[i] = s[i]*i"],
    "columns out of order": ["table[i, 1] = s[i]", "table[i, 0] = 2.0*s[i]", "table[i, 2] = h"],
    "a column left out": ["table[i, 0] = s[i]", "table[i, 2] = h"],
    "rows of a table that is read": ["table[i, 0] = s[i]", "table[i, 1] = 2.0", "table[i, 2] = h",
                                     "o[i] = table[0, i]"],
    "a column that is read": ["table[i, 0] = s[i]", "table[i, 1] = 2.0", "table[i, 2] = h", "o[i] = table[i, 0]"],
    "a loop within": ["for k in lanes(n):", "    o[k] = s[k]*h"],
}
"""Loops that are not."""
FEWER = {"every second element": (0, 1, 8, 20), "rows of a table that is read": (0, 1, 3)}
"""Numbers of turns of loops that would read beyond an array in more."""
LEFT = {"a branch": ["a = s[i]", "if a > 0.5:", "    a = a - h", "o[i] = a"]}
"""Loops that are left to numba."""
FUNCTIONS = """from math import sqrt


@inline
def g(a, b):
    return a*b - 0.3*a


@inline
def pair(a, b):
    return a + b, (a if a > b else -b)


@inline
def twice(s, o, n):
    for i in lanes(n):
        o[i + U(128)] = s[i]*2.0


"""


def program(name: str, kind: str = "separate") -> str:
    return FUNCTIONS + HEAD.format(kind=kind) + "".join(
        f"        {line}\n" for line in {**VECTORS, **SCALARS, **LEFT}[name]) + GO


def given(n: int, room: int = ROOM) -> tuple[Any, ...]:
    """Return arguments of ``go``: fields with room, and the user's arrays of ``n`` with spare elements behind them."""
    random = np.random.default_rng(n)
    s = np.concatenate([random.normal(0.5, 1.0, room) for _ in range(4)])
    x, small = np.full(ROOM, SPARE), np.full(ROOM, SPARE, np.float32)
    truth, table, grid = np.full(ROOM, 1, np.bool_), np.full((ROOM, 3), SPARE, np.float32), np.full((3, ROOM), SPARE)
    pairs = np.full((ROOM, 2), SPARE)
    x[:n], small[:n], truth[:n] = random.normal(size=n), random.normal(size=n), random.random(n) < 0.5
    return s, np.zeros(3 * room), n, 0.7, x, small, truth, table, grid, pairs


def seen(arguments: tuple[Any, ...]) -> list[bytes]:
    """Return the bytes of all that may be read: n elements of each field, and the whole of the user's arrays."""
    s, o, n, _, *user = arguments
    fields = [array.reshape(-1, ROOM)[:, :n] for array in (s, o)]
    return [array.tobytes() for array in (*fields, *user)]


def compiled(text: str) -> Callable[..., Any]:
    return functions(Kernel(text, "test"), "compiled")["go"]


def widest(go: Callable[..., Any]) -> bool:
    """Return True if a compiled program computes with vectors of the width that is chosen for this processor."""
    from numba.core.registry import cpu_target

    count = lanes.width(cpu_target.target_context.codegen().magic_tuple()[2])
    return any(f"<{count} x double>" in text for text in go.inspect_llvm().values())  # type: ignore[attr-defined]


@pytest.mark.quick(
    "fields of blocks", "truth values that are compared", "choices", "rows of large numbers", "a row of a table",
    "an index that is computed with", "a loop within", "a branch"
)
@pytest.mark.parametrize("name", [*VECTORS, *SCALARS, *LEFT])
def test_loops_have_the_bits_that_python_computes_and_write_nothing_beyond(name: str) -> None:
    text = program(name)
    one, other = interpreted(text, "test")["go"], compiled(text)
    for n in FEWER.get(name, (0, 1, 3, 4, 7, 8, 15, 16, 17, 31, 33, 48, 60)):
        expected, found = given(n), given(n)
        with np.errstate(all="ignore"):
            one(*expected)
        other(*found)
        assert seen(found) == seen(expected), n


@pytest.mark.parametrize("name", [*VECTORS, *SCALARS])
def test_which_loops_are_written_with_vectors(name: str) -> None:
    function = next(node for node in ast.parse(program(name)).body if isinstance(node, ast.FunctionDef) and
                    node.name == "f")
    (loop,) = (node for node in function.body if isinstance(node, ast.For))
    assert lanes.fits(loop) == (name in VECTORS)


def test_vectors_are_in_the_compiled_program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path))  # numba shows no code that it has loaded
    forget()
    found = []
    for name in ("fields of blocks", "every second element"):
        go = compiled(program(name, "apart"))
        go(*given(5))
        found.append(widest(go))
    assert found == [True, False]


@pytest.mark.parametrize(("features", "width"), [
    ("+64bit,+avx,+avx2,+avx512f,+sse2", 16), ("+avx,+avx2,-avx512f", 8), ("-avx,+sse2,+avx512vl", 4), ("", 4),
    ("+neon,+fp-armv8", 4)])
def test_a_vector_holds_twice_the_numbers_of_a_register(features: str, width: int) -> None:
    assert lanes.width(features) == width
    assert lanes.LARGEST % width == 0


@pytest.mark.parametrize(("integrator", "over"), [("tsit5", "lanes(n)"), ("dop853", "lanes(n)"),
                                                  ("taylor16", "range(U(n))")])
@pytest.mark.parametrize("rtol", [False, True])
def test_loops_of_taylor_series_are_left_to_the_compiler(integrator: str, over: str, rtol: bool) -> None:
    method = integrators.get(integrator)
    text = batch_program(SCENES["vacuum"], method, ("energy",), frozenset(), adaptive=rtol).text
    function = text.split("def attempts(" if rtol else "def advance_block(")[1].split("\n\n")[0]
    assert f"    for i in {over}:" in function


def test_fields_of_a_block_hold_whole_vectors() -> None:
    assert BLOCK % lanes.LARGEST == 0
    assert BLOCK % 128, "equal places of all fields would share a few lines of the cache"


SAME = """import hashlib, gymnasium, numpy, pendulum_env
found = hashlib.sha256()
for size in (5, 190):
    env = gymnasium.make_vec("LabPendulum-v0", size, vectorization_mode="vector_entry_point", integrator="rk4")
    env.reset(seed=1)
    for share in numpy.linspace(-1.2, 1.2, 20):
        seen, reward, over, late, infos = env.step(numpy.full((size, 1), share, numpy.float32))
        for array in (seen, reward, over, late, infos["energy"], infos["work"]):
            found.update(array.tobytes())
print(found.hexdigest())
"""


def with_not(phi: float, speed: float) -> float:
    return -phi if not (speed > 0.0 and phi > 0.1) else phi


def with_three(phi: float, speed: float, action: float) -> float:
    return max(phi, speed, action) - min(abs(phi), 0.5, action**2)


def with_if(phi: float, speed: float) -> float:
    if phi > 0.1 or speed < 0.0:
        return 1.0
    return -speed


def with_power(phi: float, speed: float) -> float:
    return -(abs(phi) ** 1.5) - math.exp(-speed * speed)


@pytest.mark.slow
@pytest.mark.parametrize(("reward", "straight"), [
    (with_not, True), pytest.param(with_three, True, marks=pytest.mark.slow),
    pytest.param(with_if, False, marks=pytest.mark.slow), pytest.param(with_power, False, marks=pytest.mark.slow),
])
def test_a_task_of_ones_own_has_the_same_bits_compiled(
        reward: Callable[..., float], straight: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A warning that a program cannot be written as instructions would be an error."""
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path))
    forget()
    found = []
    for backend in ("compiled", "python"):
        monkeypatch.setenv("LAB_PENDULUM_BACKEND", backend)
        forget()
        task = Task("own", reward, start={"angle": (-0.3, 0.3)})
        assert task.goal.straight is straight
        env = gym.make_vec("LabPendulum-v0", 19, vectorization_mode="vector_entry_point", integrator="rk4", task=task)
        env.reset(seed=2)
        for share in np.linspace(-1.2, 1.2, 12):
            seen, given, over, late, infos = env.step(np.full((19, 1), share, np.float32))
            found.append([array.tobytes() for array in (seen, given, over, late, infos["energy"])])
    assert found[:12] == found[12:]


@pytest.mark.slow
def test_every_width_of_vectors_has_the_same_bits() -> None:
    """A program for a processor without AVX runs on one with it; the digest is that of the interpreted program."""
    def digest(**more: str) -> str:
        done = subprocess.run([sys.executable, "-c", SAME], env={**os.environ, **more}, capture_output=True, text=True,
                              check=True)
        return done.stdout

    older = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    python = digest(LAB_PENDULUM_BACKEND="python")
    assert digest() == digest(**older) == python
    if numba.core.registry.cpu_target.target_context.codegen().magic_tuple()[2].count("+avx2"):
        assert digest(NUMBA_CPU_NAME="haswell", NUMBA_CPU_FEATURES="+avx,+avx2,+sse4.2") == python
