"""Splitting methods: compositions of kicks, drifts, exact drag flows, and pushes (kicks that include drag)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate, groupby
from typing import ClassVar

from integrators.method import Method, MethodError, rational, total
from integrators.steps.terms import Notation, Terms, begin_with_force, fraction_of, term, time_at

KICK, DRIFT, DRAG, PUSH = KINDS = ("kick", "drift", "drag", "push")
"""Names of sub-flows: a kick is v += h f(t, q), a drift q += h v, a drag the exact flow of dissipation, a push
v += h a(t, q, v)."""


@dataclass(frozen=True, kw_only=True)
class Splitting(Method):
    """A splitting method: sub-flows that are applied from left to right, each over a fraction c of the step.

    ``kick``: ``v += c h f(t, q)``; ``drift``: ``q += c h v``, and the time advances by c h; ``drag``: the exact flow of
    the dissipation, left out if there is none; ``push``: ``v += c h a(t, q, v)``, a kick that includes drag. Raises
    MethodError if a sub-flow is unknown or if kicks, drifts or drags do not sum to one whole step.

    Attributes:
        flows: pairs of a kind of sub-flow and its fraction of the step.
        nystrom: True if the order holds only for velocity-free forces, for which there are fewer order conditions
            (Sanz-Serna & Calvo 1994, section 7.3). Such a method has no drags and cannot be used with damping.
    """

    flows: tuple[tuple[str, Fraction], ...]
    nystrom: bool = False

    family: ClassVar[str] = "splitting"

    def __post_init__(self) -> None:
        super().__post_init__()
        flows = tuple((kind, *rational(parts, f"{self.name}: {kind}")) for kind, *parts in self.flows)
        object.__setattr__(self, "flows", flows)
        for kind, _ in self.flows:
            if kind not in KINDS:
                raise MethodError(f"{self.name}: unknown sub-flow '{kind}'; choose from {', '.join(KINDS)}.")
        sums = [total(part for kind, part in self.flows if kind in kinds)
                for kinds in ((DRIFT,), (KICK, PUSH), (DRAG, PUSH))]
        if any(whole != 1 for whole in (sums[:2] if self.nystrom else sums)):
            text = ", ".join(map(str, sums))
            raise MethodError(f"{self.name}: drifts, kicks and drags must each sum to 1, not to {text}.")
        if self.nystrom and any(kind in (DRAG, PUSH) for kind, _ in self.flows):
            raise MethodError(f"{self.name}: a method for velocity-free forces must not contain drags or pushes.")

    def _kinds(self) -> list[str]:
        """Return the kinds of a splitting's sub-flows (kick, drift, push) in their order, without drags."""
        return [kind for kind, _ in self.flows if kind != DRAG]

    @property
    def memory(self) -> tuple[str, ...]:
        """The memory of a splitting: ``a``, the force at the end of a step, if steps begin and end with a kick.

        The next step begins with this force.
        """
        return ("a",) if self._kinds()[0] == KICK == self._kinds()[-1] else ()

    @property
    def needs(self) -> frozenset[str]:
        if self.nystrom:
            return frozenset({"acceleration", "velocity_free"})
        if any(kind == PUSH for kind, _ in self.flows):
            return frozenset({"acceleration"})
        backwards = any(fraction < 0 for _, fraction in self.flows)
        return frozenset({"acceleration", "split", *(("reversible",) if backwards else ())})

    @property
    def evaluations(self) -> int:
        count, known = 0, bool(self.memory)
        for kind in self._kinds():
            count += kind == PUSH or (kind == KICK and not known)
            known = kind == KICK
        return count

    @property
    def last_drift(self) -> float:
        """Fraction of the step by which the last drift moves the angle, if no kick follows it."""
        kind, fraction = next(flow for flow in reversed(self.flows) if flow[0] != DRAG)
        return float(fraction) if kind == DRIFT else 0.0

    @property
    def symplectic(self) -> bool:
        """True, as exact flows of Hamiltonians compose to a symplectic map.

        With drag the map is conformally symplectic: it multiplies all areas by one factor.
        """
        return True

    @property
    def symmetric(self) -> bool:
        return self.flows == self.flows[::-1]

    @property
    def sub_flows(self) -> tuple[tuple[str, Fraction], ...]:
        return self.flows

    def calls(self, quadratures: bool, adaptive: bool) -> tuple[str, ...]:
        pushes = any(kind == PUSH for kind, _ in self.flows)
        return ("acceleration", "push") if pushes else ("force", "kick", "drag")

    @property
    def drag_limit(self) -> float | None:
        """The damping limit of a splitting: infinity with exact drag flows, else None (computed from the step)."""
        return math.inf if "split" in self.needs else None

    @property
    def furthest_back(self) -> float:
        runs = groupby(self.flows, key=lambda flow: flow[0])
        return float(min(0, *accumulate(sum(part for _, part in same) for kind, same in runs if kind == DRAG)))

    def write_step(self, notation: Notation) -> str:
        """Return the source of the functions ``begin`` and ``step`` of a splitting method.

        The problem's functions ``kick``, ``drag`` and ``push`` return the increments of quadratures (integrals carried
        along the step, such as work). Raises MethodError if none of them adds to a quadrature.
        """
        hooks, more, number = notation.hooks, notation.more, notation.number
        step = notation.new_step()
        apart = (PUSH,) if notation.exact_drag else (PUSH, DRAG)
        flows = _joined([flow for flow in self.flows if flow[0] != DRAG or "drag" in hooks], apart)
        counted: set[str] = set()
        stored = hooks.get("store", ())
        start = ", start" if stored else ""
        if stored:
            step.line("start = q")
        elapsed, fresh = Fraction(0), bool(self.memory)

        def call(function: str, arguments: str, change: Terms = ()) -> None:
            """Append the call of a problem's function such as ``kick``, and the lines that sum its increments.

            These are increments of quadratures (integrals carried along the step, such as work). The first one of a
            quadrature starts its sum.
            """
            parts = hooks[function]
            step.flow(function, arguments, [f"d_{name}" for name in parts], change)
            for name in parts:
                step.line(f"{name} = {name} + d_{name}" if name in counted else f"{name} = d_{name}")
                counted.add(name)

        for kind, fraction in flows:
            t, h = time_at(elapsed, number), fraction_of(fraction, number)
            if kind == DRIFT:
                step.advance("q", term(fraction, "h", "v"))
                elapsed += fraction
                fresh = False
            elif kind == DRAG:
                call("drag", f"{t}, q, v, {h}")
            else:
                if kind == PUSH:
                    step.line(f"a = acceleration({t}, q, v{more})")
                elif not fresh:
                    step.line(f"a = force({t}, q{more})")
                fresh = kind != PUSH
                change = term(fraction, "h", "a")
                if kind in hooks:
                    call(kind, f"{t}, q, v, a, {h}{start}", change)
                else:
                    step.advance("v", change)
        for name in stored:
            step.line(f"{name} = {name} - (store(t + h, q{more}) - store(t + h, start{more}))")
        missing = [name for name in notation.quadratures if name not in counted]
        if missing:
            raise MethodError(
                f"{self.name}: no sub-flow integrates {', '.join(missing)}; a function for this is missing in hooks.")
        begin = begin_with_force(more) if self.memory else ""
        memory = {name: name for name in self.memory}
        return begin + step.source(self.title, ["q", "v"], memory, notation.quadratures)


def _joined(flows: Sequence[tuple[str, Fraction]], apart: Sequence[str]) -> list[tuple[str, Fraction]]:
    """Return sub-flows of a splitting with neighbours of one kind combined, except for the kinds in ``apart``."""
    joined: list[tuple[str, Fraction]] = []
    for kind, fraction in flows:
        if joined and joined[-1][0] == kind and kind not in apart:
            joined[-1] = (kind, joined[-1][1] + fraction)
        else:
            joined.append((kind, fraction))
    return joined
