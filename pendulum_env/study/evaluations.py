"""Force evaluations of a step; those of implicit methods are counted."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from integrators import Method
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import NOWHERE, UNSEEN, VELOCITY, Machine

Array = NDArray[np.float64]

SAMPLES = 32
"""Single steps, spread over a run, in which the evaluations of implicit methods are counted."""


def has_evaluations(method: Method) -> bool:
    """False for methods whose steps take a series or a closed form in place of force evaluations."""
    return not method.needs & {"taylor", "exact_flow"}


def evaluations_per_step(machine: Machine, angle: Array, velocity: Array, h: float) -> float:
    """Force evaluations per step of ``h`` [s]: declared by explicit methods, counted for implicit ones; nan for others.

    An implicit method takes single steps from SAMPLES of the states ``angle, velocity`` [rad, rad/s] of a run, of which
    those count that cross no turning point; nan if all do. What its memory takes to begin is not counted.
    """
    method, scene = machine.method, machine.scene
    if not has_evaluations(method):
        return math.nan
    if not method.implicit:
        return float(method.evaluations)
    made, calls = program(scene, method, ()), [0]
    force = "mean_acceleration" if "mean" in method.needs else "acceleration"
    original = interpreted(made.text, made.title)[force]

    def counted(*arguments: float) -> float:
        calls[0] += 1
        return float(original(*arguments))

    advance = interpreted(made.text, made.title, {force: counted})["run"]
    states, before, found = Machine(scene, method, (), "python"), 0, []
    chosen = np.linspace(0, len(angle) - 1, SAMPLES).astype(int)
    for q, v in zip(angle[chosen], velocity[chosen], strict=True):
        state = states.state(float(q), float(v))
        if method.memory:
            advance(state, states.parameters, 0.0, h, 1, 1, math.inf, NOWHERE, UNSEEN)
            before = calls[0]
        advance(state, states.parameters, 0.0, h, 1, 1, math.inf, NOWHERE, UNSEEN)
        if state[VELOCITY] * v > 0.0:
            found.append(calls[0] - before)
        before = calls[0]
    return sum(found) / len(found) if found else math.nan
