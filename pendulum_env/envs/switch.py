"""Another integrator for an environment, from the state it is in."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from integrators import MethodError
from pendulum_env.engine.certificate import ESTIMATE
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, VELOCITY, Machine, fitting, reported
from pendulum_env.engine.wrap import side_of

ANEW = ("size",)
"""Entries of a state that one method cannot hand on to another."""
HALF = "half_"


def following(machine: Machine, by: int) -> Machine | None:
    """Return a machine of the method that comes so many places later among those that fit scene and options.

    None if no other fits.
    """
    names = list(fitting(machine.scene))
    if machine.method.name not in names:
        names.append(machine.method.name)
    place, way = names.index(machine.method.name), 1 if by > 0 else -1
    kind, given = machine.__reduce__()
    for steps in range(abs(by), len(names)):
        name = names[(place + way * steps) % len(names)]
        if name == machine.method.name:
            break
        try:
            return kind(given[0], name, *given[2:])
        except MethodError:  # has no estimate for the tolerance, or no compensated form
            continue
    return None


def carried(old: Machine, values: Sequence[float], new: Machine, share: float, h: float) -> Any:
    """Return a machine's state in the form of another method's machine: bit for bit, the ledger included.

    What the new method remembers of its past begins at this state. An error estimate is inf from here on, as nothing
    is known of a mixture of two methods.

    Args:
        old, values: the machine that has run, and its whole state.
        new: of the same scene and diagnostics.
        share: of the motor's torque, under which memory begins.
        h: the step [s].
    """
    known = dict(zip(reversed(old.names), reversed(values), strict=True))
    state = new.array(0.0 if name.removeprefix(HALF) in ANEW else known.get(name, 0.0) for name in new.names)
    for prefix, step in (("", h), (HALF, 0.5 * h)):
        if f"{prefix}angle" in new.names:
            _begin(new, state, prefix, share, step)
    if ESTIMATE in new.names:
        state[new.names.index(ESTIMATE)] = math.inf
    new.advance(state, share, h, 0)
    return state


def _begin(machine: Machine, state: Any, prefix: str, share: float, h: float) -> None:
    """Begin a method's memory, as its program does at a start: with the program's own function, interpreted."""
    made = program(machine.scene, machine.method, reported(machine.diagnostics), bool(machine.tolerance),
                   machine.compensated)
    shape = made.shape
    if not shape.memory or shape.remembered:
        return
    first = machine.names.index(f"{prefix}index")
    index, angle, turns, velocity = (float(state[first + place]) for place in (INDEX, ANGLE, TURNS, VELOCITY))
    numbers = dict(zip(machine.numbers, map(float, machine.parameters), strict=True))
    numbers |= {"side": side_of(turns), "control": share}
    begin = interpreted(made.text, made.title)["begin"]
    values = begin(index * h, angle, velocity, h, *(numbers[name] for name in shape.extra))
    memory = values if isinstance(values, tuple) else (values,)
    for name, value in (("held", share), *zip(shape.memory, memory, strict=True)):
        state[machine.names.index(prefix + name)] = float(value)
