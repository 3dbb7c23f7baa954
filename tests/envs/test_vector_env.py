"""Tests of the vector environment: equal bits as single environments in Gymnasium's SyncVectorEnv."""

from __future__ import annotations

import ast
import copy
import inspect
import math
import multiprocessing
import os
import pickle
import re
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from choice import FAMILIAR, check_pairs, pairs, pairs_of
from given_effects import Blow
from gymnasium.vector import AutoresetMode, VectorObservationWrapper
from gymnasium.wrappers import vector as wrappers
from vector_steps import MODES, same, side_by_side, vector

import integrators
from pendulum_env import SCENES, LabPendulumEnv, LabPendulumVectorEnv, Scene, SceneError
from pendulum_env.engine import batch, generate, kernels, pendulums, threads
from pendulum_env.engine.layout import BLOCK, aligned
from pendulum_env.tasks import TASKS
from pendulum_env.tasks.action import ActionError

DIAGNOSED: tuple[tuple[str, ...], ...] = ((), ("energy",), ("heat_by_effect",), ("energy", "heat_by_effect"))
AXES = (list(SCENES), list(integrators.METHODS), list(TASKS), MODES, DIAGNOSED)


def with_modes(rows: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """Return combinations of scene, method and task with the mode and the diagnostics that add the most new pairs.

    Rows stand twice where a pair would be left out. Pairs of all five axes at once would take seconds to find.
    """
    found: list[tuple[Any, ...]] = []
    seen: set[Any] = set()
    added = True
    while added:
        added = False
        for row in rows:
            held = {(*row, *more): pairs_of((*row, *more)) for more in product(MODES, DIAGNOSED)}
            best = max(held, key=lambda one: len(held[one] - seen))
            if held[best] - seen:
                found.append(best)
                seen |= held[best]
                added = True
    return found


PAIRS = with_modes(pairs(AXES[:3]))


def compare(scene: str, method: str, task: str, mode: str, diagnostics: tuple[str, ...], steps: int = 20,
            **options: Any) -> None:
    """Compare the vector environment with SyncVectorEnv over short episodes, so that each environment restarts often.
    """
    common = {"scene": scene, "integrator": method, "task": task, "diagnostics": diagnostics, "max_episode_steps": 13,
              "speed_limit": 1.5, **options}
    theirs = gym.make_vec("LabPendulum-v0", num_envs=3, vectorization_mode="sync",
                          vector_kwargs={"autoreset_mode": mode}, **common)
    assert side_by_side(vector(3, autoreset_mode=mode, **common), theirs, mode, steps) >= 3


def test_how_many_combinations() -> None:
    """Every pair of values, but of methods in scenes every kind: LAB_PENDULUM_GRID=full takes each method in each."""
    print(f"\n{len(PAIRS)} combinations of scene x method x task x autoreset mode x diagnostics")
    check_pairs(PAIRS, AXES)


@pytest.mark.parametrize("case", PAIRS, ids=lambda case: "-".join(str(part) for part in case))
def test_environment_i_is_the_single_one_seeded_s_plus_i(case: Any) -> None:
    compare(*case, backend="python")


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("scene", "method"), [
    ("lab", "rk4"), pytest.param("sticky_bearing", "velocity_verlet", marks=pytest.mark.slow)])
def test_compiled_vector_is_the_compiled_single_one(scene: str, method: str, mode: str) -> None:
    compare(scene, method, "swing_up", mode, ("energy",), substeps=3)


SMOOTH = [name for name, scene in SCENES.items() if not any(effect.dry for effect in scene.effects)]


@pytest.mark.parametrize("case", [
    pytest.param(case, marks=() if case[1] in FAMILIAR else pytest.mark.slow) for case in enumerate(SMOOTH)
], ids=lambda case: case[1])
def test_adaptive_steps_are_those_of_the_single_ones(case: tuple[int, str]) -> None:
    """Check every scene that allows a tolerance, the familiar ones quickly; tasks, modes and substeps take turns."""
    i, scene = case
    compare(scene, "dopri5", list(TASKS)[i % len(TASKS)], MODES[i % len(MODES)], DIAGNOSED[i % len(DIAGNOSED)],
            rtol=1e-6, dt=0.25, substeps=1 + i % 2, backend="python")


@pytest.mark.quick("options1-NextStep")
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("options", [
    {"integrator": "dop853", "diagnostics": ("energy", "error"), "task": "free"},
    {"atol": 1e-3},
    {"observation_delay": 0.1, "action_delay": 0.05, "substeps": 4},
    {"scene": "exercise_large", "task": "free", "speed_limit": 7.0, "integrator": "taylor"},
])
def test_adaptive_steps_with_other_settings(options: dict[str, Any], mode: str) -> None:
    usual = {"scene": "lab", "integrator": "bs3", "task": "swing_up", "diagnostics": ("energy",)}
    scene, method, task, diagnostics = (options.get(name, value) for name, value in usual.items())
    more = {name: value for name, value in options.items() if name not in usual}
    compare(scene, method, task, mode, diagnostics, rtol=1e-5, dt=0.2, backend="python", **more)


@pytest.mark.parametrize("backend", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
def test_adaptive_environments_differ_and_save_their_states(backend: str) -> None:
    """Check parameters of each environment's own, states of the vector, and states in the form of single ones."""
    common: dict[str, Any] = {"integrator": "dop853", "rtol": 1e-7, "dt": 0.3, "task": "free"}
    lengths = np.array([0.3, 1.0, 2.5])
    env = vector(3, length=lengths, backend=backend, **common)
    singles = [gym.make("LabPendulum-v0", length=length, backend="python", **common).unwrapped for length in lengths]
    start = {"angle": np.radians([1.0, 179.0, 90.0]), "velocity": np.zeros(3)}
    env.reset(seed=4, options=start)
    for i, single in enumerate(singles):
        single.reset(seed=4 + i, options={name: values[i] for name, values in start.items()})
    actions = np.random.default_rng(2).uniform(-1, 1, (12, 3, 1)).astype(np.float32)
    for k, action in enumerate(actions):
        if k == 6:
            saved, each = copy.deepcopy(env.get_state()), env.call("get_state")
            for single, state in zip(singles, each, strict=True):
                assert [*map(float, single.get_state()["state"])] == state["state"]
        found, wanted = env.step(action), [single.step(one) for single, one in zip(singles, action, strict=True)]
        assert found[0].tobytes() == np.array([one[0] for one in wanted]).tobytes()
        for name in ("angle", "velocity", "energy_residual"):
            assert found[4][name].tolist() == [one[4][name] for one in wanted]
    for state in (saved, each):
        env.set_state(state)
        for action in actions[6:]:
            again = env.step(action)
        assert again[4]["angle"].tolist() == found[4]["angle"].tolist()
    with pytest.raises(SceneError, match="another rtol"):
        vector(3, length=lengths, backend="python", **{**common, "rtol": 1e-6}).set_state(saved)


def test_every_ending_has_its_name() -> None:
    """Check all stop reasons, their steps and their masks against single environments."""
    cases: list[tuple[dict[str, Any], dict[str, float], str]] = [
        ({"task": "balance"}, {"angle": 3.0}, "fell"),
        ({"speed_limit": 5.0, "task": "free"}, {"angle": 3.0}, "speed_limit"),
        ({"scene": "exercise_large", "task": "free"}, {"angle": 0.0, "velocity": 10.0}, "slack"),
        ({"scene": "textbook", "task": "free", "integrator": "forward_euler", "dt": 0.5, "speed_limit": math.inf},
         {"angle": 0.5}, "diverged"),
        ({"scene": Scene(effects=(Blow(),)), "task": "free", "integrator": "bs3", "rtol": 1e-6, "dt": 0.3,
          "speed_limit": math.inf, "warn": False}, {"angle": 0.0, "velocity": 1.0}, "step_too_short"),
        ({"scene": "exercise_large", "task": "free", "integrator": "dop853", "rtol": 1e-6, "dt": 0.3},
         {"angle": 0.0, "velocity": 10.0}, "slack"),
    ]
    for options, start, reason in cases:
        env, single = vector(2, backend="python", **options), gym.make("LabPendulum-v0", backend="python", **options)
        env.reset(seed=0, options={name: np.array([value, 0.001]) for name, value in start.items()})
        single.reset(seed=0, options=start)
        for _ in range(500):
            found, wanted = env.step(np.zeros((2, 1), np.float32)), single.step(np.zeros(1, np.float32))
            assert (found[0][0].tobytes(), found[1][0], found[2][0]) == (wanted[0].tobytes(), *wanted[1:3])
            if wanted[2]:
                assert found[4]["stop_reason"][0] == wanted[4]["stop_reason"] == reason
                assert found[4]["_stop_reason"].tolist()[0]
                break
            assert found[4]["stop_reason"][0] == wanted[4]["stop_reason"] == ""
        else:
            raise AssertionError(f"{reason} did not come")


# --- same bits, whatever runs them -----------------------------------------------------------------------------------


def rollout_bits(size: int, steps: int = 30, **options: Any) -> list[bytes]:
    env = vector(size, max_episode_steps=11, **options)
    random = np.random.default_rng(3)
    env.reset(seed=5)
    found = []
    for _ in range(steps):
        observation, reward, _, _, infos = env.step(random.uniform(-1, 1, (size, 1)).astype(np.float32))
        found += [observation.tobytes(), reward.tobytes(), infos["energy_residual"].tobytes()]
    return found


def test_threads_backends_and_block_edges_do_not_touch_a_bit() -> None:
    size = 2 * BLOCK + 5
    wanted = rollout_bits(size, num_threads=1)
    for count in (2, 3, 7):
        assert rollout_bits(size, num_threads=count) == wanted
    assert rollout_bits(9, backend="python") == rollout_bits(9, backend="compiled")
    few, many = vector(9), vector(BLOCK + 9)
    for env in (few, many):
        env.reset(seed=[*range(9), *[1] * (env.num_envs - 9)])
    actions = np.random.default_rng(0).uniform(-1, 1, (BLOCK + 9, 1)).astype(np.float32)
    for _ in range(20):
        assert few.step(actions[:9])[0].tobytes() == many.step(actions)[0][:9].tobytes()


def test_several_python_threads_at_once() -> None:
    wanted = [rollout_bits(size, num_threads=2) for size in (5000, 5001, 5002)]
    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(lambda size: rollout_bits(size, num_threads=2), (5000, 5001, 5002))) == wanted


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_after_fork() -> None:
    """Check that a forked child starts its own threads, because those of the parent do not exist in it."""
    wanted = rollout_bits(3 * BLOCK, num_threads=2)
    context = multiprocessing.get_context("fork")
    receive, send = context.Pipe(duplex=False)
    child = context.Process(target=lambda: send.send(rollout_bits(3 * BLOCK, num_threads=2)))
    child.start()
    assert receive.poll(60.0)
    assert receive.recv() == wanted
    child.join(10.0)


def test_threads_by_default() -> None:
    assert vector(64).num_threads == 1
    assert vector(64, num_threads=2).num_threads == 2
    assert threads.usual(10**6) == threads.cores()
    assert threads.usual(1) == 1


# --- parameters of one's own ----------------------------------------------------------------------------------------


@pytest.mark.usefixtures("interpreted")
def test_parameters_of_each_environment() -> None:
    """Check domain randomisation: environment i equals the single environment with the i-th parameters."""
    own: dict[str, Any] = {"length": np.array([0.2, 0.353, 0.5]), "max_torque": [0.01, 0.05, 0.2],
                           "speed_limit": [0.2, 4.0, 99.0]}
    env = vector(3, autoreset_mode="Disabled", gravity=3.7, **own)
    singles = [gym.make("LabPendulum-v0", gravity=3.7, **{name: float(values[i]) for name, values in own.items()})
               for i in range(3)]
    first, infos = env.reset(seed=11)
    for i, single in enumerate(singles):
        observation, info = single.reset(seed=11 + i)
        assert observation.tobytes() == first[i].tobytes()
        assert info["energy"] == infos["energy"][i]
    for _ in range(50):
        found = env.step(np.ones((3, 1), np.float32))
        for i, single in enumerate(singles):
            wanted = single.step(np.ones(1, np.float32))
            assert found[0][i].tobytes() == wanted[0].tobytes()
            assert (found[1][i], found[2][i]) == wanted[1:3]
            assert {name: float(found[4][name][i]) for name in wanted[4] if name != "stop_reason"} == {
                name: value for name, value in wanted[4].items() if name != "stop_reason"}
        if found[2].any():
            break
    else:
        raise AssertionError("the speed limit of 0.2 rad/s did not end an episode")


def test_one_kernel_serves_all_values(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    own = pendulums.functions
    monkeypatch.setattr(pendulums, "functions", lambda *given: (made.append(own(*given)), made[-1])[1])
    vector(2, length=[0.3, 0.4], backend="python")
    vector(2, length=[0.5, 0.6], backend="python")
    first, second = made
    assert first["step_blocks"] is second["step_blocks"]


@pytest.mark.parametrize("scene", ["lab", "windy", "sticky_bearing"])
def test_new_values_generate_parse_and_compile_nothing(scene: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that new numbers for known effects and a known method reuse the compiled program."""

    def refused(*given: Any, **options: Any) -> Any:
        raise AssertionError("text is read again")

    def made(length: float) -> tuple[Any, Any]:
        options = {"scene": scene, "backend": "python", "integrator": "implicit_midpoint"}
        return gym.make("LabPendulum-v0", length=length, **options), vector(3, length=[length, 0.4, 0.5], **options)

    made(0.3)
    for module, name in ((ast, "parse"), (inspect, "getsource"), (generate, "unroll"), (kernels, "interpreted")):
        monkeypatch.setattr(module, name, refused)
    single, several = made(0.31)
    monkeypatch.undo()
    assert single.unwrapped.scene.body.length == 0.31
    assert several.reset(seed=0)[0].shape == (3, 3)


def test_resets_and_steps_are_compiled_for_one_type_of_action(monkeypatch: pytest.MonkeyPatch) -> None:
    own, seen = pendulums.functions, []

    def noted(*given: Any) -> dict[str, Any]:
        made = own(*given)

        def call(*arguments: Any) -> Any:
            seen.append([(value.dtype, value.ndim) if isinstance(value, np.ndarray) else type(value)
                         for value in arguments])
            return made["step_blocks"](*arguments)

        return {**made, "step_blocks": call}

    monkeypatch.setattr(pendulums, "functions", noted)
    env = vector(2, backend="python", autoreset_mode="Disabled")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.reset(options={"reset_mask": np.array([True, False])})
    assert len(seen) > 2
    assert all(types == seen[0] for types in seen)


# --- Gymnasium's manners ---------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("interpreted")
def test_it_is_what_make_vec_makes() -> None:
    env = vector(4, scene="vacuum", integrator="velocity_verlet")
    assert env.spec is not None
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert env.metadata["render_fps"] == 50.0
    assert env.observation_space.contains(env.reset(seed=0)[0])
    assert env.action_space.shape == (4, 1)
    single = gym.make("LabPendulum-v0").unwrapped
    assert (env.single_observation_space, env.single_action_space) == (single.observation_space, single.action_space)
    ends = [env.step(env.action_space.sample())[3].all() for _ in range(500)]
    assert ends == [False] * 499 + [True]


def test_keywords_and_their_defaults_are_the_single_ones() -> None:
    one, many = (inspect.signature(kind).parameters for kind in (LabPendulumEnv, LabPendulumVectorEnv))
    assert {name: many[name].default for name in one} == {name: entry.default for name, entry in one.items()}


def test_arrays_are_fresh_unless_reuse_is_asked_for() -> None:
    for copied in (True, False):
        env = vector(3, copy=copied)
        first = env.reset(seed=0)
        kept = (first[0].copy(), first[1]["angle"].copy())
        after = env.step(np.ones((3, 1), np.float32))
        assert np.array_equal(kept[0], first[0]) is copied
        assert np.array_equal(kept[1], first[1]["angle"]) is copied
        assert np.shares_memory(first[0], after[0]) is not copied


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("copied", [True, False])
def test_each_step_has_an_info_of_its_own(copied: bool) -> None:
    """Check that changes that a caller makes to an info, and earlier stop reasons, are not in the next info."""
    env = vector(2, copy=copied, max_episode_steps=3, speed_limit=[1e-9, 9.0])
    env.reset(seed=0)
    first = env.step(np.ones((2, 1), np.float32))[4]
    assert first["stop_reason"].tolist() == ["speed_limit", ""]
    first["episode"] = "mine"
    if copied:
        first["angle"][:] = 7.0
    for name in ("_angle", "_stop_reason"):
        with pytest.raises(ValueError, match="read-only"):
            first[name][:] = False
    second = env.step(np.ones((2, 1), np.float32))[4]
    assert "episode" not in second
    assert second["stop_reason"].tolist() == ["", ""]
    with pytest.raises(ValueError, match="read-only"):
        second["stop_reason"][0] = "mine"
    assert second["_angle"].all()
    assert np.all(second["angle"] != 7.0)
    assert second is not first


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_arrays_of_blocks_begin_with_a_cache_line(dtype: Any) -> None:
    for size in range(1, 40):
        array = aligned((3, size), dtype)
        assert array.shape == (3, size)
        assert array.dtype == dtype
        assert not array.any()
        assert array.ctypes.data % 64 == 0
    env = vector(2 * BLOCK, copy=False)
    env.reset(seed=0)
    seen, reward, *_, infos = env.step(np.zeros((2 * BLOCK, 1), np.float32))
    assert [array.ctypes.data % 64 for array in (seen, reward, infos["angle"], infos["energy"])] == [0] * 4


def test_a_copy_tells_of_itself_where_arrays_are_reused() -> None:
    push = np.ones((3, 1), np.float32)
    env, fresh = vector(3, copy=False), vector(3)
    for each in (env, fresh):
        each.reset(seed=4)
        each.step(push)
    twin, restored = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    env.step(-push)
    wanted = fresh.step(push)
    for each in (twin, restored):
        told = each.step(push)
        same(told, wanted)
        with pytest.raises(ValueError, match="read-only"):
            told[4]["_angle"][:] = False


def test_seeds() -> None:
    env = vector(3)
    first = env.reset(seed=[4, None, 6])[0]
    assert np.array_equal(env.reset(seed=[4, 5, 6])[0][[0, 2]], first[[0, 2]])
    assert np.array_equal(env.reset(seed=4)[0], env.reset(seed=[4, 5, 6])[0])
    assert not np.array_equal(env.reset()[0], env.reset()[0])
    assert not np.array_equal(vector(3).reset()[0], vector(3).reset()[0])
    # Streams go on where they stood, as a single environment's do.
    env.reset(seed=4)
    single = gym.make("LabPendulum-v0")
    single.reset(seed=4)
    assert env.reset()[0][0].tobytes() == single.reset()[0].tobytes()


def test_options_and_masks() -> None:
    env = vector(3)
    env.reset(seed=1)
    for _ in range(5):
        before = env.step(np.ones((3, 1), np.float32))
    mask = np.array([False, True, False])
    options = {"reset_mask": mask, "angle": 0.7, "velocity": np.array([9.0, 0.25, 9.0])}
    observation, infos = env.reset(options=options)
    assert set(options) == {"reset_mask", "angle", "velocity"}
    assert observation[1] == pytest.approx([math.cos(0.7), math.sin(0.7), 0.25], abs=1e-7)
    assert np.array_equal(observation[[0, 2]], before[0][[0, 2]])
    assert infos["angle"].tolist() == [0.0, pytest.approx(0.7), 0.0]
    assert infos["_angle"].tolist() == mask.tolist()
    after = env.step(np.zeros((3, 1), np.float32))[4]["time"]
    assert after == pytest.approx([0.12, 0.02, 0.12])


@pytest.mark.parametrize("backend", ["compiled", "python"])
def test_copies_resume_bit_for_bit(backend: str) -> None:
    own = {"length": [0.3, 0.3, 0.4, 0.5, 0.6]} if backend == "python" else {}
    env = vector(5, backend=backend, max_episode_steps=9, **own)
    env.reset(seed=2)
    actions = np.full((5, 1), 0.5, np.float32)
    for _ in range(7):
        env.step(actions)
    others = [pickle.loads(pickle.dumps(env)), copy.deepcopy(env)]
    for _ in range(12):
        wanted = env.step(actions)
        for other in others:
            same(other.step(actions), wanted)


@pytest.mark.usefixtures("interpreted")
def test_frames_are_those_of_single_environments() -> None:
    options = {"render_mode": "rgb_array", "render_size": 120, "max_episode_steps": 3}
    for mode in ("NextStep", "SameStep"):
        env = vector(2, autoreset_mode=mode, **options)
        theirs = gym.make_vec("LabPendulum-v0", num_envs=2, vectorization_mode="sync",
                              vector_kwargs={"autoreset_mode": mode}, **options)
        for each in (env, theirs):
            each.reset(seed=3)
        for k in range(6):
            frames, wanted = env.render(), theirs.render()
            assert frames is not None
            assert wanted is not None
            for mine, other in zip(frames, wanted, strict=True):
                assert np.array_equal(mine, other), (mode, k)
            for each in (env, theirs):
                each.step(np.full((2, 1), 0.5, np.float32))


@pytest.mark.quick("NextStep-RecordEpisodeStatistics", "NextStep-NormalizeReward", "SameStep-ClipAction")
@pytest.mark.parametrize("wrap", [
    wrappers.RecordEpisodeStatistics, wrappers.NormalizeObservation, wrappers.NormalizeReward, wrappers.ClipAction,
    wrappers.ClipReward, wrappers.DictInfoToList, wrappers.FlattenObservation,
    wrappers.RescaleObservation, wrappers.TransformReward,
], ids=lambda wrap: wrap.__name__)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.usefixtures("interpreted")
def test_gymnasiums_vector_wrappers(wrap: Any, mode: str) -> None:
    """Check that a wrapper gives equal results on the vector environment and on SyncVectorEnv."""
    arguments: dict[Any, dict[str, Any]] = {
        wrappers.ClipReward: {"min_reward": -1.0, "max_reward": 1.0},
        wrappers.TransformReward: {"func": lambda reward: 2.0 * reward},
        wrappers.RescaleObservation: {"min_obs": np.float32(-1.0), "max_obs": np.float32(1.0)},
    }
    options = {"max_episode_steps": 7, "num_envs": 3}
    native = gym.make_vec("LabPendulum-v0", autoreset_mode=mode, **options)
    theirs = gym.make_vec("LabPendulum-v0", vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode},
                          **options)
    if mode == "SameStep" and issubclass(wrap, VectorObservationWrapper):  # would leave final_obs as it is
        for env in (native, theirs):
            with pytest.raises((ValueError, AssertionError), match=r"autoreset_mode|^$"):  # Gymnasium 1.1 says no word
                wrap(env, **arguments.get(wrap, {}))
        return
    found, wanted = (wrap(env, **arguments.get(wrap, {})) for env in (native, theirs))
    observation, other = found.reset(seed=2)[0], wanted.reset(seed=2)[0]
    for _ in range(20):
        assert np.array_equal(observation, other, equal_nan=True)
        actions = np.full((3, 1), 0.5, np.float32)
        mine, his = found.step(actions), wanted.step(actions)
        observation, other = mine[0], his[0]
        assert np.array_equal(mine[1], his[1])
        if wrap is wrappers.RecordEpisodeStatistics and "episode" in his[4]:
            assert np.array_equal(mine[4]["episode"]["r"], his[4]["episode"]["r"])


# --- bad input -------------------------------------------------------------------------------------------------------

BAD = {
    "no environments": ({"num_envs": 0}, "num_envs must be a whole number from 1"),
    "half an environment": ({"num_envs": 2.5}, "num_envs must be a whole number"),
    "length of an array": ({"length": [0.3, 0.4]}, "length must be one number or one for each of 3 environments"),
    "shape of an array": ({"length": np.ones((3, 1))}, "not of the shape (3, 1)"),
    "one bad entry": ({"length": [0.3, -1.0, 0.4]}, "In environment 1 of 3: length must be a finite number above 0"),
    "first entry": ({"mass": [math.nan, 1.0, 0.4]}, "In environment 0 of 3: mass must be"),
    "speed limits": ({"speed_limit": [1.0, 2.0, 0.0]}, "In environment 2 of 3: speed_limit must be"),
    "unknown parameter": ({"lenght": [0.3, 0.3, 0.3]}, "did you mean length?"),
    "mode": ({"autoreset_mode": "NextSteps"}, "There is no autoreset_mode 'NextSteps'; did you mean NextStep"),
    "diagnostics": ({"diagnostics": ("enrgy",)}, "did you mean energy?"),
    "threads": ({"num_threads": 0}, "num_threads must be a whole number"),
    "episode": ({"max_episode_steps": 0}, "max_episode_steps must be a whole number"),
    "task": ({"task": "swingup"}, "did you mean swing_up"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gives_one_clear_error(case: str) -> None:
    options, words = BAD[case]
    with pytest.raises(SceneError, match=re.escape(words)):
        LabPendulumVectorEnv(**{"num_envs": 3, "backend": "python", **options})


BAD_ACTIONS = {
    "shape": (np.zeros(3, np.float32), "must have the shape (3, 1), not (3,)"),
    "number": (np.zeros((2, 1), np.float32), "must have the shape (3, 1), not (2, 1)"),
    "nan": (np.array([[0.0], [np.nan], [np.inf]]), "those of the environments 1, 2 are not"),
    "words": (np.array([["a"], ["b"], ["c"]]), "must have real numbers"),
}


@pytest.mark.parametrize("case", BAD_ACTIONS)
def test_bad_actions_change_nothing(case: str) -> None:
    actions, words = BAD_ACTIONS[case]
    env = vector(3, backend="python")
    env.reset(seed=0)
    with pytest.raises(ActionError, match=re.escape(words)):
        env.step(actions)
    assert env.step(np.zeros((3, 1)))[4]["time"].tolist() == [0.02] * 3


@pytest.mark.quick("options0-nan")
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("options", [
    {}, *(pytest.param(more, marks=pytest.mark.slow) for more in (
        {"num_threads": 2, "copy": False}, {"diagnostics": ("energy", "error")}, {"substeps": 100},
        {"substeps": 3000}))])
def test_a_compiled_program_refuses_actions_that_are_not_finite(value: float, options: dict[str, Any]) -> None:
    """The first action and the last are looked at, in the last of three blocks, and no environment moves."""
    env, other = (vector(600, **{"integrator": "symplectic_euler", "num_threads": 1, **options}) for _ in range(2))
    for each in (env, other):
        each.reset(seed=0)
    actions = np.linspace(-2.0, 2.0, 600, dtype=np.float32)[:, None]
    for place in (0, 599):
        bad = actions.copy()
        bad[place] = value
        with pytest.raises(ActionError, match=f"those of the environments {place} are not"):
            env.step(bad)
    found, expected = env.step(actions), other.step(actions)
    assert found[0].tobytes() == expected[0].tobytes()
    assert found[4]["time"].tolist() == [0.02] * 600


@pytest.mark.quick("False-SameStep", "False-NextStep")
@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
@pytest.mark.parametrize("some", [True, False])
def test_an_interrupted_restart_has_to_be_followed_by_a_reset(
    mode: str, some: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C while new episodes begin, of all environments or of two: no step goes on from half a state."""
    env = vector(4, autoreset_mode=mode, max_episode_steps=3)
    env.reset(seed=0)
    if some:
        env.step(np.zeros((4, 1)))
        env.reset(options={"reset_mask": np.array([True, False, True, False])})

    def interrupted(*given: Any) -> None:
        raise KeyboardInterrupt

    def go_on() -> None:
        for _ in range(5):
            env.step(np.zeros((4, 1)))

    with monkeypatch.context() as patch:
        patch.setattr(pendulums, "split_turns", interrupted)
        with pytest.raises(KeyboardInterrupt):
            go_on()
    for call in (lambda: env.step(np.zeros((4, 1))), env.get_state,
                 lambda: env.reset(options={"reset_mask": np.array([True, False, False, False])})):
        with pytest.raises(gym.error.ResetNeeded, match="was interrupted or failed, so that some"):
            call()
    env.reset(seed=0)
    other = vector(4, autoreset_mode=mode, max_episode_steps=3)
    other.reset(seed=0)
    assert env.step(np.ones((4, 1)))[0].tobytes() == other.step(np.ones((4, 1)))[0].tobytes()


def test_an_interrupted_reset_has_to_be_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    env = vector(4)
    env.reset(seed=0)

    def interrupted(*given: Any) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(pendulums, "split_turns", interrupted)
        with pytest.raises(KeyboardInterrupt):
            env.reset(seed=1)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(np.zeros((4, 1)))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_actions_are_looked_at_before_ended_episodes(dtype: type) -> None:
    env = vector(3, num_threads=1, autoreset_mode="Disabled", max_episode_steps=1)
    env.reset(seed=0)
    env.step(np.zeros((3, 1), dtype))
    with pytest.raises(ActionError, match="those of the environments 0, 1, 2 are not"):
        env.step(np.full((3, 1), np.nan, dtype))


def test_huge_finite_actions_are_clipped_not_refused() -> None:
    env = vector(3, backend="python")
    env.reset(seed=0)
    env.step(np.full((3, 1), 3e38, np.float32))


BAD_RESETS: dict[str, tuple[dict[str, Any], str]] = {
    "option": ({"options": {"angel": 1.0}}, "did you mean angle?"),
    "angles": ({"options": {"angle": [1.0, 2.0]}}, "angle must be one number or one for each of 3 environments"),
    "nan": ({"options": {"angle": [1.0, math.nan, 2.0]}}, "angle must hold at least one number, all of them finite"),
    "mask of numbers": ({"options": {"reset_mask": np.ones(3)}}, "reset_mask must be an array of 3 booleans"),
    "mask of none": ({"options": {"reset_mask": np.zeros(3, bool)}}, "mark at least one"),
    "negative seed": ({"seed": -1}, "environment 0 has -1"),
    "seeds": ({"seed": [1, 2]}, "one for each of 3 environments"),
    "seed": ({"seed": "one"}, "seed must be one whole number"),
}


@pytest.mark.parametrize("case", BAD_RESETS)
def test_bad_resets_change_nothing(case: str) -> None:
    arguments, words = BAD_RESETS[case]
    env, other = vector(3, backend="python"), vector(3, backend="python")
    for each in (env, other):
        each.reset(seed=0)
    with pytest.raises(SceneError, match=re.escape(words)):
        env.reset(**arguments)
    actions = np.ones((3, 1))
    assert env.step(actions)[0].tobytes() == other.step(actions)[0].tobytes()
    assert env.reset()[0].tobytes() == other.reset()[0].tobytes()


def test_the_order_of_calls() -> None:
    env = vector(3, autoreset_mode="Disabled", max_episode_steps=2, backend="python")
    for call in (lambda: env.step(np.zeros((3, 1))), lambda: env.reset(options={"reset_mask": np.ones(3, bool)})):
        with pytest.raises(gym.error.ResetNeeded):
            call()
    env.reset(seed=0)
    for _ in range(2):
        env.step(np.zeros((3, 1)))
    with pytest.raises(gym.error.ResetNeeded, match="have ended: 3, the first in environment 0"):
        env.step(np.zeros((3, 1)))
    env.reset(options={"reset_mask": np.array([True, True, False])})
    with pytest.raises(gym.error.ResetNeeded, match="have ended: 1, the first in environment 2"):
        env.step(np.zeros((3, 1)))


def test_a_closed_vector_refuses_to_go_on() -> None:
    env = vector(3, render_mode="rgb_array")
    env.reset(seed=0)
    state = env.get_state()
    env.close()
    env.close()
    for call in (lambda: env.step(np.zeros((3, 1))), env.reset,
                 lambda: env.reset(options={"reset_mask": np.array([True, False, False])})):
        with pytest.raises(gym.error.ClosedEnvironmentError, match=r"was closed before .*; make a new one"):
            call()
    other = vector(3)
    other.set_state(state)
    assert other.step(np.zeros((3, 1)))[4]["time"].tolist() == [0.02] * 3


def test_a_vector_is_used_from_one_thread_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second thread is refused in a sentence, and the first one's step is that of a vector that is alone."""
    env, alone = vector(3), vector(3)
    for each in (env, alone):
        each.reset(seed=0)
    state, step, entered, go_on = env.get_state(), batch.Batch.step, threading.Event(), threading.Event()

    def waiting(*given: Any) -> Any:
        entered.set()
        assert go_on.wait(60.0)
        return step(*given)

    with monkeypatch.context() as patch, ThreadPoolExecutor(1) as pool:
        patch.setattr(batch.Batch, "step", waiting)
        first = pool.submit(env.step, np.ones((3, 1)))
        assert entered.wait(60.0)
        try:
            for call in (lambda: env.step(np.ones((3, 1))), env.reset, env.get_state, lambda: env.set_state(state)):
                with pytest.raises(gym.error.AlreadyPendingCallError, match="while another thread is in a call"):
                    call()
        finally:
            go_on.set()
        found = first.result()
    assert found[0].tobytes() == alone.step(np.ones((3, 1)))[0].tobytes()
    again = pickle.loads(pickle.dumps(env))
    assert again.step(np.ones((3, 1)))[0].tobytes() == env.step(np.ones((3, 1)))[0].tobytes()


@pytest.mark.slow
def test_importing_the_vector_env_loads_no_compiler() -> None:
    code = "import sys, pendulum_env; pendulum_env.LabPendulumVectorEnv; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_ragged_input_is_refused_in_a_sentence() -> None:
    env = LabPendulumVectorEnv(2, backend="python")
    env.reset(seed=0)
    for options in ({"angle": [0.1, [1, 2]]}, {"velocity": [[1.0], [1.0, 2.0]]}):
        with pytest.raises(SceneError, match="one number or one for each of 2 environments, not "):
            env.reset(options=options)
    seeds: Any = [1, [1, 2]]
    with pytest.raises(SceneError, match=r"environment 1 has \[1, 2\]"):
        env.reset(seed=seeds)
    with pytest.raises(ActionError, match=r"must have the shape \(2, 1\), not rows of different lengths"):
        env.step([[1], [1, 2]])
