"""Order and change of phase-space area of a method, measured from its steps in 40-digit arithmetic.

The test problem is a driven, nonlinear, optionally damped pendulum, because some methods have a higher order on linear
problems. The measurements need mpmath.
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
from integrators.solving.solve import solve_unchecked

DAMPING: Mapping[str | None, tuple[float, float]] = MappingProxyType(
    {None: (0.0, 0.0), "linear": (0.25, 0.0), "quadratic": (0.0, 0.375)}
)
"""Damping of the test pendulum by name: linear gamma [1/s] and quadratic c [1/rad]."""
DRIVE, DRIVE_FREQUENCY = 1.5, 2.0
START = (0.25, 0.5, 1.0)
"""Time, angle and velocity at the start of the test problem, whose numbers are all exact in binary."""
SPAN = 0.75
"""Duration of the test problem, short enough that the velocity keeps its sign and quadratic drag has no kink."""


def driven_pendulum(damped: str | None = None, functions: Any = None) -> System:
    """Return the test problem ``q'' = -sin q + 1.5 cos 2t - gamma v - c |v| v`` with all functions a method may need.

    Args:
        damped: None, "linear" (gamma = 1/4) or "quadratic" (c = 3/8).
        functions: the module that provides ``sin``, ``cos`` and ``exp``: math, numpy or mpmath (the default).

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
    """Return the observed order of a method: the slope of log error against log h on :func:`driven_pendulum`.

    The error is the distance in (q, v) to :func:`reference` at the end of a fixed time, for four step lengths. Errors
    within six digits of round-off are dropped. If the slopes differ, the leading error term does not dominate yet;
    duration and steps are then divided by 8, up to three times. Symmetric multistep methods have parasitic solutions
    that shrink only with the number of steps, so they take up to 4000 steps.

    Args:
        method: name or Method.
        damped: None, "linear" or "quadratic"; splitting methods get the damping as its exact flow.
        digits: decimal digits of the arithmetic; None: 40, or more for a high order. Twelve digits are added each time
            the steps are shortened.

    Raises MethodError for an unknown name or damping, a method that cannot take this problem, or fewer than
    three errors above round-off.
    """
    digits = _digits(method, -8) if digits is None else digits
    parasitic = named(method).parasitic
    for shorter in range(1 if parasitic else 4):
        points = _errors(method, damped, digits + 12 * shorter, SPAN / 8**shorter)
        if len(points) < 3:
            raise MethodError(f"{digits} digits leave only {len(points)} errors above round-off; increase digits.")
        slopes = _slopes(points)
        if max(slopes) - min(slopes) < 0.04:
            break
    return _slope(points)


def _errors(method: str | Method, damped: str | None, digits: int, span: float) -> list[tuple[float, float]]:
    """Return points (log step, log error) of a method on the test problem after the time ``span``.

    Errors near round-off are left out.
    """
    mpmath = mpmath_module()
    parasitic = named(method).parasitic
    counts = (250, 1000, 4000) if parasitic else (32, 48, 72, 108)
    digits = max(digits, 5 * named(method).order) if parasitic else digits
    points = []
    with mpmath.workdps(digits):
        t, q, v = (mpmath.mpf(x) for x in START)
        truth = reference(damped, digits, span)
        for steps in counts:
            h = mpmath.mpf(span) / steps
            solution = solve_unchecked(method, driven_pendulum(damped), q, v, [t, t + span], h=h)
            error = mpmath.hypot(solution.q[-1] - truth[0], solution.v[-1] - truth[1])
            if error > mpmath.mpf(10) ** (6 - digits):
                points.append((float(mpmath.log(h)), float(mpmath.log(error))))
    return points


@lru_cache(maxsize=64)
def reference(damped: str | None = None, digits: int = 40, span: float = SPAN) -> tuple[Any, Any]:
    """Return the state (q, v) of :func:`driven_pendulum` after the time ``span``, by Taylor series.

    The series have the order ``digits + 8``. Their coefficients obey the recurrences of Jorba & Zou 2005 (Experimental
    Mathematics 14, 99); the velocity must stay positive. Raises MethodError for an unknown kind of damping.
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
    """Return the observed order of a method's dense output at the fraction ``theta`` of one step.

    The order is the slope of log error against log h on :func:`driven_pendulum`, minus one, for a step and half of it.
    The step is so short that the error is about 1e-30, well above the rounding of coefficients to 40 decimals.

    Args:
        method: name or Method.
        theta: fraction of the step, between 0 and 1.
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
            solution = solve_unchecked(method, driven_pendulum(damped), q, v, [t, t + h], h=h, dense=True)
            state, truth = solution(t + theta * h), reference(damped, digits, theta * h)
            errors.append(mpmath.hypot(state[0] - truth[0], state[1] - truth[1]))
        return float(mpmath.log(errors[0] / errors[1], 2)) - 1.0


def jacobian_determinant(
    method: str | Method, q: Any, v: Any, t: Any, h: Any, *, damped: str | None = None, digits: int = 40
) -> Any:
    """Return the factor by which one step on :func:`driven_pendulum` changes areas in phase space.

    It is the determinant of the step's Jacobian ``d(q1, v1)/d(q, v)``: 1 for symplectic methods without damping, and
    ``exp(-gamma h)`` for methods that keep the true rate of contraction under linear damping. The derivatives are
    central differences of width ``10**-digits`` in three times as many digits.

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
    """Return the power of h with which one undamped step's change of phase-space area vanishes; inf: symplectic.

    A step of order p changes areas by O(h**(p + 1)) or less. If the change is below round-off, longer steps are taken.
    Multistep methods use at least five ``digits`` per order, and shorter steps until the leading term dominates.
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
    """Return points (log step, log area change) of a method, for three steps: 4/most, 2/most and 1/most.

    Changes that are round-off are left out.
    """
    mpmath = mpmath_module()
    _, q, v = START
    points = []
    for steps in (most // 4, most // 2, most):
        change = abs(jacobian_determinant(method, q, v, START[0], 1.0 / steps, digits=digits) - 1)
        if change > mpmath.mpf(10) ** (6 - digits):
            points.append((-math.log(steps), float(mpmath.log(change))))
    return points


def _digits(method: str | Method, beside: int) -> int:
    """Return the decimal digits of arithmetic in which the errors of a method of its order exceed round-off."""
    order = named(method).order
    return max(40, 4 * order + beside) if 10 < order < math.inf else 40


def _slope(points: list[tuple[float, float]]) -> float:
    """Return the mean slope of a line through points (log h, log error), weighted towards the shortest steps."""
    slopes = _slopes(points)
    return sum((k + 1) * slope for k, slope in enumerate(slopes)) / sum(range(1, len(slopes) + 1))


def _slopes(points: list[tuple[float, float]]) -> list[float]:
    """Return the slopes (orders) between neighbouring points (log h, log error)."""
    return [(y - z) / (x - w) for (x, y), (w, z) in pairwise(points)]


def _damping(damped: str | None) -> tuple[float, float]:
    """Return the linear and the quadratic damping rate of a named kind of damping; MethodError if it is unknown."""
    if damped not in DAMPING:
        raise MethodError(f"There is no damping {damped!r}; choose from {', '.join(map(repr, DAMPING))}.")
    return DAMPING[damped]


def mpmath_module() -> ModuleType:
    """Import mpmath on first use and return it; raises ImportError with the install command if it is missing."""
    try:
        import mpmath
    except ImportError as missing:
        raise ImportError("Measuring in 40 digits needs mpmath: pip install mpmath.") from missing
    module: ModuleType = mpmath
    return module
