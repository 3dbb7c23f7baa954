"""Speed of unrolled interpreted steps, compared with a loop over the stages of the same table.

Goal: at least 2 times as fast for every explicit Runge-Kutta method. Splittings are shown, too; a loop over kicks and
drifts has no sums to unroll. One thread; the force costs almost nothing, so that the step itself is measured.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable

from machine import describe

from integrators import METHODS, Method, RungeKutta, Splitting, System
from integrators.families.splitting import DRIFT
from integrators.solving.stepper import stepper

STEPS, REPEATS, GOAL = 2000, 7, 2.0
Step = Callable[..., tuple[float, ...]]


def acceleration(t: float, q: float, v: float) -> float:
    return -q


def force(t: float, q: float) -> float:
    return -q


def stage_loop(method: RungeKutta) -> Step:
    """Return the step of a Runge-Kutta method as textbooks program it: loops over the Butcher table."""
    a = [[float(x) for x in row] for row in method.a]
    b, c = [float(x) for x in method.b], [float(x) for x in method.c]
    stages = range(len(b))

    def step(t: float, q: float, v: float, h: float) -> tuple[float, float]:
        slopes: list[tuple[float, float]] = []
        for i in stages:
            q_i, v_i = q, v
            for j in range(i):
                q_i += h * a[i][j] * slopes[j][0]
                v_i += h * a[i][j] * slopes[j][1]
            slopes.append((v_i, acceleration(t + c[i] * h, q_i, v_i)))
        for i in stages:
            q += h * b[i] * slopes[i][0]
            v += h * b[i] * slopes[i][1]
        return q, v

    return step


def flow_loop(method: Splitting) -> Step:
    """Return the step of a splitting as textbooks program it: a loop over kicks and drifts."""
    flows = [(kind == DRIFT, float(x)) for kind, x in method.flows if kind != "drag"]

    def step(t: float, q: float, v: float, h: float) -> tuple[float, float]:
        for drift, part in flows:
            if drift:
                q += part * h * v
                t += part * h
            else:
                v += part * h * force(t, q)
        return q, v

    return step


def seconds(step: Step, *memory: float) -> float:
    q, v = 1.0, 0.0
    begun = time.perf_counter()
    if memory:
        (a,) = memory
        for i in range(STEPS):
            q, v, a = step(i * 0.01, q, v, a, 0.01)
    else:
        for i in range(STEPS):
            q, v = step(i * 0.01, q, v, 0.01)
    return time.perf_counter() - begun


def loop_of(method: Method) -> Step | None:
    """Return the loop over a method's table; None for other kinds of methods."""
    if isinstance(method, RungeKutta) and not method.implicit:
        return stage_loop(method)
    return flow_loop(method) if isinstance(method, Splitting) else None


def main() -> None:
    print(describe())
    least: dict[str, float] = {}
    for name, method in METHODS.items():
        loop = loop_of(method)
        if loop is None:
            continue
        step, begin = stepper(method, System(acceleration, force=force, velocity_free=True))
        memory = begin(0.0, 1.0, 0.0, 0.01)
        runs = [(seconds(step, *memory), seconds(loop)) for _ in range(REPEATS)]
        ratio = least[name] = statistics.median(theirs / ours for ours, theirs in runs)
        ours = statistics.median(ours for ours, _ in runs)
        print(f"{name:36s} {1e6 * ours / STEPS:8.2f} us a step, {ratio:5.2f} times as fast as a loop over its table")
    kinds = {"Runge-Kutta": RungeKutta, "splittings": Splitting}
    for label, kind in kinds.items():
        ratios = {name: ratio for name, ratio in least.items() if isinstance(METHODS[name], kind)}
        name = min(ratios, key=ratios.__getitem__)
        print(f"{label}: {ratios[name]:.2f} ({name}) to {max(ratios.values()):.2f} (goal: at least {GOAL})")


if __name__ == "__main__":
    main()
