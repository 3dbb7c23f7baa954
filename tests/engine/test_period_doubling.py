"""Driven pendulum's route to chaos: theta'' + theta'/q + sin(theta) = g cos(omega_D t), q = 2, omega_D = 2/3.

Published: Baker & Gollub 1996, Chaotic Dynamics, chapter 3, doubling near g = 1.066, chaos at 1.15 and 1.5; Giordano &
Nakanishi 2006, Computational Physics, section 3.3, the same equation at 1.4, 1.44 and 1.465.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from pendulum_env import SCENES, rollout
from pendulum_env.engine.machine import ANGLE, TURNS, VELOCITY, Machine

PERIOD, STEPS = 3.0 * math.pi, 200


def section(strength: float, periods: int = 700, kept: int = 128) -> np.ndarray:
    """Return the Poincaré section: the last states (angle within a turn, velocity), one per period of the drive."""
    r = rollout("chaotic", drive_torque=strength, dt=PERIOD / STEPS, every=STEPS, duration=periods * PERIOD)
    return np.stack([np.remainder(r.angle[-kept:], 2.0 * math.pi), r.velocity[-kept:]], axis=1)


def period_of(points: np.ndarray) -> int:
    """Return the number of drive periods after which the motion repeats, 0 if it does not."""
    x = np.column_stack([np.cos(points[:, 0]), np.sin(points[:, 0]), points[:, 1]])
    return next((n for n in range(1, 33) if np.max(np.abs(x[n:] - x[:-n])) < 1e-5), 0)


def test_the_preset_is_the_equation_of_the_book() -> None:
    scene = SCENES["chaotic"]
    assert scene.omega0 == 1.0
    assert scene.coefficients == {
        "gravity_rate": 1.0, "linear_drag_rate": 0.5, "drive_strength": 1.5, "drive_rate": 2.0 / 3.0, "drive_phase": 0.0
    }
    assert scene.replace(drive_torque=1.07).coefficients["drive_strength"] == 1.07


@pytest.mark.slow
@pytest.mark.parametrize(("strength", "period"), [(0.9, 1), (1.05, 1), (1.07, 2), (1.4, 1), (1.44, 2), (1.465, 4)])
def test_the_period_doubles_where_it_was_published(strength: float, period: int) -> None:
    assert period_of(section(strength)) == period


@pytest.mark.slow
@pytest.mark.parametrize("strength", [1.15, 1.2, 1.5])
def test_chaos_is_where_it_was_published(strength: float) -> None:
    """Check that the motion is chaotic where it is published: no repetition, and neighbouring starts diverge."""
    assert period_of(section(strength)) == 0
    starts = [rollout("chaotic", drive_torque=strength, angle=angle, dt=PERIOD / STEPS, every=STEPS,
                      duration=40 * PERIOD) for angle in (0.2, 0.2 + 1e-9)]
    apart = np.abs(starts[1].angle - starts[0].angle)
    assert np.max(apart) > 1e6 * apart[0]


@pytest.mark.slow
def test_the_first_doubling_is_near_1_066() -> None:
    """Check by bisection that the first period doubling is near g = 1.066; close to it the motion settles slowly."""
    low, high = 1.06, 1.07
    for _ in range(4):
        middle = 0.5 * (low + high)
        one = period_of(section(middle, periods=3000)) == 1
        low, high = (middle, high) if one else (low, middle)
    assert 0.5 * (low + high) == pytest.approx(1.066, abs=0.001)


@pytest.mark.slow
@pytest.mark.parametrize("strength", [0.9, 1.07, 1.15, 1.5])
def test_the_lyapunov_exponents_sum_to_minus_one_over_q(strength: float) -> None:
    """Check that the Lyapunov exponents sum to -1/q: the flow shrinks areas by exp(-t/q)."""
    machine = Machine(SCENES["chaotic"].replace(drive_torque=strength), "dop853", diagnostics=())

    def after(angle: float, velocity: float) -> np.ndarray:
        state = machine.state(angle, velocity)
        machine.advance(state, 0.0, PERIOD / STEPS, STEPS)
        return np.array([state[ANGLE] + 2.0 * math.pi * state[TURNS], state[VELOCITY]])

    for angle, velocity in ((0.2, 0.0), (-1.0, 1.5), (2.5, -0.7), (3.0, 2.0)):
        d = 1e-4
        pairs = [((after(angle + k * d, velocity) - after(angle - k * d, velocity)) / (2 * k * d),
                  (after(angle, velocity + k * d) - after(angle, velocity - k * d)) / (2 * k * d)) for k in (1, 2)]
        jacobian = np.array([(4.0 * one - two) / 3.0 for one, two in zip(*pairs, strict=True)])
        assert np.linalg.det(jacobian) == pytest.approx(math.exp(-1.5 * math.pi), rel=1e-6)
