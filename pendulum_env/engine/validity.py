"""Check that the formulas of a scene's effects hold at the speeds that a run reaches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.many import Many, plain
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.flow import terminal_speed
from pendulum_env.physics.scene import Scene

Array = NDArray[np.float64]

FASTER = tuple(1e-6 * 4.0**k for k in range(21))
"""Higher speeds that a driven bob may reach [m/s]."""


def beyond(scene: Scene, speed: float, control: bool) -> str:
    """Return the names of effects with formulas that do not hold at this speed of the bob [m/s], with reasons.

    The text is "" if all formulas hold, and for speed 0. If a drive or a wind acts, or may act with ``control``, the
    bob may get faster: then a formula is named only if it holds at no higher speed either. The speed of the wind does
    not count.
    """
    pushed = any(effect.kind == "medium" or (effect.kind == "drive" and (control or not effect.controlled))
                 for effect in scene.effects)
    faults = []
    for effect in scene.effects:
        reason = effect.outside(scene, speed) if speed else ""
        if reason and not (pushed and any(not effect.outside(scene, more) for more in FASTER if more > speed)):
            faults.append(f"{effect.name} ({reason})")
    return ", ".join(faults)


@dataclass
class Validity:
    """Check of the formulas in the scenes of runs; ``warning`` names those that do not hold in the first such run.

    A formula here is that of an effect, such as a drag law, which holds up to some speed. ``warning`` is "" as long as
    all formulas hold.

    Args:
        size, what: number of runs, and the word for one run in messages, such as "run" or "environment".
        angle, velocity: initial conditions [rad, rad/s], arrays of ``size``; None for those of each scene's usual run.
        control: False if no motor torque acts.
    """

    size: int = 1
    what: str = "run"
    angle: Array | None = None
    velocity: Array | None = None
    control: bool = True
    warning: str = field(default="", init=False)

    def clear(self, scene: Scene, places: NDArray[np.intp]) -> bool:
        """Return True if the formulas of all effects hold in the runs ``places``.

        The runs are given as one scene, in which parameters that differ are Many numbers (one value per run).
        """
        if self.warning or not any(type(effect).outside is not Effect.outside for effect in scene.effects):
            return True
        return not beyond(scene, Many(self._speeds(scene, places)), self.control)  # type: ignore[arg-type]

    def look(self, scene: Scene, places: Sequence[int]) -> None:
        """Check the effects' formulas for the runs ``places`` of one scene, and set ``warning`` if one does not hold.
        """
        if self.warning or not any(type(effect).outside is not Effect.outside for effect in scene.effects):
            return
        speeds = self._speeds(scene, np.asarray(places))
        if not any(beyond(scene, float(speed), self.control) for speed in {speeds.min(), speeds.max()}):
            return
        speeds = self._speeds(scene, np.asarray(places), slowed=True)
        if not any(beyond(scene, float(speed), self.control) for speed in {speeds.min(), speeds.max()}):
            return
        place, speed, fault = next(
            (place, speed, fault) for place, speed in zip(places, speeds.tolist(), strict=True)
            if (fault := beyond(scene, speed, self.control))
        )
        alike = self.angle is None and self.velocity is None and len(places) == self.size
        which = "" if alike or self.size == 1 else f"{self.what} {place} of {self.size}, in "
        self.warning = (
            f"In {which}the scene '{scene.name}', up to {speed:.3g} m/s at the bottom, formulas do not hold: {fault}."
        )

    def _speeds(self, scene: Scene, places: NDArray[np.intp], slowed: bool = False) -> Array:
        """Return upper bounds of the bob's speed [m/s] in the runs ``places``, without losses.

        With ``slowed`` they are bounded by the terminal speed, at which drag balances gravity.
        """
        angle = np.full(len(places), scene.run.angle) if self.angle is None else self.angle[places]
        velocity = np.full(len(places), scene.run.velocity) if self.velocity is None else self.velocity[places]
        start = np.abs(velocity * plain(scene.body.reach))
        speed: Array = np.hypot(start, plain(2.0 * scene.omega0 * scene.body.reach) * np.sin(0.5 * angle))
        if slowed:
            steepest = float(np.max(np.sin(np.minimum(np.abs(angle), 0.5 * math.pi))))
            speed = np.maximum(start, np.minimum(speed, terminal_speed(scene, steepest)))
        return speed
