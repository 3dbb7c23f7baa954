"""Tests of pendulum_env.code: the text of a program runs with decorators that return functions unchanged."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest

from integrators import MethodError
from pendulum_env import SCENES, SceneError, code, rollout
from pendulum_env.physics.effects import EFFECTS


def run_by_hand(text: str, parameters: list[float], angle: float, h: float, steps: int) -> tuple[float, float]:
    """Return angle and velocity after some steps of a program's text, run as its documentation describes."""
    names: dict[str, Any] = {"inline": lambda function: function, "entry": lambda function: function}
    exec(text, names)
    state = [0.0, angle, *[0.0] * 40]
    assert names["run"](state, parameters, 0.0, h, 1, steps, math.inf, [], [0.0, 0.0, 0.0]) == 0
    return state[1], state[3]


@pytest.mark.parametrize("method", ["rk4", "velocity_verlet", "implicit_midpoint"])
def test_the_text_runs_and_gives_the_bits_of_a_rollout(method: str) -> None:
    scene = SCENES["vacuum"]
    numbers = [*scene.coefficients.values(), scene.inertia, scene.gravity * scene.weight_moment]
    angle, velocity = run_by_hand(code("vacuum", method, "engine"), numbers, 0.5, 0.01, 100)
    run = rollout("vacuum", integrator=method, angle=0.5, velocity=0.0, dt=0.01, duration=1.0, backend="python")
    assert (angle, velocity) == (run.angle[-1], run.velocity[-1])


def test_it_holds_the_scene_s_effects_and_no_others() -> None:
    words = set(re.findall(r"\w+", code("lab", "rk4", "engine")))
    roles = ("torque", "by_angle", "potential", "flow", "radial", "wind_x", "wind_y", "advance")
    for name, effect in EFFECTS.items():
        if not SCENES["lab"].has(name):
            functions = {getattr(effect, role).__name__ for role in roles if getattr(effect, role) is not None}
            assert not words & functions, f"{name} is in the program"
    assert "gravity_torque" in words or any("gravity" in word for word in words)
    assert "heat" in words
    assert "heat" not in set(re.findall(r"\w+", code("lab", "rk4", "engine", diagnostics=())))
    assert "linear_drag_rate" not in code("lab", "rk4", "engine", damping="none")


def test_numbers_are_arguments() -> None:
    assert code(SCENES["vacuum"].replace(length=2.0), language="engine") == code("vacuum", language="engine")
    assert code(SCENES["vacuum"].to_dict()) == code("vacuum")


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(SceneError, match="language"):
        code("lab", "rk4", "fortran")
    with pytest.raises(MethodError, match="does not offer"):
        code("lab", "exact")
    with pytest.raises(SceneError, match="diagnostics must be a tuple"):
        code("lab", "rk4", diagnostics="energy")
