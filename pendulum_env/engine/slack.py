"""The search for the time at which a wire goes slack: templates of ``taut``, ``slack_after`` and ``settle``.

A wire goes slack where its pull falls below zero. ``taut`` looks at every step and costs little: it needs only the
step's ends, and in scenes whose only radial force is the weight no cosine. Where it cannot exclude slack,
``slack_after`` takes parts of the step with the method itself and finds the time of slack to the method's accuracy.

``pull[0]`` is ``M L`` and ``pull[1]`` is ``W g``, divided by the moment of inertia over the length; the functions'
other arguments are those of :mod:`pendulum_env.engine.advance`.
"""

from __future__ import annotations

from typing import Any

from pendulum_env.engine.advance import State
from pendulum_env.engine.shape import DIVERGED, OK, SLACK, SPEED_LIMIT, Floats, Function
from pendulum_env.engine.specialise import spliced

TOUCH = 1e-9
"""Share of weight and centrifugal force by which the pull on a wire may be below zero within a step.

A bob that is released at the horizontal turns there with a pull of zero, up to rounding and the method's error. At the
ends of steps every pull below zero is slack.
"""
QUARTER = 1.5707963267948966
"""A quarter of a turn [rad], rounded down: the cosine of every angle within it is positive."""
CLOSE = 1e-15
"""Least distance of two trials in the search for the time of slack, as a fraction of the step."""


def taut(
    t: float, q: float, v: float, q1: float, v1: float, h: float, extra: Floats, pull: Floats, *,
    weighed: bool, side_at: int, tension: Function,
) -> bool:
    """Return False if the wire may go slack in the step from q, v to q1, v1.

    It examines the cubic through the angles and velocities at the step's ends. Its angles lie between the smallest and
    the largest of its Bezier control points ``q, q + h v/3, q1 - h v1/3, q1``, its velocities between those of ``v, m,
    v1`` with ``m = 3 (q1 - q)/h - v - v1`` (Farin 2002, Curves and Surfaces for CAGD, 4.2 and 5.3). If weight and
    centrifugal force alone pull on the wire (``weighed``), ``T = M L v² + W g cos(theta)``, it is taut

    - if all control points of the angle are below the horizontal, where the weight pulls outwards, and
    - if ``M L v² > W g`` at all control points of the velocity, which have one sign.

    The control points are beyond the cubic by O(h²), the cubic is beside the motion by O(h⁴). Other scenes need the
    pull at the ends and at the cubic's place of the least pull, that of the parabola through the pulls at both ends
    and in the middle.
    """
    if weighed:
        way = h*v
        way1 = h*v1
        inner = 3.0*(q1 - q) - way - way1
        weight = abs(pull[1])*h*h
        below = ((extra[side_at] > 0.0) & (pull[1] >= 0.0) & (abs(q) <= QUARTER) & (abs(q1) <= QUARTER)
                 & (abs(q + 0.3333333333333333*way) <= QUARTER) & (abs(q1 - 0.3333333333333333*way1) <= QUARTER))
        return below | ((way*inner > 0.0) & (inner*way1 > 0.0) & (pull[0]*way*way > weight)
                        & (pull[0]*inner*inner > weight) & (pull[0]*way1*way1 > weight))
    before = tension(t, q, v, extra, pull)
    last = tension(t + h, q1, v1, extra, pull)
    way = h*v
    way1 = h*v1
    turn = q1 - q
    q2 = 0.5*(q + q1) + 0.125*(way - way1)
    v2 = (1.5*turn - 0.25*(way + way1))/h
    middle = tension(t + 0.5*h, q2, v2, extra, pull)
    place = least_place(before, middle, last, 0.5)
    place = place if place > 0.0 else 0.0
    place = place if place < 1.0 else 1.0
    square = 3.0*turn - 2.0*way - way1
    cube = way + way1 - 2.0*turn
    q2 = q + place*(way + place*(square + place*cube))
    v2 = (way + place*(2.0*square + place*3.0*cube))/h
    least = tension(t + place*h, q2, v2, extra, pull)
    return not ((before < 0.0) | (last < 0.0) | (least < 0.0))


@spliced
def least_place(before: float, middle: float, last: float, otherwise: float) -> float:
    """Return where a parabola through three pulls is least, as a share of the step; ``otherwise`` if it bends down."""
    bend = 4.0*(before + last - 2.0*middle)
    return (3.0*before + last - 4.0*middle)/bend if bend > 1e-300 else otherwise


def pull_after(
    t: float, q: float, v: float, given: Floats, h: float, extra: Floats, pull: Floats, *,
    multistep: bool, begin: Function, take: Function, tension: Function,
) -> Any:
    """Return the pull on the wire after a step of h."""
    memory = begin(t, q, v, h, extra) if multistep else ()
    after = take(t, q, v, memory, given, h, extra)
    return tension(t + h, after.q, after.v, extra, pull)


def slack_after(
    t: float, q: float, v: float, given: Floats, h: float, extra: Floats, pull: Floats, *,
    tension: Function, pull_after: Function,
) -> float:
    """Return the time in a step of h after which the wire is slack; inf if it stays taut.

    It is 0 for a wire that is slack at the start. Otherwise the pull is computed after the whole step, after half of
    it, and at the least value of the parabola through these; a pull below zero is then traced back to its zero by the
    Illinois method, the rule of false position in which the value at an end that stays is halved (Dowell & Jarratt
    1971, BIT 11, 168), in some 10 trials. The pulls are those after parts of the step that the method itself takes; a
    multistep method begins anew for each.
    """
    before = tension(t, q, v, extra, pull)
    touch = TOUCH*(pull[0]*v*v + abs(pull[1]))
    if before < -touch:
        return 0.0
    before = before if before > 0.0 else 0.0
    last = 0.0
    least = 0.0
    low = 0.0
    high = 1e999
    stays = 0.0  # 1: the low end stayed at the last trial, -1: the high end
    close = CLOSE*h
    part = h
    for tries in range(100):
        now = pull_after(t, q, v, given, part, extra, pull)
        if high <= h:
            if now < 0.0:
                before = 0.5*before if stays > 0.0 else before
                high = part
                least = now
                stays = 1.0
            else:
                least = 0.5*least if stays < 0.0 else least
                low = part
                before = now
                stays = -1.0
        elif now < (0.0 if tries == 0 else -touch):
            high = part
            least = now
        elif tries == 0:
            last = now
            part = 0.5*h
            continue
        elif tries == 1:
            middle = now
            place = least_place(before, middle, last, 0.0)
            if not 0.0 < place < 1.0:
                break
            part = place*h
            continue
        else:
            break
        if not high - low > 4.0*close:
            break
        part = (low*least - high*before)/(least - before)
        part = part if part > low + close else low + close
        part = part if part < high - close else high - close
    return high


def settle(
    t: float, h: float, speed_limit: float, bob: State, parameters: Floats, further: Floats, pull: Floats, *,
    multistep: bool, lenient: bool, begin: Function, advance: Function, slack_after: Function,
) -> tuple[Any, ...]:
    """Return the stop code and the state after a step that slack may cut short.

    It returns what ``advance`` returns and, if slack ends the run, the fraction of the step that was taken. A run that
    continues (``lenient``: slack="warn") takes the whole step.
    """
    extra = (*parameters, *bob.winding[1:], *further)
    since = slack_after(t, bob.q, bob.v, bob.lost, h, extra, pull)
    slack = since <= h
    if lenient:
        stop, bob1 = advance(t, h, speed_limit, bob, parameters, further, pull)
        stop = stop if stop == DIVERGED else (SPEED_LIMIT if abs(bob1.v) > speed_limit else OK)
        slackened1 = (1.0 + (t + since)/h if slack else 0.0,)
        return stop, bob1._replace(slackened=slackened1), ()
    stop = SLACK
    bob1 = bob
    portion = since/h if slack else 1.0
    memory = bob.memory
    if slack:
        h = since
        if multistep and h > 0.0:
            memory = begin(t, bob.q, bob.v, h, extra)
    if h > 0.0:
        bob = bob._replace(memory=memory)
        stop, bob1 = advance(t, h, speed_limit, bob, parameters, further, pull)
        stop = stop if stop == DIVERGED else (
            SLACK if slack else (SPEED_LIMIT if abs(bob1.v) > speed_limit else OK))
    return stop, bob1, (portion,)


@spliced
def next_settled(
    index: float, h: float, speed_limit: float, bob: State, parameters: Floats, further: Floats, pull: Floats, *,
    settle: Function,
) -> tuple[Any, ...]:
    """Return what ``settle`` returns for the step with the number ``index``."""
    stop, bob1, portion = settle(index*h, h, speed_limit, bob, parameters, further, pull)
    return stop, bob1, portion
