"""Events: times at which a function g(t, q, v) changes its sign along a solution, located on its dense output.

Between the ends of a step g is evaluated on the dense output at ``PARTS`` equal parts of the step, and where it comes
close to zero between equal signs, at its extremum too. A change of sign is located to the rounding of the time by the
secant method within a bracket (the Illinois rule, Dowell & Jarratt 1971, BIT 11, 168), with bisection where it is slow.

Every change of sign is found that is more than 1/PARTS of a step away from the next one of the same function. Of two
that are closer, both or none are found. A function that touches zero and keeps its sign has no event there.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from integrators.errors import shown
from integrators.method import MethodError
from integrators.solving.dense import Curve
from integrators.solving.probing import check_arguments, with_arguments
from integrators.solving.values import column, is_real

PARTS = 8
"""Number of equal parts of a step at whose ends an event function is evaluated."""
MOST_HALVINGS = 300
"""Maximum number of evaluations that locate one event."""
FEW_HALVINGS = 40
"""Number of evaluations that look for an extremum between two equal signs."""

EventFunction = Callable[[Any, Any, Any], Any]


@dataclass(frozen=True)
class Event:
    """A function ``g(t, q, v)`` whose changes of sign are located, as ``solve`` takes it.

    Attributes:
        function: returns one finite real number, for one time and the state (q, v) at that time.
        direction: above zero only changes from negative to positive values count, below zero only the opposite ones; 0
            counts both.
        terminal: True ends the solution at the first event, a whole number n at the n-th; False never.
    """

    function: EventFunction
    direction: float = 0
    terminal: bool | int = False

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
    """Raised at a terminal event: the solution ends there, in the state (q, v) at time t.

    Attributes:
        index: place of the event function among those given.
    """

    def __init__(self, t: Any, q: Any, v: Any, index: int) -> None:
        super().__init__(t, q, v, index)
        self.t, self.q, self.v, self.index = t, q, v, index


def checked_events(events: Any, args: Any = ()) -> tuple[Event, ...]:
    """Return events as a tuple of Event: from None, one function or Event, or several of them.

    A plain function may have attributes ``direction`` and ``terminal``, as SciPy's ``solve_ivp`` reads them. ``args``
    are its arguments after t, q and v. Raises MethodError for anything else.
    """
    if events is None:
        return ()
    if isinstance(events, Event) or callable(events):
        events = [events]
    if isinstance(events, (str, bytes)) or not isinstance(events, Sequence):
        raise MethodError(f"events must be functions g(t, q, v) or Events, not {shown(events)}.")
    return tuple(_checked(event, args) for event in events)


def _checked(event: Any, args: Any) -> Event:
    """Return a function or an Event as an Event; MethodError if it is neither, or its direction or count is wrong."""
    if not isinstance(event, Event):
        event = Event(event, getattr(event, "direction", 0), getattr(event, "terminal", False))
    if not callable(event.function):
        raise MethodError(f"An event must be a function g(t, q, v) or an Event of one, not {shown(event.function)}.")
    if not is_real(event.direction):
        raise MethodError(f"The direction of event {event.name} must be a number: below zero, zero or above zero, "
                          f"not {shown(event.direction)}.")
    function = with_arguments(event.function, args, f"Event {event.name}")
    check_arguments(function, f"Event {event.name}", "t, q, v")
    terminal = bool(event.terminal) if isinstance(event.terminal, np.bool_) else event.terminal
    try:
        count = operator.index(terminal)
    except TypeError:
        count = -1
    if count < 0:
        raise MethodError(f"terminal of event {event.name} must be True, False or the number of the event that ends "
                          f"the solution, not {shown(event.terminal)}.")
    return Event(function, event.direction, terminal)


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

    def step(self, curve: Curve) -> None:
        """Find the events of one step, in the order of their times; raises Ended at the first terminal one.

        Raises MethodError for an event function that does not return one finite real number.
        """
        places: list[tuple[Any, int]] = []
        for i, event in enumerate(self.events):
            places += [(place, i) for place in self._places(i, event, curve)]
        for place, i in sorted(places, key=operator.itemgetter(0)):
            q, v = curve.at(place)
            t, here = curve.time(place), self.found[i]
            here.t.append(t)
            here.q.append(q)
            here.v.append(v)
            if self.events[i].terminal and len(here.t) == int(self.events[i].terminal):
                raise Ended(t, q, v, i)

    def columns(self) -> tuple[tuple[Any, ...], tuple[Any, ...], tuple[Any, ...]]:
        """Return the times, q and v of the events: a tuple each, with an array for each event function."""
        empty = np.empty(0)
        ts, qs, vs = (
            tuple(column(values) if values else empty for values in (getattr(found, name) for found in self.found))
            for name in "tqv"
        )
        return ts, qs, vs

    def _places(self, i: int, event: Event, curve: Curve) -> list[Any]:
        """Return where one event function changes its sign in the wanted direction, as fractions of the step.

        The value at the end of a step is that at the start of the next one, and the sign that the function had last is
        kept: a zero at the end of a step is an event if the next step goes on with the other sign.
        """
        one = curve.h / curve.h

        def g(place: Any) -> Any:
            try:
                value = event.function(curve.time(place), *curve.at(place))
            except (ArithmeticError, TypeError, ValueError) as fault:
                raise MethodError(f"Event {event.name} fails at t = {curve.time(place)}: {fault}.") from fault
            value = value.item() if getattr(value, "shape", None) == () else value
            if not is_real(value):
                raise MethodError(f"Event {event.name} must return one finite real number, not {shown(value)}, its "
                                  f"value at t = {curve.time(place)}.")
            return value

        samples = [(one * k / PARTS, g(one * k / PARTS)) for k in range(1, PARTS + 1)]
        samples.insert(0, (0 * one, self._end[i] if self._end[i] is not None else g(0 * one)))
        self._end[i] = samples[-1][1]
        positive, places = self._positive[i], []
        last: Any = None
        for place, value in self._with_extrema(g, samples):
            if value != 0:
                changed = positive is not None and (value > 0) != positive
                if changed and event.direction * (1 if value > 0 else -1) >= 0:
                    between = last is not None and last[1] != 0 and (last[1] > 0) != (value > 0)
                    places.append(located(g, last[0], last[1], place, value, self._width(curve)) if between
                                  else place if last is None else last[0])
                positive = bool(value > 0)
            last = place, value
        self._positive[i] = positive
        return places

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
