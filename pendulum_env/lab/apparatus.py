"""What hangs in front of the sensor, as far as it is told."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import FiniteBob, Gravity
from pendulum_env.physics.medium import air
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene


def apparatus(scene: str | Scene | Mapping[str, object] | PathLike[str] | None, told: Mapping[str, Any]) -> Scene:
    """The scene of a recording with the numbers ``told``; None: a pendulum in air of 20 °C, without damping.

    A bob whose radius is told is then one of finite size. Raises SceneError for a scene or numbers that cannot be.
    """
    if scene is not None:
        return find_scene(scene).replace(**told)
    sized = (FiniteBob(),) if "radius" in told else ()
    return Scene("recorded", Body(), air(20.0), (Gravity(), *sized)).replace(**told)
