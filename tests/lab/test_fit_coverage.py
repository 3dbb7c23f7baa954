"""Test that 90 to 99 % of the 95 % intervals of 300 simulated recordings contain the truth; the benchmark covers all
models."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "examples" / "benchmarks"
RUNS = 300
SHORT = {"periods": 10.0, "rate": 25.0}
"""Settings of a short study; length, amplitude, losses, quantum and noise are drawn at random."""


@pytest.fixture(scope="module")
def coverage() -> Iterator[Any]:
    sys.path.insert(0, str(BENCHMARKS))
    import fit_coverage

    yield fit_coverage
    sys.path.remove(str(BENCHMARKS))
    for name in ("fit_coverage", "machine"):
        del sys.modules[name]


@pytest.mark.slow
@pytest.mark.parametrize("model", ["linear", "coulomb"])
def test_intervals_hold_the_truth(coverage: Any, model: str) -> None:
    """Of 300 intervals at 95 %, 285 ± 3.8 should contain the truth; 270 and 297 are four and three standard deviations
    away, with fixed seeds. The rms of 300 deviations should be 1 ± 0.04 errors; the limits allow four of these, and the
    effects of Student's t and of rounding."""
    rows = [{"model": model, **coverage.one({"model": model, "seed": seed, "fixed": SHORT})} for seed in range(RUNS)]
    assert not [row["failed"] for row in rows if row.get("failed")]
    found = coverage.shares(rows, model)
    assert [name for name, *_ in found][:4] == ["angle", "velocity", "zero", "length"]
    for name, count, share, narrow, rms, _ in found:
        assert count == RUNS
        assert coverage.GOAL[0] <= share <= coverage.GOAL[1], name
        assert 0.60 <= narrow <= 0.76, name
        assert 0.84 <= rms <= 1.16, name


@pytest.mark.usefixtures("interpreted")
def test_what_is_drawn_is_what_is_recorded(coverage: Any) -> None:
    """For small losses the simulated recording is ``zero + A cos(omega0 t)``, with the returned true values A, 0 and L.
    """
    fixed = {"amplitude": 1.0, "quantum": 0.0, "noise": 0.0, "loss": 1e-6, "length": 0.5, "periods": 12.0}
    scene, recording, truth = coverage.drawn("linear", 3, fixed)
    angle = np.radians(1.0)
    omega = scene.omega0 * (1.0 - angle**2 / 16.0)
    assert recording.time[-1] == pytest.approx(12.0 * 2.0 * np.pi / scene.omega0, rel=0.01)
    np.testing.assert_allclose(recording.angle, angle * np.cos(omega * recording.time) - angle, atol=2e-6)
    assert (truth["angle"], truth["velocity"], truth["zero"], truth["length"]) == pytest.approx(
        (angle, 0.0, -angle, 0.5), abs=1e-12)
    other = coverage.drawn("linear+quadratic+coulomb", 3, {})[2]
    assert {"linear_drag.gamma", "quadratic_drag.c", "coulomb_friction.friction_torque"} < set(other)
    with pytest.raises(SystemExit):
        coverage.main(["--runs", "x"])
