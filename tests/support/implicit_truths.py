"""What the implicit methods must be, from outside the package: their stability functions."""

from __future__ import annotations

from fractions import Fraction
from math import comb, factorial, inf

Polynomial = tuple[Fraction, ...]

LIMITS = dict.fromkeys(
    ("trapezoid", "sdirk2", "sdirk4", "gauss4", "gauss6", "gauss8", "radau3", "radau5", "lobatto3c"), inf
)
"""All of them are A-stable: no step is too long for the oscillator or for drag."""

def pade(k: int, j: int) -> tuple[Polynomial, Polynomial]:
    """Numerator of degree k and denominator of degree j of exp's Padé approximation (Hairer & Wanner 1996, IV.3.30)."""

    def side(degree: int, sign: int) -> Polynomial:
        return tuple(
            Fraction(sign**i * factorial(degree) * factorial(k + j - i), factorial(degree - i) * factorial(k + j))
            / factorial(i)
            for i in range(degree + 1)
        )

    return side(k, 1), side(j, -1)


def laguerre(stages: int, gamma: Fraction) -> tuple[Polynomial, Polynomial]:
    """R of a stiffly accurate diagonally implicit method of order s - 1: its numerator, of degree s - 1, by its order.

    R = P/(1 - gamma w)^s, where P is the series of exp w (1 - gamma w)^s up to w^(s - 1) (Hairer & Wanner 1996,
    eq. IV.6.10 for L-stable methods).
    """
    bottom = tuple(comb(stages, i) * (-gamma) ** i for i in range(stages + 1))
    top = tuple(sum((bottom[i] / factorial(k - i) for i in range(k + 1)), Fraction(0)) for k in range(stages))
    return top, bottom


GAMMA = Fraction("0.2928932188134524755991556378951509607151640623115")
"""1 - sqrt(1/2); Alexander's R is (1 + (1 - 2 gamma) w)/(1 - gamma w)² (Hairer & Wanner 1996, IV.6)."""

# R's numerator and denominator: of Gauss methods Padé (s, s), of Radau IIA (s - 1, s), of Lobatto IIIC (s - 2, s)
# (Hairer & Wanner 1996, theorem IV.5.12 and proposition IV.3.8).
RATIONAL: dict[str, tuple[Polynomial, Polynomial]] = {
    "trapezoid": pade(1, 1),
    "sdirk2": ((Fraction(1), 1 - 2 * GAMMA), (Fraction(1), -2 * GAMMA, GAMMA**2)),
    "sdirk4": laguerre(5, Fraction(1, 4)),
    "gauss4": pade(2, 2),
    "gauss6": pade(3, 3),
    "gauss8": pade(4, 4),
    "radau3": pade(1, 2),
    "radau5": pade(2, 3),
    "lobatto3c": pade(1, 3),
}


def errors_of_rational(top: Polynomial, bottom: Polynomial) -> tuple[tuple[Fraction, int] | None, ...]:
    """Leading errors of angle, velocity, amplitude and frequency on the oscillator, from R = top/bottom.

    R - exp w = d w^n + ...; of log R - w, whose derivative is R'/R - 1, at w = iz the real part is the amplitude's
    growth, the imaginary part the gain of phase.
    """
    terms = 24
    numerator, denominator = ([*side, *[Fraction(0)] * (terms - len(side))] for side in (top, bottom))
    r: list[Fraction] = []
    for n in range(terms):
        r.append(numerator[n] - sum((denominator[i] * r[n - i] for i in range(1, n + 1)), Fraction(0)))
    wrong = [(x - Fraction(1, factorial(n)), n) for n, x in enumerate(r)]
    step = next(row for row in wrong if abs(row[0]) > 1e-30)
    slope: list[Fraction] = []
    for n in range(terms - 1):
        slope.append((n + 1) * r[n + 1] - sum((slope[i] * r[n - i] for i in range(n)), Fraction(0)))
    log = [Fraction(0), *(x / (n + 1) for n, x in enumerate(slope))]
    log[1] -= 1
    rows = [(x * (-1) ** (n // 2), n - 1) for n, x in enumerate(log) if abs(x) > 1e-30]
    grown = next((row for row in rows if row[1] % 2), None)
    turned = next((row for row in rows if row[1] % 2 == 0), None)
    return step, step, grown, turned
