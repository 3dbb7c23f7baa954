"""Methods of structural dynamics: Newmark's method and the alpha methods that generalise it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from integrators.families.multistep import Multistep, ago, closed, product
from integrators.method import Acceleration, History, MethodError, Polynomial
from integrators.steps.newton import one_stage
from integrators.steps.terms import Notation, StepLines, combination, increment, term, time_at, times_step

HALF = Fraction(1, 2)


@dataclass(frozen=True, kw_only=True)
class GeneralizedAlpha(Multistep):
    """The generalized-alpha method, which advances an acceleration ``a`` besides q and v (Chung & Hulbert 1993).

    The force is taken once, at the averaged angle and velocity. Chung & Hulbert state the method for linear forces,
    where this is the average of the forces at both ends; :class:`MeanForceAlpha` averages the forces themselves. Kuhl &
    Crisfield 1999, Int. J. Numer. Methods Eng. 45, 569, call the two the generalised midpoint and trapezoidal rules.

    After some steps ``a`` approximates the acceleration at ``t + lag h``, ``lag = alpha_m - alpha_f`` (Jansen, Whiting
    & Hulbert 2000, Comput. Methods Appl. Mech. Eng. 190, 305). The first step begins with the acceleration at t::

        q1 = q + h v + h**2 ((1/2 - beta) a + beta a1)        v1 = v + h ((1 - gamma) a + gamma a1)
        (1 - alpha_m) a1 + alpha_m a = f(t + (1 - alpha_f) h, Q, V),   Q = (1 - alpha_f) q1 + alpha_f q, V likewise

    Raises MethodError unless ``gamma = 1/2 - alpha_m + alpha_f``, the condition of order 2.
    """

    alpha_m: Fraction
    alpha_f: Fraction
    beta: Fraction
    gamma: Fraction

    family: ClassVar[str] = "structural dynamics"
    power: ClassVar[int] = 2

    coefficients: ClassVar[tuple[str, ...]] = ("alpha_m", "alpha_f", "beta", "gamma")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.gamma != HALF - self.alpha_m + self.alpha_f:
            raise MethodError(f"{self.name}: gamma must be 1/2 - alpha_m + alpha_f, not {self.gamma}.")

    @property
    def memory(self) -> tuple[str, ...]:
        return self.memory_with()

    def memory_with(self, quadratures: Sequence[str] = ()) -> tuple[str, ...]:
        return ("a", *ago(quadratures, (0,)))

    @property
    def implicit(self) -> bool:
        return True

    @property
    def beginning(self) -> int:
        return 1

    @property
    def lag(self) -> Fraction:
        """The time, in steps, from the state to the time that the method's stored acceleration ``a`` belongs to.

        It settles to this value after some steps; at the start ``a`` is the acceleration of the initial state.
        """
        return self.alpha_m - self.alpha_f

    def settled_memory(
        self, t: Any, q: Any, v: Any, h: Any, acceleration: Acceleration, history: History
    ) -> tuple[Any, ...]:
        """Return the value that the method's own acceleration ``a`` settles to after many steps, up to ``O(h**2)``.

        It is the acceleration at the time ``t + lag h``.
        """
        lag = h * self.lag.numerator / self.lag.denominator
        a = acceleration(t, q, v)
        return (acceleration(t + lag, q + lag * v, v + lag * a) if self.lag else a,)

    @property
    def explicit_first_stage(self) -> bool:
        """True, as work and heat are integrated by the trapezoidal rule, with their rates at the step's start."""
        return True

    @property
    def symmetric(self) -> bool:
        return self.gamma == HALF and not self.alpha_f

    @property
    def shifts(self) -> tuple[Polynomial, Polynomial]:
        """Weights of old and new values in the equation of a generalized-alpha step, as two polynomials.

        The first is for the method's acceleration ``a``, the second for the state.
        """
        return (self.alpha_m, 1 - self.alpha_m), (self.alpha_f, 1 - self.alpha_f)

    @property
    def characteristic(self) -> tuple[Polynomial, ...]:
        mass, place = self.shifts
        back = (Fraction(-1), Fraction(1))
        speed, way = (1 - self.gamma, self.gamma), product((HALF - self.beta, self.beta), back)
        total = tuple(x + y for x, y in zip((*speed, Fraction(0)), way, strict=True))
        return product(mass, product(back, back)), tuple(-x for x in product(place, total))

    @property
    def characteristic_of_drag(self) -> tuple[Polynomial, ...]:
        mass, place = self.shifts
        back, speed = (Fraction(-1), Fraction(1)), (1 - self.gamma, self.gamma)
        return product(mass, back), tuple(-x for x in product(place, speed))

    def write_step(self, notation: Notation) -> str:
        more, number = notation.more, notation.number
        part, old = 1 - self.alpha_f, self.alpha_m
        new = 1 / (1 - old)
        by_q, by_v = HALF - self.beta - self.beta * old * new, 1 - self.gamma - self.gamma * old * new
        step = notation.new_step()
        middle = term(1, "v") + increment([by_q], ["a"])
        place = step.sum("q", term(part, "h", middle))
        speed = step.sum("v", increment([part * by_v], ["a"]))
        lengths = f"{number(part * self.beta * new)}*h*h, {number(part * self.gamma * new)}*h"
        step.line(f"k = solve_stage({time_at(part, number)}, {place}, {speed}, {lengths}{more})")
        step.line(f"a_new = {combination([new, -old * new], ['k', 'a'], number)}")
        return self.finish(step, ["a_new"])

    def finish(self, step: StepLines, kept: Sequence[str]) -> str:
        """Append the lines after that of ``a_new``; return the step's source with ``begin`` and Newton's method.

        Args:
            step: the lines so far.
            kept: the names of the memory at the step's end, without those of quadratures.
        """
        both, notation = ("a", "a_new"), step.notation
        speeds = increment([HALF - self.beta, self.beta], both)
        step.advance("q", times_step(term(1, "v") + speeds), "q_new")
        step.advance("v", increment([1 - self.gamma, self.gamma], both), "v_new")
        rates, increments = closed(step, 2)
        slopes = ", ".join(["a", *ago(notation.quadratures, (0,))])
        begin = [f"return {notation.slope}(t, q, v{notation.more})"]
        if len(kept) > 1:
            begin = [f"{slopes} = {notation.slope}(t, q, v{notation.more})", f"return a, {slopes}"]
        return one_stage(notation.more, apart=True, refines=notation.refines) + self.define(
            begin, step, ["q_new", "v_new"], [*kept, *rates], increments)


@dataclass(frozen=True, kw_only=True)
class MeanForceAlpha(GeneralizedAlpha):
    """The generalized-alpha method with the average of the forces at both ends of the step.

    The steps of angle and velocity are those of :class:`GeneralizedAlpha`; the acceleration ``a1`` obeys::

        (1 - alpha_m) a1 + alpha_m a = (1 - alpha_f) f(t + h, q1, v1) + alpha_f f(t, q, v)

    With ``alpha_m = 0`` this is the average ``(1 + alpha) f1 - alpha f0`` of Hilber, Hughes & Taylor 1977, where
    ``alpha = -alpha_f``. Under linear forces that do not depend on time, the two classes give the same motion.
    """

    def memory_with(self, quadratures: Sequence[str] = ()) -> tuple[str, ...]:
        return ("a", "f", *ago(quadratures, (0,)))

    def settled_memory(
        self, t: Any, q: Any, v: Any, h: Any, acceleration: Acceleration, history: History
    ) -> tuple[Any, ...]:
        """Return ``a`` after many steps, with an error of ``O(h**2)``, and the force."""
        return (*super().settled_memory(t, q, v, h, acceleration, history), acceleration(t, q, v))

    def write_step(self, notation: Notation) -> str:
        more, number = notation.more, notation.number
        old, part = self.alpha_m, 1 - self.alpha_f
        new = 1 / (1 - old)
        forces = [part * new, self.alpha_f * new, -old * new]
        step = notation.new_step()
        step.line(f"known = {combination(forces[1:], ['f', 'a'], number) or 'a - a'}")
        place = step.sum("q", times_step(term(1, "v") + increment([HALF - self.beta, self.beta], ("a", "known"))))
        speed = step.sum("v", increment([1 - self.gamma, self.gamma], ("a", "known")))
        lengths = f"{number(self.beta * forces[0])}*h*h, {number(self.gamma * forces[0])}*h"
        step.line(f"f_new = solve_stage(t + h, {place}, {speed}, {lengths}{more})")
        step.line(f"a_new = known + {combination(forces[:1], ['f_new'], number)}")
        return self.finish(step, ["a_new", "f_new"])


def chung_hulbert(radius: Fraction) -> dict[str, Any]:
    """Return the parameters of the generalized-alpha method with this spectral radius for infinitely long steps.

    Chung & Hulbert 1993, equations 17 and 25.
    """
    alpha_m, alpha_f = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    lag = alpha_f - alpha_m
    return {"alpha_m": alpha_m, "alpha_f": alpha_f, "beta": (1 + lag) ** 2 / 4, "gamma": HALF + lag}


def hilber_hughes_taylor(alpha: Fraction) -> dict[str, Any]:
    """Return the parameters of the method of Hilber, Hughes & Taylor with this alpha, from -1/3 to 0."""
    zero = Fraction(0)
    return {"alpha_m": zero, "alpha_f": -alpha, "beta": (1 - alpha) ** 2 / 4, "gamma": HALF - alpha}


STRUCTURAL = (
    GeneralizedAlpha(
        name="newmark_linear",
        aliases=("linear_acceleration",),
        order=2,
        source="Newmark 1959, J. Eng. Mech. Div. ASCE 85 (EM3), 67: beta = 1/6, gamma = 1/2",
        summary="acceleration linear over the step; stable up to omega0 h = 2 sqrt(3)",
        alpha_m=Fraction(0),
        alpha_f=Fraction(0),
        beta=Fraction(1, 6),
        gamma=HALF,
    ),
    GeneralizedAlpha(
        name="hht_alpha",
        aliases=("hilber_hughes_taylor",),
        order=2,
        a_stable=True,
        source="Hilber, Hughes & Taylor 1977, Earthq. Eng. Struct. Dyn. 5, 283: alpha = -1/10",
        summary="force at the averaged state, alpha = -0.1: damps motion that the step does not resolve",
        **hilber_hughes_taylor(Fraction(-1, 10)),
    ),
    GeneralizedAlpha(
        name="generalized_alpha",
        aliases=("chung_hulbert",),
        order=2,
        a_stable=True,
        source="Chung & Hulbert 1993, J. Appl. Mech. 60, 371: radius at infinity 4/5",
        summary="force at the averaged state, spectral radius 0.8 at infinity: damps mainly fast motion",
        **chung_hulbert(Fraction(4, 5)),
    ),
    MeanForceAlpha(
        name="hht_alpha_mean_force",
        order=2,
        a_stable=True,
        source="Hilber, Hughes & Taylor 1977, Earthq. Eng. Struct. Dyn. 5, 283: alpha = -1/10",
        summary="like hht_alpha with the average of the forces at both ends, as published",
        **hilber_hughes_taylor(Fraction(-1, 10)),
    ),
    MeanForceAlpha(
        name="generalized_alpha_mean_force",
        order=2,
        a_stable=True,
        source="Chung & Hulbert 1993, J. Appl. Mech. 60, 371: radius at infinity 4/5",
        summary="like generalized_alpha with the average of the forces at both ends",
        **chung_hulbert(Fraction(4, 5)),
    ),
)
