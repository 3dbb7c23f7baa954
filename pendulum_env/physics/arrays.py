"""Arrays of numbers, from whatever holds them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def float_array(value: Any) -> NDArray[np.float64]:
    """A number, or an array or nested lists of numbers, as float64; TypeError for anything else, truth values too."""
    try:
        given = np.asarray(value)
        if given.dtype.kind in "iufO":
            return given.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise TypeError(f"no array of numbers: {type(value).__name__}")
