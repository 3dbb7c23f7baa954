"""The steps of Nyström methods as source, straight lines: plain, and with estimates of the error.

Signatures are those of :mod:`integrators.steps.unroll` and :mod:`integrators.steps.estimates`. Methods for forces free
of the velocity call ``force(t, q)``; quadratures ask for ``rates(t, q, v)`` afterwards, at the stages that have a
weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from integrators.families.nystrom import Nystrom
from integrators.steps.terms import Number, begin_with_force, combination, definition, time_at


def nystrom_step(method: Nystrom, quadratures: Sequence[str], extra: Sequence[str], number: Number) -> str:
    """Source of ``step(t, q, v[, a], h, *extra) -> (q, v[, a], *increments)``, and of ``begin`` where there is an a."""
    write = _Writer(method, method.stages, quadratures, extra, number)
    last = method.stages[-1]
    if method.memory:
        write.lines.append("a1 = a")
        write.stages(method.stages[1:-1])
        write.line("q_end", write.position(last))
        write.line(f"a{last + 1}", write.force("t + h", "q_end"))
        write.places[last] = "q_end"
        results = ["q_end", "v_end" if quadratures else write.end_velocity(), f"a{last + 1}"]
    else:
        write.stages(method.stages)
        results = [write.end_position(), "v_end" if quadratures else write.end_velocity()]
    if quadratures:
        write.line("v_end", write.end_velocity())
        if method.velocity_free:
            write.rates([i for i in method.stages if method.b[i]])
    write.lines.append(f"return {', '.join([*results, *write.sums()])}")
    signature = f"step({', '.join(['t', 'q', 'v', *method.memory, 'h'])}{write.more})"
    begin = begin_with_force(write.more) if method.memory else ""
    return begin + definition(signature, f"{method.name}: {method.source}", write.lines)


def estimating_step(method: Nystrom, quadratures: Sequence[str], extra: Sequence[str], number: Number) -> str:
    """Source of ``step(t, q, v, a, *rates, h, *extra) -> (q, v, a, *rates, *increments, *errors)``."""
    stages = estimating_stages(method)
    write = _Writer(method, stages, quadratures, extra, number)
    kept = ["a", *quadratures]
    last, same, free = stages[-1], method.first_same_as_last, method.velocity_free
    write.lines += [f"{name}1 = {name}" for name in kept]
    write.stages(stages[1:-1] if same else stages[1:])
    write.line("q_end", write.end_position())
    ends = [f"{name}_end" for name in kept]
    known = free and (same or not quadratures)
    if known:
        write.line("a_end", write.force("t + h", "q_end"))
    if same and free:
        write.line(f"a{last + 1}", "a_end")
    write.line("v_end", write.end_velocity())
    if quadratures or not free:
        slope = "rates" if quadratures else "acceleration"
        found = ", ".join(["_" if known else "a_end", *ends[1:]])
        write.line(found, f"{slope}(t + h, q_end, v_end{write.more})")
    if same:
        write.lines += [f"{name}{last + 1} = {name}_end" for name in kept[1 if free else 0 :]]
    if quadratures and free:
        write.rates([i for i in stages[1:] if method.b[i] and not (same and i == last)])
    errors = []
    for pair in method.embedded:
        names = [f"a{i + 1}" for i in stages]
        weights = [method.bbar[i] - pair.bbar[i] for i in stages]
        errors.append(f"h*h*({combination(weights, names, number)})")
        if pair.b is None:
            errors.append("0*v_end")
            continue
        weights = [method.b[i] - pair.b[i] for i in stages]
        errors.append(f"h*({combination(weights, names, number)})")
    results = ["q_end", "v_end", *ends, *write.sums(), *errors]
    write.lines.append(f"return {', '.join(results)}")
    signature = f"step({', '.join(['t', 'q', 'v', *kept, 'h'])}{write.more})"
    return definition(signature, f"{method.name}: {method.source}", write.lines)


def estimating_stages(method: Nystrom) -> tuple[int, ...]:
    """Stages that the weights, or those of an estimate, reach; counted from zero."""
    compared = [row for pair in method.embedded for row in (pair.bbar, pair.b) if row is not None]
    return method.reached((method.bbar, method.b, *compared))


class _Writer:
    """Lines of one step, and where the stages' positions are kept."""

    def __init__(
        self, method: Nystrom, stages: Sequence[int], quadratures: Sequence[str], extra: Sequence[str], number: Number
    ) -> None:
        self.method, self.known, self.quadratures, self.number = method, tuple(stages), tuple(quadratures), number
        self.more = "".join(f", {name}" for name in extra)
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
                slope = "rates" if self.quadratures else "acceleration"
                found = ", ".join(f"{name}{i + 1}" for name in ("a", *self.quadratures))
                self.line(found, f"{slope}({t}, {q}, {self.velocity(i)}{self.more})")
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
