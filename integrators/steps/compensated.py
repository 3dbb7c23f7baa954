"""Compensated summation: the rounding error of every addition to q and v is stored, and added with the next increment.

The angle is then q + lost_q, and the velocity v + lost_v; q and v are the nearest doubles. An addition yields the
rounded sum and its rounding error, which together are exact (Moller 1965, BIT 5, 37; Kahan 1965, Comm. ACM 8, 40).
Runge-Kutta-like methods add once in a step, splittings in every drift and kick (Kahan & Li 1997, Math. Comp. 66, 1089).
The remaining error is the rounding of the increments. It is smaller by about the step in units of the motion's time
scale, and its sign is random, so that the energy error grows with the square root of the number of steps (Hairer,
Lubich & Wanner 2006, Geometric Numerical Integration, VIII.5). Rounded coefficients would err with one sign in every
step (Hairer, McLachlan & Razakarivony 2008, BIT 48, 231). The part of a coefficient that its double leaves out, its low
part, is therefore added too, and so is the rounding error of a coefficient times h.

Symmetric multistep methods and closed-form solutions cannot be compensated. The former compute the velocity from
several earlier mean velocities, all rounded, and not from the last velocity; the latter add nothing to the state.

Compensation helps in very long runs where the method errs less than rounding does: symplectic and high-order methods
without damping. It does not help where energy is lost, as a damped motion forgets its rounding errors. Exact flows of
drag and of dry friction return velocities, not increments, so that their rounding remains. Stages of implicit methods
are solved with rounded coefficients. A compensated step takes 1.2 to 1.5 times as long as a plain one when compiled,
and up to 1.7 times when interpreted. Plain steps do not change.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from integrators.method import MethodError
from integrators.solving.values import check_truth

LOST = ("lost_q", "lost_v")
"""Names of the rounding errors of q and v, which a compensated step takes and returns after q, v and its memory."""

SPLITTER = 134217729.0
"""2**27 + 1; multiplication by it splits a double into halves of 26 bits (Dekker 1971, Numer. Math. 18, 224)."""


def added(x: Any, lost: Any, change: Any, low: Any) -> tuple[Any, Any]:
    """Return the double nearest to ``x + lost + change + low``, and the remainder: one compensated addition.

    ``lost`` is the stored rounding error of x, and ``low`` the rounding error of ``change``; both must be small. The
    sum ``x + change`` and its rounding error are exact, whichever of the two is larger (Moller 1965; Knuth 1998, 4.2.2,
    theorem B).
    """
    total = x + change
    part = total - x
    rest = ((x - (total - part)) + (change - part)) + (lost + low)
    x = total + rest
    return x, rest - (x - total)


def scaled(factor: Any, low: Any, h: Any) -> tuple[Any, Any]:
    """Return the double nearest to ``(factor + low)*h``, and the remainder (Dekker 1971).

    ``low`` is the small part of a coefficient that its double ``factor`` leaves out.
    """
    product = factor * h
    shifted = factor * SPLITTER
    head = shifted - (shifted - factor)
    tail = factor - head
    shifted = h * SPLITTER
    high = shifted - (shifted - h)
    rest = h - high
    return product, (((head * high - product) + head * rest + tail * high) + tail * rest) + low * h


def check_compensated(compensated: bool, rtol: Any) -> bool:
    """Check the keyword ``compensated`` (compensated summation) and return it as a bool.

    Raises MethodError unless it is True or False, and if it is True together with a tolerance ``rtol``.
    """
    switch = check_truth(compensated, "compensated")
    if switch and rtol is not None:
        raise MethodError(
            "compensated goes with steps of one length, not with rtol: a tolerance allows errors far above rounding."
        )
    return switch


def stepping(step: Callable[..., tuple[Any, Any]]) -> Callable[..., tuple[Any, ...]]:
    """Return a step with compensated summation, from a function that returns the increments of q and v.

    That function is ``step(t, q, v, h)``.
    """

    def compensated_step(t: Any, q: Any, v: Any, lost_q: Any, lost_v: Any, h: Any) -> tuple[Any, ...]:
        change_q, change_v = step(t, q, v, h)
        (q, lost_q), (v, lost_v) = added(q, lost_q, change_q, 0.0), added(v, lost_v, change_v, 0.0)
        return q, v, lost_q, lost_v

    return compensated_step
