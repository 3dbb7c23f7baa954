"""Damping models to compare for a recording, with parameters to fit or with drag calculated from the geometry."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import combinations

import numpy as np

from pendulum_env.lab.fitting.model import idle
from pendulum_env.physics.damping import NONE, with_damping
from pendulum_env.physics.effects import DAMPINGS
from pendulum_env.physics.flow import still_torque
from pendulum_env.physics.medium import VACUUM
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, nearest, shown

AUTO = "auto"
SPEEDS = (0.01, 0.1, 1.0, 10.0)
"""Velocities at which the torques of dampings are compared [rad/s]."""
ANGLES = (-1.0, 0.0, 0.5)
"""Angles at which the torques of dampings are compared [rad]."""

Names = tuple[str, ...]
"""Names of the dampings that make up one model."""


@cache
def shapes() -> Mapping[str, Names]:
    """Group the dampings (dissipative effects) that have a parameter to fit by the shape of their torque.

    Torques of one shape are proportional to each other at all angles and velocities, so no recording can tell them
    apart. The key is the first damping of a group, the value the names of all its dampings.
    """
    groups: dict[str, Names] = {}
    torques: dict[str, np.ndarray] = {}
    for name, effect in DAMPINGS.items():
        if not effect.fitted:
            continue
        torques[name] = own = _torques(name)
        like = next((one for one in groups if np.allclose(torques[one], own, rtol=1e-9, atol=0.0)), None)
        groups[like or name] = (*groups.get(like or name, ()), name)
    return groups


def _torques(name: str) -> np.ndarray:
    """Return the torques of one damping at fixed angles and speeds, of both signs, divided by the first of them."""
    plain = Scene("shape", medium=VACUUM)
    scene = with_damping(plain, {name: {DAMPINGS[name].fitted: 1.0}})
    effect, values = scene.effects[0], scene.coefficients
    torques = [still_torque(effect, values, angle, side * speed) for angle in ANGLES for side in (1.0, -1.0)
               for speed in SPEEDS]
    return np.array(torques) / torques[0]


def candidates(scene: Scene, known: bool) -> list[Names]:
    """Return all damping models to compare: every sum of dampings of different shape, and no damping.

    For a bob of known radius and mass, there is also the drag calculated from geometry and medium, alone and with every
    sum that does not model the same effect twice.

    Args:
        scene: the pendulum and its surroundings.
        known: True if the radius and mass of the bob are known.
    """
    own = [*shapes()]
    models = [names for count in range(len(own) + 1) for names in combinations(own, count)]
    drag = geometric(scene) if known else ()
    if drag:
        models += [(*drag, *names) for names in models if _compatible(scene, (*drag, *names))]
    return models


def geometric(scene: Scene) -> Names:
    """Return the dampings that are calculated from geometry and medium, without a parameter to fit.

    Drag on the suspension is included only if the scene has that effect or gives the suspension's thickness.
    """
    return tuple(name for name, effect in DAMPINGS.items() if not effect.fitted
                 and (trial := effect.trial(scene)) is not None and trial.needs not in scene.body.lacks
                 and (effect.at_bob or scene.body.diameter_known or scene.has(effect.name)))


def _compatible(scene: Scene, names: Names) -> bool:
    """Return True if one scene can have all the named dampings together."""
    try:
        with_damping(scene, idle(names))
    except SceneError:
        return False
    return True


def program(scene: Scene, damping: Names) -> Names:
    """Return the dampings to compile into the simulation program of a model, so that a few programs serve all models.

    They are the model's dampings, and one for every other shape of torque that can be combined with these. Dry
    friction is included only if the model has it, because it takes up to six times as long to simulate.
    """
    names = tuple(name for name in damping if not DAMPINGS[name].fitted)
    dry = any(DAMPINGS[name].dry for name in damping)
    if any(DAMPINGS[name].fitted and name not in shapes() for name in damping):
        return damping
    for name in shapes():
        if (dry or not DAMPINGS[name].dry) and _compatible(scene, (*names, name)):
            names = (*names, name)
    return names


def models_of(effects: object, scene: Scene, known: bool) -> list[Names]:
    """Return the damping models that ``effects=`` names: "auto", one model, or a list; SceneError for anything else.

    ``known``: True if the radius and mass of the bob are known.
    """
    if isinstance(effects, str):
        return candidates(scene, known) if effects == AUTO else [_sum(effects)]
    if not isinstance(effects, (list, tuple)) or not effects:
        raise SceneError(f"effects must be '{AUTO}', dampings joined by +, or a list of these, not {shown(effects)}.")
    models = [_sum(one) for one in effects]
    for names in models:
        if [set(names) for names in models].count(set(names)) > 1:
            raise SceneError(f"effects names the model {'+'.join(names) or NONE} twice.")
    return models


def _sum(text: object) -> Names:
    """Return the dampings in the text of a model, such as "linear+quadratic"; SceneError for an invalid text."""
    if not isinstance(text, str):
        raise SceneError(f"A model in effects= must be text, such as 'linear+quadratic', not {shown(text)}.")
    if text.strip() == NONE:
        return ()
    names = tuple(name.strip() for name in text.split("+"))
    for name in names:
        if name not in DAMPINGS:
            raise SceneError(f"There is no damping {shown(name)} in effects{nearest(name, [AUTO, NONE, *DAMPINGS])}")
    if len(set(names)) < len(names):
        raise SceneError(f"effects={shown(text)} names one damping twice.")
    return names
