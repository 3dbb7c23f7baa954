"""Force-gradient splittings: kicks that use the derivative of the force, for order 4 with positive sub-steps only.

A kick over the part b of a step, with ``f' = df/dq``::

    v += b h (f + c h**2 f f')

is the exact flow of the potential minus ``c h**2 f**2/2``, since [V, [T, V]] is the square of the force. It therefore
preserves areas. The order holds only for forces that do not depend on the velocity. With coupled components ``f f'`` is
the derivative of f along f, so that no matrix is needed.

The work of a drive u(t, q), with the power u v, gets a correction from the same commutator: its rate in such a kick is
``v u + (c h**2/2) (v (3 f du/dq - u f') + f du/dt - u df/dt)``, so that the work has the order of the method.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from integrators.families.splitting import DRIFT, KICK
from integrators.method import Method, MethodError, rational
from integrators.steps.terms import Notation, begin_with_force, fraction_of, term, time_at


@dataclass(frozen=True, kw_only=True)
class ForceGradient(Method):
    """A splitting of alternating kicks and drifts, a kick first and last; inner kicks may use the force's gradient.

    Raises MethodError unless the kicks sum to one step, and the drifts too.

    Attributes:
        flows: tuples of kind, fraction of the step and the coefficient c, which is 0 for drifts and plain kicks.
    """

    flows: tuple[tuple[str, Fraction, Fraction], ...]

    family: ClassVar[str] = "force gradient"

    def __post_init__(self) -> None:
        super().__post_init__()
        flows = tuple((kind, *rational(parts, f"{self.name}: {kind}")) for kind, *parts in self.flows)
        object.__setattr__(self, "flows", flows)
        for kind, parity in ((KICK, 0), (DRIFT, 1)):
            total = sum((fraction for _, fraction, _ in self.flows[parity::2]), Fraction(0))
            if total != 1 or any(flow[0] != kind for flow in self.flows[parity::2]) or self.flows[-1][0] != KICK:
                raise MethodError(f"{self.name}: kicks and drifts must alternate, with a kick first and last, and each "
                                  f"kind must sum to 1; the {kind}s sum to {total}.")
        if any(c for kind, _, c in (self.flows[0], self.flows[-1])) or any(c for _, _, c in self.flows[1::2]):
            raise MethodError(
                f"{self.name}: only kicks between the first and the last one may have a gradient; set c = 0 elsewhere.")

    @property
    def memory(self) -> tuple[str, ...]:
        """The memory of a force-gradient method: ``a``, the acceleration at the end of a step.

        The next step begins with it.
        """
        return ("a",)

    @property
    def needs(self) -> frozenset[str]:
        return frozenset({"acceleration", "velocity_free", "jacobian"})

    @property
    def evaluations(self) -> int:
        """Evaluations in one step of a force-gradient method: of the force, and of its gradient."""
        return len(self.flows) // 2 + sum(bool(c) for _, _, c in self.flows)

    @property
    def symplectic(self) -> bool:
        return True

    @property
    def symmetric(self) -> bool:
        return self.flows == self.flows[::-1]

    @property
    def counted(self) -> tuple[str, ...]:
        return ("jacobian",)

    def one_freedom(self, name: str) -> bool:
        return False

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        return ("force", "jacobian", "gradient_kick")

    def write_step(self, notation: Notation) -> str:
        """Return the source of the functions ``begin`` and ``step`` of a force-gradient method.

        Increments of quadratures (integrals carried along the step, such as work) come from the problem's function
        ``kick``, and in kicks with a gradient from ``gradient_kick``, with ``reach = c h**2``::

            gradient_kick(t, q, v, a, slope, reach, h, *extra) -> (v, *increments)

        Raises MethodError if one of these functions is missing for a quadrature.
        """
        missing = [name for name in notation.quadratures if name not in notation.hooks.get("gradient_kick", ())]
        if missing:
            raise MethodError(
                f"{self.name}: no sub-flow integrates {', '.join(missing)}; a function for this is missing in hooks.")
        hooks, more, number = notation.hooks, notation.more, notation.number
        step = notation.new_step()
        elapsed, fresh = Fraction(0), True
        parts = list(hooks.get("kick", ()))
        increments, first = [f"d_{name}" for name in parts], True
        for kind, fraction, gradient in self.flows:
            t, h = time_at(elapsed, number), fraction_of(fraction, number)
            if kind == DRIFT:
                step.advance("q", term(fraction, "h", "v"))
                elapsed, fresh = elapsed + fraction, False
                continue
            if not fresh:
                step.line(f"a = force({t}, q{more})")
            if gradient:
                step.line(f"slope, _ = jacobian({t}, q, v{more})")
                step.line(f"reach = {number(gradient)}*h*h")
            mean = term(1, "a") + term(1, "reach", "a", "slope")
            change = term(fraction, "h", mean if gradient else "a")
            if not parts:
                step.advance("v", change)
                continue
            if gradient:
                step.flow("gradient_kick", f"{t}, q, v, a, slope, reach, {h}", increments)
            else:
                step.flow("kick", f"{t}, q, v, a, {h}", increments, change)
            for name in parts:
                step.line(f"{name} = d_{name}" if first else f"{name} = {name} + d_{name}")
            first = False
        return begin_with_force(more) + step.source(self.title, ["q", "v"], {"a": "a"}, notation.quadratures)


def _flow(kind: str, fraction: str, gradient: str = "0") -> tuple[str, Fraction, Fraction]:
    """Return one sub-flow of a force-gradient method with exact numbers, from their decimal or fractional text."""
    return kind, Fraction(fraction), Fraction(gradient)


FORCE_GRADIENT = (
    ForceGradient(
        name="chin4a",
        order=4,
        source="Chin 1997, Phys. Lett. A 226, 344, algorithm A",
        summary="two forces and one force gradient: order 4 without negative sub-steps",
        flows=(
            _flow(KICK, "1/6"), _flow(DRIFT, "1/2"), _flow(KICK, "2/3", "1/24"), _flow(DRIFT, "1/2"), _flow(KICK, "1/6")
        ),
    ),
)
