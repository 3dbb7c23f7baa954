"""Function ``solve``: run a method on floats, NumPy arrays or mpmath numbers, forward or backward in time."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from integrators import html
from integrators.errors import shown
from integrators.method import Acceleration, Method, MethodError, System
from integrators.registry import METHODS, get, named
from integrators.solving.adaptive import March, checked
from integrators.solving.dense import DenseOutput, Recorder
from integrators.solving.equal import EqualSteps, check_count
from integrators.solving.events import Ended, Event, EventFunction, Watch, checked_events
from integrators.solving.probing import counted, problem, with_arguments, with_couplings
from integrators.solving.stepper import stepper
from integrators.solving.values import (
    check_truth,
    column,
    is_double,
    is_finite,
    is_real,
    of_kind,
    rounding_unit,
    state,
    widened,
    zero_of,
)
from integrators.steps.compensated import check_compensated


@dataclass(frozen=True, repr=False)
class Solution:
    """Solution at the requested times: ``t``, ``q`` and ``v``, each with one entry (or row) per time.

    The times are ``times``, or ``t_eval`` if that was given, up to a terminal event.
    They are arrays of float64 for floats and arrays, and object arrays for other numbers, such as mpmath's.
    ``steps`` counts the steps taken, ``rejected`` the steps that a tolerance rejected, and ``evaluations`` the calls of
    the acceleration or a part of it, without the calls that probe a bare function. With ``solve(..., dense=True)`` the
    solution is a function of time; see :mod:`integrators.solving.dense`. ``lost_q`` and ``lost_v`` are the rounding
    errors of ``q`` and ``v`` that compensated summation has stored; None without compensated summation.

    With ``solve(..., events=...)``, ``t_events``, ``q_events`` and ``v_events`` are tuples with an array for each event
    function: the times at which it changed its sign, and the states there. ``ended_by`` is the index of the event
    function that ended the solution, whose last time is that event's unless ``t_eval`` was given; None if none did.
    See :mod:`integrators.solving.events`.
    """

    t: Any
    q: Any
    v: Any
    method: str
    steps: int
    rejected: int = 0
    evaluations: int = 0
    dense: DenseOutput | None = field(default=None, repr=False, compare=False)
    lost_q: Any = None
    lost_v: Any = None
    t_events: tuple[Any, ...] = ()
    q_events: tuple[Any, ...] = ()
    v_events: tuple[Any, ...] = ()
    ended_by: int | None = None

    def __repr__(self) -> str:
        return f"<Solution: {self.method}, {span_of(self.t)}, {self.steps} steps>"

    def _repr_html_(self) -> str:
        """Return a short table as HTML, which notebooks show."""
        found = sum(map(len, self.t_events))
        return html.block(f"Solution by {self.method}", html.facts((
            ("times", span_of(self.t)),
            ("steps", f"{self.steps}{f', and {self.rejected} rejected' if self.rejected else ''}"),
            ("force evaluations", str(self.evaluations)),
            ("q, v at the end", f"{shown(self.q[-1])}, {shown(self.v[-1])}" if len(self.t) else ""),
            ("events", str(found) if self.t_events else ""),
        )))

    def __call__(self, t: Any) -> tuple[Any, Any]:
        """Return (q, v) at any time from the first to the last, or at an array of times, whose axes come first.

        At the end of a step the result equals the solution there bit for bit; between, its error is larger by
        ``O(h**(dense_order + 1))``, with ``dense_order`` as the method declares.
        Raises MethodError for other times, and for a solution without dense output.
        """
        if self.dense is None:
            raise MethodError("This solution has no dense output; pass dense=True to solve.")
        return self.dense(t)


def span_of(times: Any) -> str:
    """Return the number of times, the first and the last, as text."""
    return f"{len(times)} times" + (f" from {float(times[0]):.6g} to {float(times[-1]):.6g}" if len(times) else "")


def accepted(method: str | Method) -> Method:
    """Return the method of this name, or a method of one's own if its coefficients have the order that it declares.

    Raises MethodError for an unknown name, and for a method whose coefficients contradict its order.
    """
    chosen = method if isinstance(method, Method) else get(method)
    if METHODS.get(chosen.name) is not chosen:
        from integrators.analysis.conditions import check_order

        check_order(chosen)
    return chosen


def solve(
    acceleration: Acceleration | System,
    q: Any,
    v: Any,
    times: Sequence[Any],
    *,
    method: str | Method = "rk4",
    h: Any = None,
    rtol: Any = None,
    atol: Any = None,
    first_step: Any = None,
    max_step: Any = None,
    t_eval: Any = None,
    args: tuple[Any, ...] = (),
    dense: bool = False,
    compensated: bool = False,
    events: EventFunction | Event | Sequence[EventFunction | Event] | None = None,
) -> Solution:
    """Integrate ``q'' = a(t, q, v)`` from ``(q, v)`` at ``times[0]`` through all ``times``.

    Args:
        acceleration: ``a(t, q, v)`` in units of q per time squared, or a :class:`System` with more functions. Whether a
            bare function depends on the velocity is tested near the given q and v, at nine times from the first to the
            last. A function that depends on the velocity only elsewhere must be given as a System. A function may
            return a list, an array that it uses again in its next call, or one number for all components; it must not
            change q or v.
        q, v: state at ``times[0]``: floats, lists or arrays of one shape, or other real numbers with arithmetic (of
            mpmath, Fraction, Decimal). The method's coefficients have the highest precision among q, v, times and h;
            NumPy's numbers narrower than float64 are converted to float64. Complex numbers, NumPy's longdouble and
            arrays of exact numbers are refused.
        times: at least one time, strictly increasing or strictly decreasing. Steps end at each of them.
        method: a name of :data:`integrators.METHODS` or a Method.
        h: the longest step allowed; each interval is divided into equal steps no longer than h, but for the rounding
            of the times. With ``rtol``, the first step to try, as ``first_step``.
        rtol, atol: tolerances for an embedded pair: the error of a step, as a root mean square over all components y of
            q and v, stays below ``atol + rtol max(abs(y0), abs(y1))``. Steps are as long as that allows and end at all
            ``times``. ``atol`` is ``rtol`` by default, which suits values near one; it may be an array like q, or a
            pair of arrays or numbers, for q and for v. See :mod:`integrators.solving.adaptive`.
        first_step: the first step to try, with ``rtol``; chosen automatically by default.
        max_step: the longest step allowed, with ``rtol``; without it, or with infinity, a force that acts for a short
            time only, such as a pulse after a long rest, can be stepped over.
        t_eval: times between the first and the last of ``times``, in their order, at which the solution is returned
            instead. They are read off the dense output, so that they do not shorten the steps.
        args: further arguments of the acceleration, the events and their actions: ``a(t, q, v, *args)``.
        dense: True for a Solution that can be called at any time between the first and the last. It stores every step
            and, for some methods, needs further evaluations. With ``rtol`` it meets the tolerance between the ends of
            steps, too. See :mod:`integrators.solving.dense`.
        compensated: True stores the rounding error of each addition to q and v and adds it in the next step; for steps
            of one length. See :mod:`integrators.steps.compensated`.
        events: functions ``g(t, q, v)``, or Events, whose changes of sign are located on the dense output, to the
            rounding of the time. As in SciPy's ``solve_ivp`` a function may have attributes ``direction`` (above zero:
            rising changes only; below zero: falling ones) and ``terminal`` (True: the solution ends at the first
            event; n: at the n-th). Two changes of one function are both found if more than an eighth of a step lies
            between them. An ``action``, a function ``(t, q, v) -> (q, v)``, returns the state from which the solution
            goes on, as after a bounce; at the time of the event itself, ``q_events`` and a time of ``times`` show the
            state before. See :mod:`integrators.solving.events`. Not with ``compensated``.

    A multistep method starts its history anew at a time where the step length changes by more than the rounding of the
    type of ``times``; more than ``FEW_RESTARTS`` restarts give a UserWarning.

    Raises:
        MethodError: unknown method, coefficients of a method of one's own that contradict its declared order, a method
            that does not fit the problem, an array whose components the acceleration couples for a method that needs
            independent ones, a state that is not finite real numbers of one shape, an acceleration of another shape or
            of other arguments, or that changes q or v in place, ``h`` not finite and positive, times not monotonic,
            more than ``MOST_STEPS`` steps, a step whose result is not finite (the message says when), neither ``h`` nor
            ``rtol``, ``rtol`` for a method without estimates or with ``compensated``, ``first_step`` or ``max_step``
            without ``rtol``, ``t_eval`` outside of the times, a method that cannot be compensated, or an event function
            that does not return one finite real number;
            StepSizeError if steps become too short while trying to meet a tolerance.
    """
    accepted(method)
    return solve_unchecked(
        method, acceleration, q, v, times, h=h, rtol=rtol, atol=atol, first_step=first_step, max_step=max_step,
        t_eval=t_eval, args=args, dense=dense, compensated=compensated, events=events)


def solve_unchecked(
    method: str | Method, acceleration: Acceleration | System, q: Any, v: Any, times: Sequence[Any], *,
    args: Any = (), events: Any = None, **options: Any,
) -> Solution:
    """Integrate as :func:`solve` does, by a method whose declared order may be wrong, as when its order is measured.

    Raises as :func:`solve` does, except for a wrong order.
    """
    function = with_arguments(acceleration, args)
    return integrated(
        method, lambda *start: problem(function, *start), state(q, "q"), state(v, "v"), times,
        events=checked_events(events, args=args), **options)


def integrated(
    method: str | Method, system_at: Callable[..., System], q: Any, v: Any, times: Sequence[Any], *, h: Any = None,
    rtol: Any = None, atol: Any = None, first_step: Any = None, max_step: Any = None, t_eval: Any = None,
    dense: bool = False, compensated: bool = False, events: tuple[Event, ...] = (), of_v: bool = False,
) -> Solution:
    """Integrate a problem from (q, v); the arguments are those of :func:`solve`, but for three.

    Args:
        method, q, v, times, h, rtol, atol, first_step, max_step, t_eval, dense, compensated: see :func:`solve`.
        system_at: returns the System for the times, q, v and True for doubles, False for other numbers.
        events: checked events.
        of_v: True for a tolerance of v alone.

    Raises MethodError as :func:`solve` does, and StepSizeError if steps become too short to meet a tolerance.
    """
    chosen = named(method)
    h, rtol, atol, first_step, max_step = (widened(value) for value in (h, rtol, atol, first_step, max_step))
    if np.ndim(max_step) == 0 and max_step == math.inf:
        max_step = None
    if h is None and rtol is None:
        raise MethodError("h must be a finite step above zero, not None, unless rtol is given to choose the steps.")
    for name, value in (("atol", atol), ("first_step", first_step), ("max_step", max_step)):
        if value is not None and rtol is None:
            more = "; without rtol, h is the longest step" if "step" in name else ""
            raise MethodError(f"{name} needs rtol, which is missing{more}.")
    for name, value in (("h", h), ("first_step", first_step), ("max_step", max_step)):
        if value is not None and not (is_real(value) and value > 0):
            raise MethodError(f"{name} must be a finite step above zero, not {shown(value)}; to step backwards, let "
                              "times decrease.")
    if h is not None and first_step is not None:
        raise MethodError("h and first_step are one and the same with rtol; pass only one of them.")
    compensated, dense = check_compensated(compensated, rtol), check_truth(dense, "dense")
    for name, given in (("dense=True", dense), ("t_eval", t_eval is not None), ("events", events)):
        if compensated and given:
            raise MethodError(f"{name} and compensated=True cannot be combined; pass only one of them.")
    tolerance = None if rtol is None else checked(chosen, rtol, atol, np.shape(q), of_v)
    marks, unit = _ordered(times, "times")
    if events and not unit:
        raise MethodError("Events are located to the rounding of the times, and exact numbers such as Fractions have "
                          "none; give times as floats or numbers of mpmath.")
    asked = None if t_eval is None else _within(t_eval, marks)
    if not (is_finite(q) and is_finite(v) and np.shape(q) == np.shape(v)):
        raise MethodError(f"q and v must be finite numbers or arrays of one shape, not {shown(q)} and {shown(v)}.")
    first = h if first_step is None else first_step
    with np.errstate(over="ignore"):
        for name, longest in (("h", h if tolerance is None else None), ("max_step", max_step)):
            if longest is not None:
                check_count(marks[-1] - marks[0], longest, name)
        gaps = [late - early for early, late in pairwise(marks)]
    kinds = [first, max_step, *(() if tolerance is None else (rtol, tolerance.atol, tolerance.atol_v))]
    zero = zero_of(marks[0], *gaps, q, v, *(value for value in kinds if value is not None))
    q, v = (of_kind(zero, value) for value in (q, v))
    if tolerance is not None and is_double(q + zero):
        tolerance.check_rounding()
    system = with_couplings(system_at(marks, q, v, is_double(q + zero)), chosen, method, marks, q, v)
    calls = [0]
    system = counted(system, calls, chosen.counted)
    watch, recorder = Watch(events, unit) if events else None, None
    keep = dense or asked is not None
    if keep or watch is not None:
        recorder = Recorder(chosen, system.acceleration, zero, None if watch is None else watch.step, keep)
    staged = recorder is not None and recorder.extension is not None
    step, begin = stepper(chosen, system, q + zero, tolerance is not None, staged, compensated)
    lost = (q - q, v - v) if compensated else ()
    march = EqualSteps(chosen, step, begin, marks[0], q, v, h, lost, unit, recorder) if tolerance is None else March(
        chosen, step, system.acceleration, tolerance, marks[0], q, v, first, recorder, math.inf if max_step is None
        else max_step)
    rows: list[tuple[Any, ...]] = [(marks[0], q, v, *lost)]
    ended_by: int | None = None
    end: Ended | None = None
    try:
        while end is None or end.after is not None:
            try:
                march.through([march.t, *marks[len(rows) :]], zero, rows)
                break
            except Ended as found:
                end = found
            reached = [mark for mark in marks[len(rows) :] if abs(mark - marks[0]) <= abs(end.t - marks[0])]
            rows += [(mark, end.q, end.v) for mark in reached]
            if end.after is not None and recorder is not None:
                march.t, march.q, march.v = end.t, *end.after
                recorder.break_off()
            else:
                ended_by = end.index
                rows += [(end.t, end.q, end.v)] if end.t != rows[-1][0] else []
    except TypeError as fault:
        if is_double(q + zero):
            raise MethodError(f"{chosen.name} stopped at a TypeError: {fault}; the acceleration must return real "
                              "numbers at every time.") from fault
        raise MethodError(f"{chosen.name} cannot compute with numbers of the type {type(zero).__name__}: {fault}; use "
                          "floats, numbers of mpmath, or an explicit method.") from fault
    if isinstance(march, EqualSteps):
        march.warn(stacklevel=4)
    output = recorder.output(*rows[-1]) if keep and recorder is not None else None
    ts, qs, vs, *losts = (column(list(values)) for values in zip(*rows, strict=True))
    if asked is not None and output is not None:
        onwards = marks[-1] >= marks[0]
        ts = column(asked)[[t <= ts[-1] if onwards else t >= ts[-1] for t in asked]]
        qs, vs = output(ts)
    lost_q, lost_v = losts or (None, None)
    events_at = ((), (), ()) if watch is None else watch.columns()
    return Solution(
        ts, qs, vs, chosen.name, march.steps, march.rejected, calls[0], output if dense else None, lost_q, lost_v,
        *events_at, ended_by)


def _ordered(times: Any, name: str) -> tuple[list[Any], Any]:
    """Return times as a list of numbers, and the relative rounding of their type.

    Raises MethodError unless there is at least one, all are finite, and they increase or decrease strictly.
    """
    ordered = isinstance(times, Iterable) and not isinstance(times, (str, bytes, set, frozenset, Mapping))
    given = list(times) if ordered and getattr(times, "shape", None) != () else []
    marks = [widened(t) for t in given]
    if not marks or not all(is_real(t) for t in marks):
        raise MethodError(f"{name} must hold at least one time, all of them finite, not {shown(times)}.")
    if not any(all(before(*pair) for pair in pairwise(marks)) for before in (operator.lt, operator.gt)):
        raise MethodError(f"{name} must be strictly increasing or strictly decreasing.")
    return marks, rounding_unit(given)


def _within(t_eval: Any, marks: Sequence[Any]) -> list[Any]:
    """Return the times ``t_eval`` as a list; MethodError unless they lie between the times ``marks``, in their order.
    """
    asked, _ = _ordered(t_eval, "t_eval")
    first, last = marks[0], marks[-1]
    if not (first <= asked[0] <= asked[-1] <= last or first >= asked[0] >= asked[-1] >= last):
        raise MethodError(f"t_eval must lie between the first and the last of times, {first} and {last}, in their "
                          f"order; it runs from {asked[0]} to {asked[-1]}.")
    return asked
