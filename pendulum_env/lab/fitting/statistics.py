"""Statistics of a fit's residuals: reading error, tests of independence, chi-squared and information criterion."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.noise import off_neighbours

Array = NDArray[np.float64]

DEPENDENT = 0.05
"""Residuals have a pattern, to a reader, if the p value of the runs test is below this."""
WINDOW = 5.0
"""The sum of autocorrelations ends at the lag that is this many times the sum (Sokal 1997)."""
FOUND = 2.0 / (4.0 * ((56 / 70) ** 2 + (28 / 70) ** 2 + (8 / 70) ** 2 + (1 / 70) ** 2))
"""Effective share of the degrees of freedom of a chi-squared whose reading error was estimated from the same residuals.

For independent residuals, ``chi2 / n`` then has the variance ``4/n`` times the sum of the squared autocorrelations at
lags above 0 of ``(1, -4, 6, -4, 1)``, the weights of the estimate, in place of ``2/n``."""


class RunsTest(NamedTuple):
    """Result of a runs test: runs of equal sign among the residuals, compared with independent residuals.

    Attributes:
        number: number of runs.
        z: ``(number - mean) / sqrt(variance)``; below 0 there are too few runs, so neighbours are correlated.
        p: probability of a ``|z|`` at least as large for independent residuals, by the normal distribution.
    """

    number: int
    z: float
    p: float


def reading_error(time: Array, residual: Array) -> float:
    """Return the standard deviation of one reading [rad], noise and rounding included, from the residuals of a fit.

    It is the root mean square distance of a residual from the cubic through its four neighbours, scaled to the standard
    deviation of independent residuals. A misfit that changes slowly from reading to reading does not contribute. Fast
    motion does not contribute either, because the fitted model has been subtracted.
    """
    off = off_neighbours(time, residual)
    return float(np.sqrt(np.mean(off * off))) if len(off) else math.nan


def runs_test(residual: Array) -> RunsTest:
    """Test whether the signs of the residuals are in random order (Wald & Wolfowitz 1940, Ann. Math. Stat. 11, 147).

    With ``a`` positive and ``b`` negative residuals among ``n = a + b``, the number of runs has the mean ``1 + 2ab/n``
    and the variance ``2ab (2ab - n) / (n² (n - 1))``. Zeros are left out.
    """
    signs = np.sign(residual[residual != 0.0])
    n, above = len(signs), int(np.count_nonzero(signs > 0))
    count = int(np.count_nonzero(np.diff(signs))) + min(n, 1)
    pairs = 2.0 * above * (n - above)
    variance = pairs * (pairs - n) / (n * n * (n - 1.0)) if n > 1 else 0.0
    if variance <= 0.0:
        return RunsTest(count, -math.inf, 0.0) if n > 1 and not pairs else RunsTest(count, 0.0, 1.0)
    z = (count - 1.0 - pairs / n) / math.sqrt(variance)
    return RunsTest(count, z, math.erfc(abs(z) / math.sqrt(2.0)))


def autocorrelation(values: Array) -> Array:
    """Return the autocorrelation about 0, ``sum(x_i x_(i+lag)) / sum(x_i²)``, at all lags, in the shape of ``values``.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(values)
    size = next_fast_len(2 * n, real=True)
    products = irfft(np.abs(rfft(values, size)) ** 2, size)[:n]
    return np.asarray(products / products[0] if products[0] > 0.0 else np.arange(n) == 0, dtype=np.float64)


def correlation_time(residual: Array) -> float:
    """Return the correlation time of residuals, in readings: ``1 + 2 sum of rho_lag²`` over the lags, at least 1.

    This is the factor by which the variance of ``sum(r²)`` exceeds that of independent Gaussian residuals (Bartlett
    1946, J. R. Stat. Soc. Suppl. 8, 27). Squares are summed because the sum of rho itself is 0 for a misfit that
    oscillates with the swing. The mean of an estimated rho² due to chance, 1/n, is subtracted. The sum ends at the
    first lag that is 5 times the sum (Sokal 1997, in Functional Integration, NATO ASI B 361, section 3).
    """
    n = len(residual)
    squares = autocorrelation(residual)[1:] ** 2 - 1.0 / n
    sums = 1.0 + 2.0 * np.cumsum(squares)
    beyond = np.flatnonzero(np.arange(1, n) >= WINDOW * sums)
    return min(max(1.0, float(sums[beyond[0]] if beyond.size else sums[-1])), float(n))


def split_r(chain: Array) -> Array:
    """Return the potential scale reduction R-hat of every parameter of a Markov chain, an array; 1 below 4 steps.

    Each half of a walker's steps counts as a chain of m steps. With the mean W of their variances and the variance
    B of their means, R is ``sqrt((m - 1)/m + B/W)`` (Gelman et al. 2013, Bayesian Data Analysis, section 11.4).

    Args:
        chain: parameters of all walkers after every step, ``(steps, walkers, parameters)``.
    """
    m = len(chain) // 2
    if m < 2:
        return np.ones(chain.shape[2])
    parts = np.concatenate([chain[:m], chain[-m:]], axis=1)
    within = parts.var(axis=0, ddof=1).mean(axis=0)
    between = parts.mean(axis=0).var(axis=0, ddof=1)
    return np.asarray(np.sqrt((m - 1.0) / m + between / np.where(within > 0.0, within, 1.0)))


def chi_squared_p(chi2: float, degrees_of_freedom: float) -> float:
    """Return the probability that chi-squared is at least ``chi2``, for the given degrees of freedom."""
    from scipy.stats import chi2 as distribution

    return float(distribution.sf(chi2, degrees_of_freedom))


def bic(squares: float, readings: int, parameters: int, effective: float) -> float:
    """Return the Bayesian information criterion with a free variance: ``n' ln(RSS/n) + k ln n'``.

    This is the criterion of Schwarz 1978, Ann. Stat. 6, 461, for Gaussian residuals of unknown variance, without a
    constant. Only ``n'`` of the n readings count as independent. With n, a misfit that lasts as long as the swing would
    count as new evidence in every reading, and the model with more parameters would always win.

    Args:
        squares: sum of the squared residuals, RSS [rad²].
        readings: number n of readings.
        parameters: number k of fitted parameters.
        effective: number n' of independent readings, n divided by the correlation time.
    """
    variance = max(squares / readings, np.finfo(np.float64).tiny)
    return effective * math.log(variance) + parameters * math.log(effective)
