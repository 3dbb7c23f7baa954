"""One run of a machine, recorded."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.machine import INDEX, UNSEEN, Machine
from pendulum_env.engine.shape import STOP_REASONS

Array = NDArray[np.float64]


def simulate(
    machine: Machine,
    angle: float,
    velocity: float,
    *,
    h: float,
    rows: int,
    every: int = 1,
    rest: int = 0,
    control: float = 0.0,
    speed_limit: float = math.inf,
) -> tuple[Array, str]:
    """States of one run of a machine, and why it stopped, or "".

    There are ``rows`` states, the start and one after every ``every`` steps of ``h``, and one more after a ``rest`` of
    fewer steps, if any; where the run stops early, the last one is there.
    """
    return followed(machine, machine.state(angle, velocity), h, rows, every, rest, control, speed_limit)


def followed(
    machine: Machine, state: Any, h: float, rows: int, every: int, rest: int, control: float, speed_limit: float
) -> tuple[Array, str]:
    """The same from a state, which is advanced."""
    out = np.empty((rows + (rest > 0), machine.width))
    code = machine.run(state, machine.parameters, control, h, rows - 1, every, speed_limit, out[:rows], UNSEEN)
    if rest and not code:
        code = machine.run(state, machine.parameters, control, h, 1, rest, speed_limit, out[rows - 1 :], UNSEEN)
    states, reason = out[: 1 + math.ceil(state[INDEX] / every)], STOP_REASONS.get(code, "")
    if machine.accounts:
        ledger = machine.ledger(states, machine.ledger(states[0], 0.0).energy)
        absurd = np.flatnonzero(ledger.absurd(machine.scale))
        if absurd.size:
            states, reason = states[: absurd[0] + 1], "diverged"
    return states, reason
