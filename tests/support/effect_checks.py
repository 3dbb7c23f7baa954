"""Torques of effects in mpmath's numbers, and their slopes."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import FunctionType
from typing import Any

import mpmath

from pendulum_env.engine.equations import flow_numbers
from pendulum_env.physics import elementary
from pendulum_env.physics.scene import Scene

SPEEDS = (-30.0, -2.5, -0.01, 0.3, 4.0, 200.0)


def called(function: FunctionType) -> dict[str, FunctionType]:
    """The plain functions of its module that a function calls, by name."""
    found = {name: function.__globals__.get(name) for name in function.__code__.co_names}
    return {name: f for name, f in found.items() if isinstance(f, FunctionType) and name not in elementary.__all__}


def in_mpmath(function: Callable[..., float]) -> Callable[..., Any]:
    """The same code with mpmath's functions for those of physics.elementary, in what it calls too."""
    assert isinstance(function, FunctionType)
    names = {**function.__globals__, **{name: getattr(mpmath, name) for name in (*elementary.__all__, "sqrt")}}
    names |= {name: in_mpmath(f) for name, f in called(function).items()}
    return FunctionType(function.__code__, names, function.__name__, function.__defaults__)


def bound(function: Callable[..., float], scene: Scene, side: float = 1.0) -> Callable[..., Any]:
    """An effect's function of angle, velocity, control, duration, spread and time; the rest by name from the scene."""
    wanted = list(inspect.signature(function).parameters)
    exact = in_mpmath(function)

    def call(
        angle: Any = 0, velocity: Any = 0, control: Any = 0, duration: Any = 0, spread: Any = 0, time: Any = 0,
        speed: Any = None,
    ) -> Any:
        known = {
            "time": time, "angle": angle, "tilt": angle, "half_sine": mpmath.sin(mpmath.mpf(angle) / 2),
            "side": mpmath.mpf(side), "velocity": velocity, "slip": velocity,
            "speed": abs(velocity) if speed is None else speed, "control": control, "duration": duration,
            "spread": spread, **flow_numbers(scene), **scene.coefficients,
        }
        return exact(*(mpmath.mpf(known[name]) for name in wanted))

    return call


def slope(function: Callable[[Any], Any], x: float) -> Any:
    """Central difference, extrapolated once: error 1e-4 of that of h**4, h = 1e-8."""
    h = mpmath.mpf(10) ** -8
    at = mpmath.mpf(x)
    one, two = ((function(at + k * h) - function(at - k * h)) / (2 * k * h) for k in (1, 2))
    return (4 * one - two) / 3


def close(found: Any, wanted: Any, size: Any = 1) -> bool:
    return bool(abs(found - wanted) <= mpmath.mpf(10) ** -20 * (abs(wanted) + size))
