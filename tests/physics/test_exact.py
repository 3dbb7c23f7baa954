"""Tests of the closed forms against mpmath in many digits and SciPy's DOP853, which use other formulas."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendulum_env.physics import exact
from pendulum_env.physics.units import SceneError

PI = math.pi
SEPARATRIX_SPEED = 2.0 * math.cos(0.5)


@pytest.fixture(autouse=True)
def sixty_digits() -> Iterator[None]:
    with mp.workdps(60):
        yield


def dop853(rates: Callable[[float, Any], list[float]], state: list[float], times: list[float]) -> Any:
    options: dict[str, Any] = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-14}
    return solve_ivp(rates, (0.0, times[-1]), state, t_eval=times, **options).y


def half_swing(acceleration: Callable[[float, float], float], angle: float) -> tuple[float, float]:
    """Return time and angle of the next turning point after a release at rest, by DOP853."""

    def velocity(t: float, y: Any) -> float:
        return float(y[1]) if t > 1e-3 else math.copysign(1.0, -angle)

    velocity.terminal = True  # type: ignore[attr-defined]
    options: dict[str, Any] = {"method": "DOP853", "rtol": 3e-14, "atol": 1e-15, "max_step": 0.05}
    run: Any = solve_ivp(
        lambda t, y: [y[1], acceleration(*y)], (0.0, 60.0), [angle, 0.0], events=velocity, **options
    )
    return float(run.t_events[0][0]), float(run.y_events[0][0][0])


# ---- undamped pendulum


def jacobi_motion(t: float, angle: float, velocity: float, omega0: float) -> tuple[Any, Any]:
    """Return angle and velocity by mpmath's elliptic integral F and functions sn, cn, dn."""
    a, v, w = mp.mpf(angle), mp.mpf(velocity), mp.mpf(omega0)
    turns = mp.nint(a / (2 * mp.pi))
    sign = -1 if v < 0 else 1
    x, u = sign * (a / 2 - mp.pi * turns), abs(v) / (2 * w)
    m, half_turns = mp.sin(x) ** 2 + u**2, mp.mpf(0)
    k = mp.sqrt(m)
    if m < 1:
        phase = w * t + mp.ellipf(mp.atan2(mp.sin(x), u), m)
        sine, cosine, u = (f * mp.ellipfun(g, phase, m=m) for f, g in ((k, "sn"), (1, "dn"), (k, "cn")))
    elif m == 1:
        phase = w * t + mp.atanh(mp.sin(x))
        sine, cosine, u = mp.tanh(phase), mp.sech(phase), mp.sech(phase)
    else:
        phase = k * w * t + mp.ellipf(x, 1 / m)
        half_turns = mp.nint(phase / (2 * mp.ellipk(1 / m)))
        phase -= 2 * half_turns * mp.ellipk(1 / m)
        sine, cosine, u = (f * mp.ellipfun(g, phase, m=1 / m) for f, g in ((1, "sn"), (1, "cn"), (k, "dn")))
    angle_now = 2 * mp.pi * turns + 2 * sign * (mp.atan2(sine, cosine) + mp.pi * half_turns)
    return angle_now, sign * 2 * w * u


STATES = {
    "small": (1e-8, 0.0, 5.27),
    "tiny": (1e-170, 0.0, 1.0),
    "ordinary": (0.5, 0.0, 5.27),
    "moving": (1e-3, 1e-3, 5.0),
    "wide": (3.0, 0.0, 5.27),
    "leftwards": (-2.7, 0.3, 2.0),
    "another turn": (9.0, 0.3, 2.0),
    "nearly over": (0.0, 1.9, 1.0),
    "separatrix": (0.0, 2.0, 1.0),
    "separatrix backwards": (0.0, -2.0, 1.0),
    "just over": (0.0, 2.1, 1.0),
    "turning": (1.0, -7.0, 1.0),
    "many turns": (100.5, 30.0, 1.0),
    "top": (PI - 1e-9, 0.0, 5.27),
    "float pi": (PI, 0.0, 5.27),
    "to the top, short": (PI - 1e-6, 1e-6, 1.0),
    "to the top, over": (PI - 1e-6, 1e-6 * (1 + 1e-9), 1.0),
    "from the top": (PI - 1e-6, -2e-6, 1.0),
    "one rounding from the separatrix": (1.0, SEPARATRIX_SPEED, 1.0),
    "next float": (-1.0, float(np.nextafter(SEPARATRIX_SPEED, 3.0)), 1.0),
}


@pytest.mark.parametrize("state", STATES.values(), ids=STATES)
def test_pendulum_is_the_elliptic_motion_to_rounding(state: tuple[float, float, float]) -> None:
    omega0 = state[2]
    times = np.linspace(-20.0, 20.0, 9) / omega0
    scale = abs(math.sin(state[0] / 2)) if state[1] == 0.0 and abs(state[0]) < 1e-3 else 1.0
    for t, angle, velocity in zip(times, *exact.pendulum(times, *state), strict=True):
        true_angle, true_velocity = jacobi_motion(t, *state)
        rotates = abs(true_angle - state[0]) > 2 * PI
        bound = 1e-15 * scale * (4 + (abs(true_angle - state[0]) if rotates else omega0 * abs(t)))
        assert abs(angle - true_angle) <= bound
        assert abs(velocity - true_velocity) <= bound * omega0


@pytest.mark.quick("turning")
@pytest.mark.parametrize("name", ["wide", "turning", "to the top, over"])
def test_pendulum_solves_the_equation_integrated_in_20_digits(name: str) -> None:
    angle, velocity, omega0 = STATES[name]
    with mp.workdps(20):
        square, end_time = mp.mpf(omega0) ** 2, mp.mpf(1) / 2
        start = [mp.mpf(angle), mp.mpf(velocity)]
        end = mp.odefun(lambda t, y: [y[1], -square * mp.sin(y[0])], 0, start)(end_time)
        ours = exact.pendulum(float(end_time), angle, velocity, omega0)
        assert abs(ours[0] - end[0]) < 1e-14
        assert abs(ours[1] - end[1]) < 1e-14 * omega0


@pytest.mark.parametrize(
    "state", [(0.3, 0.1), (2.5, -0.4), (-1.0, 1.6), (0.2, -2.5), (3.0, 4.0), (-7.0, 1.0)]
)
def test_pendulum_agrees_with_dop853(state: tuple[float, float]) -> None:
    times = [1.0, 4.0, 10.0]
    angles, velocities = dop853(lambda t, y: [y[1], -2.25 * math.sin(y[0])], list(state), times)
    ours = exact.pendulum(np.array(times), *state, 1.5)
    assert ours[0] == pytest.approx(angles, abs=1e-11, rel=0)
    assert ours[1] == pytest.approx(velocities, abs=1e-11, rel=0)


@pytest.mark.parametrize("below", [1e-9, 0.0], ids=["1e-9 below the top", "float pi"])
def test_a_release_next_to_the_top_falls_at_the_right_time(below: float) -> None:
    start = PI - below
    fall = exact.period(start, 5.27) / 4
    assert abs(fall / (mp.ellipk(mp.sin(mp.mpf(start) / 2) ** 2) / mp.mpf(5.27)) - 1) < 1e-15
    angle, velocity = exact.pendulum(fall, start, 0.0, 5.27)
    assert abs(angle) < 1e-14 * 2 * 5.27
    assert velocity == pytest.approx(-2 * 5.27, rel=1e-15)


@pytest.mark.parametrize("start", [PI - 1e-9, PI])
def test_the_growth_from_the_top_is_right_while_it_is_tiny(start: float) -> None:
    for t in (1.0, 5.0, 10.0):
        velocity = exact.pendulum(t, start, 0.0, 1.0)[1]
        assert abs(velocity / jacobi_motion(t, start, 0.0, 1.0)[1] - 1) < 4e-14


def test_pendulum_at_rest_stays() -> None:
    angles, velocities = exact.pendulum(np.linspace(0, 9, 4), 0.0, 0.0, 3.0)
    assert not angles.any()
    assert not velocities.any()


@pytest.mark.parametrize("amplitude", [1e-5, 0.1, 1.0, 2.0, 3.0, 3.14159, PI - 1e-9, PI])
def test_period(amplitude: float) -> None:
    true = 4 * mp.ellipk(mp.sin(mp.mpf(amplitude) / 2) ** 2) / 3
    assert abs(exact.period(amplitude, 3.0) / true - 1) < 5e-16
    assert exact.period(-amplitude, 3.0) == exact.period(amplitude, 3.0)


@pytest.mark.parametrize("velocity", [2.0000000000000004, 2.001, 3.0, 100.0, 1e5])
def test_period_rotation(velocity: float) -> None:
    v = mp.mpf(velocity)
    assert abs(exact.period_rotation(velocity, 1.0) / (4 * mp.ellipk(4 / v**2) / v) - 1) < 5e-16
    assert exact.period_rotation(-velocity, 1.0) == exact.period_rotation(velocity, 1.0)
    turned = exact.pendulum(exact.period_rotation(velocity, 1.0), 0.0, velocity, 1.0)
    assert turned == pytest.approx((2 * PI, velocity), rel=1e-14)


def test_small_amplitude_series_is_the_expansion_of_the_period() -> None:
    expansion = mp.taylor(lambda q: 2 * mp.ellipk(mp.sin(q / 2) ** 2) / mp.pi - 1, 0, 10)
    for q in (1e-4, 0.01, 0.5, 2.0):
        true = mp.fsum(term * mp.mpf(q) ** n for n, term in enumerate(expansion[:10]))
        assert abs(exact.small_amplitude_series(q) / true - 1) < 5e-16
    assert abs(expansion[10] - 1.39e-6) < 5e-9


# ---- linear oscillator


def linear_motion(t: float, angle: float, velocity: float, omega0: float, gamma: float) -> tuple[Any, Any]:
    """Return angle and velocity of the damped oscillator from its two complex exponentials.

    400 digits are used, so that the two roots may nearly coincide.
    """
    with mp.workdps(400):
        d, w = mp.mpf(gamma) / 2, mp.mpf(omega0)
        s = mp.sqrt(mp.mpc(d * d - w * w))
        s = s if s else mp.mpf(10) ** -180
        first, second = s - d, -s - d
        p = (velocity - second * angle) / (2 * s)
        q = angle - p
        grow, fall = p * mp.exp(first * t), q * mp.exp(second * t)
        return (grow + fall).real, (first * grow + second * fall).real


REGIMES = {
    "undamped": (5.27, 0.0),
    "under": (5.27, 0.1),
    "barely under": (1.0, 2.0 * (1 - 1e-12)),
    "critical": (1.0, 2.0),
    "next float": (1.0, float(np.nextafter(2.0, 3.0))),
    "barely over": (1.0, 2.0 * (1 + 1e-12)),
    "over": (1.0, 50.0),
    "far over": (1.0, 1e6),
    "no gravity": (0.0, 0.5),
    "hardly any gravity": (1e-12, 1.0),
    "hardly any drag": (0.0, 1e-12),
    "free": (0.0, 0.0),
    "almost free": (1e-170, 0.0),
}


@pytest.mark.parametrize("regime", REGIMES.values(), ids=REGIMES)
@pytest.mark.parametrize("state", [(1.0, 0.0), (0.3, -2.0), (0.0, 1.0)])
def test_linear_is_the_damped_oscillator_to_rounding(
    state: tuple[float, float], regime: tuple[float, float]
) -> None:
    times = np.array([-0.3, 0.0, 0.01, 1.0, 3.0, 10.0, 1e4])
    times = times[(times >= 0) | (regime[1] < 100)]
    for t, angle, velocity in zip(times, *exact.linear(times, *state, *regime), strict=True):
        true_angle, true_velocity = linear_motion(t, *state, *regime)
        bound = 4e-16 * (1 + regime[0] * abs(t) + regime[1] * max(-t, 0.0))
        assert abs(angle - true_angle) <= bound * max(1, abs(true_angle))
        assert abs(velocity - true_velocity) <= bound * max(1, regime[0], abs(true_velocity))


def test_the_slow_mode_keeps_its_relative_accuracy() -> None:
    angle, velocity = exact.linear(100.0, 1.0, 0.0, 1.0, 1e6)
    true_angle, true_velocity = linear_motion(100.0, 1.0, 0.0, 1.0, 1e6)
    assert abs(angle / true_angle - 1) < 1e-15
    assert abs(velocity / true_velocity - 1) < 1e-15


@pytest.mark.parametrize("gamma", [0.0, 0.4, 3.0, 8.0])
def test_linear_agrees_with_dop853(gamma: float) -> None:
    times = [0.5, 2.0, 6.0]
    angles, velocities = dop853(lambda t, y: [y[1], -2.25 * y[0] - gamma * y[1]], [0.7, -1.0], times)
    ours = exact.linear(np.array(times), 0.7, -1.0, 1.5, gamma)
    assert ours[0] == pytest.approx(angles, abs=1e-12, rel=0)
    assert ours[1] == pytest.approx(velocities, abs=1e-12, rel=0)


@pytest.mark.parametrize("omega0", [0.0, 1.0, 1e3, 1e6])
def test_nothing_overflows_at_late_times(omega0: float) -> None:
    angle, velocity = exact.linear(1e300, 1.0, 1.0, omega0, 1e5)
    assert angle == (0.0 if omega0 else 1.0 + 1e-5)
    assert velocity == 0.0


# ---- dissipation


@pytest.mark.parametrize("angle", [0.01, 0.3, -1.0, 2.0, 3.14, PI])
@pytest.mark.parametrize("tau", [0.0, 1e-8, 1e-3, 0.05, 0.3, 0.7])
def test_coulomb_turning_points_solve_the_energy_balance(angle: float, tau: float) -> None:
    angles = exact.coulomb_turning_points(angle, tau, 6)
    assert angles[0] == angle
    assert len(angles) == 7 or abs(math.sin(angles[-1])) <= tau
    assert all(abs(math.sin(moving)) > tau for moving in angles[:-1])
    for start, end in pairwise(angles):
        sign = math.copysign(1.0, start)
        t0, t1 = mp.mpf(abs(start)), mp.mpf(-sign * end)
        excess = mp.cos(t1) - mp.cos(t0) - tau * (t0 + t1)
        assert abs(excess) <= 5e-16 * abs(mp.sin(t1) + tau)
        assert abs(end) < abs(start) or tau == 0.0


@pytest.mark.parametrize(("angle", "tau"), [(1.5, 0.05), (-2.8, 0.3), (0.8, 0.6)])
def test_coulomb_turning_points_agree_with_dop853(angle: float, tau: float) -> None:
    friction = math.copysign(tau, angle)
    ours = exact.coulomb_turning_points(angle, tau, 1)[1]
    assert ours == pytest.approx(half_swing(lambda q, v: friction - math.sin(q), angle)[1], abs=2e-12)


def test_coulomb_pendulum_can_stick_before_the_bottom() -> None:
    angles = exact.coulomb_turning_points(1.2, 0.9, 5)
    assert len(angles) == 2
    assert 0.0 < angles[1] < math.asin(0.9)


def test_linear_coulomb_loses_two_tau_each_half_swing_and_sticks() -> None:
    assert exact.coulomb_turning_points_linear(1.0, 0.125, 10).tolist() == [1.0, -0.75, 0.5, -0.25, 0.0]
    assert exact.coulomb_turning_points_linear(-1.0, 0.125, 2).tolist() == [-1.0, 0.75, -0.5]
    assert exact.coulomb_turning_points_linear(0.1, 0.125, 3).tolist() == [0.1]
    small = exact.coulomb_turning_points(1e-4, 3e-6, 50)
    assert exact.coulomb_turning_points_linear(1e-4, 3e-6, 50) == pytest.approx(small, abs=1e-12)


@pytest.mark.parametrize("angle", [1e-4, 0.3, -1.0, 2.0, 3.14, PI])
@pytest.mark.parametrize("c", [0.0, 1e-9, 1e-3, 0.1, 1.0, 100.0, 1e4])
def test_quadratic_turning_point_solves_the_energy_equation(angle: float, c: float) -> None:
    end = exact.quadratic_turning_point(angle, c)
    assert end * angle < 0.0
    start, stop = mp.mpf(abs(angle)), -mp.mpf(abs(end))

    def weight(x: Any) -> Any:
        return mp.exp(-2 * c * x) * (mp.cos(x) + 2 * c * mp.sin(x))

    slope = (1 + 4 * mp.mpf(c) ** 2) * mp.sin(stop) * mp.exp(-2 * c * stop)
    assert abs((weight(start) - weight(stop)) / slope) <= 5e-16


@pytest.mark.parametrize(("angle", "c"), [(0.5, 0.02), (-2.0, 0.3), (3.0, 2.0), (1.0, 15.0)])
def test_quadratic_turning_point_agrees_with_dop853(angle: float, c: float) -> None:
    _, end = half_swing(lambda q, v: -math.sin(q) - c * abs(v) * v, angle)
    assert exact.quadratic_turning_point(angle, c) == pytest.approx(end, abs=2e-12)


@pytest.mark.parametrize("gamma", [0.0, 1e-14, 1e-3, 1.0, 50.0])
@pytest.mark.parametrize("c", [0.0, 1e-14, 1e-3, 1.0, 50.0])
@pytest.mark.parametrize("velocity", [3.0, -1000.0])
def test_drag_only_to_rounding(gamma: float, c: float, velocity: float) -> None:
    times = np.array([-1e-6, 0.0, 1e-6, 0.5, 10.0])
    for t, angle, now in zip(times, *exact.drag_only(times, velocity, gamma, c), strict=True):
        fall = mp.exp(-mp.mpf(gamma) * t)
        rise = (1 - fall) / gamma if gamma else mp.mpf(t)
        load = mp.mpf(c) * abs(velocity) * rise
        true_angle = math.copysign(1.0, velocity) * (mp.log(1 + load) / c if c else abs(velocity) * rise)
        assert abs(angle - true_angle) <= 6e-16 * abs(true_angle)
        true_velocity = velocity * fall / (1 + load)
        assert abs(now - true_velocity) <= 3e-16 * (2 + gamma * abs(t)) * abs(true_velocity)


def test_drag_only_agrees_with_dop853() -> None:
    times = [0.1, 1.0, 5.0]
    rates = dop853(lambda t, y: [y[1], -0.5 * y[1] - 0.8 * abs(y[1]) * y[1]], [0.0, -9.0], times)
    for ours, theirs in zip(exact.drag_only(np.array(times), -9.0, 0.5, 0.8), rates, strict=True):
        assert ours == pytest.approx(theirs, abs=2e-12)


@pytest.mark.parametrize("omega_h", [1e-9, 0.05, 1.9])
def test_euler_energy_factors_are_those_of_the_steps(omega_h: float) -> None:
    x = mp.mpf(omega_h)
    forward = mp.matrix([[1, x], [-x, 1]])
    for method, step in (("forward_euler", forward), ("backward_euler", mp.matrix([[1, -x], [x, 1]]) ** -1)):
        state = mp.matrix([mp.mpf("0.3"), mp.mpf("0.4")])
        after = step**7 * state
        factor = (after.T * after)[0] / mp.mpf("0.25")
        ours = exact.euler_energy_factor(omega_h * 4, 0.25, method, steps=7)
        assert abs(ours / factor - 1) < 3e-16 * (1 + abs(mp.log(factor)))


DAMPINGS = {
    "linear": (0.1, 0.0, 0.0),
    "quadratic": (0.0, 0.2, 0.0),
    "coulomb": (0.0, 0.0, 0.3),
    "all": (0.1, 0.2, 0.3),
    "all, oscillatory": (0.001, 0.2, 0.3),
    "linear and quadratic": (0.4, 0.2, 0.0),
    "linear and coulomb": (0.4, 0.0, 0.1),
    "quadratic and a trace": (1e-9, 0.2, 1e-9),
}


@pytest.mark.quick("linear", "quadratic", "all")
@pytest.mark.parametrize("damping", DAMPINGS.values(), ids=DAMPINGS)
def test_damped_amplitude_solves_the_averaged_equation(damping: tuple[float, float, float]) -> None:
    gamma, c, tau = map(mp.mpf, damping)

    def rate(t: Any, a: Any) -> Any:
        return -gamma / 2 * a - 4 / (3 * mp.pi) * c * 5 * a**2 - 2 * tau / (mp.pi * 5)

    with mp.workdps(20):
        solution = mp.odefun(rate, 0, mp.mpf("0.4"))
        for t in (0.5, 5.0):
            assert abs(exact.damped_amplitude(t, 0.4, 5.0, *damping) - max(solution(t), 0)) < 2e-16


@pytest.mark.parametrize("damping", [(0.0, 0.0, 0.3), (0.1, 0.2, 0.3), (0.001, 0.2, 0.3)])
def test_damped_amplitude_comes_to_rest_and_stays(damping: tuple[float, float, float]) -> None:
    amplitudes = exact.damped_amplitude(np.linspace(0.0, 1e3, 5001), 0.4, 5.0, *damping)
    assert amplitudes[0] == 0.4
    assert amplitudes[-1] == 0.0
    assert np.all(np.diff(amplitudes) <= 0.0)


@pytest.mark.quick("damping2")
@pytest.mark.parametrize(
    "damping", [(0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.005), (0.01, 0.02, 0.005)]
)
def test_damped_amplitude_is_the_envelope_of_the_small_swing(damping: tuple[float, float, float]) -> None:
    """Compare with DOP853, restarted at each turning point so that the friction's jump falls between steps."""
    gamma, c, tau = damping
    time, angle = 0.0, 0.1
    for _ in range(20):
        friction = math.copysign(tau, angle)
        span, angle = half_swing(
            lambda q, v, push=friction: push - 25.0 * q - gamma * v - c * abs(v) * v,  # type: ignore[misc]
            angle,
        )
        time += span
    envelope = exact.damped_amplitude(time, 0.1, 5.0, *damping)
    assert abs(angle) == pytest.approx(envelope, rel=2e-5)
    assert abs(angle) < 0.1 * (1 - 1e-3)


# ---- calling


@pytest.mark.parametrize(
    "call",
    [
        lambda t: exact.linear(t, 0.3, 0.1, 2.0, 0.1),
        lambda t: exact.pendulum(t, 0.3, 0.1, 2.0),
        lambda t: exact.pendulum(t, 0.3, 9.0, 2.0),
        lambda t: exact.pendulum(t, 0.0, 4.0, 2.0),
        lambda t: exact.pendulum(t, 0.0, 0.0, 2.0),
        lambda t: exact.drag_only(t, 2.0, 0.1, 0.2),
        lambda t: (exact.damped_amplitude(t, 0.3, 2.0, 0.1, 0.1, 0.1), exact.period(t, 2.0)),
        lambda t: (exact.small_amplitude_series(t), exact.period_rotation(t + 5.0, 2.0)),
    ],
)
def test_results_have_the_shape_of_the_first_argument(call: Callable[[Any], tuple[Any, Any]]) -> None:
    times = np.array([[0.0, 0.5, 1.0], [1.5, 2.0, 2.5]])
    whole, single = call(times), call(0.5)
    for array, number in zip(whole, single, strict=True):
        assert array.shape == times.shape
        assert isinstance(number, float)
        assert array[0, 1] == pytest.approx(number, rel=1e-15)


BAD: dict[str, Callable[[], Any]] = {
    "time must be finite": lambda: exact.pendulum(np.array([0.0, math.nan]), 1.0, 0.0, 1.0),
    "time must be >= 0": lambda: exact.damped_amplitude(-1.0, 1.0, 1.0),
    "the motion at this time is not": lambda: exact.linear(-1e6, 1.0, 1.0, 1.0, 2.0),
    "time must come after": lambda: exact.drag_only(-1.0, 2.0, 0.0, 1.0),
    "angle must be finite, not nan": lambda: exact.linear(0.0, math.nan, 0.0, 1.0),
    "angle must lie": lambda: exact.coulomb_turning_points(3.2, 0.1, 1),
    "angle must lie between -pi and pi, not -4": lambda: exact.quadratic_turning_point(-4.0, 0.1),
    "velocity must be finite, not inf": lambda: exact.pendulum(0.0, 0.0, math.inf, 1.0),
    "velocity at the bottom": lambda: exact.period_rotation(np.array([3.0, 2.0]), 1.0),
    "omega0 must be finite and >= 0, not -1": lambda: exact.linear(0.0, 1.0, 0.0, -1.0),
    "omega0 must be finite and > 0, not 0": lambda: exact.pendulum(0.0, 1.0, 0.0, 0.0),
    "omega0 must be finite and > 0, not -2": lambda: exact.period(1.0, -2.0),
    "gamma must be finite and >= 0": lambda: exact.linear(0.0, 1.0, 0.0, 1.0, -0.1),
    "c must be finite and >= 0": lambda: exact.quadratic_turning_point(1.0, -0.1),
    "tau must be finite and >= 0": lambda: exact.damped_amplitude(1.0, 1.0, 1.0, tau=math.inf),
    "friction_ratio must be finite and >= 0": lambda: exact.coulomb_turning_points(1.0, -0.1, 3),
    "n must be a whole number from 0": lambda: exact.coulomb_turning_points_linear(1.0, 0.1, -1),
    "amplitude must lie": lambda: exact.period(3.2, 1.0),
    "method must be one of forward_euler, backward_euler": lambda: exact.euler_energy_factor(1.0, 0.1, "rk4"),
}


@pytest.mark.parametrize("message", BAD)
def test_bad_arguments_are_refused(message: str) -> None:
    with pytest.raises(ValueError, match=f"^{message}"):
        BAD[message]()


def test_a_bob_falls_off_a_slack_wire_until_it_is_taut_again() -> None:
    assert exact.flight(1.0, 9.81, 0.3, 0.0) is None, "the wire is taut"
    assert exact.flight(1.0, 0.0, 3.0, 0.0) is None, "nothing pulls the bob"
    with pytest.raises(SceneError, match="flight overflows"):
        exact.flight(1.0, 9.81, 0.3, 1e300)
    dropped = exact.flight(1.0, 9.81, 3.0, 0.0)
    assert dropped is not None, "from rest near the top the bob falls through the circle"
    assert dropped.angle == pytest.approx(math.asin(math.sin(3.0)))
    assert dropped.time == pytest.approx(math.sqrt(2.0 * 2.0 * math.cos(dropped.angle) / 9.81))


def test_importing_exact_does_not_import_scipy() -> None:
    code = "import sys, pendulum_env.physics.exact; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
