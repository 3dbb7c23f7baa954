"""Observations as controllers take them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def batch_of(observation: Any) -> NDArray[np.float64]:
    """Observations of shape (n, 3), or one of shape (3,), as (n, 3); ValueError for others, or not finite."""
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
