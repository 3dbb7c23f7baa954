"""The ledger: where every joule went."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

ABSURD = 100.0
"""A residual beyond this many times ``m g L + |E0| + |work|`` is finite nonsense, and counts as divergence."""


@dataclass(frozen=True)
class Ledger:
    """``energy(t) - energy(0) = work - heat + residual``, in joules; floats, or arrays over time.

    Work and heat are integrated beside the motion by the method itself, so the residual is the integrator's own
    error: it is what the energy did that neither the drives nor the dissipation account for.

    Attributes:
        kinetic: ``I v**2 / 2``.
        potential: zero at the bottom.
        work: done by the drives since the start.
        heat: dissipated since the start, never negative.
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
        return (self.energy - self.initial) - self.work + self.heat

    def absurd(self, scale: float) -> Any:
        """True where the residual is beyond any sense; ``scale`` is ``m g L`` [J]."""
        return abs(self.residual) > ABSURD * (scale + abs(self.initial) + abs(self.work))
