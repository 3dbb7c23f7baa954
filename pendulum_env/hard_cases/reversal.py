"""Hard cases: reversal of the velocity, and restart from a saved state.

After a reversal of the velocity a symmetric method retraces its steps (Hairer, Lubich & Wanner 2006, Geometric
Numerical Integration, V.1) and returns to the start up to rounding; other methods return up to the error of their
order. A run that continues from a saved state, written as text and read again, must be bit-identical, including the
memory of methods and effects.
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
    Bound,
    Case,
    Finding,
    Rule,
    Try,
    also,
    always,
    graded,
    ran,
    sooner,
    stopped,
)
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.steps import retraces, rounding_factor

GROUP = "reversal and restart"
KNOWN: dict[tuple[str, str], str] = {}
"""(case, method) -> reason of a known failure, and what the method does instead."""

SCENE = SCENES["vacuum"]
PRODUCT, STEPS = 0.02, 500
"""omega0 h, and number of steps in each direction."""
CEILING = "a method that does not retrace its steps misses the start, by an error that its order bounds from above only"
RESTARTS = 24
"""Number of steps of a run that is saved and resumed after each step."""


def _back(angle: float, speed: float, pace: float, growth: float) -> Try:
    """Return a function that judges a method by a run forwards and back from ``angle`` [rad].

    ``speed`` is the initial velocity and ``pace`` the rate at which forces change, both in units of omega0. ``growth``
    is the factor by which the motion amplifies errors. About ten ulps of rounding are allowed per step.
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
        rounding = 10.0 * rounding_factor(method) * 2.0**-52 * size * growth * 2.0 * STEPS
        order = 0.0 if math.isinf(method.order) else (pace * PRODUCT) ** method.order * pace * PRODUCT * STEPS * growth
        finding = graded(error, rounding, size=size)
        if finding.outcome == ACCURATE or retraces(method):
            return finding
        wrong = "" if finding.error <= order + rounding else "it misses the start by more than its order allows"
        bound = Bound("the return to the start", order + rounding, size, CEILING)
        return also(Finding(WRONG if wrong else STABLE, finding.error, order + rounding, wrong), bound)

    return attempt


def _retracing(method: Method) -> frozenset[str]:
    """Return ACCURATE as allowed outcome for methods that retrace their steps, else ACCURATE and STABLE."""
    return frozenset({ACCURATE} if retraces(method) else {ACCURATE, STABLE})


def _resumed(scene: Scene, hold: int, compiled: bool) -> Try:
    """Return a function that judges a method by resuming a run from a saved state after every step.

    Its end must equal that of the uninterrupted run bit for bit. The run has RESTARTS steps and a new control every
    ``hold`` steps.
    """

    def attempt(method: Method) -> Finding:
        backend = "auto" if compiled else sooner(method, RESTARTS * RESTARTS)
        h = min(0.02, PRODUCT * 2.0 / scene.omega0)
        original = Machine(scene, method, ("energy",), backend, hold=hold)  # runs without interruption
        other = Machine(scene, method, ("energy",), backend, hold=hold)

        def go(machine: Machine, state: Any, first: int) -> Any:
            for step in range(first, RESTARTS):
                if machine.advance(state, _control(step // hold), h, 1):
                    raise ArithmeticError("the run stopped although the motion is bounded")
            return state

        uninterrupted = np.array(go(original, _start(original), 0), dtype=float)
        state = _start(original)
        for step in range(RESTARTS):
            saved = json.loads(json.dumps([float(value) for value in state]))
            resumed = np.array(go(other, other.array(saved), step), dtype=float)
            if uninterrupted.tobytes() != resumed.tobytes():
                difference = float(np.max(np.abs(uninterrupted - resumed)))
                return Finding(WRONG, difference, 0.0, f"resumed after {step} steps, the run ends in another state")
            if original.advance(state, _control(step // hold), h, 1):
                raise ArithmeticError("the run stopped although the motion is bounded")
        return Finding(ACCURATE, 0.0, 0.0)

    return attempt


def _start(machine: Machine) -> Any:
    """Return a machine's initial state in its scene, with fixed random numbers for gusts."""
    run = machine.scene.run
    return machine.state(run.angle, run.velocity, [0.3] * len(machine.drawn))


def _control(period: int) -> float:
    """Return the control of a control step, as a fraction of the motor's torque."""
    return (0.5, -1.0, 0.25)[period % 3]


def _case(name: str, why: str, truth: str, source: str, attempt: Try, may: Rule, scene: Scene = SCENE,
          long: bool = False) -> Case:
    """Return a hard case of the group of reversals and restarts."""
    return Case(name, GROUP, why, truth, source, scene, may, attempt, long)


HLW = "Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, V.1"
BACK = "a return to the start, up to rounding if the method retraces its steps, else up to the error of its order"
SAVED = "a run resumed from a state written as JSON ends with the bits of the uninterrupted run"
FROM = (
    # name, angle [rad], speed [omega0], pace [omega0], growth of errors: at most 1 + omega0 t/2 except near the top
    ("a small swing", 0.01, 0.0, 1.0, 2.0),
    ("a swing of 2 rad", 2.0, 0.0, 1.7, 6.0),
    ("going round", 0.5, 3.0, 3.1, 15.0),
    ("past the top", 0.0, 2.05, 2.05, 100.0),
)
SCENES_TO_RESUME = (("vacuum", 1), ("lab", 6), ("windy", 6), ("sticky_bearing", 6), ("chaotic", 1), ("water", 1))
"""Presets, and steps per control step; together they have motors, gusts, dry friction, drives and fluids."""

CASES = (
    *(
        _case(f"there and back, {name}",
              "A symmetric method retraces its steps, so that forward and backward steps may differ only by rounding.",
              BACK, HLW, _back(angle, speed, pace, growth), _retracing)
        for name, angle, speed, pace, growth in FROM
    ),
    *(
        _case(f"resumed at any step, {name}", "The history of methods and effects must be saved with the state.",
              SAVED, "the definition of a state: the future depends on nothing else",
              _resumed(SCENES[name], hold, False), always(ACCURATE), SCENES[name])
        for name, hold in SCENES_TO_RESUME
    ),
    _case("resumed at any step, compiled",
          "Compiled programs store their state in an array of their own, which must be saved and restored, too.", SAVED,
          "the definition of a state: the future depends on nothing else", _resumed(SCENE, 1, True),
          always(ACCURATE), long=True),
)
