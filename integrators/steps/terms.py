"""Pieces of the steps' source: names, coefficients, linear combinations, times."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

Number = Callable[[Fraction], str]


def literal(value: Fraction) -> str:
    """The coefficient rounded once to double precision, as a literal."""
    return repr(float(value))


@dataclass(frozen=True)
class Notation:
    """The names and numbers in which a step's source is written; :func:`integrators.steps.unroll.unroll` explains them.

    Attributes:
        quadratures: names of integrals that ride along.
        extra: names of further run-time arguments of all functions.
        hooks: functions that the problem brings -> the quadratures that each adds to.
        number: writes a coefficient.
        exact_drag: True if two drag flows in a row are one flow.
        dense: True for a step that also returns its stages.
    """

    quadratures: tuple[str, ...] = ()
    extra: tuple[str, ...] = ()
    hooks: Mapping[str, Sequence[str]] = field(default_factory=dict)
    number: Number = literal
    exact_drag: bool = True
    dense: bool = False

    @property
    def more(self) -> str:
        """The further arguments, as they end a list of arguments: ``, p, u``."""
        return "".join(f", {name}" for name in self.extra)

    @property
    def slope(self) -> str:
        """The function that is asked for slopes: ``rates`` where quadratures ride along, else ``acceleration``."""
        return "rates" if self.quadratures else "acceleration"


def combination(weights: Sequence[Fraction], names: Sequence[str], number: Number) -> str:
    """``0.5*k1 - k3``: a sum without its zero terms; empty if all are zero."""
    text = ""
    for weight, name in zip(weights, names, strict=True):
        if weight == 0:
            continue
        size = name if abs(weight) == 1 else f"{number(abs(weight))}*{name}"
        text += f" - {size}" if weight < 0 else (f" + {size}" if text else size)
    return text.replace(" - ", "-", 1) if text.startswith(" - ") else text


def plus(base: str, weights: Sequence[Fraction], names: Sequence[str], number: Number) -> str:
    """``base + h*(...)``, or ``base`` alone."""
    total = combination(weights, names, number)
    return base if not total else f"{base} + h*{total}" if total in names else f"{base} + h*({total})"


def fraction_of(fraction: Fraction, number: Number) -> str:
    """``0.5*h``: a part of the step."""
    return "h" if fraction == 1 else f"{number(fraction)}*h"


def time_at(fraction: Fraction, number: Number) -> str:
    """``t + 0.5*h``: the time at a node."""
    return "t" if fraction == 0 else f"t + {fraction_of(fraction, number)}"


def definition(signature: str, doc: str, lines: Sequence[str]) -> str:
    """The source of one function."""
    body = "\n".join(f"    {line}" for line in lines)
    return f'def {signature}:\n    """{doc}"""\n{body}\n'


def begin_with_force(more: str) -> str:
    """Source of ``begin`` for methods whose memory is the force."""
    return definition(f"begin(t, q, v, h{more})", "The force.", [f"return force(t, q{more})"]) + "\n\n"
