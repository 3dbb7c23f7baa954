"""Standard errors of fitted parameters, for slowly changing residuals as well as for noise, and for rounded readings.

The residual of a fit is taken as white noise plus ``a(t) cos phi + b(t) sin phi + z(t)``, for the phase phi of the
swing, where a, b and z change slowly. Drifts of the length, the scale, the amplitude and the zero, jumps of the zero,
and a second mode near the swing's frequency are of this kind. Each of a, b and z is a sum of Legendre polynomials over
the recording, whose coefficient of order j has the variance ``w (1 + s / j^p)`` with the variance w of the noise. The
lowest orders, which parameters describe, are not seen in the residual, but make the parameters wrong. How large they
are follows from the higher orders. These are judged by their restricted likelihood, that of the part of the readings
that no parameter describes (Patterson & Thompson 1971, Biometrika 58, 545; Harville 1977, J. Am. Stat. Assoc. 72, 320).
No test and no best size decides: the logarithms of the variances are averaged over all sizes s and powers p of a grid,
with the likelihood as weight, so that errors change smoothly with the readings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.model import GRAVITY, LENGTH
from pendulum_env.lab.fitting.shooting import FitSolution
from pendulum_env.lab.fitting.statistics import reading_error
from pendulum_env.lab.measures import Measurement

Array = NDArray[np.float64]

UNKNOWN = 1e-9
"""Eigenvalue of the scaled ``J^T J`` below which a combination of parameters counts as undetermined."""
COARSE = 1.2
"""A parameter is named in the report if rounding enlarges its standard error by more than this factor."""
ORDERS = 40
"""Highest order of the slow changes, which have at most one for every cycle of the swing."""
FALLS = np.array([2.0, 4.0, 6.0])
"""Powers p with which the variances of a and b fall with the order: 2 for random walks, 4 for a steady drift of the
period. Those of z fall half as fast, because a and b add up what disturbs the motion."""
SIZES = np.concatenate([[0.0], np.geomspace(1e-2, 1e14, 65)])
"""Variances s of the lowest order, in variances of the noise."""
USUAL = 0.1
"""Expected size of slow changes in the lowest order, in standard deviations of the noise: the scale of a half-Cauchy
distribution (Gelman 2006, Bayesian Anal. 1, 515)."""
NONE = 0.9
"""Share of recordings in which no slow changes are expected."""
TOGETHER = 0.7
"""Share of recordings in which a and b are expected to have the same s and p, as for a second mode; in the others, one
says nothing about the other."""
KNOWN = 3.0
"""Degrees of freedom that the noise at all frequencies counts in that near the swing's frequency and near 0."""
LEFT = 0.1
"""Share of a squared slow change that parameters must leave for it to be seen in the residual."""
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


def errors_of(
    solution: FitSolution, readings: Array, quantum: float = 0.0, beside: Array | None = None
) -> Errors:
    """Return the standard errors of a least-squares fit with equal weights, as a covariance matrix.

    The covariance is ``(J^T J)^-1 J^T C J (J^T J)^-1``, for the derivatives J and the covariance C of residuals that
    have slow changes beside the noise, by :func:`slow_covariance`. No variance is smaller than that of
    :func:`rounding_covariance`.

    Args:
        solution: the least-squares fit.
        readings: the fitted readings [rad].
        quantum: smallest step of the sensor's readings [rad]; 0 for none.
        beside: changes of the readings that were fitted with the parameters, such as jumps, ``(readings, changes)``.
    """
    model, residual, slopes = solution.model, solution.residual, solution.jacobian
    inverse, known = inverted(slopes)
    plain, own = inverse * (float(residual @ residual) / (len(residual) - len(model.names))), slice(len(model.names))
    if beside is not None:
        slopes = np.column_stack([slopes, beside])
        inverse, _ = inverted(slopes)
    covariance, freedom = slow_covariance(slopes, residual, model.time, solution.velocity)
    covariance = covariance[own, own]
    free = np.isfinite(np.diag(plain))
    sizes = _ratios(covariance, plain)[free] if free.any() else np.ones(1)
    low, high = (f"{float(f'{x:.2g}'):g}" for x in (sizes.min(), sizes.max()))
    remarks = ["The errors allow for residuals that change slowly, as by a drift, a jump or a second mode: they are "
               f"{low if low == high else f'{low} to {high}'} times those of independent readings"]
    if quantum > 0.0:
        noise = noise_beside(model.time, residual, quantum)
        shift = solution.velocity * float(np.median(np.diff(model.time)))
        least = rounding_covariance(readings - residual, slopes, _finite(inverse), quantum, noise, shift)[own, own]
        wider = np.maximum(_ratios(least, covariance), 1.0)
        covariance = covariance * np.outer(wider, wider)
        coarse = ", ".join(name for name, x in zip(model.names, wider, strict=True) if x > COARSE)
        size = f"{quantum:.3g} m/s²" if model.mount else f"{math.degrees(quantum):.3g} degrees{'/s' * model.rate}"
        remarks += [f"the sensor's steps of {size} enlarge the error of {coarse}, as successive swings are rounded in "
                    "nearly the same way"] * bool(coarse and quantum > noise)
    if not known or not free.all():
        lost = ", ".join(name for name, sure in zip(model.names, free, strict=True) if not sure)
        remarks.append(f"the recording does not determine {lost}")
    if held := at_bound(solution):
        remarks.append(f"{', '.join(held)} {'is' if len(held) == 1 else 'are'} at the bound 0, with a one-sided error")
    drift = period_drift(solution) if {LENGTH, GRAVITY, "inertia"} & set(model.names) else None
    return Errors(covariance, plain, freedom, "; ".join(remarks) + ".", drift)


def _ratios(variances: Array, others: Array) -> Array:
    """Return the standard errors in a covariance matrix over those in another; 1 where one of them is not known."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.sqrt(np.diag(variances) / np.diag(others))
    return np.where(np.isfinite(found), found, 1.0)


def period_drift(solution: FitSolution) -> Measurement:
    """Return the change of the small-angle period over a recording, relative to the period, from a fit's residuals.

    A period that changes by d T, linearly in time, moves the angles by ``v t (1 - t/D) d/2`` from those with its mean,
    for the velocity v and the duration D. It is fitted to the residuals together with changes of all parameters. The
    error allows for slow changes of the residuals, as those of the parameters do.
    """
    time = solution.model.time - solution.model.time[0]
    moved = solution.velocity * time * (1.0 - time / time[-1]) / 2.0
    slopes = np.column_stack([solution.jacobian, moved])
    inverse, _ = inverted(slopes)
    if not math.isfinite(inverse[-1, -1]):
        return Measurement(0.0, math.inf, "1")
    changes = _finite(inverse) @ (slopes.T @ solution.residual)
    covariance, _ = slow_covariance(slopes, solution.residual - slopes @ changes, time, solution.velocity)
    return Measurement(float(changes[-1]), math.sqrt(float(covariance[-1, -1])), "1")


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


def _finite(inverse: Array) -> Array:
    """Return ``(J^T J)^-1`` with 0 for the variances of parameters that are not determined."""
    return np.where(np.isfinite(inverse), inverse, 0.0)


def at_bound(solution: FitSolution) -> tuple[str, ...]:
    """Return the names of the fitted parameters whose fitted values are at their lower bounds."""
    bounds = zip(solution.model.names, solution.values, solution.model.least, strict=True)
    return tuple(name for name, value, least in bounds if value <= least)


# --- slow changes ----------------------------------------------------------------------------------------------------


def slow_covariance(slopes: Array, residual: Array, time: Array, velocity: Array) -> tuple[Array, float]:
    """Return the covariance of least-squares parameters if residuals change slowly, and its degrees of freedom.

    The angle and the velocity at the start are those of the swing with its slow changes. Without two turning points,
    the covariance is that for independent residuals.

    The noise w is that of the slow changes themselves, with KNOWN degrees of freedom added from the median of the
    residual's periodogram, which a vibration at another frequency does not enlarge. The degrees of freedom are those of
    a variance whose logarithm is as uncertain: 2 over its variance, in the mean over the parameters (compare
    Satterthwaite 1946, Biometrics Bull. 2, 110).

    Args:
        slopes: derivatives J of the readings, ``(readings, parameters)``.
        residual: readings minus model [rad].
        time, velocity: times [s], and the rates of the model's readings there [rad/s].
    """
    (n, k), (inverse, _) = slopes.shape, inverted(slopes)
    turns = np.flatnonzero(np.diff(np.signbit(velocity).astype(np.int8)))
    noise = float(np.median(np.abs(np.fft.rfft(residual)[1:]) ** 2)) / math.log(2.0) / (n - k)
    if len(turns) < 2 or not noise > 0.0:
        return inverse * (float(residual @ residual) / (n - k)), float(n - k)
    phase = swing_phase(time, velocity, turns)
    waves = math.sqrt(2.0) * np.cos(phase), math.sqrt(2.0) * np.sin(phase), np.ones(n)
    parts = [_judged(wave, slopes, residual, turns, inverse, noise) for wave in waves]
    likelihood, level, shares, moves, starts, counts = (np.stack(column) for column in zip(*parts, strict=True))
    usual = np.sqrt(SIZES[1:]) / (USUAL**2 + SIZES[1:])
    weights = likelihood * np.concatenate([[NONE], (1.0 - NONE) * usual / usual.sum()])
    other = weights[1::-1].sum(axis=(1, 2), keepdims=True) / len(FALLS)
    weights[:2] *= (1.0 - TOGETHER) * other + TOGETHER * likelihood[1::-1]
    weights /= weights.sum(axis=(1, 2), keepdims=True)
    own = np.exp((weights * level).sum(axis=(1, 2)))
    white = inverse * own.min() + np.einsum("i,iao,ibo->ab", own - own.min(), moves, moves)
    logs = np.log1p(SIZES[:, None] * shares[:, :, None, :])
    slow = own[:, None] * np.expm1(np.einsum("ifs,ifso->io", weights, logs))
    moves = moves - starts
    covariance = white + np.einsum("iao,io,ibo->ab", moves, slow, moves)
    lowest = level + logs.max(axis=3)
    unsure = (weights * lowest**2).sum(axis=(1, 2)) - (weights * lowest).sum(axis=(1, 2)) ** 2
    variances = np.stack([np.diag(white), *np.einsum("iao,io->ia", moves**2, slow)])
    total = np.diag(covariance)
    sure = np.isfinite(total) & (total > 0.0)
    ratios = variances[:, sure] / total[sure]
    spread = np.concatenate([[2.0 / counts.mean()], unsure]) @ ratios**2
    return covariance, max(2.0 / float(np.mean(spread)), 2.0) if spread.size else float(n - k)


def swing_phase(time: Array, velocity: Array, turns: NDArray[np.int64]) -> Array:
    """Return the phase of a swing [rad], a multiple of pi where the velocity is 0, and linear in time between.

    ``turns`` are the readings after which the velocity changes sign.
    """
    before, after = velocity[turns], velocity[turns + 1]
    at = time[turns] + (time[turns + 1] - time[turns]) * before / (before - after)
    half = (at[-1] - at[0]) / (len(at) - 1)
    early, late = (1.0 + math.ceil(max(x, 0.0) / half) for x in (at[0] - time[0], time[-1] - at[-1]))
    at = np.concatenate([[at[0] - early * half], at, [at[-1] + late * half]])
    number = np.concatenate([[-early], np.arange(len(turns)), [len(turns) - 1.0 + late]])
    return np.asarray(math.pi * np.interp(time, at, number))


def _judged(
    wave: Array, slopes: Array, residual: Array, turns: NDArray[np.int64], inverse: Array, noise: float
) -> tuple[Array, ...]:
    """Return how well each power and size of a slow change times ``wave`` explains a residual, and what it does to the
    parameters.

    Sums over half swings, between the turning points, take the place of readings.

    Returns:
        The restricted likelihood, relative to the largest, and the logarithm of the noise, both ``(powers, sizes)``;
        the variances of the orders for s = 1, ``(powers, orders)``; the changes of the parameters for coefficients of
        1, and the part of them that is due to the value at the start, both ``(parameters, orders)``; and the degrees of
        freedom of the noise.
    """
    from scipy.linalg import eigh

    inverse, edges = _finite(inverse), np.concatenate([[0], turns + 1])
    squares, tied, sums = (np.add.reduceat(x, edges, axis=0) for x in (
        wave * wave, wave[:, None] * slopes, wave * residual))
    order = np.arange(min(ORDERS, max(len(edges) // 2, 2)) + 1)
    size = np.sqrt((2.0 * order + 1.0) / len(wave))
    slow = np.polynomial.legendre.legvander((2.0 * np.arange(len(edges)) + 1.0) / len(edges) - 1.0, order[-1]) * size
    across = slow.T @ tied
    # numpy's eigh takes 100 times as long while other programs run
    values, vectors = eigh((slow.T * squares) @ slow - across @ inverse @ across.T, driver="ev")
    seen = values > LEFT
    mixed = np.sqrt(values[seen])[:, None] * vectors.T[seen]
    shown = mixed @ (slow.T @ sums - across @ inverse @ (slopes.T @ residual)) / values[seen]
    lowest = int(np.ptp(wave) > 0.0)  # the fitted start has the order 0 of a and b, but no parameter that of z
    shares = np.where(order >= lowest, np.maximum(order + 1.0 - lowest, 1.0) ** (-FALLS[:, None] / (2.0 - lowest)), 0.0)
    likelihood, level = np.empty((2, len(FALLS), len(SIZES)))
    degrees = len(shown) + KNOWN
    for i, share in enumerate(shares):
        own, turned = eigh((mixed * share) @ mixed.T, driver="ev")
        variances = 1.0 + SIZES[:, None] * np.maximum(own, 0.0)
        chi2 = ((turned.T @ shown) ** 2 / variances).sum(axis=1) + KNOWN * noise
        likelihood[i] = -0.5 * np.log(variances).sum(axis=1) - 0.5 * degrees * np.log(chi2)
        level[i] = np.log(chi2 / degrees)
    start = inverse @ np.outer(tied.sum(axis=0), (-1.0) ** order * size * lowest)
    return np.exp(likelihood - likelihood.max()), level, shares, inverse @ across.T, start, np.array(degrees)


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
