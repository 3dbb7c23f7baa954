"""Events: times at which a function g(t, q, v) changes its sign along a solution, located on its dense output.

Between the ends of a step g is evaluated on the dense output at ``PARTS`` equal parts of the step, and where it comes
close to zero between equal signs, at its extremum too. A change of sign is located to the rounding of the time by the
secant method within a bracket (the Illinois rule, Dowell & Jarratt 1971, BIT 11, 168), with bisection where it is slow.

Every change of sign is found that is more than 1/PARTS of a step away from the next one of the same function. Of two
that are closer, both or none are found. A function that touches zero and keeps its sign has no event there.

An event may have an action, such as a bounce: a function that returns the state from which the solution goes on. In the
first step after it, the start counts as a zero of the event's own function, and the sign with which the function leaves
it is looked for down to the rounding of the time, so that no bounce is missed however soon it follows. Of several
events at one time, those without an action are found first, then those with one, in the order in which they are given;
a later action is not taken if an earlier one has turned the motion away from its event. If the action changes the sign
of another function, that is an event of that function. Actions that follow each other ever faster, as those of a ball
that comes to rest, end with an error.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cmp_to_key
from typing import Any

import numpy as np

from integrators.errors import shown
from integrators.method import MethodError
from integrators.solving.dense import Curve
from integrators.solving.probing import check_arguments, with_arguments
from integrators.solving.values import column, is_finite, is_real, of_kind, state

PARTS = 8
"""Number of equal parts of a step at whose ends an event function is evaluated."""
MOST_HALVINGS = 300
"""Maximum number of evaluations that locate one event."""
FEW_HALVINGS = 40
"""Number of evaluations that look for an extremum between two equal signs."""
NOISE = 2**16
"""A value at the start of a step counts as zero if it is less than so many roundings of the largest in the step."""
LAST_ACTIONS, SHRUNK = 100, 10**3
"""So many actions of one event come to rest if together they take less than this part of the longest time between two.
"""
NEAREST = 2**12
"""Two actions of one event are further apart than so many roundings of their times."""
MOST_ACTIONS = 20_000
"""Maximum number of actions of an event whose ``terminal`` does not say how many it may have."""

EventFunction = Callable[..., Any]


@dataclass(frozen=True)
class Event:
    """A function ``g(t, q, v)`` whose changes of sign are located, as ``solve`` takes it.

    Attributes:
        function: returns one finite real number, for one time and the state (q, v) at that time.
        direction: above zero only changes from negative to positive values count, below zero only the opposite ones; 0
            counts both.
        terminal: True ends the solution at the first event, a whole number n at the n-th; False never.
        action: a function ``(t, q, v) -> (q, v)``: the solution goes on from the state that it returns. None for no
            action. An event that ends the solution has none.
    """

    function: EventFunction
    direction: float = 0
    terminal: bool | int = False
    action: Callable[..., Any] | None = None

    @property
    def name(self) -> str:
        """Name of the function, for messages."""
        return str(getattr(self.function, "__name__", type(self.function).__name__))


@dataclass
class Found:
    """The events of one function that were found so far: their times and states."""

    t: list[Any] = field(default_factory=list)
    q: list[Any] = field(default_factory=list)
    v: list[Any] = field(default_factory=list)


class Ended(Exception):  # noqa: N818 -- not an error: it carries the end of a solution to the loop over its steps
    """Raised at a terminal event, or at one with an action: the solution ends there, in the state (q, v) at time t.

    Attributes:
        index: place of the event function among those given.
        after: the state (q, v) from which the solution goes on; None if it does not.
    """

    def __init__(self, t: Any, q: Any, v: Any, index: int, after: tuple[Any, Any] | None = None) -> None:
        super().__init__(t, q, v, index, after)
        self.t, self.q, self.v, self.index, self.after = t, q, v, index, after


def checked_events(events: Any, args: Any = (), arguments: str = "t, q, v") -> tuple[Event, ...]:
    """Return events as a tuple of Event: from None, one function or Event, or several of them.

    A plain function may have attributes ``direction`` and ``terminal``, as SciPy's ``solve_ivp`` reads them, and
    ``action``. ``args`` are its arguments after ``arguments``. Raises MethodError for anything else.
    """
    if events is None:
        return ()
    if isinstance(events, Event) or callable(events):
        events = [events]
    if isinstance(events, (str, bytes)) or not isinstance(events, Sequence):
        raise MethodError(f"events must be functions g({arguments}) or Events, not {shown(events)}.")
    return tuple(_checked(event, args, arguments) for event in events)


def _checked(event: Any, args: Any, arguments: str) -> Event:
    """Return a function or an Event as an Event; MethodError if it is neither, or its direction or count is wrong."""
    if not isinstance(event, Event):
        event = Event(event, getattr(event, "direction", 0), getattr(event, "terminal", False),
                      getattr(event, "action", None))
    if not callable(event.function):
        raise MethodError(f"An event must be a function g({arguments}) or an Event of one, not "
                          f"{shown(event.function)}.")
    if not is_real(event.direction):
        raise MethodError(f"The direction of event {event.name} must be a number: below zero, zero or above zero, "
                          f"not {shown(event.direction)}.")
    if not (event.action is None or callable(event.action)):
        raise MethodError(f"The action of event {event.name} must be a function of ({arguments}), not "
                          f"{shown(event.action)}.")
    function, action = (_with_arguments(one, args, name, arguments) for one, name in (
        (event.function, f"Event {event.name}"), (event.action, f"The action of event {event.name}")))
    terminal = bool(event.terminal) if isinstance(event.terminal, np.bool_) else event.terminal
    try:
        count = operator.index(terminal)
    except TypeError:
        count = -1
    if count < 0:
        raise MethodError(f"terminal of event {event.name} must be True, False or the number of the event that ends "
                          f"the solution, not {shown(event.terminal)}.")
    return Event(function, event.direction, terminal, action)


def _with_arguments(function: Any, args: Any, name: str, arguments: str) -> Any:
    """Return a function that passes ``args`` on after its arguments; MethodError if it takes others. None for None."""
    if function is None:
        return None
    function = with_arguments(function, args, name, arguments)
    check_arguments(function, name, arguments)
    return function


class Watch:
    """The search for the events of a solution, one step after the other.

    Args:
        events: the event functions.
        unit: relative rounding of the times.
    """

    def __init__(self, events: Sequence[Event], unit: Any) -> None:
        self.events, self.unit = tuple(events), unit
        self.found = [Found() for _ in self.events]
        self._positive: list[bool | None] = [None] * len(self.events)
        self._end: list[Any] = [None] * len(self.events)
        self._acted: set[int] = set()
        self._longest: list[Any] = [0] * len(self.events)

    def step(self, curve: Curve) -> None:
        """Find the events of one step, in the order of their times.

        Raises Ended at the first terminal one, or the first with an action, and MethodError for an event function that
        does not return one finite real number, or an action that does not return a state.
        """
        changes: list[tuple[Any, int, bool]] = []
        began_anew = bool(self._acted)
        for i, event in enumerate(self.events):
            changes += [(place, i, positive) for place, positive in self._changes(i, event, curve, began_anew)]
        acted, self._acted = self._acted, set()
        same = 4 * self._width(curve)

        def order(one: tuple[Any, int, bool], other: tuple[Any, int, bool]) -> int:
            if abs(one[0] - other[0]) > same:
                return -1 if one[0] < other[0] else 1
            mine, its = ((self.events[i].action is not None, i) for _, i, _ in (one, other))
            return (mine > its) - (mine < its)

        for place, i, positive in sorted(changes, key=cmp_to_key(order)):
            self._positive[i] = positive
            event = self.events[i]
            if event.direction * (1 if positive else -1) < 0:
                continue
            q, v = curve.at(place)
            t, here = curve.time(place), self.found[i]
            here.t.append(t)
            here.q.append(q)
            here.v.append(v)
            if event.terminal and len(here.t) == int(event.terminal):
                raise Ended(t, q, v, i)
            if event.action is not None:
                after = self._after(i, event, t, q, v)
                self._acted = {i, *(acted if place <= same else ())}
                for other, k, _ in changes:
                    if abs(other - place) <= same and self.events[k].action is None:
                        self._positive[k] = None  # this event is found; the action may lead to either side
                self._positive[i], self._end = not positive, [None] * len(self.events)
                raise Ended(t, q, v, i, after)

    def _after(self, i: int, event: Event, t: Any, q: Any, v: Any) -> tuple[Any, Any]:
        """Return the state (q, v) after an event's action at the time t; MethodError if it is none."""
        times = self.found[i].t
        gap = abs(t - times[-2]) if len(times) > 1 else None
        if gap is not None:
            self._longest[i] = max(self._longest[i], gap)
            many = len(times) > LAST_ACTIONS and (
                abs(t - times[-1 - LAST_ACTIONS]) * SHRUNK < self._longest[i])
            if many or gap <= NEAREST * self.unit * abs(t) or (len(times) > MOST_ACTIONS and not event.terminal):
                raise _at_rest(event, t)
        assert event.action is not None
        given = [x.copy() if isinstance(x, np.ndarray) else x for x in (q, v)]
        try:
            after = tuple(event.action(t, *given))
        except (ArithmeticError, TypeError, ValueError) as fault:
            raise MethodError(f"The action of event {event.name} fails at t = {t}: {fault}; it must return the state "
                              "after it.") from fault
        if len(after) == 2:
            after = tuple(of_kind(t - t, state(x, f"What the action of event {event.name} returns")) for x in after)
        if [np.shape(x) for x in after] != [np.shape(q)] * 2 or not all(map(is_finite, after)):
            raise MethodError(f"The action of event {event.name} must return the state after it, finite numbers of its "
                              f"shape, {np.shape(q)}, not {shown(after)}.")
        return after[0], after[1]

    def columns(self) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]:
        """Return the times, q and v of the events: a tuple each, with an array for each event function."""
        empty = np.empty(0)
        ts, qs, vs = (
            tuple(column(values) if values else empty for values in (getattr(found, name) for found in self.found))
            for name in "tqv"
        )
        return ts, qs, vs

    def _changes(self, i: int, event: Event, curve: Curve, began_anew: bool) -> list[tuple[Any, bool]]:
        """Return where one event function changes its sign, as fractions of the step, and whether it is positive then.

        The value at the end of a step is that at the start of the next one, and the sign that the function had last is
        kept: a zero at the end of a step is an event if the next step goes on with the other sign. Changes in the
        direction that is not wanted are not located; their place is that at which they are seen. Where the step is the
        first one after an action (``began_anew``), a start within rounding of zero is zero.
        """
        one = curve.h / curve.h

        def value_at(place: Any) -> Any:
            try:
                value = event.function(curve.time(place), *curve.at(place))
            except (ArithmeticError, TypeError, ValueError) as fault:
                raise MethodError(f"Event {event.name} fails at t = {curve.time(place)}: {fault}.") from fault
            value = value.item() if getattr(value, "shape", None) == () else value
            if not is_real(value):
                raise MethodError(f"Event {event.name} must return one finite real number, not {shown(value)}, its "
                                  f"value at t = {curve.time(place)}.")
            return value

        g: Callable[[Any], Any] = value_at
        samples = [(one * k / PARTS, g(one * k / PARTS)) for k in range(1, PARTS + 1)]
        samples.insert(0, (0 * one, self._end[i] if self._end[i] is not None else g(0 * one)))
        self._end[i] = samples[-1][1]
        if i in self._acted or (event.action is not None and self._positive[i] is None and samples[0][1] == 0):
            g, samples = self._leaving(i, event, g, samples, curve)
        elif began_anew and self._is_zero(samples):
            samples[0] = samples[0][0], 0 * samples[0][1]
        positive, changes = self._positive[i], []
        last: Any = None
        for place, value in self._with_extrema(g, samples):
            if value != 0:
                if positive is None:
                    self._positive[i] = bool(value > 0)
                elif (value > 0) != positive:
                    wanted = event.direction * (1 if value > 0 else -1) >= 0
                    between = wanted and last is not None and last[1] != 0 and (last[1] > 0) != (value > 0)
                    changes.append((located(g, last[0], last[1], place, value, self._width(curve)) if between
                                    else place if last is None or not wanted else last[0], bool(value > 0)))
                positive = bool(value > 0)
            last = place, value
        return changes

    def _leaving(
        self, i: int, event: Event, g: Callable[[Any], Any], samples: list[Any], curve: Curve
    ) -> tuple[Callable[[Any], Any], list[Any]]:
        """Return an event function and its samples in the first step after its own action, which leaves it at zero.

        The place of the action is known to rounding, and so is the value there; it is subtracted. If the first sample
        after it is not on the side from which the function came, the function is looked at closer and closer to the
        start. Raises MethodError if it leaves zero without a slope, so that nothing follows but rest.
        """
        (start, rest), *later = samples
        if not self._is_zero(samples):
            self._positive[i] = bool(rest > 0)  # the action has moved the state to another place
            self._acted.discard(i)
            return g, samples

        def above_rest(place: Any) -> Any:
            return g(place) - rest

        later = [(place, value - rest) for place, value in later]
        place, first = later[0]
        came = self._positive[i] if self._positive[i] is not None else not first > 0
        self._positive[i] = None if first == 0 else bool(first > 0)
        if first != 0 and (first > 0) != came:
            for _ in range(MOST_HALVINGS):
                place = place / 2
                if place <= 4 * self._width(curve):
                    break
                value = above_rest(place)
                if value != 0 and (value > 0) == came:
                    self._positive[i] = came
                    later.insert(0, (place, value))
                    break
            near = later[-1][0] / 2**12
            if self._positive[i] != came and not abs(above_rest(2 * near)) < 3.5 * abs(above_rest(near)):
                raise _at_rest(event, curve.time(start))
        return above_rest, [(start, 0 * rest), *later]

    def _is_zero(self, samples: Sequence[Any]) -> bool:
        """Return True if the first value of samples (place, value) is zero but for rounding."""
        first, *later = (abs(value) for _, value in samples)
        return bool(first <= NOISE * self.unit * max(later))

    def _width(self, curve: Curve) -> Any:
        """Return the fraction of a step that is the rounding of its times, or of the fraction itself."""
        return self.unit * max(abs((abs(curve.t) + abs(curve.h)) / curve.h) / 2, 1)

    def _with_extrema(self, g: Callable[[Any], Any], samples: list[Any]) -> list[Any]:
        """Return samples (place, value), with one more wherever three of one sign have one of the other sign between.

        The middle one of the three is the smallest in absolute value.
        """
        points = list(samples)
        for (low, a), (middle, b), (high, c) in zip(samples, samples[1:], samples[2:], strict=False):
            if b != 0 and (a > 0) == (b > 0) == (c > 0) and a != 0 != c and abs(b) <= min(abs(a), abs(c)):
                place, value = _lowest(g, low, middle, high, b)
                if value != 0 and (value > 0) != (b > 0):
                    points.append((place, value))
        return sorted(points, key=operator.itemgetter(0))


def _at_rest(event: Event, t: Any) -> MethodError:
    """Return the error that the actions of an event follow each other without end."""
    return MethodError(
        f"Event {event.name} has its action again and again at t = {t}: the motion comes to rest there, and no step "
        "leads beyond it. End the solution before, by terminal=n or by an event of a least speed, and go on with the "
        f"equation of what rests; terminal=n also allows more than {MOST_ACTIONS} actions.")


def _lowest(g: Callable[[Any], Any], low: Any, middle: Any, high: Any, here: Any) -> tuple[Any, Any]:
    """Return a place between low and high where g has the other sign than ``here``, its value at ``middle``.

    If there is none, the place where abs(g) is smallest. Parabolas through three points, halved brackets else.
    """
    best, value, sign = middle, here, 1 if here > 0 else -1
    below, above = sign * g(low), sign * g(high)
    value = sign * value
    for _ in range(FEW_HALVINGS):
        left, right = (best - low), (high - best)
        bend = left * (above - value) + right * (below - value)
        if bend > 0:
            guess = best + (right * right * (below - value) - left * left * (above - value)) / (2 * bend)
        else:
            guess = best
        if not low < guess < high or abs(guess - best) < (high - low) / 1000:
            guess = best + (right / 4 if right > left else -left / 4)
        if guess == best or not low < guess < high:
            break
        other = sign * g(guess)
        if other < 0:  # at a zero the search goes on: the sign may change beside it, or g may only touch zero
            return guess, sign * other
        if other < value:
            low, below, high, above = (best, value, high, above) if guess > best else (low, below, best, value)
            best, value = guess, other
        elif guess > best:
            high, above = guess, other
        else:
            low, below = guess, other
    return best, sign * value


def located(g: Callable[[Any], Any], low: Any, below: Any, high: Any, above: Any, width: Any) -> Any:
    """Return the place between low and high where g changes its sign, to the width given.

    ``below`` and ``above`` are the values of g at low and high; one of them is negative, the other positive.
    """
    kept = 0
    for k in range(MOST_HALVINGS):
        if abs(high - low) <= width:
            break
        guess = high - above * (high - low) / (above - below) if k % 4 != 3 else (low + high) / 2
        if not low < guess < high:
            guess = (low + high) / 2
            if not low < guess < high:
                break
        value = g(guess)
        if value == 0:
            return guess
        if (value > 0) == (above > 0):
            high, above = guess, value
            below = below / 2 if kept == 1 else below
            kept = 1
        else:
            low, below = guess, value
            above = above / 2 if kept == -1 else above
            kept = -1
    return low if abs(g(low)) < abs(g(high)) else high
