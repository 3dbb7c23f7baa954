"""Solvers of this package: a Machine for one trajectory, which is reused as in other packages, ``rollout`` for many.

Work and heat are not computed, because the other packages do not either: ``diagnostics=()``. "adaptive" solvers have a
tolerance per step. So have "even" ones, whose steps between two records have the same length; theirs is absolute.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from against.problem import RECORDS, Array, Problem, Solver

METHODS = (
    *(f"taylor{order}" for order in (16, 12, 20, 6, 8, 10, 14, 18, 22, 24)), "rk4", "dop853", "verner9",
    "dprkn12", "blanes_moan_srkn14a", "kahan_li8", "quinlan_tremaine14",
)
"""Methods that are (nearly) the cheapest for some accuracy, and some well-known ones; the most general one first."""
SEARCH = "PRECISION_SEARCH"
"""Environment variable; if it is set, all explicit methods of order 3 or more are tried."""
ADAPTIVE = ("dop853", "verner9", "taylor16", "taylor20")
EVEN = tuple(f"taylor{order}" for order in (10, 12, 14, 16, 18, 20))
RELATIVE, FINEST = 0.01, 3e-14
"""Relative tolerance of "even" solvers, as a fraction of the absolute one, and its smallest value."""
EXACT = "lab-pendulum exact"
"""Name of the closed form, which is shown separately and does not compete."""


def scene_of(problem: Problem) -> Any:
    """Return the scene of this package for a problem."""
    from pendulum_env.physics.damping import build_scene

    damping: Any = {"linear": {"gamma": problem.gamma}} if problem.gamma else "none"
    return build_scene("vacuum", damping, {})


def fits(name: str, problem: Problem) -> bool:
    """Return True if the scene of a problem meets the needs of a solver's method."""
    import integrators
    from pendulum_env.engine.machine import offers

    method = name.removeprefix("lab-pendulum ").partition(",")[0]
    return integrators.get(method).needs <= offers(scene_of(problem))


def _each(setting: float) -> dict[str, Any]:
    """Return the options of an "adaptive" Machine."""
    return {"rtol": setting}


def _evenly(setting: float) -> dict[str, Any]:
    """Return the options of an "even" Machine."""
    return {"rtol": max(FINEST, RELATIVE * setting), "atol": setting, "even_steps": True}


def _alone(method: str, options: Callable[[float], dict[str, Any]] | None) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, Machine
        from pendulum_env.engine.runs import RecordSchedule, recorded

        scene, start = scene_of(problem), float(problem.starts[0])
        fixed = None if options else Machine(scene, method, ())
        machines: dict[float, Machine] = {}

        def solve(setting: float, duration: float) -> Array:
            if options and setting not in machines:
                machines[setting] = Machine(scene, method, (), **options(setting))
            machine, steps = (machines[setting], 1) if fixed is None else (fixed, int(setting))
            plan = RecordSchedule(duration / RECORDS / steps, RECORDS * steps, steps)
            states, _ = recorded(machine, machine.state(start, 0.0), plan)
            if len(states) < plan.count:
                return np.full(plan.count, math.nan)
            return np.asarray(states[:, ANGLE] + TWO_PI * states[:, TURNS])

        return solve

    return prepare


def _together(method: str, adaptive: bool) -> Callable[[Problem], Solver]:
    def prepare(problem: Problem) -> Solver:
        from pendulum_env import rollout

        scene = scene_of(problem)

        def solve(setting: float, duration: float) -> Array:
            rtol, steps = (setting, 1) if adaptive else (None, int(setting))
            return rollout(scene, integrator=method, angle=problem.starts, velocity=0.0, duration=duration,
                           dt=duration / RECORDS / steps, every=steps, rtol=rtol, diagnostics=(), num_threads=1).angle

        return solve

    return prepare


def _line(method: str, adaptive: bool = False) -> Callable[[Problem], Solver]:
    alone, together = _alone(method, _each if adaptive else None), _together(method, adaptive)
    return lambda problem: (alone if problem.size == 1 else together)(problem)


def methods_tried() -> tuple[str, ...]:
    """Return METHODS, followed by all explicit methods of order 3 or more if SEARCH is set."""
    if not os.environ.get(SEARCH):
        return METHODS
    import integrators

    more = (name for name, m in integrators.METHODS.items() if not m.implicit and 3 <= m.order < math.inf)
    return tuple(dict.fromkeys((*METHODS, *more)))


def lines(methods: tuple[str, ...]) -> dict[str, Callable[[Problem], Solver]]:
    """Return the solvers of the methods, the adaptive ones and the closed form, by name."""
    solvers = {f"lab-pendulum {method}": _line(method) for method in methods}
    solvers |= {f"lab-pendulum {method}, adaptive": _line(method, True) for method in ADAPTIVE}
    solvers |= {f"lab-pendulum {method}, even": _alone(method, _evenly) for method in EVEN}
    return {**solvers, EXACT: _line("exact")}


LINES: Mapping[str, Callable[[Problem], Solver]] = lines(methods_tried())
ALONE = tuple(name for name in LINES if name.endswith(", even"))
"""Solvers for one trajectory."""
