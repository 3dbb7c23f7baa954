"""Edges of the environments, as users meet them: settings that cannot be changed, specs, seeds, bounds, pickles."""

from __future__ import annotations

import json
import math
import pickle
import subprocess
import sys
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec

import integrators
import pendulum_env
from pendulum_env import SCENES, LabPendulumVectorEnv
from pendulum_env.controllers import SwingUp
from pendulum_env.envs.attributes import FORMAT
from pendulum_env.physics.effects import Gravity, LinearDrag
from pendulum_env.physics.medium import air
from pendulum_env.physics.units import SceneError

IDLE = np.zeros(1, np.float32)


def make(**options: Any) -> Any:
    return gym.make("LabPendulum-v0", backend="python", **options).unwrapped


# --- settings that cannot be changed ---------------------------------------------------------------------------------

SETTINGS = ("length", "mass", "gravity", "max_torque", "gamma", "dt", "substeps", "scene", "integrator", "damping",
            "diagnostics", "task", "omega0", "speed_limit", "rtol", "compensated", "render_mode", "effects", "radius")


@pytest.mark.parametrize("name", SETTINGS)
def test_a_setting_that_would_do_nothing_cannot_be_assigned(name: str) -> None:
    single, vector = make(), LabPendulumVectorEnv(2, backend="python")
    for env, maker in ((single, "gym.make"), (vector, "gym.make_vec")):
        before = getattr(env, name, "none")
        with pytest.raises(AttributeError, match=rf"^{name} cannot be assigned, .*{maker}\("):
            setattr(env, name, 1.0)
        assert getattr(env, name, "none") == before


def test_the_number_of_environments_cannot_be_assigned() -> None:
    vector = LabPendulumVectorEnv(2, backend="python")
    with pytest.raises(AttributeError, match=r"^num_envs cannot be assigned, .*gym.make_vec\("):
        vector.num_envs = 3
    assert vector.num_envs == 2


@pytest.mark.parametrize(("name", "hint"), [
    ("angle", r"reset\(options=\{'angle': 0.1"), ("state", r"reset\(options="), ("theta", r"reset\(options="),
    ("g", "gravity=9.81"), ("max_speed", "speed_limit=8.0"), ("noise", "Sensor")])
def test_words_that_are_no_attributes_cannot_be_assigned_either(name: str, hint: str) -> None:
    for env in (make(), LabPendulumVectorEnv(2, backend="python")):
        with pytest.raises(AttributeError, match=rf"^{name} cannot be assigned.*{hint}"):
            setattr(env, name, 1.0)
        assert not hasattr(env, name)


@pytest.mark.parametrize("name", SETTINGS)
def test_wrappers_pass_assignments_on_to_the_refusal(name: str) -> None:
    wrapped = gym.make("LabPendulum-v0", backend="python")
    vector = gym.make_vec("LabPendulum-v0", 2, vectorization_mode="sync", backend="python")
    for assign in (wrapped.set_wrapper_attr, vector.set_attr):
        # Gymnasium's wrappers have a render_mode of their own, which they refuse to assign.
        with pytest.raises(AttributeError, match=name if name == "render_mode" else f"{name} cannot be assigned"):
            assign(name, 1.0)
    wrapped.set_wrapper_attr("mine", 1.0)
    assert wrapped.get_wrapper_attr("mine") == 1.0


def test_attributes_are_read_as_before() -> None:
    env = make(dt=0.01, substeps=2)
    assert (env.dt, env.substeps, env.task.name, env.integrator) == (0.01, 2, "swing_up", "rk4")
    assert env.omega0 == SCENES["lab"].omega0
    assert env.length == SCENES["lab"].body.length
    assert not hasattr(env, "wind_speed")
    with pytest.raises(AttributeError, match="The scene 'lab' has no parameter 'wind_speed'"):
        _ = env.wind_speed
    vector = LabPendulumVectorEnv(2, backend="python")
    with pytest.raises(AttributeError, match="has no attribute 'length'"):  # they may differ; see get_attr
        _ = vector.length


# --- info ------------------------------------------------------------------------------------------------------------


def test_info_has_the_same_keys_in_every_step() -> None:
    env = make(task="balance", speed_limit=5.0)
    keys = env.reset(seed=0)[1].keys()
    reasons = []
    for _ in range(200):
        *_, ended, _, info = env.step(np.ones(1, np.float32))
        assert info.keys() == keys
        reasons.append(info["stop_reason"])
        if ended:
            break
    assert {*reasons[:-1]} == {""}
    assert reasons[-1] == "fell"


# --- what the observation space says ---------------------------------------------------------------------------------


@pytest.mark.parametrize("bound", [8.0, math.inf])
def test_a_bound_of_the_velocity_is_that_of_the_space(bound: float) -> None:
    env, free = make(velocity_bound=bound, task="free"), make(task="free")
    vector = LabPendulumVectorEnv(2, backend="python", velocity_bound=bound, task="free")
    start = {"angle": 3.0, "velocity": 9.0}
    assert env.observation_space.high[2] == vector.single_observation_space.high[2] == bound
    seen = [(env.reset(options=start)[0], free.reset(options=start)[0], vector.reset(options=start)[0][1])]
    for _ in range(20):
        seen.append((env.step(IDLE)[0], free.step(IDLE)[0], vector.step(np.zeros((2, 1), np.float32))[0][1]))
    for cut, whole, many in seen:
        assert env.observation_space.contains(cut)
        assert cut.tolist() == many.tolist() == [*whole[:2].tolist(), min(max(whole[2], -bound), bound)]
    assert max(abs(whole[2]) for _, whole, _ in seen) > 8.0


def test_wrappers_that_need_a_bound_work_with_one() -> None:
    bounded = gym.wrappers.RescaleObservation(gym.make("LabPendulum-v0", backend="python", velocity_bound=20.0),
                                              np.float32(-1.0), np.float32(1.0))
    seen = bounded.reset(seed=0)[0]
    speed = float(np.asarray(bounded.unwrapped.get_state()["state"])[2])
    assert seen[2] == pytest.approx(speed / 20.0, abs=2e-2)
    for bad in (0.0, -1.0, math.nan, "8"):
        with pytest.raises(SceneError, match="velocity_bound must be a finite number above 0"):
            make(velocity_bound=bad)


# --- warnings --------------------------------------------------------------------------------------------------------


@pytest.mark.quick("rk4-20.0", "forward_euler-1000.0", "velocity_verlet-1000000000000.0")
@pytest.mark.parametrize("dt", [20.0, 50.0, 1e3, 1e6, 1e12])
@pytest.mark.parametrize("name", ["forward_euler", "rk4", "velocity_verlet", "heun", "ab4", "forest_ruth"])
def test_steps_beyond_every_limit_are_warned_of_however_long(name: str, dt: float) -> None:
    with pytest.warns(UserWarning, match=f"Steps of .* are too long for {name} in the scene 'lab'"):
        make(integrator=name, dt=dt, substeps=20 if name == "ab4" else 1)


def test_a_scene_without_a_motor_asks_for_a_task() -> None:
    words = "'exercise' has no motor, so that the usual task, swing_up, cannot be solved; choose task='free'"
    for build in (lambda **more: make(scene="exercise", **more),
                  lambda **more: LabPendulumVectorEnv(2, "exercise", backend="python", **more)):
        with pytest.warns(UserWarning, match=words) as seen:
            assert build().task.name == "swing_up"
        assert len(seen) == 1
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for more in ({"task": "free"}, {"task": "swing_up"}, {"warn": False}):
                build(**more)
        with pytest.raises(SceneError, match="has no motor"):
            build(careful=True)


MEANT = {"frame_skip": "dt.*substeps", "control_freq": "dt=.*substeps", "g": "gravity=",
         "m": "mass=", "l": "length=", "max_speed": "speed_limit=", "reward": "task=",
         "latency": "observation_delay", "delay": "observation_delay", "noise": "Sensor",
         "drag": "damping=", "max_steps": "max_episode_steps=", "method": "integrator=", "solver": "integrator=",
         "time_step": "dt="}


@pytest.mark.parametrize("word", MEANT)
def test_words_of_other_programs_have_the_right_hint(word: str) -> None:
    for build in (make, lambda **more: LabPendulumVectorEnv(2, **more),
                  lambda **more: pendulum_env.rollout("lab", **more)):
        with pytest.raises(TypeError, match=f"unexpected keyword argument '{word}'; .*{MEANT[word]}") as error:
            build(**{word: 1.0})
        assert "did you mean" not in str(error.value)


# --- specs -----------------------------------------------------------------------------------------------------------

SAVED: dict[str, dict[str, Any]] = {
    "scene": {"scene": SCENES["water"].replace(length=0.4), "task": "free"},
    "method": {"integrator": integrators.get("velocity_verlet")},
    "parts": {"medium": air(5.0), "effects": (Gravity(), LinearDrag(gamma=0.1)), "task": "free"},
    "numpy": {"length": np.float64(0.4), "dt": np.float32(0.25) / 16},
}


@pytest.mark.parametrize("case", SAVED)
def test_a_spec_in_json_makes_the_same_environment(case: str) -> None:
    env = gym.make("LabPendulum-v0", backend="python", **SAVED[case])
    again = gym.make(EnvSpec.from_json(env.spec.to_json())).unwrapped
    assert again.scene == env.unwrapped.scene
    assert again.get_state()["made_for"] == env.unwrapped.get_state()["made_for"]
    assert gym.make(env.spec).unwrapped.scene == env.unwrapped.scene
    json.loads(env.spec.to_json())


def test_a_spec_that_json_cannot_hold_is_refused_by_the_arguments_name() -> None:
    mine = integrators.get("rk4").__class__(
        name="mine", order=1, source="a student", summary="Euler", a=((0,),), b=(1,))
    env = gym.make("LabPendulum-v0", backend="python", integrator=mine)
    with pytest.raises(SceneError, match=r"^integrator=<RungeKutta: mine, order 1> cannot be written as JSON"):
        env.spec.to_json()
    assert gym.make(env.spec).unwrapped.integrator == "mine"


# --- seeds and starts ------------------------------------------------------------------------------------------------


def test_seeds_of_a_vector_are_those_of_its_environments() -> None:
    env = gym.make_vec("LabPendulum-v0", num_envs=3, backend="python")
    fresh = env.np_random_seed
    assert len(fresh) == len(set(fresh)) == 3
    env.reset(seed=3)
    assert env.np_random_seed == (3, 4, 5)
    env.reset(seed=[7, None, 2**100])
    assert env.np_random_seed == (7, 4, 2**100)
    other = gym.make_vec("LabPendulum-v0", num_envs=3, backend="python")
    assert other.reset(seed=list(env.np_random_seed))[0].tolist() == env.reset(seed=[7, 4, 2**100])[0].tolist()


@pytest.mark.parametrize(("task", "centre"), [("balance", math.pi), ("swing_up", 0.0)])
def test_what_a_start_leaves_out_comes_from_the_task(task: str, centre: float) -> None:
    env, vector = make(task=task), LabPendulumVectorEnv(2, backend="python", task=task)
    usual = env.reset(seed=5)[1]
    part = env.reset(seed=5, options={"velocity": 0.0})[1]
    assert abs(math.remainder(part["angle"] - centre, math.tau)) < 0.1
    assert (part["angle"], part["velocity"]) == (usual["angle"], 0.0)
    assert env.reset(seed=5, options={"angle": 0.3})[1]["velocity"] == usual["velocity"]
    many = vector.reset(seed=5, options={"velocity": np.array([0.0, 1.0])})[1]
    assert many["angle"][0] == usual["angle"]
    assert many["velocity"].tolist() == [0.0, 1.0]
    free = make(task="free")
    assert free.reset(options={"velocity": 1.0})[1]["angle"] == SCENES["lab"].run.angle


# --- rewards ---------------------------------------------------------------------------------------------------------


def returned(env: Any, policy: Any) -> tuple[float, int]:
    seen, total = env.reset(seed=0)[0], 0.0
    for taken in range(1, 501):
        seen, reward, ended, *_ = env.step(np.asarray(policy(seen), np.float32).reshape(1))
        total += reward
        if ended:
            return total, taken
    return total, 500


@pytest.mark.slow
def test_a_penalty_makes_giving_up_worse_than_swinging_up() -> None:
    """Compare with the numbers in the docstring: -462 after 78 steps, -555 after 500."""
    push = np.sign
    early, steps = returned(make(speed_limit=8.0), lambda seen: push(seen[2]) or 1.0)
    expert, _ = returned(make(), SwingUp(SCENES["lab"]))
    assert (early, steps) == (pytest.approx(-462.0, rel=0.03), 78)
    assert expert == pytest.approx(-555.0, rel=0.03)
    assert early > expert > early - 1000.0
    fined, _ = returned(make(speed_limit=8.0, speed_penalty=1000.0), lambda seen: push(seen[2]) or 1.0)
    assert fined == pytest.approx(early - 1000.0, rel=1e-12)
    for mode in ("NextStep", "SameStep"):
        vector = LabPendulumVectorEnv(2, backend="python", speed_limit=[8.0, 20.0], speed_penalty=1000.0,
                                      autoreset_mode=mode)
        seen, totals, over = vector.reset(seed=[0, 0])[0], np.zeros(2), False
        while not over:
            actions = np.where(seen[:, 2:] == 0.0, 1.0, np.sign(seen[:, 2:])).astype(np.float32)
            seen, rewards, ended, *_ = vector.step(actions)
            totals, over = totals + rewards, ended[0]
        assert totals[0] == pytest.approx(fined, rel=1e-12)
        assert totals[1] > -1000.0


def test_numbers_that_diverge_cost_the_penalty_too() -> None:
    """With a step that is far too long the episode ends early; only its last reward differs."""
    options: dict[str, Any] = {"integrator": "forward_euler", "dt": 20.0, "speed_limit": math.inf, "warn": False}
    free, steps = returned(make(**options), lambda seen: 1.0)
    fined, again = returned(make(speed_penalty=1000.0, **options), lambda seen: 1.0)
    assert steps == again < 500
    assert fined == pytest.approx(free - 1000.0, rel=1e-12)
    vector = LabPendulumVectorEnv(1, backend="python", speed_penalty=1000.0, **options)
    total, ended = 0.0, [False]
    vector.reset(seed=[0])
    while not ended[0]:
        _, rewards, ended, _, infos = vector.step(np.ones((1, 1), np.float32))
        total += rewards[0]
    assert infos["stop_reason"][0] == "diverged"
    assert total == pytest.approx(fined, rel=1e-12)


# --- pickles, threads ------------------------------------------------------------------------------------------------


def test_pickles_of_another_version_are_refused_in_a_sentence() -> None:
    for env in (make(), LabPendulumVectorEnv(2, backend="python")):
        env.reset(seed=0)
        assert pickle.loads(pickle.dumps(env)).scene == env.scene
        old = {name: value for name, value in env.__getstate__().items() if name != "format"}
        for state in (old, {**old, "format": FORMAT + 1}):
            with pytest.raises(SceneError, match="was pickled by another version of the package"):
                type(env).__new__(type(env)).__setstate__(state)


SHARED = """_acts _bounded _camera _checks _delays _dt _episode_steps _h _integrator _look _np_random _np_random_seed
    _own_steps _penalty _randomization _rate _scene _sensing _settings _settled _spec _substeps _task _turning
    _velocity_bound action_space metadata observation_space"""
KEPT = {
    "LabPendulumEnv": f"""{SHARED} _ahead _before _explained _in_flow _judge _last _machine _observed _omega0
        _parameters _plain _reel _share _slackened _speed_limit _state _upright window""",
    "LabPendulumVectorEnv": f"""{SHARED} _bank _batch _begun _everyone _explained _marks _masks _members _names
        _num_envs _num_threads _over _plain _reused _running _seeds _seen_before _slack _steps _streams _told
        autoreset_mode single_action_space single_observation_space""",
}
"""Attributes in format 9. Whoever changes them raises FORMAT, so that older pickles are refused."""


@pytest.mark.parametrize("kind", KEPT)
def test_the_format_of_pickles_is_that_of_these_attributes(kind: str) -> None:
    env = make() if kind == "LabPendulumEnv" else LabPendulumVectorEnv(2, backend="python")
    env.reset(seed=0)
    assert FORMAT == 9
    assert {*env.__getstate__()} - {"format", "_np_random", "_np_random_seed", "_made_by"} == {
        *KEPT[kind].split()} - {"_np_random", "_np_random_seed"}


THREADS = """
import threading
import gymnasium as gym
failures, together = [], threading.Barrier(8)
def made(i):
    together.wait()
    try:
        gym.make("pendulum_env:LabPendulum-v0", backend="python", length=0.3 + 0.01 * i).reset(seed=0)
    except BaseException as error:
        failures.append(repr(error))
threads = [threading.Thread(target=made, args=(i,)) for i in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert not failures, failures
"""


@pytest.mark.slow
def test_eight_threads_make_environments_at_once() -> None:
    for _ in range(3):
        subprocess.run([sys.executable, "-c", THREADS], check=True)
