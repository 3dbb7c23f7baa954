"""Time of every explicit method in compiled blocks, per step and per force evaluation, relative to symplectic Euler.

Goals: a force evaluation of any method costs less than 2.5 times that of symplectic Euler; the generated kernel of
`vacuum` is within 3 % of one written by hand for the same fields. One thread, 4096 pendulums in blocks, no recording in
between. Closed forms and Taylor series, which do not evaluate forces, are shown, too. ``--markdown`` prints table rows.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import sys
import time
from collections.abc import Callable
from inspect import isfunction

import numpy as np
from machine import describe
from numba import njit

import integrators
from pendulum_env.engine.each import Each
from pendulum_env.engine.layout import BLOCK, aligned
from pendulum_env.engine.machine import fitting
from pendulum_env.engine.runs import RecordSchedule, Runs
from pendulum_env.physics import elementary

SIZE, STEPS, REPEATS, H = 4096, 500, 7, 0.01
GOAL, HAND_GOAL = 2.5, 1.03


def kernel(method: str, scene: str = "vacuum") -> Callable[[], None]:
    """Return a function that takes some steps of all pendulums with the generated kernel."""
    starts = np.random.default_rng(0).uniform(-2.0, 2.0, SIZE)
    runs = Runs(Each(scene, "scene", np.inf, {}, SIZE), method, (), "compiled", angle=starts, velocity=0.0 * starts,
                plan=RecordSchedule(H, STEPS, STEPS), control=0.0, num_threads=1)
    out = np.empty((1, len(runs.names), SIZE))
    return lambda: runs._spread(runs._state, SIZE, H, 1, STEPS, 0.0, out, 0)


def by_hand() -> Callable[[], None]:
    """Return a function that takes these steps with a hand-written kernel of symplectic Euler in `vacuum`."""
    inline = njit(error_model="numpy", forceinline=True)
    names = {name: inline(value) for name, value in vars(elementary).items() if isfunction(value)}
    for function in names.values():
        function.py_func.__globals__.update(names)
    sin, unsigned = names["sin"], np.uint64

    @njit(error_model="numpy", nogil=True)
    def steps(state: np.ndarray, size: int, count: int, h: float, rate: float) -> None:
        for b in range(len(state)):
            s, n = state[b], min(BLOCK, size - BLOCK * b)
            for _ in range(count):
                for i in range(unsigned(n)):
                    index, q, turns = s[i], s[i + unsigned(BLOCK)], s[i + unsigned(2 * BLOCK)]
                    v, status = s[i + unsigned(3 * BLOCK)], s[i + unsigned(4 * BLOCK)]
                    work, heat = 0.0, 0.0
                    side = 1.0 - 4.0 * abs(turns - ((turns + 6755399441055744.0) - 6755399441055744.0))
                    v1 = v - h * (rate * side * sin(q))
                    q1 = q + h * v1
                    good = (status == 0.0) & (abs(v1) <= 1e150) & (abs(q1) <= 8e8) & (work + heat <= 1e150)
                    halves = (q1 * 0.3183098861837907 + 6755399441055744.0) - 6755399441055744.0
                    q1 = ((q1 - halves * 3.141592651605606) - halves * 1.9841871583270443e-09) - (
                        halves * 1.034036596358821e-18
                    )
                    s[i + unsigned(2 * BLOCK)] = turns + (0.5 * halves if good else 0.0)
                    s[i + unsigned(BLOCK)] = q1 if good else q
                    s[i + unsigned(3 * BLOCK)] = v1 if good else v
                    s[i] = index + (1.0 if good else 0.0)
                    stop = 2.0 if abs(v1) > 1e300 else 0.0
                    s[i + unsigned(4 * BLOCK)] = stop if good else (1.0 if status == 0.0 else status)

    state = aligned((-(-SIZE // BLOCK), 5 * BLOCK))
    state[:, BLOCK : 2 * BLOCK] = np.random.default_rng(0).uniform(-2.0, 2.0, (len(state), BLOCK))
    return lambda: steps(state, SIZE, STEPS, H, 9.81)


def seconds(work: Callable[[], None]) -> float:
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def main() -> None:
    print(describe())
    names = [name for name, method in fitting(Each("vacuum", "scene", np.inf, {}, 1).scene).items()
             if not method.implicit]
    works = {name: kernel(name) for name in names} | {"by hand": by_hand()}
    for work in works.values():
        work()
    taken: dict[str, list[float]] = {name: [] for name in names}
    for _ in range(REPEATS):
        for name in names:
            taken[name].append(seconds(works[name]))
    base = taken["symplectic_euler"]
    worst = 0.0
    for name in names:
        count = float(integrators.get(name).evaluations)
        each = 1e9 * statistics.median(taken[name]) / (SIZE * STEPS)
        ratio = statistics.median(a / b for a, b in zip(taken[name], base, strict=True)) / count
        no_forces = integrators.get(name).needs & {"exact_flow", "taylor"}
        worst = worst if no_forces else max(worst, ratio)
        forces, share = ("-", "-") if no_forces else (f"{count:.0f}", f"{ratio:.2f}")
        if "--markdown" in sys.argv:
            print(f"| {name} | {each:.2f} | {forces} | {share} |")
        else:
            print(f"{name:36s} {each:8.2f} ns a step, {forces:>4s} forces, {share:>5s} of symplectic Euler's per force")
    print(f"most expensive force evaluation: {worst:.2f} times symplectic Euler's (goal: under {GOAL})")
    pairs = [(seconds(works["symplectic_euler"]), seconds(works["by hand"])) for _ in range(8 * REPEATS)]
    hand = statistics.median(ours / theirs for ours, theirs in pairs)
    print(f"symplectic Euler in vacuum: {hand:.3f} times the time of a kernel by hand (goal: at most {HAND_GOAL})")


if __name__ == "__main__":
    main()
