"""Checks and shapes that the closed forms share."""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Real = TypeVar("Real", float, FloatArray)

_RANGES = {"finite": -math.inf, "finite and >= 0": 0.0, "finite and > 0": math.ulp(0.0)}


def number(name: str, value: float, allowed: str = "finite") -> float:
    if not (math.isfinite(value) and value >= _RANGES[allowed]):
        raise ValueError(f"{name} must be {allowed}, not {value}")
    return float(value)


def array(name: str, value: float | FloatArray) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite everywhere")
    return array


def shaped(array: Any) -> Any:
    """A 0-d result as a scalar, any other as it is."""
    return np.asarray(array)[()]


def rise(rate: float, time: FloatArray) -> FloatArray:
    """(1 - exp(-rate time)) / rate, and its limit `time` at rate = 0."""
    return -np.expm1(-rate * time) / rate if rate else time


def motion(angles: FloatArray, velocities: FloatArray) -> tuple[Any, Any]:
    if not (np.isfinite(angles).all() and np.isfinite(velocities).all()):
        raise ValueError("time must stay where the motion is a finite float")
    return shaped(angles), shaped(velocities)
