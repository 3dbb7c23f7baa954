"""Curves behind a phase portrait: the separatrix, and the orbit from the run's start without losses and drives."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pendulum_env.physics.scene import Scene
from pendulum_env.render import Orbits
from pendulum_env.render.portrait import reach

Points = NDArray[np.float64]

POINTS = 241
"""Number of points of a curve behind a phase portrait."""
MARGIN = 1.15
"""Ratio of the limits of the portrait's axes to the largest values on its curves."""
CLOSE = math.radians(10.0)
"""Amplitude up to which a portrait shows only the surroundings of the swing [rad]."""
KNOWN = ("gravity", "small_angle_gravity", "fibre")
"""Conservative effects with orbits in closed form."""
NOTES = {
    (False, False): ("exact orbit",),
    (True, False): ("orbit without losses", "ideal orbit"),
    (False, True): ("orbit without drives", "ideal orbit"),
    (True, True): ("orbit without losses and drives", "ideal orbit"),
}
"""Names of the orbit in several lengths, for scenes with or without (losses, drives)."""


def curves(scene: Scene, energy: float) -> Orbits:
    """Return the curves behind a phase portrait: the orbit at an energy [J] without losses, and the separatrix.

    With gravity the orbit is v² / 2 + 2 omega0² sin²(theta / 2) = E / I. It is closed below the separatrix
    v = ±2 omega0 cos(theta / 2), and two lines above it. For swings without drive below 10°, the limits of the axes
    enclose the orbit only. With linearised gravity or a fibre the orbit is an ellipse, and there is no
    separatrix. Without these, or with another potential or two, there are no curves. Drives and wind are ignored.
    """
    share = max(energy, 0.0) / scene.inertia
    rates = scene.coefficients
    held = scene.of_kind("conservative")
    if len(held) > 1 or any(effect.name not in KNOWN for effect in held):
        return Orbits(velocity_reach=reach(MARGIN * math.sqrt(2.0 * share)), periodic=scene.periodic)
    driven = bool(scene.of_kind("drive") or scene.of_kind("medium"))
    notes = NOTES[bool(scene.of_kind("dissipative")), driven]
    if rates.get("gravity_rate", 0.0) > 0.0:
        k = math.sqrt(0.5 * share / rates["gravity_rate"])
        return _pendulum(math.sqrt(rates["gravity_rate"]), k, notes, not driven)
    speed = MARGIN * math.sqrt(2.0 * share)
    spring = rates.get("spring_rate", rates.get("fibre_rate", 0.0))
    if spring > 0.0 and speed > 0.0:
        omega0, turn = math.sqrt(spring), np.linspace(0.0, 2.0 * math.pi, POINTS)
        unit, size = np.stack((np.cos(turn), omega0 * np.sin(turn)), axis=1), math.sqrt(2.0 * share) / omega0
        wide = math.radians(reach(math.degrees(MARGIN * size)))
        return Orbits((size * unit,), (), wide, reach(speed), periodic=False, notes=notes)
    return Orbits(velocity_reach=reach(speed), periodic=scene.periodic)


def _pendulum(omega0: float, k: float, notes: tuple[str, ...], near: bool) -> Orbits:
    """Return orbit and separatrix of an undamped pendulum with k² times the energy of the upright rest position.

    k = sin(amplitude / 2) for swings. ``near``: True limits the axes to the surroundings of a small swing.
    """
    angles, turn = np.linspace(-math.pi, math.pi, POINTS), np.linspace(0.0, 2.0 * math.pi, POINTS)
    top = 2.0 * omega0 * np.cos(0.5 * angles)
    if k >= 1.0:
        over = 2.0 * omega0 * np.sqrt(k * k - np.sin(0.5 * angles) ** 2)
        orbit: tuple[Points, ...] = (np.stack((angles, over), axis=1), np.stack((angles, -over), axis=1))
    else:
        orbit = (np.stack((2.0 * np.arcsin(k * np.sin(turn)), 2.0 * omega0 * k * np.cos(turn)), axis=1),)
    separatrix = np.stack((angles, top), axis=1), np.stack((angles, -top), axis=1)
    if near and 0.0 < k < math.sin(0.5 * CLOSE):
        wide = math.radians(reach(MARGIN * math.degrees(2.0 * math.asin(k))))
        return Orbits(orbit, separatrix, wide, reach(MARGIN * 2.0 * omega0 * k), notes=notes)
    high = reach(MARGIN * 2.0 * omega0 * max(1.0, k))
    return Orbits(orbit if k else (), separatrix, velocity_reach=high, notes=notes if k else ())
