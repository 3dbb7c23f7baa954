"""Test the estimates of quantum and noise on readings of simulated sensors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from pendulum_env.lab import RecordingError, noise_level, quantum_level, scatter_level

TIME = np.arange(0.0, 60.0, 0.05)
SWING = 30.0 * np.exp(-0.01 * TIME) * np.cos(4.0 * TIME)
RNG = np.random.default_rng(0)
FUZZ = 1e-9 * RNG.standard_normal(len(TIME))


def rounded(values: Any, quantum: float) -> Any:
    return quantum * np.round(values / quantum)


READINGS: dict[str, tuple[Any, float, float]] = {
    "quarter degree": (rounded(SWING, 0.25), 0.25, 1e-12),
    "with rounding errors": (rounded(SWING, 0.3) + FUZZ, 0.3, 1e-8),
    "in radians": (rounded(np.radians(SWING), math.tau / 1200), math.tau / 1200, 1e-12),
    "single precision": (rounded(SWING, 0.3).astype(np.float32).astype(float), 0.3, 1e-7),
    "4096 counts, two decimals": (np.round(rounded(SWING, 360 / 4096), 2), 360 / 4096, 1e-4),
    "one decimal": (np.round(SWING, 1), 0.1, 1e-12),
    "two decimals": (np.round(SWING, 2), 0.01, 1e-9),
    "three decimals, few the same": (np.round(SWING, 3), 0.001, 1e-9),
    "noisy before it was rounded": (rounded(SWING + RNG.normal(0, 0.4, len(TIME)), 0.25), 0.25, 1e-12),
    "few levels": (rounded(0.6 * np.cos(4.0 * TIME), 0.25), 0.25, 1e-12),
    "two levels": (np.where(TIME < 30.0, 0.0, 0.25), 0.25, 1e-12),
    "some between the levels": (np.where(np.arange(len(TIME)) % 200 == 7, SWING, rounded(SWING, 0.25)), 0.25, 1e-2),
    "off centre": (rounded(SWING, 0.25) + 0.1234567, 0.25, 1e-12),
    "many turns": (rounded(5000.0 * TIME / 60.0 + SWING, 0.3), 0.3, 1e-9),
}
SMOOTH = {
    "exact": SWING,
    "noisy": SWING + RNG.normal(0, 0.1, len(TIME)),
    "noise alone": RNG.standard_normal(1000),
    "a ramp": 0.1 * np.arange(100.0),
    "a few, two the same": np.array([0.1, 0.35, 0.1, 0.72, 0.9]),
    "at rest": np.zeros(100),
    "two": np.array([0.0, 1.0]),
    "none": np.array([]),
}


@pytest.mark.parametrize("case", READINGS)
def test_the_quantum_is_found(case: str) -> None:
    readings, quantum, error = READINGS[case]
    assert quantum_level(readings) == pytest.approx(quantum, rel=error)


@pytest.mark.parametrize("case", SMOOTH)
def test_no_quantum_is_seen_where_there_is_none(case: str) -> None:
    assert quantum_level(SMOOTH[case]) == 0.0


@pytest.mark.slow
def test_no_quantum_is_seen_in_chance() -> None:
    """Check that 1000 sets of random readings, each value read twice, show no quantum."""
    for seed in range(1000):
        rng = np.random.default_rng(seed)
        values = rng.normal(size=rng.integers(4, 300))
        values[1] = values[0]
        assert quantum_level(values) == 0.0


@pytest.mark.parametrize("uneven", [0.0, 0.8])
def test_scatter_is_that_of_the_noise(uneven: float) -> None:
    """The standard error of a median of independent values is 1.17 sigma / sqrt(n); here n is reduced at most 5-fold.
    """
    rng = np.random.default_rng(4)
    time = TIME + uneven * 0.05 * rng.uniform(-0.5, 0.5, len(TIME))
    angle = 0.5 * np.cos(4.0 * time) + 0.01 * rng.standard_normal(len(time))
    assert scatter_level(time, angle) == pytest.approx(0.01, rel=3 * 1.17 * math.sqrt(5 / len(time)))


def test_noise_is_the_larger_of_scatter_and_quantum() -> None:
    fine = np.arange(0.0, 10.0, 0.001)
    steps = rounded(np.cos(0.4 * fine), 0.01)
    assert scatter_level(fine, steps) < 1e-15
    assert noise_level(fine, steps) == pytest.approx(0.01 / math.sqrt(12))
    noisy = steps + RNG.normal(0, 0.02, len(fine))
    assert noise_level(fine, noisy) == scatter_level(fine, noisy) > 0.01 / math.sqrt(12)
    assert noise_level([0.0, 1.0, 2.0], [0.0, 0.1, 0.2]) == 0.0


def test_what_is_no_readings_is_refused() -> None:
    with pytest.raises(RecordingError, match="must be an array of numbers"):
        quantum_level("x")
    with pytest.raises(RecordingError, match="must be finite"):
        quantum_level([1.0, math.nan, 2.0])
    with pytest.raises(RecordingError, match="arrays of one length"):
        noise_level([0.0, 1.0], [0.0])
