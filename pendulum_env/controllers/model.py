"""What a controller knows of a scene: its acceleration at the top, and the speed that just carries the bob there."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.effects import Effect, Motor
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.truth.pieces import problem_of

Array = NDArray[np.float64]
Acceleration = Callable[[float, float, float], float]

POINTS = 721
"""Angles of the tables, every half degree of a turn."""
TINY = 1e-4
"""Differences for derivatives are taken over so much [rad, rad/s]."""
LOOKS = 32
"""So often a drive is looked at in its period, at so many angles."""


@dataclass(frozen=True)
class Model:
    """A scene as a controller sees it: a steady wind, no gusts, shaken pivots and torques in time left out.

    ``theta'' = a(theta, v) + motor_rate s``, with ``s`` the motor's share.

    Attributes:
        motor: the scene's motor.
        motor_rate: acceleration by the whole torque [rad/s²].
        by_angle, by_velocity: derivatives of ``a`` at rest at the top [1/s², 1/s], dry friction left out.
        bias: ``a`` at rest at the top [rad/s²]: a steady wind's push.
        disturbance: the most that dry friction, shaken pivots and torques in time come to at rest [rad/s²].
        weight: the largest ``-a`` on the way up, at rest [rad/s²].
        omega0: small-angle angular frequency [1/s].
        angles: from -pi to pi, POINTS of them [rad].
        rising, falling: half the square of the velocity with which the bob just gets to the top without the motor, in
            positive and in negative direction, at each of ``angles`` [1/s²].
    """

    motor: Motor
    motor_rate: float
    by_angle: float
    by_velocity: float
    bias: float
    disturbance: float
    weight: float
    omega0: float
    angles: Array
    rising: Array
    falling: Array

    @property
    def cannot(self) -> str:
        """Why the motor cannot bring the bob to the top and hold it there, as half a sentence; "" if it can.

        It has to be stronger than bias and disturbance together, and to lift the bob outright or to pump: in a swing
        from the top to the top and back it must do more work than is lost. Drag takes more of the motor's work the
        wider the swing is, so that lesser swings grow, too.
        """
        rate, inertia = self.motor_rate, self.motor.max_torque / self.motor_rate
        held = abs(self.bias) + self.disturbance
        if rate <= held:
            return f"holding the bob takes up to {held * inertia:.3g} N m"
        lost = float(self.rising[0] + self.falling[-1])
        pumped = lost / (4.0 * math.pi)
        lifted = self.weight + self.disturbance
        if rate <= min(pumped, lifted):
            return (f"lifting the bob takes {lifted * inertia:.3g} N m, and pumping {pumped * inertia:.3g} N m to make "
                    "up for the losses of a swing to the top")
        return ""


def acceleration_of(scene: Scene) -> Acceleration:
    """``a(theta, v, direction)`` [rad/s²], with dry friction against ``direction``, 0 for none."""
    problem = problem_of(scene.with_effects(effect for effect in scene.effects if not _beat(effect, scene)))
    return lambda angle, velocity, direction: problem.acceleration(0.0, angle, velocity, direction)


def model_of(scene: Scene) -> Model:
    """The model of a scene.

    Raises SceneError for a scene without a motor, or without gravity that has a top: linear in the angle, or none.
    """
    motor = next((effect for effect in scene.effects if isinstance(effect, Motor)), None)
    if motor is None:
        why = "; a wire cannot carry one" if scene.body.suspension == "wire" else ""
        raise SceneError(f"The scene '{scene.name}' has no motor to swing up with{why}.")
    a = acceleration_of(scene)
    by_angle = 0.5 * (a(math.pi + TINY, 0.0, 0.0) - a(math.pi - TINY, 0.0, 0.0)) / TINY
    by_velocity = 0.5 * (a(math.pi, TINY, 0.0) - a(math.pi, -TINY, 0.0)) / TINY
    if not (scene.periodic and by_angle > 0.0):
        raise SceneError(f"Gravity in the scene '{scene.name}' has no top at which the bob could be held.")
    angles = np.linspace(-math.pi, math.pi, POINTS)
    ways = np.array([-a(angle, 0.0, 0.0) for angle in angles.tolist()])
    return Model(
        motor, scene.coefficients["motor_rate"], by_angle, by_velocity, a(math.pi, 0.0, 0.0),
        disturbance=problem_of(scene).limit + sum(_shaken(scene, effect, a) for effect in scene.effects),
        weight=float(min(np.max(ways[POINTS // 2:]), -np.min(ways[:POINTS // 2]))), omega0=scene.omega0, angles=angles,
        rising=_carried(a, angles[::-1], 1.0)[::-1], falling=_carried(a, angles, -1.0),
    )


def _carried(acceleration: Acceleration, angles: Array, direction: float) -> Array:
    """``w = v**2/2`` on the way to the top, which is the first of the angles: ``dw/dtheta = a(theta, v)``, by rk4."""

    def slope(angle: float, half_square: float) -> float:
        return acceleration(angle, direction * math.sqrt(2.0 * max(half_square, 0.0)), direction)

    found = [0.0]
    for start, end in zip(angles[:-1].tolist(), angles[1:].tolist(), strict=True):
        h, w = end - start, found[-1]
        first = slope(start, w)
        second = slope(start + 0.5 * h, w + 0.5 * h * first)
        third = slope(start + 0.5 * h, w + 0.5 * h * second)
        found.append(max(0.0, w + h / 6.0 * (first + 2.0 * (second + third) + slope(end, w + h * third))))
    return np.array(found)


def _beat(effect: Effect, scene: Scene) -> float:
    """Angular rate of a torque that comes and goes by itself [rad/s]; 0 for others."""
    return effect.coefficients(scene)[effect.beat] if effect.beat else 0.0


def _shaken(scene: Scene, effect: Effect, still: Acceleration) -> float:
    """The most by which such a torque changes the acceleration of a bob at rest, anywhere [rad/s²]."""
    rate = _beat(effect, scene)
    if not rate:
        return 0.0
    alone = problem_of(scene.with_effects(e for e in scene.effects if e is effect or not _beat(e, scene)))
    turns = [2.0 * math.pi * k / LOOKS for k in range(LOOKS)]
    return max(abs(alone.acceleration(phase / rate, angle, 0.0, 0.0) - still(angle, 0.0, 0.0))
               for phase in turns for angle in turns)
