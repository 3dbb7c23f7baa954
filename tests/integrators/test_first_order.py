"""Equations of first order, y' = f(t, y): one contract for all methods that treat them, against closed forms and SciPy.

The contract is that of ``solve``: every such method, every kind of number, every way to ask.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import mpmath
import numpy as np
import pytest
from choice import shared_out
from scipy.integrate import solve_ivp

import integrators
from integrators import METHODS, Event, MethodError, System, solve, solve_first_order
from integrators.families.taylor import cos
from integrators.steps.estimates import has_estimates

TREATING = [name for name, method in METHODS.items() if method.first_order_form]
SPAN, RTOL, RTOL_LONG, SHORT, LONG, LEVEL = 3.0, 1e-8, 1e-6, 0.05, 0.2, 0.2


def f(t: Any, y: Any) -> Any:
    """Return the right side of ``y' = cos(t) - y``."""
    return cos(t) - y


def exact(t: Any, start: float = 0.0, y: float = 1.0) -> Any:
    """Return its closed form ``(cos t + sin t)/2 + C exp(-t)``, from y at the time start."""
    def steady(t: Any) -> Any:
        return (np.cos(t) + np.sin(t)) / 2

    return steady(t) + (y - steady(start)) * np.exp(start - t)


CROSSING = float(mpmath.findroot(lambda t: (mpmath.cos(t) + mpmath.sin(t)) / 2 + mpmath.exp(-t) / 2 - LEVEL, 1.9))
"""The time at which y is LEVEL."""


def after_jump(t: Any) -> Any:
    """Return the closed form of a solution that 1 is subtracted from at the crossing."""
    return np.where(t <= CROSSING, exact(t), exact(t, CROSSING, LEVEL - 1.0))


def reusing() -> Any:
    buffer = np.zeros(2)

    def right(t: Any, y: Any) -> Any:
        buffer[:] = f(t, y)
        return buffer

    return right


@dataclass(frozen=True)
class Kind:
    """A kind of numbers and of functions: how a state is given, and a time, a step or a tolerance."""

    given: Callable[[float], Any]
    f: Callable[[], Any] = lambda: f
    number: Callable[[float], Any] = float


KINDS = {
    "float": Kind(float),
    "list": Kind(lambda x: [x, x], lambda: lambda t, y: [f(t, y[0]), f(t, y[1])]),
    "array": Kind(lambda x: np.array([[x, x], [x, x]])),
    "one": Kind(lambda x: np.array([x])),
    "reused": Kind(lambda x: np.array([x, x]), reusing),
    "mpmath": Kind(mpmath.mpf, number=mpmath.mpf),
}
MODES = ("plain", "dense", "events", "backwards", "t_eval", "options", "action")


def first(y: Any) -> Any:
    """Return the first component at each time, for states of one solution in all components."""
    flat = np.asarray(y, dtype=float).reshape(-1, np.shape(y)[-1])
    assert not np.any(flat != flat[:1])
    return flat[0]


def errors(name: str, kind_name: str, rtol: bool, mode: str) -> tuple[float, float]:
    """Return the largest error at the times asked for, and that of dense output, or of events, between them."""
    kind = KINDS[kind_name]
    h, tolerance = (LONG, RTOL_LONG) if kind_name == "mpmath" else (SHORT, RTOL)
    options: dict[str, Any] = {"rtol": kind.number(tolerance)} if rtol else {"h": kind.number(h)}
    times = [kind.number(SPAN * k / 6) for k in range(7)]
    start, asked, right = kind.number(1.0), times, kind.f()
    if mode == "backwards":
        times.reverse()
        start = kind.number(float(exact(SPAN)))
    if mode == "t_eval":
        options["t_eval"], times = asked, [times[0], times[-1]]
    if mode == "options":
        plain = right
        right, options["args"] = (lambda t, y, factor, unused: plain(t, y)), (1.0, "unused")
        options |= {"atol": kind.given(tolerance) if kind_name != "mpmath" else kind.number(tolerance),
                    "first_step": kind.number(0.02), "max_step": kind.number(0.5)} if rtol else {}
    if mode in ("events", "action"):
        options["events"] = Event(lambda t, y: np.ravel(y)[0] - LEVEL, action=(lambda t, y: y - 1) if mode == "action"
                                  else None)
    y = kind.given(1.0) if mode != "backwards" else kind.given(float(start))
    run = solve_first_order(right, times, y, method=name, dense=mode == "dense", **options)
    assert [*run.t] == [*asked]
    assert np.shape(run.y) == (*np.shape(y), len(asked))
    at = np.array([float(t) for t in asked])
    at_times, between = float(np.max(np.abs(first(run.y) - (after_jump if mode == "action" else exact)(at)))), 0.0
    if mode == "dense":
        places = SPAN * (np.arange(40) + 0.37) / 40.4
        there = places if kind_name != "mpmath" else np.array([mpmath.mpf(t) for t in places], dtype=object)
        between = float(np.max(np.abs(first(run(there)) - exact(places))))
        assert np.shape(run(there[0])) == np.shape(y)
    if mode in ("events", "action"):
        (when,) = run.t_events[0]
        between = max(abs(float(when) - CROSSING), abs(float(np.ravel(run.y_events[0])[0]) - LEVEL))
        assert np.shape(run.y_events[0]) == (1, *np.shape(y))
    return at_times, between


def faults(name: str, kind: str) -> list[str]:
    """Return what is wrong with the runs of a method in one kind of numbers; a line for each run."""
    method, found = integrators.get(name), []
    for rtol, mode in product((False, True), MODES):
        case = f"{'rtol' if rtol else 'fixed'}, {mode}"
        said = "Taylor series need" if kind == "reused" and "taylor" in method.needs else (
            f"{name} does not estimate its error" if rtol and not has_estimates(method) else "")
        h, tolerance = (LONG, RTOL_LONG) if kind == "mpmath" else (SHORT, RTOL)
        allowed = 100 * tolerance if rtol else 10 * h ** min(method.order, 20) + 1e-11
        more = 0.0 if rtol else 10 * h ** (min(method.dense_order, 20) + 1)
        allowed += more if mode in ("t_eval", "action") else 0.0
        try:
            at_times, between = errors(name, kind, rtol, mode)
        except MethodError as refused:
            found += [] if said and said in str(refused) else [f"{case}: refused, {refused}"]
            continue
        found += [f"{case}: not refused"] if said else []
        found += [] if at_times < allowed else [f"{case}: errs by {at_times:.2g}, more than {allowed:.2g}"]
        found += [] if between < allowed + more else [f"{case}: errs by {between:.2g} between, more than {allowed:.2g}"]
    return found


FAMILIES = {(type(method).__name__, method.implicit, has_estimates(method), method.dense is None): name
            for name, method in reversed(METHODS.items()) if method.first_order_form}


def is_simple(family: tuple[Any, ...]) -> bool:
    """Whether a family is explicit and without estimates; others run in few kinds of numbers in quick tests."""
    return not family[1] and not family[2]


@pytest.mark.parametrize(("family", "kind"), [
    pytest.param(family, kind, id="-".join(map(str, (*family, kind))), marks=() if kind in ("float", "complex") or (
        is_simple(family) and kind in ("reused", "mpmath")) else pytest.mark.slow)
    for family in FAMILIES for kind in KINDS if kind != "array"])
def test_one_method_of_every_family(family: tuple[Any, ...], kind: str) -> None:
    assert faults(FAMILIES[family], kind) == []


@pytest.mark.parametrize("name", [*TREATING, "taylor20"])
def test_every_method_in_floats(name: str) -> None:
    assert faults(name, "float") == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), shared_out([*TREATING, "taylor20"], ("array", "mpmath")))
def test_every_method(name: str, kind: str) -> None:
    """In the other kinds one method of every family, above: a kind is made to numbers before any method sees them."""
    assert faults(name, kind) == []


@pytest.mark.parametrize("name", [name for name in METHODS if name not in TREATING])
def test_methods_that_need_the_other_form_are_refused_with_some_that_do_not(name: str) -> None:
    with pytest.raises(MethodError, match=rf"{name} is a method for q'' .* does not treat y' = f\(t, y\); rk4, dopri5"):
        solve_first_order(f, [0.0, 1.0], 1.0, method=name, h=0.1)


def test_those_that_are_named_do() -> None:
    with pytest.raises(MethodError) as said:
        solve_first_order(f, [0.0, 1.0], 1.0, method="velocity_verlet", h=0.1)
    named = str(said.value).split("; ")[1].removesuffix(" do.").replace(" and ", ", ").split(", ")
    assert set(named) <= {*TREATING}
    assert {"forward_euler", "rk4", "dop853", "radau5", "ab4", "abm4", "bdf6", "taylor"} <= {*TREATING}
    assert {METHODS[name].family for name in TREATING} == {"Runge-Kutta", "multistep", "Taylor"}


PEERS = {"bs3": "RK23", "dopri5": "RK45", "dop853": "DOP853"}


def swing(t: Any, y: Any) -> Any:
    return [y[1], -math.sin(y[0]) - 0.1 * y[1]]


@pytest.mark.quick("dopri5-1e-08")
@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
@pytest.mark.parametrize("name", PEERS)
def test_it_costs_and_errs_about_as_much_as_scipys_solver(name: str, rtol: float) -> None:
    times = np.linspace(0.0, 20.0, 201)
    found = solve_first_order(swing, [0.0, 20.0], [2.5, 0.3], method=name, rtol=rtol, t_eval=times)
    peer = solve_ivp(swing, (0.0, 20.0), [2.5, 0.3], method=PEERS[name], rtol=rtol, atol=rtol, t_eval=times)
    truth = solve_ivp(swing, (0.0, 20.0), [2.5, 0.3], method="DOP853", rtol=3e-14, atol=1e-15, t_eval=times)
    assert found.y.shape == peer.y.shape == (2, 201)
    assert found.evaluations < 1.1 * peer.nfev
    assert abs(found.y - truth.y).max() < 10 * abs(peer.y - truth.y).max()


@pytest.mark.parametrize("name", TREATING)
def test_a_function_of_q_and_v_as_one_of_y_gives_the_same(name: str) -> None:
    """``y = [q, v]``: for Runge-Kutta methods the very same operations, for all the same up to rounding."""
    one = solve(lambda t, q, v: -q - 0.1 * v, 1.0, 0.5, [0.0, 1.0, 2.0], method=name, h=0.1)
    pair = solve_first_order(lambda t, y: np.stack([y[1], -y[0] - 0.1 * y[1]]) if "taylor" not in name else
                             [y[1], -y[0] - 0.1 * y[1]], [0.0, 1.0, 2.0], [1.0, 0.5], method=name, h=0.1)
    assert pair.y == pytest.approx(np.array([one.q, one.v]), abs=1e-9 if METHODS[name].implicit else 1e-12)


def test_a_stiff_equation_by_its_implicit_methods() -> None:
    """Prothero & Robinson 1974: ``y' = -1e6 (y - cos t) - sin t`` has the solution ``cos t``."""
    for name in ("backward_euler", "trapezoid", "radau5", "bdf4", "sdirk2", "lobatto3c"):
        for y in (1.0, [1.0, 1.0]):
            found = solve_first_order(lambda t, y: -1e6 * (y - np.cos(t)) - np.sin(t), [0.0, 1.0], y, method=name,
                                      h=0.1)
            assert first(found.y)[-1] == pytest.approx(math.cos(1.0), abs=1e-6), name


def test_the_error_of_the_integral_of_y_does_not_count() -> None:
    """Tolerances are those of y alone; the integral of y, which is computed along, may be much larger."""
    found = [solve_first_order(lambda t, y, c: -(y - c) * 1.0, [0.0, 30.0], c + 1.0, method="dop853", rtol=1e-9,
                               atol=1e-9, args=(c,)) for c in (0.0, 1e3)]
    assert found[0].y[-1] == pytest.approx(math.exp(-30.0), abs=1e-8)
    assert found[1].steps <= found[0].steps
    steps = [solve_first_order(lambda t, y, unit: np.cos(t / unit) / unit, [0.0, 20.0 * unit], 0.0, method="dopri5",
                               rtol=1e-6, first_step=0.1 * unit, args=(unit,)).steps for unit in (1.0, 64.0, 1 / 64)]
    assert len({*steps}) == 1  # in any unit of time


def test_exact_numbers_compensated_sums_and_text() -> None:
    with mpmath.workdps(40):
        found = solve_first_order(lambda t, y: -y, [0, mpmath.mpf(1)], mpmath.mpf(1), method="taylor20",
                                  h=mpmath.mpf("0.05"))
        assert abs(found.y[-1] - mpmath.exp(-1)) < 1e-38
    plain, summed = (solve_first_order(lambda t, y: -0.01 * y, [0.0, 10.0], 1.0, method="rk4", h=0.001,
                                       compensated=one) for one in (False, True))
    assert abs(summed.y[-1] - math.exp(-0.1)) < 2e-16 < abs(plain.y[-1] - math.exp(-0.1))
    assert (summed.lost_y.shape, plain.lost_y) == ((2,), None)
    assert repr(plain) == "<FirstOrderSolution: rk4, 2 times from 0 to 10, 10000 steps>"
    assert "0.904837" in plain._repr_html_()
    with pytest.raises(MethodError, match="no dense output; pass dense=True to solve_first_order"):
        plain(1.0)


@pytest.mark.parametrize(("call", "said"), [
    ({"f": 3}, r"The problem must be a function f\(t, y\)"),
    ({"f": System(lambda t, q, v: -q)}, r"The problem must be a function f\(t, y\)"),
    ({"f": lambda t, q, v: -q}, r"f must be a function of \(t, y\), not of \(t, q, v\)"),
    ({"f": lambda t, y: None}, "f must be finite numbers, not None"),
    ({"f": lambda t, y: math.nan}, "f at the start, t = 0.0, must be finite numbers, not nan"),
    ({"f": lambda t, y: 1 / 0}, "f fails at the start, t = 0.0: division by zero"),
    ({"f": lambda t, y: np.ones(3), "y": [1.0, 2.0]}, r"f must have the shape of y, \(2,\), not \(3,\)"),
    ({"f": lambda t, y: y.__imul__(2), "y": np.ones(2)}, "f changes its argument y in place; it must leave y as"),
    ({"y": 1j}, "y must be real"),
    ({"y": math.nan}, "y must be finite numbers, not nan"),
    ({"y": None}, "y must be finite numbers, not None"),
    ({"atol": [1e-6, 1e-6]}, "atol must be a finite number above zero, or an array of them like y, not"),
    ({"events": lambda t, q, v: q}, r"Event <lambda> must be a function of \(t, y\)"),
    ({"events": 3}, r"events must be functions g\(t, y\) or Events"),
    ({"events": Event(lambda t, y: y - 0.9, action=lambda t, y: (y, y))}, "must return the state after it, finite"),
    ({"args": 3}, "args must be a tuple"),
    ({"method": "rk5"}, "There is no integrator 'rk5'"),
])
def test_what_cannot_be_is_refused_in_its_own_words(call: dict[str, Any], said: str) -> None:
    with pytest.raises(MethodError, match=said):
        solve_first_order(**{"f": f, "y": 1.0, "times": [0.0, 1.0], "method": "dop853", "rtol": 1e-6, **call})
