"""Test standard errors if rounding does not act like noise, because successive swings are rounded in the same way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from virtual_swings import MASS, even, recorded, swing

from pendulum_env.lab.fitting.errors import noise_beside, rounding_covariance
from pendulum_env.lab.fitting.fit import fit

QUANTUM = math.radians(0.25)
LENGTH, GAMMA = 0.5, 0.002


def waves(amplitude: float, zero: float, phase: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return 40 swings sampled at the same 28 phases, with derivatives by amplitude and zero, and by time per reading.
    """
    turn = math.tau * (np.arange(28 * 40) + phase) / 28.0
    slopes = np.stack([np.cos(turn), np.ones_like(turn)], axis=1)
    return zero + amplitude * np.cos(turn), slopes, -amplitude * np.sin(turn) * math.tau / 28.0


@pytest.mark.quick("0.1")
@pytest.mark.parametrize("noise", [0.0, 0.1, 1.0])
def test_errors_of_a_wave_that_repeats_are_those_of_many_such(noise: float) -> None:
    """Compare with least-squares lines through 2000 rounded waves, by numpy.

    With noise of a quantum, rounding acts like noise of variance ``q² / 12``; without noise, 40 swings give no more
    information than one.
    """
    source, sharp = np.random.default_rng(1), 3.0 * noise > 1.0
    errors = []
    for _ in range(2000):
        amplitude, zero, phase = 12.0 + source.uniform(-0.5, 0.5), *source.uniform(-0.5, 0.5, 2)
        seen, slopes, _shift = waves(amplitude, zero, phase)
        read = np.round(seen + noise * source.standard_normal(len(seen)))
        errors.append(np.linalg.lstsq(slopes, read, rcond=None)[0] - [amplitude, zero])
    seen, slopes, shift = waves(12.0, 0.0, 0.0)
    inverse = np.linalg.inv(slopes.T @ slopes)
    found = np.sqrt(np.diag(rounding_covariance(seen, slopes, inverse, 1.0, noise, shift)))
    np.testing.assert_allclose(found, np.sqrt(np.mean(np.square(errors), axis=0)), rtol=0.15)
    like_noise = np.sqrt((noise**2 + 1.0 / 12.0) * np.diag(inverse))
    np.testing.assert_allclose(found, like_noise, rtol=0.15) if sharp else np.testing.assert_array_less(
        2.0 * like_noise, found)


def test_the_noise_beside_a_quantum() -> None:
    """For 20 000 readings with noise and rounding, the noise is estimated to 5 %. With rounding alone the estimate is
    0, even if successive readings differ by half a quantum, so that neighbours show a larger scatter."""
    source, time = np.random.default_rng(2), np.arange(20_000) * 0.01
    slow = 12.0 * np.cos(1e-3 * np.arange(20_000))
    both = np.round(slow + 0.8 * source.standard_normal(20_000)) - slow
    assert noise_beside(time, both, 1.0) == pytest.approx(0.8, rel=0.05)
    ramp = 0.47 * np.arange(20_000)
    assert noise_beside(time, np.round(ramp) - ramp, 1.0) < 0.03


@pytest.mark.slow
def test_three_degrees_that_hardly_decay_at_a_quarter_of_a_degree() -> None:
    """The amplitude falls by less than a quantum in 70 s, so the error of its decay exceeds that for random errors."""
    pulls, plain = [], []
    time = even(70.0, 20.0)
    for seed in range(8):
        source = np.random.default_rng(seed)
        length = LENGTH * (1.0 + 0.2 * source.uniform(-1.0, 1.0))
        angle = swing(time, math.radians(3.0) * (1.0 + 0.1 * source.uniform(-1.0, 1.0)), length=length, gamma=GAMMA)
        seen = recorded(time, angle, quantum=QUANTUM, zero=QUANTUM * source.uniform(-0.5, 0.5))
        found = fit(seen, "linear", mass=MASS)
        at = found.names.index("linear_drag.gamma")
        off = np.array([found.values[at] - GAMMA, found.parameters["length"].value - length])
        pulls.append(off / [found.parameters[name].error for name in ("linear_drag.gamma", "length")])
        plain.append(off[0] / math.sqrt(found.errors.plain[at, at]))
    assert np.sqrt(np.mean(np.square(plain))) > 2.0
    assert np.sqrt(np.mean(np.square(pulls), axis=0)).max() < 1.5
    assert np.abs(pulls).max() < 3.5
    assert "steps of 0.25 degrees enlarge the error of" in found.how
    assert "linear_drag.gamma" in found.how


@pytest.mark.slow
def test_a_decay_through_many_quanta_is_left_as_it_was() -> None:
    time = even(60.0, 20.0)
    seen = recorded(time, swing(time, 0.35, length=LENGTH, gamma=0.05), quantum=QUANTUM, noise=0.5 * QUANTUM)
    found = fit(seen, "linear", mass=MASS)
    np.testing.assert_allclose(np.diag(found.covariance), np.diag(found.errors.plain), rtol=0.5)
    assert "rounded in nearly the same way" not in found.how
