"""diffrax in float64: jitted, vmapped over the trajectories, records by SaveAt(ts=...) from the dense output."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from against.problem import RATE, Array, Problem, Solver, times_of


def _line(name: str) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        import jax

        jax.config.update("jax_enable_x64", True)
        import diffrax
        import jax.numpy as jnp

        gamma = problem.gamma

        def slope(t: Any, y: Any, _: Any) -> Any:
            q, v = y
            return v, -RATE * jnp.sin(q) - (gamma * v if gamma else 0.0)

        def one(start: Any, times: Any, tolerance: Any) -> Any:
            found = diffrax.diffeqsolve(
                diffrax.ODETerm(slope), getattr(diffrax, name)(), 0.0, times[-1], None, (start, 0.0 * start),
                saveat=diffrax.SaveAt(ts=times), max_steps=None,
                stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            )
            return found.ys[0]

        run = jax.jit(one if problem.size == 1 else jax.vmap(one, (0, None, None)))
        starts = problem.starts[0] if problem.size == 1 else problem.starts

        def solve(tolerance: float, duration: float) -> Array:
            return np.asarray(run(starts, times_of(duration), tolerance))

        return solve

    return prepare


LINES: Mapping[str, Callable[[Problem], Solver]] = {f"diffrax {name}": _line(name) for name in ("Tsit5", "Dopri8")}
