"""Equal steps: every interval between two times is divided into steps of one length, forward and backward in time."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from integrators.method import Method, MethodError
from integrators.solving.dense import Recorder
from integrators.solving.stepper import Begin, Step
from integrators.solving.values import is_finite, misshapen

MOST_STEPS = 10**10
"""Maximum number of steps of one run; so many take hours even in compiled code."""
FEW_RESTARTS = 3
"""Number of restarts of a multistep method's history in one run without a warning."""


class EqualSteps:
    """Integration with equal steps: the current state, and the numbers of steps.

    Args:
        method, step, begin: a method and its generated functions, see :mod:`integrators.solving.stepper`.
        t, q, v: the state at the start.
        h: the longest step.
        lost: the rounding errors of q and v at the start, for compensated summation; () without.
        unit: relative rounding of the times.
        recorder: stores the steps for dense output and events.

    Attributes:
        steps, restarts: number of steps taken, and number of times at which the memory started anew.
    """

    rejected = 0

    def __init__(
        self, method: Method, step: Step, begin: Begin, t: Any, q: Any, v: Any, h: Any, lost: Sequence[Any], unit: Any,
        recorder: Recorder | None = None,
    ) -> None:
        self.method, self.step, self.begin = method, step, begin
        self.t, self.q, self.v, self.h, self.lost, self.unit = t, q, v, h, lost, unit
        self.steps = self.restarts = 0
        self._recorder = recorder

    def through(self, marks: Sequence[Any], zero: Any, rows: list[tuple[Any, ...]]) -> None:
        """Integrate through the times ``marks``, the first of which is the current one; append (t, q, v) at the others.

        With compensated summation the rounding errors of q and v are appended, too. ``zero`` is not used. Raises
        MethodError if a step is not finite.
        """
        method, recorder, q, v, lost = self.method, self._recorder, self.q, self.v, self.lost
        shape, memory_size = np.shape(q), len(method.memory)
        last: Any = None
        memory: Sequence[Any] = ()
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # a step that is not finite is an error
            for (start, mark), count in zip(pairwise(marks), step_counts(marks, self.h, self.unit), strict=True):
                part = (mark - start) / count
                memory_valid = last is not None and _same_step(part, last, start, self.unit)
                self.restarts += not (memory_valid or last is None)
                for i in range(count):
                    t = start + i * part
                    self.steps += 1
                    try:
                        if not (i or memory_valid):
                            memory = self.begin(t, q, v, part)
                        values = self.step(t, q, v, *memory, *lost, part)
                    except MethodError:
                        raise
                    except (ArithmeticError, ValueError) as fault:
                        raise MethodError(_divergence(method, self.steps, t, f" ({fault})")) from fault
                    if not (is_finite(values[0]) and is_finite(values[1])):
                        raise MethodError(_divergence(method, self.steps, t))
                    if recorder is not None:
                        rest = (start - t) + i * part if i else None  # t is rounded, the steps' sum is not
                        recorder.add(t, part, (q, v), values[:2], values, rest=rest)
                    end = 2 + memory_size
                    (q, v), memory, lost = values[:2], values[2:end], values[end : end + len(lost)]
                if not np.shape(q) == np.shape(v) == shape:
                    raise MethodError(misshapen(np.shape(v), shape))
                rows.append((mark, q, v, *lost))
                last = part

    def warn(self, stacklevel: int) -> None:
        """Warn if a multistep method's history has started anew at several times."""
        if self.restarts > FEW_RESTARTS and not self.method.one_step:
            warnings.warn(_restarted(self.method, self.restarts, self.steps), stacklevel=stacklevel + 1)


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


def check_count(span: Any, h: Any, name: str) -> None:
    """Raise MethodError if steps of length h, called ``name``, through the time ``span`` are too many."""
    with np.errstate(over="ignore"):
        try:
            count = float(abs(span) / h)
        except ArithmeticError:
            count = math.inf
    if not count <= MOST_STEPS:
        raise MethodError(f"Steps of {name} = {h!r} are too short: they would be {count:.3g} steps, and at most "
                          f"{MOST_STEPS:.0e} are allowed.")


def step_counts(marks: Sequence[Any], h: Any, unit: Any) -> list[int]:
    """Return the number of equal steps in each interval between times.

    Steps may be longer than h by the rounding of the times, of which ``unit`` is the relative size, and by no more than
    a thousandth.
    """
    counts = []
    for start, mark in pairwise(marks):
        excess = min(1e-3, max(1e-9, float(unit * (abs(start) + abs(mark)) / h)))
        counts.append(max(1, math.ceil(float(abs(mark - start) / h) - excess)))
    return counts


def _divergence(method: Method, step: int, t: Any, fault: str = "") -> str:
    """Return the error message for a step of a method whose result is not finite, that is, which has diverged."""
    unsolved = "Newton's method finds no solution of the stage equation, " if method.implicit else ""
    return (f"{method.name} left the finite range in step {step}, from t = {t}{fault}: {unsolved}"
            "the step is too long or the force is not finite there.")
