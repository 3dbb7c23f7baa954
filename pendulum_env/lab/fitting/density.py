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

from pendulum_env.lab.fitting.curves import between
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

    Where the fit's standard errors allow for slow changes of the residuals or for rounded readings, f is the
    degrees of freedom of these errors, and RSS is taken at ``fitted + (x - fitted)/d``, for the ratio d (at least 1) of
    each parameter's standard error to that for independent residuals. The posterior is then wider by d, as the profile
    is, and keeps its shape (compare Ribatet, Cooley & Davison 2012, Statistica Sinica 22, 813).

    Args:
        fit: the fit.
        priors: prior of every parameter.

    Raises SceneError if the fit has no residual.
    """

    def __init__(self, fit: Fitted, priors: Sequence[Prior]) -> None:
        own, variances = fit.solution, np.diag(fit.errors.plain)
        self.model, self.centre, self.priors = own.model, own.values, tuple(priors)
        self.best, self.freedom = float(own.residual @ own.residual), fit.errors.freedom
        self.variance = self.best / (len(own.residual) - len(own.values))
        if not self.variance > 0.0:
            raise SceneError("The model passes through all readings exactly, so the posterior has no width.")
        with np.errstate(divide="ignore", invalid="ignore"):
            wider = np.sqrt(np.diag(fit.errors.covariance) / variances)
        self.wider = np.where(np.isfinite(wider), np.maximum(wider, 1.0), 1.0)
        self.step = self.model.step_for(self.centre)
        self._readings = fit.recording.readings
        if self.model.mount is None:
            _, value, slope = self.model.nodes(self.centre, self.step)
            self._nodes = np.concatenate([value[0], slope[0]])
            weights = between(self.model.time, self.step, value.shape[1], int(self.model.rate))
            self._squares = weights.T @ weights
            self._linear = -2.0 * (weights.T @ (self._readings - weights @ self._nodes))

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
            if self.model.mount is not None:
                return np.asarray(np.sum((self._readings - self.model.angles(rows)) ** 2, axis=1) - self.best)
            away = np.concatenate(self.model.nodes(rows, self.step)[1:], axis=1).T - self._nodes[:, None]
            with np.errstate(invalid="ignore", over="ignore"):
                return np.asarray(np.sum(away * (self._squares @ away + self._linear[:, None]), axis=0))
        except SceneError:
            if len(rows) == 1:
                return np.full(1, math.nan)
            return np.concatenate([self.rises(row[None]) for row in rows])
