"""Measured computing time that an effect adds to one integration step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import integrators
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import Backend, resolve
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.spec import RunSpec
from pendulum_env.engine.timing import step_times
from pendulum_env.physics.scene import Scene
from pendulum_env.study.audit.swing import METHOD

STEPS_PER_PERIOD = 512
"""Steps per period in timings."""
TIMINGS: dict[str, tuple[int, int, int]] = {"compiled": (15, 5_000, 500), "python": (3, 60, 60)}
"""For each backend: number of timings, steps per timing, and steps after which the bob is released again."""


def step_costs(
    pairs: Sequence[tuple[Scene, Scene] | None], amplitude: float, period: float, backend: Backend,
    tell: Callable[[float], None],
) -> list[float]:
    """Return, for each pair of scenes, how much longer a step of rk4 takes in the first than in the second [ns].

    For an entry None instead of a pair the result is nan. ``tell`` is called with the fraction of the work done.
    """
    times = scene_times([scene for pair in pairs if pair for scene in pair], amplitude, period, backend, tell)
    return [times[pair[0]] - times[pair[1]] if pair else math.nan for pair in pairs]


def scene_times(
    scenes: Iterable[Scene], amplitude: float, period: float, backend: Backend, tell: Callable[[float], None],
    method: str = METHOD, timing: tuple[int, int, int] | None = None,
) -> dict[Scene, float]:
    """Return for each scene the computing time [ns] of one integration step, computation of energies included.

    The time is the shortest of several timings. Scenes for which the same code is generated share one timing. The
    timings alternate between scenes, so that a disturbance of the computer affects all of them alike. ``timing``
    (number of timings, steps per timing, steps between restarts) replaces the default of the backend.
    """
    keys = {scene: program(scene, integrators.get(method)).text for scene in scenes}
    rounds, steps, again = timing or TIMINGS[resolve(backend)]
    distinct = {text: scene for scene, text in reversed(keys.items())}
    machines: dict[str, Machine] = {}
    for text, scene in distinct.items():
        tell(0.8 * len(machines) / len(distinct))
        machines[text] = RunSpec.of(scene, method, backend=backend).machine()
    best = step_times(machines, amplitude, 2.0 * math.pi * amplitude / period, period / STEPS_PER_PERIOD, again,
                      rounds=rounds, runs=steps // again, tell=lambda done: tell(0.8 + 0.2 * done))
    return {scene: 1e9 * best[text] for scene, text in keys.items()}
