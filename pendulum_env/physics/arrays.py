"""Conversion of numbers, lists and arrays to float64 arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def float_array(value: Any) -> NDArray[np.float64]:
    """Return a number, nested lists of numbers or an array as a float64 array.

    Raises TypeError for anything else, including truth values.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind in "iufO":
            return array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise TypeError(f"no array of numbers: {type(value).__name__}")
