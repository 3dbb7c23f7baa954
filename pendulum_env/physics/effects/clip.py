"""The clip of the velocity in Gymnasium's Pendulum-v1, an artefact of that program and no physics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from pendulum_env.physics.effects.effect import Effect, Kind
from pendulum_env.physics.surroundings import Surroundings
from pendulum_env.physics.units import si


@dataclass(frozen=True)
class Clip(Effect):
    """A clip of the velocity after every step, as in Gymnasium's Pendulum-v1: no physics, and only in its scene.

    ``theta'`` becomes max(-clip_speed, min(clip_speed, theta')). Where a method's step ends with a drift, as that of
    symplectic_euler, the drift takes the clipped velocity. The energy that the clip takes is heat of its own,
    ``heat_clip`` in ``info``. The motion depends on the step: no motion is the true one where the clip acts.
    """

    clip_speed: float = si(8.0, "rad/s", "largest angular velocity", above=0.0)

    name: ClassVar[str] = "clip"
    kind: ClassVar[Kind] = "limit"
    number_name: ClassVar[str] = "v/v_max"
    equation: ClassVar[str] = ", max |theta'| = {clip_bound:.6g}"
    source: ClassVar[str] = "Gymnasium 1.0 (2024), classic_control/pendulum.py"
    limit: ClassVar[str] = "clip_bound"

    def coefficients(self, scene: Surroundings) -> dict[str, float]:
        return {"clip_bound": self.clip_speed}

    def number(self, scene: Surroundings, amplitude: float) -> float:
        return 2.0 * scene.omega0 * math.sin(0.5 * min(abs(amplitude), math.pi)) / self.clip_speed

    def predicted(self, scene: Surroundings, amplitude: float) -> tuple[float, float]:
        """Return no change of period and amplitude for swings that stay below the bound; nan for others."""
        return (0.0, 0.0) if self.number(scene, amplitude) <= 1.0 else (math.nan, math.nan)
