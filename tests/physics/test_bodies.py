"""Tests of compound pendulums: periods, pull at the pivot, drag and fluid against integrals over each shape in mpmath.

The integrals share no formula with the package: they add up the mass, the displaced fluid or the force of every slice.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from choice import chosen
from given_effects import GIVEN
from refusals import check_refused

import integrators
from pendulum_env import SCENES, Scene, SceneError, rollout
from pendulum_env.engine.machine import offers
from pendulum_env.physics.bodies import BODIES, Disc, Kater, MeasuredBody, Rod, Torsion, body_data, body_from
from pendulum_env.physics.body import Body, RigidBody
from pendulum_env.physics.effects import (
    EFFECTS,
    AddedMass,
    Buoyancy,
    Effect,
    Fibre,
    FiniteBob,
    Gravity,
    LinearDrag,
    Motor,
    QuadraticDrag,
    VerticalDrive,
    Wind,
    WireDrag,
)
from pendulum_env.physics.effects.effect import WEIGHT
from pendulum_env.physics.medium import Medium, air, water
from pendulum_env.physics.scene import Run

G = 9.81
LOPSIDED = Kater(length=0.7, bob_mass=0.9, radius=0.03, bob_position=0.75, counterweight_mass=0.3,
                 counterweight_radius=0.02, counterweight_position=0.2, rod_length=1.0, rod_mass=0.5, width=0.012,
                 overhang=0.1)
SHAPES: dict[str, RigidBody] = {
    "rod": Rod(length=0.8, mass=1.2, width=0.02),
    "rod with overhang": Rod(length=0.8, mass=1.2, width=0.02, overhang=0.25),
    "disc on its rim": Disc(radius=0.12, mass=0.7, centre=0.12),
    "disc near its centre": Disc(radius=0.12, mass=0.7, centre=0.03),
    "disc on an arm": Disc(radius=0.12, mass=0.7, centre=0.4),
    "kater": LOPSIDED,
    "kater inverted": dataclasses.replace(LOPSIDED, inverted=True),
    "measured": MeasuredBody(mass=1.3, centre=0.21, inertia=0.11, volume=3e-4),
}
FAST = ("dop853", "gauss8", "taylor20", "kahan_li8", "exact")
"""Methods that reach 1e-12 in a few hundred steps a period."""


def slices(body: RigidBody) -> list[tuple[Any, Any, Any, Any, Any]]:
    """Return mass, centre, half extent along the axis, width function and thickness rule of each part of a body.

    A part is a stack of slices across the axis; each is (density per length at x, ``<y²>`` at x, area at x).
    """
    if isinstance(body, Rod):
        r = mp.mpf(body.width) / 2
        middle, half = mp.mpf(body.length) / 2 - mp.mpf(body.overhang), mp.mpf(body.length) / 2
        return [(mp.mpf(body.mass), middle, half, lambda x: mp.pi * r**2, lambda x: r**2 / 4)]
    if isinstance(body, Disc):
        r, thick = mp.mpf(body.radius), mp.mpf(body.thickness)
        return [(mp.mpf(body.mass), mp.mpf(body.centre), r, lambda x: 2 * mp.sqrt(r**2 - x**2) * thick,
                 lambda x: (r**2 - x**2) / 3)]
    assert isinstance(body, Kater)
    far = mp.mpf(body.length)
    below = (lambda x: far - x) if body.inverted else (lambda x: x)
    r, half = mp.mpf(body.width) / 2, mp.mpf(body.rod_length) / 2
    parts = [(mp.mpf(body.rod_mass), below(half - mp.mpf(body.overhang)), half, lambda x: mp.pi * r**2,
              lambda x: r**2 / 4)]
    for mass, place, radius in ((body.bob_mass, body.bob_position, body.radius),
                                (body.counterweight_mass, body.counterweight_position, body.counterweight_radius)):
        a = mp.mpf(radius)
        parts.append((mp.mpf(mass), below(mp.mpf(place)), a, lambda x, a=a: mp.pi * (a**2 - x**2),
                      lambda x, a=a: (a**2 - x**2) / 4))
    return parts


def summed(body: RigidBody, value: Callable[[Any, Any], Any]) -> Any:
    """Integrate ``value(x, <y²>)`` over the mass of a body, x along the axis from the pivot, y across in the plane."""
    if isinstance(body, MeasuredBody):  # two points on the axis and a ring have its mass, centre and inertia
        m, s = mp.mpf(body.mass), mp.mpf(body.centre)
        return m * value(s, mp.mpf(body.inertia) / m - s**2)
    total = mp.mpf(0)
    for mass, middle, half, area, square in slices(body):
        volume = mp.quad(area, [-half, 0, half])
        total += mass / volume * mp.quad(lambda x, f=(middle, area, square): f[1](x) * value(f[0] + x, f[2](x)),
                                         [-half, 0, half])
    return total


def scene_of(body: RigidBody, *more: Effect, medium: Medium | None = None, **values: Any) -> Scene:
    return Scene("shape", body, medium or Medium(), (Gravity(), *more), G, Run(**values))


# --- the swing ------------------------------------------------------------------------------------------------------


@pytest.mark.quick(
    "rod-1.0", "disc near its centre-0.001", "kater-3.0", "measured-1.0", "rod with overhang-3.0",
    "disc on its rim-1.0"
)
@pytest.mark.parametrize("angle", [1e-3, 1.0, 3.0])
@pytest.mark.parametrize("name", SHAPES)
def test_the_period_of_every_shape(name: str, angle: float) -> None:
    """``T = 4 K(sin²(A/2)) sqrt(I/(M g s))``: a quarter swing past a whole one, the body passes the bottom.

    Its angle there, over its velocity, is the error of 5/4 of the period: below 1e-12 of it.
    """
    body, method = SHAPES[name], chosen(FAST, f"{name} {angle}")
    with mp.workdps(30):
        inertia = summed(body, lambda x, square: x**2 + square)
        moment = summed(body, lambda x, square: x)
        ratio = mp.sqrt(inertia / (moment * mp.mpf(G)))
        period = 4 * mp.ellipk(mp.sin(mp.mpf(angle) / 2) ** 2) * ratio
        fastest = 2 * mp.sin(mp.mpf(angle) / 2) / ratio
        end = float(period * 5 / 4)
    run = rollout(scene_of(body), integrator=method, angle=angle, velocity=0.0, dt=end / 600, duration=end,
                  warn=False, backend="python")
    assert abs(run.angle[-1]) / float(fastest) < 1e-12 * end
    assert run.velocity[-1] == pytest.approx(-float(fastest), rel=1e-11)


@pytest.mark.parametrize("counterweight", [0.25, 0.3, 0.5])
@pytest.mark.parametrize("angle", [0.05, 1.2])
def test_a_tuned_kater_pendulum_has_one_period(counterweight: float, angle: float) -> None:
    """About both knife edges it swings as a point mass on their distance does: Kater 1818, and Huygens 1673."""
    upright = dataclasses.replace(LOPSIDED, counterweight_mass=counterweight).tuned()
    period = float(4 * mp.ellipk(mp.sin(mp.mpf(angle) / 2) ** 2) * mp.sqrt(mp.mpf(upright.length) / mp.mpf(G)))
    for inverted in (False, True):
        body = dataclasses.replace(upright, inverted=inverted)
        run = rollout(scene_of(body), integrator="exact", angle=angle, velocity=0.0, dt=period / 8,
                      duration=1.25 * period, backend="python")
        assert abs(run.angle[-1] / run.velocity[-1]) < 1e-12 * period
    assert upright.moment != pytest.approx(dataclasses.replace(upright, inverted=True).moment, rel=1e-3)


def test_the_preset_measures_g() -> None:
    """``g = 4 pi² d/T²``, from both ends of the preset alike."""
    for inverted in (False, True):
        scene = SCENES["kater"].replace(inverted=inverted)
        assert (scene.omega0**2) * scene.body.reach == pytest.approx(scene.gravity, rel=1e-13)


@pytest.mark.parametrize("angle", [1e-3, 1.0, 30.0])
def test_a_torsion_pendulum_keeps_its_period_at_any_angle(angle: float) -> None:
    """``T = 2 pi sqrt(I/kappa)``, whatever the amplitude, and damped as ``exp(-gamma t/2)``."""
    body, kappa, gamma = Torsion(mass=0.4, radius=0.15), 0.003, 0.05
    inertia = mp.quad(lambda r: r**3, [0, mp.mpf(body.radius)]) * 2 * mp.mpf(body.mass) / mp.mpf(body.radius) ** 2
    omega = mp.sqrt(mp.mpf(kappa) / inertia)
    end = float(2 * mp.pi / omega * 5 / 4)
    scene = Scene("twist", body, effects=(Fibre(kappa),))
    for method in ("dop853", "gauss8", "exact"):
        run = rollout(scene, integrator=method, angle=angle, velocity=0.0, dt=end / 600, duration=end, warn=False,
                      backend="python")
        assert abs(run.angle[-1] / run.velocity[-1]) < 1e-12 * end
    damped = scene.with_effects((Fibre(kappa), LinearDrag(gamma)))
    run = rollout(damped, integrator="exact", angle=angle, velocity=0.0, dt=end / 10, duration=end,
                  warn=False, backend="python")
    nu, t = mp.sqrt(omega**2 - mp.mpf(gamma) ** 2 / 4), mp.mpf(end)
    wanted = angle * mp.exp(-gamma * t / 2) * (mp.cos(nu * t) + gamma / (2 * nu) * mp.sin(nu * t))
    assert run.angle[-1] == pytest.approx(float(wanted), abs=1e-13 * angle)
    energy = mp.mpf(kappa) * angle**2 / 2
    assert run.energy[0] == pytest.approx(float(energy), rel=1e-14)


@pytest.mark.parametrize("angle", [0.2, 2.5])
def test_a_spring_beside_gravity(angle: float) -> None:
    """The quarter period is the integral of ``dtheta/sqrt(2 (V(A) - V(theta))/I)``, theta = A sin(u)."""
    body, kappa = Rod(length=0.6, mass=0.3, width=0.01), 1.1
    scene = scene_of(body, Fibre(kappa))
    with mp.workdps(25):
        inertia, moment = (summed(body, f) for f in (lambda x, square: x**2 + square, lambda x, square: x))
        A, pull, spring = mp.mpf(angle), moment * mp.mpf(G) / inertia, mp.mpf(kappa) / inertia

        def slowness(u: Any) -> Any:
            x = A * mp.sin(u)
            share = pull * mp.sinc((A + x) / 2) * mp.sinc((A - x) / 2)
            return 1 / mp.sqrt(share + spring)

        quarter = float(mp.quad(slowness, [0, mp.pi / 2]))
        omega = float(mp.sqrt(pull + spring))
    assert scene.omega0 == pytest.approx(omega, rel=1e-14)
    run = rollout(scene, integrator="dop853", angle=angle, velocity=0.0, dt=quarter / 200,
                  duration=quarter, backend="python")
    assert abs(run.angle[-1] / run.velocity[-1]) < 1e-12 * quarter


def test_only_the_fibre_turns_a_body_without_the_effect_of_its_weight() -> None:
    scene = Scene("no weight", Rod(), effects=(Fibre(0.4),))
    assert scene.omega0 == pytest.approx(math.sqrt(0.4 / Rod().inertia), rel=1e-15)


# --- the pivot ------------------------------------------------------------------------------------------------------


@pytest.mark.quick("rod", "disc on an arm", "kater inverted")
@pytest.mark.parametrize("name", SHAPES)
def test_the_pull_at_the_pivot_of_every_shape(name: str) -> None:
    """The constraint force from a Lagrangian in which the body may slide along its axis by r.

    ``L = sum of m ((x + r)² + y²) theta'²/2 + m g (x + r) cos(theta)`` over the mass; where r'' = 0, the pull is dL/dr.
    The velocity follows from the energy.
    """
    body, start = SHAPES[name], 2.4
    run = rollout(scene_of(body), integrator="dop853", angle=start, velocity=0.0, dt=0.002, duration=0.6,
                  diagnostics=("energy", "tension"), backend="python")
    with mp.workdps(20):
        inertia, moment = (summed(body, f) for f in (lambda x, square: x**2 + square, lambda x, square: x))
        for place in (0, 300):
            theta = mp.mpf(float(run.angle[place]))
            square = 2 * moment * mp.mpf(G) / inertia * (mp.cos(theta) - mp.cos(mp.mpf(start)))

            def lagrangian(r: Any, theta: Any = theta, speed: Any = square) -> Any:
                return summed(body, lambda x, y2: ((x + r) ** 2 + y2) * speed / 2 + mp.mpf(G) * (x + r) * mp.cos(theta))

            pull = (lagrangian(1) - lagrangian(-1)) / 2  # exact, as L is a square in r
            assert run.watched["tension"][place] == pytest.approx(float(pull), rel=1e-11)


def test_a_fibre_carries_the_weight_of_a_torsion_pendulum() -> None:
    run = rollout("torsion", duration=1.0, diagnostics=("tension",), backend="python")
    assert run.watched["tension"] == pytest.approx(0.5 * 9.81, rel=1e-15)


# --- the fluid ------------------------------------------------------------------------------------------------------


def lifted(body: RigidBody, value: Callable[[Any], Any], share: Callable[[int], Any]) -> Any:
    """Integrate a function of the distance x over the displaced volume, weighted by ``share`` of the part's place."""
    total = mp.mpf(0)
    for place, (_, middle, half, area, _) in enumerate(slices(body)):
        total += share(place) * mp.quad(lambda x, f=(middle, area): f[1](x) * value(f[0] + x), [-half, 0, half])
    return total


@pytest.mark.parametrize("name", ["rod", "rod with overhang", "disc on its rim", "kater", "kater inverted"])
def test_buoyancy_and_added_mass_of_every_shape(name: str) -> None:
    """Buoyancy takes the displaced fluid; a cylinder across the flow moves as much along, a ball half (Lamb 1932)."""
    body, medium = SHAPES[name], water(20.0)
    rho = mp.mpf(medium.density)
    afloat = scene_of(body, Buoyancy(), medium=medium)
    lift = rho * lifted(body, lambda x: x, lambda place: 1)
    assert afloat.weight_moment == pytest.approx(float(summed(body, lambda x, _: x) - lift), rel=1e-13)
    if not isinstance(body, Disc):
        moved = scene_of(body, AddedMass(), medium=medium)
        one = lifted(body, lambda x: x, lambda place: mp.mpf(1) if place == 0 else mp.mpf(1) / 2)
        assert moved.mass_moment - moved.body.moment == pytest.approx(float(rho * one), rel=1e-9)
        balls = slices(body)[1:]
        own = sum(rho / 2 * mp.quad(part[3], [-part[2], part[2]]) * part[1] ** 2 for part in balls)
        _, middle, half, area, _ = slices(body)[0]
        own += rho * mp.quad(lambda x: area(x) * (middle + x) ** 2, [-half, half])
        assert moved.inertia - moved.body.inertia == pytest.approx(float(own), rel=1e-9)


@pytest.mark.parametrize("name", ["rod", "rod with overhang", "kater inverted"])
@pytest.mark.parametrize("velocity", [0.3, -6.0])
def test_the_drag_of_a_rod_slice_by_slice(name: str, velocity: float) -> None:
    """Each slice of a cylinder has ``C_d = 1 + 10 Re^(-2/3)`` at its own speed (White 2006), on both sides."""
    body, medium = SHAPES[name], air(20.0)
    scene = scene_of(body, WireDrag(), medium=medium)
    rho, mu, d = mp.mpf(medium.density), mp.mpf(medium.viscosity), 2 * mp.mpf(body.diameter) / 2
    _, middle, half, _, _ = slices(body)[0]

    def torque(x: Any) -> Any:
        speed = abs(x * velocity)
        if speed == 0:
            return mp.mpf(0)
        drag = 1 + 10 * (rho * speed * d / mu) ** (-mp.mpf(2) / 3)
        return rho / 2 * drag * d * speed**2 * abs(x)

    total = mp.quad(torque, [middle - half, 0, middle + half])
    values = scene.coefficients
    found = WireDrag.torque(velocity, abs(velocity), values["wire_form_rate"], values["wire_skin_rate"])
    assert found * scene.inertia == pytest.approx(-math.copysign(float(total), velocity), rel=1e-6)


@pytest.mark.parametrize("name", [name for name in SHAPES if name != "measured"])
def test_drag_with_a_given_coefficient_slice_by_slice(name: str) -> None:
    """``rho C_d/2`` times the area across the flow times the speed squared times the lever, C_d = 1.2."""
    body, medium = SHAPES[name], air(20.0)
    scene = scene_of(body, QuadraticDrag(drag_coefficient=1.2), medium=medium)
    if isinstance(body, Kater):
        area = [(part[1], mp.pi * part[2] ** 2) for part in slices(body)[1:]]
        total = sum(size * abs(x) ** 3 for x, size in area)
    else:
        wide = mp.mpf(body.width if isinstance(body, Rod) else body.thickness)  # type: ignore[attr-defined]
        _, middle, half, _, _ = slices(body)[0]
        total = mp.quad(lambda x: wide * abs(x) ** 3, [middle - half, *([0] if middle < half else []), middle + half])
    wanted = mp.mpf(medium.density) * mp.mpf(1.2) / 2 * total
    assert scene.coefficients["quadratic_drag_rate"] * scene.inertia == pytest.approx(float(wanted), rel=1e-12)


# --- every body with every effect and many methods --------------------------------------------------------------------

METHODS = ("rk4", "velocity_verlet", "gauss4", "dop853", "adams_bashforth4", "taylor8")
EXAMPLES: dict[str, RigidBody] = {**SHAPES, "torsion": Torsion(mass=0.4, radius=0.15)}


def example(body: RigidBody, effect: Effect) -> Scene | None:
    """Return the scene of a body with what turns it back and one effect more; None if the body refuses it."""
    held: Effect = Fibre(0.05) if isinstance(body, Torsion) else Gravity()
    effects = (held,) if effect.name == held.name else (held, effect)
    try:
        return Scene("example", body, air(20.0), effects, G, Run(angle=0.9, velocity=-2.0, dt=0.01, duration=0.12))
    except SceneError:
        return None


@pytest.mark.quick("torsion")
@pytest.mark.parametrize("name", [
    pytest.param(name, marks=() if name in ("rod with overhang", "measured", "torsion") else pytest.mark.slow)
    for name in EXAMPLES])
def test_every_body_with_every_effect(name: str) -> None:
    """The ledger closes at half the step as the method's order wants, or better; a refusal names effect and body."""
    body = EXAMPLES[name]
    for kind in EFFECTS:
        effect = GIVEN.get(kind) or EFFECTS[kind]()
        scene = example(body, effect)
        if scene is None:
            held = (Fibre(0.05),) if isinstance(body, Torsion) else (Gravity(),)
            if effect.exclusive != "gravity" or isinstance(body, Torsion):
                with pytest.raises(SceneError, match=rf"^{kind} .*'{body.shape}', because|^Buoyancy needs the volume"):
                    Scene("refused", body, air(20.0), (*held, effect), G)
            continue
        method = chosen([m for m in METHODS if integrators.get(m).needs <= offers(scene)], f"{name} {kind}")
        watched = ("energy", "heat_by_effect", "tension") + (("flow",) if "flow" not in body.lacks else ())
        coarse, fine = (
            rollout(scene, integrator=method, dt=h, substeps=round(0.01 / h), control=0.7, backend="python",
                    warn=False, diagnostics=watched) for h in (0.01, 0.005))
        size = scene.restoring
        assert fine.stop_reason == ""
        assert not np.isnan(list(fine.watched.values())).any()
        assert np.abs(fine.energy_residual).max() < 0.7 * np.abs(coarse.energy_residual).max() + 1e-13 * size
        assert np.abs(coarse.energy_residual).max() < 1e-2 * size
        assert all(heat[-1] >= 0.0 for heat in fine.heat_by_effect.values())


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", EXAMPLES)
def test_every_body_with_every_method_against_a_reference(name: str, method: str) -> None:
    """Runs, damped and driven, against the reference solution of the package's other codes; compiled with rk4."""
    from pendulum_env.truth.reference import reference

    body = EXAMPLES[name]
    held: Effect = Fibre(0.05) if isinstance(body, Torsion) else Gravity()
    scene = Scene("compound", body, effects=(held, LinearDrag(0.1), GIVEN["periodic_torque"]), gravity=G)
    errors = []
    for h in (0.01, 0.005):
        run = rollout(scene, integrator=method, angle=1.0, velocity=0.0, dt=h, duration=1.0, warn=False,
                      backend="compiled" if method == "rk4" else "python")
        errors.append(abs(run.angle[-1] - reference(scene, 1.0, 0.0, np.array([0.0, 1.0])).angle[-1]))
    assert errors[1] < 0.3 * errors[0] + 1e-12


# --- data, refusals ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", BODIES)
def test_every_body_survives_json(shape: str) -> None:
    body = BODIES[shape]()
    assert body_from(json.loads(json.dumps(body_data(body))), "A body") == body
    held: Effect = Fibre() if shape == "torsion" else Gravity()
    scene = Scene("kept", body, effects=(held,))
    assert Scene.from_dict(json.loads(json.dumps(scene.to_dict()))) == scene
    assert scene.replace(body=body_data(body)) == scene
    assert scene.replace(mass=0.31).body.mass == 0.31 if "mass" in scene.parameters() else shape == "kater"
    assert shape == "ball" or f"body: {shape}, " in scene.describe()


def test_an_array_of_rods_runs_as_one_batch() -> None:
    lengths = np.array([0.4, 0.5, 0.7])
    run = rollout("rod", length=lengths, duration=0.5, backend="python")
    for place, length in enumerate(lengths):
        one = rollout("rod", length=float(length), duration=0.5, backend="python")
        assert (run.angle[place] == one.angle).all()


REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "no inertia": (lambda: MeasuredBody(inertia=None), "inertia must be a finite number above 0 [kg m^2], not None"),  # type: ignore[arg-type]
    "inertia 0": (lambda: MeasuredBody(inertia=0.0), "inertia must be a finite number above 0"),
    "inertia about the centre": (lambda: Scene(body=MeasuredBody(1.0, 0.5, 0.1)), "at least mass times centre squared"),
    "rod held in its middle": (lambda: scene_of(Rod(length=1.0, overhang=0.5)), "no restoring torque"),
    "rod held too low": (lambda: scene_of(Rod(length=1.0, overhang=0.7)), "hangs the other way up"),
    "rod without a pivot": (lambda: Scene(body=Rod(length=1.0, overhang=1.0)), "must be below that length"),
    "disc held in its centre": (lambda: scene_of(Disc(centre=0.0)), "no restoring torque"),
    "a counterweight that balances": (
        lambda: scene_of(Kater(bob_mass=1.0, bob_position=0.15, counterweight_mass=1.0, counterweight_position=-0.15,
                               rod_length=1.3, overhang=0.15, rod_mass=1e-300)), "no restoring torque"),
    "knife edge beside the rod": (lambda: Scene(body=Kater(rod_length=1.0)), "give rod_length of at least 1.1939 m"),
    "no tuning": (lambda: Kater(counterweight_mass=1e-3).tuned(), "No place of a counterweight of 0.001 kg"),
    "no counterweight": (lambda: Kater(counterweight_mass=0.0).tuned(), "No place of a counterweight of 0 kg"),
    "gravity on a fibre": (lambda: scene_of(Torsion()), "gravity has no meaning for the body"),
    "shaken fibre": (lambda: Scene(body=Torsion(), effects=(Fibre(), VerticalDrive())), "acts through the axis"),
    "wind on a fibre": (lambda: Scene(body=Torsion(), medium=air(), effects=(Fibre(), Wind())), "wind has no meaning"),
    "bob's size on a rod": (lambda: scene_of(Rod(), FiniteBob()), "already that of the whole body"),
    "Stokes on a rod": (lambda: scene_of(Rod(), LinearDrag(), medium=air()), "use wire_drag, which is that of a rod"),
    "fluid along a disc": (lambda: scene_of(Disc(), AddedMass(), medium=air()), "moves no fluid along"),
    "drag of an unknown form": (lambda: scene_of(MeasuredBody(), QuadraticDrag(drag_coefficient=1.0), medium=air()),
                                "its outer form is not known"),
    "buoyancy of an unknown volume": (lambda: scene_of(MeasuredBody(), Buoyancy(), medium=air()), "give volume"),
    "fibre on a wire": (lambda: Scene(body=Body(suspension="wire"), effects=(Fibre(),)), "A wire carries no torque"),
    "floating rod": (lambda: scene_of(Rod(mass=0.01), Buoyancy(), medium=water()), "would float"),
    "unknown shape": (lambda: Scene.from_dict({"body": {"shape": "rot"}}), "did you mean rod?"),
    "unknown measure": (lambda: Scene.from_dict({"body": {"shape": "rod", "lenght": 1.0}}), "did you mean length?"),
    "flow past an unknown form": (lambda: rollout(scene_of(MeasuredBody()), diagnostics=("flow",)),
                                  "The diagnostic 'flow' has no meaning for the body 'measured'"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str) -> None:
    check_refused(*REFUSED[name])


def test_every_need_of_an_effect_is_one_that_bodies_name() -> None:
    """A body that lacks what no effect needs, or an effect that needs what none lacks, is a slip of the pen."""
    models: tuple[Effect, ...] = (*(GIVEN.get(name) or kind() for name, kind in EFFECTS.items()),
                                  QuadraticDrag(drag_coefficient=1.0), Motor())
    needs = {effect.needs for effect in models} - {""}
    lacks = {name for body in BODIES.values() for name in body.lacks}
    assert needs == lacks - {"flow"}
    assert WEIGHT in needs


def test_a_centre_above_the_pivot_hangs_nowhere_and_without_gravity_turns_freely() -> None:
    above = Rod(length=1.0, overhang=0.8)
    with pytest.raises(SceneError, match="above the pivot"):
        Scene(body=above, effects=(Gravity(),))
    free = Scene(body=above, effects=())
    assert (free.restoring, free.omega0) == (0.0, 0.0)
    run = rollout(free, angle=0.3, velocity=2.0, dt=0.01, duration=1.0, backend="python")
    assert run.angle[-1] == pytest.approx(2.3, rel=1e-12)
