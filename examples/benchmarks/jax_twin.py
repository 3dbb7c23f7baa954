"""The twin in JAX beside gymnax, this package's compiled vectors, and diffrax: speed of steps and of gradients.

``python examples/benchmarks/jax_twin.py`` prints a table of each, on ``--device cpu`` or ``gpu``. It needs
``pip install '.[jax]' gymnax six diffrax``; a peer that is missing is left out. ``--envs``, ``--steps`` and
``--repeats`` make it shorter.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from functools import partial
from typing import Any

Make = Callable[[], Callable[[Any], Any]]
NAMES = {"cpu": "cpu", "gpu": "cuda"}
LENGTH, GAMMA, START = 1.0, 0.005, 2.0
"""The damped swing: length [m], damping rate [1/s], release angle [rad]."""


def best(run: Callable[[], Any], repeats: int) -> float:
    """Return the shortest wall time of several calls [s], after one that compiles."""
    import jax

    jax.block_until_ready(run())
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        jax.block_until_ready(run())
        times.append(time.perf_counter() - begun)
    return min(times)


# --- steps of many environments ---------------------------------------------------------------------------------------


def twin_steps(envs: int, steps: int, autoreset: bool, **keywords: Any) -> Callable[[], Any]:
    """Return a scan of the twin's environments with a constant action; observations and rewards are computed."""
    import jax
    import jax.numpy as jnp

    import pendulum_env.jax as twin

    env = twin.LabPendulum(dtype="float32", **keywords).gymnax()
    action = jnp.full((1,), 0.5)
    return scanned(env, action, envs, steps, autoreset, jax, jnp)


def gymnax_steps(envs: int, steps: int, autoreset: bool) -> Callable[[], Any]:
    """Return the same scan of gymnax's Pendulum."""
    import gymnax
    import jax
    import jax.numpy as jnp

    env, _ = gymnax.make("Pendulum-v1")
    return scanned(env, jnp.full((1,), 0.5), envs, steps, autoreset, jax, jnp)


def scanned(env: Any, action: Any, envs: int, steps: int, autoreset: bool, jax: Any, jnp: Any) -> Callable[[], Any]:
    params = env.default_params
    step = jax.vmap(*((env.step, (0, 0, None, None)) if autoreset else (env.step_env, (None, 0, None, None))))
    observation, state = jax.vmap(env.reset, in_axes=(0, None))(jax.random.split(jax.random.key(0), envs), params)

    def one(carry: Any, key: Any) -> tuple[Any, None]:
        _, state, total = carry
        keys = jax.random.split(key, envs) if autoreset else key
        observation, state, reward, *_ = step(keys, state, action, params)
        return (observation, state, total + reward), None

    @jax.jit
    def run(carry: Any) -> Any:
        return jax.lax.scan(one, carry, jax.random.split(jax.random.key(1), steps))[0]

    return lambda: run((observation, state, jnp.zeros(envs)))


def vector_steps(envs: int, steps: int, **keywords: Any) -> Callable[[], Any]:
    """Return as many steps of the package's compiled vector environment."""
    import gymnasium
    import numpy as np

    env = gymnasium.make_vec("pendulum_env:LabPendulum-v0", envs, vectorization_mode="vector_entry_point", **keywords)
    env.reset(seed=0)
    actions = np.full((envs, 1), 0.5, dtype=np.float32)

    def run() -> None:
        for _ in range(steps):
            env.step(actions)

    return run


def steps_table(envs: int, steps: int, repeats: int) -> None:
    euler = {"integrator": "symplectic_euler", "diagnostics": ()}
    rows: list[tuple[str, Callable[[], Callable[[], Any]]]] = []
    for autoreset in (False, True):
        ending = "autoreset" if autoreset else "no reset"
        rows += [
            (f"gymnax Pendulum, float32, {ending}", lambda a=autoreset: gymnax_steps(envs, steps, a)),
            (f"twin, symplectic_euler, float32, {ending}", lambda a=autoreset: twin_steps(envs, steps, a, **euler)),
            (f"twin, rk4 with energies, float32, {ending}", lambda a=autoreset: twin_steps(envs, steps, a)),
        ]
    rows += [("compiled vector, symplectic_euler, float64", lambda: vector_steps(envs, steps, **euler)),
             ("compiled vector, rk4 with energies, float64", lambda: vector_steps(envs, steps))]
    print(f"\n{envs} environments, {steps} steps in one scan\n")
    print("| environment | ns per step of one environment |\n| --- | --- |")
    for name, make in rows:
        try:
            print(f"| {name} | {1e9 * best(make(), repeats) / envs / steps:.2f} |", flush=True)
        except ImportError as error:
            print(f"| {name} | {error.name} is missing |")


# --- compilation ------------------------------------------------------------------------------------------------------


def compile_table() -> None:
    import jax
    import jax.numpy as jnp

    import pendulum_env.jax as twin

    print("\n| a scan of 200 steps in lab | compiled [s] | its gradient [s] |\n| --- | --- | --- |")
    for method in ("symplectic_euler", "rk4", "dop853", "gauss4"):
        def last(angle: Any, method: str = method) -> Any:
            return twin.rollout("lab", integrator=method, angle=angle, steps=200).angle[-1]

        times = []
        for function in (last, jax.grad(last)):
            jax.clear_caches()
            begun = time.perf_counter()
            jax.jit(function).lower(jnp.array(0.5)).compile()
            times.append(time.perf_counter() - begun)
        print(f"| {method} | {times[0]:.1f} | {times[1]:.1f} |", flush=True)


# --- gradients --------------------------------------------------------------------------------------------------------


def twin_value(method: str, h: float, seconds: float) -> Callable[[Any], Any]:
    """Return the angle after some seconds of the damped swing as a function of the damping rate."""
    import pendulum_env.jax as twin
    from pendulum_env import Scene
    from pendulum_env.physics.effects import Gravity, LinearDrag

    scene = Scene("swing", effects=(Gravity(), LinearDrag(gamma=GAMMA))).replace(length=LENGTH, suspension="rod")
    steps = round(seconds / h)
    run = partial(twin.rollout, scene, integrator=method, angle=START, velocity=0.0, dt=h, steps=steps, every=steps,
                  diagnostics=())
    return lambda gamma: run(gamma=gamma).angle[-1]


def diffrax_value(tolerance: float, seconds: float, forward: bool) -> Callable[[Any], Any]:
    """Return the same of diffrax, for derivatives in forward or backward mode."""
    import diffrax
    import jax.numpy as jnp

    def slope(t: Any, y: Any, gamma: Any) -> Any:
        return jnp.stack([y[1], -9.81 / LENGTH * jnp.sin(y[0]) - gamma * y[1]])

    def value(gamma: Any) -> Any:
        found = diffrax.diffeqsolve(
            diffrax.ODETerm(slope), diffrax.Dopri8(), 0.0, seconds, None, jnp.array([START, 0.0]), args=gamma,
            max_steps=2**16, adjoint=diffrax.ForwardMode() if forward else diffrax.RecursiveCheckpointAdjoint(),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance))
        return found.ys[-1, 0]

    return value


def gradient_table(seconds: float, repeats: int) -> None:
    """Print the errors of value and gradient, and the time of both, beside a much finer solution."""
    import jax
    import jax.numpy as jnp

    truth = jax.jit(jax.value_and_grad(twin_value("verner9", 0.01, seconds)))(jnp.array(GAMMA))
    rows: list[tuple[str, Make, Make]] = []
    for method, h in (("rk4", 0.01), ("dop853", 0.1), ("dop853", 0.05), ("verner9", 0.1), ("taylor", 0.1)):
        make: Make = partial(twin_value, method, h, seconds)
        rows.append((f"twin {method}, h = {h:g} s", make, make))
    for tolerance in (1e-8, 1e-10, 1e-12):
        ways = [partial(diffrax_value, tolerance, seconds, forward) for forward in (False, True)]
        rows.append((f"diffrax Dopri8, tolerance {tolerance:g}", *ways))
    print(f"\n{seconds:g} s of a damped swing from {START:g} rad, float64; the derivative is that by gamma\n")
    print("| solver | error of the angle | relative error of the derivative | value [ms] | "
          "with derivative, backward [ms] | forward [ms] |\n" + "| --- " * 6 + "|")
    for name, make, make_forward in rows:
        try:
            function, forward = make(), make_forward()
        except ImportError as error:
            print(f"| {name} | {error.name} is missing |" + " |" * 4)
            continue
        runs = (jax.jit(function), jax.jit(jax.value_and_grad(function)),
                jax.jit(lambda gamma, forward=forward: jax.jvp(forward, (gamma,), (jnp.ones_like(gamma),))))
        value, slope = runs[1](jnp.array(GAMMA))
        times = [f"{1e3 * best(lambda run=run: run(jnp.array(GAMMA)), repeats):.1f}" for run in runs]
        print(f"| {name} | {abs(float(value - truth[0])):.1e} | {abs(float(slope / truth[1] - 1.0)):.1e} | "
              f"{' | '.join(times)} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--device", choices=NAMES, default="cpu")
    parser.add_argument("--envs", type=int, default=65536)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=1000.0, help="length of the damped swing")
    given = parser.parse_args()
    os.environ["JAX_PLATFORMS"] = NAMES[given.device]
    import jax

    device = jax.devices()[0].device_kind
    print(f"jax {jax.__version__}, {device}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    steps_table(given.envs, given.steps, given.repeats)
    compile_table()
    jax.config.update("jax_enable_x64", True)
    gradient_table(given.seconds, given.repeats)


if __name__ == "__main__":
    main()
