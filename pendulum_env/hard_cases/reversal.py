"""Hard cases: back to where it came from, and on from where it stopped.

A symmetric method with its velocity turned round retraces its steps (Hairer, Lubich & Wanner 2006, Geometric Numerical
Integration, V.1): what is left is rounding. Others come back to what their order leaves. A state that was saved,
written as text and read again has to go on bit for bit, with all that a method or an effect remembers.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

from integrators import Method
from pendulum_env.engine.machine import Machine
from pendulum_env.hard_cases.case import (
    ACCURATE,
    STABLE,
    WRONG,
    Case,
    Finding,
    Rule,
    Try,
    always,
    graded,
    ran,
    sooner,
    stopped,
)
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.steps import cancelling, retraces

GROUP = "reversal and restart"
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> why it fails, and what it does instead."""

SCENE = SCENES["vacuum"]
PRODUCT, STEPS = 0.02, 500
"""omega0 h, and steps each way."""
RESTARTS = 24
"""Steps of a run that is saved after each."""


def _back(angle: float, speed: float, pace: float, growth: float) -> Try:
    """There and back from ``angle`` [rad] with ``speed`` [omega0].

    ``pace``: how fast forces change in it [omega0]; ``growth``: by how much the motion amplifies errors, with which
    roundings come back as their sum; each step adds some ten of them.
    """

    def attempt(method: Method) -> Finding:
        start = np.array([angle, speed * SCENE.omega0])
        options: dict[str, Any] = {"dt": PRODUCT / SCENE.omega0, "steps": STEPS, "every": STEPS}
        there = ran(SCENE, method, angle=start[0], velocity=start[1], **options)
        ended = stopped(there)
        if ended is not None:
            return ended
        back = ran(SCENE, method, angle=there.angle[-1], velocity=-there.velocity[-1], **options)
        ended = stopped(back)
        if ended is not None:
            return ended
        error = [back.angle[-1] - angle, -back.velocity[-1] / SCENE.omega0 - speed]
        size = 1.0 + abs(there.angle[-1]) + speed
        rounding = 10.0 * cancelling(method) * 2.0**-52 * size * growth * 2.0 * STEPS
        order = 0.0 if math.isinf(method.order) else (pace * PRODUCT) ** method.order * pace * PRODUCT * STEPS * growth
        found = graded(error, rounding)
        if found.outcome == ACCURATE or retraces(method):
            return found
        wrong = "" if found.error <= order + rounding else "it comes back by another way than its order allows"
        return Finding(WRONG if wrong else STABLE, found.error, order + rounding, wrong)

    return attempt


def _retracing(method: Method) -> frozenset[str]:
    """ACCURATE for methods that retrace their steps; others may, if their error is below rounding."""
    return frozenset({ACCURATE} if retraces(method) else {ACCURATE, STABLE})


def _resumed(scene: Scene, hold: int, compiled: bool) -> Try:
    """A run of RESTARTS steps, with another control every ``hold`` steps, resumed after each of them from text."""

    def attempt(method: Method) -> Finding:
        backend = "auto" if compiled else sooner(method, RESTARTS * RESTARTS)
        h = min(0.02, PRODUCT * 2.0 / scene.omega0)
        made = Machine(scene, method, ("energy",), backend, hold=hold)
        other = Machine(scene, method, ("energy",), backend, hold=hold)

        def go(machine: Machine, state: Any, first: int) -> Any:
            for step in range(first, RESTARTS):
                if machine.advance(state, _control(step // hold), h, 1):
                    raise ArithmeticError("the run stopped although nothing grows")
            return state

        whole = np.array(go(made, _start(made), 0), dtype=float)
        state = _start(made)
        for step in range(RESTARTS):
            saved = json.loads(json.dumps([float(value) for value in state]))
            resumed = np.array(go(other, other.array(saved), step), dtype=float)
            if whole.tobytes() != resumed.tobytes():
                apart = float(np.max(np.abs(whole - resumed)))
                return Finding(WRONG, apart, 0.0, f"resumed after {step} steps it ends elsewhere")
            if made.advance(state, _control(step // hold), h, 1):
                raise ArithmeticError("the run stopped although nothing grows")
        return Finding(ACCURATE, 0.0, 0.0)

    return attempt


def _start(machine: Machine) -> Any:
    run = machine.scene.run
    return machine.state(run.angle, run.velocity, [0.3] * len(machine.drawn))


def _control(period: int) -> float:
    """A share of the motor's torque for each control step."""
    return (0.5, -1.0, 0.25)[period % 3]


def _case(name: str, why: str, truth: str, source: str, attempt: Try, may: Rule, scene: Scene = SCENE,
          long: bool = False) -> Case:
    return Case(name, GROUP, why, truth, source, scene, may, attempt, long)


HLW = "Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, V.1"
BACK = "the start, to rounding where the method retraces its steps; else to what its order leaves"
SAVED = "the same bits after every step, from a state written as JSON"
FROM = (
    # name, angle [rad], speed [omega0], pace [omega0], growth: of the phase with the energy, 1 + omega0 t/2 and less
    ("a small swing", 0.01, 0.0, 1.0, 2.0),
    ("a swing of 2 rad", 2.0, 0.0, 1.7, 6.0),
    ("going round", 0.5, 3.0, 3.1, 15.0),
    ("past the top", 0.0, 2.05, 2.05, 100.0),
)
SCENES_TO_RESUME = (("vacuum", 1), ("lab", 6), ("windy", 6), ("sticky_bearing", 6), ("chaotic", 1), ("water", 1))
"""Presets, and steps for which a control holds: methods with a past, motors, gusts, dry friction, drives, fluids."""

CASES = (
    *(
        _case(f"there and back, {name}", "Nothing but rounding tells forth from back.", BACK, HLW,
              _back(angle, speed, pace, growth), _retracing)
        for name, angle, speed, pace, growth in FROM
    ),
    *(
        _case(f"resumed at any step, {name}", "What a method or an effect remembers has to be saved with the rest.",
              SAVED, "the definition of a state: what comes after depends on nothing else",
              _resumed(SCENES[name], hold, False), always(ACCURATE), SCENES[name])
        for name, hold in SCENES_TO_RESUME
    ),
    _case("resumed at any step, compiled", "Compiled programs keep their state in an array of their own.", SAVED,
          "the definition of a state: what comes after depends on nothing else", _resumed(SCENE, 1, True),
          always(ACCURATE), long=True),
)
