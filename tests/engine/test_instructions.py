"""Tests that an absent effect costs no processor instruction."""

from __future__ import annotations

import re
from functools import lru_cache

import pytest
from given_effects import GIVEN

import integrators
from pendulum_env import Scene
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.engine.kernels import PREAMBLE
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import EFFECTS, Effect, Gravity, LinearDrag
from pendulum_env.physics.medium import air

BASE = Scene(body=Body(length=0.353, mass=0.040, radius=0.0107), medium=air(20.0), effects=(Gravity(), LinearDrag(0.1)))
ADDED = [name for name in EFFECTS if name not in ("gravity", "small_angle_gravity", "linear_drag")]
WEIGHTLESS = [name for name in ADDED if EFFECTS[name].kind == "inertia"]
METHODS = ("rk4", "velocity_verlet", "implicit_midpoint", "symplectic_euler", "ab4")
INSTRUCTION = re.compile(r"^\t[a-z]\w*", re.MULTILINE)


def with_one(name: str) -> Scene:
    effect: Effect = GIVEN.get(name) or EFFECTS[name]()
    return BASE.with_effects((*BASE.effects, effect))


def without(scene: Scene, name: str) -> Scene:
    return scene.with_effects(tuple(effect for effect in scene.effects if effect.name != name))


@lru_cache
def instructions(scene: Scene, method: str, diagnostics: tuple[str, ...]) -> int:
    """Return the number of processor instructions of a compiled ``run``."""
    numba = pytest.importorskip("numba")
    namespace: dict[str, object] = {}
    exec(PREAMBLE + program(scene, integrators.get(method), diagnostics).text, namespace)
    run, array = namespace["run"], numba.types.Array
    numbers = array(numba.float64, 1, "C")
    number, whole = numba.float64, numba.int64
    run.compile((numbers, numbers, number, number, whole, whole, number,  # type: ignore[attr-defined]
                 array(number, 2, "C"), array(numba.float32, 1, "C")))
    (code,) = run.inspect_asm().values()  # type: ignore[attr-defined]
    return len(INSTRUCTION.findall(code))


@pytest.mark.quick("finite_bob", "wire_drag", "motor", "gusts", "vertical_drive")
@pytest.mark.parametrize("name", ADDED)
def test_a_program_does_not_know_what_was_taken_out(name: str) -> None:
    """Check that a removed effect leaves no trace in the program, and that effects of inertia never do."""
    scene = with_one(name)
    for method in METHODS:
        chosen = integrators.get(method)
        for diagnostics in ((), ("heat_by_effect", "energy", "tension", "flow")):
            plain = program(BASE, chosen, diagnostics).text
            assert program(without(scene, name), chosen, diagnostics).text == plain
            if name in WEIGHTLESS:
                assert program(scene, chosen, diagnostics).text == plain
            many = batch_program(BASE, chosen, diagnostics, frozenset({"inertia"})).text
            assert batch_program(without(scene, name), chosen, diagnostics, frozenset({"inertia"})).text == many


@pytest.mark.slow
@pytest.mark.parametrize("name", ADDED)
def test_what_is_absent_takes_no_instruction(name: str) -> None:
    """Check that an absent effect takes no instruction, and that a present one does, except for effects of inertia."""
    scene = with_one(name)
    before = instructions(BASE, "symplectic_euler", ())
    there, gone = (instructions(each, "symplectic_euler", ()) for each in (scene, without(scene, name)))
    print(f"\n{name}: {there} instructions with it, {gone} without")
    assert gone == before > 100
    assert there == before if name in WEIGHTLESS else there != before
