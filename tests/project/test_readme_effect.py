"""What the READMEs say of scenes and effects, done: its code and its numbers."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from readme_code import ROOT, block, check_numbers, run
from scipy.integrate import quad

from pendulum_env import Scene, rollout
from pendulum_env.engine.machine import fitting
from pendulum_env.engine.reading import ProgramError

pytestmark = pytest.mark.usefixtures("all_interpreted")

MARKS = ("a scene", "gusts", "adding an effect")


@pytest.mark.parametrize("mark", [
    pytest.param(mark, marks=() if mark == "adding an effect" else pytest.mark.slow) for mark in MARKS])
def test_the_numbers_beside_the_code_are_what_it_prints(mark: str, tmp_path: Path) -> None:
    check_numbers(mark, 2, tmp_path)


def test_the_effect_does_what_its_docstring_says(tmp_path: Path) -> None:
    """Coasting, ``v' = -b v/(1 + (v/c)²)`` has ln(v0/v) + (v0² - v²)/(2 c²) = b t; and the largest torque is at c."""
    effect = run(block("adding an effect"), tmp_path)[0]["EddyBrake"](0.5, 2.0)
    scene = Scene(effects=(effect,))
    found = rollout(scene, angle=0.0, velocity=5.0, duration=10.0, dt=0.01, backend="python")
    v = found.velocity[-1]
    assert math.log(5.0 / v) + (25.0 - v * v) / 8.0 == pytest.approx(0.5 * 10.0, rel=1e-9)
    assert found.ledger.heat[-1] == pytest.approx(0.5 * (25.0 - v * v), rel=1e-9)
    assert quad(lambda w: effect.by_velocity(w, 0.5, 2.0), 0.0, 3.0)[0] == pytest.approx(effect.torque(3.0, 0.5, 2.0))
    assert effect.by_velocity(2.0, 0.5, 2.0) == 0.0
    assert {"rk4", "gauss4", "radau5", "bdf4", "taylor"} < set(fitting(scene))


@pytest.mark.parametrize("file", ["<stdin>", str(ROOT / "README.md")])
def test_typed_at_a_prompt_it_is_refused_in_a_sentence(file: str) -> None:
    """There is no source to copy then, or what stands in another file."""
    code = block("adding an effect").split("scene = ")[0]
    names: dict[str, Any] = {}
    exec(compile(code, file, "exec"), names)
    scene = Scene(effects=(names["EddyBrake"](),))
    with pytest.raises(ProgramError, match="The source of brake cannot be read; write it in a file"):
        rollout(scene, duration=0.1, backend="python")
