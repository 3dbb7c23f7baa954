"""Implicit steps on NumPy arrays: Newton's method with the full matrix of derivatives, from finite differences.

Implicit steps of single numbers are written as source by :func:`integrators.unroll`. Only the steps on arrays may have
coupled components of ``q``. A stage whose equation Newton's method cannot solve becomes nan; :func:`integrators.solve`
then reports the step.
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
    dense: bool, increments: bool,
) -> Callable[..., tuple[Any, ...]]:
    """Return ``step(t, q, v, h)`` of an implicit Runge-Kutta method with the table (a, b, c), for arrays of any shape.

    The step returns the new q and v, or with ``increments`` their changes; with ``dense`` also the velocities and
    accelerations of its stages. With ``coupled`` all stages are solved together, otherwise one after another.
    """
    table = np.array(a, dtype=float)
    weights, nodes = np.array(b, dtype=float), np.array(c, dtype=float)
    every = range(len(weights))
    blocks = [list(every)] if coupled else [[i] for i in every]

    def step(t: float, q: Array, v: Array, h: float) -> tuple[Any, ...]:
        slopes = np.zeros((len(weights), *np.shape(v)))

        def motion(rows: list[int]) -> tuple[Array, Array]:
            """Return positions and velocities of the stages ``rows`` (counted from zero) of an implicit step."""
            speeds = v + h * np.tensordot(table, slopes, 1)
            return q + h * np.tensordot(table[rows], speeds, 1), speeds[rows]

        for rows in blocks:

            def residual(k: Array, rows: list[int] = rows) -> Array:
                slopes[rows] = k
                places = zip(nodes[rows], *motion(rows), strict=True)
                return np.subtract(k, [system.acceleration(t + c * h, p, w) for c, p, w in places], dtype=float)

            slopes[rows] = _solve(residual, slopes[rows])
        speeds = v + h * np.tensordot(table, slopes, 1)
        change_q, change_v = h * np.tensordot(weights, speeds, 1), h * np.tensordot(weights, slopes, 1)
        state = (change_q, change_v) if increments else (q + change_q, v + change_v)
        return (*state, speeds, slopes) if dense else state

    return step


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

        k = _solve(residual, np.zeros(np.shape(v)))
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

        return _solve(residual, np.zeros(np.shape(v)))

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

        return _solve(residual, np.zeros((len(nodes), *np.shape(v))))

    return solve_stages


def _solve(residual: Callable[[Array], Array], start: Array) -> Array:
    """Return the array at which a residual is zero, by Newton's method with central differences; nan if it fails.

    The iteration ends when its steps no longer shrink.
    """
    k: Array = start.copy()
    last = np.inf
    for _ in range(SWEEPS):
        r = residual(k)
        if not np.all(np.isfinite(r)):
            break
        matrix = np.empty((k.size, k.size))
        for j in range(k.size):
            shift = np.zeros(k.size)
            shift[j] = 1e-6 * (1.0 + abs(k.flat[j]))
            bump = shift.reshape(k.shape)
            matrix[:, j] = (residual(k + bump) - residual(k - bump)).ravel() / (2.0 * shift[j])
        try:
            change = np.linalg.solve(matrix, r.ravel()).reshape(k.shape)
        except np.linalg.LinAlgError:
            break
        k = k - change
        size = float(np.max(np.abs(change)))
        if size == 0.0 or (size <= 1e-6 * float(np.max(np.abs(k))) and 2.0 * size >= last):
            return k
        last = size
    unsolved: Array = np.full(k.shape, np.nan)
    return unsolved
