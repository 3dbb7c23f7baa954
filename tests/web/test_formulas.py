"""Tests of the parameters' formulas: beside Python's own functions, for every preset."""

from __future__ import annotations

import random
from dataclasses import replace
from typing import Any

import pytest

from pendulum_env import SCENES, Scene
from pendulum_env.engine.machine import Machine, fitting, numbers_of
from pendulum_env.physics.effects import Gravity, LinearDrag
from pendulum_env.web.formulas import explicit, formulas_of, settings_of, with_settings

LEFT_OUT: dict[str, set[str]] = {
    "exercise": set(), "exercise_large": set(), "vacuum": set(), "driven": set(), "chaotic": set(), "kapitza": set(),
    "clock_bob": {"gravity", "body.length", "body.mass"},  # inertia of a ball with squares; buoyancy
    "water": {"body.length"},  # Stokes' law and the added mass take powers
    "lab": {f"effects.3.{name}" for name in ("lag", "ramp", "control_quantum", "dead_zone")},  # 0 is another program
}
"""Some presets -> settings whose formulas are not recorded, with the reason."""


def names_of(scene: Scene) -> list[str]:
    return list(Machine(scene, next(iter(fitting(scene))), backend="python").numbers)


@pytest.mark.quick("water", "windy", "sticky_bearing", "torsion", "motor_bench")
@pytest.mark.parametrize("name", SCENES)
def test_formulas_give_the_bits_of_python_at_drawn_values(name: str) -> None:
    scene = explicit(SCENES[name])
    formulas = formulas_of(scene, names_of(scene))
    draw = random.Random(name)
    for _ in range(20):
        values = [setting.value * draw.uniform(0.7, 1.4) for setting in formulas.settings]
        wanted = numbers_of(with_settings(scene, formulas.settings, values))
        found = formulas.values(values)
        assert {key: value.hex() for key, value in found.items()} == {key: wanted[key].hex() for key in found}
    left = {one.name for one in settings_of(scene)} - {one.name for one in formulas.settings}
    assert left == LEFT_OUT.get(name, left)


def test_drags_with_numbers_keep_every_bit() -> None:
    for name, scene in SCENES.items():
        assert dict(explicit(scene).coefficients) == dict(scene.coefficients), name
        assert explicit(explicit(scene)) == explicit(scene), name


def test_a_formula_that_is_not_recorded_is_not_offered(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rate with a square root loses its record; the damping alone stays fixed."""
    scene = Scene("damped", effects=(Gravity(), LinearDrag(gamma=0.25)))
    rooted: Any = lambda self, scene: {"linear_drag_rate": float(self.gamma) ** 0.5}  # noqa: E731
    monkeypatch.setattr(LinearDrag, "coefficients", rooted)
    made = formulas_of(replace(scene), names_of(scene))
    assert [setting.name for setting in made.settings] == ["body.length", "body.mass", "gravity"]
