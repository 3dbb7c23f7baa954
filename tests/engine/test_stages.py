"""Tests of steps that blocks take stage by stage: the same operations, so the same bits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, rollout
from pendulum_env.engine.generate import batch_program
from pendulum_env.engine.machine import fitting
from pendulum_env.engine.stages import divided

STEP = '''
def other(q):
    return q


@inline
def step(t, q, v, h, rate):
    """A step that changes its arguments, as splittings do, and uses its first force again at its end."""
    a1 = force(t, q, rate)
    slope, _ = jacobian(t, q, v, rate)
    v = v + 0.25*h*(a1 + slope)
    q = q + 0.5*h*v
    a2 = force(t + 0.5*h, q, rate)
    v = v + 0.5*h*a2
    q = q + 0.5*h*v
    unused = 2.0
    a3 = force(t + h, q, rate)
    return q, v + 0.25*h*(a3 - a1)
'''
FORCE = '''
def force(t, q, rate):
    return -rate*q + t

def jacobian(t, q, v, rate):
    return -rate, 0.0
'''


def loops_of(method: str, scene: str = "vacuum", **options: Any) -> int:
    """Return the number of loops in which a block takes a step of a method."""
    text = batch_program(SCENES[scene], integrators.get(method), (), frozenset(), **options).text
    return 1 + text.count("def stage_")


def test_stages_in_turn_are_the_step() -> None:
    stages = divided(STEP, ("q1", "v1"))
    space: dict[str, Any] = {"inline": lambda function: function}
    exec(FORCE + STEP, space)
    known: dict[str, Any] = {**space, "t": 0.3, "q": 0.7, "v": -0.2, "h": 0.1, "rate": 9.0}
    carried: dict[str, float] = {}
    for stage in stages:
        assert set(stage.taken) <= set(carried)
        local = {**known, **{name: carried[name] for name in stage.taken}}
        exec("\n".join(stage.lines), local)
        carried |= {name: local[name] for name in stage.handed}
    assert (local["q1"], local["v1"]) == space["step"](0.3, 0.7, -0.2, 0.1, 9.0)


def test_a_stage_ends_with_its_force_and_hands_on_what_is_needed() -> None:
    stages = divided(STEP, ("q1", "v1"))
    assert [stage.handed for stage in stages] == [
        ("s_a1", "s_q", "s_slope", "s_v"), ("s_a2", "s_q", "s_v"), ("s_a3", "s_q", "s_v"), ()]
    assert [stage.taken for stage in stages] == [
        (), ("s_a1", "s_q", "s_slope", "s_v"), ("s_a2", "s_q", "s_v"), ("s_a1", "s_a3", "s_q", "s_v")]
    assert stages[0].lines[-1].startswith("s_slope, s__ = jacobian(")


@pytest.mark.parametrize("line", ["for k in range(2):\n        v = v + h", "if v > 0.0:\n        v = 0.0"])
def test_other_steps_are_taken_whole(line: str) -> None:
    assert divided(STEP.replace("unused = 2.0", line), ("q1", "v1")) == ()


def test_which_steps_are_divided() -> None:
    """An explicit step of two forces or more is; one of a single force, and one that may be cut or repeated, is not.

    chin4a takes a force and its slope at one place, dprkn12 two forces of which neither needs the other.
    """
    for name, method in fitting(SCENES["vacuum"]).items():
        forces = 0 if method.implicit or method.needs & {"exact_flow", "taylor"} else int(method.evaluations)
        wanted = 1 if forces < 2 else forces if name in ("chin4a", "dprkn12") else forces + 1
        assert loops_of(name) == wanted, name
    assert loops_of("rk4", adaptive=False, compensated=True) == 1
    assert loops_of("dopri5", adaptive=True) == 1
    assert loops_of("rk4", "sticky_bearing") == 1


@pytest.mark.parametrize("method", ["rk4", "pefrl", "yoshida6a", "chin4a", "dprkn8", "abm4", "dop853"])
@pytest.mark.parametrize("scene", ["vacuum", "lab", "windy", "kapitza"])
def test_compiled_blocks_take_the_single_steps(method: str, scene: str) -> None:
    """Check compiled blocks, of which the second is not full, against interpreted single runs."""
    if method not in fitting(SCENES[scene]):
        pytest.skip("the method does not fit the scene")
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
