"""Tests of events: times of sign changes against closed forms, SciPy and 40-digit arithmetic."""

from __future__ import annotations

import math
from fractions import Fraction
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


@pytest.mark.slow
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


@pytest.mark.slow
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


def test_events_of_exact_numbers_are_refused() -> None:
    """Fractions would get twice as many digits with every step of the search."""
    with pytest.raises(MethodError, match="exact numbers such as Fractions have none"):
        solve(oscillator, Fraction(1), Fraction(0), [Fraction(0), Fraction(2)], method="rk4", h=Fraction(1, 2),
              events=position)


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


# --- actions --------------------------------------------------------------------------------------------------------

GRAVITY = 9.81


def falling(t: Any, q: Any, v: Any) -> Any:
    return -GRAVITY


def bouncing(share: float, floor: float = 0.0, count: int = 0) -> Event:
    """Return the event that a ball meets the floor, which gives back a share of its speed."""
    return Event(lambda t, q, v: q - floor, direction=-1, terminal=count, action=lambda t, q, v: (q, -share * v))


def bounces(share: float, count: int) -> Any:
    """Return the times of the bounces of a ball that falls from 1 m."""
    first = math.sqrt(2.0 / GRAVITY)
    return first * (1.0 + 2.0 * np.cumsum([0.0, *(share**k for k in range(1, count))]))


WAYS: dict[str, dict[str, float]] = {
    "dop853": {"rtol": 1e-9}, "dopri5": {"rtol": 1e-9}, "taylor": {"rtol": 1e-9}, "dprkn8": {"rtol": 1e-9},
    "rk4": {"h": 0.3}, "ab4": {"h": 0.01}, "gauss4": {"h": 0.5}, "velocity_verlet": {"h": 0.5}}


@pytest.mark.parametrize("method", WAYS)
def test_a_ball_bounces_when_it_should(method: str) -> None:
    """Also where several bounces fall into one step that the tolerance, or h, would allow; with array and dense output.

    Methods of order 2 and more are exact for the parabolas between the bounces.
    """
    found = solve(falling, 1.0, 0.0, [0.0, 3.0, 100.0], method=method, events=bouncing(0.8, count=30), dense=True,
                  **WAYS[method])
    times = bounces(0.8, 30)
    assert found.t_events[0] == pytest.approx(times, abs=1e-11)
    assert found.v_events[0] == pytest.approx(-math.sqrt(2 * GRAVITY) * 0.8 ** np.arange(30), abs=1e-10)
    assert (found.ended_by, found.t[-1]) == (0, found.t_events[0][-1])
    assert abs(found.q_events[0]).max() < 1e-12
    at = np.linspace(0.0, times[-1] - 1e-9, 500)
    since = at - np.concatenate([[-times[0]], times])[(flight := np.searchsorted(times, at))]
    truth = 0.8**flight * math.sqrt(2 * GRAVITY) * since - GRAVITY / 2 * since**2
    assert found(at)[0] == pytest.approx(truth, abs=1e-10)
    k = int(np.searchsorted(times, 3.0))
    assert found.q[1] == pytest.approx(0.8**k * math.sqrt(2 * GRAVITY) * (3.0 - times[k - 1])
                                       - GRAVITY / 2 * (3.0 - times[k - 1]) ** 2, abs=1e-10)
    after = found(found.t_events[0][3])
    assert after[1] == pytest.approx(-0.8 * found.v_events[0][3])  # from the event on, the state after it


@pytest.mark.quick("0.5-0.0", "0.1-1000.0")
@pytest.mark.parametrize("floor", [0.0, 1000.0])
@pytest.mark.parametrize("share", [0.95, 0.5, 0.1, 0.01, 1e-4, 0.0])
def test_a_ball_that_comes_to_rest_ends_with_a_sentence(share: float, floor: float) -> None:
    """It does at ``sqrt(2/g) (1 + share)/(1 - share)``, and it must not fall through the floor."""
    rest = math.sqrt(2.0 / GRAVITY) * (1.0 + share) / (1.0 - share)
    with pytest.raises(MethodError, match=r"Event <lambda> has its action again and again .* comes to rest") as said:
        solve(falling, 1.0 + floor, 0.0, [0.0, 60.0], method="dop853", rtol=1e-8, events=bouncing(share, floor))
    when = float(str(said.value).split("t = ")[1].split(":")[0])
    assert when == pytest.approx(rest, abs=1e-3)


def test_a_ball_that_stays_where_it_lands_is_at_rest_at_once() -> None:
    """Also if it lands a rounding above the floor, from where it would fall again."""
    calls = []
    for height in (0.0, 1e-17, -1e-17):
        event = Event(position, -1, action=lambda t, q, v, height=height: calls.append(t) or (height, 0.0))
        with pytest.raises(MethodError, match="comes to rest"):
            solve(falling, 1.0, 0.0, [0.0, 9.0], method="dop853", rtol=1e-8, events=event)
    assert len(calls) == 3


def test_actions_that_call_for_each_other_end_with_a_sentence() -> None:
    calls = []
    with pytest.raises(MethodError, match=r"has its action again and again at t = 0\.75"):
        solve(lambda t, q, v: 0.0, 0.0, 1.0, [0.0, 2.0], method="rk4", h=0.25, events=[
            Event(lambda t, q, v: q - 0.75, action=lambda t, q, v: (0.0, v)),
            Event(lambda t, q, v: q - 0.5, direction=-1, action=lambda t, q, v: calls.append(t) or (2.0, v))])
    assert len(calls) == 1


@pytest.mark.parametrize("options", [{"method": "rk4", "h": 0.5}, {"method": "dop853", "rtol": 1e-9}])
@pytest.mark.parametrize("early", [0.0, 2.0**-53, 2.0**-52])
def test_a_time_at_which_an_action_happens_shows_the_state_before_it(options: dict[str, Any], early: float) -> None:
    found = solve(lambda t, q, v: 0.0, 0.0, 1.0, [0.0, 1.0, 2.0], events=Event(
        lambda t, q, v: t - (1.0 - early), action=lambda t, q, v: (q, -v)), **options)
    assert found.t.tolist() == [0.0, 1.0, 2.0]
    assert found.q == pytest.approx([0.0, 1.0, 0.0], abs=1e-14)
    assert found.v[-1] == -1.0
    assert found.v[1] == (1.0 if found.t_events[0][0] == 1.0 else -1.0)


def test_a_ball_that_starts_on_the_floor() -> None:
    up = solve(falling, 0.0, 1.0, [0.0, 0.5], method="rk4", h=0.5, events=bouncing(0.9), t_eval=[0.25])
    assert up.t_events[0] == pytest.approx([2 / GRAVITY, 2 * 1.9 / GRAVITY], abs=1e-12)
    with pytest.raises(MethodError, match="comes to rest"):
        solve(falling, 0.0, 0.0, [0.0, 0.5], method="rk4", h=0.1, events=bouncing(0.9))


def test_a_kick_in_passing_and_a_jump_to_another_place() -> None:
    """A function may go on through zero after its action, or be moved away from it."""
    kicked = solve(oscillator, 1.0, 0.0, [0.0, 10.0], method="dop853", rtol=1e-11,
                   events=Event(position, direction=1, action=lambda t, q, v: (q, v + 1.0)))
    assert kicked.t_events[0] == pytest.approx([1.5 * math.pi], abs=1e-9)
    assert kicked.q[-1] == pytest.approx(2.0 * math.sin(10.0 - 1.5 * math.pi), abs=1e-9)
    wrapped = solve(lambda t, q, v: 0.0, 0.0, 1.0, [0.0, 20.0], method="rk4", h=0.7,
                    events=Event(lambda t, q, v: q - math.pi, action=lambda t, q, v: (q - 2 * math.pi, v)))
    assert wrapped.t_events[0] == pytest.approx(math.pi * np.array([1.0, 3.0, 5.0]), abs=1e-13)
    assert wrapped.q[-1] == pytest.approx(20.0 - 6 * math.pi, abs=1e-12)


def test_backwards_arrays_and_two_balls_that_land_together() -> None:
    """A bounce backwards in time undoes one; both balls bounce though their events are at one time."""
    there = solve(falling, 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-10, events=bouncing(0.8))
    back = solve(falling, there.q[-1], there.v[-1], [1.0, 0.0], method="dop853", rtol=1e-10, events=bouncing(1 / 0.8))
    assert (back.q[-1], back.v[-1]) == pytest.approx((1.0, 0.0), abs=1e-9)

    def mirror(i: int) -> Any:
        def action(t: Any, q: Any, v: Any) -> Any:
            v[i] = -0.9 * v[i]
            return q, v
        return Event(lambda t, q, v: q[i], -1, 3, action)

    both = solve(falling, [1.0, 1.0], [0.0, 0.0], [0.0, 9.0], method="dop853", rtol=1e-10,
                 events=[mirror(0), mirror(1)])
    assert both.t_events[0] == pytest.approx(bounces(0.9, 3), abs=1e-11)
    assert both.t_events[1][:2] == pytest.approx(bounces(0.9, 2), abs=1e-11)
    assert both.v_events[0][0] == pytest.approx(-math.sqrt(2 * GRAVITY) * np.ones(2))  # before the action


@pytest.mark.parametrize("method", ["dop853", "radau5", "sdirk4", "dprkn8", "rk4"])
def test_events_at_the_time_of_an_action_are_found_once(method: str) -> None:
    """Other events of the bouncing ball's height, before or after the bounce among the events: each has every bounce.

    A second action at the same time finds the ball on its way up.
    """
    control = {"h": 0.05} if method == "rk4" else {"rtol": 1e-6}
    times = bounces(0.9, 4)

    def found(*events: Any) -> Any:
        return solve(falling, 1.0, 0.0, [0.0, 3.0], method=method, events=events, **control)

    bounce = Event(lambda t, q, v: q, -1, False, lambda t, q, v: (q, -0.9 * v))
    height, half, downwards = lambda t, q, v: q, lambda t, q, v: -q / 2, Event(lambda t, q, v: q, -1)
    for other in (height, half, downwards):
        for events in ((bounce, other), (other, bounce)):
            both = found(*events).t_events
            assert [both[0], both[1]] == [pytest.approx(times, abs=1e-9)] * 2
    assert not len(found(bounce, Event(height, 1)).t_events[1])
    ended = found(bounce, Event(height, -1, 3))
    assert (ended.ended_by, ended.t[-1]) == (1, pytest.approx(times[2], abs=1e-9))
    again = found(bounce, Event(height, -1, False, lambda t, q, v: (q, -0.5 * v)))
    assert (again.t_events[0], len(again.t_events[1])) == (pytest.approx(times, abs=1e-9), 0)


def test_an_action_changes_the_sign_of_another_function_and_takes_arguments() -> None:
    def floor(t: Any, q: Any, v: Any, share: float) -> Any:
        return q

    floor.direction, floor.action = -1, lambda t, q, v, share: (q, -share * v)  # type: ignore[attr-defined]
    found = solve(lambda t, q, v, share: -GRAVITY, 1.0, 0.0, [0.0, 2.0], method="rk4", h=0.1, args=(0.8,),
                  events=[floor, Event(lambda t, q, v, share: v, direction=1), Event(lambda t, q, v, share: v, -1)])
    times = bounces(0.8, 6)
    assert found.t_events[0] == pytest.approx(times[times < 2.0], abs=1e-12)
    assert found.t_events[1].tolist() == found.t_events[0].tolist()  # upwards from then on
    tops = (times[1:] + times[:-1]) / 2
    assert found.t_events[2] == pytest.approx(tops[tops < 2.0], abs=1e-12)


@pytest.mark.parametrize("method", ["gauss4", "bdf4", "rk4", "dop853", "heun"])
def test_the_force_after_a_bounce_is_that_of_the_new_velocity(method: str) -> None:
    """Of a ball with drag, dense output just after the bounce against the closed form ``v = (v1 + g) exp(-s) - g``."""
    options: dict[str, Any] = {"rtol": 1e-9} if method.startswith("d") else {"h": 0.02}
    found = solve(lambda t, q, v: -GRAVITY - v, 1.0, 0.0, [0.0, 0.7], method=method, dense=True,
                  events=bouncing(0.8), **options)
    when, speed = found.t_events[0][0], -0.8 * found.v_events[0][0]
    since = np.linspace(0.0, 0.02, 30)
    truth = (speed + GRAVITY) * np.exp(-since) - GRAVITY
    errors = abs(found(when + since)[1] - truth)
    assert errors.max() < (2e-3 if method == "heun" else 1e-6)


@pytest.mark.slow
def test_bounces_in_forty_digits() -> None:
    with mpmath.workdps(40):
        found = solve(lambda t, q, v: -mpmath.mpf("9.81"), mpmath.mpf(1), mpmath.mpf(0),
                      [mpmath.mpf(0), mpmath.mpf("1.3")],
                      method="rk4", h=mpmath.mpf("0.3"), events=Event(position, -1, False, lambda t, q, v: (q, -v / 2)))
        first = mpmath.sqrt(2 / mpmath.mpf("9.81"))
        assert max(abs(t - first * (3 - mpmath.mpf(2) ** (1 - k))) for k, t in enumerate(found.t_events[0])) < 1e-36


@pytest.mark.parametrize(("action", "said"), [
    (3, "The action of event position must be a function"),
    (lambda t, q: q, r"The action of event position must be a function of \(t, q, v\)"),
    (lambda t, q, v: -v, "The action of event position fails at t = 1.5.*; it must return the state"),
    (lambda t, q, v: (q, v, t), "The action of event position must return the state after it, finite numbers"),
    (lambda t, q, v: (q, math.nan), "must return the state after it, finite numbers of its shape"),
    (lambda t, q, v: (q, np.ones(2)), "must return the state after it"),
    (lambda t, q, v: (q, None), "must return the state after it|must be a number"),
    (lambda t, q, v: (q, 1j), "What the action of event position returns must be real"),
    (lambda t, q, v: (q, 1 / 0), "The action of event position fails at t = .*division by zero"),
])
def test_bad_actions_are_refused_in_a_sentence(action: Any, said: str) -> None:
    with pytest.raises(MethodError, match=said):
        solve(oscillator, 1.0, 0.0, [0.0, 3.0], method="rk4", h=0.1, events=Event(position, action=action))
