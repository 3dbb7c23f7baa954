"""Matrix, amplification and stability limits of one step on the harmonic oscillator.

One step on ``theta'' = -omega0**2 theta`` is a matrix in ``z = omega0 h`` that acts on ``(theta, velocity/omega0)``.
The matrix is computed in exact rational arithmetic from the stability polynomials of a method
(:class:`integrators.Method`), its characteristic polynomials, or the matrix that the method states. For a method that
states none of these, such as a splitting, the step is taken on power series.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache, lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.analysis.multistep_linear import drag_limit, memory_matrix, oscillation_limit
from integrators.analysis.series import PowerSeries
from integrators.families.exact_flow import oscillator_flow
from integrators.families.taylor import coefficients
from integrators.method import NEEDS, Method, MethodError, System
from integrators.registry import named
from integrators.solving.stepper import Step, stepper
from integrators.steps.terms import literal
from integrators.steps.unroll import unroll
from integrators.tables.butcher import extrapolated_midpoint

Polynomial = Sequence[Fraction]
"""Coefficients of a polynomial, lowest power first."""
POLISHINGS = 3
"""Newton steps that refine a floating-point root; after the first the error is 1e-10 for a polynomial of degree 48."""


def single_step(method: Method, system: System, like: Any = 0.0) -> Step:
    """Return a function ``(q, v) = step(t, q, v, h)`` that takes one step of any method from (q, v) alone.

    For a multistep method every call first computes the history, by steps of a one-step method backwards in time from
    (q, v). For a method that passes a force from one step to the next, every call computes the force anew.

    ``like`` is a value of the number type to be used, as for :func:`integrators.solve.stepper`.
    """
    step, begin = stepper(method, system, like)
    if not method.memory:
        return step

    @cache
    def starter() -> Step:
        return stepper(extrapolated_midpoint(8), system, like)[0]

    def single(t: Any, q: Any, v: Any, h: Any) -> tuple[Any, ...]:
        def history(count: int) -> list[tuple[Any, Any]]:
            states = [(q, v)]
            for i in range(count):
                q1, v1, *_ = starter()(t - i * h, *states[-1], -h)
                states.append((q1, v1))
            return states

        memory = method.settled_memory(t, q, v, h, system.acceleration, history)
        return step(t, q, v, *(begin(t, q, v, h) if memory is None else memory), h)[:2]

    return single


def amplification(method: str | Method, omega0_h: float, gamma_h: float = 0.0) -> NDArray[np.float64]:
    """Return the matrix of one step on ``theta'' + gamma theta' + omega0**2 theta = 0``, shape (2, 2).

    The matrix acts on ``(theta, velocity/omega0)``, or on ``(theta, velocity h)`` if ``omega0_h`` is zero. It is
    computed in double precision by one step from each of the two unit vectors; splitting methods get the drag as its
    exact flow. For a multistep method the matrix is larger: angle and velocity are followed by the values that a step
    passes to the next one (earlier velocities and accelerations), in units of the step.

    Args:
        method: name or Method.
        omega0_h: omega0 times the step, dimensionless, not negative.
        gamma_h: gamma times the step, dimensionless, not negative.

    Raises MethodError for an unknown name.
    """
    z, g = float(omega0_h), float(gamma_h)
    flow = (lambda t, q, v, h: v * math.exp(-g * h)) if g else None
    chosen = named(method)
    system = replace(oscillator(z * z, g, flow), exact_flow=oscillator_flow(z * z, g))
    if not chosen.one_step:
        scale = np.ones(2 + len(chosen.memory))
        scale[1] = z or 1.0
        matrix = memory_matrix(chosen, system)
        scale = scale[: len(matrix)]
        return matrix * scale / scale[:, None]
    step = single_step(chosen, system)
    (a, c), (b, d) = step(0.0, 1.0, 0.0, 1.0), step(0.0, 0.0, 1.0, 1.0)
    return np.array([[a, b * z], [c / z if z else 0.0, d]])


def spectral_radius(method: str | Method, omega0_h: float, gamma_h: float = 0.0) -> float:
    """Return the largest modulus of the eigenvalues of :func:`amplification`; the motion grows where it exceeds 1.

    ``omega0_h`` and ``gamma_h`` are dimensionless. The result is inf if the matrix overflows.
    """
    try:
        matrix = amplification(method, omega0_h, gamma_h)
        if len(matrix) > 2:
            return float(max(abs(np.linalg.eigvals(matrix)))) if np.all(np.isfinite(matrix)) else math.inf
        a, b, c, d = (float(entry) for entry in matrix.ravel())
        square = ((a - d) / 2) ** 2 + b * c
    except OverflowError:
        return math.inf
    if not math.isfinite(square):
        return math.inf
    if square < 0.0:
        return math.sqrt(max(a * d - b * c, 0.0))
    return abs((a + d) / 2) + math.sqrt(square)


def stability_limit(method: str | Method) -> float:
    """Return the largest ``omega0 h`` of bounded undamped oscillations; 0: always unstable, inf: no limit.

    Computed from the exact polynomials of the step: both eigenvalues of a real 2 x 2 matrix lie in the unit disc where
    ``det <= 1`` and ``|trace| <= 1 + det``. Raises MethodError for an unknown name.
    """
    return _stability_limit(named(method))


@lru_cache(maxsize=256)
def _stability_limit(chosen: Method) -> float:
    if chosen.oscillation_limit is not None:
        return chosen.oscillation_limit
    if not chosen.one_step:
        return oscillation_limit(chosen)
    if chosen.stability_polynomials is not None:
        scale_of_z, (a, b, c, d, scale) = 1, step_matrix(chosen)
    else:
        scale_of_z, (a, b, c, d) = _whole_matrix(chosen)
        scale = PowerSeries.of(1, len(a.c))
    one, det, trace = scale * scale, a * d - b * c, scale * (a + d)
    conditions = [_shrunk(slack, scale_of_z) for slack in (one - det, one + det - trace, one + det + trace)]
    return math.sqrt(first_negative([condition.c[::2] for condition in conditions], chosen.rounding))


def damping_limit(method: str | Method) -> float:
    """Return the largest ``gamma h`` up to which a step on ``v' = -gamma v`` does not grow; inf: no limit.

    Splitting methods with an exact flow of the drag and A-stable methods have no limit. For drag together with other
    forces, see :func:`integrators.analysis.stability.overdamping_limit`. Raises MethodError for an unknown name, and
    for a method that cannot treat drag.
    """
    chosen = named(method)
    if "velocity_free" in chosen.needs:
        raise MethodError(f"{chosen.name} needs {NEEDS['velocity_free']}; it has no damping limit.")
    if chosen.drag_limit is not None:
        return chosen.drag_limit
    if not chosen.one_step:
        return drag_limit(chosen)
    terms, sides = _terms(chosen), chosen.stability_polynomials
    if sides:
        top, bottom = (_padded([x * (-1) ** k for k, x in enumerate(side)], terms) for side in sides)
    else:
        gamma, zero = PowerSeries.variable(terms), PowerSeries.of(0, terms)
        system = System(lambda t, q, v: -gamma * v, taylor_coefficients=coefficients(lambda t, q, v: v * -gamma))
        _, top = single_step(chosen, system, zero)(zero, zero, zero + 1, zero + 1)
        bottom = zero + 1
    return first_negative([(bottom * bottom - top * top).c], chosen.rounding)


def oscillator(square: Any, gamma: Any, flow: Callable[[Any, Any, Any, Any], Any] | None) -> System:
    """Return the damped oscillator ``q'' = -square q - gamma v``, a System with all functions that a method may need.

    ``square`` [1/s²] is the squared angular frequency and ``gamma`` [1/s] the damping rate: numbers, exact fractions or
    power series. ``flow`` is the exact flow of the damping alone, see ``System.dissipative_flow``; None: no damping.
    """
    return System(
        acceleration=lambda t, q, v: -square * q - gamma * v,
        force=lambda t, q: -square * q,
        velocity_free=flow is None,
        dissipative_flow=flow,
        jacobian=lambda t, q, v: (-square, -gamma),
        mean_acceleration=lambda t, q, v, s: -square * q - gamma * v,
        mean_jacobian=lambda t, q, v, s: (-square, -gamma),
        taylor_coefficients=coefficients(lambda t, q, v: -square * q - gamma * v),
    )


def _terms(method: Method) -> int:
    """Return the number of power series terms that suffice to compute a method's oscillator matrix.

    That many terms hold every coefficient of an explicit step and of its square, and the leading error.
    """
    return 4 * max(method.evaluations, 6 if method.exact else method.order) + 16


def _padded(polynomial: Polynomial, terms: int) -> PowerSeries:
    """Return a polynomial as a power series, padded with zeros to ``terms`` coefficients."""
    return PowerSeries((*polynomial, *[Fraction(0)] * (terms - len(polynomial))))


def step_matrix(method: Method) -> tuple[PowerSeries, PowerSeries, PowerSeries, PowerSeries, PowerSeries]:
    """Return the matrix of one step on the harmonic oscillator: four numerators row by row, and their denominator.

    All five are polynomials in ``z = omega0 h``. Raises MethodError for a multistep method, which has no such matrix.
    """
    if not method.one_step:
        raise MethodError(f"{method.name} uses a history of steps: its step is not a matrix of polynomials on (q, v).")
    sides, terms = method.stability_polynomials, _terms(method)
    if sides:
        (p, q), (r, s) = (_at_imaginary(_padded(side, terms)) for side in sides)
        cos_like, sin_like = p * r + q * s, q * r - p * s
        return cos_like, sin_like, -sin_like, cos_like, r * r + s * s
    scale_of_z, matrix = _whole_matrix(method)
    a, b, c, d = (_shrunk(entry, scale_of_z) for entry in matrix)
    return a, b, c, d, PowerSeries.of(1, len(a.c))


def _whole_matrix(method: Method) -> tuple[int, tuple[PowerSeries, PowerSeries, PowerSeries, PowerSeries]]:
    """Return an integer n and an explicit method's step matrix on the oscillator, as power series in ``z/n``.

    The four entries of the matrix are listed row by row, with ``z = omega0 h``. The integer n makes all their
    coefficients whole numbers, which keeps exact arithmetic fast.
    """
    terms = _terms(method)
    stated = method.oscillator_matrix(terms)
    if stated is not None:
        a, b, c, d = map(PowerSeries, stated)
        return 1, (a, b, c, d)
    if method.python_functions:
        raise MethodError(
            f"{method.name} calls a function whose course depends on its numbers, so its step has no exact matrix."
        )
    scale_of_z = common_denominator(method)
    zero, z = PowerSeries.of(0, terms), PowerSeries.variable(terms) * scale_of_z
    step = single_step(method, oscillator(1, 0, None), zero)
    (a, c), (b, d) = step(zero, zero + 1, zero, z), step(zero, zero, zero + 1, z)
    return scale_of_z, (a, b, c, d)


def common_denominator(method: Method) -> int:
    """Return the least common denominator of all coefficients in a method's step."""
    fractions: list[Fraction] = []

    def noted(value: Fraction) -> str:
        fractions.append(value)
        return literal(value)

    unroll(method, number=noted)
    return math.lcm(*(x.denominator for x in fractions))


def _shrunk(series: PowerSeries, whole: int) -> PowerSeries:
    """Convert a power series in ``z/whole``, for an integer ``whole``, to a power series in z."""
    return PowerSeries(tuple(x / whole**k for k, x in enumerate(series.c)))


def _at_imaginary(polynomial: PowerSeries) -> tuple[PowerSeries, PowerSeries]:
    """Return the real and the imaginary part of a polynomial at the imaginary number ``i z``, as power series in z."""
    signed = [x * (-1) ** (k // 2) for k, x in enumerate(polynomial.c)]
    even = PowerSeries(tuple(x * (1 - k % 2) for k, x in enumerate(signed)))
    return even, PowerSeries(tuple(signed)) - even


# --- where conditions of stability first fail -------------------------------------------------------------------------


def _significant(polynomial: Polynomial, least: Fraction) -> Polynomial:
    """Set a polynomial's lowest coefficients, which are rounding, to zero up to the first one above ``least``."""
    first = next((k for k, x in enumerate(polynomial) if abs(x) > least), len(polynomial))
    return [Fraction(0)] * first + list(polynomial[first:])


def first_negative(polynomials: Sequence[Polynomial], least: Fraction) -> float:
    """Return the least x >= 0 beyond which one of the polynomials is negative; inf if none becomes negative.

    Roots are computed in floating point and refined in exact arithmetic by Newton's method on value over slope, which
    converges at multiple roots, too. The signs between the roots are exact.
    """
    edges, wholes = [Fraction(0)], []
    for polynomial in (_significant(polynomial, least) for polynomial in polynomials):
        wholes.append(whole := _in_whole_numbers(polynomial))
        for root in np.roots([float(x) for x in reversed(polynomial)]):
            if root.real > 0.0 and abs(root.imag) <= 1e-6 * root.real:
                edges += _polished(whole, Fraction(float(root.real)), 0 if root.imag else POLISHINGS)
    edges = sorted(edge for edge in edges if edge >= 0)
    for low, high in pairwise([*edges, 2 * edges[-1] + 1]):
        if any(_value(whole, (low + high) / 2) < 0 for whole in wholes):
            return float(low)
    return math.inf


def _in_whole_numbers(polynomial: Polynomial) -> Polynomial:
    """Multiply a polynomial by the common denominator of its coefficients, so that they are whole numbers."""
    factor = math.lcm(*(x.denominator for x in polynomial))
    return [x * factor for x in polynomial]


def _value(polynomial: Polynomial, place: Fraction) -> Fraction:
    """Return the exact value of a polynomial with integer coefficients at a fraction."""
    total, power = 0, 1
    for c in reversed(polynomial):
        total = total * place.numerator + c.numerator * power
        power *= place.denominator
    return Fraction(total * place.denominator, power)


def _polished(polynomial: Polynomial, near: Fraction, times: int) -> list[Fraction]:
    """Refine the real root of a polynomial near a given number by Newton's method on value over slope.

    Returns two roots where they lie so close together that floating point does not separate them.
    """
    slope = [k * x for k, x in enumerate(polynomial)][1:]
    bend = [k * x for k, x in enumerate(slope)][1:]

    def newton(place: Fraction, values: Polynomial, slopes: Polynomial, times: int) -> Fraction:
        for _ in range(times):
            steep = _value(slopes, place)
            place -= Fraction(float(_value(values, place) / steep)) if steep else 0
        return place

    middle = newton(near, slope, bend, 3)
    curved = _value(bend, middle)
    apart = float(-2 * _value(polynomial, middle) / curved) if curved else -1.0
    if abs(middle - near) > near / 10**5 or not 0.0 < apart < 1e-8 * float(near) ** 2:
        for _ in range(times):
            value, rate, curve = (_value(each, near) for each in (polynomial, slope, bend))
            steep = rate * rate - value * curve
            near = Fraction(float(near - (value * rate / steep if steep else 0)))
        return [near]
    half = Fraction(math.sqrt(apart))
    return [newton(middle - half, polynomial, slope, 2), newton(middle + half, polynomial, slope, 2)]
