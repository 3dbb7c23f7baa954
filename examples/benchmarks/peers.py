"""Environments of other packages (peers) for comparison, each in its own venv and process.

A benchmark imports this module to communicate with the processes. A process runs it with a venv's Python as
``peers.py NAME``, see :mod:`venvs`, and answers each request with one timed repeat.
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
    # It needs six but does not declare it.
    "gymnax": ("gymnax==1.0.1", "jax==0.6.2", "jaxlib==0.6.2", "numpy==2.2.6", "six==1.17.0"),
    "gymnasium": ("gymnasium==1.4.0", "numpy==2.2.6"),
    "envpool": ("envpool==1.2.5", "gymnasium==1.4.0", "numpy==2.2.6"),
}
"""Packages in the venv of each peer, for Python 3.10 to 3.13."""

SURROUNDINGS: Mapping[str, Mapping[str, str]] = {
    "gymnax": {"JAX_PLATFORMS": "cpu"},
    "gymnasium": ONE_THREAD,
    "envpool": ONE_THREAD,
}
"""Environment variables of each process; XLA uses its default, one thread per core."""

EPISODE = 200
"""Steps per episode of gymnax's Pendulum."""

Run = Callable[[], object]


class Timing(NamedTuple):
    """Timing of one repeat: wall time and processor time of all threads [s]."""

    wall: float
    cpu: float


def timed(run: Run) -> Timing:
    """Run a function once and return its timing."""
    cpu, wall = time.process_time(), time.perf_counter()
    run()
    return Timing(time.perf_counter() - wall, time.process_time() - cpu)


def stepping(env: Any, actions: Any, steps: int) -> Run:
    """Return a function that takes ``steps`` steps of a vector environment with constant actions and autoreset."""

    def run() -> None:
        step = env.step
        for _ in range(steps):
            step(actions)

    return run


# --- the process of a peer --------------------------------------------------------------------------------------


def _gymnax(num_envs: int, steps: int, *, autoreset: bool) -> Run:
    """Return a repeat of gymnax's Pendulum-v1 in one jitted scan, in float32 with a constant action.

    Observations and summed rewards are computed. ``autoreset`` uses ``step`` with a key per environment and step, as
    documented. Without it, ``step_env`` is used with one reset of all environments between episodes, which is possible
    because all episodes have EPISODE steps.
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
"""Peer -> name of a way to run it -> function of (num_envs, steps) that returns a repeat."""


def serve(name: str) -> None:
    """Serve requests for timed repeats of one peer until stdin closes."""
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
    """Process of a peer, which runs until ``close``."""

    def __init__(self, name: str, folder: Path) -> None:
        super().__init__(name, python_of(name, PINS[name], folder), __file__, SURROUNDINGS[name])
        self.versions: dict[str, str] = self.hello

    def time(self, form: str, num_envs: int, steps: int) -> Timing:
        """Return the timing of one repeat; the first repeat of a form is preceded by an untimed one."""
        return Timing(*self.ask(form=form, num_envs=num_envs, steps=steps))


if __name__ == "__main__":
    serve(sys.argv[1])
