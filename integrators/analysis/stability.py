"""Where steps stay bounded and how they turn: stability functions and regions, growth and phase on the oscillator.

On ``y' = lambda y`` a Runge-Kutta step multiplies by its stability function R(w), ``w = lambda h``; it is stable
where ``|R(w)| <= 1``. On the oscillator ``theta'' + gamma theta' + omega0**2 theta = 0`` any step is a 2 x 2 matrix
(:mod:`integrators.analysis.linear`) of eigenvalues ``r exp(+-i phi)``: the amplitude is multiplied by r, the phase
gains phi.
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
from integrators.analysis.series import ROUNDING, Series, cosine, horner, sine
from integrators.errors import shown
from integrators.method import Method, MethodError
from integrators.registry import named

DIGITS = 60
"""Decimal digits in which the errors of oscillations are computed."""
LONGEST = 100.0
"""Steps omega0 h beyond this are refused there: no method turns with the oscillator in them."""

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Polynomials = Sequence[Sequence[Decimal]]


def stability_function(method: str | Method, w: ArrayLike) -> ComplexArray:
    """``R(w) = 1 + w b (1 - w A)^-1 1`` at complex ``w = lambda h``, of the shape of w (Hairer & Wanner 1996, IV.3).

    It is inf at a pole. Raises MethodError for an unknown name, and for a method that is no Runge-Kutta table: it has
    no such function.
    """
    top, bottom = (np.array(side[::-1]) for side in _sides(named(method)))
    at = np.asarray(w, dtype=np.complex128)
    with np.errstate(all="ignore"):
        below = np.polyval(bottom, at)
        found: ComplexArray = np.where(below == 0, np.inf, np.polyval(top, at) / below)
    return found


def stability_boundary(method: str | Method, points: int = 721) -> ComplexArray:
    """Where ``|R(w)| = 1``: for each angle ``a`` from 0 to 2 pi, all roots of ``R(w) = exp(i a)``.

    Shape ``(points, n)``, n being the larger degree of R's numerator and denominator; rows with a root at infinity
    end with nan. The curves bound the stability region, detached parts included, but neighbours in the array need not
    lie on one curve. Raises MethodError like :func:`stability_function`.
    """
    sides = _sides(named(method))
    size = max(map(len, sides))
    top, bottom = (np.array([*side, *[0.0] * (size - len(side))][::-1]) for side in sides)
    found = np.full((points, size - 1), np.nan + 0j)
    for row, angle in zip(found, np.linspace(0.0, 2.0 * np.pi, points), strict=True):
        equation = top - np.exp(1j * angle) * bottom
        roots = np.roots(equation[np.argmax(np.abs(equation) > 1e-12 * np.abs(top)) :])
        row[: len(roots)] = roots
    return found


def oscillation_errors(method: str | Method, omega0_h: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Errors of one step on the undamped oscillator: of the amplitude, ``r - 1``, and of the phase, ``phi - omega0 h``.

    Both are computed in 60 digits from the exact step, so that errors far below round-off are right, too. Where a step
    no longer turns (real eigenvalues), r is the larger modulus and the phase error is nan. Phases are known up to whole
    turns; the error [rad] is the one from -pi to pi. Of a multistep method's roots it is that which follows the true
    oscillation; others may grow before it does, see :func:`spectral_radii`.

    Args:
        method: name or Method.
        omega0_h: omega0 times the step, positive numbers up to 100, of any shape, which both results have.

    Raises MethodError for an unknown name, or omega0 h that is out of range.
    """
    chosen, steps = named(method), np.asarray(omega0_h, dtype=float)
    if not np.all((steps > 0.0) & (steps <= LONGEST)):
        raise MethodError(f"omega0_h must be numbers above 0, up to {LONGEST:g}, not {shown(omega0_h)}.")
    with localcontext() as context:
        context.prec = DIGITS
        terms = 2 * DIGITS + 4 * math.ceil(steps.max(initial=0.0))
        true = [_decimals(series(terms)) for series in (cosine, sine)]
        places = steps.ravel().tolist()
        if not chosen.one_step:
            pairs = [_errors_of_root(principal_root(chosen, z), true, Decimal(z)) for z in places]
        else:
            matrix = [_decimals(entry) for entry in step_matrix(chosen)]
            pairs = [_errors(matrix, true, Decimal(z)) for z in places]
        found = np.array(pairs).reshape(-1, 2)
    return found[:, 0].reshape(steps.shape), found[:, 1].reshape(steps.shape)


def spectral_radii(method: str | Method, omega0_h: ArrayLike, gamma_h: ArrayLike = 0.0) -> FloatArray:
    """:func:`integrators.analysis.linear.spectral_radius` on arrays: the factor by which the damped motion grows in one
    step.

    Runge-Kutta methods by ``R(h lambda)``, where ``lambda**2 + gamma lambda + omega0**2 = 0``; others by their step,
    taken on arrays. Splittings get the drag as its exact flow. True is ``exp(-gamma h/2)`` for ``gamma < 2 omega0``.

    Args:
        method: name or Method.
        omega0_h, gamma_h: omega0 and gamma times the step, dimensionless, of shapes that broadcast.

    Raises MethodError for an unknown name, or drag on a method that takes none.
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
    """The largest ``gamma h`` up to which damped oscillations do not grow, at this ``omega0 h``; inf if none up to 64.

    Both are dimensionless.

    Splittings of orders above 2 have negative sub-steps (Sheng 1989; Suzuki 1991), in which drag amplifies. Looked for
    in steps of 1/8, then by halving. Raises MethodError for an unknown name, and for a method that takes no drag.
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
    """The same from the step's matrix, found by taking the step on the two unit vectors."""
    flow: Callable[..., Any] | None = (lambda t, q, v, h: v * np.exp(-g * h)) if np.any(g) else None
    step = single_step(method, oscillator(z * z, g, flow), z)
    one, zero = np.ones_like(z), np.zeros_like(z)
    (a, c), (b, d) = step(0.0, one, zero, 1.0), step(0.0, zero, one, 1.0)
    square = ((a - d) / 2.0) ** 2 + b * c
    turning = np.sqrt(np.maximum(a * d - b * c, 0.0))
    found: FloatArray = np.where(square < 0.0, turning, np.abs((a + d) / 2.0) + np.sqrt(np.maximum(square, 0.0)))
    return found


def _sides(method: Method) -> tuple[list[float], list[float]]:
    """Coefficients of R's numerator and denominator, from the constant upwards, without zeros at their ends."""
    sides = method.stability_polynomials
    if sides is None:
        raise MethodError(f"{method.name}: stability functions are for Runge-Kutta tables, not for {method.family}.")
    top, bottom = ([float(x) if abs(x) > ROUNDING else 0.0 for x in side] for side in sides)
    for side in (top, bottom):
        while len(side) > 1 and not side[-1]:
            side.pop()
    return top, bottom


def _decimals(polynomial: Series) -> list[Decimal]:
    return [Decimal(x.numerator) / x.denominator for x in polynomial.c]


def _errors(matrix: Polynomials, true: Polynomials, z: Decimal) -> tuple[float, float]:
    """``r - 1`` and ``phi - z`` from the step's matrix, numerators and denominator, and the true cosine and sine."""
    *numerators, scale = (horner(polynomial, z) for polynomial in matrix)
    a, b, c, d = (entry / scale for entry in numerators)
    x, det = (a + d) / 2, a * d - b * c
    square = det - x * x
    if square < 0:
        return _clean(abs(x) + (-square).sqrt() - 1), math.nan
    return _errors_of_root((x, square.sqrt().copy_sign(b)), true, z)


def _errors_of_root(root: tuple[Decimal, Decimal], true: Polynomials, z: Decimal) -> tuple[float, float]:
    x, y = root
    cos, sin = (horner(polynomial, z) for polynomial in true)
    growth = (x * x + y * y).sqrt() - 1
    return _clean(growth), math.atan2(_clean(y * cos - x * sin), float(x * cos + y * sin))


def _clean(x: Decimal) -> float:
    """A float, without what rounding in the last third of the digits leaves."""
    return float(x) if abs(x) > Decimal(10) ** (-2 * DIGITS // 3) else 0.0
