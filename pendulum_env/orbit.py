"""What a phase portrait shows behind the motion: the separatrix, and the orbit of the run's start without losses."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.scene import Scene
from pendulum_env.render import Curves
from pendulum_env.render.strip import round_up

Points = NDArray[np.float64]

POINTS = 241
MARGIN = 1.15
"""The portrait goes so many times as far as its curves."""


def curves(scene: Scene, energy: float) -> Curves:
    """The curves of a scene's conservative part at an energy [J], that of the run's start.

    With gravity, v² / 2 + 2 omega0² sin²(theta / 2) = E / I: closed below the separatrix v = ±2 omega0 cos(theta / 2),
    two lines above it. With linearised gravity the orbit is an ellipse, and there is no separatrix. Without either,
    there are no curves.
    """
    share = max(energy, 0.0) / scene.inertia
    rates = scene.coefficients
    if rates.get("gravity_rate", 0.0) > 0.0:
        return _pendulum(math.sqrt(rates["gravity_rate"]), math.sqrt(0.5 * share / rates["gravity_rate"]))
    speed = MARGIN * math.sqrt(2.0 * share)
    if rates.get("spring_rate", 0.0) > 0.0 and speed > 0.0:
        omega0, turn = math.sqrt(rates["spring_rate"]), np.linspace(0.0, 2.0 * math.pi, POINTS)
        unit, size = np.stack((np.cos(turn), omega0 * np.sin(turn)), axis=1), math.sqrt(2.0 * share) / omega0
        return Curves((size * unit,), (), MARGIN * size, round_up(speed), periodic=False)
    return Curves(velocity_reach=round_up(speed), periodic=scene.periodic)


def _pendulum(omega0: float, k: float) -> Curves:
    """Of a pendulum whose energy is k² times that at the top: k = sin(amplitude / 2) where it swings."""
    angles, turn = np.linspace(-math.pi, math.pi, POINTS), np.linspace(0.0, 2.0 * math.pi, POINTS)
    top = 2.0 * omega0 * np.cos(0.5 * angles)
    if k >= 1.0:
        over = 2.0 * omega0 * np.sqrt(k * k - np.sin(0.5 * angles) ** 2)
        orbit: tuple[Points, ...] = (np.stack((angles, over), axis=1), np.stack((angles, -over), axis=1))
    else:
        orbit = (np.stack((2.0 * np.arcsin(k * np.sin(turn)), 2.0 * omega0 * k * np.cos(turn)), axis=1),)
    reach = round_up(MARGIN * 2.0 * omega0 * max(1.0, k))
    return Curves(orbit if k > 0.0 else (), (np.stack((angles, top), axis=1), np.stack((angles, -top), axis=1)),
                  velocity_reach=reach)
