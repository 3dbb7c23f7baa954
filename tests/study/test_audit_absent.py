"""Tests of audits on effects that are not in the scene, or that replace others."""

import math
from dataclasses import dataclass
from typing import ClassVar

import pytest
from audits import AIRY, CORRECTIONS, W, asked, of

from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    EFFECTS,
    AddedMass,
    Buoyancy,
    Effect,
    Gravity,
    LinearDrag,
    Motor,
    SmallAngleGravity,
    Suspension,
)
from pendulum_env.physics.medium import water
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.study.audit import cases as cases_module
from pendulum_env.study.audit.cases import cases
from pendulum_env.study.audit.judging import corrections
from pendulum_env.study.audit.study import audit, simplify
from pendulum_env.study.audit.verdicts import CALLED_FOR, NEGLIGIBLE, NOT_JUDGED, NOT_SIMULATED, OUTSIDE
from pendulum_env.study.lists.methods import unfit


def rough(slip: float, rough_rate: float) -> float:
    return -rough_rate * slip


def smooth(slip: float, smooth_rate: float) -> float:
    return -smooth_rate * slip


@dataclass(frozen=True)
class Ballast(Effect):
    """Test effect that increases the moment of inertia by a tenth."""

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
    """Test effect: a simple law of drag that is valid up to 1 m/s."""

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
    """Test effect: a more detailed law of the same drag, valid at any speed."""

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
    """Test effect that no scene accepts."""

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
        "refused": "This cannot be.", "motor": "needs max_torque"}
    rows = asked(AIRY.replace(medium=SCENES["vacuum"].medium), 0.2, 1e-3, ["rough_drag"])
    assert rows["rough_drag"].note == "needs a medium, and the scene is in vacuum"


@pytest.mark.slow
@pytest.mark.usefixtures("_known")
def test_an_absent_model_is_compared_in_place_of_the_one_that_is_there():
    """The amplitude falls as exp(-gamma t/2), and the rates gamma of the two laws differ by 0.02/s."""
    rough = AIRY.with_effects((Gravity(), Rough()))
    row = asked(rough, 0.2, 1e-3)["smooth_drag"]
    assert row.amplitude_change == pytest.approx(-0.02 * math.pi / (2.0 * W), rel=0.02)
    assert row.amplitude_predicted == pytest.approx(-1.0e-2)
    assert (row.verdict, row.note) == (CALLED_FOR, "in place of rough_drag")
    smooth = AIRY.with_effects((Gravity(), Smooth()))
    row = asked(smooth, 0.2, 1e-3)["rough_drag"]
    assert (row.verdict, row.note) == (OUTSIDE, "too coarse in place of smooth_drag")
    row = asked(smooth, 0.2, 0.05)["rough_drag"]
    assert (row.verdict, row.note) == (NEGLIGIBLE, "accurate enough in place of smooth_drag")


@pytest.mark.slow
def test_the_laws_of_the_bobs_drag_stand_in_each_others_place():
    """At Re = 1400 Stokes' law gives some 25 times too little drag; a constant C_d is within 4 %."""
    lab = SCENES["lab"]
    scene = lab.with_effects(effect for effect in lab.effects if effect.name != "linear_drag")
    rows = asked(scene, math.radians(30.0), 1e-4, ["quadratic_drag", "sphere_drag", "linear_drag", "wire_drag"])
    assert (rows["sphere_drag"].verdict, rows["sphere_drag"].note) == (NEGLIGIBLE, "in place of quadratic_drag")
    assert abs(rows["sphere_drag"].amplitude_change) < 0.04 * abs(rows["quadratic_drag"].amplitude_change)
    stokes = rows["linear_drag"]
    assert stokes.verdict == OUTSIDE
    assert stokes.note.startswith("Re reaches 1.37e+03, but Stokes' law holds up to Re = 1")
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
    """From 0.5 rad the bob reaches 2 sqrt(g L) sin(0.25) = 1.550 m/s, less 0.2 % by drag."""
    rows = asked(AIRY.with_effects((Gravity(), Rough())), 0.5, 1e-3)
    assert rows["rough_drag"].verdict == OUTSIDE
    assert rows["rough_drag"].note == "no good at 1.55 m/s; by its formula it matters"
    assert asked(AIRY, 0.5, 0.5)["rough_drag"].note == "no good at 1.55 m/s; by its formula it is negligible"


@pytest.mark.usefixtures("_known")
def test_a_scene_is_completed_with_the_closest_model():
    plain, report = simplify(AIRY, amplitude=0.2, tolerance=1e-3, complete=True, backend="python")
    assert [effect.name for effect in plain.effects] == ["gravity", "ballast", "smooth_drag"]
    assert report.added == ("ballast", "smooth_drag")
    assert report.text.endswith("Added: ballast, smooth_drag.")
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


@pytest.mark.slow
def test_corrections_that_are_not_simulated_are_named():
    """Compare with the bending length sqrt(E I/(m g)), I = pi d⁴/64, which is 14.2 mm for 0.3 mm steel wire and 40 g.

    The period is 2 % shorter.
    """
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
    """Compare with a period that grows by the factor 1/sqrt(1 - rho V/m)."""
    scene = SCENES["lab"].with_effects((SmallAngleGravity(),))
    share = scene.medium.density * 4.0 / 3.0 * math.pi * 0.0107**3 / 0.040
    row = asked(scene, 0.3, 1e-5, ["buoyancy"])["buoyancy"]
    assert row.period_change == pytest.approx(1.0 / math.sqrt(1.0 - share) - 1.0, rel=1e-4)
    assert row.verdict == CALLED_FOR


@pytest.mark.slow
def test_what_holds_a_light_bob_down_is_needed():
    """Without its rod's weight the bob would float, so no scene exists to compare with."""
    body = Body(length=1.0, mass=0.01, radius=0.02, thickness=0.006)
    effects = (Gravity(), Suspension(), Buoyancy(), AddedMass(), LinearDrag(gamma=0.01))
    scene = Scene(body=body, medium=water(), effects=effects)
    found = audit(scene, 0.3, 0.05, effects=["suspension", "buoyancy"], backend="python")
    rod, lift = (next(row for row in found.rows if row.effect == name) for name in ("suspension", "buoyancy"))
    assert (rod.verdict, lift.verdict) == (CALLED_FOR, CALLED_FOR)
    assert "would float in water" in rod.note
    plain, _ = simplify(scene, 0.3, 0.05, duration=2.0, backend="python")
    assert plain.has("suspension")
    assert unfit(scene)["okunbor_skeel6"] == "forces free of the velocity, which linear_drag does not offer"
