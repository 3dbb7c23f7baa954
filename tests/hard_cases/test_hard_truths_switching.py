"""Reference numbers of the hard cases of switching, against mpmath and scipy with other methods."""

from __future__ import annotations

import math

import hard_truths
import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendulum_env.hard_cases import switching


def test_a_very_slow_torque_is_answered_by_the_driven_oscillator() -> None:
    """``theta'' + theta = cos(W t - phi) - 0.8`` from rest at the time of release, in 50 digits."""
    times = switching.LET_GO + np.array([0.0, 0.01, 0.5, 2.0, 5.0])
    with mpmath.workdps(50):
        rate, limit = mpmath.mpf("1e-6"), mpmath.mpf("0.8")
        size, phase = 1 / (1 - rate * rate), -mpmath.acos(limit)
        for t, q, v in zip(times.tolist(), *hard_truths.yielded(times), strict=True):
            s = mpmath.mpf(t) - switching.LET_GO
            a, b = limit - size * mpmath.cos(phase), size * rate * mpmath.sin(phase)
            angle = size * mpmath.cos(rate * s + phase) - limit + a * mpmath.cos(s) + b * mpmath.sin(s)
            speed = -size * rate * mpmath.sin(rate * s + phase) - a * mpmath.sin(s) + b * mpmath.cos(s)
            assert abs(q - angle) < 1e-11 * rate
            assert abs(v - speed) < 1e-11 * rate


def test_a_torque_in_steps_is_a_sum_of_answers_to_each_step() -> None:
    """Each step of the torque adds ``1 - cos`` of the time since then, by superposition."""
    held = switching.HOLDS + 1
    angle, speed = (column / switching.GRAIN for column in hard_truths.climbed())
    assert not np.any(angle[:held])
    assert not np.any(speed[:held])
    for n in range(1, switching.SLIDES + 1):
        since = [switching.TURN * (n - k) for k in range(n)]
        assert angle[held + n - 1] == pytest.approx(sum(2.0 * math.sin(0.5 * t) ** 2 for t in since), rel=1e-12)
        assert speed[held + n - 1] == pytest.approx(sum(math.sin(t) for t in since), rel=1e-12)
    assert np.all(speed[held:] > 0.0)


def test_the_torque_equals_the_limit_exactly() -> None:
    assert switching.STAIRS.of_kind("dissipative")[0].friction_torque == 0.5
    assert all((0.5 + k * switching.GRAIN) - 0.5 == k * switching.GRAIN
               for k in range(1 - switching.HOLDS, switching.SLIDES + 1))


def test_the_wind_reverses() -> None:
    wind = np.array(hard_truths.airs(switching.REVERSES.name))
    assert len(wind) == switching.COUNT
    assert np.count_nonzero(np.diff(np.sign(wind))) >= 8
    assert wind.min() < -5.0
    assert wind.max() > 5.0


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, switching.DRAG])
def test_motion_under_a_random_torque_agrees_with_an_implicit_method(drag: float) -> None:
    """Radau's method of order 5 at 1e-11 over the first 20 steps."""
    angle, velocity = hard_truths.thrown(drag)
    state, h = np.array([switching.START, 0.0]), switching.PHASE / math.sqrt(9.81)
    for k, share in enumerate(switching.shares(switching.STEPS)[:20].tolist()):
        torque = switching.STRENGTH * 9.81 * share
        state = solve_ivp(lambda t, y, torque=torque: [y[1], torque - 9.81 * np.sin(y[0]) - drag * abs(y[1]) * y[1]],
                          (0.0, h), state, "Radau", rtol=1e-11, atol=1e-13).y[:, -1]
        assert state[0] == pytest.approx(angle[k + 1], abs=1e-9)
        assert state[1] == pytest.approx(velocity[k + 1], abs=1e-9 * math.sqrt(9.81))
