"""Run a method on any problem: floats, NumPy arrays, mpmath numbers; forward and backward in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from types import CodeType
from typing import Any

import numpy as np

from integrators.adaptive import March, checked
from integrators.arrays import array_solvers, implicit_step
from integrators.energy_preserving import DiscreteGradient
from integrators.method import NEEDS, Acceleration, Method, MethodError, RungeKutta, System
from integrators.multistep import Multistep
from integrators.probing import bare, counted
from integrators.unroll import unroll
from integrators.values import column, is_finite, is_real, misshapen, zero_of

Step = Callable[..., tuple[Any, ...]]
Begin = Callable[[Any, Any, Any, Any], tuple[Any, ...]]

MOST_STEPS = 10**10
"""Steps that one run may take: hours even for compiled code."""


@dataclass(frozen=True)
class Solution:
    """States at the wanted times: ``t``, ``q`` and ``v``, each with one entry (or row) per time.

    Arrays of float64 for floats and arrays; object arrays for other numbers, such as mpmath's.
    ``steps`` counts the steps taken, ``rejected`` those tried in vain under a tolerance, and ``evaluations`` how often
    the acceleration or a part of it was asked for, without finding out what a bare function depends on.
    """

    t: Any
    q: Any
    v: Any
    method: str
    steps: int
    rejected: int = 0
    evaluations: int = 0


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
) -> Solution:
    """Integrate ``q'' = a(t, q, v)`` from ``(q, v)`` at ``times[0]`` through all ``times``.

    Args:
        acceleration: ``a(t, q, v)`` in units of q per time squared, or a :class:`System` that offers more. Whether a
            bare function depends on the velocity is found by trying it: near the given q and v, at nine times from the
            first to the last. One that depends on it only elsewhere must be given as a System.
        q, v: state at ``times[0]``: floats, arrays of one shape, or any numbers with arithmetic (mpmath). The method's
            coefficients have the precision of the finest of q, v, times and h.
        times: at least one time, strictly increasing or strictly decreasing.
        method: a name of :data:`integrators.METHODS` or a Method.
        h: the longest step allowed; each interval is cut into equal steps no longer than this. With ``rtol`` the first
            step to try, which may be left out.
        rtol, atol: a step of an embedded pair may err by ``atol + rtol max(abs(y0), abs(y1))`` in each y of q and v, as
            a root mean square; steps are as long as that allows, and end at all ``times``. Without ``atol`` it is
            ``rtol``, which suits values near one. See :mod:`integrators.adaptive`.

    Raises:
        MethodError: unknown method, one that does not fit the problem, a state that is not finite numbers of
            one shape, an acceleration of another shape, ``h`` not finite and positive, times not monotonic, more than
            ``MOST_STEPS`` steps, a step that left the finite range (it says at which time), neither ``h`` nor ``rtol``,
            ``rtol`` for a method without estimates; StepSizeError where steps become too short to meet a tolerance.
    """
    from integrators import get

    chosen = method if isinstance(method, Method) else get(method)
    if h is None and rtol is None:
        raise MethodError("h must be a finite step above zero, not None; only rtol could choose steps instead.")
    if atol is not None and rtol is None:
        raise MethodError("atol goes with rtol, which is missing.")
    if h is not None and not (is_real(h) and h > 0):
        raise MethodError(f"h must be a finite step above zero, not {h!r}; decreasing times run backwards.")
    tolerance = None if rtol is None else checked(chosen, rtol, atol)
    marks = list(times) if isinstance(times, Iterable) else []
    if not marks or not all(is_real(t) for t in marks):
        raise MethodError(f"times must hold at least one time, all of them finite, not {times!r}.")
    with np.errstate(over="ignore"):
        gaps = [late - early for early, late in pairwise(marks)]
    if not (all(gap > 0 for gap in gaps) or all(gap < 0 for gap in gaps)):
        raise MethodError("times must be strictly increasing or strictly decreasing.")
    if not (is_finite(q) and is_finite(v) and np.shape(q) == np.shape(v)):
        raise MethodError(f"q and v must be finite numbers or arrays of one shape, not {q!r} and {v!r}.")
    counts = _counts(gaps, h) if rtol is None else []
    zero = zero_of(marks[0], *gaps, *(value for value in (q, v, h, rtol, atol) if value is not None))
    q, v = (value + zero if isinstance(value, (int, np.integer)) else value for value in (q, v))
    if tolerance is not None and _is_double(q + zero):
        tolerance.check_rounding()
    system = acceleration if isinstance(acceleration, System) else bare(acceleration, marks, q, v)
    calls = [0]
    system = counted(system, calls)
    step, begin = stepper(chosen, system, like=q + zero, estimates=tolerance is not None)
    if tolerance is None:
        rows, taken = _equal_steps(chosen, step, begin, marks, gaps, counts, q, v)
        rejected = 0
    else:
        march = March(chosen, step, system.acceleration, tolerance, marks[0], q, v, h)
        rows = march.through(marks, zero)
        taken, rejected = march.steps, march.rejected
    ts, qs, vs = (column([row[k] for row in rows]) for k in range(3))
    return Solution(ts, qs, vs, chosen.name, steps=taken, rejected=rejected, evaluations=calls[0])


def _equal_steps(
    chosen: Method, step: Step, begin: Begin, marks: Sequence[Any], gaps: Sequence[Any], counts: Sequence[int],
    q: Any, v: Any,
) -> tuple[list[tuple[Any, Any, Any]], int]:
    """The states at the marks, each interval cut into so many equal steps, and how many steps that took."""
    shape = np.shape(q)
    rows = [(marks[0], q, v)]
    taken = 0
    last: Any = None
    memory: Sequence[Any] = ()
    for start, gap, count in zip(marks, gaps, counts, strict=False):
        part = gap / count
        going_on = last is not None and _same_step(part, last, start)
        for i in range(count):
            t = start + i * part
            taken += 1
            try:
                with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                    if not (i or going_on):
                        memory = begin(t, q, v, part)
                    q, v, *memory = step(t, q, v, *memory, part)
            except (ArithmeticError, ValueError) as fault:
                raise MethodError(_divergence(chosen, taken, t, f" ({fault})")) from fault
            if not (is_finite(q) and is_finite(v)):
                raise MethodError(_divergence(chosen, taken, t))
        if not np.shape(q) == np.shape(v) == shape:
            raise MethodError(misshapen(np.shape(v), shape))
        rows.append((start + gap, q, v))
        last = part
    return rows, taken


def _same_step(part: Any, last: Any, t: Any) -> bool:
    """True if two steps differ by no more than the rounding of times, so that a memory serves on."""
    return bool(part == last) or (_is_double(part) and abs(part - last) <= 2.0**-51 * (abs(t) + abs(part)))


def _is_double(value: Any) -> bool:
    """True for numbers and arrays in double precision."""
    return isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype != object)


def _counts(gaps: Sequence[Any], h: Any) -> list[int]:
    """Steps in each interval; MethodError if there are too many."""
    sizes = []
    for gap in gaps:
        try:
            with np.errstate(over="ignore"):
                sizes.append(float(abs(gap) / h))
        except ArithmeticError:
            sizes.append(math.inf)
    if not sum(sizes) <= MOST_STEPS:
        raise MethodError(
            f"Steps of h = {h!r} are too short: these times take {sum(sizes):.3g} of them, and {MOST_STEPS:.0e} can be."
        )
    return [max(1, math.ceil(size - 1e-9)) for size in sizes]


def _divergence(method: Method, step: int, t: Any, fault: str = "") -> str:
    """What to say of a step that did not end in finite numbers."""
    unsolved = "the stage equation has no solution that Newton's method finds, " if method.implicit else ""
    return (f"{method.name} left the finite range in step {step}, from t = {t}{fault}: {unsolved}"
            "the step is too long or the force is not finite there.")


def stepper(method: Method, system: System, like: Any = 0.0, estimates: bool = False) -> tuple[Step, Begin]:
    """A method on a system, interpreted: ``step(t, q, v, *memory, h)`` and ``begin(t, q, v, h) -> memory``.

    ``like`` is a value of the number type to be used, which decides how the coefficients are rounded. With
    ``estimates`` the step also returns its estimated errors; see :mod:`integrators.estimates`.
    Raises MethodError if the system does not offer what the method needs.
    """
    _check_fit(method, system)
    if method.implicit and isinstance(like, np.ndarray) and isinstance(method, (RungeKutta, DiscreteGradient)):
        return implicit_step(method, system), _nothing
    namespace: dict[str, Any] = {
        "acceleration": system.acceleration,
        "force": _force(system),
        "jacobian": system.jacobian,
        "mean_acceleration": system.mean_acceleration,
        "mean_jacobian": system.mean_jacobian,
        "NAN": math.nan,
    }
    hooks: dict[str, tuple[str, ...]] = {}
    if system.dissipative_flow is not None:
        hooks["drag"] = ()
        namespace["drag"] = system.dissipative_flow

    def constant(value: Fraction) -> str:
        """A coefficient in the problem's own numbers, at their precision."""
        name = f"c{value.numerator}_{value.denominator}".replace("-", "m")
        namespace[name] = (like - like + 1) * value.numerator / value.denominator
        return name

    source: CodeType | str = _program(method, bool(hooks), estimates) if _is_double(like) else unroll(
        method, hooks=hooks, number=constant, estimates=estimates)
    exec(source, namespace)
    if isinstance(method, Multistep) and method.implicit and isinstance(like, np.ndarray):
        namespace |= array_solvers(method, system)
    found = namespace.get("begin", _nothing)
    single = len(method.memory) == 1
    return namespace["step"], (lambda t, q, v, h: (found(t, q, v, h),)) if single else found


def _nothing(t: Any, q: Any, v: Any, h: Any) -> tuple[Any, ...]:
    """The memory of a method that has none."""
    return ()


@lru_cache(maxsize=256)
def _program(method: Method, drag: bool, estimates: bool) -> CodeType:
    """The step in double precision, compiled once."""
    source = unroll(method, hooks={"drag": ()} if drag else {}, estimates=estimates)
    return compile(source, f"<{method.name}>", "exec")


def _force(system: System) -> Callable[[Any, Any], Any]:
    """The velocity-free part of the acceleration."""
    if system.force is not None:
        return system.force
    return lambda t, q: system.acceleration(t, q, q - q)


def _check_fit(method: Method, system: System) -> None:
    """Raises MethodError with what is missing and methods that would fit."""
    from integrators import fitting

    missing = method.needs - system.offers()
    if missing:
        wants = " and ".join(NEEDS[need] for need in sorted(missing))
        fits = ", ".join(list(fitting(system))[:6])
        raise MethodError(f"{method.name} needs {wants}, which this problem does not offer; {fits} fit.")
