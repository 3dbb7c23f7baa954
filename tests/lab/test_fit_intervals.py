"""Test profiles, bootstraps and random draws of fitted parameters, against published intervals and closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import norm

from pendulum_env import Scene, rollout
from pendulum_env.lab import Recording, RecordingError
from pendulum_env.lab.fitting import shooting
from pendulum_env.lab.fitting.model import Model
from pendulum_env.lab.fitting.result import Fit
from pendulum_env.lab.fitting.shooting import FitSolution
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity
from pendulum_env.physics.units import SceneError

CONCENTRATION = np.repeat([0.02, 0.06, 0.11, 0.22, 0.56, 1.10], 2)
RATE = np.array([76.0, 47.0, 97.0, 107.0, 123.0, 139.0, 159.0, 152.0, 191.0, 201.0, 207.0, 200.0])


def curve(names: tuple[str, ...], formula: Callable[[Any], Any], least: float = -math.inf) -> Any:
    """Return a model with the given formula, a function of ``(runs, parameters)`` that returns ``(runs, readings)``."""
    return SimpleNamespace(names=names, least=np.full(len(names), least),
                           angles=lambda values: np.stack([formula(row) for row in np.atleast_2d(values)]))


def slopes_of(model: Any, values: Any) -> Any:
    steps = np.diag(1e-6 * np.maximum(np.abs(values), 1e-3))
    return (model.angles(values + steps) - model.angles(values - steps)).T / (2.0 * np.diag(steps))


def fitted(model: Any, readings: Any, start: Any, swing: int = 0) -> Fit:
    """Return a least-squares fit by scipy, to readings with a turning point every ``swing``, or none for 0."""
    found = least_squares(lambda x: model.angles(x)[0] - readings, start, bounds=(model.least - 1e-300, np.inf),
                          x_scale=np.abs(start) + 1e-3, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    values = np.maximum(found.x, model.least)
    velocity = np.where((np.arange(len(readings)) // swing) % 2, -1.0, 1.0) if swing else np.ones(len(readings))
    recording = Recording(np.arange(float(len(readings))), readings, "readings")
    residual, model.time = readings - model.angles(values)[0], recording.time
    return Fit(recording, FitSolution(model, values, residual, slopes_of(model, values), velocity, math.inf), 1.0)


@pytest.fixture(autouse=True)
def plain_slopes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shooting, "jacobian", slopes_of)


@pytest.fixture(scope="module")
def puromycin() -> Fit:
    """Fit the treated cells of Bates & Watts 1988, table A1.3: velocity ``V c / (K + c)`` of a reaction."""
    return fitted(curve(("V", "K"), lambda x: x[0] * CONCENTRATION / (x[1] + CONCENTRATION)), RATE, [205.0, 0.08])


# --- published intervals -------------------------------------------------------------------------------------------


def test_errors_of_a_published_fit(puromycin: Fit) -> None:
    """Bates & Watts 1988, section 2.2, give 212.7 ± 6.947, 0.06412 ± 0.008281, s = 10.93 and 10 degrees of freedom."""
    assert puromycin.values == pytest.approx([212.7, 0.06412], rel=1e-4)
    assert np.sqrt(np.diag(puromycin.covariance)) == pytest.approx([6.947, 0.008281], rel=2e-4)
    variance = puromycin.residual @ puromycin.residual / puromycin.degrees_of_freedom
    assert math.sqrt(variance) == pytest.approx(10.93, rel=1e-3)
    assert puromycin.interval("V") == pytest.approx((212.684 - 2.2281 * 6.947, 212.684 + 2.2281 * 6.947), rel=1e-4)
    assert puromycin.correlation("V", "K") == pytest.approx(0.7651, abs=1e-3)
    np.testing.assert_allclose(np.diag(puromycin.correlations), 1.0)


def test_profiles_of_a_published_fit(puromycin: Fit) -> None:
    """For these data, ``confint`` of R's ``nls`` gives V from 197.302 to 229.290 and K from 0.046925 to 0.086160."""
    assert puromycin.profile("V") == pytest.approx((197.302, 229.290), rel=2e-4)
    told: list[tuple[float, str]] = []
    assert puromycin.profile("K", progress=lambda *words: told.append(words)) == pytest.approx(
        (0.046925, 0.086160), rel=1e-3)
    assert told == [(0.0, "lower end of K"), (0.5, "upper end of K")]


def test_a_profile_that_finds_a_better_fit_says_so(puromycin: Fit) -> None:
    values = puromycin.values * np.array([1.1, 1.0])
    residual = RATE - puromycin.model.angles(values)[0]
    early = replace(puromycin, solution=replace(puromycin.solution, values=values, residual=residual))
    with pytest.warns(UserWarning, match="profile of K reached a smaller sum of squares"):
        early.profile("K")


@pytest.mark.parametrize("level", [0.5, 0.68, 0.999])
def test_profiles_by_a_search_of_the_sum_of_squares(puromycin: Fit, level: float) -> None:
    """For a given K, the best V follows by linear least squares; the interval ends where ``RSS(K)`` has risen by ``F
    s²``."""
    from scipy.stats import f

    grid = np.linspace(0.02, 0.16, 28_001)
    shapes = CONCENTRATION / (grid[:, None] + CONCENTRATION)
    squares = RATE @ RATE - (shapes @ RATE) ** 2 / np.sum(shapes**2, axis=1)
    inside = grid[squares <= squares.min() * (1.0 + f.ppf(level, 1, 10) / 10)]
    assert puromycin.profile("K", level) == pytest.approx((inside[0], inside[-1]), rel=1e-3)


def test_a_profile_ends_at_the_bound_and_may_have_no_end() -> None:
    """Fitting ``a exp(-b t)`` to noise about 0 gives no information on ``b``: no sum of squares is too large."""
    time, source = np.arange(40.0), np.random.default_rng(3)
    decay = curve(("a", "b"), lambda x: x[0] * np.exp(-x[1] * time), 0.0)
    straight = fitted(decay, 1.0 + 0.1 * source.standard_normal(40), [1.0, 0.01])
    low, high = straight.profile("b")
    assert low == 0.0
    assert straight.values[1] < high < 0.01
    noise = fitted(decay, 0.2 + source.standard_normal(40), [0.2, 0.1])
    assert noise.profile("b").high == math.inf


def test_intervals_of_correlated_residuals_are_as_wide_by_profile() -> None:
    """For a linear model, both intervals are ``t error``, however the errors were calculated."""
    source = np.random.default_rng(5)
    noise = np.convolve(source.standard_normal(420), np.ones(20) / 20, mode="full")[20:420]
    time = np.arange(400.0) / 400
    line = curve(("a", "b"), lambda x: x[0] + x[1] * time)
    found = fitted(line, 1.0 + noise, [1.0, 0.0], swing=5)
    assert found.covariance[0, 0] > 4.0 * found.errors.plain[0, 0]
    assert found.profile("b") == pytest.approx(found.interval("b"), rel=2e-3)


def test_words_and_levels_that_cannot_be(puromycin: Fit) -> None:
    with pytest.raises(RecordingError, match="'v' was not fitted; there are V, K"):
        puromycin.interval("v")
    with pytest.raises(SceneError, match="level must be below 1"):
        puromycin.profile("V", 1.0)
    with pytest.raises(SceneError, match="level must be a finite number above 0"):
        puromycin.interval("V", 0.0)
    with pytest.raises(SceneError, match="n must be a whole number from 1"):
        puromycin.bootstrap(0)
    with pytest.raises(SceneError, match="seed must be a whole number from 0"):
        puromycin.sample(3, seed=-1)


# --- bootstrap -----------------------------------------------------------------------------------------------------


def line_fit(seed: int, factor: float, n: int = 400) -> Fit:
    """Return a fit of a constant and an oscillation to an AR(1) process of unit variance."""
    white = math.sqrt(1.0 - factor**2) * np.random.default_rng(seed).standard_normal(n + 200)
    noise = lfilter([1.0], [1.0, -factor], white)
    wave = np.cos(0.3 * np.arange(n))
    return fitted(curve(("a", "b"), lambda x: x[0] + x[1] * wave), 2.0 + noise[200:], [1.0, 0.0], swing=10)


@pytest.mark.slow
def test_the_bootstrap_of_independent_residuals_is_least_squares() -> None:
    """1000 refits give a variance to 5 %, and blocks of 16 of 4000 readings give the variance of white noise to 7 %."""
    found = line_fit(1, 0.0, 4000)
    drawn = found.bootstrap(1000, seed=2)
    assert drawn.values.shape == (1000, 2)
    assert drawn.block == 16
    np.testing.assert_allclose(np.diag(drawn.covariance), np.diag(found.errors.plain), rtol=0.2)
    np.testing.assert_allclose(drawn.interval("a"), found.interval("a"), atol=0.25 * math.sqrt(found.covariance[0, 0]))
    np.testing.assert_array_equal(drawn.values[:5], found.bootstrap(5, seed=2).values)


@pytest.mark.slow
def test_the_bootstrap_of_correlated_residuals_keeps_them() -> None:
    """The mean of an AR(1) process with rho = 0.9 has 19 times the variance for independent readings.

    Blocks of 5 correlation times of 9.5 reproduce it to a fifth, with a statistical error of 10 %; blocks of 6000^(1/3)
    readings would lose half of it.
    """
    drawn = line_fit(3, 0.9, 6000).bootstrap(400)
    assert 40 < drawn.block < 56
    assert drawn.covariance[0, 0] == pytest.approx(0.8 * (1.9 / 0.1) / 6000, rel=0.3)


def test_a_bootstrap_that_is_interrupted_keeps_what_it_has() -> None:
    told: list[float] = []

    def tell(done: float, what: str) -> None:
        told.append(done)
        if len(told) == 8:
            raise KeyboardInterrupt

    with pytest.warns(UserWarning, match="interrupted after 7 of 100 refits"):
        drawn = line_fit(1, 0.0).bootstrap(100, progress=tell)
    assert (len(drawn.values), drawn.asked) == (7, 100)
    assert told == sorted(told)
    with pytest.raises(RecordingError, match="needs 40 refits, there are 7"):
        drawn.interval("a")
    told.clear()
    told.extend([0.0] * 6)
    with pytest.raises(KeyboardInterrupt):
        line_fit(1, 0.0).bootstrap(100, progress=tell)


# --- draws ---------------------------------------------------------------------------------------------------------


def pendulum(gamma: float, spread: float) -> Fit:
    """Return a fit of a pendulum with given parameter values, whose errors follow from made-up derivatives."""
    scene = Scene("bench", Body(length=0.65, mass=0.0415), effects=(Gravity(),))
    model = Model.of(scene, ("linear", "coulomb"), np.arange(400.0) / 100, ("scale", "length"))
    assert model.names[3:] == ("scale", "length", "linear_drag.gamma", "coulomb_friction.friction_torque")
    values = np.array([0.5, 0.01, 0.0, 1.0, 0.65, gamma, 3e-5])
    source = np.random.default_rng(0)
    mixed = source.standard_normal((7, 7)) + 2.0 * np.eye(7)
    slopes = source.standard_normal((400, 7)) @ mixed / np.array([1e-2, 1e-2, 1e-3, 1e-3, 1e-3, spread, 1e-6]) / 20.0
    residual = source.standard_normal(400)
    recording = Recording(model.time, np.zeros(400), "bench")
    return Fit(recording, FitSolution(model, values, residual, slopes, np.ones(400), math.inf), 1.0)


def test_draws_have_the_mean_and_covariance_of_the_fit() -> None:
    """For 20 000 draws far from bounds, every element is within five standard errors."""
    found, count = pendulum(0.5, 0.01), 20_000
    drawn = found.sample(count, start=True)
    assert drawn.pop("scene") == found.scene
    order = [found.names.index(name) for name in drawn]
    assert sorted(order) == [0, 1, 4, 5, 6]
    rows, covariance = np.array(list(drawn.values())), found.covariance[np.ix_(order, order)]
    errors = np.sqrt(np.diag(covariance))
    assert np.max(np.abs(rows.mean(axis=1) - found.values[order]) / errors) < 5.0 / math.sqrt(count)
    assert np.max(np.abs(np.cov(rows) - covariance) / np.outer(errors, errors)) < 5.0 * math.sqrt(2.0 / count)
    np.testing.assert_array_equal(found.sample(10, seed=7)["length"], found.sample(10, seed=7)["length"])
    assert not np.array_equal(found.sample(10, seed=7)["length"], found.sample(10, seed=8)["length"])


def test_draws_near_a_bound_are_of_the_truncated_distribution() -> None:
    """Half of a normal distribution about 0 has the mean ``s sqrt(2/pi)`` and the variance ``s² (1 - 2/pi)``."""
    found, count = pendulum(0.0, 0.01), 20_000
    error = math.sqrt(found.covariance[5, 5])
    gamma = found.sample(count)["linear_drag.gamma"]
    assert gamma.min() >= 0.0
    assert gamma.mean() == pytest.approx(error * 2.0 * norm.pdf(0.0), rel=0.03)
    assert gamma.var() == pytest.approx(error**2 * (1.0 - 2.0 / math.pi), rel=0.05)


def test_environments_and_runs_take_the_draws() -> None:
    found = pendulum(0.5, 0.05)
    drawn = found.sample(6, seed=1)
    vec = gym.make_vec("LabPendulum-v0", num_envs=6, vectorization_mode="vector_entry_point", backend="python", **drawn)
    vec.reset(seed=0, options={"angle": 0.5, "velocity": 0.0})
    for _ in range(3):
        observation, *_ = vec.step(np.zeros((6, 1), dtype=np.float32))
    vec.close()
    run = rollout(**found.sample(6, seed=1), angle=0.5, velocity=0.0, dt=0.02, duration=0.06, backend="python")
    np.testing.assert_allclose(observation[:, 2], run.velocity[:, -1].astype(np.float32), rtol=1e-6)
    assert len(set(observation[:, 2].tolist())) == 6
    started = found.sample(6, seed=1, start=True)
    run = rollout(**started, dt=0.02, duration=0.06, backend="python")
    np.testing.assert_array_equal(run.angle[:, 0], started["angle"])
    np.testing.assert_array_equal(started["length"], drawn["length"])


def test_what_has_no_distribution_is_not_drawn() -> None:
    lost = pendulum(0.5, math.inf)
    with pytest.raises(RecordingError, match=r"cannot draw values of linear_drag\.gamma"):
        lost.sample(3)
    narrow = pendulum(-1.0, 0.01)
    with pytest.raises(RecordingError, match="have no parameter below 0"):
        narrow.sample(3)
