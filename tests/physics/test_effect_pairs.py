"""Tests of effects together: every pair that a scene allows, with methods of several kinds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from choice import chosen, turn_of
from given_effects import GIVEN

import integrators
from pendulum_env.engine.generate import program
from pendulum_env.engine.machine import offers
from pendulum_env.engine.rollout import rollout
from pendulum_env.physics.body import Body
from pendulum_env.physics.drag_laws import LAWS
from pendulum_env.physics.effects import (
    EFFECTS,
    AddedMass,
    CoulombFriction,
    Effect,
    Gravity,
    LinearDrag,
    Motor,
    SphereDrag,
)
from pendulum_env.physics.medium import air
from pendulum_env.physics.scene import Run, Scene
from pendulum_env.physics.units import SceneError

BODY = Body(length=0.353, mass=0.040, radius=0.0107)
USUAL = Run(angle=0.9, velocity=-2.0, dt=0.01, duration=0.12)
MOTORS = (
    Motor(lag=0.05), Motor(ramp=0.1, control_quantum=0.25, dead_zone=0.1, lag=0.02),
    Motor(control_sets="voltage", no_load_speed=9.0), Motor(no_load_speed=6.0, stall_torque=0.06),
    Motor(no_load_speed=0.9, ramp=0.05),
)
"""Motors with options of every kind; the supply limits the torque of the last one from the start on."""
MODELS: tuple[Effect, ...] = (
    *(GIVEN.get(name) or effect() for name, effect in EFFECTS.items()),
    *(SphereDrag(law=law) for law in LAWS), *MOTORS, AddedMass(boundary_layer=True),
    LinearDrag(boundary_layer=True),
)
"""Every effect, and variants of some."""
ADAPTIVE = "dop853"
METHODS = ("rk4", "velocity_verlet", "gauss4", "adams_bashforth4", "taylor8", ADAPTIVE)


def scenes(gravity: float = 9.81, suspension: str = "rod") -> Iterator[Scene]:
    """Yield a scene for every pair of effects that can be combined."""
    body = replace(BODY, suspension=suspension, slack="warn")
    for pair in combinations(MODELS, 2):
        try:
            yield Scene("pair", body, air(20.0), pair, gravity, USUAL)
        except SceneError:
            continue


@pytest.mark.quick("adaptive-Gravity()", "adaptive-WireDrag()", "adaptive-Motor()", "adaptive-Gusts()")
@pytest.mark.parametrize("effect", MODELS, ids=repr)
@pytest.mark.parametrize("form", ["adaptive", "compensated"])
def test_names_of_effects_and_of_controllers_do_not_clash(effect, form):
    """Functions of effects, of step-size control and of compensated sums share a program, so their names must differ.
    """
    if form == "adaptive" and effect.dry:
        pytest.skip("refused with rtol")
    method = integrators.get(ADAPTIVE if form == "adaptive" else "rk4")
    scene = Scene(body=BODY, medium=air(20.0), effects=(effect,))
    assert program(scene, method, adaptive=form == "adaptive", compensated=form == "compensated").text


def check(scene: Scene, method: str) -> None:
    """Check a short run with all diagnostics at two step sizes: finite values, closed energy ledger, no negative heat.
    """
    options = {"rtol": 1e-10} if method == ADAPTIVE else {}
    results = []
    for h in (0.004, 0.002):
        run = rollout(
            scene, integrator=method, dt=h, substeps=round(0.004 / h), control=0.7, backend="python", warn=False,
            diagnostics=("energy", "heat_by_effect", "tension", "flow"), **options,
        )
        assert run.stop_reason == ""
        assert np.isfinite([run.angle, run.velocity, run.energy, run.ledger.work, run.ledger.heat]).all()
        assert not np.isnan(list(run.watched.values())).any()
        lossy = (*scene.of_kind("dissipative"), *scene.of_kind("limit"))
        assert run.heat_by_effect.keys() == {effect.name for effect in lossy}
        assert all(heat[-1] >= 0.0 for heat in run.heat_by_effect.values())
        results.append((np.abs(run.energy_residual).max(), run.angle[-1]))
    (coarse, first), (fine, second) = results
    order = 2 if method == "velocity_verlet" else 3
    assert coarse < (1e-2 if order == 2 else 1e-3) * 0.04 * 9.81 * 0.353
    assert fine < 0.7 * coarse + 1e-14
    assert abs(first - second) < (1e-2 if order == 2 else 1e-3)


def fits(scene: Scene, method: str) -> bool:
    dry = method == ADAPTIVE and any(effect.dry for effect in scene.effects)
    return not dry and integrators.get(method).needs <= offers(scene)


@pytest.mark.slow
def test_pairs_of_effects():
    """Run about every tenth pair with one method that fits; the slow test runs all pairs with all methods."""
    allowed = list(scenes())
    names = {frozenset(effect.name for effect in scene.effects) for scene in allowed}
    assert {frozenset(("gravity", name)) for name, effect in EFFECTS.items() if effect.exclusive != "gravity"} <= names
    for scene in allowed:
        text = repr(scene.effects)
        if turn_of(text, 10) == 0:
            check(scene, chosen([method for method in METHODS if fits(scene, method)], text))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*wire.*:UserWarning")
@pytest.mark.parametrize(
    ("method", "gravity", "suspension"),
    [*((method, 9.81, "rod") for method in METHODS), ("rk4", 0.0, "rod"), ("rk4", 9.81, "wire")],
)
def test_every_pair_of_effects(method, gravity, suspension):
    for scene in scenes(gravity=gravity, suspension=suspension):
        if fits(scene, method):
            check(scene, method)


HELD = ("rk4", "velocity_verlet", "backward_euler")


@pytest.mark.slow
def test_a_stuck_bob_stays_stuck_bit_for_bit():
    """A bob held by dry friction does not creep, and makes no heat and no work, beside any other effect.

    With gravity and without, below the friction limit, with the suitable methods in turn: some 50 runs.
    """
    done: dict[str, int] = dict.fromkeys(HELD, 0)
    tried: set[str] = set()
    for effect in MODELS:
        others = (effect,) if effect.exclusive == "gravity" else (Gravity(), effect)
        for gravity in (9.81, 0.0):
            effects = (*others, CoulombFriction(friction_torque=0.2))
            try:
                scene = Scene("stuck", BODY, air(20.0), effects, gravity, Run(angle=0.3, dt=0.01, duration=0.1))
            except SceneError:
                continue
            fitting = [name for name in HELD if integrators.get(name).needs <= offers(scene)]
            method = min(fitting, key=lambda name: done[name])
            run = rollout(scene, integrator=method, control=0.9, backend="python", warn=False)
            assert (run.angle == 0.3).all()
            assert not run.velocity.any()
            assert not run.ledger.heat.any()
            assert not run.ledger.work.any()
            done[method] += 1
            tried |= {effect.name} if gravity else set()
    assert tried == EFFECTS.keys() - {"coulomb_friction"}
    assert all(done.values())
