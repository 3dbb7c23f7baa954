"""Tests of drag in a moving medium, against force vectors, closed forms and trajectories of 18 digits."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from given_effects import GIVEN
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import integrators
from pendulum_env import Scene, rollout
from pendulum_env.engine.generate import program
from pendulum_env.engine.kernels import interpreted
from pendulum_env.engine.machine import ANGLE, TURNS, TWO_PI, VELOCITY, Machine, fitting, numbers_of, offers
from pendulum_env.physics import elementary
from pendulum_env.physics.body import Body
from pendulum_env.physics.drag_laws import LAWS
from pendulum_env.physics.effects import (
    EFFECTS,
    BearingFriction,
    CoulombFriction,
    Effect,
    Gravity,
    Gusts,
    HorizontalDrive,
    LinearDrag,
    QuadraticDrag,
    SphereDrag,
    VerticalDrive,
    Wind,
    WireDrag,
)
from pendulum_env.physics.effects.linear_drag import linear_drag_fade
from pendulum_env.physics.effects.quadratic_drag import quadratic_drag_fade
from pendulum_env.physics.medium import air

LENGTH, MASS, RADIUS, THICKNESS = 0.4, 0.03, 0.02, 0.001
BODY = Body(LENGTH, MASS, RADIUS, thickness=THICKNESS)
AIR = air(20.0)
UP, SIDE, SPEED, GUST = (0.02, 11.0, 0.4), (0.03, 6.0, -1.2), 2.5, -0.7
C, GAMMA, BEARING = 0.35, 0.6, 0.002
DRAGS: dict[str, Effect] = {
    "linear": LinearDrag(GAMMA), "quadratic": QuadraticDrag(C), "wire": WireDrag(),
    **{law: SphereDrag(law) for law in LAWS},
}
MOTIONS: dict[str, tuple[Effect, ...]] = {
    "wind": (Wind(SPEED),),
    "gust": (Wind(SPEED), Gusts()),
    "vertical": (VerticalDrive(*UP),),
    "horizontal": (HorizontalDrive(*SIDE),),
    "all": (VerticalDrive(*UP), HorizontalDrive(*SIDE), Wind(SPEED), Gusts()),
}
Vector = tuple[Any, Any]


@pytest.fixture(autouse=True)
def _many_digits() -> Any:
    with mp.workdps(40):
        yield


# --- torque, power and derivatives by vectors -----------------------------------------------------------------------


def times(factor: Any, a: Vector) -> Vector:
    return factor * a[0], factor * a[1]


def plus(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1]


def dot(a: Vector, b: Vector) -> Any:
    return a[0] * b[0] + a[1] * b[1]


def multiple(law: str, re: Any) -> Any:
    """Return the published drag coefficient as a multiple of Stokes' law, C_d Re/24."""
    return {
        "clift_gauvin": lambda: 1 + mp.mpf("0.152") * re ** mp.mpf("0.677")
        + re / 24 * mp.mpf("0.417") / (1 + 5070 * re ** mp.mpf("-0.94")),
        "schiller_naumann": lambda: 1 + mp.mpf("0.15") * re ** mp.mpf("0.687"),
        "brown_lawler": lambda: 1 + mp.mpf("0.150") * re ** mp.mpf("0.681")
        + re / 24 * mp.mpf("0.407") / (1 + 8710 / re),
        "morrison": lambda: 1 + re / 24 * (
            mp.mpf("2.6") * re / 5 / (1 + (re / 5) ** mp.mpf("1.52"))
            + mp.mpf("0.411") * (re / 263000) ** mp.mpf("-7.94") / (1 + (re / 263000) ** -8)
            + re ** mp.mpf("0.8") / 461000),
    }[law]()


def strength(drag: str, size: Any) -> Any:
    """Return the drag divided by the relative velocity [N s/m], at the relative speed ``size`` [m/s]."""
    inertia, rho, mu = mp.mpf(MASS) * LENGTH**2, mp.mpf(AIR.density), mp.mpf(AIR.viscosity)
    if drag == "linear":
        return GAMMA * inertia / mp.mpf(LENGTH) ** 2
    if drag == "quadratic":
        return C * inertia / mp.mpf(LENGTH) ** 3 * size
    if drag == "wire":
        # Torque of a wire, integrated over its length with C_d = 1 + 10 Re^(-2/3), over L and the speed of its end.
        third = mp.mpf(1) / 3
        form, skin = mp.mpf(1) / 4, 10 * (mu / (rho * size * THICKNESS)) ** (2 * third) / (4 - 2 * third)
        return rho * THICKNESS * LENGTH * size / 2 * (form + skin)
    return 6 * mp.pi * mu * RADIUS * multiple(drag, rho * size * 2 * RADIUS / mu)


def truth(drag: str, motion: str, t: Any, q: Any, v: Any) -> tuple[Any, Any, Any]:
    """Return acceleration, work and heat (per inertia) under gravity, one drag and a moving pivot."""
    inertia = mp.mpf(MASS) * LENGTH**2
    names = {effect.name for effect in MOTIONS[motion]}
    (b, w, p), (c, r, f) = (map(mp.mpf, each) for each in (UP, SIDE))
    pivot = (-c * r * mp.sin(r * t + f) if "horizontal_drive" in names else 0,
             -b * w * mp.sin(w * t + p) if "vertical_drive" in names else 0)
    jolt = (-c * r * r * mp.cos(r * t + f) if "horizontal_drive" in names else 0,
            -b * w * w * mp.cos(w * t + p) if "vertical_drive" in names else 0)
    wind = ((SPEED if "wind" in names else 0) + (mp.mpf(GUST) if "gusts" in names else 0), 0)
    arm, path = times(LENGTH, (mp.sin(q), -mp.cos(q))), (mp.cos(q), mp.sin(q))
    flow = plus(wind, times(-1, pivot))
    u = plus(times(LENGTH * v, path), times(-1, flow))
    force = times(-strength(drag, mp.hypot(*u)), u)
    shaken = times(-mp.mpf(MASS), jolt)

    def torque(at: Vector) -> Any:
        return arm[0] * at[1] - arm[1] * at[0]

    weight = (0, -mp.mpf(MASS) * mp.mpf(9.81))
    work = dot(force, flow) + torque(shaken) * v
    return sum(map(torque, (force, shaken, weight))) / inertia, work / inertia, -dot(force, u) / inertia


def moving(drag: str, motion: str) -> tuple[Any, dict[str, Callable[..., Any]], list[Any]]:
    """Return a program's shape, its functions for mpmath's numbers, and their further arguments."""
    scene = Scene(body=BODY, medium=AIR, effects=(Gravity(), DRAGS[drag], *MOTIONS[motion]), gravity=9.81)
    source = program(scene, integrators.get("gauss4"))
    names = {name: getattr(mp, name) for name in (*elementary.__all__, "sqrt") if hasattr(mp, name)}
    known = {**numbers_of(scene), "control": 0.0, "gust": GUST / LENGTH}
    return source.shape, dict(interpreted(source.text, source.title, names)), [known.get(n) for n in source.shape.extra]


POINTS = [(0.0, 0.7, -1.3), (0.83, -1.4, 6.0), (12.5, 1.5, 0.0), (3.0, -0.01, 25.0)]


CASES = [
    pytest.param(drag, motion, marks=() if drag == "quadratic" or motion == "all" else pytest.mark.slow)
    for drag in DRAGS for motion in MOTIONS
]


@pytest.mark.quick("linear-all", "quadratic-all", "wire-all", "morrison-all")
@pytest.mark.parametrize(("drag", "motion"), CASES)
def test_torque_and_power_are_those_of_the_vectors(drag: str, motion: str) -> None:
    shape, functions, extra = moving(drag, motion)
    assert shape.quadratures == ("work", "heat")
    for side in (1, -1):
        values = [mp.mpf(side) if value is None else mp.mpf(value) for value in extra]
        for t, tilt, v in POINTS:
            t, tilt, v = mp.mpf(t), mp.mpf(tilt), mp.mpf(v)
            whole = tilt if side > 0 else tilt + mp.pi
            wanted = truth(drag, motion, t, whole, v)
            rates = functions["rates"](t, tilt, v, *values)
            for one, other in zip(rates, wanted, strict=True):
                # The coefficients are doubles, which limits the agreement to a few ulps.
                assert abs(one - other) < 1e-14 * (abs(other) + abs(wanted[0]) * (1 + abs(v))), (side, t, tilt, v)
            assert abs(functions["acceleration"](t, tilt, v, *values) - rates[0]) <= 1e-36 * abs(rates[0])


@pytest.mark.quick("linear-all", "wire-all", "morrison-all")
@pytest.mark.parametrize(("drag", "motion"), CASES)
def test_the_jacobian_is_the_slope(drag: str, motion: str) -> None:
    _, functions, extra = moving(drag, motion)
    h = mp.mpf(10) ** -10
    for side in (1, -1):
        values = [mp.mpf(side) if value is None else mp.mpf(value) for value in extra]
        for t, q, v in POINTS:
            at = [mp.mpf(x) for x in (t, q, v)]
            slopes = functions["jacobian"](*at, *values)
            for place, slope in zip((1, 2), slopes, strict=True):
                ends = []
                for step in (-2 * h, -h, h, 2 * h):
                    moved = list(at)
                    moved[place] += step
                    ends.append(functions["acceleration"](*moved, *values))
                wanted = (8 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12 * h)
                assert abs(slope - wanted) < mp.mpf(10) ** -25 * (1 + abs(wanted)), (side, t, q, v)


@pytest.mark.parametrize("drag", DRAGS)
def test_at_rest_in_the_air_nothing_is_infinite(drag: str) -> None:
    """Check that a bob that moves with the wind's velocity at the bottom has finite derivatives and no drag."""
    scene = Scene(body=BODY, medium=AIR, effects=(Gravity(), DRAGS[drag], Wind(SPEED)))
    source = program(scene, integrators.get("gauss4"))
    functions = interpreted(source.text, source.title)
    extra = [numbers_of(scene).get(name, 1.0) for name in source.shape.extra]
    at = (0.0, 0.0, SPEED / LENGTH, *extra)
    assert functions["rates"](*at) == (0.0, 0.0, 0.0)
    assert all(math.isfinite(slope) for slope in functions["jacobian"](*at))


# --- exact flows ----------------------------------------------------------------------------------------------------


@pytest.mark.quick("2.0-0.3-0.0", "-30.0-0.004--0.3", "-30.0--0.004-9.0")
@pytest.mark.parametrize("cross", [0.0, 1e-9, 0.02, -0.3, 9.0, -55.0])
@pytest.mark.parametrize(("slip", "duration"), [
    (2.0, 0.3), (-30.0, 0.004), (-30.0, -0.004), *(pytest.param(*case, marks=pytest.mark.slow) for case in (
        (1e-8, 0.3), (1e-8, -0.004), (2.0, -0.004), (-30.0, 0.3))),
])
def test_a_quadratic_fade_solves_its_torque(slip: float, cross: float, duration: float) -> None:
    """Check the exact flow of quadratic drag, s' = -c sqrt(s² + w²) s, against mpmath's Taylor series."""
    with mp.workdps(20):
        def slope(_: Any, y: list[Any]) -> list[Any]:
            rate = mp.sign(duration) * C * mp.hypot(y[0], cross)
            return [-rate * y[0], rate]

        rest, decay = mp.odefun(slope, 0, [mp.mpf(slip), mp.mpf(0)])(mp.mpf(abs(duration)))
    result = quadratic_drag_fade(slip, cross, duration, C)
    assert result[0] == pytest.approx(float(rest), rel=1e-15 * (4 + abs(C * cross * duration)), abs=0.0)
    assert result[1] == pytest.approx(float(decay), rel=1e-14, abs=3e-16)


def test_a_quadratic_fade_backwards_beyond_infinity_is_not_a_number() -> None:
    """Check that a backward flow beyond its pole gives nan: s/(1 + c s h) is infinite at h = -1/(c s) for w = 0."""
    assert all(math.isnan(value) for value in quadratic_drag_fade(2.0, 0.0, -2.0, 1.0))
    assert all(math.isnan(value) for value in quadratic_drag_fade(2.0, 0.5, -2.0, 1.0))


def test_a_linear_fade_is_exponential() -> None:
    rest, decay = linear_drag_fade(-2.0, 0.3, GAMMA)
    assert rest == pytest.approx(-2.0 * math.exp(-0.3 * GAMMA), rel=4e-16)
    assert decay == 0.3 * GAMMA


# --- whole runs -----------------------------------------------------------------------------------------------------

START, DURATION = (0.9, -2.0), 0.6
STORM = Scene(
    body=BODY, medium=AIR, gravity=9.81,
    effects=(Gravity(), LinearDrag(GAMMA), QuadraticDrag(C), BearingFriction(BEARING), VerticalDrive(*UP),
             Wind(SPEED)),
)
"""Scene in which the bob's speed relative to the air is never 0, so that the drag is smooth."""


@lru_cache
def storm() -> tuple[float, ...]:
    """Return the final angle, velocity, work and three heats [J] from mpmath's Taylor series."""
    with mp.workdps(18):
        b, w, p = map(mp.mpf, UP)
        inertia = mp.mpf(MASS) * LENGTH**2

        def rates(t: Any, y: list[Any]) -> list[Any]:
            q, v, *_ = y
            sine, cosine = mp.sin(q), mp.cos(q)
            flow = (mp.mpf(SPEED), b * w * mp.sin(w * t + p))
            u = (LENGTH * v * cosine - flow[0], LENGTH * v * sine - flow[1])
            drags = [times(-strength(name, mp.hypot(*u)), u) for name in ("linear", "quadratic")]
            lifted = mp.mpf(MASS) * b * w * w * mp.cos(w * t + p)
            force = plus(*drags)
            shaken = lifted * LENGTH * sine
            torque = LENGTH * dot(force, (cosine, sine)) + shaken - BEARING * v - MASS * mp.mpf(9.81) * LENGTH * sine
            return [v, torque / inertia, shaken * v + dot(force, flow), *(-dot(drag, u) for drag in drags),
                    BEARING * v * v]

        return tuple(map(float, mp.odefun(rates, 0, [*map(mp.mpf, START), *[mp.mpf(0)] * 4])(mp.mpf(DURATION))))


@pytest.mark.slow
@pytest.mark.quick("rk4", "velocity_verlet", "gauss4")
@pytest.mark.parametrize("method", fitting(STORM))
def test_methods_keep_their_order_in_moving_air(method: str) -> None:
    """Check that half the step divides the errors of motion, work and heats by 2^(order - 0.1), down to rounding."""
    order, wanted = integrators.get(method).order, np.array(storm())
    size = np.abs(wanted)
    machine = Machine(STORM, method, diagnostics=("heat_by_effect",), backend="python")
    kept, before = np.zeros(5, dtype=bool), np.full(5, np.inf)
    for steps in (16, 32, 64, 128, 256, 512, 1024):
        state = machine.state(*START)
        assert machine.advance(state, 0.0, DURATION / steps, steps) == 0
        heats = machine.heat_by_effect(state)
        ends = [state[ANGLE] + TWO_PI * state[TURNS], state[VELOCITY], machine.ledger(state, 0.0).work,
                *(heats[name] for name in ("linear_drag", "quadratic_drag", "bearing_friction"))]
        away = np.abs(np.array(ends, dtype=float) - wanted) / size
        errors = np.array([max(away[0], away[1]), *away[2:]])
        falls = 2.0 ** (order - 0.1) * errors < before
        kept |= (falls & np.isfinite(before) & (errors < 0.1)) | (errors < 2e-12)
        before = errors
        if np.all(kept):
            return
    assert np.all(kept), (kept, before)


@pytest.mark.parametrize("method", ["rk4", "velocity_verlet", "implicit_midpoint", "forest_ruth", "dopri5"])
def test_the_ledger_closes_at_the_methods_order(method: str) -> None:
    """Check that half the step divides the energy residual by at least 2^(order - 0.1)."""
    machine, left = Machine(STORM, method, backend="python"), []
    for steps in (32, 64, 128):
        state = machine.state(*START)
        machine.advance(state, 0.0, DURATION / steps, steps)
        initial = STORM.inertia * (0.5 * START[1] ** 2 + STORM.omega0**2 * (1.0 - math.cos(START[0])))
        left.append(abs(float(machine.ledger(state, initial).residual)))
    falls = [left[i] / left[i + 1] for i in (0, 1)]
    assert left[-1] < 1e-14 or max(falls) > 2.0 ** (integrators.get(method).order - 0.1), left


LEANING = Scene(body=BODY, medium=AIR, effects=(Gravity(), QuadraticDrag(C), Wind(SPEED)), gravity=9.81)
STIFFNESS = C * MASS / LENGTH
"""Drag divided by the square of the relative velocity [N s²/m²]."""
LEANS = math.atan(STIFFNESS * SPEED**2 / (MASS * 9.81))


@pytest.mark.parametrize("method", ["rk4", "gauss4"])
def test_a_steady_wind_leans_the_bob_over(method: str) -> None:
    """Check that a bob rests in a steady wind at tan(theta) = drag/weight, where all work of the wind becomes heat."""
    r = rollout(LEANING, integrator=method, angle=-0.6, velocity=3.0, dt=0.02, duration=60.0, backend="python")
    assert r.angle[-1] == pytest.approx(LEANS, rel=1e-12)
    assert abs(r.velocity[-1]) < 1e-12
    for booked in (r.ledger.work, r.ledger.heat):
        values = np.asarray(booked)
        assert (values[-1] - values[-501]) / 10.0 == pytest.approx(STIFFNESS * SPEED**3, rel=1e-12)
    assert abs(r.energy_residual[-1]) < 1e-5 * abs(r.energy[0])


def test_a_splitting_leans_nearly_as_far() -> None:
    """Check that a splitting method leans the bob to the exact angle up to an error of order h²."""
    ends = [rollout(LEANING, integrator="velocity_verlet", angle=0.4, dt=h, duration=40.0, backend="python").angle[-1]
            for h in (0.02, 0.01)]
    assert (ends[0] - LEANS) / (ends[1] - LEANS) == pytest.approx(4.0, rel=0.01)
    assert abs(ends[1] - LEANS) < 1e-4


# --- never a source of energy ---------------------------------------------------------------------------------------

LOSSES = [name for name, effect in EFFECTS.items() if effect.kind == "dissipative"]
SIZES = {
    "length": (0.01, 10.0), "mass": (1e-4, 10.0), "radius": (1e-4, 0.3), "thickness": (1e-5, 0.01),
    "wind_speed": (-30.0, 30.0), "vertical_amplitude": (0.0, 0.1), "horizontal_rate": (0.0, 50.0),
}


@lru_cache
def losing(name: str, still: bool) -> tuple[Any, Callable[..., Any], Scene]:
    effect = GIVEN.get(name) or EFFECTS[name]()
    movers = () if still else (Wind(SPEED), VerticalDrive(*UP), HorizontalDrive(*SIDE))
    scene = Scene(body=BODY, medium=AIR, effects=(effect, *movers))
    source = program(scene, integrators.get("rk4"))
    return source.shape, interpreted(source.text, source.title)["rates"], scene


@pytest.mark.quick("sphere_drag-True", "wire_drag-False", "coulomb_friction-True")
@pytest.mark.parametrize("still", [True, False])
@pytest.mark.parametrize("name", LOSSES)
@settings(max_examples=25)
@given(data=st.data())
def test_losses_make_heat_and_never_energy(name: str, still: bool, data: st.DataObject) -> None:
    shape, rates, scene = losing(name, still)
    names = {n: bounds for n, bounds in SIZES.items() if n in scene.parameters() and n != "radius"}
    changed = {n: data.draw(st.floats(*bounds), label=n) for n, bounds in names.items()}
    number = st.floats(0.0, 10.0)
    own = {n: data.draw(number) for n in ("gamma", "c", "bearing_viscosity", "friction_torque")
           if n in scene.parameters() and (n != "c" or data.draw(st.booleans()))}
    if "c" in own or name != "quadratic_drag":
        scene = scene.replace(**changed, **own)
    t, q, v = (data.draw(st.floats(-most, most), label=n) for n, most in (("t", 50.0), ("q", 1.6), ("v", 60.0)))
    known = {**numbers_of(scene), "control": 0.0, "side": data.draw(st.sampled_from([1.0, -1.0]))}
    extra = [known[n] for n in shape.extra] + ([math.copysign(1.0, v)] if shape.slides else [])
    result = rates(t, q, v, *extra)
    heat = result[1 + shape.quadratures.index("heat")]
    assert heat >= 0.0
    if still:
        assert result[0] * v <= 0.0
        assert heat == -v * result[0]


def test_dry_friction_and_moving_air_offer_no_exact_flows() -> None:
    assert "split" not in offers(Scene(body=BODY, medium=AIR, effects=(
        Gravity(), LinearDrag(GAMMA), CoulombFriction(friction_torque=1e-3), Wind(SPEED))))


# --- held by dry friction -------------------------------------------------------------------------------------------


def held(motion: str, torque: float, *more: Effect) -> Scene:
    """Quadratic drag and dry friction of a limit ``torque`` [N m] in moving air."""
    effects = (Gravity(), DRAGS["quadratic"], CoulombFriction(friction_torque=torque), *MOTIONS[motion], *more)
    return Scene(body=BODY, medium=AIR, effects=effects, gravity=9.81)


HELD_FOR = 3.0
HOLDING = tuple(fitting(held("wind", 1.0)))
POWER = STIFFNESS * SPEED**3
"""Of a wind of SPEED on a bob at rest below the pivot, all of which becomes heat [W]."""


@pytest.mark.parametrize("method", HOLDING)
def test_the_air_works_on_a_bob_that_friction_holds(method: str) -> None:
    r = rollout(held("wind", 1.0), integrator=method, angle=0.0, velocity=0.0, dt=0.05, duration=HELD_FOR,
                backend="python", diagnostics=("energy", "heat_by_effect"))
    for booked in (r.ledger.work, r.ledger.heat, r.heat_by_effect["quadratic_drag"]):
        assert np.asarray(booked) == pytest.approx(POWER * r.time, rel=1e-12)
    assert not np.any(r.heat_by_effect["coulomb_friction"])
    assert not np.any(r.angle)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["rk4", "gauss4"])
@pytest.mark.parametrize("way", [{"compensated": True}, {"angle": [0.0, 0.0]}], ids=["compensated", "block"])
def test_it_also_does_with_compensation_and_in_blocks(method: str, way: dict[str, Any]) -> None:
    r = rollout(held("wind", 1.0), integrator=method, velocity=0.0, dt=0.05, duration=HELD_FOR,
                **{"angle": 0.0, **way})
    for booked in (r.ledger.work, r.ledger.heat):
        for row in np.atleast_2d(booked):
            assert row == pytest.approx(POWER * r.time, rel=1e-12)


@pytest.mark.quick("gauss4", "backward_euler")
@pytest.mark.parametrize("method", HOLDING)
def test_a_shaken_pivot_works_through_the_air_on_a_bob_that_friction_holds(method: str) -> None:
    """The air passes with -x'(t), x = c cos(r t + f): the work is gamma m c² r² times the integral of sin²(r t + f)."""
    c, r, f = SIDE
    scene = Scene(body=BODY, medium=AIR, gravity=9.81,
                  effects=(Gravity(), LinearDrag(GAMMA), CoulombFriction(friction_torque=1.0), HorizontalDrive(*SIDE)))
    run = rollout(scene, integrator=method, angle=0.0, velocity=0.0, dt=0.01, duration=2.0, backend="python")
    time = run.time
    wanted = GAMMA * MASS * (c * r) ** 2 * (time / 2 - (np.sin(2 * r * time + 2 * f) - math.sin(2 * f)) / (4 * r))
    # Symplectic Euler freezes the air for a step: a rectangle rule, off by at most h/2 times the largest power.
    allowed = 0.5 * 0.01 * GAMMA * MASS * (c * r) ** 2 if method == "symplectic_euler" else 1e-18
    for booked in (run.ledger.work, run.ledger.heat):
        assert np.asarray(booked) == pytest.approx(wanted, rel=1e-12, abs=allowed)
    assert not np.any(run.angle)


STICKS_FOR = 2.0


@lru_cache
def stick_and_slip(motion: str, torque: float) -> tuple[float, ...]:
    """Angle, work, heat [J] and the time spent at rest [s] by trajectories of tolerance 1e-13 between the stops."""
    inertia = MASS * LENGTH**2

    def rates(t: float, y: Any, direction: float) -> list[float]:
        a, work, heat = map(float, truth("quadratic", motion, t, y[0], y[1]))
        return [y[1], a - direction * torque / inertia, inertia * work, inertia * heat + direction * torque * y[1]]

    def stopped(t: float, y: Any, direction: float) -> float:
        return float(y[1])

    def beyond(t: float, y: Any, direction: float) -> float:
        return abs(rates(t, y, 0.0)[1]) - torque / inertia

    def held_rates(t: float, y: Any, direction: float) -> list[float]:
        return [0.0, 0.0, *rates(t, [y[0], 0.0], 0.0)[2:]]

    y, t, rested, sticks = np.zeros(4), 0.0, 0.0, False
    while t < STICKS_FOR:
        y[1] = 0.0
        other = rates(t, y, 0.0)[1]
        sticks = not sticks and abs(other) <= torque / inertia  # what has just broken away slides
        event = beyond if sticks else stopped
        event.terminal, event.direction = True, 1.0 if sticks else -math.copysign(1.0, other)  # type: ignore[attr-defined]
        part = solve_ivp(held_rates if sticks else rates, (t, STICKS_FOR), y, method="DOP853", rtol=1e-13, atol=1e-15,
                         events=event, args=(math.copysign(1.0, other),), max_step=0.05)
        rested += float(part.t[-1] - t) if sticks else 0.0
        t, y = float(part.t[-1]), part.y[:, -1].copy()
    return float(y[0]), float(y[2]), float(y[3]), rested


@pytest.mark.quick("rk4-wind-0.008")
@pytest.mark.parametrize(("motion", "torque"), [("wind", 0.008), ("horizontal", 0.008)])
@pytest.mark.parametrize("method", HOLDING)
def test_work_and_heat_of_stick_and_slip(method: str, motion: str, torque: float) -> None:
    """The bob slides, stops, and breaks away: in the shaken case at the time from which friction no longer holds it."""
    with mp.workdps(16):
        angle, work, heat, rested = stick_and_slip(motion, torque)
    assert 0.0 < rested < STICKS_FOR
    r = rollout(held(motion, torque), integrator=method, angle=0.0, velocity=0.0, dt=0.005, duration=STICKS_FOR,
                backend="python")
    allowed = {1: 0.05, 2: 2e-3, 3: 1e-4}.get(integrators.get(method).order, 1e-6)
    assert r.angle[-1] == pytest.approx(angle, rel=allowed)
    assert np.asarray(r.ledger.work)[-1] == pytest.approx(work, rel=allowed)
    assert np.asarray(r.ledger.heat)[-1] == pytest.approx(heat, rel=allowed)
