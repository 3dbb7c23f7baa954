"""Solvers of heyoka: adaptive Taylor series, ``taylor_adaptive`` and ``taylor_adaptive_batch`` over SIMD lanes.

As its documentation advises for small systems, compact mode and high accuracy are off. ``propagate_grid`` returns the
records from the dense output. A single trajectory uses the scalar integrator, which is faster for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from against.problem import RATE, Array, Problem, Solver, times_of

LANES = (4, 8)
"""Batch sizes: four doubles for AVX2, eight for AVX-512."""


def _system(gamma: float) -> Any:
    import heyoka

    q, v = heyoka.make_vars("q", "v")
    return [(q, v), (v, -RATE * heyoka.sin(q) - gamma * v if gamma else -RATE * heyoka.sin(q))]


def _scalar(problem: Problem) -> Solver:
    import heyoka

    integrators: dict[float, Any] = {}

    def solve(tolerance: float, duration: float) -> Array:
        if tolerance not in integrators:
            integrators[tolerance] = heyoka.taylor_adaptive(_system(problem.gamma), [0.0, 0.0], tol=tolerance)
        integrator, grid = integrators[tolerance], times_of(duration)
        angles = np.empty((problem.size, len(grid)))
        for row, start in zip(angles, problem.starts, strict=True):
            integrator.time = 0.0
            integrator.state[:] = start, 0.0
            row[:] = integrator.propagate_grid(grid)[-1][:, 0]
        return angles

    return solve


def _batch(lanes: int) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        import heyoka

        integrators: dict[float, Any] = {}

        def solve(tolerance: float, duration: float) -> Array:
            if tolerance not in integrators:
                integrators[tolerance] = heyoka.taylor_adaptive_batch(
                    _system(problem.gamma), np.zeros((2, lanes)), tol=tolerance)
            integrator, times = integrators[tolerance], times_of(duration)
            grid, starts = np.repeat(times[:, None], lanes, axis=1), problem.starts
            angles = np.empty((problem.size, len(times)))
            for i in range(0, problem.size, lanes):
                integrator.set_time(0.0)
                integrator.state[0], integrator.state[1] = starts[i : i + lanes], 0.0
                angles[i : i + lanes] = integrator.propagate_grid(grid)[-1][:, 0].T
            return angles

        return solve

    return prepare


LINES: Mapping[str, Callable[[Problem], Solver]] = {
    "heyoka": _scalar,
    **{f"heyoka, batches of {lanes}": _batch(lanes) for lanes in LANES},
}
ALONE = ("heyoka",)
"""Solvers for one trajectory only; those in ``TOGETHER`` are for many trajectories only."""
TOGETHER = tuple(name for name in LINES if name not in ALONE)
