"""Logarithm of the posterior density of fitted parameters, for many sets of parameters at once.

The sum of squares of N angles or angular velocities is a quadratic form of the simulated angles and velocities at the
steps between which the readings are interpolated. Its coefficients are sums over the readings and calculated once, so
that an evaluation takes as long as the simulation, for any number of readings. The readings of an accelerometer are not
a linear function of the motion, so that their sum of squares is computed in every evaluation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.fitting.curves import hermite
from pendulum_env.lab.fitting.intervals import Fitted
from pendulum_env.lab.fitting.priors import Prior
from pendulum_env.physics.units import SceneError

Array = NDArray[np.float64]


class LogDensity:
    """Logarithm of the posterior density, up to a constant, of a fit's parameters.

    Readings have independent normal errors of unknown standard deviation sigma, with the prior 1/sigma. Integrated over
    sigma, the likelihood is Student's t of the sum of squares RSS (Box & Tiao 1973, Bayesian Inference in Statistical
    Analysis, section 2.7), ``-(f + k)/2 ln(1 + (RSS - RSS_fit) / (f s²))`` with k parameters, ``f = n - k`` degrees of
    freedom and ``s² = RSS_fit / (n - k)``. This is ``-n/2 ln(RSS)``.

    Where the fit's standard errors allow for correlated residuals, rounded readings or a drifting period, f is the
    degrees of freedom of these errors, and RSS is taken at ``fitted + (x - fitted)/d``, for the ratio d (at least 1) of
    each parameter's standard error to that for independent residuals. The posterior is then wider by d, as the profile
    is, and keeps its shape (compare Ribatet, Cooley & Davison 2012, Statistica Sinica 22, 813).

    Args:
        fit: the fit.
        priors: prior of every parameter.

    Raises SceneError if the fit has no residual.
    """

    def __init__(self, fit: Fitted, priors: Sequence[Prior]) -> None:
        variances = np.diag(fit.errors.plain)
        self.model, self.centre, self.priors = fit.model, fit.values, tuple(priors)
        self.best, self.freedom = float(fit.residual @ fit.residual), fit.errors.freedom
        self.variance = self.best / fit.degrees_of_freedom
        if not self.variance > 0.0:
            raise SceneError("The model passes through all readings exactly, so the posterior has no width.")
        with np.errstate(divide="ignore", invalid="ignore"):
            wider = np.sqrt(np.diag(fit.covariance) / variances)
        self.wider = np.where(np.isfinite(wider), np.maximum(wider, 1.0), 1.0)
        self.step = self.model.step_for(self.centre)
        self._sums = _Sums(fit, self.step) if self.model.mount is None else None
        self._fit = fit

    def __call__(self, rows: Array) -> Array:
        """Return the logarithm of the density for parameters of shape ``(runs, parameters)``, an array of runs.

        It is -inf outside the priors' ranges, and where a simulation stops early.
        """
        rows = np.atleast_2d(rows)
        prior = np.sum([one.log(column) for one, column in zip(self.priors, rows.T, strict=True)], axis=0)
        inside = np.isfinite(prior)
        if not inside.any():
            return np.asarray(prior)
        rise = np.full(len(rows), math.nan)
        rise[inside] = self.rises(self.centre + (rows[inside] - self.centre) / self.wider)
        share = rise / (self.freedom * self.variance)
        power = 0.5 * (self.freedom + len(self.centre))
        return np.where(np.isfinite(share), prior - power * np.log1p(np.fmax(share, -0.5)), -math.inf)

    def rises(self, rows: Array) -> Array:
        """Return the rise of the sum of squares above that of the fit for parameters of shape ``(runs, parameters)``.

        It is nan for parameters that cannot be simulated.
        """
        try:
            if self._sums is not None:
                return self._sums.rises(*self.model.nodes(rows, self.step)[1:])
            off = self._fit.recording.readings - self.model.angles(rows)
            return np.asarray(np.sum(off * off, axis=1) - self.best)
        except SceneError:
            if len(rows) == 1:
                return np.full(1, math.nan)
            return np.concatenate([self.rises(row[None]) for row in rows])


class _Sums:
    """Coefficients of the rise of the sum of squares, as a quadratic form of values and slopes at the steps."""

    def __init__(self, fit: Fitted, step: float) -> None:
        time, value, slope = fit.model.nodes(fit.values, step)
        self.value, self.slope = value[0], slope[0]
        at = fit.model.time
        cell = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
        self.last = int(cell[-1]) + 2
        basis = hermite((at - time[cell]) / step, step, int(fit.model.rate))
        ends = np.stack([self.value[cell], self.slope[cell], self.value[cell + 1], self.slope[cell + 1]])
        off = fit.recording.readings - np.einsum("ij,ij->j", basis, ends)

        def summed(weights: Array, shift: int = 0) -> Array:
            return np.asarray(np.bincount(cell + shift, weights, self.last))

        a, b, c, d = basis
        self.squares = summed(a * a) + summed(c * c, 1), summed(b * b) + summed(d * d, 1)
        self.mixed = 2.0 * (summed(a * b) + summed(c * d, 1))
        self.across = tuple(2.0 * summed(x * y)[:-1] for x in (a, b) for y in (c, d))
        self.linear = tuple(-2.0 * (summed(off * x) + summed(off * y, 1)) for x, y in ((a, c), (b, d)))

    def rises(self, value: Array, slope: Array) -> Array:
        """Return the rise of the sum of squares for values and slopes at the steps, both ``(runs, steps)``."""
        x, y = value[:, : self.last] - self.value[: self.last], slope[:, : self.last] - self.slope[: self.last]
        pairs = [(one[:, :-1], other[:, 1:]) for one in (x, y) for other in (x, y)]
        with np.errstate(invalid="ignore", over="ignore"):
            rise = (x * x) @ self.squares[0] + (y * y) @ self.squares[1] + (x * y) @ self.mixed
            for (one, other), weights in zip(pairs, self.across, strict=True):
                rise = rise + (one * other) @ weights
            return np.asarray(rise + x @ self.linear[0] + y @ self.linear[1])
