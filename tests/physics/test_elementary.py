"""Tests of the elementary functions: within an ulp, and equal bits interpreted, compiled and vectorised."""

from __future__ import annotations

import ast
import inspect
import itertools
import math
import random
import re
import types
from collections.abc import Callable, Iterator
from typing import Any

import mpmath
import numpy as np
import pytest
from compiled_code import library_calls

from pendulum_env.engine.wrap import half_turns, without_half_turns
from pendulum_env.physics import elementary

INF, NAN = math.inf, math.nan
TINIEST, NORMAL, HUGE = 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308
FUNCTIONS = {n: f for n, f in vars(elementary).items() if isinstance(f, types.FunctionType)}
TRUTH = {name: getattr(mpmath, name) for name in elementary.__all__}
SPECIAL = (0.0, TINIEST, NORMAL, 1e-300, 1e-16, 0.5, 1.0, math.pi, 750.0, 8.5e8, 1e16, 1e300, HUGE, INF, NAN)

Point = tuple[float, ...]


def neighbours(x: float) -> list[float]:
    return [math.nextafter(x, -INF), x, math.nextafter(x, INF)]


def nearest_to_multiples_of_half_pi() -> Iterator[float]:
    """Yield the doubles below 2**30 closest to a multiple of pi/2, from convergents of pi/2 in units of each ulp."""
    with mpmath.workprec(300):
        for exponent in range(-53, -22):
            rest = mpmath.ldexp(mpmath.pi / 2, -exponent)
            (m, m0), (k, k0) = (1, 0), (0, 1)
            while True:
                digit = int(mpmath.floor(rest))
                (m, m0), (k, k0) = (digit * m + m0, m), (digit * k + k0, k)
                if m >= 2**53 or k > 2**29:
                    break
                yield math.ldexp(m, exponent)
                rest = 1 / (rest - digit)


def angles() -> list[Point]:
    rng = random.Random(1)
    half_pi = mpmath.mpf("1.57079632679489661923132169163975144209858469968755291")
    with mpmath.workprec(200):
        multiples = [float(rng.randrange(1, 2 ** rng.randint(1, 29)) * half_pi / 2) for _ in range(800)]
    x = [y for m in multiples for y in neighbours(m)]
    x += list(nearest_to_multiples_of_half_pi()) + [2.0**k for k in range(-1074, 30)]
    x += [rng.uniform(0.0, 7.0) for _ in range(1500)] + [rng.uniform(0.0, 8.43e8) for _ in range(1000)]
    return [(sign * y,) for y in x for sign in (1.0, -1.0)]


def exponents() -> list[Point]:
    rng = random.Random(2)
    x = [y for k in range(-1075, 1024) for y in neighbours((k + 0.5) * math.log(2.0))]
    x += [sign * 2.0**k for k in range(-1074, 10) for sign in (1.0, -1.0)]
    x += [(rng.randrange(-1000, 1000) - rng.uniform(0.4, 0.5)) * math.log(2.0) for _ in range(5000)]
    x += [rng.uniform(-745.0, 709.78) for _ in range(1000)] + [709.782712893384, -745.1332191019411]
    return [(y,) for y in x if -745.1332191019411 <= y <= 709.782712893384]


def any_positive(rng: random.Random) -> float:
    return math.ldexp(rng.uniform(1.0, 2.0), rng.randrange(-1074, 1024))


def positives() -> list[Point]:
    rng = random.Random(3)
    x = [y for k in range(-1073, 1024) for y in neighbours(math.ldexp(1.0, k))] + [TINIEST, HUGE]
    x += [y for k in range(-40, 40) for y in neighbours(math.ldexp(math.sqrt(0.5), k))]
    x += [any_positive(rng) for _ in range(1000)] + [rng.uniform(0.5, 2.0) for _ in range(2000)]
    return [(y,) for y in x]


def bases_and_powers() -> list[Point]:
    rng = random.Random(4)
    bases = [any_positive(rng) for _ in range(1500)]
    bases += [1.0 + sign * 2.0 ** -rng.uniform(1.0, 52.0) for sign in (1.0, -1.0) for _ in range(750)]
    points = [(x, rng.uniform(-708.0, 708.0) / math.log(x)) for x in bases if x != 1.0]
    drag = (0.687, 0.5, 2 / 3, 1.16, 2.0, -1.0)
    points += [
        (x, rng.uniform(500.0, 708.0) / math.log(x)) for x in (rng.uniform(0.7, 1.42) for _ in range(3000))
    ]
    points += [(math.exp(rng.uniform(-10.0, 14.0)), y) for y in drag for _ in range(200)]
    return [(x, y) for x, y in points]


def slopes_and_saturation() -> list[Point]:
    """From 1e-300 to 400, most of them around the ends of tanh's three formulas and where it is not yet 1."""
    rng = random.Random(5)
    x = [y for end in (0.5493061443340549, 1.05) for y in around(end)]
    x += [10.0 ** rng.uniform(-300.0, math.log10(400.0)) for _ in range(1000)] + [TINIEST, NORMAL, 1e-300, 400.0]
    x += [rng.uniform(0.5, 0.62) for _ in range(2000)] + [rng.uniform(0.9, 1.2) for _ in range(2000)]
    x += [rng.uniform(0.0, 20.0) for _ in range(2000)]
    return [(sign * y,) for y in x for sign in (1.0, -1.0)]


POINTS: dict[str, Callable[[], list[Point]]] = {
    "sin": angles, "cos": angles, "exp": exponents, "log": positives, "power": bases_and_powers,
    "tanh": slopes_and_saturation,
}  # fmt: skip


def ulps(got: float, exact: Any) -> float:
    return float(abs(got - exact) / math.ulp(float(exact)))


@pytest.mark.quick("cos")
@pytest.mark.parametrize("name", elementary.__all__)
def test_accuracy(name: str) -> None:
    function = FUNCTIONS[name]
    with mpmath.workprec(160):
        errors = [(ulps(function(*p), TRUTH[name](*map(mpmath.mpf, p))), p) for p in POINTS[name]()]
    worst, where = max(errors)
    assert len(errors) > 2000
    assert worst <= 0.9, f"{name}{where}: {worst:.3f} ulp"


def test_published_values() -> None:
    """sin(float pi) is pi minus float pi; the double below 2**30 closest to a multiple of pi/2 is 29 pi/2 + 6e-19."""
    assert elementary.sin(math.pi) == 1.2246467991473532e-16
    assert elementary.cos(math.pi / 2) == 6.123233995736766e-17
    assert min(nearest_to_multiples_of_half_pi(), key=lambda x: abs(elementary.cos(x))) == 45.553093477052
    assert math.copysign(1.0, elementary.sin(-0.0)) == -1.0


SPECIAL_VALUES = [
    ("sin", (0.0,), 0.0), ("sin", (TINIEST,), TINIEST), ("sin", (-TINIEST,), -TINIEST), ("sin", (INF,), NAN),
    ("sin", (-INF,), NAN), ("sin", (NAN,), NAN), ("sin", (8.5e8,), NAN), ("sin", (HUGE,), NAN),
    ("cos", (0.0,), 1.0), ("cos", (INF,), NAN), ("cos", (NAN,), NAN), ("cos", (-8.5e8,), NAN),
    ("cos", (-HUGE,), NAN),
    ("exp", (0.0,), 1.0), ("exp", (-0.0,), 1.0), ("exp", (709.7827128933841,), INF), ("exp", (INF,), INF),
    ("exp", (HUGE,), INF), ("exp", (-745.2,), 0.0), ("exp", (-HUGE,), 0.0), ("exp", (-INF,), 0.0),
    ("exp", (NAN,), NAN),
    ("log", (1.0,), 0.0), ("log", (0.0,), -INF), ("log", (-0.0,), -INF), ("log", (INF,), INF),
    ("log", (NAN,), NAN), ("log", (-TINIEST,), NAN), ("log", (-1.0,), NAN), ("log", (-2.0,), NAN),
    ("log", (-INF,), NAN),
    ("power", (0.0, 0.5), 0.0), ("power", (-0.0, 3.0), 0.0), ("power", (0.0, -0.5), INF),
    ("power", (0.0, 0.0), 1.0), ("power", (0.3, 0.0), 1.0), ("power", (1.0, HUGE), 1.0),
    ("power", (2.0, HUGE), INF), ("power", (2.0, -HUGE), 0.0), ("power", (0.5, INF), 0.0),
    ("power", (0.5, -INF), INF), ("power", (INF, 0.5), INF), ("power", (INF, -0.5), 0.0),
    ("power", (INF, 0.0), 1.0), ("power", (-1.0, 2.0), NAN), ("power", (NAN, 0.0), NAN),
    ("power", (1.0, NAN), NAN), ("power", (2.0, -1074.0), TINIEST), ("power", (2.0, 1023.0), 2.0**1023),
    ("power", (TINIEST, 1.0), TINIEST),
    ("tanh", (0.0,), 0.0), ("tanh", (-0.0,), -0.0), ("tanh", (TINIEST,), TINIEST), ("tanh", (-1e-300,), -1e-300),
    ("tanh", (19.1,), 1.0), ("tanh", (-400.0,), -1.0), ("tanh", (HUGE,), 1.0), ("tanh", (INF,), 1.0),
    ("tanh", (-INF,), -1.0), ("tanh", (NAN,), NAN), ("tanh", (0.5493061443340549,), 0.5),
]  # fmt: skip


@pytest.mark.parametrize(("name", "arguments", "expected"), SPECIAL_VALUES)
def test_special_values(name: str, arguments: Point, expected: float) -> None:
    assert same_bits(np.array([FUNCTIONS[name](*arguments)]), np.array([expected]))


def test_source_can_be_copied() -> None:
    """A function uses only functions of its file and abs, and no operator that differs between Python and numba."""
    for name, function in FUNCTIONS.items():
        assert set(function.__code__.co_names) <= {*FUNCTIONS, "abs"}, name
        tree = ast.walk(ast.parse(inspect.getsource(function)))
        operators = {
            type(node.op) for node in tree if isinstance(node, ast.BinOp | ast.UnaryOp | ast.AugAssign)
        }
        assert operators <= {ast.Add, ast.Sub, ast.Mult, ast.Div, ast.USub}, name


def same_bits(a: Any, b: Any) -> bool:
    """Return True for equal bit patterns; zeros of different sign differ, all nans are equal."""
    a, b = (np.where(np.isnan(x), NAN, x).view(np.int64) for x in (a, b))
    return bool((a == b).all())


def loop(scalar: Any, arguments: int) -> Any:
    """Return the scalar function applied to arrays, as the engine compiles blocks."""
    import numba

    def apply1(x, out):  # type: ignore[no-untyped-def]
        for i in range(x.size):
            out[i] = scalar(x[i])

    def apply2(x, y, out):  # type: ignore[no-untyped-def]
        for i in range(x.size):
            out[i] = scalar(x[i], y[i])

    signature = f"void({', '.join(['f8[::1]'] * (arguments + 1))})"
    return numba.njit(signature, error_model="numpy")(apply1 if arguments == 1 else apply2)


@pytest.fixture(scope="module")
def compiled() -> dict[str, Any]:
    """Return each public function in a compiled loop, with every function of the file inlined."""
    import numba

    names: dict[str, Any] = {}
    for name, function in FUNCTIONS.items():
        copy = types.FunctionType(function.__code__, names, name)
        names[name] = numba.njit(error_model="numpy", forceinline=True)(copy)
    return {n: loop(names[n], len(inspect.signature(FUNCTIONS[n]).parameters)) for n in elementary.__all__}


@pytest.mark.quick("cos", "power")
@pytest.mark.parametrize("name", elementary.__all__)
def test_interpreted_and_compiled_give_the_same_bits(name: str, compiled: dict[str, Any]) -> None:
    signed = [s * x for x in SPECIAL for s in (1.0, -1.0)]
    arguments = len(inspect.signature(FUNCTIONS[name]).parameters)
    points = list(itertools.product(signed, repeat=arguments)) + POINTS[name]()
    columns = [np.array(c) for c in zip(*points, strict=True)]
    out = np.empty(len(points))
    compiled[name](*columns, out)
    assert same_bits(out, np.array([FUNCTIONS[name](*p) for p in points]))




@pytest.mark.parametrize("name", elementary.__all__)
def test_compiled_loop_is_vectorised_without_libm(name: str, compiled: dict[str, Any]) -> None:
    assert library_calls(compiled[name]) == set()
    assert re.search(r"fmul <\d+ x double>", next(iter(compiled[name].inspect_llvm().values())))


def test_a_libm_call_would_be_seen() -> None:
    import numba

    assert library_calls(loop(numba.njit(forceinline=True)(lambda x: math.sin(x)), 1))


def test_halves_of_wrapped_angles_need_no_reduction() -> None:
    """``sin_near_zero`` and ``cos_near_zero`` have the bits of sin and cos there, up to the horizontal itself."""
    edge = math.pi / 2
    angles = [x for near in (edge, -edge, 0.0) for x in around(near)] + np.linspace(-edge, edge, 100_001).tolist()
    wrapped = [without_half_turns(angle, half_turns(angle)) for turns in (1.0, 3.0, -5.0, 1001.0)
               for angle in around(turns * edge)]
    for angle in [*(x for x in angles if abs(x) <= edge), *(x for x in wrapped if abs(x) <= edge), 0.0, -0.0]:
        for near, far in ((elementary.sin_near_zero, elementary.sin), (elementary.cos_near_zero, elementary.cos)):
            one, other = near(0.5 * angle, 0.0), far(0.5 * angle)
            assert (one, math.copysign(1.0, one)) == (other, math.copysign(1.0, other))
    assert max(map(abs, wrapped)) < edge + 1e-12


def around(value: float, count: int = 20) -> list[float]:
    """The numbers of double precision next to a value."""
    found = [value]
    for _ in range(count):
        found = [math.nextafter(found[0], -math.inf), *found, math.nextafter(found[-1], math.inf)]
    return found
