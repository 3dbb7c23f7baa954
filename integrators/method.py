"""Method, the base class of all integration methods, and the signature of a step.

The problem is ``q'' = a(t, q, v)`` with ``v = q'`` and one scalar degree of freedom. Arrays are batches of it or
coupled components, depending on the acceleration. A method advances ``(q, v)`` from ``t`` to ``t + h``.

A step is a plain function; :func:`integrators.steps.unroll.unroll` returns its source, written by the method's class::

    step(t, q, v, *memory, h, *extra)  ->  (q, v, *memory, *increments)
    begin(t, q, v, h, *extra)          ->  memory (one value or several), for methods that have a memory

``memory`` are the values that one step passes to the next, named by ``Method.memory_with(quadratures)``: the force at
the end of the step (first same as last), or a history of earlier forces. Quadratures are integrals that are carried
along the step, such as work and heat. ``begin`` computes it anew when the problem changes, and in ``solve`` when the
length of the step changes. ``extra`` are run-time arguments for the problem's functions; ``increments`` are the changes
of the quadratures along the step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass
from fractions import Fraction
from numbers import Real
from typing import Any, ClassVar

from integrators import html
from integrators.errors import MethodError, shown
from integrators.steps.continuous import Extension
from integrators.steps.terms import Notation
from integrators.system import NEEDS, Acceleration, System

CALLED_BY_NEED = {"velocity_free": ("force",), "jacobian": ("jacobian",), "exact_flow": ("exact_flow",),
                  "mean": ("mean_acceleration", "mean_jacobian"), "taylor": ("series",)}
"""Need of a method (a key of :data:`NEEDS`) -> names of the problem's functions that meet it."""
History = Callable[[int], Sequence[tuple[Any, Any]]]
ROUNDED = Fraction(1, 10**35)
"""Largest residual of an equation between a table's coefficients that counts as rounding."""
SHOWN_STAGES = 7
"""Largest number of stages of a tableau that a notebook shows."""
Row = tuple[Fraction, ...]
Polynomial = tuple[Fraction, ...]
"""Coefficients of a polynomial, lowest power first."""


def exact(*values: int | str | Fraction) -> tuple[Fraction, ...]:
    """Convert coefficients to exact fractions, for example ``exact(0, "1/2", "0.1786178958448091")``.

    Raises MethodError for a value that is not a number.
    """
    row: tuple[Fraction, ...] = rational(values, "coefficients")
    return row


def rational(values: Any, label: str) -> Any:
    """Return coefficients as exact fractions, in tuples that are nested as the lists, tuples or arrays given.

    Coefficients are whole numbers, fractions, text such as ``"1/2"`` or ``"0.25"``, or floats, which are binary
    fractions. Raises MethodError for anything else; ``label`` names the coefficients in its message.
    """
    if type(values) is Fraction:
        return values
    if hasattr(values, "tolist"):
        values = values.tolist()
    if isinstance(values, (list, tuple)):
        return tuple([value if type(value) is Fraction else rational(value, f"{label}[{i}]")
                      for i, value in enumerate(values)])
    try:
        return Fraction(values)
    except (TypeError, ValueError, OverflowError, ZeroDivisionError):
        raise MethodError(f"{label} must be a number, not {shown(values)}; write it as a whole number, a fraction, or "
                          "text such as '1/2' or '0.25'.") from None


def total(values: Iterable[Fraction]) -> Fraction:
    """Return the exact sum of fractions, 0 for none.

    All are brought to one denominator first. Python's ``sum`` reduces each partial sum to its lowest terms, which takes
    several times as long.
    """
    terms = list(values)
    common = math.lcm(*[x.denominator for x in terms])
    return Fraction(sum([x.numerator * (common // x.denominator) for x in terms]), common)


def polynomial_at(polynomial: Polynomial, x: Fraction) -> Fraction:
    """Return the exact value of a polynomial, by Horner's rule in whole numbers."""
    common = math.lcm(*[c.denominator for c in polynomial])
    value, scale = 0, 1
    for c in reversed(polynomial):
        value = value * x.numerator + c.numerator * (common // c.denominator) * scale
        scale *= x.denominator
    return Fraction(value * x.denominator, common * scale)


def simple(x: Fraction) -> Fraction:
    """Return the fraction with a small denominator that differs from x by at most :data:`ROUNDED`, else x."""
    near = x.limit_denominator(10**6)
    return near if abs(near - x) < ROUNDED else x


def unrounded(x: Fraction) -> Fraction:
    """Return the fraction with a small denominator whose double is x, if there is one, else x."""
    near = x.limit_denominator(10**6)
    return near if float(near) == float(x) else x


def _short(x: Fraction) -> str:
    """Return a coefficient as a fraction or, if that is long, as a decimal number; "" for 0."""
    return "" if x == 0 else str(x) if x.denominator < 10**4 else f"{float(x):.6g}"


@dataclass(frozen=True, kw_only=True, repr=False)
class Method:
    """Integration method: its name, source and coefficients, and properties such as order, stability and symplecticity.

    A family of methods is a subclass. It must define ``evaluations``, ``symplectic``, ``symmetric``, ``write_step``
    and ``family``; every other property has a default. :func:`integrators.solve`, the engine and
    :mod:`integrators.analysis` read these properties and never check the class. If a property is None or empty, they
    compute the result from steps of the method.

    Attributes:
        name: usual name in the literature, in snake case.
        order: the global error is O(h**order) on smooth problems; math.inf for exact solutions.
        source: author, year and place of publication of the table.
        summary: one line for lists.
        aliases: other names of the same table.
        a_stable, l_stable: stability on ``y' = lambda y``; tests check both against the table.
    """

    name: str
    order: int
    source: str
    summary: str
    aliases: tuple[str, ...] = ()
    a_stable: bool = False
    l_stable: bool = False

    family: ClassVar[str]
    coefficients: ClassVar[tuple[str, ...]] = ()
    """Names of the attributes that hold coefficients; they become exact fractions, see :func:`rational`."""

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name or not self.name.isprintable():
            raise MethodError(f"A method's name must be one line of printable text, not {shown(self.name)}.")
        if isinstance(self.order, bool) or not isinstance(self.order, Real) or not (
                self.order == math.inf or (self.order >= 1 and self.order == int(self.order))):
            raise MethodError(f"{self.name}: order must be a whole number of at least 1, or math.inf, not "
                              f"{shown(self.order)}.")
        for name in self.coefficients:
            object.__setattr__(self, name, rational(getattr(self, name), f"{self.name}: {name}"))

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "__repr__" not in vars(cls):
            cls.__repr__ = Method.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.name}, order {self.order}>"

    @property
    def fingerprint(self) -> str:
        """Text that differs between methods that differ in a coefficient or in any other attribute."""
        return f"{type(self).__name__}{astuple(self)!r}"

    def _repr_html_(self) -> str:
        """Return the method's properties as HTML, which notebooks show, with the tableau of a small Runge-Kutta method.
        """
        structure = {"implicit" if self.implicit else "explicit": True, "symplectic": self.symplectic,
                     "symmetric": self.symmetric, "A-stable": self.a_stable, "L-stable": self.l_stable}
        return html.block(f"{self.name}: {self.summary}", html.facts((
            ("family", self.family), ("order", str(self.order)),
            ("structure", ", ".join(word for word, holds in structure.items() if holds)),
            ("force evaluations", f"{self.evaluations} per {'Newton iteration' if self.implicit else 'step'}"),
            ("source", self.source), ("other names", ", ".join(self.aliases)),
        )), self._tableau_html())

    def _tableau_html(self) -> str:
        """Return the Butcher tableau as HTML: nodes c, matrix a, below them weights b; "" for many stages or none."""
        if self.tableau is None or len(self.tableau[1]) > SHOWN_STAGES:
            return ""
        a, b = self.tableau
        rows = [(_short(sum(row, Fraction(0))) or "0", *map(_short, row)) for row in a]
        return html.table(("c", *(f"a{j + 1}" for j in range(len(b)))), [*rows, ("b", *map(_short, b))])

    # --- how a step is written and run --------------------------------------------------------------------------------

    @property
    def memory(self) -> tuple[str, ...]:
        """Names of the values that a step passes to the next one in addition to the state; () for none."""
        return ()

    def memory_with(self, quadratures: Sequence[str]) -> tuple[str, ...]:
        """Return the names of the values that a step passes to the next one, with these quadratures.

        Quadratures are integrals along the motion, such as work; a method may also store their rates.
        """
        return self.memory

    @property
    def beginning(self) -> int:
        """Number of force evaluations that ``begin`` needs before the first step, for instance for a history.

        Repeated evaluations in Newton's iteration of implicit methods are not counted.
        """
        return len(self.memory)

    @property
    def needs(self) -> frozenset[str]:
        """Properties that the method needs of a problem, as keys of :data:`NEEDS`.

        By default an acceleration, and for methods that pass on forces from earlier steps no stops by dry friction.
        """
        return frozenset({"acceleration", *(("smooth",) if self.memory else ())})

    @property
    def implicit(self) -> bool:
        """True if the method is implicit: a step solves an equation."""
        return False

    @property
    def evaluations(self) -> int:
        """Number of force evaluations per step, or per Newton iteration if the method is implicit.

        A force that the next step uses again (first same as last) counts once.
        """
        raise NotImplementedError

    @property
    def first_order_form(self) -> bool:
        """True if the method also integrates ``y' = f(t, y)``: what it computes for v of ``v' = a(t, v)`` needs no q.

        See :mod:`integrators.solving.first_order`.
        """
        return False

    @property
    def last_drift(self) -> float:
        """Fraction of a step by which the angle moves at its end with the final velocity, after the last kick.

        It is 0 for methods that are no splittings.
        """
        return 0.0

    @property
    def title(self) -> str:
        """Docstring of the generated step function: name and source of the method."""
        return f"{self.name}: {self.source}"

    @property
    def remark(self) -> str:
        """Sentences on the method that a study of its runs should show; "" for none."""
        return ""

    def write_step(self, notation: Notation) -> str:
        """Return the Python source of ``step``, of the functions that it calls, and of ``begin``.

        ``begin`` is left out for methods that pass no values from one step to the next. Raises MethodError for a class
        that does not define its step.
        """
        raise MethodError(f"Methods of the class {type(self).__name__} do not define write_step, the source of a step.")

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        """Return the names of the problem's functions that the generated source of a step calls.

        For most methods these are the acceleration, the rates of quadratures, and one function for each property in the
        method's ``needs``, such as "jacobian". The tuple may contain names that the source does not call. See
        :mod:`integrators.steps.unroll`.

        Args:
            quadratures: True if quadratures (integrals such as work) are computed along with the motion.
            adaptive: True for steps with error estimates.
        """
        plain = ("acceleration",) if self.implicit or not quadratures else ()
        slopes = (*plain, *(("rates",) if quadratures else ()))
        return (*slopes, *(name for need, names in CALLED_BY_NEED.items() if need in self.needs for name in names))

    @property
    def sub_flows(self) -> tuple[tuple[str, Fraction], ...]:
        """Sub-flows of a splitting: their kinds in order, each with its fraction of the step; () for other methods.

        The kinds are those of :mod:`integrators.families.splitting`; the engine may extend them, for example by the
        sticking of dry friction.
        """
        return ()

    @property
    def counted(self) -> tuple[str, ...]:
        """Names of functions of a System, in addition to force functions, whose calls count as evaluations."""
        return ()

    @property
    def python_functions(self) -> Mapping[str, Callable[..., Any]]:
        """Functions of Python, by name, that the step's source calls; such a step can be interpreted, not compiled."""
        return {}

    def functions(self, system: System, like: Any) -> Mapping[str, Callable[..., Any]]:
        """Return the method's own functions that the step's source calls in :func:`integrators.solve`, by name.

        The engine's programs contain only the functions of ``calls``, ``python_functions`` and elementary functions.

        Args:
            system: the problem.
            like: a value of the number type to be used.
        """
        return {}

    def array_step(
        self, system: System, dense: bool, increments: bool, estimates: bool = False
    ) -> Callable[..., tuple[Any, ...]] | None:
        """Return a step function for arrays q with coupled components; None: use the generated source.

        Args:
            system: the problem.
            dense: True for a step that also returns its stages.
            increments: True for a step that returns only the changes of q and v.
            estimates: True for a step with error estimates.
        """
        return None

    def one_freedom(self, name: str) -> bool:
        """Return True if the method of this name, its own or an alias, is defined for one degree of freedom only.

        It then runs on arrays only if the forces do not couple their components. By default that is so for an explicit
        method that uses ``jacobian``, which differentiates each component by itself.
        """
        return "jacobian" in self.needs and not self.implicit

    # --- errors: order, dense output, estimates -----------------------------------------------------------------------

    @property
    def exact(self) -> bool:
        """True for a method without truncation error, whose order is infinite."""
        return math.isinf(self.order)

    @property
    def tableau(self) -> tuple[tuple[Row, ...], Row] | None:
        """Butcher tableau (a, b), from which rooted trees give the order conditions; None if there is none."""
        return None

    @property
    def nystrom_tableau(self) -> tuple[Row, tuple[Row, ...], Row, Row, tuple[Row, ...]] | None:
        """Nyström tableau (c, a, bbar, b, av), from which Nyström trees give the order conditions; None if none."""
        return None

    @property
    def formulas(self) -> tuple[Method, ...]:
        """The method itself and its embedded formulas, each as a method with the order that is declared for it."""
        return (self,)

    @property
    def dense(self) -> Extension | None:
        """Polynomials over the stages of a step for dense output; None: dense output is Hermite interpolation."""
        return None

    @property
    def dense_order(self) -> int:
        """Order of dense output, whose error within one step from exact values is O(h**(dense_order + 1)).

        Without ``dense``, this is the order of Hermite interpolation: cubic for methods below order 4, else quintic;
        see :mod:`integrators.solving.dense`.
        """
        if self.dense is not None:
            return self.dense.order
        return min(self.order, 3) if self.order < 4 else min(self.order - 1, 4)

    @property
    def embedded_orders(self) -> tuple[int, ...]:
        """Orders of the embedded formulas that estimate the error of a step; () for methods without estimates."""
        return ()

    @property
    def evaluations_tried(self) -> int:
        """Number of evaluations of one adaptive step, with its error estimates and the acceleration at its end."""
        return self.evaluations

    def write_estimating_step(self, notation: Notation) -> str:
        """Return the Python source of ``step`` with error estimates; see :mod:`integrators.steps.estimates`."""
        raise NotImplementedError

    # --- structure ----------------------------------------------------------------------------------------------------

    @property
    def symplectic(self) -> bool:
        """True if the method is symplectic: a step preserves the area dq dv on systems without dissipation."""
        raise NotImplementedError

    @property
    def symmetric(self) -> bool:
        """True if the method is symmetric: step(-h) undoes step(h)."""
        raise NotImplementedError

    @property
    def keeps_energy(self) -> bool:
        """True if steps of any length conserve the energy of a conservative problem up to rounding."""
        return self.exact

    # --- earlier steps ------------------------------------------------------------------------------------------------

    @property
    def one_step(self) -> bool:
        """True for a one-step method: the result depends only on the state at the start of the step.

        If such a method has a memory, it only saves evaluations.
        """
        return True

    @property
    def begun_by(self) -> Method | None:
        """One-step method that computes the starting history of a multistep method; None if none is needed."""
        return None

    forwards: ClassVar[bool] = False
    """True if the starting method steps forwards from the start; False if backwards, to times before the start."""

    @property
    def past(self) -> int:
        """Length of the method's history: the number of earlier steps that a step uses."""
        return 0

    @property
    def counters(self) -> Mapping[str, int]:
        """Names of step counters that a step passes to the next one -> the count at which the first steps end.

        From that count on, the starting method is no longer used.
        """
        return {}

    def settled_memory(
        self, t: Any, q: Any, v: Any, h: Any, acceleration: Acceleration, history: History
    ) -> tuple[Any, ...] | None:
        """Return the memory (values passed to the next step) that an exact history before (t, q, v) gives.

        With this memory, the next step of length h is one of the method itself, not of its starting method. None: use
        the memory of ``begin``. ``history(count)`` returns the exact (q, v) at t, t - h, ..., t - count h.
        """
        return None

    @property
    def parasitic(self) -> bool:
        """True if the method has parasitic solutions that neither grow nor decay, so that its error oscillates."""
        return False

    # --- what it does to the oscillator and to drag -------------------------------------------------------------------

    @property
    def stability_polynomials(self) -> tuple[Polynomial, Polynomial] | None:
        """Numerator and denominator of the stability function ``R(w)``, the factor of a step on ``y' = w y/h``.

        None for a method without a stability function.
        """
        return None

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        """Characteristic polynomials of a multistep method; () for one-step methods.

        With steps of one length its solutions are ``x**n``, where ``sum_m w**(power m) characteristic[m](x) = 0`` on
        ``y' = w y/h``, or on ``q'' = w**2 q/h**2`` if ``power`` is 2 (Hairer, Norsett & Wanner 1993, III.3 and III.10).
        """
        return ()

    @property
    def characteristic_of_drag(self) -> tuple[Polynomial, ...]:
        """Characteristic polynomials of a multistep method on pure drag, ``v' = w v/h``, in powers of w."""
        return self.characteristic

    power: ClassVar[int] = 1
    """Power of w in the equation of ``characteristic``: 1 for methods for ``y' = f``, 2 for ``q'' = f``."""

    def oscillator_matrix(self, terms: int) -> tuple[Polynomial, ...] | None:
        """Return the exact matrix of one step on ``q'' = -q``, as power series in h with ``terms`` coefficients.

        The entries are q1 of q, q1 of v, v1 of q, v1 of v, for a step from (q, v) to (q1, v1). None:
        :mod:`integrators.analysis` computes the matrix by a step on power series.
        """
        return None

    @property
    def oscillation_limit(self) -> float | None:
        """Largest ``omega0 h`` of bounded oscillations, if it is known from theory; None: computed from the step."""
        return math.inf if self.exact else None

    @property
    def drag_limit(self) -> float | None:
        """Largest ``gamma h`` without growth under drag, if it is known from theory; None: computed from the step."""
        return math.inf if self.exact else None

    @property
    def furthest_back(self) -> float:
        """Earliest time that drag flows within a splitting step reach, as a fraction of the step; 0 or negative."""
        return 0.0

    @property
    def explicit_first_stage(self) -> bool:
        """True for an implicit method that also evaluates the rates of work and heat at the start of a step."""
        return False

    @property
    def rounding(self) -> Fraction:
        """Size below which a coefficient of a step counts as zero, because the method's table is rounded."""
        return Fraction(1, 10**24)


__all__ = [
    "NEEDS", "ROUNDED", "Acceleration", "History", "Method", "MethodError", "Notation", "Polynomial",
    "Row", "System", "exact", "simple",
]
