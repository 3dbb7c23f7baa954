"""Tests of scenes with arbitrary effects and values: files, repr, description, and refusal of invalid values.

Every field of every part is tested, so a new effect is covered once it is registered.
"""

from __future__ import annotations

import inspect
import json
import math
import re
from dataclasses import Field, fields, replace
from typing import Any

import numpy as np
import pytest
from drawn_scenes import scenes
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from pendulum_env import LabPendulumEnv, LabPendulumVectorEnv, Run, Scene, SceneError, rollout
from pendulum_env.physics.bodies import BODIES
from pendulum_env.physics.body import Body, RigidBody
from pendulum_env.physics.effects import EFFECTS, Effect, LinearDrag, SphereDrag
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.presets import SCENES

NAMES = {"Scene": Scene, **{kind.__name__: kind for kind in BODIES.values()}, "Medium": Medium, "Run": Run,
         **{kind.__name__: kind for kind in EFFECTS.values()}}
PARSER = MathTextParser("path")
SHARE = 0.375
"""Value of the motor's share and of all memory variables where equations are compared."""


# --- any scene ------------------------------------------------------------------------------------------------------








@settings(max_examples=60)
@given(scenes())
def test_a_scene_survives_a_file_and_its_own_repr(scene: Scene) -> None:
    for again in (Scene.from_dict(json.loads(json.dumps(scene.to_dict()))), eval(repr(scene), dict(NAMES))):
        assert again == scene
        assert hash(again) == hash(scene)
        assert again.coefficients == scene.coefficients
    assert scene.name in scene.describe()


@settings(max_examples=60)
@given(scenes())
def test_a_scene_keeps_what_is_replaced_by_itself_and_takes_what_is_not(scene: Scene) -> None:
    named = scene.parameters()
    assert scene.replace(**named) == scene
    assert scene.replace(**{name: getattr(scene, name) for name in ("body", "medium", "effects", "run")}) == scene
    assert scene.replace(**scene.to_dict()) == scene
    for effect in scene.effects:
        for entry in fields(effect):  # type: ignore[arg-type]
            value = getattr(effect, entry.name)
            assert scene.replace(**{f"{effect.name}.{entry.name}": value}) == scene
    mass = next(entry.name for entry in fields(scene.body) if entry.name.endswith("mass"))  # type: ignore[arg-type]
    heavier = 1.01 * getattr(scene.body, mass)
    changed = scene.replace(**{f"body.{mass}": heavier, "gravity": 2.0, "run.dt": 0.25})
    assert (getattr(changed.body, mass), changed.gravity, changed.run.dt) == (heavier, 2.0, 0.25)


def expression(text: str) -> str:
    """Return one side of an equation's text as a Python expression; a space between factors means a product."""
    text = re.sub(r"\|(.*?)\|", r"abs(\1)", text.replace("^", "**")).replace("theta'", "v").replace("theta", "q")
    return re.sub(r"(?<=[\w)]) (?=[\w(])", "*", text)


@pytest.mark.slow
@settings(max_examples=60)
@given(scenes(), st.floats(-3.0, 3.0), st.floats(-5.0, 5.0), st.floats(0.0, 2.0))
def test_the_equation_is_the_sum_of_the_torques(scene: Scene, q: float, v: float, t: float) -> None:
    """The equation's text equals the sum of the torques, with coefficients of six digits; its LaTeX form is valid."""
    known = {"time": t, "angle": q, "tilt": q, "side": 1.0, "velocity": v, "control": SHARE, **scene.coefficients}
    known |= {name: SHARE for effect in scene.effects for name in effect.memory}

    def call(function: Any, **more: float) -> float:
        return float(function(*({**known, **more}[name] for name in inspect.signature(function).parameters)))

    u, w = (sum(call(f) for e in scene.effects if (f := getattr(e, role))) for role in ("wind_x", "wind_y"))
    slip = v - u * math.cos(q) - w * math.sin(q)
    speed = math.hypot(slip, w * math.cos(q) - u * math.sin(q))
    torques = [call(e.torque, slip=slip, speed=speed) for e in scene.effects if e.torque]
    torques += [-scene.coefficients[e.dry] * math.copysign(1.0, v) for e in scene.effects if e.dry]
    space = {"sin": math.sin, "cos": math.cos, "exp": math.exp, "sign": lambda x: math.copysign(1.0, x), "q": q, "v": v,
             "t": t, "control": SHARE, "gust": SHARE}
    for effect in scene.effects:
        if isinstance(effect, SphereDrag):
            space["C_d"] = lambda re, law=effect.drag_law: law.multiple(re) * 24.0 / re if re else 0.0
    law, _, where = scene.equation().partition("; ")
    clauses = dict(line.split(" = ") for line in where.split(", ") if line)
    for left in ("u", "w", "slip", "speed**2", "Re"):
        if left in clauses:
            right = eval(expression(clauses.pop(left)), space)
            space[left.removesuffix("**2")] = math.sqrt(right) if left.endswith("**2") else right
    bounds = [scene.coefficients[effect.limit] for effect in scene.effects if effect.limit]
    assert [float(clauses.pop("max |theta'|")) for _ in bounds] == pytest.approx(bounds, rel=1e-5)
    assert not clauses
    value = eval(expression(law.removeprefix("theta'' = ")), space)
    # An angle of a drive, of six digits, is wrong by up to 5e-6 (times its rate), and counts as much as its amplitude.
    drives = sum(abs(x) for e in scene.effects if e.kind == "drive" for x in e.coefficients(scene).values())
    assert value == pytest.approx(sum(torques), abs=1e-4 * (1.0 + sum(map(abs, torques))) + 3e-5 * drives)
    PARSER.parse(f"${scene.equation(as_latex=True)}$")


# --- no scene -------------------------------------------------------------------------------------------------------

PARTS = [*BODIES.values(), Medium, Run, Scene, *EFFECTS.values()]
NEVER = ("x", "", b"1", [], {}, (1.0, 2.0), object(), math.nan, math.inf, -math.inf, 10**400, 1j, "9" * 10_000,
         np.ones(1), np.ones((2, 2)), np.array("x"))
"""Values that no field accepts, whether it holds a number, a truth value or a word."""


def wrong_for(entry: Field[Any]) -> list[Any]:
    wrong = [*NEVER]
    if "allowed" in entry.metadata:
        switch = isinstance(entry.default, bool)
        return [*wrong, None, 1.0, 0, *([] if switch else [True, np.bool_(True)])]
    wrong.append(np.bool_(True))
    limits = entry.metadata["check"].keywords
    wrong += [True] if entry.metadata["optional"] else [True, None]
    wrong += [] if limits["above"] is None else [limits["above"], limits["above"] - 1.0]
    return wrong + ([] if limits["least"] is None else [limits["least"] - 1e-9])


def refused(make: Any, *words: str) -> None:
    """Check that a call raises one error, of one sentence that contains these words."""
    with pytest.raises(SceneError) as error:
        make()
    said = str(error.value)
    assert all(word in said for word in words), said
    assert "\n" not in said
    assert len(said) < 1000


@pytest.mark.parametrize("kind", PARTS, ids=lambda kind: kind.__name__)
def test_every_field_refuses_what_it_cannot_be(kind: type) -> None:
    for entry in fields(kind):
        if "check" not in entry.metadata:
            assert (kind, entry.name) in {(Medium, "name"), *((Scene, f.name) for f in fields(Scene))}
            continue
        assert entry.metadata["doc"]
        for value in wrong_for(entry):
            refused(lambda name=entry.name, value=value: kind(**{name: value}), entry.name)


@pytest.mark.parametrize("kind", PARTS, ids=lambda kind: kind.__name__)
def test_every_field_refuses_it_as_data_and_as_a_change(kind: type) -> None:
    if kind is Scene:
        return
    label = kind.name if issubclass(kind, Effect) else kind.__name__.lower()
    shape: dict[str, object] = {}
    if issubclass(kind, RigidBody):
        label, shape = "body", {"shape": kind.shape}
    for entry in fields(kind):
        value = "\n" if entry.name == "name" else [None]
        data = {entry.name: value, **shape, **({"density": 1.0} if label == "medium" and entry.name == "name" else {})}
        whole = {"effects": [{"effect": label, **data}]} if issubclass(kind, Effect) else {label: data}
        refused(lambda whole=whole: Scene.from_dict(whole), entry.name)
        refused(lambda name=entry.name[1:] + "q", d=label: Scene.from_dict(
            {"effects": [{"effect": d, name: 1.0}]} if d in EFFECTS else {d: {name: 1.0, **shape}}), "has no value")
        for scene in SCENES.values():
            if label in ("medium", "run") or type(scene.body) is kind or scene.has(label):
                refused(lambda s=scene, path=f"{label}.{entry.name}", v=value: s.replace(**{path: v}), entry.name)


@pytest.mark.parametrize("name", ["name", "body", "medium", "effects", "run"])
def test_every_part_refuses_what_it_cannot_be(name: str) -> None:
    for value in (None, 5, math.nan, b"1", "\n", "", "9" * 10_000, object(), {5}, [[]], [None], {"x": 1}, {5: 1},
                  SCENES["lab"]):
        for make in (lambda v=value: Scene(**{name: v}), lambda v=value: Scene.from_dict({name: v}),
                     lambda v=value: Scene().replace(**{name: v})):
            refused(make)


# --- names ----------------------------------------------------------------------------------------------------------


def test_no_parameter_hides_behind_a_keyword() -> None:
    """``gym.make(..., name=value)`` reaches every parameter of every part."""
    keywords = {name for function in (LabPendulumEnv, LabPendulumVectorEnv, rollout)
                for name, taken in inspect.signature(function).parameters.items()
                if taken.kind is not inspect.Parameter.VAR_KEYWORD}
    taken = keywords | {f.name for f in fields(Scene)} | {"effect"}
    for kind in (*BODIES.values(), Medium, *EFFECTS.values()):
        assert not {f.name for f in fields(kind)} & (taken - {"name"}), kind


class OtherDrag(LinearDrag):
    """A drag with a parameter whose name another effect also has."""

    name = "other_drag"

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"other_rate": self.gamma or 0.0}


def test_a_name_that_two_effects_have_needs_the_effects_name() -> None:
    two = Scene(effects=(LinearDrag(gamma=1.0), OtherDrag(gamma=2.0)))
    refused(lambda: two.replace(gamma=3.0), "linear_drag and other_drag", "linear_drag.gamma or other_drag.gamma")
    changed = two.replace(**{"linear_drag.gamma": 3.0})
    assert changed.coefficients == {"linear_drag_rate": 3.0, "other_rate": 2.0}
    assert {"linear_drag.gamma", "other_drag.gamma"} <= set(two.parameters())
    assert two.replace(**two.parameters()) == two
    refused(lambda: SCENES["lab"].replace(**{"gamma": 1.0, "linear_drag.gamma": 1.0}), "gamma of linear_drag", "twice")
    refused(lambda: SCENES["lab"].replace(**{"linear_drg.gamma": 1.0}), "did you mean linear_drag.gamma")
    refused(lambda: SCENES["lab"].replace(dt=1.0), "has no parameter 'dt'")
    refused(lambda: SCENES["lab"].replace(**{"run.dtt": 1.0}), "did you mean run.dt")


def test_numbers_may_be_numpys() -> None:
    for one in (np.float32(1.0), np.float64(1.0), np.int64(1), np.array(1.0), np.array(1)):
        assert Body(mass=one) == Body()
        assert type(Body(mass=one).mass) is float


def test_a_repr_holds_what_is_not_the_default() -> None:
    assert repr(replace(Body(), mass=2.0)) == "Body(mass=2.0)"
    assert repr(Scene()) == "Scene()"
    lab = repr(SCENES["lab"])
    assert "Gravity(), QuadraticDrag(), LinearDrag(gamma=0.02), Motor()" in lab
    assert "suspension" not in lab
    assert len(lab) < 400
