"""Standard errors of fitted parameters, for independent and for correlated residuals and for rounded readings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.model import GRAVITY, LENGTH, SCALE
from pendulum_env.lab.fitting.shooting import FitSolution
from pendulum_env.lab.fitting.statistics import RunsTest, reading_error, runs_test
from pendulum_env.lab.measures import Measurement

Array = NDArray[np.float64]

DEPENDENT = 0.05
"""Residuals count as correlated if the p value of the runs test is below this."""
UNKNOWN = 1e-9
"""Eigenvalue of the scaled ``J^T J`` below which a combination of parameters counts as undetermined."""
ALIKE = 1e-6
"""A change of the angles counts as described by the parameters if they leave less than this share of it."""
COARSE = 1.2
"""A parameter is named in the report if rounding enlarges its standard error by more than this factor."""
STEADIEST = 0.97
"""Upper limit of the autocorrelation of half swings in the bandwidth formula (Andrews & Monahan 1992)."""
DRIFTS = 3.0
"""A drift of the period enters the error of the length if it is this many of its own errors."""
AKAIKE = 2.0
"""Chi-squared by which a scale must explain the residuals better than a drift, with a parameter more (Akaike 1974)."""
SCALED = 0.1
"""A wrong or changing scale of the angles enters the error of the length if its p value is below this."""
DRAWS = 256
"""Number of rounded motions that are simulated; a standard error from this many is accurate to 4 %."""


@dataclass(frozen=True, eq=False)
class Errors:
    """Covariance of fitted parameters, and how it was calculated.

    Attributes:
        covariance: covariance matrix of the parameters ``model.names``; inf on the diagonal for a parameter that the
            recording does not determine.
        plain: the covariance matrix that would hold for independent residuals.
        freedom: degrees of freedom of Student's t for intervals.
        how: the method of calculation, as text.
        drift: change of the small-angle period over the recording, relative to the period [1]; None if neither the
            length nor gravity was fitted.
    """

    covariance: Array
    plain: Array
    freedom: float
    how: str
    drift: Measurement | None = None


def errors_of(solution: FitSolution, readings: Array, quantum: float = 0.0) -> Errors:
    """Return the standard errors of a least-squares fit with equal weights, as a covariance matrix.

    If the residuals r look independent (runs test with p of at least 0.05), the covariance is ``s² (J^T J)^-1`` with
    ``s² = r.r / (n - k)``, which needs no estimate of the noise. Otherwise it is ``(J^T J)^-1 S (J^T J)^-1`` with the
    :func:`long_run` covariance S of the scores ``J_i r_i`` summed over half swings. A misfit that oscillates with the
    swing gives scores of a constant sign, correlated over many swings, plus an oscillation that these sums remove. No
    variance is reduced by this correction, and none is smaller than :func:`rounding_covariance` gives.

    The fitted length L, or gravity, is one value for a recording in which the small-angle period T may change, as it
    seems to if the angles are scaled or displaced. If the change over the recording, ``d T`` by :func:`period_drift`,
    exceeds three of its errors, the variance ``(2 L d)² / 12`` of a value that is spread evenly over this range is
    added. If the readings rather prefer angles whose scale is another, or changes over the recording, the square of the
    change of L that this implies is added, by :func:`shift_by_scale`.

    Args:
        solution: the least-squares fit.
        readings: the fitted readings [rad].
        quantum: smallest step of the sensor's readings [rad]; 0 for none.
    """
    residual, slopes = solution.residual, solution.jacobian
    seen, (n, k) = readings - residual, slopes.shape
    inverse, known = inverted(slopes)
    variance = float(residual @ residual) / (n - k)
    plain = inverse * variance
    test = runs_test(residual)
    free = np.isfinite(np.diag(plain))
    if test.p >= DEPENDENT:
        covariance, freedom = plain, float(n - k)
        how = (f"The residuals look independent (runs test: p = {test.p:.2g}), so the errors are those of least "
               f"squares, from the scatter of the residuals, with {n - k} degrees of freedom")
    else:
        sums = half_swings(slopes * residual[:, None], solution.velocity)
        covariance, freedom, how = _dependent(inverse, plain, sums, n, test)
    remarks = [how]
    if quantum > 0.0:
        covariance, coarse = _rounded(covariance, inverse, solution, seen, quantum)
        if coarse:
            model = solution.model
            size = f"{quantum:.3g} m/s²" if model.mount else f"{math.degrees(quantum):.3g} degrees{'/s' * model.rate}"
            remarks.append(f"the sensor's steps of {size} enlarge the error of {coarse}, as successive swings are "
                           "rounded in nearly the same way")
    drift, ratio = None, next((name for name in (LENGTH, GRAVITY, "inertia") if name in solution.model.names), None)
    if ratio is not None:
        drift, at, spread = period_drift(solution), solution.model.names.index(ratio), 0.0
        shift, statistic, p = shift_by_scale(solution, seen, at)
        pull = abs(drift.value) / drift.error
        if pull > max(DRIFTS, math.sqrt(max(statistic - AKAIKE, 0.0))):
            spread = 2.0 * solution.values[at] * drift.value / math.sqrt(12.0)
            remarks.append(_drifting(drift, ratio, SCALE in solution.model.names))
        elif p < SCALED:
            spread = shift
            remarks.append("the period depends on the amplitude as if the scale of the angles were wrong or changed "
                           f"during the run (p = {p:.2g}), which the error of {ratio} includes"
                           + ("" if SCALE in solution.model.names else f": try --free {ratio},{SCALE}"))
        least = np.zeros_like(covariance)
        least[at, at] = covariance[at, at] + spread**2
        covariance = _widened(covariance, least) if spread else covariance
    if not known or not free.all():
        lost = ", ".join(name for name, sure in zip(solution.model.names, free, strict=True) if not sure)
        remarks.append(f"the recording does not determine {lost}")
    held = at_bound(solution)
    if held:
        remarks.append(f"{', '.join(held)} {'is' if len(held) == 1 else 'are'} at the bound 0, with a one-sided error")
    return Errors(covariance, plain, freedom, "; ".join(remarks) + ".", drift)


def period_drift(solution: FitSolution) -> Measurement:
    """Return the change of the small-angle period over a recording, relative to the period, from a fit's residuals.

    A period that changes by d T, linearly in time, moves the angles by ``v t (1 - t/D) d/2`` from those with its mean,
    for the velocity v and the duration D. The part of this that no fitted parameter describes is fitted to the
    residuals by least squares. The error allows for correlated residuals, as those of the parameters do.
    """
    time = solution.model.time - solution.model.time[0]
    moved = solution.velocity * time * (1.0 - time / time[-1]) / 2.0
    values, covariance, _ = beyond_model(solution, moved[:, None])
    if not values.size:
        return Measurement(0.0, math.inf, "1")
    return Measurement(float(values[0]), math.sqrt(float(covariance[0, 0])), "1")


def shift_by_scale(solution: FitSolution, seen: Array, at: int) -> tuple[float, float, float]:
    """Return the change of a parameter if the scale of the angles is fitted, too, and chi-squared and p of a right one.

    A scale ``s + u (t/D - 1/2)`` with the duration D moves the angles theta by ``(s - 1 + u (t/D - 1/2)) theta``. Most
    of this is described by another amplitude and damping. The rest, a period that depends on the amplitude in another
    way, is fitted to the residuals; p belongs to s = 1, u = 0 (chi-squared test). ``seen`` are the model's angles, and
    ``at`` is the parameter's index.
    """
    from scipy.stats import chi2

    time = solution.model.time - solution.model.time[0]
    values, covariance, moves = beyond_model(solution, np.stack([seen, seen * (time / time[-1] - 0.5)], axis=1))
    if not values.size or not np.all(np.isfinite(covariance)):
        return 0.0, 0.0, 1.0
    statistic = float(values @ np.linalg.lstsq(covariance, values, rcond=None)[0])
    return float(-moves[at] @ values), statistic, float(chi2.sf(statistic, len(values)))


def beyond_model(solution: FitSolution, moved: Array) -> tuple[Array, Array, Array]:
    """Fit further changes of the angles to a fit's residuals; return their sizes, covariance, and what they replace.

    Args:
        solution: the least-squares fit.
        moved: changes of the angles of size 1, ``(readings, changes)``. Those that the fitted parameters describe, to
            one part in 1e6 (ALIKE), are left out.

    Returns:
        The sizes; their covariance, which allows for correlated residuals as that of the parameters does; and
        ``(parameters, changes)``, the values of the parameters that describe changes of size 1 best.
    """
    slopes, residual = solution.jacobian, solution.residual
    size = np.sqrt(np.einsum("ij,ij->j", slopes, slopes))
    size = np.where(size > 0.0, size, 1.0)
    moves = np.linalg.lstsq(slopes / size, moved, rcond=None)[0] / size[:, None]
    rest = moved - slopes @ moves
    new = np.linalg.norm(rest, axis=0) > ALIKE * np.linalg.norm(moved, axis=0)
    rest, moves = rest[:, new], moves[:, new]
    inverse, _ = inverted(rest)
    values = np.where(np.isfinite(inverse), inverse, 0.0) @ (rest.T @ residual)
    left = residual - rest @ values
    covariance = inverse * float(left @ left) / max(len(left) - slopes.shape[1] - len(values), 1)
    test = runs_test(left)
    if values.size and test.p < DEPENDENT:
        scores = half_swings(rest * left[:, None], solution.velocity)
        covariance, *_ = _dependent(inverse, covariance, scores, len(left), test)
    return values, covariance, moves


def _drifting(drift: Measurement, name: str, scaled: bool) -> str:
    """Return a remark on a drift of the period that enters the error of the length or of gravity, and its usual cause.
    """
    percent = str(Measurement(100.0 * drift.value, 100.0 * drift.error, "%"))
    cause = "although the scale is fitted, so the length, the pivot or the zero moves" if scaled else (
        f"angles look scaled or displaced: try --free {name},{SCALE}")
    return (f"the amplitude-corrected period drifts by {percent} over the run, which the error of {name} includes; "
            f"{cause}")


def _dependent(inverse: Array, plain: Array, sums: Array, n: int, test: RunsTest) -> tuple[Array, float, str]:
    """Return a covariance of fitted parameters for correlated residuals, its degrees of freedom, and how it was made.

    ``sums`` are the scores (derivatives of the model times residuals) summed over half swings; ``n`` is the number of
    readings.
    """
    blocks, k = sums.shape
    sums = sums - sums.mean(axis=0)  # the mean is 0 except for parameters at a bound
    width = bandwidth(sums)
    middle = long_run(sums, width) * (n / (n - k))
    finite = np.where(np.isfinite(inverse), inverse, 0.0)
    covariance = _widened(finite @ middle @ finite, plain)
    freedom = max(2.0, min(1.5 * blocks / max(width, 1.0), blocks - 1.0))
    how = (f"The residuals are not independent ({test.number} runs, z = {test.z:.3g}), so the errors allow for "
           f"correlation over {max(width, 1.0):.2g} of {blocks} half swings (Newey & West 1987, bandwidth of "
           f"Andrews 1991), with {freedom:.2g} degrees of freedom")
    return covariance, freedom, how


def _rounded(
    covariance: Array, inverse: Array, solution: FitSolution, seen: Array, quantum: float
) -> tuple[Array, str]:
    """Return a covariance of fitted parameters that allows for rounded readings, and the names of the parameters whose
    errors it enlarges by more than a factor of 1.2 (COARSE).
    """
    model, finite = solution.model, np.where(np.isfinite(inverse), inverse, 0.0)
    noise = noise_beside(model.time, solution.residual, quantum)
    shift = solution.velocity * float(np.median(np.diff(model.time)))
    least = rounding_covariance(seen, solution.jacobian, finite, quantum, noise, shift)
    pairs = zip(model.names, np.diag(covariance), np.diag(least), strict=True)
    return _widened(covariance, least), ", ".join(name for name, own, other in pairs if other > COARSE**2 * own)


def _widened(covariance: Array, least: Array) -> Array:
    """Enlarge a covariance matrix until no variance is below that in ``least``, without changing its correlations."""
    own, other = np.sqrt(np.diag(covariance)), np.sqrt(np.diag(least))
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = np.where(own < other, other / own, 1.0)
    wider = np.where(np.isfinite(wider), wider, 1.0)
    with np.errstate(invalid="ignore"):
        enlarged = covariance * np.outer(wider, wider)
    np.fill_diagonal(enlarged, np.maximum(np.diag(covariance), np.diag(least)))
    return np.asarray(enlarged)


def inverted(slopes: Array) -> tuple[Array, bool]:
    """Return ``(J^T J)^-1`` for the derivatives J, and True if the recording determines every parameter.

    The diagonal is inf for a parameter that is not determined. Columns of J are scaled to length 1 before the
    inversion, so units do not matter.
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
    """Sum the scores of a fit (derivatives times residuals), shape ``(readings, parameters)``, over every half swing,
    from one turning point to the next.

    The turning points are where the model's ``velocity`` changes sign.
    """
    turns = np.flatnonzero(np.diff(np.signbit(velocity).astype(np.int8))) + 1
    edges = np.concatenate([[0], turns])
    return np.asarray(np.add.reduceat(scores, edges, axis=0))


def bandwidth(scores: Array) -> float:
    """Return the bandwidth of the Bartlett kernel for correlated rows of ``scores``: ``1.1447 (alpha n)^(1/3)``.

    With n rows and alpha from their autocorrelation, this is the plug-in bandwidth of Andrews 1991, Econometrica 59,
    817, equations 6.2 and 6.4. Every column is taken as an autoregressive process of order 1, with equal weights.
    Autocorrelations below 0 count as 0.
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
    """Return the long-run covariance of correlated rows g_i,
    ``sum over lags of (1 - |lag| / width) sum_i g_i g_(i+lag)^T``.

    The Bartlett kernel (Newey & West 1987, Econometrica 55, 703) makes it positive semidefinite. Because the scores of
    a fit sum to 0, the estimate is too small by a share ``b - b²/3``, ``b = width / n`` (Kiefer & Vogelsang 2005,
    Econom. Theory 21, 1130); this is corrected.
    """
    n = len(scores)
    total = scores.T @ scores
    for lag in range(1, math.ceil(width)):
        product = scores[:-lag].T @ scores[lag:]
        total = total + (1.0 - lag / width) * (product + product.T)
    share = min(width / n, 1.0)
    return np.asarray(total / (1.0 - share + share**2 / 3.0))


def at_bound(solution: FitSolution) -> tuple[str, ...]:
    """Return the names of the fitted parameters whose fitted values are at their lower bounds."""
    bounds = zip(solution.model.names, solution.values, solution.model.least, strict=True)
    return tuple(name for name, value, least in bounds if value <= least)


# --- rounding --------------------------------------------------------------------------------------------------------


def rounding_covariance(
    seen: Array, slopes: Array, inverse: Array, quantum: float, noise: float, shift: Array
) -> Array:
    """Return the covariance of least-squares parameters that is due to the rounding of the readings.

    The parameter errors ``(J^T J)^-1 J^T e``, with ``e = q round((theta + noise) / q) - theta``, are calculated for 256
    motions theta: the fitted motion with a zero and an amplitude changed by up to half a quantum, sampled up to half a
    step earlier or later. Rounding errors of readings that scatter by less than half a quantum are not random (Widrow &
    Kollar 2008, Quantization Noise): if the amplitude falls by less than a quantum or two, or every swing is sampled at
    the same phases, successive swings are rounded in the same way, and more of them give no new information.

    Args:
        seen: angles of the model [rad].
        slopes: derivatives J of the angles, ``(readings, parameters)``.
        inverse: ``(J^T J)^-1``.
        quantum, noise: smallest step of the sensor's readings, and noise without the contribution of rounding [rad].
        shift: change of every angle within one sampling step [rad].
    """
    source = np.random.default_rng(0)
    middle = seen - seen.mean()
    size = max(float(np.max(np.abs(middle))), quantum)
    draws = np.empty((DRAWS, slopes.shape[1]))
    for row, (zero, grown, later) in zip(draws, source.uniform(-0.5, 0.5, (DRAWS, 3)), strict=True):
        motion = seen + quantum * (zero + grown * middle / size) + later * shift
        read = motion + noise * source.standard_normal(len(motion)) if noise > 0.0 else motion
        row[:] = (quantum * np.round(read / quantum) - motion) @ slopes
    return np.asarray(inverse @ (draws.T @ draws / DRAWS) @ inverse)


def noise_beside(time: Array, residual: Array, quantum: float) -> float:
    """Return the noise of the readings [rad] without the rounding error ``quantum / sqrt(12)``.

    It is the smaller of two estimates: the rms of the residuals, which a misfit enlarges, and the scatter of readings
    about their neighbours, which rounding steps at every other reading enlarge.
    """
    scatter = np.fmin(math.sqrt(float(np.mean(residual**2))), reading_error(time, residual))
    return math.sqrt(max(float(scatter) ** 2 - quantum**2 / 12.0, 0.0))
