"""What a method's own order and roundings leave of a motion, from its declaration and its table alone."""

from __future__ import annotations

import math
from fractions import Fraction

from integrators import Method, Multistep
from integrators.families.runge_kutta import RungeKutta
from integrators.families.second_order import SecondOrder
from integrators.families.splitting import DRIFT, KICK, Splitting


def left(method: Method, product: float, phase: float) -> float:
    """Part of a motion's size that a method's order leaves after ``phase`` [rad] in steps of ``product`` [rad].

    ``product**order * phase``, error constants being below 1; at most a tenth, beyond which nothing is accurate.
    """
    return float(min(product**method.order * phase, 0.1))


def retraces(method: Method) -> bool:
    """True if a step back undoes a step; a symmetric method with a past of several steps begins it anew."""
    return method.symmetric and len(method.memory) <= 1


def cancelling(method: Method) -> float:
    """By how much a step amplifies its roundings: the largest sum of |coefficients| of which a stage is made."""
    sums = [Fraction(1)]
    if isinstance(method, RungeKutta):
        rows = (method.b, *(method.a[i] for i in method.stages))
        sums += [sum((abs(part) for part in row), Fraction(0)) for row in rows]
    if isinstance(method, Splitting):
        sums += [sum((abs(part) for kind, part in method.flows if kind == one), Fraction(0)) for one in (KICK, DRIFT)]
    if isinstance(method, SecondOrder):
        sums.append(sum((abs(part) for part in method.means), Fraction(0)))
    return float(max(sums))


def error_constant(method: Method) -> float:
    """Of the error of a step, C (pace h)**(p + 1): Taylor's 1/(p + 1)! for methods of one step.

    Compositions have a step of c h in each piece, so that their errors add up as |c|**(p + 1); multistep methods have
    1/2 at most (Hairer, Norsett & Wanner 1993, II.3 and III.2; Hairer, Lubich & Wanner 2006, II.4).
    """
    power = method.order + 1
    if isinstance(method, Multistep) or math.isinf(power):
        return 0.5
    pieces = [1.0]
    if isinstance(method, Splitting):
        pieces += [sum(abs(float(part)) ** power for kind, part in method.flows if kind == one)
                   for one in (KICK, DRIFT)]
    return min(0.5, max(pieces) / math.factorial(power))
