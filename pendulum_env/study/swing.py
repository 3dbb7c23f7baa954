"""Period and amplitude of simulated swings, found between the steps, and the textbook's predictions of their change."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics import exact
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

OSCILLATIONS = 3
"""The period is the mean of so many, from the release on."""
METHOD = "rk4"
POINTS = 6
"""Steps before a turning point that are continued to it by a polynomial; so a jump at the turn does no harm."""


@dataclass(frozen=True)
class Swing:
    """A release from rest.

    Attributes:
        period: mean of the first OSCILLATIONS, release to turning point on the same side [s]; nan if they are not made.
        amplitude: size of the first turning angle on the other side [rad]; nan if there is none.
        time, angle: the run, for what does not swing [s, rad].
    """

    period: float
    amplitude: float
    time: Array
    angle: Array

    @property
    def swings(self) -> bool:
        """True if period and amplitude were found."""
        return math.isfinite(self.period) and math.isfinite(self.amplitude)


def swing(scene: Scene, amplitude: float, steps: int, *, control: float = 0.0, backend: Backend = "auto") -> Swing:
    """Simulate a release at rest from ``amplitude`` [rad], with ``steps`` steps of rk4 per undamped period."""
    period = float(exact.period(amplitude, scene.omega0)) if scene.has("gravity") else 2.0 * math.pi / scene.omega0
    run = rollout(
        scene, integrator=METHOD, angle=amplitude, velocity=0.0, dt=period / steps,
        duration=(OSCILLATIONS + 1.0) * period, control=control, backend=backend,
    )
    turns = turning_points(run.time, run.angle, run.velocity)
    last = 2 * OSCILLATIONS - 1
    return Swing(
        period=turns[last][0] / OSCILLATIONS if len(turns) > last else math.nan,
        amplitude=abs(turns[0][1]) if turns else math.nan,
        time=run.time, angle=run.angle,
    )


def turning_points(time: Array, angle: Array, velocity: Array) -> list[tuple[float, float]]:
    """Time [s] and angle [rad] of each zero of the velocity after the start, to the fifth order in the step.

    Times must be evenly spaced. Only points before the zero are used: friction makes the acceleration jump there.
    """
    before, after = velocity[:-1], velocity[1:]
    found = []
    nodes = np.arange(1.0 - POINTS, 1.0)
    for i in np.flatnonzero((before != 0.0) & (before * after <= 0.0)):
        if i + 1 < POINTS:
            continue
        part = slice(i + 1 - POINTS, i + 1)
        speed, place = (np.polynomial.Polynomial.fit(nodes, values[part], POINTS - 1) for values in (velocity, angle))
        x = float(before[i] / (before[i] - after[i]))
        for _ in range(6):
            x -= float(speed(x) / speed.deriv()(x))
        found.append((float(time[i] + x * (time[i + 1] - time[i])), float(place(x))))
    return found


# --- the textbook ---------------------------------------------------------------------------------------------------

Prediction = tuple[float, float]
"""Relative change of the period and of the amplitude in the first half swing; nan where no formula is known."""


def _lossy(scene: Scene, amplitude: float, loss: float, period: float = 0.0) -> Prediction:
    """A damping that takes ``loss`` of the amplitude per half swing: at full gravity the period falls with it."""
    fall = -(amplitude**2) / 8.0 * OSCILLATIONS * loss if scene.has("gravity") else 0.0
    return period + fall, -loss


def _linear(scene: Scene, amplitude: float) -> Prediction:
    quality = scene.omega0 / scene.coefficients["linear_drag_rate"]
    return _lossy(scene, amplitude, math.pi / (2.0 * quality), 1.0 / (8.0 * quality**2))


def _quadratic(scene: Scene, amplitude: float) -> Prediction:
    return _lossy(scene, amplitude, 4.0 / 3.0 * scene.coefficients["quadratic_drag_rate"] * amplitude)


def _coulomb(scene: Scene, amplitude: float) -> Prediction:
    return _lossy(scene, amplitude, 2.0 * scene.coefficients["dry_limit"] / (scene.omega0**2 * amplitude))


def _motor(scene: Scene, amplitude: float) -> Prediction:
    return math.nan, abs(1.0 - 2.0 * scene.coefficients["motor_rate"] / (scene.omega0**2 * amplitude)) - 1.0


def _gravity(scene: Scene, amplitude: float) -> Prediction:
    return float(exact.small_amplitude_series(amplitude)), 0.0


PREDICTIONS: Mapping[str, Callable[[Scene, float], Prediction]] = MappingProxyType({
    "gravity": _gravity, "linear_drag": _linear, "quadratic_drag": _quadratic, "coulomb_friction": _coulomb,
    "motor": _motor,
})
"""First-order formulas of small effects (Nelson & Olsson 1986, Am. J. Phys. 54, 112), by the effect's name.

With Q = omega0/gamma, amplitude A and n = OSCILLATIONS: full gravity in place of linearised dT/T = A²/16 + ...; loss of
amplitude per half swing dA/A = pi/(2 Q) by linear drag, (4/3) c A by quadratic drag, 2 tau/(omega0² A) by dry friction;
a constant push u moves the middle of the swing to u/omega0²; dT/T = 1/(8 Q²) by linear drag, and at full gravity
-(n A²/8) dA/A by any loss dA.
"""


def predicted(effect: str, scene: Scene, amplitude: float) -> Prediction:
    """The formula's values for an effect in a scene; nan where there is none, or its coefficient is zero."""
    formula = PREDICTIONS.get(effect)
    try:
        return formula(scene, amplitude) if formula else (math.nan, math.nan)
    except ZeroDivisionError:
        return 0.0, 0.0
