"""Steps on NumPy arrays that use all derivatives of the acceleration, from finite differences.

Newton's method solves implicit steps with the full matrix. Implicit steps of single numbers are written as source by
:func:`integrators.unroll`. Only the steps on arrays may have coupled components of ``q``. A stage whose equation
Newton's method cannot solve becomes nan; :func:`integrators.solve` then reports the step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.system import System

Array = NDArray[np.float64]
SWEEPS = 50


def stages_step(
    a: Sequence[Sequence[Fraction]], b: Sequence[Fraction], c: Sequence[Fraction], coupled: bool, system: System,
    dense: bool, increments: bool, pairs: Sequence[tuple[Sequence[Fraction], Fraction]] | None = None,
) -> Callable[..., tuple[Any, ...]]:
    """Return ``step(t, q, v, h)`` of an implicit Runge-Kutta method with the table (a, b, c), for arrays of any shape.

    The step returns the new q and v, or with ``increments`` their changes; with ``dense`` also the velocities and
    accelerations of its stages. With ``coupled`` all stages are solved together, otherwise one after another. With
    ``pairs``, embedded weights and the weight of the slope at the start, the function is ``step(t, q, v, a, h)`` with
    error estimates; see :mod:`integrators.steps.estimates`.

    Newton's matrix is that of the derivatives at the start of the step, for all stages and sweeps (simplified Newton
    iteration; Hairer & Wanner 1996, section IV.8). Where that converges too slowly, each sweep has its own.
    """
    table = np.array(a, dtype=float)
    weights, nodes = np.array(b, dtype=float), np.array(c, dtype=float)
    every = range(len(weights))
    blocks = [list(every)] if coupled else [[i] for i in every]
    estimators = [(weights - np.array(other, dtype=float), float(start)) for other, start in pairs or ()]

    def step(t: float, q: Array, v: Array, *rest: Any) -> tuple[Any, ...]:
        h = rest[-1]
        slopes = np.zeros((len(weights), *np.shape(v)))
        by_q, by_v = _derivatives(system, t, q, v)
        noise = _noise(q, v, h * h, h)

        def motion(rows: list[int]) -> tuple[Array, Array]:
            """Return positions and velocities of the stages ``rows`` (counted from zero) of an implicit step."""
            speeds = v + h * np.tensordot(table, slopes, 1)
            return q + h * np.tensordot(table[rows], speeds, 1), speeds[rows]

        for rows in blocks:

            def residual(k: Array, rows: list[int] = rows) -> Array:
                slopes[rows] = k
                places = zip(nodes[rows], *motion(rows), strict=True)
                return np.subtract(k, [system.acceleration(t + c * h, p, w) for c, p, w in places], dtype=float)

            inner = h * table[np.ix_(rows, rows)]
            matrix = np.eye(len(rows) * q.size) - np.kron(inner, by_v) - np.kron(inner @ inner, by_q)
            slopes[rows] = _solve(residual, slopes[rows], noise, matrix)
        speeds = v + h * np.tensordot(table, slopes, 1)
        change_q, change_v = h * np.tensordot(weights, speeds, 1), h * np.tensordot(weights, slopes, 1)
        state = (change_q, change_v) if increments else (q + change_q, v + change_v)
        errors: list[Array] = []
        for difference, start in estimators:
            of_q = h * (np.tensordot(difference, speeds, 1) - start * v)
            of_v = h * (np.tensordot(difference, slopes, 1) - start * rest[0])
            errors += _damped(of_q, of_v, start * h, by_q, by_v) if start else [of_q, of_v]
        ends = () if pairs is None else (system.acceleration(t + h, *state), *errors)
        return (*state, *ends, speeds, slopes) if dense else (*state, *ends)

    return step


def _derivatives(system: System, t: float, q: Array, v: Array) -> tuple[Array, Array]:
    """Return the matrices of the derivatives of the acceleration by q and by v, by central differences."""
    return (_differences(lambda x: np.asarray(system.acceleration(t, x, v), dtype=float), q),
            _differences(lambda x: np.asarray(system.acceleration(t, q, x), dtype=float), v))


def _damped(of_q: Array, of_v: Array, g: float, by_q: Array, by_v: Array) -> list[Array]:
    """Return estimated errors of q and v times ``(1 - g J)**-1``; see :class:`integrators.RungeKutta`'s weights."""
    right = of_v.ravel() + g * by_q @ of_q.ravel()
    try:
        damped = np.linalg.solve(np.eye(len(right)) - g * (by_v + g * by_q), right).reshape(of_v.shape)
    except np.linalg.LinAlgError:
        damped = np.full(of_v.shape, np.nan)
    return [of_q + g * damped, damped]


def mean_force_step(system: System, increments: bool) -> Callable[..., tuple[Any, ...]]:
    """Return ``step(t, q, v, h)`` of the discrete gradient method, for arrays of any shape.

    The system must have a ``mean_acceleration``. The step returns the new q and v; with ``increments``, their changes.
    """
    mean = system.mean_acceleration
    assert mean is not None

    def step(t: float, q: Array, v: Array, h: float) -> tuple[Array, Array]:
        half = 0.5 * h

        def residual(k: Array) -> Array:
            w = v + half * k
            return np.asarray(k - mean(t + half, q + half * w, w, half * w), dtype=float)

        k = _solve(residual, np.zeros(np.shape(v)), _noise(q, v, h * h, h))
        change_q, change_v = h * (v + half * k), h * k
        return (change_q, change_v) if increments else (q + change_q, v + change_v)

    return step


def stage_solver(system: System) -> Callable[..., Array]:
    """Return the function ``solve_stage``, which solves one implicit stage on arrays.

    Its arguments are those of :func:`integrators.steps.newton.one_stage`.
    """

    def solve_stage(t: float, q: Array, v: Array, *lengths: float) -> Array:
        c, d = lengths if len(lengths) > 1 else (lengths[0] * lengths[0], lengths[0])
        place = q if len(lengths) > 1 else q + d * v

        def residual(k: Array) -> Array:
            return np.asarray(k - system.acceleration(t, place + c * k, v + d * k), dtype=float)

        return _solve(residual, np.zeros(np.shape(v)), _noise(q, v, c, d))

    return solve_stage


def stages_solver(a: Sequence[Sequence[Fraction]], system: System) -> Callable[..., Array]:
    """Return the function ``solve_stages``, which solves all stages of a coupled Runge-Kutta table on arrays.

    Its arguments are those of :func:`integrators.steps.newton.simultaneous`.
    """
    table = np.array(a, dtype=float)
    nodes = table.sum(axis=1)

    def solve_stages(t: float, q: Array, v: Array, h: float) -> Array:
        def residual(k: Array) -> Array:
            speeds = v + h * np.tensordot(table, k, 1)
            places = q + h * np.tensordot(table, speeds, 1)
            forces = [system.acceleration(t + c * h, x, w) for c, x, w in zip(nodes, places, speeds, strict=True)]
            return np.subtract(k, forces, dtype=float)

        return _solve(residual, np.zeros((len(nodes), *np.shape(v))), _noise(q, v, h * h, h))

    return solve_stages


class Derivative:
    """Derivative of a system's acceleration by q at one state, with all couplings: ``x*d`` is its product with x.

    The product is the derivative of the acceleration along x, by a central difference.
    """

    __array_ufunc__ = None  # NumPy then leaves x*d to __rmul__

    def __init__(self, system: System, t: float, q: Array, v: Array) -> None:
        self.system, self.t, self.q, self.v = system, t, q, v

    def __rmul__(self, x: Array) -> Array:
        size = float(np.max(np.abs(x), initial=0.0))
        if size == 0.0:
            return x
        shift = 1e-5 * (1.0 + float(np.max(np.abs(self.q)))) / size
        ahead, back = (self.system.acceleration(self.t, self.q + way * x, self.v) for way in (shift, -shift))
        return np.asarray((ahead - back) / (2.0 * shift), dtype=float)


def _noise(q: Array, v: Array, c: float, d: float) -> float:
    """Return the size of an acceleration k that q + c k and v + d k lose among their rounding."""
    return sum(1e-14 * float(np.max(np.abs(x))) / abs(length) for x, length in ((q, c), (v, d)) if length != 0.0)


def _solve(
    residual: Callable[[Array], Array], start: Array, noise: float, matrix: Array | None = None
) -> Array:
    """Return the array at which a residual is zero, by Newton's method with central differences; nan if it fails.

    With ``matrix``, the residual's derivative nearby, all sweeps use it, as long as each step is at most a quarter of
    the one before. The iteration ends when its steps no longer shrink. At rest the solution is zero but for rounding,
    ``noise``, and its steps never get small beside it.
    """
    k: Array = start.copy()
    last = np.inf
    for _ in range(SWEEPS):
        r = residual(k)
        if not np.all(np.isfinite(r)):
            if matrix is None:
                break
            k, last, matrix = start.copy(), np.inf, None
            continue
        try:
            change = np.linalg.solve(_differences(residual, k) if matrix is None else matrix, r.ravel())
        except np.linalg.LinAlgError:
            break
        k = k - change.reshape(k.shape)
        size = float(np.max(np.abs(change)))
        near = 1e-6 * float(np.max(np.abs(k))) + (noise if matrix is None else 0.0)
        if size == 0.0 or (size <= near and 2.0 * size >= last):
            return k
        if matrix is not None and size > 0.25 * last:
            matrix, size = None, np.inf
        last = size
    unsolved: Array = np.full(k.shape, np.nan)
    return unsolved


def _differences(function: Callable[[Array], Array], k: Array) -> Array:
    """Return the derivative of a function of an array at k by central differences, as a matrix."""
    matrix = np.empty((k.size, k.size))
    for j in range(k.size):
        shift = np.zeros(k.size)
        shift[j] = 1e-6 * (1.0 + abs(k.flat[j]))
        bump = shift.reshape(k.shape)
        matrix[:, j] = (function(k + bump) - function(k - bump)).ravel() / (2.0 * shift[j])
    return matrix
