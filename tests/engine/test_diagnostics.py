"""Tests of diagnostics: pull on the suspension against Newton's law, flow numbers against closed forms, slack wires."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from functools import partial
from inspect import signature
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline
from scipy.special import ellipkinc

import pendulum_env  # noqa: F401
from pendulum_env import SCENES, Scene, SceneError, rollout
from pendulum_env.engine.machine import Machine
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import (
    AddedMass,
    BearingFriction,
    Buoyancy,
    CoulombFriction,
    Effect,
    FiniteBob,
    Gravity,
    Gusts,
    HorizontalDrive,
    LinearDrag,
    Motor,
    QuadraticDrag,
    SmallAngleGravity,
    SphereDrag,
    Suspension,
    VerticalDrive,
    Wind,
    WireDrag,
)
from pendulum_env.physics.flow import keulegan_carpenter, quality_factor, regime_of_damping
from pendulum_env.physics.medium import Medium, air, water

LENGTH, MASS, RADIUS = 0.4, 0.9, 0.05
BODY = Body(LENGTH, MASS, RADIUS)
UP, SIDE, SPEED, C = (0.02, 11.0, 0.4), (0.03, 6.0, -1.2), 2.5, 0.7
WATCHED = ("energy", "tension", "flow")
LIQUID = water(20.0)


def watched(scene: Scene, angle: float, velocity: float, after: int = 0, h: float = 0.01, **options: Any) -> Any:
    """Return the reported diagnostics after some steps."""
    machine = Machine(scene, "rk4", diagnostics=WATCHED, backend="python", **options)
    state = machine.state(angle, velocity)
    machine.advance(state, 0.7, h, after)
    return machine.info(state)


# --- tension --------------------------------------------------------------------------------------------------------

HEAVY: tuple[Effect, ...] = (Buoyancy(), AddedMass(), FiniteBob(), Suspension(0.2))
TENSE: dict[str, tuple[Effect, ...]] = {
    "plain": (),
    "motor": (Motor(0.3),),
    "losses": (LinearDrag(0.4), BearingFriction(0.01), CoulombFriction(friction_torque=0.01)),
    "heavy": HEAVY,
    "wind": (QuadraticDrag(C), Wind(SPEED)),
    "thin rod in wind": (QuadraticDrag(C), WireDrag(), Wind(SPEED)),
    "shaken": (VerticalDrive(*UP), HorizontalDrive(*SIDE)),
    "all": (*HEAVY, QuadraticDrag(C), Wind(SPEED), VerticalDrive(*UP), HorizontalDrive(*SIDE), Motor(0.3)),
}


def pull(scene: Scene, t: float, q: float, v: float) -> float:
    """Return the pull on the suspension [N] from Newton's law: mass times acceleration minus all other forces.

    Forces are components towards the pivot in the frame of the room. The fluid carried along is accelerated with the
    bob; drag acts against the velocity relative to the air.
    """
    names = {effect.name for effect in scene.effects}
    volume = 4.0 / 3.0 * math.pi * RADIUS**3
    carried = 0.5 * scene.medium.density * volume if "added_mass" in names else 0.0
    lift = scene.medium.density * volume * 9.81 if "buoyancy" in names else 0.0
    out = np.array([math.sin(q), -math.cos(q)])
    path = np.array([math.cos(q), math.sin(q)])
    (b, w, p), (c, r, f) = UP, SIDE
    shaken = float("vertical_drive" in names)
    pivot = shaken * np.array([-c * r * math.sin(r * t + f), -b * w * math.sin(w * t + p)])
    jolt = shaken * np.array([-c * r * r * math.cos(r * t + f), -b * w * w * math.cos(w * t + p)])
    wind = np.array([SPEED if "wind" in names else 0.0, 0.0])
    along = (jolt - LENGTH * v * v * out) @ out
    force = np.array([0.0, lift - MASS * 9.81])
    if "quadratic_drag" in names:
        u = pivot + LENGTH * v * path - wind
        force = force - C * scene.inertia / LENGTH**3 * np.hypot(*u) * u
    return float(force @ out - (MASS + carried) * along)


@pytest.mark.parametrize("effects", TENSE)
def test_the_tension_is_newtons(effects: str) -> None:
    scene = Scene(body=BODY, medium=LIQUID, effects=(Gravity(), *TENSE[effects]), gravity=9.81)
    for q, v in ((0.0, 0.0), (0.7, -3.0), (-2.9, 0.0), (3.1, 12.0)):
        for after in (0, 7):
            info = watched(scene, q, v, after)
            wanted = pull(scene, info["time"], info["angle"], info["velocity"])
            assert info["tension"] == pytest.approx(wanted, rel=1e-12, abs=1e-12)


def test_the_tension_of_small_angles_is_weight_and_centrifugal_force() -> None:
    """Check that the tension of the small-angle scene is weight plus centrifugal force, with cos(theta) = 1."""
    info = watched(Scene(body=BODY, effects=(SmallAngleGravity(),), gravity=9.81), 0.1, 0.3)
    assert info["tension"] == pytest.approx(MASS * (9.81 + LENGTH * 0.3**2), rel=1e-14)


def test_the_tension_needs_no_gravity() -> None:
    info = watched(Scene(body=BODY, gravity=0.0), 1.0, -3.0)
    assert info["tension"] == pytest.approx(MASS * LENGTH * 9.0, rel=1e-14)


# --- slack ----------------------------------------------------------------------------------------------------------

WIRE = Scene(body=Body(LENGTH, MASS, RADIUS, suspension="wire"), effects=(Gravity(),), gravity=9.81)
OMEGA = math.sqrt(9.81 / LENGTH)


@pytest.mark.quick("1.0-1.8", "-1.0-2.1")
@pytest.mark.parametrize("share", [1.5, 1.8, 2.1])
@pytest.mark.parametrize("velocity", [1.0, -1.0])
def test_a_wire_goes_slack_where_it_should(share: float, velocity: float) -> None:
    """Check that a wire in a vertical circle, launched at share omega0, goes slack at 3 cos(theta) = 2 - share².

    A single run ends there; a batch has no records after it.
    """
    h = 1e-3
    wanted = math.acos((2.0 - share**2) / 3.0)
    time = slack_time(share)
    for shape in ((), (2,)):
        r = rollout(WIRE, angle=np.zeros(shape), velocity=velocity * share * OMEGA, dt=h, duration=1.0,
                    backend="python", diagnostics=("energy", "tension"))
        turned, slack = np.abs(np.asarray(r.angle)), np.asarray(r.watched["tension"])
        assert set(np.atleast_1d(r.stop_reason)) == {"slack"}
        last = int(np.flatnonzero(np.isfinite(turned.reshape(-1, turned.shape[-1])[0]))[-1])
        one, pulls = turned.reshape(-1, turned.shape[-1])[0], slack.reshape(-1, slack.shape[-1])[0]
        assert np.asarray(r.stop_time) == pytest.approx(time, abs=1e-11)
        assert np.all(pulls[:last] > 0.0)
        if shape:
            assert h * last < time < h * (last + 1)
            assert pulls[last] > 0.0
        else:
            assert r.time[-1] == r.stop_time
            assert one[last] == pytest.approx(wanted, abs=2e-11)
            assert pulls[last] == pytest.approx(0.0, abs=1e-12)
            assert abs(r.energy_residual[-1]) < 1e-10


def test_slower_and_faster_bobs_keep_the_wire_tight() -> None:
    """Check that a wire stays tight if the bob never rises above the horizontal, and if it makes full turns."""
    for share in (1.41, 2.24):
        assert rollout(WIRE, angle=0.0, velocity=share * OMEGA, dt=1e-3, duration=3.0,
                       backend="python").stop_reason == ""
    for share in (1.42, 2.23):
        assert rollout(WIRE, angle=0.0, velocity=share * OMEGA, dt=1e-3, duration=3.0,
                       backend="python").stop_reason == "slack"


def slack_time(share: float) -> float:
    """Return the time at which a launch at share omega0 from the bottom reaches 3 cos(theta) = 2 - share² [s].

    For a launch faster than 2 omega0 it is ``2/v0 F(theta/2, (2 omega0/v0)²)``, the elliptic integral of scipy; for a
    slower one ``F(asin(sin(theta/2)/k), k²)/omega0`` with k = v0/(2 omega0).
    """
    angle, k = math.acos((2.0 - share**2) / 3.0), 0.5 * share
    if k < 1.0:
        return float(ellipkinc(math.asin(math.sin(0.5 * angle) / k), k * k) / OMEGA)
    return float(2.0 / (share * OMEGA) * ellipkinc(0.5 * angle, 1.0 / (k * k)))


@pytest.mark.quick("0.05-1e-06")
@pytest.mark.parametrize(("h", "missing"), [(0.01, 3e-5), (0.01, 1e-7), (0.05, 1e-3), (0.05, 1e-6)])
def test_slack_between_steps_ends_the_run_at_its_time(h: float, missing: float) -> None:
    """Check that a wire is slack if the launch misses sqrt(5) omega0, that of a full circle, by ever so little.

    Its pull is then below zero for less than a step. Truths: time and angle in closed form; methods of high order are
    as near as their own errors, the exact one down to rounding.
    """
    share = math.sqrt(5.0) * (1.0 - missing)
    wanted, angle = slack_time(share), math.acos((2.0 - share**2) / 3.0)
    enough = math.sqrt(5.0) * (1.0 + missing)
    for options, error in (({"integrator": "dop853"}, 2e-8), ({"integrator": "gauss6", "compensated": True}, 1e-5),
                           ({"integrator": "exact"}, 2e-11), ({"integrator": "dop853", "rtol": 1e-11}, 2e-9)):
        for shape in ((), (2,)) if "rtol" not in options else ((),):
            run = partial(rollout, WIRE, angle=np.zeros(shape), dt=h, duration=1.0, backend="python", **options)
            r = run(velocity=share * OMEGA)
            assert set(np.atleast_1d(r.stop_reason)) == {"slack"}
            (stop,) = {*np.atleast_1d(r.stop_time).tolist()}
            assert stop == pytest.approx(wanted, abs=error)
            if not shape:
                assert r.angle[-1] == pytest.approx(angle, abs=6.0 * error)
                assert r.time[-1] == stop
            assert set(np.atleast_1d(run(velocity=enough * OMEGA).stop_reason)) == {""}


def test_slack_between_adaptive_steps_is_found_in_one_control_step() -> None:
    """Check that adaptive steps within one long control step are examined one by one."""
    for share, reason in ((0.999, "slack"), (1.001, "")):
        r = rollout(WIRE, integrator="dop853", angle=0.0, velocity=share * math.sqrt(5.0) * OMEGA, dt=2.0, duration=2.0,
                    rtol=1e-10, backend="python")
        assert r.stop_reason == reason


@pytest.mark.parametrize("options", [{}, {"compensated": True}, {"integrator": "ab3"}, {"estimate_error": True},
                                     {"integrator": "dop853", "rtol": 1e-9}], ids=str)
def test_a_start_with_a_slack_wire_ends_at_once(options: dict[str, Any]) -> None:
    """Check that no step is taken where the pull, L v² + g cos(theta), is negative at the start."""
    least = math.sqrt(-math.cos(2.0)) * OMEGA
    for angle, velocity, time in ((2.0, 0.0, 0.0), (2.0, 0.999 * least, 0.0), (2.0, 1.001 * least, 9e-5),
                                  (0.5 * math.pi, 0.0, 1e-3), (-0.5 * math.pi, 0.0, 1e-3)):
        for shape in ((), (2,)) if "rtol" not in options else ((),):
            r = rollout(WIRE, angle=np.full(shape, angle), velocity=velocity, dt=1e-4, duration=1e-3, backend="python",
                        **options)
            assert set(np.atleast_1d(r.stop_reason)) == {"" if time == 1e-3 else "slack"}
            assert (np.atleast_1d(r.stop_time) >= time - 1e-12).all()
            if not time:
                seen = np.reshape(r.angle, (-1, np.shape(r.angle)[-1]))[0]
                assert np.count_nonzero(np.isfinite(seen)) == 1
                assert np.all(np.asarray(r.stop_time) == 0.0)


@pytest.mark.parametrize("size", [0, 2])
def test_an_episode_with_a_slack_wire_ends_at_once(size: int) -> None:
    keywords: dict[str, Any] = {"scene": WIRE, "task": "free", "backend": "python"}
    env = gym.make_vec("LabPendulum-v0", num_envs=size, **keywords) if size else gym.make("LabPendulum-v0", **keywords)
    env.reset(seed=1, options={"angle": 2.0, "velocity": 0.5})
    _, _, terminated, truncated, info = env.step(np.zeros((size, 1) if size else (1,), dtype=np.float32))
    assert np.all(terminated)
    assert not np.any(truncated)
    assert {*np.atleast_1d(info["stop_reason"]).tolist()} == {"slack"}
    assert np.all(np.asarray(info["time"]) == 0.0)
    assert np.all(np.asarray(info["velocity"]) == 0.5)


@pytest.mark.quick("0.5")
@pytest.mark.parametrize("h", [0.1, 0.5, 2.0])
def test_long_steps_find_no_slack_where_there_is_none(h: float) -> None:
    """Check that exact steps far beyond the reach of a cubic do not slacken a wire that swings below the horizontal."""
    for angle in (0.3, 1.0, 1.55):
        assert rollout(WIRE, integrator="exact", angle=angle, dt=h, duration=60.0, backend="python").stop_reason == ""


def test_wind_alone_can_slacken_a_wire() -> None:
    """Check that wind alone makes a wire slack: on the windward side it pushes a weightless bob towards the pivot."""
    scene = Scene(body=WIRE.body, medium=air(20.0), effects=(QuadraticDrag(C), Wind(SPEED)), gravity=0.0)
    assert rollout(scene, angle=-1.5, dt=0.01, duration=0.1, backend="python").stop_reason == "slack"
    assert rollout(scene, angle=1.5, dt=0.01, duration=0.1, backend="python").stop_reason == ""


def slack_by_scipy(pull: Callable[..., float], slope: Callable[..., float], angle: float, velocity: float) -> float:
    """Return the time at which ``pull(t, q, v)`` falls to zero in SciPy's solution of q'' = slope(t, q, v) [s]."""
    def zero(t: float, y: Any) -> float:
        return pull(t, *y)

    zero.terminal, zero.direction = True, -1.0  # type: ignore[attr-defined]
    found = solve_ivp(lambda t, y: (y[1], slope(t, *y)), (0.0, 5.0), (angle, velocity), method="DOP853", rtol=1e-12,
                      atol=1e-13, events=zero, max_step=0.01)
    return float(found.t_events[0][0])


@pytest.mark.quick("{'rtol': 1e-11}")
@pytest.mark.parametrize("options", [{}, {"rtol": 1e-11}], ids=str)
def test_other_radial_forces_slacken_a_wire_at_their_time(options: dict[str, Any]) -> None:
    """Check the time of slack under drag, and on a shaken pivot: T = m (L v² + (g - b W² cos(W t)) cos(theta))."""
    sway, rate, gamma = 0.005, 40.0, 0.4
    pivot = WIRE.with_effects((Gravity(), VerticalDrive(sway, rate)))
    dragged = WIRE.with_effects((Gravity(), LinearDrag(gamma)))

    def weight(t: float) -> float:
        return OMEGA**2 - sway * rate**2 * math.cos(rate * t) / LENGTH

    for scene, velocity, wanted in (
        (pivot, 1.9 * OMEGA, slack_by_scipy(lambda t, q, v: v * v + weight(t) * math.cos(q),
                                    lambda t, q, v: -weight(t) * math.sin(q), 0.3, 1.9 * OMEGA)),
        (dragged, 2.2 * OMEGA, slack_by_scipy(lambda t, q, v: v * v + OMEGA**2 * math.cos(q),
                                              lambda t, q, v: -OMEGA**2 * math.sin(q) - gamma * v, 0.3, 2.2 * OMEGA)),
    ):
        for shape in ((), (2,)) if not options else ((),):
            r = rollout(scene, integrator="dop853", angle=np.full(shape, 0.3), velocity=velocity, dt=0.01, duration=5.0,
                        backend="python", **options)
            assert set(np.atleast_1d(r.stop_reason)) == {"slack"}
            assert np.asarray(r.stop_time) == pytest.approx(wanted, abs=1e-8)
            assert np.nanmax(np.abs(r.energy_residual)) < 1e-8


def test_small_angles_never_slacken_a_wire_and_are_not_asked() -> None:
    """Check that the program of small angles has no test for a slack wire, since its wire never goes slack."""
    machine = Machine(SCENES["exercise"], "rk4", backend="python")
    state = machine.state(3.0, 0.0)
    assert machine.advance(state, 0.0, 0.01, 100) == 0
    assert "tension" not in machine.run.__globals__


LENIENT = WIRE.replace(slack="warn")
LOOPING = {"angle": 0.0, "velocity": 1.8 * OMEGA}
SLACKENS = "goes slack at .* s; the run continues as if the bob hung on a rod"


def test_a_lenient_wire_warns_once_and_pushes_like_a_rod() -> None:
    rod = rollout(WIRE.replace(suspension="rod"), **LOOPING, dt=0.01, duration=3.0, backend="python")
    for angle in (0.0, [0.0, 0.01]):
        stops = np.min(rollout(WIRE, angle=angle, velocity=1.8 * OMEGA, dt=0.01, duration=3.0,
                               backend="python").stop_time)
        with pytest.warns(UserWarning, match=SLACKENS) as caught:
            r = rollout(LENIENT, angle=angle, velocity=1.8 * OMEGA, dt=0.01, duration=3.0, backend="python")
        assert len(caught) == 1
        assert f"at {stops:g} s" in str(caught[0].message)
        assert caught[0].filename == __file__
        assert np.array_equal(np.reshape(r.angle, (-1, 301))[0], rod.angle)
        assert set(np.atleast_1d(r.stop_reason)) == {""}


@pytest.mark.parametrize("options", [{}, {"compensated": True}, {"integrator": "ab3"},
                                     {"integrator": "dop853", "rtol": 1e-9}], ids=str)
def test_a_lenient_wire_that_is_slack_at_the_start_warns_of_zero_seconds(options: dict[str, Any]) -> None:
    with pytest.warns(UserWarning, match="goes slack at 0 s"):
        rollout(LENIENT, angle=2.0, velocity=0.0, dt=0.01, duration=0.1, backend="python", **options)


@pytest.mark.parametrize("options", [{"integrator": "ab4"}, {"integrator": "dop853", "rtol": 1e-12}], ids=str)
def test_a_lenient_wire_tells_the_time_of_slack(options: dict[str, Any]) -> None:
    with pytest.warns(UserWarning, match=f"goes slack at {slack_time(1.8):g} s"):
        rollout(LENIENT, **LOOPING, dt=1e-3, duration=1.0, backend="python", **options)


@pytest.mark.parametrize("size", [0, 2])
def test_an_episode_ends_at_the_time_of_slack(size: int) -> None:
    """Check time and angle of the last info of an episode, in closed form, and that its state can be restored."""
    keywords: dict[str, Any] = {"scene": WIRE, "task": "free", "backend": "python", "integrator": "dop853", "dt": 0.05}
    env = gym.make_vec("LabPendulum-v0", num_envs=size, **keywords) if size else gym.make("LabPendulum-v0", **keywords)
    env.reset(seed=1, options={"angle": 0.0, "velocity": 2.1 * OMEGA})
    action = np.zeros((size, 1) if size else (1,), dtype=np.float32)
    ended: Any = False
    while not np.any(ended):
        _, _, ended, _, info = env.step(action)
    assert np.all(np.asarray(info["time"]) == pytest.approx(slack_time(2.1), abs=1e-10))
    assert np.all(np.asarray(info["angle"]) == pytest.approx(math.acos((2.0 - 2.1**2) / 3.0), abs=1e-9))
    if not size:
        env.unwrapped.set_state(env.unwrapped.get_state())  # type: ignore[attr-defined]


def test_the_quick_look_at_a_step_overlooks_no_slack() -> None:
    """Check on random steps that ``taut`` is true only if the pull is above zero all along SciPy's cubic.

    It is also true of all steps of a swing below the horizontal and of a full circle, which then cost no cosine.
    """
    machine = Machine(WIRE, "exact", backend="python")
    names = machine.run.__globals__ if "taut" in machine.run.__globals__ else machine.entry.__globals__
    look, random, h = names["taut"], np.random.default_rng(5), 0.05
    gravity, swing, weight = OMEGA**2, 1.0, OMEGA**2
    seen = 0
    for q, v, turn, v1 in random.uniform((-3.0, -20.0, -0.5, -20.0), (3.0, 20.0, 0.5, 20.0), (4000, 4)):
        if look(0.0, q, v, q + turn, v1, h, gravity, 1.0, swing, weight):
            seen += 1
            curve = CubicHermiteSpline([0.0, h], [q, q + turn], [v, v1])
            times = np.linspace(0.0, h, 201)
            assert np.min(curve(times, 1) ** 2 * swing + weight * np.cos(curve(times))) > -1e-9
    assert 50 < seen < 3950
    calls: list[float] = []
    own = names["slack_after"]
    names["slack_after"] = lambda *given: calls.append(0.0) or own(*given)
    for velocity in (1.3 * OMEGA, 2.4 * OMEGA):
        machine.advance(machine.state(0.0, velocity), 0.0, 0.01, 300)
    names["slack_after"] = own
    assert not calls


def test_the_quick_look_takes_the_cubics_state_in_the_middle_of_a_step() -> None:
    """Check ``taut`` in a scene with a shaken pivot on random steps: the pull at three places that SciPy's cubic gives.

    These are the ends of the step, and the least value of the parabola through the pulls there and in the middle.
    """
    machine = Machine(WIRE.with_effects((Gravity(), VerticalDrive(*UP))), "rk4", backend="python")
    names = machine.run.__globals__ if "taut" in machine.run.__globals__ else machine.entry.__globals__
    look, tension, random, h = names["taut"], names["tension"], np.random.default_rng(8), 0.05
    values = {**machine.scene.coefficients, "side": 1.0, "swing_pull": 1.0, "gravity_pull": OMEGA**2}
    more = [values[name] for name in list(signature(look).parameters)[6:]]
    found = []
    for q, v, turn, v1 in random.uniform((-3.0, -9.0, -0.4, -9.0), (3.0, 9.0, 0.4, 9.0), (1500, 4)):
        curve = CubicHermiteSpline([0.0, h], [q, q + turn], [v, v1])

        def pull(part: float, curve: Any = curve) -> float:
            return float(tension(part * h, float(curve(part * h)), float(curve(part * h, 1)), *more))

        before, middle, last = pull(0.0), pull(0.5), pull(1.0)
        bend = 4.0 * (before + last - 2.0 * middle)
        place = min(max((3.0 * before + last - 4.0 * middle) / bend, 0.0), 1.0) if bend > 0.0 else 0.5
        least = min(before, last, pull(place))
        found.append(least >= 0.0)
        if abs(least) > 1e-9:
            assert bool(look(0.0, q, v, q + turn, v1, h, *more)) == found[-1]
    assert 150 < sum(found) < 1350


@pytest.mark.parametrize("size", [0, 3])
def test_a_lenient_environment_warns_once(size: int) -> None:
    keywords: dict[str, Any] = {"scene": LENIENT, "task": "free", "backend": "python"}
    env = gym.make_vec("LabPendulum-v0", num_envs=size, **keywords) if size else gym.make("LabPendulum-v0", **keywords)
    action = np.zeros((size, 1) if size else (1,), dtype=np.float32)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(2):
            env.reset(seed=1, options=LOOPING)
            for _ in range(40):
                _, _, terminated, _, _ = env.step(action)
                assert not np.any(terminated)
    assert len([warning for warning in caught if "goes slack" in str(warning.message)]) == 1


# --- flow -----------------------------------------------------------------------------------------------------------

NU = 1e-4
OIL = Medium("oil", density=900.0, viscosity=900.0 * NU)


def test_the_reynolds_number_is_that_of_the_relative_velocity() -> None:
    """Check the Reynolds number 2 a |u|/nu of the velocity u relative to the air, in records and in environments."""
    still = Scene(body=BODY, medium=OIL, effects=(Gravity(), LinearDrag(0.4)))
    assert watched(still, 0.3, -2.0)["reynolds"] == pytest.approx(2.0 * LENGTH * 2.0 * RADIUS / NU, rel=1e-14)
    moved = Scene(body=BODY, medium=OIL, effects=(*still.effects, Wind(SPEED), VerticalDrive(*UP)))
    for after in (0, 7):
        info = watched(moved, 0.3, -2.0, after)
        q, v, t = info["angle"], info["velocity"], info["time"]
        b, w, p = UP
        u = (LENGTH * v * math.cos(q) - SPEED, LENGTH * v * math.sin(q) - b * w * math.sin(w * t + p))
        assert info["reynolds"] == pytest.approx(math.hypot(*u) * 2.0 * RADIUS / NU, rel=1e-13)


@pytest.mark.parametrize("phase", [0.0, 0.6, math.pi / 2.0, 4.0])
@pytest.mark.parametrize("gravity", [SmallAngleGravity(), Gravity()])
def test_the_keulegan_carpenter_number_is_that_of_the_swing(gravity: Effect, phase: float) -> None:
    """Check that the Keulegan-Carpenter number of a small swing is pi A L/a at any phase."""
    scene = Scene(body=BODY, medium=OIL, effects=(gravity,), gravity=9.81)
    size = 1e-4
    info = watched(scene, size * math.cos(phase), -size * scene.omega0 * math.sin(phase))
    assert info["keulegan_carpenter"] == pytest.approx(math.pi * size * LENGTH / RADIUS, rel=1e-8)
    assert info["keulegan_carpenter"] == pytest.approx(keulegan_carpenter(scene, size), rel=1e-8)


def scene_with(*losses: Effect, gravity: Effect | None = None) -> Scene:
    return Scene(body=BODY, medium=OIL, effects=(gravity or Gravity(), *losses), gravity=9.81)


def friction(torque: float) -> CoulombFriction:
    return CoulombFriction(friction_torque=torque)


QUALITIES: dict[str, tuple[tuple[Effect, ...], float, float, float]] = {
    "linear": ((LinearDrag(0.4),), 0.4, 0.0, 0.0),
    "bearing": ((BearingFriction(0.02),), 0.02 / (MASS * LENGTH**2), 0.0, 0.0),
    "quadratic": ((QuadraticDrag(C),), 0.0, C, 0.0),
    "dry": ((friction(0.05),), 0.0, 0.0, 0.05 / (MASS * LENGTH**2)),
    "all": ((LinearDrag(0.4), QuadraticDrag(C), friction(0.05)), 0.4, C, 0.05 / (MASS * LENGTH**2)),
}


@pytest.mark.parametrize("losses", QUALITIES)
@pytest.mark.parametrize("size", [1e-6, 0.3, 2.0])
def test_the_quality_factor_is_the_closed_form(losses: str, size: float) -> None:
    """Check the quality factor omega0/gamma, gamma = g + 8/(3 pi) c u + 4/pi tau/u, with the velocity u at the bottom.

    gamma takes the energy loss of a harmonic swing (Nelson & Olsson 1986). The midpoint rule misses 1.7e-5 of the part
    of the quadratic drag.
    """
    effects, g, c, tau = QUALITIES[losses]
    scene = scene_with(*effects)
    info = watched(scene, size, 0.0)
    u = 2.0 * OMEGA * math.sin(0.5 * size)
    quadratic = 8.0 / (3.0 * math.pi) * c * u
    wanted = OMEGA / (g + quadratic + 4.0 / math.pi * tau / u)
    assert info["quality_factor"] == pytest.approx(wanted, rel=1.7e-5 if c else 1e-13)
    phase = watched(scene, 0.0, u)["quality_factor"]
    assert phase == pytest.approx(info["quality_factor"], rel=1e-9)


@pytest.mark.parametrize("losses", [*QUALITIES, "sphere", "wire"])
def test_the_quality_factor_live_is_that_of_the_scene(losses: str) -> None:
    """Check the environments' quality factor against :func:`quality_factor` with more integration nodes."""
    own = {"sphere": (SphereDrag(),), "wire": (WireDrag(),)}
    scene = scene_with(*(own[losses] if losses in own else QUALITIES[losses][0]), gravity=SmallAngleGravity())
    for size in (1e-3, 0.5):
        assert watched(scene, size, 0.0)["quality_factor"] == pytest.approx(quality_factor(scene, size), rel=1e-4)


LIMITS: dict[str, tuple[Scene, float, float]] = {
    "vacuum": (SCENES["vacuum"], 0.0, math.inf),
    "no damping": (scene_with(), math.inf, math.inf),
    "no gravity": (Scene(body=BODY, medium=OIL, effects=(LinearDrag(0.4),), gravity=0.0), 0.0, 0.0),
    "nothing": (Scene(body=BODY, gravity=0.0), 0.0, 0.0),
    "no damping rate": (scene_with(LinearDrag(0.0)), math.inf, math.inf),
    "quadratic drag at rest": (scene_with(QuadraticDrag(C)), math.inf, math.inf),
    "dry friction at rest": (scene_with(friction(0.05)), 0.0, 0.0),
}


@pytest.mark.parametrize("name", LIMITS)
def test_flow_is_never_not_a_number(name: str) -> None:
    scene, _, wanted = LIMITS[name]
    for angle, velocity in ((0.0, 0.0), (0.0, 1e-160), (0.3, 2.0), (3.1, 40.0)):
        for backend in ("python",):
            machine = Machine(scene, "rk4", diagnostics=WATCHED, backend=backend)
            state = machine.state(angle, velocity)
            machine.advance(state, 0.0, 0.01, 2 if velocity == 2.0 else 0)
            info = machine.info(state)
            for key in ("reynolds", "keulegan_carpenter", "tension"):
                assert math.isfinite(info[key]), key
            assert not math.isnan(info["quality_factor"])
            if angle == velocity == 0.0 and wanted == math.inf:
                assert info["quality_factor"] > 1e100
            if angle == velocity == 0.0 and wanted == 0.0:
                assert info["quality_factor"] < 1e-100
    if not scene.medium.density:
        assert info["reynolds"] == 0.0


def test_flow_without_viscosity_is_refused() -> None:
    scene = Scene(body=BODY, medium=Medium("ether", density=1.0, viscosity=0.0), effects=(Gravity(),))
    with pytest.raises(SceneError, match="'flow' needs a viscosity"):
        Machine(scene, "rk4", diagnostics=("flow",), backend="python")


@pytest.mark.parametrize(("gamma", "wanted"), [
    (2.0 * OMEGA, "critically damped"), (2.0 * OMEGA * (1.0 + 1e-10), "critically damped"),
    (2.0 * OMEGA * (1.0 - 1e-8), "underdamped"), (2.0 * OMEGA * (1.0 + 1e-8), "overdamped"),
])
def test_the_regime_of_damping(gamma: float, wanted: str) -> None:
    """Check the damping regime: theta'' + gamma theta' + omega0² theta = 0 is critically damped at gamma = 2 omega0."""
    scene = scene_with(LinearDrag(gamma))
    assert regime_of_damping(quality_factor(scene, 0.3)) == wanted
    env = gym.make("LabPendulum-v0", scene=scene, diagnostics=("flow",), backend="python")
    assert env.reset(seed=1)[1]["damping_regime"] == wanted
    assert env.step(np.zeros(1, dtype=np.float32))[-1]["damping_regime"] == wanted


def test_without_flow_there_is_no_regime() -> None:
    env = gym.make("LabPendulum-v0", backend="python")
    assert "damping_regime" not in env.reset(seed=1)[1]
    many = gym.make_vec("LabPendulum-v0", num_envs=2, backend="python")
    assert "damping_regime" not in many.reset(seed=1)[1]


def test_a_vector_reports_what_its_single_environments_do() -> None:
    """Check that a vector reports the diagnostics of its single environments; in a vacuum Q is infinite."""
    scene = scene_with(LinearDrag(1.0), QuadraticDrag(C), Wind(SPEED))
    gammas, lengths = [0.5, 30.0, 2.0], [0.4, 0.4, 0.8]
    keywords: dict[str, Any] = {"scene": scene, "diagnostics": WATCHED, "backend": "python"}
    many = gym.make_vec("LabPendulum-v0", num_envs=3, gamma=gammas, length=lengths, **keywords)
    seen = [many.reset(seed=5)[1], many.step(np.zeros((3, 1), dtype=np.float32))[-1]]
    for place in range(3):
        env = gym.make("LabPendulum-v0", gamma=gammas[place], length=lengths[place], **keywords)
        own = [env.reset(seed=5 + place)[1], env.step(np.zeros(1, dtype=np.float32))[-1]]
        for info, wanted in zip(seen, own, strict=True):
            assert {name: info[name][place] for name in wanted} == wanted
            assert all(info[f"_{name}"].all() for name in wanted)
    assert seen[0]["damping_regime"].dtype == object
    assert seen[0]["damping_regime"].tolist()[:2] == ["underdamped", "overdamped"]
    some = many.reset(options={"reset_mask": np.array([True, False, True])})[1]
    assert some["damping_regime"][1] is None
    assert some["_damping_regime"].tolist() == [True, False, True]


def test_the_last_info_has_the_regime_too() -> None:
    env = gym.make_vec("LabPendulum-v0", num_envs=2, diagnostics=("flow",), backend="python", max_episode_steps=2,
                       autoreset_mode="SameStep")
    env.reset(seed=1)
    for _ in range(2):
        info = env.step(np.zeros((2, 1), dtype=np.float32))[-1]
    assert info["final_info"]["damping_regime"].tolist() == ["underdamped"] * 2


def test_a_state_with_an_infinite_quality_factor_can_be_restored() -> None:
    env = gym.make("LabPendulum-v0", scene="vacuum", diagnostics=WATCHED, backend="python").unwrapped
    env.reset(seed=1)
    saved = env.get_state()
    assert math.inf in saved["state"]
    wanted = env.step(np.zeros(1, dtype=np.float32))[-1]
    env.set_state(saved)
    assert env.step(np.zeros(1, dtype=np.float32))[-1] == wanted
    broken = {**saved, "state": [math.inf, *saved["state"][1:]]}
    with pytest.raises(SceneError, match="finite numbers"):
        env.set_state(broken)


def test_watching_does_not_touch_the_motion() -> None:
    scene = Scene(body=BODY, medium=LIQUID, effects=(Gravity(), *TENSE["all"], Gusts()), gravity=9.81)
    plain = rollout(scene, dt=0.01, duration=1.0, backend="python")
    watching = rollout(scene, dt=0.01, duration=1.0, backend="python", diagnostics=WATCHED)
    assert np.array_equal(plain.angle, watching.angle)
    assert np.array_equal(plain.energy_residual, watching.energy_residual)
    assert set(watching.watched) == {"tension", "reynolds", "keulegan_carpenter", "quality_factor"}
    assert not plain.watched
    assert regime_of_damping(math.inf) == "underdamped"


# --- a wire that catches again --------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [1.5, 1.8, 2.1])
def test_a_run_says_where_a_slack_wire_would_catch_the_bob(share: float) -> None:
    """The parabola, in steps of 10 microseconds, leaves the circle and meets it again there, at this speed."""
    run = rollout(WIRE, angle=0.0, velocity=share * OMEGA, dt=1e-3, duration=3.0, integrator="rk4", backend="python")
    found = run.flight
    assert found is not None
    length, angle, spin = WIRE.body.reach, float(run.angle[-1]), float(run.velocity[-1])
    time = np.arange(1e-3, 1.2 * found.time, 1e-5)
    x = length * (math.sin(angle) + spin * math.cos(angle) * time)
    z = length * (-math.cos(angle) + spin * math.sin(angle) * time) - 0.5 * WIRE.gravity * time**2
    far = np.hypot(x, z)
    back = int(np.argmax(far > length))
    assert time[back] == pytest.approx(found.time, abs=2e-5)
    assert math.atan2(x[back], -z[back]) == pytest.approx(found.angle, abs=1e-3)
    assert (far[back] - far[back - 1]) / 1e-5 == pytest.approx(found.speed, rel=1e-3)
    assert f"caught by the wire {found.time:.4g} s later" in run.ending


def test_other_runs_have_no_flight() -> None:
    whole = rollout(WIRE, angle=0.1, velocity=0.0, dt=1e-3, duration=0.1, backend="python")
    assert (whole.flight, whole.ending) == (None, "")
