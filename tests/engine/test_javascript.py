"""Programs in JavaScript: the same bits in Node as in Python, and what has no translation is refused.

The truth is another implementation of IEEE 754 arithmetic, that of Node. A run of a case is 50 calls, each with a
control of its own where the scene has a motor; all recorded states, the ledger, the observation and the stop codes are
compared.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from choice import check_pairs, pairs
from given_effects import Rub
from in_node import Case, cases_of, differing, in_node, in_python, needs_node

import integrators
from pendulum_env import SCENES, Scene, code
from pendulum_env.engine.javascript import javascript, translated
from pendulum_env.engine.reading import ProgramError
from pendulum_env.physics.effects import Gravity

QUICK = (
    Case("textbook", "quinlan8a"), Case("vacuum", "exact"), Case("exercise", "forward_euler"),
    Case("exercise_large", "symplectic_euler", "compensated"), Case("lab", "dop853", "adaptive"),
    Case("lab_rod", "discrete_gradient"), Case("sticky_bearing", "velocity_verlet"), Case("water", "bdf3"),
    Case("overdamped", "radau5"), Case("driven", "kahan_li6"), Case("chaotic", "rk4"),
    Case("kapitza", "yoshida6a", "compensated"), Case("windy", "bs3", "adaptive"), Case("clock_bob", "hht_alpha"),
    Case("moon", "taylor", "adaptive"), Case("lab", "taylor15"), Case("rod", "gauss4"),
    Case("kater", "kahan_li8"), Case("torsion", "verner6"),
    *(Case(Scene(effects=(Gravity(), Rub())), method) for method in ("rk4", "taylor")),
)
"""Scenes, each with a method of another family."""
AXES = (list(SCENES), list(integrators.METHODS))
PAIRS = pairs(AXES)
"""Every kind of method in every scene, and every method."""


@pytest.mark.slow
@needs_node
def test_every_scene_has_the_same_bits_in_node(tmp_path: Path) -> None:
    """With one method each, rk4 where QUICK names none, 100 steps."""
    others = set(SCENES) - {case.scene for case in QUICK}
    assert differing([*QUICK, *(Case(scene, "rk4") for scene in sorted(others))], 100, tmp_path) == []


def test_no_scene_and_no_method_is_left_out() -> None:
    check_pairs(PAIRS, AXES)


@needs_node
@pytest.mark.slow
@pytest.mark.parametrize("scene", list(SCENES))
def test_adaptive_and_compensated_programs_have_the_same_bits_in_node(scene: str, tmp_path: Path) -> None:
    """250 steps each, of PAIRS. All programs with steps of one length run in a browser: see tests/web/test_page.py.

    ``python tests/support/in_node.py`` runs every program in Node.
    """
    cases = cases_of(scene, [method for place, method in PAIRS if place == scene])
    assert differing([case for case in cases if case.steps != "fixed"], 250, tmp_path) == []


@needs_node
def test_a_run_that_stops_gives_the_same_reason(tmp_path: Path) -> None:
    """Steps of 20 s diverge by forward Euler, after the same call."""
    case = Case("exercise", "forward_euler")
    codes, digest = in_node([case], 20.0, 5000, tmp_path)[0]
    assert codes[-1] != 0
    assert (codes, digest) == in_python(case, 20.0, 5000)


@needs_node
def test_one_altered_digit_is_seen(tmp_path: Path) -> None:
    case = Case("vacuum", "rk4")
    text = javascript(case.program())
    altered = text.replace("0.16666666666666666", "0.16666666666666669", 1)
    assert altered != text
    them = in_node([case, case], 0.01, 100, tmp_path, [text, altered])
    ours = in_python(case, 0.01, 100)
    assert [found == ours for found in them] == [True, False]


REFUSED = {
    "def f(x):\n    return x % 2.0\n": "x % 2.0",
    "def f(x):\n    return x // 2.0\n": "x // 2.0",
    "def f(x):\n    return x ** 2.0\n": "x ** 2.0",
    "def f(x):\n    return x @ x\n": "x @ x",
    "def f(x):\n    return +x\n": "+x",
    "def f(x):\n    return tan(x)\n": "tan(x)",
    "def f(x):\n    return x.real\n": "x.real",
    "def f(x):\n    return y\n": "name 'y'",
    "def f(x):\n    return 'x'\n": "constant",
    "def f(x):\n    return 1j\n": "constant",
    "def f(x=1.0):\n    return x\n": "arguments",
    "def f(*x):\n    return x\n": "arguments",
    "def f(x):\n    return 0.0 < abs(x) < 1.0\n": "comparison",
    "def f(x):\n    return x is x\n": "x is x",
    "def f(x):\n    return [x for y in x]\n": "ListComp",
    "def f(x):\n    return (lambda: x)()\n": "call",
    "def f(x):\n    return max(x, x, x)\n": "max(x, x, x)",
    "def f(x):\n    with x:\n        return x\n": "with x",
    "def f(x):\n    for y in x:\n        return y\n": "loop",
    "def f(x):\n    for i in range(1, 2):\n        return i\n": "loop",
    "def f(x):\n    for i in range(3):\n        x = x + i\n    return i*x\n": "counter",
    "def f(x):\n    while x:\n        x = 0.0\n    else:\n        x = 1.0\n    return x\n": "loop",
    "def f(x):\n    a, b = x, x, x\n    return a\n": "assignment",
    "def f(x):\n    x.y = 1.0\n": "assignment",
    "def f(x):\n    del x\n": "del x",
    "from math import tan\n": "tan",
    "import math\n": "import math",
    "class A:\n    pass\n": "class A",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_has_no_translation_is_refused(text: str) -> None:
    with pytest.raises(ProgramError, match="cannot be translated to JavaScript") as said:
        translated(text)
    assert REFUSED[text] in str(said.value)


def test_a_step_that_python_must_run_is_refused() -> None:
    def step(theta, omega, dt, acceleration):  # type: ignore[no-untyped-def]
        omega = omega + acceleration(theta, omega) * dt
        while abs(omega) > 1e9:
            omega = 0.5 * omega
        return theta + omega * dt, omega

    with pytest.raises(ProgramError, match="calls the Python function"):
        code("vacuum", integrators.from_step(step), "javascript")


def test_reserved_words_get_an_underscore_and_parentheses_stay_where_they_count() -> None:
    text = translated("def new(var, x):\n    y = (var - (x - 1.5)) * -(x + 2.0)\n    return y if x else var\n")
    assert "function new_(var_, x) {" in text
    assert "const y = (var_ - (x - 1.5)) * -(x + 2);" in text
    assert "return x ? y : var_;" in text


def test_the_command_prints_the_module(run_here) -> None:  # type: ignore[no-untyped-def]
    status, text, _ = run_here("code", "--scene", "lab", "-i", "rk4", "--language", "javascript")
    assert status == 0
    assert text == code("lab", "rk4", "javascript")
    assert "export function run(state, params, control, h, rows, every, speed_limit, out, seen) {" in text
