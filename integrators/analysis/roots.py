"""Real roots of polynomials with exact coefficients: where conditions of stability first fail."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise

import numpy as np

Polynomial = Sequence[Fraction]
"""Coefficients, that of the lowest power first."""
POLISHINGS = 3
"""Newton steps for a root that floating point has found: the first leaves 1e-10 of a polynomial of degree 48."""


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
        wholes.append(whole := _whole(polynomial))
        for root in np.roots([float(x) for x in reversed(polynomial)]):
            if root.real > 0.0 and abs(root.imag) <= 1e-6 * root.real:
                edges += _polished(whole, Fraction(float(root.real)), 0 if root.imag else POLISHINGS)
    edges = sorted(edge for edge in edges if edge >= 0)
    for low, high in pairwise([*edges, 2 * edges[-1] + 1]):
        if any(_at(whole, (low + high) / 2) < 0 for whole in wholes):
            return float(low)
    return math.inf


def _whole(polynomial: Polynomial) -> Polynomial:
    """The same but for a positive factor, in whole numbers: these are quick to use."""
    factor = math.lcm(*(x.denominator for x in polynomial))
    return [x * factor for x in polynomial]


def _at(polynomial: Polynomial, place: Fraction) -> Fraction:
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
            steep = _at(slopes, place)
            place -= Fraction(float(_at(values, place) / steep)) if steep else 0
        return place

    middle = moved(near, slope, bend, 3)
    curved = _at(bend, middle)
    apart = float(-2 * _at(polynomial, middle) / curved) if curved else -1.0
    if abs(middle - near) > near / 10**5 or not 0.0 < apart < 1e-8 * float(near) ** 2:
        for _ in range(times):
            value, rate, curve = (_at(each, near) for each in (polynomial, slope, bend))
            steep = rate * rate - value * curve
            near = Fraction(float(near - (value * rate / steep if steep else 0)))
        return [near]
    half = Fraction(math.sqrt(apart))
    return [moved(middle - half, polynomial, slope, 2), moved(middle + half, polynomial, slope, 2)]
