"""Test posteriors: against closed forms, a grid that shares no code with them, and the errors and profiles of fits."""

from __future__ import annotations

import csv
import importlib.util
import math
import sys
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import emcee
import numpy as np
import pytest
from bench_files import written
from PIL import Image
from scipy.stats import t
from typer.testing import CliRunner
from virtual_swings import recorded, swing

from pendulum_env import LabPendulumEnv, Recording, fit, load, rollout
from pendulum_env.cli import app
from pendulum_env.lab import RecordingError, simulated_recording
from pendulum_env.lab.fitting import posterior as sampling
from pendulum_env.lab.fitting.grade import Fault
from pendulum_env.lab.fitting.posterior import Posterior
from pendulum_env.lab.fitting.priors import LogDensity, Prior, priors_of
from pendulum_env.lab.fitting.result import Fit
from pendulum_env.lab.fitting.statistics import split_r
from pendulum_env.physics.units import SceneError

OMEGA = math.sqrt(9.81)
TIME = np.linspace(0.0, 9.0, 40)
DRAGS = ("linear_drag.gamma", "quadratic_drag.c")
PARTS = (0.025, 0.16, 0.5, 0.84, 0.975)


def columns(rate: bool) -> Any:
    """Return the exact derivatives of the harmonic oscillator's readings by angle, velocity and zero at the start."""
    turn = OMEGA * TIME
    if rate:
        return np.stack([-OMEGA * np.sin(turn), np.cos(turn), np.ones_like(turn)], axis=1)
    return np.stack([np.cos(turn), np.sin(turn) / OMEGA, np.ones_like(turn)], axis=1)


@cache
def harmonic(rate: bool = False) -> Fit:
    """Fit the readings of a harmonic oscillator, whose parameters angle, velocity and zero are linear."""
    seen = columns(rate) @ [0.5, 0.05, 0.02] + 0.01 * np.random.default_rng(5).standard_normal(len(TIME))
    turning = np.cos(OMEGA * TIME)
    recording = Recording(TIME, 0.5 * turning if rate else seen, "harmonic", rate=seen if rate else None, release=0.0)
    found = fit(recording, "none", scene="textbook", free=())
    assert len(found.recording.time) == len(TIME)
    return found


@cache
def linear_posterior(steps: int = 400) -> Posterior:
    return harmonic().posterior(steps=steps, seed=1)


def exact(rate: bool = False) -> tuple[Any, Any, float]:
    """Return mean, scale matrix and degrees of freedom of the exact posterior, a Student's t (Box & Tiao 1973).

    It is as wide as the errors of the fit where these exceed those of independent readings, with their freedom.
    """
    slopes, found = columns(rate), harmonic(rate)
    mean, (squares,), *_ = np.linalg.lstsq(slopes, found.recording.readings, rcond=None)
    scale = squares / (len(TIME) - 3) * np.linalg.inv(slopes.T @ slopes)
    wider = np.maximum(np.sqrt(np.diag(found.covariance) / np.diag(scale)), 1.0)
    return mean, scale * np.outer(wider, wider), found.errors.freedom


# --- the density ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [False, True])
def test_the_density_of_a_linear_model_is_that_of_students_t(rate: bool) -> None:
    found = harmonic(rate)
    mean, scale, freedom = exact(rate)
    density = LogDensity(found, priors_of(found.model, None))
    rows = mean + np.random.default_rng(0).standard_normal((50, 3)) * 3.0 * np.sqrt(np.diag(scale))
    squares = np.einsum("ij,jk,ik->i", rows - mean, np.linalg.inv(scale), rows - mean)
    expected = -0.5 * (freedom + 3) * np.log1p(squares / freedom)
    assert density(rows) - density(mean) == pytest.approx(expected, abs=2e-3)


@pytest.mark.quick("False")
@pytest.mark.parametrize("rate", [False, True])
def test_the_sum_of_squares_at_the_steps_is_that_of_the_readings(rate: bool) -> None:
    """Check it with a scale and far from the fit, against a direct sum over readings interpolated by SciPy."""
    time = np.sort(np.random.default_rng(2).uniform(0.0, 8.0, 400))
    angle = swing(time, 0.5, length=0.5, gamma=0.1)
    noise = 0.01 * np.random.default_rng(3).standard_normal(400)
    recording = Recording(time, angle + noise, "x", rate=4.0 * np.gradient(angle, time) + noise if rate else None)
    found = fit(recording, "linear", free=("length", "scale"), mass=0.1)
    density = LogDensity(found, priors_of(found.model, None))
    rows = found.values * (1.0 + 0.02 * np.random.default_rng(1).standard_normal((6, len(found.values))))
    squares = [float(np.sum((found.recording.readings - found.model.angles(row)[0]) ** 2)) for row in rows]
    rise = (np.array(squares) - density.best) / density.variance
    own = density.rises(rows) / density.variance
    assert own == pytest.approx(rise, rel=1e-4)


def test_the_density_is_0_outside_the_priors_and_where_nothing_can_be_simulated() -> None:
    found = harmonic()
    density = LogDensity(found, priors_of(found.model, {"zero": (-1.0, 1.0)}))
    rows = np.tile(found.values, (3, 1))
    rows[1, 2], rows[2, 0] = 1.1, 1e300
    logs = density(rows)
    assert np.isfinite(logs[0])
    assert logs[1] == -math.inf
    assert logs[2] < -100.0
    assert density(rows[1:2]) == [-math.inf]


@pytest.mark.parametrize(("entry", "log"), [
    ((0.5, 2.0), lambda x: np.zeros_like(x)),
    (("log", 0.5, 2.0), lambda x: -np.log(x)),
    (("normal", 1.2, 0.3), lambda x: -0.5 * ((x - 1.2) / 0.3) ** 2),
])
def test_priors_are_what_they_say(entry: Any, log: Callable[[Any], Any]) -> None:
    one = priors_of(damped().model, {"gamma": entry})[damped().names.index("linear_drag.gamma")]
    x = np.array([0.6, 1.0, 1.9])
    assert one.log(x) - one.log(x[:1]) == pytest.approx(log(x) - log(x[:1]), abs=1e-12)
    assert one.log(np.array([-0.1])) == [-math.inf]
    assert one.bounded
    low, high = max(one.low, one.mean - 8.0 * one.error), min(one.high, one.mean + 8.0 * one.error)
    grid = np.linspace(low, high, 20001)
    chances = np.exp(one.log(grid))
    mean = float(np.average(grid, weights=chances))
    error = math.sqrt(float(np.average((grid - mean) ** 2, weights=chances)))
    assert one.moments == pytest.approx((mean, error), rel=1e-3 if one.kind != "log" else 0.25)


# --- the sample -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_sample_of_a_linear_model_has_the_quantiles_of_students_t() -> None:
    """Quantiles are compared by the exact probability below them; 5000 independent samples scatter by 0.007."""
    found = linear_posterior(700)
    mean, scale, freedom = exact()
    errors = np.sqrt(np.diag(scale))
    assert found.independent > 2000
    assert found.problem == ""
    for part in PARTS:
        quantiles = np.quantile(found.samples, part, axis=0)
        assert t.cdf((quantiles - mean) / errors, freedom) == pytest.approx([part] * 3, abs=0.03)
    assert found.mean == pytest.approx(mean, abs=0.1 * float(errors.max()))
    assert found.covariance == pytest.approx(scale * freedom / (freedom - 2.0), abs=0.1 * float(np.diag(scale).max()))
    low, high = found.interval("angle", 0.68)
    assert (low, high) == pytest.approx(harmonic().interval("angle", 0.68), abs=0.1 * float(errors[0]))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The chain is too short")
def test_the_same_seed_gives_the_same_samples() -> None:
    one, same, other = (harmonic().posterior(steps=40, seed=seed, progress=False) for seed in (3, 3, 4))
    assert np.array_equal(one.chain, same.chain)
    assert np.array_equal(one.log_density, same.log_density)
    assert not np.array_equal(one.chain, other.chain)


@pytest.mark.slow
def test_a_normal_prior_counts_as_another_reading() -> None:
    """For a linear model with many readings, precisions add and means are weighted by them."""
    mean, scale, _ = exact()
    error, told = math.sqrt(scale[2, 2]), float(mean[2]) + 2.0 * math.sqrt(scale[2, 2])
    found = harmonic().posterior(steps=500, priors={"zero": ("normal", told, 0.5 * error)})
    own = found.parameters["zero"]
    assert own.value == pytest.approx((mean[2] + 4.0 * told) / 5.0, abs=0.1 * error)
    assert own.error == pytest.approx(error / math.sqrt(5.0), rel=0.1)


@pytest.mark.slow
def test_a_range_that_excludes_the_fit_holds_for_all_walkers() -> None:
    value = float(harmonic().values[0])
    found = harmonic().posterior(steps=400, priors={"angle": (value + 0.002, value + 0.004)})
    assert (found.chain[..., 0] >= value + 0.002).all()
    assert (found.chain[..., 0] <= value + 0.004).all()


@cache
def damped() -> Fit:
    """Fit a short recording in which linear and quadratic drag can hardly be told apart."""
    time = np.arange(0.0, 6.0, 0.03)
    angle = swing(time, 0.6, length=0.4, gamma=0.02, c=0.01)
    return fit(recorded(time, angle, noise=0.002, seed=11), "linear+quadratic", free=(), scene="vacuum",
               length=0.4, mass=0.1)


def by_grid(found: Fit, gammas: Any, drags: Any) -> Any:
    """Return the posterior density of gamma and c on a grid, from a right-hand side and an integrator of this test.

    At every point the start and the zero, which are nearly linear, are fitted by Gauss-Newton steps. Integrated over
    them and over sigma, the likelihood is ``RSS^(-(n - 3)/2) det(J^T J)^(-1/2)``.
    """
    time, readings = found.recording.time, found.recording.readings
    steps, pull = 10, 9.81 / 0.4
    gamma, c = (grid.ravel() for grid in np.meshgrid(gammas, drags, indexing="ij"))

    def force(q: Any, v: Any) -> Any:
        return -pull * np.sin(q) - gamma * v - c * np.abs(v) * v

    def angles(start: Any, velocity: Any) -> Any:
        q, v, rows = start.copy(), velocity.copy(), [start.copy()]
        for gap in np.diff(time):
            h = gap / steps
            for _ in range(steps):
                a = force(q, v)
                qb, vb = q + 0.5 * h * v, v + 0.5 * h * a
                b = force(qb, vb)
                qc, vc = q + 0.5 * h * vb, v + 0.5 * h * b
                d = force(qc, vc)
                qe, ve = q + h * vc, v + h * d
                e = force(qe, ve)
                q, v = q + h / 6.0 * (v + 2.0 * vb + 2.0 * vc + ve), v + h / 6.0 * (a + 2.0 * b + 2.0 * d + e)
            rows.append(q.copy())
        return np.array(rows).T

    numbers = np.tile([0.6, 0.0, 0.0], (len(gamma), 1))
    for _ in range(3):
        seen = angles(numbers[:, 0], numbers[:, 1])
        slopes = np.stack([(angles(numbers[:, 0] + 1e-4, numbers[:, 1]) - seen) / 1e-4,
                           (angles(numbers[:, 0], numbers[:, 1] + 1e-4) - seen) / 1e-4, np.ones_like(seen)], axis=2)
        rest = readings - seen - numbers[:, 2:]
        normal = np.einsum("ijk,ijl->ikl", slopes, slopes)
        moves = np.linalg.solve(normal, np.einsum("ijk,ij->ik", slopes, rest)[..., None])[..., 0]
        squares = np.sum((rest - np.einsum("ijk,ik->ij", slopes, moves)) ** 2, axis=1)
        numbers = numbers + moves
    logs = -0.5 * (len(time) - 3) * np.log(squares) - 0.5 * np.linalg.slogdet(normal)[1]
    return np.exp(logs - logs.max()).reshape(len(gammas), len(drags))


@pytest.mark.slow
def test_dampings_that_only_their_sum_determines_share_it_within_their_ranges() -> None:
    """Linear drag and a bearing's viscosity b have torques of one shape: ``gamma + b/(m L²)`` is that of linear alone.
    """
    time = np.arange(0.0, 6.0, 0.03)
    recording = recorded(time, swing(time, 0.6, length=0.4, gamma=0.05), noise=0.002, seed=11)
    given = {"free": (), "scene": "vacuum", "length": 0.4, "mass": 0.1}
    both, alone = (fit(recording, damping, **given) for damping in ("linear+bearing", "linear"))
    with pytest.raises(RecordingError, match=r"does not determine linear_drag\.gamma, .* give a prior with a range"):
        both.posterior()
    own = both.posterior(steps=700, priors={"gamma": (0.0, 0.2), "bearing_viscosity": (0.0, 0.01)})
    assert own.problem == ""
    gamma, viscosity = own.samples[:, -2:].T
    whole, expected = gamma + viscosity / (0.1 * 0.4**2), alone.parameters["linear_drag.gamma"]
    assert whole.mean() == pytest.approx(expected.value, abs=0.2 * expected.error)
    freedom = alone.errors.freedom  # of Student's t; a posterior is never narrower than that of independent readings
    width = max(expected.error, math.sqrt(alone.errors.plain[-1, -1])) * math.sqrt(freedom / (freedom - 2.0))
    assert whole.std() == pytest.approx(width, rel=0.15)
    assert gamma / whole == pytest.approx(np.full(len(whole), 0.5), abs=0.51)
    assert (gamma / whole).std() == pytest.approx(1.0 / math.sqrt(12.0), rel=0.1)  # any share is as likely


@pytest.mark.slow
def test_a_posterior_that_is_not_gaussian_against_a_grid() -> None:
    """Linear and quadratic drag trade off, both above 0; quantiles differ from those of the fit's normal errors."""
    found = damped()
    assert np.all(np.diag(found.covariance) < 1.05**2 * np.diag(found.errors.plain))  # otherwise the posterior is wider
    own = found.posterior(steps=4000, seed=2)
    assert own.problem == ""
    assert own.independent > 5000
    tops = [1.3 * float(own.samples[:, own.names.index(name)].max()) for name in DRAGS]
    grids = [(np.arange(60) + 0.5) / 60.0 * top for top in tops]
    density = by_grid(found, *grids)
    for axis, (name, grid) in enumerate(zip(DRAGS, grids, strict=True)):
        marginal = density.sum(axis=1 - axis)
        ends = np.concatenate([grid - grid[0], [grid[-1] + grid[0]]])
        below = np.concatenate([[0.0], np.cumsum(marginal) / marginal.sum()])
        column = own.samples[:, own.names.index(name)]
        for part in PARTS:
            assert np.interp(np.quantile(column, part), ends, below) == pytest.approx(part, abs=0.025), name
    assert own.interval("linear_drag.gamma").low > 0.0
    assert set(own.skewed) & {*DRAGS}


@pytest.mark.slow
def test_it_agrees_with_errors_and_profiles_where_they_are_gaussian() -> None:
    found = fit(simulated_recording(), "linear+quadratic", mass=0.01, radius=0.02)
    own = found.posterior()
    assert own.problem == ""
    assert own.skewed == ()
    errors = np.sqrt(np.diag(found.covariance))
    assert own.std / errors == pytest.approx(np.ones(6), abs=0.1)
    assert (own.mean - found.values) / errors == pytest.approx(np.zeros(6), abs=0.2)
    for name in ("length", "linear_drag.gamma", "quadratic_drag.c"):
        error = found.parameters[name].error
        assert own.interval(name) == pytest.approx(found.profile(name), abs=0.2 * error)
    run = rollout(**own.sample(20, start=True), integrator="rk4", dt=0.01, duration=5.0, diagnostics=())
    near = np.interp(run.time, found.recording.time, found.swing)
    assert np.sqrt(np.mean((run.angle - near) ** 2)) < 0.02


@pytest.mark.slow
def test_the_posterior_of_an_accelerometer_contains_the_truth(tmp_path: Path) -> None:
    file, truth = written("phone on a rod", tmp_path)
    one = fit(Recording.read(file), "linear")
    found = one.posterior(steps=500, progress=False)
    np.testing.assert_allclose(found.std, np.sqrt(np.diag(one.covariance)), rtol=0.15)
    for name, value in {"length": truth["length"], "sensor_distance": truth["reach"]}.items():
        low, high = found.interval(name, 0.999)
        assert low <= value <= high, name
    with pytest.raises(RecordingError, match="not angles"):
        assert one.sensor
    env = LabPendulumEnv(one.scene, task="free", randomize=found, backend="python", warn=False)
    lengths = [env.reset(seed=seed)[1]["parameters"]["length"] for seed in range(40)]
    at = found.names.index("length")
    assert abs(np.mean(lengths) - found.mean[at]) < found.std[at]
    assert 0.6 < np.std(lengths) / found.std[at] < 1.5


@pytest.mark.slow
def test_intervals_of_many_recordings_contain_the_truth() -> None:
    """Of 20 intervals with the probability 68 %, 6.4 ± 2.1 miss the truth."""
    time, missed = np.arange(0.0, 8.0, 0.05), 0
    angle = swing(time, 0.5, length=0.4, gamma=0.1)
    for seed in range(10):
        found = fit(recorded(time, angle, noise=0.01, seed=seed), "linear", scene="vacuum", mass=0.1, length=0.38)
        own = found.posterior(walkers=20, steps=450, seed=seed)
        for name, value in (("length", 0.4), ("linear_drag.gamma", 0.1)):
            low, high = own.interval(name, 0.68)
            missed += not low <= value <= high
    assert 2 <= missed <= 11


@pytest.mark.slow
def test_it_is_as_wide_as_errors_that_allow_for_correlation() -> None:
    """Neighbouring readings share their noise; the errors of the fit are then wider than those of the scatter alone."""
    source, noise = np.random.default_rng(8), np.zeros(300)
    for i in range(1, 300):
        noise[i] = 0.9 * noise[i - 1] + 0.0002 * source.standard_normal()
    time = np.linspace(0.0, 40.0, 300)
    recording = Recording(time, 0.5 * np.cos(OMEGA * time) + noise, "x", release=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the residuals' pattern
        found = fit(recording, "none", scene="textbook", free=())
    plain, errors = (np.sqrt(np.diag(matrix)) for matrix in (found.errors.plain, found.covariance))
    assert (errors / plain).max() > 1.2
    own = found.posterior(steps=400)
    reach = [float(np.subtract(*own.interval(name, 0.68)[::-1])) / 2.0 for name in own.names]
    assert reach == pytest.approx(errors * t.ppf(0.84, found.errors.freedom), rel=0.12)
    assert "wider" in own.text


# --- the chain --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_autocorrelation_times_against_a_closed_form(rho: float) -> None:
    """An autoregressive chain has the time ``(1 + rho) / (1 - rho)``."""
    source, chain = np.random.default_rng(4), np.zeros((4000, 64, 3))
    for i in range(1, len(chain)):
        chain[i] = rho * chain[i - 1] + source.standard_normal((64, 3))
    own = replace(linear_posterior(), chain=chain)
    assert own.autocorrelation_time == pytest.approx([(1.0 + rho) / (1.0 - rho)] * 3, rel=0.12)
    assert (own.autocorrelation_time >= 1.0).all()


def test_a_walker_that_never_moved_makes_the_chain_too_short() -> None:
    chain = linear_posterior().chain.copy()
    chain[:, 3] = 0.5  # the mean of the steps is exact, so that the walker's variance is 0
    stuck = replace(linear_posterior(), chain=chain)
    assert stuck.autocorrelation_time.tolist() == [len(chain) - stuck.warm] * 3
    assert "are 1 autocorrelation times" in stuck.problem


def test_walkers_apart_have_a_large_r_hat() -> None:
    """For chains of m steps and variance 1 whose means have the variance B, R-hat is ``sqrt((m - 1)/m + B)``."""
    source = np.random.default_rng(6)
    chain = source.standard_normal((400, 200, 1))
    assert split_r(chain) == pytest.approx([1.0], abs=0.01)
    assert split_r(chain + 2.0 * source.standard_normal((200, 1))) == pytest.approx([math.sqrt(5.0)], rel=0.15)
    assert split_r(chain + 3.0 * (np.arange(400) < 200)[:, None, None])[0] > 1.5


def test_a_short_chain_says_how_many_steps_are_needed() -> None:
    with pytest.warns(UserWarning, match=r"The chain is too short: \d+ steps .* give steps=\d+00\.$"):
        short = harmonic().posterior(steps=30)
    assert "The chain is too short" in short.text


@pytest.mark.parametrize("after", [3, 25])
def test_ctrl_c_returns_the_steps_so_far(after: int) -> None:
    def interrupt(_done: float, activity: str) -> None:
        if activity.startswith(f"step {after} "):
            raise KeyboardInterrupt

    if after < 10:
        with pytest.raises(KeyboardInterrupt):
            harmonic().posterior(steps=200, progress=interrupt)
        return
    with pytest.warns(UserWarning, match="interrupted after 25 of 200 steps|too short"):
        found = harmonic().posterior(steps=200, progress=interrupt)
    assert found.chain.shape == (25, 32, 3)
    assert found.log_density.shape == (25, 32)
    assert found.asked == 200
    assert len(found.samples) > 0
    assert "25 steps" in found.text


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("given", "why"), [
    ({"walkers": 5}, "walkers must be at least 6, twice the 3 fitted parameters, not 5"),
    ({"walkers": 32.5}, "walkers must be a whole number"),
    ({"steps": 0}, "steps must be a whole number from 1"),
    ({"seed": -1}, "seed must be a whole number from 0"),
    ({"priors": {"angel": (0.0, 1.0)}}, "priors has 'angel', which is not a fitted parameter; did you mean angle?"),
    ({"priors": {"zero": (1.0, 0.0)}}, "the upper end of the prior of zero must be a finite number above 1"),
    ({"priors": {"zero": ("log", -1.0, 2.0)}}, "the lower end of the log prior of zero must be a finite number above"),
    ({"priors": {"zero": ("normal", 0.0, 0.0)}}, "the error of the prior of zero must be a finite number above 0"),
    ({"priors": {"zero": ("lognormal", 0.0, 1.0)}}, "The prior of zero must have the form"),
    ({"priors": {"zero": (1.0,)}}, "The prior of zero must have the form"),
    ({"priors": {"zero": 1.0}}, "the prior of zero must be a list"),
    ({"priors": [("zero", 1.0)]}, "priors must be a dict"),
])
def test_it_refuses(given: Any, why: str) -> None:
    with pytest.raises(SceneError) as refused:
        harmonic().posterior(**given)
    assert why in str(refused.value)


def test_it_refuses_a_range_below_a_physical_bound() -> None:
    with pytest.raises(SceneError, match=r"the lower end of the prior of gamma must be a finite number of at least 0"):
        damped().posterior(priors={"gamma": (-0.1, 0.1)})


def test_it_refuses_a_fit_that_is_not_usable() -> None:
    bad = Fit(harmonic().recording, harmonic().solution, 1.0, faults=(Fault("the pendulum is driven", True),))
    with pytest.raises(RecordingError, match=r"no posterior of a fit that is not usable.*driven"):
        bad.posterior()


def test_without_emcee_it_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(sampling, "find_spec", lambda name: None if name == "emcee" else find(name))
    with pytest.raises(RecordingError, match=r"needs emcee; pip install .*\[posterior\]"):
        harmonic().posterior()


# --- files and scenes -------------------------------------------------------------------------------------------------


def test_saved_files_have_the_samples_and_their_origin(tmp_path: Path) -> None:
    found = linear_posterior()
    lines = found.save(tmp_path / "one.csv").read_text(encoding="utf-8").splitlines()
    head, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    assert head == ["angle [rad]", "velocity [rad/s]", "zero [rad]", "log_density"]
    assert {tuple(map(float, row[:3])) for row in rows} <= {tuple(row) for row in found.samples.tolist()}
    assert 1000 < len(rows) <= len(found.samples)
    assert any(line.startswith("# seed: 1") for line in lines)
    assert any(line.startswith("# recording: harmonic") for line in lines)
    with pytest.raises(SceneError, match=r"'\.npz'.*\.zip"):
        found.save(tmp_path / "one.npz")
    assert {path.name for path in tmp_path.iterdir()} == {"one.csv"}


def test_a_saved_posterior_is_loaded_again(tmp_path: Path) -> None:
    """With priors of all kinds, all that it says and draws is as before."""
    given = {"angle": (0.4, 0.6), "velocity": ("normal", 0.05, 0.01), "zero": ("log", 0.01, 0.03)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        kept = harmonic().posterior(walkers=8, steps=60, seed=5, priors=given)
    found: Any = load(kept.save(tmp_path / "one.zip"))
    assert (found.text, found.table, found.priors, found.problem) == (kept.text, kept.table, kept.priors, kept.problem)
    assert (found.seed, found.asked) == (5, 60)
    assert found.fit.parameters == kept.fit.parameters
    np.testing.assert_array_equal(found.samples, kept.samples)
    np.testing.assert_array_equal(found.log_density, kept.log_density)
    assert str(found.sample(3, seed=2)) == str(kept.sample(3, seed=2))


def test_it_is_data_for_arviz_with_names_units_and_the_density() -> None:
    """Its groups hold the steps that are not discarded, with one chain for each walker."""
    found = linear_posterior()
    tree = found.to_arviz()
    kept = found.chain[found.discarded:]
    assert dict(tree["posterior"].sizes) == {"chain": 32, "draw": len(kept)}
    for i, (name, unit) in enumerate(zip(found.names, ("rad", "rad/s", "rad"), strict=True)):
        column = tree["posterior"][name]
        assert column.attrs["units"] == unit
        np.testing.assert_array_equal(column.values, kept[:, :, i].T)
    np.testing.assert_array_equal(tree["sample_stats"]["lp"].values, found.log_density[found.discarded:].T)


@pytest.mark.parametrize(("module", "call", "extra"), [
    ("arviz_base", lambda found: found.to_arviz(), "arviz"), ("corner", lambda found: found.plot(), "posterior"),
])
def test_without_an_extra_it_is_judged_and_printed_alike_and_says_what_is_missing(
    module: str, call: Callable[[Posterior], Any], extra: str, monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = linear_posterior()
    said = found.text, found.table, found.problem, found.fit.errors.how
    monkeypatch.setitem(sys.modules, module, None)
    again = replace(found)
    assert (again.text, again.table, again.problem, again.fit.errors.how) == said
    with pytest.raises(ValueError, match=rf"pip install 'lab-pendulum\[{extra}\]'"):
        call(again)


def test_drawn_scenes_are_samples() -> None:
    found = linear_posterior()
    drawn = found.sample(10, seed=4, start=True)
    assert set(drawn) == {"scene", "angle", "velocity"}
    known = {tuple(row) for row in found.samples[:, :2].tolist()}
    assert set(zip(drawn["angle"].tolist(), drawn["velocity"].tolist(), strict=True)) <= known
    assert len(set(drawn["angle"].tolist())) > 1
    assert np.array_equal(drawn["angle"], found.sample(10, seed=4, start=True)["angle"])
    assert set(found.sample(2)) == {"scene"}
    with pytest.raises(SceneError, match="n must be a whole number"):
        found.sample(0)


def test_text_and_table_say_what_there_is() -> None:
    found = linear_posterior()
    assert [row[0] for row in found.table.rows] == ["angle", "velocity", "zero"]
    assert "Priors: angle flat; velocity flat; zero flat." in found.text
    assert "prior 1/sigma" in found.text
    assert repr(found).startswith("<Posterior: harmonic, 32 walkers, 400 steps")
    assert emcee.__version__.split(".")[0] >= "3"
    assert Prior(0.0, math.inf).text == "flat above 0"


# --- the command ------------------------------------------------------------------------------------------------------

SHORT = ["fit", "--mass", "0.01", "--radius", "0.02", "--effects", "linear+quadratic", "--read", "until=10.6"]


@pytest.mark.slow
@pytest.mark.parametrize("interrupted", [False, True])
def test_the_command_writes_valid_files_even_if_it_is_interrupted(
    interrupted: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls, density = [0], LogDensity.__call__

    def stop(self: Any, rows: Any) -> Any:
        calls[0] += 1
        if interrupted and calls[0] > 40:
            raise KeyboardInterrupt
        return density(self, rows)

    monkeypatch.setattr(LogDensity, "__call__", stop)
    done = CliRunner().invoke(app, [*SHORT, "--posterior", "--walker-steps", "120", "--seed", "3", "--svg", "--prior",
                                    "gamma=normal:0.03:0.001", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.exception
    names = {"posterior.csv", "posterior.zip", "corner.png", "corner.svg", "fit.png", "scene.json"}
    assert names <= {path.name for path in tmp_path.iterdir()}
    assert "gamma normal, 0.03 ± 0.001, above 0" in " ".join(done.output.split())
    kept: Any = load(tmp_path / "posterior.zip")
    assert kept.chain.shape[1:] == (32, 6)
    assert (len(kept.chain) < 120) == interrupted
    assert abs(kept.parameters["linear_drag.gamma"].value - 0.03) < 0.002
    assert kept.seed == 3
    with Image.open(tmp_path / "corner.png") as picture:
        assert picture.info["seed"] == "3"


@pytest.mark.slow
def test_the_command_without_corner_writes_its_files_and_says_how_to_get_the_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "corner", None)
    done = CliRunner().invoke(app, [*SHORT, "--posterior", "--walker-steps", "60", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.exception
    assert {"posterior.csv", "posterior.zip"} <= {path.name for path in tmp_path.iterdir()}
    assert not list(tmp_path.glob("corner.*"))
    assert "the corner figure needs corner; pip install 'lab-pendulum[posterior]'" in " ".join(done.output.split())


@pytest.mark.parametrize(("words", "why"), [
    (["--walker-steps", "10"], "--walker-steps needs --posterior"),
    (["--seed", "1"], "--seed needs --posterior"),
    (["--prior", "gamma=1:2"], "--prior needs --posterior"),
    (["--posterior", "--walker-steps", "0"], "--walker-steps must be a whole number from 1"),
    (["--posterior", "--prior", "gamma"], "--prior needs a name and a range"),
])
def test_the_command_refuses_before_it_reads(words: list[str], why: str, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, [*SHORT, *words, "--out", str(tmp_path / "out")])
    assert why in str(done.exception)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_the_command_refuses_an_unknown_prior_before_it_writes(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, [*SHORT, "--posterior", "--prior", "gama=1:2", "--out", str(tmp_path)])
    assert "did you mean gamma?" in str(done.exception)
    assert not list(tmp_path.iterdir())
