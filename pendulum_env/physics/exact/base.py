"""Argument checks and helpers shared by the closed forms of the pendulum's motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from pendulum_env.common.checks import float_array
from pendulum_env.physics import units
from pendulum_env.physics.units import SceneError, shown, whole_number

FloatArray = NDArray[np.float64]
Real = TypeVar("Real", float, FloatArray)
P = ParamSpec("P")
R = TypeVar("R")

MOST = 10**7
"""Largest number of steps or half swings."""

_RANGES = {"finite": -math.inf, "finite and >= 0": 0.0, "finite and > 0": math.ulp(0.0)}


def number(name: str, value: float, allowed: str = "finite") -> float:
    """Return an argument of a closed form as a float; SceneError if it is not in the ``allowed`` range."""
    try:
        result = units.number(value, name)
    except SceneError:
        raise SceneError(f"{name} must be {allowed}, not {shown(value)}") from None
    if result < _RANGES[allowed]:
        raise SceneError(f"{name} must be {allowed}, not {value}")
    return result


def count(name: str, value: int) -> int:
    """Return an argument of a closed form as a whole number from 0 to 10 million (MOST); SceneError otherwise."""
    return whole_number(value, name, MOST, least=0)


def array(name: str, value: float | FloatArray) -> FloatArray:
    """Return an argument of a closed form as an array of finite floats; SceneError otherwise."""
    try:
        array = float_array(value)
    except TypeError:
        raise SceneError(f"{name} must be a number or an array of numbers, not {shown(value)}") from None
    if not np.isfinite(array).all():
        raise SceneError(f"{name} must be finite everywhere")
    return array


def in_floats(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a closed form, a function, to raise SceneError where its result overflows or is undefined."""
    overflows = f"{function.__name__} overflows with these arguments; use smaller numbers."

    @wraps(function)
    def called(*arguments: P.args, **keywords: P.kwargs) -> R:
        try:
            with np.errstate(all="ignore"):
                result = function(*arguments, **keywords)
        except SceneError:
            raise
        except (ArithmeticError, ValueError):
            raise SceneError(overflows) from None
        parts: tuple[Any, ...] = result if isinstance(result, tuple) else () if result is None else (result,)
        if not all(np.isfinite(part).all() for part in parts):
            raise SceneError(overflows)
        return result

    return called


def shaped(array: Any) -> Any:
    """Return a 0-d array as a scalar, and any other array unchanged."""
    return np.asarray(array)[()]


def rise(rate: float, time: FloatArray) -> FloatArray:
    """Return (1 - exp(-rate time)) / rate, the integral of exp(-rate t) from 0 to ``time``.

    At rate = 0 this is ``time``.
    """
    return -np.expm1(-rate * time) / rate if rate else time


def motion(angles: FloatArray, velocities: FloatArray) -> tuple[Any, Any]:
    """Return a closed form's angles and velocities, as scalars where 0-d; SceneError if a value is not finite."""
    if not (np.isfinite(angles).all() and np.isfinite(velocities).all()):
        raise SceneError("the motion at this time is not a finite number; use a shorter time")
    return shaped(angles), shaped(velocities)
