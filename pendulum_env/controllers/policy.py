"""A policy maps observations to actions: how policies take observations, and the random one to compare with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.units import whole_number


def batch_of(observation: Any) -> NDArray[np.float64]:
    """Return observations of shape (n, 3), or one of shape (3,), as (n, 3); ValueError for others, or not finite."""
    try:
        given = np.asarray(observation)
        found = given.astype(np.float64) if given.dtype.kind in "fiu" else None
    except (TypeError, ValueError):
        found = None
    if found is None:
        raise ValueError("Observations must be arrays of numbers.")
    if found.ndim not in (1, 2) or found.shape[-1] != 3:
        raise ValueError(f"Observations must have the shape (3,) or (n, 3), not {np.shape(observation)}.")
    if not np.isfinite(found).all():
        raise ValueError("Observations must be finite.")
    return found.reshape(-1, 3)


class RandomPolicy:
    """Actions uniform in [-1, 1), whatever is observed: what others have to beat.

    Args:
        seed: a whole number from 0.

    Raises SceneError for another seed.
    """

    def __init__(self, seed: int = 0) -> None:
        self._random = np.random.default_rng(whole_number(seed, "seed", least=0))

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Shape (1,) for an observation of shape (3,), (n, 1) for (n, 3); ValueError for others."""
        batch_of(observation)
        return self._random.uniform(-1.0, 1.0, (*np.shape(observation)[:-1], 1)).astype(np.float32)
