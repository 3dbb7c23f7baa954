"""Standard errors of fitted numbers: for residuals that are independent, for others, and for a sensor's rounding."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.shooting import Solution
from pendulum_env.lab.fitting.statistics import RunsTest, reading_error, runs_test

Array = NDArray[np.float64]

DEPENDENT = 0.05
"""p of the runs test below which residuals are not taken as independent."""
UNKNOWN = 1e-9
"""Eigenvalue of the scaled ``J^T J`` below which the recording says nothing on that combination of parameters."""
COARSE = 1.2
"""Times that rounding must make an error larger to be named for it."""
STEADIEST = 0.97
"""Largest autocorrelation of half swings that the bandwidth is derived from (Andrews & Monahan 1992)."""
DRAWS = 256
"""Motions that are rounded: a standard error from so many is good to 4 %."""


@dataclass(frozen=True, eq=False)
class Errors:
    """Covariance of fitted numbers, and how it was found.

    Attributes:
        covariance: of ``model.names``; inf on the diagonal where the recording says nothing.
        plain: the same, were the residuals independent.
        freedom: degrees of freedom of Student's t for intervals.
        how: what was done, in a sentence.
    """

    covariance: Array
    plain: Array
    freedom: float
    how: str


def errors_of(solution: Solution, quantum: float = 0.0) -> Errors:
    """Standard errors of a least-squares fit with equal weights.

    Residuals r that look independent (runs test, p of at least 0.05): ``s² (J^T J)^-1``, ``s² = r.r / (n - k)``; a
    wrong estimate of the noise does no harm. Others: ``(J^T J)^-1 S (J^T J)^-1`` with S as :func:`long_run` has it, of
    the scores ``J_i r_i`` summed over half swings: a misfit that oscillates with the swing makes scores of a steady
    sign, correlated over many swings, on top of an oscillation that the sums leave out. No error is made smaller, nor
    smaller than rounding makes it; see :func:`rounding_covariance`.

    Args:
        quantum: of the sensor [rad]; 0 for none.
    """
    residual, slopes = solution.residual, solution.jacobian
    n, k = slopes.shape
    inverse, known = inverted(slopes)
    variance = float(residual @ residual) / (n - k)
    plain = inverse * variance
    test = runs_test(residual)
    free = np.isfinite(np.diag(plain))
    if test.p >= DEPENDENT:
        covariance, freedom = plain, float(n - k)
        how = (f"The residuals look independent (runs test: p = {test.p:.2g}), so the errors are those of least "
               f"squares with their own scatter, of {n - k} degrees of freedom")
    else:
        sums = half_swings(slopes * residual[:, None], solution.velocity)
        covariance, freedom, how = _dependent(inverse, plain, sums, n, test)
    told = [how]
    if quantum > 0.0:
        covariance, coarse = _rounded(covariance, inverse, solution, quantum)
        if coarse:
            told.append(f"the sensor's steps of {math.degrees(quantum):.3g} degrees make that of {coarse} larger, as "
                        "swings are rounded alike")
    if not known or not free.all():
        lost = ", ".join(name for name, sure in zip(solution.model.names, free, strict=True) if not sure)
        told.append(f"the recording does not tell {lost} apart or says nothing on them")
    held = at_bound(solution)
    if held:
        told.append(f"{', '.join(held)} {'is' if len(held) == 1 else 'are'} at the bound 0, the error one-sided")
    return Errors(covariance, plain, freedom, "; ".join(told) + ".")


def _dependent(inverse: Array, plain: Array, sums: Array, n: int, test: RunsTest) -> tuple[Array, float, str]:
    """Covariance that allows for dependence, degrees of freedom, and the sentence."""
    blocks, k = sums.shape
    sums = sums - sums.mean(axis=0)  # 0, but for numbers held by a bound
    width = bandwidth(sums)
    middle = long_run(sums, width) * (n / (n - k))
    finite = np.where(np.isfinite(inverse), inverse, 0.0)
    covariance = _widened(finite @ middle @ finite, plain)
    freedom = max(2.0, min(1.5 * blocks / max(width, 1.0), blocks - 1.0))
    how = (f"The residuals are not independent ({test.number} runs, z = {test.z:.3g}), so the errors allow for scores "
           f"that are correlated over {max(width, 1.0):.2g} of {blocks} half swings (Newey & West 1987, bandwidth of "
           f"Andrews 1991), with {freedom:.2g} degrees of freedom")
    return covariance, freedom, how


def _rounded(covariance: Array, inverse: Array, solution: Solution, quantum: float) -> tuple[Array, str]:
    """Covariance that allows for rounding, and the names whose errors that makes clearly larger."""
    model, finite = solution.model, np.where(np.isfinite(inverse), inverse, 0.0)
    noise = noise_beside(model.time, solution.residual, quantum)
    shift = solution.velocity * float(np.median(np.diff(model.time)))
    seen = model.angles(solution.values)[0]
    least = rounding_covariance(seen, solution.jacobian, finite, quantum, noise, shift)
    pairs = zip(model.names, np.diag(covariance), np.diag(least), strict=True)
    return _widened(covariance, least), ", ".join(name for name, own, other in pairs if other > COARSE**2 * own)


def _widened(covariance: Array, least: Array) -> Array:
    """A covariance with no variance below those of another, its correlations kept."""
    own, other = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(least))
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = np.where(own < other, other / own, 1.0)
    wider = np.where(np.isfinite(wider), wider, 1.0)
    with np.errstate(invalid="ignore"):
        found = covariance * np.outer(wider, wider)
    np.fill_diagonal(found, np.maximum(np.diag(covariance), np.diag(least)))
    return np.asarray(found)


def inverted(slopes: Array) -> tuple[Array, bool]:
    """``(J^T J)^-1``, and whether the recording determines every parameter; inf on the diagonal of those it does not.

    Columns are scaled to length 1 first, so units do not matter.
    """
    size = np.sqrt(np.einsum("ij,ij->j", slopes, slopes))
    scaled = slopes / np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    known = values > UNKNOWN
    inverse = (vectors[:, known] / values[known]) @ vectors[:, known].T
    lost = (vectors[:, ~known] ** 2).sum(axis=1) > 1e-6
    outer = np.outer(size, size)
    inverse = np.where(outer > 0.0, inverse / np.where(outer > 0.0, outer, 1.0), 0.0)
    inverse[lost, lost] = math.inf
    return inverse, bool(known.all())


def half_swings(scores: Array, velocity: Array) -> Array:
    """Scores ``(readings, parameters)`` summed from each turning point of the model to the next."""
    turns = np.flatnonzero(np.diff(np.signbit(velocity).astype(np.int8))) + 1
    edges = np.concatenate([[0], turns])
    return np.asarray(np.add.reduceat(scores, edges, axis=0))


def bandwidth(scores: Array) -> float:
    """Bandwidth of the Bartlett kernel in rows of ``scores``, ``1.1447 (alpha n)^(1/3)``.

    The plug-in of Andrews 1991, Econometrica 59, 817, equations 6.2 and 6.4: each column taken as an autoregressive
    process of order 1, all columns of equal weight. Autocorrelations below 0 count as 0.
    """
    n = len(scores)
    above = below = 0.0
    for column in scores.T:
        before, after = column[:-1], column[1:]
        squares = float(before @ before)
        if squares == 0.0:
            continue
        rho = min(max(float(before @ after) / squares, 0.0), STEADIEST)
        above += 4.0 * rho**2 / ((1.0 - rho) ** 6 * (1.0 + rho) ** 2)
        below += 1.0 / (1.0 - rho) ** 4
    return min(1.1447 * (above / below * n) ** (1.0 / 3.0), float(n)) if below else 0.0


def long_run(scores: Array, width: float) -> Array:
    """Long-run covariance of the sum of the rows, ``sum over lags of (1 - |lag| / width) sum_i g_i g_(i+lag)^T``.

    Newey & West 1987, Econometrica 55, 703: the Bartlett kernel, which makes it positive semidefinite. Scores of a fit
    sum to 0, which takes a share ``b - b²/3`` off, ``b = width / n`` (Kiefer & Vogelsang 2005, Econom. Theory 21,
    1130); it is put back.
    """
    n = len(scores)
    found = scores.T @ scores
    for lag in range(1, math.ceil(width)):
        product = scores[:-lag].T @ scores[lag:]
        found = found + (1.0 - lag / width) * (product + product.T)
    share = min(width / n, 1.0)
    return np.asarray(found / (1.0 - share + share**2 / 3.0))


def at_bound(solution: Solution) -> tuple[str, ...]:
    """Names of the numbers that are at their lower bound."""
    bounds = zip(solution.model.names, solution.values, solution.model.least, strict=True)
    return tuple(name for name, value, least in bounds if value <= least)


# --- rounding --------------------------------------------------------------------------------------------------------


def rounding_covariance(
    seen: Array, slopes: Array, inverse: Array, quantum: float, noise: float, shift: Array
) -> Array:
    """Covariance of least-squares parameters over motions that are like the fitted one, but lie elsewhere on the grid.

    ``(J^T J)^-1 J^T e``, ``e = q round((theta + noise) / q) - theta``: each of 256 motions theta is the fitted one with
    another zero and another amplitude, both uniform over a quantum, sampled up to half a reading earlier or later.
    Rounding errors of readings that scatter by less than half a quantum are not random (Widrow & Kollar 2008,
    Quantization Noise): where the amplitude falls by less than a quantum or two, or swings are read at the same phases
    again and again, each swing is rounded as the one before, and more of them tell nothing new.

    Args:
        seen: angles of the model [rad].
        slopes: their derivatives J, ``(readings, parameters)``.
        inverse: ``(J^T J)^-1``.
        quantum, noise: of the sensor, the noise without what rounding adds [rad].
        shift: change of each angle in the time of one reading [rad].
    """
    source = np.random.default_rng(0)
    middle = seen - seen.mean()
    size = max(float(np.max(np.abs(middle))), quantum)
    found = np.empty((DRAWS, slopes.shape[1]))
    for row, (zero, grown, later) in zip(found, source.uniform(-0.5, 0.5, (DRAWS, 3)), strict=True):
        motion = seen + quantum * (zero + grown * middle / size) + later * shift
        read = motion + noise * source.standard_normal(len(motion)) if noise > 0.0 else motion
        row[:] = (quantum * np.round(read / quantum) - motion) @ slopes
    return np.asarray(inverse @ (found.T @ found / DRAWS) @ inverse)


def noise_beside(time: Array, residual: Array, quantum: float) -> float:
    """Noise of readings [rad], without the ``quantum / sqrt(12)`` of rounding.

    From the residual's root mean square, to which a misfit adds, or from what sets readings off their neighbours, to
    which steps that come every other reading add: whichever is smaller.
    """
    scatter = np.fmin(math.sqrt(float(np.mean(residual**2))), reading_error(time, residual))
    return math.sqrt(max(float(scatter) ** 2 - quantum**2 / 12.0, 0.0))
