"""Hard cases: reversal of the velocity, and restart from a saved state.

After a reversal of the velocity a symmetric method retraces its steps (Hairer, Lubich & Wanner 2006, Geometric
Numerical Integration, V.1) and returns to the start up to rounding; other methods return up to the error of their
order. A run that continues from a saved state, written as text and read again, must be bit-identical, including the
memory of methods and effects.
"""

from __future__ import annotations

import json
import math
from functools import partial
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
    also,
    always,
    graded,
    ran,
    sooner,
)
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Scene
from pendulum_env.truth.bounds import UNIT, retraces, rounding_factor

GROUP = "reversal and restart"
SCENE = SCENES["vacuum"]
PRODUCT, STEPS = 0.02, 500
"""omega0 h, and number of steps in each direction."""
CEILING = "a method that does not retrace its steps misses the start, by an error that its order bounds from above only"
RESTARTS = 24
"""Number of steps of a run that is saved and resumed after each step."""


def _back(angle: float, speed: float, pace: float, growth: float, method: Method) -> Finding:
    """Judge a method by a run forwards and back from ``angle`` [rad].

    ``speed`` is the initial velocity and ``pace`` the rate at which forces change, both in units of omega0. ``growth``
    is the factor by which the motion amplifies errors. About ten ulps of rounding are allowed per step.
    """
    start = np.array([angle, speed * SCENE.omega0])
    options: dict[str, Any] = {"dt": PRODUCT / SCENE.omega0, "steps": STEPS, "every": STEPS}
    there = ran(SCENE, method, angle=start[0], velocity=start[1], **options)
    back = ran(SCENE, method, angle=there.angle[-1], velocity=-there.velocity[-1], **options)
    error = [back.angle[-1] - angle, -back.velocity[-1] / SCENE.omega0 - speed]
    size = 1.0 + abs(there.angle[-1]) + speed
    rounding = 10.0 * rounding_factor(method) * UNIT * size * growth * 2.0 * STEPS
    order = 0.0 if math.isinf(method.order) else (pace * PRODUCT) ** method.order * pace * PRODUCT * STEPS * growth
    finding = graded(error, rounding, size=size)
    if finding.outcome == ACCURATE or retraces(method):
        return finding
    wrong = "" if finding.error <= order + rounding else "it misses the start by more than its order allows"
    bound = Bound("the return to the start", order + rounding, size, CEILING)
    return also(Finding(WRONG if wrong else STABLE, finding.error, order + rounding, wrong), bound)


def _resumed(scene: Scene, hold: int, compiled: bool, method: Method) -> Finding:
    """Judge a method by resuming a run from a saved state after every step.

    Its end must equal that of the uninterrupted run bit for bit. The run has RESTARTS steps and a new control every
    ``hold`` steps.
    """
    backend = "auto" if compiled else sooner(method, RESTARTS * RESTARTS)
    h = min(0.02, PRODUCT * 2.0 / scene.omega0)
    original, other = (Machine(scene, method, ("energy",), backend, hold=hold) for _ in range(2))
    start = scene.run.angle, scene.run.velocity, [0.3] * len(original.drawn)  # fixed random numbers for gusts

    def go(machine: Machine, state: Any, first: int, end: int = RESTARTS) -> Any:
        for step in range(first, end):
            if machine.advance(state, (0.5, -1.0, 0.25)[step // hold % 3], h, 1):
                raise ArithmeticError("the run stopped although the motion is bounded")
        return state

    uninterrupted = np.array(go(original, original.state(*start), 0), dtype=float)
    state = original.state(*start)
    for step in range(RESTARTS):
        saved = json.loads(json.dumps([float(value) for value in state]))
        resumed = np.array(go(other, other.array(saved), step), dtype=float)
        if uninterrupted.tobytes() != resumed.tobytes():
            difference = float(np.max(np.abs(uninterrupted - resumed)))
            return Finding(WRONG, difference, 0.0, f"resumed after {step} steps, the run ends in another state")
        go(original, state, step, step + 1)
    return Finding(ACCURATE, 0.0, 0.0)


SAVED = "a run resumed from a state written as JSON ends with the bits of the uninterrupted run"
THE_FUTURE = "the definition of a state: the future depends on nothing else"

CASES = (
    *(
        Case(f"there and back, {name}", GROUP,
             "A symmetric method retraces its steps, so that forward and backward steps may differ only by rounding.",
             "a return to the start, up to rounding if the method retraces its steps, else up to the error of its "
             "order",
             "Hairer, Lubich & Wanner 2006, Geometric Numerical Integration, V.1", SCENE,
             lambda method: frozenset({ACCURATE} if retraces(method) else {ACCURATE, STABLE}),
             partial(_back, angle, speed, pace, growth))
        for name, angle, speed, pace, growth in (
            # angle [rad], speed and pace [omega0], growth of errors: at most 1 + omega0 t/2 except near the top
            ("a small swing", 0.01, 0.0, 1.0, 2.0), ("a swing of 2 rad", 2.0, 0.0, 1.7, 6.0),
            ("going round", 0.5, 3.0, 3.1, 15.0), ("past the top", 0.0, 2.05, 2.05, 100.0))
    ),
    *(
        Case(f"resumed at any step, {name}", GROUP, "The history of methods and effects must be saved with the state.",
             SAVED, THE_FUTURE, SCENES[name], always(ACCURATE), partial(_resumed, SCENES[name], hold, False))
        # Presets, and steps per control step; together they have motors, gusts, dry friction, drives and fluids.
        for name, hold in (("vacuum", 1), ("lab", 6), ("windy", 6), ("sticky_bearing", 6), ("chaotic", 1), ("water", 1))
    ),
    Case("resumed at any step, compiled", GROUP,
         "Compiled programs store their state in an array of their own, which must be saved and restored, too.", SAVED,
         THE_FUTURE, SCENE, always(ACCURATE), partial(_resumed, SCENE, 1, True), True),
)
