"""What the compiled step of a vector of environments consists of, in ns for one environment, one thread.

A step is taken without the part of the generated program that computes the observation, reward, endings and energies;
Python is the rest of a whole step of 1024 environments. Then: adaptive steps of 1024 pendulums at once beside one run
after the other; those of one pendulum, chosen one by one and evenly; and a step of a single Taylor series by its order,
with and without damping, beside a loop that takes only the steps.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import re
import time
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from against.problem import GAMMA
from machine import describe

import integrators
from pendulum_env import rollout
from pendulum_env.engine.elementwise import Kernel
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import functions
from pendulum_env.physics.damping import build_scene

SIZE, REPEATS = 1024, 9
KINDS: dict[str, dict[str, Any]] = {
    "rk4, energies": {"integrator": "rk4", "diagnostics": ("energy",)},
    "symplectic_euler, no diagnostics": {"integrator": "symplectic_euler", "diagnostics": ()},
}
ORDERS = (6, 8, 10, 12, 14, 16, 20, 24)


def shortest(work: Callable[[], Any], times: int = 1) -> float:
    """Return the shortest time of a call [s], of several series of ``times`` calls."""
    work()
    found = []
    for _ in range(REPEATS):
        begun = time.perf_counter()
        for _ in range(times):
            work()
        found.append((time.perf_counter() - begun) / times)
    return min(found)


def parts(name: str) -> None:
    """Print the parts of a step of one kind."""
    env = gym.make_vec("LabPendulum-v0", SIZE, vectorization_mode="vector_entry_point", num_threads=1, copy=False,
                       damping="none", max_episode_steps=10**9, **KINDS[name])
    action = np.random.default_rng(0).uniform(-1, 1, (SIZE, 1)).astype(np.float32)
    env.reset(seed=0)
    whole = shortest(lambda: env.step(action), 500)
    batch = env.unwrapped._batch
    arguments = (batch._state, batch._scratch[0], 0, len(batch._state), SIZE, batch.h, 1, 1, batch._bound,
                 action.ravel(), *batch.results(lasting=True), *batch._shared)

    def of(text: str) -> float:
        step = functions(Kernel(text, "parts"), "compiled")["step_blocks"]
        env.reset(seed=0)
        return shortest(lambda: step(*arguments), 500)

    text = batch.program.text
    full, motion = of(text), of(re.sub(r"        observe\(.*\n", "", text))
    each = 1e9 / SIZE
    print(f"{name}: {each * whole:.1f} ns, of which motion {each * motion:.1f}, observation, reward, endings and "
          f"energies {each * (full - motion):.1f}, Python {each * (whole - full):.1f}")


def at_once(method: str, every: float) -> None:
    """Print the time of adaptive steps of many pendulums beside that of one run after the other."""
    angles = np.radians(np.linspace(1.0, 179.0, SIZE))
    given: dict[str, Any] = {"scene": "vacuum", "integrator": method, "rtol": 1e-6, "duration": 20.0, "dt": every,
                             "diagnostics": (), "num_threads": 1}
    batch = shortest(lambda: rollout(angle=angles, **given))
    rollout(angle=1.0, **given)  # compiles
    begun = time.perf_counter()
    for angle in angles.tolist():
        rollout(angle=angle, **given)
    single = time.perf_counter() - begun
    print(f"{method}, rtol = 1e-6, records every {every:g} s: {1e6 * batch / SIZE:.1f} us a pendulum, "
          f"{single / batch:.0f} times as fast as one after the other")


def evenly(method: str) -> None:
    """Print time and error of 1000 s of a damped pendulum from 2 rad, with steps chosen one by one and evenly."""
    scene = build_scene("vacuum", {"linear": {"gamma": GAMMA["damped"]}}, {})
    given: dict[str, Any] = {"scene": scene, "angle": 2.0, "velocity": 0.0, "duration": 1000.0, "diagnostics": ()}
    truth = rollout(integrator="taylor24", dt=0.1, every=50, **given).angle
    for rtol in (1e-6, 1e-7, 1e-8, 1e-9, 1e-10):
        found = []
        for even in (False, True):
            def run(even: bool = even, rtol: float = rtol) -> Any:
                return rollout(integrator=method, dt=5.0, rtol=rtol, even_steps=even, **given)

            found.append(f"{1e6 * shortest(run):.0f} us, error {abs(run().angle - truth).max():.0e}")
        print(f"{method}, rtol = {rtol:.0e}: {found[0]}; even steps {found[1]}")


ONLY_STEPS = """
@entry
def only_steps(q, v, h, count, {parameters}):
    turns = 0.0
    side = 1.0
    for _ in range(count):
        q1, v = step(0.0, q, v, h, {given})
        halves = half_turns(q1)
        q = without_half_turns(q1, halves)
        turns = turns + 0.5*halves
        side = side_of(turns)
    return q + 6.283185307179586*turns
"""
"""A loop by hand that takes only the steps, without checks, stops and records."""


def series(order: int, gamma: float, steps: int = 400_000) -> None:
    """Print the time of a step of a Taylor series for one pendulum, beside that of a loop which takes only the steps.

    Both do the same operations on the angle in the same order, so that their results have the same bits. The
    linear damping is gamma [1/s], or none if it is 0.
    """
    method, scene = f"taylor{order}", build_scene("vacuum", {"linear": {"gamma": gamma}} if gamma else "none", {})

    def ours() -> float:
        return float(rollout(scene, integrator=method, duration=0.1 * steps, dt=0.1, every=steps, angle=1.0,
                             diagnostics=()).angle[-1])

    found = program(scene, integrators.get(method), ())
    loop = ONLY_STEPS.format(parameters=", ".join(found.shape.parameters), given=", ".join(found.shape.forces))
    only_steps = functions(Kernel(found.text.split("@entry\ndef run(")[0] + loop, "steps"), "compiled")["only_steps"]
    values = [scene.coefficients[name] for name in found.shape.parameters]

    def by_hand() -> float:
        return float(only_steps(1.0, 0.0, 0.1, steps, *values))

    assert ours() == by_hand()
    whole, only = (shortest(run) / steps for run in (ours, by_hand))
    print(f"{method}, {f'gamma = {gamma:g}/s' if gamma else 'undamped'}: {1e9 * whole:.1f} ns a step of one pendulum, "
          f"{whole / only:.3f} times the {1e9 * only:.1f} ns of a loop by hand")


def main() -> None:
    warnings.simplefilter("ignore")
    print(describe())
    for name in KINDS:
        parts(name)
    for method in ("dopri5", "dop853", "taylor16"):
        for every in (20.0, 0.1):
            at_once(method, every)
    evenly("taylor14")
    for gamma in (0.0, GAMMA["damped"]):
        for order in ORDERS:
            series(order, gamma)


if __name__ == "__main__":
    main()
