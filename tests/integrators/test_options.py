"""Options that ``solve`` shares with SciPy's solve_ivp: max_step, first_step, several atol, args and t_eval."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from integrators import METHODS, Event, MethodError, System, solve, solve_first_order
from integrators.solving.adaptive import Tolerance, checked

PULSED = (100.0, 100.1)


def oscillator(t: Any, q: Any, v: Any) -> Any:
    return -q


def pulse(t: Any, q: Any, v: Any) -> Any:
    """Return the acceleration of a bob at rest that is pushed for 0.1 s."""
    return -q + (1.0 if PULSED[0] <= t < PULSED[1] else 0.0)


def after_pulse(t: float) -> float:
    return math.cos(t - PULSED[1]) - math.cos(t - PULSED[0])


@pytest.mark.parametrize("method", ["dop853", "bs3", "verner9", "dprkn8", "tsit5"])
def test_a_pulse_after_a_long_rest_is_missed_without_a_longest_step(method: str) -> None:
    """The closed form is ``q = cos(t - 100.1) - cos(t - 100)`` after the pulse."""
    free = solve(pulse, 0.0, 0.0, [0.0, 110.0], method=method, rtol=1e-8)
    held = solve(pulse, 0.0, 0.0, [0.0, 110.0], method=method, rtol=1e-8, max_step=0.05)
    assert free.q[-1] == 0.0  # a longer step sees nothing of it
    assert held.q[-1] == pytest.approx(after_pulse(110.0), abs=1e-6)


def lengths(found: Any) -> Any:
    return np.abs([curve.h for curve in found.dense.curves[:-1]])


@pytest.mark.parametrize("times", [[0.0, 3.0], [0.0, 0.1005, 0.2, 3.0], [2.0, -1.0], [1e6, 1e6 + 3.0]])
@pytest.mark.parametrize("longest", [0.1, 0.099, 3.0, 1e-2])
def test_no_step_is_longer_than_the_longest(times: list[float], longest: float) -> None:
    found = solve(oscillator, 1.0, 0.0, times, method="dop853", rtol=1e-3, max_step=longest, dense=True)
    rounding = 2.0 ** -50 * abs(times[0])
    assert 0.9 * min(longest, 0.5) < lengths(found).max() <= longest * (1 + 1e-9) + rounding
    free = solve(oscillator, 1.0, 0.0, times, method="dop853", rtol=1e-3, dense=True)
    assert lengths(free).max() > 0.5


def test_times_as_far_apart_as_the_longest_step_take_one_step_each() -> None:
    times = np.linspace(0.0, 5.0, 51)
    found = solve(oscillator, 1.0, 0.0, times, method="dop853", rtol=1e-4, max_step=0.1, first_step=0.1)
    assert found.steps == 50


def test_the_first_step_is_the_one_asked_for() -> None:
    for options in ({"first_step": 0.03125}, {"h": 0.03125}):
        found = solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-6, dense=True, **options)
        assert lengths(found)[0] == 0.03125
    both = solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-6, first_step=0.5, max_step=0.1, dense=True)
    assert lengths(both).max() <= 0.1 * (1 + 1e-9)


def test_infinity_is_no_bound_as_in_scipy() -> None:
    free = solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-6)
    for longest in (math.inf, np.float64(np.inf), mpmath.inf):
        found = solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-6, max_step=longest)
        assert (found.q[-1], found.steps) == (free.q[-1], free.steps)


def test_exact_numbers_keep_to_a_longest_step() -> None:
    for kind in (Decimal, mpmath.mpf):
        found = solve(oscillator, kind(1), kind(0), [kind(0), kind(1)], method="dop853", rtol=kind("1e-4"),
                      max_step=kind("0.1"), dense=True)
        assert max(abs(curve.h) for curve in found.dense.curves[:-1]) <= kind("0.1000000001")
        assert abs(float(found.q[-1]) - math.cos(1.0)) < 1e-5


# --- several absolute tolerances ------------------------------------------------------------------------------------


def test_each_component_has_its_own_tolerance() -> None:
    """By hand: the mean square of errors over ``atol + rtol max(abs(y0), abs(y1))``."""
    many = [np.array([0.5, -2.0]), np.array([1.5, 0.25])]
    old, new = [np.array([1.0, -3.0]), np.array([0.0, 2.0])], [np.array([-2.0, 1.0]), np.array([4.0, 1.0])]
    by_hand = [0.5 / (0.25 + 1.0), -2.0 / (0.5 + 1.5), 1.5 / (1.0 + 2.0), 0.25 / (2.0 + 1.0)]
    tolerance = checked(METHODS["dop853"], 0.5, [[0.25, 0.5], [1.0, 2.0]], (2,))
    assert tolerance.size(many, old, new) == pytest.approx(math.sqrt(sum(x * x for x in by_hand) / 4), rel=1e-15)
    alike = [0.5 / (0.25 + 1.0), -2.0 / (0.5 + 1.5), 1.5 / (0.25 + 2.0), 0.25 / (0.5 + 1.0)]
    tolerance = checked(METHODS["dop853"], 0.5, np.array([0.25, 0.5]), (2,))
    assert tolerance.size(many, old, new) == pytest.approx(math.sqrt(sum(x * x for x in alike) / 4), rel=1e-15)
    single = checked(METHODS["dop853"], 0.5, (0.25, 1.0), ())
    assert single == Tolerance(0.5, 0.25, 1.0)
    numbers = checked(METHODS["dop853"], 0.5, (0.25, 1.0), (3,))
    assert numbers == single
    mixed = checked(METHODS["dop853"], 0.5, ([0.25, 0.5], 1.0), (2,))
    assert (mixed.atol.tolist(), mixed.atol_v) == ([0.25, 0.5], 1.0)
    assert single.size([0.5, 1.5], [1.0, 0.0], [-2.0, 4.0]) == pytest.approx(
        math.sqrt((0.4**2 + 0.5**2) / 2), rel=1e-15)


def test_a_small_component_is_as_exact_as_its_tolerance() -> None:
    """Two oscillators of frequencies 1 and 5, one of them a millionth of the other, against the closed form."""
    k = np.array([1.0, 25.0])
    errors = {}
    for name, atol in (("one", 1e-6), ("each", [1e-6, 1e-12]), ("pair", [[1e-6, 1e-12], [1e-6, 1e-11]])):
        found = solve(lambda t, q, v: -k * q, [1.0, 1e-6], [0.0, 0.0], [0.0, 10.0], method="dop853", rtol=1e-6,
                      atol=atol)
        errors[name] = abs(found.q[-1][1] - 1e-6 * math.cos(50.0))
    assert errors["one"] > 1e-8
    assert max(errors["each"], errors["pair"]) < 1e-10


def test_pairs_of_tolerances_cost_what_scipys_do() -> None:
    """For a scalar equation SciPy has the state [q, v] and one atol for either."""
    ours = solve(lambda t, q, v: -1e4 * math.sin(q), 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-9,
                 atol=(1e-9, 1e-7))
    peer = solve_ivp(lambda t, y: [y[1], -1e4 * math.sin(y[0])], (0.0, 1.0), [1.0, 0.0], method="DOP853", rtol=1e-9,
                     atol=[1e-9, 1e-7])
    truth = solve_ivp(lambda t, y: [y[1], -1e4 * math.sin(y[0])], (0.0, 1.0), [1.0, 0.0], method="DOP853", rtol=3e-14,
                      atol=1e-14)
    assert ours.evaluations < 1.1 * peer.nfev
    assert abs(ours.q[-1] - truth.y[0, -1]) < 1e-7


# --- further arguments ----------------------------------------------------------------------------------------------


def test_arguments_reach_the_acceleration_the_events_and_a_system() -> None:
    def level(t: Any, q: Any, v: Any, k: float, drag: float) -> Any:
        return q

    def spring(t: Any, q: Any, v: Any, k: float, drag: float) -> Any:
        return -k * q - drag * v

    plain = solve(lambda t, q, v: -4.0 * q - 0.1 * v, 1.0, 0.0, [0.0, 3.0], h=0.1, events=lambda t, q, v: q)
    for problem in (spring, System(spring)):
        found = solve(problem, 1.0, 0.0, [0.0, 3.0], h=0.1, args=(4.0, 0.1), events=[level, Event(level, 1)])
        assert found.q.tolist() == plain.q.tolist()
        assert found.t_events[0].tolist() == plain.t_events[0].tolist()
    with pytest.raises(MethodError, match=r"args must be a tuple of further arguments, such as args=\(k,\), not 4"):
        solve(spring, 1.0, 0.0, [0.0, 3.0], h=0.1, args=4.0)  # type: ignore[arg-type]
    with pytest.raises(MethodError, match=r"The acceleration must be a function of \(t, q, v, args\[0\]\)"):
        solve(spring, 1.0, 0.0, [0.0, 3.0], h=0.1, args=(4.0,))
    with pytest.raises(MethodError, match=r"Event <lambda> must be a function of \(t, q, v, args\[0\], args\[1\]\)"):
        solve(spring, 1.0, 0.0, [0.0, 3.0], h=0.1, args=(4.0, 0.1), events=lambda t, q, v: q)
    with pytest.raises(MethodError, match=r"force must be a function of \(t, q, args\[0\]\)"):
        solve(System(lambda t, q, v, k: -q, force=lambda t, q: -q), 1.0, 0.0, [0.0, 1.0], h=0.1, args=(1,))
    with pytest.raises(MethodError, match="must be a function a"):
        solve(3.0, 1.0, 0.0, [0.0, 1.0], h=0.1, args=(1,))  # type: ignore[arg-type]


# --- times that are read off ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{"rtol": 1e-8}, {"h": 0.3}])
@pytest.mark.parametrize("method", ["dop853", "dopri5", "taylor", "dprkn8"])
def test_times_read_off_are_those_of_dense_output_and_cost_as_much(method: str, options: dict[str, float]) -> None:
    times = np.linspace(0.0, 20.0, 2001)
    read = solve(oscillator, 1.0, 0.0, [0.0, 20.0], method=method, t_eval=times, **options)  # type: ignore[arg-type]
    dense = solve(oscillator, 1.0, 0.0, [0.0, 20.0], method=method, dense=True, **options)  # type: ignore[arg-type]
    assert (read.t.tolist(), read.dense) == (times.tolist(), None)
    assert (read.q.tolist(), read.v.tolist()) == tuple(x.tolist() for x in dense(times))
    assert (read.steps, read.evaluations) == (dense.steps, dense.evaluations)
    if "rtol" in options:
        assert read.q == pytest.approx(np.cos(times), abs=1e-6)
        ends = solve(oscillator, 1.0, 0.0, times, method=method, rtol=1e-8)
        assert read.evaluations < ends.evaluations / 4 or method == "taylor"


def test_2001_times_cost_about_what_they_cost_scipy() -> None:
    times = np.linspace(0.0, 40.0, 2001)
    read = solve(oscillator, 1.0, 0.0, [0.0, 40.0], method="dop853", rtol=1e-8, t_eval=times)
    peer = solve_ivp(lambda t, y: [y[1], -y[0]], (0.0, 40.0), [1.0, 0.0], method="DOP853", rtol=1e-8, atol=1e-8,
                     t_eval=times)
    assert read.evaluations < 1.1 * peer.nfev
    assert np.array_equal(read.t, peer.t)
    assert abs(read.q - peer.y[0]).max() < 1e-6


def test_times_read_off_backwards_at_ends_up_to_an_event_and_in_every_number() -> None:
    back = solve(oscillator, 1.0, 0.0, [2.0, 0.0], method="dop853", rtol=1e-10, t_eval=[2.0, 1.5, 0.0], dense=True)
    assert back.q == pytest.approx(np.cos(2.0 - back.t), abs=1e-8)
    assert back.q[-1] == back(0.0)[0]
    falls = Event(lambda t, q, v: q, terminal=True)
    ended = solve(oscillator, 1.0, 0.0, [0.0, 9.0], method="dop853", rtol=1e-10, t_eval=[0.5, 1.0, 2.0], events=falls)
    assert (ended.t.tolist(), ended.ended_by) == ([0.5, 1.0], 0)
    never = solve(oscillator, np.ones(2), np.zeros(2), [0.0, 9.0], method="dop853", rtol=1e-10, t_eval=[5.0],
                  events=lambda t, q, v: q[0] - 0.5)
    assert never.q.shape == (1, 2)
    none = solve(oscillator, np.ones(2), np.zeros(2), [0.0, 9.0], method="dop853", rtol=1e-10, t_eval=[5.0],
                 events=Event(lambda t, q, v: q[0], terminal=1))
    assert (none.t.shape, none.q.shape) == ((0,), (0, 2))
    assert repr(none) == f"<Solution: dop853, 0 times, {none.steps} steps>"
    assert "dop853" in none._repr_html_()
    exact = solve(oscillator, Fraction(1), Fraction(0), [Fraction(0), Fraction(1)], h=Fraction(1, 4),
                  t_eval=[Fraction(1, 2), 1])
    assert exact.q.dtype == exact.t.dtype == object
    assert float(exact.q[1]) == pytest.approx(math.cos(1.0), abs=1e-4)


@pytest.mark.parametrize(("options", "said"), [
    ({"h": 0.1, "t_eval": [0.5, 1.5]}, "t_eval must lie between the first and the last of times, 0.0 and 1.0"),
    ({"h": 0.1, "t_eval": [0.5, 0.2]}, "t_eval must lie between .* in their order; it runs from 0.5 to 0.2"),
    ({"h": 0.1, "t_eval": [0.5, 0.2, 0.7]}, "t_eval must be strictly increasing or strictly decreasing"),
    ({"h": 0.1, "t_eval": []}, "t_eval must hold at least one time"),
    ({"h": 0.1, "t_eval": 0.5}, "t_eval must hold at least one time"),
    ({"h": 0.1, "t_eval": [0.5], "compensated": True}, "t_eval and compensated=True cannot be combined"),
    ({"h": 0.1, "max_step": 0.1}, "max_step needs rtol, which is missing; without rtol, h is the longest step"),
    ({"h": 0.1, "first_step": 0.1}, "first_step needs rtol, which is missing"),
    ({"rtol": 1e-6, "h": 0.1, "first_step": 0.1}, "h and first_step are one and the same with rtol"),
    ({"rtol": 1e-6, "max_step": 0.0}, "max_step must be a finite step above zero, not 0.0"),
    ({"rtol": 1e-6, "max_step": 1e-12}, "Steps of max_step = 1e-12 are too short: they would be 1e[+]12 steps"),
    ({"rtol": 1e-6, "max_step": math.nan}, "max_step must be a finite step above zero, not nan"),
    ({"rtol": 1e-6, "first_step": -0.1}, "first_step must be a finite step above zero, not -0.1"),
    ({"rtol": [1e-6, 1e-6]}, "rtol must be a finite number above zero, not"),
    ({"rtol": 1e-6, "atol": [1e-6, 0.0]}, "atol must be a finite number above zero, an array of them like q, or two"),
    ({"rtol": 1e-6, "atol": [1e-6, 1e-6, 1e-6]}, "atol must be a finite number above zero, an array of them like q"),
    ({"rtol": 1e-6, "atol": [[1e-6], [1e-6, 1e-6]]}, "atol must be a finite number above zero, an array of them"),
    ({"rtol": 1e-6, "atol": (1e-6, 0.0)}, "atol must be a finite number above zero, an array of them like q"),
])
def test_options_that_cannot_be_are_refused_in_a_sentence(options: dict[str, Any], said: str) -> None:
    with pytest.raises(MethodError, match=said):
        solve(oscillator, 1.0, 0.0, [0.0, 1.0], method="dop853", **options)


# --- the number of evaluations --------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["radau5", "sdirk4", "gauss4", "bdf4", "dop853"])
@pytest.mark.parametrize("start", [1.0, np.array([1.0, 2.0])])
def test_every_call_of_a_function_is_counted_but_its_probes(method: str, start: Any) -> None:
    """The probes are the calls of a run without steps; Newton's derivatives are differences of the function."""
    calls = [0]

    def damped(t: Any, q: Any, v: Any) -> Any:
        calls[0] += 1
        return -q - 0.1 * v

    def decay(t: Any, y: Any) -> Any:
        calls[0] += 1
        return -y

    control = {"rtol": 1e-6} if METHODS[method].embedded_orders else {"h": 0.1}
    for run in (lambda times: solve(damped, start, 0 * start, times, method=method, **control),
                lambda times: solve_first_order(decay, times, start, method=method, **control)):
        calls[0] = 0
        run([0.0])
        probes = calls[0]
        calls[0] = 0
        found = run([0.0, 2.0])
        assert found.evaluations == calls[0] - probes
