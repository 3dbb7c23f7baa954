"""The energy ledger under tolerances: work and each heat against scipy's quadrature of equations written here."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import integrators
from pendulum_env import Scene, rollout
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import Gravity, LinearDrag, Motor, PeriodicTorque, QuadraticDrag

NAMES = [method.name for method in integrators.PAIRS]
GAMMA, C, TORQUE, DRIVE, RATE, CONTROL = 0.3, 0.2, 1.5, 2.0, 1.7, 0.4
BODY, START, SPAN = Body(length=1.0, mass=1.0), 2.0, 6.0
DRIVEN = (Gravity(), Motor(max_torque=TORQUE), PeriodicTorque(DRIVE, RATE))
DRAGS = (LinearDrag(gamma=GAMMA), QuadraticDrag(c=C))
Array = NDArray[np.float64]


@cache
def truth(damped: bool) -> Array:
    """Return angle, velocity, work, and the heats of linear and quadratic drag at the end, by DOP853 at 1e-13."""
    gamma, c = (GAMMA, C) if damped else (0.0, 0.0)

    def slope(t: float, y: Array) -> list[float]:
        q, v = y[0], y[1]
        push = CONTROL * TORQUE + DRIVE * np.cos(RATE * t)
        return [v, push - 9.81 * np.sin(q) - gamma * v - c * abs(v) * v, push * v, gamma * v * v, c * abs(v) ** 3]

    end: Array = solve_ivp(slope, (0.0, SPAN), [START, 0.0, 0.0, 0.0, 0.0], "DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return end


@pytest.mark.parametrize("name", NAMES)
def test_work_and_heats_err_in_proportion_to_the_tolerance(name: str) -> None:
    """With a motor and a periodic torque, and with two drags if the method takes them; masses and lengths are 1."""
    damped = "velocity_free" not in integrators.get(name).needs
    scene = Scene("ledger", BODY, effects=(*DRIVEN, *(DRAGS if damped else ())), gravity=9.81)
    wanted, errors, residuals = truth(damped), [], []
    exponents = (5, 7, 9)
    for n in exponents:
        run = rollout(scene, integrator=name, angle=START, velocity=0.0, dt=0.3, duration=SPAN, control=CONTROL,
                      rtol=10.0**-n, backend="python", diagnostics=("energy", "heat_by_effect"), warn=False)
        heats = [run.heat_by_effect[drag.name][-1] for drag in DRAGS] if damped else [0.0, 0.0]
        found = np.array([run.angle[-1], run.velocity[-1], run.ledger.work[-1], *heats])
        errors.append(np.abs(found - wanted))
        assert run.energy_residual[-1] == pytest.approx(
            run.energy[-1] - run.energy[0] - run.ledger.work[-1] + sum(heats), abs=1e-12)
        residuals.append(float(np.max(np.abs(run.energy_residual))))
    # The state errs by some rtol times the growth of errors in 6 s, and each energy with it.
    for n, error, residual in zip(exponents, errors, residuals, strict=True):
        assert np.max(error) < 3000.0 * 10.0**-n, (n, error)
        assert residual < 3000.0 * 10.0**-n
    # Methods of high order are limited by the control step at first, and estimate errors at kinks of |v| v too small.
    assert np.all(errors[-1] < np.maximum(10.0**-2 * errors[0], 1e-8))
