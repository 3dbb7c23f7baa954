"""Solvers of diffrax in float64: jitted, vmapped over the trajectories, with records by SaveAt(ts=...).

Records come from the dense output, whose order is lower than that of the steps; "clipped" solvers also end steps at the
records. The state is one array, because Dopri8 takes five times as long with a tuple.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from against.problem import RATE, Array, Problem, Solver, times_of


def _line(name: str, clipped: bool) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        import jax

        jax.config.update("jax_enable_x64", True)
        import diffrax
        import jax.numpy as jnp

        gamma = problem.gamma

        def slope(t: Any, y: Any, _: Any) -> Any:
            return jnp.stack([y[1], -RATE * jnp.sin(y[0]) - (gamma * y[1] if gamma else 0.0)])

        def one(start: Any, times: Any, tolerance: Any) -> Any:
            controller: Any = diffrax.PIDController(rtol=tolerance, atol=tolerance)
            if clipped:
                controller = diffrax.ClipStepSizeController(controller, step_ts=times)
            found = diffrax.diffeqsolve(
                diffrax.ODETerm(slope), getattr(diffrax, name)(), 0.0, times[-1], None,
                jnp.stack([start, 0.0 * start]),
                saveat=diffrax.SaveAt(ts=times), max_steps=None, stepsize_controller=controller,
            )
            return found.ys[:, 0]

        run = jax.jit(one if problem.size == 1 else jax.vmap(one, (0, None, None)))
        starts = problem.starts[0] if problem.size == 1 else problem.starts

        def solve(tolerance: float, duration: float) -> Array:
            return np.asarray(run(starts, times_of(duration), tolerance))

        return solve

    return prepare


LINES: Mapping[str, Callable[[Problem], Solver]] = {
    **{f"diffrax {name}": _line(name, False) for name in ("Tsit5", "Dopri8")},
    **{f"diffrax {name}, clipped": _line(name, True) for name in ("Tsit5", "Dopri8")},
}
