"""Tests of controllers: they swing the bob up and hold it in an accurate simulation, and agree with theory."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.typing import NDArray

import pendulum_env
from pendulum_env import SCENES, Scene, SceneError, rollout
from pendulum_env.controllers import RandomPolicy, SwingUp, swing_up
from pendulum_env.controllers.regulator import model_of, sampled
from pendulum_env.controllers.swinging import REACH
from pendulum_env.engine.machine import Machine
from pendulum_env.physics.effects import Motor, PeriodicTorque
from pendulum_env.physics.effects.motor import motor_advance

Array = NDArray[np.float64]

UPRIGHT = math.radians(5.0)
LAB = SCENES["lab"]
WITH_MOTOR = [name for name, scene in SCENES.items() if scene.has("motor")]
SWUNG_UP = ("lab", "sticky_bearing", "windy", "moon")
"""Scenes whose motor swings the bob up within seconds, as tested; a new scene's motor may fail."""
NO_MOTOR = {name: scene for name, scene in SCENES.items() if name not in WITH_MOTOR}


@cache
def designed(scene: Scene) -> SwingUp:
    return SwingUp(scene)


def made(scene: Scene) -> SwingUp:
    """Return a controller without memory, designed once for a scene."""
    controller = copy.copy(designed(scene))
    controller.reset()
    return controller


def away(angle: Any) -> Any:
    """Return the angle from the top, in [-pi, pi)."""
    return np.remainder(angle, 2.0 * math.pi) - math.pi


def played(
    controller: Any, scene: Scene, seconds: float, start: tuple[float, float] = (0.0, 0.0), seed: int = 0,
    dt: float = 0.02,
) -> tuple[Array, Array, Array]:
    """Return angle from the top, velocity and action at every control step, by dop853 to 1e-9, or at tenths of a step.
    """
    how: dict[str, Any] = {"substeps": 10} if scene.has("coulomb_friction") else {"rtol": 1e-9}
    env = gym.make("LabPendulum-v0", scene=scene, integrator="dop853", backend="python", dt=dt, max_episode_steps=10**9,
                   **how).unwrapped
    seen, info = env.reset(seed=seed, options=dict(zip(("angle", "velocity"), start, strict=True)))
    rows = []
    for _ in range(round(seconds / dt)):
        action = controller(seen)
        rows.append((away(info["angle"]), info["velocity"], float(action[0])))
        seen, _, terminated, _, info = env.step(action)
        assert not terminated
    phi, velocity, share = np.array(rows).T
    return phi, velocity, share


def held(phi: Array, seconds: float = 5.0, dt: float = 0.02) -> bool:
    """Return True if the bob was upright without a break in the last ``seconds``."""
    return bool(np.all(np.abs(phi[-round(seconds / dt):]) < UPRIGHT))


# --- swinging up ----------------------------------------------------------------------------------------------------


@pytest.mark.quick("lab", "moon")
@pytest.mark.parametrize("name", SWUNG_UP)
def test_swings_up_from_rest_and_stays_up(name: str) -> None:
    phi, _, share = played(made(SCENES[name]), SCENES[name], 9.0)
    assert held(phi)
    assert np.abs(share).max() == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_swings_up_in_gusts(seed: int) -> None:
    phi, _, _ = played(made(SCENES["windy"]), SCENES["windy"], 20.0, seed=seed)
    assert held(phi, 15.0)


@pytest.mark.slow
@pytest.mark.parametrize("lag", [0.05, 0.2])
@pytest.mark.parametrize("name", [name for name in SWUNG_UP if name != "windy"])
def test_swings_up_with_a_motor_that_lags(name: str, lag: float) -> None:
    scene = SCENES[name].replace(lag=lag)
    assert held(played(SwingUp(scene), scene, 12.0)[0])


def test_a_forgotten_lag_does_not_hold() -> None:
    scene = LAB.replace(lag=0.2)
    assert not held(played(made(LAB), scene, 12.0)[0])


def test_presets_that_cannot_be_swung_up_say_why() -> None:
    assert {*SWUNG_UP} <= {*WITH_MOTOR}
    for name, scene in NO_MOTOR.items():
        wire = scene.body.suspension == "wire"
        with pytest.raises(SceneError, match="a wire cannot carry one" if wire else "has no motor for a swing-up"):
            SwingUp(name)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.2, 0.36, 1.5])
@pytest.mark.parametrize("name", [name for name, scene in NO_MOTOR.items() if scene.body.suspension == "rod"])
def test_presets_on_a_rod_are_swung_up_by_a_motor_of_enough_torque(name: str, share: float) -> None:
    """A motor with this share of the restoring torque at 1 rad swings a preset's body up, or an error says why not."""
    scene = NO_MOTOR[name]
    scene = scene.with_effects((*scene.effects, Motor(max_torque=share * scene.restoring)))
    refused = {"textbook": "no unstable top", "torsion": "no unstable top",
               "chaotic": "holding the bob takes up to 1.5 N m", "kapitza": "holding the bob takes up to 0.8 N m"}
    if name in refused:
        with pytest.raises(SceneError, match=refused[name]):
            SwingUp(scene)
        return
    phi, _, _ = played(SwingUp(scene), scene, 9.0 * 2.0 * math.pi / scene.omega0)
    assert held(phi)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "torque", "dt"), [("chaotic", 2.0, 0.02), ("kapitza", 1.0, 0.001)])
def test_drives_are_withstood_by_a_stronger_motor(name: str, torque: float, dt: float) -> None:
    scene = SCENES[name].with_effects((*SCENES[name].effects, Motor(max_torque=torque)))
    phi, _, _ = played(SwingUp(scene, dt), scene, 8.0, dt=dt)
    assert held(phi, 5.0, dt)


@pytest.mark.slow
def test_in_water_the_motor_has_to_lift() -> None:
    rod = SCENES["water"].replace(suspension="rod")
    weight = rod.gravity * rod.weight_moment
    with pytest.raises(SceneError, match=f"lifting the bob takes {weight:.3g} N m"):
        SwingUp(rod.with_effects((*rod.effects, Motor(max_torque=0.9 * weight))))
    scene = rod.with_effects((*rod.effects, Motor(max_torque=1.2 * weight)))
    assert held(played(SwingUp(scene), scene, 10.0)[0])


@pytest.mark.slow
def test_the_weakest_motor_is_where_losses_outweigh_it() -> None:
    """A motor that always pushes with the motion reaches the top above the torque named in the error, and not below it.
    """
    said = model_of(LAB)
    needed = float(said.rising[0] + said.falling[-1]) / (4.0 * math.pi) * LAB.inertia
    with pytest.raises(SceneError, match=f"pumping {needed:.3g} N m"):
        SwingUp(LAB.replace(max_torque=0.999 * needed))
    for torque, comes in ((0.95 * needed, False), (1.1 * needed, True)):
        env = gym.make("LabPendulum-v0", scene="lab", max_torque=torque, max_episode_steps=10**9, diagnostics=())
        seen, _ = env.reset(options={"angle": 0.1, "velocity": 0.0})
        least = math.pi
        for _ in range(40_000):
            seen, *_ = env.step(np.sign(seen[2:]))
            least = min(least, abs(math.atan2(-seen[1], -seen[0])))
        assert (least < 0.05) == comes


def test_a_constant_torque_is_known() -> None:
    """A constant torque is a bias, which the motor cancels; a periodic torque is a disturbance."""
    steady = PeriodicTorque(drive_torque=0.01, drive_rate=0.0)
    model = model_of(LAB.with_effects((*LAB.effects, steady)))
    assert (model.bias, model.disturbance) == (pytest.approx(0.01 / LAB.inertia), 0.0)
    swaying = model_of(LAB.with_effects((*LAB.effects, PeriodicTorque(drive_torque=0.01, drive_rate=3.0))))
    assert (swaying.bias, swaying.disturbance) == (pytest.approx(0.0, abs=1e-12), pytest.approx(0.01 / LAB.inertia))
    scene = LAB.with_effects((*LAB.effects, steady))
    assert held(played(SwingUp(scene), scene, 9.0)[0])


def test_errors_name_what_is_wrong() -> None:
    weak = r"The motor of 0.0005 N m is too weak in .* 'lab': lifting the bob takes 0.139 N m, and pumping 0.000917 N m"
    with pytest.raises(SceneError, match=weak):
        SwingUp(LAB.replace(max_torque=0.0005))
    for name, torque, needed in (("chaotic", 1.4, "1.5"), ("kapitza", 0.7, "0.8")):
        driven = SCENES[name].with_effects((*SCENES[name].effects, Motor(max_torque=torque)))
        with pytest.raises(SceneError, match=f"holding the bob takes up to {needed} N m"):
            SwingUp(driven)
    for beyond in ({"max_torque": 1e200}, {"lag": 1e-300}, {"lag": 1e300}):
        with pytest.raises(SceneError, match="No regulator can be computed for the scene 'lab'"):
            SwingUp(LAB.replace(**beyond))
    with pytest.raises(SceneError, match=r"must be from 1.9e-06 to 0.19 s long, not 0.5 s\."):
        SwingUp("lab", 0.5)
    with pytest.raises(SceneError, match="There is no scene 'lap'; did you mean lab"):
        SwingUp("lap")
    with pytest.raises(SceneError, match="The reward of the task 'free' does not depend on angle"):
        SwingUp("lab", task="free")
    with pytest.raises(SceneError, match="env must be a LabPendulum environment, not <"):
        swing_up(gym.make("CartPole-v1"))


# --- the model ------------------------------------------------------------------------------------------------------


def test_the_speed_that_is_needed_without_losses_is_that_of_the_separatrix() -> None:
    scene = SCENES["vacuum"].with_effects((*SCENES["vacuum"].effects, Motor()))
    model = model_of(scene)
    exactly = scene.omega0**2 * (1.0 + np.cos(model.angles))
    np.testing.assert_allclose(model.rising, exactly, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(model.falling, exactly, rtol=0.0, atol=1e-9)
    assert model.cannot == ""


@pytest.mark.parametrize("name", ["lab", "windy"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_speed_that_is_needed_just_gets_to_the_top(name: str, direction: float) -> None:
    """From the bottom, a slightly slower bob turns back and a slightly faster one goes over the top, also in wind."""
    scene = SCENES[name].with_effects(e for e in SCENES[name].effects if e.name not in ("gusts", "motor"))
    model = model_of(SCENES[name])
    table = model.rising if direction > 0.0 else model.falling
    speed = direction * math.sqrt(2.0 * float(np.interp(0.0, model.angles, table)))
    slower, faster = (rollout(scene, angle=0.0, velocity=part * speed, duration=3.0, dt=0.01, integrator="dop853",
                              rtol=1e-10, backend="python") for part in (0.9999, 1.0001))
    assert np.max(direction * slower.angle) < math.pi < np.max(direction * faster.angle)


def moved(scene: Scene, x: Array, action: float, dt: float) -> Array:
    """Return angle from the top, velocity and, for a lagging motor, its state after a control step from ``x``."""
    env = gym.make("LabPendulum-v0", scene=scene, integrator="dop853", backend="python", dt=dt, substeps=20).unwrapped
    env.reset(options={"angle": math.pi + x[0], "velocity": x[1]})
    place = Machine(scene, "dop853", ("energy",), "python").names.index("motor_state") if len(x) > 2 else 0
    saved = env.get_state()
    if place:
        saved["state"][place] = x[2]
        env.set_state(saved)
    _, _, _, _, info = env.step(np.array([action], dtype=np.float32))
    more = [env.get_state()["state"][place]] if place else []
    return np.array([away(info["angle"]), info["velocity"], *more])


@pytest.mark.parametrize("lag", [0.0, 0.03, 0.3])
def test_the_linear_step_is_the_scenes(lag: float) -> None:
    """The linear step agrees with the scene up to second order in small x, for a control step of a tenth of a second.
    """
    scene = LAB.replace(lag=lag) if lag else LAB
    model, dt, small = model_of(scene), 0.1, 2.0**-12
    state, control = sampled(model, dt)
    start = small * np.array([1.0, -2.0, 0.5])[: len(state)]
    end = moved(scene, start, small, dt)
    np.testing.assert_allclose(end, state @ start + control[:, 0] * small, rtol=0.0, atol=20.0 * small**2 * 0.01)


def seen_at(angle: float, velocity: float) -> Array:
    return np.array([math.cos(angle), math.sin(angle), velocity])


def test_far_from_the_top_the_missing_energy_is_pumped_in() -> None:
    """Without losses the action is the missing energy over a quarter of the torque, in the direction of the motion.

    At rest, the action is in the direction of gravity.
    """
    scene = SCENES["vacuum"].with_effects((*SCENES["vacuum"].effects, Motor(max_torque=3.0)))
    controller = made(scene)
    for angle, velocity in ((0.3, 6.1), (0.3, -6.1), (-1.2, 5.0), (-1.2, -5.3), (1.0, 2.0), (1.0, -2.0), (0.2, 7.0)):
        missing = 9.81 * (1.0 + math.cos(angle)) - 0.5 * velocity**2
        wanted = math.copysign(min(abs(missing) / (0.25 * 3.0), 1.0), missing * velocity)
        assert controller(seen_at(angle, velocity))[0] == pytest.approx(wanted, abs=1.3e-4)  # tables by half degrees
    assert [float(controller(seen_at(angle, 0.0))[0]) for angle in (-1.0, 1.0)] == [1.0, -1.0]


def test_in_wind_each_way_needs_a_speed_of_its_own() -> None:
    controller = made(SCENES["windy"])
    model = controller.model
    for table, direction in ((model.rising, 1.0), (model.falling, -1.0)):
        speed = direction * math.sqrt(2.0 * float(np.interp(0.5, model.angles, table)))
        assert controller(seen_at(0.5, speed))[0] == pytest.approx(0.0, abs=1e-9)
        assert direction * controller(seen_at(0.5, 0.99 * speed))[0] > 0.01
        assert direction * controller(seen_at(0.5, 1.01 * speed))[0] < -0.01


@pytest.mark.slow
def test_what_a_lagging_motor_still_gives_is_reckoned_with() -> None:
    controller = made(LAB.replace(lag=0.1))
    needed = float(np.interp(0.5, controller.model.angles, controller.model.rising))
    controller(seen_at(0.5, math.sqrt(2.0 * (needed - 0.05 * REACH * controller.model.motor_rate))))
    share = float(controller.motor_shares[0])
    assert 0.05 < share < 0.1
    action = float(controller(seen_at(0.5, math.sqrt(2.0 * needed)))[0])
    assert action < -0.5
    assert motor_advance(share, action, 0.02, 10.0)[1] == pytest.approx(0.0, abs=1e-7)


# --- the regulator --------------------------------------------------------------------------------------------------


def test_gains_are_the_closed_form_of_fast_control() -> None:
    """For phi'' = a phi + u s and least sum of phi² + q v² + r s², the gains solve Riccati's equation (no damping)."""
    scene = SCENES["vacuum"].with_effects((*SCENES["vacuum"].effects, Motor(max_torque=3.0)))
    rate, top, q, r = 3.0, 9.81, 0.1 / 9.81, 0.001
    first = (top + math.sqrt(top**2 + rate**2 / r)) / rate
    second = math.sqrt((2.0 * first * r / rate + q) / r)
    gain = SwingUp(scene, 1e-5).regulators[0].gain
    np.testing.assert_allclose(gain, [first, second], rtol=3e-4)


def test_the_cost_is_what_is_paid() -> None:
    """The regulator's cost equals the sum of the reward's terms over a run of the scene that starts near the top."""
    controller = made(LAB)
    phi, velocity, share = played(controller, LAB, 4.0, (math.pi - 0.004, 0.01))
    paid = np.sum(phi**2 + 0.1 * (velocity / LAB.omega0) ** 2 + 0.001 * share**2)
    start = np.array([phi[0], velocity[0]])
    assert paid == pytest.approx(start @ controller.regulators[0].cost @ start, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "lag"), [
    ("lab", 0.0), *(pytest.param(*more, marks=pytest.mark.slow) for more in (("moon", 0.0), ("lab", 0.1)))])
def test_within_its_level_each_regulator_comes_nearer_in_every_step(name: str, lag: float) -> None:
    """The cost falls in every step, from starts between those tried in the design, by dop853 in the scene."""
    scene = SCENES[name].replace(lag=lag) if lag else SCENES[name]
    random = np.random.default_rng(1)
    for held in made(scene).regulators:
        root = np.linalg.inv(np.linalg.cholesky(held.cost)).T
        for _ in range(6):
            way = random.normal(size=len(held.gain))
            x = math.sqrt(0.98 * held.level) * root @ (way / np.linalg.norm(way))
            last = 0.98 * held.level
            for _ in range(10):
                x = moved(scene, x, float(np.clip(-held.gain @ x, -1.0, 1.0)), 0.02)
                cost = float(x @ held.cost @ x)
                assert cost < last
                last = cost


@pytest.mark.parametrize("name", [name for name in SWUNG_UP if name != "moon"])  # where it may lift the bob outright
def test_the_softest_regulator_reaches_nearly_as_far_as_the_torque(name: str) -> None:
    """phi + v/rate above (1 - |hold|) u/(a rate²) grows with any action; ``rate`` solves x² = b x + a."""
    controller = made(SCENES[name])
    model, soft = controller.model, controller.regulators[-1]
    rate = 0.5 * (model.by_velocity + math.sqrt(model.by_velocity**2 + 4.0 * model.by_angle))
    side = np.array([rate - model.by_velocity, 1.0])  # left eigenvector of the growing mode
    bound = (model.motor_rate - abs(model.bias)) / rate
    reach = math.sqrt(soft.level * side @ np.linalg.inv(soft.cost) @ side)
    assert 0.7 * bound < reach < bound


# --- as a callable --------------------------------------------------------------------------------------------------


@pytest.mark.quick("0.0")
@pytest.mark.parametrize("lag", [0.0, 0.1])
def test_many_observations_are_each_answered_as_alone(lag: float) -> None:
    random = np.random.default_rng(2)
    angles = random.uniform(-math.pi, math.pi, (3, 40))
    seen = np.stack([np.cos(angles), np.sin(angles), random.normal(0.0, 6.0, angles.shape)], axis=-1)
    together = made(LAB.replace(lag=lag)) if lag else made(LAB)
    alone = [copy.copy(together) for _ in range(40)]
    for row in seen.astype(np.float32):
        actions = together(row)
        assert actions.shape == (40, 1)
        assert actions.dtype == np.float32
        assert np.abs(actions).max() <= 1.0
        assert np.array_equal([one(each) for one, each in zip(alone, row, strict=True)], actions)


@pytest.mark.slow
def test_a_lagging_motor_is_followed() -> None:
    scene = LAB.replace(lag=0.1)
    controller = made(scene)
    env = gym.make("LabPendulum-v0", scene=scene, backend="python").unwrapped
    seen, _ = env.reset(seed=3)
    place = Machine(scene, "rk4", ("energy",), "python").names.index("motor_state")
    for _ in range(50):
        seen, *_ = env.step(controller(seen))
        assert controller.motor_shares[0] == pytest.approx(env.get_state()["state"][place], abs=1e-12)
    controller.reset()
    assert controller.motor_shares.tolist() == [0.0]


def test_it_can_be_sent_to_another_process() -> None:
    controller = made(LAB.replace(lag=0.1))
    seen = np.array([0.6, 0.8, 2.0])
    controller(seen)
    sent = pickle.loads(pickle.dumps(controller))
    assert np.array_equal(sent(seen), controller(seen))
    assert sent.motor_shares == controller.motor_shares


@pytest.mark.parametrize("name", ["dt", "scene", "model", "regulators", "gain"])
def test_nothing_can_be_assigned_to_it(name: str) -> None:
    controller = made(LAB)
    before = {key: getattr(controller, key, None) for key in ("dt", "scene", "model", "regulators")}
    for one in (controller, pickle.loads(pickle.dumps(controller))):
        with pytest.raises(AttributeError, match=rf"{name} cannot be assigned, .* make a new one with SwingUp"):
            setattr(one, name, 0.1)
    assert before == {key: getattr(controller, key, None) for key in before}
    with pytest.raises(AttributeError):
        RandomPolicy().seed = 3  # type: ignore[attr-defined]


def test_it_is_made_for_an_environment() -> None:
    env = gym.make("LabPendulum-v0", scene="moon", dt=0.05, task="balance", backend="python")
    many = gym.make_vec("LabPendulum-v0", 3, vectorization_mode="vector_entry_point", task="free", backend="python")
    one, three = swing_up(env), swing_up(many)
    assert (one.scene, one.dt) == (SCENES["moon"], 0.05)
    assert (three.scene, three.dt) == (LAB, 0.02)
    seen, _ = env.reset(seed=1)
    assert env.action_space.contains(one(seen))
    seen, _ = many.reset(seed=1)
    assert many.action_space.contains(three(seen))
    assert one.regulators[0].gain[0] != SwingUp("moon", 0.05).regulators[0].gain[0]


@pytest.mark.parametrize("mode", ["sync", pytest.param("async", marks=pytest.mark.slow)])
def test_it_is_made_for_gymnasiums_own_vectors(mode: str) -> None:
    many = gym.make_vec("LabPendulum-v0", 2, vectorization_mode=mode, scene="moon", dt=0.05, backend="python",
                        wrappers=[gym.wrappers.FlattenObservation, gym.wrappers.ClipAction])
    controller = swing_up(many)
    assert (controller.scene, controller.dt) == (SCENES["moon"], 0.05)
    assert repr(controller) == "SwingUp('moon', dt=0.05 s)"
    assert many.action_space.contains(controller(many.reset(seed=1)[0]))
    many.close()


@pytest.mark.parametrize(("wrapped", "kind"), [
    (gym.wrappers.NormalizeObservation, "observations"), (gym.wrappers.TimeAwareObservation, "observations"),
    (lambda env: gym.wrappers.FrameStackObservation(env, 2), "observations"),
    (lambda env: gym.wrappers.RescaleAction(env, np.float32(-2.0), np.float32(2.0)), "actions")])
def test_wrappers_that_rescale_are_refused(wrapped: Any, kind: str) -> None:
    """The controller would read rescaled values as angles and torques, and fail without an error."""
    with pytest.raises(SceneError, match=f"A wrapper of env changes the {kind}, but the controller needs them"):
        swing_up(wrapped(gym.make("LabPendulum-v0", backend="python")))


@pytest.mark.slow
@pytest.mark.parametrize("bound", [20.0, pytest.param(np.inf, marks=pytest.mark.slow)])
def test_a_bound_of_the_velocity_is_no_wrapper(bound: float) -> None:
    """Check that the controller takes environments with their own bound, and still refuses rescaled ones."""
    options = {"velocity_bound": bound, "backend": "python"}
    single = gym.make("LabPendulum-v0", **options)
    for env in (single, gym.make_vec("LabPendulum-v0", 2, **options),
                gym.make_vec("LabPendulum-v0", 2, vectorization_mode="sync", **options)):
        swing_up(env)
    with pytest.raises(SceneError, match="A wrapper of env changes the observations"):
        swing_up(gym.wrappers.NormalizeObservation(single))
    if bound == 20.0:
        with pytest.raises(SceneError, match="A wrapper of env changes the observations"):
            swing_up(gym.wrappers.RescaleObservation(single, np.float32(-1.0), np.float32(1.0)))


@pytest.mark.parametrize("policy", [designed(LAB), RandomPolicy(1)], ids=["controller", "chance"])
@pytest.mark.parametrize("wrong", [[1.0, 0.0], np.zeros((2, 4)), np.zeros((1, 1, 3)), [math.nan, 0.0, 0.0], "word",
                                   [1.0, 0.0, "a"], [[1.0, 0.0, 0.0], [1.0]], np.ones(3, dtype=complex)])
def test_other_observations_are_refused(policy: Any, wrong: Any) -> None:
    with pytest.raises(ValueError, match="Observations must "):
        policy(wrong)


def test_chance_is_uniform_and_repeatable() -> None:
    seen = np.zeros((20_000, 3))
    actions = RandomPolicy(5)(seen)
    assert np.array_equal(actions, RandomPolicy(5)(seen))
    assert not np.array_equal(actions, RandomPolicy(6)(seen))
    assert (actions.shape, actions.dtype) == ((20_000, 1), np.float32)
    assert abs(actions.mean()) < 4.0 / math.sqrt(3.0 * 20_000)
    assert np.histogram(actions, 10, (-1.0, 1.0))[0].min() > 1800
    assert RandomPolicy(5)(seen[0]).shape == (1,)


@pytest.mark.slow
def test_an_energy_shaping_controller_beats_chance_by_far() -> None:
    """Compare returns of whole episodes of the registered environment; the largest return of ``balance`` is 500."""
    for task, least, most in (("swing_up", -600.0, -4000.0), ("balance", 499.0, 40.0)):
        returns = []
        for policy in (SwingUp("lab", task=task), RandomPolicy(0)):
            env = gym.make_vec("LabPendulum-v0", 8, vectorization_mode="vector_entry_point", task=task,
                               max_episode_steps=500, backend="python", diagnostics=(), autoreset_mode="Disabled")
            seen, _ = env.reset(seed=1)
            total, going = np.zeros(8), np.ones(8, dtype=bool)
            for _ in range(500):
                seen, reward, terminated, _, _ = env.step(policy(seen))
                total += np.where(going, reward, 0.0)
                going &= ~terminated
                if terminated.any():
                    env.reset(options={"reset_mask": terminated})
            returns.append(total)
        assert returns[0].min() > least
        assert returns[1].max() < (most if task == "swing_up" else 150.0)


@pytest.mark.slow
def test_controllers_are_loaded_when_first_used() -> None:
    code = ("import sys, pendulum_env\n"
            "assert 'pendulum_env.controllers' not in sys.modules and 'controllers' in dir(pendulum_env)\n"
            "pendulum_env.controllers.RandomPolicy(1)\n"
            "print([name for name in ('numba', 'scipy', 'matplotlib') if name in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert pendulum_env.controllers.SwingUp is SwingUp
