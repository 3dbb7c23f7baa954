"""Evaluations, time and error of `integrators.solve` beside SciPy and diffrax, on problems of DETEST and of Bari.

Each program gets the same formulas, tolerances (rtol = atol; a thousandth of rtol for VDPOL, whose velocity is small)
and times, only the last one; each runs in a process of its own, SciPy and diffrax in venvs that the first run makes
with pip. The programs take turns, and the shortest of five repeats counts, on one thread. diffrax's functions are
compiled; its first call is left out. Stages of diffrax are counted as steps, taken or not, times stages; its implicit
methods count no evaluations of Newton's iteration, so none are shown.

    python examples/benchmarks/work_precision.py [--folder ~/.cache/lab-pendulum/venvs] [--problems D1 VDPOL]

Prints Markdown: machine, versions, one table for problems that are not stiff and one for those that are.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from against.test_sets import PROBLEMS, Problem, state
from venvs import ONE_THREAD, Worker, python_of, serve, versions

PINS = {"scipy": ("scipy==1.17.1", "numpy==2.4.6"),
        "diffrax": ("diffrax==0.7.2", "jax==0.10.2", "jaxlib==0.10.2", "numpy==2.4.6")}
METHODS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "own": (("dop853", "verner9", "dprkn12"), ("radau5", "sdirk4")),
    "scipy": (("DOP853", "LSODA"), ("Radau", "LSODA")),
    "diffrax": (("Dopri8",), ("Kvaerno5",)),
}
"""Program -> its methods for problems that are not stiff, and for stiff ones."""
TOLERANCES = (1e-4, 1e-7, 1e-10)
REPEATS = 5
STAGES = {"Dopri8": 13}
"""Evaluations of a step of diffrax's methods, whose last slope is the next step's first."""

Run = Callable[[], tuple[Any, int | None]]


def prepared(program: str, problem: Problem, method: str, rtol: float) -> Run:
    """Return a function that solves the problem and returns q at the end and the number of evaluations."""
    atol = rtol * (1e-3 if problem.stiff else 1.0)
    size = len(np.atleast_1d(problem.q))
    if program == "own":
        from integrators import System, solve

        array = isinstance(problem.q, list)
        lib: Any = np if array else math
        q, v = (np.array(x) if array else x for x in (problem.q, problem.v))
        form = problem.acceleration
        system: Any = (lambda t, q, v: form(lib, t, q, v)) if not problem.free else System(
            lambda t, q, v: form(lib, t, q, v), velocity_free=True)

        def own() -> tuple[Any, int | None]:
            found = solve(system, q, v, [0.0, problem.end], method=method, rtol=rtol, atol=atol)
            return np.atleast_1d(found.q[-1]).tolist(), found.evaluations

        return own
    start = state(problem)
    if program == "scipy":
        from scipy.integrate import solve_ivp

        def slope(t: float, y: Any) -> Any:
            a = problem.acceleration(np, t, y[:size], y[size:])
            return np.concatenate([y[size:], a])

        def scipy() -> tuple[Any, int | None]:
            found = solve_ivp(slope, (0.0, problem.end), start, method=method, rtol=rtol, atol=atol)
            return found.y[:size, -1].tolist(), int(found.nfev)

        return scipy
    import jax

    jax.config.update("jax_enable_x64", True)
    import diffrax
    import jax.numpy as jnp

    def slopes(t: Any, y: Any, _: Any) -> Any:
        return jnp.concatenate([y[size:], problem.acceleration(jnp, t, y[:size], y[size:])])

    @jax.jit
    def solved(y: Any) -> Any:
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(slopes), getattr(diffrax, method)(), 0.0, problem.end, None, y, max_steps=None,
            stepsize_controller=diffrax.PIDController(rtol=rtol, atol=atol))
        return found.ys[-1], found.stats["num_steps"]

    def compiled() -> tuple[Any, int | None]:
        y, steps = solved(start)
        return np.asarray(y)[:size].tolist(), int(steps) * STAGES[method] + 1 if method in STAGES else None

    return compiled


def served(program: str) -> None:
    """Answer requests {problem, method, rtol} with q at the end, evaluations and the shortest time [s]."""
    runs: dict[tuple[str, str, float], Run] = {}

    def answer(request: dict[str, Any]) -> Any:
        key = request["problem"], request["method"], request["rtol"]
        if key not in runs:
            runs[key] = prepared(program, PROBLEMS[key[0]], *key[1:])
            runs[key]()
        begun = time.perf_counter()
        try:
            q, evaluations = runs[key]()
        except (ArithmeticError, ValueError, RuntimeError) as fault:
            return {"fault": str(fault)}
        return {"q": q, "evaluations": evaluations, "seconds": time.perf_counter() - begun}

    serve(versions(PINS.get(program, ("numpy",))), answer)


def rows(workers: dict[str, Worker], names: list[str], stiff: bool) -> list[str]:
    """Return the rows of one table, in which the cells of a method are evaluations, time and error."""
    lines = ["| problem | program, method | " + " | ".join(f"rtol {rtol:.0e}" for rtol in TOLERANCES) + " |",
             "| --- | --- |" + " --- |" * len(TOLERANCES)]
    for name in names:
        problem = PROBLEMS[name]
        pairs = [(program, method) for program in workers for method in METHODS[program][stiff]
                 if method != "dprkn12" or problem.free]
        truth: Any = problem.truth
        if truth is None:
            finest: dict[str, Any] = {"problem": name, "method": "DOP853", "rtol": 3e-14}
            truth = workers["scipy"].ask(**finest)["q"]
        best: dict[tuple[str, str, float], dict[str, Any]] = {}
        for _ in range(REPEATS):
            for rtol in TOLERANCES:
                for program, method in pairs:
                    found = workers[program].ask(problem=name, method=method, rtol=rtol)
                    key = program, method, rtol
                    if key not in best or found.get("seconds", math.inf) < best[key].get("seconds", math.inf):
                        best[key] = found
        for program, method in pairs:
            cells = []
            for rtol in TOLERANCES:
                found = best[program, method, rtol]
                if "fault" in found:
                    cells.append("does not finish")
                    continue
                error = float(np.max(np.abs(np.array(found["q"]) - truth)))
                count = "" if found["evaluations"] is None else f"{found['evaluations']}; "
                cells.append(f"{count}{1e3 * found['seconds']:.3g} ms; {error:.0e}")
            lines.append(f"| {name} | {program} {method} | " + " | ".join(cells) + " |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path("~/.cache/lab-pendulum/venvs").expanduser())
    parser.add_argument("--problems", nargs="+", choices=list(PROBLEMS), default=list(PROBLEMS))
    parser.add_argument("--programs", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--serve", choices=list(METHODS), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.serve:
        served(given.serve)
        return
    from machine import describe

    print(describe(("numpy",)), flush=True)
    workers = {}
    for name in given.programs:
        python = sys.executable if name == "own" else python_of(name, PINS[name], given.folder)
        surroundings = {**ONE_THREAD, "JAX_PLATFORMS": "cpu",
                        "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"}
        workers[name] = Worker("--serve", python, Path(__file__), surroundings, name)
        print(f"{name}: {', '.join(f'{package} {number}' for package, number in workers[name].hello.items())}")
    for stiff in (False, True):
        chosen = [name for name in given.problems if PROBLEMS[name].stiff == stiff]
        if chosen:
            print("", *rows(workers, chosen, stiff), sep="\n", flush=True)
    for worker in workers.values():
        worker.close()


if __name__ == "__main__":
    os.environ.update(ONE_THREAD)
    main()
