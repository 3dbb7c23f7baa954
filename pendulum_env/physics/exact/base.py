"""Checks and shapes that the closed forms share."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics import units
from pendulum_env.physics.arrays import float_array
from pendulum_env.physics.units import SceneError, shown, whole_number

FloatArray = NDArray[np.float64]
Real = TypeVar("Real", float, FloatArray)
P = ParamSpec("P")
R = TypeVar("R")

MOST = 10**7
"""Steps or half swings, at most."""

_RANGES = {"finite": -math.inf, "finite and >= 0": 0.0, "finite and > 0": math.ulp(0.0)}


def number(name: str, value: float, allowed: str = "finite") -> float:
    try:
        found = units.number(value, name)
    except SceneError:
        raise SceneError(f"{name} must be {allowed}, not {shown(value)}") from None
    if found < _RANGES[allowed]:
        raise SceneError(f"{name} must be {allowed}, not {value}")
    return found


def count(name: str, value: int) -> int:
    return whole_number(value, name, MOST, least=0)


def array(name: str, value: float | FloatArray) -> FloatArray:
    try:
        array = float_array(value)
    except TypeError:
        raise SceneError(f"{name} must be a number or an array of numbers, not {shown(value)}") from None
    if not np.isfinite(array).all():
        raise SceneError(f"{name} must be finite everywhere")
    return array


def in_floats(function: Callable[P, R]) -> Callable[P, R]:
    """A closed form that says so where its numbers leave what floats hold: it raises SceneError."""

    @wraps(function)
    def called(*arguments: P.args, **keywords: P.kwargs) -> R:
        try:
            with np.errstate(all="ignore"):
                found = function(*arguments, **keywords)
        except SceneError:
            raise
        except (ArithmeticError, ValueError):
            found = None
        parts: tuple[Any, ...] = found if isinstance(found, tuple) else (math.nan if found is None else found,)
        if found is None or not all(np.isfinite(part).all() for part in parts):
            raise SceneError(f"{function.__name__} leaves the range of floats with these numbers; take smaller ones.")
        return found

    return called


def shaped(array: Any) -> Any:
    """A 0-d result as a scalar, any other as it is."""
    return np.asarray(array)[()]


def rise(rate: float, time: FloatArray) -> FloatArray:
    """(1 - exp(-rate time)) / rate, and its limit `time` at rate = 0."""
    return -np.expm1(-rate * time) / rate if rate else time


def motion(angles: FloatArray, velocities: FloatArray) -> tuple[Any, Any]:
    if not (np.isfinite(angles).all() and np.isfinite(velocities).all()):
        raise SceneError("time must stay where the motion is a finite float")
    return shaped(angles), shaped(velocities)
