"""Orders and changes of area as a step shows them, measured in 40-digit arithmetic.

Measured on a driven, nonlinear, optionally damped pendulum, because linear problems flatter methods; this needs mpmath.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise
from types import MappingProxyType, ModuleType
from typing import Any

from integrators.analysis.linear import single_step
from integrators.analysis.series import horner
from integrators.families import taylor
from integrators.method import Method, MethodError, System
from integrators.registry import named
from integrators.solving.solve import solve

DAMPING: Mapping[str | None, tuple[float, float]] = MappingProxyType(
    {None: (0.0, 0.0), "linear": (0.25, 0.0), "quadratic": (0.0, 0.375)}
)
"""Damping of the test pendulum by name: linear gamma [1/s] and quadratic c [1/rad]."""
DRIVE, DRIVE_FREQUENCY = 1.5, 2.0
START = (0.25, 0.5, 1.0)
"""Time, angle and velocity at the start; all numbers of the test problem are exact in binary."""
SPAN = 0.75
"""Over this time the velocity keeps its sign in every variant, so that quadratic drag has no kink."""


def driven_pendulum(damped: str | None = None, functions: Any = None) -> System:
    """The test problem ``q'' = -sin q + 1.5 cos 2t - gamma v - c |v| v``, offering all a method may need.

    Args:
        damped: None, "linear" (gamma = 1/4) or "quadratic" (c = 3/8).
        functions: where ``sin``, ``cos`` and ``exp`` come from: math, numpy or mpmath (the default).

    Raises MethodError for another kind of damping.
    """
    gamma, c = _damping(damped)
    m = mpmath_module() if functions is None else functions

    def force(t: Any, q: Any, m: Any = m) -> Any:
        return DRIVE * m.cos(DRIVE_FREQUENCY * t) - m.sin(q)

    flows = {
        "linear": lambda t, q, v, h: v * m.exp(-gamma * h),
        "quadratic": lambda t, q, v, h: v / (1 + c * abs(v) * h),
    }
    def mean(t: Any, q: Any, v: Any, s: Any) -> Any:
        apart = s + 1e-300 * (s == 0)
        return DRIVE * m.cos(DRIVE_FREQUENCY * t) - m.sin(q) * m.sin(apart) / apart - gamma * v - c * abs(v) * v

    def mean_jacobian(t: Any, q: Any, v: Any, s: Any) -> tuple[Any, Any]:
        apart = s + 1e-300 * (s == 0)
        share = m.sin(apart) / apart
        return -m.cos(q) * share - m.sin(q) * (m.cos(apart) - share) / apart, -gamma - 2 * c * abs(v)

    return System(
        acceleration=lambda t, q, v: force(t, q) - gamma * v - c * abs(v) * v,
        force=force,
        velocity_free=damped is None,
        dissipative_flow=None if damped is None else flows[damped],
        jacobian=lambda t, q, v: (-m.cos(q), -gamma - 2 * c * abs(v)),
        mean_acceleration=mean,
        mean_jacobian=mean_jacobian,
        taylor_coefficients=taylor.coefficients(lambda t, q, v: force(t, q, taylor) - gamma * v - c * abs(v) * v),
    )


def observed_order(method: str | Method, *, damped: str | None = None, digits: int | None = None) -> float:
    """The order a method shows: the slope of log error against log h on :func:`driven_pendulum`.

    The error is the distance in (q, v) to :func:`reference` at the end of a fixed time, for four lengths of
    step; errors within six digits of round-off are dropped. Where the slopes between them differ, the leading term does
    not rule yet: then time and steps are shortened, up to three times, to an eighth. Symmetric methods of many steps
    have other solutions, whose share falls with the number of steps alone: of these there are many.

    Args:
        method: name or Method.
        damped: None, "linear" or "quadratic"; splitting methods get the damping as its exact flow.
        digits: decimal digits of the arithmetic, by default 40 or what a high order asks for; twelve more each time
            that the steps are shortened.

    Raises MethodError for an unknown name or damping, a method that cannot take this problem, or fewer than
    three errors above round-off.
    """
    digits = _digits(method, -8) if digits is None else digits
    wavy = named(method).parasitic
    for shorter in range(1 if wavy else 4):
        points = _errors(method, damped, digits + 12 * shorter, SPAN / 8**shorter)
        if len(points) < 3:
            raise MethodError(f"{digits} digits leave {len(points)} errors above round-off; ask for more digits.")
        slopes = _slopes(points)
        if max(slopes) - min(slopes) < 0.04:
            break
    return _slope(points)


def _errors(method: str | Method, damped: str | None, digits: int, span: float) -> list[tuple[float, float]]:
    """Logarithms of step and error after the time ``span``, for those errors that stand out of round-off."""
    mpmath = mpmath_module()
    wavy = named(method).parasitic
    counts, digits = ((250, 1000, 4000), max(digits, 5 * named(method).order)) if wavy else ((32, 48, 72, 108), digits)
    points = []
    with mpmath.workdps(digits):
        t, q, v = (mpmath.mpf(x) for x in START)
        truth = reference(damped, digits, span)
        for steps in counts:
            h = mpmath.mpf(span) / steps
            found = solve(driven_pendulum(damped), q, v, [t, t + span], method=method, h=h)
            error = mpmath.hypot(found.q[-1] - truth[0], found.v[-1] - truth[1])
            if error > mpmath.mpf(10) ** (6 - digits):
                points.append((float(mpmath.log(h)), float(mpmath.log(error))))
    return points


@lru_cache(maxsize=64)
def reference(damped: str | None = None, digits: int = 40, span: float = SPAN) -> tuple[Any, Any]:
    """State of :func:`driven_pendulum` after the time ``span``, by Taylor series of order ``digits + 8``.

    The coefficients obey the recurrences of Jorba & Zou 2005 (Experimental Mathematics 14, 99); the velocity
    must stay positive. Raises MethodError for an unknown kind of damping.
    """
    mpmath = mpmath_module()
    gamma, c = _damping(damped)
    pieces = math.ceil(12 * span / SPAN)
    with mpmath.workdps(digits + 8):
        t, q, v = (mpmath.mpf(x) for x in START)
        h = mpmath.mpf(span) / pieces
        for _ in range(pieces):
            Q, V, S, C = [q], [v], [mpmath.sin(q)], [mpmath.cos(q)]
            phase, scale = DRIVE_FREQUENCY * t, mpmath.mpf(DRIVE)
            for k in range(digits + 8):
                drive = scale * mpmath.cos(phase + k * mpmath.pi / 2)
                square = sum(V[i] * V[k - i] for i in range(k + 1))
                Q.append(V[k] / (k + 1))
                V.append((drive - S[k] - gamma * V[k] - c * square) / (k + 1))
                S.append(sum((i + 1) * Q[i + 1] * C[k - i] for i in range(k + 1)) / (k + 1))
                C.append(-sum((i + 1) * Q[i + 1] * S[k - i] for i in range(k + 1)) / (k + 1))
                scale *= DRIVE_FREQUENCY / mpmath.mpf(k + 1)
            t, q, v = t + h, horner(Q, h), horner(V, h)
    return q, v


def observed_dense_order(
    method: str | Method, theta: float, *, damped: str | None = None, digits: int = 60
) -> float:
    """The order that dense output shows in one step on :func:`driven_pendulum`, at a share of it.

    One less than the slope of log error against log h, between a step so short that its error is about 1e-30, which
    stands out of the rounding of coefficients to 40 decimals, and its half.

    Args:
        method: name or Method.
        theta: where in the step, between 0 and 1.
        damped: None, "linear" or "quadratic".
        digits: decimal digits of the arithmetic.

    Raises MethodError for an unknown name or damping, or a method that cannot take this problem.
    """
    mpmath = mpmath_module()
    errors = []
    with mpmath.workdps(digits):
        t, q, v = (mpmath.mpf(x) for x in START)
        longest = 2.0 ** -(90 // (named(method).dense_order + 1))
        for h in (longest, longest / 2):
            way = solve(driven_pendulum(damped), q, v, [t, t + h], method=method, h=h, dense=True)
            found, truth = way(t + theta * h), reference(damped, digits, theta * h)
            errors.append(mpmath.hypot(found[0] - truth[0], found[1] - truth[1]))
        return float(mpmath.log(errors[0] / errors[1], 2)) - 1.0


def jacobian_determinant(
    method: str | Method, q: Any, v: Any, t: Any, h: Any, *, damped: str | None = None, digits: int = 40
) -> Any:
    """Determinant of one step's Jacobian ``d(q1, v1)/d(q, v)`` on :func:`driven_pendulum`: the area's change.

    It is 1 for symplectic methods without damping, and ``exp(-gamma h)`` for those that keep the true rate of
    contraction under linear damping. Central differences of width ``10**-digits`` in three times the digits.

    Args:
        method: name or Method.
        q, v, t, h: state, time and step, dimensionless; numbers or strings that mpmath reads.
        damped: None, "linear" or "quadratic".
        digits: correct decimal digits of the result, an mpmath number.

    Raises MethodError for an unknown name or damping.
    """
    mpmath = mpmath_module()
    with mpmath.workdps(3 * digits + 10):
        q, v, t, h = (mpmath.mpf(x) for x in (q, v, t, h))
        step, d = single_step(named(method), driven_pendulum(damped), q), mpmath.mpf(10) ** -digits
        (qa, va), (qb, vb) = step(t, q + d, v, h), step(t, q - d, v, h)
        (qc, vc), (qd, vd) = step(t, q, v + d, h), step(t, q, v - d, h)
        return ((qa - qb) * (vc - vd) - (qc - qd) * (va - vb)) / (4 * d * d)


def area_order(method: str | Method, *, digits: int = 40) -> float:
    """The power of h with which one undamped step's area change vanishes; inf for symplectic methods.

    A step of order p changes areas by O(h**(p + 1)) or less. Steps of high orders are longer, for it to show; those of
    multistep methods, which take five ``digits`` for each order, are shorter where the leading term does not rule yet.
    Raises MethodError for an unknown name.
    """
    chosen = named(method)
    shortens = not chosen.one_step
    digits = max(digits, 5 * chosen.order) if shortens else digits
    for longer in (1, 8, 64):
        points = _area_changes(chosen, 1024 // longer, digits)
        if len(points) > 1:
            break
    else:
        return math.inf
    for shorter in (8, 64) if shortens else ():
        slopes = _slopes(points)
        if max(slopes) - min(slopes) < 0.04:
            break
        points = _area_changes(chosen, 1024 * shorter, digits + 12)
    return _slope(points)


def _area_changes(method: Method, most: int, digits: int) -> list[tuple[float, float]]:
    """Logarithms of step and change of area, for the steps ``4/most, 2/most, 1/most``, where that is no rounding."""
    mpmath = mpmath_module()
    _, q, v = START
    points = []
    for steps in (most // 4, most // 2, most):
        change = abs(jacobian_determinant(method, q, v, START[0], 1.0 / steps, digits=digits) - 1)
        if change > mpmath.mpf(10) ** (6 - digits):
            points.append((-math.log(steps), float(mpmath.log(change))))
    return points


def _digits(method: str | Method, beside: int) -> int:
    """Decimal digits in which errors of a method's order stand out."""
    order = named(method).order
    return max(40, 4 * order + beside) if 10 < order < math.inf else 40


def _slope(points: list[tuple[float, float]]) -> float:
    """Mean of the slopes between neighbours, weighted towards the finest, where the leading term rules."""
    slopes = _slopes(points)
    return sum((k + 1) * slope for k, slope in enumerate(slopes)) / sum(range(1, len(slopes) + 1))


def _slopes(points: list[tuple[float, float]]) -> list[float]:
    return [(y - z) / (x - w) for (x, y), (w, z) in pairwise(points)]


def _damping(damped: str | None) -> tuple[float, float]:
    if damped not in DAMPING:
        raise MethodError(f"There is no damping {damped!r}; there are {', '.join(map(repr, DAMPING))}.")
    return DAMPING[damped]


def mpmath_module() -> ModuleType:
    """mpmath, imported when the 40 digits are asked for."""
    try:
        import mpmath
    except ImportError as missing:
        raise ImportError("Measuring in 40 digits needs mpmath: pip install mpmath.") from missing
    module: ModuleType = mpmath
    return module
