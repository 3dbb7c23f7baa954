"""Tests of steps that blocks take stage by stage: the same operations, so the same bits."""

from __future__ import annotations

import math
import re
from collections.abc import Set
from typing import Any

import numpy as np
import pytest
from choice import EVERYWHERE

import integrators
from pendulum_env import SCENES, rollout
from pendulum_env.engine.generate import batch_program
from pendulum_env.engine.machine import fitting
from pendulum_env.engine.stages import StepStage, rows_of, scheduled

STEP = '''
def push(q, rate):
    return rate*sin(q)

def force(t, q, rate):
    shifted = q + t
    return -push(shifted, rate) + cos(shifted)*q

def jacobian(t, q, v, rate):
    return -rate*cos(q + t), 0.0

def step(t, q, v, h, rate):
    """A step that changes its arguments, as splittings do, and uses its first force again at its end."""
    half = 0.5*h
    a1 = force(t, q, rate)
    slope, _ = jacobian(t, q, v, rate)
    v = v + half*(a1 + slope)
    q = q + half*v
    a2 = force(t + half, q, rate)
    v = v + half*a2*power(abs(q), 0.75)
    q = q + half*v + (sin(v) if v > 100.0 else 0.0)
    unused = sin(q - v)
    a3 = force(t + h, q, rate) + sin(rate)
    return q, v + half*(a3 - a1)
'''
FUNCTIONS: dict[str, Any] = {"inline": lambda function: function, "sin": math.sin, "cos": math.cos, "power": math.pow}
ARGUMENTS = {"t": 0.3, "q": 0.7, "v": -0.2, "h": 0.1, "rate": 9.0}
SAME = ("h", "rate")


def program_of(method: str, scene: str = "vacuum", **options: Any) -> str:
    """Return the program of blocks of runs with a method."""
    return batch_program(SCENES[scene], integrators.get(method), (), frozenset(), **options).text


def calls_in_step(text: str) -> list[str]:
    """Return the functions that a block's step calls before its last loop, in order: stages and values."""
    before = text.split("def advance_block(")[1].split("    for i in range")[0]
    return re.findall(r"^    (\w+)\(", before, re.MULTILINE)


def run_in_turn(stages: tuple[StepStage, ...], functions: tuple[str, ...]) -> dict[str, Any]:
    """Run stages, each of which sees the arguments and what earlier ones hand to it, in the rows of memory."""
    space = dict(FUNCTIONS)
    exec(STEP, space)
    for text in functions:
        exec(text, space)
    rows, memory = rows_of(stages), dict[int, float]()
    local: dict[str, Any] = {}
    for stage in stages:
        local = {**space, **ARGUMENTS, **{name: memory[rows[name]] for name in stage.taken}}
        exec("\n".join(stage.lines), local)
        memory |= {rows[name]: local[name] for name in stage.handed}
        for name, function, argument, constants in stage.values:
            at = ARGUMENTS[argument] if argument in ARGUMENTS else memory[rows[argument]]
            memory[rows[name]] = space[function](at, *map(float, constants))
    return local


def test_stages_in_turn_are_the_step() -> None:
    schedule = scheduled(STEP, ("q1", "v1"), SAME)
    assert len(schedule.stages) == 4
    found, space = run_in_turn(schedule.stages, schedule.functions), dict(FUNCTIONS)
    exec(STEP, space)
    assert (found["q1"], found["v1"]) == space["step"](**ARGUMENTS)


def test_values_are_computed_once_between_stages() -> None:
    """The force and its slope share a cosine, ``unused`` needs no sine, and those of ``rate`` and of a choice stay."""
    stages = scheduled(STEP, ("q1", "v1"), SAME).stages
    assert [sorted(value.function for value in stage.values) for stage in stages] == [
        ["cos", "sin"], ["cos", "power", "sin"], ["cos", "sin"], []]
    lines = [line for stage in stages for line in stage.lines]
    assert [line for line in lines if "sin(" in line] == [
        line for line in lines if "sin(rate)" in line or "if s_v > 100.0" in line.replace("s2_v", "s_v")]
    assert stages[1].values[-1].constants == ("0.75",)


def test_what_is_the_same_for_all_pendulums_is_not_handed_on() -> None:
    """The first stage only adds angle and time, and needs no half step; all others compute it themselves."""
    stages = scheduled(STEP, ("q1", "v1"), SAME).stages
    assert [sum(line.startswith("s_half =") for line in stage.lines) for stage in stages] == [0, 1, 1, 1]
    assert not any(name.endswith("half") for stage in stages for name in stage.handed)
    handed = scheduled(STEP, ("q1", "v1"), ("rate",)).stages
    assert any(name.endswith("half") for stage in handed for name in stage.handed)


@pytest.mark.parametrize("line", ["for k in range(2):\n        v = v + h", "if v > 0.0:\n        v = 0.0"])
def test_other_steps_are_taken_whole(line: str) -> None:
    assert scheduled(STEP.replace("unused = sin(q - v)", line), ("q1", "v1"), SAME).stages == ()


@pytest.mark.parametrize("names", [
    pytest.param({*EVERYWHERE, "chin4a"}, id="everywhere"),
    pytest.param(frozenset(integrators.METHODS), id="all", marks=pytest.mark.slow)])
def test_a_block_computes_as_many_sines_as_the_method_has_forces(names: Set[str]) -> None:
    """An undamped pendulum's force needs one sine; chin4a's slope needs the cosine of an angle whose sine it has."""
    for name in sorted(names & fitting(SCENES["vacuum"]).keys()):
        method = integrators.get(name)
        if method.implicit or method.needs & {"exact_flow", "taylor"}:
            continue
        values = [call for call in calls_in_step(program_of(name)) if not call.startswith("stage_")]
        assert sorted(values) == (["cos_sin_block", "sin_block"] if name == "chin4a" else
                                  ["sin_block"] * int(method.evaluations)), name
    assert calls_in_step(program_of("rk4", "rod")).count("power_block") == 4


def test_a_stage_ends_with_a_force_where_there_is_no_sine() -> None:
    assert len(calls_in_step(program_of("rk4", "textbook"))) == 4
    assert calls_in_step(program_of("symplectic_euler", "textbook")) == []


def test_steps_that_may_be_cut_or_repeated_are_taken_whole() -> None:
    assert "def stage_" not in program_of("rk4", adaptive=False, compensated=True)
    assert "def stage_" not in program_of("dopri5", adaptive=True)
    assert "def stage_" not in program_of("rk4", "sticky_bearing")


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "method"), [
    ("rod", "rk4"), ("kapitza", "symplectic_euler"),
    *(pytest.param(*more, marks=pytest.mark.slow) for more in (
        ("windy", "abm4"), ("vacuum", "rk4"), ("lab", "rk4"), ("windy", "rk4"), ("kapitza", "rk4"), ("vacuum", "pefrl"),
        ("lab", "yoshida6a"), ("vacuum", "chin4a"), ("vacuum", "dprkn8"), ("rod", "dop853")))])
def test_compiled_blocks_take_the_single_steps(scene: str, method: str) -> None:
    """Check compiled blocks, of which the second is not full, against interpreted single runs."""
    angle = np.linspace(-3.1, 3.1, 251)
    many = rollout(scene, integrator=method, angle=angle, duration=0.2, diagnostics=("energy",))
    for i in (0, 100, 247, 248, 250):
        one = rollout(scene, integrator=method, angle=float(angle[i]), duration=0.2, diagnostics=("energy",),
                      backend="python", seed=i)
        count = len(one.time)
        assert count > 20
        for name in ("angle", "velocity", "energy"):
            assert getattr(many, name)[i][:count].tolist() == getattr(one, name).tolist()
        assert many.ledger.work[i][:count].tolist() == one.ledger.work.tolist()
        assert many.ledger.heat[i][:count].tolist() == one.ledger.heat.tolist()
