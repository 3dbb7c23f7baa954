"""What a window shows, and what a person may change in it: handed to the window by whoever runs the pendulum."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pendulum_env.engine.machine import Machine
from pendulum_env.render import Apparatus, FrameStyle, View


@dataclass(frozen=True)
class Shown:
    """A running pendulum, as its window sees it.

    Attributes:
        apparatus: what hangs from the stand; its title is the scene's name.
        dt: control step [s].
        size: width and height of the frame when the window opens [px].
        look: theme and panels.
        view: returns the present instant.
        start: starts anew from an angle [rad] and a velocity [rad/s]; raises SceneError for a start that cannot be.
        another: returns a machine with the integrator that comes so many places later among those that fit the scene,
            None if no other fits.
        take: goes on from the present state with such a machine.
    """

    apparatus: Apparatus
    dt: float
    size: tuple[int, int]
    look: FrameStyle
    view: Callable[[], View]
    start: Callable[[float, float], None]
    another: Callable[[int], Machine | None]
    take: Callable[[Machine], None]
