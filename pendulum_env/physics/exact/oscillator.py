"""Closed forms of the small-angle pendulum with linear damping, and of Euler's two methods on it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendulum_env.physics.exact.base import FloatArray, Real, array, count, in_floats, motion, number, rise
from pendulum_env.physics.units import SceneError, shown

_EULER_EXPONENT = {"forward_euler": 1, "backward_euler": -1}


class _Oscillator(NamedTuple):
    """Coefficients of the exact motion of the damped oscillator x'' + 2 d x' + w² x = 0 over a time t.

    From x and v at time 0 follow x(t) = factor (plus x + rise v) and v(t) = factor (minus v - w² rise x). `factor`
    times `plus` is C + d S, times `minus` C - d S, and times `rise` S, all multiplied by exp(-d t), with C = cosh(s t),
    S = sinh(s t)/s, s² = d² - w².
    """

    factor: FloatArray
    plus: FloatArray
    minus: FloatArray
    rise: FloatArray


def oscillator_flow(time: FloatArray, w: float, d: float) -> _Oscillator:
    """Return the coefficients of the damped oscillator's motion over `time`, for natural frequency w and damping 2 d.
    """
    square = (w - d) * (w + d)
    with np.errstate(over="ignore", under="ignore"):
        if square > 0.0:
            n = math.sqrt(square)
            cosine, risen = np.cos(n * time), np.sin(n * time) / n
            return _Oscillator(np.exp(-d * time), cosine + d * risen, cosine - d * risen, risen)
        s = math.sqrt(-square)
        slow = w * (w / max(d + s, w)) if w else 0.0
        risen = rise(2.0 * s, time)
        fall = np.exp(-2.0 * s * time)
        return _Oscillator(np.exp(-slow * time), 1.0 + slow * risen, fall - slow * risen, risen)


@in_floats
def linear(time: Real, angle: float, velocity: float, omega0: float, gamma: float = 0.0) -> tuple[Real, Real]:
    """Return angle and velocity of theta'' + gamma theta' + omega0² theta = 0, under-, critically or overdamped.

    omega0 >= 0 [rad/s], gamma >= 0 [1/s]; (angle, velocity) is the state at time 0. There is no cancellation next to
    critical damping, and no overflow at late times. Source: Landau & Lifshitz, Mechanics (1976), § 25.
    """
    t, a, v = array("time", time), number("angle", angle), number("velocity", velocity)
    w, g = number("omega0", omega0, "finite and >= 0"), number("gamma", gamma, "finite and >= 0")
    flow = oscillator_flow(t, w, g / 2.0)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        angles = flow.factor * (a * flow.plus + v * flow.rise)
        return motion(angles, flow.factor * (v * flow.minus - w * (w * a * flow.rise)))


@in_floats
def euler_energy_factor(omega0: float, h: float, method: str, steps: int = 1) -> float:
    """Return the exact factor of the small-angle pendulum's energy over `steps` Euler steps of h seconds.

    (1 + omega0² h²)^steps for "forward_euler", its inverse for "backward_euler": their amplification matrices
    have the eigenvalues 1 ± i omega0 h and 1/(1 ± i omega0 h). Source: Hairer, Lubich & Wanner, Geometric
    Numerical Integration (2006), I.1.
    """
    if not isinstance(method, str) or method not in _EULER_EXPONENT:
        raise SceneError(f"method must be one of {', '.join(_EULER_EXPONENT)}, not {shown(method)}")
    x = number("omega0", omega0, "finite and >= 0") * number("h", h)
    return math.exp(_EULER_EXPONENT[method] * count("steps", steps) * math.log1p(x * x))
