"""Speed of unrolled interpreted steps, compared with a loop over the stages of the same table.

Goal: at least 2 times as fast for every explicit Runge-Kutta method. A loop over the kicks and drifts of a splitting
has no sums to unroll, so that its goal is a step written by hand: Forest and Ruth's, at most 1.05 times its time. One
thread; the force costs almost nothing, so that the step itself is measured.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import statistics
import time
from collections.abc import Callable

from machine import describe

import integrators
from integrators import METHODS, Method, RungeKutta, Splitting, System
from integrators.families.splitting import DRIFT, KICK
from integrators.solving.stepper import stepper

STEPS, REPEATS, GOAL, HAND_GOAL = 2000, 7, 2.0, 1.05
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


def by_hand() -> Step:
    """Return Forest and Ruth's step as it would be written by hand: the operations that it needs, and no others."""
    flows = integrators.get("forest_ruth").flows
    c1, c2, c3 = (float(x) for kind, x in flows if kind == DRIFT)
    kicks = [float(x) for kind, x in flows if kind == KICK]
    d1, d2, d3, d4 = kicks[0], kicks[1] + kicks[2], kicks[3] + kicks[4], kicks[5]
    e2 = c1 + c2

    def step(t: float, q: float, v: float, a: float, h: float) -> tuple[float, float, float]:
        v = v + h * (d1 * a)
        q = q + h * (c1 * v)
        v = v + h * (d2 * force(t + c1 * h, q))
        q = q + h * (c2 * v)
        v = v + h * (d3 * force(t + e2 * h, q))
        q = q + h * (c3 * v)
        a = force(t + h, q)
        return q, v + h * (d4 * a), a

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
        goal = f" (goal: at least {GOAL})" if kind is RungeKutta else ""
        print(f"{label}: {ratios[name]:.2f} ({name}) to {max(ratios.values()):.2f}{goal}")
    step, begin = stepper(METHODS["forest_ruth"], System(acceleration, force=force, velocity_free=True))
    memory, hand = begin(0.0, 1.0, 0.0, 0.01), by_hand()
    ratio = statistics.median(seconds(step, *memory) / seconds(hand, *memory) for _ in range(8 * REPEATS))
    print(f"forest_ruth: {ratio:.2f} times the time of a step written by hand (goal: at most {HAND_GOAL})")


if __name__ == "__main__":
    main()
