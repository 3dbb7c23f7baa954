"""Tests of events: times of sign changes against closed forms, SciPy and 40-digit arithmetic."""

from __future__ import annotations

import math
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import integrators
from integrators import Event, MethodError, solve
from integrators.solving.events import PARTS


def oscillator(t: Any, q: Any, v: Any) -> Any:
    return -q


def pendulum(t: Any, q: Any, v: Any) -> Any:
    return -math.sin(q)


def velocity(t: Any, q: Any, v: Any) -> Any:
    return v


def position(t: Any, q: Any, v: Any) -> Any:
    return q


def at(*places: float) -> Any:
    """Return an event function with zeros at some times."""
    return lambda t, q, v: math.prod(t - place for place in places)


def test_turning_points_of_the_oscillator_to_rounding() -> None:
    found = solve(oscillator, 1.0, 0.0, [0.0, 12.0], method="dop853", h=0.05, events=velocity)
    assert found.t_events[0] == pytest.approx([math.pi, 2 * math.pi, 3 * math.pi], abs=1e-13)
    assert found.q_events[0] == pytest.approx([-1.0, 1.0, -1.0], abs=1e-13)
    assert abs(found.v_events[0]).max() < 1e-15


def test_the_period_of_the_pendulum_is_the_elliptic_integral() -> None:
    """T = 4 K(sin²(angle/2)) (Landau & Lifshitz, Mechanics, section 11)."""
    for angle in (0.1, 1.0, 2.0, 3.0):
        period = 4.0 * float(mpmath.ellipk(mpmath.sin(mpmath.mpf(angle) / 2) ** 2))
        found = solve(pendulum, angle, 0.0, [0.0, 1.1 * period], method="dop853", h=0.01, events=velocity)
        assert found.t_events[0] == pytest.approx([period / 2, period], rel=1e-13)


@pytest.mark.slow
def test_forty_digits() -> None:
    with mpmath.workdps(40):
        start, end = mpmath.mpf(0), mpmath.mpf("3.3")
        found = solve(oscillator, mpmath.mpf(1), mpmath.mpf(0), [start, end], method="dop853", h=mpmath.mpf("0.005"),
                      events=velocity)
        assert abs(found.t_events[0][0] - mpmath.pi) < mpmath.mpf("1e-24")
        exact = solve(oscillator, mpmath.mpf(1), mpmath.mpf(0), [start, end], method="rk4", h=mpmath.mpf("0.5"),
                      events=lambda t, q, v: t * t - 2)
        assert abs(exact.t_events[0][0] - mpmath.sqrt(2)) < mpmath.mpf("1e-38")


ORDERS = {"symplectic_euler": 1, "velocity_verlet": 2, "rk4": 4, "gauss4": 4, "dopri5": 5, "bdf4": 4, "forest_ruth": 4}


@pytest.mark.parametrize("method", ORDERS)
def test_times_of_events_have_the_order_of_the_method(method: str) -> None:
    half = 2.0 * float(mpmath.ellipk(mpmath.sin(mpmath.mpf("0.5")) ** 2))
    errors = []
    for h in (0.1, 0.05, 0.025):
        end = solve(pendulum, 1.0, 0.0, [0.0, 4.0], method=method, h=h, events=velocity)
        errors.append(abs(end.t_events[0][0] - half))
    assert math.log2(errors[0] / errors[2]) / 2 > min(ORDERS[method], integrators.get(method).dense_order) - 0.35


@pytest.mark.parametrize("tolerance", [1e-4, 1e-11])
def test_events_are_those_of_scipy(tolerance: float) -> None:
    """Directions and counts, on a damped pendulum."""

    def bottom(t: float, y: Any) -> Any:
        return y[0]

    bottom.direction, bottom.terminal = -1, 3  # type: ignore[attr-defined]
    peers = [bottom, lambda t, y: y[1], lambda t, y: math.cos(3.0 * t) + 0.2 * y[0]]
    truth = solve_ivp(lambda t, y: (y[1], -math.sin(y[0]) - 0.1 * y[1]), (0.0, 50.0), [2.5, 0.1], method="DOP853",
                      rtol=3e-14, atol=1e-15, events=peers)
    ours: list[Any] = [Event(position, direction=-1, terminal=3), velocity,
                       lambda t, q, v: math.cos(3.0 * t) + 0.2 * q]
    found = solve(lambda t, q, v: -math.sin(q) - 0.1 * v, 2.5, 0.1, [0.0, 50.0], method="dop853", rtol=tolerance,
                  events=ours)
    assert found.ended_by == 0
    assert found.t[-1] == found.t_events[0][-1]
    for mine, other in zip(found.t_events, truth.t_events, strict=True):
        assert len(mine) == len(other)
        assert mine == pytest.approx(other, abs=100 * tolerance)


def test_a_function_may_carry_direction_and_count_as_scipy_reads_them() -> None:
    def rising(t: Any, q: Any, v: Any) -> Any:
        return q

    rising.direction, rising.terminal = 1.0, 2  # type: ignore[attr-defined]
    found = solve(oscillator, 1.0, 0.0, [0.0, 1.0, 100.0], method="dop853", h=0.1, events=rising, dense=True)
    assert found.t_events[0] == pytest.approx([1.5 * math.pi, 3.5 * math.pi], abs=1e-11)
    assert found.t.tolist() == [0.0, 1.0, found.t_events[0][1]]
    assert found.steps == len(found.dense.curves) - 1  # type: ignore[union-attr]
    assert found(found.t[-1])[0] == found.q[-1]
    with pytest.raises(MethodError, match="not between this solution's first and last time"):
        found(found.t[-1] + 0.01)


def test_backwards_in_time_the_direction_is_that_of_the_march() -> None:
    found = solve(oscillator, 1.0, 0.0, [0.0, -7.0], method="dop853", h=0.05,
                  events=[Event(position, direction=-1), velocity])
    assert found.t_events[0] == pytest.approx([-0.5 * math.pi], abs=1e-12)
    assert found.t_events[1] == pytest.approx([-math.pi, -2.0 * math.pi], abs=1e-12)


@pytest.mark.parametrize("step", [0.1, 0.25, 1.0])
def test_zeros_at_ends_of_steps_are_found_once(step: float) -> None:
    """Zeros at 0, where the solution begins, and at its last time, after which no sign follows, are no changes."""
    found = solve(oscillator, 1.0, 0.0, [0.0, 4.0], method="rk4", h=step,
                  events=[at(1.0), at(0.0, 2.0), at(4.0), lambda t, q, v: math.sin(math.pi * t / step)])
    assert [each.tolist() for each in found.t_events[:3]] == [[1.0], [2.0], []]
    assert found.t_events[3] == pytest.approx(step * np.arange(1, round(4.0 / step)), abs=1e-12)


def test_no_two_changes_further_apart_than_a_part_of_a_step_are_missed() -> None:
    """Of closer ones both or none are found, and nearly always both."""
    draws, near = np.random.default_rng(4), []
    for _ in range(60):
        first = draws.uniform(0.0, 2.8)
        for share in (draws.uniform(1.0, 8.0), 10.0 ** draws.uniform(-5.0, 0.0)):
            second = first + 0.2 * share / PARTS
            found = solve(oscillator, 1.0, 0.0, [0.0, 4.4], method="rk4", h=0.2, events=at(first, second)).t_events[0]
            if share > 1.0:
                assert found == pytest.approx([first, second], abs=1e-14)
            else:
                assert len(found) in (0, 2)
                near.append(len(found) == 2)
    print(f"\n{sum(near)} of {len(near)} pairs closer than an eighth of a step are found")
    assert sum(near) > 0.75 * len(near)


def test_arrays_and_several_steps_in_one_function() -> None:
    found = solve(lambda t, q, v: -np.array([1.0, 4.0]) * q, np.array([1.0, 1.0]), np.zeros(2), [0.0, 3.5],
                  method="dop853", h=0.05, events=[lambda t, q, v: q[1], lambda t, q, v: q[0] - q[1]])
    assert found.t_events[0] == pytest.approx([math.pi / 4, 3 * math.pi / 4], abs=1e-12)
    assert found.q_events[0].shape == (2, 2)
    assert found.t_events[1] == pytest.approx([2 * math.pi / 3], abs=1e-12)
    assert solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="rk4", h=0.1, events=velocity).t_events[0].shape == (0,)


def test_events_do_not_change_the_solution() -> None:
    for method in ("rk4", "velocity_verlet", "bdf4"):
        plain = solve(oscillator, 1.0, 0.0, [0.0, 1.0, 2.5], method=method, h=0.1)
        watched = solve(oscillator, 1.0, 0.0, [0.0, 1.0, 2.5], method=method, h=0.1, events=position)
        assert (plain.q.tolist(), plain.v.tolist(), plain.steps) == (
            watched.q.tolist(), watched.v.tolist(), watched.steps)
        assert plain.t_events == ()
        assert watched.dense is None


@pytest.mark.parametrize(("events", "said"), [
    (lambda t, q, v: math.nan, r"Event <lambda> must return one finite real number, not nan, its value at t = 0"),
    (lambda t, q, v: np.array([q, v]), "must return one finite real number"),
    (lambda t, q, v: None, "must return one finite real number, not None"),
    ("bottom", "events must be functions g"),
    (3, "events must be functions g"),
    ([velocity, 3], r"An event must be a function g\(t, q, v\) or an Event of one, not 3"),
    (Event(velocity, direction="up"), "The direction of event velocity must be a number"),  # type: ignore[arg-type]
    (Event(velocity, terminal=-1), "terminal of event velocity must be True, False or the number"),
    (Event(velocity, terminal=0.5), "terminal of event velocity must be"),  # type: ignore[arg-type]
])
def test_bad_events_are_refused_in_a_sentence(events: Any, said: str) -> None:
    with pytest.raises(MethodError, match=said):
        solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="rk4", h=0.1, events=events)


def test_an_event_that_fails_and_one_that_ends_by_numpys_true() -> None:
    with pytest.raises(MethodError, match=r"Event <lambda> fails at t = 0.0125: division by zero"):
        solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="rk4", h=0.1, events=lambda t, q, v: 1 / 0)
    with pytest.raises(MethodError, match=r"Event <lambda> fails at t = 0\.0125: 'float'"):
        solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="rk4", h=0.1, events=lambda t, q, v: t[0])
    for last in (np.True_, np.int64(1)):
        found = solve(oscillator, 1.0, 0.0, [0.0, 3.0], method="dop853", rtol=1e-12, events=Event(velocity, 0, last))
        assert found.ended_by is None  # v = -sin(t) begins at zero and changes its sign at pi only
        found = solve(oscillator, 0.0, 1.0, [0.0, 3.0], method="dop853", rtol=1e-12, events=Event(velocity, 0, last))
        assert found.t[-1] == pytest.approx(math.pi / 2, abs=1e-11)


def test_events_are_refused_with_compensated_sums() -> None:
    with pytest.raises(MethodError, match="events and compensated=True cannot be combined"):
        solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="rk4", h=0.1, events=velocity, compensated=True)


@pytest.mark.parametrize("shift", [0.0, 0.25])
def test_two_zeros_in_the_middle_between_equal_values_are_found(shift: float) -> None:
    """The function dips below zero between two times at which it has the same value, in a part of a long step.

    Its zeros are at 3/16 + shift -+ 0.01; steps of 1 are looked at in equal parts, the ends of which are symmetric to
    the middle of the dip. Zeros of a function of time alone do not depend on the solution.
    """
    middle = 0.1875 + shift
    found = solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="rk4", h=1.0,
                  events=lambda t, q, v: (t - middle) ** 2 - 1e-4)
    assert found.t_events[0] == pytest.approx([middle - 0.01, middle + 0.01], abs=1e-12)


def test_a_pair_of_changes_is_found_if_the_search_hits_one_of_them():
    """Between samples at 3/8, 4/8 and 5/8 of the step, the second trial is at 15/32, where this polynomial is 0."""
    def g(t, q, v):
        return (t - 15 / 32) * (t - 7 / 16) * (11 - 16 * t)

    found = solve(lambda t, q, v: 0.0, 0.0, 0.0, [0.0, 1.0], method="rk4", h=1.0, events=g)
    assert found.t_events[0] == pytest.approx([7 / 16, 15 / 32, 11 / 16], abs=1e-15)
    touching = solve(lambda t, q, v: 0.0, 0.0, 0.0, [0.0, 1.0], method="rk4", h=1.0,
                     events=lambda t, q, v: (t - 15 / 32) ** 2)
    assert len(touching.t_events[0]) == 0
