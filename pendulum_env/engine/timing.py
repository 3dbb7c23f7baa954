"""Computing time of integration steps, measured without compilation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from time import perf_counter
from typing import TypeVar

from pendulum_env.engine.machine import INDEX, Machine

Key = TypeVar("Key")


def run_time(
    machine: Machine, angle: float, velocity: float, h: float, steps: int, runs: int = 1, control: float = 0.0
) -> tuple[float, float]:
    """Return the mean wall time [s] of ``runs`` equal runs, and the integration steps that one of them takes.

    A run begins at ``angle`` [rad] and ``velocity`` [rad/s], and has ``steps`` steps of ``h`` [s], which an adaptive
    machine divides.
    """
    start, state = (machine.state(angle, velocity) for _ in range(2))
    begun = perf_counter()
    for _ in range(runs):
        state[:] = start
        machine.advance(state, control, h, steps)
    seconds = perf_counter() - begun
    return seconds / runs, float(state[machine.kept["taken"] if machine.tolerance else INDEX])


def step_times(
    machines: Mapping[Key, Machine], angle: float, velocity: float, h: float, steps: int, *, rounds: int, runs: int = 1,
    control: float = 0.0, tell: Callable[[float], None] = lambda _done: None,
) -> dict[Key, float]:
    """Return the computing time of an integration step of every machine [s]: the shortest of ``rounds`` timings.

    The machines take turns, so that a change of the computer's speed affects all of them alike. Each timing is a
    :func:`run_time`; before the first, every machine takes a step, so that no timing includes compilation. ``tell`` is
    called with the fraction done.
    """
    best = dict.fromkeys(machines, math.inf)
    for machine in machines.values():
        machine.advance(machine.state(angle, velocity), control, h, 1)
    for i in range(rounds):
        tell(i / rounds)
        for key, machine in machines.items():
            seconds, taken = run_time(machine, angle, velocity, h, steps, runs, control)
            best[key] = min(best[key], seconds / max(1.0, taken))
    return best
