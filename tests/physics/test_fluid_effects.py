"""Tests of the effects of bob size, suspension and fluid on a swing: textbook corrections against simulation."""

from __future__ import annotations

import math
from typing import Any

import pytest
from fluid_scenes import AIR, FREQUENCY, LARGE, LENGTH, MASS, RADIUS, scene_with

from pendulum_env import SceneError, rollout
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    EFFECTS,
    AddedMass,
    BearingFriction,
    Buoyancy,
    CoulombFriction,
    Effect,
    FiniteBob,
    Gravity,
    LinearDrag,
    Motor,
    QuadraticDrag,
    SmallAngleGravity,
    Suspension,
)
from pendulum_env.physics.effects.added_mass import own_frequency
from pendulum_env.physics.flow import boundary_layer
from pendulum_env.physics.medium import Medium, glycerol, water
from pendulum_env.physics.scene import Scene
from pendulum_env.study.audit.cases import swing, turning_points

DENSITY = MASS / (4.0 / 3.0 * math.pi * RADIUS**3)
"""Density of the lab's bob [kg/m³]."""




def period(scene: Scene, amplitude: float) -> float:
    """Return the mean period of two oscillations, by an eighth-order method with 200 steps per period, to about 1e-11.
    """
    natural = 2.0 * math.pi / scene.omega0
    run = rollout(
        scene, integrator="dop853", angle=amplitude, velocity=0.0, dt=natural / 200.0, duration=2.3 * natural,
        diagnostics=(), backend="python", warn=False,
    )
    return turning_points(run.time, run.angle, run.velocity)[3][0] / 2.0


# --- the table of period corrections --------------------------------------------------------------------------------

WIRE_MASS = math.pi * 0.00015**2 * LENGTH * 7850.0
LAYER = math.sqrt(2.0 * AIR.viscosity / AIR.density / FREQUENCY)
RATIO = AIR.density / DENSITY

# what -> (scene with it, scene without it, amplitude [rad], dT/T of Nelson & Olsson 1986, Am. J. Phys. 54, 112)
CORRECTIONS: dict[str, tuple[Scene, Scene, float, float]] = {
    "finite amplitude": (
        scene_with(), scene_with(weight=SmallAngleGravity()), LARGE,
        LARGE**2 / 16 + 11 * LARGE**4 / 3072 + 173 * LARGE**6 / 737280 + 22931 * LARGE**8 / 1321205760,
    ),
    "finite bob": (scene_with(FiniteBob()), scene_with(), LARGE, (RADIUS / LENGTH) ** 2 / 5.0),
    "wire mass": (scene_with(Suspension()), scene_with(), LARGE, -WIRE_MASS / (12.0 * MASS)),
    "wire mass given": (scene_with(Suspension(suspension_mass=1e-4)), scene_with(), LARGE, -1e-4 / (12.0 * MASS)),
    "buoyancy": (scene_with(Buoyancy()), scene_with(), LARGE, RATIO / 2.0),
    "added mass": (scene_with(AddedMass()), scene_with(), LARGE, RATIO / 4.0),
    "added mass with its boundary layer": (
        scene_with(AddedMass(boundary_layer=True)), scene_with(), LARGE,
        RATIO / 4.0 * (1.0 + 9.0 * LAYER / (2.0 * RADIUS)),
    ),
    "linear damping": (
        scene_with(LinearDrag(gamma=0.02), weight=SmallAngleGravity()), scene_with(weight=SmallAngleGravity()), LARGE,
        1.0 / (8.0 * (FREQUENCY / 0.02) ** 2),
    ),
}


@pytest.mark.quick("finite amplitude", "buoyancy", "added mass with its boundary layer")
@pytest.mark.parametrize("what", CORRECTIONS)
def test_a_correction_of_the_period_is_that_of_the_simulation(what: str) -> None:
    """The textbook's correction of the period agrees with the simulation within 1 % of it, for the lab's bob."""
    scene, base, amplitude, wanted = CORRECTIONS[what]
    assert period(scene, amplitude) / period(base, amplitude) - 1.0 == pytest.approx(wanted, rel=0.01)


def test_the_corrections_of_the_lab() -> None:
    """For 40 g of steel, 0.353 m, 30 degrees: amplitude 1.7e-2, bob size 1.8e-4, buoyancy 7.7e-5, added mass 7.7e-5."""
    corrections = [CORRECTIONS[name][3] for name in (
        "finite amplitude", "finite bob", "buoyancy", "added mass with its boundary layer")]
    assert corrections == pytest.approx([1.7e-2, 1.8e-4, 7.7e-5, 7.7e-5], rel=0.03)


# --- predictions of effects -----------------------------------------------------------------------------------------


def small(name: str) -> tuple[Scene, Scene, Effect] | None:
    """Return the lab's bob with a small effect, without it, and the effect; None if no number determines its size."""
    numbers = {"coulomb_friction": CoulombFriction(friction_torque=1e-4), "motor": Motor(max_torque=1e-4),
               "linear_drag": LinearDrag(gamma=0.02), "bearing_friction": BearingFriction(1e-4), "gravity": Gravity(),
               "small_angle_gravity": SmallAngleGravity()}
    base = Scene(body=Body(LENGTH, MASS, RADIUS, "rod" if name == "motor" else "wire"), medium=AIR,
                 effects=(Gravity(),))
    effect = numbers.get(name) or EFFECTS[name].trial(base)
    if effect is None:
        return None
    if effect.exclusive == "gravity":
        other = SmallAngleGravity() if name == "gravity" else Gravity()
        return base.with_effects((effect,)), base.with_effects((other,)), effect
    return base.with_effects((Gravity(), effect)), base, effect


@pytest.mark.quick("buoyancy", "wire_drag", "finite_bob", "motor", "coulomb_friction", "vertical_drive")
@pytest.mark.parametrize("name", [name for name in EFFECTS if name != "small_angle_gravity"])
def test_predictions_are_near_the_simulation_where_they_are_small(name: str) -> None:
    """Predicted changes of period and amplitude, relative to small-angle gravity, are within 20 % of simulated ones."""
    pair = small(name)
    if pair is None:
        pytest.skip("neither geometry and medium nor the textbook have this effect's numbers")
    scene, base, effect = pair
    amplitude = 0.3
    period_change, amplitude_change = effect.predicted(scene, amplitude)
    control = 1.0 if scene.of_kind("drive") else 0.0
    usual = 2.0 * math.pi / base.omega0
    one, two = (swing(s, amplitude, usual, 256, control=control if s is scene else 0.0, backend="python")
                for s in (scene, base))
    if not math.isnan(period_change):
        assert abs(period_change) < 0.05
        assert one.period / two.period - 1.0 == pytest.approx(period_change, rel=0.2, abs=1e-8)
    if not math.isnan(amplitude_change):
        assert abs(amplitude_change) < 0.05
        assert one.amplitude / two.amplitude - 1.0 == pytest.approx(amplitude_change, rel=0.2, abs=1e-8)


WITH_NUMBERS = [name for name, effect in EFFECTS.items() if effect.predicted is not Effect.predicted]


@pytest.mark.parametrize("name", WITH_NUMBERS)
def test_an_effect_with_a_prediction_has_a_number_that_grows_with_it(name: str) -> None:
    pair = small(name)
    assert EFFECTS[name].number_name
    if pair is not None:
        number = pair[2].number(pair[0], 0.3)
        assert number > 0.0
        assert math.isfinite(number)


def test_trials_are_what_geometry_and_medium_determine() -> None:
    fluid, empty = scene_with(), scene_with(medium=Medium())
    inert = [name for name in EFFECTS if EFFECTS[name].kind == "inertia"]
    assert [n for n in inert if EFFECTS[n].trial(fluid)] == inert
    assert [n for n in inert if EFFECTS[n].trial(empty)] == ["finite_bob", "suspension"]
    drags = [n for n in EFFECTS if EFFECTS[n].needs_medium and EFFECTS[n].kind == "dissipative"]
    assert {"sphere_drag", "wire_drag"} <= set(drags)
    for name in (*drags, "linear_drag", "quadratic_drag"):
        assert EFFECTS[name].trial(empty) is None
        effect = EFFECTS[name].trial(fluid)
        assert effect is not None
        assert all(value > 0.0 for value in fluid.with_effects((Gravity(), effect)).coefficients.values())
    assert QuadraticDrag.trial(fluid.replace(gravity=0.0)) is None


# --- inertia and weight ---------------------------------------------------------------------------------------------


def test_inertia_weight_and_mass_add_up() -> None:
    """All effects together: inertia (m + 2/5 m (a/L)² + m_s/3 + rho V/2) L², and the moments of weight and mass.

    The moments are (m + m_s/2 - rho V) L and (m + m_s/2 + rho V/2) L.
    """
    rod = Body(length=LENGTH, mass=MASS, radius=RADIUS, suspension="rod", thickness=0.004, suspension_density=2700.0)
    scene = scene_with(FiniteBob(), Suspension(), Buoyancy(), AddedMass(), body=rod, medium=water(20.0))
    volume, rod_mass = 4.0 / 3.0 * math.pi * RADIUS**3, math.pi * 0.002**2 * LENGTH * 2700.0
    fluid = water(20.0).density * volume
    inertia = MASS + 0.4 * MASS * (RADIUS / LENGTH) ** 2 + rod_mass / 3.0 + fluid / 2.0
    assert scene.inertia == pytest.approx(inertia * LENGTH**2, rel=1e-14)
    assert scene.weight_moment == pytest.approx((MASS + rod_mass / 2.0 - fluid) * LENGTH, rel=1e-14)
    assert scene.mass_moment == pytest.approx((MASS + rod_mass / 2.0 + fluid / 2.0) * LENGTH, rel=1e-14)
    wanted = math.sqrt(9.81 * (MASS + rod_mass / 2.0 - fluid) / (inertia * LENGTH))
    assert scene.omega0 == pytest.approx(wanted, rel=1e-14)
    assert scene.equation() == f"theta'' = -{wanted**2:.6g} sin(theta)"


@pytest.mark.parametrize("medium", [AIR, water(20.0), glycerol(20.0)], ids=lambda medium: medium.name)
@pytest.mark.parametrize("others", [(), (FiniteBob(), Suspension(), Buoyancy())], ids=["alone", "all"])
def test_the_boundary_layer_is_that_of_the_scenes_own_frequency(medium: Medium, others: tuple[Effect, ...]) -> None:
    """The added mass is (2/3) pi rho a³ (1 + 9 delta/(2 a)), delta = sqrt(2 nu/omega0) (Landau & Lifshitz, section 24).
    """
    scene = scene_with(*others, AddedMass(boundary_layer=True), medium=medium)
    delta = math.sqrt(2.0 * medium.viscosity / medium.density / scene.omega0)
    wanted = 2.0 / 3.0 * math.pi * medium.density * RADIUS**3 * (1.0 + 9.0 * delta / (2.0 * RADIUS))
    rest = scene.with_effects(effect for effect in scene.effects if effect.name != "added_mass")
    assert scene.inertia - rest.inertia == pytest.approx(wanted * LENGTH**2, rel=1e-9)
    assert scene.mass_moment - rest.mass_moment == pytest.approx(wanted * LENGTH, rel=1e-9)
    assert scene.weight_moment == rest.weight_moment
    assert boundary_layer(scene.omega0, medium) == pytest.approx(delta, rel=1e-14)


@pytest.mark.parametrize(("torque", "inertia", "layer"), [
    (1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (1e-6, 1.0, 1e6), (1e6, 1e-6, 1e-3), (1e-3, 1e3, 1e-9)])
def test_the_own_frequency_solves_its_equation(torque: float, inertia: float, layer: float) -> None:
    omega = own_frequency(torque, inertia, layer)
    assert (inertia + layer / math.sqrt(omega)) * omega * omega == pytest.approx(torque, rel=1e-13)


def test_drag_of_the_oscillating_boundary_layer() -> None:
    """The drag rate is 6 pi mu a (1 + a/delta) / m at omega0 (Landau & Lifshitz, section 24), and else Stokes' law."""
    scene = scene_with(LinearDrag(boundary_layer=True))
    stokes = 6.0 * math.pi * AIR.viscosity * RADIUS / MASS
    assert scene.coefficients["linear_drag_rate"] == pytest.approx(stokes * (1.0 + RADIUS / LAYER), rel=1e-12)
    assert scene_with(LinearDrag()).coefficients["linear_drag_rate"] == pytest.approx(stokes, rel=1e-12)
    light = scene_with(LinearDrag(boundary_layer=True), medium=Medium("goo", 0.0, 1.0))
    assert light.coefficients == scene_with(LinearDrag(), medium=Medium("goo", 0.0, 1.0)).coefficients


FLOATS: dict[str, tuple[Any, str]] = {
    "wood in water": (lambda: scene_with(Buoyancy(), body=Body(LENGTH, 0.003, RADIUS), medium=water()),
                      "The bob of 0.003 kg would float in water, where it displaces 0.00512238 kg"),
    "with a layer": (lambda: scene_with(Buoyancy(), AddedMass(boundary_layer=True), body=Body(LENGTH, 0.003, RADIUS),
                                        medium=water()), "would float in water"),
    "no weight": (lambda: scene_with(AddedMass(boundary_layer=True)).replace(gravity=0.0), "needs a bob that swings"),
    "buoyancy in vacuum": (lambda: Scene(effects=(Buoyancy(),)), "no buoyancy in vacuum"),
    "added mass in vacuum": (lambda: Scene(effects=(AddedMass(),)), "no added_mass in vacuum"),
    "two bobs": (lambda: Scene(effects=(FiniteBob(), FiniteBob())), "only one effect"),
    "wire of negative mass": (lambda: Suspension(suspension_mass=-1.0), "suspension_mass must be"),
    "flag": (lambda: AddedMass(boundary_layer="yes"), "must be True or False, not 'yes'"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("case", FLOATS)
def test_what_cannot_hang_or_carry_fluid_is_refused(case: str) -> None:
    make, words = FLOATS[case]
    with pytest.raises(SceneError) as error:
        make()
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_rod_of_enough_weight_holds_a_light_bob_down() -> None:
    assert scene_with(Buoyancy(), Suspension(suspension_mass=0.01), body=Body(LENGTH, 0.003, RADIUS),
                      medium=water()).omega0 > 0.0


# --- validity -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("effect", "speed", "said"), [
    (LinearDrag(), 0.5, "Re reaches 710, but Stokes' law holds up to Re = 1"),
    (LinearDrag(), 1e-4, ""),
    (LinearDrag(gamma=0.1), 0.5, ""),
    (LinearDrag(boundary_layer=True), 0.5, "Keulegan-Carpenter number reaches 27.8"),
    (LinearDrag(boundary_layer=True), 0.01, ""),
    (AddedMass(boundary_layer=True), 0.5, "Keulegan-Carpenter number reaches 27.8"),
    (AddedMass(boundary_layer=True), 0.01, ""),
    (AddedMass(), 0.5, ""),
    (QuadraticDrag(), 0.5, ""),
    (QuadraticDrag(), 0.1, "Re reaches only 142"),
    (QuadraticDrag(drag_coefficient=0.4), 200.0, "Re reaches even 2.84e+05"),
    (QuadraticDrag(c=0.1), 200.0, ""),
    (FiniteBob(), 200.0, ""),
])
def test_what_an_effect_says_outside_its_range(effect: Effect, speed: float, said: str) -> None:
    warning = effect.outside(scene_with(effect), speed)
    assert said in warning
    assert bool(warning) == bool(said)
