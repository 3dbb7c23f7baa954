"""The source of steps whose additions to q and v are compensated; see :mod:`integrators.steps.compensated`.

::

    step(t, q, v, *memory, lost_q, lost_v, h, *extra)  ->  (q, v, *memory, lost_q, lost_v, *increments)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from integrators.steps.compensated import LOST
from integrators.steps.terms import Notation, Product, StepLines, Terms, literal, signed


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
