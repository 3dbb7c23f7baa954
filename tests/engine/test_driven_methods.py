"""Tests of methods under torques that depend on the time: orders, work and heat, against solutions of 18 digits."""

from __future__ import annotations

import math
from functools import lru_cache

import mpmath as mp
import numpy as np
import pytest

import integrators
from pendulum_env import Scene
from pendulum_env.engine.machine import ANGLE, VELOCITY, Machine, fitting
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import BearingFriction, Gravity, HorizontalDrive, Motor, PeriodicTorque, VerticalDrive

pytestmark = pytest.mark.slow

LENGTH, MASS, START, DURATION = 0.5, 0.2, (0.9, -1.0), 1.0
UP, SIDE, TORQUE = (0.02, 11.0, 0.4), (0.03, 6.0, -1.2), (0.2, 5.0, 0.3)
VISCOSITY, MOTOR, CONTROL = 0.02, 0.3, 0.5
_DRIVES = (VerticalDrive(*UP), HorizontalDrive(*SIDE), PeriodicTorque(*TORQUE), Motor(MOTOR))
SCENES = {
    "driven": Scene(body=Body(LENGTH, MASS), effects=(Gravity(), *_DRIVES)),
    "damped": Scene(body=Body(LENGTH, MASS), effects=(Gravity(), BearingFriction(VISCOSITY), *_DRIVES)),
}
PAIRS = [(scene, method) for scene in SCENES for method in fitting(SCENES[scene])]


@lru_cache
def truth(scene: str) -> tuple[float, float, float, float]:
    """Return the final angle, velocity, work [J] and heat [J] from mpmath's Taylor series.

    The torques are written here from Newton's law in the pivot's frame.
    """
    with mp.workdps(18):
        inertia, drag = mp.mpf(MASS) * LENGTH**2, mp.mpf(VISCOSITY if scene == "damped" else 0)

        def drive(t: mp.mpf, q: mp.mpf) -> mp.mpf:
            rise, sway = (-b * w * w * mp.cos(w * t + p) for b, w, p in (map(mp.mpf, UP), map(mp.mpf, SIDE)))
            size, rate, phase = map(mp.mpf, TORQUE)
            pulled = -MASS * LENGTH * (rise * mp.sin(q) + sway * mp.cos(q))
            return pulled + size * mp.cos(rate * t + phase) + mp.mpf(MOTOR) * CONTROL

        def rates(t: mp.mpf, y: list[mp.mpf]) -> list[mp.mpf]:
            q, v, *_ = y
            push = drive(t, q)
            weight = -MASS * mp.mpf(9.81) * LENGTH * mp.sin(q)
            return [v, (weight + push - drag * v) / inertia, push * v, drag * v * v]

        path = mp.odefun(rates, 0, [*map(mp.mpf, START), mp.mpf(0), mp.mpf(0)])
        q, v, work, heat = map(float, path(mp.mpf(DURATION)))
        return q, v, work, heat


def end(scene: str, method: str, steps: int) -> tuple[float, float, float, float]:
    machine = Machine(SCENES[scene], method, backend="python")
    state = machine.state(*START)
    assert machine.advance(state, CONTROL, DURATION / steps, steps) == 0
    ledger = machine.ledger(state, 0.0)
    turned = state[ANGLE] + 2.0 * math.pi * state[ANGLE + 1]
    return turned, state[VELOCITY], float(ledger.work), float(ledger.heat)


@pytest.mark.parametrize(("scene", "method"), PAIRS)
def test_methods_keep_their_order_and_book_the_true_work(scene: str, method: str) -> None:
    """Check that half the step divides the errors of motion, work and heat by 2^order, down to rounding."""
    order, wanted = integrators.get(method).order, np.array(truth(scene))
    kept = np.zeros(3, dtype=bool)
    before = np.full(3, np.inf)
    for steps in (16, 32, 64, 128, 256, 512):
        distance = np.abs(np.array(end(scene, method, steps)) - wanted)
        errors = np.array([max(distance[0], 0.1 * distance[1]), distance[2], distance[3]])
        falls = 2.0 ** (order - 0.3) * errors < before
        kept |= (falls & np.isfinite(before) & (errors < 0.1)) | ((errors < 1e-12) & np.isinf(before))
        before = errors
        if np.all(kept):
            return
    assert np.all(kept), (kept, before)


@pytest.mark.parametrize(
    ("method", "compensated"), [("velocity_verlet", False), ("mclachlan_atela4", False), ("mclachlan_atela4", True)]
)
def test_interpreted_and_compiled_give_the_same_bits(method: str, compensated: bool) -> None:
    """Check equal bits of both backends in an undamped driven scene, where splittings compute work in a special way."""
    ends = []
    for backend in ("python", "compiled"):
        machine = Machine(SCENES["driven"], method, backend=backend, compensated=compensated)
        state = machine.state(*START)
        assert machine.advance(state, CONTROL, 0.01, 2000) == 0
        ends.append([float(value) for value in state])
    assert ends[0] == ends[1]
