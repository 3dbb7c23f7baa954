"""The source of users' functions in programs: any form that Python takes, and what a program cannot have is refused."""

from __future__ import annotations

import importlib.util
import inspect
import io
import linecache
import math
import pdb
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.common.sources import source_of
from pendulum_env.engine.elementwise import elementwise
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.reading import ProgramError
from pendulum_env.engine.source import blocks_of, text_of, with_callees
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
    "a number of the function around it": (
        "def made(by):\n    def own(x, k):\n        return by*x + k\n    return own\nown = made(2.5)\n"),
    "a helper with another name": "def more(x): return x + 1.0\nless = more\ndef own(x, k): return less(x)*k\n",
    "a helper with a name of Python's": "def abs(x): return x + 2.0\ndef own(x, k): return abs(x)*k\n",
    "a constant with a name of a program's": "NAN = U = 0.5\ndef own(x, k): return NAN*x + U*k\n",
    "a helper with a name of a program's": "def lanes(x): return x + 2.0\ndef own(x, k): return lanes(x)*k\n",
    "a lambda as a helper": "more = lambda x: x*3.0\ndef own(x, k): return more(x) + more(k)\n",
    "two helpers of one name": (
        "def made(by):\n    def more(x): return by*x\n    return more\none, two = made(2.0), made(5.0)\n"
        "def own(x, k): return one(x) - two(k)\n"),
    "a whole number of the module": "N = 3\ndef own(x, k):\n    for i in range(N): x = x + k*i\n    return x\n",
    "a large whole number of the module": "N = 3000000\ndef own(x, k): return N**3*x + k*N*N*N\n",
    "a whole number as a default": (
        "def more(x, n=3):\n    for i in range(n): x = x + i\n    return x\n"
        "def own(x, k): return more(x) + more(k, 2)\n"),
    "an index of the module": "N = 1\ndef own(x, k):\n    both = [x, k]\n    return both[N] + both[N - 1]*N\n",
    "a helper that stands for another function": (
        "import functools\ndef base(a, b): return a\n@functools.wraps(base)\ndef more(b, a): return b - a\n"
        "def own(x, k): return more(x, k)\n"),
    "helpers of one name that call each other": (
        "def made(more):\n    def inner(x): return more(x)*2.0\n    return inner\none = made(lambda x: x + 1.0)\n"
        "def first(f):\n    def inner(x): return f(x) - 3.0\n    return inner\ntwo = first(one)\n"
        "def own(x, k): return two(x) + one(k)\n"),
    "a truth value of the module": "ON = False\ndef own(x, k): return x if ON else k\n",
    "an infinite number": "import math\nTOP = math.inf\ndef own(x, k): return k if x < TOP and x > -math.inf else x\n",
    "a number of a module": "import math\ndef own(x, k): return math.pi*x - math.e*k\n",
    "a variable with the name of a constant": (
        "by = 9.0\ndef own(x, k): return sum([by*x for by in (0.5, 2.0)]) + k*by\n"),
    "a function inside": "by = 9.0\ndef own(x, k):\n    def more(by): return by*x\n    return more(k) + by\n",
    "powers": "def own(x, k): return x**2 - x**3*k**4 + (x*x + 1.0)**5 + x**1 - x**8 + x**0\n",
    "an infinite number below all": "import math\nLEAST = -math.inf\ndef own(x, k): return k if x > LEAST else x\n",
    "a closure with the name of a number of the module": (
        "by = 9.0\ndef made(by):\n    def own(x, k): return by*x + k\n    return own\nown = made(2.5)\n"),
    "a name that a comprehension sets": "def own(x, k):\n    [last := x*one for one in (1.0, k)]\n    return last\n",
    "math.pow of a negative number": "import math\ndef own(x, k): return math.pow(x, 2) - math.pow(k, 1.0)\n",
    "names of a pattern": "by = 9.0\ndef own(x, k):\n    match x:\n        case by: return by*k\n",
    "a comprehension over its own name": "def own(x, k): return sum([x for x in (x, k)])\n",
    "a default with the name of its argument": "by = 3.0\ndef own(x, k): return (lambda z, by=by: z*by)(x) + by*k\n",
    "a variable with the new name of another": (
        "def own(x, k):\n    sin = x\n    sin_value = k\n    return sin + 2.0*sin_value\n"),
    "keyword arguments of functions inside": (
        "def own(x, k):\n    max = k\n    more = lambda max: max*2.0\n    return more(max=x) + max\n"),
    "variables with names of functions": (
        "import numpy as np\ndef own(x, k):\n    max = x + 1.0\n    power2 = max*k\n"
        "    return np.maximum(power2**2, max)\n"),
    "functions inside with names of functions": (
        "import math\ndef own(x, k):\n    def sin(cos):\n        return cos*2.0\n    cos, cos_value = sin(x), 5.0\n"
        "    return sin(cos) + k*(lambda abs: abs + cos_value)(x) + math.fabs(x)\n"),
    "a name that is renamed and assigned": (
        "def own(x, k):\n    power2: float = x*k\n    power2 **= 2\n    power2 += k\n    return power2\n"),
    "a power that is assigned": "def own(x, k):\n    x **= 2\n    x += k\n    return x\n",
    "a NumPy float": "import numpy\nBY = numpy.float64(0.1)\ndef own(x, k): return BY*x + k\n",
}
"""Functions in a form that Python takes, as the text of a module."""


INSIDE = "numba compiles functions inside only in part"
UNCOMPILED = {"names of a pattern": "numba does not compile patterns", "a function inside": INSIDE,
              "functions inside with names of functions": INSIDE, "keyword arguments of functions inside": INSIDE,
              "a name that a comprehension sets": "numba does not compile := in a comprehension"}
"""Form that Python runs and numba does not compile -> the reason."""


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
    "stars": ("def own(*angle): return 1.0\n", r"own \(line 1\) has \* or \*\* among"),
    "list": ("TABLE = [1.0]\ndef own(angle):\n    return TABLE[0]\n", r"own \(line 3\) uses TABLE, which is \[1\.0\]"),
    "module": ("import math\ndef own(angle): return math.gamma(angle)\n", r"uses math\.gamma, which is"),
    "object": ("class A: k = 2.0\na = A()\ndef own(angle): return a.k*angle\n", r"own \(line 3\) uses a\.k"),
    "a call of itself": ("def own(angle): return own(0.5*angle) if angle > 1.0 else angle\n", "own calls itself"),
    "two arguments of a logarithm": ("import math\ndef own(x): return math.log(x, 2.0)\n",
                                      "calls math.log with other than 1 argument;"),
    "a small number of NumPy": ("import numpy\nBY = numpy.int8(100)\ndef own(x): return BY*x\n", "uses BY, which is"),
    "none": ("Q = None\ndef own(x): return 1.0 if Q is None else x\n", "uses Q, which is None"),
    "global": ("by = 2.0\ndef own(angle):\n    global by\n    return by*angle\n", "has the statement global by"),
    "import": ("def own(angle):\n    import math\n    return math.sin(angle)\n", "has the statement import math"),
    "defaults in between": ("def more(x, by=2.0, *, to): return x\ndef own(x): return more(x, to=x)\n",
                            "more .* an argument without a default behind one with"),
    "a default that is no number": ("def more(x, how=None): return x\ndef own(x): return more(x)\n",
                                    "more .* has the default None for how"),
    "a name that is not there": ("def own(angle): return angle*nowhere\n", "uses nowhere, which is not defined"),
    "a variable with the name of a helper": (
        "def more(x): return x\nless = more\ndef own(x):\n    more = less(x)\n    return more\n",
        "calls more, and has an argument or a variable of this name"),
    "an argument with the name of a sine": (
        "import math\ndef own(sin):\n    return math.sin(sin)\n", "calls sin, and has an argument or a variable"),
}


@pytest.mark.parametrize("form", REFUSED)
def test_what_a_program_cannot_have_is_refused_in_a_sentence(form: str, load: Loader) -> None:
    text, words = REFUSED[form]
    with pytest.raises(ProgramError, match=words) as caught:
        elementwise(load(text).own, "python")
    assert str(caught.value).endswith(".")


def test_two_modules_may_have_a_constant_of_one_name(load: Loader) -> None:
    first = load("RATE = 1.0\ndef one(angle): return RATE*angle\n").one
    other = load("RATE = 2.0\ndef two(angle): return one(angle) + RATE\n")
    other.two.__globals__["one"] = first
    assert elementwise(other.two, "python")(np.array([0.25])).tolist() == [2.25]


POWERS = {"x**6": lambda x: x**6, "x**7": lambda x: x**7, "x**9": lambda x: x**9, "x**31": lambda x: x**31,
          "x**70": lambda x: x**70, "x**-2": lambda x: x**-2, "x**-7": lambda x: x**-7,
          "math.pow(x, 3)": lambda x: x**3, "math.pow(x, -2.0)": lambda x: x**-2}


@pytest.mark.parametrize("formula", [
    pytest.param(formula, marks=() if formula in ("x**7", "x**-2") else pytest.mark.slow) for formula in POWERS])
def test_a_whole_exponent_takes_a_negative_base(formula: str, load: Loader) -> None:
    own, x = load(f"import math\ndef own(x): return {formula}\n").own, np.array([-1.3, 0.7, 2.9])
    found = elementwise(own, "python")(x)
    np.testing.assert_allclose(found, [POWERS[formula](one) for one in x.tolist()], rtol=1e-14)
    assert elementwise(own, "compiled")(x).tolist() == found.tolist()


ELEMENTARY = {
    "math.sin(x)": math.sin, "np.cos(x)": math.cos, "m.exp(x)": math.exp, "math.log(x)": math.log,
    "sqrt(x)": math.sqrt, "math.fabs(-x)": math.fabs, "x**1.5": lambda x: x**1.5, "x**0.5": math.sqrt,
    "math.pow(x, 2.5)": lambda x: x**2.5, "math.atan2(x, 1.0)": math.atan,
    "math.tanh(x)": math.tanh, "np.tanh(-x)": lambda x: -math.tanh(x), "np.minimum(x, 0.5)": lambda x: min(x, 0.5),
}
"""A formula with a function of a module -> what Python computes."""


@pytest.mark.parametrize("formula", ELEMENTARY)
def test_functions_of_math_and_numpy_are_known(formula: str, load: Loader) -> None:
    """The package's own stand in their place, which err by less than an ulp."""
    own = load(f"import math, math as m, numpy as np\nfrom math import sqrt\ndef own(x): return {formula}\n").own
    x = np.array([0.1, 0.7, 2.9, 41.0])
    found = elementwise(own, "python")(x)
    np.testing.assert_allclose(found, [ELEMENTARY[formula](one) for one in x.tolist()], rtol=4e-16)


@pytest.mark.slow
def test_functions_of_math_and_numpy_have_the_same_bits_compiled(load: Loader) -> None:
    own = load("import math, math as m, numpy as np\nfrom math import sqrt\ndef own(x): return "
               f"{' + '.join(f'({formula})' for formula in ELEMENTARY)}\n").own
    x = np.array([0.1, 0.7, 2.9, 41.0])
    assert elementwise(own, "python")(x).tolist() == elementwise(own, "compiled")(x).tolist()


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


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_every_form_that_numba_knows_has_the_same_bits(form: str, load: Loader) -> None:
    own = load(FORMS[form]).own
    angle, rate = np.array([-1.3, 0.0, 0.7, 2.9]), np.array([0.5, -0.25, 3.0, 0.1])
    if form in UNCOMPILED:
        pytest.skip(UNCOMPILED[form])
    assert elementwise(own, "compiled")(angle, rate).tolist() == elementwise(own, "python")(angle, rate).tolist()


def test_a_function_that_is_changed_in_place_is_read_anew(load: Loader) -> None:
    own, other = load("def own(x, by=2.0): return by*x\n").own, load("def own(x, by=2.0): return by*x*10.0\n").own
    assert with_callees([own])[-1](3.0) == 6.0
    own.__defaults__ = (5.0,)
    assert with_callees([own])[-1](3.0) == 15.0
    own.__code__ = other.__code__
    assert with_callees([own])[-1](3.0) == 150.0
    module = load("K = 1.0\ndef own(x): return K*x\n")
    assert elementwise(module.own, "python")(np.array([3.0])).tolist() == [3.0]
    module.own.__globals__["K"] = 50.0
    assert elementwise(module.own, "python")(np.array([3.0])).tolist() == [150.0]


def test_a_number_of_a_module_and_of_the_function_around_it_may_change(load: Loader) -> None:
    """A program's functions are kept, but not when the module's number is another one."""
    tools, own = load("BY = 2.0\n"), load("def own(x): return tools.BY*x\n").own
    own.__globals__["tools"] = tools
    assert with_callees([own])[-1](3.0) == 6.0
    assert with_callees([own])[-1] is with_callees([own])[-1]
    tools.BY = 5.0
    assert with_callees([own])[-1](3.0) == 15.0
    around = load("def made():\n    by = 2.0\n    def own(x): return by*x\n    def change(new):\n"
                  "        nonlocal by\n        by = new\n    return own, change\nown, change = made()\n")
    assert with_callees([around.own])[-1](3.0) == 6.0
    around.change(7.0)
    assert with_callees([around.own])[-1](3.0) == 21.0


def test_a_debugger_steps_through_a_program() -> None:
    """Its lines are shown as those of a file, and the values are Python's floats."""
    made = program(SCENES["exercise_large"], integrators.get("symplectic_euler"))
    functions, shown = interpreted(made.text, made.title), io.StringIO()
    values = [0.25] * len(inspect.signature(functions["step"]).parameters)
    debugger = pdb.Pdb(stdin=io.StringIO("next\nnext\nnext\nnext\np v\ncontinue\n"), stdout=shown)
    debugger.use_rawinput = False
    result = debugger.runcall(functions["step"], *values)
    assert "-> q = q + h*v" in shown.getvalue()
    assert repr(result[1]) in shown.getvalue()


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
