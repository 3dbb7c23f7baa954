"""The root of a multistep method that follows the true oscillation, in many digits."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from decimal import Decimal

from integrators.families.multistep import Multistep

Complex = tuple[Decimal, Decimal]
STRIDE = 0.05
"""Roots are followed from ``omega0 h = 0`` in strides of this."""
SWEEPS = 7
"""Newton steps from double precision to the digits of the context, each of which doubles them."""


def principal_root(method: Multistep, z: float) -> Complex:
    """The root of ``sum_m (i z)**(power m) characteristic[m](x)`` next to ``exp(i z)``: real and imaginary part.

    Followed from z = 0, where it is 1, by Newton's iteration on the complex plane; its last steps are taken in the
    digits of the decimal context.
    """
    rows = [[float(c) for c in row] for row in method.characteristic]
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
    """The root near x, in double precision."""
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
    """``(i z)**(power m)`` for m from 0."""
    units = ((1, 0), (0, 1), (-1, 0), (0, -1))
    sizes = [(z ** (power * m) if m else Decimal(1), units[power * m % 4]) for m in range(count)]
    return [(size * real, size * imaginary) for size, (real, imaginary) in sizes]


def _at(row: Sequence[Decimal], x: Complex) -> Complex:
    total: Complex = (Decimal(0), Decimal(0))
    for c in reversed(row):
        total = _times(total, x)
        total = (total[0] + c, total[1])
    return total


def _plus(x: Complex, y: Complex) -> Complex:
    return x[0] + y[0], x[1] + y[1]


def _times(x: Complex, y: Complex) -> Complex:
    return x[0] * y[0] - x[1] * y[1], x[0] * y[1] + x[1] * y[0]


def _over(x: Complex, y: Complex) -> Complex:
    size = y[0] * y[0] + y[1] * y[1]
    real, imaginary = _times(x, (y[0], -y[1]))
    return real / size, imaginary / size
