"""Tests of the drag of spheres and wires, against other programs, measured curves and published formulas."""

from __future__ import annotations

import math
import re
from typing import Any

import mpmath
import pytest
from effect_checks import SPEEDS, bound, close, in_mpmath, slope
from refusals import check_refused

from pendulum_env import SCENES, SceneError, rollout
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.body import Body
from pendulum_env.physics.damping import parse_damping, with_damping
from pendulum_env.physics.drag_laws import LAWS
from pendulum_env.physics.effects import Effect, Gravity, LinearDrag, QuadraticDrag, SphereDrag, WireDrag
from pendulum_env.physics.flow import reynolds_number, sphere_drag_coefficient
from pendulum_env.physics.medium import Medium, air
from pendulum_env.physics.presets import find_scene
from pendulum_env.physics.scene import Scene

BODY = Body(length=0.353, mass=0.040, radius=0.0107, suspension="wire")


def scene_with(*effects: Any, medium: Medium | None = None) -> Scene:
    return Scene(body=BODY, medium=medium or air(20.0), effects=(Gravity(), *effects))


@pytest.fixture(autouse=True)
def _many_digits() -> Any:
    with mpmath.workdps(40):
        yield


# --- the laws -------------------------------------------------------------------------------------------------------

# law -> (Re, C_d) of the package fluids 1.3.1 (Bell 2016-2024, ChEDL): fluids.drag.Clift_Gauvin, fluids.drag.Morrison
PEER = {
    "clift_gauvin": (
        (0.01, 2416.1456249080325), (1.0, 27.648082232301316), (10.0, 4.134738030409285), (200.0, 0.7905400398000133),
        (1400.0, 0.4318348798508207), (1e4, 0.4103151512302996), (1.9e5, 0.46721026320573983),
    ),
    "morrison": (
        (0.01, 2400.1526495419503), (1.0, 24.672931768378028), (10.0, 3.9675832598425482), (200.0, 0.767731559965325),
        (1400.0, 0.45685031437816304), (1e4, 0.393564428240075), (1.9e5, 0.4223973734051499),
        (9e5, 0.13066475712163883),
    ),
}


@pytest.mark.parametrize("name", PEER)
def test_a_law_is_that_of_the_package_fluids(name: str) -> None:
    for reynolds, drag in PEER[name]:
        assert sphere_drag_coefficient(reynolds, name) == pytest.approx(drag, rel=1e-13)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_its_published_formula(name: str) -> None:
    """Compare each drag law with its formula text, evaluated in 40 digits; "24/Re (1 + ...)" means a product."""
    text = re.sub(r"Re \(", "Re*(", LAWS[name].formula).replace("^", "**").replace("2.6 Re", "2.6*Re")
    text = re.sub(r"([0-9]) (Re|\()", r"\1*\2", text)
    formula = re.sub(r"\d+\.?\d*", lambda number: f"mpf('{number[0]}')", text)
    for reynolds in (1e-6, 0.3, 17.0, 800.0, 1e5):
        if reynolds <= LAWS[name].most:
            wanted = eval(formula, {"mpf": mpmath.mpf, "Re": mpmath.mpf(reynolds)})
            assert LAWS[name].coefficient(reynolds) == pytest.approx(float(wanted), rel=3e-15)


# Re, C_d of the standard drag curve of a sphere, as Morsi & Alexander 1972 have it, J. Fluid Mech. 55, 193.
STANDARD = (
    (1.0, 26.5), (3.0, 10.4), (10.0, 4.1), (30.0, 2.0), (100.0, 1.07), (300.0, 0.65), (1000.0, 0.46), (3000.0, 0.40),
    (10_000.0, 0.41), (50_000.0, 0.488),
)
FAR = {"clift_gauvin": 0.06, "brown_lawler": 0.06, "schiller_naumann": 0.06, "morrison": 0.17}
"""Largest relative difference of each law from the measured curve; Morrison's is within 11 % up to Re = 20 000."""


@pytest.mark.parametrize("name", LAWS)
def test_a_law_follows_the_measured_curve(name: str) -> None:
    for reynolds, drag in STANDARD:
        if reynolds <= LAWS[name].most:
            assert LAWS[name].coefficient(reynolds) == pytest.approx(drag, rel=FAR[name])


def test_the_laws_agree_where_all_hold() -> None:
    """The drag laws agree within 12 %, which is the uncertainty of the measurements behind them."""
    for reynolds in (0.1, 1.0, 5.0, 30.0, 200.0, 1000.0):
        values = [law.coefficient(reynolds) for law in LAWS.values()]
        assert max(values) / min(values) < 1.13


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_finite_at_every_speed_and_smooth_through_rest(name: str) -> None:
    """The drag force is odd in the velocity, grows with it, and has Stokes' slope at v = 0."""
    law, rates = LAWS[name], (2.0, 500.0)
    assert law.multiple(0.0) == 1.0
    assert law.growth(0.0) == 0.0
    speeds = [0.0, 5e-324, 1e-300, 1e-30, 1e-9, 1e-3, 0.1, 1.0, 30.0, 1e4, 1e30, 1e100]
    forces = [law.torque(-v, v, *rates) for v in speeds]
    assert all(map(math.isfinite, forces))
    assert all(map(math.isfinite, (law.by_velocity(v, *rates) for v in speeds)))
    assert all(map(math.isfinite, (law.by_speed(v, v, *rates) for v in speeds)))
    assert [law.torque(v, v, *rates) for v in speeds] == [-force for force in forces]
    assert forces == sorted(forces)
    for v in (1e-30, -1e-30, 0.0):
        assert law.by_velocity(v, *rates) == pytest.approx(-2.0, rel=1e-14)
    assert law.torque(1e-9, 1e-9, *rates) == pytest.approx(-2e-9, rel=1e-4)


@pytest.mark.parametrize("name", LAWS)
def test_the_growth_and_slopes_of_a_law(name: str) -> None:
    law, scene = LAWS[name], scene_with(SphereDrag(law=name))
    multiple, growth = in_mpmath(law.multiple), in_mpmath(law.growth)
    for reynolds in (1e-3, 0.7, 40.0, 3e3, 2e5, 5e6):
        assert close(growth(mpmath.mpf(reynolds)), reynolds * slope(multiple, reynolds))
    effect = scene.effects[1]
    torque, by_velocity, by_speed = (
        bound(f, scene) for f in (effect.torque, effect.by_velocity, effect.by_speed))  # type: ignore[arg-type]
    for v in SPEEDS:
        assert close(by_velocity(0, v), slope(lambda x: torque(0, x), v))
        for speed in (abs(v), 2.0 * abs(v)):
            change = speed * slope(lambda x, v=v: torque(0, v, speed=x), speed)
            assert close(by_speed(0, v, speed=speed), change, abs(v))


@pytest.mark.parametrize("name", LAWS)
def test_outside_its_range_a_law_says_what_it_does(name: str) -> None:
    law, scene = LAWS[name], scene_with(SphereDrag(law=name))
    one = reynolds_number(1.0, BODY, scene.medium)
    assert scene.effects[1].outside(scene, 0.999 * law.most / one) == ""
    said = scene.effects[1].outside(scene, 1.001 * law.most / one)
    assert f"fitted up to Re = {law.most:g}" in said
    assert "formula is used all the same" in said
    for wrong in (0.0, -1.0, 1.001 * law.most, math.nan):
        with pytest.raises(ValueError, match="is known for 0 < Re <="):
            sphere_drag_coefficient(wrong, name)


# --- sphere drag in scenes ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", LAWS)
def test_sphere_drag_is_stokes_when_slow_and_its_drag_coefficient_when_fast(name: str) -> None:
    """The force is 6 pi mu a V at Re = 1e-6 and (1/2) rho C_d A V² at Re = 900; the torque is that times L over I."""
    scene = scene_with(SphereDrag(law=name))
    mu, rho, a, length = scene.medium.viscosity, scene.medium.density, 0.0107, 0.353
    arm = length / (0.040 * length * length)
    slow, fast = (reynolds * mu / (rho * 2.0 * a) for reynolds in (1e-6, 900.0))
    torque = bound(scene.effects[1].torque, scene)  # type: ignore[arg-type]
    assert torque(0, slow / length) == pytest.approx(-6.0 * math.pi * mu * a * slow * arm, rel=1e-4)
    drag = 0.5 * rho * LAWS[name].coefficient(900.0) * math.pi * a * a * fast * fast
    assert torque(0, fast / length) == pytest.approx(-drag * arm, rel=1e-12)


def test_at_the_bottom_sphere_drag_is_the_quadratic_drag_derived_from_it() -> None:
    scene = SCENES["exercise_large"].with_effects((Gravity(), SphereDrag()))
    fixed = scene.with_effects((Gravity(), QuadraticDrag()))
    v = scene.bottom_velocity
    acceleration = bound(scene.effects[1].torque, scene)(0, v)  # type: ignore[arg-type]
    assert acceleration == pytest.approx(bound(fixed.effects[1].torque, fixed)(0, v), rel=1e-12)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("name", LAWS)
def test_compiled_and_interpreted_sphere_and_wire_drag_give_the_same_bits(name: str) -> None:
    """The default drag law is also tested in the scene "water" of test_engine."""
    scene = scene_with(SphereDrag(law=name), WireDrag())
    one, two = (
        rollout(scene, integrator="rk4", angle=1.0, velocity=0.0, duration=1.0, dt=0.01, backend=backend, warn=False)
        for backend in ("compiled", "python")
    )
    assert one.angle.tolist() == two.angle.tolist()
    assert one.ledger.heat.tolist() == two.ledger.heat.tolist()


def test_methods_that_need_a_flow_or_a_series_are_not_offered() -> None:
    """Drag laws have no closed flow, and a power of the speed has no Taylor series at a turning point."""
    names = fitting(scene_with(SphereDrag()))
    assert {"rk4", "gauss4", "dop853"} <= names.keys()
    assert not {"velocity_verlet", "taylor", "exact"} & names.keys()
    with pytest.raises(ValueError, match="the speed is taken, which has no series at rest"):
        rollout(scene_with(WireDrag()), integrator="taylor", duration=1.0, dt=0.1)


def test_the_law_is_chosen_by_name() -> None:
    scene = with_damping(SCENES["lab"], {"sphere_drag": {"law": "morrison"}})
    assert scene.effects[-1] == SphereDrag(law="morrison")
    assert parse_damping("sphere_drag:law=morrison+linear:boundary_layer=true") == {
        "sphere_drag": {"law": "morrison"}, "linear": {"boundary_layer": True}}
    assert scene.replace(law="brown_lawler").effects[-1] == SphereDrag(law="brown_lawler")
    assert Scene.from_dict(scene.to_dict()) == scene
    assert find_scene(scene.to_dict()) == scene


REFUSED: dict[str, tuple[Any, str]] = {
    "law": (lambda: SphereDrag(law="morison"), "There is no law 'morison'; did you mean morrison?"),
    "law as a number": (lambda: SphereDrag(law=1), "no law 1; there are clift_gauvin, "),  # type: ignore[arg-type]
    "typed law": (lambda: with_damping(SCENES["lab"], parse_damping("sphere_drag:law=moris")), "no law 'moris'"),
    "flag": (lambda: LinearDrag(boundary_layer=1), "must be True or False, not 1"),  # type: ignore[arg-type]
    "typed flag": (lambda: with_damping(SCENES["lab"], parse_damping("linear:boundary_layer=2")), "True or False"),
    "sphere drag in vacuum": (lambda: Scene(effects=(SphereDrag(),)), "There is no sphere_drag in vacuum"),
    "wire drag in vacuum": (lambda: Scene(effects=(WireDrag(),)), "There is no wire_drag in vacuum"),
    "sphere drag without density": (lambda: scene_with(SphereDrag(), medium=Medium("goo", 0.0, 1.0)), "no density"),
    "wire drag without density": (lambda: scene_with(WireDrag(), medium=Medium("goo", 0.0, 1.0)), "no density"),
    "gamma and layer": (lambda: scene_with(LinearDrag(gamma=0.1, boundary_layer=True)), "not both"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_clear_sentence(case: str) -> None:
    check_refused(*REFUSED[case])


# --- the wire -------------------------------------------------------------------------------------------------------


def wire_coefficient(reynolds: Any) -> Any:
    """Return C_d of a cylinder at a Reynolds number (White 2006, Viscous Fluid Flow)."""
    return 1 + 10 / mpmath.cbrt(reynolds) ** 2


@pytest.mark.parametrize("velocity", [-4.0, -1e-3, 0.02, 2.7, 50.0])
@pytest.mark.parametrize("suspension", ["wire", "rod"])
def test_wire_drag_is_the_sum_over_its_pieces(velocity: float, suspension: str) -> None:
    """The torque is the integral of (1/2) rho d C_d(Re(s)) (s v)² s from 0 to L, by mpmath's quadrature, over I."""
    scene = Scene(body=Body(0.353, 0.040, 0.0107, suspension), medium=air(20.0), effects=(WireDrag(),))
    d, rho = mpmath.mpf({"wire": 0.0003, "rod": 0.002}[suspension]), mpmath.mpf(scene.medium.density)
    v, nu = abs(mpmath.mpf(velocity)), mpmath.mpf(scene.medium.viscosity) / rho
    pieces = mpmath.quad(lambda s: 0.5 * rho * d * wire_coefficient(s * v * d / nu) * (s * v) ** 2 * s, [0, 0.353])
    acceleration = bound(WireDrag.torque, scene)(0, velocity)  # type: ignore[arg-type]
    assert acceleration == pytest.approx(-math.copysign(float(pieces), velocity) / (0.040 * 0.353**2), rel=1e-12)


@pytest.mark.parametrize("reynolds", [1.0, 10.0, 100.0, 1000.0, 1e4, 1e5])
def test_the_drag_coefficient_of_a_wire_is_near_another_fit(reynolds: float) -> None:
    """Compare C_d of a wire with the fit of Cheng 2013, J. Hydraul. Eng. 139, 602.

    That fit is 11 Re^-0.75 + 0.9 (1 - exp(-1000/Re)) + 1.2 (1 - exp(-(Re/4500)^0.7)).
    """
    other = 11.0 * reynolds**-0.75 + 0.9 * (1.0 - math.exp(-1000.0 / reynolds))
    other += 1.2 * (1.0 - math.exp(-((reynolds / 4500.0) ** 0.7)))
    assert wire_coefficient(reynolds) == pytest.approx(other, rel=0.18)


def test_wire_drag_is_finite_and_odd_and_says_where_it_was_fitted() -> None:
    scene = scene_with(WireDrag())
    rates = tuple(scene.effects[1].coefficients(scene).values())
    for v in (0.0, 5e-324, 1e-300, 1e-9, 1.0, 1e4, 1e100):
        acceleration = WireDrag.torque(v, v, *rates)  # type: ignore[misc]
        assert math.isfinite(acceleration)
        assert WireDrag.torque(-v, v, *rates) == -acceleration  # type: ignore[misc]
        assert math.isfinite(WireDrag.by_velocity(v, *rates))  # type: ignore[misc]
    assert WireDrag.by_velocity(0.0, *rates) == 0.0  # type: ignore[misc]
    effect, one = scene.effects[1], 0.0003 / scene.medium.kinematic_viscosity
    assert effect.outside(scene, 1.01 / one) == ""
    assert "only 0.99" in effect.outside(scene, 0.99 / one)
    assert "even 2.02e+05" in effect.outside(scene, 2.02e5 / one)


@pytest.mark.parametrize("other", [LinearDrag(), LinearDrag(boundary_layer=True), QuadraticDrag(drag_coefficient=0.46)])
def test_the_bobs_drag_is_not_counted_twice(other: Effect) -> None:
    """C_d(Re) describes the whole drag force, so other drag laws are refused beside it; measured damping is allowed."""
    for effects in ((SphereDrag(), other), (other, SphereDrag())):
        with pytest.raises(SceneError, match=f"sphere_drag and {other.name} both model the bob's drag"):
            scene_with(*effects)
    assert scene_with(SphereDrag(), LinearDrag(gamma=0.1), WireDrag()).coefficients
