"""Interface between a running pendulum and the window that shows and changes it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

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
        another: function of a name or of n that returns the simulation (machine) with the integrator of this name, or
            with that n places later in the list of those that fit the scene; None if it already runs. Raises
            MethodError for an integrator that does not fit the scene.
        take: function that continues from the present state with a simulation that ``another`` returned.
        facts: function that returns scene, method and settings, for the provenance of a saved picture.
    """

    apparatus: Apparatus
    dt: float
    size: tuple[int, int]
    look: FrameStyle
    view: Callable[[], View]
    start: Callable[[float, float], None]
    another: Callable[[str | int], Machine | None]
    take: Callable[[Machine], None]
    facts: Callable[[], Mapping[str, Any]]
