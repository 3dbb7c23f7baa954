"""Runge-Kutta methods from Butcher tables: explicit, embedded and implicit ones, with dense output."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, ClassVar

from integrators.method import (
    ROUNDED,
    Method,
    MethodError,
    Polynomial,
    Row,
    System,
    rational,
    simple,
    total,
    unrounded,
)
from integrators.steps.arrays import stages_step
from integrators.steps.continuous import Extension
from integrators.steps.newton import one_stage, simultaneous
from integrators.steps.terms import (
    Notation,
    StepLines,
    combination,
    definition,
    fraction_of,
    increment,
    plus,
    term,
    time_at,
)


@dataclass(frozen=True)
class Embedded:
    """Embedded weights b of a Runge-Kutta method: their result ``q + h sum_i b_i V_i`` has a lower ``order``.

    Attributes:
        order: order of the result.
        b: weights of the stages.
        start: weight of the slope at the start of the step, for implicit methods of which no stage is there. It makes
            the difference to the method's own result grow with ``h J``, where J is the derivative of the slopes; so
            the difference is multiplied by ``(1 - start h J)**-1``, which keeps it bounded in stiff problems
            (Hairer & Wanner 1996, eq. IV.8.19). 0 for other pairs.
    """

    order: int
    b: tuple[Fraction, ...]
    start: Fraction = Fraction(0)


@dataclass(frozen=True, kw_only=True)
class RungeKutta(Method):
    """A Runge-Kutta method, explicit or implicit, from its Butcher table.

    With ``c_i = sum_j a_ij``::

        V_i = v + h sum_j a_ij K_j        K_i = a(t + c_i h, Q_i, V_i)
        Q_i = q + h sum_j a_ij V_j
        q1 = q + h sum_i b_i V_i          v1 = v + h sum_i b_i K_i

    Symplecticity, symmetry and implicitness are computed from the table, up to :data:`ROUNDED`.
    Raises MethodError if a coefficient is not a number, the shapes disagree or weights do not sum to one.

    Attributes:
        a, b: the table; stages on which ``b`` does not depend serve only to estimate the error.
        embedded: embedded weights, the most accurate first; the differences between them and ``b`` estimate the error
            of one step. Two estimates E5 and E3 are combined to ``E5**2/sqrt(E5**2 + E3**2/100)`` (Hairer, Norsett &
            Wanner 1993, II.10).
        dense: polynomials for dense output; None for Hermite interpolation.
    """

    a: tuple[tuple[Fraction, ...], ...]
    b: tuple[Fraction, ...]
    embedded: tuple[Embedded, ...] = ()
    dense: Extension | None = field(default=None, hash=False)
    c: tuple[Fraction, ...] = field(init=False)

    family: ClassVar[str] = "Runge-Kutta"
    coefficients: ClassVar[tuple[str, ...]] = ("a", "b")

    def __post_init__(self) -> None:
        super().__post_init__()
        pairs = tuple(replace(pair, b=rational(pair.b, f"{self.name}: embedded b"), start=Fraction(pair.start))
                      for pair in self.embedded)
        object.__setattr__(self, "embedded", pairs)
        if self.dense is not None:
            b, a = (rational(rows, f"{self.name}: dense") for rows in (self.dense.b, self.dense.a))
            object.__setattr__(self, "dense", replace(self.dense, b=b, a=a))
        rows = (self.b, *self.a) if isinstance(self.a, tuple) else ()
        if not rows or not all(isinstance(row, tuple) and all(isinstance(x, Fraction) for x in row) for row in rows):
            raise MethodError(f"{self.name}: a must be rows of numbers, and b a row of numbers, as in "
                              "a=((0, 0), ('1/2', 0)), b=(0, 1).")
        if total(self.b) != 1 and total(map(unrounded, self.b)) == 1:  # floats such as 1/6 are rounded
            object.__setattr__(self, "b", tuple(map(unrounded, self.b)))
            object.__setattr__(self, "a", tuple(tuple(map(unrounded, row)) for row in self.a))
        object.__setattr__(self, "c", tuple(total(filter(None, row)) for row in self.a))
        stages = len(self.b)
        if len(self.a) != stages or any(len(row) != stages for row in self.a):
            raise MethodError(f"{self.name}: a must be {stages} rows of {stages} numbers, like b.")
        if any(len(pair.b) != stages for pair in self.embedded):
            raise MethodError(f"{self.name}: embedded weights must be {stages} numbers, like b.")
        for label, weights in (("b", self.b), *(("embedded", (*pair.b, pair.start)) for pair in self.embedded)):
            if total(weights) != 1:
                raise MethodError(f"{self.name}: the weights {label} sum to {total(weights)}, not to 1.")
        if self.dense is not None:
            fault = self.dense.fault(self.b, ROUNDED)
            if fault:
                raise MethodError(f"{self.name}: {fault}.")

    @property
    def coupled(self) -> bool:
        """True if stages of a Runge-Kutta method depend on later ones, so that all stages are solved together."""
        return any(any(row[i + 1 :]) for i, row in enumerate(self.a))

    @property
    def implicit(self) -> bool:
        return any(any(row[i:]) for i, row in enumerate(self.a))

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "jacobian"}) if self.implicit else frozenset({"acceleration"})

    @property
    def first_order_form(self) -> bool:
        return True

    @property
    def stages(self) -> tuple[int, ...]:
        """The stages of a Runge-Kutta method, counted from zero, that a step without an error estimate needs."""
        return self.reached(self.b)

    @property
    def tableau(self) -> tuple[tuple[Row, ...], Row]:
        return self.a, self.b

    @property
    def formulas(self) -> tuple[Method, ...]:
        return (self, *(self._formula(pair) for pair in self.embedded))

    def _formula(self, pair: Embedded) -> RungeKutta:
        """Return a method with embedded weights; a slope at the start is one more stage, the first."""
        start = (Fraction(0),) if pair.start else ()
        rows = tuple((*start, *row) for row in self.a)
        a = ((Fraction(0),) * (len(rows) + 1), *rows) if start else rows
        b = (pair.start, *pair.b) if start else pair.b
        return replace(self, name=f"{self.name}, embedded weights", order=pair.order, a=a, b=b, embedded=(), dense=None)

    def reached(self, *rows: tuple[Fraction, ...]) -> tuple[int, ...]:
        """Return the stages, counted from zero, that have a weight other than zero in one of the ``rows``.

        Stages on which these stages depend, directly or through others, are included.
        """
        if self.coupled:
            return tuple(range(len(self.b)))
        reached = {i for row in rows for i, weight in enumerate(row) if weight}
        for i in reversed(range(len(self.b))):
            if i in reached:
                reached |= {j for j, weight in enumerate(self.a[i]) if weight}
        return tuple(sorted(reached))

    @property
    def first_same_as_last(self) -> bool:
        """True if a Runge-Kutta method's last stage is the new state: the next step can begin with its slope."""
        return len(self.b) > 1 and self.a[-1] == self.b and not any(self.a[0])

    @property
    def evaluations(self) -> int:
        return len(self.stages)

    @property
    def embedded_orders(self) -> tuple[int, ...]:
        return tuple(pair.order for pair in self.embedded)

    @property
    def evaluations_tried(self) -> int:
        return len(self._compared()) + self.implicit - self.first_same_as_last

    @property
    def symplectic(self) -> bool:
        """True if a Runge-Kutta method is symplectic.

        The condition is ``b_i a_ij + b_j a_ji = b_i b_j`` for all stages (Sanz-Serna 1988).
        """
        a, b, stages = self.a, self.b, range(len(self.b))
        defects = (b[i] * a[i][j] + b[j] * a[j][i] - b[i] * b[j] for i in stages for j in stages)
        return all(abs(defect) < ROUNDED for defect in defects)

    @property
    def symmetric(self) -> bool:
        """True if a Runge-Kutta method with s stages is symmetric: a step of -h undoes one of h.

        The condition is ``a_ij + a_(s+1-i)(s+1-j) = b_j`` for all stages (Hairer, Lubich & Wanner 2006, theorem V.2.3).
        """
        a, b, last = self.a, self.b, len(self.b) - 1
        stages = range(last + 1)
        return all(abs(a[i][j] + a[last - i][last - j] - b[j]) < ROUNDED for i in stages for j in stages)

    @property
    def explicit_first_stage(self) -> bool:
        return self.implicit and not any(self.a[0])

    @property
    def stability_polynomials(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of the stability function, ``R(w) = 1 + w b (1 - w A)^-1 1`` (Butcher 2016, 238).

        The denominator is ``det(1 - w A)``, by the method of Faddeev and Le Verrier. The numerator is the power series
        of R times the denominator. Coefficients within :data:`ROUNDED` of a simple fraction are that fraction.
        """
        stages = range(len(self.b))
        bottom, moments, column = [Fraction(1)], [Fraction(1)], [Fraction(1)] * len(self.b)
        power = [[Fraction(int(i == j)) for j in stages] for i in stages]
        for k in stages:
            power = [[sum((x * power[m][j] for m, x in enumerate(row) if x), Fraction(0)) for j in stages]
                     for row in self.a]
            bottom.append(-sum((power[i][i] for i in stages), Fraction(0)) / (k + 1))
            power = [[x + bottom[-1] * (i == j) for j, x in enumerate(row)] for i, row in enumerate(power)]
            moments.append(sum((self.b[j] * column[j] for j in stages), Fraction(0)))
            column = [sum((x * column[j] for j, x in enumerate(row) if x), Fraction(0)) for row in self.a]
        top = (sum((bottom[i] * moments[k - i] for i in range(k + 1)), Fraction(0)) for k in range(len(moments)))
        return tuple(map(simple, top)), tuple(map(simple, bottom))

    def array_step(
        self, system: System, dense: bool, increments: bool, estimates: bool = False
    ) -> Callable[..., tuple[Any, ...]] | None:
        if not self.implicit:
            return None
        pairs = [(pair.b, pair.start) for pair in self.embedded] if estimates else None
        return stages_step(self.a, self.b, self.c, self.coupled, system, dense, increments, pairs)

    def write_step(self, notation: Notation) -> str:
        further = (self.dense.used(len(self.b)),) if notation.dense and self.dense is not None else ()
        taken = self.reached(self.b, *further)
        step = notation.new_step()
        newton = self._write_stages(step, taken)
        weights = [self.b[i] for i in taken]
        ends = [step.end(y, increment(weights, [f"{slope}{i + 1}" for i in taken]))
                for y, slope in (("q", "v"), ("v", "a"))]
        increments = [f"h*({self._mean_slope(name, taken, notation)})" for name in notation.quadratures]
        if notation.dense:
            increments += self._all_stages(taken)
        return newton + step.source(self.title, ends, increments=increments)

    def write_starter(self, notation: Notation) -> str:
        """Return the source of ``starter``, a Runge-Kutta step that returns mean slopes instead of the new state.

        Multistep methods compute their history with it.
        """
        step = StepLines(notation)
        newton = self._write_stages(step, self.stages)
        means = [self._mean_slope(name, self.stages, notation) for name in ("v", "a", *notation.quadratures)]
        lines = [*step.lines, f"return {', '.join(means)}"]
        return newton + definition(f"starter(t, q, v, h{notation.more})", self.title, lines)

    def _mean_slope(self, name: str, taken: Sequence[int], notation: Notation) -> str:
        """Return the source text of a mean over stages with the weights b: ``0.5*v1 + 0.5*v2`` for the name v."""
        return combination([self.b[i] for i in taken], [f"{name}{i + 1}" for i in taken], notation.number)

    def _write_stages(self, step: StepLines, taken: Sequence[int], near: bool = False) -> str:
        """Append the source lines that compute these stages, counted from zero; ``near`` as for ``simultaneous``.

        Returns the source of the function that solves implicit stages; empty for an explicit method.
        """
        notation = step.notation
        quadratures, more, number = notation.quadratures, notation.more, notation.number
        stages = [i + 1 for i in taken]
        if self.coupled:
            step.line(f"{', '.join(f'a{i}' for i in stages)} = solve_stages(t, q, v, h{more})")
            for i in stages:
                step.line(f"v{i} = {step.sum('v', increment(self.a[i - 1], [f'a{j}' for j in stages]))}")
            for i in stages if quadratures else ():
                q = step.sum("q", increment(self.a[i - 1], [f"v{j}" for j in stages]))
                rates = ", ".join(["_", *(f"{name}{i}" for name in quadratures)])
                step.line(f"{rates} = rates({time_at(self.c[i - 1], number)}, {q}, v{i}{more})")
            return simultaneous(self.a, self.c, more, number, notation.refines, near)
        for i in stages:
            diagonal, t = self.a[i - 1][i - 1], time_at(self.c[i - 1], number)
            before = [j for j in stages if j < i]
            shares = [self.a[i - 1][j - 1] for j in before]
            dq, dv = (increment(shares, [f"{slope}{j}" for j in before]) for slope in "va")
            if diagonal:
                length = fraction_of(diagonal, number)
                step.line(f"k{i} = solve_stage({t}, {step.sum('q', dq)}, {step.sum('v', dv)}, {length}{more})")
                dq, dv = dq + term(diagonal, "h", f"v{i}"), dv + term(diagonal, "h", f"k{i}")
            step.line(f"v{i} = {step.sum('v', dv)}")
            if quadratures or not diagonal:
                slopes = ", ".join(f"{name}{i}" for name in ("a", *quadratures))
                step.line(f"{slopes} = {notation.slope}({t}, {step.sum('q', dq)}, v{i}{more})")
            if diagonal:
                step.line(f"a{i} = k{i}")
        return one_stage(more, refines=notation.refines) if self.implicit else ""

    def write_estimating_step(self, notation: Notation) -> str:
        stages = self._compared(notation.dense)
        kept, number, final = ["a", *notation.quadratures], notation.number, [i for i in stages if self.b[i]]
        step = StepLines(notation)
        before = self._write_stages(step, stages, near=True) if self.implicit else self._write_known_start(step, stages)
        ends = [plus(y, [self.b[i] for i in final], [f"{slope}{i + 1}" for i in final], number)
                for y, slope in (("q", "v"), ("v", "a"))]
        for name, formula in zip(("q_end", "v_end"), ends, strict=True):
            step.line(f"{name} = {formula}")
        last = [f"{name}{stages[-1] + 1}" if self.first_same_as_last else f"{name}_end" for name in kept]
        step.line(f"{', '.join(last)} = {notation.slope}(t + h, q_end, v_end{notation.more})")
        if self.first_same_as_last:
            step.line(f"v{stages[-1] + 1} = v_end")
        sums = [f"h*({self._mean_slope(name, final, notation)})" for name in notation.quadratures]
        errors = [text for k, pair in enumerate(self.embedded) for text in self._write_errors(step, stages, pair, k)]
        inner_stages = self._all_stages(stages) if notation.dense else []
        return before + step.source(self.title, ["q_end", "v_end"], dict(zip(kept, last, strict=True)),
                                    [*sums, *errors, *inner_stages])

    def _write_known_start(self, step: StepLines, stages: Sequence[int]) -> str:
        """Append the source lines of an explicit method's stages, whose first slope is known; return ""."""
        notation = step.notation
        kept, number = ["a", *notation.quadratures], notation.number
        step.lines += ["v1 = v", *(f"{name}1 = {name}" for name in kept)]
        for i in stages[1:-1] if self.first_same_as_last else stages[1:]:
            earlier = [j for j in stages if j < i]
            shares = [self.a[i][j] for j in earlier]
            step.line(f"v{i + 1} = {plus('v', shares, [f'a{j + 1}' for j in earlier], number)}")
            q = plus("q", shares, [f"v{j + 1}" for j in earlier], number)
            slopes = ", ".join(f"{name}{i + 1}" for name in kept)
            step.line(f"{slopes} = {notation.slope}({time_at(self.c[i], number)}, {q}, v{i + 1}{notation.more})")
        return ""

    def _write_errors(self, step: StepLines, stages: Sequence[int], pair: Embedded, k: int) -> list[str]:
        """Return the source texts of the estimated errors of q and v by the embedded weights number k.

        The lines of a filter, see :class:`Embedded`, are appended to the step.
        """
        number = step.notation.number
        weights = [self.b[i] - pair.b[i] for i in stages]
        if not pair.start:
            return [f"h*({combination(weights, [f'{y}{i + 1}' for i in stages], number)})" for y in "va"]
        for y in "va":
            names = [y, *(f"{y}{i + 1}" for i in stages)]
            step.line(f"raw_{y} = h*({combination([-pair.start, *weights], names, number)})")
        step.line(f"g = {fraction_of(pair.start, number)}")
        step.line(f"by_q, by_v = jacobian(t, q, v{step.notation.more})")
        step.line(f"error_v{k} = (raw_a + g*by_q*raw_v)/(1.0 - g*(by_v + g*by_q))")
        step.line(f"error_q{k} = raw_v + g*error_v{k}")
        return [f"error_q{k}", f"error_v{k}"]

    def _all_stages(self, taken: Sequence[int]) -> list[str]:
        """Return the source texts of two tuples, of all stages' velocities and accelerations; None for unused ones."""
        every = range(len(self.b))
        return [f"({''.join(f'{y}{i + 1}, ' if i in taken else 'None, ' for i in every)})" for y in "va"]

    def _compared(self, dense: bool = False) -> tuple[int, ...]:
        """Return the stages, counted from zero, that a step with error estimates needs.

        With ``dense``, stages that only dense output needs are included.
        """
        further = (self.dense.used(len(self.b)),) if dense and self.dense is not None else ()
        return self.reached(self.b, *(pair.b for pair in self.embedded), *further)


__all__ = ["Embedded", "Extension", "RungeKutta"]
