"""The law of the damping from the envelope of a swing: amplitude loss per half swing against amplitude."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import FloatArray, RecordingError, check_half_turn
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.turning import TurningPoints
from pendulum_env.physics import exact
from pendulum_env.physics.units import shown

FEWEST = 8
"""Minimum number of amplitudes; fewer cannot separate the three laws of damping."""
NEXT = 1.5
"""Largest time between successive turning points, in half swings; after a longer time, readings are missing."""
_LEAST_EIGENVALUE = 1e-12
"""Floor for the eigenvalues of the scaled normal matrix; smaller ones occur if the amplitudes hardly differ."""
TOLD = 0.5
"""Largest error of a share of the loss that is a result; a share is between 0 and 1."""
LAWS = ("constant", "linear", "quadratic")
"""Growth of the loss with the amplitude: constant for dry friction, then for linear and for quadratic drag."""


@dataclass(frozen=True, eq=False)
class Losses:
    """Amplitude loss per half swing, ``A_i - A_(i+1) = s + l A + q A²`` at small angles, with A midway between the two.

    Attributes:
        amplitude: median amplitude [rad], at which the shares are given.
        terms: s [rad], l [1], q [1/rad], none below 0: ``s = 2 tau/omega0²``, ``l = pi gamma/(2 omega0)`` and
            ``q = 4 c/3``, with the friction torque per inertia tau, linear drag gamma and quadratic drag c.
        errors: standard errors of the terms, calculated without the bound at 0.
        shares: share of the loss at ``amplitude`` due to each term [1].
        misfit: sqrt(chi² / degrees of freedom); above 1, it enlarges the errors.
    """

    amplitude: float
    terms: tuple[float, float, float]
    errors: tuple[float, float, float]
    shares: dict[str, Measurement]
    misfit: float

    @property
    def text(self) -> str:
        """Clause on the constant, linear and quadratic shares of the loss per half swing, and on those that the
        recording does not tell."""
        if not self.told:
            return "the recording does not tell constant, linear and quadratic loss apart"
        shares = ", ".join(f"{percent(part)} {law}" for law, part in self.told.items())
        rest = " or ".join(law for law in LAWS if law not in self.told)
        return (f"the loss per half swing at {math.degrees(self.amplitude):.3g}° is {shares} in the amplitude"
                + (f"; the recording does not tell how much of the rest is {rest}" if rest else ""))

    @property
    def told(self) -> dict[str, Measurement]:
        """Shares that the recording tells: those with an error below a half (TOLD)."""
        return {law: part for law, part in self.shares.items() if part.error < TOLD}


def losses(points: TurningPoints) -> Losses:
    """Split the amplitude loss per half swing into parts constant, linear and quadratic in the amplitude, with errors.

    The method is weighted least squares of the differences of successive amplitudes, allowing for the correlation of
    two differences that share an amplitude. An error of the equilibrium is fitted too, and no term may be below 0. At
    larger angles, the powers of A are replaced by the exact work of the forces sign(v), v and |v| v along an undamped
    half swing of amplitude A, divided by the slope of the potential: ``A/sin A``, ``16 (E - (1 - m) K)/(pi sin A)`` and
    ``3 (1 - A/tan A)``, with the complete elliptic integrals K and E of parameter ``m = sin²(A/2)``. The loss in a half
    swing must be small compared with the amplitude.

    Source: the small-angle laws, Nelson & Olsson, Am. J. Phys. 54, 112 (1986). Raises RecordingError unless ``points``
    are TurningPoints with at least 8 amplitudes, all below half a turn.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    if not isinstance(points, TurningPoints):
        raise RecordingError(f"points must be TurningPoints, from turning_points(recording), not {shown(points)}")
    size, error = points.amplitude, np.maximum(points.error, 1e-9 * points.amplitude)
    if len(size) < FEWEST:
        raise RecordingError(f"the law of the damping needs at least {FEWEST} amplitudes, there are {len(size)}")
    check_half_turn(size, "the law of the damping needs")
    middle = 0.5 * (size[1:] + size[:-1])
    lasted = np.diff(points.time) / exact.period(middle, math.tau)
    usable = np.flatnonzero(lasted < NEXT * np.median(lasted))
    beside = -np.square(error[1:-1])
    covariance = np.diag(np.square(error[1:]) + np.square(error[:-1])) + np.diag(beside, 1) + np.diag(beside, -1)
    root = np.linalg.cholesky(covariance[np.ix_(usable, usable)])
    table = np.column_stack([*powers(middle), np.sign(points.angle[:-1]), size[:-1] - size[1:]])[usable]
    white = solve_triangular(root, table, lower=True)
    columns, side, wanted = white[:, :3], white[:, 3:4], white[:, 4]
    across = side / np.linalg.norm(side)
    columns, wanted = columns - across @ (across.T @ columns), wanted - across[:, 0] * (across[:, 0] @ wanted)
    scale = np.linalg.norm(columns, axis=0)
    terms, rest = nnls(columns / scale, wanted)
    misfit = math.sqrt(float(rest) ** 2 / (len(wanted) - 4))
    sizes, axes = np.linalg.eigh((columns / scale).T @ (columns / scale))
    plain = (axes / np.maximum(sizes, _LEAST_EIGENVALUE)) @ axes.T * max(1.0, misfit) ** 2
    terms, plain = terms / scale, plain / np.outer(scale, scale)
    amplitude = float(np.median(middle))
    return Losses(amplitude, tuple(terms.tolist()), tuple(np.sqrt(np.diag(plain)).tolist()),
                  _shares(terms, plain, amplitude), misfit)


def percent(part: Measurement) -> str:
    """Return a share and its standard error, a :class:`Measurement`, as text in per cent."""
    return str(Measurement(100.0 * part.value, 100.0 * part.error, "%"))


def powers(amplitude: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the functions of the amplitude that replace 1, A and A² in the loss at large angles; see :func:`losses`.
    """
    from scipy.special import ellipe, ellipk

    sine, m = np.sin(amplitude), np.sin(0.5 * amplitude) ** 2
    linear = 16.0 / math.pi * (ellipe(m) - (1.0 - m) * ellipk(m)) / sine
    quadratic = np.where(amplitude < 0.01, amplitude**2, 3.0 * (1.0 - amplitude / np.tan(amplitude)))
    return amplitude / sine, linear, quadratic


def _shares(terms: NDArray[np.float64], covariance: NDArray[np.float64], amplitude: float) -> dict[str, Measurement]:
    """Return the share of every term in the loss at an amplitude [rad], with first-order errors of at most 1."""
    parts = np.array([float(law[0]) for law in powers(np.array([amplitude]))])
    total = float(parts @ terms)
    if total <= 0.0:
        return {law: Measurement(0.0, 1.0, "1") for law in LAWS}
    shares = parts * terms / total
    slopes = (np.diag(parts) - np.outer(shares, parts)) / total
    errors = np.minimum(np.sqrt(np.diag(slopes @ covariance @ slopes.T)), 1.0)
    return {law: Measurement(float(share), float(error), "1")
            for law, share, error in zip(LAWS, shares, errors, strict=True)}
