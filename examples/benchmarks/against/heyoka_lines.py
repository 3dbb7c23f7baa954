"""heyoka's adaptive Taylor series: ``taylor_adaptive``, and ``taylor_adaptive_batch`` over the SIMD lanes.

As its documentation advises for small systems: neither compact mode nor high accuracy; records by ``propagate_grid``,
from the dense output. One trajectory alone takes the scalar integrator, which is the faster for it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from against.problem import RATE, Array, Problem, Solver, times_of

LANES = (4, 8)
"""Batch sizes: four doubles in AVX2, eight in AVX-512."""


def _system(gamma: float) -> Any:
    import heyoka

    q, v = heyoka.make_vars("q", "v")
    return [(q, v), (v, -RATE * heyoka.sin(q) - gamma * v if gamma else -RATE * heyoka.sin(q))]


def _scalar(problem: Problem) -> Solver:
    import heyoka

    made: dict[float, Any] = {}

    def solve(tolerance: float, duration: float) -> Array:
        if tolerance not in made:
            made[tolerance] = heyoka.taylor_adaptive(_system(problem.gamma), [0.0, 0.0], tol=tolerance)
        integrator, grid = made[tolerance], times_of(duration)
        found = np.empty((problem.size, len(grid)))
        for row, start in zip(found, problem.starts, strict=True):
            integrator.time = 0.0
            integrator.state[:] = start, 0.0
            row[:] = integrator.propagate_grid(grid)[-1][:, 0]
        return found

    return solve


def _batch(lanes: int) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        import heyoka

        made: dict[float, Any] = {}

        def solve(tolerance: float, duration: float) -> Array:
            if tolerance not in made:
                made[tolerance] = heyoka.taylor_adaptive_batch(
                    _system(problem.gamma), np.zeros((2, lanes)), tol=tolerance)
            integrator, times = made[tolerance], times_of(duration)
            grid, starts = np.repeat(times[:, None], lanes, axis=1), problem.starts
            found = np.empty((problem.size, len(times)))
            for i in range(0, problem.size, lanes):
                integrator.set_time(0.0)
                integrator.state[0], integrator.state[1] = starts[i : i + lanes], 0.0
                found[i : i + lanes] = integrator.propagate_grid(grid)[-1][:, 0].T
            return found

        return solve

    return prepare


LINES: Mapping[str, Callable[[Problem], Solver]] = {
    "heyoka": _scalar,
    **{f"heyoka, batches of {lanes}": _batch(lanes) for lanes in LANES},
}
ALONE = ("heyoka",)
"""Lines for one trajectory only; ``TOGETHER``: for many only."""
TOGETHER = tuple(name for name in LINES if name not in ALONE)
