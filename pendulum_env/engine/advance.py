"""One checked step: templates of ``advance``, ``stick_slip``, ``resting``, ``adapt``, ``adapt_evenly`` and ``land``.

A program integrates one scene by one method. Single runs, environments and blocks of environments (see
:mod:`pendulum_env.engine.blocks`) all call its function ``advance``. The functions here run as they stand;
:mod:`pendulum_env.engine.specialise` makes a program's functions of them. Their tuples hold what only some scenes and
methods have:

===================  =================================================================================================
``winding``           whole or half turns, and +1 or -1 for the side of the horizontal, where torques repeat
``memory``           a multistep method's history
``lost``             rounding remainders of angle and velocity; ``lost_sums`` those of the sums
``given``            what a step takes beside the motion and ``memory``: ``lost``, or in adaptive steps ``a, *rates``
``sums``             work and heat since the start of a run, and ``integrals`` since the start of a step
``parts``            work and heat of a step; ``rates`` those per time
``slackened``        1 plus the number of steps when the wire went slack, if the run continues (``lenient``)
``parameters``       the effects' coefficients; ``further`` the action and the effects' state variables
``extra``            ``(*parameters, side, *further)``: what torques take beside time, angle and velocity
``pull``             the two parameters of the pull on a wire that may go slack
``errors``           error estimates of angle and velocity, alternately, of one or two embedded methods
===================  =================================================================================================

A step of a method, ``take``, gets ``t, q, v, memory, given, h, extra`` and returns :class:`After`. Functions of a
program take and return flat numbers, so that ``stick_slip``, which has no memory and no errors, serves as ``take``; to
call a template with them, nest what they return as ``Plain`` in tests/engine/test_templates.py does.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from integrators.solving.step_size import (
    BROKEN,
    GROW,
    SHRINK,
    ratio_powers,
    step_power,
    step_power_of_many,
    step_ratio,
)
from integrators.steps.compensated import added
from pendulum_env.engine.shape import (
    DIVERGED,
    LARGEST,
    OK,
    PAUSED,
    SINE_RANGE,
    SLACK,
    SPEED_LIMIT,
    TOO_SHORT,
    UNSURE,
    Floats,
    Function,
)
from pendulum_env.engine.source import Plain
from pendulum_env.engine.specialise import spliced
from pendulum_env.engine.wrap import half_turns, side_of, without_half_turns, without_half_turns_kept
from pendulum_env.physics.elementary import sin

CALLED: tuple[Plain, ...] = (step_power, step_power_of_many, ratio_powers, step_ratio)
"""Functions that generated adaptive steps call."""

EVEN_AIM = 0.8
"""Largest error of a step, in units of the tolerance, at which steps of equal length aim."""
MOST_EVEN = 16777216.0
"""Largest number of equal steps that an interval is divided into; with more, steps are too short."""


@spliced
def total(values: Floats) -> float:
    """Return the sum of at least one number, from left to right."""
    return values[0] if len(values) == 1 else total(values[:-1]) + values[-1]


@spliced
def plus(sums: Floats, parts: Floats) -> Floats:
    """Return sums with a step's parts added."""
    return tuple(one + part for one, part in zip(sums, parts, strict=True))


# --- one step ---------------------------------------------------------------------------------------------------------


class State(NamedTuple):
    """What a step changes; see the table above."""

    q: float
    winding: Floats
    v: float
    memory: Floats
    lost: Floats
    sums: Floats
    lost_sums: Floats
    slackened: Floats


class After(NamedTuple):
    """What a step of a method returns: motion, what it hands to the next step, work and heat, and its errors."""

    q: float
    v: float
    memory: Floats
    given: Floats
    parts: Floats
    errors: Floats


class Clip(NamedTuple):
    """A bound of the velocity after every step.

    Attributes:
        bound: the largest velocity [rad/s].
        drift: fraction of h by which the last sub-flow of a splitting, a drift, turns the rod; 0 if there is none.
        counts: True if the energy that the clip takes is reported.
    """

    bound: float
    drift: float
    counts: bool


def advance(
    t: float, h: float, speed_limit: float, bob: State, parameters: Floats, further: Floats, pull: Floats, *,
    take: Function, taut: Function, potential: Function, clip: Clip | None, slack: bool,
) -> tuple[Any, State]:
    """Return the stop code (0.0 if the run continues) and the state after one step.

    The step of length ``h`` from the time ``t`` checks whether the run has to stop: divergence, the speed limit, a
    slack wire. With the code DIVERGED the state is not valid, and the loop that called ``advance`` keeps that from
    before the step. With UNSURE the loop calls ``settle`` in place of ``advance``.
    """
    extra = (*parameters, *bob.winding[1:], *further)
    after = take(t, bob.q, bob.v, bob.memory, bob.lost, h, extra)
    return checked(t, h, speed_limit, bob, parameters, extra, pull, after, taut=taut, potential=potential, clip=clip,
                   slack=slack)


@spliced
def checked(
    t: float, h: float, speed_limit: float, bob: State, parameters: Floats, extra: Floats, pull: Floats, after: After,
    *, taut: Function, potential: Function, clip: Clip | None, slack: bool,
) -> tuple[Any, State]:
    """Check the end of a step of fixed length, and return the stop code and the new bob."""
    q1, v1, memory1, lost1, changes, _ = after
    good = finite(q1, v1, changes, bob.winding)
    if clip:
        q1, v1, lost1, changes = clipped(h, bob.winding, parameters, q1, v1, lost1, changes, clip, potential)
    if slack and bob.slackened:
        sure = (bob.slackened[0] > 0.0) | taut(t, bob.q, bob.v, q1, v1, h, extra, pull)
    elif slack:
        sure = taut(t, bob.q, bob.v, q1, v1, h, extra, pull)
    q1, winding1, lost1 = wrapped(q1, bob.winding, lost1)
    sums1, lost_sums1 = summed(bob.sums, bob.lost_sums, changes)
    stop = SPEED_LIMIT if abs(v1) > speed_limit else 0.0
    slackened1 = bob.slackened
    if slack:
        stop = stop if sure else UNSURE
    stop = stop if good else DIVERGED
    return stop, State(q1, winding1, v1, memory1, lost1, sums1, lost_sums1, slackened1)


@spliced
def finite(q1: float, v1: float, parts: Floats, winding: Floats) -> bool:
    """Return True if the end of a step is finite, and its angle one whose sine is accurate."""
    return ((abs(v1) <= LARGEST) & (abs(q1) <= (SINE_RANGE if winding else LARGEST))
            & (abs(total(parts)) <= LARGEST if parts else True))


@spliced
def clipped(
    h: float, winding: Floats, parameters: Floats, q1: float, v1: float, lost1: Floats, parts: Floats, clip: Clip,
    potential: Function,
) -> tuple[float, float, Floats, Floats]:
    """Return the motion after a clip of the velocity, and the step's work and heat with the energy that it takes.

    A last drift of the step is taken back by the part that the velocity loses.
    """
    free_q = q1
    free_v = v1
    v1 = max(-clip.bound, min(clip.bound, free_v))
    if clip.drift:
        q1 = free_q - clip.drift*h*(free_v - v1)
    if lost1:
        lost1 = (lost1[0], lost1[1] if v1 == free_v else 0.0)
    if not clip.counts:
        return q1, v1, lost1, parts
    if clip.drift:
        d_heat_clip = 0.5*(free_v - v1)*(free_v + v1) + (
            height(free_q, winding, parameters, potential) - height(q1, winding, parameters, potential))
    else:
        d_heat_clip = 0.5*(free_v - v1)*(free_v + v1)
    return q1, v1, lost1, (*parts, d_heat_clip)


@spliced
def height(q: float, winding: Floats, parameters: Floats, potential: Function) -> Any:
    """Return the potential energy per moment of inertia at an angle that is not wrapped."""
    return potential(q, sin(0.5*q), parameters, winding[1:]) if winding else potential(q, parameters)


@spliced
def wrapped(q1: float, winding: Floats, lost1: Floats) -> tuple[float, Floats, Floats]:
    """Return the angle from the nearer of bottom and top, with its turns and its side, where torques repeat."""
    if not winding:
        return q1, (), lost1
    halves = half_turns(q1)
    if lost1:
        q1, lost_q1 = without_half_turns_kept(q1, lost1[0], halves)
        lost1 = (lost_q1, lost1[1])
    else:
        q1 = without_half_turns(q1, halves)
    turns1 = winding[0] + 0.5*halves
    side1 = side_of(turns1)
    return q1, (turns1, side1), lost1


@spliced
def summed(sums: Floats, lost_sums: Floats, changes: Floats) -> tuple[Floats, Floats]:
    """Return work and heat after a step, and their rounding remainders with compensated summation."""
    if not lost_sums:
        return plus(sums, changes), ()
    totals = tuple(added(one, rest, part, 0.0) for one, rest, part in zip(sums, lost_sums, changes, strict=True))
    return tuple(one for one, _ in totals), tuple(rest for _, rest in totals)


# --- dry friction -----------------------------------------------------------------------------------------------------


def stick_slip(
    t: float, q: float, v: float, lost: Floats, h: float, extra: Floats, *,
    step: Function, acceleration: Function, resting: Function, limit: float, count: int, timed: bool, held: bool,
) -> tuple[Any, ...]:
    """Return the state after a step under dry friction, cut at zeros of the velocity, with work and heat.

    Methods without sub-flows take it. Between zeros the direction of the friction is fixed and the problem is smooth.
    At a zero the bob sticks if the sum of all other torques is within the ``limit`` of the friction; otherwise it
    slides in the direction of this sum. If torques depend on the time (``timed``), the time at which a sticking bob
    breaks away is found by bisection; a larger torque for a shorter time within the step is overlooked. In moving air
    (``held``) the ``count`` sums of work and heat grow while the bob is at rest. If the velocity changes its sign more
    than 64 times in one step, the run ends as "diverged", because the rest of the step was not computed.
    """
    integrals = (0.0,)*count
    left = h
    for _ in range(64):
        direction = 1.0 if v > 0.0 else -1.0
        if v == 0.0:
            other = acceleration(t, q, 0.0, extra, 0.0)
            if abs(other) <= limit:
                if not timed:
                    if held:
                        parts = tuple(resting(t, q, left, extra))
                        integrals = plus(integrals, parts)
                    break
                other = acceleration(t + left, q, 0.0, extra, 0.0)
                if not abs(other) > limit:
                    if held:
                        parts = tuple(resting(t, q, left, extra))
                        integrals = plus(integrals, parts)
                    break
                low = 0.0
                high = left
                for _ in range(100):
                    part = 0.5*(low + high)
                    if part <= low or part >= high:
                        break
                    other = acceleration(t + part, q, 0.0, extra, 0.0)
                    if abs(other) > limit:
                        high = part
                    else:
                        low = part
                if held:
                    parts = tuple(resting(t, q, high, extra))
                    integrals = plus(integrals, parts)
                t = t + high
                left = left - high
                if left <= 0.0:
                    break
                other = acceleration(t, q, 0.0, extra, 0.0)
            direction = 1.0 if other > 0.0 else -1.0
        q1, v1, lost1, parts = step(t, q, v, lost, left, extra, direction)
        turned = direction*v1 < 0.0
        part = left
        if turned:
            high = left
            low = 0.5*left
            q1, v1, lost1, parts = step(t, q, v, lost, low, extra, direction)
            for _ in range(60):
                if not direction*v1 < 0.0:
                    break
                high = low
                low = 0.5*low
                q1, v1, lost1, parts = step(t, q, v, lost, low, extra, direction)
            for _ in range(100):
                part = 0.5*(low + high)
                if part <= low or part >= high:
                    break
                q1, v1, lost1, parts = step(t, q, v, lost, part, extra, direction)
                if direction*v1 < 0.0:
                    high = part
                else:
                    low = part
            part = high
            q1, v1, lost1, parts = step(t, q, v, lost, part, extra, direction)
            v1 = 0.0
            if lost1:
                lost1 = (lost1[0], 0.0)
        q = q1
        v = v1
        lost = lost1
        integrals = plus(integrals, parts)
        if not turned:
            break
        t = t + part
        left = left - part
        if left <= 0.0:
            break
    else:
        v = 1e999 - 1e999
    return q, v, lost, integrals


GAUSS = (
    (0.046910077030668004, 0.11846344252809454), (0.23076534494715845, 0.23931433524968324),
    (0.5, 0.28444444444444444), (0.7692346550528415, 0.23931433524968324), (0.953089922969332, 0.11846344252809454),
)
"""Nodes and weights of Gauss's quadrature with five nodes on (0, 1), exact for powers up to the ninth."""


def resting(
    t: float, q: float, h: float, extra: Floats, *, rates: Function, nodes: tuple[tuple[float, float], ...]
) -> Floats:
    """Return work and heats, over a time ``h``, of a bob that dry friction holds at rest in moving air.

    The air does work on the held bob, and the drag turns this work into heat. Both grow at the rates for velocity zero,
    which are integrated by Gauss's rule with five nodes where they depend on the time.
    """
    at_rest = tuple(rates(t + node*h, q, 0.0, extra, 0.0) for node, _ in nodes)
    powers = zip(*(rates for _, rates in at_rest), strict=True)
    return tuple(h*total(tuple(weight*power for (_, weight), power in zip(nodes, one, strict=True))) for one in powers)


# --- adaptive steps ---------------------------------------------------------------------------------------------------


class Progress(NamedTuple):
    """Progress of adaptive steps over h.

    It is the time ``done``, the error of the ``last`` attempt, how much the next may grow at ``most``, the ``size`` to
    try, the numbers of attempts, the motion, work and heat, and in ``loose`` the time after which the wire is slack, or
    -1.
    """

    done: float
    last: float
    most: float
    size: float
    taken: float
    rejected: float
    q: float
    v: float
    a: float
    rates: Floats
    integrals: Floats
    loose: Floats


def advance_adaptively(
    t: float, h: float, speed_limit: float, bob: State, size: float, taken: float, rejected: float, bound: float,
    params: Any, rtol: float, atol: float, parameters: Floats, further: Floats, pull: Floats, *,
    adapt: Function, land: Function,
) -> Any:
    """Return the stop code (0.0 if the run continues) and the state after one step.

    The step is divided as the tolerances require; ``land`` checks its end.
    """
    extra = (*parameters, *bob.winding[1:], *further)
    q1, v1, parts, size, steps, vain, reason, found = adapt(
        t, bob.q, bob.v, h, size, bound - taken - rejected, params, rtol, atol, extra, pull, bob.slackened)
    return land(t, h, speed_limit, bob, taken, rejected, q1, v1, parts, size, steps, vain, reason, found, parameters,
                further)


def land(
    t: float, h: float, speed_limit: float, bob: State, taken: float, rejected: float, q1: float, v1: float,
    parts: Floats, size: float, steps: float, vain: float, reason: float, found: Floats, parameters: Floats,
    further: Floats, *, potential: Function, clip: Clip | None,
) -> tuple[Any, ...]:
    """Return the stop code (0.0 if the run continues) and the state after adaptive steps over h.

    Single runs call it in ``advance``, blocks for every pendulum that has come to the end of its step.
    """
    good = finite(q1, v1, parts, bob.winding)
    changes = parts
    if clip:
        q1, v1, _, changes = clipped(h, bob.winding, parameters, q1, v1, (), parts, clip, potential)
    q1, winding1, _ = wrapped(q1, bob.winding, ())
    sums1, _ = summed(bob.sums, (), changes)
    stop = SPEED_LIMIT if abs(v1) > speed_limit else 0.0
    slackened1 = tuple(1.0 + (t + since)/h if (before == 0.0) & (since >= 0.0) else before
                       for before, since in zip(bob.slackened, found, strict=False))
    stop = stop if good else DIVERGED
    stop = stop if reason == OK else reason
    bob1 = State(q1, winding1, v1, (), (), sums1, (), slackened1)
    return stop, bob1, size, taken + steps, rejected + vain, () if bob.slackened else found


@spliced
def begun(size: float, h: float, *, count: int, lenient: bool) -> tuple[Any, ...]:
    """Return the first part of the progress at the start of steps over h, and its two last parts."""
    integrals = (0.0,)*count
    loose = (-1.0,) if lenient else ()
    done = 0.0
    last = 0.0
    most = 10.0
    taken = 0.0
    rejected = 0.0
    size = size if size > 0.0 else h
    return (done, last, most, size, taken, rejected), integrals, loose


@spliced
def slopes(t: float, q: float, v: float, extra: Floats, *, slope: Function) -> tuple[Any, ...]:
    """Return the acceleration and the rates of work and heat at the start of adaptive steps."""
    a, rates = slope(t, q, v, extra)
    return a, rates


@spliced
def length(t: float, h: float, size: float, done: float) -> tuple[Any, ...]:
    """Return the time of an attempt, whether it ends before h, and its length."""
    now = t + done
    left = h - done
    whole = 1.01*size < left
    part = size if whole else left
    return now, whole, part


@spliced
def too_short(now: float, h: float, size: float, whole: bool) -> bool:
    """Return True if an attempt is too short to change the time."""
    return whole & ((now + 0.0625*size == now) | (h + 0.0625*size == h))


@spliced
def possible(now: float, h: float, size: float, whole: bool) -> float:
    """Return the stop code of an attempt that is too short, or OK."""
    reason = TOO_SHORT if too_short(now, h, size, whole) else OK
    return reason


@spliced
def larger(a: float, b: float) -> float:
    """Return the larger of two magnitudes."""
    return abs(a) if abs(a) > abs(b) else abs(b)


@spliced
def mean_square(x: float, y: float) -> float:
    """Return the mean of two squares."""
    return 0.5*(x*x + y*y)


@spliced
def trial(
    now: float, part: float, q: float, v: float, given: Floats, rtol: float, atol: float, extra: Floats, *,
    take: Function,
) -> tuple[After, Any]:
    """Return an attempt's step, and the square of its error in angle and velocity, in units of the tolerance."""
    after = take(now, q, v, (), given, part, extra)
    scale_q = atol + rtol*larger(q, after.q)
    scale_v = atol + rtol*larger(v, after.v)
    errors = after.errors
    square0 = mean_square(errors[0]/scale_q, errors[1]/scale_v)
    if len(errors) == 2:
        square = square0
    else:
        square1 = mean_square(errors[2]/scale_q, errors[3]/scale_v)
        square = square0*square0/(square0 + 0.01*square1) if square0 > 0.0 else 0.0*square1
    return after, square


@spliced
def judged(
    t: float, h: float, now: float, whole: bool, part: float, progress: Progress, after: After, square: float,
    reason: float, extra: Floats, pull: Floats, slackened: Floats, *,
    order: float, power: Function, take: Function, taut: Function, slack_after: Function, slack: bool, ends_slack: bool,
) -> tuple[Any, ...]:
    """Accept or reject an attempt, and choose the length of the next as in :mod:`integrators.solving.adaptive`.

    An accepted step in which a wire goes slack is cut there, with the ``reason`` SLACK, or it stays whole, and
    ``loose`` is the time since the start at which the wire first went slack. Returned are progress, reason, and step.
    """
    done, last, most, size, taken, rejected, q, v, a, rates, integrals, loose = progress
    accepted = ((abs(after.q) <= LARGEST) & (abs(after.v) <= LARGEST) & (abs(after.given[0]) <= LARGEST)
                & (square <= 1.0))
    known = accepted | (square > 1.0) & (square <= 1e300)
    inside = square if known & (square > 1e-24) else 1e-24
    error = power(inside if inside < 1e40 else 1e40, 0.5)
    error = error if known else 1e301
    base, exponent, earlier, share = ratio_powers(error, accepted, last, order)
    ratio = step_ratio(power(base, exponent), power(earlier, share), error, accepted, last)
    tried = part*(most if accepted & (most < ratio) else ratio)
    size = size if accepted & (not whole) & (not tried > size) else tried
    last = error if accepted & whole else 0.0
    most = 10.0 if accepted else 1.0
    if ends_slack:
        cut = part
        if accepted and not taut(now, q, v, after.q, after.v, part, extra, pull):
            since = slack_after(now, q, v, (a, *rates), part, extra, pull)
            if since <= part:
                reason = SLACK
                cut = since
                after = after._replace(q=q, v=v, parts=tuple(0.0 for _ in after.parts))
                if since > 0.0:
                    after = take(now, q, v, (), (a, *rates), since, extra)
        ahead = done + cut if whole | (cut < part) else h
    else:
        if slack and (accepted and slackened[0] == 0.0 and loose[0] < 0.0
                      and not taut(now, q, v, after.q, after.v, part, extra, pull)):
            since = slack_after(now, q, v, (a, *rates), part, extra, pull)
            loose = (now - t + since if since <= part else loose[0],)
        ahead = done + part if whole else h
    done = ahead if accepted else done
    q = after.q if accepted else q
    v = after.v if accepted else v
    a = after.given[0] if accepted else a
    rates = tuple(new if accepted else old for new, old in zip(after.given[1:], rates, strict=True))
    integrals = tuple(one + part if accepted else one for one, part in zip(integrals, after.parts, strict=True))
    taken = taken + (1.0 if accepted else 0.0)
    rejected = rejected + (0.0 if accepted else 1.0)
    progress = Progress(done, last, most, size, taken, rejected, q, v, a, rates, integrals, loose)
    return progress, reason, after


def adapt(
    t: float, q: float, v: float, h: float, size: float, tries: float, params: Any, rtol: float, atol: float,
    extra: Floats, pull: Floats, slackened: Floats, *,
    take: Function, slope: Function, power: Function, taut: Function, slack_after: Function, order: float, count: int,
    paused: int, slack: bool, ends_slack: bool, lenient: bool,
) -> tuple[Any, ...]:
    """Return the state after adaptive steps from t to exactly t + h, and what the next ones need.

    The first attempt has the length ``size``, or h if that is 0. ``adapt`` returns the motion, work and heat, the next
    step size to try, the numbers of steps taken and rejected, and a stop code; for a wire that ends the run where it
    goes slack also the fraction of h up to there, and for a wire with slack="warn" the time from t to there or -1.
    After ``tries`` attempts it pauses: it stores its progress in ``params``, from the place ``paused`` on, for the next
    call, and returns the values from before the step.
    """
    first = size
    if params[paused] > 0.0:
        progress = resumed(params, paused, count, lenient)
        params[paused] = 0.0
    else:
        (done, last, most, size, taken, rejected), integrals, loose = begun(size, h, count=count, lenient=lenient)
        a, rates = slope(t, q, v, extra)
        progress = Progress(done, last, most, size, taken, rejected, q, v, a, rates, integrals, loose)
    reason = OK
    while progress.done < h:
        if progress.taken + progress.rejected >= tries:
            reason = PAUSED
            break
        now, whole, part = length(t, h, progress.size, progress.done)
        if too_short(now, h, progress.size, whole):
            reason = TOO_SHORT
            break
        given = (progress.a, *progress.rates)
        after, square = trial(now, part, progress.q, progress.v, given, rtol, atol, extra, take=take)
        progress, reason, after = judged(
            t, h, now, whole, part, progress, after, square, reason, extra, pull, slackened, order=order, power=power,
            take=take, taut=taut, slack_after=slack_after, slack=slack, ends_slack=ends_slack)
        if ends_slack and reason == SLACK:
            break
    return ended(h, first, progress, reason, params, paused, ends_slack)


@spliced
def resumed(params: Any, paused: int, count: int, lenient: bool) -> Progress:
    """Return the progress of steps that have paused."""
    first, second, third = paused + 10, paused + 10 + count, paused + 10 + 2*count
    return Progress._make((*params[paused + 1:first], params[first:second], params[second:third],
                           params[third:third + 1] if lenient else ()))


@spliced
def ended(
    h: float, first: float, progress: Progress, reason: float, params: Any, paused: int, ends_slack: bool
) -> tuple[Any, ...]:
    """Return what ``adapt`` returns; steps that pause store their progress before, unless runs never pause."""
    done, _, _, size, taken, rejected, q, v, _, _, integrals, loose = progress
    if reason == PAUSED:
        if params[paused] == 0.0:
            params[paused] = 1.0
            for i, value in enumerate((*progress[:9], *progress.rates, *progress.integrals, *progress.loose)):
                params[paused + 1 + i] = value
        size = first
        taken = 0.0
        rejected = 0.0
    found = (done/h,) if ends_slack else loose
    return q, v, integrals, size, taken, rejected, reason, found


def adapt_evenly(
    t: float, q: float, v: float, h: float, size: float, tries: float, params: Any, rtol: float, atol: float,
    extra: Floats, pull: Floats, slackened: Floats, *,
    take: Function, slope: Function, power: Function, aim: float, exponent: float, count: int, paused: int,
    ends_slack: bool, lenient: bool,
) -> tuple[Any, ...]:
    """Return the state after steps of equal length from t to exactly t + h, and what the next ones need.

    They are those of ``adapt``. The number of parts is that of the interval before, changed so that the largest
    estimated error of a step is EVEN_AIM times the tolerance (``aim`` is a power of EVEN_AIM); it is chosen once
    for an interval, which costs less than for every step. If an error is larger than the tolerance, the interval is
    taken again with more steps. While it pauses, ``done`` is the number of steps taken, ``last`` that of the
    interval, and ``most`` the largest squared error so far.
    """
    first = size
    start_q = q
    start_v = v
    if params[paused] > 0.0:
        progress = resumed(params, paused, count, lenient)
        done, last, most, size, taken, rejected, q, v, a, rates, integrals, loose = progress
        params[paused] = 0.0
    else:
        (done, last, most, size, taken, rejected), integrals, loose = begun(size, h, count=count, lenient=lenient)
        most = 0.0
        a, rates = slope(t, q, v, extra)
        last, part = divided(h, size)
    reason = OK
    part = h/last
    if too_many(t, h, last, part):
        reason = TOO_SHORT
    while (reason == OK) & (done < last):
        fine = True
        while fine & (done < last):  # in a loop of its own, in which ``part`` does not change
            if taken + rejected >= tries:
                reason = PAUSED
                break
            now = t + done*part
            after, square = trial(now, part, q, v, (a, *rates), rtol, atol, extra, take=take)
            most = most if square <= most else square
            q = after.q
            v = after.v
            a = after.given[0]
            rates = after.given[1:]
            integrals = plus(integrals, after.parts)
            done = done + 1.0
            taken = taken + 1.0
            fine = square <= 1.0
        if reason == PAUSED:
            break
        known = (abs(q) <= LARGEST) & (abs(v) <= LARGEST) & (abs(a) <= LARGEST) & (most <= 1e300)
        inside = most if known & (most > 1e-24) else 1e-24
        inside = inside if inside < 1e40 else 1e40
        ratio = aim*power(inside, exponent)
        ratio = ratio if ratio > SHRINK else SHRINK
        ratio = ratio if ratio < GROW else GROW
        size = part*(ratio if known else BROKEN)
        if known & fine:
            break
        rejected = rejected + done
        taken = taken - done
        q = start_q
        v = start_v
        done = 0.0
        most = 0.0
        integrals = (0.0,)*count
        a, rates = slope(t, q, v, extra)
        last, part = divided(h, size)
        if too_many(t, h, last, part):
            reason = TOO_SHORT
    progress = Progress(done, last, most, size, taken, rejected, q, v, a, rates, integrals, loose)
    return ended(h, first, progress, reason, params, paused, ends_slack)


@spliced
def divided(h: float, size: float) -> tuple[float, float]:
    """Return the number of equal steps, of about ``size``, into which h is divided, and their length."""
    share = h/size
    last = (share + 6755399441055744.0) - 6755399441055744.0
    last = last if last >= share else last + 1.0
    part = h/last
    return last, part


@spliced
def too_many(t: float, h: float, last: float, part: float) -> bool:
    """Return True if equal steps are too many, or too short to change the time."""
    return (last > MOST_EVEN) | (last > 1.0) & ((t + part == t) | (h + 0.0625*part == h))


# --- calls of the steps ----------------------------------------------------------------------------------------------


@spliced
def next_state(
    index: float, h: float, speed_limit: float, bob: State, parameters: Floats, further: Floats, pull: Floats, *,
    advance: Function,
) -> tuple[Any, State]:
    """Return the stop code and the state after the step with the number ``index``."""
    stop, bob1 = advance(index*h, h, speed_limit, bob, parameters, further, pull)
    return stop, bob1


@spliced
def landed(
    t: float, h: float, speed_limit: float, bob: State, taken: float, rejected: float, q1: float, v1: float,
    parts: Floats, size: float, steps: float, vain: float, reason: float, found: Floats, parameters: Floats,
    further: Floats, *, land: Function,
) -> tuple[Any, ...]:
    """Return what ``land`` returns, under the names of a step's results."""
    stop, bob1, size, taken, rejected, portion = land(
        t, h, speed_limit, bob, taken, rejected, q1, v1, parts, size, steps, vain, reason, found, parameters, further)
    return stop, bob1, size, taken, rejected, portion
