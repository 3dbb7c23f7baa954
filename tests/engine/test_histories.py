"""Tests of long histories of multistep methods in blocks, which move back to their place in every eighth step."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import integrators
from pendulum_env import SCENES, rollout
from pendulum_env.engine import runs
from pendulum_env.engine.generate import batch_program
from pendulum_env.engine.layout import AHEAD, BLOCK, FEWEST_VALUES
from pendulum_env.engine.stages import scheduled
from pendulum_env.tasks import TASKS

LONG = ["quinlan_tremaine8", "quinlan8a", "quinlan8b", "quinlan_tremaine10", "quinlan_tremaine12",
        "quinlan_tremaine14"]
STEP = '''
def force(t, q, rate):
    return -rate*sin(q)

def step(t, q, v, a, a1_ago, a2_ago, u1_ago, h, rate):
    u = v + h*(a - a1_ago + a2_ago)
    q_new = q + h*(u + u1_ago)
    return q_new, v, force(t + h, q_new, rate), a, a2_ago, u
'''


def same(many: Any, i: int, one: Any) -> None:
    """Check run ``i`` of many against a run alone, to the last bit; only the latter records where it stops."""
    count = int(np.sum(one.time == many.time[: len(one.time)]))
    assert count >= len(one.time) - 1
    for name in ("angle", "velocity", "energy"):
        assert getattr(many, name)[i][:count].tolist() == getattr(one, name)[:count].tolist()
        assert np.isnan(getattr(many, name)[i][count:]).all()


def test_copies_are_results_that_the_step_was_given() -> None:
    """The second value of the history is a copy of the first; the third stays where it is."""
    results = ("q1", "v1", "a1", "a1_ago1", "a2_ago1", "u1_ago1")
    assert dict(scheduled(STEP, results, ("h", "rate")).copies) == {"v1": "v", "a1_ago1": "a", "a2_ago1": "a2_ago"}


@pytest.mark.slow
def test_methods_with_long_histories_have_room_for_newer_values() -> None:
    """Forces and mean velocities are two histories; short ones, and those of environments of a task, have no room.

    Nor have those of work and heat, with which there are three or four.
    """
    for name in LONG:
        order = int("".join(filter(str.isdigit, name)))
        layout = batch_program(SCENES["vacuum"], integrators.get(name), (), frozenset()).layout
        forces, velocities = layout.histories
        assert (len(forces), len(velocities)) == (order, order - 2)
        assert order + order - 2 >= FEWEST_VALUES
        at = layout.fields.index(forces[0])
        assert layout.fields[at : at + order] == forces
        assert layout.fields[at - AHEAD - 1] == "held"
        goal = TASKS["swing_up"].goal
        assert batch_program(SCENES["vacuum"], integrators.get(name), (), frozenset(), goal).layout.histories == ()
    undamped = SCENES["kapitza"].with_effects([effect for effect in SCENES["kapitza"].effects
                                               if effect.kind != "dissipative"])
    vacuum, lab, driven = (SCENES[name] for name in ("vacuum", "lab", "driven"))
    for scene, name in ((vacuum, "stoermer6"), (vacuum, "ab6"), (vacuum, "velocity_verlet"), (lab, "ab4"),
                        (driven, "ab6"), (undamped, "quinlan_tremaine12")):
        layout = batch_program(scene, integrators.get(name), ("energy",), frozenset()).layout
        assert layout.histories == ()
        assert not any(field.endswith("_in_1") for field in layout.fields)


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "method"), [
    *(("vacuum", name) for name in LONG), pytest.param("kater", "quinlan8a", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("steps", "every"), [(45, 1), (45, 3), (64, 8), (45, 45), (3, 2)])
def test_blocks_have_the_bits_of_single_runs(scene: str, method: str, steps: int, every: int) -> None:
    """Check compiled blocks, of which the second is not full, against interpreted single runs.

    Some runs stop at a limit of the speed, all at different times.
    """
    options: Any = {"integrator": method, "dt": 0.02, "duration": 0.02 * steps, "every": every, "speed_limit": 4.0}
    angle = np.linspace(-3.1, 3.1, BLOCK + 3)
    many = rollout(scene, angle=angle, **options)
    for i in (0, 60, 100, BLOCK - 1, BLOCK, BLOCK + 2):
        same(many, i, rollout(scene, angle=float(angle[i]), backend="python", **options))
    if steps > 40:
        assert 0 < sum(map(bool, many.stop_reason)) < len(angle)


@pytest.mark.slow
@pytest.mark.parametrize("method", LONG)
def test_interpreted_blocks_have_the_same_bits(method: str) -> None:
    found = [rollout("vacuum", integrator=method, angle=[0.3, 1.0, 2.5], velocity=[0.0, 9.0, 0.0], dt=0.05,
                     duration=2.0, every=3, speed_limit=9.5, backend=backend) for backend in ("compiled", "python")]
    assert found[0].angle.tobytes() == found[1].angle.tobytes()
    assert found[0].velocity.tobytes() == found[1].velocity.tobytes()


@pytest.mark.parametrize("place", [
    pytest.param(i, id=name, marks=() if name == "quinlan8a" else pytest.mark.slow) for i, name in enumerate(LONG)])
@pytest.mark.parametrize("every", [1, 3, 8, 11])
def test_calls_may_end_at_any_step(place: int, every: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs that take a few steps in each call of the program have the bits of runs that take all in one.

    Quick tests take the method whose program those above have compiled.
    """
    options: Any = {"integrator": LONG[place], "angle": [0.3, 1.0, 2.5], "dt": 0.02, "duration": 1.0, "every": every}
    whole = rollout("vacuum", **options)
    monkeypatch.setattr(runs, "WORK", 15)
    assert rollout("vacuum", **options).angle.tobytes() == whole.angle.tobytes()


@pytest.mark.parametrize("method", LONG)
def test_runs_that_diverge_leave_the_others_alone(method: str) -> None:
    """Steps of 1e7 s take a run out of the range of its sine at once; others stay at rest, at the bottom."""
    options: Any = {"integrator": method, "dt": 1e7, "duration": 1e8, "warn": False}
    many = rollout("vacuum", angle=[0.0, 2.0, 0.0], velocity=[0.0, 100.0, 0.0], **options)
    assert not many.angle[[0, 2]].any()
    assert not math.isfinite(many.angle[1][-1])
    same(many, 1, rollout("vacuum", angle=2.0, velocity=100.0, backend="python", **options))
