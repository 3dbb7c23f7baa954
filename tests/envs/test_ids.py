"""Ids with true specs: the registered length and spaces, and the rule for durations and time limits."""

from __future__ import annotations

import ast
import copy
import json
import math
import re
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.utils.passive_env_checker import (
    env_render_passive_checker,
    env_reset_passive_checker,
    env_step_passive_checker,
)
from gymnasium.wrappers import RecordVideo, RescaleObservation, TimeAwareObservation
from gymnasium.wrappers import vector as vector_wrappers
from readme_code import ROOT

from pendulum_env import SceneError
from pendulum_env.envs.limits import IDS
from pendulum_env.testing import check_vector_env

FLOAT32 = float(np.finfo(np.float32).max)
TRUE: dict[str, tuple[int, float, str, str]] = {
    "LabPendulum-v0": (500, FLOAT32, "lab", "swing_up"),
    "LabPendulumAnywhere-v0": (200, 10.0, "lab", "swing_up_anywhere"),
    "LabPendulumGymnasium-v0": (200, 8.0, "gymnasium", "gymnasium"),
    "LabPendulumDmControl-v0": (1000, math.inf, "dm_control", "dm_control"),
    "LabPendulumBalance-v0": (500, math.inf, "lab", "balance"),
    "LabPendulumTrack-v0": (500, math.inf, "lab", "track"),
    "LabPendulumMotorBench-v0": (500, math.inf, "motor_bench", "swing_up"),
}
"""Id -> control steps, bound of the velocity [rad/s], scene and task."""
MAKERS: dict[str, Callable[..., Any]] = {
    "make": gym.make, "native": gym.make_vec, "sync": partial(gym.make_vec, vectorization_mode="sync")}
QUICK: dict[str, Any] = {"backend": "python", "diagnostics": ()}
INFINITE = pytest.mark.filterwarnings(  # Gymnasium says this of any infinite bound, as of its own MuJoCo environments
    "ignore:.*Box observation space m(in|ax)imum value is -?infinity:UserWarning")


def length(env: Any, most: int = 1200) -> tuple[int, bool]:
    """Return the number of control steps of an idle episode, and True if it was truncated."""
    env.reset(seed=0)
    idle = np.zeros(env.action_space.shape, np.float32)
    for k in range(1, most):
        *_, terminated, truncated, _ = env.step(idle)
        if np.any(terminated) or np.any(truncated):
            return k, bool(np.any(truncated))
    return most, False


# --- the ids ----------------------------------------------------------------------------------------------------------


def test_the_ids_are_these() -> None:
    assert list(IDS) == list(TRUE)
    assert {name for name in gym.registry if name.startswith("LabPendulum") and "Bench-" not in name} == {
        name for name in TRUE if "Bench-" not in name}


@pytest.mark.quick("LabPendulum-v0", "LabPendulumMotorBench-v0")
@pytest.mark.parametrize("name", TRUE)
@INFINITE
def test_an_id_has_its_true_length_and_spaces(name: str) -> None:
    steps, bound, scene, task = TRUE[name]
    more = 4 if task == "track" else 0
    for kind, make in MAKERS.items():
        env = make(name, **QUICK)
        space = env.observation_space if kind == "make" else env.single_observation_space
        high = np.array([1.0, 1.0, bound, *[1.0] * more], np.float32)
        assert space == gym.spaces.Box(-high, high, dtype=np.float32)
        assert (gym.spec(name).max_episode_steps, env.spec.max_episode_steps) == (steps, steps)
        if kind == "sync":
            continue
        own = env.unwrapped
        assert (own.scene.name, own.task.name) == (scene, task)
        again = EnvSpec.from_json(env.spec.to_json())
        assert again == env.spec
        if task != "balance":  # an idle bob falls there
            assert length(env) == (steps, True)
            assert length((gym.make if kind == "make" else gym.make_vec)(again)) == (steps, True)


def test_the_gymnasium_id_is_pendulum_v1() -> None:
    ours, theirs = gym.spec("LabPendulumGymnasium-v0"), gym.make("Pendulum-v1")
    assert theirs.spec is not None
    assert ours.max_episode_steps == theirs.spec.max_episode_steps == 200
    assert gym.make(ours).observation_space == theirs.observation_space


def test_the_readme_has_all_ids() -> None:
    text = (ROOT / "pendulum_env" / "envs" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(LabPendulum\w*-v0)` \| (.*) \| (\d+) \| (\S+) \| (.*) \|$", text, flags=re.M)
    words = {FLOAT32: "float32's largest number", 8.0: "8 rad/s", 10.0: "10 rad/s", math.inf: "inf"}
    assert [(name, int(steps), bound) for name, _, steps, _, bound in rows] == [
        (name, steps, words[bound]) for name, (steps, bound, _, _) in TRUE.items()]
    for name, keywords, _, threshold, _ in rows:
        assert float(threshold) == gym.spec(name).reward_threshold
        sets = {key: value for key, value in IDS[name][1].items() if key != "velocity_bound"}
        assert {key: ast.literal_eval(value) for key, value in re.findall(r'(\w+)=([^`]+)', keywords)} == sets


@pytest.mark.parametrize("name", TRUE)
@INFINITE
def test_no_wrapper_erases_the_velocity_silently(name: str) -> None:
    """Only LabPendulum-v0, for saved policies, has the bound with which RescaleObservation makes velocities 0."""
    env = gym.make(name, **QUICK)
    bound = TRUE[name][1]
    if bound == math.inf:
        with pytest.raises((AssertionError, ValueError)):
            RescaleObservation(env, np.float32(-1.0), np.float32(1.0))
    elif bound < FLOAT32:
        options = {"angle": 0.0, "velocity": 0.5 * bound}
        assert RescaleObservation(env, np.float32(-1.0), np.float32(1.0)).reset(options=options)[0][2] == 0.5


# --- checkers ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TRUE)
@INFINITE
def test_gymnasiums_checkers_pass(name: str) -> None:
    env = gym.make(name, **QUICK, render_mode="rgb_array", render_size=60).unwrapped
    check_env(env)
    found = []
    for _ in range(2):
        first = env_reset_passive_checker(env, seed=5)
        found.append((*first, *env_step_passive_checker(env, np.full(1, 0.5, np.float32))))
        assert env_render_passive_checker(env) is not None
    assert data_equivalence(*found, exact=True)
    checked = gym.make(name, **QUICK)  # with PassiveEnvChecker
    checked.reset(seed=1)
    checked.step(np.zeros(1, np.float32))


@pytest.mark.quick("LabPendulum-v0")
@pytest.mark.parametrize("name", [
    pytest.param(name, marks=() if name in ("LabPendulum-v0", "LabPendulumMotorBench-v0") else pytest.mark.slow)
    for name in TRUE])
@INFINITE
def test_our_checker_passes(name: str) -> None:
    short = {"max_episode_steps": 5, "backend": "python"}
    report = check_vector_env(partial(gym.make_vec, name, **short), partial(gym.make, name, **short), num_envs=2,
                              steps=20)
    assert not report.failed


@pytest.mark.slow
@pytest.mark.parametrize("name", TRUE)
@INFINITE
def test_episodes_are_filmed(name: str, tmp_path: Path) -> None:
    options = {**QUICK, "render_mode": "rgb_array", "render_size": 60, "max_episode_steps": 4}
    filmed: list[Any] = [RecordVideo(gym.make(name, **options), str(tmp_path / "one"), disable_logger=True)]
    if hasattr(vector_wrappers, "RecordVideo"):  # older ones film no vectors
        many = gym.make_vec(name, num_envs=2, **options)
        filmed.append(vector_wrappers.RecordVideo(many, str(tmp_path / "two"), video_length=4))
    for made in filmed:
        assert length(made) == (4, True)
        made.close()
    assert len(list(tmp_path.glob("*/*.mp4"))) == len(filmed)


# --- durations and limits ---------------------------------------------------------------------------------------------

LONGER: dict[str, tuple[str, dict[str, Any], str]] = {
    "duration": ("LabPendulum-v0", {"duration": 20.0}, "20 s has 1000 control steps of dt=0.02 s, but LabPendulum-v0 "
                 "ends it after 500; give max_episode_steps=1000."),
    "dt": ("LabPendulumGymnasium-v0", {"dt": 0.01}, "10 s has 1000 control steps of dt=0.01 s, but "
           "LabPendulumGymnasium-v0 ends it after 200; give max_episode_steps=1000."),
    "task": ("LabPendulum-v0", {"scene": "dm_control", "task": "dm_control"},
             "give max_episode_steps=1000, or make LabPendulumDmControl-v0, which has 1000."),
}
SHORTER: dict[str, tuple[str, dict[str, Any], int, str]] = {
    "duration": ("LabPendulum-v0", {"duration": 2.0}, 100, "Episodes of 2 s end after 100 control steps, but wrappers "
                 "read 500, the number of LabPendulum-v0; give max_episode_steps=100."),
    "id": ("LabPendulumDmControl-v0", {"duration": 2.0}, 100, "read 1000, .*give max_episode_steps=100."),
    "task": ("LabPendulum-v0", {"scene": "gymnasium", "task": "gymnasium"}, 200,
             "give max_episode_steps=200, or make LabPendulumGymnasium-v0, which has 200."),
}


@pytest.mark.quick("duration-native", "dt-make", "task-sync")
@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("case", LONGER)
@INFINITE
def test_a_duration_longer_than_the_ids_steps_is_refused_at_the_first_reset(case: str, maker: str) -> None:
    name, keywords, text = LONGER[case]
    env = MAKERS[maker](name, **keywords, **QUICK)
    for _ in range(2):
        with pytest.raises(SceneError, match=re.escape(text)):
            env.reset(seed=0)
    remedied = MAKERS[maker](name, **keywords, max_episode_steps=1000, **QUICK)
    assert length(remedied) == (1000, True)


@pytest.mark.quick("duration-make", "id-native")
@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("case", SHORTER)
@INFINITE
def test_a_shorter_duration_warns_once(case: str, maker: str) -> None:
    name, keywords, steps, text = SHORTER[case]
    env = MAKERS[maker](name, **keywords, **QUICK)
    with pytest.warns(UserWarning, match=text) as told:
        assert length(env) == (steps, True)
    assert told[0].filename == __file__
    assert length(env) == (steps, True)
    assert length(MAKERS[maker](name, **keywords, max_episode_steps=steps, **QUICK)) == (steps, True)
    assert length(MAKERS[maker](name, **keywords, warn=False, **QUICK)) == (steps, True)
    with pytest.raises(SceneError, match=text):
        MAKERS[maker](name, **keywords, careful=True, **QUICK).reset()


@pytest.mark.quick("keywords0-500-make", "keywords1-7-native", "keywords4-300-sync")
@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize(("keywords", "steps"), [
    ({"duration": 20.0, "max_episode_steps": 500}, 500),  # an argument, though equal to the registered number
    ({"duration": 20.0, "max_episode_steps": 7}, 7), ({"duration": 2.0, "max_episode_steps": 500}, 500),
    ({"task": "dm_control", "max_episode_steps": 500}, 500), ({"task": "gymnasium", "max_episode_steps": 300}, 300),
    ({"duration": 2.0, "max_episode_steps": -1}, 100), ({"duration": 10.0}, 500), ({}, 500),
])
def test_an_argument_counts_whatever_the_duration_is(keywords: dict[str, Any], steps: int, maker: str) -> None:
    env = MAKERS[maker]("LabPendulum-v0", **keywords, **QUICK)
    assert length(env) == (steps, True)
    if maker == "make" and keywords.get("max_episode_steps") != -1:
        assert env.spec.max_episode_steps == steps


@pytest.mark.parametrize("maker", MAKERS)
def test_without_a_limit_an_episode_has_no_end(maker: str) -> None:
    assert length(MAKERS[maker]("LabPendulum-v0", max_episode_steps=-1, **QUICK), 600) == (600, False)


@pytest.mark.parametrize("limit", [0, -2, 1.5, True, "500", -1.0])
def test_what_is_no_number_of_steps_is_refused(limit: Any) -> None:
    with pytest.raises(SceneError, match="max_episode_steps must be a whole number"):
        gym.make_vec("LabPendulum-v0", max_episode_steps=limit)


def test_wrappers_around_a_made_environment_count_too() -> None:
    env = gym.wrappers.TimeLimit(gym.make("LabPendulum-v0", duration=20.0, max_episode_steps=1000, **QUICK), 30)
    assert length(env) == (30, True)
    env = gym.make("LabPendulum-v0", duration=20.0, **QUICK).unwrapped  # its own end, without a wrapper
    assert length(env) == (1000, True)


@pytest.mark.parametrize("name", TRUE)
@INFINITE
def test_normalized_time_ends_at_one(name: str) -> None:
    cases: list[dict[str, Any]] = [{}, {"duration": 2.0, "max_episode_steps": 40 if "Gymnasium" in name else 100}]
    for keywords in cases:
        env = TimeAwareObservation(gym.make(name, speed_limit=math.inf, **keywords, **QUICK), normalize_time=True)
        env.reset(seed=0)
        over, times = False, []
        while not over:
            seen, _, terminated, truncated, _ = env.step(np.zeros(1, np.float32))
            times.append(float(seen[-1]))
            over = terminated or truncated
        count = TRUE[name][0] if not keywords else keywords["max_episode_steps"]
        assert times == pytest.approx(np.arange(1, len(times) + 1) / count)
        assert terminated or times[-1] == 1.0


def test_json_keeps_the_length_of_a_duration() -> None:
    """JSON cannot tell a registered number from an argument, so that it has the number of the duration."""
    for make in (gym.make, gym.make_vec):
        env: Any = make("LabPendulum-v0", duration=2.0, warn=False, **QUICK)
        text = env.spec.to_json()
        data = json.loads(text)
        assert data["kwargs"].get("max_episode_steps", data["max_episode_steps"]) == 100
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert length(make(EnvSpec.from_json(text))) == (100, True)
            assert length(copy.deepcopy(make(env.spec))) == (100, True)


# --- frames in lists --------------------------------------------------------------------------------------------------


@pytest.mark.quick("NextStep")
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_lists_of_frames_are_those_of_sync_vectors(mode: str) -> None:
    options = {"num_envs": 3, "render_mode": "rgb_array_list", "render_size": 50, "max_episode_steps": 5, **QUICK}
    native = gym.make_vec("LabPendulum-v0", autoreset_mode=mode, **options)
    sync = gym.make_vec("LabPendulum-v0", vectorization_mode="sync", **options,
                        vector_kwargs={"autoreset_mode": gym.vector.AutoresetMode(mode)})
    assert native.render_mode == "rgb_array_list"
    for env in (native, sync):
        env.reset(seed=3)
    for k in range(1, 14):
        if mode == "Disabled" and k % 5 == 1 and k > 1:
            mask = {"reset_mask": np.array([True, True, True])}
            for env in (native, sync):
                env.reset(options=dict(mask))
        action = np.random.default_rng(k).uniform(-1.0, 1.0, (3, 1)).astype(np.float32)
        for env in (native, sync):
            env.step(action)
        if k in (2, 7, 8, 13):
            ours, theirs = native.render(), sync.render()
            assert ours is not None
            assert theirs is not None
            assert [len(each) for each in ours] == [len(each) for each in theirs]
            for one, other in zip(ours, theirs, strict=True):
                assert all(map(np.array_equal, one, other))
    assert native.render() == ([], [], [])


def test_before_the_first_reset_there_are_no_lists() -> None:
    env = gym.make_vec("LabPendulum-v0", render_mode="rgb_array_list", render_size=50, **QUICK)
    with pytest.raises(gym.error.ResetNeeded):
        env.render()
