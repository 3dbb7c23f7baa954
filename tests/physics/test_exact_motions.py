"""Tests of simulated scenes against published exact results, half swing by half swing, with methods of every kind.

For quadratic drag and dry friction, a conserved quantity links successive turning points; the undamped motion is that
of Jacobi's elliptic functions.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from choice import rolled

import integrators
from pendulum_env import Scene
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import CoulombFriction, Gravity, LinearDrag, QuadraticDrag
from pendulum_env.study.audit.cases import turning_points

pytestmark = pytest.mark.slow

UNIT = Body(length=1.0, mass=1.0)
METHODS = ("rk4", "dop853", "gauss4", "taylor20", "velocity_verlet", "kahan_li8", "symplectic_euler", "abm4")
STOPPING = tuple(name for name in METHODS if not integrators.get(name).needs & {"smooth", "reversible"})
"""Methods that can run dry friction, whose torque jumps."""
H = 0.005


def scene_of(*effects: Any, gravity: float = 1.0) -> Scene:
    """Return a scene with omega0 = 1 if there is gravity."""
    return Scene(body=UNIT, gravity=gravity, effects=effects)


def allowed(method: str, size: float, rounding: float = 1e-11) -> float:
    """Return the allowed error of a method: ``size`` times the step to the method's order, at most 4, plus rounding.

    The order is limited to 4 because friction is not smooth.
    """
    return float(size * H ** min(integrators.get(method).order, 4) + rounding)


def turns(scene: Scene, method: str, angle: float, duration: float) -> list[float]:
    """Return the angles of rest: the release, and each turning point."""
    r = rolled(scene, integrator=method, angle=angle, velocity=0.0, dt=H, duration=duration)
    return [angle, *(place for _, place in turning_points(r.time, r.angle, r.velocity))]


# --- each half swing ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("c", [0.05, 0.4])
@pytest.mark.parametrize("method", METHODS)
def test_each_half_swing_under_quadratic_drag(method: str, c: float) -> None:
    """exp(-2 c x) (cos x + 2 c sin x) is equal at both ends of a half swing, x counted against the motion.

    From v² = y: dy/dx - 2 c y = -2 sin x on the way from x to -x (Nelson & Olsson 1986).
    """
    angles = turns(scene_of(Gravity(), QuadraticDrag(c=c)), method, 2.0, 30.0)
    assert len(angles) > 7
    for start, end in pairwise(angles[:8]):
        side = math.copysign(1.0, start)

        def weight(x: float) -> float:
            return math.exp(-2.0 * c * x) * (math.cos(x) + 2.0 * c * math.sin(x))

        slope = (1.0 + 4.0 * c * c) * math.sin(side * end) * math.exp(-2.0 * c * side * end)
        assert abs((weight(side * start) - weight(side * end)) / slope) < allowed(method, 3.0)


@pytest.mark.parametrize("tau", [0.02, 0.1])
@pytest.mark.parametrize("method", STOPPING)
def test_each_half_swing_under_dry_friction(method: str, tau: float) -> None:
    """Turning points under dry friction obey cos t1 - cos t0 = tau (t0 + t1), t1 on the other side (Lapidus 1970).

    At the first with sin t1 <= tau the bob stays at rest.
    """
    scene = scene_of(Gravity(), CoulombFriction(tau))
    r = rolled(scene, integrator=method, angle=2.0, velocity=0.0, dt=H, duration=200.0)
    moving = r.velocity != 0.0
    stops = [r.angle[0], *(place for _, place in turning_points(r.time, r.angle, r.velocity))]
    stops = [q for q in stops if math.sin(abs(q)) > tau or abs(q) > 1.5]
    assert len(stops) >= (8 if tau == 0.1 else 20)
    for start, end in pairwise([*stops, r.angle[-1]]):
        excess = math.cos(end) - math.cos(start) - tau * abs(start - end)
        assert abs(excess) / (abs(math.sin(end)) + tau) < allowed(method, 3.0)
    assert math.sin(abs(r.angle[-1])) <= tau
    assert not np.any(moving[-100:])


# --- without gravity ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", [-9.0, 0.4])
@pytest.mark.parametrize("method", METHODS)
def test_both_drags_alone(method: str, velocity: float) -> None:
    """Without gravity, v = gamma v0 e/(gamma + c |v0| (1 - e)) with e = exp(-gamma t); the path is a logarithm.

    The path is log(1 + c |v0| (1 - e)/gamma)/c.
    """
    gamma, c = 0.5, 0.8
    scene = scene_of(LinearDrag(gamma), QuadraticDrag(c=c), gravity=0.0)
    r = rolled(scene, integrator=method, angle=0.3, velocity=velocity, dt=H, duration=5.0)
    e = np.exp(-gamma * r.time)
    load = c * abs(velocity) * (1.0 - e) / gamma
    size = 3.0 * (1.0 + abs(velocity)) ** (1 + min(integrators.get(method).order, 4)) / 4.0
    assert np.max(np.abs(r.velocity - velocity * e / (1.0 + load))) < allowed(method, size)
    assert np.max(np.abs(r.angle - 0.3 - math.copysign(1.0, velocity) * np.log1p(load) / c)) < allowed(method, size)
    assert r.angle[-1] != r.angle[0]


# --- the undamped pendulum ------------------------------------------------------------------------------------------

SPEEDS = {"libration": 1.9, "separatrix": 2.0, "rotation": 2.1}


def elliptic(t: float, velocity: float) -> tuple[float, float]:
    """Return angle and velocity after a start at the bottom, by Jacobi's elliptic functions.

    sin(theta/2) = k sn(t, k), tanh(t), sn(k t, 1/k) with k = velocity/2 (Whittaker 1937, §44).
    """
    with mp.workdps(30):
        k, time = mp.mpf(velocity) / 2, mp.mpf(t)
        if k < 1:
            sn, cn = (mp.ellipfun(name, time, m=k * k) for name in ("sn", "cn"))
            return float(2 * mp.asin(k * sn)), float(2 * k * cn)
        if k == 1:
            return float(2 * mp.asin(mp.tanh(time))), float(2 / mp.cosh(time))
        quarter = mp.ellipk(1 / k**2)
        halves = mp.nint(k * time / (2 * quarter))
        u = k * time - 2 * halves * quarter
        sn, dn = (mp.ellipfun(name, u, m=1 / k**2) for name in ("sn", "dn"))
        return float(2 * mp.asin(sn) + 2 * mp.pi * halves), float(2 * k * dn)


@pytest.mark.parametrize("regime", SPEEDS)
@pytest.mark.parametrize("method", [*METHODS, "blanes_moan_srkn11b", "rkn43", "discrete_gradient", "chin4a"])
def test_the_elliptic_motion_in_its_three_regimes(method: str, regime: str) -> None:
    """The motion agrees with the closed form; on the separatrix errors grow as exp(t), 400-fold in 6 s."""
    velocity = SPEEDS[regime]
    r = rolled(scene_of(Gravity()), integrator=method, angle=0.0, velocity=velocity, dt=H,
               duration=6.0 if regime == "separatrix" else 30.0, every=100)
    for t, q, v in zip(r.time, r.angle, r.velocity, strict=True):
        angle, speed = elliptic(float(t), velocity)
        assert abs(q - angle) < allowed(method, 400.0, 1e-12)
        assert abs(v - speed) < allowed(method, 400.0, 1e-12)
