"""Solvers of scipy: solve_ivp, and odeint, a compiled loop around LSODA.

Many trajectories are solved as one system with common steps, which is faster than one call for each. LSODA and Radau
then use the narrow band or the sparsity of the Jacobian. For "numba" solvers, numba compiles the right-hand side of a
single trajectory.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from against.problem import RATE, Array, Problem, Solver, times_of


def _interleaved(size: int, gamma: float) -> Callable[[float, Array], Array]:
    """Return the right-hand side for the state ``(q_0, v_0, q_1, v_1, ...)``, whose Jacobian is a narrow band."""

    def slope(t: float, y: Array) -> Array:
        rate = np.empty(2 * size)
        rate[::2] = y[1::2]
        rate[1::2] = -RATE * np.sin(y[::2]) - gamma * y[1::2]
        return rate

    return slope


def _single(gamma: float) -> Callable[[float, Array], Any]:
    from math import sin

    def slope(t: float, y: Array) -> tuple[float, float]:
        q, v = y
        return v, -RATE * sin(q) - gamma * v

    return slope


def _compiled(gamma: float) -> Callable[[float, Array], Any]:
    from math import sin

    from numba import njit

    @njit
    def slope(t: float, y: Array) -> Array:
        rate = np.empty(2)
        rate[0] = y[1]
        rate[1] = -RATE * sin(y[0]) - gamma * y[1]
        return rate

    slope(0.0, np.zeros(2))
    return slope


def _sparse(size: int, gamma: float) -> Callable[[float, Array], Any]:
    from scipy.sparse import csc_matrix

    columns = np.arange(0, 3 * size + 1, 3)
    starts = np.sort(np.concatenate([columns[:-1], columns[:-1] + 1, columns[-1:]]))
    rows = np.stack([2 * np.arange(size) + 1, 2 * np.arange(size), 2 * np.arange(size) + 1], axis=1).ravel()
    values = np.ones(3 * size)
    values[2::3] = -gamma

    def jacobian(t: float, y: Array) -> Any:
        entries = values.copy()
        entries[::3] = -RATE * np.cos(y[::2])
        return csc_matrix((entries, rows, starts), shape=(2 * size, 2 * size))

    return jacobian


def _dense(gamma: float) -> Callable[[float, Array], Any]:
    return lambda t, y: np.array([[0.0, 1.0], [-RATE * np.cos(y[0]), -gamma]])


def _line(method: str, compiled: bool = False) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        from scipy.integrate import solve_ivp

        size, gamma = problem.size, problem.gamma
        one = _compiled if compiled else _single
        slope = one(gamma) if size == 1 else _interleaved(size, gamma)
        start = np.zeros(2 * size)
        start[::2] = problem.starts
        options: dict[str, Any] = {}
        if method == "Radau":
            options["jac"] = _dense(gamma) if size == 1 else _sparse(size, gamma)
        elif method == "LSODA" and size > 1:
            options |= {"lband": 1, "uband": 1}

        def solve(tolerance: float, duration: float) -> Array:
            found = solve_ivp(slope, (0.0, duration), start, method, times_of(duration), rtol=tolerance,
                              atol=tolerance, **options)
            return np.asarray(found.y[::2])

        return solve

    return prepare


def _odeint(compiled: bool) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        from scipy.integrate import odeint

        size, gamma = problem.size, problem.gamma
        one = _compiled if compiled else _single
        slope = one(gamma) if size == 1 else _interleaved(size, gamma)
        start = np.zeros(2 * size)
        start[::2] = problem.starts
        band = {"ml": 1, "mu": 1} if size > 1 else {}

        def solve(tolerance: float, duration: float) -> Array:
            found = odeint(slope, start, times_of(duration), rtol=tolerance, atol=tolerance, mxstep=10**7, tfirst=True,
                           **band)
            return np.asarray(found[:, ::2]).T

        return solve

    return prepare


LINES: Mapping[str, Callable[[Problem], Solver]] = {
    **{f"scipy {method}": _line(method) for method in ("RK45", "DOP853", "LSODA", "Radau")},
    **{f"scipy {method}, numba": _line(method, True) for method in ("DOP853", "LSODA")},
    "scipy odeint": _odeint(False),
    "scipy odeint, numba": _odeint(True),
}
ALONE = tuple(name for name in LINES if name.endswith(", numba"))
"""Solvers for one trajectory only."""
