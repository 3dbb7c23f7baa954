"""PI controller: the length of the next step from the errors of the last two steps.

It uses only basic arithmetic on floats and no function of the machine's mathematical library, so that step sizes have
the same bits on every machine, interpreted or compiled.
"""

from __future__ import annotations

LN2 = 0.6931471805599453
SAFETY = 0.9
"""Safety factor on the step that would just meet the tolerance."""
PATIENCE = 0.9688861611972633
"""``SAFETY**0.3``, the safety factor with which the PI controller converges to the same error as without memory."""
SHRINK, GROW = 0.2, 10.0
"""Smallest and largest ratio of the next step to the last one."""
BROKEN = 0.1
"""Ratio of the next step to a step whose result was not finite."""
SMALLEST_ERROR = 1e-4
"""Smaller errors of the previous step are replaced by this (Hairer, Norsett & Wanner 1993, code DOPRI5)."""


def step_power(x: float, p: float) -> float:
    """Return ``x**p`` with a relative error of 1e-7, for positive x and ``abs(p log(x))`` up to 700."""
    log = 0.0
    while x > 1.5:
        x = 0.5 * x
        log = log + LN2
    while x < 0.75:
        x = x + x
        log = log - LN2
    y = (x - 1.0) / (x + 1.0)
    w = y * y
    tail = 1.0 + w * (1.0 / 3.0 + w * (0.2 + w * (1.0 / 7.0 + w * (1.0 / 9.0 + w * (1.0 / 11.0)))))
    z = p * (log + 2.0 * y * tail)
    halvings = 0
    while abs(z) > 0.1:
        z = 0.5 * z
        halvings = halvings + 1
    power = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0 * (1.0 + z / 6.0)))))
    for _ in range(halvings):
        power = power * power
    return power


def growth(error: float, last: float, order: float) -> float:
    """Return the ratio of the next step to an accepted step, from 0.2 to 10.

    It is ``(error/e)**(-0.7/k) (last/e)**(0.4/k)`` with ``e = 0.9**k`` and k = ``order``, where the error estimate is
    proportional to ``h**k``: the PI controller of Gustafsson 1991, ACM Trans. Math. Softw. 17, 533. ``error`` is the
    error of the step and ``last`` that of the step before, both in units of the tolerance. If ``last`` is 0, because
    there was no step before, the ratio is ``0.9 error**(-1/k)``.
    """
    size = max(error, 1e-300)
    if last > 0.0:
        ratio = PATIENCE * step_power(size, -0.7 / order) * step_power(max(last, SMALLEST_ERROR), 0.4 / order)
    else:
        ratio = SAFETY * step_power(size, -1.0 / order)
    return min(GROW, max(SHRINK, ratio))


def shrinkage(error: float, order: float) -> float:
    """Return the ratio of the next step to a rejected one: ``0.9 error**(-1/k)``, at least 0.2; after nan or inf 0.1.

    k is ``order``; the error estimate is proportional to ``h**k``.
    """
    if not error <= 1e300:
        return BROKEN
    return max(SHRINK, SAFETY * step_power(error, -1.0 / order))
