"""Tests of scenes from files and dicts, parameters that are words, contradictions, and the equation in LaTeX."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser

from pendulum_env import SCENES, Scene, SceneError, rollout
from pendulum_env.physics import damping, data, presets
from pendulum_env.physics.damping import build_scene, parse_damping
from pendulum_env.physics.effects import DAMPINGS, EFFECTS, Effect, Gravity, LinearDrag, SphereDrag
from pendulum_env.physics.effects.linear_drag import linear_drag, linear_drag_by_velocity, linear_drag_flow
from pendulum_env.physics.equation import latex
from pendulum_env.physics.flow import reynolds_number
from pendulum_env.physics.medium import Medium, air, glycerol, water
from pendulum_env.physics.units import choice, flag, si

LAWS = {"slow": 1.0, "fast": 2.0}


@dataclass(frozen=True)
class Lawful(Effect):
    """A drag whose law is chosen by a word."""

    law: str = choice("slow", LAWS, "which law")
    strict: bool = flag(False, "ten times as much")

    name: ClassVar[str] = "lawful"
    kind = "dissipative"
    damping: ClassVar[str] = "lawful"
    equation: ClassVar[str] = "- {linear_drag_rate:.6g} theta'"
    needs_medium: ClassVar[bool] = True
    torque = staticmethod(linear_drag)
    by_velocity = staticmethod(linear_drag_by_velocity)
    flow = staticmethod(linear_drag_flow)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"linear_drag_rate": LAWS[self.law] * (10.0 if self.strict else 1.0)}


@dataclass(frozen=True)
class Float(Effect):
    """An effect that carries a part of the bob's weight."""

    lift: float = si(0.0, "kg m", "what it carries")

    name: ClassVar[str] = "float"
    kind = "inertia"
    equation: ClassVar[str] = ""

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {}

    def weight_moment(self, scene: Scene) -> float:
        return -self.lift

    def inertia(self, scene: Scene) -> float:
        return 0.001


@pytest.fixture
def _lawful(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(data, "EFFECTS", {**EFFECTS, "lawful": Lawful})
    monkeypatch.setattr(damping, "DAMPINGS", {**DAMPINGS, "lawful": Lawful})


# --- words and switches ---------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("_lawful")
def test_words_and_switches_go_through_every_door() -> None:
    wanted = Lawful(law="fast", strict=True)
    typed = parse_damping("lawful:law=fast,strict=true")
    assert typed == {"lawful": {"law": "fast", "strict": True}}
    for spec in (typed, '{"lawful": {"law": "fast", "strict": true}}'):
        built = build_scene("lab", parse_damping(spec) if isinstance(spec, str) else spec)
        assert built.effects[-1] == wanted
    settings = damping.parse_settings(["law=fast", "lawful.strict=true"])
    assert build_scene("lab", "lawful", settings).effects[-1] == wanted
    scene = build_scene("lab", typed)
    assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
    assert "Lawful(law='fast', strict=True)" in repr(scene)
    assert "law fast, strict true" in scene.describe()
    with pytest.raises(SceneError, match="There is no law 'fst'; did you mean fast"):
        build_scene("lab", {"lawful": {"law": "fst"}})
    with pytest.raises(SceneError, match="strict must be True or False, not 1"):
        build_scene("lab", {"lawful": {"strict": 1}})


@pytest.mark.usefixtures("_lawful")
def test_each_environment_may_have_its_own_word_if_all_run_one_program() -> None:
    options: dict[str, Any] = {"num_envs": 2, "damping": "lawful", "backend": "python"}
    env = gym.make_vec("LabPendulum-v0", law=["slow", "fast"], **options)
    env.reset(seed=0, options={"angle": 1.0, "velocity": 0.0})
    both = env.step(np.zeros((2, 1)))[0]
    for law, row in zip(("slow", "fast"), both, strict=True):
        alone = gym.make("LabPendulum-v0", damping="lawful", law=law, backend="python")
        alone.reset(seed=0, options={"angle": 1.0, "velocity": 0.0})
        assert alone.step(np.zeros(1))[0].tolist() == row.tolist()
    assert both[0].tolist() != both[1].tolist()
    assert gym.make_vec("LabPendulum-v0", law="fast", **options).unwrapped.scene.effects[-1] == Lawful(law="fast")
    for scene, words in (("vacuum", ["rod", "wire"]), ("exercise_large", ("wire", "rod"))):
        with pytest.raises(SceneError, match="In environment 1 of 2: its suspension would need another program"):
            gym.make_vec("LabPendulum-v0", num_envs=2, scene=scene, suspension=words)


def test_a_law_of_drag_is_a_word() -> None:
    """The law of drag is chosen by a word; it changes the program, so environments of one vector cannot differ in it.
    """
    laws = "sphere_drag:law=morrison"
    for spec in (parse_damping(laws), {"sphere_drag": {"law": "morrison"}}):
        scene = build_scene("lab", spec)
        assert scene.effects[-1] == SphereDrag(law="morrison")
        assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
    assert [e.name for e in build_scene("lab", "linear+sphere_drag").effects[-2:]] == ["linear_drag", "sphere_drag"]
    with pytest.raises(SceneError, match="its law would need another program"):
        gym.make_vec("LabPendulum-v0", num_envs=2, damping="sphere_drag", law=["morrison", "brown_lawler"])


# --- files and dicts ------------------------------------------------------------------------------------------------


def test_a_file_may_say_where_it_is_from(tmp_path: Path) -> None:
    SCENES["lab"].save(tmp_path / "lab.json", {"Software": "some program 1.0"})
    assert json.loads((tmp_path / "lab.json").read_text())["provenance"] == {"Software": "some program 1.0"}
    assert Scene.load(tmp_path / "lab.json") == SCENES["lab"]


def test_parts_are_changed_by_data_as_by_objects() -> None:
    lab, cold = SCENES["lab"], air(-10.0)
    data_of = {"name": "air", "density": cold.density, "viscosity": cold.viscosity}
    assert build_scene("lab", "scene", {"medium": data_of}) == lab.replace(medium=cold)
    assert lab.replace(medium={"name": "air", "temperature": -10.0}) == lab.replace(medium=cold)
    assert build_scene("exercise", "scene", {"medium": "water"}).medium == water()
    assert Scene.from_dict({"medium": "glycerol"}).medium == glycerol()
    assert lab.replace(effects=[{"effect": "gravity"}]).effects == (Gravity(),)
    assert build_scene("lab", "scene", {"effects": [{"effect": "gravity"}]}).effects == (Gravity(),)
    assert lab.replace(run={"angle": 1.0}).run.angle == 1.0


FILES = {
    "twice": ('{"gravity": 1, "gravity": 2}', "gives 'gravity' twice"),
    "twice inside": ('{"effects": [{"effect": "linear_drag", "gamma": 1, "gamma": 2}]}', "gives 'gamma' twice"),
    "nan": ('{"gravity": NaN}', "gravity must be a finite number of at least 0 [m/s^2], not nan"),
    "infinity": ('{"run": {"dt": Infinity}}', "dt must be a finite number"),
    "too deep": ("[" * 100_000, "is not JSON"),
    "too large": ('{"gravity": 1e400}', "gravity must be a finite number"),
    "more digits than numbers have": (f'{{"gravity": {"9" * 5000}}}', ""),
    "no text": ("\udcff", "is not JSON"),
    "a list": ('[{"effect": "gravity"}]', "must be given by a dict of its values"),
    "null": ('{"body": null}', "must be a Body or given by a dict"),
    "effect without a name": ('{"effects": [{"gamma": 1}]}', "with its name under 'effect'"),
    "effect's unknown value": ('{"effects": [{"effect": "linear_drag", "gama": 1}]}', "did you mean gamma?"),
    "run's unknown value": ('{"run": {"time": 1}}', "A scene's run has no value 'time'"),
    "number as text": ('{"body": {"mass": "1"}}', "mass must be a finite number above 0 [kg], not '1'"),
    "number in a list": ('{"body": {"mass": [1]}}', "mass must be a finite number above 0 [kg], not [1]"),
    "true": ('{"gravity": true}', "gravity must be a finite number"),
    "name of two lines": ('{"name": "a\\nb"}', "A scene's name must be one line"),
    "no name": ('{"medium": {"name": "", "density": 1}}', "A medium's name must be one line of 1 to 100 characters"),
    "a medium nobody knows": ('{"medium": {"name": "watr"}}', "no medium 'watr' without density and visc"),
    "a medium's unknown value": ('{"medium": {"name": "water", "temprature": 5}}', "did you mean temperature?"),
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_is_no_scene(case: str, tmp_path: Path) -> None:
    text, said = FILES[case]
    (tmp_path / "a.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(SceneError) as error:
        Scene.load(tmp_path / "a.json")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


REFUSED = {
    "effects without order": (lambda: Scene(effects={Gravity()}), "must be a list of effects"),
    "an effect in a vacuum": (lambda: Scene(effects=(Lawful(),)), "There is no lawful in vacuum"),
    "a bob that floats": (lambda: Scene(medium=air(), effects=(Float(lift=1.0),)), "would float in air"),
    "a damping typed twice": (lambda: parse_damping("linear:gamma=1+linear:gamma=2"), "names one damping twice"),
    "a value typed twice": (lambda: parse_damping("linear:gamma=1,gamma=2"), "gives gamma twice"),
    "a damping's JSON twice": (lambda: parse_damping('{"linear": {"gamma": 1, "gamma": 2}}'), "gives 'gamma' twice"),
    "a setting twice": (lambda: damping.parse_settings(["length=1", "length=2"]), "--set gives length twice"),
    "given twice by full name": (lambda: build_scene("lab", {"linear": {"gamma": 1.0}}, {"linear_drag.gamma": 0.5}),
                                 "linear_drag.gamma is given twice"),
    "removed, by full name": (lambda: build_scene("lab", "none", {"linear_drag.gamma": 0.5}), "belongs to linear_drag"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_contradictions(case: str) -> None:
    make, said = REFUSED[case]
    with pytest.raises(SceneError) as error:
        make()
    assert said in str(error.value)


def test_what_effects_add_is_described() -> None:
    scene = Scene(medium=Medium("broth", 1000.0, 0.001), effects=(Gravity(), Float(lift=0.25)))
    assert scene.weight_moment == 0.75
    said = scene.describe()
    assert "; +0.001 kg m^2 to the inertia, 0.0999 % of it, -2.453 N m to the weight's torque at 90 degrees" in said
    assert scene.equation() == f"theta'' = -{9.81 * 0.75 / 1.001:.6g} sin(theta)"


def test_damping_as_typed_with_exponents() -> None:
    assert parse_damping("linear:gamma=1e+2+quadratic") == {"linear": {"gamma": 100.0}, "quadratic": {}}
    assert parse_damping("linear:gamma=null") == {"linear": {"gamma": None}}
    assert build_scene("exercise_large", parse_damping("linear:gamma=null")).effects[-1] == LinearDrag()


# --- the equation in LaTeX ------------------------------------------------------------------------------------------

LATEX = {
    "- 9.81 sin(theta)": r"- 9.81\,\sin \theta",
    "1.2e-05 theta'": r"1.2 \times 10^{-5}\,\dot{\theta}",
    "5e+20 control": r"5 \times 10^{20}\,\mathrm{control}",
    "- 3 |theta'| theta'": r"- 3\,\left|\dot{\theta}\right|\,\dot{\theta}",
    "2 |theta' - 0.5|**0.38": r"2\,\left|\dot{\theta} - 0.5\right|^{0.38}",
    "4 cos(10 t + 0.5) sin(theta)": r"4\,\cos\left(10\,t + 0.5\right)\,\sin \theta",
    "3 |theta'|^(1/3) x**2": r"3\,\left|\dot{\theta}\right|^{1/3}\,x^{2}",
    "- 0.1 sign(theta')": r"- 0.1\,\operatorname{sign}\left(\dot{\theta}\right)",
    "a_b motor_rate C_d": r"a_{\mathrm{b}}\,\mathrm{motor\_rate}\,C_{\mathrm{d}}",
}


@pytest.mark.parametrize("text", LATEX)
def test_text_in_latex(text: str) -> None:
    assert latex(text) == LATEX[text]
    MathTextParser("path").parse(f"${latex(text)}$")


def test_signs_and_zeros_are_written_as_one_would() -> None:
    """In the equation's text a zero phase is left out and a negative phase is subtracted."""
    pushed = SCENES["kapitza"]
    assert "cos(100 t) sin(theta)" in pushed.equation()
    assert "cos(100 t - 0.5)" in pushed.replace(vertical_phase=-0.5).equation()
    assert pushed.equation().startswith("theta'' = -98.1 sin(theta)")
    assert Scene().equation(as_latex=True) == r"\ddot{\theta} = 0"


def test_drag_in_a_moving_medium_is_by_slip() -> None:
    said = SCENES["driven"].equation()
    assert "speed slip" in said
    sway = 0.005 * 5.0 / 0.353
    assert said.endswith("; slip = theta' - u cos(theta), speed**2 = slip**2 + (u sin(theta))**2, "
                         f"u = {sway:.6g} sin(5 t)")
    assert "slip" not in SCENES["kapitza"].equation()
    assert SCENES["windy"].equation().endswith(f", u = {3.0 / 0.353:.6g} + gust")


# --- presets --------------------------------------------------------------------------------------------------------


def test_presets_are_what_their_docstrings_say() -> None:
    """Periods, regimes, sizes, Reynolds numbers and simulated swings match the presets' docstrings."""
    assert SCENES["moon"].omega0 == pytest.approx(SCENES["lab"].omega0 / 2.46, rel=1e-3)
    share = 7850.0 * math.pi / 4.0 * 0.002**2 * 0.353 / 0.040  # a steel rod of 2 mm
    assert share == pytest.approx(0.22, abs=0.005)
    shorter = math.sqrt((1.0 + share / 3.0) / (1.0 + share / 2.0))
    assert SCENES["lab"].omega0 / SCENES["lab_rod"].omega0 == pytest.approx(shorter, rel=1e-12)
    assert 1.0 - shorter == pytest.approx(0.016, abs=5e-4)
    assert 1.0 / shorter - 1.0 == pytest.approx(0.017, abs=5e-4)
    assert 0.05 > 0.040 * 1.62 * 0.353
    assert 0.05 < 0.040 * 9.81 * 0.353
    clock, thick = SCENES["clock_bob"], SCENES["overdamped"]
    assert 2.0 * math.pi / clock.omega0 == pytest.approx(2.0, abs=1e-4)
    assert clock.omega0 / clock.coefficients["linear_drag_rate"] == pytest.approx(54_000, rel=0.01)
    assert thick.omega0 / thick.coefficients["linear_drag_rate"] == pytest.approx(0.1, rel=0.05)
    assert thick.coefficients["linear_drag_rate"] == pytest.approx(46.0, abs=0.5)
    creep = rollout(thick, integrator="rk4", backend="python")
    assert creep.angle.min() > 0.0
    speed = np.abs(creep.velocity).max() * thick.body.length
    assert 0.5 < reynolds_number(speed, thick.body, thick.medium) < 1.0
    swings = rollout("water", integrator="rk4", backend="python", duration=3.0).angle
    tops = [swings[i] for i in range(1, len(swings) - 1) if swings[i - 1] < swings[i] >= swings[i + 1]]
    assert 0.45 < tops[0] / swings[0] < 0.5
    assert tops[1] / tops[0] > 0.6
    windy = SCENES["windy"]
    force = 0.5 * windy.medium.density * 0.45 * math.pi * 0.020**2 * 3.0**2
    assert math.degrees(math.atan(force / (0.0027 * 9.81))) == pytest.approx(7.0, abs=0.5)


@pytest.mark.parametrize("name", ["lab", "sticky_bearing", "driven", "windy", "moon"])
def test_presets_that_leave_out_a_heavy_rod_say_by_how_much(name: str) -> None:
    """A rod of steel, 7850 kg/m³, that changes the period by over 1 % is named in the docstring."""
    scene, body = SCENES[name], SCENES[name].body
    assert not any(effect.name == "suspension" for effect in scene.effects)
    share = 7850.0 * math.pi / 4.0 * body.diameter**2 * body.length / body.mass
    longer = 100.0 * (math.sqrt((1.0 + share / 2.0) / (1.0 + share / 3.0)) - 1.0)
    assert longer > 1.0
    text = " ".join((getattr(presets, name).__doc__ or "").split())
    assert f"period {longer:.1f} % too long" in text or f"period is {longer:.1f} % too long" in text
