"""Tests of users' effects in blocks: functions of any form give the bits of single runs, and may make lists."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import signature
from typing import Any

import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.generate import batch_program
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.elementary import cos, power, sin
from pendulum_env.tasks import TASKS

v = 3.0
"""A constant with the name that a step has for the velocity."""


def product(first: float, second: float) -> float:
    return first*second


def pair(first: float, second: float) -> tuple[float, float]:
    return sin(first), cos(second)


def with_a_constant(angle: float, mine_rate: float) -> float:
    return -mine_rate*(sin(angle) + v*cos(angle))


def with_two_targets(angle: float, velocity: float, mine_rate: float) -> float:
    b = 3.0
    a = b = sin(angle)
    return -mine_rate*(a + b*velocity)


def with_a_keyword(angle: float, velocity: float, mine_rate: float) -> float:
    v = 2.0*velocity + 1.0
    return -mine_rate*sin(angle)*product(angle, second=v)


def with_a_keyword_of_the_sine(angle: float, mine_rate: float) -> float:
    return -mine_rate*sin(x=angle*2.0)


def with_a_walrus(angle: float, velocity: float, mine_rate: float) -> float:
    b = (v := angle*3.0)*2.0
    return -mine_rate*(sin(v) + b*velocity)


def with_truth_values(angle: float, velocity: float, mine_rate: float) -> float:
    fast = velocity > 0.5
    a = sin(angle*(2.0 if fast else 1.0))
    near = (a > 0.1) & fast
    b = cos(a)
    return -mine_rate*(b if near else sin(b) if not fast else 2.0*b)


def with_nested_targets(angle: float, velocity: float, mine_rate: float) -> float:
    c, (a, b) = velocity, pair(angle, velocity)
    return -mine_rate*(a + 2.0*b + 3.0*c)


def with_a_guard(angle: float, mine_rate: float) -> float:
    return -mine_rate*(1.0 if angle > 0.0 and sin(power(angle, 0.5)) > 0.5 else 2.0)


def the_same_for_all(mine_rate: float) -> float:
    return mine_rate*sin(mine_rate)


def with_lists(angle: float, mine_rate: float) -> float:
    table = [0.1, 0.2, 0.4]
    return -mine_rate*table[0 if angle < 0.0 else 2]*sin(angle)


def with_a_comprehension(angle: float, mine_rate: float) -> float:
    return -mine_rate*sum([v*sin(share*angle) for share in (0.5, 1.0)])


def with_tanh(angle: float, velocity: float, mine_rate: float) -> float:
    return -mine_rate*(math.tanh(20.0*velocity) + np.tanh(angle))


FORMS: tuple[Callable[..., float], ...] = (
    with_a_constant, with_two_targets, with_a_keyword, with_a_keyword_of_the_sine, with_a_walrus, with_truth_values,
    with_nested_targets, with_a_guard, the_same_for_all, with_lists,
    with_a_comprehension, with_tanh)


def scene_with(form: Callable[..., float], scene: str) -> Scene:
    """Return a scene with an effect of one's own, whose torque has this form."""
    @dataclass(frozen=True)
    class Mine(Effect):
        """A drive of one's own."""

        name, kind, equation, source = "mine", "drive", "mine", "none"
        torque = staticmethod(form)

        def coefficients(self, scene: Any) -> Mapping[str, float]:
            return {"mine_rate": 0.5}

    base = SCENES[scene]
    return base.with_effects((*base.effects, Mine()))


@pytest.mark.quick(
    "with_a_walrus-rk4-vacuum", "with_nested_targets-rk4-vacuum", "with_lists-rk4-torsion", "with_a_guard-rk4-torsion",
    "the_same_for_all-rk4-torsion"
)
@pytest.mark.parametrize("scene", ["vacuum", "torsion"])
@pytest.mark.parametrize(("form", "integrator"), [*((form, "rk4") for form in FORMS), *(
    (form, "velocity_verlet") for form in FORMS if "velocity" not in signature(form).parameters)])
def test_blocks_have_the_bits_of_single_runs(form: Callable[..., float], integrator: str, scene: str) -> None:
    own, angle = scene_with(form, scene), np.array([-0.5, 0.3, 1.0])
    options: dict[str, Any] = {"integrator": integrator, "duration": 0.1, "diagnostics": ("energy",)}
    many = rollout(own, angle=angle, backend="python", **options)
    for place, one in enumerate(angle.tolist()):
        single = rollout(own, angle=one, backend="python", **options)
        assert many.angle[place].tolist() == single.angle.tolist()
        assert many.ledger.work[place].tolist() == single.ledger.work.tolist()


@pytest.mark.parametrize("own", [False, True])
def test_with_effects_of_ones_own_observations_are_copied_by_loops_of_their_own(own: bool) -> None:
    """The compiler finds no vectors in a loop that writes to arrays of several types; steps took three times as long.
    """
    scene = scene_with(with_a_constant, "vacuum") if own else SCENES["vacuum"]
    found = batch_program(scene, integrators.get("rk4"), ("energy",), frozenset(), TASKS["swing_up"].goal)
    observe = found.text.split("def observe(")[1].split("@entry")[0]
    assert ("observation[i, 0]" in observe, "seen[i, 0]" in found.text) == (not own, own)


@pytest.mark.usefixtures("interpreted")
def test_names_in_a_comprehension_are_found_for_series_too() -> None:
    own = scene_with(with_a_comprehension, "torsion")
    series, steps = (rollout(own, angle=1.0, duration=1.0, dt=0.05, integrator=name).angle
                     for name in ("taylor", "dop853"))
    assert series == pytest.approx(steps, abs=1e-12)
    assert abs(series[-1] - rollout(SCENES["torsion"], angle=1.0, duration=1.0, dt=0.05).angle[-1]) > 0.1


def test_stages_end_with_the_whole_force() -> None:
    text = batch_program(scene_with(with_a_constant, "vacuum"), integrators.get("rk4"), (), frozenset()).text
    assert text.count("def stage_") == 4
    assert "sin_block" not in text


@pytest.mark.slow
@pytest.mark.parametrize("form", [with_lists, with_a_comprehension, with_tanh])
def test_compiled_programs_with_functions_of_a_user(form: Callable[..., float]) -> None:
    """A user's functions may make lists, which needs numba's memory, and comprehensions, which need all its passes."""
    own, angle = scene_with(form, "vacuum"), np.array([-0.5, 0.3, 1.0])
    many = rollout(own, angle=angle, duration=0.1, backend="compiled")
    plain = rollout(own, angle=1.0, duration=0.1, backend="python")
    assert many.angle[2].tolist() == plain.angle.tolist()
    if form is with_lists:  # the program of single runs calls the same functions
        assert rollout(own, angle=1.0, duration=0.1, backend="compiled").angle.tolist() == plain.angle.tolist()
