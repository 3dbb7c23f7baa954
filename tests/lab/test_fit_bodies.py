"""Tests of fits to swings of compound pendulums, made by closed forms outside the package, with noise.

The undamped swing is that of Jacobi's elliptic functions in SciPy, the torsion pendulum's the damped cosine.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from pendulum_env import Scene, SceneError
from pendulum_env.lab import Recording, fit
from pendulum_env.physics.bodies import Disc, Kater, MeasuredBody, Rod, Torsion
from pendulum_env.physics.body import RigidBody
from pendulum_env.physics.effects import Fibre, Gravity

pytestmark = pytest.mark.slow

G, AMPLITUDE, NOISE = 9.81, 0.6, 1e-3
TIME = np.linspace(0.0, 20.0, 1001)
GIVEN = MeasuredBody(mass=1.3, centre=0.21, inertia=0.11)


def swing(omega0: float) -> Recording:
    """Return readings of ``2 asin(k sn(K - omega0 t, k²))``, k = sin(A/2), with noise."""
    k = math.sin(0.5 * AMPLITUDE)
    angle = 2.0 * np.arcsin(k * ellipj(ellipk(k * k) - omega0 * TIME, k * k)[0])
    return Recording(TIME, angle + np.random.default_rng(5).normal(0.0, NOISE, len(TIME)), "closed form")


def at(body: RigidBody) -> Scene:
    return Scene("bench", body, effects=(Gravity(),), gravity=G)


@pytest.mark.parametrize(("body", "name", "true", "omega0"), [
    (MeasuredBody(1.3, 0.21, 0.18), "inertia", 0.11, math.sqrt(1.3 * G * 0.21 / 0.11)),
    (MeasuredBody(1.3, 0.16, 0.11), "centre", 0.21, math.sqrt(1.3 * G * 0.21 / 0.11)),
    (Rod(0.6, 0.3, 0.001), "length", 0.9, math.sqrt(G * 0.45 / (0.81 / 3.0 + 1e-6 / 16.0))),
    (Disc(0.1, 0.7, 0.005, 0.2), "centre", 0.25, math.sqrt(G * 0.25 / (0.005 + 0.0625))),
], ids=["inertia", "centre", "rod", "disc"])
def test_a_swing_gives_one_measure(body: RigidBody, name: str, true: float, omega0: float) -> None:
    """The fitted measure is the true one within four of its standard errors, which are below a thousandth."""
    best = fit(swing(omega0), "none", scene=at(body), free=(name,))
    found = best.parameters[name]
    assert abs(found.value - true) < 4.0 * found.error
    assert found.error < 1e-3 * true


def test_the_measure_that_sets_the_period_is_the_default() -> None:
    best = fit(swing(math.sqrt(1.3 * G * 0.21 / 0.11)), "none", scene=at(GIVEN))
    assert "inertia" in best.parameters


def test_a_torsion_pendulum_gives_the_stiffness_of_its_fibre() -> None:
    """``A exp(-gamma t/2) (cos(nu t) + gamma/(2 nu) sin(nu t))`` with kappa = 0.003 and gamma = 0.05."""
    body, kappa, gamma = Torsion(mass=0.4, radius=0.15), 0.03, 0.05
    nu = math.sqrt(kappa / (0.5 * 0.4 * 0.15**2) - gamma**2 / 4.0)
    angle = np.exp(-0.5 * gamma * TIME) * (np.cos(nu * TIME) + 0.5 * gamma / nu * np.sin(nu * TIME))
    recording = Recording(TIME, angle + np.random.default_rng(6).normal(0.0, NOISE, len(TIME)), "closed form")
    best = fit(recording, "linear", scene=Scene("twist", body, effects=(Fibre(0.02),)), free=("stiffness",))
    for name, true in (("stiffness", kappa), ("linear_drag.gamma", gamma)):
        found = best.parameters[name]
        assert abs(found.value - true) < 4.0 * found.error


@pytest.mark.parametrize(("body", "free"), [
    (GIVEN, ("inertia", "centre")), (GIVEN, ("inertia", "mass")), (GIVEN, ("centre", "gravity")),
    (Disc(), ("centre", "radius")), (Kater(), ("counterweight_position", "bob_position")),
])
def test_what_a_free_swing_cannot_tell_apart_is_refused(body: RigidBody, free: tuple[str, ...]) -> None:
    with pytest.raises(SceneError, match=f"free cannot have {free[0]} and {free[1]} together"):
        fit(swing(4.0), "none", scene=at(body), free=free)
