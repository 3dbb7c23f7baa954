"""Tests of parameters that differ between environments: every environment has its scene's numbers, at little cost."""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

from pendulum_env import SCENES, Scene
from pendulum_env.engine.each import Each
from pendulum_env.engine.limits import Validity
from pendulum_env.engine.machine import Machine, numbers_of
from pendulum_env.physics.effects import Gravity, LinearDrag
from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.medium import air
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import SceneError, si

SIZE = 120


def drawn(scene: Scene, names: list[str], spread: float = 0.2) -> dict[str, np.ndarray]:
    """Return random arrays for these parameters, around the scene's own values."""
    source, own = np.random.default_rng(len(names)), scene.parameters()
    return {name: (own[name] or 0.1) * 2.0 ** source.uniform(-spread, spread, SIZE) for name in names}


def numeric(scene: Scene) -> list[str]:
    return [name for name, value in scene.parameters().items() if isinstance(value, float)]


def check_numbers(scene: Scene, each: Each, given: dict[str, Any]) -> None:
    """Check that every environment has the numbers of its own scene bit for bit."""
    for place in range(SIZE):
        own = scene.replace(**{name: float(values[place]) for name, values in given.items()})
        expected = {**numbers_of(own), "omega0": own.omega0 or 1.0}
        for name, value in expected.items():
            numbers = each.numbers[name]
            assert (numbers[place] if isinstance(numbers, np.ndarray) else numbers) == value, (name, place)


@pytest.mark.quick("lab", "windy", "torsion", "kapitza")
@pytest.mark.parametrize("name", SCENES)
def test_every_environment_has_the_numbers_of_its_scene(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that every environment has its scene's numbers, and that scenes are built for groups, not one by one."""
    scene, built = SCENES[name], [0]
    given = drawn(scene, numeric(scene), 0.1)
    check_numbers(scene, Each(scene, "scene", None, given, SIZE), given)

    def counted(self: Scene, **changes: Any) -> Scene:
        built[0] += 1
        return replace(self, **changes)

    replace = Scene.replace
    one = drawn(scene, ["gravity"], 0.1)
    monkeypatch.setattr(Scene, "replace", counted)
    each = Each(scene, "scene", None, one, SIZE)
    assert built[0] < SIZE // 3
    monkeypatch.undo()
    check_numbers(scene, each, one)


def test_values_that_lead_code_another_way_are_put_right() -> None:
    """Check the numbers if parameters so differ (64-fold, some without a medium) that environments form many groups."""
    scene = SCENES["lab"]
    given = drawn(scene, ["length", "density", "viscosity", "radius"], 3.0) | {"radius": np.full(SIZE, 0.01)}
    given["viscosity"][::7] = 1.7e-5
    check_numbers(scene, Each(scene, "scene", None, given, SIZE), given)


@pytest.mark.parametrize("wrong", [-0.2, 0.0, math.nan, "long", None])
@pytest.mark.parametrize("place", [0, 77])
def test_one_that_cannot_be_is_named(wrong: Any, place: int) -> None:
    lengths: list[Any] = np.linspace(0.3, 0.4, SIZE).tolist()
    lengths[place], lengths[place + 5] = wrong, -1.0
    with pytest.raises(SceneError, match=rf"In environment {place} of {SIZE}: length must be a finite number above 0"):
        Each("lab", "scene", None, {"length": lengths}, SIZE)
    masses = np.full(SIZE, 0.04)
    masses[place], masses[place + 9] = 1e-5, 1e-6
    with pytest.raises(SceneError, match=f"In environment {place} of {SIZE}: The bob of 1e-05 kg would float in water"):
        Each("water", "scene", None, {"mass": masses}, SIZE)


def test_one_that_needs_another_program_is_named() -> None:
    laws = ["torque"] * SIZE
    laws[41] = "voltage"
    with pytest.raises(SceneError, match=rf"In environment 41 of {SIZE}: its control_sets would need another program"):
        Each(SCENES["lab"].replace(no_load_speed=9.0), "scene", None, {"control_sets": laws}, SIZE)


def test_speed_limits_of_each() -> None:
    limits = np.linspace(3.0, 9.0, SIZE)
    limits[5] = math.inf
    lengths = np.linspace(0.3, 0.4, SIZE)
    each = Each("lab", "scene", limits, {"length": lengths}, SIZE)
    assert np.array_equal(each.numbers["speed_limit"], limits)
    usual = Each("lab", "scene", None, {"length": lengths}, SIZE).numbers
    assert np.array_equal(usual["speed_limit"], 100.0 * np.asarray(usual["omega0"]))
    limits[7] = -1.0
    with pytest.raises(SceneError, match=rf"In environment 7 of {SIZE}: speed_limit must be a finite number above 0"):
        Each("lab", "scene", limits, {"length": lengths}, SIZE)


@pytest.mark.parametrize("places", [(90, 33), (0, 1), (119,), tuple(range(40, 120))])
def test_the_first_whose_formula_does_not_hold_is_told_of(places: tuple[int, ...]) -> None:
    """Check that the warning names the first environment beyond Stokes' law (Re > 1), valid for the small bobs only."""
    scene = Scene("two_sizes", medium=air(20.0), effects=(Gravity(), LinearDrag()))
    radii, masses = np.full(SIZE, 1e-7), np.linspace(0.03, 0.05, SIZE)
    quiet, validity = Validity(SIZE, "environment"), Validity(SIZE, "environment")
    Each(scene, "scene", None, {"radius": radii, "mass": masses}, SIZE, validity=quiet)
    assert not quiet.warning
    radii[list(places)] = 0.01
    Each(scene, "scene", None, {"radius": radii, "mass": masses}, SIZE, validity=validity)
    assert f"In environment {min(places)} of {SIZE}, in the scene 'two_sizes'" in validity.warning


def whirl(velocity: float, whirl_rate: float) -> float:
    return -whirl_rate * velocity


@dataclass(frozen=True)
class Whirl(Effect):
    """A dissipative effect with a coefficient from a function that accepts only floats."""

    turn: float = si(0.3, "rad", "an angle")

    name: ClassVar[str] = "whirl"
    kind: ClassVar[Kind] = "dissipative"
    equation: ClassVar[str] = "- {whirl_rate:.6g} theta'"
    source: ClassVar[str] = "made up"
    torque = staticmethod(whirl)

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"whirl_rate": math.sin(self.turn) ** 2 / scene.body.mass}


def test_an_effect_of_ones_own_may_call_what_it_likes() -> None:
    scene = SCENES["vacuum"].with_effects((*SCENES["vacuum"].effects, Whirl()))
    given = {"turn": np.linspace(0.1, 1.0, SIZE), "mass": np.linspace(0.5, 2.0, SIZE)}
    check_numbers(scene, Each(scene, "scene", None, given, SIZE), given)


@pytest.mark.parametrize("form", [0, 99, None, "1"])
@pytest.mark.parametrize("kind", ["scene", "machine"])
def test_scenes_and_machines_pickled_by_another_version_are_refused(
    monkeypatch: pytest.MonkeyPatch, kind: str, form: object
) -> None:
    thing: object = SCENES["lab"] if kind == "scene" else Machine(SCENES["vacuum"], "rk4", backend="python")
    place = "pendulum_env.physics.scene.FORMAT" if kind == "scene" else "pendulum_env.engine.machine.FORMAT"
    with monkeypatch.context() as patch:
        patch.setattr(place, form)
        old = pickle.dumps(thing)
    with pytest.raises(SceneError, match=f"This {kind} was pickled by another version of the package, in the format "):
        pickle.loads(old)
    assert type(pickle.loads(pickle.dumps(thing))) is type(thing)


def test_a_scene_is_pickled_without_what_follows_from_it() -> None:
    scene = SCENES["lab"].replace(length=0.36)
    fresh = pickle.dumps(scene)
    assert scene.omega0 > 0.0
    assert scene.coefficients
    assert pickle.dumps(scene) == fresh
    assert pickle.loads(fresh) == scene
    with pytest.raises(TypeError, match="does not support item assignment"):
        scene.coefficients["gravity_rate"] = 0.0  # type: ignore[index]
