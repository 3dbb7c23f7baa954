"""Observations in the form that policies take, and a random policy for comparison."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.units import whole_number


def batch_of(observation: Any) -> NDArray[np.float64]:
    """Return observations of shape (n, 3), or one of shape (3,), as (n, 3).

    Raises ValueError for other shapes and for values that are not finite numbers.
    """
    try:
        given = np.asarray(observation)
        batch = given.astype(np.float64) if given.dtype.kind in "fiu" else None
    except (TypeError, ValueError):
        batch = None
    if batch is None:
        raise ValueError("Observations must be arrays of numbers.")
    if batch.ndim not in (1, 2) or batch.shape[-1] != 3:
        raise ValueError(f"Observations must have the shape (3,) or (n, 3), not {np.shape(observation)}.")
    if not np.isfinite(batch).all():
        raise ValueError("Observations must be finite.")
    return batch.reshape(-1, 3)


class RandomPolicy:
    """A policy with actions uniform in [-1, 1), for comparison with better ones.

    Args:
        seed: a whole number from 0.

    Raises SceneError for another seed.
    """

    __slots__ = ("_random",)

    def __init__(self, seed: int = 0) -> None:
        self._random = np.random.default_rng(whole_number(seed, "seed", least=0))

    def __call__(self, observation: Any) -> NDArray[np.float32]:
        """Return random actions: shape (1,) for an observation of shape (3,), (n, 1) for (n, 3).

        Raises ValueError for another shape or values that are not finite.
        """
        batch_of(observation)
        return self._random.uniform(-1.0, 1.0, (*np.shape(observation)[:-1], 1)).astype(np.float32)
