"""Tests of environments under random sequences of calls: reset, step, render, copy, saved states, close and reopen.

The model is an environment that is never rendered, copied or restored, and takes the same resets and actions (from the
beginning, where a state was restored). Results of both have to be equal, bit for bit.
"""

from __future__ import annotations

import copy
import json
import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    Bundle,
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from pendulum_env import LabPendulumEnv, LabPendulumVectorEnv, SceneError
from pendulum_env.tasks.action import ActionError

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

LIVES: tuple[dict[str, Any], ...] = (
    {"scene": "lab", "task": "balance", "diagnostics": ("energy", "heat_by_effect", "tension", "flow")},
    {"scene": "sticky_bearing", "integrator": "velocity_verlet", "substeps": 2},
    {"scene": "windy", "integrator": "heun", "diagnostics": ("energy", "flow")},
    {"scene": "windy", "max_torque": 0.02, "lag": 0.1, "integrator": "ab3", "substeps": 5, "task": "free"},
    {"scene": "exercise_large", "slack": "warn", "task": "free", "compensated": True},
    {"scene": "lab", "integrator": "dopri5", "rtol": 1e-6, "diagnostics": ()},
    {"scene": "driven", "integrator": "gauss4", "diagnostics": ("energy", "error"), "task": "free"},
    {"scene": "lab", "integrator": "forward_euler", "dt": 0.3, "speed_limit": math.inf},
)
"""Settings of environments, one for each kind of state."""
USUAL: dict[str, Any] = {"backend": "python", "render_mode": "rgb_array", "render_size": 50}

ACTIONS = st.sampled_from([-1.0, 0.0, 1.0, 0.3, 1e308, -1e308, 5e-324]) | st.floats(-1.0, 1.0)
SEEDS = st.none() | st.integers(0, 2**64)
STARTS = st.none() | st.fixed_dictionaries(
    {}, optional={"angle": st.floats(-7.0, 7.0), "velocity": st.floats(-9.0, 9.0)})
Call = tuple[str, Any]


def told(found: Any) -> Any:
    """Return the result of a reset or a step in a form that can be compared."""
    return [part.tobytes() if isinstance(part, np.ndarray) else part for part in found]


def do(env: LabPendulumEnv, call: Call) -> Any:
    kind, given = call
    return told(env.reset(**given) if kind == "reset" else env.step(np.array([given])))


class Life(RuleBasedStateMachine):
    """State machine that compares one environment with its model."""

    kept = Bundle("kept")

    @initialize(life=st.sampled_from(LIVES), seed=st.integers(0, 2**32), start=STARTS)
    def begin(self, life: dict[str, Any], seed: int, start: Any) -> None:
        self.life, self.calls = life, list[Call]()
        self.env, self.model = LabPendulumEnv(**USUAL, **life), LabPendulumEnv(**USUAL, **life)
        self.both(("reset", {"seed": seed, "options": start}))

    def both(self, call: Call) -> None:
        self.calls.append(call)
        found, wanted = do(self.env, call), do(self.model, call)
        assert found == wanted
        seen = np.frombuffer(found[0], dtype=np.float32)
        assert self.env.observation_space.contains(seen)
        assert all(isinstance(value, str) or not math.isnan(value) for value in found[-1].values())

    @rule(seed=SEEDS, start=STARTS)
    def reset(self, seed: int | None, start: Any) -> None:
        self.both(("reset", {"seed": seed, "options": start}))

    @rule(actions=st.lists(ACTIONS, min_size=1, max_size=4))
    def step(self, actions: list[float]) -> None:
        for action in actions:
            self.both(("step", action))

    @rule()
    def render(self) -> None:
        first, second = self.env.render(), self.env.render()
        assert first is not None
        assert second is not None
        assert first is not second
        assert first.tobytes() == second.tobytes()

    @rule(action=st.sampled_from([math.nan, math.inf, -math.inf, 1j]))
    def act_badly(self, action: Any) -> None:
        with pytest.raises(ActionError):
            self.env.step(np.array([action]))

    @rule(seed=st.sampled_from([3, -1, "x", True]), angle=st.sampled_from([math.nan, math.inf, 1e300, "x", None]))
    def reset_badly(self, seed: Any, angle: Any) -> None:
        with pytest.raises(SceneError):
            self.env.reset(seed=seed, options={"angle": angle})

    @rule()
    def pickle(self) -> None:
        self.env = pickle.loads(pickle.dumps(self.env))

    @rule()
    def deepcopy(self) -> None:
        old, self.env = self.env, copy.deepcopy(self.env)
        old.step(np.array([1.0]))
        old.close()

    @rule(through=st.sampled_from([lambda state: state, copy.deepcopy, lambda state: json.loads(json.dumps(state))]))
    def close_and_open_again(self, through: Any) -> None:
        saved = through(self.env.get_state())
        self.env.close()
        self.env.close()
        self.env = LabPendulumEnv(**USUAL, **self.life)
        self.env.set_state(saved)

    @rule(target=kept)
    def keep(self) -> Any:
        return self.life, self.env.get_state(), pickle.dumps(self.env), tuple(self.calls)

    @rule(kept=kept, by_state=st.booleans())
    def restore(self, kept: Any, by_state: bool) -> None:
        _, state, pickled, calls = kept
        if by_state:
            self.env.set_state(state)
        else:
            self.env = pickle.loads(pickled)
        self.model, self.calls = LabPendulumEnv(**USUAL, **self.life), list(calls)
        for call in calls:
            do(self.model, call)

    @rule(spoil=st.sampled_from([{}, {"state": [1.0]}, {"random": {}}, {"action": math.nan}, {"made_for": {}}]))
    def restore_badly(self, spoil: dict[str, Any]) -> None:
        with pytest.raises(SceneError):
            self.env.set_state({**self.env.get_state(), **spoil} if spoil else {})

    @invariant()
    @precondition(lambda self: hasattr(self, "env"))
    def states_are_alike(self) -> None:
        assert self.env.get_state() == self.model.get_state()


class VectorLife(RuleBasedStateMachine):
    """State machine that compares a vector environment with a model that is never rendered or copied."""

    @initialize(mode=st.sampled_from(["NextStep", "SameStep"]), most=st.sampled_from([None, 1, 3]),
                seed=st.integers(0, 99), life=st.sampled_from(LIVES))
    def begin(self, mode: str, most: int | None, seed: int, life: dict[str, Any]) -> None:
        made = {**USUAL, **life, "num_envs": 3, "autoreset_mode": mode, "max_episode_steps": most}
        self.env, self.model = LabPendulumVectorEnv(**made), LabPendulumVectorEnv(**made)
        self.same("reset", seed=seed)

    def same(self, name: str, **given: Any) -> None:
        found, wanted = (getattr(env, name)(**given) for env in (self.env, self.model))
        assert [part.tobytes() for part in found[:-1]] == [part.tobytes() for part in wanted[:-1]]
        assert found[-1].keys() == wanted[-1].keys()
        for key, value in found[-1].items():
            if value.__class__ is np.ndarray and value.dtype != object:
                assert value.tobytes() == wanted[-1][key].tobytes()
        assert self.env.observation_space.contains(found[0])

    @rule(seed=SEEDS)
    def reset(self, seed: int | None) -> None:
        self.same("reset", seed=None if seed is None else seed % 2**63)

    @rule(mask=st.lists(st.booleans(), min_size=3, max_size=3).filter(any), angle=st.floats(-7.0, 7.0))
    def reset_some(self, mask: list[bool], angle: float) -> None:
        self.same("reset", options={"reset_mask": np.array(mask), "angle": angle})

    @rule(actions=st.lists(ACTIONS, min_size=3, max_size=3))
    def step(self, actions: list[float]) -> None:
        self.same("step", actions=np.array(actions)[:, None])

    @rule()
    def render(self) -> None:
        frames, again = self.env.render(), self.env.render()
        assert frames is not None
        assert again is not None
        assert [frame.tobytes() for frame in frames] == [frame.tobytes() for frame in again]

    @rule(how=st.sampled_from([copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))]))
    def copied(self, how: Any) -> None:
        old, self.env = self.env, how(self.env)
        old.step(np.ones((3, 1)))
        old.close()


def lived(machine: type[RuleBasedStateMachine], lives: int, steps: int) -> None:
    run_state_machine_as_test(machine, settings=settings(
        max_examples=lives, stateful_step_count=steps, deadline=None, derandomize=True,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much]))


@pytest.mark.quick("VectorLife-6")
@pytest.mark.parametrize(("machine", "lives"), [(Life, 12), (VectorLife, 6)])
def test_any_order_of_calls(machine: type[RuleBasedStateMachine], lives: int) -> None:
    lived(machine, lives, 12)


@pytest.mark.slow
@pytest.mark.parametrize("machine", [Life, VectorLife])
def test_many_lives(machine: type[RuleBasedStateMachine]) -> None:
    lived(machine, 80, 40)
