"""Tests of the diagnostic "error": estimates compared with scipy under random torques, in vectors, states and copies.
"""

from __future__ import annotations

import copy
import json
import math
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import integrators
import pendulum_env  # noqa: F401
from pendulum_env import SCENES, SceneError, rollout
from pendulum_env.engine import pendulums
from pendulum_env.engine.generate import program


def made(**options: Any) -> Any:
    return gym.make("LabPendulum-v0", **{"diagnostics": ("energy", "error"), "backend": "python", **options}).unwrapped


def played(env: Any, steps: int, seed: int = 0) -> list[dict[str, Any]]:
    actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, 1)).astype(np.float32)
    return [env.step(action)[4] for action in actions]


@pytest.mark.parametrize(("options", "limit"), [
    ({"dt": 0.1}, 1e-2), ({"dt": 0.02}, 1e-5), ({"integrator": "heun", "dt": 0.05, "substeps": 4}, 1e-2),
    ({"integrator": "ab3", "dt": 0.1, "substeps": 12}, 1e-2), ({"integrator": "gauss4", "dt": 0.1}, 1e-2),
    ({"integrator": "dopri5", "dt": 0.2, "rtol": 1e-4}, 1e-1), ({"compensated": True, "dt": 0.1}, 1e-2),
])
def test_random_torques_against_scipy(options: dict[str, Any], limit: float) -> None:
    """Compare with scipy's DOP853 under the same actions, on an equation written from the lab's coefficients."""
    from scipy.integrate import solve_ivp

    env, steps = made(task="free", **options), 60
    start = env.reset(seed=3)[1]
    values = SCENES["lab"].coefficients
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (steps, 1)).astype(np.float32)
    state, errors, found = [start["angle"], start["velocity"]], [0.0], [start["error_estimate"]]
    for action in actions:
        share = float(action[0])

        def rates(_: float, y: Any, share: float = share) -> list[float]:
            drag = values["linear_drag_rate"] * y[1] + values["quadratic_drag_rate"] * abs(y[1]) * y[1]
            return [y[1], -values["gravity_rate"] * math.sin(y[0]) - drag + values["motor_rate"] * share]

        state = solve_ivp(rates, (0.0, env.dt), state, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1].tolist()
        info = env.step(action)[4]
        errors.append(abs(info["angle"] - state[0]))
        found.append(info["error_estimate"])
    assert all(type(value) is float for value in found)
    assert 0.1 < max(found) / max(errors) < 10.0
    assert max(found) < limit


STORIES: list[dict[str, Any]] = [
    {}, {"substeps": 3, "speed_limit": 0.25}, {"task": "balance", "substeps": 2}, {"scene": "sticky_bearing"},
    {"scene": "windy", "substeps": 3, "speed_limit": 1.0, "integrator": "heun", "task": "free"},
    {"scene": "windy", "lag": 0.05, "substeps": 2, "integrator": "ab2"},
    {"task": "balance", "integrator": "heun", "dt": 0.05}, {"scene": "windy", "lag": 0.05, "substeps": 2},
    {"integrator": "ab3", "substeps": 4}, {"compensated": True, "diagnostics": ("error",)},
    {"scene": "vacuum", "length": 0.5, "speed_limit": 3.0},
    {"scene": "exercise", "integrator": "forward_euler", "dt": 0.1, "task": "free"},
]
"""Settings with memory, early stops, lost tasks and divergence, all with episodes that end."""


@pytest.mark.quick("0-SameStep", "7-SameStep")
@pytest.mark.parametrize("mode", ["SameStep", *(
    pytest.param(mode, marks=pytest.mark.slow) for mode in ("NextStep", "Disabled"))])
@pytest.mark.parametrize("options", STORIES, ids=range(len(STORIES)))
def test_environments_of_a_vector_have_the_bits_of_single_ones(options: dict[str, Any], mode: str) -> None:
    size, steps = 3, 24
    keywords: dict[str, Any] = {"diagnostics": ("energy", "error"), "backend": "python", **options}
    keywords["max_episode_steps"] = 15
    vector = gym.make_vec("LabPendulum-v0", num_envs=size, autoreset_mode=mode, **keywords)
    singles = [gym.make("LabPendulum-v0", **keywords) for _ in range(size)]
    infos = vector.reset(seed=3)[1]
    told = [env.reset(seed=3 + i)[1] for i, env in enumerate(singles)]
    over, random, ends = [False] * size, np.random.default_rng(0), 0
    for _ in range(steps):
        assert infos["error_estimate"].tolist() == [info["error_estimate"] for info in told]
        assert infos["_error_estimate"].all()
        if mode == "Disabled" and any(over):
            mask = np.array(over)
            again = vector.reset(options={"reset_mask": mask})[1]
            told = [env.reset()[1] if due else info for env, due, info in zip(singles, over, told, strict=True)]
            wanted = [info["error_estimate"] if due else 0.0 for due, info in zip(over, told, strict=True)]
            assert again["error_estimate"].tolist() == wanted
            assert again["_error_estimate"].tolist() == over
            over = [False] * size
        actions = random.uniform(-1.0, 1.0, (size, 1)).astype(np.float32)
        infos = vector.step(actions)[4]
        for i, env in enumerate(singles):
            if over[i]:
                told[i], over[i] = env.reset()[1], False
                continue
            _, _, terminated, truncated, told[i] = env.step(actions[i])
            over[i] = terminated or truncated
            ends += over[i]
            if over[i] and mode == "SameStep":
                assert infos["final_info"]["error_estimate"][i] == told[i]["error_estimate"]
                told[i], over[i] = env.reset()[1], False
    assert ends


def test_steps_that_do_not_end_are_what_the_estimates_of_a_rollout_are() -> None:
    """Compare an environment without control with a rollout that is recorded once per control step."""
    env = made(scene="vacuum", dt=0.02, task="free")
    infos = [env.reset()[1], *played(env, 50)]
    run = rollout("vacuum", dt=0.02, duration=1.0, estimate_error=True, backend="python")
    assert run.error_estimate is not None
    assert [info["error_estimate"] for info in infos] == run.error_estimate.tolist()


@pytest.mark.parametrize("options", [
    {}, {"scene": "windy", "diagnostics": ("error", "tension", "flow"), "substeps": 3},
    {"rtol": 1e-6, "integrator": "bs3"}, {"integrator": "ab3", "substeps": 4, "compensated": True},
    {"integrator": "forward_euler", "dt": 0.3, "task": "free"},
], ids=str)
def test_the_whole_state_has_the_run_at_half_the_step(options: dict[str, Any]) -> None:
    """Check that get_state (also through JSON), pickle and deepcopy continue with equal estimates."""
    env = made(**options)
    env.reset(seed=1)
    played(env, 12)
    saved = json.loads(json.dumps(env.get_state()))
    other = made(**options)
    other.reset(seed=9)
    other.set_state(saved)
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env)), other]
    wanted = played(env, 12, seed=1)
    assert all(played(one, 12, seed=1) == wanted for one in copies)
    assert all(one.get_state() == env.get_state() for one in copies)


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_an_episode_that_diverges_at_once_is_unknown(start: float) -> None:
    """Check a single environment and one of a vector; from rest nothing happens."""
    keywords: dict[str, Any] = {"scene": "vacuum", "integrator": "forward_euler", "task": "free", "backend": "python",
                                "damping": {"linear": {"gamma": 1e160}}, "diagnostics": ("error",)}
    env, vector = made(**keywords), gym.make_vec("LabPendulum-v0", num_envs=2, **keywords)
    asked = {"angle": 0.0, "velocity": start}
    env.reset(options=asked)
    vector.reset(options=asked)
    info = env.step(np.zeros(1, dtype=np.float32))[4]
    infos = vector.step(np.zeros((2, 1), dtype=np.float32))[4]
    assert info["error_estimate"] == (math.inf if start else 0.0)
    assert infos["error_estimate"].tolist() == [info["error_estimate"]] * 2


def test_a_state_without_an_estimate_is_not_restored() -> None:
    plain, env = made(diagnostics=("energy",)), made()
    plain.reset(seed=0)
    with pytest.raises(SceneError, match="finite numbers"):
        env.set_state(plain.get_state())


def test_a_vector_copies_and_pickles_with_its_estimates() -> None:
    vector = gym.make_vec("LabPendulum-v0", num_envs=3, diagnostics=("error",), backend="python")
    vector.reset(seed=0)
    actions = np.full((3, 1), 0.3, dtype=np.float32)
    vector.step(actions)
    copies = [copy.deepcopy(vector), pickle.loads(pickle.dumps(vector))]
    wanted = vector.step(actions)[4]["error_estimate"].tolist()
    assert all(one.step(actions)[4]["error_estimate"].tolist() == wanted for one in copies)


def test_without_the_diagnostic_nothing_is_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that program, classes, keys and state are unchanged without the diagnostic."""
    scene, method = SCENES["lab"], integrators.get("rk4")
    plain, asked = made(diagnostics=("energy",)), made()
    told, more = plain.reset(seed=0)[1], asked.reset(seed=0)[1]
    assert set(more) - set(told) == {"error_estimate"}
    assert all(more[name] == told[name] for name in told)
    text = program(scene, method, ("energy",)).text
    assert "error" not in text
    assert "half_angle" not in text
    assert len(plain.get_state()["state"]) == len(program(scene, method, ("energy",)).shape.state)
    programs: list[Any] = []
    own = pendulums.functions
    monkeypatch.setattr(pendulums, "functions", lambda made, backend: (programs.append(made), own(made, backend))[1])
    vector = gym.make_vec("LabPendulum-v0", num_envs=2, backend="python").unwrapped
    assert "error_estimate" not in vector.reset(seed=0)[1]
    gym.make_vec("LabPendulum-v0", num_envs=2, backend="python", diagnostics=("energy", "error"))
    assert len(programs) == 3
    assert programs[0] is programs[1] is programs[2]


@pytest.mark.slow
@pytest.mark.parametrize("options", STORIES[:6], ids=range(6))
def test_compiled_estimates_have_the_bits_of_interpreted_ones(options: dict[str, Any]) -> None:
    found = []
    for backend in ("python", "compiled"):
        keywords = {"diagnostics": ("error",), **options, "backend": backend}
        vector = gym.make_vec("LabPendulum-v0", num_envs=3, **keywords)
        single = made(**{**options, "backend": backend})
        rows = [vector.reset(seed=0)[1]["error_estimate"].tolist()]
        random = np.random.default_rng(0)
        rows += [vector.step(random.uniform(-1.0, 1.0, (3, 1)))[4]["error_estimate"].tolist() for _ in range(30)]
        single.reset(seed=0)
        found.append((rows, [info["error_estimate"] for info in played(single, 20)]))
    assert found[0] == found[1]
