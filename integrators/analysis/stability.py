"""Stability functions and regions of methods, and growth and phase of one step on the oscillator.

On ``y' = lambda y`` a Runge-Kutta step multiplies by its stability function R(w), ``w = lambda h``; it is stable
where ``|R(w)| <= 1``. On the oscillator ``theta'' + gamma theta' + omega0**2 theta = 0`` any step is a 2 x 2 matrix
(:mod:`integrators.analysis.linear`) with eigenvalues ``r exp(+-i phi)``: the step multiplies the amplitude by r and
adds phi to the phase.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from decimal import Decimal, localcontext
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from integrators.analysis.linear import (
    oscillator,
    single_step,
    spectral_radius,
    step_matrix,
)
from integrators.analysis.multistep_linear import principal_root
from integrators.analysis.series import ROUNDING, PowerSeries, cosine, horner, sine
from integrators.errors import shown
from integrators.method import Method, MethodError
from integrators.registry import named

DIGITS = 60
"""Decimal digits of the arithmetic in :func:`oscillation_errors`."""
LONGEST = 100.0
"""Largest omega0 h in :func:`oscillation_errors`; no method follows the oscillation in longer steps."""

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Polynomials = Sequence[Sequence[Decimal]]


def stability_function(method: str | Method, w: ArrayLike) -> ComplexArray:
    """Return the stability function of a Runge-Kutta method at complex ``w = lambda h``, in the shape of w.

    It is ``R(w) = 1 + w b (1 - w A)^-1 1`` (Hairer & Wanner 1996, IV.3), and inf at a pole. Raises MethodError for an
    unknown name, and for a method that is not a Runge-Kutta table.
    """
    top, bottom = (np.array(side[::-1]) for side in _sides(named(method)))
    at = np.asarray(w, dtype=np.complex128)
    with np.errstate(all="ignore"):
        below = np.polyval(bottom, at)
        values: ComplexArray = np.where(below == 0, np.inf, np.polyval(top, at) / below)
    return values


def stability_boundary(method: str | Method, points: int = 721) -> ComplexArray:
    """Return points on the boundary of a Runge-Kutta method's stability region, where ``|R(w)| = 1``.

    They are all roots of ``R(w) = exp(i a)``, for each angle ``a`` from 0 to 2 pi.
    Shape ``(points, n)``, n being the larger degree of R's numerator and denominator; rows with a root at infinity
    end with nan. The curves bound the stability region, detached parts included, but neighbours in the array need not
    lie on one curve. Raises MethodError like :func:`stability_function`.
    """
    sides = _sides(named(method))
    size = max(map(len, sides))
    top, bottom = (np.array([*side, *[0.0] * (size - len(side))][::-1]) for side in sides)
    boundary = np.full((points, size - 1), np.nan + 0j)
    for row, angle in zip(boundary, np.linspace(0.0, 2.0 * np.pi, points), strict=True):
        equation = top - np.exp(1j * angle) * bottom
        roots = np.roots(equation[np.argmax(np.abs(equation) > 1e-12 * np.abs(top)) :])
        row[: len(roots)] = roots
    return boundary


def oscillation_errors(method: str | Method, omega0_h: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return amplitude error ``r - 1`` and phase error ``phi - omega0 h`` of one step on the undamped oscillator.

    Both are computed in 60 digits from the exact step, so errors far below round-off are right, too. If a step has
    real eigenvalues, it does not oscillate: r is then the larger modulus and the phase error is nan. The phase error
    [rad] lies between -pi and pi, as phases are known up to whole turns. For a multistep method both errors belong to
    the principal root; other roots may grow at shorter steps, see :func:`spectral_radii`.

    Args:
        method: name or Method.
        omega0_h: omega0 times the step, positive numbers up to 100, of any shape; both results have this shape.

    Raises MethodError for an unknown name, or omega0 h that is out of range.
    """
    chosen, steps = named(method), np.asarray(omega0_h, dtype=float)
    if not np.all((steps > 0.0) & (steps <= LONGEST)):
        raise MethodError(f"omega0_h must be numbers above 0, up to {LONGEST:g}, not {shown(omega0_h)}.")
    with localcontext() as context:
        context.prec = DIGITS
        terms = 2 * DIGITS + 4 * math.ceil(steps.max(initial=0.0))
        exact = [_decimals(series(terms)) for series in (cosine, sine)]
        places = steps.ravel().tolist()
        if not chosen.one_step:
            pairs = [_errors_of_root(principal_root(chosen, z), exact, Decimal(z)) for z in places]
        else:
            matrix = [_decimals(entry) for entry in step_matrix(chosen)]
            pairs = [_errors(matrix, exact, Decimal(z)) for z in places]
        errors = np.array(pairs).reshape(-1, 2)
    return errors[:, 0].reshape(steps.shape), errors[:, 1].reshape(steps.shape)


def spectral_radii(method: str | Method, omega0_h: ArrayLike, gamma_h: ArrayLike = 0.0) -> FloatArray:
    """Return the factor by which the damped motion grows in one step, for arrays of ``omega0 h`` and ``gamma h``.

    It is :func:`integrators.analysis.linear.spectral_radius` on arrays. For Runge-Kutta methods it is ``|R(h lambda)|``
    with the stability function R and ``lambda**2 + gamma lambda + omega0**2 = 0``; for others the
    largest size of an eigenvalue of the matrix of one step. A splitting advances the drag exactly. The exact factor is
    ``exp(-gamma h/2)`` for ``gamma < 2 omega0``.

    Args:
        method: name or Method.
        omega0_h, gamma_h: omega0 and gamma times the step, dimensionless, of shapes that broadcast.

    Raises MethodError for an unknown name, or drag on a method that cannot treat drag.
    """
    chosen = named(method)
    z, g = np.broadcast_arrays(np.asarray(omega0_h, dtype=float), np.asarray(gamma_h, dtype=float))
    with np.errstate(all="ignore"):
        if not chosen.one_step or "exact_flow" in chosen.needs:
            radii = np.array([spectral_radius(chosen, *at) for at in zip(z.ravel(), g.ravel(), strict=True)])
            radii = radii.reshape(z.shape)
        elif chosen.stability_polynomials:
            root = np.sqrt(g * g / 4.0 - z * z + 0j)
            sizes = [np.abs(stability_function(chosen, -g / 2.0 + side)) for side in (root, -root)]
            radii = np.maximum(*sizes)
        else:
            radii = _radii_of_step(chosen, np.array(z), np.array(g))
    return np.where(np.isfinite(radii), radii, np.inf)


def overdamping_limit(method: str | Method, omega0_h: float) -> float:
    """Return the largest ``gamma h`` up to which damped oscillations do not grow at an ``omega0 h``; inf: above 64.

    Both are dimensionless. Splittings of orders above 2 have negative sub-steps (Sheng 1989; Suzuki 1991), in which
    drag amplifies. The limit is searched in steps of 1/8, then by bisection. Raises MethodError for an unknown name,
    and for a method that cannot treat drag.
    """
    chosen = named(method)

    def grows(gamma_h: ArrayLike) -> NDArray[np.bool_]:
        return np.asarray(spectral_radii(chosen, omega0_h, gamma_h) > 1.0 + 1e-12)

    marks = np.arange(1, 513) / 8.0
    beyond = marks[grows(marks)]
    if not beyond.size:
        return math.inf
    low, high = float(beyond[0]) - 0.125, float(beyond[0])
    for _ in range(40):
        middle = (low + high) / 2.0
        low, high = (low, middle) if grows(middle) else (middle, high)
    return high


def _radii_of_step(method: Method, z: FloatArray, g: FloatArray) -> FloatArray:
    """Return the largest eigenvalue moduli of a step on the damped oscillator, for arrays of omega0 h and gamma h."""
    flow: Callable[..., Any] | None = (lambda t, q, v, h: v * np.exp(-g * h)) if np.any(g) else None
    step = single_step(method, oscillator(z * z, g, flow), z)
    one, zero = np.ones_like(z), np.zeros_like(z)
    (a, c), (b, d) = step(0.0, one, zero, 1.0), step(0.0, zero, one, 1.0)
    square = ((a - d) / 2.0) ** 2 + b * c
    turning = np.sqrt(np.maximum(a * d - b * c, 0.0))
    radii: FloatArray = np.where(square < 0.0, turning, np.abs((a + d) / 2.0) + np.sqrt(np.maximum(square, 0.0)))
    return radii


def _sides(method: Method) -> tuple[list[float], list[float]]:
    """Return the coefficients of the stability function's numerator and denominator, lowest power first.

    Zeros of the highest powers are left out. Raises MethodError for a method without a stability function.
    """
    sides = method.stability_polynomials
    if sides is None:
        raise MethodError(f"{method.name}: only Runge-Kutta tables have a stability function, not {method.family}.")
    top, bottom = ([float(x) if abs(x) > ROUNDING else 0.0 for x in side] for side in sides)
    for side in (top, bottom):
        while len(side) > 1 and not side[-1]:
            side.pop()
    return top, bottom


def _decimals(polynomial: PowerSeries) -> list[Decimal]:
    """Return the coefficients of a power series as decimal numbers in the current decimal context."""
    return [Decimal(x.numerator) / x.denominator for x in polynomial.c]


def _errors(matrix: Polynomials, true: Polynomials, z: Decimal) -> tuple[float, float]:
    """Return amplitude error ``r - 1`` and phase error ``phi - z`` of one step on the oscillator at ``z = omega0 h``.

    ``matrix`` holds the four numerators of the step's matrix and their denominator, ``true`` the power series of ``cos
    z`` and ``sin z``.
    """
    *numerators, scale = (horner(polynomial, z) for polynomial in matrix)
    a, b, c, d = (entry / scale for entry in numerators)
    x, det = (a + d) / 2, a * d - b * c
    square = det - x * x
    if square < 0:
        return _clean(abs(x) + (-square).sqrt() - 1), math.nan
    return _errors_of_root((x, square.sqrt().copy_sign(b)), true, z)


def _errors_of_root(root: tuple[Decimal, Decimal], true: Polynomials, z: Decimal) -> tuple[float, float]:
    """Return amplitude error and phase error of a step's eigenvalue against the exact ``exp(i z)``.

    ``root`` is the eigenvalue as real and imaginary part, ``true`` the power series of ``cos z`` and ``sin z``.
    """
    x, y = root
    cos, sin = (horner(polynomial, z) for polynomial in true)
    growth = (x * x + y * y).sqrt() - 1
    return _clean(growth), math.atan2(_clean(y * cos - x * sin), float(x * cos + y * sin))


def _clean(x: Decimal) -> float:
    """Convert a decimal to a float; values that are mere rounding of the decimal arithmetic become 0."""
    return float(x) if abs(x) > Decimal(10) ** (-2 * DIGITS // 3) else 0.0
