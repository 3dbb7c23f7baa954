"""Order, error constants, growth, detuning and stability limits of multistep methods.

They follow from the roots of a method's characteristic polynomials; see :class:`integrators.Method`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from integrators.analysis.series import PowerSeries, cosine, horner, sine
from integrators.method import Method, MethodError, Polynomial, System
from integrators.registry import named
from integrators.solving.stepper import stepper
from integrators.steps.unroll import unroll

FARTHEST = 1e3
"""Largest ``omega0 h`` or ``gamma h`` at which a stability limit is searched."""
Complex = tuple[Decimal, Decimal]
STRIDE = 0.05
"""Increment of ``omega0 h`` in which the principal root is followed from ``omega0 h = 0``."""
SWEEPS = 7
"""Newton steps from double precision to the digits of the decimal context; each step doubles the correct digits."""


def memory_matrix(method: Method, system: System) -> NDArray[np.float64]:
    """Return the matrix of one multistep step of ``h = 1`` on a linear problem.

    It acts on q, v and the method's memory, the values that one step passes to the next. Step counters in the memory
    have no row.
    """
    step, _ = stepper(method, system)
    fixed = method.counters
    names = ["q", "v", *method.memory]
    free = [i for i, name in enumerate(names) if name not in fixed]
    columns = []
    for i in free:
        values = [float(fixed.get(name, 0.0)) for name in names]
        values[i] = 1.0
        end = step(0.0, *values, 1.0)
        columns.append([end[j] for j in free])
    return np.array(columns).T


def characteristic_of(method: Method) -> tuple[Polynomial, ...]:
    """Return a method's characteristic polynomials; raises MethodError for a method that states none."""
    if not method.characteristic:
        raise MethodError(f"{method.name} states no characteristic polynomials, which this analysis needs.")
    return method.characteristic


def exponent(method: Method, terms: int) -> PowerSeries:
    """Return the logarithm of a multistep method's principal root, which approximates ``exp(w)``, as a series in w.

    It is ``w - C w**(p+1) + ...`` with the error constant C for a method for ``y' = f``, and
    ``w - C w**(p+1)/2 + ...`` for a method for ``q'' = f`` (Hairer, Norsett & Wanner 1993, III.2 and III.10).
    """
    at = [_at_exponential(row, terms + 4) for row in characteristic_of(method)]
    if method.power == 2:
        square = (-at[0]).over_z(2) / at[1].head(terms + 2)
        slope = square.sqrt()
    else:
        w = PowerSeries.variable(terms + 4)
        for _ in range(terms + 4):
            rest = at[1]
            power = w
            for row in at[2:]:
                rest, power = rest + power * row, power * w
            w = -at[0] / rest
        slope = w.over_z()
    slope = slope.head(terms)
    log_root = PowerSeries.variable(terms)
    for _ in range(terms):
        log_root = PowerSeries.variable(terms) / _composed(slope, log_root)
    return log_root


def growth_and_detuning(method: Method) -> tuple[PowerSeries, PowerSeries]:
    """Return growth and frequency error of a multistep method on the oscillator, as series in ``z = omega0 h``.

    These are the growth rate of the amplitude divided by omega0, and the relative error of the frequency.
    """
    at_imaginary = [x * (-1) ** (k // 2) for k, x in enumerate(exponent(method, method.order + 7).c)]
    even = PowerSeries(tuple(x * (1 - k % 2) for k, x in enumerate(at_imaginary)))
    return even.over_z(), (PowerSeries(tuple(at_imaginary)) - even).over_z() - 1


def _at_exponential(polynomial: Polynomial, terms: int) -> PowerSeries:
    """Return the power series in z of a polynomial at ``x = exp(z)``."""
    return PowerSeries(tuple(
        sum((c * Fraction(j) ** k for j, c in enumerate(polynomial)), Fraction(0)) / math.factorial(k)
        for k in range(terms)
    ))


def _composed(outer: PowerSeries, inner: PowerSeries) -> PowerSeries:
    """Return the power series ``outer(inner(z))``; ``inner`` must have no constant term."""
    composed: PowerSeries = horner([PowerSeries.of(x, len(inner.c)) for x in outer.c], inner)
    return composed


def order_defects(method: Method, order: int) -> tuple[Fraction, ...]:
    """Return the exact residuals of a multistep method's order conditions, for the orders 1 to ``order``.

    They are the coefficients of ``log x(w) - w`` for the principal root x. A method integrates polynomials of degree p
    exactly if ``rho(exp w)/sigma(exp w)`` equals w, or ``w**2`` for a method for ``q'' = f``, up to ``w**(p+1)``
    (Hairer, Norsett & Wanner 1993, theorem III.2.4).
    """
    _, first, *others = exponent(method, order + 1).c
    return first - 1, *others


def error_constant(method: str | Method) -> Fraction:
    """Return the error constant C of a multistep method, normalised by ``sigma(1)``.

    The error of one step is ``C h**(p+1) y^(p+1)``, or ``C h**(p+2) q^(p+2)`` for a method for ``q'' = f``. C is 5/12
    for ``ab2``, -1/3 for ``bdf2`` and -1/240 for ``numerov``; a predictor-corrector pair has the corrector's constant
    (Hairer, Norsett & Wanner 1993, III.2 and III.10).

    Raises MethodError for a method that is not a multistep method.
    """
    chosen = named(method)
    if not chosen.characteristic:
        raise MethodError(f"{chosen.name} has no error constant, because it is not a multistep method.")
    return -chosen.power * exponent(chosen, chosen.order + 2).c[-1]


def local_errors(method: Method, terms: int) -> tuple[PowerSeries, ...]:
    """Return the error matrix of one multistep step on the oscillator, row by row, as power series in ``z = omega0 h``.

    The step starts from an exact history. The matrix times the state (q, v) at its start is the error in (q, v) at its
    end.
    """
    namespace: dict[str, Any] = {
        "acceleration": lambda t, q, v: -q, "NAN": math.nan,
        "solve_stage": lambda t, q, v, *d: -(q + v * d[0]) / (d[0] * d[0] + 1) if len(d) < 2 else -q / (d[0] + 1),
    }

    def number(value: Fraction) -> str:
        name = f"c{value.numerator}_{value.denominator}".replace("-", "m")
        namespace[name] = value
        return name

    functions = dict(namespace)
    exec(unroll(method, number=number), namespace)
    cos, sin = cosine(terms + 1), sine(terms + 1)
    once, apart = (cos - 1).over_z(), sin.over_z()
    z = PowerSeries.variable(terms)

    def starter(t: Any, q: PowerSeries, v: PowerSeries, h: PowerSeries) -> tuple[PowerSeries, PowerSeries]:
        sense = h.c[1]
        return q * once * sense + v * apart, v * once * sense - q * apart

    def earlier(state: tuple[PowerSeries, PowerSeries], count: int) -> list[tuple[PowerSeries, PowerSeries]]:
        states = [state]
        for _ in range(count):
            (q, v), c, s = states[-1], cos.head(terms), sin.head(terms)
            states.append((q * c - v * s, v * c + q * s))
        return states

    namespace |= {**functions, "starter": starter}
    columns = []
    for q, v in ((1, 0), (0, 1)):
        start = PowerSeries.of(q, terms), PowerSeries.of(v, terms)
        memory = method.settled_memory(z - z, *start, z, namespace["acceleration"], partial(earlier, start))
        if memory is None:
            memory = _several(namespace["begin"](z - z, *start, z))
        q1, v1, *_ = namespace["step"](z - z, *start, *memory, z)
        (q0, v0), c, s = start, cos.head(terms), sin.head(terms)
        columns.append((q1 - q0 * c - v0 * s, v1 - v0 * c + q0 * s))
    (a, c), (b, d) = columns
    return a, b, c, d


def _several(memory: Any) -> tuple[Any, ...]:
    """Return a method's memory (values passed from one step to the next) as a tuple, also if it is a single value."""
    return memory if isinstance(memory, tuple) else (memory,)


def largest_root(polynomials: Sequence[Polynomial], w: complex) -> float:
    """Return the largest modulus of the complex roots x of ``sum_m w**m polynomials[m](x)``."""
    count = max(map(len, polynomials))
    total = np.zeros(count, dtype=complex)
    for m, row in enumerate(polynomials):
        total[: len(row)] += w**m * np.array([float(x) for x in row])
    return float(max(abs(np.roots(total[::-1])), default=0.0))


def first_growth(radius: Callable[[float], float]) -> float:
    """Return the least positive ``x`` at which ``radius(x)``, the largest root of a method, exceeds 1.

    The result is inf if there is none below :data:`FARTHEST`. It is extrapolated from the arguments at which the radius
    exceeds 1 by 1e-8 and by 4e-8.
    """
    low = 0.01
    while not radius(high := 1.01 * low) > 1.0 + 1e-8:
        low = high
        if low > FARTHEST:
            return math.inf
    ends = []
    for beyond in (1e-8, 4e-8):
        below, above = low, 1.01 * high
        for _ in range(60):
            middle = 0.5 * (below + above)
            below, above = (below, middle) if radius(middle) > 1.0 + beyond else (middle, above)
        ends.append(below)
    return ends[0] - (ends[1] - ends[0]) / 3.0


@lru_cache(maxsize=128)
def oscillation_limit(method: Method) -> float:
    """Return the largest ``omega0 h`` of bounded oscillations for a multistep method; 0 if every step makes them grow.

    Raises MethodError like :func:`characteristic_of`.
    """
    grown = growth_and_detuning(method)[0].leading()
    if grown and grown[0] > 0:
        return 0.0
    rows = characteristic_of(method)
    return first_growth(lambda z: largest_root(rows, -z * z if method.power == 2 else 1j * z))


@lru_cache(maxsize=128)
def drag_limit(method: Method) -> float:
    """Return the largest ``gamma h`` at which a multistep method on ``v' = -gamma v`` does not grow.

    Raises MethodError like :func:`characteristic_of`.
    """
    characteristic_of(method)
    rows = method.characteristic_of_drag
    return first_growth(lambda g: largest_root(rows, -g))


def stability_angle(method: str | Method) -> float:
    """Return the largest angle alpha [rad] of A(alpha)-stability of a multistep method.

    The method is stable for every ``w = lambda h`` within alpha of the negative real axis. The angle comes from the
    root locus (Hairer & Wanner 1996, V.2): pi/2 for A-stable methods, and 0 if drag alone limits the step. Raises
    MethodError for a method that is not a multistep method for ``y' = f``.
    """
    chosen = named(method)
    if len(chosen.characteristic) != 2 or chosen.power != 1:
        raise MethodError(f"{chosen.name} has no stability angle, because it is not a multistep method for y' = f.")
    if drag_limit(chosen) < math.inf:
        return 0.0
    top, bottom = ([float(x) for x in row] for row in chosen.characteristic)

    def slack(phi: NDArray[np.float64]) -> NDArray[np.float64]:
        x = np.exp(1j * phi)
        w = -np.polyval(top[::-1], x) / np.polyval(bottom[::-1], x)
        return np.asarray(np.where(w.real < 0.0, np.pi - np.abs(np.angle(w)), np.pi / 2))

    low, high = 0.01, math.pi
    for _ in range(12):
        phi = np.linspace(low, high, 2001)
        best = int(np.argmin(slack(phi)))
        low, high = phi[max(best - 1, 0)], phi[min(best + 1, 2000)]
    return float(slack(phi)[best])


# --- the root that follows the true oscillation, in many digits ---------------------------------------------------


def principal_root(method: Method, z: float) -> Complex:
    """Return the principal root of a multistep method on the oscillator, as real and imaginary part.

    It is the root of ``sum_m (i z)**(power m) characteristic[m](x)`` next to ``exp(i z)``. Newton's method follows it
    from z = 0, where it is 1; the last Newton steps use the digits of the decimal context.
    """
    rows = [[float(c) for c in row] for row in characteristic_of(method)]
    strides = math.ceil(z / STRIDE)
    x = 1.0 + 0.0j
    for k in range(1, strides + 1):
        w = 1j * z * k / strides
        x = _newton(rows, method.power, w, x * cmath.exp(1j * z / strides))
    fine = [[Decimal(c.numerator) / c.denominator for c in row] for row in method.characteristic]
    root: Complex = (Decimal(x.real), Decimal(x.imag))
    weights = _powers(Decimal(z), method.power, len(fine))
    for _ in range(SWEEPS):
        value = slope = (Decimal(0), Decimal(0))
        for weight, row in zip(weights, fine, strict=True):
            value = _plus(value, _times(weight, _at(row, root)))
            slope = _plus(slope, _times(weight, _at([k * c for k, c in enumerate(row)][1:], root)))
        change = _over(value, slope)
        root = (root[0] - change[0], root[1] - change[1])
    return root


def _newton(rows: Sequence[Sequence[float]], power: int, w: complex, x: complex) -> complex:
    """Refine a complex root x of a multistep method's characteristic equation by Newton's method in doubles."""
    for _ in range(8):
        value = slope = 0.0 + 0.0j
        for m, row in enumerate(rows):
            inner = outer = 0.0 + 0.0j
            for c in reversed(row):
                inner = inner * x + outer
                outer = outer * x + c
            value, slope = value + w ** (power * m) * outer, slope + w ** (power * m) * inner
        if slope == 0.0:
            break
        x = x - value / slope
    return x


def _powers(z: Decimal, power: int, count: int) -> list[Complex]:
    """Return ``(i z)**(power m)`` for m from 0 to ``count - 1``."""
    units = ((1, 0), (0, 1), (-1, 0), (0, -1))
    sizes = [(z ** (power * m) if m else Decimal(1), units[power * m % 4]) for m in range(count)]
    return [(size * real, size * imaginary) for size, (real, imaginary) in sizes]


def _at(row: Sequence[Decimal], x: Complex) -> Complex:
    """Return the value of a real polynomial at a complex decimal number."""
    total: Complex = (Decimal(0), Decimal(0))
    for c in reversed(row):
        total = _times(total, x)
        total = (total[0] + c, total[1])
    return total


def _plus(x: Complex, y: Complex) -> Complex:
    """Add two complex decimal numbers."""
    return x[0] + y[0], x[1] + y[1]


def _times(x: Complex, y: Complex) -> Complex:
    """Multiply two complex decimal numbers."""
    return x[0] * y[0] - x[1] * y[1], x[0] * y[1] + x[1] * y[0]


def _over(x: Complex, y: Complex) -> Complex:
    """Divide a complex decimal number by another one."""
    size = y[0] * y[0] + y[1] * y[1]
    real, imaginary = _times(x, (y[0], -y[1]))
    return real / size, imaginary / size
