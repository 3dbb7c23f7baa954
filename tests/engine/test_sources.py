"""The source of users' functions in programs: any form that Python takes, and what a program cannot have is refused."""

from __future__ import annotations

import importlib.util
import linecache
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendulum_env import Scene, rollout
from pendulum_env.common.sources import source_of
from pendulum_env.engine.elementwise import elementwise
from pendulum_env.engine.source import ProgramError, blocks_of, text_of
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.equation import equation_text

Loader = Callable[[str], Any]

FORMS = {
    "one line": "def own(x, k): return -k*x*(1.0 + 0.1*x)\n",
    "one line that goes on": "def own(x, k): return (x +\n  k)*2.0\n",
    "statements in one line": "def own(x, k): a = k + x; b = a*x; return a - 2.0*b\n",
    "one line behind arguments in several": "def own(x,\n        k): return k/(2.0 + x*x)\n",
    "a comment behind the colon": "def own(x, k):  # pull\n    return -k*x\n",
    "a comment with a colon": "def own(x, k):  # in N m:\n    b = 2.0*x\n    return -k*b\n",
    "a first line that ends in a colon": (
        "def own(x, k):  # pull\n    b = 3.0*k\n    if x > 0.0:\n        b = k\n    return b*x\n"),
    "annotations with colons": (
        "def own(x: 'dict[str:\\n', k: {1: 2} = 3.0) -> {'a':\n        1}:\n    # note\n    return k - x\n"),
    "a docstring that ends in a colon": 'def own(x, k):\n    """Return:\n\n    it:\n    """\n    return k*x\n',
    "a docstring alone in the line": 'def own(x, k): """Return it."""; return k*x\n',
    "tabs": "def own(x, k):\n\tif x > 0.0:\n\t\treturn k\n\treturn x\n",
    "a comment at the left": "def own(x, k):\n    b = k\n# a comment:\n    return b*x\n",
    "a bracket at the left": "def own(x, k):\n    return (k\n+ x\n)*2.0\n",
    "a backslash": "def own(x, k): \\\n    return k + \\\n  x\n",
    "a form feed": "\f\ndef own(x, k):\n    return k + x\n",
    "no newline at the end": "def own(x, k):\n    return k + x",
    "a keyword-only argument": "def own(x, *, k):\n    return k + x\n",
    "a positional argument": "def own(x, /, k):\n    return k + x\n",
    "letters of other languages": "def own(x, k):\n    größe = k  # ö:\n    return größe + x\n",
    "inside a function": (
        "def made():\n    def own(x, k):\n        b = k\n# left:\n        if x > 0.0:\n"
        "            b = 1.0\n        return b\n    return own\nown = made()\n"),
    "inside a condition": "if True:\n  def own(x, k):\n    b = k\n    return b*x\nelse:\n  own = None\n",
    "a static method": "class Mine:\n    @staticmethod\n    def own(x, k):\n        return k*x\nown = Mine.own\n",
    "a decorator that changes nothing": "def same(f): return f\n\n@same\n@same\ndef own(x, k): return k*x\n",
    "one of two definitions": "def own(x, k): return k\nfirst = own\ndef own(x, k): return x\nown = first\n",
    "a helper with a default": "def more(x, by=2.0): return x*by\ndef own(x, k): return more(x) + more(k, 3.0)\n",
    "a NumPy float": "import numpy\nBY = numpy.float64(0.1)\ndef own(x, k): return BY*x + k\n",
}
"""Functions in a form that Python takes, as the text of a module."""


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Loader:
    """Return a function that imports a text as a module."""
    def loaded(text: str) -> Any:
        path = tmp_path / f"users_{len(list(tmp_path.iterdir()))}.py"
        path.write_text(text, encoding="utf-8")
        spec = importlib.util.spec_from_file_location("users_module", path)
        assert spec
        assert spec.loader
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "users_module", module)
        monkeypatch.setattr(sys, "dont_write_bytecode", True)
        spec.loader.exec_module(module)
        linecache.checkcache()
        return module
    return loaded


@pytest.mark.parametrize("form", FORMS)
def test_every_form_runs_as_python_runs_it(form: str, load: Loader) -> None:
    """The truth is the function itself, called by Python."""
    own = load(FORMS[form]).own
    angle, rate = np.array([-1.3, 0.0, 0.7, 2.9]), np.array([0.5, -0.25, 3.0, 0.1])
    wanted = [own(a, k=r) for a, r in zip(angle.tolist(), rate.tolist(), strict=True)]
    assert elementwise(own, "python")(angle, rate).tolist() == wanted


def test_a_copy_keeps_its_comments_where_it_can(load: Loader) -> None:
    own = load("def own(x: float,\n        k: float) -> float:\n    b = k  # here\n    # there\n    return b\n").own
    assert text_of(own) == "def own(x, k):\n    b = k  # here\n    # there\n    return b\n"


REFUSED = {
    "lambda": ("own = lambda angle, rate: rate", "must be a function made with def, not a lambda"),
    "stars": ("def own(*angle): return 1.0\n", r"The function own takes \* or \*\*"),
    "closure": ("def made(k):\n    def own(angle): return k*angle\n    return own\nown = made(2.0)\n",
                "own uses k of the function around it"),
    "alias": ("def more(x): return x\nless = more\ndef own(angle): return less(angle)\n", "own calls more as less"),
    "name of Python's": ("def abs(x): return x\ndef own(angle): return abs(angle)\n", "own calls abs as abs"),
    "name of a program's": ("NAN = 0.0\ndef own(angle): return NAN\n", "own uses NAN, which has another meaning"),
    "module": ("import math\ndef own(angle): return math.sin(angle)\n", "own uses math, which cannot be copied"),
}


@pytest.mark.parametrize("form", REFUSED)
def test_what_a_program_cannot_have_is_refused_in_a_sentence(form: str, load: Loader) -> None:
    text, words = REFUSED[form]
    with pytest.raises(ProgramError, match=words) as caught:
        elementwise(load(text).own, "python")
    assert str(caught.value).endswith(".")


def test_two_constants_of_one_name_are_refused(load: Loader) -> None:
    """Otherwise one of two modules would silently compute with the other's."""
    first = load("RATE = 1.0\ndef one(angle): return RATE*angle\n").one
    other = load("RATE = 2.0\nfrom builtins import float\ndef two(angle): return one(angle) + RATE\n")
    other.two.__globals__["one"] = first
    with pytest.raises(ProgramError, match=r"use two values of RATE, 1\.0 and, in two, 2\.0; rename one"):
        elementwise(other.two, "python")


def test_a_source_that_changed_is_refused(load: Loader) -> None:
    own = load("def own(angle, rate): return rate\n").own
    Path(own.__code__.co_filename).write_text("def own(angle, rate): return -rate\n# longer\n")
    with pytest.raises(ProgramError, match="The source of own is not what runs: the file has changed; import it again"):
        elementwise(own, "python")


def scene_of(torque: Callable[..., float]) -> Scene:
    @dataclass(frozen=True)
    class Own(Effect):
        """A drive of one's own."""

        name, kind, equation, source, periodic = "own", "drive", "own", "none", False

        def coefficients(self, scene: Any) -> dict[str, float]:
            return {"pull_rate": -4.0}

    Own.torque = staticmethod(torque)  # type: ignore[assignment]
    return Scene(effects=(Own(),))


def test_a_constant_and_a_helper_that_were_defined_anew_count(load: Loader) -> None:
    """``theta'' = -4 k theta`` from 0.1 rad at rest is ``0.1 cos(2 sqrt(k) t)``; a notebook's cell changes k."""
    module = load("K = 1.0\ndef by(x): return K*x\ndef own(angle, pull_rate): return pull_rate*by(angle)\n")

    def end() -> float:
        run = rollout(scene_of(module.own), angle=0.1, velocity=0.0, duration=1.0, dt=0.01, backend="python")
        return float(run.angle[-1])

    assert end() == pytest.approx(0.1 * np.cos(2.0), abs=1e-8)
    module.own.__globals__["K"] = 2.25
    assert end() == pytest.approx(0.1 * np.cos(3.0), abs=1e-8)
    new = load("K = 2.25\ndef by(x): return K*x/2.25\ndef own(angle, rate): return 1.0\n").by
    module.own.__globals__["by"] = new
    assert end() == pytest.approx(0.1 * np.cos(2.0), abs=1e-8)


def test_a_lambda_is_told_from_others_in_its_line() -> None:
    one, two = (lambda x: x + 1.0), (lambda x: x + 2.0)
    if sys.version_info >= (3, 11):
        assert source_of(two).body_text() == "    return x + 2.0\n"
        assert source_of(one).body_text() == "    return x + 1.0\n"


WINDS = {
    "def wind_x(blow): return blow\n": "u = 0.5",
    "def wind_x(time, blow):  # return to it\n    return 2.0*blow*time\n": "u = 2.0 0.5 t",
    "def wind_x(time, blow):\n    late = time\n    return late\n": "u = wind_x(t)",
}


@pytest.mark.parametrize("text", WINDS)
def test_the_formula_of_a_wind_is_read_too(text: str, load: Loader) -> None:
    from pendulum_env.physics.effects import LinearDrag

    class Air:
        equation, memory, wind_x, wind_y, torque = "", (), staticmethod(load(text).wind_x), None, None

    found = equation_text((LinearDrag(0.1), Air()), {"blow": 0.5, "linear_drag_rate": 0.1})  # type: ignore[arg-type]
    assert found.split("; ")[-1].split(", ")[-1] == WINDS[text]


def test_a_program_is_divided_between_functions_and_never_in_a_text() -> None:
    parts = ('"""Head."""\n\nA = 1.0', "@inline\ndef f(x):\n    return x", "def g(x):\n    y = x\n\n    return y\n")
    assert blocks_of("\n\n\n".join(parts)) == parts
    for quotes in ('"""', "'''"):
        text = f"def f(x):\n    {quotes}\n\ndef of something\n{quotes}\n    return x\n\n\ndef g(x):\n    return x\n"
        assert blocks_of(text) == (text,)
