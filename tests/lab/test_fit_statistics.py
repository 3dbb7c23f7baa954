"""Test statistics of residuals and the errors based on them: closed forms, published examples, correlated processes."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from pendulum_env.lab import Recording
from pendulum_env.lab.fitting import errors, statistics
from pendulum_env.lab.fitting.result import Fit, common_bic


def errors_found(fitted: Any) -> errors.Errors:
    """Return the standard errors of a fit whose model's angles are all 0."""
    return errors.errors_of(fitted, fitted.residual)


def solution(slopes: Any, residual: Any, values: Any = None, least: float = -math.inf, swing: int = 0) -> Any:
    """Return the solution of a fit with given derivatives and residual; its model has a turning point every ``swing``
    readings, and none for 0."""
    n, k = slopes.shape
    model = SimpleNamespace(names=tuple("abcdef"[:k]), least=np.full(k, least), time=np.arange(float(n)))
    velocity = np.where((np.arange(n) // swing) % 2, -1.0, 1.0) if swing else np.ones(n)
    return SimpleNamespace(model=model, values=np.ones(k) if values is None else np.asarray(values), residual=residual,
                           jacobian=slopes, velocity=velocity)


def autoregressive(n: int, factor: complex, seed: int) -> Any:
    """Return the real part of ``z_(t+1) = factor z_t + noise``, whose autocorrelation is ``Re factor^lag``."""
    first, second = np.random.default_rng(seed).standard_normal((2, n))
    noise = first + 1j * second
    noise[0] /= math.sqrt(1.0 - abs(factor) ** 2)
    return lfilter([1.0], [1.0, -factor], noise).real


# --- runs ----------------------------------------------------------------------------------------------------------


def signs(runs: int, above: int, below: int) -> Any:
    """Return residuals with a given number of runs, positive and negative values; all but the last two runs have length
    1."""
    up, down = (runs + 1) // 2, runs // 2
    lengths = [above - up + 1, *[1] * (up - 1)], [below - down + 1, *[1] * (down - 1)]
    found: list[float] = []
    for i in range(runs):
        found += [1.0 if i % 2 == 0 else -1.0] * lengths[i % 2][i // 2]
    assert found.count(1.0) == above
    assert found.count(-1.0) == below
    return np.array(found)


def test_the_runs_test_of_the_nist_handbook() -> None:
    """NIST/SEMATECH e-Handbook of Statistical Methods, 1.3.5.13: for 100 readings above and 100 below the median, Z =
    2.6938 corresponds to 120 runs. Zeros have no effect."""
    found = statistics.runs_test(signs(120, 100, 100))
    assert found.number == 120
    assert found.z == pytest.approx(2.6938, abs=5e-5)
    assert found.p == pytest.approx(0.00706, abs=5e-5)
    assert statistics.runs_test(np.insert(signs(120, 100, 100), [0, 7, 30], 0.0)) == found


def test_the_runs_of_every_order_have_the_mean_and_variance_that_z_takes() -> None:
    """For all 210 orders of 4 positive and 6 negative residuals, z has exactly the mean 0 and the variance 1."""
    from itertools import combinations

    found = []
    for places in combinations(range(10), 4):
        order = -np.ones(10)
        order[list(places)] = 1.0
        found.append(statistics.runs_test(order).z)
    assert np.mean(found) == pytest.approx(0.0, abs=1e-14)
    assert np.var(found) == pytest.approx(1.0, rel=1e-12)


def test_one_sign_is_no_order_by_chance_and_too_few_say_nothing() -> None:
    assert statistics.runs_test(np.ones(50)) == (1, -math.inf, 0.0)
    assert statistics.runs_test(np.array([1.0, -1.0])) == (2, 0.0, 1.0)
    assert statistics.runs_test(np.zeros(5)) == (0, 0.0, 1.0)


# --- correlation ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("radius", "turn"), [(0.0, 0.0), (0.5, 0.0), (0.95, 0.0), (0.99, 0.2)])
def test_the_correlation_time_of_an_autoregressive_process(radius: float, turn: float) -> None:
    """The correlation time is ``1 + 2 sum r^(2 lag) cos²(turn lag)``, or ``(1 + r²)/(1 - r²)`` without oscillation.

    The sum of rho itself does not show it: with oscillation, that sum is 0.2.
    """
    exact = 1.0 + 2.0 * sum(radius ** (2 * lag) * math.cos(turn * lag) ** 2 for lag in range(1, 5000))
    if turn == 0.0:
        assert exact == pytest.approx((1.0 + radius**2) / (1.0 - radius**2))
    path = autoregressive(60_000, radius * complex(math.cos(turn), math.sin(turn)), 1)
    assert statistics.correlation_time(path) == pytest.approx(exact, rel=0.08, abs=0.02)


def test_short_independent_residuals_have_the_correlation_time_one() -> None:
    """The squares of n correlations by chance, 1/n each, must not count: in 20 readings they would add 0.5.

    The mean over 2000 records may exceed 1 a little, because no correlation time is below 1.
    """
    random = np.random.default_rng(11)
    times = [statistics.correlation_time(random.standard_normal(20)) for _ in range(2000)]
    assert 1.0 <= np.mean(times) < 1.1


def test_readings_that_repeat_count_once() -> None:
    """If every value is repeated m times, rho falls linearly over m lags: ``1 + 2 sum (1 - lag/m)² = (2 m² + 1)/(3
    m)``."""
    values = np.repeat(np.random.default_rng(3).standard_normal(4000), 6)
    assert statistics.correlation_time(values) == pytest.approx((2 * 36 + 1) / 18, rel=0.05)
    assert statistics.correlation_time(np.ones(100)) > 30.0
    assert statistics.correlation_time(np.zeros(100)) == 1.0


def test_autocorrelation_is_the_sum_of_products() -> None:
    values = np.random.default_rng(5).standard_normal(37)
    direct = [values[: 37 - lag] @ values[lag:] for lag in range(37)]
    np.testing.assert_allclose(statistics.autocorrelation(values), np.array(direct) / direct[0], atol=1e-14)


# --- goodness ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("degrees", "value", "p"), [(1, 3.841, 0.05), (10, 18.307, 0.05), (10, 23.209, 0.01), (100, 124.342, 0.05)])
def test_chi_squared_as_in_tables(degrees: int, value: float, p: float) -> None:
    """Compare with Abramowitz & Stegun 1964, table 26.8."""
    assert statistics.chi_squared_p(value, degrees) == pytest.approx(p, rel=1e-3)


def test_bic_is_twice_the_logarithm_of_the_bayes_factor() -> None:
    """Compare the criterion with ``-2 ln`` of the ratio of evidences, by quadrature, for a mean that is known to be 0
    or is free within a wide box.

    Schwarz's approximation is exact in the limit of many readings, up to a constant.
    """
    source = np.random.default_rng(2)
    gaps = []
    for n in (200, 20_000):
        y = source.standard_normal(n)
        zero, free = float(y @ y), float((y - y.mean()) @ (y - y.mean()))
        ours = statistics.bic(free, n, 1, n) - statistics.bic(zero, n, 0, n)
        mean = np.linspace(-6.0, 6.0, 4001) / math.sqrt(n) + y.mean()
        squares = free + n * (mean - y.mean()) ** 2
        evidence = np.trapezoid if hasattr(np, "trapezoid") else np.trapz
        ratio = evidence((squares / zero) ** (-n / 2), mean) / math.sqrt(2.0 * math.pi)
        gaps.append(ours + 2.0 * math.log(ratio))
    assert np.max(np.abs(gaps)) < 0.1


def test_several_fits_share_the_readings_that_count_of_the_best() -> None:
    good = SimpleNamespace(residual=np.full(100, 0.1), names=("a", "b", "c"), n_effective=50.0)
    poor = SimpleNamespace(residual=np.full(100, 0.2), names=("a", "b"), n_effective=2.0)
    found = common_bic([poor, good])
    assert found == pytest.approx([50.0 * math.log(0.04) + 2.0 * math.log(50.0),
                                   50.0 * math.log(0.01) + 3.0 * math.log(50.0)])


def test_the_error_of_a_reading_is_that_of_the_noise_alone() -> None:
    """White noise of 1 plus a slow misfit of 50 and a jump in the times: within three standard errors of 1.8/2
    ``1/sqrt(n)``."""
    source = np.random.default_rng(0)
    time = np.cumsum(source.uniform(0.5, 1.5, 20_000))
    misfit = 50.0 * np.sin(time / 300.0)
    found = statistics.reading_error(time, misfit + source.standard_normal(20_000))
    assert found == pytest.approx(1.0, abs=3.0 * 0.9 / math.sqrt(20_000))
    assert math.isnan(statistics.reading_error(time[:4], misfit[:4]))


@pytest.mark.slow
def test_p_of_noise_is_uniform() -> None:
    """For 2000 fits of a mean to 300 independent readings, the share of p below a limit is right within three standard
    errors."""
    source, found = np.random.default_rng(1), []
    for _ in range(2000):
        y = source.standard_normal(300)
        fit = Fit(Recording(np.arange(300.0), y, "noise"), solution(np.ones((300, 1)), y - y.mean()), 1.0)
        found.append(fit.p_value)
    for limit in (0.05, 0.25, 0.5, 0.75, 0.95):
        share = float(np.mean(np.array(found) < limit))
        assert abs(share - limit) < 3.0 * math.sqrt(limit * (1.0 - limit) / 2000) + 0.005


# --- errors --------------------------------------------------------------------------------------------------------


def test_a_straight_line_has_the_errors_of_the_textbook() -> None:
    """Slope ``s²/Sxx``, intercept ``s² (1/n + mean²/Sxx)`` and covariance ``-s² mean/Sxx`` are the same in any units,
    without swings, in which slow changes would show."""
    source = np.random.default_rng(4)
    x = source.uniform(2.0, 5.0, 300)
    y = 1.0 + 2.0 * x + source.standard_normal(300)
    slope, intercept = np.polyfit(x, y, 1)
    residual = y - intercept - slope * x
    spread, variance = float(np.sum((x - x.mean()) ** 2)), float(residual @ residual) / 298
    found = errors_found(solution(np.stack([np.ones(300), 1e9 * x], axis=1), residual))
    expected = variance * np.array([[1 / 300 + x.mean() ** 2 / spread, -x.mean() / spread / 1e9],
                                    [-x.mean() / spread / 1e9, 1.0 / spread / 1e18]])
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-9)
    assert found.freedom == 298
    assert "they are 1 times those of independent readings" in found.how


def test_the_mean_of_correlated_readings_has_the_known_variance() -> None:
    """For AR(1) with rho = 0.8, the variance of the mean is ``sigma²/(1 - rho)²/n``, 9 times that of independent
    readings. Its logarithm is known to about 0.2, from 40 orders, and 8 processes to 0.1."""
    found = []
    for seed in range(8):
        path = autoregressive(50_000, 0.8, seed)
        found.append(errors_found(solution(np.ones((50_000, 1)), path - path.mean(), swing=8)))
    assert found[0].plain[0, 0] == pytest.approx(1.0 / 0.36 / 5e4, rel=0.05)
    assert np.mean(np.log([one.covariance[0, 0] * 5e4 / 25.0 for one in found])) == pytest.approx(0.0, abs=0.3)
    ratio = math.sqrt(found[0].covariance[0, 0] / found[0].plain[0, 0])
    assert f"they are {ratio:.2g} times those of independent readings" in found[0].how


@pytest.mark.slow
def test_a_misfit_that_oscillates_with_the_swing_counts_by_its_envelope() -> None:
    """Fit the amplitude a of ``a cos(w t)`` to readings ``cos(w t) m(t)``.

    a is the mean of m. Its variance is that of the mean of an AR(1) process, although the autocorrelations of the
    residuals sum to 0.
    """
    n, half, rho = 80_000, 4, 0.95
    wave = np.cos(math.pi * (np.arange(n) + 0.5) / half)
    truth, ratios = 1.0 / (1.0 - rho) ** 2 / (n // half), []
    for seed in range(10, 16):
        misfit = np.repeat(autoregressive(n // half, rho, seed), half) * wave
        value = float(wave @ misfit) / float(wave @ wave)
        found = errors_found(solution(wave[:, None], misfit - value * wave, swing=half))
        ratios.append(found.covariance[0, 0] / truth)
        assert found.covariance[0, 0] > 10.0 * found.plain[0, 0]
    assert abs(statistics.autocorrelation(misfit)[1 : 20 * half].sum()) < 1.0
    assert np.mean(np.log(ratios)) == pytest.approx(0.0, abs=0.4)


def swinging(n: int = 1200, cycles: float = 40.0) -> tuple[Any, Any]:
    """Return derivatives of a damped swing by angle, velocity, zero, period and damping, and its phase."""
    phase = math.tau * cycles * np.arange(n) / n
    size = np.exp(-phase / phase[-1])
    wave = np.stack([np.cos(phase), np.sin(phase)]) * size
    return np.stack([*wave, np.ones(n), wave[1] * phase, wave[0] * phase], axis=1), phase


@pytest.mark.quick("2.0")
@pytest.mark.parametrize("cycles", [2.0, 6.0, pytest.param(40.0, marks=pytest.mark.slow)])
def test_noise_alone_has_the_errors_of_least_squares(cycles: float) -> None:
    """Of 200 drawn fits, 95 % intervals hold the truth, 0, in 91 to 99 % (1.5 % is one standard deviation), and the
    pulls have an rms of 1 within 15 %."""
    from scipy.stats import t

    slopes, phase = swinging(round(30 * cycles), cycles)
    project, source = np.linalg.pinv(slopes), np.random.default_rng(1)
    pulls, held = [], []
    for _ in range(200):
        noise = source.standard_normal(len(phase))
        value = project @ noise
        covariance, freedom = errors.slow_covariance(slopes, noise - slopes @ value, phase, -np.sin(phase + 1e-6))
        pulls.append(value / np.sqrt(np.diag(covariance)))
        held.append(np.abs(pulls[-1]) < t.ppf(0.975, freedom))
    assert np.sqrt(np.mean(np.square(pulls), axis=0)) == pytest.approx(1.0, abs=0.15)
    assert np.all((np.mean(held, axis=0) >= 0.91) & (np.mean(held, axis=0) <= 0.99))


@pytest.mark.quick("zero")
@pytest.mark.parametrize("kind", ["zero", "period", "jump", "second mode"])
def test_errors_grow_smoothly_with_a_disturbance(kind: str) -> None:
    """A disturbance grows from 0.05 to 30 standard deviations of the noise in 20 steps. Within the steepest of them, in
    20 fine steps, no error changes by more than 20 % from one to the next: a test that switches between two formulas
    would be a jump in one of them. The error that the disturbance concerns ends more than ten times as large.
    """
    slopes, phase = swinging()
    time = phase / phase[-1]
    shape, concerned = {
        "zero": (np.exp(-3.0 * time), 2), "period": (4.0 * time * (1.0 - time) * np.sin(phase), 3),
        "jump": (1.0 * (time > 0.35), 2), "second mode": (np.cos(1.03 * phase + 1.0), 4)}[kind]
    noise, project = np.random.default_rng(2).standard_normal(len(phase)), np.linalg.pinv(slopes)

    def found(size: float) -> Any:
        residual = noise + size * shape
        residual = residual - slopes @ (project @ residual)
        return np.diag(errors.slow_covariance(slopes, residual, phase, -np.sin(phase + 1e-6))[0]) ** 0.5

    sizes = np.geomspace(0.05, 30.0, 20)
    coarse = [found(size) for size in sizes]
    steps = np.abs(np.diff(np.log(coarse), axis=0)).max(axis=1)
    steep = int(np.argmax(steps))
    fine = [found(size) for size in np.geomspace(sizes[steep], sizes[steep + 1], 20)]
    assert np.abs(np.diff(np.log(fine), axis=0)).max() < math.log(1.2)
    np.testing.assert_allclose(coarse[0], found(0.0), rtol=0.05)
    assert coarse[-1][concerned] > 10.0 * coarse[0][concerned]


def test_what_the_recording_does_not_tell_has_no_finite_error() -> None:
    """Of two columns of equal shape neither is determined, and a column of zeros is not; the third is as if it were
    alone."""
    source = np.random.default_rng(12)
    x, y = source.standard_normal((2, 500))
    residual = source.standard_normal(500)
    found = errors_found(solution(np.stack([x, 3.0 * x, y, 0.0 * x], axis=1), residual))
    assert np.isinf(np.diag(found.covariance)).tolist() == [True, True, False, True]
    alone = errors_found(solution(np.stack([x, y], axis=1), residual))
    assert found.covariance[2, 2] == pytest.approx(alone.covariance[1, 1], rel=0.01)
    assert "a, b, d" in found.how


def test_a_number_at_its_bound_is_said() -> None:
    residual = np.random.default_rng(0).standard_normal(100)
    found = errors_found(solution(np.ones((100, 1)), residual, values=[0.0], least=0.0))
    assert found.how.endswith("a is at the bound 0, with a one-sided error.")


def test_what_pulls_at_a_bound_is_no_noise() -> None:
    """A mean of -0.5 is held at 0 under an AR(1) process: the error is that of the process about its own mean."""
    path = autoregressive(20_000, 0.8, 13)
    path -= path.mean()
    held = errors_found(solution(np.ones((20_000, 1)), path - 0.5, values=[0.0], least=0.0, swing=8))
    free = errors_found(solution(np.ones((20_000, 1)), path, swing=8))
    assert held.covariance[0, 0] == pytest.approx(free.covariance[0, 0], rel=1e-6)
