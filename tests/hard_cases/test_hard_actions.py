"""The hard cases of actions, run through the environment and the vector environment."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from choice import kind

import integrators
from integrators import Method
from pendulum_env.engine.machine import fitting
from pendulum_env.envs.env import LabPendulumEnv
from pendulum_env.envs.vector_env import LabPendulumVectorEnv
from pendulum_env.hard_cases.actions import CASES, START, Motored, attempts, hold
from pendulum_env.hard_cases.fast_drive import PUSHED

COPIES = 3
OMEGA0 = PUSHED.omega0


class Environment:
    """Agent that takes control steps in a single environment."""

    kind: Any = LabPendulumEnv

    def __init__(self, method: Method, phase: float, **options: Any) -> None:
        self.hold = hold(method, phase)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            self.env = self.kind(scene=PUSHED, integrator=method, dt=phase / OMEGA0, substeps=self.hold, task="free",
                                 backend="python", **options)
        self.env.reset(seed=0, options={"angle": START, "velocity": 0.0})

    def act(self, action: Any) -> tuple[float, float]:
        observation, reward, terminated, truncated, info = self.env.step(action)
        assert self.env.observation_space.contains(observation)
        assert (reward, terminated, truncated) == (0.0, False, False)
        return info["angle"], info["velocity"] / OMEGA0


class Vector(Environment):
    """Agent that steps three identical environments in a vector, which must stay identical."""

    kind = LabPendulumVectorEnv

    def __init__(self, method: Method, phase: float) -> None:
        super().__init__(method, phase, num_envs=COPIES)

    def act(self, action: Any) -> tuple[float, float]:
        _, _, terminated, truncated, info = self.env.step(np.repeat(action[None, :], COPIES, axis=0))
        assert not np.any(terminated | truncated)
        assert np.ptp(info["angle"]) == np.ptp(info["velocity"]) == 0.0
        return float(info["angle"][0]), float(info["velocity"][0]) / OMEGA0


METHODS = [pytest.param(name, marks=() if name in ("rk4", "velocity_verlet") else pytest.mark.slow)
           for name in fitting(PUSHED)]


PAIRS = [*(pytest.param(Environment, *name.values, marks=name.marks) for name in METHODS
           if name.marks == () or kind(str(name.values[0])) == name.values[0]),
         (Vector, "rk4"), (Vector, "velocity_verlet")]
"""Every kind of method: that each steps in the environment as in the study, the next test shows."""


@pytest.mark.quick(
    "Environment-velocity_verlet-NaN", "Environment-velocity_verlet-bang-bang", "Environment-velocity_verlet-1e308"
)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
@pytest.mark.parametrize(("agent", "method"), PAIRS)
def test_actions_have_their_outcome_in_environments(agent: Any, case: Any, method: str) -> None:
    chosen = integrators.get(method)
    finding = attempts(agent)[case.name](chosen)
    assert case.as_expected(chosen, finding), finding


@pytest.mark.parametrize("method", METHODS)
def test_the_study_steps_as_the_environment_does(method: str) -> None:
    chosen = integrators.get(method)
    agents = [kind(chosen, 0.1) for kind in (Motored, Environment, Vector)]
    for share in (1.0, -0.3, 2.0, 0.7):
        first, *others = (agent.act(np.array([share])) for agent in agents)
        assert others == [first, first]


def test_one_bad_action_of_a_vector_is_named_and_moves_nobody() -> None:
    vector = Vector(integrators.get("rk4"), 0.1)
    actions = np.array([[0.5], [np.nan], [np.inf]])
    with pytest.raises(ValueError, match="those of the environments 1, 2 are not"):
        vector.env.step(actions)
    assert vector.act(np.array([0.5])) == Vector(integrators.get("rk4"), 0.1).act(np.array([0.5]))
