"""Property tests with random scenes, methods, steps, starts and actions.

Numbers stay finite or the run gives a stop reason, the energy balance closes, residuals agree with the method's order,
observations are in their space, and mirrored runs are mirror images.
"""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from drawn_scenes import scenes
from fuzz import ENDLESS, Drawn, actions, check_ledger, drawn, most_residual, own_rate
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from pendulum_env import LabPendulumVectorEnv, Scene, rollout
from pendulum_env.engine.each import Each
from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.energy import ABSURD

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

ENVS, STEPS = 5120, 40
"""Numbers of environments and of control steps of each compiled configuration."""
COMPILED = 5
"""Number of compiled configurations, with at least 1e6 environment steps in all."""
FEW, MANY = 6, 150
"""Numbers of interpreted configurations, in quick and in slow tests."""
ONE_SIDED = {"wind", "gusts", "periodic_torque", "horizontal_drive", "vertical_drive"}
"""Effects that break the mirror symmetry, or depend on time."""
SPREAD = 3.0
"""Largest factor on a scene's rates by parameters that vary among environments."""
SHARES = st.sampled_from([-1.0, 0.0, 1.0]) | st.floats(-1.0, 1.0)


# --- runs -----------------------------------------------------------------------------------------------------------




def check_run(
    scene: Scene, source: random.Random, power: float, angle: float, velocity: float, control: float
) -> None:
    """Assert that a run is finite, its energy balance closes, and its residual is within the method's order."""
    method, dt = source.choice(list(fitting(scene).values())), 10.0**power
    found = rollout(scene, integrator=method, dt=dt, duration=12 * dt, angle=angle, velocity=velocity, control=control,
                    backend="python", warn=False)
    ledger, steps = found.ledger, np.arange(len(found.time))
    every = {"energy": found.energy, "work": np.asarray(ledger.work), "heat": np.asarray(ledger.heat),
             "energy_residual": found.energy_residual}
    for values in (found.time, found.angle, found.velocity, *every.values()):
        assert np.all(np.isfinite(values))
    assert found.stop_reason in ("", "diverged", "slack")
    assert len(found.time) == 13 or found.stop_reason
    check_ledger(every, np.full(len(steps), found.energy[0]), slice(None))
    if found.stop_reason != "diverged":
        speed = np.maximum.accumulate(np.abs(found.velocity))
        change = np.maximum.accumulate(np.abs(np.diff(found.velocity, prepend=found.velocity[0])) / dt)
        energies = scene.gravity * abs(scene.weight_moment) + sum(
            np.maximum.accumulate(np.abs(every[name])) for name in ("energy", "work", "heat"))
        most = most_residual(scene, method, steps, dt, own_rate(scene), scene.inertia, speed, change, energies)
        assert np.all(np.abs(found.energy_residual) <= most)
        assert np.all(every["heat"] >= -most)


def check_mirror(
    scene: Scene, source: random.Random, power: float, angle: float, velocity: float, control: float
) -> None:
    """Assert that a mirrored run is mirrored to the last bit, since sine and rounding are odd."""
    assume(not ONE_SIDED & {effect.name for effect in scene.effects})
    method, dt = source.choice(list(fitting(scene).values())), 10.0**power
    one, other = (rollout(scene, integrator=method, dt=dt, duration=12 * dt, angle=side * angle,
                          velocity=side * velocity, control=side * control, backend="python", warn=False)
                  for side in (1.0, -1.0))
    assert one.stop_reason == other.stop_reason
    assert np.array_equal(one.angle, -other.angle)
    assert np.array_equal(one.velocity, -other.velocity)
    assert np.array_equal(one.energy_residual, other.energy_residual)


RUNS = (scenes(), st.randoms(use_true_random=False), st.floats(-4.0, 0.0), st.floats(-20.0, 20.0),
        st.floats(-20.0, 20.0), SHARES)


@pytest.mark.quick("12-check_run")
@pytest.mark.parametrize("check", [check_run, check_mirror])
@pytest.mark.parametrize("examples", [12, pytest.param(150, marks=pytest.mark.slow)])
def test_any_run(check: Callable[..., None], examples: int) -> None:
    settings(max_examples=examples)(given(*RUNS)(check))()


# --- environments ---------------------------------------------------------------------------------------------------


def lived(found: Drawn, size: int, steps: int, backend: Backend, seed: int) -> int:
    """Step ``size`` environments with random actions, check all results, and return the number of episodes that ended.
    """
    source = np.random.default_rng(seed)
    varied = {name: value * 2.0 ** source.uniform(-0.5, 0.5, size) for name, value in found.keywords.items()
              if name in ("length", "mass", "gravity", "radius", "gamma", "max_torque") and source.random() < 0.5}
    env = LabPendulumVectorEnv(
        size, **{**found.keywords, **varied}, backend=backend, max_episode_steps=[None, 3, 20][seed % 3],
        autoreset_mode=["NextStep", "SameStep", "Disabled"][seed % 3 if size > 2 else 0],
    )
    numbers = Each(found.scene, "scene", None, varied, size).numbers
    scale, inertia = (np.broadcast_to(numbers[name], size) for name in ("scale", "inertia"))
    observation, info = env.reset(seed=seed)
    initial, taken = info["energy"].copy(), np.zeros(size)
    speed, change, energies, begun = np.zeros(size), np.zeros(size), np.zeros(size), size
    before = info["velocity"].copy()
    alive, rate = np.ones(size, dtype=bool), SPREAD * own_rate(found.scene)

    def start(which: Any, info: Any) -> None:
        initial[which], before[which] = info["energy"][which], info["velocity"][which]
        for values in (taken, speed, change, energies):
            values[which] = 0.0

    for _ in range(steps):
        if env.autoreset_mode.value == "Disabled" and not alive.all():
            at = source.uniform(-9.0, 9.0, size)
            _, info = env.reset(options={"reset_mask": ~alive, "angle": at})
            start(~alive, info)
            begun += int((~alive).sum())
        observation, reward, ended, late, info = env.step(actions(source, size))
        last = info.get("final_info", {})
        anew = info["time"] == 0.0
        begun += int(anew.sum())
        start(anew, info)
        taken[~anew] += env.substeps
        assert env.observation_space.contains(observation)
        assert np.all(np.isfinite(reward))
        for said in (info, last):
            for name, values in said.items():
                if values.__class__ is np.ndarray and values.dtype.kind == "f":
                    assert np.all(np.isfinite(values)) or (name in ENDLESS and not np.isnan(values).any()), name
        check_ledger(info, initial, slice(None))
        reasons = info.get("stop_reason", last.get("stop_reason", np.full(size, None)))
        change = np.maximum(change, np.abs(info["velocity"] - before) / env.dt)
        speed, before = np.maximum(speed, np.abs(info["velocity"])), info["velocity"].copy()
        energies = np.maximum(energies, sum(abs(info[name]) for name in ("energy", "work", "heat")))
        most = most_residual(found.scene, found.method, taken, env.dt / env.substeps, rate, inertia, speed, change,
                             energies + scale)
        diverged, residual = reasons == "diverged", np.abs(info["energy_residual"])
        assert np.all((residual <= most) | diverged)
        assert np.all((residual <= ABSURD * (scale + abs(initial) + abs(info["work"]))) | diverged)
        assert np.all((info["heat"] >= -most) | diverged)
        alive = ~(ended | late)
    env.close()
    return begun


def fuzzed(count: int, size: int, steps: int, backend: Backend, begin: int = 0) -> tuple[int, int]:
    """Run random configurations; return the numbers of environment steps and of episodes."""
    total = episodes = 0
    for seed in range(begin, begin + count):
        found = drawn(random.Random(seed))
        try:
            episodes += lived(found, size, steps, backend, seed)
        except Exception as error:
            raise AssertionError(f"configuration {seed}: {found}: {error}") from error
        total += size * steps
    print(f"\n{total} steps of environments, {episodes} episodes, {count} configurations, {backend}")
    return total, episodes


@pytest.mark.slow
def test_configurations_at_random() -> None:
    fuzzed(FEW, 3, 8, "python")


@pytest.mark.slow
def test_many_configurations_at_random() -> None:
    assert fuzzed(MANY, 3, 12, "python")[0] == MANY * 3 * 12


@pytest.mark.slow
def test_a_million_steps_of_few_configurations() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        total, episodes = fuzzed(COMPILED, ENVS, STEPS, "compiled", begin=1000)
    assert total >= 10**6
    assert episodes > ENVS * COMPILED
