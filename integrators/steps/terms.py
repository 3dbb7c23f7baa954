"""Notation in which a family of methods writes the source of a step: sums of products, and source lines."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import ClassVar

Number = Callable[[Fraction], str]


def literal(value: Fraction) -> str:
    """Return an exact coefficient as the text of a Python float literal, rounded once to double precision."""
    return repr(float(value))


# --- sums as data -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Product:
    """One term of a sum in a step's source: an exact coefficient times factors, multiplied left to right.

    ``Product(Fraction(1, 2), ("h", "a"))`` is ``0.5*h*a``. The step's length ``h`` stands first among the factors.

    Attributes:
        weight: the coefficient, with its sign.
        factors: names in the source, and sums in parentheses, given as tuples of terms.
    """

    weight: Fraction
    factors: tuple[str | Terms, ...]


Terms = tuple[Product, ...]
"""A sum, added from left to right; ``()`` is zero. Sums are joined by ``+``."""


def term(weight: Fraction | int, *factors: str | Terms) -> Terms:
    """Return a product of a coefficient and factors (names or sums), as a sum of this one term."""
    return (Product(Fraction(weight), factors),)


def weighted(weights: Sequence[Fraction], names: Sequence[str]) -> Terms:
    """Return the sum of names times their weights as a tuple of terms, without those of weight zero."""
    return tuple(Product(weight, (name,)) for weight, name in zip(weights, names, strict=True) if weight)


def times_step(total: Terms) -> Terms:
    """Return a sum of terms multiplied by the step's length h, as one term; an empty sum stays empty."""
    if not total:
        return ()
    single = len(total) == len(total[0].factors) == total[0].weight == 1
    return (Product(Fraction(1), ("h", total[0].factors[0] if single else total)),)


def increment(weights: Sequence[Fraction], slopes: Sequence[str]) -> Terms:
    """Return h times a weighted sum of slopes as terms: the increment of q or v in a step or stage."""
    return times_step(weighted(weights, slopes))


def signed(parts: Iterable[tuple[bool, str]]) -> str:
    """Return the source text of a sum, such as ``-x + y``, from the texts of its terms.

    Each pair is True if the term is subtracted, and the text of the term without its sign.
    """
    text = ""
    for negative, part in parts:
        minus = negative != part.startswith("-")
        text += ((" - " if minus else " + ") if text else "-" if minus else "") + part.removeprefix("-")
    return text


def text_of(total: Terms, number: Number) -> str:
    """Return the source text of a sum of terms, such as ``0.5*h*a - h*(b + c)``; empty for an empty sum."""
    parts = []
    for one in total:
        size = [number(abs(one.weight))] if abs(one.weight) != 1 else []
        factors = (x if isinstance(x, str) else f"({text_of(x, number)})" for x in one.factors)
        parts.append((one.weight < 0, "*".join([*size, *factors])))
    return signed(parts)


def combination(weights: Sequence[Fraction], names: Sequence[str], number: Number) -> str:
    """Return the source text of a weighted sum of names, such as ``0.5*k1 - k3``; empty if all weights are 0."""
    return text_of(weighted(weights, names), number)


def plus(base: str, weights: Sequence[Fraction], names: Sequence[str], number: Number) -> str:
    """Return the source text of ``base + h*(weighted sum of names)``, or ``base`` alone if all weights are 0."""
    change = text_of(increment(weights, names), number)
    return f"{base} + {change}" if change else base


def fraction_of(fraction: Fraction, number: Number) -> str:
    """Return the source text of a fraction of the step's length, such as ``0.5*h``."""
    return "h" if fraction == 1 else f"{number(fraction)}*h"


def time_at(fraction: Fraction, number: Number) -> str:
    """Return the source text of the time at a fraction of the step, such as ``t + 0.5*h``."""
    return "t" if fraction == 0 else f"t + {fraction_of(fraction, number)}"


# --- functions and steps ----------------------------------------------------------------------------------------------


def docstring(text: str) -> str:
    """Return a text as the source of a docstring, whatever a user wrote in it: quotes, backslashes, control characters.
    """
    shown = "".join(c if (c.isprintable() and c != "\\") or c == "\n" else c.encode("unicode_escape").decode()
                    for c in text)
    if '"""' in shown or shown.endswith('"'):
        shown = shown.replace('"', '\\"')
    return f'"""{shown}"""'


def definition(signature: str, doc: str, lines: Sequence[str]) -> str:
    """Return the Python source of one function, from its signature, docstring and body lines."""
    body = "\n".join(f"    {line}" for line in lines)
    return f"def {signature}:\n    {docstring(doc)}\n{body}\n"


def begin_with_force(more: str) -> str:
    """Return the source of ``begin``, which computes the force before the first step.

    It serves methods that pass only the force from one step to the next. ``more`` is the text of further arguments.
    """
    doc = "Return the force with which the first step begins."
    return definition(f"begin(t, q, v, h{more})", doc, [f"return force(t, q{more})"]) + "\n\n"


@dataclass(frozen=True)
class Notation:
    """The names and numbers in which a step's source is written; :func:`integrators.steps.unroll.unroll` explains them.

    Attributes:
        quadratures: names of integrals that are carried along the step.
        extra: names of further run-time arguments of all functions.
        hooks: name of a function that the problem brings, such as ``kick`` -> the quadratures to which it adds.
        number: function that returns a coefficient as source text.
        exact_drag: True if two drag flows in a row equal one flow over both times.
        dense: True for a step that also returns its stages.
        refines: True for the source of one step of Newton's method beside every function that solves a stage.
    """

    quadratures: tuple[str, ...] = ()
    extra: tuple[str, ...] = ()
    hooks: Mapping[str, Sequence[str]] = field(default_factory=dict)
    number: Callable[[Fraction], str] = literal  # no alias, as it is looked up in the modules of subclasses
    exact_drag: bool = True
    dense: bool = False
    refines: bool = False

    @property
    def more(self) -> str:
        """The source text of further run-time arguments at the end of a list of arguments, such as ``, p, u``."""
        return "".join(f", {name}" for name in self.extra)

    @property
    def slope(self) -> str:
        """Name of the function that a step calls for slopes: ``rates`` or ``acceleration``.

        ``rates`` also returns the rates of quadratures (integrals carried along the step, such as work).
        """
        return "rates" if self.quadratures else "acceleration"

    def new_step(self) -> StepLines:
        """Return an empty :class:`StepLines`, to which a family of methods adds the source lines of a step."""
        return StepLines(self)


@dataclass
class StepLines:
    """Source lines of one step function, in the order in which they run; a family of methods appends them.

    Lines that add to the angle q or the velocity v go through ``sum``, ``advance``, ``end`` and ``flow``. These methods
    know the terms of the sum, so that :mod:`integrators.steps.compensated` can add compensated sums instead.

    Attributes:
        notation: names and number format of the source.
        lines: the lines so far.
        carried: names of further values that a step takes and returns, such as the rounding errors of q and v.
    """

    notation: Notation
    lines: list[str] = field(default_factory=list)
    carried: ClassVar[tuple[str, ...]] = ()

    def line(self, text: str) -> None:
        """Append a line to a step's source; the line must not change the angle q or the velocity v."""
        self.lines.append(text)

    def sum(self, y: str, change: Terms) -> str:
        """Return the source text of the angle or velocity at a stage: ``y + change``, where ``y`` is ``q`` or ``v``."""
        return f"{y} + {text_of(change, self.notation.number)}" if change else y

    def advance(self, y: str, change: Terms, name: str = "") -> None:
        """Append a source line that advances the angle or the velocity, ``y = y + change``.

        ``y`` is ``q`` or ``v``. With ``name``, the line is ``name = y + change``.
        """
        self.line(f"{name or y} = {self.sum(y, change)}")

    end = sum
    """As :meth:`sum`, for the angle or velocity at the step's end."""

    def flow(self, function: str, arguments: str, increments: Sequence[str] = (), change: Terms = ()) -> None:
        """Append the call of a problem's function such as ``kick``, which returns the new velocity and increments.

        Args:
            function: the function's name.
            arguments: the text of the call's arguments, without further run-time arguments.
            increments: names for the increments of quadratures (integrals carried along the step, such as work).
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
            memory: name of a value that one step passes to the next one -> its name or text at the step's end.
            increments: the texts of the increments of quadratures (integrals carried along the step), and of anything
                else that the step returns.
        """
        memory = memory or {}
        arguments = ", ".join(["t", "q", "v", *memory, *self.carried, "h"])
        results = ", ".join([*ends, *memory.values(), *self.carried, *increments])
        lines = [*self.lines, f"return {results}"]
        return definition(f"step({arguments}{self.notation.more})", title, lines)
