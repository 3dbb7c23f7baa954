"""Adaptive steps: embedded pairs under a PI controller that meets a tolerance, forward and backward in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from integrators.errors import shown
from integrators.method import Method, MethodError
from integrators.registry import METHODS
from integrators.solving.dense import Curve, Recorder, hermite
from integrators.solving.step_size import next_ratio, step_power
from integrators.solving.values import is_finite, is_real, like, misshapen, state
from integrators.steps.estimates import embedded_orders, has_estimates, order_of_estimate

LONGEST = 1e150
"""Longest duration in doubles. Where nothing accelerates, a step becomes as long, and its square must be finite."""
FINEST = 16 * 2.0**-53
"""Smallest rtol that is allowed in double precision, sixteen units of rounding."""


class StepSizeError(MethodError):
    """Error raised when only a step too short to change the time could meet the tolerance.

    Attributes:
        t: the time at which the integration stopped.
        h: length of the next step, which would have been too short.
    """

    def __init__(self, message: str, t: Any, h: Any) -> None:
        super().__init__(message, t, h)
        self.t, self.h = t, h

    def __str__(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of one step: an error of ``atol + rtol max(abs(y0), abs(y1))`` in each component y of q and v.

    The error of a step is measured in units of the tolerance, as the root mean square over all components
    (Hairer, Norsett & Wanner 1993, eq. II.4.11).

    Attributes:
        rtol: the relative tolerance.
        atol: the absolute tolerance, a number or an array of the shape of q and v.
        atol_v: that of v, if it is another one; None for the same.
        of_v: True measures the errors of v alone, see :mod:`integrators.solving.first_order`.
    """

    rtol: Any
    atol: Any
    atol_v: Any = None
    of_v: bool = False

    def check_rounding(self) -> None:
        """Check that double precision can meet the relative tolerance; raises MethodError if it is too small."""
        if self.rtol < FINEST:
            raise MethodError(f"rtol must be at least {FINEST:.2g} in double precision, not {shown(self.rtol)}.")

    def size(self, errors: Sequence[Any], before: Sequence[Any], after: Sequence[Any]) -> float:
        """Return the error of one step in units of the tolerance; the step is accepted if it is at most 1.

        ``errors`` holds the estimated errors of q and v, once for each embedded formula. Two formulas with errors E5
        and E3 give ``E5**2/sqrt(E5**2 + E3**2/100)`` (Hairer, Norsett & Wanner 1993, II.10).
        """
        squares = [self.square(errors[i : i + 2], before, after) for i in range(0, len(errors), 2)]
        if len(squares) == 1:
            return math.sqrt(squares[0])
        fine, coarse = (float(square) for square in squares)
        return fine / math.sqrt(fine + 0.01 * coarse) if fine else fine

    def square(self, pair: Sequence[Any], before: Sequence[Any], after: Sequence[Any]) -> Any:
        """Return the mean square of errors (of q and v) in units of the tolerance of a step.

        ``before`` and ``after`` are the states (q, v) at the ends of the step.
        """
        total: Any = 0
        atols, counted = (self.atol, self.atol if self.atol_v is None else self.atol_v), (1,) if self.of_v else (0, 1)
        for i in counted:
            value, old, new = pair[i], before[i], after[i]
            is_array = isinstance(value, np.ndarray)
            largest = np.maximum(abs(old), abs(new)) if is_array else max(abs(old), abs(new))
            ratio = value / (atols[i] + self.rtol * largest)
            total = total + (np.mean(ratio * ratio) if is_array else ratio * ratio)
        return total / len(counted)


def checked(
    method: Method, rtol: Any, atol: Any, shape: tuple[int, ...] | None = None, of_v: bool = False
) -> Tolerance:
    """Check rtol and atol for a method and return them as a Tolerance; if ``atol`` is None it equals ``rtol``.

    ``shape`` is that of q and v; ``atol`` may then be an array of this shape, or two arrays or numbers, for q and v.
    With None it must be a number. ``of_v`` is that of the Tolerance, where there are no two.

    Raises MethodError for a method without error estimates, or tolerances that are not positive.
    """
    if not has_estimates(method):
        pairs = ", ".join(name for name, other in METHODS.items() if has_estimates(other))
        raise MethodError(f"{method.name} does not estimate its error, so rtol cannot choose its steps; methods that "
                          f"do are {pairs}.")
    if not (is_real(rtol) and rtol > 0):
        raise MethodError(f"rtol must be a finite number above zero, not {shown(rtol)}.")
    if shape is None or not (isinstance(atol, (list, tuple)) or np.ndim(atol)):
        atol = rtol if atol is None else atol
        parts, fine = [atol], is_real(atol) and atol > 0
    else:
        try:
            like_q = np.shape(atol) == shape
        except ValueError:  # rows of several lengths, as of an array and a number
            like_q = False
        pair = not (of_v or like_q) and len(atol) == 2
        parts = [state(part, "atol") for part in (atol if pair else [atol])]
        shapes = ((), shape) if pair else (shape,)
        fine = all(np.shape(part) in shapes and is_finite(part) and np.all(part > 0) for part in parts)
    if not fine:
        two = ", or an array of them like y" if of_v else (
            ", an array of them like q, or two such arrays or numbers for q and for v")
        arrays = "" if shape is None else two
        raise MethodError(f"atol must be a finite number above zero{arrays}, not {shown(atol)}.")
    return Tolerance(rtol, parts[0], parts[1] if len(parts) == 2 else None, of_v)


class March:
    """Adaptive integration: the current state, the step-size control, and the numbers of steps.

    Args:
        method, step: an embedded pair, and its generated step function that also returns error estimates.
        slope: the acceleration.
        tolerance: the tolerance of one step.
        t, q, v: the state at the start.
        h: length of the first step to try; None: choose it automatically.
        recorder: stores the steps for dense output.
        longest: length of the longest step; by default there is none.

    Attributes:
        steps, rejected: number of steps taken, and number of steps rejected.
    """

    def __init__(
        self, method: Method, step: Callable[..., tuple[Any, ...]], slope: Callable[[Any, Any, Any], Any],
        tolerance: Tolerance, t: Any, q: Any, v: Any, h: Any = None, recorder: Recorder | None = None,
        longest: Any = math.inf,
    ) -> None:
        self.name, self.step, self.slope, self.tolerance = method.name, step, slope, tolerance
        self.order, self._estimates = order_of_estimate(method), 2 * len(embedded_orders(method))
        self.t, self.q, self.v, self.h = t, q, v, h
        self.longest = longest * (10**9 + 1) / (101 * 10**7)  # steps that end at a time may be longer by a hundredth
        self.steps = self.rejected = 0
        self._fault = ""
        self._recorder, self._step_values = recorder, ()

    def through(self, marks: Sequence[Any], zero: Any, rows: list[tuple[Any, ...]]) -> None:
        """Integrate through the times ``marks``, the first of which is the current one; append (t, q, v) at the others.

        ``zero`` is a zero of the number type to be used, ``rows`` the list to append to. Raises MethodError if the
        acceleration at the start is not finite, and StepSizeError if no step meets the tolerance.
        """
        shape = np.shape(self.q)
        if len(marks) > 1:
            self._start(marks[-1] - marks[0], zero)
        for mark in marks[1:]:
            self._to(mark)
            if np.shape(self.q) != shape:
                raise MethodError(misshapen(np.shape(self.q), shape))
            rows.append((mark, self.q, self.v))

    def _start(self, span: Any, zero: Any) -> None:
        """Compute the acceleration at the start of an integration and, unless given, the length of the first step."""
        self.sense, self.span, self._zero = 1 if span > 0 else -1, abs(span), zero
        if isinstance(zero, float) and self.span > LONGEST:
            raise MethodError(f"times may span at most {LONGEST:g} with rtol, not {float(self.span):g}; choose a "
                              "longer unit of time.")
        try:
            with np.errstate(all="ignore"):
                self.a = self.slope(self.t, self.q, self.v) + (self.q - self.q)
        except (ArithmeticError, ValueError) as fault:
            raise MethodError(f"The acceleration fails at the start, t = {self.t}: {fault}.") from fault
        if not is_finite(self.a):
            raise MethodError(
                f"The acceleration at the start, t = {self.t}, must be finite numbers, not {shown(self.a)}."
            )
        if np.shape(self.a) != np.shape(self.q):
            raise MethodError(misshapen(np.shape(self.a), np.shape(self.q)))
        self.h = min(self._first() if self.h is None else self.h, self.span, self.longest)
        self._last = 0.0

    def _first(self) -> Any:
        """Return a length for the first step, so short that Euler's method would have a small error in it.

        The algorithm is that of Hairer, Norsett & Wanner 1993, II.4, but for its first guess of 1e-6: here only a state
        below the tolerance, or one at rest, has no time scale of its own.
        """
        here, slope = (self.q, self.v), (self.v, self.a)

        def size(pair: Sequence[Any]) -> float:
            return math.sqrt(self.tolerance.square(pair, here, here))

        with np.errstate(all="ignore"):
            d0, d1 = size(here), size(slope)
            scale = 0.01 * d0 / d1 if d1 > 0.0 else math.inf
            h = min(like(self._zero, 1e-6 if d0 < 1e-5 or not scale < 1e300 else scale), self.span)
            signed_step = self.sense * h
            try:
                later = self.slope(self.t + signed_step, self.q + signed_step * self.v, self.v + signed_step * self.a)
                d2 = size((signed_step * self.a, later - self.a)) / float(h)
            except (ArithmeticError, ValueError):
                return h
        most = max(d1, d2)
        if not most < 1e300:
            return h
        other = step_power(0.01 / most, 1.0 / self.order) if most > 1e-15 else max(1e-6, 1e-3 * float(h))
        return min(100 * h, like(self._zero, other), self.span)

    def _to(self, mark: Any) -> None:
        """Take adaptive steps until the state is exactly at the time ``mark``."""
        last_accepted = True
        while self.t != mark:
            left = abs(mark - self.t)
            full_step = self.h + self.h / 100 < left
            if full_step:
                self._check()
            length = abs(self.t + self.sense * self.h - self.t) if full_step else left  # as the times are stored
            error, state = self._try(self.sense * length)
            if error <= 1.0:
                ratio = next_ratio(error, True, self._last, self.order)
                next_length = length * like(self._zero, ratio if last_accepted else min(1.0, ratio))
                self.h = min(next_length if full_step else max(next_length, self.h), self.longest)
                self.steps += 1
                if self._recorder is not None:
                    self.record(self._recorder, self.t, self.sense * length, (self.q, self.v, self.a), state)
                self.t = self.t + self.sense * length if full_step else mark
                self.q, self.v, self.a = state
                self._last = error if full_step else 0.0
            else:
                self.h = length * like(self._zero, next_ratio(error, False, 0.0, self.order))
                self._last = 0.0
                self.rejected += 1
            last_accepted = error <= 1.0

    def record(
        self, recorder: Recorder, t: Any, h: Any, before: Sequence[Any], after: Sequence[Any], rest: Any = None,
        earlier: float = math.inf,
    ) -> None:
        """Record the curves of one step of length h between two states (q, v, a), within the tolerance.

        A quintic that errs by more is replaced by the polynomial of degree 8 through the states at both ends and after
        half the step, then by that of degree 14 through five states, then by the curves of four steps of h/4. The
        method itself takes the shorter steps. ``earlier`` is the error of a quintic over four times the length: if the
        error is not half as large, rounding is all that is left of it. ``rest`` is the part of the start that t does
        not hold; None for none. Raises MethodError if the acceleration fails within the step.
        """
        (q, v, a), (q1, v1, a1) = before, after
        curve = recorder.curve(t, h, (q, v), (q1, v1), self._step_values, (a, a1), rest)
        if not recorder.quintic:
            recorder.put(curve)
            return
        try:
            states = [before, after]
            error = coarse = self._missed(curve, states)
            for _ in range(2):
                if not 1.0 < error < earlier / 2:
                    break
                states = self._halved(t, h, states)
                finer = recorder.joined(t, h, states, rest)
                if (smaller := self._missed(finer, states)) < error:
                    curve, error = finer, smaller
        except MethodError:
            raise
        except (ArithmeticError, ValueError) as fault:
            raise recorder.failed(t, h, fault) from fault
        if not 1.0 < error < earlier / 2:
            recorder.put(curve)
            return
        for k, (start, end) in enumerate(pairwise(states)):
            begin = t + k * h / 4
            rounded = (t - begin) + k * h / 4 if k else None
            more = rest if rounded is None else rounded if rest is None else rounded + rest
            self.record(recorder, begin, h / 4, start, end, more, coarse)

    def _halved(self, t: Any, h: Any, states: Sequence[Sequence[Any]]) -> list[Sequence[Any]]:
        """Return states (q, v, a) at equal distances within a step with those half way between them."""
        parts = len(states) - 1
        found = [states[0]]
        for k, (start, end) in enumerate(pairwise(states)):
            with np.errstate(all="ignore"):
                found += [self.step(t + k * h / parts, *start, h / parts / 2)[:3], end]
        return found

    def _missed(self, curve: Curve, states: Sequence[Sequence[Any]]) -> float:
        """Return the estimated error of a curve within a step, in units of the tolerance.

        The curve passes through ``states`` (q, v, a), and leaves out a multiple of the polynomial that is zero there
        with two derivatives. The acceleration at another place shows how much; see :class:`Hermite`.
        """
        rule, h = hermite(len(states) - 1), curve.h
        one = h / h
        at = one * rule.test.numerator / rule.test.denominator
        with np.errstate(all="ignore"):
            d = self.slope(curve.time(at), *curve.at(at)) - curve.slope(at)
        errors = (one * share.numerator / share.denominator * d for share in (rule.of_q, rule.of_v))
        return self.tolerance.size([h * h * next(errors), h * next(errors)], states[0][:2], states[-1][:2])

    def _try(self, h: Any) -> tuple[float, tuple[Any, ...]]:
        """Try one step; return its error in units of the tolerance, nan if not finite, and (q, v, a) at its end."""
        try:
            with np.errstate(all="ignore"):
                q, v, a, *errors = self._step_values = self.step(self.t, self.q, self.v, self.a, h)
                if not (is_finite(q) and is_finite(v) and is_finite(a)):
                    return float("nan"), ()
                return self.tolerance.size(errors[:self._estimates], (self.q, self.v), (q, v)), (q, v, a)
        except MethodError:
            raise
        except (ArithmeticError, ValueError) as fault:
            self._fault = f" ({fault})"
            return float("nan"), ()

    def _check(self) -> None:
        """Raise StepSizeError if the next step is so short that a sixteenth of it would not change the time."""
        if abs(self.t) + self.h / 16 == abs(self.t):
            raise StepSizeError(
                f"{self.name} cannot keep to rtol = {self.tolerance.rtol} at t = {self.t}{self._fault}: a step of "
                f"h = {float(self.h):.3g} is too short to be taken, and a longer one errs by more; "
                "the force jumps or is not finite there, or the tolerance is below rounding.", self.t, self.h,
            )
