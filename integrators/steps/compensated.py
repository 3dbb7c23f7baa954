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

The source of a compensated step, which :class:`CompensatedNotation` writes, is a function
``step(t, q, v, *memory, lost_q, lost_v, h, *extra) -> (q, v, *memory, lost_q, lost_v, *increments)``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from integrators.method import MethodError
from integrators.solving.values import check_truth
from integrators.steps.terms import Notation, Product, StepLines, Terms, literal, signed

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


@dataclass(frozen=True)
class CompensatedNotation(Notation):
    """Names and number format in the source of a step with compensated sums.

    Coefficients written as float literals get low parts, which the literals leave out.

    Attributes:
        glides: True if the problem's functions ``kick`` and ``push`` do more than ``v + h a``, because of dry friction:
            their result is then taken as it is, and a velocity of zero has no rounding error.
    """

    glides: bool = False

    def new_step(self) -> StepLines:
        """Return an empty :class:`CompensatedLines`, to which a family of methods adds its source lines."""
        return CompensatedLines(self)


class CompensatedLines(StepLines):
    """Source lines of one step function with compensated sums.

    The lines add to q and v by calls of the function ``added``, and compute products ``coefficient*h`` by ``scaled``.
    """

    carried = LOST

    def __init__(self, notation: CompensatedNotation) -> None:
        super().__init__(notation)
        self.glides = notation.glides
        self.scaled: dict[Fraction, tuple[str, str]] = {}

    def sum(self, y: str, change: Terms) -> str:
        if not change:
            return y
        high, low = self._parts(change)
        return f"{y} + ({high} + ({low}))" if low else f"{y} + ({high})"

    def advance(self, y: str, change: Terms, name: str = "") -> None:
        high, low = self._parts(change)
        self.line(f"{name or y}, lost_{y} = added({y}, lost_{y}, {high or '0.0'}, {low or '0.0'})")

    def end(self, y: str, change: Terms) -> str:
        self.advance(y, change, f"{y}_end")
        return f"{y}_end"

    def flow(self, function: str, arguments: str, increments: Sequence[str] = (), change: Terms = ()) -> None:
        known = bool(change) and not self.glides
        results = ", ".join(["_" if known else "w", *increments])
        self.line(f"{results} = {function}({arguments}{self.notation.more})")
        if known:
            self.advance("v", change)
            return
        if function != "drag":
            self.line("lost_v = 0.0 if w == 0.0 else lost_v")
        self.line("v, lost_v = added(v, lost_v, w - v, 0.0)")

    def source(
        self, title: str, ends: Sequence[str], memory: Mapping[str, str] | None = None, increments: Sequence[str] = ()
    ) -> str:
        coefficients = [(*names, *self._coefficient(weight)) for weight, names in self.scaled.items()]
        self.lines[:0] = [f"{high}, {low} = scaled({x}, {rest or '0.0'}, h)" for high, low, x, rest in coefficients]
        return super().source(title, ends, memory, increments)

    def _parts(self, total: Terms) -> tuple[str, str]:
        """Return the source texts of a sum and of its low part, which rounded coefficients leave out.

        The low part is empty if there is none.
        """
        parts = [(term.weight < 0, *self._product(term)) for term in total]
        return signed((sign, high) for sign, high, _ in parts), signed((sign, low) for sign, _, low in parts if low)

    def _product(self, term: Product) -> tuple[str, str]:
        """Return the source texts of a term without its sign, and of its low part; empty if there is none."""
        weight, factors = abs(term.weight), term.factors
        timed = factors[0] == "h"
        high, low = self._step(weight) if timed else self._coefficient(weight)
        size = [high] if high else []
        for factor in factors[timed:]:
            if isinstance(factor, str):
                inner, rest = factor, ""
            else:
                inner, rest = (f"({text})" if text else "" for text in self._parts(factor))
            lows = [f"{low}*{inner}"] if low else []
            if rest:
                lows.append("*".join([*size, rest]))
            low = f"({' + '.join(lows)})" if len(lows) > 1 else "".join(lows)
            size.append(inner)
        return "*".join(size), low

    def _coefficient(self, weight: Fraction) -> tuple[str, str]:
        """Return the source texts of a coefficient, empty for one, and of its low part.

        The low part is the rest that the coefficient's float literal leaves out.
        """
        low = float(weight - Fraction(float(weight))) if self.notation.number is literal else 0.0
        return "" if weight == 1 else self.notation.number(weight), repr(low) if low else ""

    def _step(self, weight: Fraction) -> tuple[str, str]:
        """Return the source texts of a coefficient times h, and of the low part of this product.

        The step computes this product once and stores it under a name.
        """
        high, low = self._coefficient(weight)
        if self.notation.number is not literal or (not low and math.frexp(weight)[0] == 0.5):
            return f"{high}*h" if high else "h", ""
        place = len(self.scaled) + 1
        return self.scaled.setdefault(weight, (f"h_{place}", f"low_{place}"))
