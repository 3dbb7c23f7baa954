"""How long the next step may be, from the errors of the last: the PI controller, in plain arithmetic on floats.

No function of the machine's own library is called, so that step sizes have the same bits everywhere, interpreted or
compiled.
"""

from __future__ import annotations

LN2 = 0.6931471805599453
SAFETY = 0.9
"""Part of the step that would just meet the tolerance."""
PATIENCE = 0.9688861611972633
"""``SAFETY**0.3``: with it the controller comes to rest at the same error."""
SHRINK, GROW = 0.2, 10.0
"""A step follows one of at most 1/SHRINK and at least 1/GROW its length."""
BROKEN = 0.1
"""A step follows one that left the finite range."""
SMALLEST_ERROR = 1e-4
"""Errors below this count as this where they are remembered (Hairer, Norsett & Wanner 1993, code DOPRI5)."""


def step_power(x: float, p: float) -> float:
    """``x**p`` to 1e-7 for positive x and ``abs(p log(x))`` up to 700."""
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
    found = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0 * (1.0 + z / 6.0)))))
    for _ in range(halvings):
        found = found * found
    return found


def growth(error: float, last: float, order: float) -> float:
    """Next step over an accepted one: ``(error/e)**(-0.7/k) (last/e)**(0.4/k)``, e = 0.9**k; from 0.2 to 10.

    ``error`` is the step's, and ``last`` that of the step before, in units of the tolerance: the PI controller of
    Gustafsson 1991, ACM Trans. Math. Softw. 17, 533. With ``last`` 0, where there is none, ``0.9 error**(-1/k)``.
    An estimate goes with ``h**k``, k = ``order``.
    """
    size = max(error, 1e-300)
    if last > 0.0:
        ratio = PATIENCE * step_power(size, -0.7 / order) * step_power(max(last, SMALLEST_ERROR), 0.4 / order)
    else:
        ratio = SAFETY * step_power(size, -1.0 / order)
    return min(GROW, max(SHRINK, ratio))


def shrinkage(error: float, order: float) -> float:
    """Ratio of the next step to a rejected one: ``0.9 error**(-1/k)``, at least 0.2; after nan or inf 0.1."""
    if not error <= 1e300:
        return BROKEN
    return max(SHRINK, SAFETY * step_power(error, -1.0 / order))
