"""Digests of motions, for the same bits on every machine: on each Python, processor and operating system.

``python tests/support/same_bits.py [--all] KIND ...`` prints them as JSON, so that other Pythons and processors
can be asked. The samples are those that same_bits.json names; ``regenerate.py`` adds one of each new method and scene.
For a change of physics or of a method that is meant to alter a digest, delete it there first.
"""

from __future__ import annotations

import argparse
import json
import platform
import warnings
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from pendulum_env import SCENES, Rollout, rollout

STORED = Path(__file__).resolve().parents[1] / "same_bits.json"
STEPS = 200
KEPT: dict[str, dict[str, str]] = json.loads(STORED.read_text(encoding="utf-8"))["digests"]
"""Digests by group and sample, ``scene/method``: each method in one scene that it fits, and rk4 in each scene."""
FEW = ("exercise/rk4", "water/rk4", "kapitza/rk4", "sticky_bearing/velocity_verlet", "overdamped/implicit_midpoint",
       "driven/ab4", "lab/taylor", "textbook/exact")
"""Those that are compiled, a second or two each: a few scenes, and a method of each kind of program."""


def digest(*arrays: Any) -> str:
    """Of arrays' bytes, little-endian float64 or float32."""
    found = sha256()
    for array in arrays:
        values = np.ascontiguousarray(array)
        found.update(values.astype(values.dtype.newbyteorder("<")).tobytes())
    return found.hexdigest()[:32]


def _of(run: Rollout, place: Any = ...) -> str:
    ledger = run.ledger
    kept = (run.angle, run.velocity, ledger.kinetic, ledger.potential, ledger.work, ledger.heat)
    return digest(*(np.asarray(values)[place] for values in kept))


def _single(sample: str, backend: Any, **options: Any) -> Rollout:
    scene, method = sample.split("/")
    return rollout(scene, integrator=method, backend=backend, duration=STEPS * SCENES[scene].run.dt, seed=7, warn=False,
                   **options)


def _batch(sample: str, backend: Any) -> str:
    """Of the third of several runs, of more than a block where they are compiled; the others start elsewhere."""
    angles = SCENES[sample.split("/")[0]].run.angle + 1e-3 * (np.arange(300 if backend == "compiled" else 5) - 2)
    scene, method = sample.split("/")
    return _of(rollout(scene, integrator=method, backend=backend, duration=STEPS * SCENES[scene].run.dt,
                       angle=angles, seed=5, warn=False), 2)


def _followed(sample: str, step: Callable[..., Any], reset: Callable[..., Any], place: Any) -> str:
    """Of 60 control steps under actions of NumPy's generator, from a random start."""
    random, found = np.random.Generator(np.random.PCG64(11)), sha256()
    observation, info = reset()
    for _ in range(60):
        action = random.random(1, dtype=np.float32) * np.float32(2.0) - np.float32(1.0)
        numbers = [float(np.asarray(info[name])[place]) for name in ("angle", "velocity", "energy", "work", "heat")]
        found.update(digest(np.asarray(observation)[place], numbers).encode())
        observation, reward, terminated, _, info = step(action)
        found.update(digest([float(np.asarray(reward)[place])]).encode())
        if np.asarray(terminated)[place]:
            break
    return found.hexdigest()[:32]


def _environment(sample: str, backend: Any) -> str:
    scene, method = sample.split("/")
    env = gym.make("LabPendulum-v0", scene=scene, integrator=method, backend=backend, substeps=4)
    return _followed(sample, env.step, lambda: env.reset(seed=9), ())


def _vector(sample: str, backend: Any) -> str:
    scene, method = sample.split("/")
    env: Any = gym.make_vec("LabPendulum-v0", num_envs=5, scene=scene, integrator=method, backend=backend, substeps=4)
    return _followed(sample, lambda action: env.step(np.tile(action, (5, 1))), lambda: env.reset(seed=7), 2)


Run = Callable[[str], str]

GROUPS: dict[str, dict[str, Run]] = {
    "motion": {
        "interpreted": lambda sample: _of(_single(sample, "python")),
        "compiled": lambda sample: _of(_single(sample, "compiled")),
        "interpreted batch": lambda sample: _batch(sample, "python"),
        "batch": lambda sample: _batch(sample, "compiled"),
    },
    "environment": {
        "environment": lambda sample: _environment(sample, "python"),
        "compiled environment": lambda sample: _environment(sample, "compiled"),
        "vector environment": lambda sample: _vector(sample, "compiled"),
    },
    "compensated": {
        "compensated": lambda sample: _of(_single(sample, "python", compensated=True)),
        "compiled compensated": lambda sample: _of(_single(sample, "compiled", compensated=True)),
    },
    "adaptive": {
        "adaptive": lambda sample: _of(_single(sample, "python", rtol=1e-9)),
        "compiled adaptive": lambda sample: _of(_single(sample, "compiled", rtol=1e-9)),
    },
}
"""By group of digests: the ways to run that must all give them; the first needs no numba."""
KINDS = {kind: group for group, runs in GROUPS.items() for kind in runs}


def found(kind: str, few: bool = True) -> dict[str, str]:
    """Digests by sample, of a few samples or of all."""
    group = KINDS[kind]
    every = not few or group not in ("motion", "environment")
    return {sample: GROUPS[group][kind](sample) for sample in KEPT[group] if every or sample in FEW}


def stored(kind: str) -> dict[str, str]:
    """Those that a way to run must give, by sample."""
    return KEPT[KINDS[kind]]


def machine() -> dict[str, str]:
    """Who answers: Python, numpy, numba and the processor for which it compiles, as far as they are there."""
    about = {"python": platform.python_version(), "numpy": np.__version__,
             "machine": f"{platform.system()} {platform.machine()}"}
    try:
        import numba
        from numba.core.registry import cpu_target
    except ImportError:
        return about
    processor = cpu_target.target_context.codegen().magic_tuple()[1]
    return {**about, "numba": numba.__version__, "processor": str(processor)}


def main() -> None:
    """Print the digests that the arguments ask for."""
    parser = argparse.ArgumentParser(description="Digests of motions as JSON.")
    parser.add_argument("--all", action="store_true", help="of all samples, not of a few")
    parser.add_argument("kinds", nargs="*", help=", ".join(KINDS))
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    print(json.dumps({"machine": machine(), "found": {kind: found(kind, not asked.all) for kind in asked.kinds}}))


if __name__ == "__main__":
    main()
