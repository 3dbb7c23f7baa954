"""Nyström methods: Runge-Kutta methods for ``q'' = a(t, q, v)``, with separate weights for q and for v.

Nyström 1925, Acta Soc. Sci. Fennicae 50, no. 13; Hairer, Norsett & Wanner 1993, section II.14. Tables are in
:mod:`integrators.tables.nystrom`, order conditions in :mod:`integrators.analysis.nystrom_trees`.

Methods for velocity-free forces call ``force(t, q)`` in their steps. Steps with quadratures then call
``rates(t, q, v)`` at the stages that have a weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import ClassVar

from integrators.method import ROUNDED, Method, MethodError, Polynomial, Row, polynomial_at, rational, simple, total
from integrators.steps.terms import (
    Notation,
    StepLines,
    Terms,
    begin_with_force,
    combination,
    increment,
    term,
    time_at,
    times_step,
    weighted,
)


@dataclass(frozen=True)
class EmbeddedNystrom:
    """Embedded weights of a Nyström method, for a result of lower order that is compared with the step's result.

    Attributes:
        order: the order of the embedded result; if it differs for q and v, the lower one.
        bbar: weights for q.
        b: weights for v; None for a pair that compares q alone.
    """

    order: int
    bbar: Row
    b: Row | None


@dataclass(frozen=True, kw_only=True)
class Nystrom(Method):
    """An explicit Nyström method by its table.

    ::

        Q_i = q + c_i h v + h**2 sum_j a_ij K_j        K_i = a(t + c_i h, Q_i, V_i)
        V_i = v + h sum_j av_ij K_j
        q1 = q + h v + h**2 sum_i bbar_i K_i           v1 = v + h sum_i b_i K_i

    In a ``velocity_free`` method no force depends on V_i, only the rates of quadratures (integrals carried along the
    step, such as work) do. They are evaluated after all forces, so that V_i may contain any K_j. Quadratures have the
    weights b. Their order is that of the method for rates linear in v, such as the power of a drive; for other rates
    the tables state it.

    Symplecticity and symmetry are computed from the table, up to :data:`integrators.method.ROUNDED`.
    Raises MethodError if shapes disagree, if weights do not sum to 1/2 for q and 1 for v, or if a stage depends on a
    later one.

    Attributes:
        c, a, bbar, b, av: the table; stages on which bbar and b do not depend serve only to estimate the error.
        velocity_free: True if the order holds only for velocity-free forces, for which there are fewer conditions.
        embedded: embedded weights; the differences between them and bbar and b estimate the error of one step.
    """

    c: Row
    a: tuple[Row, ...]
    bbar: Row
    b: Row
    av: tuple[Row, ...]
    velocity_free: bool = False
    embedded: tuple[EmbeddedNystrom, ...] = ()

    family: ClassVar[str] = "Nyström"
    coefficients: ClassVar[tuple[str, ...]] = ("c", "a", "bbar", "b", "av")

    def __post_init__(self) -> None:
        super().__post_init__()
        pairs = tuple(
            replace(pair, bbar=rational(pair.bbar, f"{self.name}: embedded bbar"),
                    b=None if pair.b is None else rational(pair.b, f"{self.name}: embedded b"))
            for pair in self.embedded)
        object.__setattr__(self, "embedded", pairs)
        size = len(self.b)
        for label, table in (("a", self.a), ("av", self.av)):
            if len(table) != size or any(len(line) != size for line in table):
                raise MethodError(f"{self.name}: {label} must be {size} rows of {size} numbers, like b.")
        later = [("a", self.a), *([] if self.velocity_free else [("av", self.av)])]
        for label, table in later:
            if any(any(line[i:]) for i, line in enumerate(table)):
                raise MethodError(f"{self.name}: a stage may depend only on earlier ones, "
                                  f"so {label} must be zero on and above the diagonal.")
        rows: list[tuple[str, Row | None, Fraction]] = [("bbar", self.bbar, Fraction(1, 2)), ("b", self.b, Fraction(1))]
        for pair in self.embedded:
            rows += [("embedded bbar", pair.bbar, Fraction(1, 2)), ("embedded b", pair.b, Fraction(1))]
        for label, line in (("c", self.c), *((label, line) for label, line, _ in rows)):
            if line is not None and len(line) != size:
                raise MethodError(f"{self.name}: {label} must be {size} numbers, like b.")
        for label, line, whole in rows:
            if line is not None and abs(total(line) - whole) > ROUNDED:
                raise MethodError(f"{self.name}: the weights {label} sum to {total(line)}, not to {whole}.")

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "velocity_free"} if self.velocity_free else {"acceleration"})

    @property
    def formulas(self) -> tuple[Method, ...]:
        return (self, *(replace(self, name=f"{self.name}, embedded weights", order=pair.order, bbar=pair.bbar, b=pair.b,
                                embedded=()) for pair in self.embedded if pair.b is not None))

    @property
    def first_same_as_last(self) -> bool:
        """True if a Nyström method's last stage is the new state, so that the next step can begin with its force."""
        ends = self.c[-1] == 1 and self.a[-1] == self.bbar and (self.velocity_free or self.av[-1] == self.b)
        return len(self.b) > 1 and ends and self.c[0] == 0

    @property
    def memory(self) -> tuple[str, ...]:
        """The memory of a Nyström method: ``a``, the force at the step's end, if the step computes it.

        The next step begins with this force.
        """
        return ("a",) if self.first_same_as_last and self.velocity_free and self.b[-1] != 0 else ()

    @property
    def stages(self) -> tuple[int, ...]:
        """Numbers of the stages, from zero, that a step needs; stages for the error estimate alone are left out."""
        return self.reached((self.bbar, self.b))

    def reached(self, rows: Sequence[Row]) -> tuple[int, ...]:
        """Return the stages, counted from zero, that have a weight other than zero in one of the ``rows``.

        Stages on which these stages depend, directly or through others, are included.
        """
        reached = {i for line in rows for i, weight in enumerate(line) if weight}
        for i in reversed(range(len(self.b))):
            if i in reached:
                lines = (self.a[i],) if self.velocity_free else (self.a[i], self.av[i])
                reached |= {j for line in lines for j, weight in enumerate(line) if weight}
        return tuple(sorted(reached))

    @property
    def evaluations(self) -> int:
        return len(self.stages) - len(self.memory)

    @property
    def symplectic(self) -> bool:
        """True if a Nyström table is symplectic (Suris 1989).

        The conditions are ``bbar_i = b_i (1 - c_i)`` and ``b_i (bbar_j - a_ij) = b_j (bbar_i - a_ji)``.
        """
        a, b, bbar, stages = self.a, self.b, self.bbar, range(len(self.b))
        defects = [bbar[i] - b[i] * (1 - self.c[i]) for i in stages]
        defects += [b[i] * (bbar[j] - a[i][j]) - b[j] * (bbar[i] - a[j][i]) for i in stages for j in stages]
        return all(abs(defect) < ROUNDED for defect in defects)

    @property
    def symmetric(self) -> bool:
        """True if a Nyström method is symmetric: a step of -h undoes one of h.

        The table then equals its reverse (Hairer, Lubich & Wanner 2006, V.2).
        """
        a, b, c, bbar, last = self.a, self.b, self.c, self.bbar, len(self.b) - 1
        stages = range(last + 1)
        defects = [c[i] + c[last - i] - 1 for i in stages] + [b[i] - b[last - i] for i in stages]
        defects += [bbar[i] + bbar[last - i] - b[i] for i in stages]
        defects += [a[last - i][last - j] - a[i][j] - b[j] * (1 - c[i]) + bbar[j] for i in stages for j in stages]
        if not self.velocity_free:
            defects += [self.av[i][j] + self.av[last - i][last - j] - b[j] for i in stages for j in stages]
        return all(abs(defect) < ROUNDED for defect in defects)

    @property
    def oscillator(self) -> tuple[tuple[Fraction, ...], ...]:
        """The matrix of one Nyström step on ``q'' = -q``, row by row, as polynomials in h, lowest power first."""
        of_q, of_v = [Fraction(1)] * len(self.b), list(self.c)
        entries = [[Fraction(x) for x in start] for start in ((1, 0), (0, 1, 0), (0,), (1, 0))]
        sign = -1
        for _ in self.b:
            for entry, line, inner in zip(
                entries, (self.bbar, self.bbar, self.b, self.b), (of_q, of_v, of_q, of_v), strict=True
            ):
                entry += [sign * sum((x * y for x, y in zip(line, inner, strict=True)), Fraction(0)), Fraction(0)]
            of_q, of_v = (
                [sum((x * y for x, y in zip(line, inner, strict=True) if x), Fraction(0)) for line in self.a]
                for inner in (of_q, of_v)
            )
            sign = -sign
        return tuple(tuple(entry) for entry in entries)

    def oscillator_matrix(self, terms: int) -> tuple[Polynomial, ...]:
        pad = [Fraction(0)] * terms
        return tuple((*map(simple, entry), *pad)[:terms] for entry in self.oscillator)

    @property
    def nystrom_tableau(self) -> tuple[Row, tuple[Row, ...], Row, Row, tuple[Row, ...]]:
        return self.c, self.a, self.bbar, self.b, self.av

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        if not self.velocity_free:
            return super().calls(quadratures, adaptive)
        return ("force", *(("rates",) if quadratures else ("acceleration",) if adaptive else ()))

    @property
    def embedded_orders(self) -> tuple[int, ...]:
        return tuple(pair.order for pair in self.embedded)

    @property
    def evaluations_tried(self) -> int:
        return len(self._compared) - self.first_same_as_last

    @property
    def _compared(self) -> tuple[int, ...]:
        """The stages of a Nyström method, counted from zero, that a step with error estimates needs."""
        compared = [row for pair in self.embedded for row in (pair.bbar, pair.b) if row is not None]
        return self.reached((self.bbar, self.b, *compared))

    def write_step(self, notation: Notation) -> str:
        step = notation.new_step()
        write = NystromLines(self, self.stages, step)
        last = self.stages[-1]
        memory = {}
        if self.memory:
            step.line("a1 = a")
            write.stages(self.stages[1:-1])
            step.advance("q", write.displacement(last), "q_end")
            step.line(f"a{last + 1} = {write.force('t + h', 'q_end')}")
            write.places[last] = q_end = "q_end"
            memory = {"a": f"a{last + 1}"}
        else:
            write.stages(self.stages)
            q_end = step.end("q", write.end_displacement())
        v_end = "v_end" if notation.quadratures else step.end("v", write.end_increment())
        if notation.quadratures:
            step.advance("v", write.end_increment(), v_end)
            if self.velocity_free:
                write.rates([i for i in self.stages if self.b[i]])
        begin = begin_with_force(notation.more) if self.memory else ""
        return begin + step.source(self.title, [q_end, v_end], memory, write.sums())

    def write_estimating_step(self, notation: Notation) -> str:
        stages, number, more = self._compared, notation.number, notation.more
        step = StepLines(notation)
        write = NystromLines(self, stages, step)
        kept = ["a", *notation.quadratures]
        last, same, free = stages[-1], self.first_same_as_last, self.velocity_free
        step.lines += [f"{name}1 = {name}" for name in kept]
        write.stages(stages[1:-1] if same else stages[1:])
        step.advance("q", write.end_displacement(), "q_end")
        ends = [f"{name}_end" for name in kept]
        known = free and (same or not notation.quadratures)
        if known:
            step.line(f"a_end = {write.force('t + h', 'q_end')}")
        if same and free:
            step.line(f"a{last + 1} = a_end")
        step.advance("v", write.end_increment(), "v_end")
        if notation.quadratures or not free:
            slopes = ", ".join(["_" if known else "a_end", *ends[1:]])
            step.line(f"{slopes} = {notation.slope}(t + h, q_end, v_end{more})")
        if same:
            step.lines += [f"{name}{last + 1} = {name}_end" for name in kept[1 if free else 0 :]]
        if notation.quadratures and free:
            write.rates([i for i in stages[1:] if self.b[i] and not (same and i == last)])
        errors = []
        for pair in self.embedded:
            names = [f"a{i + 1}" for i in stages]
            weights = [self.bbar[i] - pair.bbar[i] for i in stages]
            errors.append(f"h*h*({combination(weights, names, number)})")
            if pair.b is None:
                errors.append("0*v_end")
                continue
            weights = [self.b[i] - pair.b[i] for i in stages]
            errors.append(f"h*({combination(weights, names, number)})")
        slopes_at_end = dict(zip(kept, ends, strict=True))
        return step.source(self.title, ["q_end", "v_end"], slopes_at_end, [*write.sums(), *errors])


class NystromLines:
    """Writer that appends the source lines of a Nyström method's stages to a step.

    Attributes:
        method: the Nyström method.
        known: the stages that the step takes, counted from zero.
        step: the lines of the step so far.
        places: number of a stage -> the name or text of its position in the source.
    """

    def __init__(self, method: Nystrom, known: Sequence[int], step: StepLines) -> None:
        self.method, self.known, self.step = method, known, step
        self.places: dict[int, str] = {}

    def force(self, t: str, q: str) -> str:
        """Return the source text of a call of the function ``force``; the time ``t`` and angle ``q`` are texts, too."""
        return f"force({t}, {q}{self.step.notation.more})"

    def slopes(self, weights: Sequence[Fraction], stages: Sequence[int]) -> Terms:
        """Return the sum ``h sum_i weights_i K_i`` over some stages, as terms of source text."""
        return increment([weights[i] for i in stages], [f"a{i + 1}" for i in stages])

    def displacement(self, i: int) -> Terms:
        """Return ``Q_i - q``, the displacement of stage i from the step's start, as terms of source text."""
        before = [j for j in self.known if j < i]
        return times_step(weighted([self.method.c[i]], ["v"]) + self.slopes(self.method.a[i], before))

    def velocity(self, i: int) -> str:
        """Return the name or source text of the velocity ``V_i`` at a stage."""
        if self.method.velocity_free and self.method.av[i] == self.method.b:
            return "v_end"
        return self.step.sum("v", self.slopes(self.method.av[i], self.known))

    def end_displacement(self) -> Terms:
        """Return the increment of q over a Nyström step, as terms of source text."""
        return times_step(term(1, "v") + self.slopes(self.method.bbar, self.known))

    def end_increment(self) -> Terms:
        """Return the increment of v over a Nyström step, as terms of source text."""
        return self.slopes(self.method.b, self.known)

    def stages(self, stages: Sequence[int]) -> None:
        """Append the source lines that compute the forces at these stages.

        A stage's position gets a name if the rates of quadratures are evaluated there later.
        """
        step, quadratures, number = self.step, self.step.notation.quadratures, self.step.notation.number
        for i in stages:
            t, displacement = time_at(self.method.c[i], number), self.displacement(i)
            if not self.method.velocity_free:
                slopes = ", ".join(f"{name}{i + 1}" for name in ("a", *quadratures))
                q, v = step.sum("q", displacement), self.velocity(i)
                step.line(f"{slopes} = {step.notation.slope}({t}, {q}, {v}{step.notation.more})")
                continue
            self.places[i] = step.sum("q", displacement)
            if quadratures and self.method.b[i] and displacement:
                step.line(f"q{i + 1} = {self.places[i]}")
                self.places[i] = f"q{i + 1}"
            step.line(f"a{i + 1} = {self.force(t, self.places[i])}")

    def rates(self, stages: Sequence[int]) -> None:
        """Append the source lines of the rates of quadratures (integrals along the step) at these stages.

        All forces must have been computed before.
        """
        notation = self.step.notation
        for i in stages:
            names = ", ".join(["_", *(f"{name}{i + 1}" for name in notation.quadratures)])
            t, q = time_at(self.method.c[i], notation.number), self.places.get(i, "q")
            self.step.line(f"{names} = rates({t}, {q}, {self.velocity(i)}{notation.more})")

    def sums(self) -> list[str]:
        """Return the source texts of the increments of quadratures (integrals carried along the step) over the step."""
        notation = self.step.notation
        stages = [i for i in self.known if self.method.b[i]]
        weights = [self.method.b[i] for i in stages]
        return [f"h*({combination(weights, [f'{name}{i + 1}' for i in stages], notation.number)})"
                for name in notation.quadratures]


def interpolated(c: Row, nodes: Sequence[int], digits: int = 50) -> tuple[Row, ...]:
    """Return coefficients ``av`` of a Nyström table, with which stage velocities are ``V_i = v + h sum_j av_ij K_j``.

    V_i is the integral, up to the stage's time, of the polynomial through the forces K at the stages ``nodes``. Its
    error is ``O(h**(len(nodes) + 1))``.

    Args:
        c: the times of all stages, as fractions of the step.
        nodes: the stages, counted from zero, whose forces are interpolated.
        digits: decimals to which a coefficient is rounded, unless its denominator is shorter than that.
    """
    table = [[Fraction(0)] * len(c) for _ in c]
    for j in nodes:
        basis = [Fraction(1)]
        for k in nodes:
            if k != j:
                up = [Fraction(0), *basis]
                basis = [(x - c[k] * y) / (c[j] - c[k]) for x, y in zip(up, [*basis, Fraction(0)], strict=True)]
        area = (Fraction(0), *(x / n for n, x in enumerate(basis, 1)))
        for line, end in zip(table, c, strict=True):
            line[j] = polynomial_at(area, end)
    return tuple(tuple(x if x.denominator < 10**digits else round(x, digits) for x in line) for line in table)
