"""Cost of each effect: the time that it adds to a step of the ball of `lab` under gravity, compiled and interpreted.

Differences in nanoseconds per step, with rk4 and, if it fits, velocity_verlet, with energies; and with rk4 for each of
1024 pendulums in blocks, one thread. Each number is the shortest of several timings, with all programs in turn. Effects
of the kind "inertia" only change numbers, so the program is identical. The memory of gusts is advanced at every step
here. ``--markdown`` prints table rows.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import math
import sys
import time
from collections.abc import Callable

import numpy as np
from machine import describe

import integrators
from pendulum_env import SCENES, Scene
from pendulum_env.engine.each import Each
from pendulum_env.engine.generate import program
from pendulum_env.engine.machine import fitting
from pendulum_env.engine.runs import RecordSchedule, Runs
from pendulum_env.physics.effects import (
    EFFECTS,
    BearingFriction,
    CoulombFriction,
    Effect,
    Gravity,
    QuadraticDrag,
    SmoothFriction,
    SphereDrag,
)
from pendulum_env.study.audit.study import scene_times

AMPLITUDE, SIZE, METHODS = 0.5, 1024, ("rk4", "velocity_verlet")
TIMINGS: dict[str, tuple[int, int, int]] = {"compiled": (25, 20_000, 500), "python": (9, 200, 100)}
"""Backend -> number of timings, steps per timing, and steps after which the ball is released again."""
BLOCKS = (15, 100)
"""Number of timings in blocks, and steps per timing."""
GIVEN: dict[str, Effect] = {
    "bearing_friction": BearingFriction(bearing_viscosity=1e-4),
    "coulomb_friction": CoulombFriction(friction_torque=5e-4),
    "smooth_friction": SmoothFriction(friction_torque=5e-4),
}
"""Effects that have no default parameters."""
BASE = SCENES["lab"].with_effects((Gravity(),))
Pair = tuple[Scene, Scene]
Cost = float | None


def pairs() -> dict[str, Pair]:
    """Return the label of each row -> a scene with the effect, and the scene without it."""
    empty, dragged = BASE.with_effects(()), BASE.with_effects((*BASE.effects, QuadraticDrag()))
    scenes: dict[str, Pair] = {}
    for name, kind in EFFECTS.items():
        effect = GIVEN.get(name) or kind()
        if name == "gravity":
            scenes[name] = (BASE, empty)
        elif effect.exclusive == "gravity":
            scenes[f"{name}, for gravity"] = (empty.with_effects((effect,)), BASE)
        elif effect.kind == "medium":
            scenes[f"{name}, beside quadratic_drag"] = (dragged.with_effects((*dragged.effects, effect)), dragged)
        else:
            scenes[name] = (BASE.with_effects((*BASE.effects, effect)), BASE)
    return scenes


def everything() -> Scene:
    """Return the scene with all effects that can be combined."""
    effects = [GIVEN.get(name) or kind() for name, kind in EFFECTS.items()]
    drags = [effect for effect in effects if effect.models == SphereDrag().models and effect.name != "sphere_drag"]
    return BASE.with_effects(e for e in effects if e not in drags and e.name != "small_angle_gravity")


def block_times(scenes: list[Scene], rounds: int, steps: int) -> dict[Scene, float]:
    """Return the shortest time per step and pendulum [ns] of rk4 with SIZE pendulums in blocks, for each scene."""
    works = {scene: block_work(scene, steps) for scene in scenes}
    best = dict.fromkeys(scenes, math.inf)
    for _ in range(rounds):
        for scene, work in works.items():
            begun = time.perf_counter()
            work()
            best[scene] = min(best[scene], 1e9 * (time.perf_counter() - begun) / (SIZE * steps))
    return best


def block_work(scene: Scene, steps: int) -> Callable[[], None]:
    """Return a function that takes some steps of all pendulums, always from the same starts."""
    starts, h = np.random.default_rng(0).uniform(0.3, 0.7, SIZE), 0.002
    runs = Runs(Each(scene, "scene", math.inf, {}, SIZE), "rk4", ("energy",), "compiled", angle=starts,
                velocity=0.0 * starts, plan=RecordSchedule(h, steps, steps), control=0.0, num_threads=1)
    first, out = runs._state.copy(), np.empty((1, len(runs.names), SIZE))
    memory = (0, 1) if runs.layout.shape.remembered else (0,)

    def work() -> None:
        runs._state[:] = first
        runs._spread(runs._state, SIZE, h, 1, steps, 0.0, out, *memory)

    work()
    return work


def costs(
    rows: dict[str, Pair], timings: dict[str, tuple[int, int, int]] = TIMINGS, blocks: tuple[int, int] | None = BLOCKS
) -> dict[str, list[Cost]]:
    """Return for each row the time that its effect adds to a step [ns]: by method and backend, then in blocks.

    None if the method does not fit the scene.
    """
    by_row: dict[str, list[Cost]] = {label: [] for label in rows}
    period = 2.0 * math.pi / BASE.omega0
    for method in METHODS:
        fits = [pair for pair in rows.values() if all(method in fitting(scene) for scene in pair)]
        scenes = list(dict.fromkeys(scene for pair in fits for scene in pair))
        for backend, timing in timings.items():
            taken = scene_times(scenes, AMPLITUDE, period, backend, lambda _: None, method, timing)
            for label, pair in rows.items():
                by_row[label].append(taken[pair[0]] - taken[pair[1]] if pair in fits else None)
    if blocks:
        scenes = list({text(scene): scene for pair in rows.values() for scene in pair}.values())
        taken = {text(scene): value for scene, value in block_times(scenes, *blocks).items()}
        for label, pair in rows.items():
            by_row[label].append(taken[text(pair[0])] - taken[text(pair[1])])
    return by_row


def text(scene: Scene) -> str:
    """Return the generated program of rk4 for a scene."""
    return program(scene, integrators.get("rk4")).text


def shown(cost: Cost, same: bool) -> str:
    """Format a number of nanoseconds with its significant digits."""
    return "0 (same program)" if same else "-" if cost is None else f"{cost:.1f}" if abs(cost) < 1e3 else f"{cost:.0f}"


def main() -> None:
    print(describe())
    empty = BASE.with_effects(())
    rows = {**pairs(), "all that go together": (everything(), empty)}
    by_row = costs(rows)
    markdown = "--markdown" in sys.argv
    heads = ["effect", *(f"{method}, {backend}" for method in METHODS for backend in TIMINGS), "rk4, in blocks"]
    table = [heads, *([["---"] * len(heads)] if markdown else [])]
    for label, values in by_row.items():
        same = text(rows[label][0]) == text(rows[label][1])
        table.append([label, *(shown(value, same) for value in values)])
    for row in table:
        print(f"| {' | '.join(row)} |" if markdown else f"{row[0]:32s}" + "".join(f"{cell:>26s}" for cell in row[1:]))


if __name__ == "__main__":
    main()
