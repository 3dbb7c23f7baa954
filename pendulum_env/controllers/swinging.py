"""A swing-up controller: energy shaping, then a linear-quadratic regulator at the top; and a random policy beside it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from os import PathLike
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pendulum_env.controllers.regulator import (
    ControlModel,
    Regulator,
    acceleration_of,
    model_of,
    regulators,
    weights_of,
)
from pendulum_env.physics.effects.motor import motor_advance
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, number, shown, whole_number
from pendulum_env.tasks import Task, find_task


def batch_of(observation: Any, *sizes: int) -> NDArray[np.float64]:
    """Return observations of shape (n, k), or one of shape (k,), as (n, k), where k is one of ``sizes``.

    Raises ValueError for other shapes and for values that are not finite numbers.
    """
    try:
        given = np.asarray(observation)
        batch = given.astype(np.float64) if given.dtype.kind in "fiu" else None
    except (TypeError, ValueError):
        batch = None
    if batch is None:
        raise ValueError("Observations must be arrays of numbers.")
    if batch.ndim not in (1, 2) or batch.shape[-1] not in sizes:
        wanted = " or ".join(f"({k},) or (n, {k})" for k in sizes)
        raise ValueError(f"Observations must have the shape {wanted}, not {np.shape(observation)}.")
    if not np.isfinite(batch).all():
        raise ValueError("Observations must be finite.")
    return batch.reshape(-1, batch.shape[-1])


class RandomPolicy:
    """A policy with actions uniform in [-1, 1), for comparison with better ones.

    Args:
        seed: a whole number from 0.

    Raises SceneError for another seed.
    """

    __slots__ = ("_random",)

    def __init__(self, seed: int = 0) -> None:
        self._random = np.random.default_rng(whole_number(seed, "seed", least=0))

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Return random actions: shape (1,) for an observation of shape (3,), (n, 1) for (n, 3).

        Observations of a task with a reference have 7 entries. Raises ValueError for another shape or values that are
        not finite.
        """
        batch_of(observation, 3, 7)
        return self._random.uniform(-1.0, 1.0, (*np.shape(observation)[:-1], 1)).astype(np.float32)


Array = NDArray[np.float64]

SHORTEST, LONGEST = 1e-5, 1.0
"""Shortest and longest control step, times omega0."""
REACH = 0.25
"""The torque is reduced where full torque would supply the missing energy within this angle [rad]."""


class SwingUp:
    """A swing-up controller for one environment or many: energy shaping, and a linear-quadratic regulator at the top.

    Away from the top the motor pushes with the motion while the bob is too slow to reach the top, and against the
    motion while it is too fast: ``action = clip((need - w)/(motor_rate reach), -1, 1) sign(v)``, with ``w = v**2/2``
    and ``need`` the w of a bob that just reaches the top by itself from this angle, with losses and a steady wind.
    Without losses ``need - w`` is the missing energy per moment of inertia, and this is the law of Åström & Furuta
    (2000, Automatica 36, 287) for a motor. Near the top, where the motor's torque is enough to hold the bob, regulators
    take over: see :func:`pendulum_env.controllers.regulator.regulators`.

    Gusts, shaken pivots and periodic torques are not predicted: the controller reacts to the motion that they cause. A
    motor's lag is known: the controller computes the motor's share from its own actions, from 0 at the first call or
    ``reset``; after a new episode without ``reset`` this share is right again after a few times the lag. The check that
    the motor is strong enough ignores the lag: with a lag above about 2/omega0, a weak motor may not reach the top. A
    motor that brakes by its own voltage is allowed for, but not a supply that limits its torque, nor a ramp, steps and
    a dead zone of the control.

    Attributes:
        scene: the scene that the controller was designed for.
        dt: control step [s].
        model: the controller's model of the scene.
        regulators: from the hardest to the one that reaches farthest.
    """

    scene: Scene
    dt: float
    model: ControlModel
    regulators: tuple[Regulator, ...]

    def __init__(
        self, scene: str | Scene | Mapping[str, object] | PathLike[str] = "lab", dt: float = 0.02,
        task: str | Task = "swing_up",
    ) -> None:
        """Design a swing-up controller, in about a tenth of a second.

        Args:
            scene: a scene with a motor: preset name, dict, Scene, or a scene's JSON file.
            dt: control step [s].
            task: the task whose reward the regulator at the top maximises, a name or a Task. A task with ``upright``
                means that the observed cosine and sine are those of the angle from upright.

        Raises SceneError for a scene without a motor or an unstable top, for a motor that is too weak (with the torque
        needed), for control steps shorter than 1e-5/omega0 or longer than 1/omega0, and for a task without reward.
        """
        self.dt, aim = number(dt, "dt", above=0.0, unit="s"), find_task(task)
        self.scene = find_scene(scene)
        self.model = model_of(self.scene)
        if why := self.model.cannot:
            raise SceneError(f"The motor of {self.model.motor.max_torque:g} N m is too weak in the scene "
                             f"'{self.scene.name}': {why}.")
        if not SHORTEST <= self.dt * self.model.omega0 <= LONGEST:
            least, most = SHORTEST / self.model.omega0, LONGEST / self.model.omega0
            raise SceneError(f"Control steps to hold the bob at the top must be from {least:.2g} to {most:.2g} s long, "
                             f"not {self.dt:g} s.")
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                self.regulators = regulators(self.model, acceleration_of(self.scene), self.dt, aim)
        except SceneError:
            raise
        except (ArithmeticError, ValueError):  # numpy's LinAlgError is a ValueError
            raise SceneError(f"No regulator can be computed for the scene '{self.scene.name}': the motor's torque, its "
                             "lag or the control step is too large or too small.") from None
        self._side = -1.0 if aim.upright else 1.0
        self._motor: Array = np.zeros(1)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute while the controller is designed; AttributeError afterwards, as it would change nothing."""
        if "_motor" in vars(self) and name != "_motor":
            raise AttributeError(f"{name} cannot be assigned, as the controller is designed for its scene and control "
                                 "step; make a new one with SwingUp(scene, dt, task).")
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        return f"SwingUp('{self.scene.name}', dt={self.dt:g} s)"

    @property
    def motor_shares(self) -> Array:
        """Return the present torques of lagging motors as fractions of the largest torque, shape ``(n,)``.

        They are computed from the past actions of the n environments.
        """
        return self._motor.copy()

    def reset(self) -> None:
        """Forget the torque of a lagging motor, the only value remembered between calls, before a new episode."""
        self._motor = np.zeros(1)

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Return the action for an observation, float32 of shape (1,) for shape (3,), and (n, 1) for (n, 3).

        Raises ValueError for another shape or values that are not finite.
        """
        observed = batch_of(observation, 3) * (self._side, self._side, 1.0)
        angle = np.arctan2(observed[:, 1], observed[:, 0])
        phi = np.arctan2(-observed[:, 1], -observed[:, 0])
        velocity = observed[:, 2]
        if self._motor.shape != angle.shape:
            self._motor = np.zeros(angle.shape)
        shares = self._pumping(angle, velocity)
        x = np.stack([phi, velocity], axis=1)
        for regulator in reversed(self.regulators):
            full = np.column_stack([x, self._motor - regulator.hold]) if self.model.motor.lag else x
            cost = np.einsum("ni,ij,nj->n", full, regulator.cost, full)
            shares = np.where(cost <= regulator.level, regulator.hold - full @ regulator.gain, shares)
        actions = np.clip(shares, -1.0, 1.0).astype(np.float32)
        if self.model.motor.lag:
            decay = 1.0 / self.model.motor.lag
            remaining, _ = motor_advance(1.0, 0.0, self.dt, decay)
            self._motor = actions + (self._motor - actions) * remaining
        return actions.reshape((*np.shape(observation)[:-1], 1))

    def _pumping(self, angle: Array, velocity: Array) -> Array:
        """Return the motor torques, as fractions of the largest torque, that bring the energy to that of the top."""
        model = self.model
        forwards = np.where(velocity != 0.0, velocity > 0.0, np.sin(angle) <= 0.0)
        needed = np.where(forwards, np.interp(angle, model.angles, model.rising),
                          np.interp(angle, model.angles, model.falling))
        reach = model.motor_rate * np.maximum(REACH, np.abs(velocity) * self.dt)
        share = np.where(forwards, 1.0, -1.0) * np.clip((needed - 0.5 * velocity * velocity) / reach, -1.0, 1.0)
        if not model.motor.lag:
            return share
        _, mean = motor_advance(1.0, 0.0, self.dt, 1.0 / model.motor.lag)
        return (share - mean * self._motor) / (1.0 - mean)


class Environment(Protocol):
    """Protocol of a Gymnasium environment or vector of environments, wrapped or not."""

    @property
    def unwrapped(self) -> Any:
        """Return the Gymnasium environment that is inside all wrappers."""


def swing_up(env: Environment) -> SwingUp:
    """Return the swing-up controller for an environment or a vector: ``action = controller(observation)``.

    If the environments of a vector have different parameters, the controller is designed for the first one. For a task
    whose reward does not fall with angle and action, the regulator at the top is that of swing_up. Raises SceneError as
    :class:`SwingUp` does, for an environment that is not a LabPendulum, and for one with wrappers that rescale
    observations or actions.
    """
    inner: Any = getattr(env, "unwrapped", None)
    try:
        scene, dt, task, bound = (_attribute(inner, name) for name in ("scene", "dt", "task", "velocity_bound"))
        keywords = {"scene": scene, "dt": dt, "task": task}
    except AttributeError:
        raise SceneError(f"env must be a LabPendulum environment, not {shown(env)}.") from None
    for kind, bounds in {"observation": (1.0, 1.0, bound), "action": (1.0,)}.items():
        space = getattr(env, f"single_{kind}_space", None) or getattr(env, f"{kind}_space")
        if not _bounded(space, bounds) and not (kind == "action" and _bounded(space, (math.inf,))):
            raise SceneError(f"A wrapper of env changes the {kind}s, but the controller needs them unchanged; give it "
                             f"the environment inside the wrapper, not one with {shown(space)}.")
    try:
        weights_of(task, 1.0)
    except SceneError:  # the reward has no maximum to hold, as that of free
        keywords["task"] = dataclasses.replace(find_task("swing_up"), upright=task.upright)
    return SwingUp(**keywords)


def _attribute(env: Any, name: str) -> Any:
    """Return an attribute of an environment, or of the first environment in a vector."""
    return env.get_attr(name)[0] if hasattr(env, "get_attr") else getattr(env, name)


def _bounded(space: Any, bounds: tuple[float, ...]) -> bool:
    """Return True for a Gymnasium Box space with the limits ``-bounds`` and ``bounds``."""
    low: Any = getattr(space, "low", None)
    high: Any = getattr(space, "high", None)
    return np.array_equal(low, np.negative(bounds)) and np.array_equal(high, bounds)
