"""What every method declares, and the contract of a step.

The problem is ``q'' = a(t, q, v)`` with ``v = q'``: one scalar degree of freedom (arrays are batches of it,
or coupled components, as the acceleration decides). A method advances ``(q, v)`` from ``t`` to ``t + h``.

A step is a plain function, written by :func:`integrators.steps.unroll.unroll` from the method's table::

    step(t, q, v, *memory, h, *extra)  ->  (q, v, *memory, *increments)
    begin(t, q, v, h, *extra)          ->  memory, one value or several; for methods that have any

``memory`` is what one step hands on to the next, named by ``Method.memory_with(quadratures)``: the force at its end
(first same as last), or earlier forces. It begins anew where the problem changes, and in ``solve`` where the step's
length does. ``extra`` are run-time arguments handed through to the problem's functions, ``increments`` the quadratures
that ride along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import ClassVar

from integrators.errors import MethodError as MethodError
from integrators.families.extension import Extension
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
    def symplectic(self) -> bool:
        """True if the step preserves dq dv on systems without dissipation."""
        raise NotImplementedError

    @property
    def symmetric(self) -> bool:
        """True if step(-h) undoes step(h)."""
        raise NotImplementedError


@dataclass(frozen=True)
class Embedded:
    """Further weights on a method's stages: ``q + h sum_i b_i V_i`` is a result of lower ``order``, to compare with."""

    order: int
    b: tuple[Fraction, ...]


@dataclass(frozen=True, kw_only=True)
class RungeKutta(Method):
    """A Runge-Kutta method, explicit or implicit, by its Butcher table.

    With ``c_i = sum_j a_ij``::

        V_i = v + h sum_j a_ij K_j        K_i = a(t + c_i h, Q_i, V_i)
        Q_i = q + h sum_j a_ij V_j
        q1 = q + h sum_i b_i V_i          v1 = v + h sum_i b_i K_i

    Symplecticity, symmetry and implicitness are read off the table, never declared, up to :data:`ROUNDED`.
    Raises MethodError if the shapes disagree or weights do not sum to one.

    Attributes:
        a, b: the table; stages that ``b`` does not reach serve the estimates of the error alone.
        embedded: further weights, whose differences to ``b`` estimate the error of one step; the most accurate first.
            Of two, E5 and E3, Hairer, Norsett & Wanner 1993, II.10, make ``E5**2/sqrt(E5**2 + E3**2/100)``.
        dense: polynomials for dense output; without them it is Hermite interpolation.
    """

    a: tuple[tuple[Fraction, ...], ...]
    b: tuple[Fraction, ...]
    embedded: tuple[Embedded, ...] = ()
    dense: Extension | None = field(default=None, hash=False)
    c: tuple[Fraction, ...] = field(init=False)

    family: ClassVar[str] = "Runge-Kutta"

    def __post_init__(self) -> None:
        object.__setattr__(self, "c", tuple(sum(row, Fraction(0)) for row in self.a))
        stages = len(self.b)
        if len(self.a) != stages or any(len(row) != stages for row in self.a):
            raise MethodError(f"{self.name}: a must be {stages} rows of {stages} numbers, like b.")
        if any(len(pair.b) != stages for pair in self.embedded):
            raise MethodError(f"{self.name}: embedded weights must be {stages} numbers, like b.")
        for label, weights in (("b", self.b), *(("embedded", pair.b) for pair in self.embedded)):
            if sum(weights) != 1:
                raise MethodError(f"{self.name}: the weights {label} sum to {sum(weights)}, not to 1.")
        if self.dense is not None:
            fault = self.dense.fault(self.b, ROUNDED)
            if fault:
                raise MethodError(f"{self.name}: {fault}.")

    @property
    def coupled(self) -> bool:
        """True if stages depend on later ones, so that all are solved at once."""
        return any(any(row[i + 1 :]) for i, row in enumerate(self.a))

    @property
    def implicit(self) -> bool:
        return any(any(row[i:]) for i, row in enumerate(self.a))

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "jacobian"}) if self.implicit else frozenset({"acceleration"})

    @property
    def stages(self) -> tuple[int, ...]:
        """Which stages the weights ``b`` reach, counted from zero: those that a step without an estimate takes."""
        return self.reached(self.b)

    @property
    def dense_order(self) -> int:
        return super().dense_order if self.dense is None else self.dense.order

    def reached(self, *rows: tuple[Fraction, ...]) -> tuple[int, ...]:
        """Which stages these weights reach, directly or through other stages."""
        if self.coupled:
            return tuple(range(len(self.b)))
        reached = {i for row in rows for i, weight in enumerate(row) if weight}
        for i in reversed(range(len(self.b))):
            if i in reached:
                reached |= {j for j, weight in enumerate(self.a[i]) if weight}
        return tuple(sorted(reached))

    @property
    def first_same_as_last(self) -> bool:
        """True if the last stage is the new state, so that its slope is the first one of the next step."""
        return len(self.b) > 1 and self.a[-1] == self.b and not any(self.a[0])

    @property
    def evaluations(self) -> int:
        return len(self.stages)

    @property
    def symplectic(self) -> bool:
        """``b_i a_ij + b_j a_ji = b_i b_j`` (Sanz-Serna 1988)."""
        a, b, stages = self.a, self.b, range(len(self.b))
        defects = (b[i] * a[i][j] + b[j] * a[j][i] - b[i] * b[j] for i in stages for j in stages)
        return all(abs(defect) < ROUNDED for defect in defects)

    @property
    def symmetric(self) -> bool:
        """``a_ij + a_(s+1-i)(s+1-j) = b_j`` (Hairer, Lubich & Wanner 2006, theorem V.2.3)."""
        a, b, last = self.a, self.b, len(self.b) - 1
        stages = range(last + 1)
        return all(abs(a[i][j] + a[last - i][last - j] - b[j]) < ROUNDED for i in stages for j in stages)


KICK, DRIFT, DRAG, PUSH = "kick", "drift", "drag", "push"
"""Sub-flows of a splitting: v += h f(t, q); q += h v; the exact dissipative flow; v += h a(t, q, v)."""


@dataclass(frozen=True, kw_only=True)
class Splitting(Method):
    """A composition of exact sub-flows, applied left to right, each over its fraction of the step.

    ``kick``: ``v += c h f(t, q)``; ``drift``: ``q += c h v`` (time moves with it); ``drag``: the exact flow
    of the dissipation, left out where there is none; ``push``: ``v += c h a(t, q, v)``, drag explicit.
    Raises MethodError if a sub-flow is unknown or kicks, drifts or drags do not sum to one whole step.

    Attributes:
        flows: kinds of sub-flow and their fractions of the step.
        nystrom: True if the order holds for velocity-free forces only, where fewer conditions suffice
            (Sanz-Serna & Calvo 1994, section 7.3). Such a method has no drags and takes no damping.
    """

    flows: tuple[tuple[str, Fraction], ...]
    nystrom: bool = False

    family: ClassVar[str] = "splitting"

    def __post_init__(self) -> None:
        totals = dict.fromkeys((KICK, DRIFT, DRAG, PUSH), Fraction(0))
        for kind, fraction in self.flows:
            if kind not in totals:
                raise MethodError(f"{self.name}: no sub-flow '{kind}'; there are {', '.join(totals)}.")
            totals[kind] += fraction
        whole = [totals[DRIFT], totals[KICK] + totals[PUSH], totals[DRAG] + totals[PUSH]]
        if any(total != 1 for total in (whole[:2] if self.nystrom else whole)):
            sums = ", ".join(map(str, whole))
            raise MethodError(f"{self.name}: drifts, kicks and drags must each sum to 1, not to {sums}.")
        if self.nystrom and any(kind in (DRAG, PUSH) for kind, _ in self.flows):
            raise MethodError(f"{self.name}: a method for velocity-free forces has no drags and pushes.")

    def _kinds(self) -> list[str]:
        return [kind for kind, _ in self.flows if kind != DRAG]

    @property
    def memory(self) -> tuple[str, ...]:
        """The force, if the step begins and ends with a kick, so that one serves both."""
        return ("a",) if self._kinds()[0] == KICK == self._kinds()[-1] else ()

    @property
    def needs(self) -> frozenset[str]:
        if self.nystrom:
            return frozenset({"acceleration", "velocity_free"})
        if any(kind == PUSH for kind, _ in self.flows):
            return frozenset({"acceleration"})
        backwards = any(fraction < 0 for _, fraction in self.flows)
        return frozenset({"acceleration", "split", *(("reversible",) if backwards else ())})

    @property
    def evaluations(self) -> int:
        count, known = 0, bool(self.memory)
        for kind in self._kinds():
            count += kind == PUSH or (kind == KICK and not known)
            known = kind == KICK
        return count

    @property
    def symplectic(self) -> bool:
        """Exact sub-flows of Hamiltonians compose to a symplectic map; drag makes it conformally so."""
        return True

    @property
    def symmetric(self) -> bool:
        return self.flows == self.flows[::-1]


__all__ = [
    "DRAG", "DRIFT", "KICK", "NEEDS", "PUSH", "ROUNDED", "Acceleration", "Coefficient", "Embedded", "Extension",
    "Method", "MethodError", "RungeKutta", "Splitting", "System", "exact",
]
