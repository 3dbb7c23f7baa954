"""Digests of motions, for the same bits on every machine: on each Python, processor and operating system.

``python tests/support/same_bits.py [--all] KIND ...`` prints them as JSON, so that other Pythons and processors
can be asked; ``--write`` makes same_bits.json anew, for a change of physics or of a method that is meant to alter them.
"""

from __future__ import annotations

import argparse
import json
import platform
import warnings
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import integrators
from pendulum_env import SCENES, Rollout, rollout
from pendulum_env.engine.machine import fitting

STORED = Path(__file__).resolve().parents[1] / "same_bits.json"
FITS = {name: set(fitting(scene)) for name, scene in SCENES.items()}
ADAPTIVE = "dop853"
STEPS = 200


def _samples() -> Iterator[str]:
    """Every method in one scene that it fits, in turn, and rk4 in every scene."""
    names = list(SCENES)
    for i, method in enumerate(integrators.METHODS):
        if method != "rk4":
            yield f"{next(name for name in names[i % len(names):] + names if method in FITS[name])}/{method}"
    yield from (f"{name}/rk4" for name in names)


SAMPLES = tuple(_samples())
FEW = tuple(sample for sample in SAMPLES if sample.endswith("/rk4"))[2::4] + tuple(
    next(sample for sample in SAMPLES if sample.endswith(f"/{method}"))
    for method in ("velocity_verlet", "implicit_midpoint", "ab4", "taylor", "exact"))
"""Those that are compiled, a second or two each: every fourth scene, and a method of each kind of program."""
SMOOTH = ("vacuum/dop853", "lab/dopri5", "driven/bogacki_shampine", "vacuum/rkn43")
CONSERVED = ("vacuum/rk4", "textbook/velocity_verlet", "driven/gauss4")


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

GROUPS: dict[str, tuple[tuple[str, ...], dict[str, Run]]] = {
    "motion": (SAMPLES, {
        "interpreted": lambda sample: _of(_single(sample, "python")),
        "compiled": lambda sample: _of(_single(sample, "compiled")),
        "interpreted batch": lambda sample: _batch(sample, "python"),
        "batch": lambda sample: _batch(sample, "compiled"),
    }),
    "environment": (SAMPLES, {
        "environment": lambda sample: _environment(sample, "python"),
        "compiled environment": lambda sample: _environment(sample, "compiled"),
        "vector environment": lambda sample: _vector(sample, "compiled"),
    }),
    "compensated": (CONSERVED, {
        "compensated": lambda sample: _of(_single(sample, "python", compensated=True)),
        "compiled compensated": lambda sample: _of(_single(sample, "compiled", compensated=True)),
    }),
    "adaptive": (SMOOTH, {
        "adaptive": lambda sample: _of(_single(sample, "python", rtol=1e-9)),
        "compiled adaptive": lambda sample: _of(_single(sample, "compiled", rtol=1e-9)),
    }),
}
"""What is kept a digest of: for which samples, and the ways to run that must all give it; the first needs no numba."""
KINDS = {kind: group for group, (_, runs) in GROUPS.items() for kind in runs}


def found(kind: str, few: bool = True) -> dict[str, str]:
    """Digests by sample, of a few samples or of all."""
    samples, runs = GROUPS[KINDS[kind]]
    return {sample: runs[kind](sample) for sample in samples if not few or samples is not SAMPLES or sample in FEW}


def stored(kind: str) -> dict[str, str]:
    """Those that a way to run must give, by sample."""
    kept: dict[str, str] = json.loads(STORED.read_text(encoding="utf-8"))["digests"][KINDS[kind]]
    return kept


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
    """Print, or write, what the arguments ask for."""
    parser = argparse.ArgumentParser(description="Digests of motions as JSON.")
    parser.add_argument("--all", action="store_true", help="of all samples, not of a few")
    parser.add_argument("--write", action="store_true", help="make same_bits.json anew, from interpreted runs")
    parser.add_argument("kinds", nargs="*", help=", ".join(KINDS))
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    if asked.write:
        digests = {group: found(next(iter(runs)), few=False) for group, (_, runs) in GROUPS.items()}
        about = "Digests of motions, scene/method, by tests/support/same_bits.py; the same on every machine."
        STORED.write_text(json.dumps({"about": about, "made_on": machine(), "digests": digests}, indent=1) + "\n",
                          encoding="utf-8")
    else:
        print(json.dumps({"machine": machine(), "found": {kind: found(kind, not asked.all) for kind in asked.kinds}}))


if __name__ == "__main__":
    main()
