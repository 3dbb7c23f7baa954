"""Tests of audits: changes of period and amplitude compared with closed forms, and verdicts."""

import math

import mpmath
import numpy as np
import pytest
from audits import AIRY, WEIGHTS, W, asked, of

from pendulum_env.physics import exact
from pendulum_env.physics.effects import (
    BearingFriction,
    CoulombFriction,
    Gravity,
    Gusts,
    LinearDrag,
    Motor,
    PeriodicTorque,
    QuadraticDrag,
    SmallAngleGravity,
    VerticalDrive,
    Wind,
)
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.units import SceneError
from pendulum_env.study.audit.cases import SAMPLES, swing, turning_points
from pendulum_env.study.audit.study import audit, simplify
from pendulum_env.study.audit.verdicts import CALLED_FOR, NEGLIGIBLE, NOT_JUDGED, NOT_SIMULATED, OUTSIDE
from pendulum_env.truth.reference import StudyError

# --- measuring swings -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 2.9])
def test_turning_points_between_the_steps(amplitude):
    time = np.linspace(0.0, 10.0, 2001)
    angle, velocity = exact.pendulum(time, amplitude, 0.0, W)
    half = exact.period(amplitude, W) / 2.0
    found = turning_points(time, angle, np.concatenate(([0.0], velocity[1:])))
    assert len(found) == math.floor(10.0 / half)
    for k, (moment, place) in enumerate(found, start=1):
        assert moment == pytest.approx(k * half, abs=1e-9)
        assert place == pytest.approx((-1) ** k * amplitude, abs=1e-9)


@pytest.mark.parametrize("amplitude", [0.1, 1.0, 2.9])
def test_a_swing_has_the_exact_period(amplitude):
    found = swing(SCENES["vacuum"], amplitude, exact.period(amplitude, W), 8 * SAMPLES, backend="python")
    assert found.period == pytest.approx(exact.period(amplitude, W), rel=1e-9)
    assert found.amplitude == pytest.approx(amplitude, rel=1e-9)


# --- changes against closed forms -----------------------------------------------------------------------------------


def test_linear_drag_on_the_harmonic_oscillator():
    """Compare with T = 2 pi/sqrt(omega0² - gamma²/4) and an amplitude that falls as exp(-gamma t/2)."""
    gamma = 0.3
    row = asked(of(SmallAngleGravity(), LinearDrag(gamma=gamma)), 0.2, 1e-6, ["linear_drag"])["linear_drag"]
    slow = math.sqrt(W**2 - gamma**2 / 4.0)
    assert row.period_change == pytest.approx(W / slow - 1.0, rel=1e-6)
    assert row.amplitude_change == pytest.approx(math.expm1(-gamma * math.pi / (2.0 * slow)), rel=1e-8)
    assert row.period_predicted == pytest.approx(row.period_change, rel=0.01)
    assert row.amplitude_predicted == pytest.approx(row.amplitude_change, rel=0.1)


def test_quadratic_drag_takes_the_exact_share_of_the_amplitude():
    c, amplitude = 0.05, 0.8
    row = asked(of(Gravity(), QuadraticDrag(c=c)), amplitude, 1e-3, ["quadratic_drag"])["quadratic_drag"]
    after = abs(exact.quadratic_turning_point(amplitude, c))
    assert row.amplitude_change == pytest.approx(after / amplitude - 1.0, rel=1e-7)
    assert row.amplitude_predicted == pytest.approx(row.amplitude_change, rel=0.1)


def test_dry_friction_takes_two_tau_and_leaves_the_period():
    tau, amplitude = 0.004, 0.3
    scene = of(SmallAngleGravity(), CoulombFriction(friction_torque=tau * 9.81))
    row = asked(scene, amplitude, 1e-3, ["coulomb_friction"])["coulomb_friction"]
    assert row.amplitude_change == pytest.approx(-2.0 * tau / amplitude, rel=1e-8)
    assert row.period_change == pytest.approx(0.0, abs=1e-9)
    assert row.amplitude_predicted == pytest.approx(-2.0 * tau / amplitude, rel=1e-12)
    assert row.period_predicted == 0.0


def test_dry_friction_at_full_gravity():
    tau, amplitude = 0.004, 1.2
    scene = of(Gravity(), CoulombFriction(friction_torque=tau * 9.81))
    row = asked(scene, amplitude, 1e-3, ["coulomb_friction"])["coulomb_friction"]
    after = abs(exact.coulomb_turning_points(amplitude, tau, 1)[1])
    assert row.amplitude_change == pytest.approx(after / amplitude - 1.0, rel=1e-7)


@pytest.mark.parametrize(
    "drag", [LinearDrag(gamma=0.01), QuadraticDrag(c=0.005), BearingFriction(bearing_viscosity=0.01)],
    ids=lambda e: e.name,
)
def test_a_loss_of_amplitude_shortens_the_period_as_predicted(drag):
    row = asked(of(Gravity(), drag), 0.4, 1e-5, [drag.name])[drag.name]
    assert row.period_change < 0.0
    assert row.period_predicted == pytest.approx(row.period_change, rel=0.05)


@pytest.mark.parametrize("amplitude", [0.1, 1.0])
def test_small_angle_scenes_are_compared_with_full_gravity(amplitude):
    """Compare with T = 4 K(sin(A/2))/omega0 instead of 2 pi/omega0, with K computed by mpmath."""
    rows = asked(SCENES["textbook"], amplitude, 1e-3, WEIGHTS)
    change = float(2 * mpmath.ellipk(mpmath.sin(mpmath.mpf(amplitude) / 2) ** 2) / mpmath.pi - 1)
    assert not rows["gravity"].present
    assert rows["gravity"].period_change == pytest.approx(change, rel=1e-6)
    assert rows["gravity"].period_predicted == pytest.approx(change, rel=1e-4)
    assert rows["gravity"].verdict == (CALLED_FOR if amplitude == 1.0 else NEGLIGIBLE)
    assert rows["gravity"].note == "in place of small_angle_gravity"
    assert rows["small_angle_gravity"].verdict == CALLED_FOR
    assert math.isnan(rows["small_angle_gravity"].period_change)


@pytest.mark.parametrize(("amplitude", "verdict"), [(0.1, NEGLIGIBLE), (1.0, OUTSIDE)])
def test_full_gravity_is_compared_with_small_angles(amplitude, verdict):
    rows = asked(SCENES["vacuum"], amplitude, 1e-3, WEIGHTS)
    change = exact.period(amplitude, W) * W / (2.0 * math.pi) - 1.0
    assert rows["gravity"].period_change == pytest.approx(change, rel=1e-6)
    assert rows["gravity"].verdict == CALLED_FOR
    assert rows["small_angle_gravity"].period_change == pytest.approx(1.0 / (1.0 + change) - 1.0, rel=1e-6)
    assert rows["small_angle_gravity"].period_predicted == pytest.approx(1.0 / (1.0 + change) - 1.0, rel=1e-9)
    assert rows["small_angle_gravity"].verdict == verdict
    assert rows["small_angle_gravity"].note == ("accurate enough" if verdict == NEGLIGIBLE else "too coarse") + (
        " in place of gravity")


def test_a_constant_push_moves_the_middle_of_the_swing():
    u, amplitude = 0.01, 0.1
    row = asked(of(SmallAngleGravity(), Motor(max_torque=u * 9.81)), amplitude, 1e-3, ["motor"])["motor"]
    assert row.amplitude_change == pytest.approx(-2.0 * u / amplitude, rel=1e-8)
    assert row.amplitude_predicted == pytest.approx(-2.0 * u / amplitude, rel=1e-12)
    assert row.period_change == pytest.approx(0.0, abs=1e-9)
    assert "at full control" in row.note


def test_a_steady_swing_that_nothing_drives_is_told_from_one_that_something_drives():
    """On the oscillator a periodic torque adds f (cos(w t) - cos(W t))/(W² - w²) for every release angle."""
    f, w, amplitude = 0.2, 1.3, 0.4
    drive, nothing = PeriodicTorque(drive_torque=f, drive_rate=w), BearingFriction(bearing_viscosity=0.0)
    scene = of(SmallAngleGravity(), drive, nothing)
    rows = asked(scene, amplitude, 1e-3, ["periodic_torque", "bearing_friction"])
    row = rows["periodic_torque"]
    time = np.arange(4 * SAMPLES + 1) * (2.0 * math.pi / W / SAMPLES)
    added = f / (W**2 - w**2) * (np.cos(w * time) - np.cos(W * time))
    assert row.angle_change == pytest.approx(np.max(np.abs(added)) / amplitude, rel=1e-6)
    assert math.isnan(row.period_change)
    assert math.isnan(row.amplitude_change)
    assert row.verdict == CALLED_FOR
    assert rows["bearing_friction"].angle_change == 0.0
    assert math.isnan(rows["bearing_friction"].amplitude_predicted)


def test_overdamped_motion_is_compared_by_its_angles():
    gamma, amplitude = 9.0, 0.4
    row = asked(of(SmallAngleGravity(), LinearDrag(gamma=gamma)), amplitude, 1e-3, ["linear_drag"])["linear_drag"]
    time = np.arange(4 * SAMPLES + 1) * (2.0 * math.pi / W / SAMPLES)
    gap = exact.linear(time, amplitude, 0.0, W, gamma)[0] - exact.linear(time, amplitude, 0.0, W)[0]
    assert row.angle_change == pytest.approx(np.max(np.abs(gap)) / amplitude, rel=1e-6)
    assert row.note == "with the effect the bob does not make 3 oscillations, without the effect it does"
    assert math.isnan(row.amplitude_predicted)


@pytest.mark.slow
def test_gusts_are_the_same_with_and_without_an_effect():
    """Check that a wind of speed 0 changes no bit of the motion in gusts."""
    scene = AIRY.with_effects((Gravity(), LinearDrag(gamma=0.5), Wind(wind_speed=0.0), Gusts()))
    rows = asked(scene, 0.4, 1e-3, ["wind", "gusts"])
    assert rows["wind"].angle_change == 0.0
    assert rows["gusts"].angle_change > 0.1
    plain, report = simplify(scene, amplitude=0.4, tolerance=1e-3, duration=3.0, backend="python")
    assert report.removed == ("wind",)
    assert report.error == 0.0
    assert plain.has("gusts")


def test_a_lagging_motor_that_is_asked_for_nothing_leaves_the_swings_free():
    scene = AIRY.with_effects((Gravity(), LinearDrag(gamma=0.1), Motor(lag=0.2)))
    rows = asked(scene, 0.4, 1e-3, ["linear_drag", "motor"])
    assert rows["linear_drag"].amplitude_change == pytest.approx(-0.1 * math.pi / (2.0 * W), rel=0.05)
    assert math.isnan(rows["motor"].period_change)
    assert rows["motor"].angle_change > 1e-3


# --- verdicts -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("tolerance", "verdict"), [(0.0062, NEGLIGIBLE), (0.0060, CALLED_FOR)])
def test_the_tolerance_decides(tolerance, verdict):
    """Linear drag reduces the amplitude by pi gamma/(2 omega0) = 0.6 %, a little more from 30 degrees."""
    rows = asked(SCENES["lab"], math.radians(30.0), tolerance, ["linear_drag", "gravity"])
    assert rows["linear_drag"].verdict == verdict
    assert rows["gravity"].verdict == CALLED_FOR
    assert "nothing swings without it" in rows["gravity"].note


def test_an_effect_that_stops_the_swing_is_called_for():
    scene = of(Gravity(), LinearDrag(gamma=30.0), QuadraticDrag(c=1e-9))
    rows = asked(scene, 0.5, 1e-3, ["linear_drag", "quadratic_drag"])
    assert rows["linear_drag"].verdict == CALLED_FOR
    assert "does not make" in rows["linear_drag"].note
    assert rows["quadratic_drag"].verdict == NEGLIGIBLE
    assert 0.0 < rows["quadratic_drag"].angle_change < 1e-8


def test_a_scene_without_a_weight_calls_for_it():
    rows = asked(of(LinearDrag(gamma=1.0)), 0.5, 1e-3, ["linear_drag", "gravity"])
    assert rows["gravity"].verdict == CALLED_FOR
    assert rows["linear_drag"].verdict == NEGLIGIBLE
    assert rows["linear_drag"].angle_change == 0.0


def test_where_a_wire_is_slack_from_the_start_nothing_is_judged():
    scene = of(Gravity(), LinearDrag(gamma=1e-9)).replace(suspension="wire")
    row = asked(scene, 2.5, 1e-3, ["linear_drag"])["linear_drag"]
    assert row.note == "the run ends at once with and without the effect: slack"
    assert row.verdict == NOT_JUDGED
    assert asked(scene, 1.5, 1e-3, ["linear_drag"])["linear_drag"].verdict == NEGLIGIBLE


def test_an_effect_that_ends_the_run_is_called_for():
    """The pivot falls with an acceleration of 4 g while the bob hangs on a wire, so the wire goes slack."""
    drive = VerticalDrive(vertical_amplitude=0.1, vertical_rate=20.0)
    row = asked(of(Gravity(), drive).replace(suspension="wire"), 0.2, 100.0, ["vertical_drive"])["vertical_drive"]
    assert row.angle_change < 1.0
    assert (row.verdict, row.note) == (CALLED_FOR, "end of the run with the effect: slack, without: time")


@pytest.mark.slow
def test_close_to_the_top():
    """From 1e-3 rad below the top the period is five times that of small swings."""
    rows = asked(of(Gravity(), LinearDrag(gamma=1e-3)), math.pi - 1e-3, 1e-2, [*WEIGHTS, "linear_drag"])
    assert rows["linear_drag"].verdict == CALLED_FOR
    assert rows["small_angle_gravity"].verdict == OUTSIDE


@pytest.mark.slow
def test_what_is_too_stiff_is_not_judged():
    row = asked(of(Gravity(), LinearDrag(gamma=1e6)), 0.5, 1e-3, ["linear_drag"])["linear_drag"]
    note = "the simulation diverges at every step of rk4, because the scene is too stiff"
    assert (row.verdict, row.note) == (NOT_JUDGED, note)


@pytest.mark.slow
def test_the_simulation_is_refined_to_the_tolerance():
    found = audit("vacuum", amplitude=1.0, tolerance=1e-9, effects=WEIGHTS, backend="python")
    assert found.integration_error <= 1e-10


@pytest.mark.slow
def test_costs_are_numbers_for_what_was_simulated():
    for row in asked(SCENES["lab"], 0.5, 1e-2).values():
        assert math.isfinite(row.ns_per_step) == (row.verdict not in (NOT_JUDGED, NOT_SIMULATED))


@pytest.mark.quick(
    "arguments0-SceneError-tolerance must be a finite number above 0", "arguments9-SceneError-did you mean gravity"
)
@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"tolerance": 0.0}, SceneError, "tolerance must be a finite number above 0"),
        ({"tolerance": -1e-3}, SceneError, "tolerance must be a finite number above 0"),
        ({"tolerance": math.nan}, SceneError, "tolerance must be a finite number above 0"),
        ({"amplitude": math.nan}, SceneError, "amplitude must be a finite number above 0"),
        ({"amplitude": 0.0}, SceneError, "amplitude must be a finite number above 0"),
        ({"amplitude": 3.2}, StudyError, "amplitude must be below pi"),
        ({"tolerance": 1e-20}, StudyError, r"tolerance must be above \S+, the accuracy"),
        ({"scene": "textbok"}, SceneError, "textbook"),
        ({"scene": of(Gravity()).replace(gravity=0.0)}, StudyError, "nothing moves after a release at rest"),
        ({"effects": ["gravty"]}, SceneError, "did you mean gravity"),
    ],
)
def test_bad_input_gives_one_clear_error(arguments, error, message):
    usual = {"scene": "vacuum", "amplitude": 0.5, "tolerance": 1e-3, "effects": WEIGHTS, "backend": "python"}
    with pytest.raises(error, match=message):
        audit(**{**usual, **arguments})
