"""Which effects matter: changes of period and amplitude against closed forms, verdicts, and simplified scenes."""

import csv
import math

import numpy as np
import pytest
from PIL import Image

from pendulum_env.physics import exact
from pendulum_env.physics.effects import CoulombFriction, Gravity, LinearDrag, Motor, QuadraticDrag, SmallAngleGravity
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.study.audit import audit, simplify, write
from pendulum_env.study.audit_plot import draw
from pendulum_env.study.reference import StudyError
from pendulum_env.study.swing import swing, turning_points
from pendulum_env.study.verdicts import CALLED_FOR, NEGLIGIBLE, Audit, AuditRow

W = math.sqrt(9.81)


def of(*effects) -> Scene:
    """The vacuum scene (1 m, 1 kg, g 9.81) with other effects."""
    return SCENES["vacuum"].with_effects(effects)


def asked(scene, amplitude, tolerance) -> dict[str, AuditRow]:
    rows = audit(scene, amplitude=amplitude, tolerance=tolerance, backend="python").rows
    return {row.effect: row for row in rows}


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
    found = swing(SCENES["vacuum"], amplitude, 1024, backend="python")
    assert found.period == pytest.approx(exact.period(amplitude, W), rel=1e-9)
    assert found.amplitude == pytest.approx(amplitude, rel=1e-9)


# --- changes against closed forms -----------------------------------------------------------------------------------


def test_linear_drag_on_the_harmonic_oscillator():
    """T = 2 pi/sqrt(omega0² - gamma²/4), and A falls as exp(-gamma t/2)."""
    gamma = 0.3
    row = asked(of(SmallAngleGravity(), LinearDrag(gamma=gamma)), 0.2, 1e-4)["linear_drag"]
    slow = math.sqrt(W**2 - gamma**2 / 4.0)
    assert row.period_change == pytest.approx(W / slow - 1.0, rel=1e-6)
    assert row.amplitude_change == pytest.approx(math.expm1(-gamma * math.pi / (2.0 * slow)), rel=1e-8)
    assert row.period_predicted == pytest.approx(row.period_change, rel=0.01)
    assert row.amplitude_predicted == pytest.approx(row.amplitude_change, rel=0.1)


def test_quadratic_drag_takes_the_exact_share_of_the_amplitude():
    c, amplitude = 0.05, 0.8
    row = asked(of(Gravity(), QuadraticDrag(c=c)), amplitude, 1e-3)["quadratic_drag"]
    after = abs(exact.quadratic_turning_point(amplitude, c))
    assert row.amplitude_change == pytest.approx(after / amplitude - 1.0, rel=1e-7)
    assert row.amplitude_predicted == pytest.approx(row.amplitude_change, rel=0.1)


def test_dry_friction_takes_two_tau_and_leaves_the_period():
    tau, amplitude = 0.004, 0.3
    scene = of(SmallAngleGravity(), CoulombFriction(friction_torque=tau * 9.81))
    row = asked(scene, amplitude, 1e-3)["coulomb_friction"]
    assert row.amplitude_change == pytest.approx(-2.0 * tau / amplitude, rel=1e-8)
    assert row.period_change == pytest.approx(0.0, abs=1e-9)
    assert row.amplitude_predicted == pytest.approx(-2.0 * tau / amplitude, rel=1e-12)
    assert row.period_predicted == 0.0


def test_dry_friction_at_full_gravity():
    tau, amplitude = 0.004, 1.2
    row = asked(of(Gravity(), CoulombFriction(friction_torque=tau * 9.81)), amplitude, 1e-3)["coulomb_friction"]
    after = abs(exact.coulomb_turning_points(amplitude, tau, 1)[1])
    assert row.amplitude_change == pytest.approx(after / amplitude - 1.0, rel=1e-7)


@pytest.mark.parametrize("drag", [LinearDrag(gamma=0.01), QuadraticDrag(c=0.005)], ids=lambda e: e.name)
def test_a_loss_of_amplitude_shortens_the_period_as_predicted(drag):
    row = asked(of(Gravity(), drag), 0.4, 1e-5)[drag.name]
    assert row.period_change < 0.0
    assert row.period_predicted == pytest.approx(row.period_change, rel=0.05)


@pytest.mark.parametrize("amplitude", [0.1, 1.0])
def test_small_angle_scenes_are_compared_with_full_gravity(amplitude):
    rows = asked(SCENES["textbook"], amplitude, 1e-3)
    change = exact.period(amplitude, W) * W / (2.0 * math.pi) - 1.0
    assert not rows["gravity"].present
    assert rows["gravity"].period_change == pytest.approx(change, rel=1e-7)
    assert rows["gravity"].period_predicted == pytest.approx(change, rel=1e-4)
    assert rows["gravity"].verdict == (CALLED_FOR if amplitude == 1.0 else NEGLIGIBLE)
    assert "replacing small_angle_gravity by gravity changes the period by" in rows["gravity"].note
    assert rows["small_angle_gravity"].verdict == CALLED_FOR
    assert math.isnan(rows["small_angle_gravity"].period_change)


def test_a_constant_push_moves_the_middle_of_the_swing():
    u, amplitude = 0.01, 0.1
    row = asked(of(SmallAngleGravity(), Motor(max_torque=u * 9.81)), amplitude, 1e-3)["motor"]
    assert row.amplitude_change == pytest.approx(-2.0 * u / amplitude, rel=1e-8)
    assert row.amplitude_predicted == pytest.approx(-2.0 * u / amplitude, rel=1e-12)
    assert row.period_change == pytest.approx(0.0, abs=1e-9)
    assert "at full control" in row.note


# --- verdicts -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("tolerance", "verdict"), [(0.02, NEGLIGIBLE), (0.002, CALLED_FOR)])
def test_the_tolerance_decides(tolerance, verdict):
    rows = asked(SCENES["lab"], math.radians(30.0), tolerance)  # linear drag takes 0.6 % of the amplitude
    assert rows["linear_drag"].verdict == verdict
    assert rows["gravity"].verdict == CALLED_FOR
    assert "without it nothing swings" in rows["gravity"].note
    assert all(row.present for row in rows.values())


def test_an_effect_that_stops_the_swing_is_called_for():
    rows = asked(of(Gravity(), LinearDrag(gamma=30.0), QuadraticDrag(c=1e-9)), 0.5, 1e-3)
    assert rows["linear_drag"].verdict == CALLED_FOR
    assert "does not make" in rows["linear_drag"].note
    assert rows["quadratic_drag"].verdict == NEGLIGIBLE
    assert "the angle's largest" in rows["quadratic_drag"].note


def test_the_simulation_is_refined_to_the_tolerance():
    found = audit("vacuum", amplitude=1.0, tolerance=1e-9, backend="python")
    assert found.integration_error <= 1e-10


def test_costs_are_numbers():
    for row in asked(SCENES["lab"], 0.5, 1e-2).values():
        assert math.isfinite(row.ns_per_step)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"tolerance": 0.0}, SceneError, "tolerance must be a finite number above 0"),
        ({"tolerance": -1e-3}, SceneError, "tolerance must be a finite number above 0"),
        ({"tolerance": math.nan}, SceneError, "tolerance must be a finite number above 0"),
        ({"amplitude": math.nan}, SceneError, "amplitude must be a finite number above 0"),
        ({"amplitude": 0.0}, SceneError, "amplitude must be a finite number above 0"),
        ({"amplitude": 3.2}, StudyError, "amplitude must be below pi"),
        ({"tolerance": 1e-20}, StudyError, r"tolerance must be above \S+ here"),
        ({"scene": "textbok"}, SceneError, "textbook"),
        ({"scene": of(LinearDrag(gamma=1.0))}, StudyError, "no gravity"),
    ],
)
def test_bad_input_gives_one_clear_error(arguments, error, message):
    with pytest.raises(error, match=message):
        audit(**{"scene": "vacuum", "amplitude": 0.5, "tolerance": 1e-3, "backend": "python", **arguments})


# --- simplified scenes ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("duration", "within"), [(1.0, True), (60.0, False)])
def test_simplify_removes_what_is_negligible_and_says_what_that_does(duration, within):
    gamma, amplitude = 2e-3, 0.2
    scene = of(SmallAngleGravity(), LinearDrag(gamma=gamma))
    plain, report = simplify(scene, amplitude=amplitude, tolerance=2e-3, duration=duration, backend="python")
    assert [effect.name for effect in plain.effects] == ["small_angle_gravity"]
    assert report.removed == ("linear_drag",)
    time = np.linspace(0.0, duration, 20_001)
    gap = exact.linear(time, amplitude, 0.0, W, gamma)[0] - exact.linear(time, amplitude, 0.0, W)[0]
    assert report.error == pytest.approx(np.max(np.abs(gap)) / amplitude, rel=2e-3)
    assert report.within is within
    assert (": within" if within else ": NOT within") in report.text


def test_simplify_keeps_what_is_called_for():
    scene = of(SmallAngleGravity(), LinearDrag(gamma=0.5))
    plain, report = simplify(scene, amplitude=1.0, tolerance=1e-3, backend="python")
    assert plain == scene
    assert report.removed == ()
    assert report.error == 0.0
    assert "calls for gravity, which the scene leaves out" in report.text


def test_simplify_compares_over_the_usual_run_by_default():
    scene = of(Gravity(), LinearDrag(gamma=1e-7))
    _, report = simplify(scene, amplitude=0.2, tolerance=1e-3, backend="python")
    assert report.duration == scene.run.duration
    assert report.within


def test_simplify_checks_its_duration():
    with pytest.raises(SceneError, match="duration must be a finite number above 0"):
        simplify("vacuum", amplitude=0.2, tolerance=1e-3, duration=0.0, backend="python")


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bearing() -> Audit:
    return audit("sticky_bearing", amplitude=0.5, tolerance=1e-3, backend="python")


def test_files(bearing, tmp_path):
    picture, table = write(bearing, tmp_path)
    lines = table.read_text().splitlines()
    head = [line for line in lines if line.startswith("# ")]
    assert any(line.startswith("# Tolerance: 0.001") for line in head)
    rows = list(csv.DictReader(lines[len(head):]))
    assert [row["effect"] for row in rows] == [effect.name for effect in bearing.scene.effects]
    assert [row["verdict"] for row in rows] == [row.verdict for row in bearing.rows]
    with Image.open(picture) as image:
        assert "sticky_bearing" in image.info["Scene"]


def test_the_chart_has_the_bars_the_formulas_and_the_tolerance(bearing):
    (axes,) = draw(bearing).axes
    low = axes.get_xlim()[0]
    ends = sorted(bar.get_x() + bar.get_width() for bar in axes.patches)
    sizes = [abs(value) for row in bearing.rows for value in (row.period_change, row.amplitude_change)]
    assert ends == pytest.approx(sorted(size for size in sizes if size > low))
    assert any(set(line.get_xdata()) == {bearing.tolerance} for line in axes.lines)
    assert [label.get_text().split("\n")[0] for label in axes.get_yticklabels()] == [row.effect for row in bearing.rows]
