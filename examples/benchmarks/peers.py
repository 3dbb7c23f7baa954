"""Other people's environments, to be timed beside this package's: each in a venv and a process of its own.

Imported, it makes the venvs and speaks to the processes. Run by a venv's Python as ``peers.py NAME`` it is such a
process: it reads requests, one JSON line each, answers each with one timed repeat, and idles in between.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import time
import venv
from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import IO, Any, NamedTuple

PINS: Mapping[str, tuple[str, ...]] = {
    # gymnax 1.0.1 takes jax 0.6 to 0.11. 0.6.2 is its fastest: 24 ns a step on 2 cores, where 0.7.2 to 0.10.2 take 34.
    # It needs six without saying so.
    "gymnax": ("gymnax==1.0.1", "jax==0.6.2", "jaxlib==0.6.2", "numpy==2.2.6", "six==1.17.0"),
    "gymnasium": ("gymnasium==1.4.0", "numpy==2.2.6"),
    "envpool": ("envpool==1.2.5", "gymnasium==1.4.0", "numpy==2.2.6"),
}
"""What each venv holds, for Python 3.10 to 3.13."""

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
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
    """Answer requests until stdin closes. Only answers go to stdout: what libraries print goes to stderr."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    packages = [pin.split("==")[0] for pin in PINS[name]]
    print(json.dumps({package: version(package) for package in packages}), file=answers)
    prepared: dict[tuple[Any, ...], Run] = {}
    for line in sys.stdin:
        request = json.loads(line)
        key = (request["form"], request["num_envs"], request["steps"])
        if key not in prepared:
            prepared[key] = FORMS[name][key[0]](*key[1:])
            prepared[key]()
        print(json.dumps(timed(prepared[key])), file=answers)


# --- the side of the benchmark ----------------------------------------------------------------------------------


def python_of(name: str, folder: Path) -> Path:
    """Python of a peer's venv in ``folder``, made if it is not there yet."""
    pins = PINS[name]
    tag = hashlib.sha256(" ".join((sys.version, *pins)).encode()).hexdigest()[:8]
    home = folder.absolute() / f"{name}-{tag}"
    python = home / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    finished = home / "finished"
    if not finished.exists():
        print(f"making {home} with {', '.join(pins)}", flush=True)
        venv.create(home, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *pins], check=True)
        finished.touch()
    return python


class Peer:
    """A peer's process, alive until ``close``."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name = name
        outside = {key: value for key, value in os.environ.items() if key not in ONE_THREAD}
        self._process = subprocess.Popen(
            [python_of(name, folder), "-W", "ignore", __file__, name],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env={**outside, **SURROUNDINGS[name]},
        )  # fmt: skip
        self.versions: dict[str, str] = self._answer()

    def time(self, form: str, num_envs: int, steps: int) -> Timing:
        """One repeat; the first of its kind compiles and runs once before."""
        requests: IO[str] = self._process.stdin  # type: ignore[assignment]
        requests.write(json.dumps({"form": form, "num_envs": num_envs, "steps": steps}) + "\n")
        requests.flush()
        return Timing(*self._answer())

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def _answer(self) -> Any:
        answers: IO[str] = self._process.stdout  # type: ignore[assignment]
        line = answers.readline()
        if not line:
            raise RuntimeError(f"The process of {self.name} ended with {self._process.wait()} and gave no answer.")
        return json.loads(line)


if __name__ == "__main__":
    serve(sys.argv[1])
