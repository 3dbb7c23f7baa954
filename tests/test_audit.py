"""Which effects matter: changes of period and amplitude against closed forms, verdicts, and simplified scenes."""

import csv
import math
from dataclasses import dataclass, fields
from typing import ClassVar

import mpmath
import numpy as np
import pytest
from PIL import Image
from scipy.integrate import solve_ivp

from pendulum_env.console import print_table
from pendulum_env.physics import exact
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    EFFECTS,
    BearingFriction,
    CoulombFriction,
    Effect,
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
from pendulum_env.physics.medium import air
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.study import cases as cases_module
from pendulum_env.study.audit import audit, write
from pendulum_env.study.audit_plot import draw
from pendulum_env.study.cases import cases
from pendulum_env.study.judging import corrections
from pendulum_env.study.reference import StudyError
from pendulum_env.study.simplify import simplify
from pendulum_env.study.swing import SAMPLES, swing, turning_points
from pendulum_env.study.tables import remarks, verdicts
from pendulum_env.study.verdicts import CALLED_FOR, NEGLIGIBLE, NOT_JUDGED, NOT_SIMULATED, OUTSIDE, Audit, AuditRow

W = math.sqrt(9.81)
AIRY = Scene("airy", Body(), air(20.0), (Gravity(),))
WEIGHTS = ["gravity", "small_angle_gravity"]
CORRECTIONS = ("support_compliance", "wire_flexure")


def of(*effects) -> Scene:
    """The vacuum scene (1 m, 1 kg, g 9.81) with other effects."""
    return SCENES["vacuum"].with_effects(effects)


def asked(scene, amplitude, tolerance, effects=None) -> dict[str, AuditRow]:
    rows = audit(scene, amplitude=amplitude, tolerance=tolerance, effects=effects, backend="python").rows
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
    found = swing(SCENES["vacuum"], amplitude, exact.period(amplitude, W), 8 * SAMPLES, backend="python")
    assert found.period == pytest.approx(exact.period(amplitude, W), rel=1e-9)
    assert found.amplitude == pytest.approx(amplitude, rel=1e-9)


# --- changes against closed forms -----------------------------------------------------------------------------------


def test_linear_drag_on_the_harmonic_oscillator():
    """T = 2 pi/sqrt(omega0² - gamma²/4), and A falls as exp(-gamma t/2)."""
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
    """T = 4 K(sin(A/2))/omega0 against 2 pi/omega0, K by mpmath."""
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
    assert rows["small_angle_gravity"].verdict == verdict
    assert rows["small_angle_gravity"].note == ("would do" if verdict == NEGLIGIBLE else "too coarse") + (
        " in place of gravity")


def test_a_constant_push_moves_the_middle_of_the_swing():
    u, amplitude = 0.01, 0.1
    row = asked(of(SmallAngleGravity(), Motor(max_torque=u * 9.81)), amplitude, 1e-3, ["motor"])["motor"]
    assert row.amplitude_change == pytest.approx(-2.0 * u / amplitude, rel=1e-8)
    assert row.amplitude_predicted == pytest.approx(-2.0 * u / amplitude, rel=1e-12)
    assert row.period_change == pytest.approx(0.0, abs=1e-9)
    assert "at full control" in row.note


def test_a_steady_swing_that_nothing_drives_is_told_from_one_that_something_drives():
    """On the oscillator a periodic torque adds f (cos(w t) - cos(W t))/(W² - w²), whatever the release."""
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
    assert row.note == "with it the bob does not make 3 oscillations, without it it does"
    assert math.isnan(row.amplitude_predicted)


def test_gusts_are_the_same_with_and_without_an_effect():
    """A wind of no speed changes nothing, to the last bit; gusts do."""
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


# --- effects that the scene leaves out ------------------------------------------------------------------------------


def rough(slip: float, rough_rate: float) -> float:
    return -rough_rate * slip


def smooth(slip: float, smooth_rate: float) -> float:
    return -smooth_rate * slip


@dataclass(frozen=True)
class Ballast(Effect):
    """A tenth more moment of inertia, from nowhere."""

    name: ClassVar[str] = "ballast"
    kind: ClassVar[str] = "inertia"
    number_name: ClassVar[str] = "dI/I"
    equation: ClassVar[str] = ""
    source: ClassVar[str] = "none"

    def coefficients(self, scene):
        return {}

    def inertia(self, scene):
        return 0.1 * scene.body.inertia

    def number(self, scene, amplitude):
        return 0.1

    def predicted(self, scene, amplitude):
        return 0.05, 0.0

    @classmethod
    def trial(cls, scene):
        return cls()


@dataclass(frozen=True)
class Rough(Effect):
    """A drag that two laws describe, this one up to 1 m/s."""

    name: ClassVar[str] = "rough_drag"
    kind: ClassVar[str] = "dissipative"
    equation: ClassVar[str] = "- {rough_rate:.6g} theta'"
    source: ClassVar[str] = "none"
    needs_medium: ClassVar[bool] = True
    torque = staticmethod(rough)
    models = "the drag"
    rate: ClassVar[float] = 0.010
    loss: ClassVar[float] = 0.5e-2

    def coefficients(self, scene):
        return {"rough_rate": self.rate}

    def predicted(self, scene, amplitude):
        return 0.0, -self.loss

    def outside(self, scene, speed):
        return f"no good at {speed:.2f} m/s" if speed > 1.0 else ""

    @classmethod
    def trial(cls, scene):
        return cls()


@dataclass(frozen=True)
class Smooth(Rough):
    """The closer law, at any speed."""

    name: ClassVar[str] = "smooth_drag"
    equation: ClassVar[str] = "- {smooth_rate:.6g} theta'"
    torque = staticmethod(smooth)
    detail: ClassVar[int] = 1
    loss: ClassVar[float] = 1.5e-2

    def coefficients(self, scene):
        return {"smooth_rate": 3.0 * self.rate}

    def outside(self, scene, speed):
        return ""


@dataclass(frozen=True)
class Refused(Ballast):
    """Not in any scene."""

    name: ClassVar[str] = "refused"

    def check(self, scene):
        raise SceneError("This cannot be.")


@pytest.fixture
def _known(monkeypatch):
    extra = {kind.name: kind for kind in (Ballast, Rough, Smooth, Refused)}
    monkeypatch.setattr(cases_module, "EFFECTS", {"gravity": Gravity, "motor": Motor, **extra})


@pytest.mark.usefixtures("_known")
def test_an_absent_inertia_changes_the_period_and_costs_nothing():
    row = asked(AIRY, 0.2, 1e-3)["ballast"]
    assert not row.present
    assert row.period_change == pytest.approx(math.sqrt(1.1) - 1.0, rel=1e-6)
    assert row.ns_per_step == 0.0
    assert (row.number_name, row.number, row.period_predicted) == ("dI/I", 0.1, 0.05)
    assert row.verdict == CALLED_FOR


@pytest.mark.usefixtures("_known")
def test_what_cannot_be_added_says_why():
    rows = asked(AIRY, 0.2, 1e-3)
    assert {name: row.note for name, row in rows.items() if row.verdict == NOT_JUDGED} == {
        "refused": "This cannot be.", "motor": "needs max_torque, lag"}
    rows = asked(AIRY.replace(medium=SCENES["vacuum"].medium), 0.2, 1e-3, ["rough_drag"])
    assert rows["rough_drag"].note == "there is none in vacuum"


@pytest.mark.usefixtures("_known")
def test_an_absent_model_is_compared_in_place_of_the_one_that_is_there():
    """The amplitude falls as exp(-gamma t/2): the two laws differ by 0.02/s."""
    rough = AIRY.with_effects((Gravity(), Rough()))
    row = asked(rough, 0.2, 1e-3)["smooth_drag"]
    assert row.amplitude_change == pytest.approx(-0.02 * math.pi / (2.0 * W), rel=0.02)
    assert row.amplitude_predicted == pytest.approx(-1.0e-2)
    assert (row.verdict, row.note) == (CALLED_FOR, "in place of rough_drag")
    smooth = AIRY.with_effects((Gravity(), Smooth()))
    row = asked(smooth, 0.2, 1e-3)["rough_drag"]
    assert (row.verdict, row.note) == (OUTSIDE, "too coarse in place of smooth_drag")
    row = asked(smooth, 0.2, 0.05)["rough_drag"]
    assert (row.verdict, row.note) == (NEGLIGIBLE, "would do in place of smooth_drag")


def test_the_laws_of_the_bobs_drag_stand_in_each_others_place():
    """At Re = 1400 Stokes' law is some 25 times too small, and a constant C_d is good to 4 % of the drag."""
    lab = SCENES["lab"]
    scene = lab.with_effects(effect for effect in lab.effects if effect.name != "linear_drag")
    rows = asked(scene, math.radians(30.0), 1e-4, ["quadratic_drag", "sphere_drag", "linear_drag", "wire_drag"])
    assert (rows["sphere_drag"].verdict, rows["sphere_drag"].note) == (NEGLIGIBLE, "in place of quadratic_drag")
    assert abs(rows["sphere_drag"].amplitude_change) < 0.04 * abs(rows["quadratic_drag"].amplitude_change)
    stokes = rows["linear_drag"]
    assert stokes.verdict == OUTSIDE
    assert stokes.note.startswith("Re reaches 1.37e+03, and Stokes' law holds up to 1")
    share = stokes.amplitude_change / rows["quadratic_drag"].amplitude_change
    assert share == pytest.approx(-1.0, abs=0.1)
    assert stokes.amplitude_predicted == pytest.approx(stokes.amplitude_change, rel=0.05)
    assert "in place of" not in rows["wire_drag"].note
    measured = asked(lab, math.radians(30.0), 1e-3, ["linear_drag", "sphere_drag"])
    assert measured["linear_drag"].verdict == CALLED_FOR
    assert measured["sphere_drag"].note == "in place of quadratic_drag"


@pytest.mark.usefixtures("_known")
def test_a_coarser_model_that_holds_is_better_than_a_closer_one_that_does_not(monkeypatch):
    monkeypatch.setattr(Rough, "outside", Smooth.outside)
    monkeypatch.setattr(Smooth, "outside", lambda *_: "no good")
    rows = asked(AIRY.with_effects((Gravity(), Smooth())), 0.2, 1e-3)
    assert (rows["rough_drag"].verdict, rows["rough_drag"].note) == (CALLED_FOR, "in place of smooth_drag")
    assert rows["smooth_drag"].verdict == OUTSIDE


@pytest.mark.usefixtures("_known")
def test_a_formula_that_does_not_hold_is_outside_its_validity():
    """From 0.5 rad the bob reaches 2 sqrt(g L) sin(0.25) = 1.550 m/s, less 0.2 % for the drag."""
    rows = asked(AIRY.with_effects((Gravity(), Rough())), 0.5, 1e-3)
    assert rows["rough_drag"].verdict == OUTSIDE
    assert rows["rough_drag"].note == "no good at 1.55 m/s; by its formula it is called for"
    assert asked(AIRY, 0.5, 0.5)["rough_drag"].note == "no good at 1.55 m/s; by its formula it is negligible"


@pytest.mark.usefixtures("_known")
def test_a_scene_is_completed_with_the_closest_model():
    plain, report = simplify(AIRY, amplitude=0.2, tolerance=1e-3, complete=True, backend="python")
    assert [effect.name for effect in plain.effects] == ["gravity", "ballast", "smooth_drag"]
    assert report.added == ("ballast", "smooth_drag")
    assert report.text.endswith("Added: ballast, smooth_drag. It calls for rough_drag too, which the scene leaves out.")
    rough = AIRY.with_effects((Gravity(), Rough()))
    plain, _ = simplify(rough, amplitude=0.2, tolerance=1e-3, complete=True, backend="python")
    assert [effect.name for effect in plain.effects] == ["gravity", "smooth_drag", "ballast"]


@pytest.mark.parametrize("scene", [*SCENES.values(), of(LinearDrag(gamma=1.0))], ids=lambda scene: scene.name)
def test_every_effect_is_asked_for_once(scene):
    found = [case.name for case in cases(scene)]
    assert sorted(found) == sorted(EFFECTS)
    assert found[: len(scene.effects)] == [effect.name for effect in scene.effects]
    for case in cases(scene):
        assert case.present == scene.has(case.name)
        assert bool(case.reason) != (case.effect is not None)


def test_corrections_that_are_not_simulated_are_named():
    """Bent over sqrt(E I/(m g)), I = pi d⁴/64: 0.3 mm steel under 40 g, 14.2 mm; the period is 2 % shorter."""
    rows = asked(SCENES["exercise_large"], 0.3, 1e-3)
    assert tuple(rows)[-2:] == CORRECTIONS
    bent = math.sqrt(2e11 * math.pi * 0.0003**4 / 64.0 / (0.040 * 9.8))
    assert bent == pytest.approx(14.2e-3, rel=0.01)
    assert rows["wire_flexure"].period_predicted == pytest.approx(-bent / (2.0 * 0.353), rel=1e-9)
    assert rows["wire_flexure"].number == pytest.approx(bent / 0.353, rel=1e-9)
    assert "by the formula it matters" in rows["wire_flexure"].note
    assert all(rows[name].verdict == NOT_SIMULATED for name in CORRECTIONS)
    stiffness = 0.040 * 9.8 / (2.0 * 0.353 * 1e-3)
    assert f"softer than K = {stiffness:.3g} N/m" in rows["support_compliance"].note
    (_, rod) = corrections(SCENES["exercise_large"].replace(suspension="rod"), 1e-3)
    assert math.isnan(rod.period_predicted)
    assert rod.note == "a rod that turns with its shaft does not bend at the pivot"


@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if effect.kind == "inertia"])
def test_what_changes_inertia_or_weight_costs_nothing(name):
    row = asked(SCENES["lab"], 0.3, 1e-3, [name])[name]
    assert row.ns_per_step == 0.0
    assert row.period_change == pytest.approx(row.period_predicted, rel=0.2)
    assert row.verdict == (CALLED_FOR if abs(row.period_change) > 1e-3 else NEGLIGIBLE)


def test_buoyancy_leaves_less_weight():
    """T grows by 1/sqrt(1 - rho V/m)."""
    scene = SCENES["lab"].with_effects((SmallAngleGravity(),))
    share = scene.medium.density * 4.0 / 3.0 * math.pi * 0.0107**3 / 0.040
    row = asked(scene, 0.3, 1e-5, ["buoyancy"])["buoyancy"]
    assert row.period_change == pytest.approx(1.0 / math.sqrt(1.0 - share) - 1.0, rel=1e-4)
    assert row.verdict == CALLED_FOR


# --- verdicts -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("tolerance", "verdict"), [(0.0062, NEGLIGIBLE), (0.0060, CALLED_FOR)])
def test_the_tolerance_decides(tolerance, verdict):
    """Linear drag takes pi gamma/(2 omega0) = 0.6 % of the amplitude, a little more from 30 degrees."""
    rows = asked(SCENES["lab"], math.radians(30.0), tolerance, ["linear_drag", "gravity"])
    assert rows["linear_drag"].verdict == verdict
    assert rows["gravity"].verdict == CALLED_FOR
    assert "without it nothing swings" in rows["gravity"].note


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


def test_a_wire_that_goes_slack_ends_the_comparison():
    scene = of(Gravity(), LinearDrag(gamma=1e-9)).replace(suspension="wire")
    row = asked(scene, 2.5, 1e-3, ["linear_drag"])["linear_drag"]
    assert row.note == "the run ends with it by slack, without it by slack"
    assert row.verdict == NEGLIGIBLE


def test_an_effect_that_ends_the_run_is_called_for():
    """The pivot falls with 4 g while the bob hangs on a wire."""
    drive = VerticalDrive(vertical_amplitude=0.1, vertical_rate=20.0)
    row = asked(of(Gravity(), drive).replace(suspension="wire"), 0.2, 100.0, ["vertical_drive"])["vertical_drive"]
    assert row.angle_change < 1.0
    assert (row.verdict, row.note) == (CALLED_FOR, "the run ends with it by slack, without it by time")


def test_close_to_the_top():
    """From 1e-3 rad below the top a period is five times that of small swings."""
    rows = asked(of(Gravity(), LinearDrag(gamma=1e-3)), math.pi - 1e-3, 1e-2, [*WEIGHTS, "linear_drag"])
    assert rows["linear_drag"].verdict == CALLED_FOR
    assert rows["small_angle_gravity"].verdict == OUTSIDE


def test_what_is_too_stiff_is_not_judged():
    row = asked(of(Gravity(), LinearDrag(gamma=1e6)), 0.5, 1e-3, ["linear_drag"])["linear_drag"]
    assert (row.verdict, row.note) == (NOT_JUDGED, "the simulation diverges however short the step of rk4: too stiff")


def test_the_simulation_is_refined_to_the_tolerance():
    found = audit("vacuum", amplitude=1.0, tolerance=1e-9, effects=WEIGHTS, backend="python")
    assert found.integration_error <= 1e-10


def test_costs_are_numbers_for_what_was_simulated():
    for row in asked(SCENES["lab"], 0.5, 1e-2).values():
        assert math.isfinite(row.ns_per_step) == (row.verdict not in (NOT_JUDGED, NOT_SIMULATED))


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
        ({"scene": of(Gravity()).replace(gravity=0.0)}, StudyError, "nothing moves when released at rest"),
        ({"effects": ["gravty"]}, SceneError, "did you mean gravity"),
    ],
)
def test_bad_input_gives_one_clear_error(arguments, error, message):
    usual = {"scene": "vacuum", "amplitude": 0.5, "tolerance": 1e-3, "effects": WEIGHTS, "backend": "python"}
    with pytest.raises(error, match=message):
        audit(**{**usual, **arguments})


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
    assert "gravity" in report.audit.missing
    assert "It calls for gravity" in report.text
    assert "which the scene leaves out" in report.text


def test_simplify_compares_over_the_usual_run_by_default():
    scene = of(Gravity(), LinearDrag(gamma=1e-7))
    _, report = simplify(scene, amplitude=0.2, tolerance=1e-3, backend="python")
    assert report.duration == scene.run.duration
    assert report.within


def test_the_error_of_a_simplified_scene_is_that_of_another_program():
    """The lab without its quadratic drag for 5 s, both by scipy's DOP853."""
    scene, amplitude, duration = SCENES["lab"], 0.5, 5.0
    plain, report = simplify(scene, amplitude=amplitude, tolerance=2e-3, duration=duration, backend="python")
    assert report.removed == ("quadratic_drag",)
    assert not plain.has("quadratic_drag")
    rate, c = 9.81 / 0.353, scene.coefficients["quadratic_drag_rate"]
    time = np.linspace(0.0, duration, 4001)
    angles = [
        solve_ivp(lambda _, y, c=c: (y[1], -rate * np.sin(y[0]) - 0.02 * y[1] - c * abs(y[1]) * y[1]), (0.0, duration),
                  (amplitude, 0.0), "DOP853", time, rtol=1e-11, atol=1e-12).y[0]
        for c in (c, 0.0)
    ]
    assert report.error == pytest.approx(np.max(np.abs(angles[0] - angles[1])) / amplitude, rel=2e-3)
    assert not report.within


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
    assert [row["effect"] for row in rows] == [row.effect for row in bearing.rows]
    assert [row["verdict"] for row in rows] == [row.verdict for row in bearing.rows]
    assert list(rows[0]) == [field.name for field in fields(AuditRow)]
    with Image.open(picture) as image:
        assert "sticky_bearing" in image.info["Scene"]


def test_the_chart_has_the_bars_the_formulas_and_the_tolerance(bearing):
    made = draw(bearing)
    (axes,) = made.axes
    low = axes.get_xlim()[0]
    ends = sorted(bar.get_x() + bar.get_width() for bar in axes.patches)
    shown = [row for row in bearing.rows if row.verdict != NOT_JUDGED]
    sizes = [abs(value) for row in shown for value in (row.period_change, row.amplitude_change)]
    assert ends == pytest.approx(sorted(size for size in sizes if size > low))
    marks = [line.get_xdata()[0] for line in axes.lines if line.get_marker() == "D"]
    formulas = [abs(value) for row in shown for value in (row.period_predicted, row.amplitude_predicted)]
    assert sorted(marks) == pytest.approx(sorted(value for value in formulas if value > low))
    assert any(set(line.get_xdata()) == {bearing.tolerance} for line in axes.lines)
    labels = [row.effect if row.present else f"({row.effect})" for row in shown]
    assert [label.get_text() for label in axes.get_yticklabels()] == labels
    said = made.legends[0].get_title().get_text()
    assert all((row.effect in said.replace("\n", " ")) == (row.verdict == NOT_JUDGED) for row in bearing.rows)


def test_the_table_has_all_and_fits(bearing, capsys, monkeypatch):
    table = verdicts(bearing)
    names = [row.effect if row.present else f"({row.effect})" for row in bearing.rows]
    assert [row[0] for row in table.rows] == names
    assert "angle" not in table.head
    monkeypatch.setenv("COLUMNS", "120")
    print_table(table)
    print(remarks(bearing))
    printed = capsys.readouterr().out.splitlines()
    assert max(map(len, (line.rstrip() for line in printed))) <= 120
    for row, name in zip(bearing.rows, names, strict=True):
        assert any(line.split()[:1] == [name] and line.rstrip().endswith(row.verdict) for line in printed)
        assert row.note.split(":")[0][:40] in " ".join(" ".join(printed).split())
