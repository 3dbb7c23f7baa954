"""The ledger: where every joule went. The two formulas serve arrays and are copied into generated programs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

ABSURD = 100.0
"""A residual beyond this many times ``m g L + |E0| + |work|`` is finite nonsense, and counts as divergence."""


def residual_of(energy: Any, initial: Any, work: Any, heat: Any) -> Any:
    """What the integrator added or lost: what neither the drives nor the dissipation account for [J]."""
    return (energy - initial) - work + heat


def beyond_sense(residual: Any, scale: Any, initial: Any, work: Any) -> Any:
    """True where a residual is finite nonsense; ``scale`` is ``m g L`` [J]."""
    return abs(residual) > ABSURD * (scale + abs(initial) + abs(work))


@dataclass(frozen=True)
class Ledger:
    """``energy(t) - energy(0) = work - heat + residual``, in joules; floats, or arrays over time.

    Work and heat are integrated beside the motion by the method itself, so the residual is the integrator's own
    error: it is what the energy did that neither the drives nor the dissipation account for.

    Attributes:
        kinetic: ``I v**2 / 2``.
        potential: zero at the bottom.
        work: done by the drives since the start.
        heat: dissipated since the start; below 0 only by the error of steps too long for a method whose weights or
            sub-steps are not all positive.
        initial: energy at the start.
    """

    kinetic: Any
    potential: Any
    work: Any
    heat: Any
    initial: Any

    @property
    def energy(self) -> Any:
        """Kinetic plus potential energy."""
        return self.kinetic + self.potential

    @property
    def residual(self) -> Any:
        """What the integrator added or lost."""
        return residual_of(self.energy, self.initial, self.work, self.heat)

    def absurd(self, scale: float) -> Any:
        """True where the residual is beyond any sense; ``scale`` is ``m g L`` [J]."""
        return beyond_sense(self.residual, scale, self.initial, self.work)
