"""How a family of methods writes a step: sums of exact coefficients times names, and the lines of a step function."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

Number = Callable[[Fraction], str]


def literal(value: Fraction) -> str:
    """Return a coefficient, rounded once to double precision, as a Python float literal."""
    return repr(float(value))


# --- sums as data -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Product:
    """One term of a sum in a step: an exact coefficient times factors, multiplied from left to right.

    ``Product(Fraction(1, 2), ("h", "a"))`` is ``0.5*h*a``. The step's length ``h`` stands first among the factors.

    Attributes:
        weight: the coefficient, with its sign.
        factors: names, and sums as tuples of terms.
    """

    weight: Fraction
    factors: tuple[str | Terms, ...]


Terms = tuple[Product, ...]
"""A sum, added from left to right; ``()`` is zero. Sums are joined by ``+``."""


def term(weight: Fraction | int, *factors: str | Terms) -> Terms:
    """Return a product of a coefficient and factors, as a sum of one term."""
    return (Product(Fraction(weight), factors),)


def weighted(weights: Sequence[Fraction], names: Sequence[str]) -> Terms:
    """Return the sum of names times their weights, as terms, without those of weight zero."""
    return tuple(Product(weight, (name,)) for weight, name in zip(weights, names, strict=True) if weight)


def times_step(total: Terms) -> Terms:
    """Return a sum times the step's length h, as one term; an empty sum stays empty."""
    if not total:
        return ()
    single = len(total) == len(total[0].factors) == total[0].weight == 1
    return term(1, "h", total[0].factors[0] if single else total)


def increment(weights: Sequence[Fraction], slopes: Sequence[str]) -> Terms:
    """Return h times a weighted sum of slopes, the increment of the angle or the velocity in a step or stage."""
    return times_step(weighted(weights, slopes))


def signed(parts: Iterable[tuple[bool, str]]) -> str:
    """Return the text of a sum from its terms' texts, each with True if the term is subtracted: ``-x + y``."""
    text = ""
    for negative, part in parts:
        minus = negative != part.startswith("-")
        text += ((" - " if minus else " + ") if text else "-" if minus else "") + part.removeprefix("-")
    return text


def text_of(total: Terms, number: Number) -> str:
    """Return the text of a sum, such as ``0.5*h*a - h*(b + c)``; empty for an empty sum."""
    return signed((term.weight < 0, _product(term, number)) for term in total)


def _product(term: Product, number: Number) -> str:
    """Return the text of a term without its sign."""
    size = [number(abs(term.weight))] if abs(term.weight) != 1 else []
    return "*".join([*size, *(x if isinstance(x, str) else f"({text_of(x, number)})" for x in term.factors)])


def combination(weights: Sequence[Fraction], names: Sequence[str], number: Number) -> str:
    """Return the text of a sum of weighted names without its zero terms, ``0.5*k1 - k3``; empty if all are zero."""
    return text_of(weighted(weights, names), number)


def plus(base: str, weights: Sequence[Fraction], names: Sequence[str], number: Number) -> str:
    """Return the text of ``base + h*(sum of weighted names)``, or ``base`` alone if all weights are zero."""
    change = text_of(increment(weights, names), number)
    return f"{base} + {change}" if change else base


def fraction_of(fraction: Fraction, number: Number) -> str:
    """Return the text of a fraction of the step's length: ``0.5*h``."""
    return "h" if fraction == 1 else f"{number(fraction)}*h"


def time_at(fraction: Fraction, number: Number) -> str:
    """Return the text of the time at a fraction of the step: ``t + 0.5*h``."""
    return "t" if fraction == 0 else f"t + {fraction_of(fraction, number)}"


# --- functions and steps ----------------------------------------------------------------------------------------------


def definition(signature: str, doc: str, lines: Sequence[str]) -> str:
    """Return the source of one function, from its signature, docstring and lines."""
    body = "\n".join(f"    {line}" for line in lines)
    return f'def {signature}:\n    """{doc}"""\n{body}\n'


def begin_with_force(more: str) -> str:
    """Return the source of ``begin`` for methods whose memory is the force; ``more`` ends its list of arguments."""
    return definition(f"begin(t, q, v, h{more})", "The force.", [f"return force(t, q{more})"]) + "\n\n"


@dataclass(frozen=True)
class Notation:
    """The names and numbers in which a step's source is written; :func:`integrators.steps.unroll.unroll` explains them.

    Attributes:
        quadratures: names of integrals that are carried along the step.
        extra: names of further run-time arguments of all functions.
        hooks: functions that the problem brings -> the quadratures to which the function adds.
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
        """The name of the function that returns slopes: ``rates`` if there are quadratures, else ``acceleration``."""
        return "rates" if self.quadratures else "acceleration"

    def new_step(self) -> StepLines:
        """Return an empty step, to which a family adds its lines."""
        return StepLines(self)


class StepLines:
    """The source lines of one step function, in the order in which they run.

    Lines that add to the angle q or the velocity v go through ``sum``, ``advance``, ``end`` and ``flow``. These methods
    know the terms of the sum, so that :mod:`integrators.steps.compensated_lines` can add compensated sums instead.

    Attributes:
        notation: names and numbers.
        lines: the lines so far.
        carried: further values that a step takes and returns after its memory.
    """

    carried: tuple[str, ...] = ()

    def __init__(self, notation: Notation) -> None:
        self.notation = notation
        self.lines: list[str] = []

    def line(self, text: str) -> None:
        """Append a source line to the step; the line must not change q or v."""
        self.lines.append(text)

    def sum(self, y: str, change: Terms) -> str:
        """Return the text of a stage's angle or velocity, ``y + change``, where ``y`` is ``q`` or ``v``."""
        return f"{y} + {text_of(change, self.notation.number)}" if change else y

    def advance(self, y: str, change: Terms, name: str = "") -> None:
        """Append the line ``y = y + change``, where ``y`` is ``q`` or ``v``, or ``name = y + change``."""
        self.line(f"{name or y} = {self.sum(y, change)}")

    def end(self, y: str, change: Terms) -> str:
        """Return the text of the angle or velocity at the step's end, ``y + change``."""
        return self.sum(y, change)

    def flow(self, function: str, arguments: str, increments: Sequence[str] = (), change: Terms = ()) -> None:
        """Append the call of a sub-flow of the problem, which returns the new velocity and increments of quadratures.

        Args:
            function: the sub-flow's name.
            arguments: the text of the call's arguments, without further run-time arguments.
            increments: names for the increments of quadratures.
            change: the increment of the velocity, which holds unless dry friction acts; () if it is unknown.
        """
        self.line(f"{', '.join(['v', *increments])} = {function}({arguments}{self.notation.more})")

    def source(
        self, title: str, ends: Sequence[str], memory: Mapping[str, str] | None = None, increments: Sequence[str] = ()
    ) -> str:
        """Return the source of the function ``step`` that consists of these lines.

        Args:
            title: the step's docstring.
            ends: the names or texts of q and v at the step's end.
            memory: name of a value that one step hands on to the next -> its name or text at the step's end.
            increments: the texts of the quadratures' increments, and of anything else that the step returns.
        """
        memory = memory or {}
        arguments = ", ".join(["t", "q", "v", *memory, *self.carried, "h"])
        results = ", ".join([*ends, *memory.values(), *self.carried, *increments])
        lines = [*self.lines, f"return {results}"]
        return definition(f"step({arguments}{self.notation.more})", title, lines)
