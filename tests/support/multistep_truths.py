"""What the multistep methods and those of structural dynamics must be, from outside the package."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import mpmath

from integrators import Multistep, System
from integrators.solving.solve import stepper

F = Fraction

# Error constants over sigma(1): Hairer, Norsett & Wanner 1993, sections III.1 to III.2, and III.10 for q'' = f; of
# backward differences -1/(k + 1). Those of Quinlan & Tremaine: what the coefficients leave of the next condition.
CONSTANTS = {
    "ab2": F(5, 12), "ab3": F(3, 8), "ab4": F(251, 720), "ab5": F(95, 288), "ab6": F(19087, 60480),
    "abm4": F(-19, 720),
    "bdf2": F(-1, 3), "bdf3": F(-1, 4), "bdf4": F(-1, 5), "bdf5": F(-1, 6), "bdf6": F(-1, 7),
    "stoermer3": F(1, 12), "stoermer4": F(19, 240), "stoermer5": F(3, 40), "stoermer6": F(863, 12096),
    "numerov": F(-1, 240),
}

# Largest omega0 h of bounded oscillations and gamma h of drag alone. On the real axis Hairer & Wanner 1996, section
# V.1; on the imaginary axis the first roots to leave the unit disc, in 40 digits, but for square roots: Lambert &
# Watson 1976, J. Inst. Maths Applics 18, 189 (Numerov), Newmark 1959.
LIMITS = {
    "ab2": (0.0, 1.0),
    "ab3": (0.7236272269866327, 6 / 11),
    "ab4": (0.429987079909256, 3 / 10),
    "ab5": (0.0, 90 / 551),
    "ab6": (0.0, 5 / 57),
    "abm4": (0.0, 1.284816263106911),
    "bdf2": (math.inf, math.inf),
    "bdf3": (0.0, math.inf),
    "bdf4": (0.0, math.inf),
    "bdf5": (0.7108076710137233, math.inf),
    "bdf6": (0.8431381620971574, math.inf),
    "stoermer3": (math.sqrt(3.0), math.inf),
    "stoermer4": (math.sqrt(2.0), math.inf),
    "stoermer5": (0.0, math.inf),
    "stoermer6": (0.0, math.inf),
    "numerov": (math.sqrt(6.0), math.inf),
    "quinlan_tremaine8": (0.7181688525331604, math.inf),
    "quinlan8a": (0.8580606139082665, math.inf),
    "quinlan8b": (0.3344955663702927, math.inf),
    "quinlan_tremaine10": (0.41524318300171004, math.inf),
    "quinlan_tremaine12": (0.2136220582830679, math.inf),
    "quinlan_tremaine14": (0.11067728589405659, math.inf),
    "newmark_linear": (math.sqrt(12.0), math.inf),
    "hht_alpha": (math.inf, math.inf),
    "generalized_alpha": (math.inf, math.inf),
    "hht_alpha_mean_force": (math.inf, math.inf),
    "generalized_alpha_mean_force": (math.inf, math.inf),
}

# Angles of A(alpha)-stability in degrees (Hairer & Wanner 1996, section V.2).
ANGLES = {"bdf2": 90.0, "bdf3": 86.03, "bdf4": 73.35, "bdf5": 51.84, "bdf6": 17.84}


# Generating coefficients of the Adams and of Störmer's formulas (Hairer, Norsett & Wanner 1993, III.1.7 and III.10.8).
GAMMA = (F(1), F(1, 2), F(5, 12), F(3, 8), F(251, 720), F(95, 288), F(19087, 60480), F(5257, 17280))
SIGMA = (F(1), F(0), F(1, 12), F(1, 12), F(19, 240), F(3, 40), F(863, 12096), F(275, 4032))

Row = tuple[tuple[Fraction, int] | None, ...]


def _errors(order: int, first: Fraction, second: Fraction, angle: tuple[Fraction, int], velocity: Fraction) -> Row:
    """Of angle, velocity, amplitude, frequency; the root that follows exp(w) is x with
    log x = w + first w^(order + 1) + second w^(order + 2) + ...
    """
    rows = [(x * (-1) ** (n // 2), n - 1) for x, n in ((first, order + 1), (second, order + 2)) if x]
    grown = next((row for row in rows if row[1] % 2), None)
    turned = next((row for row in rows if row[1] % 2 == 0), None)
    return angle, (velocity, order + 1), grown, turned


def _adams(k: int) -> Row:
    """From ``w sum_(j<k) gamma_j nabla**j = exp(log x) - 1``, nabla = 1 - 1/x."""
    c = GAMMA[k]
    return _errors(k, -c, (k + 1) * c / 2 - GAMMA[k + 1], (-c, k + 1), -c)


def _backward(k: int) -> Row:
    """From ``w = sum_(j<=k) nabla**j/j = log x - nabla**(k+1)/(k+1) - ...``; one step adds its share of that."""
    share = 1 / sum(F(1, j) for j in range(1, k + 1)) / (k + 1)
    return _errors(k, F(1, k + 1), F(-k, 2 * (k + 2)), (share, k + 1), share)


def _stoermer(k: int, angle: Fraction) -> Row:
    """From ``w**2 sum_(j<k) sigma_j nabla**j = x - 2 + 1/x``."""
    c = SIGMA[k]
    return _errors(k, -c / 2, (k * c / 2 - SIGMA[k + 1]) / 2, (angle, k + 2), -c)


def _balanced(order: int, constant: str, angle: str, velocity: str, total: int = 1) -> Row:
    """Symmetric: half of what the coefficients leave of the next condition, over ``sigma(1)``, and no growth."""
    return _errors(order, -F(constant) / 2 / total, F(0), (F(angle), order + 2), F(velocity))


# Constants of the symmetric ones are what their coefficients leave of the next condition; other figures without a
# formula are those that steps show in 80 digits (check_leading_error).
ERRORS: dict[str, Row] = {
    **{f"ab{k}": _adams(k) for k in range(2, 7)},
    "abm4": _errors(4, F(19, 720), F(-31, 192), (F(19, 720), 5), F(19, 720)),
    **{f"bdf{k}": _backward(k) for k in range(2, 7)},
    "stoermer3": _stoermer(3, F(-19, 180)),
    "stoermer4": _stoermer(4, F(-3, 32)),
    "stoermer5": _stoermer(5, F(-863, 10080)),
    "stoermer6": _stoermer(6, F(-275, 3456)),
    "numerov": _errors(4, F(1, 480), F(0), (F(-1, 45), 5), F(19, 720)),
    "quinlan_tremaine8": _balanced(8, "45767/725760", "-497857/7257600", "-45767/725760", 5),
    "quinlan8a": _balanced(8, "8183/129600", "-4747/69120", "-8183/129600", 4),
    "quinlan8b": _balanced(8, "428321/112492800", "-21563/403200", "-347947/7257600"),
    "quinlan_tremaine10": _balanced(10, "52559/13685760", "-52559/912384", "-17088943/319334400"),
    "quinlan_tremaine12": _balanced(
        12, "16301796103/2615348736000", "-310190718017/5230697472000", "-16301796103/290594304000"),
    "quinlan_tremaine14": _balanced(
        14, "152802083671/31384184832000", "-100726162423/1793381990400", "-152802083671/2853107712000"),
    "newmark_linear": ((F(1, 24), 4), (F(1, 12), 3), None, (F(-1, 24), 2)),
    "hht_alpha": ((F(103, 1200), 3), (F(31, 300), 3), (F(-81, 8000), 3), (F(-251, 2400), 2)),
    "generalized_alpha": ((F(7, 81), 3), (F(19, 216), 3), (F(-1, 1458), 3), (F(-19, 216), 2)),
}
# Under linear forces the average of the forces is the force at the averaged place.
ERRORS |= {f"{name}_mean_force": ERRORS[name] for name in ("hht_alpha", "generalized_alpha")}


def principal_root(method: Multistep, system: System, h: Any) -> Any:
    """The eigenvalue next to exp(i h) of a step on the oscillator, memory and all, by inverse iteration in mpmath."""
    step, _ = stepper(method, system, h)
    fixed = method.counters
    names = ["q", "v", *method.memory]
    free = [i for i, name in enumerate(names) if name not in fixed]
    matrix = mpmath.matrix(len(free))
    for j, i in enumerate(free):
        values = [mpmath.mpf(fixed.get(name, 0)) for name in names]
        values[i] = mpmath.mpf(1)
        end = step(h - h, *values, h)
        for row, k in enumerate(free):
            matrix[row, j] = end[k]
    root = mpmath.expj(h)
    x = mpmath.matrix([mpmath.mpc(1, k) for k in range(len(free))])
    for _ in range(6):
        try:
            y = mpmath.lu_solve(matrix - root * mpmath.eye(len(free)), x)
        except ZeroDivisionError:
            break
        root = root + x[0] / y[0]
        x = y / mpmath.norm(y)
    return root
