"""Define your own effect: the stiffness of the wire as a torsion spring, which then works in all methods and audits."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pendulum_env import SCENES, Scene, audit, rollout
from pendulum_env.lab import period
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.units import si


def stiffness(angle: float, stiffness_rate: float) -> float:
    return -stiffness_rate * angle


def stiffness_by_angle(stiffness_rate: float) -> float:
    return -stiffness_rate


def stiffness_potential(angle: float, stiffness_rate: float) -> float:
    return 0.5 * stiffness_rate * angle * angle


@dataclass(frozen=True)
class Stiffness(Effect):
    """Torsion spring at the pivot, with the torque -k theta."""

    spring: float = si(0.001, "N m/rad", "torque over angle", least=0.0)

    name = "stiffness"
    kind = "conservative"
    periodic = False
    equation = "- {stiffness_rate:.6g} theta"
    source = "Hooke 1678, De Potentia Restitutiva"
    torque = staticmethod(stiffness)
    by_angle = staticmethod(stiffness_by_angle)
    potential = staticmethod(stiffness_potential)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"stiffness_rate": self.spring / scene.inertia}


exercise = SCENES["exercise"]
scene = exercise.with_effects((*exercise.effects, Stiffness()))
print(scene.equation())

run = rollout(scene, duration=20.0, integrator="gauss6")
expected = 2.0 * math.pi / math.sqrt(exercise.omega0**2 + 0.001 / scene.inertia)
print(f"The period is {period(run).value:.5f} s, by formula {expected:.5f} s.")
assert abs(period(run).value / expected - 1.0) < 1e-6
assert abs(run.energy_residual).max() < 1e-12 * run.energy[0]

(row,) = audit(scene, amplitude=0.1, tolerance=1e-3, effects=["stiffness"]).rows
print(f"It changes the period by {row.period_change:+.2e}: {row.verdict}.")
assert abs(row.period_change - (expected * exercise.omega0 / (2.0 * math.pi) - 1.0)) < 1e-6
