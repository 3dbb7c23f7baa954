"""Test that the error of a fitted length allows for a drift of the amplitude-corrected period.

Recordings whose scale, zero or pivot drifts are simulated by scipy; the lengths of their halves must agree.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from virtual_swings import GRAVITY, MASS, even, recorded, swing

from pendulum_env.lab import Recording
from pendulum_env.lab.fitting.fit import fit

Array = NDArray[np.float64]
COUNT = 90


def sinking(time: Array, angle: float, length: float, gamma: float, drift: float) -> Array:
    """Return the swing of a pendulum whose length grows by the relative amount ``drift`` over the run, linearly."""
    end = float(time[-1])

    def slope(t: float, y: Array) -> list[float]:
        now, rate = length * (1.0 + drift * (t / end - 0.5)), length * drift / end
        return [y[1], -GRAVITY / now * math.sin(y[0]) - (gamma + 2.0 * rate / now) * y[1]]

    return np.asarray(solve_ivp(slope, (0.0, end), [angle, 0.0], "DOP853", time, rtol=1e-9, atol=1e-11).y[0])


def drifting(kind: str, seed: int) -> Recording:
    """Return a simulated recording in which the sensor's scale or zero, or the pivot's height, drifts by 1 to 4 %."""
    source = np.random.default_rng(seed)
    angle, length = math.radians(source.uniform(10.0, 60.0)), source.uniform(0.3, 1.0)
    drift = source.uniform(0.01, 0.04) * source.choice([-1.0, 1.0])
    span = source.uniform(15.0, 30.0) * math.tau * math.sqrt(length / GRAVITY) if seed % 2 else 80.0
    time = even(span, source.uniform(20.0, 40.0))
    clean = sinking(time, angle, length, 2.0 * source.uniform(0.3, 2.0) / span, drift if kind == "pivot" else 0.0)
    later = drift * time / span
    seen = clean * (1.0 + later) if kind == "scale" else clean + angle * later if kind == "zero" else clean
    return recorded(time, seen, noise=math.radians(source.uniform(0.05, 0.3)),
                    quantum=math.radians(source.choice([0.0, 0.1, 0.25])), seed=seed)


@pytest.mark.slow
def test_a_scale_that_changes_enlarges_the_error_of_the_length() -> None:
    """A scale that rises by 1.4 % changes the period most in the middle, so that the period seems not to drift."""
    time = even(40.0, 60.0)
    clean = swing(time, math.radians(49.2), length=0.353, gamma=0.0556)
    right, rising = (fit(recorded(time, clean * (1.0 + rise * time), noise=math.radians(0.1), seed=1), "linear",
                         mass=MASS) for rise in (0.0, 3.5e-4))
    length = rising.parameters["length"]
    assert 10.0 * right.parameters["length"].error < abs(length.value - 0.353) < 3.0 * length.error


@pytest.mark.slow
@pytest.mark.usefixtures("no_remedies")
def test_the_lengths_of_both_halves_agree_within_three_errors_in_92_per_cent() -> None:
    """With errors of independent readings, half of the differences are above three errors, and some above ten. Six of
    the 90 halves show no more of a drift than the noise does, and their lengths are three to nine errors apart."""
    pulls = []
    for seed in range(COUNT):
        whole = drifting(("scale", "zero", "pivot")[seed % 3], seed)
        middle = 0.5 * whole.time[-1]
        first, last = (
            fit(Recording(whole.time[part] - whole.time[part][0], whole.angle[part], "half"), "linear", mass=MASS
                ).parameters["length"] for part in (whole.time <= middle, whole.time > middle))
        pulls.append((first.value - last.value) / math.hypot(first.error, last.error))
    assert np.mean(np.abs(pulls) < 3.0) >= 0.92
    assert np.max(np.abs(pulls)) < 10.0


@pytest.mark.usefixtures("no_remedies")
def test_the_drift_of_the_period_is_found_and_widens_the_error_of_the_length() -> None:
    """A length that grows by 2 % has a period that grows by 1 %. Spread evenly, its error is 2 % / sqrt(12); it is
    taken for as large as that, and for no more than the whole growth."""
    time = even(25.0, 40.0)
    seen = recorded(time, sinking(time, 0.4, 0.5, 0.03, 0.02), noise=math.radians(0.1))
    found = fit(seen, "linear", mass=MASS)
    drift = found.errors.drift
    assert drift is not None
    assert drift.value == pytest.approx(0.01, rel=0.03)
    assert drift.error < 1e-3
    assert 0.5 * 0.02 / math.sqrt(12.0) < found.parameters["length"].error < 0.5 * 0.02


@pytest.mark.slow
def test_a_free_scale_takes_the_drift_away() -> None:
    """A scale that is 3 % too large at 50 degrees makes the corrected period drift."""
    time = even(30.0, 40.0)
    seen = recorded(time, swing(time, math.radians(50.0), length=0.5, gamma=0.08), noise=math.radians(0.1), scale=1.03)
    plain, scaled = (fit(seen, "linear", mass=MASS, free=free) for free in (("length",), ("length", "scale")))
    assert plain.errors.drift is not None
    assert scaled.errors.drift is not None
    assert plain.errors.drift.value > 2e-3 > 4.0 * abs(scaled.errors.drift.value)
    for found in (plain, scaled):
        assert abs(found.parameters["length"].value - 0.5) < 4.0 * found.parameters["length"].error
    assert 10.0 * scaled.parameters["length"].error < plain.parameters["length"].error
