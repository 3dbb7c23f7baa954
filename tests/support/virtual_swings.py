"""Recordings of pendulums with known truth, by scipy's integrator and rounding: nothing of the code under test."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pendulum_env.lab import Recording

Array = NDArray[np.float64]
GRAVITY, MASS = 9.81, 0.1


def swing(
    time: Array, angle: float, *, length: float, velocity: float = 0.0, gamma: float = 0.0, c: float = 0.0,
    friction: float = 0.0,
) -> Array:
    """``theta'' = -(g/L) sin theta - gamma v - c |v| v - tau sign(v)`` at these times; friction is tau L² MASS [N m].

    Half swing by half swing, from one zero of the velocity to the next, so that no step sees the jump of dry friction;
    at rest where the pull is below it.
    """
    tau, pull = friction / (MASS * length**2), GRAVITY / length
    found = np.full(len(time), math.nan)
    now, state = float(time[0]), [angle, velocity]
    while now < time[-1]:
        side = math.copysign(1.0, state[1] if abs(state[1]) > 1e-9 else -state[0])
        if abs(state[1]) <= 1e-9 and abs(pull * math.sin(state[0])) <= tau:
            found[time >= now] = state[0]
            break

        def slope(_t: float, y: Array, side: float = side) -> list[float]:
            v = y[1]
            return [v, -pull * math.sin(y[0]) - gamma * v - c * abs(v) * v - tau * side]

        def turn(_t: float, y: Array, side: float = side, begun: float = now) -> float:
            return float(y[1] * side if _t > begun + 0.01 / math.sqrt(pull) else 1.0)

        turn.terminal, turn.direction = True, -1.0  # type: ignore[attr-defined]
        run = solve_ivp(slope, (now, float(time[-1]) + 1e-9), state, method="DOP853", rtol=1e-9, atol=1e-11,
                        dense_output=True, events=turn)
        end = float(run.t[-1])
        inside = (time >= now) & (time <= end)
        if inside.any():
            found[inside] = run.sol(time[inside])[0]
        now, state = end, [float(run.y[0, -1]), 0.0]
    return found


def recorded(
    time: Array, angle: Array, *, quantum: float = 0.0, noise: float = 0.0, zero: float = 0.0, scale: float = 1.0,
    seed: int = 0,
) -> Recording:
    """What a sensor makes of it: ``zero + scale theta + noise``, rounded to the quantum [rad]."""
    source = np.random.default_rng(seed)
    seen = zero + scale * angle + noise * source.standard_normal(len(time))
    return Recording(time, quantum * np.round(seen / quantum) if quantum else seen, "virtual")


def even(duration: float, rate: float) -> Array:
    """Times from 0 [s]."""
    return np.arange(math.floor(duration * rate) + 1) / rate


def uneven(duration: float, step: float, seed: int = 0) -> Array:
    """Times from 0, whose steps vary by 40 % [s]."""
    source = np.random.default_rng(seed)
    time = np.cumsum(step * source.uniform(0.6, 1.4, math.ceil(duration / step)))
    return time - time[0]
