"""Tests of the flow numbers of a swing: Keulegan-Carpenter number, losses, quality factor, damping regime."""

from __future__ import annotations

import math
from typing import Any

import pytest
from fluid_scenes import FREQUENCY, LARGE, LENGTH, MASS, scene_with

from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.equations import flow_numbers
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    CoulombFriction,
    Effect,
    LinearDrag,
    Motor,
    QuadraticDrag,
    SmallAngleGravity,
)
from pendulum_env.physics.flow import (
    bottom_speed,
    keulegan_carpenter,
    quality_factor,
    regime_of_damping,
    swing_loss,
    terminal_speed,
)


def test_the_keulegan_carpenter_number_of_the_lab_is_54() -> None:
    assert keulegan_carpenter(SCENES["lab"], LARGE) == pytest.approx(54.0, abs=0.5)
    assert keulegan_carpenter(SCENES["lab"], -LARGE) == keulegan_carpenter(SCENES["lab"], LARGE)


def test_the_speed_at_the_bottom() -> None:
    """The speed at the bottom obeys v²/2 = g L (1 - cos A)."""
    wanted = math.sqrt(2.0 * 9.81 * LENGTH * (1.0 - math.cos(LARGE)))
    assert bottom_speed(scene_with(), LARGE) == pytest.approx(wanted, rel=1e-12)


# what takes energy -> its share of the amplitude per half swing: Nelson & Olsson 1986
LOSSES: dict[str, tuple[Effect, Any]] = {
    "linear": (LinearDrag(gamma=0.3), lambda a: math.pi * 0.3 / (2.0 * FREQUENCY)),
    "quadratic": (QuadraticDrag(c=0.02), lambda a: 4.0 / 3.0 * 0.02 * a),
    "coulomb": (CoulombFriction(friction_torque=1e-3), lambda a: 2e-3 / (MASS * LENGTH**2 * FREQUENCY**2 * a)),
}


@pytest.mark.parametrize("amplitude", [1e-3, 0.5])
@pytest.mark.parametrize("what", LOSSES)
def test_the_loss_of_a_harmonic_swing(what: str, amplitude: float) -> None:
    effect, wanted = LOSSES[what]
    assert swing_loss(effect, scene_with(effect), amplitude) == pytest.approx(wanted(amplitude), rel=1e-6)


def test_the_quality_factor_is_that_of_all_losses() -> None:
    """Q is omega0/gamma for linear drag; 1/Q of several effects add up; inf without losses, 0 without weight."""
    effects = [effect for effect, _ in LOSSES.values()]
    quality = quality_factor(scene_with(LinearDrag(gamma=0.3)), 0.2)
    assert quality == pytest.approx(FREQUENCY / 0.3, rel=1e-12)
    each = [1.0 / quality_factor(scene_with(effect), 0.2) for effect in effects]
    assert 1.0 / quality_factor(scene_with(*effects), 0.2) == pytest.approx(sum(each), rel=1e-12)
    assert quality_factor(scene_with(Motor(), body=Body(LENGTH, MASS)), 0.2) == math.inf
    assert quality_factor(scene_with(LinearDrag(gamma=0.3)).replace(gravity=0.0), 0.2) == 0.0
    assert quality_factor(scene_with(LinearDrag(gamma=0.3)), 0.0) == pytest.approx(FREQUENCY / 0.3, rel=1e-12)
    assert quality_factor(scene_with(CoulombFriction(friction_torque=1e-3)), 0.0) < 1e-90
    assert quality_factor(scene_with(QuadraticDrag(c=0.02)), 0.0) > 1e90


@pytest.mark.parametrize(("share", "regime"), [
    (1.9, "underdamped"), (2.0, "critically damped"), (2.1, "overdamped")])
def test_the_regime_of_damping(share: float, regime: str) -> None:
    """Damping is critical at gamma/omega0 = 2."""
    scene = scene_with(LinearDrag(gamma=share * FREQUENCY), weight=SmallAngleGravity())
    assert regime_of_damping(quality_factor(scene, 0.2)) == regime
    run = rollout(scene, integrator="dop853", angle=0.2, velocity=0.0, dt=0.01, duration=6.0, backend="python")
    assert (min(run.angle) < 0.0) == (regime == "underdamped")


@pytest.mark.parametrize("steepness", [0.1, 1.0])
def test_the_terminal_speed_is_where_drag_balances_the_weight(steepness: float) -> None:
    """The terminal speed is omega0² sin(A)/gamma for linear and sqrt(omega0² sin(A)/c) for quadratic drag.

    With both, it is the root of the quadratic equation.
    """
    base = Scene(body=Body(length=0.7), effects=(SmallAngleGravity(),))
    pull = steepness * 9.81 / 0.7
    gamma, c = 30.0, 4.0
    both = (math.sqrt(gamma**2 + 4.0 * c * pull) - gamma) / (2.0 * c)
    for effects, wanted in (((LinearDrag(gamma),), pull / gamma), ((QuadraticDrag(c=c),), math.sqrt(pull / c)),
                            ((LinearDrag(gamma), QuadraticDrag(c=c)), both)):
        scene = base.with_effects((*base.effects, *effects))
        assert terminal_speed(scene, steepness) == pytest.approx(0.7 * wanted, rel=1e-8)
    assert terminal_speed(base, steepness) == math.inf


def test_where_nothing_restores_there_is_no_quality() -> None:
    """The quality factor is 0 in a scene without the effect of gravity, whatever g is."""
    scene = Scene(effects=(LinearDrag(gamma=0.5),))
    assert scene.omega0 > 0.0
    assert quality_factor(scene, 0.3) == 0.0
    assert quality_factor(scene.with_effects(()), 0.3) == 0.0
    values = flow_numbers(scene)
    assert (values["natural_rate"], values["stroke_rate"]) == (0.0, 0.0)
