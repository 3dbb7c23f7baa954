"""Checks and conversions of numbers of any type: floats, NumPy arrays, mpmath numbers, decimals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from integrators.errors import MethodError, shown


def check_truth(value: Any, name: str) -> bool:
    """Return ``value`` as a bool if it is Python's or NumPy's True or False; raises MethodError otherwise."""
    scalar = value.item() if getattr(value, "shape", None) == () else value
    if not isinstance(scalar, bool):
        raise MethodError(f"{name} must be True or False, not {shown(value)}.")
    return scalar


def widened(value: Any) -> Any:
    """Convert NumPy floats and arrays narrower than float64 to float64, and NumPy integers to int.

    Other values are returned unchanged.
    """
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.floating) and value.dtype.itemsize < 8:
        return float(value)
    narrow = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.dtype.itemsize < 8
    return value.astype(np.float64) if narrow else value


def of_kind(zero: Any, value: Any) -> Any:
    """Convert an integer or an integer array to the number type of ``zero``; return other values unchanged."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "iu":
        return value.astype(np.float64) if isinstance(zero, float) else value + zero
    return value + zero if isinstance(value, int) else value


def is_finite(value: Any) -> bool:
    """Return True if all entries of a number or array are finite; False if it is not a number, or a bool."""
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
    """Return True if a value is one finite real number, of a type that can be compared."""
    try:
        return is_finite(value) and np.ndim(value) == 0 and bool(value > 0 or value <= 0)
    except TypeError:
        return False


def zero_of(*values: Any) -> Any:
    """Return zero in the number type of the sum of the values; arrays are ignored.

    The type of q, v, times and tolerances decides the arithmetic of a solution. Raises MethodError if their types
    cannot be added.
    """
    kinds = {type(value): value - value for value in values if not isinstance(value, np.ndarray)}
    try:
        zero = sum(kinds.values())
    except TypeError:
        names = ", ".join(sorted(kind.__name__ for kind in kinds))
        raise MethodError(
            f"q, v, times, h and tolerances must have compatible numeric types, not {names}.") from None
    return 0.0 if isinstance(zero, (int, np.integer)) else zero


def like(zero: Any, value: float) -> Any:
    """Convert a float to the number type of ``zero``, exactly if that type can represent it."""
    if isinstance(zero, float):
        return value
    numerator, denominator = value.as_integer_ratio()
    return (zero + 1) * numerator / denominator


def column(values: list[Any]) -> Any:
    """Return values as an array of float64, or as an object array for numbers of other types."""
    if isinstance(values[-1], (float, int, np.generic, np.ndarray)):
        return np.array(values, dtype=float)
    objects = np.empty(len(values), dtype=object)
    objects[:] = values
    return objects


def misshapen(actual: tuple[int, ...], shape: tuple[int, ...]) -> str:
    """Return the error message for an acceleration whose shape differs from that of the state q and v."""
    return f"The acceleration must have the shape of q and v, {shape}, not {actual}."


def is_double(value: Any) -> bool:
    """Return True for floats and for arrays in double precision."""
    return isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype != object)
