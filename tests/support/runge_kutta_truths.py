"""What the explicit Runge-Kutta methods must be, from outside the package, and how much rounding they may show."""

from __future__ import annotations

import math
from fractions import Fraction

from integrators import Method, Nystrom, RungeKutta
from integrators.families.adams import Adams
from integrators.families.second_order import SecondOrder

# Largest omega0 h without growth on the undamped oscillator, largest gamma h under drag alone (Hairer & Wanner 1996,
# IV.2): R of order 2 with two stages has |R(iz)|² = 1 + z⁴/4; order 3 with three, sqrt(3) and the root of
# 2 + x + x²/2 + x³/6; order 4 with four, 2 sqrt(2) and the root of 1 + x/2 + x²/6 + x³/24. Pairs: the first roots of
# |R| = 1 in 90 digits, R from the published tables.
LIMITS = {
    "ralston": (0.0, 2.0),
    "kutta3": (math.sqrt(3.0), 2.5127453266183286),
    "ssp_rk3": (math.sqrt(3.0), 2.5127453266183286),
    "rk4_38": (2.0 * math.sqrt(2.0), 2.785293563405282),
    "bs3": (math.sqrt(3.0), 2.5127453266183286),
    "dopri5": (0.9971890086325299, 3.3065678926349467),
    "tsit5": (0.47797886888275207, 3.5068469938049292),
    "dop853": (5.9603598117027794, 6.3936515228510649),
    "verner6": (2.5841995676074590, 4.8552743144895819),
    "verner7": (0.0, 4.6400243353375478),
    "verner8": (0.0, 5.8641132393523253),
    "verner9": (2.7569651249245201, 4.4761727225619106),
}

# Order p, and the next two coefficients of R, sum b A^p 1 and sum b A^(p+1) 1, in 90 digits from the published tables.
STABILITY = {
    "tsit5": (5, "0.001432211324807347768805553", "0"),
    "dop853": (8, "0.000002691692200169085620053287", "0.0000002341345108209779966985344"),
    "verner6": (6, "0.0001980469895121603362065034", "0.000019028145746247938908345"),
    "verner7": (7, "0.00002517769290287156565061973", "0.000002957324245145149198832905"),
    "verner8": (8, "0.000002762949145994102138749434", "0.0000002719894778144408446629402"),
    "verner9": (9, "0.0000002812351328603985694333524", "0.00000003361161047774021497129498"),
}


def errors_from_stability(order: int, *found: str) -> tuple[tuple[Fraction, int], ...]:
    """Leading errors of angle, velocity, amplitude and frequency on the oscillator.

    With d and e what R's coefficients are above those of exp(w), log R(w) - w = d w^(p+1) + (e - d) w^(p+2) + ...; at
    w = iz its real part is the amplitude's growth, its imaginary part the gain of phase.
    """
    d, e = (Fraction(x) - Fraction(1, math.factorial(order + k)) for k, x in enumerate(found, start=1))
    first, second = (d, order + 1), (e - d, order + 2)
    (grown, m), (turned, n) = (first, second) if order % 2 else (second, first)
    return first, first, (grown * (-1) ** (m // 2), m - 1), (turned * (-1) ** (n // 2), n - 1)


def rounding(method: Method, h: float) -> float:
    """What one step of a Runge-Kutta or Nyström method leaves of double precision where all derivatives are about 1.

    So of the sum over earlier steps in a multistep method, whose terms reach 200 with 12 steps. Rounding of a
    stage's sum, h sum |a_ij| or h² sum |a_ij|, enters the result h |b_i| strong: of terms of 200 verner6 keeps 3e-11
    h².
    """
    if isinstance(method, (Adams, SecondOrder)):
        return 2.0**-52 * h * sum(abs(float(x)) for x in (method.b if isinstance(method, Adams) else method.beta))
    if not isinstance(method, (RungeKutta, Nystrom)):
        return 0.0
    strength = h * h if isinstance(method, Nystrom) else h
    sizes = [float(sum(map(abs, line))) for line in method.a]
    total = sum(abs(float(x)) * (1.0 + strength * size) for x, size in zip(method.b, sizes, strict=True))
    return 2.0**-52 * h * total
