"""What every method declares, and the contract of a step.

The problem is ``q'' = a(t, q, v)`` with ``v = q'``: one scalar degree of freedom (arrays are batches of it,
or coupled components, as the acceleration decides). A method advances ``(q, v)`` from ``t`` to ``t + h``.

A step is a plain function, whose source :func:`integrators.steps.unroll.unroll` has from the method's class::

    step(t, q, v, *memory, h, *extra)  ->  (q, v, *memory, *increments)
    begin(t, q, v, h, *extra)          ->  memory, one value or several; for methods that have any

``memory`` is what one step hands on to the next, named by ``Method.memory_with(quadratures)``: the force at its end
(first same as last), or earlier forces. It begins anew where the problem changes, and in ``solve`` where the step's
length does. ``extra`` are run-time arguments handed through to the problem's functions, ``increments`` the quadratures
that ride along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from integrators.errors import MethodError
from integrators.moved import names_of_before
from integrators.steps.terms import Notation
from integrators.system import NEEDS, Acceleration, System

Coefficient = Fraction
ROUNDED = Fraction(1, 10**35)
"""What equations between a table's coefficients may leave, of which roots are rounded to many digits."""


def exact(*values: int | str | Fraction) -> tuple[Fraction, ...]:
    """Coefficients as exact rationals: ``exact(0, "1/2", "0.1786178958448091")``."""
    return tuple(Fraction(value) for value in values)


@dataclass(frozen=True, kw_only=True)
class Method:
    """One integration method: its table and what the literature says of it.

    Attributes:
        name: the field's usual name, in snake case.
        order: the global error is O(h**order) on smooth problems; math.inf for exact solutions.
        source: author, year and where the table stands.
        summary: one line for lists.
        aliases: other names of the same table.
        a_stable, l_stable: stability on ``y' = lambda y``; checked against the table by the tests.
    """

    name: str
    order: int
    source: str
    summary: str
    aliases: tuple[str, ...] = ()
    a_stable: bool = False
    l_stable: bool = False

    family: ClassVar[str]

    @property
    def memory(self) -> tuple[str, ...]:
        """Names of what a step hands on to the next beside the state; none, for one-step methods."""
        return ()

    def memory_with(self, quadratures: Sequence[str]) -> tuple[str, ...]:
        """The same where these quadratures ride along, whose rates a method may remember, too."""
        return self.memory

    @property
    def beginning(self) -> int:
        """Force evaluations that the memory takes to begin; if implicit, without Newton's sweeps."""
        return len(self.memory)

    @property
    def needs(self) -> frozenset[str]:
        """What a system must offer; keys of :data:`NEEDS`."""
        return frozenset({"acceleration"})

    @property
    def implicit(self) -> bool:
        """True if a step solves an equation."""
        return False

    @property
    def evaluations(self) -> int:
        """Force evaluations per step, first same as last counted once; if implicit, per Newton sweep."""
        raise NotImplementedError

    @property
    def dense_order(self) -> int:
        """Dense output errs by O(h**(dense_order + 1)) over one step, beside the errors that the step began with.

        Here that of Hermite interpolation: cubic below order 4, else quintic; see :mod:`integrators.solving.dense`.
        """
        return min(self.order, 3) if self.order < 4 else min(self.order - 1, 4)

    @property
    def embedded_orders(self) -> tuple[int, ...]:
        """Orders of the results with which the method's own is compared to estimate its error; () without estimates."""
        return ()

    @property
    def evaluations_tried(self) -> int:
        """Evaluations of one step with its estimates and the slope at its end, if that is asked for."""
        return self.evaluations

    @property
    def symplectic(self) -> bool:
        """True if the step preserves dq dv on systems without dissipation."""
        raise NotImplementedError

    @property
    def symmetric(self) -> bool:
        """True if step(-h) undoes step(h)."""
        raise NotImplementedError

    @property
    def title(self) -> str:
        """The docstring of its step: name and source."""
        return f"{self.name}: {self.source}"

    def write_step(self, notation: Notation) -> str:
        """Return the source of ``step``, of the functions it needs, and of ``begin`` for methods with a memory.

        Raises MethodError for a method that has no such program.
        """
        raise MethodError(f"There is no unrolling for methods of the kind {type(self).__name__}.")

    def write_estimating_step(self, notation: Notation) -> str:
        """Return the source of ``step`` with estimates of its error; see :mod:`integrators.steps.estimates`."""
        raise NotImplementedError


__getattr__ = names_of_before(__name__)

__all__ = [
    "NEEDS", "ROUNDED", "Acceleration", "Coefficient", "Method", "MethodError", "Notation", "System", "exact",
]
