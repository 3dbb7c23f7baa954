"""Linear-quadratic regulators that hold the bob at the top, and the regions in which the limited motor torque suffices.

A controller's model of a scene has the accelerations near the top, and the speed with which the bob just reaches it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.effects import Effect, Motor
from pendulum_env.physics.effects.motor import motor_advance
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError
from pendulum_env.tasks import Task
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


Step = Callable[[Array, float, Array], Array]
"""A control step: ``step(gain, hold, x)`` returns the next ``x``."""

SOFTEST = 1.0
"""Weight of the squared action of the softest regulator, relative to the reward's weight of the squared angle [rad]."""
STEP = 10.0
"""Ratio of the action's weights of two successive regulators."""
FARTHEST = 0.5 * math.pi
"""Largest angle from the top at which a regulator is used [rad]."""
DIRECTIONS, LEVELS = {2: 48, 3: 192}, 32
"""Starts from which a regulator is tested: number of directions in the plane or in space, and of distances in each."""
RESOLVED = 0.1
"""Largest step of the simulations that test a regulator, as a fraction of the time 1/omega0."""


@dataclass(frozen=True)
class Regulator:
    """A regulator that holds the bob at the top: ``action = hold - gain x``, clipped to [-1, 1].

    ``x`` is the angle from the top, the velocity and, for a motor with a lag, its present torque as a fraction of the
    largest torque, less ``hold``.

    Attributes:
        gain: [1/rad, s/rad, 1].
        hold: the fraction of the torque that cancels a steady wind's push.
        cost: matrix of the quadratic form ``x cost x``, the sum of all future weighted deviations and actions.
        level: the regulator works from every x with ``x cost x`` below this number, as the form then falls in every
            step.
    """

    gain: Array
    hold: float
    cost: Array
    level: float


def weights_of(task: Task, omega0: float) -> tuple[float, float, float]:
    """Return the weights of phi², (velocity/omega0)² and action² in a task's reward.

    ``omega0`` is the small-angle frequency [1/s]. Raises SceneError for a task whose reward does not depend on angle
    and action.
    """
    judge = task.judge(omega0, 0.0)

    def reward(phi: float, speed: float, action: float) -> float:
        velocity = speed * omega0
        before = {"phi_before": phi, "angle_before": phi + math.pi, "velocity_before": velocity}
        return judge(0.0, phi, 0.5, velocity, phi, action, before)[0]

    base = reward(0.0, 0.0, 0.0)
    weights = base - reward(1.0, 0.0, 0.0), base - reward(0.0, 1.0, 0.0), base - reward(0.0, 0.0, 1.0)
    if not (weights[0] > 0.0 and weights[2] > 0.0):
        raise SceneError(f"The reward of the task '{task.name}' does not depend on angle and action, so no regulator "
                         "can be designed for it; use 'swing_up'.")
    return weights


def regulators(model: ControlModel, acceleration: Acceleration, dt: float, task: Task) -> tuple[Regulator, ...]:
    """Return regulators for the top, from the hardest to the softest, which works farthest from the top.

    A hard regulator uses large torques. The hardest has the weights of the task's reward. ``x' = A x + B action`` at
    the top is sampled exactly over control steps of ``dt`` [s] with constant action. The regulator minimises the sum of
    ``x Q x + R action**2`` over all steps: ``gain`` solves the discrete algebraic Riccati equation (Anderson & Moore
    1990, Optimal Control, section 2.4). A few degrees from the top a hard regulator would need more than the largest
    torque; so softer ones are used around it, each with ten times (STEP) the weight of the action of the one before
    (Wredenhagen & Belanger 1994, Automatica 30, 403).
    """
    angle, velocity, least = weights_of(task, model.omega0)
    state, control = sampled(model, dt)
    count = max(0, math.ceil(math.log(SOFTEST * angle / least, STEP) - 1e-9))
    weights = np.zeros(state.shape)
    weights[0, 0], weights[1, 1] = angle, velocity / model.omega0**2
    step = partial(_stepped, model, acceleration, dt)
    return tuple(_regulator(model, step, state, control, weights, least * STEP**k) for k in range(count + 1))


def sampled(model: ControlModel, dt: float) -> tuple[Array, Array]:
    """Return the matrices of ``x_next = state x + control action`` at the top, for one control step.

    The action is constant in the step. The matrices come from the exponential of the linearised scene's matrix (Van
    Loan 1978, IEEE Trans. Autom. Control 23, 395). The torque of a lagging motor, as its mean over the step and its
    value after the step, is linear in the action and in the torque before the step.
    """
    from scipy.linalg import expm

    linear = np.zeros((3, 3))
    linear[0, 1] = 1.0
    linear[1] = model.by_angle, model.by_velocity, model.motor_rate
    exponential = expm(linear * dt)
    plain, push = exponential[:2, :2], exponential[:2, 2]
    if not model.motor.lag:
        return plain, push[:, np.newaxis]
    remaining, mean = motor_advance(1.0, 0.0, dt, 1.0 / model.motor.lag)
    state = np.zeros((3, 3))
    state[:2, :2], state[:2, 2], state[2, 2] = plain, push * mean, remaining
    return state, np.array([*(push * (1.0 - mean)), 1.0 - remaining])[:, np.newaxis]


def _regulator(
    model: ControlModel, step: Step, state: Array, control: Array, error_weights: Array, least: float
) -> Regulator:
    """Return the regulator for these weights of deviation and action, with the region in which it works."""
    from scipy.linalg import solve_discrete_are

    cost = np.asarray(solve_discrete_are(state, control, error_weights, [[least]]), dtype=np.float64)
    push = cost @ control
    gain = np.asarray((push.T @ state / (least + control.T @ push))[0], dtype=np.float64)
    hold = -model.bias / model.motor_rate
    return Regulator(gain, hold, cost, _level(step, gain, hold, cost))


def _level(step: Step, gain: Array, hold: float, cost: Array) -> float:
    """Return the ``level`` of a regulator: from every state with at most this cost, the cost falls in the next step.

    The cost is the quadratic form ``x cost x``. Up to ``(1 - |hold|)**2 / (gain cost**-1 gain)`` the action needs no
    clipping, and the cost falls by Riccati's equation; beyond, one step of the scene with its limited torque is
    simulated from states in many directions. The cost serves as a Lyapunov function, which gives the region of
    attraction (Khalil 2002, Nonlinear Systems, section 8.2).
    """
    inverse = np.linalg.inv(cost)
    first = (1.0 - abs(hold)) ** 2 / float(gain @ inverse @ gain)
    best = FARTHEST**2 / float(inverse[0, 0])
    if first >= best:
        return best
    root = np.linalg.inv(np.linalg.cholesky(cost)).T
    sizes = np.geomspace(math.sqrt(first), math.sqrt(best), LEVELS)
    reached = LEVELS
    for direction in _directions(len(gain)):
        way = root @ direction
        for k in range(reached):
            after = step(gain, hold, sizes[k] * way)
            if not float(after @ cost @ after) < sizes[k] ** 2:
                reached = k
                break
    return float(sizes[reached - 1] ** 2) if reached else first


def _directions(size: int) -> Array:
    """Return unit vectors in the plane (``size`` 2) or in space (3), spread evenly.

    Those in space lie on a spiral of the golden angle.
    """
    count = np.arange(DIRECTIONS[size])
    if size == 2:
        turns = 2.0 * math.pi * count / len(count)
        return np.stack([np.cos(turns), np.sin(turns)], axis=1)
    height = 1.0 - (2.0 * count + 1.0) / len(count)
    around, width = math.pi * (1.0 + math.sqrt(5.0)) * count, np.sqrt(1.0 - height * height)
    return np.stack([width * np.cos(around), width * np.sin(around), height], axis=1)


def _stepped(model: ControlModel, acceleration: Acceleration, dt: float, gain: Array, hold: float, x: Array) -> Array:
    """Return the deviation from the top after one control step under a regulator, from the deviation ``x``, by rk4."""
    action = min(max(hold - float(gain @ x), -1.0), 1.0)
    share, after = action, tuple[float, ...]()
    if model.motor.lag:
        state, share = motor_advance(float(x[2]) + hold, action, dt, 1.0 / model.motor.lag)
        after = (state - hold,)
    push, count = share * model.motor_rate, math.ceil(dt * model.omega0 / RESOLVED)
    angle, velocity, h = math.pi + float(x[0]), float(x[1]), dt / count

    def slope(q: float, v: float) -> float:
        return acceleration(q, v, 0.0) + push

    for _ in range(count):
        a = slope(angle, velocity)
        v2 = velocity + 0.5 * h * a
        b = slope(angle + 0.5 * h * velocity, v2)
        v3 = velocity + 0.5 * h * b
        c = slope(angle + 0.5 * h * v2, v3)
        v4 = velocity + h * c
        d = slope(angle + h * v3, v4)
        angle += h / 6.0 * (velocity + 2.0 * (v2 + v3) + v4)
        velocity += h / 6.0 * (a + 2.0 * (b + c) + d)
    return np.array([angle - math.pi, velocity, *after])
