"""What a program reports of a state: observation, angle from upright, energy ledger and other diagnostics. Templates.

The functions are spliced into ``run``, and into the loops over blocks of environments: their variables, such as
``r_work`` for the entry "work" of ``info``, are those of a program. Tuples are those of
:mod:`pendulum_env.engine.advance`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from pendulum_env.engine import wrap
from pendulum_env.engine.advance import State, total
from pendulum_env.engine.shape import DIVERGED, LEFT_OUT, SLACK, Floats, Function, Shape
from pendulum_env.engine.source import Plain
from pendulum_env.engine.specialise import spliced
from pendulum_env.engine.wrap import half_turns, left_out, side_of, without_half_turns
from pendulum_env.physics import elementary, energy
from pendulum_env.physics.elementary import cos, cos_near_zero, sin, sin_near_zero
from pendulum_env.physics.energy import beyond_sense, residual_of

SEEN = ("cosine", "sine", "rate")
"""Local names of the entries of the observation."""

FASTEST = 3.4028234663852886e+38
"""Largest float32, the bound of the observed velocity."""

RESOLVED = 1.6
"""Bound of the reduced angle [rad], above pi/2.

Without it, the reduced angle of a huge angle, which has no fractional digits, could be anything.
"""

CALLED: tuple[Plain, ...] = (
    elementary.sin, elementary.cos, elementary.sin_near_zero, elementary.cos_near_zero, wrap.half_turns,
    wrap.without_half_turns, wrap.without_half_turns_kept, wrap.side_of, wrap.left_out,
    energy.residual_of, energy.beyond_sense,
)
"""Plain functions that the generated reports and the steps between them call."""


class Numbers(NamedTuple):
    """Parameters of a program for single runs.

    Attributes:
        parameters: the effects' coefficients.
        inertia: moment of inertia [kg m²].
        scale: ``m g L`` [J].
        pulls: PULL of :mod:`pendulum_env.engine.shape`, or nothing; ``flow`` is FLOW.
        hold: number of steps per control step, in scenes whose effects have a state.
        tolerance: the tolerances of adaptive steps, and ``attempts`` the number of attempts that one call may make.
    """

    parameters: Floats
    inertia: float
    scale: float
    pulls: Floats
    flow: Floats
    hold: Floats
    tolerance: Floats
    attempts: Floats


class Places(NamedTuple):
    """Places among the sums: of the work, of all heats, and of those that are reported one by one."""

    work: tuple[int, ...]
    heats: tuple[int, ...]
    told: tuple[int, ...]


class Watch(NamedTuple):
    """The diagnostics "tension" and "flow": the quantities asked for, and the program's functions for them."""

    asked: tuple[str, ...]
    tension: Function
    relative_speed: Function
    bottom_speed: Function
    quality: Function


@spliced
def observed(bob: State) -> tuple[float, float, float, float]:
    """Return the observation, and ``phi``, the angle from upright in [-pi, pi].

    The sine of half the angle is used, because the gravitational potential needs it too: the compiler computes it only
    once. Where the angle is wrapped, its half needs no reduction.
    """
    if bob.winding:
        tilt = bob.q
        side = bob.winding[1]
        half = sin_near_zero(0.5*tilt, 0.0)
        cosine = side*(1.0 - 2.0*half*half)
        sine = side*(2.0*half*cos_near_zero(0.5*tilt, 0.0))
    else:
        halves = half_turns(bob.q)
        tilt = without_half_turns(bob.q, halves)
        tilt = tilt if tilt < RESOLVED else RESOLVED
        tilt = tilt if tilt > -RESOLVED else -RESOLVED
        side = side_of(0.5*halves)
        half = sin(0.5*tilt)
        cosine = side*(1.0 - 2.0*half*half)
        sine = side*(2.0*half*cos(0.5*tilt))
    rate = bob.v if bob.v < FASTEST else FASTEST
    rate = rate if rate > -FASTEST else -FASTEST
    phi = tilt if side < 0.0 else (tilt - 3.141592653589793 if tilt > 0.0 else tilt + 3.141592653589793)
    return cosine, sine, rate, phi


@spliced
def stored(bob: State, parameters: Floats, *, potential: Function) -> Any:
    """Return the potential energy per moment of inertia [1/s²]; the angle of a state is wrapped."""
    if bob.winding:
        r_stored = potential(bob.q, sin_near_zero(0.5*bob.q, 0.0), parameters, bob.winding[1:])
    else:
        r_stored = potential(bob.q, parameters)
    return r_stored


@spliced
def place(bob: State, turns: float) -> tuple[float, float]:
    """Return the unwrapped angle [rad] and the velocity."""
    r_angle = bob.q + 6.283185307179586*turns
    r_velocity = bob.v
    return r_angle, r_velocity


@spliced
def energies(bob: State, inertia: float, r_stored: float) -> tuple[float, float, float]:
    """Return the kinetic, potential and total energy [J]."""
    r_kinetic_energy = inertia*(0.5*bob.v*bob.v)
    r_potential_energy = inertia*r_stored
    r_energy = r_kinetic_energy + r_potential_energy
    return r_kinetic_energy, r_potential_energy, r_energy


@spliced
def balance(
    bob: State, inertia: float, r_energy: float, initial: float, *, places: Places
) -> tuple[float, float, float]:
    """Return work, heat and energy residual [J]."""
    r_work = inertia*bob.sums[places.work[0]] if places.work else 0.0
    r_heat = total((0.0, *(inertia*bob.sums[i] for i in places.heats)))
    r_energy_residual = residual_of(r_energy, initial, r_work, r_heat)
    return r_work, r_heat, r_energy_residual


@spliced
def remainders(bob: State, turns: float, r_angle: float) -> tuple[float, float]:
    """Return the rounding remainders of angle and velocity, with compensated summation."""
    r_lost_angle = left_out(r_angle, bob.q, bob.lost[0], turns)
    r_lost_velocity = bob.lost[1]
    return r_lost_angle, r_lost_velocity


@spliced
def diagnosed(
    index: float, h: float, bob: State, further: Floats, numbers: Numbers, *, places: Places, watch: Watch
) -> Floats:
    """Return the heats of single effects [J], and the diagnostics "tension" and "flow"."""
    r_heats = tuple(numbers.inertia*bob.sums[i] for i in places.told)
    r_watched = watched(index, h, bob, further, numbers, watch=watch)
    return (*r_heats, *r_watched)


@spliced
def watched(index: float, h: float, bob: State, further: Floats, numbers: Numbers, *, watch: Watch) -> Floats:
    """Return the diagnostics "tension" and "flow"; see :data:`pendulum_env.engine.shape.WATCHED`."""
    parameters, side = numbers.parameters, bob.winding[1:]
    return tuple(
        numbers.pulls[2]*watch.tension(index*h, bob.q, bob.v, parameters, side, further, numbers.pulls[:2])
        if one == "tension" else
        numbers.flow[0]*watch.relative_speed(index*h, bob.q, bob.v, parameters, side, further)
        if one == "reynolds" else
        numbers.flow[1]*watch.bottom_speed(bob.q, bob.v, parameters, side)
        if one == "keulegan_carpenter" else
        watch.quality(watch.bottom_speed(bob.q, bob.v, parameters, side), parameters, numbers.flow[2])
        for one in watch.asked)


@spliced
def judged(stop: float, r_energy_residual: float, scale: float, initial: float, r_work: float) -> float:
    """Return the stop code: DIVERGED if the energy residual is absurdly large, though finite."""
    return DIVERGED if beyond_sense(r_energy_residual, scale, initial, r_work) & (stop <= SLACK) else stop


FOLLOWING = ("time", "energy", "energy_residual")
"""Entries of an energy ledger that follow from the others and are therefore not recorded."""


def names_recorded(shape: Shape) -> tuple[str, ...]:
    """Return the names of the quantities that a run of a batch records, without those that follow from others."""
    motion = ("angle", "velocity", "kinetic_energy", "potential_energy", *(LEFT_OUT if shape.compensated else ()))
    named = shape.info if shape.ledger else (*motion, *shape.info)
    return tuple(name for name in named if name not in FOLLOWING)


def info(shape: Shape) -> str:
    """Write the source of ``info``, which returns the reported quantities in a state vector as a dict by name."""
    items = ", ".join(f'"{name}": values[{i}]' for i, name in enumerate(shape.state) if i > shape.phi)
    return f"def info(values):\n    return {{{items}}}\n"
