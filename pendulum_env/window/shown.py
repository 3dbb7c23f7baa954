"""Interface between a running pendulum and the window that shows and changes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from pendulum_env.engine.machine import Machine
from pendulum_env.render import Apparatus, FrameStyle, View


@dataclass(frozen=True)
class Shown:
    """Interface of a running pendulum for the window that shows it and lets a person change it.

    Attributes:
        apparatus: drawing data of the pendulum; its title is the scene's name.
        dt: control step [s].
        size: width and height of the frame when the window opens [px].
        look: theme and panels.
        view: function that returns the drawing data of the present state.
        start: function that restarts from an angle [rad] and a velocity [rad/s]; raises SceneError for invalid ones.
        another: function of n that returns the simulation (machine) with the integrator n places later in the list of
            those that fit the scene, None if no other fits.
        take: function that continues from the present state with a simulation that ``another`` returned.
    """

    apparatus: Apparatus
    dt: float
    size: tuple[int, int]
    look: FrameStyle
    view: Callable[[], View]
    start: Callable[[float, float], None]
    another: Callable[[int], Machine | None]
    take: Callable[[Machine], None]
