"""The discrete gradient method, which conserves the energy to round-off with steps of any length.

With one degree of freedom the methods of Gonzalez, of Itoh & Abe and of the average vector field (Quispel & McLaren
2008, J. Phys. A 41, 045206) are identical. With coupled components they differ; the method is then that of the average
vector field, and the names of the others are refused::

    w = (v + v1)/2        q1 = q + h w        v1 = v + h (F(q, q1) + N(t + h/2, (q + q1)/2, w))

F is the mean of the conservative force between the two angles: minus the difference of the potential, divided by the
difference of the angles. N is the sum of all other forces at the middle of the step. In short steps the quotient would
lose digits by cancellation, so the problem gives F in closed form: for gravity ``-omega0**2 sin(q) sin(s)/s``, where q
is the middle angle and s half the difference. The kinetic energy changes by ``h w (F + N)``. If the powers of heat and
work are those at the middle, energy plus heat minus work is therefore conserved too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, ClassVar

from integrators.families.runge_kutta import RungeKutta
from integrators.method import Acceleration, Method, MethodError, Polynomial, System, exact
from integrators.steps.arrays import mean_force_step
from integrators.steps.newton import one_stage
from integrators.steps.terms import Notation, term
from integrators.tables.implicit import GAUSS8

HALF = Fraction(1, 2)
Mean = Callable[[Any, Any, Any, Any], Any]


@dataclass(frozen=True, kw_only=True)
class DiscreteGradient(Method):
    """The discrete gradient method: an implicit step with the mean of the force between the old and the new angle.

    Raises MethodError for an order above 2, which it does not have.
    """

    family: ClassVar[str] = "energy-preserving"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.order > 2:
            raise MethodError(f"{self.name}: a discrete gradient method has order 2, not {self.order} as declared.")

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "mean"})

    @property
    def implicit(self) -> bool:
        return True

    @property
    def evaluations(self) -> int:
        return 1

    @property
    def symplectic(self) -> bool:
        """False, as a method that conserves the energy cannot be symplectic unless it is exact (Ge & Marsden 1988)."""
        return False

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def linear_twin(self) -> RungeKutta:
        """The implicit midpoint rule under the name of the discrete gradient method, for analysis on linear problems.

        Both methods take equal steps where forces are linear.
        """
        return RungeKutta(
            name=self.name, order=2, source=self.source, summary=self.summary, a=(exact("1/2"),), b=exact(1)
        )

    @property
    def stability_polynomials(self) -> tuple[Polynomial, Polynomial]:
        return self.linear_twin.stability_polynomials

    @property
    def keeps_energy(self) -> bool:
        return True

    def one_freedom(self, name: str) -> bool:
        return name in ("gonzalez", "itoh_abe")

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        return (*(("rates",) if quadratures else ()), "mean_acceleration", "mean_jacobian")

    def array_step(
        self, system: System, dense: bool, increments: bool, estimates: bool = False
    ) -> Callable[..., tuple[Any, ...]]:
        return mean_force_step(system, increments)

    def write_step(self, notation: Notation) -> str:
        quadratures, more = notation.quadratures, notation.more
        step = notation.new_step()
        step.line(f"a = solve_stage(t + 0.5*h, q, v, 0.5*h{more})")
        step.line(f"w = {step.sum('v', term(HALF, 'h', 'a'))}")
        if quadratures:
            middle = step.sum("q", term(HALF, "h", "w"))
            step.line(f"{', '.join(['_', *quadratures])} = rates(t + 0.5*h, {middle}, w{more})")
        ends = [step.end("q", term(1, "h", "w")), step.end("v", term(1, "h", "a"))]
        return one_stage(more, mean=True, refines=notation.refines) + step.source(
            self.title, ends, increments=[f"h*{name}" for name in quadratures])


ENERGY_PRESERVING = (
    DiscreteGradient(
        name="discrete_gradient",
        aliases=("gonzalez", "itoh_abe", "average_vector_field"),
        order=2,
        a_stable=True,
        source="Gonzalez 1996, J. Nonlinear Sci. 6, 449; Itoh & Abe 1988, J. Comput. Phys. 76, 85",
        summary="implicit: mean force between old and new angle; conserves the energy to round-off",
    ),
)


def averaged(acceleration: Acceleration) -> tuple[Mean, Mean]:
    """Return the functions ``mean_acceleration`` and ``mean_jacobian`` of a System, from a plain acceleration.

    Means are Gauss quadratures of four nodes, exact for polynomials of degree 7, and derivatives are central
    differences. The discrete gradient method then conserves the energy up to the error of the quadrature.
    """
    nodes = [(2 * c - 1, b) for c, b in zip(GAUSS8.c, GAUSS8.b, strict=True)]
    rounded = [(float(c), float(b)) for c, b in nodes]

    def mean(t: Any, q: Any, v: Any, spread: Any) -> Any:
        plain = isinstance(spread, float) or hasattr(spread, "dtype")
        one = 1 if plain else spread - spread + 1
        places = rounded if plain else [
            (one * c.numerator / c.denominator, one * b.numerator / b.denominator) for c, b in nodes
        ]
        return sum(b * acceleration(t, q + c * spread, v) for c, b in places)

    def jacobian(t: Any, q: Any, v: Any, spread: Any) -> tuple[Any, Any]:
        dq, dv = 1e-5 * (1 + abs(q)), 1e-5 * (1 + abs(v))
        return (
            (mean(t, q + dq, v, spread + dq) - mean(t, q - dq, v, spread - dq)) / (2 * dq),
            (mean(t, q, v + dv, spread) - mean(t, q, v - dv, spread)) / (2 * dv),
        )

    return mean, jacobian
