"""Function ``solve``: run a method on floats, NumPy arrays or mpmath numbers, forward or backward in time."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
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
from integrators.solving.events import Ended, Event, EventFunction, Watch, checked_events
from integrators.solving.probing import counted, problem, with_couplings
from integrators.solving.stepper import Begin, Step, stepper
from integrators.solving.values import (
    check_truth,
    column,
    is_double,
    is_finite,
    is_real,
    misshapen,
    of_kind,
    rounding_unit,
    state,
    widened,
    zero_of,
)
from integrators.steps.compensated import check_compensated

MOST_STEPS = 10**10
"""Maximum number of steps of one run; so many take hours even in compiled code."""
FEW_RESTARTS = 3
"""Number of restarts of a multistep method's history in one run without a warning."""


@dataclass(frozen=True, repr=False)
class Solution:
    """Solution at the requested times: ``t``, ``q`` and ``v``, each with one entry (or row) per time.

    They are arrays of float64 for floats and arrays, and object arrays for other numbers, such as mpmath's.
    ``steps`` counts the steps taken, ``rejected`` the steps that a tolerance rejected, and ``evaluations`` the calls of
    the acceleration or a part of it, without the calls that probe a bare function. With ``solve(..., dense=True)`` the
    solution is a function of time; see :mod:`integrators.solving.dense`. ``lost_q`` and ``lost_v`` are the rounding
    errors of ``q`` and ``v`` that compensated summation has stored; None without compensated summation.

    With ``solve(..., events=...)``, ``t_events``, ``q_events`` and ``v_events`` are tuples with an array for each event
    function: the times at which it changed its sign, and the states there. ``ended_by`` is the index of the event
    function that ended the solution, whose last time is that event's; None if none did. See
    :mod:`integrators.solving.events`.
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
        return f"<Solution: {self.method}, {self._span}, {self.steps} steps>"

    @property
    def _span(self) -> str:
        """Number of times, the first and the last, as text."""
        return f"{len(self.t)} times from {float(self.t[0]):.6g} to {float(self.t[-1]):.6g}"

    def _repr_html_(self) -> str:
        """Return a short table as HTML, which notebooks show."""
        found = sum(map(len, self.t_events))
        return html.block(f"Solution by {self.method}", html.facts((
            ("times", self._span),
            ("steps", f"{self.steps}{f', and {self.rejected} rejected' if self.rejected else ''}"),
            ("force evaluations", str(self.evaluations)),
            ("q, v at the end", f"{shown(self.q[-1])}, {shown(self.v[-1])}"),
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
        times: at least one time, strictly increasing or strictly decreasing.
        method: a name of :data:`integrators.METHODS` or a Method.
        h: the longest step allowed; each interval is divided into equal steps no longer than h, but for the rounding
            of the times. With ``rtol``, the first step to try; it may then be None.
        rtol, atol: tolerances for an embedded pair: the error of a step, as a root mean square over all components y of
            q and v, stays below ``atol + rtol max(abs(y0), abs(y1))``. Steps are as long as that allows and end at all
            ``times``. ``atol`` is ``rtol`` by default, which suits values near one; see
            :mod:`integrators.solving.adaptive`.
        dense: True for a Solution that can be called at any time between the first and the last. It stores every step
            and, for some methods, needs further evaluations. With ``rtol`` it meets the tolerance between the ends of
            steps, too. See :mod:`integrators.solving.dense`.
        compensated: True stores the rounding error of each addition to q and v and adds it in the next step; for steps
            of one length. See :mod:`integrators.steps.compensated`.
        events: functions ``g(t, q, v)``, or Events, whose changes of sign are located on the dense output, to the
            rounding of the time. As in SciPy's ``solve_ivp`` a function may have attributes ``direction`` (above zero:
            rising changes only; below zero: falling ones) and ``terminal`` (True: the solution ends at the first
            event; n: at the n-th). Two changes of one function are both found if more than an eighth of a step lies
            between them; see :mod:`integrators.solving.events`. Not with ``compensated``.

    A multistep method starts its history anew at a time where the step length changes by more than the rounding of the
    type of ``times``; more than ``FEW_RESTARTS`` restarts give a UserWarning.

    Raises:
        MethodError: unknown method, coefficients of a method of one's own that contradict its declared order, a method
            that does not fit the problem, an array whose components the acceleration couples for a method that needs
            independent ones, a state that is not finite real numbers of one shape, an acceleration of another shape or
            of other arguments, or that changes q or v in place, ``h`` not finite and positive, times not monotonic,
            more than ``MOST_STEPS`` steps, a step whose result is not finite (the message says when), neither ``h`` nor
            ``rtol``, ``rtol`` for a method without estimates or with ``compensated``, a method that cannot be
            compensated, or an event function that does not return one finite real number;
            StepSizeError if steps become too short while trying to meet a tolerance.
    """
    accepted(method)
    return solve_unchecked(method, acceleration, q, v, times, h, rtol, atol, dense, compensated, events)


def solve_unchecked(
    method: str | Method, acceleration: Acceleration | System, q: Any, v: Any, times: Sequence[Any], h: Any = None,
    rtol: Any = None, atol: Any = None, dense: bool = False, compensated: bool = False, events: Any = None,
) -> Solution:
    """Integrate as :func:`solve` does, by a method whose declared order may be wrong, as when its order is measured.

    Raises as :func:`solve` does, except for a wrong order.
    """
    chosen = named(method)
    q, v = state(q, "q"), state(v, "v")
    h, rtol, atol = (widened(value) for value in (h, rtol, atol))
    if h is None and rtol is None:
        raise MethodError("h must be a finite step above zero, not None, unless rtol is given to choose the steps.")
    if atol is not None and rtol is None:
        raise MethodError("atol needs rtol, which is missing.")
    if h is not None and not (is_real(h) and h > 0):
        raise MethodError(f"h must be a finite step above zero, not {shown(h)}; to step backwards, let times decrease.")
    compensated, dense = check_compensated(compensated, rtol), check_truth(dense, "dense")
    if compensated and dense:
        raise MethodError("dense=True and compensated=True cannot be combined; pass only one of them.")
    watched = checked_events(events)
    if compensated and watched:
        raise MethodError("events and compensated=True cannot be combined; pass only one of them.")
    tolerance = None if rtol is None else checked(chosen, rtol, atol)
    ordered = isinstance(times, Iterable) and not isinstance(times, (str, bytes, set, frozenset, Mapping))
    given = list(times) if ordered and getattr(times, "shape", None) != () else []
    marks = [widened(t) for t in given]
    if not marks or not all(is_real(t) for t in marks):
        raise MethodError(f"times must hold at least one time, all of them finite, not {shown(times)}.")
    with np.errstate(over="ignore"):
        gaps = [late - early for early, late in pairwise(marks)]
    if not (all(gap > 0 for gap in gaps) or all(gap < 0 for gap in gaps)):
        raise MethodError("times must be strictly increasing or strictly decreasing.")
    if not (is_finite(q) and is_finite(v) and np.shape(q) == np.shape(v)):
        raise MethodError(f"q and v must be finite numbers or arrays of one shape, not {shown(q)} and {shown(v)}.")
    unit = rounding_unit(given)
    counts = _counts(marks, gaps, h, unit) if rtol is None else []
    zero = zero_of(marks[0], *gaps, *(value for value in (q, v, h, rtol, atol) if value is not None))
    q, v = (of_kind(zero, value) for value in (q, v))
    if tolerance is not None and is_double(q + zero):
        tolerance.check_rounding()
    system = with_couplings(problem(acceleration, marks, q, v, is_double(q + zero)), chosen, method, marks, q, v)
    calls = [0]
    system = counted(system, calls, chosen.counted)
    watch = Watch(watched, unit) if watched else None
    recorder = None
    if dense or watch is not None:
        recorder = Recorder(chosen, system.acceleration, zero, None if watch is None else watch.step, dense)
    staged = recorder is not None and recorder.extension is not None
    step, begin = stepper(chosen, system, q + zero, tolerance is not None, staged, compensated)
    rows: list[tuple[Any, ...]] = []
    taken = restarts = rejected = 0
    ended_by: int | None = None
    march = None if tolerance is None else March(
        chosen, step, system.acceleration, tolerance, marks[0], q, v, h, recorder)
    try:
        if march is None:
            lost = (q - q, v - v) if compensated else ()
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # a step that is not finite is an error
                taken, restarts = _equal_steps(
                    chosen, step, begin, marks, gaps, counts, q, v, lost, recorder, unit, rows)
        else:
            march.through(marks, zero, rows)
            taken = march.steps
    except Ended as end:
        assert recorder is not None
        ended_by, taken = end.index, recorder.steps if march is None else march.steps + 1
        rows += [(end.t, end.q, end.v)] if end.t != rows[-1][0] else []
    except TypeError as fault:
        if is_double(q + zero):
            raise MethodError(f"{chosen.name} stopped at a TypeError: {fault}; the acceleration must return real "
                              "numbers at every time.") from fault
        raise MethodError(f"{chosen.name} cannot compute with numbers of the type {type(zero).__name__}: {fault}; use "
                          "floats, numbers of mpmath, or an explicit method.") from fault
    if march is not None:
        rejected = march.rejected
    if restarts > FEW_RESTARTS and not chosen.one_step:
        warnings.warn(_restarted(chosen, restarts, taken), stacklevel=3)
    ts, qs, vs, *losts = (column(list(values)) for values in zip(*rows, strict=True))
    lost_q, lost_v = losts or (None, None)
    output = recorder.output(*rows[-1]) if dense and recorder is not None else None
    events_at = ((), (), ()) if watch is None else watch.columns()
    return Solution(
        ts, qs, vs, chosen.name, taken, rejected, calls[0], output, lost_q, lost_v, *events_at, ended_by)


def _equal_steps(
    chosen: Method, step: Step, begin: Begin, marks: Sequence[Any], gaps: Sequence[Any], counts: Sequence[int],
    q: Any, v: Any, lost: Sequence[Any], recorder: Recorder | None, unit: Any, rows: list[tuple[Any, ...]],
) -> tuple[int, int]:
    """Integrate with equal steps in each interval between marks; append the states at the marks to ``rows``.

    Return the number of steps and the number of marks at which the memory started anew.
    ``counts`` is the number of steps of each interval, ``lost`` the initial rounding errors of compensated summation,
    ``unit`` the relative rounding of the marks.
    """
    shape = np.shape(q)
    rows.append((marks[0], q, v, *lost))
    taken, restarts, memory_size = 0, 0, len(chosen.memory)
    last: Any = None
    memory: Sequence[Any] = ()
    for (start, mark), gap, count in zip(pairwise(marks), gaps, counts, strict=True):
        part = gap / count
        memory_valid = last is not None and _same_step(part, last, start, unit)
        restarts += not (memory_valid or last is None)
        for i in range(count):
            t = start + i * part
            taken += 1
            try:
                if not (i or memory_valid):
                    memory = begin(t, q, v, part)
                values = step(t, q, v, *memory, *lost, part)
            except MethodError:
                raise
            except (ArithmeticError, ValueError) as fault:
                raise MethodError(_divergence(chosen, taken, t, f" ({fault})")) from fault
            if not (is_finite(values[0]) and is_finite(values[1])):
                raise MethodError(_divergence(chosen, taken, t))
            if recorder is not None:
                rest = (start - t) + i * part if i else None  # t is rounded, the steps' sum is not
                recorder.add(t, part, (q, v), values[:2], values, rest=rest)
            end = 2 + memory_size
            (q, v), memory, lost = values[:2], values[2:end], values[end : end + len(lost)]
        if not np.shape(q) == np.shape(v) == shape:
            raise MethodError(misshapen(np.shape(v), shape))
        rows.append((mark, q, v, *lost))
        last = part
    return taken, restarts


def _same_step(part: Any, last: Any, t: Any, unit: Any) -> bool:
    """Return True if step lengths ``part`` and ``last`` agree up to the rounding of the time t.

    The values that the last step passed on (forces, a history) are then valid for the next one. ``unit`` is the
    relative rounding of the times. A difference of a thousandth of a step never counts as rounding.
    """
    return bool(part == last) or bool(abs(part - last) <= min(2 * unit * (abs(t) + abs(part)), abs(part) / 1000))


def _restarted(method: Method, restarts: int, steps: int) -> str:
    """Return the warning about a multistep method whose history started anew at several times."""
    starter = method.begun_by
    work = f"the first {method.past} steps" if method.forwards else "a new history"
    start = "" if starter is None else f" After each restart {starter.name} computes {work}."
    return (f"{method.name} started its history anew {restarts} times in {steps} steps, because the step length "
            f"changed by more than the rounding of the times.{start} Equally spaced times need no restart.")


def _counts(marks: Sequence[Any], gaps: Sequence[Any], h: Any, unit: Any) -> list[int]:
    """Return the number of equal steps in each interval between times; MethodError if they are too many in all.

    Steps may be longer than h by the rounding of the times, of which ``unit`` is the relative size, and by no more than
    a thousandth.
    """
    sizes, excess = [], []
    with np.errstate(over="ignore"):
        for gap, (start, mark) in zip(gaps, pairwise(marks), strict=True):
            try:
                sizes.append(float(abs(gap) / h))
                excess.append(min(1e-3, max(1e-9, float(unit * (abs(start) + abs(mark)) / h))))
            except ArithmeticError:
                sizes.append(math.inf)
                excess.append(0.0)
    if not sum(sizes) <= MOST_STEPS:
        raise MethodError(
            f"Steps of h = {h!r} are too short: they would be {sum(sizes):.3g} steps, and at most {MOST_STEPS:.0e} are "
            "allowed."
        )
    return [max(1, math.ceil(size - more)) for size, more in zip(sizes, excess, strict=True)]


def _divergence(method: Method, step: int, t: Any, fault: str = "") -> str:
    """Return the error message for a step of a method whose result is not finite, that is, which has diverged."""
    unsolved = "Newton's method finds no solution of the stage equation, " if method.implicit else ""
    return (f"{method.name} left the finite range in step {step}, from t = {t}{fault}: {unsolved}"
            "the step is too long or the force is not finite there.")
