"""One contract for ``solve``: every method, every kind of number, every way to ask, each against a closed form.

Features are tested here where they meet: fixed steps and steps under a tolerance, in floats, lists, arrays, arrays of
one component, mpmath numbers, and with an acceleration that reuses its own array; plain, dense, with events, backwards,
far from t = 0, at times read off, with the other options, and with an action. What a method refuses is said by
:func:`refusal`, with a part of its sentence.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import mpmath
import numpy as np
import pytest
from choice import shared_out

import integrators
from integrators import METHODS, Event, Method, MethodError, System, solve
from integrators.families.taylor import cos
from integrators.steps.estimates import has_estimates

SPAN = 3.0
"""Length of a run; the slowest of its two rates is 1/2, the fastest 1."""
FAR = 1e9
"""A start so late that double precision rounds times to 1.2e-7."""
ROUNDED = 1.2e-7
"""The distance of two doubles near FAR: an event's time is one of them, and its state differs by as much."""
RTOL, RTOL_LONG = 1e-8, 1e-6
"""Tolerances, and those in mpmath numbers, whose steps take long."""
SHORT, LONG = 0.06, 0.24
"""Fixed steps, and those in mpmath numbers."""


@dataclass(frozen=True)
class Motion:
    """Closed form ``q = A cos(s) + B sin(s) + F cos(s/2)``, ``s = t - start``, of ``q'' = -q + 3/4 F cos(s/2)``.

    It is the exact motion from any of its states, forwards and backwards.
    """

    start: float = 0.0
    cosine: float = 0.5
    sine: float = 0.3
    drive: float = 1.0

    def acceleration(self, t: Any, q: Any, v: Any) -> Any:
        return -q + 0.75 * self.drive * cos((t - self.start) / 2) if self.drive else -q

    def at(self, t: Any, m: Any = np) -> tuple[Any, Any]:
        """Return q and v at a time, or at an array of times; ``m`` has the functions cos and sin."""
        s = t - self.start
        c, w = m.cos(s), m.sin(s)
        return (self.cosine * c + self.sine * w + self.drive * m.cos(s / 2),
                self.sine * c - self.cosine * w - self.drive * m.sin(s / 2) / 2)

    def flow(self, t: Any, q: Any, v: Any, h: Any, m: Any) -> tuple[Any, Any]:
        """Return the exact state after the time h."""
        p, r = (self.drive * f((t - self.start) / 2) for f in (m.cos, m.sin))
        end, rate = (self.drive * f((t + h - self.start) / 2) for f in (m.cos, m.sin))
        x, w = q - p, v + r / 2
        return end + x * m.cos(h) + w * m.sin(h), w * m.cos(h) - x * m.sin(h) - rate / 2

    def zero(self) -> float:
        """Return the first time after the start at which q is 0."""
        return float(mpmath.findroot(lambda s: self.at(self.start + s, mpmath)[0], 2.0))


NEAR = Motion()
LATE = Motion(FAR, drive=0.0)


@dataclass(frozen=True)
class Kind:
    """A kind of numbers and of functions: how a state is given, and how its first number is read.

    Attributes:
        given: makes a state of a number.
        problem: makes the acceleration or System of a motion.
        number: makes a time, a step or a tolerance of a float.
        m: module with the functions cos and sin of the kind's numbers.
    """

    given: Callable[[float], Any]
    problem: Callable[[Motion], Any]
    number: Callable[[float], Any] = float
    m: Any = np


def reusing(motion: Motion) -> Any:
    """Return the acceleration of a motion that writes each result into the same array."""
    buffer = np.zeros(2)

    def acceleration(t: Any, q: Any, v: Any) -> Any:
        buffer[:] = motion.acceleration(t, q, v)
        return buffer

    return acceleration


def listing(motion: Motion) -> Any:
    """Return the acceleration of a motion as a list."""
    return lambda t, q, v: [motion.acceleration(t, q[0], v[0]), motion.acceleration(t, q[1], v[1])]


def plain(motion: Motion) -> Any:
    return motion.acceleration


KINDS = {
    "float": Kind(float, plain, m=math),
    "list": Kind(lambda x: [x, x], listing),
    "array": Kind(lambda x: np.array([[x, x], [x, x]]), plain),
    "one": Kind(lambda x: np.array([x]), plain),
    "reused": Kind(lambda x: np.array([x, x]), reusing),
    "mpmath": Kind(mpmath.mpf, plain, mpmath.mpf, mpmath),
    "complex": Kind(complex, plain, m=math),
}
MODES = ("plain", "dense", "events", "backwards", "far", "t_eval", "options", "action")


def problem(method: Method, kind: Kind, motion: Motion) -> Any:
    """Return what solve integrates: a bare function, or for a closed form the System that has it."""
    function = kind.problem(motion)
    if "exact_flow" not in method.needs:
        return function
    return System(function, velocity_free=True, exact_flow=lambda t, q, v, h: motion.flow(t, q, v, h, kind.m))


def reflected(motion: Motion, t: float) -> tuple[Any, Any]:
    """Return the state of a motion whose velocity is reversed where q becomes zero."""
    zero = motion.start + motion.zero()
    return motion.at(t) if t <= zero else motion.flow(zero, 0.0, -motion.at(zero)[1], t - zero, math)


def taking_more(function: Any) -> Any:
    """Return a function, or a System of functions, that takes two further arguments."""
    if isinstance(function, System):
        flow = function.exact_flow
        return replace(function, acceleration=taking_more(function.acceleration),
                       exact_flow=None if flow is None else lambda t, q, v, h, factor, unused: flow(t, q, v, h))
    return lambda t, q, v, factor, unused: function(t, q, v)


def refusal(method: Method, kind: str, rtol: bool) -> str:
    """Return a part of the sentence by which a method refuses a kind of numbers or a tolerance; "" for none."""
    if kind == "complex":
        return "q must be real"
    if kind == "reused" and "taylor" in method.needs:
        return "Taylor series need an acceleration that uses only"  # recorded numbers do not go into an array
    return f"{method.name} does not estimate its error" if rtol and not has_estimates(method) else ""


def first(value: Any) -> Any:
    """Return the first number of each state, for states of one motion in all components."""
    array = np.asarray(value)
    assert not np.any(array.reshape(len(array), -1) != array.reshape(len(array), -1)[:, :1])
    return array.reshape(len(array), -1)[:, 0]


def largest(found: tuple[Any, Any], truth: tuple[Any, Any]) -> float:
    return max(float(np.max(np.abs(np.asarray(x, dtype=float) - np.asarray(y, dtype=float))))
               for x, y in zip(found, truth, strict=True))


def errors(name: str, kind_name: str, rtol: bool, mode: str) -> tuple[float, float]:
    """Return the largest error at the times asked for, and that of dense output, or of events, between them."""
    method, kind = integrators.get(name), KINDS[kind_name]
    motion = LATE if mode == "far" else NEAR
    h = LONG if kind_name == "mpmath" else SHORT
    tolerance = RTOL_LONG if kind_name == "mpmath" else RTOL
    options: dict[str, Any] = {"rtol": kind.number(tolerance)} if rtol else {"h": kind.number(h)}
    times = [kind.number(motion.start + SPAN * k / 6) for k in range(7)]
    if mode == "backwards":
        times.reverse()
    state = motion.at(times[0], mpmath if kind_name == "mpmath" else math)
    asked = times
    if mode == "t_eval":
        asked, times = times, [times[0], times[-1]]
        options["t_eval"] = asked
    function = problem(method, kind, motion)
    if mode == "options":
        options["args"] = (1.0, "unused")
        function = taking_more(function)
        options |= {"atol": [kind.given(tolerance), kind.given(2 * tolerance)], "first_step": kind.number(0.02),
                    "max_step": kind.number(0.5)} if rtol else {}
    options |= {"dense": mode in ("dense", "far")} | ({"events": lambda t, q, v: np.ravel(q)[0]} if mode in (
        "events", "far") else {"events": Event(lambda t, q, v: np.ravel(q)[0], action=lambda t, q, v: (q, -v))}
        if mode == "action" else {})
    run = solve(function, *(kind.given(x) for x in state), times, method=method, **options)
    assert [*run.t] == [*asked]
    truth = [reflected(motion, float(t)) if mode == "action" else motion.at(float(t)) for t in asked]
    at_times = largest((first(run.q), first(run.v)), tuple(zip(*truth, strict=True)))
    between = 0.0
    if mode in ("dense", "far"):
        places = motion.start + SPAN * (np.arange(40) + 0.37) / 40.4
        found = run(places if kind_name != "mpmath" else np.array([mpmath.mpf(t) for t in places], dtype=object))
        between = largest(tuple(map(first, found)), motion.at(places))
    if mode in ("events", "far", "action"):
        (at,), *states = run.t_events, first(run.q_events[0]), first(run.v_events[0])
        after, rounding = motion.zero(), ROUNDED if mode == "far" else 0.0
        there = motion.at(motion.start + after) if mode != "far" else replace(motion, start=0.0).at(after)
        assert len(at) == 1
        between = max(between, abs(float(at[0]) - motion.start - after) - rounding,
                      largest(tuple(states), tuple([x] for x in there)) - rounding)
    return at_times, between


def faults(name: str, kind: str) -> list[str]:
    """Return what is wrong with the runs of a method in one kind of numbers; a line for each run."""
    method, found = integrators.get(name), []
    for rtol, mode in product((False, True), MODES):
        case, said = f"{'rtol' if rtol else 'fixed'}, {mode}", refusal(method, kind, rtol)
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
        found += [] if between < allowed + more else [
            f"{case}: errs by {between:.2g} between the times, more than {allowed + more:.2g}"]
    return found


FAMILIES = {(type(method).__name__, method.implicit, has_estimates(method), method.dense is None): name
            for name, method in reversed(METHODS.items())}
"""The first method of each family, of its implicit and explicit ones, with and without estimates and polynomials."""


def is_simple(family: tuple[Any, ...]) -> bool:
    """Whether a family is explicit and without estimates; others run in few kinds of numbers in quick tests."""
    return not family[1] and not family[2]


@pytest.mark.parametrize(("family", "kind"), [
    pytest.param(family, kind, id="-".join(map(str, (*family, kind))), marks=() if kind == "float" or (
        is_simple(family) and kind in ("complex", "mpmath")) else pytest.mark.slow)
    for family in FAMILIES for kind in KINDS if kind != "array"])
def test_one_method_of_every_family(family: tuple[Any, ...], kind: str) -> None:
    assert faults(FAMILIES[family], kind) == []


@pytest.mark.slow
@pytest.mark.parametrize(("name", "kind"), [
    *((name, "float") for name in METHODS), ("taylor20", "float"),
    *shared_out([*METHODS, "taylor20"], ("array", "mpmath"))])
def test_every_method(name: str, kind: str) -> None:
    """In the other kinds one method of every family, above: a kind is made to numbers before any method sees them."""
    assert faults(name, kind) == []


def damped(reuses: bool) -> Callable[..., Any]:
    """Return the acceleration of ``q'' = -q - v/4``, in an array of its own each time or always in the same one."""
    buffer = np.zeros(2)

    def acceleration(t: Any, q: Any, v: Any) -> Any:
        np.subtract(-q, v / 4, out=buffer)
        return buffer if reuses else buffer.copy()

    return acceleration


@pytest.mark.parametrize("name", [name for name, method in METHODS.items() if "taylor" not in method.needs])
def test_a_reused_array_hides_no_velocity(name: str) -> None:
    """Probes for the velocity and for couplings compare results, which must not be one and the same array."""
    state, rate = (np.array([1.0, 0.5]), np.zeros(2)), math.sqrt(1 - 1 / 64)

    def run(reuses: bool) -> Any:
        try:
            return solve(damped(reuses), *state, [0.0, 1.0, 2.0], method=name, h=SHORT).q
        except MethodError as refused:
            return str(refused)

    found, fresh = run(True), run(False)
    if isinstance(fresh, str):
        assert found == fresh
        assert f"{name} needs" in fresh
        return
    assert found.tolist() == fresh.tolist()
    truth = np.exp(-1 / 4) * (np.cos(2 * rate) + np.sin(2 * rate) / (8 * rate)) * state[0]
    assert found[-1] == pytest.approx(truth, abs=10 * SHORT ** METHODS[name].order + 1e-11)
