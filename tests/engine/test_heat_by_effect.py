"""Tests of the heat of every effect and the work of the air, against independent quadratures.

They cover all combinations of dissipative effects, still air and wind, and one method of every family. The reference
uses force vectors in the plane, from textbook formulas for a sphere, a cylinder and a bearing.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from choice import rolled
from scipy.integrate import solve_ivp

import integrators
from pendulum_env import Scene
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    BearingFriction,
    CoulombFriction,
    Effect,
    Gravity,
    LinearDrag,
    QuadraticDrag,
    SphereDrag,
    Wind,
    WireDrag,
)
from pendulum_env.physics.medium import Medium

LENGTH, MASS, RADIUS, ROD, RHO, MU, G = 0.353, 0.040, 0.0107, 0.002, 1.2, 1.8e-5, 9.81
INERTIA = MASS * LENGTH**2
GAMMA, C, BEARING, DRY, BLOW = 0.05, 0.1, 1e-4, 5e-4, 2.0
BODY, AIR = Body(length=LENGTH, mass=MASS, radius=RADIUS, thickness=ROD), Medium("air", RHO, MU)
START, DURATION, STEP = 1.0, 2.0, 0.004

LAWS: tuple[Effect, ...] = (SphereDrag(), WireDrag(), BearingFriction(BEARING))
NUMBERS: tuple[Effect, ...] = (LinearDrag(GAMMA), QuadraticDrag(C), BearingFriction(BEARING))
EFFECTS = {
    name + dry * ", dry" + blow * ", wind": (Gravity(), *drags, *dry * (CoulombFriction(DRY),), *blow * (Wind(BLOW),))
    for name, drags in (("laws", LAWS), ("numbers", NUMBERS)) for dry in (False, True) for blow in (False, True)
}
SCENES = {name: Scene(name, BODY, AIR, effects, G) for name, effects in EFFECTS.items()}
METHODS = (
    "symplectic_euler", "velocity_verlet", "yoshida6a", "rk4", "gauss4", "discrete_gradient", "fine5", "abm4", "bdf4",
    "generalized_alpha", "taylor",
)
CASES = [(name, method) for name, scene in SCENES.items() for method in METHODS if method in fitting(scene)]


def sphere(speed: float) -> float:
    """Return a sphere's drag divided by the speed [N s/m]: Clift and Gauvin's form, fitted by Brown and Lawler."""
    reynolds = RHO * speed * 2 * RADIUS / MU
    if reynolds == 0.0:
        return 6 * math.pi * MU * RADIUS
    coefficient = 24 / reynolds * (1 + 0.152 * reynolds**0.677) + 0.417 / (1 + 5070 * reynolds**-0.94)
    return 0.5 * RHO * coefficient * math.pi * RADIUS**2 * speed


def rod(speed: float) -> float:
    """Return a wire's torque divided by the speed at its end [N s], from C_d = 1 + 10 Re**(-2/3) along the wire."""
    if speed == 0.0:
        return 0.0
    reynolds = RHO * speed * ROD / MU
    form, skin = LENGTH**4 / 4, 10 * reynolds ** (-2 / 3) * LENGTH ** (2 / 3) * LENGTH ** (10 / 3) / (10 / 3)
    return 0.5 * RHO * ROD * speed / LENGTH**2 * (form + skin)


DRAGS = {
    "sphere_drag": sphere,
    "wire_drag": lambda speed: rod(speed) / LENGTH,
    "linear_drag": lambda speed: GAMMA * INERTIA / LENGTH**2,
    "quadratic_drag": lambda speed: C * INERTIA / LENGTH**3 * speed,
}
"""Forces of the drags at the bob divided by the speed [N s/m]."""


@lru_cache
def truth(case: str) -> dict[str, float]:
    """Return final angle, velocity, heats and work [J] from DOP853 at 1e-13, restarted at zeros of the velocity."""
    scene = SCENES[case]
    drags = {effect.name: DRAGS[effect.name] for effect in scene.effects if effect.name in DRAGS}
    dry, wind = DRY * scene.has("coulomb_friction"), np.array([BLOW * scene.has("wind"), 0.0])

    def slope(t: float, y: Any, side: float) -> list[float]:
        q, v = y[0], y[1]
        along = np.array([math.cos(q), math.sin(q)])
        slip = LENGTH * v * along - wind
        speed = math.hypot(*slip)
        forces = [-over(speed) * slip for over in drags.values()]
        torque = LENGTH * sum(float(force @ along) for force in forces)
        torque += -MASS * G * LENGTH * math.sin(q) - BEARING * v - side * dry
        return [v, torque / INERTIA, *(-float(force @ slip) for force in forces), BEARING * v * v, dry * side * v,
                sum(float(force @ wind) for force in forces)]

    def stopped(t: float, y: Any, side: float) -> float:
        return float(y[1])

    stopped.terminal = True  # type: ignore[attr-defined]
    t, y, side = 0.0, np.zeros(5 + len(drags)), -1.0
    y[0] = START
    while t < DURATION:
        stopped.direction = -side  # type: ignore[attr-defined]
        run = solve_ivp(slope, (t, DURATION), y, "DOP853", args=(side,), rtol=1e-13, atol=1e-16, events=stopped)
        t, y, side = run.t[-1], run.y[:, -1], -side
    names = ("angle", "velocity", *drags, "bearing_friction", "coulomb_friction", "work")
    return dict(zip(names, y.tolist(), strict=True))


def allowed(method: str, scene: Scene) -> float:
    """Return the allowed error of a heat or work, relative to the exchanged energies."""
    order = integrators.get(method).order
    return 0.2 * (scene.omega0 * STEP) ** order + 2e-9


@pytest.mark.quick(
    "laws-rk4", "laws, dry-symplectic_euler", "laws, dry, wind-rk4", "numbers-velocity_verlet", "numbers, wind-gauss4",
    "numbers, dry-discrete_gradient", "laws, dry, wind-discrete_gradient"
)
@pytest.mark.parametrize(("case", "method"), CASES)
def test_each_heat_and_the_airs_work_are_true(case: str, method: str) -> None:
    scene, wanted = SCENES[case], truth(case)
    run = rolled(scene, integrator=method, dt=STEP, duration=DURATION, angle=START, velocity=0.0,
                 diagnostics=("energy", "heat_by_effect"))
    names = [effect.name for effect in scene.of_kind("dissipative")]
    assert list(run.heat_by_effect) == names
    exchanged = run.energy[0] + sum(abs(wanted[name]) for name in (*names, "work"))
    limit = allowed(method, scene) * exchanged
    for name in names:
        assert abs(run.heat_by_effect[name][-1] - wanted[name]) <= limit, name
        assert wanted[name] > 1e-3 * exchanged
    assert abs(run.ledger.work[-1] - wanted["work"]) <= limit
    total = sum(run.heat_by_effect[name] for name in names)
    np.testing.assert_allclose(total, run.ledger.heat, rtol=1e-14)
    change = run.energy - run.energy[0]
    np.testing.assert_allclose(change, run.ledger.work - total + run.energy_residual, rtol=0, atol=1e-14 * exchanged)
    assert np.max(np.abs(run.energy_residual)) <= 10.0 * limit


def test_wind_does_work_and_makes_heat() -> None:
    """Check that still air does no work, and that wind makes more heat than the bob ever had energy."""
    for name, scene in SCENES.items():
        work, heat = truth(name)["work"], sum(value for key, value in truth(name).items() if key in DRAGS)
        assert (work != 0.0) == scene.has("wind")
        assert not scene.has("wind") or heat > work > 0.0


def test_every_family_that_can_be_is_there() -> None:
    fits = {integrators.get(method).family for scene in SCENES.values() for method in fitting(scene)}
    assert fits == {integrators.get(method).family for _, method in CASES}
