"""Error estimates of runs and environments, against the true error: closed forms, and solvers of other origin."""

from __future__ import annotations

import copy
import json
import math
import pickle
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from choice import EVERYWHERE, turn_of
from numpy.typing import NDArray

import integrators
import pendulum_env  # noqa: F401
from pendulum_env import SCENES, Rollout, Scene, SceneError, rollout
from pendulum_env.engine import certificate
from pendulum_env.engine.batch import Batch
from pendulum_env.engine.certificate import MOST, TRUST, Yardstick
from pendulum_env.engine.certified_many import CertifiedBatch
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.engine.machine import DIAGNOSTICS, fitting
from pendulum_env.engine.stream import read
from pendulum_env.physics import exact
from pendulum_env.study.reference import reference

Array = NDArray[np.float64]

DURATION, GAP = {"kapitza": 0.6, "overdamped": 2.0}, {"kapitza": 0.002}
SMOOTH = [name for name in SCENES if name not in ("windy", "sticky_bearing")]
"""Scenes without dry friction and, as their truth is not known to :mod:`pendulum_env.study.reference`, gusts."""
FLOOR = 2e-13
"""Where both are below this many times the angle, rounding rules, and estimates of many sub-steps may be too high."""


def estimated(scene: str | Scene, method: str, h: float, duration: float, **options: Any) -> Rollout:
    return rollout(scene, integrator=method, dt=h, duration=duration, estimate_error=True,
                   **{"backend": "python", "warn": False, **options})


def ratio(estimate: Array | None, error: Array) -> float:
    """Largest estimate over largest error, up to where the estimate is known: at least two records."""
    assert estimate is not None
    assert not np.isnan(estimate).any()
    known = np.isfinite(estimate)
    assert known.sum() > 1
    assert np.all(estimate[known] >= 0.0)
    return float(np.max(estimate[known]) / np.max(error[known]))


# --- closed forms ---------------------------------------------------------------------------------------------------


def swing(time: Array) -> tuple[Array, Array]:
    """Jacobi's elliptic functions: `vacuum` from 1 rad."""
    angle, velocity = exact.pendulum(time, 1.0, 0.0, math.sqrt(SCENES["vacuum"].gravity))
    return np.asarray(angle), np.asarray(velocity)


STEPS = [
    ("forward_euler", 0.01), ("forward_euler", 0.001), ("backward_euler", 0.005), ("symplectic_euler", 0.01),
    ("velocity_verlet", 0.05), ("heun", 0.02), ("rk4", 0.1), ("rk4", 0.01), ("rk4", 0.002), ("dopri5", 0.1),
    ("dop853", 0.1), ("dop853", 0.05), ("dop853", 0.02), ("verner8", 0.02), ("gauss4", 0.1), ("radau5", 0.05),
    ("implicit_midpoint", 0.02), ("discrete_gradient", 0.02), ("forest_ruth", 0.02), ("kahan_li8", 0.05),
    ("blanes_moan_srkn11b", 0.05), ("chin4a", 0.05), ("rkn43", 0.05), ("nystrom4", 0.02), ("dprkn12", 0.1),
    ("taylor", 0.1), ("taylor", 0.02), ("exact", 0.05), ("ab3", 0.01), ("bdf4", 0.01), ("abm4", 0.02),
    ("numerov", 0.02), ("quinlan_tremaine12", 0.02),
]


@pytest.mark.parametrize(("method", "h"), STEPS)
def test_estimates_are_within_ten_of_the_true_error_of_a_large_swing(method: str, h: float) -> None:
    """Every family, from a tenth of the motion down to rounding; angle and velocity."""
    run = estimated("vacuum", method, h, 4.0)
    angle, velocity = swing(run.time)
    assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - angle)) < 10.0
    assert 0.1 < ratio(run.velocity_error_estimate, np.abs(run.velocity - velocity)) < 10.0


@pytest.mark.parametrize("method", ["rk4", "dopri5", "gauss4", "forest_ruth"])
def test_well_above_rounding_estimates_are_the_error_within_five_per_cent_at_every_time(method: str) -> None:
    """Richardson's estimate is exact in the limit; compared where the error is a tenth of its largest or more."""
    run = estimated("vacuum", method, 0.02, 4.0, every=5)
    error = np.abs(run.angle - swing(run.time)[0])
    large = error > 0.1 * error.max()
    assert run.error_estimate is not None
    assert large.sum() > 15
    assert run.error_estimate[large] == pytest.approx(error[large], rel=0.05)


@pytest.mark.parametrize(("method", "h"), [("rk4", 0.05), ("velocity_verlet", 0.01), ("dop853", 0.2), ("gauss4", 0.05)])
def test_estimates_follow_an_error_that_decays(method: str, h: float) -> None:
    """The damped oscillator: at the end the error has fallen with the motion, and so has the estimate."""
    run = estimated("textbook", method, h, 10.0, damping={"linear": {"gamma": 1.5}})
    angle, _ = exact.linear(run.time, 0.1, 0.0, math.sqrt(SCENES["textbook"].gravity), 1.5)
    late = run.time > 8.0
    error = np.abs(run.angle - angle)
    assert run.error_estimate is not None
    assert ratio(run.error_estimate, error) == pytest.approx(1.0, abs=0.3)
    assert ratio(run.error_estimate[late], error[late]) == pytest.approx(1.0, abs=0.5)
    assert np.max(run.error_estimate[late]) < 0.05 * np.max(run.error_estimate)


@pytest.mark.parametrize("method", ["dop853", "dopri5", "bs3", "taylor"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("dt", [0.05, 0.5])
def test_adaptive_estimates_hold_where_the_tolerance_rules_and_where_the_interval_does(
    method: str, rtol: float, dt: float
) -> None:
    run = estimated("vacuum", method, dt, 2.0, rtol=rtol)
    assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - swing(run.time)[0])) < 10.0


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("method", ["taylor", "dprkn12", "kahan_li8"])
@pytest.mark.slow
def test_estimates_hold_where_rounding_has_long_ruled(method: str, compensated: bool) -> None:
    """1000 s of a harmonic oscillator and of a large swing, 20000 steps."""
    for scene in ("textbook", "vacuum"):
        run = estimated(scene, method, 0.05, 1000.0, every=100, compensated=compensated, backend="auto")
        true = reference(SCENES[scene], SCENES[scene].run.angle, 0.0, run.time)
        assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - true.angle)) < 10.0


# --- scenes without a closed form -----------------------------------------------------------------------------------


LONG = ("water", "kapitza", "clock_bob", "exercise_large", "vacuum")


@pytest.mark.parametrize("scene", [
    pytest.param(scene, marks=pytest.mark.slow if scene in LONG else ()) for scene in SMOOTH
])
def test_estimates_hold_in_every_smooth_scene(scene: str) -> None:
    check_scene(scene, "rk4", 1)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_estimates_hold_in_every_scene_with_every_method(part: int) -> None:
    """Every scene with a third of the methods that fit it, and with all of EVERYWHERE: some 550 runs."""
    count = 0
    for scene in (*SMOOTH, "sticky_bearing"):
        for method in fitting(SCENES[scene]):
            turn = turn_of(scene + method, 12)
            if turn % 4 == part and (turn < 4 or method in EVERYWHERE):
                check_scene(scene, method, 1 if turn < 2 else 2)
                count += 1
    assert count > 100


REFERENCES: dict[str, Any] = {}


def check_scene(scene: str, method: str, parts: int) -> None:
    """From the usual start, with a step that shows the drive, and parts of it."""
    place, gap, duration = SCENES[scene], GAP.get(scene, 0.02), DURATION.get(scene, 1.5)
    run = estimated(scene, method, gap / parts, duration, every=parts)
    if scene not in REFERENCES:
        marks = np.arange(round(duration / gap) + 1) * gap
        REFERENCES[scene] = reference(place, place.run.angle, place.run.velocity, marks)
    error = np.abs(run.angle - REFERENCES[scene].angle[: len(run.angle)])
    assert run.error_estimate is not None
    known = np.isfinite(run.error_estimate)
    largest = float(np.max(np.abs(run.angle)))
    if known.sum() < 3:
        assert error.max() > 0.02 * largest, f"{method} is right in {scene}, and not known to be"
        return
    found = ratio(run.error_estimate, error)
    high = 10.0 if np.max(run.error_estimate[known]) > FLOOR * largest else 60.0
    assert 0.1 < found < high or error[known].max() < 2.0**-52 * largest, (scene, method, found)


@pytest.mark.parametrize("method", ["rk4", "heun", "ab3"])
def test_gusts_and_a_lagging_motor_are_the_same_at_half_the_step(method: str) -> None:
    """What they remember holds for control steps of 0.04 s: the truth is a method of order 8 on these at h/16."""
    options: dict[str, Any] = {"seed": 7, "control": 0.6, "lag": 0.1, "angle": 0.5, "backend": "python"}
    run = estimated("windy", method, 0.01, 1.2, substeps=4, every=4, **options)
    true = rollout("windy", integrator="dop853", dt=0.000625, duration=1.2, substeps=64, every=64, **options)
    assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - true.angle)) < 10.0
    assert run.error_estimate is not None
    assert np.max(run.error_estimate) < 1e-2


# --- many runs ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("scene", "method", "options"), [
    ("vacuum", "rk4", {"every": 7}), ("lab", "symplectic_euler", {"compensated": True, "control": 0.5}),
    ("windy", "ab2", {"substeps": 3, "every": 4}), ("sticky_bearing", "rk4", {}),
    ("exercise", "forward_euler", {"speed_limit": 2.0}), ("kapitza", "heun", {}),
])
def test_a_batch_has_the_estimates_of_its_runs(scene: str, method: str, options: dict[str, Any]) -> None:
    """Bit for bit, and nan after a run's end."""
    angles = np.array([[0.3, 1.0], [2.9, -0.2]])
    many = estimated(scene, method, 0.02, 1.0, angle=angles, velocity=0.1, seed=5, **options)
    assert many.error_estimate is not None
    assert many.velocity_error_estimate is not None
    assert many.error_estimate.shape == many.angle.shape
    for i, place in enumerate(np.ndindex(2, 2)):
        one = estimated(scene, method, 0.02, 1.0, angle=angles[place], velocity=0.1, seed=5 + i, **options)
        marks = min(len(one.time), int(np.isfinite(many.angle[place]).sum()))
        for single, row in ((one.error_estimate, many.error_estimate[place]),
                            (one.velocity_error_estimate, many.velocity_error_estimate[place])):
            assert single is not None
            assert np.array_equal(single[:marks], row[:marks])
            assert np.array_equal(np.isnan(row), np.isnan(many.angle[place]))


def test_a_file_holds_the_estimates_beside_the_records(tmp_path: Path) -> None:
    heard: list[float] = []
    options: dict[str, Any] = {"angle": np.array([0.5, 1.5]), "every": 10}
    run = estimated("vacuum", "rk4", 0.05, 5.0, file=tmp_path / "runs.npy",
                    progress=lambda done, _: heard.append(done), **options)
    kept = estimated("vacuum", "rk4", 0.05, 5.0, **options)
    assert run.error_estimate is not None
    assert kept.error_estimate is not None
    assert np.array_equal(read(tmp_path / "runs.npy")["error_estimate"], kept.error_estimate.T)
    assert np.array_equal(run.error_estimate, kept.error_estimate)
    assert heard[-1] == 1.0
    assert heard == sorted(heard)


def test_parameters_of_their_own_have_yardsticks_of_their_own() -> None:
    lengths = np.array([0.2, 5.0])
    many = estimated("vacuum", "rk4", 0.05, 2.0, angle=1.0, length=lengths)
    for i, length in enumerate(lengths):
        one = estimated("vacuum", "rk4", 0.05, 2.0, angle=1.0, length=float(length))
        assert many.error_estimate is not None
        assert one.error_estimate is not None
        assert np.array_equal(many.error_estimate[i], one.error_estimate)


@pytest.mark.parametrize("scene", ["vacuum", "lab"])
def test_asking_changes_neither_the_run_nor_its_program(scene: str) -> None:
    plain = rollout(scene, dt=0.02, duration=1.0, backend="python")
    asked = rollout(scene, dt=0.02, duration=1.0, backend="python", diagnostics=("energy", "error"))
    other = estimated(scene, "rk4", 0.02, 1.0)
    assert plain.error_estimate is None
    assert plain.velocity_error_estimate is None
    assert np.array_equal(plain.angle, asked.angle)
    assert np.array_equal(plain.energy, asked.energy)
    assert asked.error_estimate is not None
    assert other.error_estimate is not None
    assert np.array_equal(asked.error_estimate, other.error_estimate)


# --- where nothing is known -----------------------------------------------------------------------------------------


def test_chaos_beyond_its_horizon_is_unknown_from_there_on() -> None:
    """Errors grow as fast as the motions of nearby starts part, until nothing is left of them."""
    run = estimated("chaotic", "heun", 0.05, 120.0, every=20)
    assert run.error_estimate is not None
    known = np.isfinite(run.error_estimate)
    horizon = int(np.argmin(known))
    assert 10.0 < run.time[horizon] < 100.0
    assert not known[horizon:].any()
    true = reference(SCENES["chaotic"], 0.2, 0.0, run.time[:horizon])
    error = np.abs(run.angle[:horizon] - true.angle)
    assert 0.1 < ratio(run.error_estimate[:horizon], error) < 10.0
    assert np.max(run.error_estimate[known]) <= MOST


@pytest.mark.parametrize(("h", "length"), [(0.1, 1.0), (0.5, 1.0), (2.0, 1.0), (0.1, 0.01)])
def test_a_motion_damped_away_by_the_method_is_unknown(h: float, length: float) -> None:
    """Backward Euler comes to rest in both runs, and their difference with it; at once, where steps are long."""
    run = estimated("vacuum", "backward_euler", h, 60.0 * h, length=length)
    assert run.error_estimate is not None
    assert abs(run.angle[-1]) < 0.3
    assert np.isinf(run.error_estimate[-1])
    known = np.isfinite(run.error_estimate)
    true, _ = exact.pendulum(run.time[known], 1.0, 0.0, math.sqrt(SCENES["vacuum"].gravity / length))
    assert np.all(np.abs(run.angle[known] - true) <= 3.0 * TRUST + 10.0 * run.error_estimate[known])


@pytest.mark.parametrize("every", [1, 1000])
def test_growing_motions_are_unknown_and_diverged_ones_too(every: int) -> None:
    """Also where records lie far apart: runs are compared after every step."""
    run = estimated("textbook", "forward_euler", 0.05, 1000.0, every=every)
    assert run.stop_reason == "diverged"
    assert run.error_estimate is not None
    assert run.velocity_error_estimate is not None
    assert run.error_estimate[-1] == run.velocity_error_estimate[-1] == math.inf
    assert np.isfinite(run.error_estimate[0])


def test_a_drive_that_no_step_sees_is_unknown() -> None:
    """16 shakes of the pivot a step: two steps of any length that see it alike agree, and are wrong."""
    shaken = {"vertical_rate": 2.0 * math.pi / 0.001}
    blind = estimated("kapitza", "rk4", 0.002, 0.5, **shaken)
    seen = estimated("kapitza", "rk4", 0.0001, 0.01, **shaken)
    assert blind.error_estimate is not None
    assert np.all(np.isinf(blind.error_estimate))
    assert seen.error_estimate is not None
    assert np.all(np.isfinite(seen.error_estimate))


def test_a_speed_that_turns_half_round_in_a_step_is_unknown() -> None:
    run = estimated("vacuum", "rk4", 0.1, 1.0, velocity=2.0 * math.pi / 0.1)
    assert run.error_estimate is not None
    assert np.all(np.isinf(run.error_estimate[1:]))


def test_starts_at_rest_are_known() -> None:
    """A bob on its way from rest errs by much of its way in the first steps of forward_euler, and that is known."""
    run = estimated("driven", "forward_euler", 0.001, 0.2)
    still = estimated("vacuum", "rk4", 0.01, 0.2, angle=math.pi)
    assert run.error_estimate is not None
    assert np.all(np.isfinite(run.error_estimate))
    assert still.error_estimate is not None
    assert np.all(still.error_estimate < 1e-14)


def test_a_run_that_stops_is_judged_up_to_its_stop() -> None:
    """The wire goes slack a little earlier at half the step, which goes on as with a rod."""
    run = estimated("exercise_large", "rk4", 0.005, 5.0, angle=0.3, velocity=9.0)
    assert run.stop_reason == "slack"
    assert len(run.time) > 10
    true = reference(SCENES["exercise_large"], 0.3, 9.0, run.time)
    assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - true.angle)) < 10.0
    assert run.error_estimate is not None
    assert np.all(np.isfinite(run.error_estimate))


# --- environments ---------------------------------------------------------------------------------------------------


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
    """The same actions in scipy's DOP853, which knows the lab's equation from its coefficients alone."""
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
    assert 0.1 < ratio(np.array(found), np.array(errors)) < 10.0
    assert max(found) < limit


STORIES: list[dict[str, Any]] = [
    {}, {"substeps": 3, "speed_limit": 0.25}, {"task": "balance", "substeps": 2}, {"scene": "sticky_bearing"},
    {"scene": "windy", "substeps": 3, "speed_limit": 1.0, "integrator": "heun", "task": "free"},
    {"scene": "windy", "lag": 0.05, "substeps": 2, "integrator": "ab2"}, {"integrator": "ab3", "substeps": 4},
    {"compensated": True, "diagnostics": ("error",)}, {"scene": "vacuum", "length": 0.5, "speed_limit": 3.0},
    {"scene": "exercise", "integrator": "forward_euler", "dt": 0.1, "task": "free"},
]
"""Memory, midway stops, losing, divergence; each with episodes that end."""


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
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
    """A run of the environment without control, checked once per control step, is the rollout's."""
    env = made(scene="vacuum", dt=0.02, task="free")
    infos = [env.reset()[1], *played(env, 50)]
    run = estimated("vacuum", "rk4", 0.02, 1.0)
    assert run.error_estimate is not None
    assert [info["error_estimate"] for info in infos] == run.error_estimate.tolist()


@pytest.mark.parametrize("options", [
    {}, {"scene": "windy", "diagnostics": ("error", "tension", "flow"), "substeps": 3},
    {"rtol": 1e-6, "integrator": "bs3"}, {"integrator": "ab3", "substeps": 4, "compensated": True},
    {"integrator": "forward_euler", "dt": 0.3, "task": "free"},
], ids=str)
def test_the_whole_state_has_the_run_at_half_the_step(options: dict[str, Any]) -> None:
    """get_state, through JSON too, pickle and deepcopy go on with the same estimates."""
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


def test_without_the_diagnostic_nothing_is_there() -> None:
    """The same program, the same classes, no further key and no further number in the state."""
    scene, method = SCENES["lab"], integrators.get("rk4")
    plain, asked = made(diagnostics=("energy",)), made()
    told, more = plain.reset(seed=0)[1], asked.reset(seed=0)[1]
    assert set(more) - set(told) == {"error_estimate"}
    assert all(more[name] == told[name] for name in told)
    text = program(scene, method, ("energy",)).text
    assert "error" not in text
    assert "half_angle" not in text
    assert len(plain.get_state()["state"]) == len(program(scene, method, ("energy",)).shape.state)
    assert type(plain._machine).__name__ == "Machine"
    vector = gym.make_vec("LabPendulum-v0", num_envs=2, backend="python").unwrapped
    assert type(vector._batch) is Batch
    assert "error_estimate" not in vector.reset(seed=0)[1]
    certain = gym.make_vec("LabPendulum-v0", num_envs=2, backend="python", diagnostics=("energy", "error")).unwrapped
    assert type(certain._batch) is CertifiedBatch
    assert certain._batch._made is certain._batch._half._made is vector._batch._made
    assert batch_program.cache_info().currsize


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


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("asked", [1, "yes", None, 0.5])
def test_estimate_error_is_true_or_false(asked: Any) -> None:
    with pytest.raises(SceneError, match="estimate_error must be True or False"):
        rollout("vacuum", estimate_error=asked)


def test_the_diagnostic_has_its_place_in_the_one_list() -> None:
    assert DIAGNOSTICS[-1] == "error"
    with pytest.raises(SceneError, match="did you mean.*error"):
        rollout("vacuum", diagnostics=("eror",))
    with pytest.raises(SceneError, match="must be a tuple"):
        gym.make("LabPendulum-v0", diagnostics="error")


# --- the yardstick --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["rk4", "exact", "forward_euler"])
def test_numbers_and_arrays_are_measured_alike(method: str) -> None:
    stick = Yardstick.of(SCENES["vacuum"], integrators.get(method), 0.01, {"omega0": SCENES["vacuum"].omega0}, False)
    random = np.random.default_rng(1)
    rows = random.uniform(-9.0, 9.0, (50, 4))
    rows[:, 1], rows[:, 3] = rows[:, 0] + 10.0 ** -random.uniform(1, 17, 50), rows[:, 2] + 1e-9
    index, span, fastest = np.arange(50.0), random.uniform(0.0, 5.0, 50), np.abs(rows[:, 2])
    many = stick(index, (rows[:, 0], rows[:, 1]), (rows[:, 2], rows[:, 3]), span, fastest)
    for i, row in enumerate(rows.tolist()):
        motion = float(span[i]), float(fastest[i])
        one = stick(float(i), (row[0], row[1]), (row[2], row[3]), *motion, min, max, math.sqrt)
        assert one == tuple(values[i] for values in many)


@pytest.mark.parametrize(("method", "gain"), [("forward_euler", 2.0), ("rk4", 16.0 / 15.0), ("exact", 1.0)])
def test_differences_are_extrapolated_by_the_declared_order(method: str, gain: float) -> None:
    stick = Yardstick.of(SCENES["vacuum"], integrators.get(method), 0.01, {"omega0": 3.0}, False)
    assert stick.gain == gain
    assert stick(10.0, (1.0, 1.0 + 2.0**-20), (0.0, 0.0), 1.0, 1.0, min, max, math.sqrt)[0] == gain * 2.0**-20


def test_tolerances_are_tighter_at_half_the_step_and_never_below_what_can_be() -> None:
    found = certificate.halved({"rtol": 3.2e-7, "atol": 6.4e-7, "hold": 4.0, "scale": 2.0, "gravity_rate": 9.8})
    assert found == {"rtol": pytest.approx(1e-8), "atol": pytest.approx(2e-8), "hold": 8.0, "scale": math.inf,
                     "gravity_rate": 9.8}
    assert certificate.halved({"rtol": 1e-15, "atol": 1e-15})["rtol"] > 1e-15
