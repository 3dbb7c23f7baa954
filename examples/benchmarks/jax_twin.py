"""The twin in JAX beside gymnax, this package's compiled vectors, diffrax and Brax: speed of steps and of gradients.

``python examples/benchmarks/jax_twin.py`` prints a table of each, on ``--device cpu`` or ``gpu``. It needs
``pip install '.[jax]' gymnax six diffrax brax``; a peer that is missing is left out. ``--envs``, ``--steps`` and
``--repeats`` make it shorter.
"""

from __future__ import annotations

import argparse
import math
import os
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

Make = Callable[[], Callable[[Any], Any]]
PATIENCE = 5.0
"""Seconds after which a measurement is not repeated."""
NAMES = {"cpu": "cpu", "gpu": "cuda"}
LENGTH, GAMMA, START = 1.0, 0.005, 2.0
"""The damped swing: length [m], damping rate [1/s], release angle [rad]."""
TRUTH = {1000.0: (-0.02800927006228005, 3836.320975882853)}
"""Seconds -> what :func:`true_slope` finds in some minutes."""
TWINS = {"symplectic_euler": (0.01, 0.001), "rk4": (0.05, 0.02, 0.01), "dop853": (0.1, 0.05),
         "verner9": (0.1, 0.05), "gauss4": (0.05, 0.02), "taylor": (0.2, 0.1)}
"""Methods of the twin and their steps [s]."""


def best(run: Callable[[], Any], repeats: int) -> float:
    """Return the shortest wall time of several calls [s], after one that compiles; of fewer where they take long."""
    import jax

    jax.block_until_ready(run())
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        jax.block_until_ready(run())
        times.append(time.perf_counter() - begun)
        if sum(times) > PATIENCE:
            break
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


def true_slope(seconds: float) -> tuple[float, float]:
    """Return the angle after some seconds of the damped swing and its derivative by the damping rate, to 15 digits.

    Motion and variational equation by Taylor series of order 34 in steps of 1/8 s, in 32-digit arithmetic (mpmath): no
    code of the package has a part in it.
    """
    if seconds in TRUTH:
        return TRUTH[seconds]
    from mpmath import mp

    with mp.workdps(32):
        return _slope(seconds)


def _slope(seconds: float) -> tuple[float, float]:
    from mpmath import cos, mp, mpf, sin

    gamma, stiffness, h = mpf(GAMMA), mpf(9.81) / mpf(LENGTH), mpf(1) / 8
    state = (mpf(START), mpf(0), mpf(0), mpf(0))

    def product(a: Any, b: Any, n: int) -> Any:
        return sum((a[j] * b[n - j] for j in range(n + 1)), mpf(0))

    for _ in range(round(8 * seconds)):
        q, v, p, w = ([value] for value in state)
        s, c = [sin(q[0])], [cos(q[0])]
        for n in range(34):
            further = (v[n], -stiffness * s[n] - gamma * v[n], w[n],
                       -stiffness * product(c, p, n) - v[n] - gamma * w[n], product(c, v, n), -product(s, v, n))
            for series, value in zip((q, v, p, w, s, c), further, strict=True):
                series.append(value / (n + 1))
        state = tuple(mp.fsum(value * h**n for n, value in enumerate(series)) for series in (q, v, p, w))
    return float(state[0]), float(state[2])


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


BODY = """<mujoco><option timestep="0.01" gravity="0 0 -9.81"/><worldbody><body><joint type="hinge" axis="0 -1 0"/>
<inertial pos="0 0 -{length}" mass="1" diaginertia="1e-12 1e-12 1e-12"/>
<geom type="sphere" size="0.01" mass="0" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""
"""The damped swing for Brax: a point mass on a hinge."""


def brax_value(h: float, seconds: float) -> Callable[[Any], Any]:
    """Return the same of Brax's generalized pipeline, in parts of which only the first state is stored."""
    import jax
    import jax.numpy as jnp
    from brax.generalized import pipeline
    from brax.io import mjcf

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it is no longer maintained
        plain = mjcf.loads(BODY.format(length=LENGTH))
    steps = round(seconds / h)
    part = math.isqrt(steps)

    def value(gamma: Any) -> Any:
        system = plain.tree_replace({"opt.timestep": h, "dof.damping": gamma * LENGTH**2 * jnp.ones(1)})

        def turn(state: Any, _: Any) -> tuple[Any, None]:
            return pipeline.step(system, state, jnp.zeros(0)), None

        def turns(state: Any, _: Any) -> tuple[Any, None]:
            return jax.lax.scan(turn, state, None, length=part)[0], None

        state = pipeline.init(system, jnp.array([START]), jnp.zeros(1))
        state, _ = jax.lax.scan(jax.checkpoint(turns), state, None, length=steps // part)
        return jax.lax.scan(turn, state, None, length=steps % part)[0].q[0]

    return value


def gradient_table(seconds: float, repeats: int, path: str | None) -> None:
    """Print the errors of value and gradient, and the time of both; draw them, if a path is given."""
    import jax
    import jax.numpy as jnp

    truth = true_slope(seconds)
    rows: list[tuple[str, str, Make, Make]] = []
    for method, steps in TWINS.items():
        for h in steps:
            make: Make = partial(twin_value, method, h, seconds)
            rows.append((f"twin {method}", f"h = {h:g} s", make, make))
    for tolerance in (1e-8, 1e-10, 1e-12):
        ways = [partial(diffrax_value, tolerance, seconds, forward) for forward in (False, True)]
        rows.append(("diffrax Dopri8", f"tolerance {tolerance:g}", *ways))
    for h in (0.1, 0.01):
        make = partial(brax_value, h, seconds)
        rows.append(("Brax generalized", f"h = {h:g} s", make, make))
    print(f"\n{seconds:g} s of a damped swing from {START:g} rad, float64; the derivative is that by gamma\n")
    print("| solver | error of the angle | relative error of the derivative | value [ms] | "
          "with derivative, backward [ms] | forward [ms] |\n" + "| --- " * 6 + "|")
    points: dict[str, list[tuple[float, float, float]]] = {}
    for name, setting, make, make_forward in rows:
        try:
            function, forward = make(), make_forward()
        except ImportError as error:
            print(f"| {name}, {setting} | {error.name} is missing |" + " |" * 4)
            continue
        runs = (jax.jit(function), jax.jit(jax.value_and_grad(function)),
                jax.jit(lambda gamma, forward=forward: jax.jvp(forward, (gamma,), (jnp.ones_like(gamma),))))
        value, slope = runs[1](jnp.array(GAMMA))
        times = [1e3 * best(lambda run=run: run(jnp.array(GAMMA)), repeats) for run in runs]
        away = abs(float(slope / truth[1] - 1.0))
        points.setdefault(name, []).append((away, *times[1:]))
        print(f"| {name}, {setting} | {abs(float(value - truth[0])):.1e} | {away:.1e} | "
              f"{' | '.join(f'{one:.1f}' for one in times)} |", flush=True)
    if path is not None:
        draw(points, seconds, path)


def draw(points: dict[str, list[tuple[float, float, float]]], seconds: float, path: str) -> None:
    """Draw the error of the derivative against the time that value and derivative take, one panel for each mode."""
    from matplotlib.figure import Figure

    from pendulum_env.common.provenance import provenance
    from pendulum_env.plots import style
    from pendulum_env.render.palette import OKABE_ITO

    own = iter(hue for name, hue in OKABE_ITO.items() if name not in ("yellow", "black"))
    others = iter(("black", "0.55"))  # grey
    hues = {name: next(own if name.startswith("twin") else others) for name in points}
    with style.styled():
        figure = Figure(figsize=(9.0, 4.2), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for mode, (axes, title) in enumerate(zip(panels, ("backward, jax.grad", "forward, jax.jvp"), strict=True), 1):
            for name, found in points.items():
                line = sorted((one[mode] / 1e3, one[0]) for one in found)
                peer = not name.startswith("twin")
                axes.plot(*zip(*line, strict=True), label=name, color=hues[name], marker="s" if peer else "o",
                          linestyle="--" if peer else "-")
            axes.margins(0.06)
            axes.set(xscale="log", yscale="log", title=title, xlabel="time of value and derivative [s]")
        panels[0].set_ylabel("relative error of the derivative")
        panels[0].invert_yaxis()
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        figure.suptitle(f"Derivative of the angle after {seconds:g} s by the damping: further left is faster, further "
                        "up more accurate", x=0.01, ha="left", fontsize=12)
    style.save(figure, path, provenance(Seconds=seconds))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--device", choices=NAMES, default="cpu")
    parser.add_argument("--envs", type=int, default=65536)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--figure", help="file for a figure of the gradients' accuracy against time, as .png")
    parser.add_argument("--only", choices=("steps", "compilation", "gradients"), help="print one of the tables")
    parser.add_argument("--seconds", type=float, default=1000.0, help="length of the damped swing")
    given = parser.parse_args()
    os.environ["JAX_PLATFORMS"] = NAMES[given.device]
    import jax

    device = jax.devices()[0].device_kind
    print(f"jax {jax.__version__}, {device}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    if given.only in (None, "steps"):
        steps_table(given.envs, given.steps, given.repeats)
    if given.only in (None, "compilation"):
        compile_table()
    if given.only in (None, "gradients"):
        jax.config.update("jax_enable_x64", True)
        gradient_table(given.seconds, given.repeats, given.figure)


if __name__ == "__main__":
    main()
