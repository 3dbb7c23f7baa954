"""Models that a recording may call for: the dampings that a decay can give, and those that geometry gives."""

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
"""Velocities at which torques are compared [rad/s]."""
ANGLES = (-1.0, 0.0, 0.5)
"""And angles [rad]."""

Names = tuple[str, ...]


@cache
def shapes() -> Mapping[str, Names]:
    """Dampings with a number that a decay can give, by the first of those whose torques are proportional.

    A recording cannot tell those of one shape apart, whatever it is. Found from the torques themselves.
    """
    found: dict[str, Names] = {}
    torques: dict[str, np.ndarray] = {}
    for name, effect in DAMPINGS.items():
        if not effect.fitted:
            continue
        torques[name] = own = _torques(name)
        like = next((one for one in found if np.allclose(torques[one], own, rtol=1e-9, atol=0.0)), None)
        found[like or name] = (*found.get(like or name, ()), name)
    return found


def _torques(name: str) -> np.ndarray:
    """The torques of one damping in a scene that has nothing else, over the first of them."""
    plain = Scene("shape", medium=VACUUM)
    scene = with_damping(plain, {name: {DAMPINGS[name].fitted: 1.0}})
    effect, values = scene.effects[0], scene.coefficients
    found = [still_torque(effect, values, angle, side * speed) for angle in ANGLES for side in (1.0, -1.0)
             for speed in SPEEDS]
    return np.array(found) / found[0]


def candidates(scene: Scene, known: bool) -> list[Names]:
    """All sums of dampings of different shape, none included; where the bob is known, also the drag that its geometry
    and medium give, alone and with those that are no model of the same.

    Args:
        scene: what hangs there, in what.
        known: True if the bob's radius and mass are.
    """
    own = [*shapes()]
    found = [names for count in range(len(own) + 1) for names in combinations(own, count)]
    drag = geometric(scene) if known else ()
    if drag:
        found += [(*drag, *names) for names in found if _goes(scene, (*drag, *names))]
    return found


def geometric(scene: Scene) -> Names:
    """Dampings that geometry and medium give without a number; the suspension's only if the scene has it, or tells its
    thickness."""
    return tuple(name for name, effect in DAMPINGS.items() if not effect.fitted and effect.trial(scene) is not None
                 and (effect.at_bob or scene.body.thickness is not None or scene.has(effect.name)))


def _goes(scene: Scene, names: Names) -> bool:
    """True if one scene can hold these dampings."""
    try:
        with_damping(scene, idle(names))
    except SceneError:
        return False
    return True


def program(scene: Scene, damping: Names) -> Names:
    """Dampings to compile for a model, so that few programs serve all: those of all shapes that go with its own; dry
    friction, which takes time, only if it has some, or drag that takes more."""
    found = tuple(name for name in damping if not DAMPINGS[name].fitted)
    dry = bool(found) or any(DAMPINGS[name].dry for name in damping)
    if any(DAMPINGS[name].fitted and name not in shapes() for name in damping):
        return damping
    for name in shapes():
        if (dry or not DAMPINGS[name].dry) and _goes(scene, (*found, name)):
            found = (*found, name)
    return found


def asked_for(effects: object, scene: Scene, known: bool) -> list[Names]:
    """The models that ``effects=`` names: "auto", one, or a list of them; SceneError for anything else."""
    if isinstance(effects, str):
        return candidates(scene, known) if effects == AUTO else [_sum(effects)]
    if not isinstance(effects, (list, tuple)) or not effects:
        raise SceneError(f"effects must be '{AUTO}', dampings joined by +, or a list of such, not {shown(effects)}.")
    found = [_sum(one) for one in effects]
    for names in found:
        if [set(names) for names in found].count(set(names)) > 1:
            raise SceneError(f"effects names the model {'+'.join(names) or NONE} twice.")
    return found


def _sum(text: object) -> Names:
    """The dampings of one model."""
    if not isinstance(text, str):
        raise SceneError(f"A model in effects must be dampings joined by +, not {shown(text)}.")
    if text.strip() == NONE:
        return ()
    names = tuple(name.strip() for name in text.split("+"))
    for name in names:
        if name not in DAMPINGS:
            raise SceneError(f"There is no damping {shown(name)} in effects{nearest(name, [AUTO, NONE, *DAMPINGS])}")
    if len(set(names)) < len(names):
        raise SceneError(f"effects={shown(text)} names one damping twice.")
    return names
