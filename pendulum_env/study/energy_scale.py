"""What studies measure energy errors in."""

from __future__ import annotations

from typing import Any

import numpy as np

from pendulum_env.physics.scene import Scene


def energy_scale(scene: Scene, energy: Any) -> tuple[float, str]:
    """What energy errors are measured in [J], and its name.

    The energy at the start, counted from the bottom, where the scene keeps energy; elsewhere ``m g L``. Without
    gravity it is the energy at the start there too, or the largest where that is 0.
    """
    moved = [effect for effect in scene.of_kind("drive") if effect.torque and not effect.controlled]
    weight = scene.gravity * scene.weight_moment
    if (scene.of_kind("dissipative") or moved) and weight > 0.0:
        return weight, "m g L"
    start = float(energy[0])
    return (start, "the energy at the start") if start > 0.0 else (float(np.max(energy)), "the largest energy")
