"""Compensated summation: what rounding takes from q and v in each addition is kept, and added with the next.

A state is then q + lost_q, of which q is the nearest double. Every addition to q and v gives two numbers, the rounded
sum and its error, together exact (Moller 1965, BIT 5, 37; Kahan 1965, Comm. ACM 8, 40): once a step for Runge-Kutta-
like methods, for each drift and kick of a splitting (Kahan & Li 1997, Math. Comp. 66, 1089). What is left is the
rounding of the increments, smaller by about the step in units of the motion's time scale, and of no preferred sign, so
that the energy's error grows with the square root of the number of steps (Hairer, Lubich & Wanner 2006, Geometric
Numerical Integration, VIII.5). For that the coefficients must be those of the method, not their nearest doubles, which
err alike in every step (Hairer, McLachlan & Razakarivony 2008, BIT 48, 231): they enter with their low parts, and
products with the step with their roundings.

Symmetric multistep methods and closed forms have no such step, and refuse: the first make the velocity anew from
earlier mean velocities, each rounded, and not from the last one; the second add nothing up.

It helps where an orbit is kept for very many steps, and errors of the method are below rounding: symplectic and
high-order methods without damping. It does not where energy is lost, as the motion forgets what rounding did to it;
exact flows of a drag and of dry friction return velocities, not increments, and are rounded as these are. Stages of
implicit methods are solved with the nearest doubles of the table's coefficients. A compiled step takes 1.2 to 1.5 times
as long as a plain one, an interpreted one up to 1.7 times; plain steps stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from integrators.method import MethodError
from integrators.solving.values import check_truth

LOST = ("lost_q", "lost_v")
"""What a compensated step takes and returns behind q, v and its memory."""

SPLITTER = 134217729.0
"""2**27 + 1, which cuts a double into halves of 26 bits (Dekker 1971, Numer. Math. 18, 224)."""


def added(x: Any, lost: Any, change: Any, low: Any) -> tuple[Any, Any]:
    """``x + lost + change + low`` as the nearest double and what that leaves out, for a small ``low``.

    ``x + change`` and its error are exact (Moller 1965; Knuth 1998, 4.2.2, theorem B), whichever is larger.
    """
    total = x + change
    part = total - x
    rest = ((x - (total - part)) + (change - part)) + (lost + low)
    x = total + rest
    return x, rest - (x - total)


def scaled(factor: Any, low: Any, h: Any) -> tuple[Any, Any]:
    """``(factor + low)*h`` as the nearest double and what that leaves out (Dekker 1971), for a small ``low``."""
    product = factor * h
    shifted = factor * SPLITTER
    head = shifted - (shifted - factor)
    tail = factor - head
    shifted = h * SPLITTER
    high = shifted - (shifted - h)
    rest = h - high
    return product, (((head * high - product) + head * rest + tail * high) + tail * rest) + low * h


def check_compensated(compensated: bool, rtol: Any) -> bool:
    """``compensated`` as a bool; MethodError for anything else, and where a tolerance chooses the steps."""
    found = check_truth(compensated, "compensated")
    if found and rtol is not None:
        raise MethodError(
            "compensated goes with steps of one length, not with rtol: a tolerance allows errors far above rounding."
        )
    return found


def stepping(step: Callable[..., tuple[Any, Any]]) -> Callable[..., tuple[Any, ...]]:
    """A compensated step from ``step(t, q, v, h) -> increments of q and v``."""

    def compensated_step(t: Any, q: Any, v: Any, lost_q: Any, lost_v: Any, h: Any) -> tuple[Any, ...]:
        change_q, change_v = step(t, q, v, h)
        (q, lost_q), (v, lost_v) = added(q, lost_q, change_q, 0.0), added(v, lost_v, change_v, 0.0)
        return q, v, lost_q, lost_v

    return compensated_step
