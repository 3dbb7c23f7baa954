"""What residuals say: how large, how independent, and how much a model is worth by them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.noise import off_neighbours

Array = NDArray[np.float64]

WINDOW = 5.0
"""The sum over lags ends where the lag is so many times the sum (Sokal 1997)."""
FOUND = 2.0 / (4.0 * ((56 / 70) ** 2 + (28 / 70) ** 2 + (8 / 70) ** 2 + (1 / 70) ** 2))
"""Degrees of freedom that count of a chi-squared by the error that the same residuals gave, as a share of theirs:
``chi2 / n`` of independent ones has the variance ``4/n`` times the sum of the squared autocorrelations at lags above 0
of ``(1, -4, 6, -4, 1)``, which takes a reading off its neighbours, in place of ``2/n``."""


class RunsTest(NamedTuple):
    """Runs of one sign among the residuals, and what independence lets expect.

    Attributes:
        number: runs that there are.
        z: ``(number - mean) / sqrt(variance)``; below 0: too few runs, neighbours are alike.
        p: chance of a ``|z|`` as large among independent residuals, by the normal distribution.
    """

    number: int
    z: float
    p: float


def reading_error(time: Array, residual: Array) -> float:
    """Standard deviation of one reading [rad], of noise and quantum, from the residuals of a fit.

    The root mean square of each residual's distance from the cubic through its four neighbours, times what makes that
    of independent residuals their own. A misfit that changes slowly from reading to reading does not count, nor does a
    motion that is fast beside the rate: the model has taken it off.
    """
    off = off_neighbours(time, residual)
    return float(np.sqrt(np.mean(off * off))) if len(off) else math.nan


def runs_test(residual: Array) -> RunsTest:
    """Wald & Wolfowitz 1940, Ann. Math. Stat. 11, 147: are the signs of the residuals in random order?

    With ``a`` positive and ``b`` negative ones among ``n = a + b``, the number of runs has the mean ``1 + 2ab/n`` and
    the variance ``2ab (2ab - n) / (n² (n - 1))``. Zeros are left out.
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
    """Autocorrelation about 0 at all lags, ``sum(x_i x_(i+lag)) / sum(x_i²)``, of the shape of ``values``."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(values)
    size = next_fast_len(2 * n, real=True)
    products = irfft(np.abs(rfft(values, size)) ** 2, size)[:n]
    return np.asarray(products / products[0] if products[0] > 0.0 else np.arange(n) == 0, dtype=np.float64)


def correlation_time(residual: Array) -> float:
    """Readings that count as one in the sum of squares: ``1 + 2 sum of rho_lag²`` over the lags, at least 1.

    That is how many times larger the variance of ``sum(r²)`` is than among independent Gaussian residuals (Bartlett
    1946, J. R. Stat. Soc. Suppl. 8, 27). Squares, as the sum of rho itself is 0 for a misfit that oscillates with the
    swing. What an estimated rho² has from chance, 1/n, is taken off. The sum ends at the first lag of 5 times itself
    (Sokal 1997, in Functional Integration, NATO ASI B 361, section 3). In readings, whatever their times.
    """
    n = len(residual)
    squares = autocorrelation(residual)[1:] ** 2 - 1.0 / n
    sums = 1.0 + 2.0 * np.cumsum(squares)
    beyond = np.flatnonzero(np.arange(1, n) >= WINDOW * sums)
    return min(max(1.0, float(sums[beyond[0]] if beyond.size else sums[-1])), float(n))


def chi_squared_p(chi2: float, degrees_of_freedom: float) -> float:
    """Chance of a chi-squared at least as large."""
    from scipy.stats import chi2 as distribution

    return float(distribution.sf(chi2, degrees_of_freedom))


def bic(squares: float, readings: int, parameters: int, effective: float) -> float:
    """Bayesian information criterion with a free variance: ``n' ln(RSS/n) + k ln n'``.

    Schwarz 1978, Ann. Stat. 6, 461, for Gaussian residuals of unknown variance, less a constant. ``n'`` readings count
    as independent, not all n: with n, a misfit that lasts as long as the swing would count as evidence in each
    reading anew, and the model with more parameters would always win.

    Args:
        squares: sum of the squared residuals, RSS [rad²].
        effective: n', readings that count: n over their correlation time.
    """
    variance = max(squares / readings, np.finfo(np.float64).tiny)
    return effective * math.log(variance) + parameters * math.log(effective)
