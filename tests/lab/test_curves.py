"""Curves between the steps of simulated runs: those of scipy; and batches, in which a run does not depend on others."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from pendulum_env import Scene
from pendulum_env.lab.fitting.model import Model, between, spline_slopes
from pendulum_env.lab.fitting.shooting import jacobian, linearised
from pendulum_env.lab.inertial import Mount
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity

STEP, COUNT = 0.07, 40
STEPS = STEP * np.arange(COUNT)
VALUES = np.random.default_rng(3).standard_normal((COUNT, 3))


def test_slopes_are_those_of_a_spline() -> None:
    theirs = CubicSpline(STEPS, VALUES)(STEPS, 1)
    np.testing.assert_allclose(spline_slopes(VALUES, STEP), theirs, rtol=1e-12, atol=1e-11)
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0])
    np.testing.assert_allclose(spline_slopes(cubic(STEPS)[:4, None], STEP)[:, 0], cubic.deriv()(STEPS[:4]), rtol=1e-12)


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_interpolated_curves_are_hermites(derivative: int) -> None:
    slopes = np.random.default_rng(4).standard_normal(VALUES.shape)
    time = np.sort(np.random.default_rng(5).uniform(0.0, STEPS[-1], 200))
    found = between(time, STEP, COUNT, derivative) @ np.concatenate([VALUES, slopes])
    np.testing.assert_allclose(found, CubicHermiteSpline(STEPS, VALUES, slopes)(time, derivative), rtol=1e-9, atol=1e-8)
    if derivative < 2:
        ends = between(STEPS[[0, -1]], STEP, COUNT, derivative) @ np.concatenate([VALUES, slopes])
        np.testing.assert_allclose(ends, (VALUES, slopes)[derivative][[0, -1]], rtol=1e-9, atol=1e-9)


@pytest.mark.quick("rate")
@pytest.mark.parametrize("sensor", ["angle", "rate", "force"])
def test_a_run_is_the_same_in_every_batch(sensor: str) -> None:
    """Of one run, of eight with the extra one, and of more, that fill up the batch: the same bits."""
    mount = Mount(0.0, 1.0, 0.5) if sensor == "force" else None
    scene = Scene("test", Body(length=0.5, mass=0.1), effects=(Gravity(),))
    model = Model.of(scene, ("linear",), np.linspace(0.0, 3.0, 200),
                     rate=sensor == "rate", mount=mount)
    values = np.array([0.4, 0.1, 0.01, 0.5, 0.02])
    rows = values + 1e-3 * np.arange(16)[:, None] * np.array([1.0, 1.0, 0.0, 0.0, 1.0])
    whole = model.angles(rows)
    for count in (1, 7, 9):
        np.testing.assert_array_equal(model.angles(rows[:count]), whole[:count])
    readings, slopes = linearised(model, values)
    np.testing.assert_array_equal(readings, whole[0])
    central = jacobian(model, values)
    scale = np.abs(central).max(axis=0)
    np.testing.assert_allclose(slopes / scale, central / scale, atol=1e-5)
    rises = model.motion(values)[1][0]
    fine = np.gradient(readings, model.time, edge_order=2)
    assert math.sqrt(np.mean((rises - fine)[2:-2] ** 2)) < 1e-2 * np.abs(rises).max()


def test_trial_values_of_no_pendulum_have_no_readings() -> None:
    """A search may try a length of 0, its bound; it then goes on with a shorter step (seed 176 of fit_coverage.py)."""
    model = Model.of(Scene("test", Body(length=0.5, mass=0.1), effects=(Gravity(),)), ("linear",), STEPS)
    place = model.names.index("length")
    values = np.full(len(model.names), 0.1)
    values[place] = model.least[place]
    readings, slopes = linearised(model, values)
    assert values[place] == 0.0
    assert np.isnan(readings).all()
    assert not slopes.any()
