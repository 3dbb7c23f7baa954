"""Reference solutions of the hard cases with kinks, fast drives and actions, against mpmath, scipy and closed forms."""

from __future__ import annotations

import math

import hard_truths
import mpmath as mp
import numpy as np
import pytest
from breakaway import by_turns
from hard_truths import Force, traced
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b, mathieu_cem

from pendulum_env.hard_cases import fast_drive, non_smooth
from pendulum_env.physics import exact

# --- piecewise integration ------------------------------------------------------------------------------------------


def test_sticking_and_sliding_by_turns_is_the_motion_of_30_digits() -> None:
    """The reference has closed forms between 13 events, located with mpmath."""
    _, angle, velocity = by_turns()
    found = traced(hard_truths.turns_force, non_smooth.LIMIT, (0.0, 0.0), [5.0, 20.0])
    assert (found[0][-1], found[1][-1]) == pytest.approx((angle, velocity), abs=2e-13)


def next_turn(start: mp.mpf, limit: float, drag: float) -> mp.mpf:
    """Return the next turning angle of theta'' = -g sin - limit sign(v) - drag |v| v from rest at ``start`` > 0.

    y = v² obeys a linear equation: while the angle falls, dy/dtheta = -2 g sin + 2 limit + 2 drag y. So the integral of
    (g sin - limit) e^(-2 drag theta) from one turning angle to the next vanishes; its terms have closed forms.
    """
    g, k = mp.mpf(non_smooth.EARTH), 2 * mp.mpf(drag)

    def primitive(x: mp.mpf) -> mp.mpf:
        return mp.exp(-k * x) * (-g * (mp.cos(x) + k * mp.sin(x)) / (1 + k * k) + limit / k)

    return mp.findroot(lambda x: primitive(x) - primitive(start), (-0.95 * start, -0.3 * start), solver="anderson")


def test_quadratic_drag_and_dry_friction_rest_where_the_energy_says() -> None:
    limit, angle = non_smooth.WITH_BOTH * non_smooth.EARTH, mp.mpf("1.5")
    side = 1
    while non_smooth.EARTH * mp.sin(angle) > limit:
        angle, side = -next_turn(angle, limit, non_smooth.DRAG), -side
    found = traced(hard_truths.swing_force, limit, (1.5, 0.0), [9.0])
    assert found[1].tolist() == [0.0]
    assert found[0][0] == pytest.approx(float(side * angle), abs=1e-12)


def test_quadratic_drag_alone_turns_where_the_energy_says() -> None:
    time = brentq(lambda t: traced(hard_truths.swing_force, 0.0, (1.5, 0.0), [t])[1][0], 0.9, 1.4, xtol=1e-12)
    turn = traced(hard_truths.swing_force, 0.0, (1.5, 0.0), [time])[0][0]
    assert turn == pytest.approx(float(next_turn(mp.mpf("1.5"), 0.0, non_smooth.DRAG)), abs=1e-12)
    assert turn == pytest.approx(exact.quadratic_turning_point(1.5, non_smooth.DRAG), abs=1e-12)


def test_dry_swings_are_cosines_about_the_edges() -> None:
    marks = np.linspace(0.0, 7.0 * math.pi, 50)[1:]
    found = traced(lambda _t, q, _v: -q, non_smooth.RATIO, (non_smooth.AMPLITUDE, 0.0), marks)
    unit = np.stack(found)
    assert np.stack(hard_truths.dry_swing(marks)) == pytest.approx(unit, abs=1e-12)
    assert unit[:, -1] == pytest.approx([0.02, 0.0], abs=1e-12)


def test_what_a_rising_torque_lets_go_is_the_driven_oscillator() -> None:
    marks = np.array([40.0, non_smooth.LET_GO, 47.0, 48.0, 49.3])
    found = traced(lambda t, q, _v: non_smooth.PUSH * math.sin(non_smooth.SLOW * t) - q, non_smooth.LIMIT,
                 (0.0, 0.0), marks)
    assert np.stack(hard_truths.risen(marks)) == pytest.approx(np.stack(found), abs=1e-13)
    assert found[0][1] == 0.0 < found[0][2]


@pytest.mark.slow
@pytest.mark.parametrize(("force", "limit", "start", "angle"), [
    (hard_truths.many_force, non_smooth.LIMIT, 0.0, 0.13600493),
    (hard_truths.shaken_force, non_smooth.LIMIT, 0.3, 0.34176700),
])
def test_motions_that_stick_do_so_in_another_integration(force: Force, limit: float, start: float,
                                                         angle: float) -> None:
    """Dry friction is replaced by a steep slope through zero, limit v/e with e = 1e-6 rad/s, in scipy's Radau."""
    end = {0.0: 20.0, 0.3: 12.0}[start]
    q = traced(force, limit, (start, 0.0), [end])[0]
    soft = solve_ivp(lambda t, y: [y[1], force(t, y[0], y[1]) - limit * max(-1.0, min(1.0, y[1] / 1e-6))], (0.0, end),
                     [start, 0.0], method="Radau", rtol=1e-9, atol=1e-12, max_step=0.02)
    assert q[0] == pytest.approx(soft.y[0, -1], abs=3e-5)
    assert q[0] == pytest.approx(angle, abs=1e-7)


# --- fast drives ----------------------------------------------------------------------------------------------------

CHARACTERISTIC = -4.0 * fast_drive.SLOWNESS**2


def test_the_edges_are_mathieus() -> None:
    lower = brentq(lambda b: mathieu_a(0, 2.0 * b) - CHARACTERISTIC, 1e-4, 0.5, xtol=1e-16)
    upper = brentq(lambda b: mathieu_b(1, 2.0 * b) - CHARACTERISTIC, 0.3, 0.6, xtol=1e-16)
    assert pytest.approx(lower, abs=1e-13) == fast_drive.LOWER
    assert pytest.approx(upper, abs=1e-13) == fast_drive.UPPER
    assert hard_truths.half_trace(fast_drive.LOWER) == pytest.approx(1.0, abs=1e-12)
    assert hard_truths.half_trace(fast_drive.UPPER) == pytest.approx(-1.0, abs=1e-12)


@pytest.mark.parametrize("share", [fast_drive.UPPER, *(pytest.param(share, marks=pytest.mark.slow) for share in
                                                       fast_drive.SHARES if share != fast_drive.UPPER)])
def test_the_tilt_after_each_period_is_mathieus_even_solution(share: float) -> None:
    """phi'' = (omega0² - (b/L) Omega² cos Omega t) phi, with the drive's phase as time, from rest at the upper end."""
    ends = 2.0 * math.pi * np.arange(fast_drive.PERIODS + 1)
    found = traced(lambda s, q, _v: (fast_drive.SLOWNESS**2 - share * math.cos(s)) * q, 0.0, (1.0, 0.0), ends[1:])
    wanted = hard_truths.returns(share)
    assert found[0] == pytest.approx(wanted[1:], rel=1e-10, abs=1e-10)


def test_at_the_lower_edge_the_motion_is_ce_0() -> None:
    phase = np.linspace(0.0, 360.0, 9)
    even, _ = mathieu_cem(0, -2.0 * fast_drive.LOWER, 0.5 * phase)
    share = fast_drive.LOWER
    found = traced(lambda s, q, _v: (fast_drive.SLOWNESS**2 - share * math.cos(s)) * q, 0.0, (1.0, 0.0),
                 np.radians(phase[1:]))
    assert even[1:] / even[0] == pytest.approx(found[0], abs=1e-9)


def test_pushed_swings_are_those_of_mpmath() -> None:
    shares = np.array([1.0, -1.0, 0.3, -0.7])
    angle, speed = hard_truths.pushed(shares, 0.4, 0.3)
    q, v = mp.mpf(0.3), mp.mpf(0)
    for k, share in enumerate(shares):
        centre = fast_drive.ANSWER * share
        q, v = mp.odefun(lambda _t, y, c=centre: [y[1], c - y[0]], 0, [q, v])(mp.mpf("0.4"))
        assert (angle[k + 1], speed[k + 1]) == pytest.approx((float(q), float(v)), abs=1e-14)


def test_bang_bang_in_time_gains_twice_the_answer_each_half_swing() -> None:
    shares = np.where(np.arange(160) // 16 % 2, 1.0, -1.0)
    angle, _ = hard_truths.pushed(shares, math.pi / 16, 0.2)
    assert abs(angle[-1]) == pytest.approx(0.2 + 10 * 2.0 * fast_drive.ANSWER, abs=1e-13)


def test_the_random_numbers_are_lecuyers() -> None:
    """First numbers of MRG32k3a with all six seeds 12345 (L'Ecuyer et al. 2002, Operations Research 50, 1073)."""
    draw = hard_truths.uniforms([12345] * 6)
    assert [next(draw) for _ in range(3)] == pytest.approx([0.1270111220, 0.3185275653, 0.3091860155], abs=1e-9)


def test_gusts_have_their_spread_and_their_memory() -> None:
    """Over 400 correlation times, mean, variance and neighbour correlation are within four standard errors."""
    found = hard_truths.gust_path(1, fast_drive.GUST_TIME, 4000)
    assert np.mean(found) == pytest.approx(0.0, abs=4.0 * math.sqrt(2.2 / 4000))
    assert np.var(found) == pytest.approx(fast_drive.GUST**2, rel=4.0 * math.sqrt(2.6 / 4000))
    assert np.corrcoef(found[1:], found[:-1])[0, 1] == pytest.approx(math.exp(-1.0), abs=4.0 / math.sqrt(4000))


def test_the_wind_never_dies() -> None:
    """If the wind were zero, drag would have a kink at rest and the motion would not be smooth in a control step."""
    assert np.min(fast_drive.WIND + hard_truths.gust_path(fast_drive.SEED, fast_drive.CONTROL, fast_drive.COUNT)) > 0.3
