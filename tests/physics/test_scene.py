"""Tests of scenes: checks of their values, files, and descriptions."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from refusals import check_refused

from pendulum_env import SCENES, Scene, SceneError
from pendulum_env.physics.body import Body
from pendulum_env.physics.damping import build_scene, parse_damping, with_damping
from pendulum_env.physics.effects import (
    DAMPINGS,
    EFFECTS,
    CoulombFriction,
    Gravity,
    LinearDrag,
    Motor,
    QuadraticDrag,
    SmallAngleGravity,
)
from pendulum_env.physics.flow import reynolds_number, sphere_drag_coefficient
from pendulum_env.physics.medium import Medium, air, water
from pendulum_env.physics.presets import PURPOSES, find_scene


@pytest.mark.parametrize("name", SCENES)
class TestEveryPreset:
    def test_survives_a_dict_and_a_file(self, name: str, tmp_path: Path) -> None:
        scene = SCENES[name]
        assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
        scene.save(tmp_path / "scene.json")
        assert find_scene(str(tmp_path / "scene.json")) == scene

    def test_is_hashable_and_named_in_the_registry(self, name: str) -> None:
        assert hash(SCENES[name]) == hash(SCENES[name].replace())
        assert SCENES[name].name == name
        assert PURPOSES[name]

    def test_equation_names_no_absent_effect(self, name: str) -> None:
        text = SCENES[name].equation()
        assert ("sin(theta)" in text) == SCENES[name].has("gravity")
        assert ("control" in text) == SCENES[name].has("motor")

    def test_no_parameter_has_two_owners(self, name: str) -> None:
        scene = SCENES[name]
        for key, value in scene.parameters().items():
            if isinstance(value, float):
                changed = scene.replace(**{key: value * 1.25 or 0.125})
                assert changed != scene


def test_replace_reaches_every_part() -> None:
    scene = SCENES["lab"].replace(length=0.5, gravity=1.62, max_torque=0.01, gamma=0.5, density=1.0)
    assert (scene.body.length, scene.gravity, scene.medium.density) == (0.5, 1.62, 1.0)
    assert scene.coefficients["linear_drag_rate"] == 0.5
    assert scene.coefficients["motor_rate"] == 0.01 / (0.040 * 0.5 * 0.5)


# --- numbers from outside ------------------------------------------------------------------------------------------


def test_air_and_water_at_20_degrees() -> None:
    """CRC Handbook of Chemistry and Physics: air 1.204 kg/m³, 1.81e-5 Pa s; water 998.2 kg/m³, 1.00e-3 Pa s."""
    assert air(20.0).density == pytest.approx(1.204, abs=5e-4)
    assert air(20.0).viscosity == pytest.approx(1.81e-5, rel=3e-3)
    assert water(20.0).density == pytest.approx(998.2, abs=0.05)
    assert water(20.0).viscosity == pytest.approx(1.00e-3, rel=3e-3)


def test_drag_coefficient_of_a_sphere() -> None:
    """Standard drag curve, Clift, Grace & Weber 1978, table 5.1: C_d 1.09 at Re 100, 0.46 at 1000; Stokes below 1."""
    assert sphere_drag_coefficient(100.0) == pytest.approx(1.09, rel=0.03)
    assert sphere_drag_coefficient(1000.0) == pytest.approx(0.46, rel=0.04)
    assert sphere_drag_coefficient(1e-4) == pytest.approx(24e4, rel=1e-3)


def test_reynolds_number_of_the_lab_at_30_degrees() -> None:
    """The lab sheet gives about 1400: rho v 2a / mu with v = 2 sqrt(g L) sin(15°)."""
    scene = SCENES["exercise_large"]
    assert scene.reynolds == pytest.approx(1400, rel=0.05)
    speed = 2.0 * math.sqrt(9.8 * 0.353) * math.sin(math.radians(15.0))
    assert scene.reynolds == pytest.approx(reynolds_number(speed, scene.body, scene.medium), rel=1e-12)


def test_drag_from_geometry() -> None:
    """Stokes' rate is 6 pi mu a / m; with C_d = 0.46 the drag at the bottom is 26 times Stokes', as the lab sheet says.

    Published drag correlations differ from each other by up to 12 % here.
    """
    scene = SCENES["exercise_large"]
    stokes = with_damping(scene.with_effects((Gravity(),)), "linear").coefficients["linear_drag_rate"]
    assert stokes == pytest.approx(6 * math.pi * scene.medium.viscosity * 0.0107 / 0.040, rel=1e-12)
    c = with_damping(scene, "quadratic").coefficients["quadratic_drag_rate"]
    area = math.pi * 0.0107**2
    assert c == pytest.approx(scene.medium.density * 0.46 * area * 0.353 / (2 * 0.040), rel=0.12)
    assert c * scene.bottom_velocity / stokes == pytest.approx(26, rel=0.12)


# --- damping --------------------------------------------------------------------------------------------------------


def test_damping_replaces_the_dissipative_effects() -> None:
    lab = SCENES["lab"]
    names = {spec: [e.name for e in with_damping(lab, spec).of_kind("dissipative")] for spec in (
        "scene", "none", "linear", "linear+quadratic")}
    assert names == {
        "scene": ["quadratic_drag", "linear_drag"],
        "none": [],
        "linear": ["linear_drag"],
        "linear+quadratic": ["linear_drag", "quadratic_drag"],
    }
    assert with_damping(lab, "linear").coefficients["linear_drag_rate"] == 0.02
    assert with_damping(lab, {"linear": {"gamma": 0.1}}).coefficients["linear_drag_rate"] == 0.1
    assert with_damping(SCENES["vacuum"], {"coulomb": {"friction_torque": 0.5}}).coefficients["dry_limit"] == 0.5


def test_parameters_change_what_the_damping_left() -> None:
    vacuum = SCENES["vacuum"]
    built = build_scene("vacuum", "quadratic", {"c": 0.1})
    assert built.coefficients == {**vacuum.coefficients, "quadratic_drag_rate": 0.1}
    assert build_scene("vacuum", "linear", {"gamma": 0.5}).coefficients["linear_drag_rate"] == 0.5
    assert build_scene("vacuum", "linear", {"medium": air()}).has("linear_drag")
    assert build_scene("lab", {"linear": {}}, {"gamma": 0.5}).coefficients["linear_drag_rate"] == 0.5
    assert build_scene("lab", "none", {"effects": (Gravity(), LinearDrag(gamma=1.0))}).effects == (Gravity(),)
    assert build_scene("lab", "scene", {"gamma": 0.5, "length": 0.5}) == SCENES["lab"].replace(gamma=0.5, length=0.5)
    assert build_scene("lab") is not None
    assert build_scene("lab", "linear") == with_damping(SCENES["lab"], "linear")


def test_a_change_only_has_to_make_sense_as_a_whole() -> None:
    """Drag cannot be derived in a vacuum, but a change may set medium and drag together."""
    changed = SCENES["vacuum"].replace(effects=(Gravity(), QuadraticDrag()), c=0.1)
    assert changed.coefficients["quadratic_drag_rate"] == 0.1


def test_a_scene_without_effects_turns_freely() -> None:
    assert Scene.from_dict({}).equation() == "theta'' = 0"


def test_damping_as_typed() -> None:
    assert parse_damping("linear+quadratic") == "linear+quadratic"
    assert parse_damping("linear:gamma=0.1+quadratic") == {"linear": {"gamma": 0.1}, "quadratic": {}}
    assert parse_damping('{"coulomb": {"friction_torque": 0.001}}') == {"coulomb": {"friction_torque": 0.001}}


def test_every_dissipative_effect_is_a_damping() -> None:
    assert set(DAMPINGS.values()) == {effect for effect in EFFECTS.values() if effect.kind == "dissipative"}


# --- what cannot be -------------------------------------------------------------------------------------------------

WIRE = Body(suspension="wire")


class Twin(LinearDrag):
    name = "twin"

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"gravity_rate": 1.0}

    def check(self, scene: Scene) -> None: ...


REFUSED = {
    "two gravities": (lambda: Scene(effects=(Gravity(), SmallAngleGravity())), "only one effect of the kind 'gravity'"),
    "one effect twice": (lambda: Scene(effects=(LinearDrag(gamma=1.0), LinearDrag(gamma=2.0))), "only one"),
    "motor on a wire": (lambda: Scene(body=WIRE, effects=(Motor(),)), "wire cannot carry"),
    "Stokes in vacuum": (lambda: Scene(effects=(LinearDrag(),)), "has no viscosity; give a number"),
    "C_d in vacuum": (lambda: Scene(effects=(QuadraticDrag(drag_coefficient=0.4),)), "has no density"),
    "one coefficient twice": (lambda: Scene(effects=(Gravity(), Twin())), "have a coefficient named gravity_rate"),
    "C_d and c": (lambda: Scene(medium=air(), effects=(QuadraticDrag(c=1.0, drag_coefficient=1.0),)), "not both"),
    "friction from nothing": (lambda: Scene(effects=(CoulombFriction(),)), "give a number"),
    "negative length": (lambda: Body(length=-1.0), "length must be a finite number above 0 [m], not -1.0"),
    "mass nan": (lambda: Body(mass=math.nan), "mass must be a finite number"),
    "mass text": (lambda: Body(mass="1"), "mass must be a finite number"),  # type: ignore[arg-type]
    "mass true": (lambda: Body(mass=True), "mass must be a finite number"),
    "suspension": (lambda: Body(suspension="wirre"), "did you mean wire?"),
    "gravity infinite": (lambda: Scene(gravity=math.inf), "gravity must be"),
    "body is no body": (lambda: Scene(body=1.0), "body must be a Body"),  # type: ignore[arg-type]
    "effect is no effect": (lambda: Scene(effects=("gravity",)), "must be Effect instances"),  # type: ignore[arg-type]
    "unknown preset": (lambda: find_scene("vaccum"), "did you mean vacuum?"),
    "unknown key": (lambda: Scene.from_dict({"bodi": {}}), "did you mean body?"),
    "unknown key of body": (lambda: Scene.from_dict({"body": {"lenght": 1.0}}), "did you mean length?"),
    "unknown effect": (lambda: Scene.from_dict({"effects": [{"effect": "gravitiy"}]}), "did you mean gravity"),
    "unknown parameter": (lambda: SCENES["lab"].replace(lenght=1.0), "did you mean length?"),
    "missing file": (lambda: find_scene("nowhere.json"), "cannot be read"),
    "unknown damping": (lambda: with_damping(SCENES["lab"], "quadratik"), "did you mean quadratic?"),
    "unknown damping number": (lambda: with_damping(SCENES["lab"], {"linear": {"gama": 1.0}}), "did you mean gamma?"),
    "damping number": (lambda: with_damping(SCENES["lab"], 0.1), "name or a dict"),  # type: ignore[arg-type]
    "typed damping": (lambda: build_scene("lab", parse_damping("linear:gamma=a")), "gamma must be a finite numb"),
    "typed damping without =": (lambda: parse_damping("linear:0.1"), "name=value"),
    "damping of none and more": (lambda: with_damping(SCENES["lab"], "none+linear"), "damping='none' cannot be"),
    "damping of the scene and more": (lambda: with_damping(SCENES["lab"], {"scene": {}, "linear": {}}), "cannot be"),
    "damping twice": (lambda: with_damping(SCENES["lab"], "linear+linear"), "one damping twice"),
    "number of what damping removes": (lambda: build_scene("lab", "quadratic", {"gamma": 0.5}), "leaves out"),
    "number of no damping": (lambda: build_scene("lab", "none", {"gamma": 0.5}), "gamma belongs to linear_drag"),
    "number twice": (lambda: build_scene("lab", {"linear": {"gamma": 0.1}}, {"gamma": 0.5}), "gamma is given twice"),
    "unknown with damping": (lambda: build_scene("vacuum", "linear", {"gama": 0.5}), "did you mean gamma or mass?"),
    "derivation after all": (lambda: build_scene("vacuum", "linear", {"length": 0.5}), "has no viscosity; give a num"),
    "effects a number": (lambda: Scene.from_dict({"effects": 5}), "effects must be a list of effects, not 5"),
    "effects none": (lambda: Scene.from_dict({"effects": None}), "effects must be a list of effects, not None"),
    "effects a dict": (lambda: Scene.from_dict({"effects": {"effect": "gravity"}}), "must be a list of effects"),
    "effect's name a list": (lambda: Scene.from_dict({"effects": [{"effect": []}]}), "There is no effect []"),
    "suspension a list": (lambda: Scene.from_dict({"body": {"suspension": []}}), "There is no suspension []"),
    "body a number": (lambda: Scene.from_dict({"body": 5}), "body must be a Body or given by"),
    "name a number": (lambda: Scene.from_dict({"name": 5}), "A scene's name must be text, not 5"),
    "medium's name a number": (lambda: Scene.from_dict({"medium": {"name": 5}}), "medium's name must be text, not 5"),
    "body replaced by a number": (lambda: SCENES["lab"].replace(body=5, length=0.5), "must be a Body or given by"),
    "effects replaced by a number": (lambda: build_scene("lab", "none", {"effects": 5.0}), "must be a list of effects"),
    "inertia infinite": (lambda: Body(length=1e200) and SCENES["lab"].replace(length=1e200), "moment of inertia"),
    "inertia zero": (lambda: SCENES["vacuum"].replace(length=1e-200), "moment of inertia"),
    "inertia without all its digits": (lambda: SCENES["vacuum"].replace(length=1e-160), "moment of inertia"),
    "weight infinite": (lambda: SCENES["vacuum"].replace(mass=1e300, gravity=1e10), "omega0 of the scene 'vacuum'"),
    "gravity whose work underflows": (lambda: SCENES["vacuum"].replace(gravity=1e-300), "omega0 is 1e-150 rad/s"),
    "gravity whose torque underflows": (lambda: SCENES["vacuum"].replace(mass=1e-300, gravity=1e-10), "too weak here"),
    "gravity that underflows to none": (lambda: SCENES["vacuum"].replace(mass=1e-200, gravity=1e-200), "too weak here"),
    "motor infinite": (lambda: Scene(effects=(Motor(max_torque=1e200),), body=Body(mass=1e-200)), "motor_rate"),
    "drag beyond powers": (lambda: Scene(body=Body(length=1e110, mass=1e-100), medium=Medium("thick", 1.0, 1.0),
                                         gravity=0.0, effects=(QuadraticDrag(drag_coefficient=0.5),)),
                           "quadratic_drag_rate"),
    "below absolute zero": (lambda: air(-300.0), "temperature must be"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_clear_sentence(case: str) -> None:
    check_refused(*REFUSED[case])


def test_a_scene_file_that_is_no_scene(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text("{")
    (tmp_path / "b.json").write_text("[1]")
    for name, words in (("a.json", "is not JSON"), ("b.json", "must be given by a dict")):
        with pytest.raises(SceneError, match=words):
            find_scene(str(tmp_path / name))
