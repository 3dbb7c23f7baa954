"""Generated source of steps: straight lines, no zeros, readable."""

from __future__ import annotations

import ast
from dataclasses import replace
from fractions import Fraction

import pytest

from integrators import METHODS, Method, MethodError, RungeKutta, Splitting, unroll
from integrators.families.splitting import DRAG, DRIFT, KICK, PUSH
from integrators.method import exact

HALF, ONE = Fraction(1, 2), Fraction(1)
EXPLICIT = [name for name, method in METHODS.items() if not method.implicit]
VERLET = METHODS["velocity_verlet"]


def body(source: str) -> list[str]:
    """Return the lines of ``step`` after its docstring."""
    lines = source[source.index("def step") :].splitlines()
    return [line.strip() for line in lines[2:]]


def step_of(source: str, **namespace):
    exec(source, namespace)
    return namespace["step"]


@pytest.mark.parametrize("name", EXPLICIT)
def test_explicit_steps_are_straight_lines_of_plain_arithmetic(name):
    source = unroll(METHODS[name], hooks={"drag": ()})
    *_, function = ast.parse(source).body
    assert isinstance(function, ast.FunctionDef)
    kinds = {type(node) for node in ast.walk(function)}
    assert not kinds & {ast.For, ast.While, ast.If, ast.IfExp, ast.ListComp, ast.Subscript, ast.Attribute}
    assert {type(line) for line in function.body[1:-1]} == {ast.Assign}
    assert isinstance(function.body[-1], ast.Return)
    constants = [node.value for node in ast.walk(function) if isinstance(node, ast.Constant)]
    assert 0.0 not in constants
    assert 1.0 not in constants


@pytest.mark.parametrize("name", EXPLICIT)
def test_explicit_steps_ask_for_the_force_as_often_as_declared(name):
    lines = body(unroll(METHODS[name], hooks={"drag": ()}))
    asked = ("acceleration(", "force(", "exact_flow(", "series(", "jacobian(")
    assert sum(any(call in line for call in asked) for line in lines) == METHODS[name].evaluations


@pytest.mark.parametrize("name", METHODS)
def test_the_docstring_names_the_method_and_its_source(name):
    source = unroll(METHODS[name])
    functions = {f.name: f for f in ast.parse(source).body if isinstance(f, ast.FunctionDef)}
    assert ast.get_docstring(functions["step"]) == f"{name}: {METHODS[name].source}"
    assert bool(functions.keys() & {"solve_stage", "solve_stages"}) == METHODS[name].implicit


def test_verlet_reads_as_in_a_textbook():
    assert body(unroll(VERLET)) == [
        "v = v + 0.5*h*a",
        "q = q + h*v",
        "a = force(t + h, q)",
        "v = v + 0.5*h*a",
        "return q, v, a",
    ]


def test_zeros_of_the_table_are_left_out():
    lines = body(unroll(METHODS["rk4"]))
    assert "v3 = v + h*(0.5*a2)" in lines
    assert "a3 = acceleration(t + 0.5*h, q + h*(0.5*v2), v3)" in lines
    assert body(unroll(METHODS["midpoint"]))[-1] == "return q + h*v2, v + h*a2"


def test_negative_coefficients_are_subtracted():
    kutta3 = RungeKutta(
        name="kutta3",
        order=3,
        source="Kutta 1901",
        summary="three stages",
        a=(exact(0, 0, 0), exact("1/2", 0, 0), exact(-1, 2, 0)),
        b=exact("1/6", "2/3", "1/6"),
    )
    assert "v3 = v + h*(-a1 + 2.0*a2)" in body(unroll(kutta3))
    mirrored = replace(kutta3, a=(exact(0, 0, 0), exact("1/2", 0, 0), exact(2, -1, 0)))
    assert "v3 = v + h*(2.0*a1 - a2)" in body(unroll(mirrored))


def test_coefficients_are_written_by_whom_the_caller_names():
    source = unroll(METHODS["heun"], number=lambda value: f"c_{value.numerator}_{value.denominator}")
    assert body(source)[-1] == "return q + h*(c_1_2*v1 + c_1_2*v2), v + h*(c_1_2*a1 + c_1_2*a2)"


def test_extra_arguments_are_handed_through_everywhere():
    source = unroll(VERLET, extra=("u", "p"), hooks={"drag": ()})
    assert "def step(t, q, v, a, h, u, p):" in source
    assert all("u, p)" in line for line in body(source) if "(" in line)
    implicit = unroll(METHODS["implicit_midpoint"], extra=("u",))
    assert implicit.count("acceleration(") == implicit.count(", u)\n") - implicit.count("jacobian(") - 1


def test_quadratures_ride_along_in_runge_kutta_steps():
    """On q'' = 0 from q = 0 with v = 1, Simpson's weights give the integrals of t**3 and q**3 exactly."""
    source = unroll(METHODS["rk4"], quadratures=("first", "second"), extra=("s",))
    step = step_of(source, rates=lambda t, q, v, s: (0.0, s * t**3, q**3))
    assert step(0.0, 0.0, 1.0, 1.0, 2.0) == pytest.approx((1.0, 1.0, 0.5, 0.25), abs=1e-15)


def test_quadratures_ride_along_in_implicit_steps():
    def acceleration(t, q, v):
        return -q

    source = unroll(METHODS["implicit_midpoint"], quadratures=("power",))
    step = step_of(
        source,
        acceleration=acceleration,
        rates=lambda t, q, v: (-q, -q * v),
        jacobian=lambda t, q, v: (-1.0, 0.0),
        NAN=float("nan"),
    )
    q, v, work = step(0.0, 1.0, 0.5, 0.1)
    assert work == pytest.approx((v * v - 0.25) / 2, abs=4e-16), "exact for quadratic energies"
    assert work == pytest.approx((1.0 - q * q) / 2, abs=4e-16)


def test_quadratures_of_splittings_add_up_over_sub_flows():
    source = unroll(VERLET, quadratures=("work", "heat"), hooks={"kick": ("work",), "drag": ("heat",)})

    def kick(t, q, v, a, h):
        after = v + h * a
        return after, (after * after - v * v) / 2

    def drag(t, q, v, h):
        return v / 2, v * v / 2 - v * v / 8

    step = step_of(source, force=lambda t, q: -q, kick=kick, drag=drag)
    _, v, _, work, heat = step(0.0, 1.0, 2.0, -1.0, 0.1)
    assert work - heat == pytest.approx((v * v - 4.0) / 2, abs=1e-15)
    assert heat > 0.0


def test_drag_flows_are_left_out_where_there_is_no_drag():
    assert "drag" not in unroll(VERLET)
    assert unroll(VERLET, hooks={"drag": ()}).count("drag(") == 2


def splitting(*flows: tuple[str, Fraction]) -> Splitting:
    return Splitting(name="made_up", order=1, source="none", summary="none", flows=flows)


def test_kicks_at_one_place_share_their_force():
    method = splitting((DRIFT, ONE), (KICK, HALF), (DRAG, ONE), (KICK, HALF))
    source = unroll(method, hooks={"drag": ()})
    assert source.count("force(") == method.evaluations == 1


def test_a_kick_after_a_push_asks_for_its_own_force():
    method = splitting((PUSH, HALF), (KICK, HALF), (DRIFT, ONE), (DRAG, HALF))
    source = unroll(method, hooks={"drag": ()})
    assert source.count("force(") == source.count("acceleration(") == 1
    assert method.evaluations == 2


def test_times_follow_the_drifts():
    method = splitting((DRIFT, HALF), (KICK, HALF), (DRIFT, HALF), (KICK, HALF), (DRAG, ONE))
    lines = body(unroll(method, hooks={"drag": ()}))
    assert [line for line in lines if "(" in line] == [
        "a = force(t + 0.5*h, q)",
        "a = force(t + h, q)",
        "v = drag(t + h, q, v, h)",
    ]


def test_missing_hooks_and_unknown_kinds_are_refused():
    with pytest.raises(MethodError, match="velocity_verlet: no sub-flow integrates work; a function for"):
        unroll(VERLET, quadratures=("work", "heat"), hooks={"drag": ("heat",)})
    with pytest.raises(MethodError, match="Methods of the class Method do not define write_step"):
        unroll(Method(name="bare", order=1, source="none", summary="none"))
