"""Energy balance of a run: energies, work, heat and their residual. Its two formulas work on arrays and are also copied
into generated programs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

ABSURD = 100.0
"""A residual above this multiple of ``m g L + |E0| + |work|`` counts as divergence, even though all values are finite.
"""


def residual_of(energy: Any, initial: Any, work: Any, heat: Any) -> Any:
    """Return the energy residual [J]: the change of energy that neither work nor heat explains."""
    return (energy - initial) - work + heat


def beyond_sense(residual: Any, scale: Any, initial: Any, work: Any) -> Any:
    """Return True where an energy residual is so large that the run counts as diverged; ``scale`` is ``m g L`` [J]."""
    return abs(residual) > ABSURD * (scale + abs(initial) + abs(work))


@dataclass(frozen=True)
class Ledger:
    """The energy balance ``energy(t) - energy(0) = work - heat + residual``, in joules; floats, or arrays over time.

    The method integrates work and heat as quadratures along with the motion. The residual is the error in the energy
    balance: the change of energy that neither drives nor dissipation explain. It is no bound of the error in the angle.

    Attributes:
        kinetic: kinetic energy ``I v**2 / 2``.
        potential: potential energy, zero at the bottom.
        work: work done by the drives since the start.
        heat: energy dissipated since the start; negative only through the error of too long steps of a method that has
            negative weights or sub-steps.
        initial: energy at the start.
    """

    kinetic: Any
    potential: Any
    work: Any
    heat: Any
    initial: Any

    @property
    def energy(self) -> Any:
        """Return the kinetic plus the potential energy [J]."""
        return self.kinetic + self.potential

    @property
    def residual(self) -> Any:
        """Return the energy residual [J]: the change of energy that neither work nor heat explains."""
        return residual_of(self.energy, self.initial, self.work, self.heat)

    def absurd(self, scale: float) -> Any:
        """Return True where the energy residual is so large that the run diverged; ``scale`` is ``m g L`` [J]."""
        return beyond_sense(self.residual, scale, self.initial, self.work)
