"""Tests of the method "exact" with steps of any length, against mpmath's elliptic functions and exponentials."""

from __future__ import annotations

import math
import random
from typing import Any

import mpmath
import numpy as np
import pytest

import integrators
from integrators import MethodError, System, solve
from integrators.families.exact_flow import oscillator_flow
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.machine import fitting
from pendulum_env.physics.effects import EFFECTS, Gravity, LinearDrag, SmallAngleGravity
from pendulum_env.physics.elementary import atan2
from pendulum_env.physics.exact.flows import FLOWS, damped_spring_flow, pendulum_flow, spring_flow

GRAVITY = 9.8
OMEGA0 = math.sqrt(GRAVITY)
DAMPED = Scene(effects=(SmallAngleGravity(), LinearDrag(gamma=0.4)))


def elliptic(tilt: float, side: float, velocity: float, h: float, rate: float = GRAVITY) -> tuple[Any, Any]:
    """Return tilt and velocity after the time h, from mpmath's elliptic functions sn, cn and dn."""
    w, pi = mpmath.sqrt(rate), mpmath.pi
    q = mpmath.mpf(tilt) + (pi if side < 0 else 0)
    turns = mpmath.nint(q / (2 * pi))
    x, y, z = mpmath.sin(q / 2 - turns * pi), mpmath.cos(q / 2 - turns * pi), mpmath.mpf(velocity) / (2 * w)
    m = x * x + z * z
    k = mpmath.sqrt(m)
    if m < 1:
        u = mpmath.ellipf(mpmath.atan2(x, z), m) + w * h
        s, c, d = (mpmath.ellipfun(name, u, m) for name in ("sn", "cn", "dn"))
        half, speed = mpmath.atan2(k * s, d), k * c
    else:
        sign = mpmath.sign(z)
        u = mpmath.ellipf(mpmath.atan2(sign * x, y), 1 / m) + k * w * h
        period = 2 * mpmath.ellipk(1 / m)
        rounds = mpmath.nint(u / period)
        s, d = (mpmath.ellipfun(name, u - rounds * period, 1 / m) for name in ("sn", "dn"))
        half, speed = sign * (mpmath.asin(s) + rounds * pi), sign * k * d
    return 2 * (half + turns * pi) - (pi if side < 0 else 0), 2 * w * speed


def over_the_top(draw: random.Random) -> tuple[float, ...]:
    tilt, speed = draw.uniform(-1.57, 1.57), 1.0 + 10 ** draw.uniform(-9.0, -1.0)
    velocity = draw.choice([-2.0, 2.0]) * OMEGA0 * math.sqrt(speed - math.sin(0.5 * tilt) ** 2)
    return tilt, 1.0, velocity, draw.uniform(0.0, 20.0)


def near_separatrix(draw: random.Random) -> tuple[float, ...]:
    tilt = draw.uniform(-1.5, 1.5)
    off = draw.choice([0.0, 1e-15, -1e-15, 1e-12, -1e-8, 1e-4])
    return tilt, 1.0, 2.0 * OMEGA0 * math.cos(0.5 * tilt) * (1.0 + off), draw.uniform(0.0, 1.0)


# Tilt, side, velocity, duration; and the allowed error, relative to the motion's size and the phase covered.
STATES: dict[str, tuple[Any, float]] = {
    "libration": (lambda r: (r.uniform(-1.57, 1.57), 1.0, r.uniform(-0.5, 0.5), r.uniform(0.0, 3.0)), 1e-15),
    "rotation": (lambda r: (r.uniform(-1.57, 1.57), r.choice([1.0, -1.0]), r.uniform(8, 60), r.uniform(0, 3)), 1e-15),
    "backwards": (lambda r: (r.uniform(-1.57, 1.57), 1.0, r.uniform(-30.0, 30.0), r.uniform(-3.0, 0.0)), 1e-15),
    "short": (lambda r: (r.uniform(-1.57, 1.57), 1.0, r.uniform(-9.0, 9.0), 10 ** r.uniform(-6, -1)), 1e-15),
    "long": (lambda r: (r.uniform(-1.57, 1.57), 1.0, r.uniform(-5.0, 5.0), r.uniform(-100.0, 100.0)), 1e-15),
    "tiny": (lambda r: (r.uniform(-1e-9, 1e-9), 1.0, r.uniform(-1e-9, 1e-9), r.uniform(0.0, 3.0)), 1e-15),
    "at the top": (lambda r: (r.uniform(-1e-9, 1e-9), -1.0, 0.0, r.uniform(0.0, 3.0)), 1e-15),
    "just over the top": (over_the_top, 1e-7),  # limited by the rounding of the 1e-9
    "separatrix": (near_separatrix, 2e-14),  # limited by the rounding of the state
}


@pytest.mark.quick("libration", "rotation", "at the top")
@pytest.mark.parametrize("kind", STATES)
def test_the_pendulum_against_elliptic_functions(kind: str) -> None:
    draw, (state, allowed) = random.Random(kind), STATES[kind]
    with mpmath.workdps(40):
        for _ in range(60):
            tilt, side, velocity, h = state(draw)
            q, v = pendulum_flow(tilt, side, velocity, h, GRAVITY)
            wanted, speed = elliptic(tilt, side, velocity, h)
            phase = 1.0 + OMEGA0 * abs(h) + abs(wanted - tilt)
            size = abs(wanted) + abs(speed) / OMEGA0 + abs(tilt) + abs(velocity) / OMEGA0
            assert abs(q - wanted) <= allowed * phase * size, (tilt, side, velocity, h)
            assert abs(v - speed) <= allowed * phase * size * OMEGA0, (tilt, side, velocity, h)


def test_the_top_and_the_bottom_are_at_rest() -> None:
    for side in (1.0, -1.0):
        for h in (0.1, 30.0, 1e4):
            q, v = pendulum_flow(0.0, side, 0.0, h, GRAVITY)
            assert (q, v) == (0.0, 0.0)


def test_without_gravity_it_goes_straight_on() -> None:
    q, v = pendulum_flow(0.3, 1.0, 2.0, 0.7, 0.0)
    assert q == pytest.approx(0.3 + 2.0 * 0.7, rel=1e-15)
    assert v == pytest.approx(2.0, rel=1e-15)


def spring_truth(q: float, v: float, h: float, rate: float, gamma: float) -> tuple[Any, Any, Any]:
    """Return the motion of a damped spring from exponentials of 60 digits, and its heat from the loss of energy."""
    with mpmath.workdps(60):
        q, v, h, rate, d = (mpmath.mpf(x) for x in (q, v, h, rate, gamma / 2))
        s = mpmath.sqrt(mpmath.mpc(d * d - rate)) or mpmath.mpf(10) ** -25
        c, s, f = mpmath.cosh(s * h), mpmath.sinh(s * h) / s, mpmath.exp(-d * h)
        q1, v1 = mpmath.re(f * (q * (c + d * s) + v * s)), mpmath.re(f * (v * (c - d * s) - rate * q * s))
        return q1, v1, (v * v + rate * q * q - v1 * v1 - rate * q1 * q1) / 2


def regime(kind: str, draw: random.Random) -> tuple[float, ...]:
    start = draw.uniform(-1, 1), draw.uniform(-3, 3)
    gamma, h = 10 ** draw.uniform(-2, 2), 10 ** draw.uniform(-4, 2)
    if kind == "near critical":
        return *start, h, gamma * gamma / 4 * (1 + draw.choice([-1, 0, 1]) * 10 ** draw.uniform(-17, -1)), gamma
    spread = {"underdamped": (0, 3), "overdamped": (-4, 0), "undamped": (0, 2)}[kind]
    return *start, h, gamma * gamma / 4 * 10 ** draw.uniform(*spread), 0.0 if kind == "undamped" else gamma


@pytest.mark.quick("underdamped", "overdamped")
@pytest.mark.parametrize("kind", ["underdamped", "near critical", "overdamped", "undamped"])
def test_the_damped_spring_and_its_heat(kind: str) -> None:
    draw = random.Random(kind)
    for _ in range(400):
        q, v, h, rate, _ = state = regime(kind, draw)
        flow, wanted = damped_spring_flow(*state), spring_truth(*state)
        size = math.hypot(q * math.sqrt(rate), v) * (1.0 + math.sqrt(rate) * h)
        assert abs(flow[0] - wanted[0]) * math.sqrt(rate) <= 5e-16 * size, state
        assert abs(flow[1] - wanted[1]) <= 5e-16 * size, state
        if kind == "undamped":
            assert flow[2] == 0.0
            assert spring_flow(q, v, h, rate) == pytest.approx(flow[:2], abs=5e-16 * size * max(1.0, 1.0 / rate))
        else:
            assert flow[2] == pytest.approx(float(wanted[2]), rel=1e-14), state


def test_the_arctangent() -> None:
    draw = random.Random(1)
    for _ in range(2000):
        y, x = (draw.uniform(-1, 1) * 10 ** draw.uniform(-9, 9) for _ in "yx")
        truth = mpmath.atan2(y, x)
        assert abs(atan2(y, x) - truth) <= 1.5 * math.ulp(float(truth))
    assert [atan2(*p) for p in ((0.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0))] == [
        0.0, 0.0, math.pi, math.pi / 2, -math.pi / 2]


# --- in scenes -------------------------------------------------------------------------------------------------------


def test_the_table_of_closed_forms_names_effects_and_their_heats() -> None:
    for names, flow in FLOWS.items():
        assert names <= EFFECTS.keys()
        assert set(flow.heats) == {name for name in names if EFFECTS[name].kind == "dissipative"}


def test_its_matrix_on_the_oscillator_is_a_rotation() -> None:
    """In power series of the step, whose next term is beyond rounding."""
    rows = integrators.get("exact").oscillator_matrix(20)
    values = [sum(float(x) * 0.5**k for k, x in enumerate(row)) for row in rows]
    wanted = [math.cos(0.5), math.sin(0.5), -math.sin(0.5), math.cos(0.5)]
    assert values == pytest.approx(wanted, abs=1e-15)


def test_steps_of_any_length_lead_to_one_motion() -> None:
    for scene, start in ((SCENES["vacuum"], (3.0, 0.3)), (SCENES["vacuum"], (1.0, 7.0)), (DAMPED, (1.0, 2.0))):
        options: dict[str, Any] = {"angle": start[0], "velocity": start[1], "duration": 12.0, "backend": "python"}
        coarse, fine = (rollout(scene, integrator="exact", dt=dt, **options) for dt in (3.0, 0.0625))
        assert coarse.angle[-1] == pytest.approx(fine.angle[-1], abs=2e-12)
        assert coarse.velocity[-1] == pytest.approx(fine.velocity[-1], abs=1e-11)
        assert coarse.ledger.heat[-1] == pytest.approx(fine.ledger.heat[-1], rel=1e-13)
        assert np.max(np.abs(fine.energy_residual)) < 1e-13 * fine.energy[0]


@pytest.mark.slow
@pytest.mark.parametrize("scene", [SCENES["vacuum"], DAMPED], ids=["gravity", "damped spring"])
def test_compiled_and_interpreted_steps_and_batches_have_the_same_bits(scene: Scene) -> None:
    angles = np.linspace(-3.1, 3.1, 9)
    options: dict[str, Any] = {"integrator": "exact", "velocity": 2.0, "duration": 8.0, "dt": 0.4}
    batch = rollout(scene, angle=angles, backend="compiled", **options)
    for i, angle in enumerate(angles):
        alone = rollout(scene, angle=float(angle), backend="python", **options)
        for quantity in ("angle", "velocity", "energy_residual"):
            assert getattr(batch, quantity)[i].tolist() == getattr(alone, quantity).tolist()


def test_other_scenes_are_refused() -> None:
    fits = {name for name, scene in SCENES.items() if "exact" in fitting(scene)}
    assert {"textbook", "vacuum", "exercise"} <= fits
    assert not fits & {"exercise_large", "lab", "driven", "chaotic", "kapitza"}
    with pytest.raises(MethodError, match=r"exact needs the motion itself in closed form.*'lab' does not offer"):
        rollout("lab", integrator="exact")
    with pytest.raises(MethodError, match="exact does not estimate its error, so rtol cannot"):
        rollout("vacuum", integrator="exact", rtol=1e-9)
    assert "exact" not in fitting(Scene(effects=(Gravity(), LinearDrag(gamma=0.1))))


# --- on any problem --------------------------------------------------------------------------------------------------


def test_solve_applies_what_the_system_offers() -> None:
    system = System(lambda t, q, v: -4.0 * q - v, exact_flow=oscillator_flow(4.0, 1.0))
    solution = solve(system, 1.0, 0.5, [0.0, 1.0, 5.0], method="exact", h=2.0)
    assert (solution.steps, solution.evaluations) == (3, 3)
    for t, q, v in zip(solution.t, solution.q, solution.v, strict=True):
        wanted = spring_truth(1.0, 0.5, t, 4.0, 1.0)
        assert (q, v) == pytest.approx((float(wanted[0]), float(wanted[1])), abs=1e-15)
    with pytest.raises(MethodError, match=r"exact needs the motion itself in closed form .*does not offer; .*fit"):
        solve(lambda t, q, v: -q, 1.0, 0.0, [0.0, 1.0], method="exact", h=0.1)


@pytest.mark.parametrize("gamma", [0.0, 0.3, 4.0, 4.0 + 1e-9, 50.0])
def test_the_oscillators_flow_for_the_analysis(gamma: float) -> None:
    for h in (0.01, 1.0, 7.0):
        wanted = spring_truth(0.7, -0.4, h, 4.0, gamma)
        assert oscillator_flow(4.0, gamma)(0.0, 0.7, -0.4, h) == pytest.approx(
            (float(wanted[0]), float(wanted[1])), abs=4e-15)


def test_what_the_registry_says_of_it() -> None:
    method = integrators.get("exact")
    assert method.order == math.inf
    assert (method.symplectic, method.symmetric, method.implicit, method.evaluations) == (True, True, False, 1)
