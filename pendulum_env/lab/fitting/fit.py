"""From a recording to the scene that follows it."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

import numpy as np

from pendulum_env.lab.fitting.model import LENGTH, Model
from pendulum_env.lab.fitting.result import Fit
from pendulum_env.lab.fitting.shooting import solve
from pendulum_env.lab.fitting.start import measured_start
from pendulum_env.lab.measures import noise_level
from pendulum_env.lab.recording import Recording
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import FiniteBob, Gravity
from pendulum_env.physics.medium import air
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene
from pendulum_env.progress import Progress, telling_of


def fit(
    recording: Recording,
    effects: str = "auto",
    *,
    scene: str | Scene | Mapping[str, object] | PathLike[str] | None = None,
    free: tuple[str, ...] = (LENGTH,),
    progress: Progress | bool = False,
    **parameters: Any,
) -> Fit:
    """Fit a scene's numbers to a recording, by least squares of the whole trajectory.

    Args:
        recording: as read; it is cut at the release.
        effects: dampings joined by "+", as ``damping=`` takes them.
        scene: what hangs there, in what; its own damping is left out. By default a pendulum in air that is told only
            by ``parameters``.
        free: parameters of the scene that are fitted beside the dampings' numbers: the length, or ``("gravity",)``.
        progress: True shows a bar; or what is called with the fraction done and a word for it.
        **parameters: what is known of the scene, such as ``length=0.65, mass=0.0415``.
    """
    swing = recording.released()
    place = _place(scene, parameters)
    model = Model.of(place, tuple(effects.split("+")), swing.time, free)
    sigma = noise_level(swing.time, swing.angle)
    start = measured_start(model, swing)
    with telling_of(progress, "fit") as telling:
        found = solve(model, swing.angle, np.full(len(swing.time), sigma), start, telling)
    return Fit(swing, found, sigma)


def _place(scene: str | Scene | Mapping[str, object] | PathLike[str] | None, parameters: Mapping[str, Any]) -> Scene:
    """The scene as it is known. A bob whose radius is told is one of finite size."""
    if scene is not None:
        return find_scene(scene).replace(**parameters)
    sized = (FiniteBob(),) if "radius" in parameters else ()
    return Scene("recorded", Body(), air(20.0), (Gravity(), *sized)).replace(**parameters)
