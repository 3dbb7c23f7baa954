"""Numbers of any kind: floats, NumPy arrays, mpmath's, decimals; what they are and how they are kept."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from integrators.errors import MethodError, shown


def check_truth(value: Any, name: str) -> bool:
    """``value`` if it is True or False, NumPy's too; MethodError if not."""
    found = value.item() if getattr(value, "shape", None) == () else value
    if not isinstance(found, bool):
        raise MethodError(f"{name} must be True or False, not {shown(value)}.")
    return found


def widened(value: Any) -> Any:
    """NumPy's numbers and arrays narrower than float64 as float64, its whole numbers as int; all else as it is."""
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.floating) and value.dtype.itemsize < 8:
        return float(value)
    narrow = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.dtype.itemsize < 8
    return value.astype(np.float64) if narrow else value


def of_kind(zero: Any, value: Any) -> Any:
    """Whole numbers, and arrays of them, as numbers of the kind of ``zero``; everything else as it is."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "iu":
        return value.astype(np.float64) if isinstance(zero, float) else value + zero
    return value + zero if isinstance(value, int) else value


def is_finite(value: Any) -> bool:
    """Finite in all entries, for any kind of number; False for what is no number, as True is none."""
    if isinstance(value, (bool, np.bool_)):
        return False
    if isinstance(value, float):
        return math.isfinite(value)
    try:
        if isinstance(value, (int, np.ndarray, np.generic)):
            return bool(np.all(np.isfinite(value)))
        return bool(value - value == 0)
    except TypeError:
        return False


def is_real(value: Any) -> bool:
    """Finite, and one number that can be put in order with others."""
    try:
        return is_finite(value) and np.ndim(value) == 0 and bool(value > 0 or value <= 0)
    except TypeError:
        return False


def zero_of(*values: Any) -> Any:
    """Zero in the kind of number that the values make together; of arrays, an entry's kind.

    Raises MethodError where they do not add up.
    """
    kinds = {type(value): value - value for value in values if not isinstance(value, np.ndarray)}
    try:
        zero = sum(kinds.values())
    except TypeError:
        names = ", ".join(sorted(kind.__name__ for kind in kinds))
        raise MethodError(f"q, v, times, h and tolerances must be numbers that add up, not {names}.") from None
    return 0.0 if isinstance(zero, (int, np.integer)) else zero


def like(zero: Any, value: float) -> Any:
    """A float as a number of the kind of ``zero``, exactly if that kind can hold it."""
    if isinstance(zero, float):
        return value
    numerator, denominator = value.as_integer_ratio()
    return (zero + 1) * numerator / denominator


def column(values: list[Any]) -> Any:
    """One array per quantity; numbers of other kinds stay themselves."""
    if isinstance(values[-1], (float, int, np.generic, np.ndarray)):
        return np.array(values, dtype=float)
    found = np.empty(len(values), dtype=object)
    found[:] = values
    return found


def misshapen(found: tuple[int, ...], shape: tuple[int, ...]) -> str:
    """What to say of an acceleration that does not have the shape of the state."""
    return f"The acceleration must have the shape of q and v, {shape}, but makes {found} of it."


def is_double(value: Any) -> bool:
    """True for numbers and arrays in double precision."""
    return isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype != object)
