"""Multistep methods for ``q'' = f``: Störmer, Numerov, Quinlan & Tremaine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import accumulate
from typing import ClassVar

from integrators.families.multistep import (
    HNW,
    RK4,
    Started,
    ago,
    closed,
    falling,
    over_mean,
    starter_of,
)
from integrators.method import MethodError, Polynomial, exact, total
from integrators.steps.newton import one_stage
from integrators.steps.terms import Notation, StepLines, combination, increment, plus, term, times_step
from integrators.tables.butcher import extrapolated_midpoint


@dataclass(frozen=True, kw_only=True)
class SecondOrder(Started):
    """A multistep method for ``q'' = f(t, q)``: ``sum_j alpha_j q_(n+1-j) = h**2 sum_j beta_j f_(n+1-j)``.

    The step uses the summed form: it adds mean velocities ``u = (q_n - q_(n-1))/h`` instead of angles, so that rounding
    errors grow more slowly (Henrici 1962, section 6.4). The velocity is the last mean velocity plus a weighted sum of
    earlier accelerations, ``v = u + h sum_j c_j f_(n-j)``. Raises MethodError if the method is not consistent.

    Attributes:
        alpha: the coefficients of angles, that of the new one first.
        beta: the coefficients of forces, that of the new one first.
    """

    alpha: tuple[Fraction, ...]
    beta: tuple[Fraction, ...]
    power: ClassVar[int] = 2

    coefficients: ClassVar[tuple[str, ...]] = ("alpha", "beta")

    def __post_init__(self) -> None:
        super().__post_init__()
        moments = [total(x * (-j) ** m for j, x in enumerate(self.alpha)) for m in range(3)]
        if self.alpha[0] != 1 or moments[0] or moments[1] or moments[2] != 2 * total(self.beta):
            raise MethodError(f"{self.name}: the sums of alpha_j (-j)**m must be 0, 0 and 2 sum(beta) "
                              "for m = 0, 1 and 2, and alpha must begin with 1.")

    @property
    def needs(self) -> frozenset[str]:
        return super().needs | {"velocity_free"}

    @property
    def memory(self) -> tuple[str, ...]:
        return self.memory_with()

    def memory_with(self, quadratures: Sequence[str] = ()) -> tuple[str, ...]:
        means = ago(("u",), range(1, len(self.alpha) - 2))
        return ("a", *ago(("a",), range(1, self.past + 1)), *means, *ago(quadratures, range(self.past + 1)))

    @property
    def past(self) -> int:
        used = max(j for j, x in enumerate(self.beta) if x)
        return max(used - 1, len(self.alpha) - 2, self.order - 2)

    @property
    def implicit(self) -> bool:
        return self.beta[0] != 0

    @property
    def beginning(self) -> int:
        return 1 + super().beginning

    @property
    def symmetric(self) -> bool:
        """True if a multistep method's coefficients are symmetric, so that a step of -h undoes a step of h."""
        length = len(self.alpha)
        beta = (*self.beta, *[Fraction(0)] * (length - len(self.beta)))
        return self.alpha == self.alpha[::-1] and len(beta) == length and beta == beta[::-1]

    @property
    def parasitic(self) -> bool:
        return self.symmetric and len(self.alpha) > 3

    @property
    def means(self) -> tuple[Fraction, ...]:
        """The weights of earlier mean velocities in a step's new mean velocity, the newest first."""
        return tuple(-x for x in list(accumulate(self.alpha))[1:-1])

    @cached_property
    def velocity(self) -> tuple[Fraction, ...]:
        """The weights ``c_j`` of accelerations in the velocity of a multistep method.

        The velocity is ``v = u + h sum_j c_j f_(n-j)`` with the mean velocity u of the last step.
        """
        return over_mean(self.past + 1)

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        used = max(len(self.alpha), 1 + max(j for j, x in enumerate(self.beta) if x))
        return falling([-x for x in self.alpha], used - 1), falling(self.beta[:used], used - 1)

    def write_step(self, notation: Notation) -> str:
        several = len(self.alpha) > 3
        # A mean velocity from several earlier ones is not the last one plus an increment: it cannot be compensated.
        step = StepLines(notation) if several else notation.new_step()
        forces = ["a", *ago("a", range(1, self.past + 1))]
        ends = self._ends_from_means(step, forces) if several else self._ends_from_increments(step, forces)
        means = ["u", *ago("u", range(1, len(self.alpha) - 2))]
        rates, increments = closed(step, self.past + 2)
        kept = ["a_new", *forces[:-1], *means[:-1], *rates]
        newton = one_stage(notation.more, apart=True, refines=notation.refines) if self.implicit else ""
        begin = self.begin_backwards(notation, means=ago("u", range(self.past)) if several else ())
        return self.write_starter(notation) + newton + self.define(begin, step, ends, kept, increments)

    def _ends_from_means(self, step: StepLines, forces: Sequence[str]) -> list[str]:
        """Append the source lines of a step whose history holds several mean velocities ``(q_n - q_(n-1))/h``.

        ``forces`` are the names of the history's accelerations. Returns the names of q and v at the step's end.
        """
        more, number = step.notation.more, step.notation.number
        means = ["u", *ago("u", range(1, len(self.alpha) - 2))]
        beta, c = self.beta, self.velocity
        step.lines += [
            f"u = {plus('v', [-x for x in c], forces, number)}",
            f"mean = {plus(combination(self.means, means, number), beta[1:], forces[: len(beta) - 1], number)}",
        ]
        if self.implicit:
            share = number(beta[0])
            step.lines += [
                f"a_new = solve_stage(t + h, q + h*mean, v, {share}*h*h, h - h{more})",
                f"u_new = mean + {share}*h*a_new",
                "q_new = q + h*u_new",
            ]
        else:
            step.lines += ["u_new = mean", "q_new = q + h*u_new", f"a_new = acceleration(t + h, q_new, v{more})"]
        step.line(f"v_new = {plus('u_new', c, ['a_new', *forces[:-1]], number)}")
        return ["q_new", "v_new"]

    def _ends_from_increments(self, step: StepLines, forces: Sequence[str]) -> list[str]:
        """Append the source lines of a step whose history holds one mean velocity ``(q_n - q_(n-1))/h``.

        That mean velocity follows from v, so that q and v are advanced by increments. ``forces`` are the names of the
        history's accelerations. Returns the names of q and v at the step's end.
        """
        more, number = step.notation.more, step.notation.number
        beta, c = [*self.beta, *[Fraction(0)] * (len(forces) + 1 - len(self.beta))], self.velocity
        speeds = increment([x - y for x, y in zip(beta[1:], c, strict=True)], forces)
        mean = term(1, "v") + speeds
        if self.implicit:
            place = step.sum("q", times_step(mean))
            step.line(f"a_new = solve_stage(t + h, {place}, v, {number(beta[0])}*h*h, h - h{more})")
            step.advance("q", times_step(mean + term(beta[0], "h", "a_new")), "q_new")
        else:
            step.advance("q", times_step(mean), "q_new")
            step.line(f"a_new = acceleration(t + h, q_new, v{more})")
        weights = [c[0] + beta[0], *(x - y + z for x, y, z in zip(beta[1:], c, [*c[1:], Fraction(0)], strict=True))]
        step.advance("v", increment(weights, ["a_new", *forces]), "v_new")
        return ["q_new", "v_new"]


def _stoermer(order: int, *beta: str) -> SecondOrder:
    """Return Störmer's explicit method of this order; ``beta`` are the coefficients of its forces, newest first."""
    return SecondOrder(
        name=f"stoermer{order}",
        order=order,
        source=f"Störmer 1907, Arch. Sci. Phys. Nat. 24, 5; {HNW}, III.10",
        summary=f"explicit, from the last {order} forces: for velocity-free forces, one evaluation per step",
        alpha=exact(1, -2, 1),
        beta=exact(0, *beta),
        starter=starter_of(order),
    )


def _mirrored(*half: str) -> tuple[Fraction, ...]:
    """Return a symmetric row of coefficients from its first half, up to and including the middle coefficient."""
    return exact(*half, *half[-2::-1])


def _symmetric(name: str, order: int, source: str, alpha: str, beta: str, scale: int) -> SecondOrder:
    """Return a symmetric method from the first halves of its coefficients; ``scale`` divides those of forces."""
    return SecondOrder(
        name=name,
        order=order,
        source=source,
        summary=f"symmetric, {2 * len(alpha.split()) - 2} steps, one force per step: for short steps without drag",
        alpha=_mirrored(*alpha.split()),
        beta=tuple(x / scale for x in _mirrored(*beta.split())),
        starter=extrapolated_midpoint(order + 2),
    )


STOERMER = (
    _stoermer(3, "13/12", "-1/6", "1/12"),
    _stoermer(4, "7/6", "-5/12", "1/3", "-1/12"),
    _stoermer(5, "299/240", "-11/15", "97/120", "-2/5", "19/240"),
    _stoermer(6, "317/240", "-133/120", "187/120", "-23/20", "109/240", "-3/40"),
    SecondOrder(
        name="numerov",
        aliases=("cowell4",),
        order=4,
        source=f"Numerov 1924, Mon. Not. R. Astron. Soc. 84, 592; {HNW}, III.10",
        summary="implicit, from the new force and the last two: for velocity-free forces",
        alpha=exact(1, -2, 1),
        beta=exact("1/12", "5/6", "1/12"),
        starter=RK4,
    ),
)

QT, Q = "Quinlan & Tremaine 1990, Astron. J. 100, 1694", "Quinlan 1999, arXiv:astro-ph/9901136"
SYMMETRIC = (
    _symmetric("quinlan_tremaine8", 8, QT, "1 -2 2 -1 0", "0 17671 -23622 61449 -50516", 12096),
    _symmetric("quinlan8a", 8, Q, "1 -2 2 -2 2", "0 22081 -29418 75183 -75212", 15120),
    _symmetric("quinlan8b", 8, Q, "1 0 0 -1/2 -1", "0 192481 6582 816783 -156812", 120960),
    _symmetric(
        "quinlan_tremaine10", 10, QT, "1 -1 1 -1 1 -2", "0 399187 -485156 2391436 -2816732 4651330", 241920),
    _symmetric(
        "quinlan_tremaine12", 12, QT, "1 -2 2 -1 0 0 0",
        "0 90987349 -229596838 812627169 -1628539944 2714971338 -3041896548", 53222400,
    ),
    _symmetric(
        "quinlan_tremaine14", 14, QT, "1 -2 2 -1 0 0 0 0",
        "0 433489274083 -1364031998256 5583113380398 -14154444148720 28630585332045 -42056933842656 48471792742212",
        237758976000,
    ),
)
