"""What README says of scenes and effects, done: its code and numbers, and its effect in the registry."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import pytest
from readme_code import ROOT, block, check_copy, check_numbers, copy_package, run
from scipy.integrate import quad

from pendulum_env import Scene, rollout
from pendulum_env.engine.machine import fitting
from pendulum_env.engine.source import SourceError

pytestmark = pytest.mark.usefixtures("all_interpreted")

MARKS = ("a scene", "gusts", "adding an effect")


@pytest.mark.parametrize("mark", MARKS)
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


@pytest.mark.slow
def test_in_the_registry_it_is_a_name_and_the_tests_of_effects_run_it(tmp_path: Path) -> None:
    """A copy of the package with README's effect in a file of its own and in the tuple: nothing else is written."""
    copy_package(tmp_path)
    found = re.search(r"(from dataclasses.*?)\n\nscene = ", block("adding an effect"), flags=re.S)
    assert found
    effects = tmp_path / "pendulum_env" / "physics" / "effects"
    code = found[1].replace("import gymnasium as gym, pendulum_env\n", "")
    code = code.replace("pendulum_env.physics.effects import", "pendulum_env.physics.effects.effect import")
    (effects / "eddy_brake.py").write_text(f"from __future__ import annotations\n{code}", encoding="utf-8")
    registry = effects / "__init__.py"
    text = registry.read_text(encoding="utf-8").replace(
        "from pendulum_env.physics.effects.effect import Effect\n",
        "from pendulum_env.physics.effects.eddy_brake import EddyBrake\n"
        "from pendulum_env.physics.effects.effect import Effect\n",
    )
    registry.write_text(text.replace("    Gravity, SmallAngle", "    EddyBrake, Gravity, SmallAngle"), encoding="utf-8")
    code = "from pendulum_env import Scene, SCENES\nfrom pendulum_env.physics.damping import with_damping\n" \
           "scene = with_damping(SCENES['lab'], 'eddy+linear')\n" \
           "print(Scene.from_dict(scene.to_dict()) == scene, scene.has('eddy_brake'))"
    check_copy(tmp_path, code, "True True\n", "eddy_brake", ("test_effects", "test_scene_properties", "test_audit"), 4)


@pytest.mark.parametrize("file", ["<stdin>", str(ROOT / "README.md")])
def test_typed_at_a_prompt_it_is_refused_in_a_sentence(file: str) -> None:
    """There is no source to copy then, or what stands in another file."""
    code = block("adding an effect").split("scene = ")[0]
    names: dict[str, Any] = {}
    exec(compile(code, file, "exec"), names)
    scene = Scene(effects=(names["EddyBrake"](),))
    with pytest.raises(SourceError, match="The source of brake cannot be read; write an effect's functions in a file"):
        rollout(scene, duration=0.1, backend="python")
