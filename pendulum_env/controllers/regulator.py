"""Linear-quadratic regulators that hold the bob at the top, and the regions in which the limited motor torque suffices.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pendulum_env.controllers.model import Acceleration, ControlModel
from pendulum_env.physics.effects.motor import motor_advance
from pendulum_env.physics.units import SceneError
from pendulum_env.tasks import Task

Array = NDArray[np.float64]
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
