"""Nyström methods: Runge-Kutta methods made for ``q'' = a(t, q, v)``, with weights of their own for q and for v.

Nyström 1925, Acta Soc. Sci. Fennicae 50, no. 13; Hairer, Norsett & Wanner 1993, section II.14. Tables are in
:mod:`integrators.tables.nystrom` and :mod:`integrators.tables.nystrom_high`, order conditions in
:mod:`integrators.analysis.nystrom_trees`, the source of a step in :mod:`integrators.families.nystrom_steps`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from integrators.method import ROUNDED, Method, MethodError

Row = tuple[Fraction, ...]


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
