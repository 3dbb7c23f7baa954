"""Change of an environment's integrator in the middle of an episode."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from integrators import MethodError
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import Backend, interpreted
from pendulum_env.engine.machine import ANGLE, INDEX, TURNS, VELOCITY, Machine, fitting
from pendulum_env.engine.result import ESTIMATE
from pendulum_env.engine.wrap import side_of

ANEW = ("size",)
"""Entries of a state that are not carried over to another method."""
HALF = "half_"
"""Prefix of the entries of a state that belong to a second run at half the step."""


INTERPRETED = 5e-4
"""Shortest step [s] with which interpreted steps keep up with the clock of a window."""


def following(machine: Machine, to: str | int, backend: Backend, h: float) -> Machine | None:
    """Return a simulation (machine) with another method: that named ``to``, or that ``to`` places later in the list.

    The list holds the methods that fit the scene; those that do not support the machine's tolerance or compensation are
    skipped. None if the named method already runs, or if no other method fits. The backend is ``backend``. But a window
    shall not stand still while a method is compiled: one that is not compiled yet is interpreted, with the same bits,
    unless the step ``h`` [s] is too short for that.

    Raises MethodError for a named method that does not fit the scene, the tolerance or the compensation.
    """
    kind, arguments = type(machine), machine.arguments

    def simulation(name: str) -> Machine:
        made = kind(arguments[0], name, arguments[2], backend, *arguments[4:])
        return made if made.ready or h < INTERPRETED else kind(arguments[0], name, arguments[2], "python",
                                                               *arguments[4:])

    if isinstance(to, str):
        return None if to == machine.method.name else simulation(to)
    names = list(fitting(machine.scene))
    if machine.method.name not in names:
        names.append(machine.method.name)
    place, way = names.index(machine.method.name), 1 if to > 0 else -1
    for steps in range(abs(to), len(names)):
        name = names[(place + way * steps) % len(names)]
        if name == machine.method.name:
            break
        try:
            return simulation(name)
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
    code = program(machine.scene, machine.method, machine.diagnostics, bool(machine.tolerance), machine.compensated)
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
