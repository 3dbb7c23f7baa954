"""Pendulum-v1 itself beside the scene and task ``gymnasium``, and MuJoCo beside those of dm_control's pendulum."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from beside import environment

from pendulum_env import SCENES, LabPendulumEnv, LabPendulumVectorEnv, SceneError, rollout
from pendulum_env.controllers import swing_up
from pendulum_env.physics.effects import EFFECTS

TWIN = "LabPendulumGymnasium-v0"
LIKE: dict[str, Any] = {"scene": "gymnasium", "task": "gymnasium"}
SINGLE = 2.0**-23
"""Spacing of float32 at 1."""


Shares = Callable[[np.random.Generator, int], Any]


def shares(source: np.random.Generator, size: int) -> np.ndarray[Any, Any]:
    """Return random actions with few bits: Pendulum-v1 multiplies its torque by 3 in float32, which is then exact."""
    return (np.round(source.uniform(-1.1, 1.1, (size, 1)) * 256.0) / 256.0).astype(np.float32)


def ordinary(source: np.random.Generator, size: int) -> np.ndarray[Any, Any]:
    """Return random actions as a policy gives them, with all bits of float32."""
    return source.uniform(-1.1, 1.1, (size, 1)).astype(np.float32)


def compared(episodes: int, seed: int = 0) -> tuple[float, float]:
    """Return the largest differences of observations and rewards, in units of float32's spacing there."""
    return tuple(float(each.max()) for each in differences(episodes, seed))  # type: ignore[return-value]


def differences(episodes: int, seed: int = 0, shares: Shares = shares, kind: type = np.float32) -> tuple[Any, Any]:
    """Return each episode's largest differences of observations and rewards, in units of float32's spacing there.

    Each episode of Pendulum-v1, and the environment of a vector with its seed, get the same random torques; ``kind`` is
    the type of number in which Pendulum-v1 gets them.
    """
    source, theirs = np.random.default_rng(seed), gym.make("Pendulum-v1", disable_env_checker=True)
    steps = 200
    actions = np.stack([shares(source, episodes) for _ in range(steps)])
    vector = gym.make_vec(TWIN, num_envs=episodes)
    rows = [(vector.reset(seed=seed)[0], np.zeros(episodes))]
    ends = []
    for action in actions:
        observation, reward, terminated, truncated, _ = vector.step(action)
        rows.append((observation, reward))
        ends.append(truncated)
        assert not terminated.any()
    assert not np.any(ends[:-1])
    assert np.all(ends[-1]), "200 steps an episode"
    seen, rewards = (np.array(column) for column in zip(*rows, strict=True))
    worst = np.zeros((2, episodes))
    for episode in range(episodes):
        observation, _ = theirs.reset(seed=seed + episode)
        over = False
        for k in range(steps):
            apart = np.abs(seen[k, episode] - observation) / np.maximum(1.0, np.abs(observation))
            worst[0, episode] = max(worst[0, episode], float(np.max(apart)))
            observation, reward, _, over, _ = theirs.step(2.0 * actions[k, episode].astype(kind))
            more = abs(rewards[k + 1, episode] - float(reward)) / max(1.0, abs(float(reward)))
            worst[1, episode] = max(worst[1, episode], more)
        assert over
    return worst[0] / SINGLE, worst[1] / SINGLE


def test_pendulum_v1_itself() -> None:
    assert max(compared(30)) < 1.0


@pytest.mark.slow
def test_pendulum_v1_itself_in_a_thousand_episodes() -> None:
    assert max(compared(1000, seed=1000)) < 1.0


@pytest.mark.slow
def test_with_ordinary_actions_pendulum_v1_rounds_its_torque() -> None:
    """Pendulum-v1 multiplies the torque by 3 in float32, and swings near the top magnify that: a fifth of the episodes
    part by more than 1e-6, by up to some thousandths. With the same torques in float64 none does, nor with NumPy 1,
    where a number of Python times a float32 is a float64.
    """
    rounded, _ = differences(100, shares=ordinary)
    if isinstance(3.0 * np.float32(1.0), np.float64):
        assert rounded.max() < 1.0
    else:
        assert 15 <= np.sum(SINGLE * rounded > 1e-6) <= 35
        assert 1e-5 < SINGLE * rounded.max() < 1e-2
    assert max(float(each.max()) for each in differences(100, shares=ordinary, kind=np.float64)) < 1.0


def test_the_single_environment_is_pendulum_v1_too() -> None:
    theirs, ours = gym.make("Pendulum-v1"), gym.make(TWIN, backend="python")
    assert (ours.unwrapped.dt, ours.unwrapped.integrator) == (0.05, "symplectic_euler")  # type: ignore[attr-defined]
    for options in (None, {"x_init": 0.3, "y_init": 2.0}, {"x_init": 0.0}):
        observation, _ = theirs.reset(seed=5, options=options)
        seen, info = ours.reset(seed=5, options=options)
        assert seen == pytest.approx(observation, abs=SINGLE)
        assert math.cos(info["angle"]) == pytest.approx(-observation[0], abs=SINGLE)
        for action in shares(np.random.default_rng(1), 200):
            observation, reward, *over, _ = theirs.step(2.0 * action)
            seen, own, *ends, info = ours.step(action)
            assert seen == pytest.approx(observation, rel=SINGLE, abs=SINGLE)
            assert own == pytest.approx(float(reward), rel=SINGLE)
            assert ends == over
    assert over == [False, True]


def test_angles_in_options_and_infos_count_from_hanging() -> None:
    """Check that Gymnasium's angle, 0 upright, is the angle from hanging less pi."""
    theirs, ours = gym.make("Pendulum-v1").unwrapped, LabPendulumEnv(**LIKE, backend="python")
    theirs.reset(seed=0)
    theirs.state = np.array([0.7, -0.4])  # type: ignore[attr-defined]
    seen, info = ours.reset(options={"angle": 0.7 + math.pi, "velocity": -0.4})
    assert seen == pytest.approx([math.cos(0.7), math.sin(0.7), -0.4], abs=SINGLE)
    assert info["angle"] == 0.7 + math.pi
    assert ours.step(np.array([0.25], np.float32))[0] == pytest.approx(theirs.step(np.array([0.5]))[0], abs=SINGLE)
    with pytest.raises(SceneError, match="reset has no option 'x_inti'; did you mean x_init"):
        ours.reset(options={"x_inti": 0.1})
    with pytest.raises(SceneError, match="x_init must be a finite number of at least 0"):
        ours.reset(options={"x_init": -0.1})
    with pytest.raises(SceneError, match="reset has no option 'x_init'"):
        LabPendulumEnv(backend="python").reset(options={"x_init": 0.1})


# --- the clip ---------------------------------------------------------------------------------------------------------


def test_the_clip_takes_energy_and_the_ledger_says_how_much() -> None:
    """Compute the energy from Pendulum-v1's own states, and the clip's part from a step without it."""
    env = LabPendulumEnv(**LIKE, backend="python")
    _, info = env.reset(options={"angle": 1.0, "velocity": 7.9})
    theta, omega, taken, clipped = 1.0, 7.9, 0.0, 0

    def energy(theta: float, omega: float) -> float:
        return omega * omega / 6.0 + 5.0 * (1.0 - math.cos(theta))

    first = energy(theta, omega)
    assert info["energy"] == pytest.approx(first)
    for k in range(100):
        share = 1.0 if k % 40 < 20 else -0.5
        free = omega + 0.05 * (-15.0 * math.sin(theta) + 6.0 * share)
        omega = min(max(free, -8.0), 8.0)
        before = energy(theta + 0.05 * free, free)
        theta += 0.05 * omega
        taken += before - energy(theta, omega)
        clipped += free != omega
        *_, info = env.step(np.array([share], dtype=np.float32))
        assert info["heat_clip"] == pytest.approx(taken, abs=1e-11)
        assert info["heat"] == info["heat_clip"]
        assert info["energy"] == pytest.approx(energy(theta, omega), abs=1e-11)
        assert info["energy"] - first == pytest.approx(info["work"] - info["heat"] + info["energy_residual"], abs=1e-12)
    assert clipped > 10
    assert abs(taken) > 1.0


@pytest.mark.parametrize("method", ["rk4", "dop853", "velocity_verlet", "gauss4", "taylor"])
def test_with_an_accurate_method_the_clip_takes_what_the_motor_gives(method: str) -> None:
    """Check a bob at the bound under full torque: with the clip, the energy balances to the error of the method."""
    run = rollout("gymnasium", integrator=method, angle=0.0, velocity=7.99, control=1.0, dt=0.01, duration=4.0,
                  backend="python", warn=False)
    assert np.max(np.abs(run.velocity)) == 8.0
    assert run.heat_by_effect["clip"][-1] > 1.0
    assert np.max(np.abs(run.energy_residual)) < (5e-3 if method == "velocity_verlet" else 1e-5)
    gained = run.energy[-1] - run.energy[0]
    assert run.heat_by_effect["clip"][-1] == pytest.approx(2.0 * run.angle[-1] - gained, abs=5e-3)


def test_no_other_scene_clips() -> None:
    assert [name for name, scene in SCENES.items() if scene.has("clip")] == ["gymnasium"]
    assert [name for name, effect in EFFECTS.items() if effect.limit] == ["clip"]
    info = LabPendulumEnv(scene="lab", diagnostics=("energy", "heat_by_effect"), backend="python").reset(seed=0)[1]
    assert "heat_clip" not in info


def test_a_clipped_motion_has_no_reference() -> None:
    from pendulum_env.truth.reference import StudyError, reference

    assert reference(SCENES["gymnasium"], 1.0, 0.0, [1.0]).angle.shape == (1,)
    with pytest.raises(StudyError, match=r"clips the velocity at 8 rad/s.*no motion is the true one"):
        reference(SCENES["gymnasium"], 3.0, 6.0, [1.0])


@pytest.mark.slow
def test_the_controller_swings_pendulum_v1_up() -> None:
    """Check that it earns as much as good agents in Pendulum-v1: above -400 in every episode."""
    vector = gym.make_vec(TWIN, num_envs=20, diagnostics=())
    policy, total = swing_up(vector), np.zeros(20)
    theirs = gym.make("Pendulum-v1")
    seen, _ = vector.reset(seed=0)
    for _ in range(200):
        seen, reward, *_ = vector.step(policy(seen))
        total += reward
    assert total.min() > -450.0
    assert total.mean() > -220.0
    observation, same = theirs.reset(seed=3)[0], 0.0
    for _ in range(200):
        observation, reward, *_ = theirs.step(2.0 * policy(observation))
        same += float(reward)
    assert same == pytest.approx(total[3], rel=1e-3)


# --- dm_control -------------------------------------------------------------------------------------------------------

PROGRAM = Path(__file__).parent / "mujoco_pendulum.py"


def mujoco(folders: pytest.TempPathFactory, *cases: dict[str, Any]) -> list[Any]:
    """Return angle from upright and velocity of MuJoCo's pendulum at every control step, for each case."""
    python = environment(folders, "mujoco", "mujoco==4.0.0")
    ran = subprocess.run([python, PROGRAM], input=json.dumps(cases), capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return [np.array(rows) for rows in json.loads(ran.stdout)]


def ours(case: dict[str, Any]) -> np.ndarray[Any, Any]:
    """Return the same of the scene dm_control."""
    env = LabPendulumEnv("dm_control", integrator=case["method"], task="dm_control", substeps=case["substeps"],
                         warn=False)
    env.reset(options={"angle": case["angle"] + math.pi, "velocity": case["velocity"]})
    rows = []
    for share in case["controls"]:
        seen, reward, *_, info = env.step(np.array([share], dtype=np.float32))
        phi = info["angle"] - math.pi
        rows.append((phi, info["velocity"]))
        assert seen[:2] == pytest.approx([math.cos(phi), math.sin(phi)], abs=1e-6)
        assert reward == float(math.cos(phi) >= math.cos(math.radians(8.0)))
    return np.array(rows)


def euler(case: dict[str, Any]) -> np.ndarray[Any, Any]:
    """Return the same by the formula of MuJoCo's Euler: the damping implicit, then the angle with the new velocity."""
    phi, omega, h, inertia = case["angle"], case["velocity"], 0.02 / case["substeps"], 0.251
    rows = []
    for share in case["controls"]:
        for _ in range(case["substeps"]):
            torque = 9.81 * 0.5 * math.sin(phi) + float(np.float32(share)) - 0.1 * omega
            omega += h * torque / (inertia + h * 0.1)
            phi += h * omega
        rows.append((phi, omega))
    return np.array(rows)


@pytest.mark.slow
def test_dm_controls_pendulum_in_mujoco(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Accurate solutions agree; Euler's differ by MuJoCo's implicit damping, by an amount that shrinks with the step.

    The XML of dm_control 1.0.50 itself, read by MuJoCo 4.0.0, gave the same motion within 1e-15.
    """
    source = np.random.default_rng(3)
    controls = [float(np.float32(x)) for x in source.uniform(-1.0, 1.0, 150)]
    start = {"angle": 2.6, "velocity": 0.0, "controls": controls}
    fine = {**start, "method": "dop853", "integrator": "RK4", "substeps": 20}
    eulers = [{**start, "method": "symplectic_euler", "integrator": "Euler", "substeps": n} for n in (1, 4, 16)]
    theirs = mujoco(tmp_path_factory, fine, *eulers)
    assert np.max(np.abs(theirs[0] - ours(fine))) < 1e-7
    gaps = []
    for case, rows in zip(eulers, theirs[1:], strict=True):
        assert np.max(np.abs(rows - euler(case))) < 1e-9, "MuJoCo takes this step"
        gaps.append(float(np.max(np.abs(rows - ours(case)))))
    assert gaps[0] < 0.1
    assert [gaps[0] / gaps[1], gaps[1] / gaps[2]] == pytest.approx([4.0, 4.0], rel=0.3)


def test_dm_controls_start_and_length() -> None:
    env = LabPendulumVectorEnv(500, "dm_control", task="dm_control", backend="python")
    seen, infos = env.reset(seed=0)
    assert np.all(infos["velocity"] == 0.0)
    assert (infos["angle"].min(), infos["angle"].max()) == pytest.approx((0.0, 2.0 * math.pi), abs=0.05)
    assert np.max(np.abs(seen[:, 0] + np.cos(infos["angle"]))) < 1e-6
    single = LabPendulumEnv("dm_control", task="dm_control", backend="python", diagnostics=())
    single.reset(seed=0)
    count = 1
    while not single.step(np.zeros(1, np.float32))[3]:
        count += 1
    assert count == 1000


def test_heat_of_the_clip_beyond_the_horizontal_is_exact() -> None:
    """Compare it in 30 digits for a step of symplectic Euler that is clipped while it passes the horizontal."""
    scene, h, start = SCENES["gymnasium"], 0.05, -1.7
    run = rollout(scene, integrator="symplectic_euler", angle=start, velocity=8.0, dt=h, duration=h,
                  diagnostics=("heat_by_effect",), backend="python")
    with mpmath.workdps(30):
        rate = mpmath.mpf(scene.coefficients["gravity_rate"])
        speed = 8 - mpmath.mpf(h) * rate * mpmath.sin(start)
        free = start + h * speed
        fallen = rate * (mpmath.cos(free - h * (speed - 8)) - mpmath.cos(free))
        heat = scene.inertia * ((speed**2 - 64) / 2 + fallen)
        assert speed > 8
        assert run.velocity[-1] == 8.0
        assert abs(run.heat_by_effect["clip"][-1] / heat - 1) < 1e-14


def test_half_widths_of_the_start_are_the_same_in_a_vector() -> None:
    given: dict[str, Any] = {"seed": 3, "options": {"x_init": 0.01, "y_init": 0.2}}
    usual: dict[str, Any] = {"task": "gymnasium", "backend": "python"}
    infos = LabPendulumVectorEnv(3, "gymnasium", **usual).reset(**given)[1]
    single = LabPendulumEnv("gymnasium", **usual).reset(**given)[1]
    assert (infos["angle"][0], infos["velocity"][0]) == (single["angle"], single["velocity"])
    assert (np.abs(infos["velocity"]) <= 0.2).all()
    assert len({*infos["velocity"].tolist()}) == 3
