"""Tests of a pivot shaken up and down: stability of both equilibria against Mathieu's theory and Kapitza's limit."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b

from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.machine import ANGLE, TURNS, VELOCITY, Machine
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity, VerticalDrive

pytestmark = pytest.mark.slow

RATE, STEPS, SMALL = 20.0, 100, 1e-7
RATIOS = (0.01, 0.05, 0.15)
"""Ratios of omega0 to the angular frequency Omega of the pivot."""


def shaken(ratio: float, amplitude: float) -> Scene:
    """Return a scene of 1 m length with omega0 = ratio * RATE and a pivot shaken by ``amplitude`` [m]."""
    drive = VerticalDrive(vertical_amplitude=amplitude, vertical_rate=RATE)
    return Scene(body=Body(length=1.0, mass=1.0), effects=(Gravity(), drive), gravity=(ratio * RATE) ** 2)


def one_period(scene: Scene, top: bool) -> np.ndarray:
    """Return the linear map of a small (angle, velocity/Omega) at an equilibrium over one period of the pivot."""
    machine, columns = Machine(scene, "dop853", diagnostics=()), []
    for angle, velocity in ((SMALL, 0.0), (0.0, SMALL * RATE)):
        state = machine.state(0.0, velocity)
        state[ANGLE], state[TURNS] = angle, 0.5 if top else 0.0
        machine.advance(state, 0.0, 2.0 * math.pi / RATE / STEPS, STEPS)
        columns.append((state[ANGLE] / SMALL, state[VELOCITY] / SMALL / RATE))
    return np.array(columns).T


def trace(ratio: float, amplitude: float, top: bool) -> float:
    """Return the trace of the period map: the equilibrium is stable if it is between -2 and 2 (Floquet)."""
    matrix = one_period(shaken(ratio, amplitude), top)
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=1e-9)
    return float(np.trace(matrix))


def edge(excess: Callable[[float], float], low: float, high: float) -> float:
    return float(brentq(excess, low, high, xtol=1e-11))


# theta'' = -(omega0² - (b/L) Omega² cos(Omega t)) theta is Mathieu's y'' + (a - 2 q cos 2 tau) y = 0 with
# a = 4 (omega0/Omega)², q = 2 b/L, tau = Omega t/2 up to a shift; next to the top a has the other sign.


@pytest.mark.parametrize("ratio", RATIOS)
def test_upright_is_stable_between_mathieus_limits(ratio: float) -> None:
    """Check that upright is stable from a = a_0(q) to a = b_1(q) (McLachlan 1947; DLMF 28.17), to nine digits."""
    lower = edge(lambda b: trace(ratio, b, True) - 2.0, 0.5 * ratio, 2.5 * ratio)
    upper = edge(lambda b: trace(ratio, b, True) + 2.0, 0.35, 0.55)
    assert lower == pytest.approx(edge(lambda b: mathieu_a(0, 2.0 * b) + 4.0 * ratio**2, 1e-4, 0.5), rel=1e-7)
    assert upper == pytest.approx(edge(lambda b: mathieu_b(1, 2.0 * b) + 4.0 * ratio**2, 0.3, 0.6), rel=1e-7)
    assert abs(trace(ratio, 0.9 * lower, True)) > 2.0 > abs(trace(ratio, 1.1 * lower, True))
    assert abs(trace(ratio, 0.97 * upper, True)) < 2.0 < abs(trace(ratio, 1.03 * upper, True))


@pytest.mark.parametrize("ratio", RATIOS)
def test_the_lower_limit_is_kapitzas_for_fast_shaking(ratio: float) -> None:
    """Check Kapitza's limit Omega b = sqrt(2 g L) (1 + (7/16) (omega0/Omega)² + ...) (Kapitza 1951; DLMF 28.6)."""
    lower = edge(lambda b: trace(ratio, b, True) - 2.0, 0.5 * ratio, 2.5 * ratio)
    kapitza = math.sqrt(2.0) * ratio
    assert lower / kapitza - 1.0 == pytest.approx(7.0 / 16.0 * ratio**2, rel=2.0 * ratio**2, abs=1e-7)
    assert SCENES["kapitza"].effects[-1].number(SCENES["kapitza"], 0.1) == pytest.approx(4.0 / (2 * 9.81 * 0.1))


@pytest.mark.parametrize("amplitude", [0.02, 0.1, 0.25])
def test_the_bottom_is_pumped_between_mathieus_limits(amplitude: float) -> None:
    """Check that the bottom is unstable around Omega = 2 omega0, from a = b_1(q) to a_1(q)."""
    tongue = [edge(lambda r: trace(r, amplitude, False) + 2.0, *ends) for ends in ((0.3, 0.5), (0.5, 0.7))]
    limits = math.sqrt(mathieu_b(1, 2.0 * amplitude)) / 2.0, math.sqrt(mathieu_a(1, 2.0 * amplitude)) / 2.0
    assert tongue == pytest.approx(limits, rel=1e-7)
    assert trace(0.5, amplitude, False) < -2.0


@pytest.mark.parametrize("amplitude", [0.004, 0.01])
@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.2])
def test_the_slow_swing_is_that_of_the_mean_potential(ratio: float, amplitude: float) -> None:
    """Check the slow swing's omega² = omega0² + (b/L)² Omega⁴/(2 (Omega² - 4 omega0²)) up to (b/L)⁴ (DLMF 28.15)."""
    omega = math.acos(0.5 * trace(ratio, amplitude, False)) / (2.0 * math.pi)
    wanted = ratio**2 + amplitude**2 / (2.0 * (1.0 - 4.0 * ratio**2))
    assert omega**2 == pytest.approx(wanted, abs=2.0 * amplitude**4 + 1e-11)


@pytest.mark.parametrize(("share", "stays"), [(0.96, False), (1.04, True)])
def test_the_whole_pendulum_stays_up_or_falls(share: float, stays: bool) -> None:
    """Check that a pendulum 0.02 rad from the top stays up above Kapitza's limit and falls below it."""
    scene = shaken(0.05, share * math.sqrt(2.0) * 0.05)
    r = rollout(scene, angle=math.pi - 0.02, velocity=0.0, dt=0.005, duration=100.0)
    assert (np.max(np.abs(r.angle - math.pi)) < 0.2) == stays


def test_the_preset_comes_to_rest_upright() -> None:
    r = rollout("kapitza", duration=20.0)
    assert np.max(np.abs(r.angle - math.pi)) < 1.0
    assert np.max(np.abs(r.angle[-1000:] - math.pi)) < 0.01
    fallen = rollout("kapitza", duration=20.0, vertical_rate=60.0, dt=0.002)
    assert np.max(np.abs(fallen.angle[-1000:])) < 0.1
