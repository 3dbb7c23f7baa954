"""Tables of one's own: coefficients may be text, and a declared order that the coefficients do not have is refused."""

from __future__ import annotations

import math
import random
from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from choice import EVERYWHERE

import integrators
import pendulum_env
from integrators import MethodError
from integrators.families.adams import Adams
from integrators.families.nystrom import Nystrom
from integrators.families.runge_kutta import Embedded, RungeKutta
from integrators.families.splitting import Splitting
from integrators.method import exact, polynomial_at, total

WORDS: dict[str, Any] = {"source": "a student", "summary": "a table of one's own"}
HEUN = {"a": (("0", "0"), ("1", "0")), "b": ("1/2", "1/2")}
"""Heun's table as text; its order is 2."""
NYSTROM = {"c": ("0", "1"), "a": (("0", "0"), ("1/2", "0")), "bbar": ("1/2", "0"), "b": ("1/2", "1/2"),
           "av": (("0", "0"), ("1", "0"))}


def solved(method: integrators.Method) -> float:
    return float(integrators.solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 1.0], method=method, h=0.01).q[-1])


@pytest.mark.parametrize("table", [
    HEUN, {"a": [[0, 0], [1, 0]], "b": [0.5, 0.5]},
    {"a": np.array([[0.0, 0.0], [1.0, 0.0]]), "b": np.array([0.5, 0.5])},
], ids=["text", "lists", "arrays"])
def test_coefficients_are_text_numbers_or_arrays(table: Any) -> None:
    method = RungeKutta(name="mine", order=2, **WORDS, **table)
    assert method.b == (Fraction(1, 2), Fraction(1, 2))
    assert method.c == (0, 1)
    assert abs(solved(method) - math.cos(1.0)) < 1e-4


def test_every_family_takes_text() -> None:
    adams = replace(integrators.get("ab2"), name="mine", b=("3/2", "-1/2"))
    assert isinstance(adams, Adams)
    assert adams.b == (Fraction(3, 2), Fraction(-1, 2))
    splitting = Splitting(name="mine", order=2, flows=(("kick", "0.5"), ("drift", 1), ("drag", 1), ("kick", "1/2")),
                          **WORDS)
    assert splitting.flows[0] == ("kick", Fraction(1, 2))
    nystrom = Nystrom(name="mine", order=2, **WORDS, **NYSTROM)
    assert nystrom.bbar == (Fraction(1, 2), 0)
    for method in (adams, splitting, nystrom):
        assert abs(solved(method) - math.cos(1.0)) < 1e-4


def test_weights_that_are_rounded_floats_sum_to_one() -> None:
    own = RungeKutta(name="mine", order=4, b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
                     a=((0, 0, 0, 0), (0.5, 0, 0, 0), (0, 0.5, 0, 0), (0, 0, 1.0, 0)), **WORDS)
    assert own.b == integrators.get("rk4").b


def test_what_is_no_table_or_no_order_is_refused_in_a_sentence() -> None:
    with pytest.raises(MethodError, match="mine: a must be rows of numbers, and b a row of numbers, as in a="):
        RungeKutta(name="mine", order=1, a="1/2", b="1", **WORDS)
    with pytest.raises(MethodError, match="mine: a must be rows of numbers, and b a row of numbers, as in a="):
        RungeKutta(name="mine", order=1, a=((0, ()), (1, 0)), b=(0, 1), **WORDS)
    for order in ("2", 0, 2.5, None, True, float("nan")):
        with pytest.raises(MethodError, match=r"mine: order must be a whole number of at least 1, or math\.inf, not "):
            RungeKutta(name="mine", order=order, a=((0,),), b=(1,), **WORDS)


@pytest.mark.parametrize("value", ["half", None, float("nan"), "1/0", {}])
def test_what_is_no_number_is_named(value: Any) -> None:
    with pytest.raises(MethodError, match=r"mine: a\[1\]\[0\] must be a number, not .*'1/2' or '0.25'"):
        RungeKutta(name="mine", order=2, a=((0, 0), (value, 0)), b=("1/2", "1/2"), **WORDS)
    with pytest.raises(MethodError, match="must be a number"):
        exact("1/2", value)


def test_a_wrong_order_is_refused_where_a_method_is_used() -> None:
    method = RungeKutta(name="mine", order=3, **WORDS, **HEUN)
    sentence = r"mine: the coefficients have order 2, not 3 as declared: a condition of order 3 is off by 0\.17"
    with pytest.raises(MethodError, match=sentence):
        solved(method)
    with pytest.raises(MethodError, match=sentence):
        pendulum_env.rollout("exercise", integrator=method, duration=0.1)
    assert abs(solved(replace(method, order=2)) - math.cos(1.0)) < 1e-4
    assert solved(replace(method, order=1)), "an order that is too low is no contradiction"


CLAIMS = {
    "an exchanged digit": (lambda: replace(
        integrators.get("rk4"), name="mine", a=((0, 0, 0, 0), ("1/2", 0, 0, 0), (0, "0.51", 0, 0), (0, 0, 1, 0))), 1),
    "embedded weights": (lambda: RungeKutta(
        name="mine", order=2, embedded=(Embedded(2, ("1", "0")),), **WORDS, **HEUN), 1),
    "dense output": (lambda: replace(
        integrators.get("dopri5"), name="mine", dense=replace(integrators.get("dopri5").dense, order=5)), 4),
    "a Nystrom table": (lambda: Nystrom(name="mine", order=3, **WORDS, **NYSTROM), 2),
    "a splitting": (lambda: replace(integrators.get("velocity_verlet"), name="mine", order=4), 2),
    "kicks with a gradient": (lambda: replace(integrators.get("chin4a"), name="mine", order=6), 4),
    "kicks with a wrong gradient": (lambda: replace(
        integrators.get("chin4a"), name="mine",
        flows=tuple((kind, share, 2 * c) for kind, share, c in integrators.get("chin4a").flows)), 2),
    "a mean force": (lambda: replace(integrators.get("discrete_gradient"), name="mine", order=3), 2),
    "a multistep formula": (lambda: replace(integrators.get("ab3"), name="mine", order=4), 3),
}


@pytest.mark.parametrize("claim", CLAIMS)
def test_claims_of_every_kind_of_coefficients_are_checked(claim: str) -> None:
    make, order = CLAIMS[claim]
    with pytest.raises(MethodError, match=f"(have|has) order {order}, not "):
        solved(make())


@pytest.mark.parametrize("name", ["velocity_verlet", "chin4a", "taylor", "rk4", "dprkn4", "ab2", "bdf2", "stoermer4"])
@pytest.mark.parametrize("order", [0, 2.5, "two", None, True])
def test_an_order_is_a_whole_number(name: str, order: object) -> None:
    with pytest.raises(MethodError, match="order"):
        replace(integrators.get(name), name="mine", order=order)


@pytest.mark.parametrize("names", [
    pytest.param(EVERYWHERE, id="everywhere"),
    pytest.param(frozenset(integrators.METHODS), id="all", marks=pytest.mark.slow)])
def test_copies_of_methods_pass(names: Iterable[str]) -> None:
    for method in map(integrators.get, names):
        copy = replace(method, name=f"{method.name}_copy")
        assert integrators.solving.solve.accepted(copy) is copy


def test_sums_and_polynomials_are_exact() -> None:
    """As Python's own fractions compute them, one operation after the other."""
    r = random.Random(5)
    for count in range(9):
        row = tuple(Fraction(r.randint(-10**9, 10**9), r.choice((1, 7, 10**20, r.randint(1, 10**6))))
                    for _ in range(count))
        assert total(iter(row)) == sum(row)
        for x in (Fraction(0), Fraction(1), Fraction(-3, 7), Fraction(r.randint(-99, 99), 10**12)):
            assert polynomial_at(row, x) == sum(c * x**k for k, c in enumerate(row))
