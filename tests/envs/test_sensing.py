"""Tests of sensors and delays, against plain environments with shorter steps and numpy on the true angle."""

from __future__ import annotations

import copy
import itertools
import math
import pickle
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy import stats
from sensing_pairs import PAIRS, ROUGH
from vector_steps import MODES, same, side_by_side, vector

from pendulum_env import (
    LabPendulumEnv,
    LabPendulumVectorEnv,
    Recording,
    SceneError,
    Sensor,
    Task,
    VirtualSensor,
    fit,
    rollout,
)
from pendulum_env.engine import sensing
from pendulum_env.engine.layout import BLOCK
from pendulum_env.testing import check_vector_env

DT, PARTS = 0.03125, 4
STEP = DT / PARTS

CASES: dict[str, dict[str, Any]] = {
    "action": {"action_delay": 0.02}, "action in a step": {"action_delay": 0.012, "substeps": 5},
    "random action": {"action_delay": (0.0, 0.05), "substeps": 4},
    "observation": {"observation_delay": 0.04}, "observation in a step": {"observation_delay": 0.012, "substeps": 5},
    "both random": {"observation_delay": (0.0, 0.05), "substeps": 4, "action_delay": (0.005, 0.03)},
    "angle": {"observation": "angle"}, "encoder": {"observation": "encoder"},
    "history": {"observation": "history", "history": 3, "observation_delay": 0.04},
    "rough": {"observation": "encoder", "sensor": ROUGH},
    "filter": {"observation": "encoder", "sensor": Sensor(quantum=0.005, rate=200.0, corner=20.0), "substeps": 4,
               "observation_delay": 0.01},
    "slow": {"observation": "encoder", "sensor": Sensor(noise=0.005, rate=25.0, window=2, dropout=0.3), "substeps": 2,
             "observation_delay": (0.0, 0.05)},
    "slow, velocity seen": {"sensor": Sensor(noise=0.005, rate=25.0, dropout=0.3), "observation_delay": (0.0, 0.04)},
    "gusts": {"scene": "windy", "task": "free", "sensor": Sensor(noise=0.01), "action_delay": 0.02},
    "lag": {"lag": 0.05, "substeps": 4, "action_delay": 0.015},
    "errors": {"observation_delay": 0.04, "action_delay": 0.02, "diagnostics": ("energy", "error")},
    "random all over": {"observation": "encoder", "randomize": {"length": (0.3, 0.4)}, "velocity_bound": 1.0,
                        "action_delay": (0.0, 0.02)},
    "not periodic": {"scene": "textbook", "task": "free", "observation": "history"},
    "reference": {"task": "track", "observation": "angle", "observation_delay": 0.02},
    "clipped speed": {"scene": "gymnasium", "observation": "encoder", "action_delay": (0.0, 0.1),
                      "observation_delay": 0.05, "randomize": {"length": (0.8, 1.2)}},
    "a slack wire": {"scene": "exercise_large", "task": "free", "slack": "warn", "observation_delay": 0.04,
                     "randomize": {"length": (0.5, 0.7)}, "compensated": True},
    "multistep": {"integrator": "adams_bashforth2", "substeps": 8, "action_delay": 0.005},
}


@pytest.mark.quick("0-action", "0-both random", "0-encoder", "0-history", "0-gusts", "0-reference", "0-slow")
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("shift", [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow)])
def test_environment_i_sees_what_the_single_one_sees(case: str, shift: int) -> None:
    """Compare bits of a vector and of single environments, in one autoreset mode for each case here, in all slowly."""
    mode = MODES[([*CASES].index(case) + shift) % len(MODES)]
    common = {"max_episode_steps": 13, "speed_limit": 0.6, "backend": "python", "warn": False, **CASES[case]}
    theirs = gym.make_vec("LabPendulum-v0", num_envs=3, vectorization_mode="sync",
                          vector_kwargs={"autoreset_mode": mode}, **common)
    assert side_by_side(vector(3, autoreset_mode=mode, **common), theirs, mode, 16) >= 3


@pytest.mark.slow
@pytest.mark.parametrize("case", ["both random", "rough", "slow"])
def test_compiled_and_interpreted_readings_have_the_same_bits(case: str) -> None:
    """Check a vector over two blocks and threads, and a single environment."""
    found = []
    for options in ({"backend": "python"}, {"num_threads": 2}):
        env = vector(BLOCK + 12, max_episode_steps=7, autoreset_mode="SameStep", **CASES[case], **options)
        rows = [env.reset(seed=3)[0]]
        actions = np.random.default_rng(0).uniform(-1, 1, (9, BLOCK + 12, 1)).astype(np.float32)
        rows += [env.step(action)[0] for action in actions]
        found.append(np.array(rows).tobytes())
    assert found[0] == found[1]
    singles = [LabPendulumEnv(backend=backend, **CASES[case]) for backend in ("python", "compiled")]
    for env in singles:
        env.reset(seed=5)
    for action in actions[:, 0]:
        same(singles[0].step(action), singles[1].step(action))


# --- delays ---------------------------------------------------------------------------------------------------------


def fine(actions: Any, late: int = 0, **options: Any) -> list[Any]:
    """Step a plain environment with a control step for each integration step; actions arrive ``late`` steps late.

    Return observations and infos at the start and after every step.
    """
    env = LabPendulumEnv(dt=STEP, task="free", backend="python", **options)
    rows = [env.reset(options={"angle": 0.5, "velocity": 0.2})]
    shifted = [0.0] * late + [action for action in actions for _ in range(PARTS)]
    for action in shifted[: PARTS * len(actions)]:
        observation, _, _, _, info = env.step(np.array([action], np.float32))
        rows.append((observation, info))
    return rows


def coarse(actions: Any, **options: Any) -> list[Any]:
    """Step an environment with PARTS integration steps in a control step; return what :func:`fine` returns."""
    env = LabPendulumEnv(dt=DT, substeps=PARTS, task="free", backend="python", **options)
    rows = [env.reset(options={"angle": 0.5, "velocity": 0.2})]
    for action in actions:
        observation, _, _, _, info = env.step(np.array([action], np.float32))
        rows.append((observation, info))
    return rows


ACTIONS = np.random.default_rng(2).uniform(-1.0, 1.0, 12)
TRUE = ("time", "angle", "velocity", "energy", "work", "heat", "energy_residual")


@pytest.mark.parametrize(("late", "lag"), [
    (1, 0.0), (3, 0.0), (4, 0.0), (6, 0.0), (9, 0.0), (1, 0.1), (3, 0.1), (9, 0.1)])
def test_a_delayed_action_is_one_that_arrives_steps_later(late: int, lag: float) -> None:
    """Compare the true motion in every bit with a plain run whose actions were shifted by hand.

    The motor with a lag is advanced in every integration step where actions arrive within control steps.
    """
    wanted = fine(ACTIONS, late, lag=lag)[::PARTS]
    found = coarse(ACTIONS, action_delay=late * STEP, lag=lag)
    for (_, mine), (_, theirs) in zip(found, wanted, strict=True):
        assert [mine[name] for name in TRUE] == [theirs[name] for name in TRUE]


def test_an_action_delayed_by_control_steps_is_the_one_before() -> None:
    """Check rewards, too, which count the action that acts, and a lagging motor."""
    mine, plain = (LabPendulumEnv(dt=0.02, substeps=2, lag=0.1, backend="python", **options)
                   for options in ({"action_delay": 0.04}, {}))
    for env in (mine, plain):
        env.reset(seed=1)
    for action, earlier in zip(ACTIONS, [0.0, 0.0, *ACTIONS], strict=False):
        found = mine.step(np.array([action], np.float32))
        wanted = plain.step(np.array([earlier], np.float32))
        found[4].pop("observed_angle")
        same(found, wanted)


@pytest.mark.parametrize("late", [1, 2, 4, 7, 8])
def test_a_delayed_observation_is_that_of_steps_ago(late: int) -> None:
    steps = fine(ACTIONS)
    found = coarse(ACTIONS, observation_delay=late * STEP)
    for k, (observation, info) in enumerate(found):
        wanted, true = steps[max(0, PARTS * k - late)]
        same(observation, wanted)
        assert info["observed_angle"] == true["angle"]
        assert info["angle"] == steps[PARTS * k][1]["angle"]


def test_random_delays_are_within_their_bounds_and_equally_frequent() -> None:
    env = vector(2000, dt=DT, substeps=PARTS, observation_delay=(STEP, 6 * STEP), action_delay=(0.0, 2 * STEP),
                 backend="python", diagnostics=())
    _, infos = env.reset(seed=0)
    for name, low, high in (("observation_delay", 1, 6), ("action_delay", 0, 2)):
        steps = np.round(infos["parameters"][name] / STEP).astype(int)
        values, counts = np.unique(steps, return_counts=True)
        assert values.tolist() == [*range(low, high + 1)]
        assert stats.chisquare(counts).pvalue > 0.01


def test_a_random_delay_acts_as_the_same_fixed_one() -> None:
    drawn = set()
    for seed in range(6):
        env = LabPendulumEnv(dt=DT, substeps=PARTS, observation_delay=(0.0, 6 * STEP), action_delay=(0.0, 6 * STEP),
                             backend="python")
        start = {"angle": 0.5, "velocity": 0.2}
        _, info = env.reset(seed=seed, options=start)
        delays = info.pop("parameters")
        drawn.add(tuple(delays.values()))
        plain = LabPendulumEnv(dt=DT, substeps=PARTS, backend="python", **delays)
        plain.reset(options=start)
        for action in ACTIONS:
            found, wanted = (one.step(np.array([action], np.float32)) for one in (env, plain))
            found[4].pop("observed_angle", None)
            wanted[4].pop("observed_angle", None)
            same(found, wanted)
    assert len(drawn) > 3


# --- readings -------------------------------------------------------------------------------------------------------


def true_angles(**options: Any) -> np.ndarray:
    return np.array([info["angle"] for _, info in fine(ACTIONS, **options)])


@pytest.mark.parametrize("window", [1, 3])
@pytest.mark.parametrize("every", [1, 2, 4])
def test_an_encoder_computes_what_numpy_does(window: int, every: int) -> None:
    """Check counts and velocities in every bit: readings every ``every`` steps, differences over a window of them."""
    quantum, scale, offset = math.tau / 1000, 1.02, 0.3
    device = Sensor(quantum=quantum, scale=scale, offset=offset, window=window,
                    rate=None if every == PARTS else 1.0 / (every * STEP))
    readings = quantum * np.round((scale * true_angles()[::every] + offset) / quantum)
    past = np.concatenate([np.full(window, readings[0]), readings])
    speeds = ((readings - past[: len(readings)]) / (window * (every * STEP)))[:: PARTS // every]
    readings = readings[:: PARTS // every]
    found = coarse(ACTIONS, observation="encoder", sensor=device)
    assert [info["observed_angle"] for _, info in found] == readings.tolist()
    assert [observation[2] for observation, _ in found] == speeds.astype(np.float32).tolist()
    seen = np.array([observation[:2] for observation, _ in found])
    assert np.allclose(seen, np.stack([np.cos(readings), np.sin(readings)], axis=1), atol=1e-7)


def test_a_filter_has_its_corner_frequency() -> None:
    """Check the filter against its recursion in numpy, with readings in every integration step."""
    device = Sensor(rate=1.0 / STEP, corner=3.0)
    readings, speed, speeds = true_angles(), 0.0, [0.0]
    for before, after in itertools.pairwise(readings):
        speed += (1.0 - math.exp(-2.0 * math.pi * 3.0 * STEP)) * ((after - before) / STEP - speed)
        speeds.append(speed)
    found = coarse(ACTIONS, observation="encoder", sensor=device)
    assert np.allclose([observation[2] for observation, _ in found], speeds[::PARTS], rtol=1e-5, atol=1e-6)


def test_a_slow_sensor_holds_its_readings() -> None:
    found = coarse(ACTIONS, observation="encoder", sensor=Sensor(rate=1.0 / (3 * DT)))
    true = true_angles()[::PARTS]
    held = true[(np.arange(len(true)) // 3) * 3]
    assert [info["observed_angle"] for _, info in found] == held.tolist()
    speeds = np.diff(held[::3], prepend=held[0]) / (3 * DT)
    assert [observation[2] for observation, _ in found] == speeds[np.arange(len(true)) // 3].astype(np.float32).tolist()


def test_a_history_holds_past_readings_the_oldest_first() -> None:
    found = coarse(ACTIONS, observation="history", history=3)
    plain = [observation[:2] for observation, _ in coarse(ACTIONS)]
    for k, (observation, _) in enumerate(found):
        same(observation, np.concatenate([plain[max(0, k - back)] for back in (2, 1, 0)]))


def test_the_zero_at_the_start_is_that_of_a_virtual_sensor() -> None:
    """Check one declaration for recordings and environments: the same readings of the same motion."""
    device = VirtualSensor(quantum=math.radians(0.25), rate=1.0 / DT)
    found = coarse(np.zeros(40), sensor=device)
    motion = rollout("lab", angle=0.5, velocity=0.2, dt=STEP, duration=40 * DT, backend="python")
    recorded = device.record(motion).angle
    assert np.abs(recorded - [info["observed_angle"] for _, info in found]).max() < 1e-12


@pytest.mark.slow
def test_noise_and_dropout_have_their_sizes() -> None:
    """Check the readings of a bob at rest: Gaussian noise, independent from step to step, with lost readings between.
    """
    noise, dropout, size = 0.02, 0.3, 400
    env = vector(size, scene="vacuum", task="free", sensor=Sensor(noise=noise, dropout=dropout), backend="python")
    start = {"angle": 0.0, "velocity": 0.0}
    rows = [env.reset(seed=1, options=start)[1]["observed_angle"]]
    rows += [env.step(np.zeros((size, 1), np.float32))[4]["observed_angle"] for _ in range(20)]
    readings = np.array(rows)
    lost = readings[1:] == readings[:-1]
    assert abs(lost.mean() - dropout) < 4.0 * math.sqrt(dropout * (1.0 - dropout) / lost.size)
    fresh = np.concatenate([readings[0], readings[1:][~lost]])
    assert stats.kstest(fresh, stats.norm(0.0, noise).cdf).pvalue > 0.01
    pairs = ~lost[1:] & ~lost[:-1]
    assert abs(np.corrcoef(readings[1:-1][pairs], readings[2:][pairs])[0, 1]) < 0.06


@pytest.mark.slow
def test_a_fit_tells_the_sensor_of_its_recording() -> None:
    time = np.arange(0.0, 20.0, 0.05)
    source, quantum, noise = np.random.default_rng(0), 0.002, 0.004
    swing = 0.3 * np.exp(-0.04 * time) * np.cos(5.2 * time) + noise * source.standard_normal(len(time))
    device = fit(Recording(time, quantum * np.round(swing / quantum), "swing"), effects="linear", mass=0.04).sensor
    assert device.quantum == pytest.approx(quantum, rel=1e-6)
    assert device.noise == pytest.approx(noise, rel=0.15)
    assert device.rate == pytest.approx(20.0)


# --- environments ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", ["both random", "rough", "slow", "lag", "history"])
def test_saved_states_resume_in_the_middle_of_a_queue(case: str) -> None:
    env = LabPendulumEnv(backend="python", **CASES[case])
    env.reset(seed=1)
    for action in ACTIONS[:5]:
        env.step(np.array([action], np.float32))
    saved, others = env.get_state(), [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    fresh = LabPendulumEnv(backend="python", **CASES[case])
    fresh.reset(seed=2)
    fresh.set_state(saved)
    for other in (*others, fresh):
        twin = copy.deepcopy(env)
        for action in ACTIONS[5:]:
            same(other.step(np.array([action], np.float32)), twin.step(np.array([action], np.float32)))
        same(other.reset(), twin.reset())
    for spoilt in (None, {}, {**saved["sensing"], "readings": [0.0]}, {**saved["sensing"], "slot": 99},
                   {**saved["sensing"], "readings": [math.nan] * len(saved["sensing"]["readings"])}):
        with pytest.raises(SceneError, match="sensing in a state to restore"):
            env.set_state({**saved, "sensing": spoilt})
    with pytest.raises(SceneError, match="another sensing"):
        env.set_state(LabPendulumEnv(backend="python", substeps=env.substeps, lag=env.scene.parameters()["lag"]
                                     ).get_state())


@pytest.mark.slow
def test_a_state_with_arrays_in_the_order_of_fortran_resumes() -> None:
    """As a file of another program may hold them: the compiled step reads the restored arrays themselves."""
    env = gym.make_vec("LabPendulum-v0", 300, vectorization_mode="vector_entry_point", action_delay=0.02,
                       observation="history")
    actions = np.linspace(-1.0, 1.0, 300, dtype=np.float32)[:, None]
    env.reset(seed=1)
    env.step(actions)
    saved = env.unwrapped.get_state()

    def turned(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: turned(one) for name, one in value.items()}
        return np.asfortranarray(value) if isinstance(value, np.ndarray) else value

    expected = env.step(actions)[0].tobytes()
    env.unwrapped.set_state(turned(saved))
    assert env.step(actions)[0].tobytes() == expected


def test_pickled_vectors_resume_too() -> None:
    env = vector(20, backend="python", max_episode_steps=6, **CASES["slow"])
    env.reset(seed=1)
    actions = np.random.default_rng(1).uniform(-1, 1, (12, 20, 1)).astype(np.float32)
    for action in actions[:4]:
        env.step(action)
    other = pickle.loads(pickle.dumps(env))
    for action in actions[4:]:
        same(other.step(action), env.step(action))


def test_a_sensor_that_is_off_makes_no_program_and_one_that_is_on_leaves_the_motion(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    plain, sensed = (LabPendulumEnv(backend="python", **options) for options in ({}, {"observation": "encoder"}))
    for env in (plain, sensed):
        env.reset(seed=3)
    for action in ACTIONS:
        mine, theirs = (env.step(np.array([action], np.float32)) for env in (sensed, plain))
        mine[4].pop("observed_angle")
        same(mine[1:], theirs[1:])
    monkeypatch.setattr(sensing, "functions", None)
    for kind in (LabPendulumEnv, LabPendulumVectorEnv):
        kind(backend="python").reset(seed=0)
        with pytest.raises(TypeError):
            kind(backend="python", observation="angle")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("options", "shape"), [
    ({"observation": "angle"}, (2,)), ({"observation": "encoder", "velocity_bound": 50.0}, (3,)),
    ({"observation": "history", "history": 5}, (10,)), ({"sensor": {"quantum": 0.01, "noise": 0.01}}, (3,)),
    ({"task": "track", "observation": "angle"}, (6,)), ({"observation_delay": (0.0, 0.04)}, (3,)),
], ids=str)
def test_gymnasiums_checker_passes(options: dict[str, Any], shape: tuple[int, ...]) -> None:
    env = LabPendulumEnv(backend="python", **options)
    assert env.observation_space.shape == shape
    check_env(env, skip_render_check=True)


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("case", PAIRS)
def test_checkers_pass_over_every_pair_of_options(case: str) -> None:
    """Check Gymnasium's checker, with warnings as errors, and this package's for vectors, which compares with singles.
    """
    options = PAIRS[case]
    check_env(LabPendulumEnv(**options), skip_render_check=True)
    made = {"max_episode_steps": 13, **options}
    check_vector_env(partial(gym.make_vec, "LabPendulum-v0", **made), partial(gym.make, "LabPendulum-v0", **made),
                     steps=16)


def test_a_reference_is_seen_without_delay() -> None:
    """Check that what the task shows of its reference is the present one: the agent knows where it is to go."""
    mine, plain = (LabPendulumEnv(backend="python", task="track", **options)
                   for options in ({"observation": "angle", "observation_delay": 0.04}, {}))
    same(mine.reset(seed=0)[0][2:], plain.reset(seed=0)[0][3:])
    for _ in range(5):
        same(mine.step(np.ones(1, np.float32))[0][2:], plain.step(np.ones(1, np.float32))[0][3:])


@pytest.mark.parametrize("kind", ["full", "angle", "encoder", "history"])
def test_angles_from_upright_are_turned(kind: str) -> None:
    """Check a task whose observation measures the angle from upright: cosines and sines change sign, nothing else."""
    task = Task("hold_up", lambda phi: -phi * phi, upright=True)
    options: dict[str, Any] = {"observation": kind, "observation_delay": 0.02, "backend": "python"}
    mine, plain = (LabPendulumEnv(task=task, **options), LabPendulumEnv(task="free", **options))
    many = vector(2, task=task, **options)
    start = {"angle": 0.4, "velocity": 0.5}
    found, wanted, both = mine.reset(options=start)[0], plain.reset(options=start)[0], many.reset(options=start)[0]
    for _ in range(3):
        speeds = [2] if kind in ("full", "encoder") else []
        assert np.array_equal(found, np.where(np.isin(np.arange(len(wanted)), speeds), wanted, -wanted))
        same(both[0], found)
        found, wanted = (env.step(np.ones(1, np.float32))[0] for env in (mine, plain))
        both = many.step(np.ones((2, 1), np.float32))[0]


@pytest.mark.parametrize("sensor", [ROUGH, VirtualSensor(rate=25.0, noise=0.01)])
def test_the_specification_as_json_sees_alike(sensor: Any) -> None:
    env = gym.make("LabPendulum-v0", backend="python", observation="encoder", sensor=sensor, action_delay=(0.0, 0.02))
    assert env.spec is not None
    other = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    same(other.reset(seed=3), env.reset(seed=3))
    same(other.step(np.ones(1, np.float32)), env.step(np.ones(1, np.float32)))


def test_reused_arrays_hold_the_same_observations() -> None:
    """Check copy=False, where steps overwrite the arrays of the step before."""
    envs = [vector(4, backend="python", copy=keep, max_episode_steps=5, autoreset_mode="SameStep", **CASES["history"])
            for keep in (True, False)]
    for env in envs:
        env.reset(seed=0)
    for _ in range(8):
        found = [env.step(np.ones((4, 1), np.float32)) for env in envs]
        same(found[0], found[1])


# --- refusals -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("options", "words"), [
    ({"observation": "encodr"}, "did you mean encoder"), ({"history": 3}, "history=3 is for observation='history'"),
    ({"observation": "history", "history": 0}, "whole number from 1 to 64"),
    ({"observation_delay": -0.02}, "at least 0"), ({"action_delay": 0.013}, "such as 0 or 0.02 s, not 0.013"),
    ({"action_delay": (0.04, 0.02)}, "lower end first"), ({"action_delay": (0.02,)}, "must be a delay or"),
    ({"observation_delay": 100.0}, "at most 1000 control steps"), ({"observation_delay": "long"}, "finite number"),
    ({"sensor": {"rate": 0.0}}, "rate must be a finite number above 0"),
    ({"sensor": {"rats": 1.0}}, "did you mean rate"),
    ({"sensor": 3.0}, "must be a Sensor or a dict"), ({"sensor": {"rate": 30.0}}, "such as 50 or 25 Hz, not 30"),
    ({"sensor": {"rate": 100.0}}, "more substeps"), ({"sensor": {"dropout": 1.0}}, "dropout must be below 1"),
    ({"sensor": {"window": 1.5}}, "window must be a whole number"),
    ({"sensor": {"window": 2, "corner": 3.0}}, "give one of them"), ({"sensor": {"noise": -1.0}}, "noise must be"),
    ({"sensor": VirtualSensor(jitter=0.001)}, "jitter=0"),
    ({"diagnostics": ("energy", "error"), "substeps": 2, "action_delay": 0.01}, "whole control steps"),
    ({"latency": 0.1}, "action_delay="),
])
@pytest.mark.parametrize("kind", [LabPendulumEnv, LabPendulumVectorEnv])
def test_what_no_sensor_can_be_is_refused(kind: Any, options: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        kind(backend="python", **options)
