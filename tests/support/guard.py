"""Guard of every motion: digests of each method in each scene that it fits, to show that a redesign changed no bit.

``python tests/support/guard.py`` computes them interpreted, in a minute, and names each that differs from
guard.json. ``python tests/support/regenerate.py`` adds those that are not there yet. For a change that is meant, delete
the digest first, so that it shows in the commit. ``same_bits.json`` holds a sample of each method, this all of them, in
each way to run:

=============  =======================================================================================================
motion         every method in every scene that it fits: angle, velocity and the ledger over 50 steps
adaptive       every method that estimates its error, in every scene that it fits without dry friction, with ``rtol``
dense          every method in one scene: dense output, and the times of events
compensated    every method that can be compensated, in one scene
watched        every scene with rk4: tension, and the numbers of the flow where there is a medium
sensors        environments that hold every pair of settings of sensors, delays, tasks and motors
vectors        every method in a vector of three environments
javascript     every method's program, run by Node (left out where Node is missing)
=============  =======================================================================================================

Methods whose torques enter only through Newton's method hide a small error of a derivative; those that use it directly
(force gradients) and the numbers of Newton's iterations, which the ledger's last bits follow, show it.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import gymnasium as gym
import in_node
import numpy as np
from choice import chosen
from same_bits import digest
from sensing_pairs import PAIRS

import integrators
from integrators import MethodError
from integrators.steps.estimates import has_estimates
from pendulum_env import SCENES, Rollout, SceneError, rollout
from pendulum_env.engine.machine import fitting

STORED = Path(__file__).resolve().parents[1] / "guard.json"
STEPS, FEW = 50, 25
"""Numbers of steps of a motion, and of an environment."""
REFUSED = "refused"
"""What stands in place of a digest where a way to run does not suit a method."""


def of_run(run: Rollout, *more: Any) -> str:
    """Return the digest of a run's motion and ledger, and of further arrays."""
    ledger = run.ledger
    heats = [run.heat_by_effect[name] for name in sorted(run.heat_by_effect)]
    return digest(run.angle, run.velocity, ledger.kinetic, ledger.potential, ledger.work, ledger.heat, *heats, *more)


def moved(
    scene: str, method: str, diagnostics: tuple[str, ...] = ("energy", "heat_by_effect"), **options: Any
) -> Rollout:
    """Return an interpreted run of a method in a scene, from the scene's usual start."""
    return rollout(scene, integrator=method, backend="python", duration=STEPS * SCENES[scene].run.dt, seed=7,
                   warn=False, diagnostics=diagnostics, **options)


def between(scene: str, method: str) -> str:
    """Return the digest of dense output at 101 times, and of the events, of a run."""
    run = moved(scene, method, dense=True, events=["turning", "bottom"])
    times = np.linspace(0.0, float(run.time[-1]), 101)
    return of_run(run, *run(times), *run.t_events, *run.angle_events)


def followed(env: Any, action: Callable[[Any], Any]) -> str:
    """Return the digest of observations, rewards, ends and energies of an environment under drawn actions."""
    random, found = np.random.Generator(np.random.PCG64(11)), []
    observation, info = env.reset(seed=9)
    for _ in range(FEW):
        found += [np.asarray(observation, dtype=float).ravel(), [np.sum(info["energy"]), np.sum(info["angle"])]]
        observation, reward, terminated, truncated, info = env.step(action(random.uniform(-1.0, 1.0, 1)))
        found.append(np.concatenate([np.ravel(reward), np.ravel(terminated), np.ravel(truncated)]).astype(float))
        if np.all(terminated) or np.all(truncated):
            break
    env.close()
    return digest(*map(np.asarray, found))


def watched(scene: str) -> str:
    """Return the digest of a run's tension, and of the numbers of its flow."""
    flow = () if SCENES[scene].medium.empty else ("flow",)
    run = moved(scene, "rk4", ("energy", "tension", *flow))
    return of_run(run, *(run.watched[name] for name in sorted(run.watched)))


def vector(scene: str, method: str) -> str:
    env = gym.make_vec("LabPendulum-v0", num_envs=3, scene=scene, integrator=method, backend="python", substeps=2)
    return followed(env, lambda share: np.tile(share.astype(np.float32), (3, 1)))


def sensed(name: str) -> str:
    env = gym.make("LabPendulum-v0", **PAIRS[name])
    return followed(env, lambda share: share.astype(np.float32))


def javascript(methods: Iterable[str]) -> dict[str, str]:
    """Return the digests of programs of methods, each in one scene, run by Node."""
    cases = [in_node.Case(one_scene(method, "javascript"), method) for method in methods]
    with TemporaryDirectory() as folder:
        found = in_node.in_node(cases, 0.01, STEPS, Path(folder))
    return {f"{case.scene}/{case.method}": digest_[:32] for case, (_, digest_) in zip(cases, found, strict=True)}


FITS = {scene: list(fitting(SCENES[scene])) for scene in SCENES}


@cache
def stored() -> dict[str, dict[str, str]]:
    """Return the stored digests by group and sample."""
    kept: dict[str, dict[str, str]] = json.loads(STORED.read_text(encoding="utf-8"))
    return kept


def one_scene(method: str, group: str) -> str:
    """Return the scene in which a group runs a method: the stored one, or for a new method one by its name."""
    for sample in stored().get(group, ()):
        if sample.endswith(f"/{method}"):
            return sample.partition("/")[0]
    return chosen([scene for scene in SCENES if method in FITS[scene]], f"{method} {group}")


def every_pair(methods: Iterable[str]) -> list[str]:
    return [f"{scene}/{method}" for scene in SCENES for method in methods if method in FITS[scene]]


def in_one_scene(group: str) -> list[str]:
    return [f"{one_scene(method, group)}/{method}" for method in integrators.METHODS]


def by_pair(run: Callable[[str, str], str]) -> Callable[[str], str]:
    """Return a function of a sample, ``scene/method``, from one of its scene and method."""
    return lambda sample: run(*sample.split("/"))


GROUPS: dict[str, tuple[Callable[[], list[str]], Callable[[str], str]]] = {
    "motion": (lambda: every_pair(integrators.METHODS), by_pair(lambda scene, method: of_run(moved(scene, method)))),
    "adaptive": (lambda: every_pair([name for name, method in integrators.METHODS.items() if has_estimates(method)]),
                 by_pair(lambda scene, method: of_run(moved(scene, method, rtol=1e-8)))),
    "dense": (lambda: in_one_scene("dense"), by_pair(between)),
    "compensated": (lambda: in_one_scene("compensated"),
                    by_pair(lambda scene, method: of_run(moved(scene, method, compensated=True)))),
    "watched": (lambda: list(SCENES), watched),
    "sensors": (lambda: list(PAIRS), sensed),
    "vectors": (lambda: in_one_scene("vectors"), by_pair(vector)),
}
"""Group -> its samples, and the digest of one."""
EVERY = (*GROUPS, "javascript")
"""All groups; programs for Node are made and run together."""


def found(group: str, part: Callable[[str], bool] = lambda sample: True) -> dict[str, str]:
    """Return the digests of a group by sample, of those samples for which ``part`` is true."""
    if group == "javascript":
        methods = [name for name in integrators.METHODS if part(f"{one_scene(name, group)}/{name}")]
        return javascript(methods) if in_node.NODE else {}
    samples, run = GROUPS[group]
    digests = {}
    for sample in filter(part, samples()):
        try:
            digests[sample] = run(sample)
        except (MethodError, SceneError):
            digests[sample] = REFUSED
    return digests


def with_new() -> dict[str, dict[str, str]]:
    """Return the stored digests with those of new samples; those that are there stay."""
    kept = {group: stored().get(group, {}) for group in EVERY}
    return {group: known | found(group, lambda sample, known=known: sample not in known)  # type: ignore[misc]
            for group, known in kept.items()}


def main() -> int:
    """Compare with the stored digests; return 1 if one differs, is gone or is new."""
    parser = argparse.ArgumentParser(description="Digests of every method in every scene, beside the stored ones.")
    parser.add_argument("groups", nargs="*", help=f"{', '.join(EVERY)}; all by default")
    warnings.simplefilter("ignore")
    different = 0
    for group in parser.parse_args().groups or EVERY:
        begun, known, here = perf_counter(), stored()[group], found(group)
        if not here and group == "javascript":
            print("javascript: left out, as Node is missing")
            continue
        changed = [sample for sample, value in here.items() if known.get(sample, value) != value]
        gone, new = [[each for each in one if each not in other] for one, other in ((known, here), (here, known))]
        different += len(changed) + len(gone) + len(new)
        print(f"{group}: {len(here)} digests, {len(changed)} differ, {len(gone)} are gone, {len(new)} are new, "
              f"{perf_counter() - begun:.0f} s", flush=True)
        for words, samples in (("differs", changed), ("is gone", gone), ("is new", new)):
            print(*(f"  {sample} {words}" for sample in samples[:20]), sep="\n", end="\n" if samples else "")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
