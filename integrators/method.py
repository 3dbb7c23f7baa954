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

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from integrators.errors import MethodError
from integrators.moved import names_of_before
from integrators.steps.continuous import Extension
from integrators.steps.terms import Notation
from integrators.system import NEEDS, Acceleration, System

CALLED_BY_NEED = {"velocity_free": ("force",), "jacobian": ("jacobian",), "exact_flow": ("exact_flow",),
                  "mean": ("mean_acceleration", "mean_jacobian"), "taylor": ("series",)}
"""What a method needs -> the functions by which a problem offers it."""
History = Callable[[int], Sequence[tuple[Any, Any]]]
Coefficient = Fraction
ROUNDED = Fraction(1, 10**35)
"""What equations between a table's coefficients may leave, of which roots are rounded to many digits."""
Row = tuple[Fraction, ...]
Polynomial = tuple[Fraction, ...]
"""Coefficients, that of the lowest power first."""


def exact(*values: int | str | Fraction) -> tuple[Fraction, ...]:
    """Coefficients as exact rationals: ``exact(0, "1/2", "0.1786178958448091")``."""
    return tuple(Fraction(value) for value in values)


def simple(x: Fraction) -> Fraction:
    """Return the fraction of small numbers that a number is up to :data:`ROUNDED`, or the number itself."""
    near = x.limit_denominator(10**6)
    return near if abs(near - x) < ROUNDED else x


@dataclass(frozen=True, kw_only=True)
class Method:
    """One integration method: its table, what the literature says of it, and what it answers about itself.

    A family of methods is a subclass. It must answer ``evaluations``, ``symplectic``, ``symmetric`` and ``write_step``,
    and name its ``family``; every other answer has a default. Nobody asks for a method's class:
    :func:`integrators.solve`, the engine and :mod:`integrators.analysis` go by these answers, and where there are none
    by the step itself.

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

    # --- how a step is written and run --------------------------------------------------------------------------------

    @property
    def memory(self) -> tuple[str, ...]:
        """Names of what a step hands on to the next beside the state; () for nothing."""
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
        """What a system must offer; keys of :data:`NEEDS`. Here no stops of dry friction where there is a memory."""
        return frozenset({"acceleration", *(("smooth",) if self.memory else ())})

    @property
    def implicit(self) -> bool:
        """True if a step solves an equation."""
        return False

    @property
    def evaluations(self) -> int:
        """Force evaluations per step, first same as last counted once; if implicit, per Newton sweep."""
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

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        """Return the names of the problem's functions that its source calls; see :mod:`integrators.steps.unroll`.

        Here slopes, and what ``needs`` names. More than it calls does no harm.

        Args:
            quadratures: True if integrals ride along.
            adaptive: True for steps with estimates.
        """
        plain = ("acceleration",) if self.implicit or not quadratures else ()
        slopes = (*plain, *(("rates",) if quadratures else ()))
        return (*slopes, *(name for need, names in CALLED_BY_NEED.items() if need in self.needs for name in names))

    @property
    def sub_flows(self) -> tuple[tuple[str, Fraction], ...]:
        """The sub-flows that a step is composed of, which the problem may extend, and their parts of it; () for others.

        Kinds of :mod:`integrators.families.splitting`. One of them takes care of the sticking of dry friction.
        """
        return ()

    @property
    def counted(self) -> tuple[str, ...]:
        """Functions of a System, beside those for forces, whose calls count as evaluations."""
        return ()

    def functions(self, system: System, like: Any) -> Mapping[str, Callable[..., Any]]:
        """Return functions of its own that its source calls, by name, where :func:`integrators.solve` runs it.

        The engine's programs hold those of ``calls`` alone, and elementary functions.

        Args:
            system: the problem.
            like: a value of the kind of number in which it runs.
        """
        return {}

    def array_step(self, system: System, dense: bool, increments: bool) -> Callable[..., tuple[Any, ...]] | None:
        """Return an implicit step on arrays whose components may be coupled; None: as the source has it.

        Args:
            system: the problem.
            dense: True for a step that also returns its stages.
            increments: True for the changes of q and v alone.
        """
        return None

    # --- errors: order, dense output, estimates -----------------------------------------------------------------------

    @property
    def exact(self) -> bool:
        """True for a method without any error of its own: its order is infinite."""
        return math.isinf(self.order)

    @property
    def tableau(self) -> tuple[tuple[Row, ...], Row] | None:
        """Its Butcher tableau (a, b), on which rooted trees set its order conditions; None without one."""
        return None

    @property
    def nystrom_tableau(self) -> tuple[Row, tuple[Row, ...], Row, Row, tuple[Row, ...]] | None:
        """Its Nyström tableau (c, a, bbar, b, av), on which Nyström trees set its order conditions; None without."""
        return None

    @property
    def dense(self) -> Extension | None:
        """Polynomials for dense output over the stages of a step; None: it is Hermite interpolation."""
        return None

    @property
    def dense_order(self) -> int:
        """Dense output errs by O(h**(dense_order + 1)) over one step, beside the errors that the step began with.

        Without ``dense`` that of Hermite interpolation: cubic below order 4, else quintic; see
        :mod:`integrators.solving.dense`.
        """
        if self.dense is not None:
            return self.dense.order
        return min(self.order, 3) if self.order < 4 else min(self.order - 1, 4)

    @property
    def embedded_orders(self) -> tuple[int, ...]:
        """Orders of the results with which the method's own is compared to estimate its error; () without estimates."""
        return ()

    @property
    def evaluations_tried(self) -> int:
        """Evaluations of one step with its estimates and the slope at its end, if that is asked for."""
        return self.evaluations

    def write_estimating_step(self, notation: Notation) -> str:
        """Return the source of ``step`` with estimates of its error; see :mod:`integrators.steps.estimates`."""
        raise NotImplementedError

    # --- structure ----------------------------------------------------------------------------------------------------

    @property
    def symplectic(self) -> bool:
        """True if the step preserves dq dv on systems without dissipation."""
        raise NotImplementedError

    @property
    def symmetric(self) -> bool:
        """True if step(-h) undoes step(h)."""
        raise NotImplementedError

    @property
    def keeps_energy(self) -> bool:
        """True if steps of any length keep the energy of a conservative problem to rounding."""
        return self.exact

    # --- earlier steps ------------------------------------------------------------------------------------------------

    @property
    def one_step(self) -> bool:
        """True if a step depends on the state at its start alone, so that what its memory holds saves evaluations."""
        return True

    @property
    def begun_by(self) -> Method | None:
        """The one-step method that takes the first steps, of a method that needs one."""
        return None

    forwards: ClassVar[bool] = False
    """True if that method goes forwards from the start, and not backwards to what would have been before it."""

    @property
    def past(self) -> int:
        """How many earlier steps it goes on from."""
        return 0

    @property
    def counters(self) -> Mapping[str, int]:
        """What of its memory counts steps -> the number from which on the method is itself, no longer its starter."""
        return {}

    def settled_memory(
        self, t: Any, q: Any, v: Any, h: Any, acceleration: Acceleration, history: History
    ) -> tuple[Any, ...] | None:
        """Return the memory with which a step of h at (t, q, v) is the method's own; None: that of ``begin`` is.

        ``history(count)`` returns (q, v) at t, t - h, ..., t - count h, on the motion itself.
        """
        return None

    @property
    def parasitic(self) -> bool:
        """True if its equation has other solutions that neither grow nor fade: waves in its error."""
        return False

    # --- what it does to the oscillator and to drag -------------------------------------------------------------------

    @property
    def stability_polynomials(self) -> tuple[Polynomial, Polynomial] | None:
        """Numerator and denominator of ``R(w)``, by which a step multiplies on ``y' = w y/h``; None without an R."""
        return None

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        """Polynomials of a method that is no ``one_step``: steady steps have solutions ``x**n``, x their roots.

        ``sum_m w**(power m) characteristic[m](x) = 0`` on ``y' = w y/h``, or on ``q'' = w**2 q/h**2`` where ``power``
        is 2 (Hairer, Norsett & Wanner 1993, III.3 and III.10).
        """
        return ()

    @property
    def characteristic_of_drag(self) -> tuple[Polynomial, ...]:
        """The same for ``v' = w v/h`` where that is another equation, in powers of w."""
        return self.characteristic

    power: ClassVar[int] = 1
    """See ``characteristic``."""

    def oscillator_matrix(self, terms: int) -> tuple[Polynomial, ...] | None:
        """Return one step on ``q'' = -q`` as power series in h, exactly: q1 of q, q1 of v, v1 of q, v1 of v.

        Of so many ``terms``. None: the analysis takes the step itself, if its arithmetic is that of power series.
        """
        return None

    @property
    def oscillation_limit(self) -> float | None:
        """The largest ``omega0 h`` of bounded oscillations, where theory tells; None: it is computed from the step."""
        return math.inf if self.exact else None

    @property
    def drag_limit(self) -> float | None:
        """The largest ``gamma h`` without growth under drag, where theory tells; None: it is computed from the step."""
        return math.inf if self.exact else None

    @property
    def furthest_back(self) -> float:
        """The earliest time that the flows of drag within a step reach, in steps after its start; 0 or below."""
        return 0.0

    @property
    def explicit_first_stage(self) -> bool:
        """True for an implicit method that takes the rates of work and heat at the start of a step, too."""
        return False

    @property
    def rounding(self) -> Fraction:
        """Coefficients of a step below this are what a rounded table leaves of zero."""
        return Fraction(1, 10**24)


__getattr__ = names_of_before(__name__)

__all__ = [
    "NEEDS", "ROUNDED", "Acceleration", "Coefficient", "History", "Method", "MethodError", "Notation", "Polynomial",
    "Row", "System", "exact", "simple",
]
