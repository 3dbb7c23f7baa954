"""What one step does to the harmonic oscillator: its matrix, amplification and stability limits.

All of it follows from one step on ``theta'' = -omega0**2 theta``, a matrix in ``z = omega0 h`` that acts on
``(theta, velocity/omega0)``. It is computed in exact rational arithmetic: splitting methods take their own
step on power series; Runge-Kutta methods come from their table, for a series cannot follow Newton's iteration.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.analysis.multistep_linear import drag_limit, memory_matrix, oscillation_limit, single_multistep
from integrators.analysis.series import ROUNDING, Series, cosine, sine
from integrators.families.energy_preserving import DiscreteGradient
from integrators.families.exact_flow import Exact, oscillator_flow
from integrators.families.multistep import Multistep
from integrators.families.nystrom import Nystrom
from integrators.families.runge_kutta import RungeKutta
from integrators.families.splitting import Splitting
from integrators.families.taylor import Taylor, coefficients
from integrators.method import NEEDS, ROUNDED, Method, MethodError, System
from integrators.registry import named
from integrators.solving.stepper import Step, stepper

Polynomial = Sequence[Fraction]
"""Coefficients, that of the lowest power first."""
POLISHINGS = 3
"""Newton steps for a root that floating point has found: the first leaves 1e-10 of a polynomial of degree 48."""


def single_step(method: Method, system: System, like: Any = 0.0) -> Step:
    """``(q, v) = step(t, q, v, h)`` for every method: what steps hand on is found afresh at each.

    ``like`` is a value of the number type to be used, as for :func:`integrators.solve.stepper`.
    """
    if isinstance(method, Multistep):
        return single_multistep(method, system, like)
    step, begin = stepper(method, system, like)
    return (lambda t, q, v, h: step(t, q, v, *begin(t, q, v, h), h)[:2]) if method.memory else step


def amplification(method: str | Method, omega0_h: float, gamma_h: float = 0.0) -> NDArray[np.float64]:
    """One step's matrix on ``theta'' + gamma theta' + omega0**2 theta = 0``, shape (2, 2).

    It acts on ``(theta, velocity/omega0)`` and is found by taking the step itself on the two unit vectors, in
    double precision; splitting methods get the drag as its exact flow. Of a multistep method it is larger: behind the
    two stands the memory, in units of the step; so is the velocity where ``omega0_h`` is zero.

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
    if isinstance(chosen, Multistep):
        scale = np.ones(2 + len(chosen.memory))
        scale[1] = z or 1.0
        matrix = memory_matrix(chosen, system)
        scale = scale[: len(matrix)]
        return matrix * scale / scale[:, None]
    step = single_step(chosen, system)
    (a, c), (b, d) = step(0.0, 1.0, 0.0, 1.0), step(0.0, 0.0, 1.0, 1.0)
    return np.array([[a, b * z], [c / z if z else 0.0, d]])


def spectral_radius(method: str | Method, omega0_h: float, gamma_h: float = 0.0) -> float:
    """The largest modulus of the eigenvalues of :func:`amplification`: motion grows where it exceeds 1.

    ``omega0_h`` and ``gamma_h`` are dimensionless. It is inf where the matrix leaves the range of floats.
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
    """The largest ``omega0 h`` up to which undamped oscillations stay bounded; 0 if none, inf if all.

    From the exact polynomials: both eigenvalues of a real 2 x 2 matrix lie in the unit disc where
    ``det <= 1`` and ``|trace| <= 1 + det``. Raises MethodError for an unknown name.
    """
    return _stability_limit(named(method))


@lru_cache(maxsize=256)
def _stability_limit(chosen: Method) -> float:
    if isinstance(chosen, Exact):
        return math.inf
    if isinstance(chosen, Multistep):
        return oscillation_limit(chosen)
    if butcher_table(chosen):
        whole, (a, b, c, d, scale) = 1, step_matrix(chosen)
    else:
        whole, (a, b, c, d) = _whole_matrix(chosen)
        scale = Series.of(1, len(a.c))
    one, det, trace = scale * scale, a * d - b * c, scale * (a + d)
    conditions = [_shrunk(found, whole) for found in (one - det, one + det - trace, one + det + trace)]
    return math.sqrt(first_negative([condition.c[::2] for condition in conditions], rounding_of(chosen)))


def damping_limit(method: str | Method) -> float:
    """The largest ``gamma h`` up to which a step on ``v' = -gamma v`` does not grow; inf if there is none.

    Splitting methods that take drag by its exact flow have no limit; nor have A-stable ones. Where forces act as well,
    see :func:`integrators.analysis.stability.overdamping_limit`. Raises MethodError for an unknown name, and for a
    method that takes no drag.
    """
    chosen = named(method)
    if "velocity_free" in chosen.needs:
        raise MethodError(f"{chosen.name} needs {NEEDS['velocity_free']}: it takes no drag, so that it has no limit.")
    if "split" in chosen.needs or isinstance(chosen, Exact):
        return math.inf
    if isinstance(chosen, Multistep):
        return drag_limit(chosen)
    table = butcher_table(chosen)
    if table:
        top, bottom = (Series(tuple(x * (-1) ** k for k, x in enumerate(s.c))) for s in stability_polynomials(table))
    else:
        terms = _terms(chosen)
        gamma, zero = Series.variable(terms), Series.of(0, terms)
        system = System(lambda t, q, v: -gamma * v, taylor_coefficients=coefficients(lambda t, q, v: v * -gamma))
        _, top = single_step(chosen, system, zero)(zero, zero, zero + 1, zero + 1)
        bottom = zero + 1
    return first_negative([(bottom * bottom - top * top).c], rounding_of(chosen))


def oscillator(square: Any, gamma: Any, flow: Callable[[Any, Any, Any, Any], Any] | None) -> System:
    """Return the damped oscillator ``q'' = -square q - gamma v`` with all that any method can ask of it.

    ``square`` [1/s²] is the square of its angular rate, ``gamma`` [1/s] its damping rate; numbers, exact fractions or
    power series. ``flow`` is the exact flow of the damping alone, as System's ``dissipative_flow``; None says that
    there is no damping.
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
    """Enough terms to hold an explicit step, a polynomial, and its square, and to show the leading error."""
    return 4 * max(method.evaluations, 6 if isinstance(method, Exact) else method.order) + 16


def butcher_table(method: Method) -> RungeKutta | None:
    """The Butcher table of what a method does on linear problems, if it is one."""
    found = method.linear_twin if isinstance(method, DiscreteGradient) else method
    return found if isinstance(found, RungeKutta) else None


def stability_polynomials(method: RungeKutta) -> tuple[Series, Series]:
    """Numerator and denominator of ``R(w) = 1 + w b (1 - w A)^-1 1`` (Butcher 2016, section 238).

    The denominator is ``det(1 - w A)``, by the method of Faddeev and Le Verrier; the numerator is the series times it,
    which ends at the power of the last stage. Rounded roots in tables leave simple fractions simple.
    """
    terms, stages = _terms(method), range(len(method.b))
    bottom, moments, column = [Fraction(1)], [Fraction(1)], [Fraction(1)] * len(method.b)
    power = [[Fraction(int(i == j)) for j in stages] for i in stages]
    for k in stages:
        power = [[sum((x * power[m][j] for m, x in enumerate(row) if x), Fraction(0)) for j in stages]
                 for row in method.a]
        bottom.append(-sum((power[i][i] for i in stages), Fraction(0)) / (k + 1))
        power = [[x + bottom[-1] * (i == j) for j, x in enumerate(row)] for i, row in enumerate(power)]
        moments.append(sum((method.b[j] * column[j] for j in stages), Fraction(0)))
        column = [sum((x * column[j] for j, x in enumerate(row) if x), Fraction(0)) for row in method.a]
    pad = [Fraction(0)] * (terms - len(moments))
    below = Series((*map(_simple, bottom), *pad))
    top = (Series((*bottom, *pad)) * Series((*moments, *pad))).c[: len(moments)]
    return Series((*map(_simple, top), *pad)), below


def _simple(x: Fraction) -> Fraction:
    """The fraction of small numbers that a number is up to :data:`ROUNDED`, or itself."""
    near = x.limit_denominator(10**6)
    return near if abs(near - x) < ROUNDED else x


def step_matrix(method: Method) -> tuple[Series, Series, Series, Series, Series]:
    """Numerators of the step's matrix, row by row, and their common denominator: polynomials in z.

    Raises MethodError for a multistep method, whose step is no such matrix.
    """
    if isinstance(method, Multistep):
        raise MethodError(f"{method.name} goes on from earlier steps: its step is no matrix of polynomials on (q, v).")
    table = butcher_table(method)
    if table:
        (p, q), (r, s) = (_at_imaginary(polynomial) for polynomial in stability_polynomials(table))
        cos_like, sin_like = p * r + q * s, q * r - p * s
        return cos_like, sin_like, -sin_like, cos_like, r * r + s * s
    whole, matrix = _whole_matrix(method)
    a, b, c, d = (_shrunk(entry, whole) for entry in matrix)
    return a, b, c, d, Series.of(1, len(a.c))


def _whole_matrix(method: Method) -> tuple[int, tuple[Series, Series, Series, Series]]:
    """An explicit step's matrix as series in ``z/whole``, which have whole coefficients: these are quick to use."""
    if isinstance(method, Nystrom):
        pad = [Fraction(0)] * _terms(method)
        a, b, c, d = (Series((*map(_simple, entry), *pad)[: len(pad)]) for entry in method.oscillator)
        return 1, (a, b, c, d)
    if isinstance(method, Exact):
        cos, sin = cosine(_terms(method)), sine(_terms(method))
        return 1, (cos, sin, -sin, cos)
    fractions = [x for _, x in method.flows] if isinstance(method, Splitting) else []
    whole, terms = math.lcm(*(x.denominator for x in fractions)), _terms(method)
    zero, z = Series.of(0, terms), Series.variable(terms) * whole
    step = single_step(method, oscillator(1, 0, None), zero)
    (a, c), (b, d) = step(zero, zero + 1, zero, z), step(zero, zero, zero + 1, z)
    return whole, (a, b, c, d)


def _shrunk(series: Series, whole: int) -> Series:
    """From a series in ``z/whole`` to one in z."""
    return Series(tuple(x / whole**k for k, x in enumerate(series.c)))


def _at_imaginary(polynomial: Series) -> tuple[Series, Series]:
    """Real and imaginary part of the polynomial at ``w = i z``, in powers of z."""
    signed = [x * (-1) ** (k // 2) for k, x in enumerate(polynomial.c)]
    even = Series(tuple(x * (1 - k % 2) for k, x in enumerate(signed)))
    return even, Series(tuple(signed)) - even


def rounding_of(method: Method) -> Fraction:
    """Coefficients below this are taken for zero: none of a Taylor series, which has no table that could be rounded."""
    return Fraction(0) if isinstance(method, Taylor) else ROUNDING


# --- where conditions of stability first fail -------------------------------------------------------------------------


def _significant(polynomial: Polynomial, least: Fraction) -> Polynomial:
    """Without lowest coefficients that only tables rounded to many digits leave behind."""
    first = next((k for k, x in enumerate(polynomial) if abs(x) > least), len(polynomial))
    return [Fraction(0)] * first + list(polynomial[first:])


def first_negative(polynomials: Sequence[Polynomial], least: Fraction) -> float:
    """Where, from zero upwards, one of the polynomials first turns negative; inf if none does.

    Roots are found in floating point and polished in exact arithmetic by Newton steps for value over slope, which
    suit roots of any multiplicity; the signs between them are found exactly, too.
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
    """The same but for a positive factor, in whole numbers: these are quick to use."""
    factor = math.lcm(*(x.denominator for x in polynomial))
    return [x * factor for x in polynomial]


def _value(polynomial: Polynomial, place: Fraction) -> Fraction:
    """Its value, summed in whole numbers."""
    total, power = 0, 1
    for c in reversed(polynomial):
        total = total * place.numerator + c.numerator * power
        power *= place.denominator
    return Fraction(total * place.denominator, power)


def _polished(polynomial: Polynomial, near: Fraction, times: int) -> list[Fraction]:
    """The root near a place, by Newton steps for value over slope, or two that floating point cannot tell apart."""
    slope = [k * x for k, x in enumerate(polynomial)][1:]
    bend = [k * x for k, x in enumerate(slope)][1:]

    def moved(place: Fraction, values: Polynomial, slopes: Polynomial, times: int) -> Fraction:
        for _ in range(times):
            steep = _value(slopes, place)
            place -= Fraction(float(_value(values, place) / steep)) if steep else 0
        return place

    middle = moved(near, slope, bend, 3)
    curved = _value(bend, middle)
    apart = float(-2 * _value(polynomial, middle) / curved) if curved else -1.0
    if abs(middle - near) > near / 10**5 or not 0.0 < apart < 1e-8 * float(near) ** 2:
        for _ in range(times):
            value, rate, curve = (_value(each, near) for each in (polynomial, slope, bend))
            steep = rate * rate - value * curve
            near = Fraction(float(near - (value * rate / steep if steep else 0)))
        return [near]
    half = Fraction(math.sqrt(apart))
    return [moved(middle - half, polynomial, slope, 2), moved(middle + half, polynomial, slope, 2)]
