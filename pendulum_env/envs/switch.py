"""Change of an environment's integrator in the middle of an episode."""

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
"""Entries of a state that are not carried over to another method."""
HALF = "half_"
"""Prefix of the entries of a state that belong to a second run at half the step."""


def following(machine: Machine, by: int) -> Machine | None:
    """Return a simulation (machine) with another method, ``by`` places later in the list of methods that fit the scene.

    Methods that do not support the machine's tolerance or compensation are skipped. None if no other method fits.
    """
    names = list(fitting(machine.scene))
    if machine.method.name not in names:
        names.append(machine.method.name)
    place, way = names.index(machine.method.name), 1 if by > 0 else -1
    kind, arguments = machine.__reduce__()
    for steps in range(abs(by), len(names)):
        name = names[(place + way * steps) % len(names)]
        if name == machine.method.name:
            break
        try:
            return kind(arguments[0], name, *arguments[2:])
        except MethodError:  # the method has no error estimate for the tolerance, or no compensated form
            continue
    return None


def carried(old: Machine, values: Sequence[float], new: Machine, share: float, h: float) -> Any:
    """Convert the state of a simulation with one method to the form that another method needs, without rounding.

    Energies, work and heat are carried over. The history of a multistep method begins at this state. An error estimate
    is inf from then on, because no estimate exists for a mixture of two methods.

    Args:
        old, values: simulation (machine) that has run so far, and its complete state.
        new: simulation with the new method, for the same scene and diagnostics.
        share: fraction of the motor's torque with which the history of a multistep method is computed.
        h: step [s].
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
    """Write the first history of a multistep method into a state, computed as at the start of a run.

    ``prefix`` is "" for the run and "half_" for a second run at half the step.
    """
    code = program(machine.scene, machine.method, reported(machine.diagnostics), bool(machine.tolerance),
                   machine.compensated)
    shape = code.shape
    if not shape.memory or shape.remembered:
        return
    first = machine.names.index(f"{prefix}index")
    index, angle, turns, velocity = (float(state[first + place]) for place in (INDEX, ANGLE, TURNS, VELOCITY))
    numbers = dict(zip(machine.numbers, map(float, machine.parameters), strict=True))
    numbers |= {"side": side_of(turns), "control": share}
    begin = interpreted(code.text, code.title)["begin"]
    values = begin(index * h, angle, velocity, h, *(numbers[name] for name in shape.extra))
    memory = values if isinstance(values, tuple) else (values,)
    for name, value in (("held", share), *zip(shape.memory, memory, strict=True)):
        state[machine.names.index(prefix + name)] = float(value)
