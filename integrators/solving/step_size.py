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
LEAST, LARGEST = 1e-18, 1e20
"""Smaller and larger errors are replaced by these. Up to order 30, the ratio is at its limit there."""
SMALLEST_ERROR = 1e-4
"""Smaller errors of the previous step are replaced by this (Hairer, Norsett & Wanner 1993, code DOPRI5)."""


def step_power(x: float, p: float) -> float:
    """Return ``x**p`` with a relative error of 1e-7, for positive x and ``abs(p log(x))`` up to 700.

    Its loops are short where x is near 1, as errors of steps are.
    """
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


def halved(x: float, count: float, power: float, scale: float) -> tuple[float, float]:
    """Return x and count after ``power`` halvings of x, if that many leave it above 0.75; ``scale`` is 2**-power."""
    part = x * scale
    return (part if part > 0.75 else x), (count + power if part > 0.75 else count)


def log_of_doublings(n: float) -> float:
    """Return the logarithm of ``2**n``, for whole numbers n up to 184: ``LN2 + LN2 + ... + LN2``, rounded n times.

    As long as the sum stays below the next power of 2, every addition increases it by the same amount.
    """
    first, total, each = 0.0, 0.0, LN2
    first, total, each = (3.0, 2.0794415416798357, 0.6931471805599454) if n >= 3.0 else (first, total, each)
    first, total, each = (6.0, 4.1588830833596715, 0.6931471805599454) if n >= 6.0 else (first, total, each)
    first, total, each = (12.0, 8.317766166719343, 0.6931471805599454) if n >= 12.0 else (first, total, each)
    first, total, each = (23.0, 15.942385152878742, 0.6931471805599436) if n >= 23.0 else (first, total, each)
    first, total, each = (47.0, 32.57791748631739, 0.6931471805599472) if n >= 47.0 else (first, total, each)
    return total + (n - first) * each


def step_power_of_many(x: float, p: float) -> float:
    """Return the bits of :func:`step_power` without branches, for x from 1e-36 to 1e40 and ``abs(p log(x))`` up to 51.

    It compiles to SIMD code. ``x = m 2**n`` with m from 0.75 to 1.5; the series of ``exp(z)`` is taken at ``z/2**k``,
    at most 0.1, and squared k times.
    """
    small = x < 0.75
    m = x * 3.402823669209385e38 if small else x  # times 2**128
    n = 0.0
    m, n = halved(m, n, 128.0, 2.938735877055719e-39)
    m, n = halved(m, n, 64.0, 5.421010862427522e-20)
    m, n = halved(m, n, 32.0, 2.3283064365386963e-10)
    m, n = halved(m, n, 16.0, 1.52587890625e-05)
    m, n = halved(m, n, 8.0, 0.00390625)
    m, n = halved(m, n, 4.0, 0.0625)
    m, n = halved(m, n, 2.0, 0.25)
    m, n = halved(m, n, 1.0, 0.5)
    edge = small and m == 1.5
    m = 0.75 if edge else m
    n = n + 1.0 if edge else n
    log = -log_of_doublings(128.0 - n) if small else log_of_doublings(n)
    y = (m - 1.0) / (m + 1.0)
    w = y * y
    tail = 1.0 + w * (1.0 / 3.0 + w * (0.2 + w * (1.0 / 7.0 + w * (1.0 / 9.0 + w * (1.0 / 11.0)))))
    z = p * (log + 2.0 * y * tail)
    size = abs(z)
    bound = 0.1
    for _ in range(9):
        z = 0.5 * z if size > bound else z
        bound = bound + bound
    power = 1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0 * (1.0 + z / 5.0 * (1.0 + z / 6.0)))))
    bound = 0.1
    for _ in range(9):
        power = power * power if size > bound else power
        bound = bound + bound
    return power


def ratio_powers(error: float, accepted: bool, last: float, order: float) -> tuple[float, float, float, float]:
    """Return bases and exponents of the two powers x**p from which :func:`step_ratio` computes the next step."""
    base = error if error > LEAST else LEAST
    base = base if base < LARGEST else LARGEST
    pair = accepted & (last > 0.0)
    earlier = last if last > SMALLEST_ERROR else SMALLEST_ERROR
    return base, (-0.7 / order if pair else -1.0 / order), earlier, 0.4 / order


def step_ratio(now: float, before: float, error: float, accepted: bool, last: float) -> float:
    """Return the ratio of the next step to this one, from the error of this step in units of the tolerance.

    With k = order, where the error estimate is proportional to ``h**k``, the ratio after an accepted step is
    ``(error/e)**(-0.7/k) (last/e)**(0.4/k)`` with ``e = 0.9**k``, from 0.2 to 10: the PI controller of Gustafsson 1991,
    ACM Trans. Math. Softw. 17, 533. ``last`` is the error of the step before; if it is 0, because there was none, the
    ratio is ``0.9 error**(-1/k)``. So it is after a rejected step, and 0.1 if the error is nan or above 1e300. ``now``
    and ``before`` are the powers of the two errors, see :func:`ratio_powers`.
    """
    ratio = PATIENCE * now * before if accepted & (last > 0.0) else SAFETY * now
    ratio = ratio if ratio > SHRINK else SHRINK
    ratio = ratio if ratio < GROW else GROW
    return ratio if error <= 1e300 else BROKEN


def next_ratio(error: float, accepted: bool, last: float, order: float) -> float:
    """Return the ratio of the next step to this one; see :func:`step_ratio`."""
    base, power, earlier, share = ratio_powers(error, accepted, last, order)
    return step_ratio(step_power(base, power), step_power(earlier, share), error, accepted, last)
