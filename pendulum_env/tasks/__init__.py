"""Tasks: start, reward and end of an episode, as pure functions of plain numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.units import one_of

Numbers = float | NDArray[np.float64]
"""A number, or an array of numbers."""

SPREAD, SPEED_SPREAD = 0.1, 0.05
"""Half widths of the uniform distributions of the start: angle about the centre [rad], and velocity [omega0]."""

FELL_ANGLE = 0.5
"""Angle from upright beyond which the balancing task is lost [rad]."""


@dataclass(frozen=True)
class Task:
    """A task: where an episode starts, the reward of a step, and when the episode ends.

    Attributes:
        name: for ``gym.make(..., task=...)``.
        centre: angle about which episodes start [rad]; None to start with the scene's usual run.
        reward: function of phi, the angle from upright in [-pi, pi], of velocity/omega0 and of the action that returns
            the reward of a step.
        lost: function of phi that is True where the task is lost ("fell"). Both functions are plain, because they are
            copied into generated programs.
        equation: the reward as text, for the documentation.
        ends: when the task is lost, as text; "-" for never.
    """

    name: str
    centre: float | None
    reward: Callable[[float, float, float], float]
    lost: Callable[[float], bool]
    equation: str
    ends: str = "-"

    def start(self, first: Numbers, second: Numbers, omega0: Numbers) -> tuple[Numbers, Numbers]:
        """Return the angle [rad] and velocity [rad/s] at which an episode starts, from two random numbers in [0, 1).

        ``omega0`` is the small-angle frequency [rad/s]. All arguments may be arrays, for many episodes.
        """
        centre = 0.0 if self.centre is None else self.centre
        return centre + SPREAD * (2.0 * first - 1.0), omega0 * (SPEED_SPREAD * (2.0 * second - 1.0))


def _nothing(phi: float, speed: float, action: float) -> float:
    return 0.0


def _swing_up(phi: float, speed: float, action: float) -> float:
    return -(phi * phi + 0.1 * speed * speed + 0.001 * action * action)


def _balance(phi: float, speed: float, action: float) -> float:
    return 1.0 - (phi / FELL_ANGLE) * (phi / FELL_ANGLE) - 0.001 * action * action


def _never(phi: float) -> bool:
    return False


def _fell(phi: float) -> bool:
    return abs(phi) > FELL_ANGLE


_ALL = (
    Task("free", None, _nothing, _never, "0"),
    Task("swing_up", 0.0, _swing_up, _never, "-(phi² + 0.1 (velocity/omega0)² + 0.001 action²)"),
    Task("balance", math.pi, _balance, _fell, "1 - (phi/0.5)² - 0.001 action²",
         'abs(phi) > 0.5: "fell"'),
)

USUAL_TASK = "swing_up"
"""Name of the task of an environment that is made without one."""
TASKS: Mapping[str, Task] = MappingProxyType({task.name: task for task in _ALL})
"""Every task by name."""


def find_task(name: str) -> Task:
    """Return the task of this name; SceneError with the nearest name for an unknown one."""
    return TASKS[one_of(name, "task", TASKS)]
