"""Least squares of simulated motions within bounds: the search, with robust losses, and Gauss-Newton steps at its end.

A problem gives :class:`Residuals` and their derivatives for values of its free numbers. Of a free swing, the start of
the motion is among these numbers. Logs of driven runs are divided into windows, each with a start of its own, which the
problem eliminates from residuals and derivatives (variable projection: Golub & Pereyra 1973, SIAM J. Numer. Anal. 10,
413; with derivatives as Kaufman 1975, BIT 15, 49).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST = 25
"""Largest number of Gauss-Newton steps."""
CLOSE = 1e-6
"""Usual share of the residual variance by which the last step is predicted to lower the sum of squares."""
HONEST, NEAR = 0.8, 100.0
"""Derivatives are recalculated if the ratio of the fall of the sum of squares to the predicted fall is not between the
first number and its inverse, or if the fall exceeds the second number times the residual variance."""


class Residuals(Protocol):
    """Residuals of a simulated motion, as functions of the free numbers.

    Attributes:
        least: lower bounds of the numbers, -inf for none.
    """

    least: Array

    def sizes(self, values: Array) -> Array:
        """Return, for every number, a change that would be large, by which the search scales it."""

    def residual(self, values: Array, ahead: bool = False) -> Array:
        """Return readings minus model; ``ahead``: True if the derivatives will probably be called for, too."""

    def slopes(self, values: Array, central: bool = False) -> Array:
        """Return the derivatives of the model, ``(readings, numbers)``, at values that a search has accepted; from
        central differences, or from one-sided ones, which are faster."""


def derivatives(
    simulate: Callable[[Array], Array], values: Array, steps: Array, least: Array, central: bool
) -> tuple[Array, Array]:
    """Return a model's readings, and their derivatives ``(readings, numbers)`` by finite differences, from one batch.

    Args:
        simulate: function of rows of numbers ``(runs, numbers)`` that returns the readings, ``(runs, readings)``.
        values, steps: the numbers, and their changes.
        least: lower bounds of the numbers, beyond which none is changed.
        central: True for differences of second order, one-sided next to a bound; False for one-sided ones, which take
            half the simulations.
    """
    up = values + np.diag(steps)
    down = np.maximum(values - np.diag(steps), least) if central else values[None]
    rows = simulate(np.concatenate([values[None], up, down] if central else [values[None], up]))
    ahead, behind = rows[1 : len(up) + 1], rows[len(up) + 1 :] if central else rows[:1]
    return rows[0], np.nan_to_num((ahead - behind).T / np.diagonal(up - down))


def search(
    problem: Residuals, start: Array, how: Mapping[str, Any], loss: Any = "linear", scale: float = 1.0
) -> Array:
    """Return the numbers, within their bounds, that minimise the loss of the residuals.

    ``how`` are keyword arguments of SciPy's ``least_squares`` that say when the search ends; ``loss`` and ``scale`` are
    its ``loss`` and ``f_scale``.
    """
    from scipy.optimize import least_squares

    def misses(x: Array) -> Array:
        return -problem.residual(x, ahead=True)

    found = least_squares(misses, start, problem.slopes,
                          bounds=(problem.least, np.inf), x_scale=problem.sizes(start), method="dogbox", gtol=None,
                          loss=loss, f_scale=scale, **how)
    return np.asarray(np.maximum(found.x, problem.least))


def refit(
    problem: Residuals,
    start: Array,
    slopes: Array,
    which: NDArray[np.intp] | None = None,
    trust: float = 0.0,
    close: float = CLOSE,
    fresh: bool = False,
) -> tuple[Array, float]:
    """Fit all or some numbers again, starting close to the minimum; return the values and the sum of squares.

    The steps are Gauss-Newton steps within the bounds. Derivatives are reused as long as the sum of squares falls as
    they predict, and calculated anew before the last step, which ends within some 1e-6 of the standard errors.

    Args:
        problem: what is fitted, with equal weights of the residuals.
        start: starting values of all numbers.
        slopes: derivatives of the model near ``start``, ``(readings, numbers)``.
        which: indices of the numbers to fit; all by default. Others stay at ``start``.
        trust: if the total fall of the sum of squares agrees to this share with the first prediction of ``slopes``, the
            model is linear enough to end without new derivatives.
        close: a step that is predicted to lower the sum of squares by less than this share of the residual variance is
            the last.
        fresh: True for ``slopes`` exactly at ``start``.
    """
    places = np.arange(len(start)) if which is None else which
    least, values = problem.least[places], np.maximum(start, problem.least)
    residual = problem.residual(values)
    squares, falls = float(residual @ residual), [0.0, 0.0]
    size, q, r = _factors(slopes[:, places])
    for _ in range(MOST):
        target = q.T @ residual
        step = bounded(r, target, (least - values[places]) * size)
        predicted, fallen = float(target @ target) - float((target - r @ step) @ (target - r @ step)), 0.0
        trial = values.copy()
        trial[places] = np.maximum(values[places] + step / size, least)
        if predicted >= close * squares / len(residual):
            missed = problem.residual(trial)
            fallen = squares - float(missed @ missed)
            falls = [falls[0] or predicted, falls[1] + fallen]
            if fallen > 0.0:
                values, residual, squares = trial, missed, squares - fallen
            elif fresh:
                break
        elif fresh or abs(falls[1] - falls[0]) < trust * falls[0]:
            return trial, squares - predicted
        most = min(predicted / HONEST, NEAR * squares / len(residual))
        if fresh := not (fallen > 0.0 and HONEST * predicted <= fallen <= most):
            size, q, r = _factors(problem.slopes(values, central=True)[:, places])
    return values, squares


def bounded(r: Array, target: Array, low: Array) -> Array:
    """Return the array x that minimises ``|r x - target|`` with no entry below ``low``."""
    from scipy.optimize import lsq_linear

    if not np.isfinite(low).any():
        return np.asarray(lsq_linear(r, target).x)
    return np.asarray(lsq_linear(r, target, bounds=(low, np.inf), method="bvls").x)


def _factors(slopes: Array) -> tuple[Array, Array, Array]:
    """Return the lengths of a matrix's columns, and the factors Q and R of the matrix with columns scaled to length 1.
    """
    size = np.sqrt(np.einsum("ij,ij->j", slopes, slopes))
    size = np.where(size > 0.0, size, 1.0)
    q, r = np.linalg.qr(slopes / size)
    return size, q, r
