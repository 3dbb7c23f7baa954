"""Programs whose arithmetic is written as instructions: what is, what is left to numba, and the same bits."""

from __future__ import annotations

import ast
import inspect
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numba
import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, Task, rollout
from pendulum_env.engine import compiling, llvm
from pendulum_env.engine.elementwise import Kernel
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.engine.kernels import forget, functions, interpreted
from pendulum_env.engine.machine import fitting
from pendulum_env.tasks import TASKS

F8, F4, B1 = np.float64, np.float32, np.bool_
NUMBERS = (0.0, -0.0, 0.7, -1.3, 2.5, 1e-310, 1e308, -1e308, math.inf, -math.inf, math.nan)

WHOLE = {
    "arithmetic": "@inline\ndef f(x, y):\n    z = x*y - y/x\n    return -z + 2.0*(x - 0.1)\n",
    "a choice": "@inline\ndef f(x, y):\n    return x if x < y else (y if y >= 0.5 else 0.5 - x)\n",
    "truth values": "@inline\ndef f(x, y):\n    a = x != y\n    b = (x <= y) | (y == 0.7) & (x > 0.0)\n"
                    "    return 3.0 if a & b else (x if b else y)\n",
    "truth values that are compared": "@inline\ndef f(x, y):\n    a = (x > y) == False\n"
                                      "    b = (x > 0.5) != (y > 0.5)\n"
                                      "    return (1.0 if a else x) + (y if b else 2.0) + (3.0 if a < b else y)\n",
    "not equal": "@inline\ndef f(x, y):\n    return x if x != y else 2.0\n",
    "a truth value of the program": "@inline\ndef f(x, y):\n    return x if False | (x > y) else y\n",
    "abs and sqrt": "@inline\ndef f(x, y):\n    return abs(x) + sqrt(abs(y))\n",
    "max and min": "@inline\ndef f(x, y):\n    return max(-y, min(y, x)) + max(x, 0.0)\n",
    "the largest of three": "@inline\ndef f(x, y):\n    return max(x, y, 0.5) - min(-x, 2.0*y, 0.1, y)\n",
    "a name set twice": "@inline\ndef f(x, y):\n    x = x + y\n    x = x*x\n    return x - y\n",
    "constants": "@inline\ndef f(x, y):\n    return LARGE*x - SMALL*y + (NAN if x > y else 1.0)\n",
    "an infinite number": "@inline\ndef f(x, y):\n    return x if abs(y) < 1e999 else 1e999 - 1e999\n",
    "a function of functions": "@inline\ndef g(x):\n    return x*x\n\n@inline\ndef f(x, y):\n"
                               "    return g(x + g(y)) - g(y)\n",
    "numbers of other types": "@inline\ndef g(x, n, b):\n    return (x if b else n) + sqrt(n) - b*x\n\n@inline\n"
                              "def f(x, y):\n    return g(x, 3, x > y) - y\n",
    "a whole number that is given": "@inline\ndef g(x, n):\n    return x*n\n\n@inline\ndef f(x, y):\n"
                                    "    return g(x, 3) - y\n",
    "several results": "@inline\ndef g(x, y):\n    return y, x - y, x > y\n\n@inline\ndef f(x, y):\n"
                       "    a, b, c = g(x, 2.0*y)\n    a, b = b, a\n    return a - b if c else b\n",
    "a docstring": "@inline\ndef f(x, y):\n    \"\"\"Return x - y.\"\"\"\n    return x - y\n",
}
"""Functions that are written as a whole."""
HEAD = "LARGE = 3.5\nSMALL = -0.25\nNAN = float('nan')\nfrom math import sqrt\n\n"
GO = "\n@entry\ndef go(x, y):\n    if x == 123.0:\n        return x\n    return f(x, y)\n"

LEFT = {
    "a loop that ends early": "@inline\ndef f(x, y):\n    for _ in range(9):\n        x = 0.5*x + 0.1\n"
                              "        if x < y:\n            break\n    return x\n",
    "a branch": "@inline\ndef f(x, y):\n    z = x\n    if x < y:\n        z = 2.0*y - x\n    return z\n",
    "a loop that carries a number on": "@inline\ndef f(x, y):\n    for _ in range(3):\n        x = x*y + 0.1\n"
                                       "    return x\n",
    "a whole number": "@inline\ndef f(x, y):\n    n = 3\n    for i in range(4):\n        n += i\n    return x + n*y\n",
    "a function that is called with a name": "@inline\ndef g(x, y):\n    return x - y\n\n@inline\ndef f(x, y):\n"
                                             "    return g(x, y=2.0*y)\n",
    "a power": "@inline\ndef f(x, y):\n    return x**2 + y\n",
    "a chain of comparisons": "@inline\ndef f(x, y):\n    return x if 0.0 < x < y else y\n",
    "and": "@inline\ndef f(x, y):\n    return x if x > 0.0 and y > 0.0 else y\n",
}
"""Functions of which something is left to numba."""


def compiled(text: str, name: str = "go") -> Callable[..., Any]:
    return functions(Kernel(text, "test"), "compiled")[name]


def left(text: str, entry: str = "go", given: tuple[Any, ...] = (numba.float64, numba.float64)) -> list[str]:
    """Return the names of the functions that numba compiles."""
    found = llvm.LlvmProgram(text, entry, given)
    found.forget()
    return [node.name for node in ast.parse(found.text).body if isinstance(node, ast.FunctionDef)]


def bits(value: Any) -> str:
    return "nan" if value != value else float(value).hex()


@pytest.mark.quick(
    "arithmetic", "a choice", "truth values that are compared", "max and min", "a function of functions",
    "a loop that carries a number on", "a loop that ends early", "a branch", "a power", "numbers of other types"
)
@pytest.mark.parametrize("name", [*WHOLE, *LEFT])
def test_functions_have_the_bits_that_python_computes(name: str) -> None:
    text = HEAD + {**WHOLE, **LEFT}[name] + GO
    one, other = interpreted(text, "test")["go"], compiled(text)
    for x in NUMBERS:
        for y in NUMBERS:
            try:
                expected = one(x, y)
            except (ZeroDivisionError, OverflowError):
                continue
            assert bits(other(x, y)) == bits(expected), (x, y)
    assert left(text) == (["f", "go"] if name in LEFT else ["go"])


BLOCKS = {
    "numbers": ("@inline\ndef f(s, o, n):\n    for i in range(U(n)):\n        a = s[i + U(3)]\n"
                "        o[i + U(0)] = a*s[i + U(0)] - 0.3\n        o[i + U(4)], o[i + U(8)] = a, -a\n", F8),
    "in place": ("@inline\ndef f(s, o, n):\n    for i in range(U(n)):\n        o[i + U(0)] = 0.5*s[i + U(2)]\n"
                 "        o[i + U(0)] = o[i + U(0)] + 1.0\n", F8),
    "two loops": ("@inline\ndef f(s, o, n):\n    for i in range(U(n)):\n        o[i + U(4)] = s[i + U(1)] + 1.0\n"
                  "    for i in range(U(n)):\n        o[i + U(0)] = o[i + U(4)]*0.1\n", F8),
    "a place that is given": ("@apart\ndef g(a, o, n, x, to):\n    for i in range(U(n)):\n"
                              "        o[i + to] = 2.0*a[i + x]\n\n@inline\ndef f(s, o, n):\n"
                              "    g(s, o, n, U(2), U(4))\n    g(o, o, n, U(4), U(0))\n", F8),
    "small numbers": ("@separate\ndef f(s, o, n):\n    for i in range(U(n)):\n        o[i + U(0)] = s[i + U(1)]*0.1\n"
                      "        o[i + U(4)] = o[i + U(0)]*3.0\n", F4),
    "truth values": ("@inline\ndef f(s, o, n):\n    for i in range(U(n)):\n        o[i + U(0)] = s[i + U(1)] > 0.0\n"
                     "        o[i + U(4)] = o[i + U(0)] | (s[i + U(2)] == 2.5)\n", B1),
}
"""Functions of blocks, and the type of the numbers that they write."""
CARRIED = {
    "a sum": "@inline\ndef f(s, o, n):\n    total = 0.5\n    for i in range(U(n)):\n"
             "        total = total + s[i + U(0)]*s[i + U(1)]\n    o[0] = total\n",
    "the last number": "@inline\ndef f(s, o, n):\n    for i in range(U(n)):\n        last = 2.0*s[i + U(1)]\n"
                       "        o[i + U(4)] = last - 1.0\n    o[0] = last\n",
    "the number before": "@inline\ndef f(s, o, n):\n    before = 0.25\n    for i in range(U(n)):\n"
                         "        o[i + U(4)] = before*s[i + U(0)]\n        before = s[i + U(2)] + 1.0\n",
    "a number that the next loop reads first": "@inline\ndef f(s, o, n):\n    t = 0.0\n    for i in range(U(n)):\n"
                                               "        t = s[i + U(0)]*2.0 + 1.0\n        o[i + U(0)] = t\n"
                                               "    for i in range(U(n)):\n        o[i + U(0)] = o[i + U(0)] + t\n"
                                               "        t = s[i + U(1)]*3.0 - 1.0\n",
    "an element that is not always read": "@inline\ndef f(s, o, n):\n    for i in range(U(n)):\n"
                                          "        o[i + U(0)] = s[i + U(7)]*2.0 if n < 2 else 3.0*n\n",
    "a branch": "@inline\ndef f(s, o, n):\n    for i in range(U(n)):\n        a = s[i + U(0)]*0.1\n"
                "        if a > 0.0:\n            a = a - s[i + U(1)]*0.3\n        o[i + U(0)] = a\n",
}
"""Functions of blocks whose loops are left to numba."""
BLOCK_GO = "\n@entry\ndef go(s, o, n):\n    if n < 0:\n        return 1\n    f(s, o, n)\n    return 0\n"


@pytest.mark.quick("in place", "truth values", "a place that is given")
@pytest.mark.parametrize("name", BLOCKS)
def test_loops_over_blocks_have_the_bits_that_python_computes(name: str) -> None:
    text, kind = BLOCKS[name]
    numbers = np.array([0.7, -1.3, 2.5, 1e-3, -0.0, 17.0, 3.25, -9.0], F8)
    found = []
    for go in (interpreted(text + BLOCK_GO, "test")["go"], compiled(text + BLOCK_GO)):
        out = np.zeros(12, kind)
        assert go(numbers, out, 4) == 0
        found.append(out.tobytes())
    assert found[0] == found[1]
    arrays = numba.typeof(numbers), numba.typeof(out), numba.int64
    assert left(text + BLOCK_GO, given=arrays) == ["go"]


@pytest.mark.quick("a sum", "a branch")
@pytest.mark.parametrize("name", CARRIED)
def test_loops_that_carry_numbers_on_are_left_to_numba(name: str) -> None:
    text, numbers, found = CARRIED[name] + BLOCK_GO, np.array([0.7, -1.3, 2.5, 1e-3, -0.0, 17.0, 3.25, -9.0], F8), []
    for go in (interpreted(text, "test")["go"], compiled(text)):
        out = np.zeros(12)
        go(numbers, out, 4)
        found.append(out.tobytes())
    assert found[0] == found[1]
    assert left(text, given=(numba.typeof(numbers), numba.typeof(out), numba.int64)) == ["f", "go"]


ROWS = """@entry
def go(state, out, seen, counts, rows, x):
    a = state[0]
    b = state[1] - x
    total = 0.0
    kept = counts[0]
    for row in range(rows):
        a, b = 0.5*a + b, a - b
        out[row + 1, 0] = a
        out[row + 1, 2] = -b
        worst = a if a > b else b
        if worst > 50.0:
            break
        total = total + worst
    for i in range(U(rows)):
        w = seen[i]
        seen[i] = 2.0*w
    first = out[1]
    first[1] = total
    state[0] = a
    state[2] = first[0]
    n = rows*3
    m = n + kept + n
    return total + b, m
"""


def test_statements_in_a_row_have_the_bits_that_python_computes() -> None:
    """An early end, rows and elements of arrays of two dimensions, small numbers, and whole numbers."""
    found = []
    for go in (interpreted(ROWS, "test")["go"], compiled(ROWS)):
        state, out, seen = np.array([1.7, 0.3, 0.0]), np.zeros((9, 3)), np.linspace(-1.0, 3.0, 8, dtype=F4)
        total, whole = go(state, out, seen, np.array([[7, 8]])[0], 8, 0.1)
        found.append((total.hex(), whole, state.tobytes(), out.tobytes(), seen.tobytes()))
    assert found[0] == found[1]
    assert found[0][1] == 3*8 + 7 + 3*8


def test_rows_of_an_array_and_whole_numbers_are_left_to_numba() -> None:
    given = numba.typeof((np.zeros(3), np.zeros((9, 3)), np.zeros(8, F4), np.zeros(2, np.int64), 8, 0.1)).types
    program = llvm.LlvmProgram(ROWS, "go", given)
    program.forget()
    text = program.text
    for line in ("first = out[1]", "kept = counts[0]", "n = rows * 3", "m = n + kept + n", "break"):
        assert line in text
    assert text.count(f"{llvm.CALL}(") == 4, "before the loop, within it, the loop over seen, and after it"
    assert "0.5 * a" not in text
    assert "for i in" not in text, "the loop over seen"


@pytest.mark.parametrize(("scene", "integrator"), [("lab", "rk4"), ("vacuum", "taylor14"), ("gymnasium", "pefrl"),
                                                   ("kapitza", "ab4"), ("vacuum", "quinlan8a")])
def test_numba_compiles_only_what_python_calls(scene: str, integrator: str) -> None:
    """Neither steps nor loops over blocks are left, as long as no step ends early."""
    method, asked = integrators.get(integrator), ("energy",)
    for text, entry in ((program(SCENES[scene], method, asked).text, "run"),
                        (batch_program(SCENES[scene], method, asked, frozenset()).text, "run_blocks")):
        tree = next(node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef) and node.name == entry)
        found = left(text, entry, (numba.float64,) * len(tree.args.args))
        assert entry in found
        assert {"step", "advance", "advance_block", "record", "sin", "sin_block"}.isdisjoint(found), found


@pytest.mark.quick("lab-swing_up", "windy-swing_up", "lab-track")
@pytest.mark.parametrize(("scene", "name"), [
    *((scene, "swing_up") for scene in SCENES), ("lab", "track"), ("lab", "gymnasium")])
def test_numba_compiles_no_observations_of_the_packages_scenes(scene: str, name: str) -> None:
    """In its own loops it would take one environment at a time, because the user's arrays have several types."""
    method = next(str(one) for one in ("rk4", "velocity_verlet") if one in map(str, fitting(SCENES[scene])))
    found = batch_program(SCENES[scene], integrators.get(method), ("energy",), frozenset(), TASKS[name].goal)
    tree = next(node for node in ast.parse(found.text).body
                if isinstance(node, ast.FunctionDef) and node.name == "step_blocks")
    assert found.layout.told_at_once
    assert "observe" not in left(found.text, "step_blocks", (numba.float64,) * len(tree.args.args))


@pytest.mark.slow
@pytest.mark.parametrize("integrator", ["rk4", "pefrl", "gauss4", "taylor16", "quinlan8a", "chin4a", "abm4"])
def test_a_batch_has_the_bits_that_numba_computes_by_itself(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path, integrator: str) -> None:
    asked: dict[str, Any] = {"integrator": integrator, "duration": 1.0, "dt": 0.02, "backend": "compiled"}
    angles = np.linspace(0.1, 3.0, 300)
    found = []
    for _ in range(2):
        result = rollout("vacuum", angle=angles, **asked)
        found.append((result.angle.tobytes(), result.velocity.tobytes(), result.energy_residual.tobytes()))
        monkeypatch.setattr(compiling, "TEXT", "nothing is written as instructions")
        monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path))
        forget()
    assert found[0] == found[1]


def test_nothing_of_a_program_is_kept_after_it_has_been_compiled() -> None:
    compiled(HEAD + WHOLE["arithmetic"] + GO.replace("123.0", "124.0"))(1.0, 2.0)
    assert not llvm.WRITTEN


def test_numba_reads_no_lines_of_another_text(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Since Python 3.12 it stops where lines of another text begin in the middle of a docstring."""
    read, lines_of = [], inspect.getsourcelines

    def recorded(function: Any) -> Any:
        read.append(Path(function.__code__.co_filename))
        return lines_of(function)

    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path))
    monkeypatch.setattr(inspect, "getsourcelines", recorded)
    forget()
    assert compiled(HEAD + WHOLE["arithmetic"] + GO)(1.0, 2.0) is not None
    assert read
    assert not [path for path in read if path.exists()]


def test_a_program_that_cannot_be_written_is_compiled_by_numba_alone(
        monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Generated programs have no arrays with gaps; if one had, it would run, and somebody would report it."""
    monkeypatch.setenv("LAB_PENDULUM_CACHE", str(tmp_path))
    forget()
    text = BLOCKS["numbers"][0] + BLOCK_GO.replace("1\n", "2\n")
    numbers, found = np.arange(24.0)[::2], []
    go = compiled(text)
    with pytest.warns(UserWarning, match=r"not be written as instructions \(TypingError\), so that numba compiles all"):
        assert go(numbers, np.zeros(12), 4) == 0
    for one in (go, interpreted(text, "test")["go"]):
        out = np.zeros(12)
        one(numbers, out, 4)
        found.append(out.tobytes())
    assert found[0] == found[1]


def test_a_program_that_numba_cannot_compile_either_raises_its_error() -> None:
    text = "@entry\ndef go(x):\n    return x.nothing + 2.0*x - 1.0\n"
    with pytest.raises(numba.TypingError, match="nothing"):
        compiled(text)(1.0)


@pytest.mark.slow
def test_a_vector_with_a_reward_of_ones_own_has_the_same_rows() -> None:
    """Its program is compiled by numba as a whole: the two ways meet in the same numbers."""
    def own(phi: float, speed: float, action: float) -> float:
        return -(phi * phi + 0.1 * speed * speed + 0.001 * action * action)

    kept = []
    for task in ("swing_up", Task("own", own, start={"angle": (-0.1, 0.1)})):
        env = gym.make_vec("LabPendulum-v0", 300, vectorization_mode="vector_entry_point", task=task)
        env.reset(options={"angle": np.linspace(-3.0, 3.0, 300), "velocity": 0.1})
        action = np.linspace(-1.0, 1.0, 300, dtype=F4)[:, None]
        for _ in range(30):
            seen, reward, _, _, infos = env.step(action)
        kept.append([seen.tobytes(), reward.tobytes(), *(infos[name].tobytes() for name in ("energy", "work", "heat"))])
    assert kept[0] == kept[1]
