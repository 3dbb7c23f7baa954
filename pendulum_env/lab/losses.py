"""The law of the damping as the envelope shows it: loss per half swing against amplitude."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.lab.checked import FloatArray, RecordingError
from pendulum_env.lab.measures import Measurement
from pendulum_env.lab.turning import TurningPoints
from pendulum_env.physics import exact
from pendulum_env.physics.units import shown

FEWEST = 8
"""Amplitudes below which three laws cannot be told apart."""
NEXT = 1.5
"""Half swings that lie between successive turning points, at most: more where readings are missing."""
_TOLD = 1e-12
"""Eigenvalue of the normalised normal matrix below which amplitudes that hardly differ tell nothing."""
LAWS = ("constant", "linear", "quadratic")
"""How the loss grows with the amplitude, as dry friction, linear drag and quadratic drag make it."""


@dataclass(frozen=True, eq=False)
class Losses:
    """``A_i - A_(i+1) = s + l A + q A²`` of successive amplitudes at small angles, A between them.

    Attributes:
        amplitude: the middle one [rad], which the shares are of.
        terms: s [rad], l [1], q [1/rad], none below 0: ``s = 2 tau/omega0²``, ``l = pi gamma/(2 omega0)`` and
            ``q = 4 c/3`` of friction torque per inertia tau, linear drag gamma and quadratic drag c.
        errors: standard errors of the terms, where none were bounded.
        shares: what each contributes to the loss at ``amplitude`` [1].
        misfit: sqrt(chi² / degrees of freedom), by which errors grow if above 1.
    """

    amplitude: float
    terms: tuple[float, float, float]
    errors: tuple[float, float, float]
    shares: dict[str, Measurement]
    misfit: float

    @property
    def text(self) -> str:
        """The shares in a sentence."""
        said = ", ".join(f"{percent(part)} {law}" for law, part in self.shares.items())
        return f"of the loss per half swing at {math.degrees(self.amplitude):.3g}°: {said}"


def losses(points: TurningPoints) -> Losses:
    """What of the loss per half swing is constant, linear and quadratic in the amplitude, with errors.

    Weighted least squares of the differences of successive amplitudes, with the correlation that a common amplitude
    gives two of them, and an equilibrium that is off free; terms are not below 0. Away from small angles, for the
    powers of A stands the exact work of forces sign(v), v and |v| v along an undamped half swing of amplitude A over
    the slope of the potential: ``A/sin A``, ``16 (E - (1 - m) K)/(pi sin A)`` and ``3 (1 - A/tan A)``, K and E the
    complete elliptic integrals of parameter ``m = sin²(A/2)``. A half swing must lose little of its amplitude.

    Source: the small-angle laws, Nelson & Olsson, Am. J. Phys. 54, 112 (1986). Raises RecordingError below 8
    amplitudes.
    """
    from scipy.linalg import solve_triangular
    from scipy.optimize import nnls

    if not isinstance(points, TurningPoints):
        raise RecordingError(f"points must be TurningPoints, as turning_points finds them, not {shown(points)}")
    size, error = points.amplitude, np.maximum(points.error, 1e-9 * points.amplitude)
    if len(size) < FEWEST:
        raise RecordingError(f"the law of the damping needs at least {FEWEST} amplitudes, there are {len(size)}")
    if size.max() >= math.pi:
        raise RecordingError("the law of the damping is that of swings that turn back, these go over the top")
    middle = 0.5 * (size[1:] + size[:-1])
    lasted = np.diff(points.time) / exact.period(middle, math.tau)
    kept = np.flatnonzero(lasted < NEXT * np.median(lasted))
    beside = -np.square(error[1:-1])
    covariance = np.diag(np.square(error[1:]) + np.square(error[:-1])) + np.diag(beside, 1) + np.diag(beside, -1)
    root = np.linalg.cholesky(covariance[np.ix_(kept, kept)])
    table = np.column_stack([*powers(middle), np.sign(points.angle[:-1]), size[:-1] - size[1:]])[kept]
    white = solve_triangular(root, table, lower=True)
    columns, side, wanted = white[:, :3], white[:, 3:4], white[:, 4]
    across = side / np.linalg.norm(side)
    columns, wanted = columns - across @ (across.T @ columns), wanted - across[:, 0] * (across[:, 0] @ wanted)
    scale = np.linalg.norm(columns, axis=0)
    terms, rest = nnls(columns / scale, wanted)
    misfit = math.sqrt(float(rest) ** 2 / (len(wanted) - 4))
    sizes, axes = np.linalg.eigh((columns / scale).T @ (columns / scale))
    plain = (axes / np.maximum(sizes, _TOLD)) @ axes.T * max(1.0, misfit) ** 2
    terms, plain = terms / scale, plain / np.outer(scale, scale)
    amplitude = float(np.median(middle))
    return Losses(amplitude, tuple(terms.tolist()), tuple(np.sqrt(np.diag(plain)).tolist()),
                  _shares(terms, plain, amplitude), misfit)


def percent(part: Measurement) -> str:
    """A share with its error, as text."""
    return str(Measurement(100.0 * part.value, 100.0 * part.error, "%"))


def powers(amplitude: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """1, A and A² at small angles, and what stands for them at large ones; see :func:`losses`."""
    from scipy.special import ellipe, ellipk

    sine, m = np.sin(amplitude), np.sin(0.5 * amplitude) ** 2
    linear = 16.0 / math.pi * (ellipe(m) - (1.0 - m) * ellipk(m)) / sine
    quadratic = np.where(amplitude < 0.01, amplitude**2, 3.0 * (1.0 - amplitude / np.tan(amplitude)))
    return amplitude / sine, linear, quadratic


def _shares(terms: NDArray[np.float64], covariance: NDArray[np.float64], amplitude: float) -> dict[str, Measurement]:
    """Contributions over their sum, errors to first order, none above 1."""
    parts = np.array([float(law[0]) for law in powers(np.array([amplitude]))])
    total = float(parts @ terms)
    if total <= 0.0:
        return {law: Measurement(0.0, 1.0, "1") for law in LAWS}
    shares = parts * terms / total
    slopes = (np.diag(parts) - np.outer(shares, parts)) / total
    errors = np.minimum(np.sqrt(np.diag(slopes @ covariance @ slopes.T)), 1.0)
    return {law: Measurement(float(share), float(error), "1")
            for law, share, error in zip(LAWS, shares, errors, strict=True)}
