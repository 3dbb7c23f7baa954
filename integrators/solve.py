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

from integrators.arrays import implicit_step
from integrators.energy_preserving import DiscreteGradient, averaged
from integrators.method import NEEDS, Acceleration, Method, MethodError, RungeKutta, System
from integrators.unroll import unroll

Step = Callable[..., tuple[Any, ...]]

MOST_STEPS = 10**10
"""Steps that one run may take: hours even for compiled code."""
PROBES = 8
"""Parts of the whole time at whose ends a bare function is probed for the velocity."""


@dataclass(frozen=True)
class Solution:
    """States at the wanted times: ``t``, ``q`` and ``v``, each with one entry (or row) per time.

    Arrays of float64 for floats and arrays; object arrays for other numbers, such as mpmath's.
    ``steps`` counts the steps taken.
    """

    t: Any
    q: Any
    v: Any
    method: str
    steps: int


def solve(
    acceleration: Acceleration | System,
    q: Any,
    v: Any,
    times: Sequence[Any],
    *,
    method: str | Method = "rk4",
    h: Any,
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
        h: the longest step allowed; each interval is cut into equal steps no longer than this.

    Raises:
        MethodError: unknown method, one that does not fit the problem, a state that is not finite numbers of
            one shape, an acceleration of another shape, ``h`` not finite and positive, times not monotonic, more than
            ``MOST_STEPS`` steps, or a step that left the finite range (it says at which time).
    """
    from integrators import get

    chosen = method if isinstance(method, Method) else get(method)
    if not (_is_real(h) and h > 0):
        raise MethodError(f"h must be a finite step above zero, not {h!r}; decreasing times run backwards.")
    marks = list(times) if isinstance(times, Iterable) else []
    if not marks or not all(_is_real(t) for t in marks):
        raise MethodError(f"times must hold at least one time, all of them finite, not {times!r}.")
    with np.errstate(over="ignore"):
        gaps = [late - early for early, late in pairwise(marks)]
    if not (all(gap > 0 for gap in gaps) or all(gap < 0 for gap in gaps)):
        raise MethodError("times must be strictly increasing or strictly decreasing.")
    if not (_is_finite(q) and _is_finite(v) and np.shape(q) == np.shape(v)):
        raise MethodError(f"q and v must be finite numbers or arrays of one shape, not {q!r} and {v!r}.")
    counts = _counts(gaps, h)
    zero = _zero(q, v, h, marks[0], *gaps)
    q, v = (value + zero if isinstance(value, (int, np.integer)) else value for value in (q, v))
    system = acceleration if isinstance(acceleration, System) else _bare(acceleration, marks, q, v)
    step = stepper(chosen, system, like=q + zero)

    shape = np.shape(q)
    rows = [(marks[0], q, v)]
    taken = 0
    for start, gap, count in zip(marks, gaps, counts, strict=False):
        part = gap / count
        carried: list[Any] | None = None
        for i in range(count):
            t = start + i * part
            taken += 1
            try:
                with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                    if carried is None:
                        carried = [_force(system)(t, q)] if chosen.carry else []
                    q, v, *carried = step(t, q, v, *carried, part)
            except (ArithmeticError, ValueError) as fault:
                raise MethodError(_divergence(chosen, taken, t, f" ({fault})")) from fault
            if not (_is_finite(q) and _is_finite(v)):
                raise MethodError(_divergence(chosen, taken, t))
        if not np.shape(q) == np.shape(v) == shape:
            raise MethodError(_misshapen(np.shape(v), shape))
        rows.append((start + gap, q, v))
    ts, qs, vs = (_column([row[k] for row in rows]) for k in range(3))
    return Solution(ts, qs, vs, method=chosen.name, steps=taken)


def _zero(*values: Any) -> Any:
    """Zero in the kind of number that the values make together; of arrays, an entry's kind."""
    kinds = {type(value): value - value for value in values if not isinstance(value, np.ndarray)}
    try:
        zero = sum(kinds.values())
    except TypeError:
        names = ", ".join(sorted(kind.__name__ for kind in kinds))
        raise MethodError(f"q, v, times and h must be numbers that add up, not {names}.") from None
    return 0.0 if isinstance(zero, (int, np.integer)) else zero


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


def _misshapen(found: tuple[int, ...], shape: tuple[int, ...]) -> str:
    """What to say of an acceleration that does not have the shape of the state."""
    return f"The acceleration must have the shape of q and v, {shape}, but makes {found} of it."


def _divergence(method: Method, step: int, t: Any, fault: str = "") -> str:
    """What to say of a step that did not end in finite numbers."""
    unsolved = "the stage equation has no solution that Newton's method finds, " if method.implicit else ""
    return (f"{method.name} left the finite range in step {step}, from t = {t}{fault}: {unsolved}"
            "the step is too long or the force is not finite there.")


def stepper(method: Method, system: System, like: Any = 0.0) -> Step:
    """The step function of a method on a system: ``step(t, q, v[, a], h)``, interpreted.

    ``like`` is a value of the number type to be used, which decides how the coefficients are rounded.
    Raises MethodError if the system does not offer what the method needs.
    """
    _check_fit(method, system)
    if method.implicit and isinstance(like, np.ndarray) and isinstance(method, (RungeKutta, DiscreteGradient)):
        return implicit_step(method, system)
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

    plain = isinstance(like, float) or (isinstance(like, np.ndarray) and like.dtype != object)
    exec(_program(method, bool(hooks)) if plain else unroll(method, hooks=hooks, number=constant), namespace)
    step: Step = namespace["step"]
    return step


@lru_cache(maxsize=256)
def _program(method: Method, drag: bool) -> CodeType:
    """The step in double precision, compiled once."""
    return compile(unroll(method, hooks={"drag": ()} if drag else {}), f"<{method.name}>", "exec")


def _force(system: System) -> Callable[[Any, Any], Any]:
    """The velocity-free part of the acceleration."""
    if system.force is not None:
        return system.force
    return lambda t, q: system.acceleration(t, q, q - q)


def _bare(acceleration: Acceleration, times: Sequence[Any], q: Any, v: Any) -> System:
    """A system from a function alone: the velocity's influence probed, derivatives by central differences.

    Probed near ``q`` and ``v``, at the first and the last time and evenly between.
    """
    if not callable(acceleration):
        raise MethodError("The problem must be a function a(t, q, v) or an integrators.System.")

    def jacobian(t: Any, q: Any, v: Any) -> tuple[Any, Any]:
        dq, dv = 1e-5 * (1 + abs(q)), 1e-5 * (1 + abs(v))
        return (
            (acceleration(t, q + dq, v) - acceleration(t, q - dq, v)) / (2 * dq),
            (acceleration(t, q, v + dv) - acceleration(t, q, v - dv)) / (2 * dv),
        )

    t, last = times[0], times[-1]
    try:
        with np.errstate(all="ignore"):
            first = acceleration(t, q, v)
    except (ArithmeticError, ValueError) as fault:
        raise MethodError(f"The acceleration fails at the start, t = {t}: {fault}.") from fault
    if not _is_finite(first):
        raise MethodError(f"The acceleration at the start, t = {t}, must be finite numbers, not {first!r}.")
    try:
        together = np.broadcast_shapes(np.shape(first), np.shape(q))
    except ValueError:
        together = np.shape(first)
    if together != np.shape(q):
        raise MethodError(_misshapen(np.shape(first), np.shape(q)))
    moments = [t, *(t + (last - t) * k / PROBES for k in range(1, PROBES)), last]
    places = (q, q + 0.5772157)
    velocity_free = all(_ignores_velocity(acceleration, when, place, v) for when in moments for place in places)
    mean, by_end = averaged(acceleration)
    return System(
        acceleration, velocity_free=velocity_free, jacobian=jacobian, mean_acceleration=mean, mean_jacobian=by_end
    )


def _ignores_velocity(acceleration: Acceleration, t: Any, q: Any, v: Any) -> bool:
    """False if the acceleration differs between four velocities here, or exists only for some of them."""
    found: list[Any] = []
    for w in (v, v + 0.7390851, -v - 1.2020569, v - v):
        try:
            with np.errstate(all="ignore"):
                found.append(acceleration(t, q, w))
        except (ArithmeticError, ValueError):
            found.append(math.nan)
    exists = [_is_finite(a) for a in found]
    return not any(exists) or (all(exists) and all(bool(np.all(found[0] == a)) for a in found))


def _check_fit(method: Method, system: System) -> None:
    """Raises MethodError with what is missing and methods that would fit."""
    from integrators import fitting

    missing = method.needs - system.offers()
    if missing:
        wants = " and ".join(NEEDS[need] for need in sorted(missing))
        fits = ", ".join(list(fitting(system))[:6])
        raise MethodError(f"{method.name} needs {wants}, which this problem does not offer; {fits} fit.")


def _is_finite(value: Any) -> bool:
    """Finite in all entries, for any kind of number; False for what is no number."""
    if isinstance(value, float):
        return math.isfinite(value)
    try:
        if isinstance(value, (int, np.ndarray, np.generic)):
            return bool(np.all(np.isfinite(value)))
        return bool(value - value == 0)
    except TypeError:
        return False


def _is_real(value: Any) -> bool:
    """Finite, and one number that can be put in order with others."""
    try:
        return _is_finite(value) and np.ndim(value) == 0 and bool(value > 0 or value <= 0)
    except TypeError:
        return False


def _column(values: list[Any]) -> Any:
    """One array per quantity; numbers of other kinds stay themselves."""
    if isinstance(values[-1], (float, int, np.generic, np.ndarray)):
        return np.array(values, dtype=float)
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column
