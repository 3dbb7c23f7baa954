"""A controller's model of a scene: accelerations near the top, and the speed with which the bob just reaches the top.
"""

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
"""Number of angles in the tables, one for every half degree of a turn."""
TINY = 1e-4
"""Step of the finite differences for derivatives [rad, rad/s]."""
LOOKS = 32
"""Number of times in a drive's period, and of angles, at which the drive's torque is sampled."""


@dataclass(frozen=True)
class ControlModel:
    """A controller's model of a scene, with a steady wind, but without gusts, shaken pivots and periodic torques.

    ``theta'' = a(theta, v) + motor_rate s``, where ``s`` is the motor's torque as a fraction of its largest torque.

    Attributes:
        motor: the scene's motor.
        motor_rate: acceleration by the largest torque [rad/s²].
        by_angle, by_velocity: derivatives of ``a`` at rest at the top [1/s², 1/s], without dry friction.
        bias: ``a`` at rest at the top [rad/s²], caused by a steady wind.
        disturbance: largest acceleration at rest by dry friction, shaken pivots and periodic torques together [rad/s²].
        weight: the acceleration that the motor needs to lift the bob slowly to the top [rad/s²].
        omega0: small-angle angular frequency [1/s].
        angles: 721 angles from -pi to pi, one every half degree [rad].
        rising, falling: half the square of the velocity with which the bob just reaches the top without the motor, in
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
        """Return the reason why the motor is too weak to bring the bob to the top and hold it there; "" if it is not.

        The largest torque must exceed the steady and periodic torques together. It must also lift the bob directly or
        pump it up: in a swing from the top all the way round to the top and back it must do more work than is lost.
        Drag takes a larger share of the motor's work in wider swings, so smaller swings grow too.
        """
        rate, inertia = self.motor_rate, self.motor.max_torque / self.motor_rate
        needed = abs(self.bias) + self.disturbance
        if rate <= needed:
            return f"holding the bob takes up to {needed * inertia:.3g} N m"
        lost = float(self.rising[0] + self.falling[-1])
        pumped = lost / (4.0 * math.pi)
        lifted = self.weight + self.disturbance
        if rate <= min(pumped, lifted):
            return (f"lifting the bob takes {lifted * inertia:.3g} N m, and pumping {pumped * inertia:.3g} N m to make "
                    "up for the losses of a swing to the top")
        return ""


def acceleration_of(scene: Scene) -> Acceleration:
    """Return the function ``a(theta, v, direction)`` of a scene, the angular acceleration without motor [rad/s²].

    Dry friction acts against ``direction``, +1 or -1; it is left out for 0. Periodic torques and shaken pivots are left
    out.
    """
    problem = problem_of(scene.with_effects(effect for effect in scene.effects if not _beat(effect, scene)))
    return lambda angle, velocity, direction: problem.acceleration(0.0, angle, velocity, direction)


def model_of(scene: Scene) -> ControlModel:
    """Return the model of a scene from which a controller is designed.

    Raises SceneError for a scene without a motor, and for one without an unstable top: without gravity, or with gravity
    linear in the angle.
    """
    motor = next((effect for effect in scene.effects if isinstance(effect, Motor)), None)
    if motor is None:
        why = "; a wire cannot carry one" if scene.body.suspension == "wire" else ""
        raise SceneError(f"The scene '{scene.name}' has no motor for a swing-up{why}.")
    a = acceleration_of(scene)
    by_angle = 0.5 * (a(math.pi + TINY, 0.0, 0.0) - a(math.pi - TINY, 0.0, 0.0)) / TINY
    by_velocity = 0.5 * (a(math.pi, TINY, 0.0) - a(math.pi, -TINY, 0.0)) / TINY
    if not (scene.periodic and by_angle > 0.0):
        raise SceneError(f"The scene '{scene.name}' has no unstable top at which the bob could be held; use a scene "
                         "with gravity that is not linear in the angle.")
    angles = np.linspace(-math.pi, math.pi, POINTS)
    ways = np.array([-a(angle, 0.0, 0.0) for angle in angles.tolist()])
    return ControlModel(
        motor, scene.coefficients["motor_rate"], by_angle, by_velocity, a(math.pi, 0.0, 0.0),
        disturbance=problem_of(scene).limit + sum(_shaken(scene, effect, a) for effect in scene.effects),
        weight=float(min(np.max(ways[POINTS // 2:]), -np.min(ways[:POINTS // 2]))), omega0=scene.omega0, angles=angles,
        rising=_carried(a, angles[::-1], 1.0)[::-1], falling=_carried(a, angles, -1.0),
    )


def _carried(acceleration: Acceleration, angles: Array, direction: float) -> Array:
    """Return ``w = v**2/2`` at each angle for a bob that just reaches the top with the last of its speed.

    ``angles`` begin at the top. ``dw/dtheta = a(theta, v)`` is integrated from there by rk4.
    """

    def slope(angle: float, half_square: float) -> float:
        return acceleration(angle, direction * math.sqrt(2.0 * max(half_square, 0.0)), direction)

    half_squares = [0.0]
    for start, end in zip(angles[:-1].tolist(), angles[1:].tolist(), strict=True):
        h, w = end - start, half_squares[-1]
        first = slope(start, w)
        second = slope(start + 0.5 * h, w + 0.5 * h * first)
        third = slope(start + 0.5 * h, w + 0.5 * h * second)
        half_squares.append(max(0.0, w + h / 6.0 * (first + 2.0 * (second + third) + slope(end, w + h * third))))
    return np.array(half_squares)


def _beat(effect: Effect, scene: Scene) -> float:
    """Return the angular frequency of a periodic torque or shaken pivot [rad/s]; 0 for other effects."""
    return effect.coefficients(scene)[effect.beat] if effect.beat else 0.0


def _shaken(scene: Scene, effect: Effect, still: Acceleration) -> float:
    """Return the largest change of a resting bob's acceleration by a periodic torque or shaken pivot [rad/s²]."""
    rate = _beat(effect, scene)
    if not rate:
        return 0.0
    alone = problem_of(scene.with_effects(e for e in scene.effects if e is effect or not _beat(e, scene)))
    turns = [2.0 * math.pi * k / LOOKS for k in range(LOOKS)]
    return max(abs(alone.acceleration(phase / rate, angle, 0.0, 0.0) - still(angle, 0.0, 0.0))
               for phase in turns for angle in turns)
