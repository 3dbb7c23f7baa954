"""The loop over the steps of a single run: the template of ``run``."""

from __future__ import annotations

from typing import Any, NamedTuple

from pendulum_env.engine.advance import State
from pendulum_env.engine.report import (
    Numbers,
    Places,
    Watch,
    balance,
    diagnosed,
    energies,
    judged,
    observed,
    place,
    remainders,
    stored,
    watched,
)
from pendulum_env.engine.shape import DIVERGED, OK, PAUSED, TOO_SHORT, UNSURE, Floats, Function
from pendulum_env.engine.specialise import spliced
from pendulum_env.engine.wrap import side_of

Spans = tuple[tuple[int, int], ...]
"""Where parts of an array begin and end."""


class Arrays(NamedTuple):
    """Where the values of a run stand in its arrays.

    Attributes:
        params: the parts of :class:`Numbers`; inertia and scale are one.
        state: sums and rounding remainders, after STATE.
        kept: the initial energy, and what else only the program reads; see :class:`pendulum_env.engine.shape.Shape`.
        phi: place of the angle from upright; the reported quantities follow it.
        paused: place among ``params`` at which an adaptive step stores its progress.
        steered: True if torques take the action, and ``acting`` tells which of the effects' state variables they take.
    """

    params: Spans
    state: Spans
    kept: Spans
    phi: int
    paused: int
    steered: bool
    acting: tuple[int, ...]


def run(
    state: Any, params: Any, control: float, h: float, rows: int, every: int, speed_limit: float, out: Any, seen: Any,
    *, advance: Function, settle: Function, begin: Function, remember: Function, potential: Function, arrays: Arrays,
    places: Places, watch: Watch, periodic: bool, multistep: bool, remembers: bool, adaptive: bool,
    slack: bool, ends_slack: bool, accounts: bool, ledger: bool,
) -> int:
    """Take ``rows`` times ``every`` steps, and return the stop code. Python calls this function.

    It advances the state in place; the state keeps its last finite values. The reported quantities are written to its
    last entries and the observation to ``seen``, three float32; with an empty ``seen`` neither is computed. ``out``, an
    array of ``rows + 1`` rows, receives the initial state, the state after every ``every`` steps, and the state at a
    stop; with an empty ``out`` nothing is recorded. :mod:`pendulum_env.engine.pieces` divides long runs into several
    calls of ``run``.
    """
    parameters, own, pulls, flow, hold, tolerance, attempts = (
        tuple(params[first:last]) for first, last in arrays.params)
    inertia, scale = own
    numbers = Numbers(parameters, inertia, scale, pulls, flow, hold, tolerance, attempts)
    index, q, turns, v = state[:4]
    sums, lost = (tuple(state[first:last]) for first, last in arrays.state)
    winding = (turns, side_of(turns)) if periodic else ()
    initial = state[arrays.kept[0][0]]
    r_stored = stored(State(q, winding, v, (), lost, sums, (), ()), parameters, potential=potential)
    if index == 0.0:
        initial = inertia*(0.5*v*v) + inertia*r_stored
    held, memory, lost_sums, adapted, slackened, effects, phase = (
        tuple(state[first:last]) for first, last in arrays.kept[1:])
    bob = State(q, winding, v, memory, lost, sums, lost_sums, slackened)
    if adaptive:
        size, taken, rejected = adapted
        bound = taken + rejected + attempts[0]
        if params[arrays.paused] > 0.0:
            bound = bound + params[arrays.paused + 5] + params[arrays.paused + 6]
    if multistep and not remembers and (
            (index == 0.0) | (held[0] != control) if arrays.steered else index == 0.0) and rows*every > 0:
        memory, held = restarted(index, h, bob, parameters, control, effects, begin, arrays)
        bob = bob._replace(memory=memory)
    pull = pulls[:2] if slack else ()
    stop: float = OK
    records = len(out) > 0
    if records:
        outer = outside(control, effects, arrays)
        write(out, 0, recorded(index, h, bob, turns, r_stored, outer, numbers, watch))
    if accounts and records and rows == 0:
        stop = audited(stop, bob, numbers, r_stored, initial, places)
    for row in range(rows):
        before = index
        for _ in range(every):
            if remembers and (params[arrays.paused] <= 0.0 if adaptive else True):
                effects, phase, bob, held = at_control_step(
                    index, h, bob, numbers, control, effects, phase, held, remember, begin, multistep, arrays)
            outer = outside(control, effects, arrays)
            if adaptive:
                stop, bob1, size, taken, rejected, portion = advance(
                    index*h, h, speed_limit, bob, size, taken, rejected, bound, params, tolerance, parameters,
                    outer, pull)
                if stop == DIVERGED or stop == TOO_SHORT or stop == PAUSED:  # noqa: SIM109
                    break
            else:
                stop, bob1 = advance(index*h, h, speed_limit, bob, parameters, outer, pull)
                if slack:
                    portion = (1.0,) if ends_slack else ()
                    if stop == UNSURE:
                        stop, bob1, portion = settle(index*h, h, speed_limit, bob, parameters, outer, pull)
                if stop == DIVERGED:
                    break
            bob = bob1
            index = index + (portion[0] if ends_slack else 1.0)
            if stop != 0.0:
                break
        if records and index > before and (stop != PAUSED if adaptive else True):
            turns = bob.winding[0] if periodic else turns
            r_stored = stored(bob, parameters, potential=potential)
            outer = outside(control, effects, arrays)
            write(out, row + 1, recorded(index, h, bob, turns, r_stored, outer, numbers, watch))
            if accounts:
                stop = audited(stop, bob, numbers, r_stored, initial, places)
        if stop != 0.0:
            break
    turns = bob.winding[0] if periodic else turns
    r_stored = stored(bob, parameters, potential=potential)
    outer = outside(control, effects, arrays)
    values = recorded(index, h, bob, turns, r_stored, outer, numbers, watch)
    adapted = (size, taken, rejected) if adaptive else ()
    for i, value in enumerate((*values, initial, *held, *bob.memory, *bob.lost_sums, *adapted, *bob.slackened, *effects,
                               *phase)):
        state[i] = value
    if len(seen) > 0:
        stop, cosine, sine, rate, phi, told = reported(
            stop, index, h, bob, turns, r_stored, initial, outer, numbers, places, watch, ledger)
        for i, value in enumerate((phi, *told)):
            state[arrays.phi + i] = value
        for i, value in enumerate((cosine, sine, rate)):
            seen[i] = value
    return int(stop)


@spliced
def write(out: Any, row: int, values: Floats) -> None:
    """Write values into a row of an array."""
    for i, value in enumerate(values):
        out[row, i] = value


@spliced
def outside(control: float, effects: Floats, arrays: Arrays) -> Floats:
    """Return what torques take beside parameters and side: the action, and state variables of effects."""
    return (*((control,) if arrays.steered else ()), *(effects[i] for i in arrays.acting))


@spliced
def restarted(
    index: float, h: float, bob: State, parameters: Floats, control: float, effects: Floats, begin: Function,
    arrays: Arrays,
) -> tuple[Floats, Floats]:
    """Return a multistep method's first history, and the action for which it was computed."""
    memory = begin(index*h, bob.q, bob.v, h, parameters, bob.winding[1:], outside(control, effects, arrays))
    held = (control,)
    return memory, held


@spliced
def at_control_step(
    index: float, h: float, bob: State, numbers: Numbers, control: float, effects: Floats, phase: Floats, held: Floats,
    remember: Function, begin: Function, multistep: bool, arrays: Arrays,
) -> tuple[Floats, Floats, State, Floats]:
    """Advance the effects' state variables, such as gusts, once per control step."""
    if phase[0] == 0.0:
        first = 1.0 if index == 0.0 else 0.0
        effects1 = tuple(remember(effects, control, first, numbers.hold[0]*h, numbers.parameters))
        effects = effects1
        if multistep:
            memory, held = restarted(index, h, bob, numbers.parameters, control, effects, begin, arrays)
            bob = bob._replace(memory=memory)
    phase = (phase[0] + 1.0,)
    phase = (phase[0] if phase[0] < numbers.hold[0] else 0.0,)
    return effects, phase, bob, held


@spliced
def recorded(
    index: float, h: float, bob: State, turns: float, r_stored: float, further: Floats, numbers: Numbers,
    watch: Watch,
) -> Floats:
    """Return the recorded values."""
    return (index, bob.q, turns, bob.v, 0.5*bob.v*bob.v, r_stored, *bob.sums, *bob.lost,
            *watched(index, h, bob, further, numbers, watch=watch))


@spliced
def audited(stop: float, bob: State, numbers: Numbers, r_stored: float, initial: float, places: Places) -> float:
    """Return the stop code: a run ends if the energy residual of a recorded state is absurdly large."""
    _, _, r_energy = energies(bob, numbers.inertia, r_stored)
    r_work, _, r_energy_residual = balance(bob, numbers.inertia, r_energy, initial, places=places)
    return judged(stop, r_energy_residual, numbers.scale, initial, r_work)


@spliced
def reported(
    stop: float, index: float, h: float, bob: State, turns: float, r_stored: float, initial: float, further: Floats,
    numbers: Numbers, places: Places, watch: Watch, ledger: bool,
) -> tuple[float, float, float, float, float, Floats]:
    """Return the stop code, the observation, the angle from upright and the other reported quantities."""
    cosine, sine, rate, phi = observed(bob)
    told: Floats = ()
    if ledger:
        r_time = index*h
        r_angle, r_velocity = place(bob, turns)
        r_kinetic_energy, r_potential_energy, r_energy = energies(bob, numbers.inertia, r_stored)
        r_work, r_heat, r_energy_residual = balance(bob, numbers.inertia, r_energy, initial, places=places)
        told = (r_time, r_angle, r_velocity, r_kinetic_energy, r_potential_energy, r_energy, r_work, r_heat,
                r_energy_residual)
        if bob.lost:
            told = (*told, *remainders(bob, turns, r_angle))
    told = (*told, *diagnosed(index, h, bob, further, numbers, places=places, watch=watch))
    if ledger:
        stop = judged(stop, r_energy_residual, numbers.scale, initial, r_work)
    return stop, cosine, sine, rate, phi, told
