"""Whether the formulas of a scene's effects hold where a run takes them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.many import Many, plain
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.flow import bottom_speed, terminal_speed
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

FASTER = tuple(1e-6 * 4.0**k for k in range(21))
"""Speeds that a driven bob may come to [m/s]."""


def beyond(scene: Scene, speed: float, control: bool) -> str:
    """Which effects' formulas do not hold up to this speed of the bob [m/s], and why; "" if all do.

    Where a drive or a wind acts, or may with a ``control``, the bob may come to be faster: told then is only what
    holds at no higher speed either. The speed of a wind is not counted. At rest nothing is to be held.
    """
    pushed = any(effect.kind == "medium" or (effect.kind == "drive" and (control or not effect.controlled))
                 for effect in scene.effects)
    found = []
    for effect in scene.effects:
        said = effect.outside(scene, speed) if speed else ""
        if said and not (pushed and any(not effect.outside(scene, more) for more in FASTER if more > speed)):
            found.append(f"{effect.name} ({said})")
    return ", ".join(found)


class Validity:
    """Looks at the scenes of runs for formulas that do not hold; ``said`` is a sentence on the first, "" without any.

    Args:
        size, what: number of runs, and the word for one.
        angle, velocity: their starts [rad, rad/s], arrays of ``size``; None for the usual run of each scene.
        control: False if no control acts.
    """

    def __init__(
        self, size: int = 1, what: str = "run", angle: Array | None = None, velocity: Array | None = None,
        control: bool = True,
    ) -> None:
        self._size, self._what, self._control = size, what, control
        self._angle, self._velocity, self.said = angle, velocity, ""

    def clear(self, scene: Scene, places: NDArray[np.intp]) -> bool:
        """Return True if nothing can be said of the runs at these places, whose scenes are one of Many numbers."""
        if self.said or not any(type(effect).outside is not Effect.outside for effect in scene.effects):
            return True
        return not beyond(scene, Many(self._speeds(scene, places)), self._control)  # type: ignore[arg-type]

    def look(self, scene: Scene, places: Sequence[int]) -> None:
        """Judge the runs of a scene at these successive places, each from its start to the bottom without losses."""
        if self.said or not any(type(effect).outside is not Effect.outside for effect in scene.effects):
            return
        speeds = self._speeds(scene, np.asarray(places))
        if not any(beyond(scene, float(speed), self._control) for speed in {speeds.min(), speeds.max()}):
            return
        speeds = self._speeds(scene, np.asarray(places), slowed=True)
        if not any(beyond(scene, float(speed), self._control) for speed in {speeds.min(), speeds.max()}):
            return
        place, speed, said = next(
            (place, speed, said) for place, speed in zip(places, speeds.tolist(), strict=True)
            if (said := beyond(scene, speed, self._control))
        )
        alike = self._angle is None and self._velocity is None and len(places) == self._size
        which = "" if alike or self._size == 1 else f"{self._what} {place} of {self._size}, in "
        self.said = (
            f"In {which}the scene '{scene.name}', up to {speed:.3g} m/s at the bottom, formulas do not hold: {said}."
        )

    def _speeds(self, scene: Scene, places: NDArray[np.intp], slowed: bool = False) -> Array:
        """Bounds of the bob's speed without losses or, ``slowed``, also where these balance the weight [m/s]."""
        angle = np.full(len(places), scene.run.angle) if self._angle is None else self._angle[places]
        velocity = np.full(len(places), scene.run.velocity) if self._velocity is None else self._velocity[places]
        start = np.abs(velocity * plain(scene.body.length))
        found: Array = np.hypot(start, plain(bottom_speed(scene, math.pi)) * np.sin(0.5 * angle))
        if slowed:
            steepest = float(np.max(np.sin(np.minimum(np.abs(angle), 0.5 * math.pi))))
            found = np.maximum(start, np.minimum(found, terminal_speed(scene, steepest)))
        return found
