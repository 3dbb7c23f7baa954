"""Motion under dry friction, half swing by half swing."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import mpmath as mp

from pendulum_env.physics.body import Body

UNIT, LIMIT, RATE = Body(length=1.0, mass=1.0), 0.8, 1.3

STIFFNESS, TORQUE, END = 1.0, 1.2, 20.0


@lru_cache
def by_turns() -> tuple[tuple[mp.mpf, ...], float, float]:
    """Times of all events, and angle and velocity at END: closed forms between events, found in 30 digits.

    theta'' = -theta + TORQUE cos(RATE t) - LIMIT sign(theta') slides as the driven oscillator; it stops at a zero of
    the velocity and stays until |TORQUE cos(RATE t) - theta| reaches LIMIT.
    """
    with mp.workdps(30):
        answer = mp.mpf(TORQUE) / (STIFFNESS - mp.mpf(RATE) ** 2)

        def slide(t0: mp.mpf, q0: mp.mpf, v0: mp.mpf, side: int) -> Callable[[mp.mpf], tuple[mp.mpf, mp.mpf]]:
            p = q0 + side * mp.mpf(LIMIT) - answer * mp.cos(RATE * t0)
            w = v0 + answer * RATE * mp.sin(RATE * t0)
            return lambda t: (
                p * mp.cos(t - t0) + w * mp.sin(t - t0) - side * mp.mpf(LIMIT) + answer * mp.cos(RATE * t),
                -p * mp.sin(t - t0) + w * mp.cos(t - t0) - answer * RATE * mp.sin(RATE * t))

        def first(crossing: Callable[[mp.mpf], mp.mpf], t: mp.mpf) -> mp.mpf:
            """The first time after t from which ``crossing`` is positive; END at the latest."""
            step = mp.mpf(1) / 256
            while crossing(t + step) <= 0:
                t += step
                if t > END:
                    return mp.mpf(END)
            low, high = t, t + step
            for _ in range(100):
                middle = (low + high) / 2
                low, high = (middle, high) if crossing(middle) <= 0 else (low, middle)
            return min(high, mp.mpf(END))

        t, q, v, events = mp.mpf(0), mp.mpf(0), mp.mpf(0), []
        while t < END:
            other = TORQUE * mp.cos(RATE * t) - STIFFNESS * q
            if abs(other) <= LIMIT:
                t = first(lambda s, q=q: abs(TORQUE * mp.cos(RATE * s) - STIFFNESS * q) - LIMIT, t)
            else:
                side = 1 if other > 0 else -1
                path = slide(t, q, v, side)
                stop = first(lambda s, path=path, side=side: -side * path(s)[1], t + mp.mpf(10) ** -12)
                q, v = path(stop)
                t, v = stop, v if stop == END else mp.mpf(0)
            events.append(t)
        return tuple(events), float(q), float(v)
