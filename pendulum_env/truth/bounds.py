"""Bounds that follow from a method's order and coefficients: its truncation error, rounding, and early growth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

from integrators import Method, RungeKutta
from integrators.families.second_order import SecondOrder
from integrators.families.splitting import DRIFT, KICK, PUSH
from pendulum_env.physics.energy import ABSURD

UNIT = 2.0**-52
"""Distance of 1 from the next larger float."""
ULPS = 50.0
"""Rounding error of a step, in ulps; most of it comes from the rounding of the frequency and of coefficients."""


def order_bound(method: Method, product: float, phase: float) -> float:
    """Return the relative error that a method's order allows after ``phase`` [rad] in steps of ``product`` [rad].

    It is ``product**order * phase``, because error constants are below 1, and at most 0.1; beyond that no run counts as
    accurate.
    """
    return float(min(product**method.order * phase, 0.1))


def retraces(method: Method) -> bool:
    """Return True if a method retraces its steps: a step of -h undoes a step of h.

    It is False for symmetric multistep methods, which compute a new history after a reversal.
    """
    return method.symmetric and len(method.memory) <= 1


def _parts(method: Method, *kinds: str) -> list[Fraction]:
    """Return the fractions of a step that a splitting's sub-flows of these kinds have; [] for other methods."""
    return [part for kind, part in method.sub_flows if kind in kinds]


def rounding_factor(method: Method) -> float:
    """Return the factor by which a method's step amplifies rounding: the largest sum of |coefficients| in a stage."""
    rows: list[Sequence[Fraction]] = [[Fraction(1)], _parts(method, KICK), _parts(method, DRIFT)]
    if isinstance(method, RungeKutta):
        rows += [method.b, *(method.a[i] for i in method.stages)]
    elif isinstance(method, SecondOrder):
        rows += [method.means]
    return float(max(sum(map(abs, row), Fraction(0)) for row in rows))


def rounding(method: Method) -> float:
    """Return a bound of the relative rounding error of a method's step, in units of its increments.

    The error has one sign in every step, because it comes from the rounded coefficients.
    """
    return ULPS * rounding_factor(method) * UNIT


def error_constant(method: Method) -> float:
    """Return the constant C in a bound ``C (rate h)**(p + 1)`` of a step's error, at most 1/2.

    One-step methods have the constant 1/(p + 1)! of a Taylor series. The errors of a composition's sub-steps c h add up
    in proportion to |c|**(p + 1). Multistep methods have at most 1/2 (Hairer, Norsett & Wanner 1993, II.3 and III.2;
    Hairer, Lubich & Wanner 2006, II.4).
    """
    power = method.order + 1
    if math.isinf(power) or not method.one_step:
        return 0.5
    added = (sum(abs(float(part)) ** power for part in _parts(method, kind)) for kind in (KICK, DRIFT))
    return min(0.5, max(1.0, *added) / math.factorial(power))


def too_early(method: Method, angle: float, velocity: float, z: float, count: int) -> str:
    """Return the reason why a run cannot have diverged within its first ``count`` steps; "" if it can.

    A run diverges when its energy, in units of m g L, differs from the initial energy E by ABSURD times (1 + E). Forces
    of at most 1 add at most ``z`` = omega0 h times the sum of a method's |weights| to |velocity| in a step; for methods
    whose velocities are not such sums nothing is known.
    """
    start = 0.5 * velocity * velocity + 1.0 - math.cos(angle)
    needed = math.sqrt(2.0 * max(ABSURD * (1.0 + start) + start - 2.0, 0.0))
    weights = _parts(method, KICK, PUSH) or getattr(method, "corrector", None) or getattr(method, "b", None) or []
    gain = z * float(sum(map(abs, weights))) * (count + 1)
    few = weights and abs(velocity) + gain < needed
    return f"it stopped after {count} steps, too few to gain enough energy to diverge" if few else ""
