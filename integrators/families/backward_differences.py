"""Backward differentiation formulas (BDF), implicit multistep methods for stiff problems."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate, pairwise
from typing import Any, ClassVar

from integrators.families.multistep import HNW, Started
from integrators.method import Acceleration, History, MethodError, Polynomial, exact
from integrators.steps.newton import one_stage
from integrators.steps.terms import Notation, combination, fraction_of, term
from integrators.tables.implicit import COLLOCATION

RADAU5 = next(method for method in COLLOCATION if method.name == "radau5")


@dataclass(frozen=True, kw_only=True)
class BackwardDifference(Started):
    """A backward differentiation formula: ``sum_j alpha_j y_(n+1-j) = h f_(n+1)``, solved for the new acceleration.

    The history holds the increments of q and v over earlier steps, called gains. A one-step method, the starter, takes
    the first steps, forwards in time, since a damped motion grows without bound backwards; a counter of these steps is
    passed from step to step. Work and heat are integrated by the formula too; with steps too long for the motion, heat
    may decrease, although it should not. Raises MethodError if the formula is not consistent.

    Attributes:
        alpha: the coefficients, that of the new state first.
    """

    alpha: tuple[Fraction, ...]

    forwards: ClassVar[bool] = True

    coefficients: ClassVar[tuple[str, ...]] = ("alpha",)

    def __post_init__(self) -> None:
        super().__post_init__()
        if sum(self.alpha) or sum(-j * x for j, x in enumerate(self.alpha)) != 1:
            raise MethodError(f"{self.name}: sum_j alpha_j must be 0 and sum_j -j alpha_j must be 1.")

    @property
    def memory(self) -> tuple[str, ...]:
        return self.memory_with()

    def memory_with(self, quadratures: Sequence[str] = ()) -> tuple[str, ...]:
        gains = (f"{name}{i}_gain" for name in ("q", "v", *quadratures) for i in range(1, self.past + 1))
        return ("begun", *gains)

    @property
    def first_order_form(self) -> bool:
        return True

    @property
    def past(self) -> int:
        return len(self.alpha) - 2

    @property
    def implicit(self) -> bool:
        return True

    @property
    def beginning(self) -> int:
        """The additional force evaluations of a BDF method's first steps, which its starter (a one-step method) takes.

        Repeated evaluations in Newton's iteration are not counted.
        """
        return self.past * (self.starter.evaluations - 1)

    @property
    def counters(self) -> Mapping[str, int]:
        return {"begun": self.past}

    def settled_memory(
        self, t: Any, q: Any, v: Any, h: Any, acceleration: Acceleration, history: History
    ) -> tuple[Any, ...]:
        steps = list(pairwise(history(self.past)))
        return (self.past, *(one[k] - other[k] for k in range(2) for one, other in steps))

    @property
    def share(self) -> Fraction:
        """The weight ``1/alpha_0`` of the new acceleration in a BDF step's increment of the velocity."""
        return 1 / self.alpha[0]

    @property
    def gains(self) -> tuple[Fraction, ...]:
        """The weights of earlier steps' increments in the increment that a BDF step computes, the newest first."""
        return tuple(-x / self.alpha[0] for x in list(accumulate(self.alpha))[1:-1])

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        k = len(self.alpha) - 1
        return self.alpha[::-1], (*[Fraction(0)] * k, Fraction(-1))

    def write_step(self, notation: Notation) -> str:
        more, number = notation.more, notation.number
        names = ("q", "v", *notation.quadratures)
        rows = {name: [f"{name}{i}_gain" for i in range(1, self.past + 1)] for name in names}
        known = {name: combination(self.gains, row, number) for name, row in rows.items()}
        length = fraction_of(self.share, number)
        means = ", ".join(f"{name}_gain" for name in names)
        step = notation.new_step()
        step.lines += [
            f"if begun < {self.past}:",
            f"    {means} = starter(t, q, v, h{more})",
            *(f"    {name}_gain = h*{name}_gain" for name in names),
            "else:",
            *(f"    {name}_gain = {known[name]}" for name in names),
            f"    a = solve_stage(t + h, q + q_gain, v + v_gain, {length}{more})",
            f"    v_gain = v_gain + {length}*a",
            f"    q_gain = q_gain + {length}*(v + v_gain)",
        ]
        if notation.quadratures:
            step.line(f"    {', '.join(['_', *notation.quadratures])} = rates(t + h, q + q_gain, v + v_gain{more})")
            step.lines += [f"    {name}_gain = {name}_gain + {length}*{name}" for name in notation.quadratures]
        kept = ["begun + 1", *(gain for name, row in rows.items() for gain in (f"{name}_gain", *row[:-1]))]
        sums = [f"{name}_gain" for name in notation.quadratures]
        ends = [step.end(y, term(1, f"{y}_gain")) for y in "qv"]
        zeros = ", ".join(["zero"] * (len(self.memory_with(notation.quadratures)) - 1))
        begin = ["zero = v - v", f"return h - h, {zeros}"]
        newton = one_stage(more, refines=notation.refines)
        return self.write_starter(notation) + newton + self.define(begin, step, ends, kept, sums)


def _backward(order: int, *alpha: str) -> BackwardDifference:
    """Return the backward differentiation formula of this order; ``alpha`` are its coefficients, newest state first."""
    angle = ("", ", L-stable", ", A(86)-stable", ", A(73)-stable", ", A(51)-stable", ", A(17)-stable")[order - 1]
    return BackwardDifference(
        name=f"bdf{order}",
        aliases=(f"gear{order}",),
        order=order,
        a_stable=order == 2,
        l_stable=order == 2,
        source=f"Curtiss & Hirschfelder 1952, Proc. Natl. Acad. Sci. 38, 235; {HNW}, III.1",
        summary=f"implicit: slope of the polynomial through the last {order} states and the new one{angle}",
        alpha=exact(*alpha),
        starter=RADAU5,
    )


BACKWARD = (
    _backward(2, "3/2", "-2", "1/2"),
    _backward(3, "11/6", "-3", "3/2", "-1/3"),
    _backward(4, "25/12", "-4", "3", "-4/3", "1/4"),
    _backward(5, "137/60", "-5", "5", "-10/3", "5/4", "-1/5"),
    _backward(6, "49/20", "-6", "15/2", "-20/3", "15/4", "-6/5", "1/6"),
)
