"""Other people's environments, to be timed beside this package's: each in a venv and a process of its own.

Imported, it speaks to the processes. Run by a venv's Python as ``peers.py NAME`` it is one: see :mod:`venvs`. Each
request is answered with one timed repeat.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from venvs import ONE_THREAD, Worker, python_of, versions
from venvs import serve as serve_requests

PINS: Mapping[str, tuple[str, ...]] = {
    # gymnax 1.0.1 takes jax 0.6 to 0.11. 0.6.2 is its fastest: 24 ns a step on 2 cores, where 0.7.2 to 0.10.2 take 34.
    # It needs six without saying so.
    "gymnax": ("gymnax==1.0.1", "jax==0.6.2", "jaxlib==0.6.2", "numpy==2.2.6", "six==1.17.0"),
    "gymnasium": ("gymnasium==1.4.0", "numpy==2.2.6"),
    "envpool": ("envpool==1.2.5", "gymnasium==1.4.0", "numpy==2.2.6"),
}
"""What each venv holds, for Python 3.10 to 3.13."""

SURROUNDINGS: Mapping[str, Mapping[str, str]] = {
    "gymnax": {"JAX_PLATFORMS": "cpu"},
    "gymnasium": ONE_THREAD,
    "envpool": ONE_THREAD,
}
"""Environment variables of each process. XLA keeps its default: a thread for every core."""

EPISODE = 200
"""Steps of an episode of gymnax's Pendulum."""

Run = Callable[[], object]


class Timing(NamedTuple):
    """One repeat: wall time and processor time [s] of all threads."""

    wall: float
    cpu: float


def timed(run: Run) -> Timing:
    """One repeat of ``run``."""
    cpu, wall = time.process_time(), time.perf_counter()
    run()
    return Timing(time.perf_counter() - wall, time.process_time() - cpu)


def stepping(env: Any, actions: Any, steps: int) -> Run:
    """``steps`` steps of a vector environment with the same actions; autoreset starts its episodes anew."""

    def run() -> None:
        step = env.step
        for _ in range(steps):
            step(actions)

    return run


# --- the process of a peer --------------------------------------------------------------------------------------


def _gymnax(num_envs: int, steps: int, *, autoreset: bool) -> Run:
    """Pendulum-v1 in one jitted scan, float32, a constant action; observations and summed rewards are computed.

    With ``autoreset``, the documented use: ``step``, a key for each environment in each step. Without it, what a
    Pendulum allows: ``step_env``, and since all episodes last EPISODE steps, one reset of all between them.
    """
    import gymnax
    import jax
    import jax.numpy as jnp

    env, params = gymnax.make("Pendulum-v1")
    action = jnp.full((1,), 0.5)
    reset = jax.vmap(env.reset, in_axes=(0, None))
    step = jax.vmap(env.step, in_axes=(0, 0, None, None))
    step_env = jax.vmap(env.step_env, in_axes=(None, 0, None, None))

    def one(carry: Any, _: None) -> tuple[Any, None]:
        key, _, state, total = carry
        key, drawn = jax.random.split(key)
        observation, state, reward, *_ = step(jax.random.split(drawn, num_envs), state, action, params)
        return (key, observation, state, total + reward), None

    def inner(carry: Any, _: None) -> tuple[Any, None]:
        key, _, state, total = carry
        observation, state, reward, *_ = step_env(key, state, action, params)
        return (key, observation, state, total + reward), None

    def episode(carry: Any, _: None) -> tuple[Any, None]:
        key, _, _, total = carry
        key, drawn = jax.random.split(key)
        start = (key, *reset(jax.random.split(drawn, num_envs), params), total)
        return jax.lax.scan(inner, start, None, length=EPISODE)

    body, length = (one, steps) if autoreset else (episode, steps // EPISODE)
    key = jax.random.key(0)
    start = (key, *reset(jax.random.split(key, num_envs), params), jnp.zeros(num_envs))
    scan = jax.jit(lambda carry: jax.lax.scan(body, carry, None, length=length)[0])
    return lambda: jax.block_until_ready(scan(start))


def _cart_pole(num_envs: int, steps: int) -> Run:
    import gymnasium
    import numpy as np

    env = gymnasium.make_vec("CartPole-v1", num_envs, vectorization_mode="vector_entry_point")
    env.reset(seed=0)
    return stepping(env, np.random.default_rng(0).integers(0, 2, num_envs), steps)


def _envpool(num_envs: int, steps: int) -> Run:
    import envpool
    import numpy as np

    env = envpool.make("Pendulum-v1", env_type="gymnasium", num_envs=num_envs, num_threads=2)
    env.reset()
    return stepping(env, np.random.default_rng(0).uniform(-2, 2, (num_envs, 1)).astype(np.float32), steps)


FORMS: Mapping[str, Mapping[str, Callable[[int, int], Run]]] = {
    "gymnax": {
        "Pendulum, step_env": partial(_gymnax, autoreset=False),
        "Pendulum, step": partial(_gymnax, autoreset=True),
    },
    "gymnasium": {"CartPoleVectorEnv": _cart_pole},
    "envpool": {"Pendulum": _envpool},
}
"""What each peer is asked to run: (num_envs, steps) -> a repeat."""


def serve(name: str) -> None:
    """Answer requests for repeats of a peer's forms."""
    prepared: dict[tuple[Any, ...], Run] = {}

    def repeat(request: Mapping[str, Any]) -> Timing:
        key = (request["form"], request["num_envs"], request["steps"])
        if key not in prepared:
            prepared[key] = FORMS[name][key[0]](*key[1:])
            prepared[key]()
        return timed(prepared[key])

    serve_requests(versions(PINS[name]), repeat)


# --- the side of the benchmark ----------------------------------------------------------------------------------


class Peer(Worker):
    """A peer's process, alive until ``close``."""

    def __init__(self, name: str, folder: Path) -> None:
        super().__init__(name, python_of(name, PINS[name], folder), __file__, SURROUNDINGS[name])
        self.versions: dict[str, str] = self.hello

    def time(self, form: str, num_envs: int, steps: int) -> Timing:
        """One repeat; the first of its kind compiles and runs once before."""
        return Timing(*self.ask(form=form, num_envs=num_envs, steps=steps))


if __name__ == "__main__":
    serve(sys.argv[1])
