"""Tasks: start, reward and end of an episode. The package's own tasks are made with :class:`Task`, as yours are."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from pendulum_env.common.checks import SceneError, nearest, number, shown
from pendulum_env.physics.elementary import sin
from pendulum_env.tasks.task import QUANTITIES, Task
from pendulum_env.tasks.translate import TaskError

__all__ = ["QUANTITIES", "TASKS", "USUAL_TASK", "Task", "TaskError", "find_task", "track"]

SPREAD, SPEED_SPREAD = 0.1, 0.05
"""Half widths of the uniform distributions of the start: angle about the centre [rad], and velocity [omega0]."""

FELL_ANGLE = 0.5
"""Angle from upright beyond which the balancing task is lost [rad]."""

HUNG = 0.25
"""Part of the episodes of swing_up_mixed that begin as those of swing_up."""

TOLERANCE = math.radians(8.0)
"""Angle from upright up to which the task of dm_control is fulfilled [rad]."""

HELD_ANGLE, HELD_SPEED = 0.1, 0.1
"""Angle from upright [rad] and velocity [omega0] up to which the task swing_up_sparse is fulfilled."""


def _hanging(first: Any, second: Any, omega0: Any) -> tuple[Any, Any]:
    return 0.0 + SPREAD * (2.0 * first - 1.0), omega0 * (SPEED_SPREAD * (2.0 * second - 1.0))


def _upright(first: Any, second: Any, omega0: Any) -> tuple[Any, Any]:
    return math.pi + SPREAD * (2.0 * first - 1.0), omega0 * (SPEED_SPREAD * (2.0 * second - 1.0))


def _mixed(first: Any, second: Any, omega0: Any) -> tuple[Any, Any]:
    hangs = 1.0 * (first < HUNG)  # 1 or 0, of arrays, too
    hanging = SPREAD * (2.0 * first / HUNG - 1.0)
    anywhere = 2.0 * math.pi * (first - HUNG) / (1.0 - HUNG)
    fastest = hangs * SPEED_SPREAD + (1.0 - hangs)
    return hangs * hanging + (1.0 - hangs) * anywhere, omega0 * (fastest * (2.0 * second - 1.0))


def _nothing(phi: float, speed: float, action: float) -> float:
    return 0.0


def _swing_up(phi: float, speed: float, action: float) -> float:
    return -(phi * phi + 0.1 * speed * speed + 0.001 * action * action)


def _swing_up_sparse(phi: float, speed: float) -> float:
    return 1.0 if (abs(phi) <= HELD_ANGLE) & (abs(speed) <= HELD_SPEED) else 0.0


def _balance(phi: float, speed: float, action: float) -> float:
    return 1.0 - (phi / FELL_ANGLE) * (phi / FELL_ANGLE) - 0.001 * action * action


def _fell(phi: float) -> bool:
    return abs(phi) > FELL_ANGLE


def _gymnasium(phi_before: float, velocity_before: float, action: float) -> float:
    return -(phi_before * phi_before + 0.1 * velocity_before * velocity_before + 0.004 * action * action)


def _dm_control(phi: float) -> float:
    return 1.0 if abs(phi) <= TOLERANCE else 0.0


def _follow(error: float, action: float) -> float:
    return -(error * error + 0.001 * action * action)


AMPLITUDE, PERIOD = 0.5, 4.0
"""Amplitude [rad] and period [s] of the usual reference of the task track."""
RATE = 2.0 * math.pi / PERIOD


def _usual_swing(time: float) -> float:
    return AMPLITUDE * sin(RATE * time)


def track(
    reference: Callable[..., float] | None = None, amplitude: float = AMPLITUDE, period: float = PERIOD,
    name: str = "track",
) -> Task:
    """Return the task of following a reference angle: reward ``-(error² + 0.001 action²)`` per step.

    The error is the angle less the reference, in [-pi, pi]. Episodes start as those of swing_up. The observation has
    four more entries: cosine and sine of the reference now, and after the next control step.

    Args:
        reference: plain function of "time" [s] that returns the angle to follow, from hanging [rad]; None for
            ``amplitude sin(2 pi time/period)``.
        amplitude, period: amplitude [rad] and period [s] of the usual reference.
        name: the task's name.

    Raises TaskError for a function that cannot be copied, and SceneError for invalid numbers.
    """
    size, cycle = number(amplitude, "amplitude", unit="rad"), number(period, "period", above=0.0, unit="s")
    rate = 2.0 * math.pi / cycle
    usual = (size, cycle) == (AMPLITUDE, PERIOD)

    def swing(time: float) -> float:
        return size * math.sin(rate * time)

    aim = (_usual_swing if usual else swing) if reference is None else reference
    return Task(name, _follow, start=_hanging, reference=aim, equation="-(error² + 0.001 action²)")


SWINGING_UP = "-(phi² + 0.1 (velocity/omega0)² + 0.001 action²)"
"""The reward of swing_up, and of the same from other starts, as text."""

_ALL = (
    Task("free", _nothing, equation="0"),
    Task("swing_up", _swing_up, start=_hanging, equation=SWINGING_UP),
    Task("swing_up_anywhere", _swing_up, start={"angle": (0.0, 2.0 * math.pi), "speed": (-1.0, 1.0)},
         equation=SWINGING_UP),
    Task("swing_up_mixed", _swing_up, start=_mixed, equation=SWINGING_UP),
    Task("balance", _balance, _fell, _upright, equation="1 - (phi/0.5)² - 0.001 action²",
         ends='abs(phi) > 0.5: "fell"'),
    Task("swing_up_sparse", _swing_up_sparse, start=_hanging,
         equation="1 if abs(phi) <= 0.1 and abs(velocity) <= 0.1 omega0, else 0"),
    track(),
    Task("gymnasium", _gymnasium, start={"angle": (0.0, 2.0 * math.pi), "velocity": (-1.0, 1.0)}, duration=10.0,
         upright=True, equation="-(phi² + 0.1 velocity² + 0.004 action²) before the step", widths=("x_init", "y_init")),
    Task("dm_control", _dm_control, start={"angle": (0.0, 2.0 * math.pi)}, duration=20.0, upright=True,
         equation="1 if abs(phi) <= 8 pi/180, else 0"),
)

USUAL_TASK = "swing_up"
"""Name of the task of an environment that is made without one."""
TASKS: Mapping[str, Task] = MappingProxyType({task.name: task for task in _ALL})
"""Every task by name."""


def find_task(task: str | Task) -> Task:
    """Return the task of this name, or a Task unchanged.

    Raises SceneError with the nearest name for an unknown one, and for anything else.
    """
    if isinstance(task, Task):
        return task
    if not isinstance(task, str) or task not in TASKS:
        own = "" if isinstance(task, str) else " A task of your own is a pendulum_env.Task."
        raise SceneError(f"There is no task {shown(task)}{nearest(task, TASKS)}{own}")
    return TASKS[task]
