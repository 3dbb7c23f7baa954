"""Tests of dry friction under varying torques: a bob sticks up to the limit, breaks away in time, and never creeps."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from breakaway import END, LIMIT, RATE, TORQUE, UNIT, by_turns

import integrators
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.generate import program
from pendulum_env.engine.machine import Machine, fitting
from pendulum_env.physics.effects import (
    CoulombFriction,
    Effect,
    Gravity,
    HorizontalDrive,
    PeriodicTorque,
    SmallAngleGravity,
    VerticalDrive,
)
from pendulum_env.truth.reference import reference


def stuck(*effects: Effect, limit: float = LIMIT, gravity: float = 1.0) -> Scene:
    return Scene(body=UNIT, gravity=gravity, effects=(*effects, CoulombFriction(limit)))


PUSHED: dict[str, tuple[Scene, float]] = {
    "periodic torque": (stuck(Gravity(), PeriodicTorque(0.299, RATE, 0.3)), math.asin(0.5)),
    "vertical drive": (stuck(Gravity(), VerticalDrive(0.399 / 9.0, 3.0)), math.asin(0.8 / 1.4)),
    "horizontal drive": (stuck(HorizontalDrive(0.799 / 9.0, 3.0)), 0.0),
}
"""Scenes and angles at which the sum of all torques stays below the friction's limit, but by less than 0.2 %."""
QUICK = [("periodic torque", "rk4"), ("vertical drive", "gauss4")]
HOLDING = [
    pytest.param(case, method, marks=[] if (case, method) in QUICK else pytest.mark.slow)
    for case, (scene, _) in PUSHED.items() for method in fitting(scene)
]


@pytest.mark.parametrize(("case", "method"), HOLDING)
def test_within_the_limit_it_never_moves(case: str, method: str) -> None:
    """Check that a bob below the friction's limit moves by no bit in 10 000 steps, without heat or work."""
    scene, angle = PUSHED[case]
    machine = Machine(scene, method, backend="python")
    state = machine.state(angle, 0.0)
    before = list(state)
    assert machine.advance(state, 0.0, 0.011, 10_000) == 0
    assert list(state[1:4]) == before[1:4]
    assert state[machine.sums["heat"]] == state[machine.sums["work"]] == 0.0


# --- the time of letting go -----------------------------------------------------------------------------------------


def risen(t: Any) -> tuple[Any, Any]:
    """Return the exact angle and velocity of a bob that slides under the torque sin(RATE t) after it exceeded LIMIT."""
    start = mp.asin(mp.mpf(LIMIT)) / RATE
    if t <= start:
        return mp.mpf(0), mp.mpf(0)
    push = (mp.cos(RATE * start) - mp.cos(RATE * t)) / RATE
    path = (mp.cos(RATE * start) * (t - start) - (mp.sin(RATE * t) - mp.sin(RATE * start)) / RATE) / RATE
    return path - LIMIT * (t - start) ** 2 / 2, push - LIMIT * (t - start)


@pytest.mark.parametrize("h", [0.35, 0.1, 0.013])
@pytest.mark.parametrize("method", ["dop853", "gauss4", "taylor20", "rk4"])
def test_a_rising_torque_lets_go_at_the_right_time(method: str, h: float) -> None:
    """Check that the bob breaks away at arcsin(limit/torque)/RATE, with the accuracy of the method's order."""
    scene = stuck(PeriodicTorque(1.0, RATE, -0.5 * math.pi))
    r = rollout(scene, integrator=method, angle=0.0, velocity=0.0, dt=h, duration=1.4, backend="python")
    order = integrators.get(method).order
    for t, q, v in zip(r.time, r.angle, r.velocity, strict=True):
        angle, velocity = risen(mp.mpf(t))
        allowed = (RATE * h) ** (order + 1) / math.factorial(order) + 2e-15
        assert abs(q - angle) < allowed
        assert abs(v - velocity) < allowed


def test_the_order_of_rk4_does_not_suffer() -> None:
    scene, errors = stuck(PeriodicTorque(1.0, RATE, -0.5 * math.pi)), []
    for steps in (7, 14, 28, 56):
        r = rollout(scene, integrator="rk4", angle=0.0, velocity=0.0, dt=1.4 / steps, duration=1.4, backend="python")
        errors.append(abs(float(r.angle[-1] - risen(mp.mpf(1.4))[0])))
    assert np.all(np.log2(np.array(errors[:-1]) / np.array(errors[1:])) > 3.6), errors


# --- sticking and sliding by turns ----------------------------------------------------------------------------------





def turning(method: str, h: float) -> Any:
    scene = stuck(SmallAngleGravity(), PeriodicTorque(TORQUE, RATE))
    return rollout(scene, integrator=method, angle=0.0, velocity=0.0, dt=h, duration=END, backend="python")


@pytest.mark.slow
def test_the_motion_sticks_and_slides_many_times() -> None:
    events, _, _ = by_turns()
    assert len(events) == 13


@pytest.mark.quick("velocity_verlet")
@pytest.mark.parametrize("method", ["dop853", "gauss4", "rk4", "velocity_verlet"])
def test_sticking_and_sliding_by_turns_is_the_exact_motion(method: str) -> None:
    events, angle, velocity = by_turns()
    h, order = 0.02, integrators.get(method).order
    r = turning(method, h)
    allowed = 20.0 * (RATE * h) ** order + 1e-12
    assert abs(r.angle[-1] - angle) < allowed
    assert abs(r.velocity[-1] - velocity) < allowed
    # The bob is at rest bit for bit from every stop to the next breakaway.
    bounds = [0.0, *map(float, events)]
    for start, stop in pairwise(bounds):
        inside = (r.time > start + 2 * h) & (r.time < stop - 2 * h)
        rest = r.velocity[inside] == 0.0
        assert np.all(rest) or not np.any(rest)
        assert not np.any(rest) or np.ptp(r.angle[inside]) == 0.0


def test_the_reference_of_the_studies_is_the_exact_motion() -> None:
    _, angle, velocity = by_turns()
    solution = reference(stuck(SmallAngleGravity(), PeriodicTorque(TORQUE, RATE)), 0.0, 0.0, [5.0, END])
    assert solution.angle[-1] == pytest.approx(angle, abs=1e-12)
    assert solution.velocity[-1] == pytest.approx(velocity, abs=1e-12)


def test_where_no_torque_depends_on_the_time_nothing_is_bisected() -> None:
    """Check that the program bisects for a breakaway only in scenes with torques that depend on the time."""
    plain = program(SCENES["sticky_bearing"], integrators.get("rk4")).text
    timed = program(PUSHED["periodic torque"][0], integrators.get("rk4")).text
    assert plain.count("other = acceleration(") == 1
    assert timed.count("other = acceleration(") == 4


def test_a_step_of_more_turns_than_are_followed_is_named() -> None:
    """Check that a step of 95 half swings diverges with a message, since the engine follows at most 64."""
    scene = Scene(body=UNIT, gravity=1.0, effects=(SmallAngleGravity(), CoulombFriction(1e-3)))
    r = rollout(scene, integrator="taylor", dt=300.0, duration=900.0, angle=1.0, velocity=0.0, backend="python")
    assert (r.stop_reason, r.stop_time) == ("diverged", 0.0)
    assert (r.angle[-1], r.velocity[-1], r.energy_residual[-1]) == (1.0, 0.0, 0.0)
    followed = rollout(scene, integrator="taylor", dt=60.0 * math.pi, duration=60.0 * math.pi, angle=1.0, velocity=0.0,
                       backend="python")
    assert followed.stop_reason == ""
