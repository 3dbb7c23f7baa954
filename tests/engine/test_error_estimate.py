"""Tests of the error estimates of runs and environments against true errors, from closed forms and other solvers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from choice import EVERYWHERE, turn_of
from numpy.typing import NDArray

import integrators
import pendulum_env  # noqa: F401
from pendulum_env import SCENES, Rollout, Scene, SceneError, rollout
from pendulum_env.engine import certificate
from pendulum_env.engine.certificate import MOST, TRUST, ErrorEstimator
from pendulum_env.engine.growing_file import read
from pendulum_env.engine.machine import DIAGNOSTICS, fitting
from pendulum_env.physics import exact
from pendulum_env.study.compare import compare
from pendulum_env.truth.reference import reference

Array = NDArray[np.float64]

DURATION, GAP = {"kapitza": 0.6, "overdamped": 2.0}, {"kapitza": 0.002}
SMOOTH = [name for name, scene in SCENES.items() if name != "windy" and not any(effect.dry for effect in scene.effects)]
"""Scenes without dry friction and without gusts, for which there is no reference solution."""
FLOOR = 2e-13
"""Fraction of the angle below which errors are mostly rounding; estimates of many-stage methods may be too high."""


def estimated(scene: str | Scene, method: str, h: float, duration: float, **options: Any) -> Rollout:
    return rollout(scene, integrator=method, dt=h, duration=duration, estimate_error=True,
                   **{"backend": "python", "warn": False, **options})


def ratio(estimate: Array | None, error: Array) -> float:
    """Return the largest estimate divided by the largest error, over the records with a finite estimate."""
    assert estimate is not None
    assert not np.isnan(estimate).any()
    known = np.isfinite(estimate)
    assert known.sum() > 1
    assert np.all(estimate[known] >= 0.0)
    return float(np.max(estimate[known]) / np.max(error[known]))


# --- closed forms ---------------------------------------------------------------------------------------------------


def swing(time: Array) -> tuple[Array, Array]:
    """Return the exact motion in the scene `vacuum` from 1 rad, from Jacobi's elliptic functions."""
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


@pytest.mark.quick("rk4-0.01", "gauss4-0.1", "velocity_verlet-0.05", "dopri5-0.1")
@pytest.mark.parametrize(("method", "h"), STEPS)
def test_estimates_are_within_ten_of_the_true_error_of_a_large_swing(method: str, h: float) -> None:
    """Check that estimates are within a factor of 10 of the true error, from a tenth of the motion down to rounding."""
    run = estimated("vacuum", method, h, 4.0)
    angle, velocity = swing(run.time)
    assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - angle)) < 10.0
    assert 0.1 < ratio(run.velocity_error_estimate, np.abs(run.velocity - velocity)) < 10.0


@pytest.mark.parametrize("method", ["rk4", "dopri5", "gauss4", "forest_ruth"])
def test_well_above_rounding_estimates_are_the_error_within_five_per_cent_at_every_time(method: str) -> None:
    """Check that estimates well above rounding are within 5 % of the error at every time."""
    run = estimated("vacuum", method, 0.02, 4.0, every=5)
    error = np.abs(run.angle - swing(run.time)[0])
    large = error > 0.1 * error.max()
    assert run.error_estimate is not None
    assert large.sum() > 15
    assert run.error_estimate[large] == pytest.approx(error[large], rel=0.05)


@pytest.mark.parametrize(("method", "h"), [("rk4", 0.05), ("velocity_verlet", 0.01), ("dop853", 0.2), ("gauss4", 0.05)])
def test_estimates_follow_an_error_that_decays(method: str, h: float) -> None:
    """Check that the estimate decays with the error of a damped oscillator."""
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


@pytest.mark.parametrize("which", [0, 1, 2])
def test_no_estimate_is_below_rounding_where_both_runs_agree_by_chance(which: int) -> None:
    """Both runs often have the same bits, while each is off by some roundings: the estimate must hold at every record.

    The truth is the cosine of the oscillator, in 30 digits.
    """
    run = estimated("textbook", ("exact", "taylor", "gauss8")[which], 0.05, 5.0)
    start, gravity = SCENES["textbook"].run.angle, SCENES["textbook"].gravity
    with mpmath.workdps(30):
        rate = mpmath.sqrt(mpmath.mpf(gravity) / mpmath.mpf(SCENES["textbook"].body.length))
        phases = [rate * mpmath.mpf(float(t)) for t in run.time]
        off = [float(abs(q - start * mpmath.cos(p))) for q, p in zip(run.angle.tolist(), phases, strict=True)]
        speeds = zip(run.velocity.tolist(), phases, strict=True)
        off_v = [float(abs(v + start * rate * mpmath.sin(p))) for v, p in speeds]
    assert run.error_estimate is not None
    assert run.velocity_error_estimate is not None
    assert np.all(np.array(off)[1:] <= 10.0 * run.error_estimate[1:])
    assert np.all(np.array(off_v)[1:] <= 10.0 * run.velocity_error_estimate[1:])
    assert max(off) > 0.0


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("method", ["taylor", "dprkn12", "kahan_li8"])
@pytest.mark.slow
def test_estimates_hold_where_rounding_has_long_ruled(method: str, compensated: bool) -> None:
    """Check the estimates over 1000 s (20000 steps) of swings whose error is dominated by rounding."""
    for scene in ("textbook", "vacuum"):
        run = estimated(scene, method, 0.05, 1000.0, every=100, compensated=compensated, backend="auto")
        true = reference(SCENES[scene], SCENES[scene].run.angle, 0.0, run.time)
        assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - true.angle)) < 10.0


# --- scenes without a closed form -----------------------------------------------------------------------------------


LONG = ("water", "kapitza", "clock_bob", "exercise_large", "vacuum")


@pytest.mark.quick("lab", "exercise", "driven", "kater")
@pytest.mark.parametrize("scene", [
    pytest.param(scene, marks=pytest.mark.slow if scene in LONG else ()) for scene in SMOOTH
])
def test_estimates_hold_in_every_smooth_scene(scene: str) -> None:
    check_scene(scene, "rk4", 1)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_estimates_hold_in_every_scene_with_every_method(part: int) -> None:
    """Check the estimates in every scene with a third of its methods and with all of EVERYWHERE: some 550 runs."""
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
    """Check the estimates in a scene from its usual start, with steps that resolve the drive."""
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
    quotient = ratio(run.error_estimate, error)
    high = 10.0 if np.max(run.error_estimate[known]) > FLOOR * largest else 60.0
    unseen = max(2.0**-52 * largest, REFERENCES[scene].error_estimate)
    assert 0.1 < quotient < high or max(np.max(run.error_estimate[known]), error[known].max()) < unseen, (scene, method)


@pytest.mark.parametrize("method", ["rk4", "heun", "ab3"])
def test_gusts_and_a_lagging_motor_are_the_same_at_half_the_step(method: str) -> None:
    """Check the estimates with gusts and a lagging motor against a method of order 8 at h/16."""
    options: dict[str, Any] = {"seed": 7, "control": 0.6, "lag": 0.1, "angle": 0.5, "backend": "python"}
    run = estimated("windy", method, 0.01, 1.2, substeps=4, every=4, **options)
    true = rollout("windy", integrator="dop853", dt=0.000625, duration=1.2, substeps=64, every=64, **options)
    assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - true.angle)) < 10.0
    assert run.error_estimate is not None
    assert np.max(run.error_estimate) < 1e-2


# --- many runs ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("scene", "method", "options"), [
    ("vacuum", "rk4", {"every": 7}), ("lab", "symplectic_euler", {"compensated": True, "control": 0.5}),
    ("windy", "heun", {"substeps": 3, "every": 4}), ("windy", "ab2", {"substeps": 3, "lag": 0.1}),
    ("sticky_bearing", "rk4", {}),
    ("exercise", "forward_euler", {"speed_limit": 2.0}), ("kapitza", "heun", {}),
])
def test_a_batch_has_the_estimates_of_its_runs(scene: str, method: str, options: dict[str, Any]) -> None:
    """Check that a batch has the estimates of its single runs bit for bit, and nan after a run's end."""
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
    estimated_run = rollout(scene, dt=0.02, duration=1.0, backend="python", diagnostics=("energy", "error"))
    other = estimated(scene, "rk4", 0.02, 1.0)
    assert plain.error_estimate is None
    assert plain.velocity_error_estimate is None
    assert np.array_equal(plain.angle, estimated_run.angle)
    assert np.array_equal(plain.energy, estimated_run.energy)
    assert estimated_run.error_estimate is not None
    assert other.error_estimate is not None
    assert np.array_equal(estimated_run.error_estimate, other.error_estimate)


# --- where nothing is known -----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_chaos_beyond_its_horizon_is_unknown_from_there_on() -> None:
    """Check that the estimate is inf once chaos has separated the two runs completely."""
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
    """Check that the estimate is inf if backward Euler damps the motion away, so that the runs' difference vanishes."""
    run = estimated("vacuum", "backward_euler", h, 60.0 * h, length=length)
    assert run.error_estimate is not None
    assert abs(run.angle[-1]) < 0.3
    assert np.isinf(run.error_estimate[-1])
    known = np.isfinite(run.error_estimate)
    true, _ = exact.pendulum(run.time[known], 1.0, 0.0, math.sqrt(SCENES["vacuum"].gravity / length))
    assert np.all(np.abs(run.angle[known] - true) <= 3.0 * TRUST + 10.0 * run.error_estimate[known])


@pytest.mark.parametrize("every", [1, 1000])
def test_growing_motions_are_unknown_and_diverged_ones_too(every: int) -> None:
    """Check that estimates of growing and diverged motions are inf, also between distant records."""
    run = estimated("textbook", "forward_euler", 0.05, 1000.0, every=every)
    assert run.stop_reason == "diverged"
    assert run.error_estimate is not None
    assert run.velocity_error_estimate is not None
    assert run.error_estimate[-1] == run.velocity_error_estimate[-1] == math.inf
    assert np.isfinite(run.error_estimate[0])


def test_a_drive_that_no_step_sees_is_unknown() -> None:
    """Check that the estimate is inf if a step spans 16 periods of a drive, where both runs may agree and be wrong."""
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


@pytest.mark.parametrize(("scene", "method", "h", "options"), [
    ("lab", "rk4", 0.02, {"every": 3}), ("textbook", "forward_euler", 1.0, {"every": 5, "duration": 1000.0}),
    ("exercise_large", "rk4", 0.01, {"angle": 0.0, "velocity": 9.0}),
])
def test_no_estimate_depends_on_where_a_run_is_divided(
    scene: str, method: str, h: float, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Check that the steps compared at a time change no bit, also where a run diverges or its wire goes slack."""
    given = {"duration": 4.0, **options}
    whole = estimated(scene, method, h, **given)
    assert whole.error_estimate is not None
    assert whole.velocity_error_estimate is not None
    for stretch in (1, 7):
        monkeypatch.setattr(certificate, "STRETCH", stretch)
        parts = estimated(scene, method, h, **given)
        assert parts.error_estimate is not None
        assert parts.velocity_error_estimate is not None
        assert parts.error_estimate.tolist() == whole.error_estimate.tolist()
        assert parts.velocity_error_estimate.tolist() == whole.velocity_error_estimate.tolist()


def test_a_run_that_diverges_at_once_is_unknown() -> None:
    """Check that a run that diverges in its first step has an estimate of inf, though its only record is exact."""
    run = estimated("vacuum", "forward_euler", 0.01, 1.0, velocity=1.0, damping={"linear": {"gamma": 1e160}})
    assert run.stop_reason == "diverged"
    assert run.error_estimate is not None
    assert run.error_estimate.tolist() == [math.inf]


def test_a_bob_held_at_rest_is_known_to_rounding() -> None:
    """Check the estimate of a bob that the motor holds at rest: it is of the size of rounding."""
    values = SCENES["lab"].coefficients
    for share in (0.3, 0.5, 0.7):
        angle = math.asin(share * values["motor_rate"] / values["gravity_rate"])
        run = estimated("lab", "rk4", 0.05, 5.0, angle=angle, control=share)
        assert run.error_estimate is not None
        assert 0.0 < np.max(run.error_estimate) < 2e-14


def test_starts_at_rest_are_known() -> None:
    """Check that estimates are finite after a start at rest, where the error is a large part of the first steps."""
    run = estimated("driven", "forward_euler", 0.001, 0.2)
    still = estimated("vacuum", "rk4", 0.01, 0.2, angle=math.pi)
    assert run.error_estimate is not None
    assert np.all(np.isfinite(run.error_estimate))
    assert still.error_estimate is not None
    assert np.all(still.error_estimate < 1e-14)


@pytest.mark.parametrize("velocity", [7.6, 7.9, 8.2, 8.5, 8.8, 9.1])
def test_a_run_that_stops_is_judged_up_to_its_stop(velocity: float) -> None:
    """Check that a run is estimated up to its stop, also if the wire goes slack earlier at half the step."""
    run = estimated("exercise_large", "rk4", 0.005, 5.0, angle=0.3, velocity=velocity)
    assert run.stop_reason == "slack"
    true = reference(SCENES["exercise_large"], 0.3, velocity, run.time)
    assert run.error_estimate is not None
    assert np.all(np.isfinite(run.error_estimate))
    assert 0.1 < ratio(run.error_estimate, np.abs(run.angle - true.angle)) < 10.0


# --- the comparison's text ------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_comparison_without_a_truth_tells_the_estimates() -> None:
    """Check that a comparison has estimates where there is no reference solution, and no second run elsewhere."""
    comparison = compare("windy", "rk4,forward_euler", dt=0.02, duration=1.0)
    values = {name.split()[0]: value for name, value in comparison.estimates.items()}
    assert 0.0 < values["rk4"] < 1e-3 < values["forward_euler"]
    assert f"rk4 {values['rk4']:.1g} rad" in comparison.text
    blown = compare("windy", "forward_euler", dt=0.4, duration=40.0)
    assert "forward_euler unknown" in blown.text
    assert not compare("vacuum", "rk4", duration=1.0).estimates


# --- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [1, "yes", None, 0.5])
def test_estimate_error_is_true_or_false(value: Any) -> None:
    with pytest.raises(SceneError, match="estimate_error must be True or False"):
        rollout("vacuum", estimate_error=value)


def test_the_diagnostic_has_its_place_in_the_one_list() -> None:
    assert DIAGNOSTICS[-1] == "error"
    with pytest.raises(SceneError, match="error"):
        rollout("vacuum", diagnostics=("eror",))
    with pytest.raises(SceneError, match="must be a tuple"):
        gym.make("LabPendulum-v0", diagnostics="error")


# --- the estimator --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["rk4", "exact", "forward_euler"])
def test_numbers_and_arrays_are_measured_alike(method: str) -> None:
    numbers = {"omega0": SCENES["vacuum"].omega0}
    estimate = ErrorEstimator.of(SCENES["vacuum"], integrators.get(method), 0.01, numbers, False)
    random = np.random.default_rng(1)
    rows = random.uniform(-9.0, 9.0, (50, 4))
    rows[:, 1], rows[:, 3] = rows[:, 0] + 10.0 ** -random.uniform(1, 17, 50), rows[:, 2] + 1e-9
    index, span, fastest = np.arange(50.0), random.uniform(0.0, 5.0, 50), np.abs(rows[:, 2])
    many = estimate(index, (rows[:, 0], rows[:, 1]), (rows[:, 2], rows[:, 3]), span, fastest)
    for i, row in enumerate(rows.tolist()):
        motion = float(span[i]), float(fastest[i])
        one = estimate(float(i), (row[0], row[1]), (row[2], row[3]), *motion, min, max, math.sqrt)
        assert one == tuple(values[i] for values in many)


@pytest.mark.parametrize(("method", "gain"), [("forward_euler", 2.0), ("rk4", 16.0 / 15.0), ("exact", 1.0)])
def test_differences_are_extrapolated_by_the_declared_order(method: str, gain: float) -> None:
    estimate = ErrorEstimator.of(SCENES["vacuum"], integrators.get(method), 0.01, {"omega0": 3.0}, False)
    assert estimate.gain == gain
    assert estimate(10.0, (1.0, 1.0 + 2.0**-20), (0.0, 0.0), 1.0, 1.0, min, max, math.sqrt)[0] == gain * 2.0**-20


def test_tolerances_are_tighter_at_half_the_step_and_never_below_what_can_be() -> None:
    numbers = certificate.halved({"rtol": 3.2e-7, "atol": 6.4e-7, "hold": 4.0, "scale": 2.0, "gravity_rate": 9.8})
    assert numbers == {"rtol": pytest.approx(1e-8), "atol": pytest.approx(2e-8), "hold": 8.0, "scale": math.inf,
                       "gravity_rate": 9.8}
    assert certificate.halved({"rtol": 1e-15, "atol": 1e-15})["rtol"] > 1e-15


@pytest.mark.parametrize(("compensated", "walk"), [(False, 20.0), (True, 1.0)])
def test_runs_that_agree_have_an_error_of_rounding(compensated: bool, walk: float) -> None:
    """Check the rounding bound u (|angle| + (walk + omega0 t)(|tilt| + |velocity|/omega0)) of equal runs."""
    estimate = ErrorEstimator.of(SCENES["vacuum"], integrators.get("rk4"), 0.01, {"omega0": 3.0}, compensated)
    angle, velocity, u = 4.0 * math.pi + 0.25, 1.5, 2.0**-53
    result = estimate(400.0, (angle, angle), (velocity, velocity), 20.0, 1.5, min, max, math.sqrt)
    assert result[0] == pytest.approx(u * (angle + (walk + 12.0) * (0.25 + 0.5)), rel=1e-12)
    assert result[1] == pytest.approx(u * (walk + 12.0) * (1.5 + 0.75), rel=1e-12)
    assert result[2]
