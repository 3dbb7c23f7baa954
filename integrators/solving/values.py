"""Checks and conversions of numbers of any type: floats, NumPy arrays, mpmath numbers, decimals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from decimal import Decimal
from numbers import Complex, Real
from typing import Any

import numpy as np

from integrators.errors import MethodError, shown

MOST_BITS = 2**16
"""Numbers of a type with more bits than this count as exact."""


def check_truth(value: Any, name: str) -> bool:
    """Return ``value`` as a bool if it is Python's or NumPy's True or False; raises MethodError otherwise."""
    scalar = value.item() if getattr(value, "shape", None) == () else value
    if not isinstance(scalar, bool):
        raise MethodError(f"{name} must be True or False, not {shown(value)}.")
    return scalar


def widened(value: Any) -> Any:
    """Convert NumPy floats and arrays narrower than float64 to float64, and NumPy integers to int.

    Other values are returned unchanged. Raises MethodError for NumPy's longdouble where it is wider than float64.
    """
    kind = getattr(value, "dtype", None)
    if kind is not None and kind.kind == "f" and kind.itemsize > 8:
        raise MethodError(f"{shown(value)} is of NumPy's longdouble, which solve does not compute with; convert it to "
                          "float64, or use numbers of mpmath.")
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, np.floating) and value.dtype.itemsize < 8:
        return float(value)
    narrow = isinstance(value, np.ndarray) and value.dtype.kind == "f" and value.dtype.itemsize < 8
    return value.astype(np.float64) if narrow else value


def state(value: Any, name: str) -> Any:
    """Return q or v as ``solve`` computes with it: a real number, or a new array of real numbers.

    Lists and tuples become arrays. Raises MethodError for complex numbers, for NumPy's longdouble, for masked and empty
    arrays, and for arrays of anything else.
    """
    if isinstance(value, np.ma.MaskedArray):
        raise MethodError(f"{name} must be a plain array, not a masked one; fill it, as by .filled(0.0).")
    try:
        array = np.array(value) if isinstance(value, (list, tuple, np.ndarray)) else None
    except ValueError:  # rows of several lengths
        raise MethodError(f"{name} must be a number or an array of real numbers, not {shown(value)}.") from None
    if is_complex(value if array is None else array):
        raise MethodError(f"{name} must be real, not {shown(value)}; give a complex number as an array of its real and "
                          "its imaginary part.")
    if array is not None and array.dtype.kind not in "iuf":
        raise MethodError(f"{name} must be a number or an array of real numbers, not {shown(value)}; numbers of mpmath "
                          "and other exact numbers are integrated one by one, not in an array.")
    if array is not None and not array.size:
        raise MethodError(f"{name} must have at least one component, not the shape {array.shape}.")
    return widened(value if array is None else array)


def is_complex(value: Any) -> bool:
    """Return True for complex numbers and arrays of them, whatever their imaginary part."""
    kind = getattr(value, "dtype", None)
    if kind is not None:
        return bool(kind.kind == "c")
    return isinstance(value, Complex) and not isinstance(value, Real)


def own_copy(value: Any, double: bool, name: str = "The acceleration") -> Any:
    """Return what a user's function returned, as it will stay: arrays are copied, as a function may reuse its array.

    Lists and tuples become arrays, arrays of numbers those of float64, and an array of shape () a number. ``double``
    says that the state is of doubles, to which other numbers are converted then. Raises MethodError for what is no real
    number and no array of real numbers; ``name`` is what it calls the function.
    """
    if type(value) is float:
        return value
    if isinstance(value, (list, tuple)):
        try:
            value = np.array(value)
        except ValueError:  # rows of several lengths
            return value
    if is_complex(value):
        raise MethodError(f"{name} must be real, not {shown(value)}.")
    if isinstance(value, np.ma.MaskedArray):  # checks of its numbers would skip those that are masked
        raise MethodError(f"{name} must be a plain array, not a masked one; fill it, as by .filled(0.0).")
    if isinstance(value, np.ndarray):
        value = value.astype(np.float64) if value.dtype.kind in "iuf" else value.copy()
        value = value if value.shape else value[()]
    value = widened(value)
    kind = getattr(value, "dtype", None)
    if value is None or isinstance(value, (bool, str, bytes)) or (kind is not None and kind.kind not in "fO"):
        raise MethodError(f"{name} must be finite numbers, not {shown(value)}.")
    if not (double and kind is None and isinstance(value, (Real, Decimal))):
        return value  # also the symbols with which a Taylor method records an acceleration
    try:
        return float(value)
    except OverflowError:
        return math.copysign(math.inf, value)


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
    if all(issubclass(kind, (float, int, np.generic, np.ndarray)) for kind in {*map(type, values)}):
        return np.array(values, dtype=float)
    objects = np.empty(len(values), dtype=object)
    objects[:] = values
    return objects


def misshapen(actual: tuple[int, ...], shape: tuple[int, ...], name: str = "The acceleration") -> str:
    """Return the error message for a function such as the acceleration whose shape differs from that of the state."""
    return f"{name} must have the shape of {'q and v' if name == 'The acceleration' else 'y'}, {shape}, not {actual}."


def rounding_unit(values: Sequence[Any]) -> Any:
    """Return the relative spacing of the coarsest number type among the values; for integers alone that of doubles.

    It is 2**-52 for doubles, 2**-23 for NumPy's float32, that of the working precision for mpmath numbers and decimals,
    and zero for fractions, which are exact.
    """
    samples = {type(value): value for value in values if not isinstance(value, (int, np.integer))}
    units = [_spacing(value) for value in samples.values()]
    return max(units) if units else _spacing(1.0)


def _spacing(value: Any) -> Any:
    """Return the difference between 1 and the next number of a value's type, as a power of two; zero if it is exact."""
    kind = getattr(value, "dtype", None)
    if kind is not None and kind.kind == "f":
        return float(np.finfo(kind).eps)
    one = value - value + 1
    low, high = 0, 1
    while one + one / 2**high != one:
        low, high = high, 2 * high
        if high > MOST_BITS:
            return value - value
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if one + one / 2**middle != one else (low, middle)
    return one / 2**low


def is_double(value: Any) -> bool:
    """Return True for floats and for arrays in double precision."""
    return isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype != object)
