"""Tests of every registered effect: its functions against each other, and its numbers against published ones."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from functools import partial
from itertools import product
from typing import Any

import mpmath
import pytest
from effect_checks import SPEEDS, bound, called, close, slope
from given_effects import scene_of

from pendulum_env import rollout
from pendulum_env.physics import elementary, exact
from pendulum_env.physics.body import Body
from pendulum_env.physics.damping import with_damping
from pendulum_env.physics.effects import EFFECTS, CoulombFriction, LinearDrag, QuadraticDrag, SmoothFriction
from pendulum_env.physics.effects.coulomb_friction import dry_glide
from pendulum_env.physics.flow import reynolds_number, sphere_drag_coefficient
from pendulum_env.physics.medium import Medium
from pendulum_env.physics.presets import SCENES
from pendulum_env.physics.scene import Run, Scene
from pendulum_env.physics.units import SceneError

DIGITS = 40
ANGLES = (-2.9, -1.3, -0.2, 0.05, 0.7, 2.1, 3.0)
SIDES = (1.0, -1.0)
TIMES = (0.0, 0.83, 1234.5)








def times_of(function: Callable[..., float]) -> tuple[float, ...]:
    """Return times at which to evaluate a function: several if it depends on time, else one."""
    return TIMES if "time" in inspect.signature(function).parameters else TIMES[:1]


def having(role: str) -> list[str]:
    return [name for name, effect in EFFECTS.items() if getattr(effect, role) is not None]


@pytest.fixture(autouse=True)
def _many_digits() -> Any:
    with mpmath.workdps(DIGITS):
        yield


# --- functions of one effect against each other ---------------------------------------------------------------------


@pytest.mark.quick("sphere_drag--1.0", "horizontal_drive--1.0", "motor--1.0", "smooth_friction--1.0")
@pytest.mark.parametrize("side", [-1.0, pytest.param(1.0, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", having("torque"))
def test_derivatives_are_those_of_the_torque(name: str, side: float) -> None:
    effect, scene = EFFECTS[name], scene_of(name)
    torque = bound(effect.torque, scene, side)  # type: ignore[arg-type]
    by_angle = bound(effect.by_angle, scene, side) if effect.by_angle else lambda *_, **__: 0
    by_velocity = bound(effect.by_velocity, scene, side) if effect.by_velocity else lambda *_, **__: 0
    for t, q, v in product(times_of(effect.torque), ANGLES, SPEEDS):  # type: ignore[arg-type]
        for share in (-1.0, 0.5):
            given = {"control": share, "time": t}
            assert close(by_angle(q, v, **given), slope(partial(torque, velocity=v, **given), q))
            assert close(by_velocity(q, v, **given), slope(partial(torque, q, **given), v))


@pytest.mark.parametrize("name", having("by_speed"))
def test_a_drag_is_proportional_to_the_slip_and_its_slope_by_speed_is_given(name: str) -> None:
    """``by_speed`` is speed times d torque/d speed at fixed slip; slip and speed are relative to a moving medium."""
    effect, scene = EFFECTS[name], scene_of(name)
    torque, by_speed = (bound(f, scene) for f in (effect.torque, effect.by_speed))  # type: ignore[arg-type]
    for slip in SPEEDS:
        for speed in (abs(slip), 1.5 * abs(slip) + 0.2):
            assert close(by_speed(0, slip, speed=speed),
                         speed * slope(lambda x, slip=slip: torque(0, slip, speed=x), speed), abs(slip))
            assert close(torque(0, mpmath.mpf(slip) / 4, speed=speed), torque(0, slip, speed=speed) / 4)


def test_every_drag_by_speed_has_its_slope() -> None:
    wanted = {n for n in having("torque") if "speed" in inspect.signature(EFFECTS[n].torque).parameters}  # type: ignore[arg-type]
    assert wanted == set(having("by_speed"))


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", having("potential"))
def test_a_conservative_torque_is_minus_the_slope_of_its_potential(name: str, side: float) -> None:
    effect, scene = EFFECTS[name], scene_of(name)
    assert effect.kind == "conservative"
    torque, potential = (bound(f, scene, side) for f in (effect.torque, effect.potential))  # type: ignore[arg-type]
    for q in ANGLES:
        assert close(torque(q), -slope(potential, q))
    if "side" not in inspect.signature(effect.potential).parameters or side > 0.0:  # type: ignore[arg-type]
        assert potential(0.0) == 0


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if effect.kind == "drive"])
def test_a_drives_torque_is_minus_the_slope_of_its_store(name: str, side: float) -> None:
    effect, scene = EFFECTS[name], scene_of(name)
    torque, store = (bound(f, scene, side) for f in (effect.torque, effect.store))  # type: ignore[arg-type]
    for t, q, share in product(times_of(effect.torque), ANGLES, (-1.0, 0.5)):  # type: ignore[arg-type]
        given = {"control": share, "time": t}
        assert close(torque(q, **given), -slope(partial(store, **given), q))


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", having("mean"))
def test_a_mean_torque_is_the_difference_of_potentials_over_that_of_angles(name: str, side: float) -> None:
    """Compare the mean torque and its slope in 40 digits; differences over spreads of 1e-4 then have 30 correct digits.
    """
    effect, scene = EFFECTS[name], scene_of(name)
    potential, mean, by_end = (
        bound(f, scene, side) for f in (effect.potential, effect.mean, effect.mean_by_end))  # type: ignore[arg-type]
    for q in ANGLES:
        for s in (-40.0, -1.5, -1e-4, 1e-4, 0.3, 2.0, 7.5):
            low, high = mpmath.mpf(q) - s, mpmath.mpf(q) + s
            assert close(mean(q, spread=s), -(potential(high) - potential(low)) / (high - low))
            assert close(by_end(q, spread=s), slope(lambda x, q=q, s=s: mean(q + x, spread=s + x), 0.0))
        assert close(mean(q, spread=0.0), bound(effect.torque, scene, side)(q))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", having("mean"))
def test_a_mean_torque_does_not_cancel(name: str) -> None:
    """In double precision the mean torque over the smallest spreads equals the torque at the middle within rounding."""
    effect, scene = EFFECTS[name], scene_of(name)
    for role, plain in (("mean", "torque"), ("mean_by_end", "by_angle")):
        functions = [getattr(effect, role), getattr(effect, plain)]
        wanted = [list(inspect.signature(function).parameters) for function in functions]
        for q in ANGLES:
            for s in (0.0, 5e-324, 1e-300, 1e-30, 1e-12, 1e-9):
                known = {"angle": q, "tilt": q, "side": 1.0, "spread": s, **scene.coefficients}
                pairs = zip(functions, wanted, strict=True)
                mean, middle = (function(*(known[name] for name in names)) for function, names in pairs)
                assert mean == pytest.approx(middle, rel=1e-15, abs=2.0 * s * scene.omega0**2)


def test_each_kind_has_what_it_promises() -> None:
    assert {name for name, e in EFFECTS.items() if e.kind == "conservative"} == set(having("potential"))
    for name, effect in EFFECTS.items():
        assert (effect.torque is None) == (bool(effect.dry) or effect.kind in ("inertia", "medium", "limit")), name
        assert bool(effect.limit) == (effect.kind == "limit"), name
        assert effect.flow is None or effect.kind == "dissipative", name


@pytest.mark.parametrize("name", [name for name in having("torque") if "side" in inspect.signature(
    EFFECTS[name].torque).parameters])  # type: ignore[arg-type]
def test_over_the_top_an_effect_by_tilt_and_side_is_the_same_as_at_the_bottom(name: str) -> None:
    """Torque, slope, potential and pull from tilt and side equal those from the whole angle theta = tilt + pi."""
    effect, scene = EFFECTS[name], scene_of(name)
    for role in ("torque", "by_angle", "potential", "radial", "mean", "mean_by_end"):
        function = getattr(effect, role)
        if function is None or "side" not in inspect.signature(function).parameters:
            continue
        bottom, top = bound(function, scene, 1.0), bound(function, scene, -1.0)
        for t, tilt in product(times_of(function), ANGLES):
            assert close(top(tilt, time=t), bottom(mpmath.mpf(tilt) + mpmath.pi, time=t), scene.omega0**2), role


def test_gravity_is_that_of_a_mass_on_an_arm() -> None:
    """Gravity has torque -m g L sin(theta), energy m g L (1 - cos(theta)) and pull m g cos(theta).

    For L = 0.353 m, g = 9.81 m/s².
    """
    effect, scene = EFFECTS["gravity"], scene_of("gravity")
    rate = mpmath.mpf(scene.coefficients["gravity_rate"])
    assert rate == pytest.approx(9.81 / 0.353, rel=1e-15)
    for q in ANGLES:
        angle = mpmath.mpf(q)
        assert close(bound(effect.torque, scene)(q), -rate * mpmath.sin(angle))  # type: ignore[arg-type]
        assert close(bound(effect.potential, scene)(q), rate * (1 - mpmath.cos(angle)))  # type: ignore[arg-type]
        assert close(bound(effect.radial, scene)(q), rate * mpmath.cos(angle))  # type: ignore[arg-type]


# --- what dissipates ------------------------------------------------------------------------------------------------


@pytest.mark.quick("linear_drag")
@pytest.mark.parametrize("name", having("flow"))
def test_a_flow_solves_its_torque(name: str) -> None:
    """The flow solves dv/dt = torque at fixed angle, by mpmath's Taylor series; two flows in a row equal one long flow.
    """
    effect, scene = EFFECTS[name], scene_of(name).replace(**{"linear_drag": {"gamma": 3.0}, "quadratic_drag": {
        "c": 0.4}}.get(name, {}))
    torque, flow = bound(effect.torque, scene), bound(effect.flow, scene)  # type: ignore[arg-type]
    for v in (-30.0, 2.5):
        path = mpmath.odefun(lambda _, y: torque(0.3, y), 0, mpmath.mpf(v), tol=mpmath.mpf(10) ** -22)
        for t in (0.01, 0.05):
            end = flow(0.3, v, 0, t)
            assert close(end, path(mpmath.mpf(t)))
            half = mpmath.mpf(t) / 2
            assert close(flow(0.3, flow(0.3, v, 0, half), 0, half), end)
        assert flow(0.3, v, 0, 0.0) == v
    assert flow(0.3, 0.0, 0, 1.0) == 0


@pytest.mark.parametrize("name", [n for n, e in EFFECTS.items() if e.kind == "dissipative" and e.torque])
def test_a_dissipative_torque_never_drives(name: str) -> None:
    torque = bound(EFFECTS[name].torque, scene_of(name))  # type: ignore[arg-type]
    for q in ANGLES:
        for v in SPEEDS:
            assert torque(q, v) * v < 0
    assert torque(0.3, 0.0) == 0


@pytest.mark.parametrize("velocity", [-3.0, -1e-3, 0.0, 0.02, 5.0])
@pytest.mark.parametrize("push", [-7.0, -1.0, 0.3, 2.0, 9.0])
def test_the_dry_flow_is_that_of_small_steps(velocity: float, push: float) -> None:
    """The flow of v' = a - limit sign(v), stuck at v = 0 while |a| <= limit, agrees with small Euler steps.

    An Euler step in which v changes sign ends at v = 0.
    """
    limit, steps, duration = 2.0, 20_000, 1.5
    h = duration / steps
    v, path, length = velocity, 0.0, 0.0
    for _ in range(steps):
        side = math.copysign(1.0, v) if v else math.copysign(1.0, push)
        new = v + h * (push - side * limit) if v or abs(push) > limit else 0.0
        new = 0.0 if v * new < 0.0 else new
        path += 0.5 * h * (v + new)
        length += 0.5 * h * abs(v + new)
        v = new
    # An error in the time of a zero shifts the rest of the run by at most one step.
    error = 2.0 * h * (abs(push) + limit) * (1.0 + duration)
    flow = dry_glide(velocity, push, limit, duration)
    assert flow == pytest.approx((v, path, length), abs=error)
    assert limit * flow[2] >= 0.0


# --- numbers from geometry and medium -------------------------------------------------------------------------------

# Re, C_d of the standard drag curve of a sphere: Lapple & Shepherd 1940, Ind. Eng. Chem. 32, 605.
STANDARD = ((0.1, 244.0), (1.0, 26.5), (10.0, 4.1), (100.0, 1.07), (1000.0, 0.46), (10_000.0, 0.405), (100_000.0, 0.48))


@pytest.mark.parametrize(("reynolds", "drag"), STANDARD)
def test_the_drag_coefficient_follows_the_standard_curve(reynolds: float, drag: float) -> None:
    """C_d is within 5 % of the measured curve around Re = 1 and within 3 % elsewhere."""
    assert sphere_drag_coefficient(reynolds) == pytest.approx(drag, rel=0.05 if reynolds == 1.0 else 0.03)


def test_the_drag_coefficient_is_that_of_the_formula() -> None:
    """Compare C_d with another package: fluids.drag.Clift_Gauvin(200) (Bell 2016-2024, ChEDL fluids)."""
    assert sphere_drag_coefficient(200.0) == pytest.approx(0.7905400398000133, rel=1e-14)


def test_the_drag_coefficient_of_a_slow_sphere_is_stokes() -> None:
    """C_d Re / 24 approaches 1 from above (Stokes 1851), at most by Oseen's 3 Re/16."""
    for reynolds in (1e-9, 1e-6, 1e-4, 1e-2):
        excess = sphere_drag_coefficient(reynolds) * reynolds / 24.0 - 1.0
        assert 0.0 < excess < 0.16 * reynolds**0.677
    for wrong in (0.0, -1.0, 2.1e5, math.inf, math.nan):
        with pytest.raises(ValueError, match="is known for 0 < Re"):
            sphere_drag_coefficient(wrong)


def drag_rate(scene: Scene, drag: float) -> float:
    """Return the rate of quadratic drag by its formula, rho C_d A L**3 / (2 I)."""
    body, area = scene.body, math.pi * scene.body.radius * scene.body.radius
    return scene.medium.density * drag * area * body.length**3 / (2.0 * body.mass * body.length**2)


@pytest.mark.parametrize("changes", [{}, {"length": 1.1, "mass": 0.3, "radius": 0.02}, {"density": 998.0}])
def test_quadratic_drag_of_a_given_drag_coefficient(changes: dict[str, float]) -> None:
    scene = SCENES["lab"].replace(drag_coefficient=0.46, **changes)
    assert scene.coefficients["quadratic_drag_rate"] == pytest.approx(drag_rate(scene, 0.46), rel=1e-12)


def test_quadratic_drag_of_the_lab_is_that_of_its_usual_run() -> None:
    """C_d is taken at the speed at the bottom from 30 degrees: sqrt(2 g L (1 - cos 30 degrees)) = 0.963 m/s."""
    lab = SCENES["lab"]
    speed = math.sqrt(2.0 * 9.81 * 0.353 * (1.0 - math.cos(math.radians(30.0))))
    reynolds = lab.medium.density * speed * 2.0 * 0.0107 / lab.medium.viscosity
    wanted = drag_rate(lab, sphere_drag_coefficient(reynolds))
    assert lab.coefficients["quadratic_drag_rate"] == pytest.approx(wanted, rel=1e-12)
    assert lab.coefficients["quadratic_drag_rate"] == pytest.approx(8e-4, rel=0.05)


def test_stokes_drag_of_the_bob() -> None:
    """Stokes' drag per inertia is 6 pi mu a L² / I = 6 pi mu a / m (Stokes 1851)."""
    lab = with_damping(SCENES["lab"].with_effects(()), "linear")
    wanted = 6.0 * math.pi * lab.medium.viscosity * 0.0107 / 0.040
    assert lab.coefficients["linear_drag_rate"] == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(("speed", "medium", "wanted"), [
    (2.0, Medium("oil", 900.0, 0.1), 900.0 * 2.0 * 0.06 / 0.1),
    (-2.0, Medium("oil", 900.0, 0.1), 900.0 * 2.0 * 0.06 / 0.1),
    (0.0, Medium("oil", 900.0, 0.1), 0.0),
    (2.0, Medium(), 0.0),
    (2.0, Medium("ideal", 900.0, 0.0), math.inf),
    (0.0, Medium("ideal", 900.0, 0.0), 0.0),
])
def test_reynolds_numbers(speed: float, medium: Medium, wanted: float) -> None:
    assert reynolds_number(speed, Body(radius=0.03), medium) == pytest.approx(wanted, rel=1e-12)


UNKNOWN: dict[str, tuple[dict[str, Any], str]] = {
    "at rest": ({"run": Run(angle=0.0)}, "the bob hardly moves in the usual run (Re = 0,"),
    "a whole turn": ({"run": Run(angle=2.0 * math.pi)}, "the bob hardly moves in the usual run (Re = "),
    "no weight": ({"gravity": 0.0}, "the bob hardly moves in the usual run"),
    "no viscosity": ({"viscosity": 0.0}, "has no viscosity"),
    "too fast": ({"run": Run(velocity=1000.0)}, "known up to Re = 200000 and the usual run reaches Re = 5.0"),
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_a_drag_coefficient_that_cannot_be_derived_is_refused(case: str) -> None:
    changes, words = UNKNOWN[case]
    with pytest.raises(SceneError) as error:
        SCENES["lab"].replace(**changes)
    assert words in str(error.value)
    assert "give c or drag_coefficient" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("case", UNKNOWN)
@pytest.mark.parametrize("numbers", [{"c": 0.25}, {"drag_coefficient": 0.46}])
def test_a_drag_coefficient_that_is_given_is_taken(case: str, numbers: dict[str, float]) -> None:
    scene = SCENES["lab"].replace(**numbers).replace(**UNKNOWN[case][0])
    wanted = numbers.get("c") or drag_rate(scene, 0.46)
    assert scene.coefficients["quadratic_drag_rate"] == pytest.approx(wanted, rel=1e-12)


def test_the_limits_of_the_drag_curve_are_kept() -> None:
    """C_d exists just inside Re = 0.01 and 2e5, and not just outside; Re is proportional to the velocity."""
    still = SCENES["lab"].with_effects((QuadraticDrag(drag_coefficient=1.0), LinearDrag(gamma=0.0)))
    one = still.replace(run=Run(angle=0.0, velocity=1.0)).reynolds
    for reynolds, inside, outside in ((0.01, 1.001, 0.999), (2e5, 0.999, 1.001)):
        scene = still.replace(run=Run(angle=0.0, velocity=inside * reynolds / one))
        rate = scene.replace(drag_coefficient=None).coefficients["quadratic_drag_rate"]
        assert rate == pytest.approx(drag_rate(scene, sphere_drag_coefficient(inside * reynolds)), rel=1e-9)
        with pytest.raises(SceneError, match="cannot be derived"):
            still.replace(run=Run(angle=0.0, velocity=outside * reynolds / one)).replace(drag_coefficient=None)


@pytest.mark.parametrize("name", EFFECTS)
def test_functions_use_only_what_is_copied_into_a_program(name: str) -> None:
    """An effect's functions use only arithmetic, abs and functions of physics.elementary."""
    for role in ("torque", "by_angle", "by_velocity", "by_speed", "potential", "flow", "fade", "radial",
                 "store", "wind_x", "wind_y"):
        functions = [f] if (f := getattr(EFFECTS[name], role)) else []
        while functions:
            function = functions.pop()
            more = called(function)
            assert set(function.__code__.co_names) <= {"abs", "sqrt", *elementary.__all__, *more}, role
            functions += more.values()


# --- smoothed dry friction -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_smoothed_friction_is_that_of_coulomb_up_to_its_width() -> None:
    """From 1 rad with a friction ratio of 0.3: the next turning points differ by less as the width is smaller."""
    tau, scene = 0.05, SCENES["vacuum"]
    true = exact.coulomb_turning_points(1.0, tau, 3)[1:]
    torque = tau * scene.omega0**2 * scene.inertia
    away = []
    for width in (0.1, 0.01, 0.001):
        place = with_damping(scene, {"smooth": {"friction_torque": torque, "friction_width": width}})
        run = rollout(place, integrator="rk4", angle=1.0, velocity=0.0, dt=0.0005, duration=4.0, diagnostics=())
        turns = run.angle[1:-1][run.velocity[1:-1] * run.velocity[2:] <= 0.0]
        away.append(max(abs(one - other) for one, other in zip(turns, true, strict=False)))
    assert away[0] > 5.0 * away[1] > 25.0 * away[2]
    assert away[2] < 1e-5
    assert len(true) == 3


def test_a_held_bob_creeps_at_the_stated_speed() -> None:
    """Against a torque of x tau, ``w x/sqrt(1 - x**2)``: the root of ``x tau = tau v/sqrt(v**2 + w**2)``."""
    effect = SmoothFriction(friction_torque=0.003, friction_width=0.02)
    limit = effect.coefficients(scene_of("smooth_friction"))["smooth_limit"]
    for share in (0.1, 0.6, 0.99):
        speed = 0.02 * share / math.sqrt(1.0 - share**2)
        assert SmoothFriction.torque(speed, limit, 0.02) == pytest.approx(-share * limit, rel=1e-12)
    assert CoulombFriction(friction_torque=0.003).smoothed(0.02) == effect
