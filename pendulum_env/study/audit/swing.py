"""Simulated release at rest, with the measured period and amplitude of the swing and its sampled angles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from pendulum_env.engine.kernels import Backend
from pendulum_env.engine.reading import arguments
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics import exact
from pendulum_env.physics.effects.effect import OSCILLATIONS
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

METHOD = "rk4"
"""Integrator of all audits."""
POINTS = 6
"""Number of steps before a turning point whose polynomial locates it; points after it may lie beyond a jump."""
POWERS = np.arange(POINTS)
"""Powers in a polynomial through these points."""
COEFFICIENTS = np.linalg.inv(np.vander(np.arange(1.0 - POINTS, 1.0), increasing=True))
"""Matrix from the values at these points, a step apart and the last at 0, to the coefficients of the polynomial."""
SAMPLES = 128
"""Instants per period at which angles are compared, for every step."""


@dataclass(frozen=True)
class Swing:
    """Results measured on one simulated release from rest: period, amplitude, angles and others.

    Attributes:
        period: mean period of the first three oscillations [s]; nan if there are fewer.
        amplitude: size of the angle at the first turning point, on the side opposite to the release [rad]; nan if
            there is none.
        angle: angles at 128 instants per period [rad]; the instants do not depend on the step.
        speed: largest size of the velocity [rad/s].
        stop_reason: why the run ended early, else "".
        free: False if a force depends on time, on random numbers or on a control, so that the swing has no period.
    """

    period: float
    amplitude: float
    angle: Array
    speed: float
    stop_reason: str
    free: bool

    @property
    def swings(self) -> bool:
        """True if the swing's period and amplitude could be measured."""
        return math.isfinite(self.period) and math.isfinite(self.amplitude)


def time_scale(scene: Scene, amplitude: float) -> float:
    """Return the period [s] of a swing of ``amplitude`` [rad] without losses; 0 without a restoring torque."""
    if not (scene.of_kind("conservative") and scene.omega0):
        return 0.0
    return float(exact.period(amplitude, scene.omega0)) if scene.has("gravity") else 2.0 * math.pi / scene.omega0


def free(scene: Scene, control: float) -> bool:
    """Return True if no force in a scene depends on time, random numbers or a control, so that swings have a period.

    State variables of an effect's own change if it draws random numbers, as gusts do, or has a control that is not 0.
    """
    functions = (function for effect in scene.effects
                 for function in (effect.torque, effect.wind_x, effect.wind_y, effect.radial) if function)
    remembers = any(effect.memory and (effect.draws > 0 or control != 0.0) for effect in scene.effects)
    return not (remembers or any("time" in arguments(function) for function in functions))


def held_for(scene: Scene, steps: int) -> dict[str, Any]:
    """Return the keyword ``substeps`` for a rollout if an effect has state variables of its own, else an empty dict.

    Such effects are updated once per control step; the keyword keeps its length independent of the integration step.
    """
    return {"substeps": steps} if any(effect.memory for effect in scene.effects) else {}


def swing(
    scene: Scene, amplitude: float, period: float, steps: int, *, control: float = 0.0, backend: Backend = "auto"
) -> Swing:
    """Simulate a release at rest from ``amplitude`` [rad] for four times ``period`` [s], and measure the swing.

    ``steps``, a multiple of 128, is the number of steps of rk4 per period. ``control`` is the constant control signal.
    """
    every, undriven = steps // SAMPLES, free(scene, control)
    held: dict[str, Any] = {} if undriven else held_for(scene, every)
    run = rollout(
        scene, integrator=METHOD, angle=amplitude, velocity=0.0, dt=period / steps,
        duration=(OSCILLATIONS + 1) * period, every=1 if undriven else every, control=control, backend=backend,
        warn=False, **held,
    )
    whole = int(float(run.stop_time) / run.dt + 1e-6)  # a wire may go slack within a step
    turns = turning_points(*(one[: 1 + whole] for one in (run.time, run.angle, run.velocity))) if undriven else []
    last = 2 * OSCILLATIONS - 1
    samples = whole // every
    angle = run.angle[:: every if undriven else 1]
    return Swing(
        period=turns[last][0] / OSCILLATIONS if len(turns) > last else math.nan,
        amplitude=abs(turns[0][1]) if turns else math.nan,
        angle=angle[: 1 + min(samples, (OSCILLATIONS + 1) * SAMPLES)],
        speed=float(np.max(np.abs(run.velocity))),
        stop_reason=str(run.stop_reason),
        free=undriven,
    )


def turning_points(time: Array, angle: Array, velocity: Array) -> list[tuple[float, float]]:
    """Return time [s] and angle [rad] of each turning point after the start, interpolated between integration steps.

    The interpolation is of fifth order in the step. Times must be evenly spaced. Only states before the turning point
    are used, because with dry friction the acceleration jumps there.
    """
    before, after = velocity[:-1], velocity[1:]
    turns = []
    for i in np.flatnonzero((before != 0.0) & (before * after <= 0.0)):
        if i + 1 < POINTS:
            continue
        part = slice(i + 1 - POINTS, i + 1)
        speed, place = (COEFFICIENTS @ values[part] for values in (velocity, angle))
        slope = POWERS[1:] * speed[1:]
        x = float(before[i] / (before[i] - after[i]))
        for _ in range(6):
            x -= float(polyval(x, speed) / polyval(x, slope))
        turns.append((float(time[i] + x * (time[i + 1] - time[i])), float(polyval(x, place))))
    return turns
