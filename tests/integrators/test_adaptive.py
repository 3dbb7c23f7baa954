"""Adaptive steps under a tolerance, against elliptic functions and SciPy's solvers."""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest

import integrators
from integrators import METHODS, PAIRS, MethodError, RungeKutta, StepSizeError, System, solve, unroll
from integrators.solving.adaptive import FINEST, March, Tolerance
from integrators.solving.step_size import next_ratio, step_power, step_power_of_many
from integrators.steps.estimates import evaluations_tried
from pendulum_env.physics.exact import pendulum

NAMES = [method.name for method in PAIRS]
PEERS = {"bs3": "RK23", "dopri5": "RK45", "dop853": "DOP853"}
START = (2.5, 0.3)
TIMES = [0.0, 2.0, 5.0, 7.5, 10.0]
FIRST_STEP = 2
"""Evaluations that choose the first step: at the start, and after a trial step of Euler's method."""


def swing(t, q, v):
    return -math.sin(q)


def error_of(found) -> float:
    angles, velocities = pendulum(np.array(found.t), *START, 1.0)
    return float(np.max(np.hypot(found.q - angles, found.v - velocities)))


# --- the controller -----------------------------------------------------------------------------------------------


def test_powers_are_right_to_seven_digits():
    for x in (1e-300, 1e-9, 0.3, 0.74, 0.76, 1.0, 1.49, 1.51, 2.0, 31.7, 1e6, 1e250):
        for p in (-1.0, -0.7 / 3, -0.07, 0.05, 0.4 / 3, 1.0):
            assert step_power(x, p) == pytest.approx(x**p, rel=1e-7)


def test_powers_without_branches_have_the_same_bits() -> None:
    """Check the powers at the ends of all intervals of the reduction to 0.75 ... 1.5, and at random in between."""
    ends = [x * 2.0**k for k in range(-119, 132) for x in (0.75, 1.0, 1.5)]
    near = [math.nextafter(x, to) for x in ends for to in (0.0, math.inf)]
    rng = np.random.default_rng(5)
    drawn = [*(10.0 ** rng.uniform(-36, 40, 3000)).tolist(), *rng.uniform(0.5, 2.0, 1000).tolist()]
    for x in (*ends, *near, *drawn):
        for p in (0.5, -0.7 / 8, -1.0 / 3, 0.4 / 5):
            assert step_power_of_many(x, p) == step_power(x, p), (x, p)


@pytest.mark.parametrize("order", [3, 5, 8, 9])
def test_the_controller_rests_at_one_error_and_stays_within_its_bounds(order):
    rest = 0.9**order
    assert next_ratio(rest, True, rest, order) == pytest.approx(1.0, rel=1e-6)
    assert next_ratio(rest, True, 0.0, order) == pytest.approx(1.0, rel=1e-6)
    assert next_ratio(1.0, True, rest, order) == pytest.approx(0.9**0.7, rel=1e-6)
    assert next_ratio(2.0**order, False, 0.0, order) == pytest.approx(0.45, rel=1e-6)
    assert next_ratio(0.0, True, 0.0, order) == next_ratio(1e-200, True, 1.0, order) == 10.0
    assert next_ratio(1.0, True, 1e-300, order) == next_ratio(1.0, True, 1e-4, order) >= 0.2
    assert next_ratio(1e250, False, 0.0, order) == next_ratio(1e250, False, 1.0, order) == 0.2
    assert next_ratio(math.nan, False, 0.0, order) == next_ratio(math.inf, False, 0.0, order) == 0.1


# --- the solver ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_the_error_falls_with_the_tolerance(name):
    exponents = range(4, 12)
    errors = [error_of(solve(swing, *START, [TIMES[0], TIMES[-1]], method=name, rtol=10.0**-n)) for n in exponents]
    slope = -np.polyfit(exponents, np.log10(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.25)
    assert max(error * 10.0**n for n, error in zip(exponents, errors, strict=True)) < 100


@pytest.mark.parametrize("rtol", [1e-5, 1e-8, 1e-11])
@pytest.mark.parametrize("name", PEERS)
def test_it_costs_and_errs_about_as_much_as_scipys_solver(name, rtol):
    integrate = pytest.importorskip("scipy.integrate")
    found = solve(swing, *START, [0.0, 10.0], method=name, rtol=rtol)
    peer = integrate.solve_ivp(
        lambda t, y: [y[1], -math.sin(y[0])], (0.0, 10.0), START, method=PEERS[name], rtol=rtol, atol=rtol
    )
    truth = pendulum(10.0, *START, 1.0)
    assert found.evaluations / peer.nfev < 1.1
    assert math.dist((found.q[-1], found.v[-1]), truth) < 10 * math.dist(peer.y[:, -1], truth)


@pytest.mark.parametrize("method", PAIRS, ids=NAMES)
def test_everything_asked_for_is_counted(method):
    calls = []
    system = System(lambda t, q, v: calls.append(t) or -math.sin(q), velocity_free=True,
                    jacobian=lambda t, q, v: (-math.cos(q), 0.0))
    found = solve(system, *START, [0.0, 10.0], method=method, rtol=1e-6)
    tried = FIRST_STEP + (found.steps + found.rejected) * evaluations_tried(method)
    assert found.evaluations == len(calls)
    assert len(calls) > 2 * tried if method.implicit else len(calls) == tried  # Newton's sweeps count, too
    if method.implicit:
        return
    calls.clear()
    needed = 10 * method.evaluations + len(method.memory)
    assert solve(system, *START, [0.0, 1.0], method=method, h=0.1).evaluations == len(calls) == needed


@pytest.mark.parametrize("name", NAMES)
def test_it_ends_at_the_times_asked_for_and_goes_on_with_the_step_it_had(name):
    times = [0.0, 0.1, 0.7, 1 / 3 + 1, 10.0]
    found = solve(swing, *START, times, method=name, rtol=1e-8)
    assert found.t.tolist() == times
    assert error_of(found) < 1e-6
    alone = solve(swing, *START, [0.0, 10.0], method=name, rtol=1e-8)
    assert found.steps <= alone.steps + 6


VAN_DER_POL = 1.706167732170483, -0.8928097010247975e-3
"""q and v at t = 2000 for mu = 1000 from (2, 0) (Mazzia & Magherini 2008, Test Set for IVP Solvers, problem VDPOL)."""


@pytest.mark.parametrize(("name", "rtol", "most"), [pytest.param(*one, marks=pytest.mark.slow) for one in (
    ("radau5", 1e-4, 500), ("radau5", 1e-7, 1700), ("radau5", 1e-10, 9000), ("sdirk4", 1e-4, 800),
    ("sdirk4", 1e-7, 9000))])
def test_stiff_van_der_pol(name: str, rtol: float, most: int) -> None:
    """The tolerance holds, in few steps where explicit methods take a million; as a number and as an array."""
    mu, errors = 1000.0, []
    for q in (2.0, np.array([2.0])) if rtol == 1e-4 else (2.0,):
        found = solve(lambda t, q, v: mu * (1 - q * q) * v - q, q, 0 * q, [0.0, 2000.0], method=name, rtol=rtol,
                      atol=1e-3 * rtol)
        ends = [float(x) for x in np.ravel([found.q[-1], found.v[-1]])]
        errors.append(max(abs(x / truth - 1) for x, truth in zip(ends, VAN_DER_POL, strict=True)))
        assert found.steps + found.rejected < most
    assert max(errors) < rtol


def test_times_close_together_do_not_make_later_steps_short():
    times = sorted([0.0, *(k + d for k in range(1, 10) for d in (0.0, 1e-9)), 10.0])
    found = solve(swing, *START, times, method="bs3", rtol=1e-6)
    assert found.steps <= solve(swing, *START, [0.0, 10.0], method="bs3", rtol=1e-6).steps + 2 * len(times)


def test_each_step_follows_from_the_errors_of_the_last_two():
    method, tolerance, tried = METHODS["dopri5"], Tolerance(1e-7, 1e-7), []
    namespace = {"acceleration": swing}
    exec(unroll(method, estimates=True), namespace)

    def step(t, q, v, a, h):
        found = namespace["step"](t, q, v, a, h)
        tried.append((h, tolerance.size(found[3:], (q, v), found[:2])))
        return found

    march = March(method, step, swing, tolerance, 0.0, *START)
    march.through([0.0, 20.0], 0.0, [])
    assert (len(tried), march.rejected) == (march.steps + march.rejected, sum(error > 1 for _, error in tried))
    last, fresh = 0.0, True
    for (h, error), (after, _) in pairwise(tried[:-1]):
        ratio = next_ratio(error, error <= 1, last, 5)
        assert after == pytest.approx(h * (ratio if fresh else min(ratio, 1.0)), abs=1e-14)  # times near 20 are rounded
        last, fresh = (error, True) if error <= 1 else (0.0, False)
    assert march.rejected > 0


def test_arrays_err_as_their_components_do_together():
    many = [np.array([0.5, -2.0]), np.array([1.5, 0.25])]
    old, new = [np.array([1.0, -3.0]), np.array([0.0, 2.0])], [np.array([-2.0, 1.0]), np.array([4.0, 1.0])]
    tolerance = Tolerance(0.5, 0.25)
    by_hand = [0.5 / 1.25, -2.0 / 1.75, 1.5 / 2.25, 0.25 / 1.25]
    assert tolerance.size(many, old, new) == pytest.approx(math.sqrt(sum(x * x for x in by_hand) / 4), rel=1e-15)
    alone = tolerance.size([x[0] for x in many], [x[0] for x in old], [x[0] for x in new])
    assert alone == pytest.approx(math.sqrt((by_hand[0] ** 2 + by_hand[2] ** 2) / 2), rel=1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_backwards_it_returns(name):
    there = solve(swing, *START, [0.0, 5.0], method=name, rtol=1e-10)
    back = solve(swing, there.q[-1], there.v[-1], [5.0, 2.5, 0.0], method=name, rtol=1e-10)
    assert (back.q[-1], back.v[-1]) == pytest.approx(START, abs=1e-7)
    assert back.t.tolist() == [5.0, 2.5, 0.0]


def test_the_same_run_has_the_same_bits():
    runs = [solve(swing, *START, TIMES, method="dop853", rtol=1e-9) for _ in range(2)]
    assert runs[0].q.tolist() == runs[1].q.tolist()
    assert runs[0].v.tolist() == runs[1].v.tolist()


def test_a_first_step_can_be_given_and_is_tried_as_any_other():
    found = solve(swing, *START, [0.0, 10.0], method="dopri5", rtol=1e-8, h=5.0)
    assert found.rejected >= 2
    assert error_of(found) < 1e-6
    small = solve(swing, *START, [0.0, 10.0], method="dopri5", rtol=1e-8, h=1e-9)
    assert small.steps - solve(swing, *START, [0.0, 10.0], method="dopri5", rtol=1e-8).steps < 15
    assert error_of(small) < 1e-6


def test_one_time_alone_is_the_start():
    found = solve(swing, *START, [1.0], method="dop853", rtol=1e-8)
    assert (found.q.tolist(), found.steps, found.evaluations) == ([START[0]], 0, 0)


def test_at_rest_and_on_straight_lines_steps_grow_to_the_end():
    assert solve(swing, 0.0, 0.0, [0.0, 1e3], method="dop853", rtol=1e-10).q[-1] == 0.0
    found = solve(lambda t, q, v: -9.8, 1.0, 2.0, [0.0, 8.0], method="dopri5", rtol=1e-8)
    assert found.q[-1] == pytest.approx(1 + 2 * 8 - 4.9 * 64, rel=1e-14)
    assert found.steps < 12


@pytest.mark.slow
def test_mpmath_numbers_keep_tolerances_beyond_double_precision():
    with mpmath.workdps(40):
        one = mpmath.mpf(1)
        found = solve(lambda t, q, v: -q, one, 0 * one, [0 * one, 3 * one], method="verner9", rtol=mpmath.mpf("1e-25"))
        error = abs(found.q[-1] - mpmath.cos(3))
    assert 1e-29 < error < 1e-23


def test_decimals_go_through_as_well():
    one, rtol = Decimal(1), Decimal("1e-12")
    found = solve(System(lambda t, q, v: -q), one, 0 * one, [0 * one, 2 * one], method="verner8", rtol=rtol)
    assert abs(float(found.q[-1]) - math.cos(2)) < 1e-11


def test_arrays_share_their_steps():
    angles = np.array([0.5, 1.5, 2.5])
    found = solve(lambda t, q, v: -np.sin(q), angles, np.zeros(3), [0.0, 3.0, 6.0], method="dop853", rtol=1e-10)
    truth = np.array([pendulum(6.0, angle, 0.0, 1.0)[0] for angle in angles])
    assert found.q.shape == (3, 3)
    assert found.q[-1] == pytest.approx(truth, abs=1e-8)


@pytest.mark.parametrize("name", NAMES)
def test_steps_are_rejected_where_the_force_has_a_kink(name):
    """An elastic wall at q = 0, a thousand times stiffer than the pull towards it; the motion is made of half sines."""
    pull, wall = 1.0, 1e3

    def bounce(t, q, v):
        return -pull * q if q > 0 else -wall * q

    period = math.pi / math.sqrt(pull) + math.pi / math.sqrt(wall)
    found = solve(bounce, 1.0, 0.0, [0.0, 2 * period], method=name, rtol=1e-9)
    assert found.rejected > 4
    assert (found.q[-1], found.v[-1]) == pytest.approx((1.0, 0.0), abs=1e-5)


def test_under_stiff_drag_the_controller_rests_at_the_limit_of_stability():
    """v' = -1000 (v - cos t): steps of 3.3 ms, dopri5's real stability limit, with almost no rejections.

    This is the purpose of PI control (Hairer & Wanner 1996, section IV.2).
    """
    found = solve(lambda t, q, v: -1e3 * (v - math.cos(t)), 0.0, 0.0, [0.0, 1.0], method="dopri5", rtol=1e-6)
    truth = (1e6 * math.cos(1) + 1e3 * math.sin(1)) / (1e6 + 1)
    assert found.v[-1] == pytest.approx(truth, abs=1e-6)
    assert found.rejected < 5
    assert 1000 / 3.31 < found.steps < 400


# --- what cannot be -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_a_blow_up_is_named_with_its_time(name):
    """q'' = 2 q**3 from (1, 1) has the solution 1/(1 - t)."""
    says = rf"{name} cannot keep to rtol = 1e-08 at t = (0\.99|1\.00).*too short"
    with pytest.raises(StepSizeError, match=says) as caught:
        solve(lambda t, q, v: 2.0 * q * q * q, 1.0, 1.0, [0.0, 2.0], method=name, rtol=1e-8)
    assert caught.value.t == pytest.approx(1.0, abs=1e-6)
    assert 0.0 < caught.value.h < 1e-14


@pytest.mark.parametrize("kind", ["nan", "inf", "fails"])
def test_a_force_that_ends_is_named_with_its_time(kind):
    def acceleration(t, q, v):
        if t <= 0.5:
            return -q
        return math.sqrt(-1.0) if kind == "fails" else float(kind)

    with pytest.raises(StepSizeError, match=r"at t = 0\.(5|49999).*not finite") as caught:
        solve(System(acceleration), 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-8)
    assert caught.value.t == pytest.approx(0.5, abs=1e-14)
    assert ("math domain" in str(caught.value)) == (kind == "fails")


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_force_that_is_none_from_the_start(bad):
    with pytest.raises(MethodError, match=r"acceleration at the start, t = 0\.0, must be finite"):
        solve(System(lambda t, q, v: bad), 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-8)
    with pytest.raises(MethodError, match=r"fails at the start, t = 0\.0: "):
        solve(System(lambda t, q, v: 1.0 / t), 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-8)


def test_an_acceleration_of_another_shape():
    with pytest.raises(MethodError, match=r"shape of q and v, \(\), not \(2,\)"):
        solve(System(lambda t, q, v: np.zeros(2)), 1.0, 0.0, [0.0, 1.0], method="dop853", rtol=1e-8)


@pytest.mark.parametrize("name", ["rk4", "velocity_verlet", "implicit_midpoint"])
def test_methods_without_estimates_are_refused_with_those_that_have_them(name):
    with pytest.raises(MethodError, match=rf"{name} does not estimate its error.*bs3, dopri5, tsit5, dop853, verner6"):
        solve(swing, *START, [0.0, 1.0], method=name, rtol=1e-8)


@pytest.mark.parametrize("bad", [0.0, -1e-8, math.nan, math.inf, "1e-8", [1e-8]])
def test_tolerances_that_are_none(bad):
    with pytest.raises(MethodError, match="rtol must be a finite number above zero"):
        solve(swing, *START, [0.0, 1.0], method="dop853", rtol=bad)
    with pytest.raises(MethodError, match="atol must be a finite number above zero"):
        solve(swing, *START, [0.0, 1.0], method="dop853", rtol=1e-8, atol=bad)


def test_a_tolerance_below_rounding():
    with pytest.raises(MethodError, match=r"rtol must be at least 1\.8e-15 in double precision, not 1e-16"):
        solve(swing, *START, [0.0, 1.0], method="dop853", rtol=1e-16)
    assert error_of(solve(swing, *START, [0.0, 1.0], method="dop853", rtol=FINEST)) < 1e-13


def test_a_step_or_a_tolerance_is_needed():
    with pytest.raises(MethodError, match=r"h must be .*rtol"):
        solve(swing, *START, [0.0, 1.0])
    with pytest.raises(MethodError, match="atol needs rtol"):
        solve(swing, *START, [0.0, 1.0], h=0.1, atol=1e-8)
    with pytest.raises(MethodError, match="h must be a finite step above zero"):
        solve(swing, *START, [0.0, 1.0], method="dop853", rtol=1e-8, h=-0.1)


def test_a_pair_of_ones_own_adapts_its_steps():
    """A user-defined pair, Heun's method with embedded Euler, needs only a table entry."""
    own = replace(
        METHODS["heun"], name="heun_euler", aliases=(), embedded=(integrators.Embedded(1, (Fraction(1), Fraction(0))),)
    )
    assert isinstance(own, RungeKutta)
    errors = [error_of(solve(swing, *START, [0.0, 10.0], method=own, rtol=rtol)) for rtol in (1e-5, 1e-7)]
    assert math.log10(errors[0] / errors[1]) / 2 == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize("rtol", [1e-6, 1e-9, 1e-11])
def test_the_first_step_of_an_oscillator_is_taken_at_once(rtol: float) -> None:
    """A first step in which Euler's method errs little is not too long for a pair (Hairer, Norsett & Wanner II.4).

    One ten times longer errs by more than the tolerance, and is tried in vain. The motion is cos(t) + 0.3 sin(t).
    """
    for method in ("bs3", "dopri5", "dop853", "rkn43"):
        found = integrators.solve(lambda t, q, v: -q, 1.0, 0.3, [0.0, 1.0], method=method, rtol=rtol)
        assert found.rejected == 0, method
        assert found.q[-1] == pytest.approx(math.cos(1.0) + 0.3 * math.sin(1.0), abs=100.0 * rtol), method
