"""Chance."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pendulum_env.controllers.seen import batch_of
from pendulum_env.physics.units import whole_number


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
