"""Stable-Baselines3's vector; run by test_adapters.py in an environment that has Stable-Baselines3."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from sensing_pairs import PAIRS
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import (
    DummyVecEnv,
    VecCheckNan,
    VecEnv,
    VecFrameStack,
    VecMonitor,
    VecNormalize,
)

from pendulum_env import LabPendulumEnv, SceneError
from pendulum_env.adapters.sb3 import LabPendulumVecEnv
from pendulum_env.tasks.action import ActionError

torch.set_num_threads(1)
SIZE = 3
LENGTHS = [0.3, 0.35, 0.4]


def actions(count: int, size: int = SIZE) -> Any:
    return np.random.default_rng(1).uniform(-1.0, 1.0, (count, size, 1)).astype(np.float32)


def theirs(**options: Any) -> Any:
    """Stable-Baselines3's own vector of single environments, each with its own of the values of lists."""
    def one(place: int) -> Any:
        own = {name: value[place] if isinstance(value, list) else value for name, value in options.items()}
        return lambda: gym.make("LabPendulum-v0", **own)

    return DummyVecEnv([one(place) for place in range(SIZE)])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", PAIRS)
def test_their_checker_passes_over_every_pair_of_options(case: str) -> None:
    """Check settings of sensors, delays, drawn parameters, tasks and motors, with warnings as errors."""
    check_env(LabPendulumEnv(**PAIRS[case]), warn=True, skip_render_check=True)


@pytest.mark.parametrize("options", [
    {"task": "balance", "length": LENGTHS}, {"max_episode_steps": 7},
    {"randomize": {"length": (0.3, 0.4)}, "observation_delay": 0.04, "max_episode_steps": 9},
    {"observation": "history", "history": 3, "max_episode_steps": 9},
    {"speed_limit": 1.0, "diagnostics": ("energy", "flow"), "max_episode_steps": 40}])
def test_steps_ends_and_infos_are_those_of_their_own_vector(options: dict[str, Any]) -> None:
    mine, other = LabPendulumVecEnv(SIZE, info_names=("energy",), **options), theirs(**options)
    ends = 0
    for seed in (5, None):  # also without a seed, the streams go on alike
        for vector in (mine, other):
            if seed is not None:
                vector.seed(seed)
        assert np.array_equal(mine.reset(), other.reset())
        assert mine.reset_infos == other.reset_infos
        for action in actions(150):
            (seen, reward, done, infos), wanted = mine.step(action), other.step(action)
            assert np.array_equal(seen, wanted[0])
            assert seen.dtype == wanted[0].dtype
            assert np.array_equal(reward, wanted[1])
            assert reward.dtype == wanted[1].dtype
            assert np.array_equal(done, wanted[2])
            assert mine.reset_infos == other.reset_infos
            for place, (info, his) in enumerate(zip(infos, wanted[3], strict=True)):
                assert info["TimeLimit.truncated"] is his["TimeLimit.truncated"]
                assert info["energy"] == his["energy"]
                if not done[place]:
                    continue
                ends += 1
                assert info.keys() == his.keys()
                assert np.array_equal(info.pop("terminal_observation"), his.pop("terminal_observation"))
                assert info == his
                assert {name: type(info[name]) for name in info} == {name: type(his[name]) for name in his}
    assert ends > 10


def test_options_of_reset() -> None:
    mine, other = LabPendulumVecEnv(SIZE, task="balance"), theirs(task="balance")
    for options in ({"angle": 1.0, "velocity": 0.5}, [{"angle": angle} for angle in (0.1, 0.2, 0.3)]):
        for vector in (mine, other):
            vector.seed(1)
            vector.set_options(options)
        assert np.array_equal(mine.reset(), other.reset())
    mine.set_options([{"angle": 1.0}, {}, {}])
    with pytest.raises(SceneError, match="must have the same names in all environments, but environment 1"):
        mine.reset()


def test_attributes_and_methods_are_those_of_their_own_vector() -> None:
    options = {"length": LENGTHS, "task": "balance"}
    mine, other = LabPendulumVecEnv(SIZE, **options), theirs(**options)
    for vector in (mine, other):
        vector.seed(2)
        vector.reset()
    for name in ("length", "dt", "omega0", "scene", "task", "render_mode", "action_space"):
        for indices in (None, 1, [2, 0]):
            assert mine.get_attr(name, indices) == other.get_attr(name, indices)
    assert mine.has_attr("length")
    assert not mine.has_attr("lenght")
    assert mine.env_is_wrapped(Monitor) == other.env_is_wrapped(Monitor) == [False] * SIZE
    assert mine.env_method("has_wrapper_attr", "dt", indices=[1]) == [True]
    states = [vector.env_method("get_state", indices=2)[0] for vector in (mine, other)]
    assert states[0]["state"] == states[1]["state"]
    for vector in (mine, other):
        vector.step(actions(1)[0])
        vector.env_method("set_state", states[0], indices=-1)
    after = mine.step(actions(2)[1])[0], other.step(actions(2)[1])[0]
    assert np.array_equal(*after)
    for vector in (mine, other):
        vector.set_attr("level", 3, indices=[0, 2])
        assert vector.get_attr("level", 2) == [3]
    mine.set_attr("level", 4)
    assert mine.get_attr("level") == [4, 4, 4]
    for name in ("length", "dt", "omega0", "substeps"):
        for assign in (mine.set_attr, lambda *given: other.env_method("set_wrapper_attr", *given)):
            with pytest.raises(AttributeError, match=f"{name} cannot be assigned"):
                assign(name, 1.0)


def test_frames() -> None:
    options = {"render_mode": "rgb_array", "render_size": 60, "length": LENGTHS}
    mine, other = LabPendulumVecEnv(SIZE, **options), theirs(**options)
    for vector in (mine, other):
        vector.seed(2)
        vector.reset()
        vector.step(actions(1)[0])
    assert np.array_equal(mine.render(), other.render())
    assert len(mine.get_images()) == SIZE


def test_infos_of_running_episodes_are_one_that_cannot_be_changed() -> None:
    vector = LabPendulumVecEnv(SIZE, diagnostics=())
    vector.reset()
    infos = vector.step(actions(1)[0])[3]
    assert infos == [{"TimeLimit.truncated": False}] * SIZE
    assert infos[0] is infos[1]
    changes = (lambda info: info.update(mine=1), lambda info: info.__setitem__("mine", 1), lambda info: info.clear())
    for change in changes:
        with pytest.raises(TypeError, match="read-only"):
            change(infos[0])
    for plain in (infos[0].copy(), copy.deepcopy(infos[0]), pickle.loads(pickle.dumps(infos[0]))):
        plain["mine"] = 1
        assert type(plain) is dict
    own = LabPendulumVecEnv(SIZE, info_names=("energy",))
    own.reset()
    infos = own.step(actions(1)[0])[3]
    infos[0]["mine"] = 1
    assert "mine" not in infos[1]


def test_their_wrappers_evaluation_and_algorithms() -> None:
    """Combine wrappers as users do; VecMonitor must see whole episodes."""
    def vector(size: int) -> VecEnv:
        plain = LabPendulumVecEnv(size, max_episode_steps=64, diagnostics=())
        made = VecMonitor(VecCheckNan(plain, raise_exception=True))
        made.seed(1)
        return made

    normal = VecNormalize(vector(8), gamma=0.98)
    model = PPO("MlpPolicy", normal, n_steps=64, batch_size=64, n_epochs=2, device="cpu", seed=1).learn(1024)
    assert [episode["l"] for episode in model.ep_info_buffer or ()] == [64] * 16
    normal.training, normal.norm_reward = False, False
    mean, spread = evaluate_policy(model, normal, n_eval_episodes=8)
    assert -(np.pi**2 + 1.0) * 64 < mean < 0.0
    assert spread > 0.0
    plain = model.predict(normal.normalize_obs(np.array([1.0, 0.0, 0.0], np.float32)), deterministic=True)[0]
    assert np.isfinite(plain).all()
    off = SAC("MlpPolicy", vector(4), learning_starts=64, train_freq=16, batch_size=32, device="cpu", seed=1).learn(600)
    assert [episode["l"] for episode in off.ep_info_buffer or ()] == [64] * 8
    stacked = VecFrameStack(vector(2), 3)
    PPO("MlpPolicy", stacked, n_steps=64, batch_size=64, n_epochs=1, device="cpu").learn(128)


def test_the_same_policy_earns_the_same_in_both() -> None:
    """Compare evaluations by Stable-Baselines3 itself, on its own vector and on this one."""
    model = PPO("MlpPolicy", LabPendulumVecEnv(2), n_steps=32, batch_size=64, device="cpu", seed=3)
    earned = []
    for vector in (LabPendulumVecEnv(SIZE, max_episode_steps=50), theirs(max_episode_steps=50)):
        monitored = VecMonitor(vector)
        monitored.seed(7)
        earned.append(evaluate_policy(model, monitored, n_eval_episodes=8, return_episode_rewards=True))
    assert earned[0][1] == earned[1][1]
    assert np.allclose(earned[0][0], earned[1][0], rtol=1e-6)  # theirs adds up rewards of single precision


BAD: dict[str, tuple[Any, type[Exception], str]] = {
    "mode": (lambda: LabPendulumVecEnv(2, autoreset_mode="NextStep"), SceneError, "autoreset_mode cannot be chosen"),
    "copy": (lambda: LabPendulumVecEnv(2, copy=False), SceneError, "copy cannot be chosen"),
    "size": (lambda: LabPendulumVecEnv(0), SceneError, "num_envs must be"),
    "keyword": (lambda: LabPendulumVecEnv(2, lenght=1.0), SceneError, "did you mean length?"),
    "names": (lambda: LabPendulumVecEnv(2, info_names="energy"), SceneError, "info_names"),
    "name": (lambda: LabPendulumVecEnv(2, info_names=("enrgy",)).reset(), SceneError, "did you mean energy?"),
    "absent": (lambda: LabPendulumVecEnv(2, info_names=("energy",), diagnostics=()).reset(), SceneError, "energy"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_refused_in_a_sentence(case: str) -> None:
    call, kind, said = BAD[case]
    with pytest.raises(kind, match=said):
        call()


def test_bad_actions_are_refused() -> None:
    vector = LabPendulumVecEnv(2)
    vector.reset()
    with pytest.raises(ActionError, match="must have the shape"):
        vector.step(np.zeros(2, np.float32))
    with pytest.raises(SceneError, match="indices from 0 to 1"):
        vector.get_attr("dt", 5)
    vector.close()
