"""What a vector of environments is asked for, checked: modes, masks, seeds, starts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from pendulum_env.engine.starts import checked_start
from pendulum_env.engine.streams import MOST_SEED
from pendulum_env.physics.scene import Scene
from pendulum_env.physics.units import SceneError, one_of, shown

Array = NDArray[np.float64]
Places = NDArray[np.intp]


def autoreset_mode_of(mode: Any) -> AutoresetMode:
    """The autoreset mode of this value or name; SceneError if there is none."""
    names = [entry.value for entry in AutoresetMode]
    if isinstance(mode, AutoresetMode):
        return mode
    return AutoresetMode(one_of(mode, "autoreset_mode", names))


def checked_mask(mask: Any, size: int) -> NDArray[np.bool_]:
    """A mask of environments to reset; SceneError if it is none, or marks none."""
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (size,):
        raise SceneError(f"reset_mask must be an array of {size} booleans, not {shown(mask)}.")
    if not mask.any():
        raise SceneError("reset_mask must mark at least one environment, not none.")
    return mask


def checked_starts(scene: Scene, asked: Mapping[str, Any], which: Places, size: int) -> tuple[Array, Array]:
    """Angles [rad] and velocities [rad/s] of the environments at these places, from one number or one for each.

    Raises SceneError for another shape, or values that cannot be a start.
    """
    found = {}
    for name, values in asked.items():
        wanted = f"{name} must be one number or one for each of {size} environments"
        try:
            shape = np.shape(values)
        except ValueError:
            raise SceneError(f"{wanted}, not {shown(values)}.") from None
        if shape not in ((), (size,)):
            raise SceneError(f"{wanted}, not {shape}.")
        found[name] = np.broadcast_to(np.asarray(values), (size,))[which]
    angle, velocity = checked_start(scene, found["angle"], found["velocity"])
    return angle, velocity


def checked_seeds(seed: Any, size: int) -> NDArray[np.uint64] | list[int | None] | None:
    """One seed for each environment, None where there is none; SceneError for anything that is no seed."""
    if seed is None:
        return None
    seeds: list[int | None] = []
    if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool):
        if 0 <= seed <= 2**64 - size:
            return np.arange(size, dtype=np.uint64) + np.uint64(seed)
        seeds = [int(seed) + place for place in range(size)]
    elif isinstance(seed, (list, tuple)) or (isinstance(seed, np.ndarray) and seed.ndim):
        seeds = [entry.item() if isinstance(entry, np.generic) else entry for entry in seed]
    if len(seeds) != size:
        raise SceneError(f"seed must be one whole number or one for each of {size} environments, not {shown(seed)}.")
    for place, entry in enumerate(seeds):
        whole = isinstance(entry, int) and not isinstance(entry, bool) and 0 <= entry <= MOST_SEED
        if entry is not None and not whole:
            raise SceneError(
                f"A seed must be a whole number from 0 to 2**128 - 1; that of environment {place} is {shown(entry)}."
            )
    return seeds


def marked(name: str, places: NDArray[np.intp], values: Iterable[Any], size: int) -> dict[str, NDArray[Any]]:
    """An entry of infos that some environments have, and its mask: objects, None at the other places."""
    found, mask = np.full(size, None, dtype=object), np.zeros(size, dtype=np.bool_)
    for place, value in zip(places.tolist(), values, strict=True):
        found[place] = value
    mask[places] = True
    return {name: found, f"_{name}": mask}
