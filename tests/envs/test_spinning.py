"""Threads that share the steps of a vector: the same bits as one thread, whatever happens between the steps."""

from __future__ import annotations

import copy
import gc
import multiprocessing
import os
import pickle
import threading
import time
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import pendulum_env  # noqa: F401
from pendulum_env import Task
from pendulum_env.engine import spinning, threads
from pendulum_env.engine.layout import BLOCK
from pendulum_env.tasks import TaskError
from pendulum_env.tasks.action import ActionError

SIZE = 5 * BLOCK - 3
"""An odd number of blocks, so that one of two threads takes the last while the other waits for it."""
ACTIONS = np.random.default_rng(0).uniform(-1, 1, (4, SIZE, 1)).astype(np.float32)

pytestmark = pytest.mark.skipif(threads.cores() < 2, reason="A spinning pool has at most one thread for each core.")


def vector(count: int | None, **options: Any) -> Any:
    env = gym.make_vec("LabPendulum-v0", SIZE, num_threads=count, **{"copy": False, "max_episode_steps": 7, **options})
    env.reset(seed=3)
    return env


def bits(env: Any, last: int = 10, first: int = 0, pause: float = 0.0) -> list[bytes]:
    """All that the steps from ``first`` to ``last`` return, in which episodes end and begin."""
    found = []
    for step in range(first, last):
        time.sleep(pause)
        seen, *results, infos = env.step(ACTIONS[step % len(ACTIONS)])
        found += [array.tobytes() for array in (seen, *results, infos["energy"])]
    return found


def members() -> int:
    return sum(thread.name == "lab-pendulum spinning" for thread in threading.enumerate())


def stepped(env: Any) -> Any:
    """The environment after enough steps for its pace to be known, so that a spinning pool takes the next one.

    Three are enough, but for a machine that does other things meanwhile: then its steps seem too long to be shared.
    """
    for _ in range(200):
        env.step(ACTIONS[0])
        if members():
            break
    assert members()
    env.reset(seed=3)
    return env


@pytest.fixture(autouse=True)
def _alone() -> None:
    if members():  # else nothing is looked for, which takes half a second late in a long process
        gc.collect()
    begun = time.perf_counter()
    while members() and time.perf_counter() - begun < 10.0:
        time.sleep(0.001)
    assert members() == 0


@pytest.mark.quick("options1")
@pytest.mark.parametrize("options", [
    {}, {"substeps": 50}, pytest.param({"autoreset_mode": "SameStep"}, marks=pytest.mark.slow),
    pytest.param({"length": np.linspace(0.2, 0.5, SIZE)}, marks=pytest.mark.slow),
    pytest.param({"slack": "warn", "scene": "exercise"}, marks=pytest.mark.slow)])
def test_a_spinning_pool_has_the_bits_of_one_thread(options: dict[str, Any]) -> None:
    wanted = bits(vector(1, **options))
    env = stepped(vector(2, **options))
    assert bits(env) == wanted


@pytest.mark.slow
def test_threads_that_sleep_are_woken() -> None:
    wanted = bits(vector(1))
    assert bits(stepped(vector(2)), pause=5 * spinning.LIMIT) == wanted


@pytest.mark.slow
def test_a_step_does_not_wait_for_a_thread_that_never_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = bits(vector(1))
    monkeypatch.setattr(spinning, "_work", lambda *arguments: time.sleep(0.5))
    assert bits(stepped(vector(2))) == wanted


@pytest.mark.slow
def test_copies_and_pickles_start_threads_of_their_own() -> None:
    one, env = vector(1), stepped(vector(2))
    wanted, begun = bits(one), bits(env, 5)
    twins = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    for each in (env, *twins):
        assert begun + bits(each, first=5) == wanted
    assert members() == 3


@pytest.mark.parametrize("given", [
    lambda action: np.repeat(action, 2, axis=1)[:, 1:], *(pytest.param(given, marks=pytest.mark.slow) for given in (
        lambda action: action.astype(np.float64) * 0.99, lambda action: action.tolist()))])
def test_actions_of_any_kind_are_those_of_one_thread(given: Any) -> None:
    one, env = vector(1), stepped(vector(2))
    for action in ACTIONS:
        for found, wanted in zip(env.step(given(action))[:4], one.step(given(action))[:4], strict=True):
            assert found.tobytes() == wanted.tobytes()


@pytest.mark.quick("nan")
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_spinning_pool_refuses_actions_that_are_not_finite(value: float) -> None:
    """The first action and the last are looked at, and no environment moves."""
    wanted, env = bits(vector(1)), stepped(vector(2))
    begun = bits(env, 3)
    for place in (0, SIZE - 1):
        bad = ACTIONS[3].copy()
        bad[place] = value
        with pytest.raises(ActionError, match=f"those of the environments {place} are not"):
            env.step(bad)
    assert members() == 1
    assert begun + bits(env, first=3) == wanted


@pytest.mark.slow
def test_a_parameter_that_varies_from_now_on_is_seen_by_all_threads() -> None:
    env, one = stepped(vector(2)), vector(1)
    for each in (env, one):
        each.reset(seed=3, options={"length": np.linspace(0.2, 0.5, SIZE)})
    assert bits(env) == bits(one)


@pytest.mark.slow
def test_threads_end_with_their_environment() -> None:
    env = stepped(vector(2))
    time.sleep(5 * spinning.LIMIT)
    assert members() == 1
    del env


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_starts_threads_of_its_own() -> None:
    wanted, env = bits(vector(1)), stepped(vector(2))
    receive, send = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=lambda: send.send((bits(env), members())))
    child.start()
    assert receive.poll(60)
    assert receive.recv() == (wanted, 1)
    child.join()
    assert bits(env) == wanted


@pytest.mark.parametrize("options", [{"num_threads": None}, {"num_threads": 2, "copy": True},
                                     pytest.param({"num_threads": threads.cores() + 1}, marks=pytest.mark.skipif(
                                         threads.cores() >= 5, reason="There are no more threads than blocks, 5.")),
                                     pytest.param({"num_threads": 2, "integrator": "dopri5", "rtol": 1e-6},
                                                  marks=pytest.mark.slow)])
def test_no_thread_spins_unasked(options: dict[str, Any]) -> None:
    env = vector(options.pop("num_threads"), **options)
    bits(env)
    assert members() == 0


def infinite_at_once(time: float) -> float:
    return 1.0 / (0.2 - time) if time > 0.19 and time < 0.21 else 0.0


@pytest.mark.slow
def test_a_reward_that_is_not_finite_is_told() -> None:
    env = vector(2, task=Task("edge", infinite_at_once), max_episode_steps=1000)
    bits(env, 9)
    assert members() == 1
    with pytest.raises(TaskError, match="reward of the task 'edge' is inf in environment 0, at angle"):
        env.step(ACTIONS[0])
