"""Chin's splitting with the force gradient: coefficients from the oscillator, order, work."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import integrators
from integrators import ForceGradient, MethodError, System, solve, unroll
from integrators.analysis import amplification, driven_pendulum, observed_order, stability_limit
from integrators.families.splitting import DRIFT, KICK
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.effects import Effect, Gravity, Motor

CHIN = integrators.get("chin4a")
assert isinstance(CHIN, ForceGradient)


def matrices(z: Fraction) -> list[list[Fraction]]:
    """Return the matrix of kick, drift, kick of f + h**2/24 f f' = -q (1 - z**2/24), drift, kick."""

    def product(*factors: list[list[Fraction]]) -> list[list[Fraction]]:
        total = [[Fraction(1), Fraction(0)], [Fraction(0), Fraction(1)]]
        for f in factors:
            total = [[sum(f[i][k] * total[k][j] for k in range(2)) for j in range(2)] for i in range(2)]
        return total

    def kick(b: Fraction) -> list[list[Fraction]]:
        return [[Fraction(1), Fraction(0)], [-b, Fraction(1)]]

    drift = [[Fraction(1), z / 2], [Fraction(0), Fraction(1)]]
    middle = kick(z * Fraction(2, 3) * (1 - z * z / 24))
    return product(kick(z / 6), drift, middle, drift, kick(z / 6))


@pytest.mark.parametrize("z", [Fraction(1, 3), Fraction(2), Fraction(7, 2)])
def test_its_matrix_on_the_oscillator(z: Fraction) -> None:
    wanted = matrices(z)
    assert amplification(CHIN, float(z)) == pytest.approx(np.array(wanted, dtype=float), rel=1e-14)
    assert (wanted[0][0] + wanted[1][1]) / 2 == 1 - z**2 / 2 + z**4 / 24 - z**6 / 864


def test_its_stability_limit_is_a_triple_root() -> None:
    """1 - y/2 + y**2/24 - y**3/864 = -1 - (y - 12)**3/864, y = z**2."""
    assert stability_limit(CHIN) == pytest.approx(2.0 * math.sqrt(3.0), abs=4.5e-16)


def test_another_coefficient_or_sign_has_order_two() -> None:
    for c in ("0", "-1/24", "1/12"):
        flows = tuple((kind, part, Fraction(c) if gradient else gradient) for kind, part, gradient in CHIN.flows)
        assert observed_order(replace(CHIN, flows=flows)) == pytest.approx(2.0, abs=0.1)


def test_every_sub_step_is_positive() -> None:
    assert all(fraction > 0 for _, fraction, _ in CHIN.flows)
    assert CHIN.evaluations == 3, "two forces, the first carried, and a gradient"


def test_evaluations_count_the_gradient() -> None:
    found = solve(driven_pendulum(functions=math), 0.5, 1.0, [0.0, 1.0], method=CHIN, h=0.1)
    assert found.evaluations == 10 * CHIN.evaluations + 1


def test_it_takes_bare_functions_by_differences() -> None:
    bare = solve(lambda t, q, v: -math.sin(q), 1.0, 0.0, [0.0, 5.0], method=CHIN, h=0.1)
    known = System(lambda t, q, v: -math.sin(q), velocity_free=True, jacobian=lambda t, q, v: (-math.cos(q), 0.0))
    assert bare.q[-1] == pytest.approx(solve(known, 1.0, 0.0, [0.0, 5.0], method=CHIN, h=0.1).q[-1], abs=1e-12)


def test_drag_is_refused() -> None:
    with pytest.raises(MethodError, match="chin4a needs forces free of the velocity, which the scene 'lab' does not"):
        rollout("lab", integrator="chin4a")
    with pytest.raises(MethodError, match="chin4a needs forces free of the velocity"):
        solve(lambda t, q, v: -q - v, 1.0, 0.0, [0.0, 1.0], method="chin4a", h=0.1)
    fits = {name for name, scene in SCENES.items() if "chin4a" in fitting(scene)}
    assert {"textbook", "vacuum", "exercise"} <= fits
    assert not any(SCENES[name].of_kind("dissipative") for name in fits)


def tug(angle: float, time: float, tug_rate: float) -> float:
    return tug_rate * (1.0 + time - angle * angle)


def tug_by_angle(angle: float, tug_rate: float) -> float:
    return -2.0 * tug_rate * angle


@dataclass(frozen=True)
class Tug(Effect):
    """Drive that depends on time and angle."""

    name = "tug"
    kind = "drive"
    equation = "{tug_rate} (1 + t - theta^2)"
    source = "made up"
    periodic = False
    torque = staticmethod(tug)
    by_angle = staticmethod(tug_by_angle)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"tug_rate": 3.0}


@pytest.mark.parametrize("drive", [Motor(max_torque=2.0), Tug()], ids=["motor", "tug"])
def test_work_is_of_order_four_too(drive: Effect) -> None:
    scene = Scene(effects=(Gravity(), drive))
    asked: dict[str, Any] = {"angle": 0.7, "velocity": 0.3, "duration": 1.0, "backend": "python",
                              "control": 0.7 if drive.controlled else 0.0}
    truth = rollout(scene, integrator="verner9", dt=0.005, **asked)
    runs = [rollout(scene, integrator="chin4a", dt=dt, **asked) for dt in (0.02, 0.01, 0.005)]
    for errors in (
        [abs(run.ledger.work[-1] - truth.ledger.work[-1]) for run in runs],
        [abs(run.angle[-1] - truth.angle[-1]) for run in runs],
        [float(np.max(np.abs(run.energy_residual))) for run in runs],
    ):
        assert math.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.1)


@pytest.mark.slow
def test_compiled_steps_have_the_same_bits() -> None:
    scene = Scene(effects=(Gravity(), Motor(max_torque=2.0)))
    asked: dict[str, Any] = {"integrator": "chin4a", "angle": 2.0, "velocity": 1.0, "duration": 5.0, "dt": 0.05,
                             "control": 0.5}
    one, other = (rollout(scene, backend=backend, **asked) for backend in ("python", "compiled"))
    for quantity in ("angle", "velocity", "energy_residual"):
        assert getattr(one, quantity).tolist() == getattr(other, quantity).tolist()


@pytest.mark.parametrize(
    ("flows", "message"),
    [
        (((KICK, "1/2", "0"), (DRIFT, "1", "0"), (KICK, "1/3", "0")), "the kicks sum to 5/6"),
        (((KICK, "1/2", "0"), (DRIFT, "1/2", "0"), (KICK, "1/2", "0")), "the drifts sum to 1/2"),
        (((DRIFT, "1/2", "0"), (KICK, "1", "0"), (DRIFT, "1/2", "0")), "with a kick first and last"),
        (((KICK, "1/2", "1/24"), (DRIFT, "1", "0"), (KICK, "1/2", "0")), "only kicks between the first and the last"),
    ],
)
def test_malformed_ones_are_refused(flows: Any, message: str) -> None:
    with pytest.raises(MethodError, match=message):
        replace(CHIN, flows=tuple((kind, Fraction(part), Fraction(c)) for kind, part, c in flows))


def test_quadratures_want_hooks() -> None:
    with pytest.raises(MethodError, match="chin4a: no sub-flow integrates work; a function for this is"):
        unroll(CHIN, quadratures=("work",), hooks={"kick": ("work",)})
