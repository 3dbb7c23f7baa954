"""Nyström methods: Runge-Kutta methods made for ``q'' = a(t, q, v)``, with weights of their own for q and for v.

Nyström 1925, Acta Soc. Sci. Fennicae 50, no. 13; Hairer, Norsett & Wanner 1993, section II.14. Tables are in
:mod:`integrators.tables.nystrom`, order conditions in :mod:`integrators.analysis.nystrom_trees`.

Methods for forces free of the velocity call ``force(t, q)`` in their steps; quadratures ask for ``rates(t, q, v)``
afterwards, at the stages that have a weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from integrators.method import ROUNDED, Method, MethodError, Polynomial, Row, simple
from integrators.steps.terms import Notation, begin_with_force, combination, definition, time_at


@dataclass(frozen=True)
class EmbeddedNystrom:
    """Further weights on a method's stages: results of lower order for q and v, to compare with.

    Attributes:
        order: of the lower of the two results.
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

    In a ``velocity_free`` method no force asks for V_i; there it is where the rates of quadratures are asked for, once
    all forces are known, so that V_i may hold any of them. Quadratures have the weights b. Their order is the method's
    for rates linear in v, such as the power of a drive; for others see each table.

    Symplecticity and symmetry are read off the table, never declared, up to :data:`integrators.method.ROUNDED`.
    Raises MethodError if shapes disagree, weights do not sum to 1/2 for q and 1 for v, or a stage asks for a later one.

    Attributes:
        c, a, bbar, b, av: the table; stages that bbar and b do not reach serve the estimates of the error alone.
        velocity_free: True if the order holds for forces free of the velocity only, where fewer conditions suffice.
        embedded: further weights, whose differences to bbar and b estimate the error of one step.
    """

    c: Row
    a: tuple[Row, ...]
    bbar: Row
    b: Row
    av: tuple[Row, ...]
    velocity_free: bool = False
    embedded: tuple[EmbeddedNystrom, ...] = ()

    family: ClassVar[str] = "Nyström"

    def __post_init__(self) -> None:
        size = len(self.b)
        for label, table in (("a", self.a), ("av", self.av)):
            if len(table) != size or any(len(line) != size for line in table):
                raise MethodError(f"{self.name}: {label} must be {size} rows of {size} numbers, like b.")
        later = [("a", self.a), *([] if self.velocity_free else [("av", self.av)])]
        for label, table in later:
            if any(any(line[i:]) for i, line in enumerate(table)):
                raise MethodError(f"{self.name}: a stage may ask for those before it only, so {label} must be lower.")
        rows: list[tuple[str, Row | None, Fraction]] = [("bbar", self.bbar, Fraction(1, 2)), ("b", self.b, Fraction(1))]
        for pair in self.embedded:
            rows += [("embedded bbar", pair.bbar, Fraction(1, 2)), ("embedded b", pair.b, Fraction(1))]
        for label, line in (("c", self.c), *((label, line) for label, line, _ in rows)):
            if line is not None and len(line) != size:
                raise MethodError(f"{self.name}: {label} must be {size} numbers, like b.")
        for label, line, total in rows:
            if line is not None and abs(sum(line) - total) > ROUNDED:
                raise MethodError(f"{self.name}: the weights {label} sum to {sum(line)}, not to {total}.")

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "velocity_free"} if self.velocity_free else {"acceleration"})

    @property
    def first_same_as_last(self) -> bool:
        """True if the last stage is the new state, so that its force is the first one of the next step."""
        ends = self.c[-1] == 1 and self.a[-1] == self.bbar and (self.velocity_free or self.av[-1] == self.b)
        return len(self.b) > 1 and ends and self.c[0] == 0

    @property
    def memory(self) -> tuple[str, ...]:
        """The force, if the result needs that at the new state, which then serves the next step, too."""
        return ("a",) if self.first_same_as_last and self.velocity_free and self.b[-1] != 0 else ()

    @property
    def stages(self) -> tuple[int, ...]:
        """Which stages the weights reach, counted from zero: those that a step without an estimate takes."""
        return self.reached((self.bbar, self.b))

    def reached(self, rows: Sequence[Row]) -> tuple[int, ...]:
        """Which stages some weights reach, themselves or through others; counted from zero."""
        found = {i for line in rows for i, weight in enumerate(line) if weight}
        for i in reversed(range(len(self.b))):
            if i in found:
                lines = (self.a[i],) if self.velocity_free else (self.a[i], self.av[i])
                found |= {j for line in lines for j, weight in enumerate(line) if weight}
        return tuple(sorted(found))

    @property
    def evaluations(self) -> int:
        return len(self.stages) - len(self.memory)

    @property
    def symplectic(self) -> bool:
        """``bbar_i = b_i (1 - c_i)`` and ``b_i (bbar_j - a_ij) = b_j (bbar_i - a_ji)`` (Suris 1989)."""
        a, b, bbar, stages = self.a, self.b, self.bbar, range(len(self.b))
        defects = [bbar[i] - b[i] * (1 - self.c[i]) for i in stages]
        defects += [b[i] * (bbar[j] - a[i][j]) - b[j] * (bbar[i] - a[j][i]) for i in stages for j in stages]
        return all(abs(defect) < ROUNDED for defect in defects)

    @property
    def symmetric(self) -> bool:
        """The table is that of step(-h), solved for the new state: stages in reverse (Hairer, Lubich & Wanner, V.2)."""
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
        """One step on ``q'' = -q`` as polynomials in h, lowest power first: q1 of q, q1 of v, v1 of q, v1 of v."""
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
        """Stages that the weights, or those of an estimate, reach; counted from zero."""
        compared = [row for pair in self.embedded for row in (pair.bbar, pair.b) if row is not None]
        return self.reached((self.bbar, self.b, *compared))

    def write_step(self, notation: Notation) -> str:
        write = _Writer(self, self.stages, notation)
        last = self.stages[-1]
        if self.memory:
            write.lines.append("a1 = a")
            write.stages(self.stages[1:-1])
            write.line("q_end", write.position(last))
            write.line(f"a{last + 1}", write.force("t + h", "q_end"))
            write.places[last] = "q_end"
            results = ["q_end", "v_end" if notation.quadratures else write.end_velocity(), f"a{last + 1}"]
        else:
            write.stages(self.stages)
            results = [write.end_position(), "v_end" if notation.quadratures else write.end_velocity()]
        if notation.quadratures:
            write.line("v_end", write.end_velocity())
            if self.velocity_free:
                write.rates([i for i in self.stages if self.b[i]])
        write.lines.append(f"return {', '.join([*results, *write.sums()])}")
        signature = f"step({', '.join(['t', 'q', 'v', *self.memory, 'h'])}{write.more})"
        begin = begin_with_force(write.more) if self.memory else ""
        return begin + definition(signature, self.title, write.lines)

    def write_estimating_step(self, notation: Notation) -> str:
        stages, number = self._compared, notation.number
        write = _Writer(self, stages, notation)
        kept = ["a", *notation.quadratures]
        last, same, free = stages[-1], self.first_same_as_last, self.velocity_free
        write.lines += [f"{name}1 = {name}" for name in kept]
        write.stages(stages[1:-1] if same else stages[1:])
        write.line("q_end", write.end_position())
        ends = [f"{name}_end" for name in kept]
        known = free and (same or not notation.quadratures)
        if known:
            write.line("a_end", write.force("t + h", "q_end"))
        if same and free:
            write.line(f"a{last + 1}", "a_end")
        write.line("v_end", write.end_velocity())
        if notation.quadratures or not free:
            found = ", ".join(["_" if known else "a_end", *ends[1:]])
            write.line(found, f"{notation.slope}(t + h, q_end, v_end{write.more})")
        if same:
            write.lines += [f"{name}{last + 1} = {name}_end" for name in kept[1 if free else 0 :]]
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
        results = ["q_end", "v_end", *ends, *write.sums(), *errors]
        write.lines.append(f"return {', '.join(results)}")
        signature = f"step({', '.join(['t', 'q', 'v', *kept, 'h'])}{write.more})"
        return definition(signature, self.title, write.lines)


class _Writer:
    """Lines of one step, and where the stages' positions are kept."""

    def __init__(self, method: Nystrom, stages: Sequence[int], notation: Notation) -> None:
        self.method, self.known = method, tuple(stages)
        self.quadratures, self.number, self.more = notation.quadratures, notation.number, notation.more
        self.slope = notation.slope
        self.lines: list[str] = []
        self.places: dict[int, str] = {}

    def line(self, name: str, value: str) -> None:
        self.lines.append(f"{name} = {value}")

    def force(self, t: str, q: str) -> str:
        return f"force({t}, {q}{self.more})"

    def sum(self, weights: Sequence[Fraction], stages: Sequence[int]) -> str:
        return combination([weights[i] for i in stages], [f"a{i + 1}" for i in stages], self.number)

    def moved(self, share: Fraction, weights: Sequence[Fraction], stages: Sequence[int]) -> str:
        """``q + h*(share*v + h*(sum))``, without what vanishes."""
        total = self.sum(weights, stages)
        parts = [combination([share], ["v"], self.number), f"h*({total})" if total else ""]
        inner = " + ".join(part for part in parts if part)
        return f"q + h*({inner})" if inner else "q"

    def position(self, i: int) -> str:
        """Q_i."""
        return self.moved(self.method.c[i], self.method.a[i], [j for j in self.known if j < i])

    def velocity(self, i: int) -> str:
        """V_i."""
        if self.method.velocity_free and self.method.av[i] == self.method.b:
            return "v_end"
        total = self.sum(self.method.av[i], self.known)
        return f"v + h*({total})" if total else "v"

    def end_position(self) -> str:
        return self.moved(Fraction(1), self.method.bbar, self.known)

    def end_velocity(self) -> str:
        return f"v + h*({self.sum(self.method.b, self.known)})"

    def stages(self, stages: Sequence[int]) -> None:
        """The forces of these stages; positions by name where rates are asked for there later."""
        for i in stages:
            t, q = time_at(self.method.c[i], self.number), self.position(i)
            if not self.method.velocity_free:
                found = ", ".join(f"{name}{i + 1}" for name in ("a", *self.quadratures))
                self.line(found, f"{self.slope}({t}, {q}, {self.velocity(i)}{self.more})")
                continue
            self.places[i] = q
            if self.quadratures and self.method.b[i] and q != "q":
                self.places[i] = f"q{i + 1}"
                self.line(self.places[i], q)
            self.line(f"a{i + 1}", self.force(t, self.places[i]))

    def rates(self, stages: Sequence[int]) -> None:
        """The quadratures' rates at these stages, all forces known."""
        found = [f"{name}{{}}" for name in self.quadratures]
        for i in stages:
            t, names = time_at(self.method.c[i], self.number), ", ".join(["_", *found]).format(*[i + 1] * len(found))
            place = self.places.get(i, "q")
            self.line(names, f"rates({t}, {place}, {self.velocity(i)}{self.more})")

    def sums(self) -> list[str]:
        """The quadratures' increments."""
        stages = [i for i in self.known if self.method.b[i]]
        weights = [self.method.b[i] for i in stages]
        return [f"h*({combination(weights, [f'{name}{i + 1}' for i in stages], self.number)})"
                for name in self.quadratures]


def interpolated(c: Row, nodes: Sequence[int], digits: int = 50) -> tuple[Row, ...]:
    """``av`` from the polynomial through the forces at some stages, integrated to each stage's time: V_i of the order
    ``len(nodes)``; rounded to so many decimals where it is no short fraction.
    """
    table = []
    for end in c:
        line = [Fraction(0)] * len(c)
        for j in nodes:
            basis = [Fraction(1)]
            for k in nodes:
                if k != j:
                    up = [Fraction(0), *basis]
                    basis = [(x - c[k] * y) / (c[j] - c[k]) for x, y in zip(up, [*basis, Fraction(0)], strict=True)]
            line[j] = sum((x * end ** (n + 1) / (n + 1) for n, x in enumerate(basis)), Fraction(0))
        table.append(tuple(x if x.denominator < 10**digits else round(x, digits) for x in line))
    return tuple(table)
