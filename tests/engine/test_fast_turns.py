"""Tests of the warnings of steps that turn the rod by more than half a turn: before a run, during it and after it."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import pendulum_env  # noqa: F401
from pendulum_env import SCENES, SceneError, rollout
from pendulum_env.engine.limits import PART
from pendulum_env.engine.machine import fitting

H = 0.01
TURN = 2.0 * math.pi / H
"""Velocity at which a step of H turns the rod by a whole turn [rad/s]."""
FITTING = tuple(fitting(SCENES["vacuum"]))


def said(call: Callable[[], object]) -> list[str]:
    """Return the warnings of too far a turn that a call emits."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    return [str(warning.message) for warning in caught if "turns the rod" in str(warning.message)]


def run(velocity: Any, **options: Any) -> Callable[[], object]:
    return lambda: rollout(**{"scene": "vacuum", "angle": 0.0, "velocity": velocity, "dt": H, "duration": 2 * H,
                              "backend": "python", **options})


@pytest.mark.parametrize("method", FITTING)
def test_a_whole_turn_per_step_is_warned_of_with_every_method(method: str) -> None:
    """Check that only an exact method, which has no error at such steps, is not warned of."""
    (*sentences,) = said(run(TURN, integrator=method))
    assert len(sentences) == (method != "exact")
    assert all("1.00 turns" in sentence for sentence in sentences)


def test_the_limit_is_half_a_turn_at_the_bottom_and_the_remedy_keeps_it() -> None:
    """Check the limit against v² = v0² + 2 omega0² (1 - cos(angle)), and the recommended step."""
    omega0, limit = SCENES["vacuum"].omega0, PART * TURN
    for angle in (0.0, 2.0):
        start = math.sqrt(limit**2 - 2.0 * omega0**2 * (1.0 - math.cos(angle)))
        for sign in (1.0, -1.0):
            assert not said(run(sign * 0.999 * start, angle=angle))
            assert len(said(run(sign * 1.001 * start, angle=angle))) == 1
    (sentence,) = said(run(3.0 * TURN))
    shorter = re.search(r"steps of (\S+) s or less", sentence)
    assert shorter is not None
    assert not said(run(3.0 * TURN, dt=float(shorter[1])))


def test_a_batch_is_warned_of_its_fastest_run_once() -> None:
    assert len(said(run([0.0, TURN, -2.0 * TURN]))) == 1
    assert not said(run([0.0, 0.4 * TURN]))


def test_no_warning_without_a_torque_that_changes_with_the_angle_or_with_tolerances_or_on_demand() -> None:
    for scene in (SCENES["textbook"], SCENES["vacuum"].replace(effects=())):
        assert not said(run(TURN, scene=scene))
    assert not said(run(TURN, integrator="dop853", rtol=1e-6))
    assert not said(run(TURN, warn=False))
    with pytest.raises(SceneError, match="turns the rod"):
        run(TURN, careful=True)()


DRIVEN: dict[str, Any] = {"scene": "lab", "max_torque": 20.0}
"""A motor that turns the rod, from rest, by more than half a turn per step within two seconds."""


@pytest.mark.parametrize("angle", [0.0, [0.0, 0.1]])
def test_a_run_that_gets_too_fast_is_warned_of_afterwards(angle: Any) -> None:
    options: dict[str, Any] = {**DRIVEN, "angle": angle, "velocity": 0.0, "dt": H, "duration": 2.0, "backend": "python"}
    (sentence,) = said(lambda: rollout(**options, control=1.0))
    assert "the run has reached" in sentence
    assert not said(lambda: rollout(**options, control=1.0, warn=False))
    assert not said(lambda: rollout(**options, control=0.01))


@pytest.mark.parametrize("size", [0, 2])
def test_an_environment_that_gets_too_fast_warns_once(size: int) -> None:
    keywords: dict[str, Any] = {**DRIVEN, "task": "free", "backend": "python", "speed_limit": 1e9}
    full = np.ones((size, 1) if size else (1,), dtype=np.float32)
    for share, wanted in ((1.0, 1), (0.001, 0)):
        env = gym.make_vec("LabPendulum-v0", num_envs=size, **keywords) if size else gym.make(
            "LabPendulum-v0", **keywords)

        def play(env: Any = env, action: Any = share * full) -> None:
            for _ in range(2):
                env.reset(seed=1)
                for _ in range(100):
                    env.step(action)

        assert len(said(play)) == wanted
