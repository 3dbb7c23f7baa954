"""Random numbers drawn inside a step by plain arithmetic, with identical bits interpreted and compiled, on any machine.

MRG32k3a, L'Ecuyer 1999, Operations Research 47, 159: two recurrences of order 3 with moduli near 2**32 and period
2**191, designed for double precision: every product is a whole number below 2**53. A state is six whole numbers,
all from 1 to MOST, which both recurrences allow.
"""

from __future__ import annotations

from typing import Any

from pendulum_env.physics.elementary import cos, log, sqrt

MOST = 4294944442.0
"""Largest number in the generator's state that both recurrences allow."""


def remainder(x: float, modulus: float) -> float:
    """Return the remainder of a whole number below 2**53, from 0 to below ``modulus``."""
    rest = x - ((x / modulus + 6755399441055744.0) - 6755399441055744.0) * modulus
    return rest + modulus if rest < 0.0 else rest


def next_uniform(
    a0: float, a1: float, a2: float, b0: float, b1: float, b2: float
) -> tuple[float, float, float, float, float, float, float]:
    """Return the next state of the generator and a uniform random number between 0 and 1, both excluded.

    The state holds the oldest number of each recurrence first.
    """
    a3 = remainder(1403580.0 * a1 - 810728.0 * a0, 4294967087.0)
    b3 = remainder(527612.0 * b2 - 1370589.0 * b0, 4294944443.0)
    difference = a3 - b3
    shifted = difference if difference > 0.0 else difference + 4294967087.0
    return a1, a2, a3, b1, b2, b3, shifted * 2.328306549295728e-10


def normal(first: float, second: float) -> float:
    """Return a standard normal random number from two uniform ones (Box & Muller 1958, Ann. Math. Stat. 29, 610)."""
    return sqrt(-2.0 * log(first)) * cos(6.283185307179586 * second)


def started(uniform: Any) -> Any:
    """Return a whole number from 1 to 4294944442, for the generator's state, from a number in [0, 1); floats or arrays.
    """
    return (uniform * MOST) // 1.0 + 1.0
