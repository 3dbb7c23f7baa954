"""Short functions in place of their calls: the same numbers, bit by bit, and nothing else that the names mean."""

from __future__ import annotations

import re

import pytest

import integrators
import pendulum_env
from pendulum_env.engine.folding import folded
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted

HEAD = "def unused(): pass\n\n"
FORMS = {
    "a call": ("@inline\ndef f(x):\n    return x*x + 1.0\n\n@entry\ndef go(a):\n    return 2.0*f(a)", ["f"]),
    "a call in a call": ("@inline\ndef f(x):\n    return x + 1.0\n\n@inline\ndef g(x):\n    return f(2.0*x)\n\n"
                         "@entry\ndef go(a):\n    return g(f(a))", ["f", "g"]),
    "a sum in a product": (
        "@inline\ndef f(x, y):\n    return x - y\n\n@entry\ndef go(a):\n    return 3.0*f(a, -a - 0.1)", ["f"]),
    "a choice": ("@inline\ndef f(x):\n    return 1.0 if x > 2.0 else -x\n\n@entry\ndef go(a):\n"
                 "    return f(a) - f(a + 1.0)", []),
    "a choice of names": (
        "@inline\ndef f(x):\n    return 1.0 if x > 2.0 else -x\n\n@entry\ndef go(a):\n    return f(a)", ["f"]),
    "an argument taken twice": ("@inline\ndef f(x):\n    return x*x\n\n@entry\ndef go(a):\n    return f(a + 1.0)", []),
    "a name that means something else": (
        "K = 7.0\n\n@inline\ndef f(x):\n    return K*x\n\n@entry\ndef go(a):\n    K = 2.0\n    return K + f(a)", []),
    "a parameter that means something else": (
        "K = 7.0\n\n@inline\ndef f(x):\n    return K*x\n\n@entry\ndef go(K):\n    return K + f(K)", []),
    "a name for an argument": (
        "@inline\ndef f(x, y):\n    return x - y\n\n@entry\ndef go(a):\n    return f(a, y=2.0)", []),
    "an argument left out": (
        "@inline\ndef f(x, y=2.0):\n    return x - y\n\n@entry\ndef go(a):\n    return f(a)", []),
    "a local name of the function": (
        "@inline\ndef f(x):\n    return x + 1.0\n\n@inline\ndef g(x):\n    return 3.0*x\n\n"
        "@entry\ndef go(a):\n    f = g\n    return f(a)", []),
    "two lines": ("@inline\ndef f(x):\n    y = x*x\n    return y + 1.0\n\n@entry\ndef go(a):\n    return f(a)", []),
    "apart": ("@apart\ndef f(x):\n    return x + 1.0\n\n@entry\ndef go(a):\n    return f(a)", []),
    "often and long": ("@inline\ndef f(x, y):\n    return x*x*x*x*x*x + y*y*y*y*y\n\n@entry\ndef go(a):\n    return "
                       "f(a, a) + f(a, 1.0) + f(2.0, a) + f(a, 3.0) + f(4.0, a)", []),
}
"""Programs, and the functions that are folded in them."""


@pytest.mark.parametrize("name", FORMS)
def test_forms(name: str) -> None:
    text, gone = FORMS[name]
    found = folded(HEAD + text)
    before, after = (interpreted(one, "test") for one in (text, found))
    for a in (0.1, 1.7, 2.5, -3.3):
        assert after["go"](a).hex() == before["go"](a).hex()
    assert sorted(re.findall(r"def (\w+)", HEAD + text)) == sorted([*re.findall(r"def (\w+)", found), *gone])


def test_the_default_program_has_fewer_functions() -> None:
    """Torques, and what wraps angles, are written where they are called."""
    text = program(pendulum_env.SCENES["lab"], integrators.get("rk4")).text
    names, left = (set(re.findall(r"def (\w+)", one)) for one in (text, folded(text)))
    assert left < names
    assert {"gravity", "motor_torque", "half_turns", "side_of", "residual_of"} <= names - left
