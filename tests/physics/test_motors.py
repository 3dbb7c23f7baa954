"""Tests of the motor's options: its torque at a speed, and the control that reaches it.

The truth of the torque is the circuit of a DC motor, ``i = (V - k w)/R`` and torque = k i, integrated by SciPy, and
closed forms. That of the control is written here a second time, with NumPy.
"""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from functools import lru_cache, partial
from itertools import product
from pathlib import Path
from typing import Any

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from effect_checks import SPEEDS, bound, close, slope
from given_effects import Blow
from in_node import Case, differing, needs_node
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import integrators
from pendulum_env import SCENES, Scene, SceneError, code, rollout
from pendulum_env.controllers import SwingUp
from pendulum_env.engine.each import Each
from pendulum_env.engine.generate import batch_program, program
from pendulum_env.engine.machine import VELOCITY, Machine, fitting
from pendulum_env.physics.body import Body
from pendulum_env.physics.effects import BearingFriction, CoulombFriction, Gravity, LinearDrag, Motor
from pendulum_env.physics.flow import damping_rate, quality_factor
from pendulum_env.physics.medium import air
from pendulum_env.tasks import TASKS
from pendulum_env.truth.reference import reference, true_motion

# A geared DC motor: torque constant, resistance and supply; at the shaft it stalls at 0.36 N m and idles at 5 rad/s.
CONSTANT, RESISTANCE, SUPPLY = 0.6, 5.0, 3.0
STALL, NO_LOAD = CONSTANT * SUPPLY / RESISTANCE, SUPPLY / CONSTANT
LIMIT = 0.4
"""Limit of the controlled current [A]."""
LENGTH, MASS, GRAVITY, GAMMA = 0.5, 0.1, 9.81, 0.3
INERTIA = MASS * LENGTH**2
BODY = Body(length=LENGTH, mass=MASS)
START, DURATION = (0.4, -2.0), 2.0

VOLTAGE = Motor(STALL, control_sets="voltage", no_load_speed=NO_LOAD)
SUPPLIED = Motor(CONSTANT * LIMIT, no_load_speed=NO_LOAD, stall_torque=STALL)
LINE = Motor(STALL, no_load_speed=NO_LOAD)
LAWS = {"voltage": VOLTAGE, "supplied": SUPPLIED, "line": LINE}
MOST = {"supplied": LIMIT, "line": SUPPLY / RESISTANCE}
"""Current at full control, where a current is controlled [A]."""


def current(law: str, share: float, velocity: float) -> float:
    """Return the current of the motor [A] at a share of control and a velocity [rad/s], from its circuit."""
    back = CONSTANT * velocity
    if law == "voltage":
        return (share * SUPPLY - back) / RESISTANCE
    least, most = (-SUPPLY - back) / RESISTANCE, (SUPPLY - back) / RESISTANCE
    return min(max(share * MOST[law], least), most)


def scene_with(motor: Motor, *more: Any, gravity: float = GRAVITY) -> Scene:
    """Return a pendulum with a motor: under gravity with linear drag, or free without either."""
    rest = (Gravity(), LinearDrag(gamma=GAMMA)) if gravity else ()
    return Scene("motor", BODY, air(), (*rest, *more, motor), gravity)


@lru_cache
def truth(law: str, share: float) -> dict[str, float]:
    """Return final motion, work of the shaft, heat of the drag and the circuit's energies [J] by DOP853 at 1e-12."""

    def slopes(t: float, y: Any) -> list[float]:
        i = current(law, share, y[1])
        torque = CONSTANT * i - MASS * GRAVITY * LENGTH * math.sin(y[0]) - GAMMA * INERTIA * y[1]
        volts = CONSTANT * y[1] + RESISTANCE * i
        return [y[1], torque / INERTIA, CONSTANT * i * y[1], GAMMA * INERTIA * y[1] ** 2, volts * i,
                RESISTANCE * i * i]

    run = solve_ivp(slopes, (0.0, DURATION), [*START, 0.0, 0.0, 0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-14,
                    max_step=0.01)
    return dict(zip(("angle", "velocity", "work", "heat", "supplied", "winding"), run.y[:, -1].tolist(), strict=True))


# --- the torque at a speed ------------------------------------------------------------------------------------------

KINKED = {("supplied", 1.0), ("supplied", -0.7), ("line", 1.0), ("line", -0.7)}
"""Laws and shares at which the supply limits the torque during a part of the run."""


def run_of(law: str, share: float, method: str, h: float) -> Any:
    return rollout(scene_with(LAWS[law]), integrator=method, angle=START[0], velocity=START[1], dt=h,
                   duration=DURATION, control=share, backend="python", warn=False)


@pytest.mark.parametrize("method", ["symplectic_euler", "conformal_symplectic_euler", "velocity_verlet", "rk4",
                                    "implicit_midpoint", "abm4", "gauss4", "dopri5"])
@pytest.mark.parametrize("share", [1.0, -0.7, 0.0])
@pytest.mark.parametrize("law", LAWS)
def test_motion_work_and_heat_are_those_of_the_circuit(law: str, share: float, method: str) -> None:
    """Compare motion, work and heat, each by itself, with SciPy's solution of the motor's circuit.

    The kink where the supply begins to limit the torque costs digits of the motion, but none of the ledger's balance.
    """
    wanted, h = truth(law, share), 0.005
    order = integrators.get(method).order
    smooth = 6.0 * (0.6 * math.sqrt(GRAVITY / LENGTH) * h) ** order + 1e-9
    error = smooth + (1e-5 if (law, share) in KINKED else 0.0)
    run = run_of(law, share, method, h)
    assert abs(run.angle[-1] - wanted["angle"]) < error
    assert abs(run.velocity[-1] - wanted["velocity"]) < 5.0 * error
    energy = MASS * GRAVITY * LENGTH
    assert abs(run.ledger.work[-1] - wanted["work"]) < 5.0 * energy * error
    assert abs(run.ledger.heat[-1] - wanted["heat"]) < 5.0 * energy * error
    assert abs(run.energy_residual).max() < 5.0 * energy * smooth


@pytest.mark.quick("supplied")
@pytest.mark.parametrize("law", LAWS)
def test_the_supply_pays_for_the_work_and_the_heat_of_the_winding(law: str) -> None:
    """Check that the ledger's work is the energy from the supply less the heat of the winding, which is not in it."""
    wanted = truth(law, 1.0)
    assert wanted["winding"] > 0.05 * abs(wanted["work"])
    run = run_of(law, 1.0, "dop853", 0.0005)
    assert run.ledger.work[-1] == pytest.approx(wanted["supplied"] - wanted["winding"], abs=1e-6)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("method", ["velocity_verlet", "forest_ruth", "rk4", "gauss4"])
def test_the_order_of_a_method_is_kept_where_the_torque_is_smooth(law: str, method: str) -> None:
    """Halve the step with a share of 0.25, at which the supply is never short: the errors shrink at the order."""
    wanted, order = truth(law, 0.25), integrators.get(method).order
    errors = [math.hypot(run.angle[-1] - wanted["angle"], run.velocity[-1] - wanted["velocity"])
              for run in (run_of(law, 0.25, method, h) for h in (0.02, 0.01))]
    assert math.log2(errors[0] / errors[1]) > order - 0.35


@pytest.mark.parametrize("share", [1.0, -0.5])
@pytest.mark.parametrize("method", ["rk4", "gauss4", "taylor8", "velocity_verlet"])
def test_a_free_dc_motor_spins_up_exponentially(method: str, share: float) -> None:
    """Check velocity = share w0 (1 - exp(-t/tm)) with tm = I w0/M, the mechanical time constant."""
    time, run = INERTIA * NO_LOAD / STALL, rollout(
        scene_with(VOLTAGE, gravity=0.0), integrator=method, angle=0.0, velocity=0.0, dt=0.01, duration=2.0,
        control=share, backend="python")
    wanted = -share * NO_LOAD * np.expm1(-run.time / time)
    assert np.abs(run.velocity - wanted).max() < {"velocity_verlet": 5e-3, "rk4": 1e-6}.get(method, 1e-8)


@pytest.mark.parametrize("method", ["rk4", "gauss4", "velocity_verlet", "backward_euler", "bdf3"])
def test_a_current_limit_then_the_supply_limit_a_free_motor(method: str) -> None:
    """Check a spin-up at constant torque M up to the speed w0 (S - M)/S, and exponentially to w0 from there."""
    most = CONSTANT * LIMIT
    corner, time = NO_LOAD * (STALL - most) / STALL, INERTIA * NO_LOAD / STALL
    until = corner * INERTIA / most
    h = until / 8
    run = rollout(scene_with(SUPPLIED, gravity=0.0), integrator=method, angle=0.0, velocity=0.0, dt=h,
                  duration=160 * h, control=1.0, backend="python", warn=False)
    early = np.arange(161) <= 8
    wanted = np.where(early, most / INERTIA * run.time,
                      NO_LOAD - (NO_LOAD - corner) * np.exp(-(run.time - until) / time))
    allowed = {"rk4": 1e-6, "gauss4": 1e-7, "velocity_verlet": 0.01, "bdf3": 0.02, "backward_euler": 0.15}[method]
    assert np.abs(run.velocity - wanted)[early].max() < (1e-12 if method != "backward_euler" else 1e-9)
    assert np.abs(run.velocity - wanted).max() < allowed
    assert run.velocity[-1] == pytest.approx(NO_LOAD, rel=0.01)
    assert run.ledger.work[-1] == pytest.approx(0.5 * INERTIA * run.velocity[-1] ** 2, rel=0.05)


def test_torques_follow_the_line() -> None:
    """Check points of the line: stall, half speed, no load, beyond it, and against the motion."""
    for law, share, speed in product(LAWS, (-1.0, 0.3, 1.0), (-7.0, -2.5, 0.0, 2.5, NO_LOAD, 7.0)):
        motor = LAWS[law]
        values = scene_with(motor, gravity=0.0).coefficients
        torque = bound(motor.torque, scene_with(motor, gravity=0.0))(0, speed, share)  # type: ignore[arg-type]
        assert float(torque) * INERTIA == pytest.approx(CONSTANT * current(law, share, speed), abs=1e-15), values
    free = scene_with(LINE, gravity=0.0)
    assert [round(float(bound(LINE.torque, free)(0, v, 1.0)) * INERTIA / STALL, 12)  # type: ignore[arg-type]
            for v in (-NO_LOAD, 0.0, 0.5 * NO_LOAD, NO_LOAD, 1.5 * NO_LOAD)] == [1.0, 1.0, 0.5, 0.0, -0.5]


@pytest.mark.quick("supplied")
@pytest.mark.parametrize("law", LAWS)
def test_functions_of_the_torque_belong_together(law: str) -> None:
    """The slope by velocity is that of the torque, and the flow solves dv/dt = torque - torque at rest."""
    motor = LAWS[law]
    scene = scene_with(motor, gravity=0.0)
    torque, by_velocity, flow = (bound(f, scene) for f in (
        motor.torque, motor.by_velocity, motor.flow))  # type: ignore[arg-type]
    with mpmath.workdps(40):
        for v, share in product(SPEEDS, (-1.0, 0.0, 0.4)):
            given = {"control": share}
            assert close(by_velocity(0, v, **given), slope(partial(torque, 0, **given), v))

            def rest(t: Any, y: Any, share: float = share) -> Any:
                return [float(torque(0, y[0], share) - torque(0, 0, share))]

            if abs(v) > 50.0:
                continue
            for time in (0.02, 0.5):
                end = flow(0, v, share, time)
                run = solve_ivp(rest, (0.0, time), [v], "DOP853", rtol=1e-11, atol=1e-12)
                assert float(end) == pytest.approx(run.y[0, -1], abs=1e-8)
                assert close(flow(0, flow(0, v, share, time / 2), share, time / 2), end)
                assert close(flow(0, end, share, -time), v, 100)
            assert flow(0, v, share, 0) == v
        assert flow(0, 0, 0.4, 1.0) == 0


@pytest.mark.parametrize("law", LAWS)
def test_a_motor_that_follows_is_the_same_motor(law: str) -> None:
    """Check that all functions return the bits of a control for an equal share of a lagging motor."""
    motor, other = LAWS[law], replace(LAWS[law], lag=0.1)
    lagging = Scene("lagging", BODY, effects=(other,))
    for role in ("torque", "by_velocity", "flow"):
        one, two = getattr(motor, role), getattr(other, role)
        names = one.__code__.co_varnames[:one.__code__.co_argcount]
        more = two.__code__.co_varnames[:two.__code__.co_argcount]
        assert [name.replace("motor_share", "control") for name in more] == list(names)
        for v, share in product(SPEEDS, (-1.0, 0.3)):
            known = {"velocity": v, "control": share, "motor_share": share, "duration": 0.01, **lagging.coefficients}
            assert one(*(known[name] for name in names)) == two(*(known[name] for name in more))


def test_where_the_supply_suffices_the_line_changes_no_bit() -> None:
    plain, rest = Motor(0.02), {"angle": 0.3, "velocity": 0.0, "dt": 0.01, "duration": 1.0, "control": 0.5}
    runs = [rollout(scene_with(motor), backend="python", **rest)
            for motor in (plain, Motor(0.02, no_load_speed=50.0, stall_torque=0.1))]
    assert np.array_equal(runs[0].angle, runs[1].angle)
    assert np.array_equal(runs[0].ledger.work, runs[1].ledger.work)


def test_dry_friction_holds_against_a_motor_that_is_too_weak() -> None:
    """A bob at rest feels no back-EMF: it stays, makes no work and no heat, also with a splitting method."""
    for law, method in product(LAWS, ("velocity_verlet", "rk4")):
        friction = CoulombFriction(friction_torque=1.1 * STALL)
        scene = scene_with(LAWS[law], friction, gravity=0.0)
        run = rollout(scene, integrator=method, angle=0.3, velocity=0.0, control=0.9, duration=0.2, backend="python")
        assert not run.velocity.any()
        assert not run.ledger.work.any()
        assert not run.ledger.heat.any()


def test_methods_that_need_more_say_what() -> None:
    """A series needs a torque without a kink; methods for forces without velocity take no back-EMF."""
    assert "taylor" in fitting(scene_with(VOLTAGE))
    with pytest.raises(integrators.MethodError, match="The torque of motor has no Taylor series"):
        Machine(scene_with(SUPPLIED), "taylor8")
    for law in LAWS.values():
        assert "velocity_verlet" in fitting(scene_with(law))
        with pytest.raises(integrators.MethodError, match="forces free of the velocity"):
            Machine(scene_with(law), "chin4a")


def test_a_drive_of_the_velocity_without_a_flow_does_not_fit_splitting_methods() -> None:
    scene = Scene("blow", BODY, effects=(Gravity(), Blow()))
    assert "rk4" in fitting(scene)
    with pytest.raises(integrators.MethodError, match="velocity_verlet needs forces free of the velocity"):
        Machine(scene, "velocity_verlet")


@pytest.mark.slow
def test_a_motor_that_brakes_counts_as_damping() -> None:
    """A DC motor without control brakes as a bearing of M/w0: the same quality factor, step limits and swings.

    Closed forms without damping do not serve such a scene.
    """
    motor = scene_with(VOLTAGE)
    bearing = scene_with(Motor(STALL), BearingFriction(bearing_viscosity=STALL / NO_LOAD))
    assert quality_factor(motor, 0.3) == pytest.approx(quality_factor(bearing, 0.3), rel=1e-12)
    assert damping_rate(motor, 1.0) == pytest.approx(damping_rate(bearing, 1.0), rel=1e-9)
    options: dict[str, Any] = {"angle": 0.5, "velocity": 0.0, "dt": 0.01, "duration": 1.0, "backend": "python",
                               "diagnostics": ("energy", "flow")}
    runs = [rollout(scene, **options) for scene in (motor, bearing)]
    assert np.allclose(runs[0].angle, runs[1].angle, rtol=0.0, atol=1e-13)
    assert np.allclose(runs[0].watched["quality_factor"], runs[1].watched["quality_factor"], rtol=1e-12)
    assert runs[0].ledger.work[-1] < 0.0
    both = [run.ledger.work[-1] - run.ledger.heat[-1] for run in runs]
    assert both[0] == pytest.approx(both[1], rel=1e-9)
    alone = Scene("alone", BODY, effects=(Gravity(), VOLTAGE))
    assert not reference(alone, 0.5, 0.0, np.array([0.5, 1.0])).closed
    times = np.linspace(0.0, 1.0, 101)
    run = solve_ivp(lambda t, y: [y[1], -GRAVITY / LENGTH * math.sin(y[0]) - STALL / NO_LOAD / INERTIA * y[1]],
                    (0.0, 1.0), [0.5, 0.0], "DOP853", t_eval=times, rtol=1e-12, atol=1e-13)
    assert np.abs(true_motion(alone, 0.5, 0.0, times).angle - run.y[0]).max() < 1e-9
    with pytest.warns(UserWarning, match="too long for rk4"):
        rollout(Scene("stiff", BODY, effects=(Gravity(), replace(VOLTAGE, no_load_speed=0.01))), angle=0.5,
                velocity=0.0, dt=0.01, duration=0.01, backend="python")


def test_a_plain_program_of_a_dc_motor_is_the_rollout() -> None:
    for law, method in (("voltage", "rk4"), ("voltage", "velocity_verlet"), ("line", "rk4")):
        scene = scene_with(LAWS[law])
        space: dict[str, Any] = {}
        exec(code(scene, method).split("figure, axes")[0].replace("import matplotlib.pyplot as plt", ""), space)
        run = rollout(scene, integrator=method, backend="python", warn=False)
        assert np.abs(np.array(space["angles"]) - run.angle).max() < 1e-12


def test_a_swing_up_reckons_with_the_brake_of_a_dc_motor() -> None:
    scene = Scene("strong", BODY, effects=(Gravity(), Motor(0.3, control_sets="voltage", no_load_speed=25.0)))
    controller = SwingUp(scene, dt=0.02)
    assert controller.model.by_velocity == pytest.approx(-0.3 / 25.0 / INERTIA, rel=1e-6)
    env = gym.make("LabPendulum-v0", scene=scene, backend="python", max_episode_steps=None)
    observation, _ = env.reset(seed=1)
    for _ in range(500):
        observation, *_, info = env.step(controller(observation))
    assert abs(math.remainder(info["angle"] - math.pi, 2.0 * math.pi)) < 0.01


# --- the control that reaches the motor -----------------------------------------------------------------------------

CONTROLS = (0.3, 1.0, 1.0, -0.2, 0.05, -1.0, -1.0, 0.0, 0.62, 0.62)
OPTIONS: dict[str, dict[str, float]] = {
    "ramp": {"ramp": 0.25}, "steps": {"control_quantum": 0.25}, "odd steps": {"control_quantum": 0.3},
    "large steps": {"control_quantum": 0.6}, "dead zone": {"dead_zone": 0.1},
    "all": {"ramp": 0.1, "control_quantum": 0.125, "dead_zone": 0.2},
    "all and lag": {"ramp": 0.1, "control_quantum": 0.125, "dead_zone": 0.2, "lag": 0.03},
}
SPAN, TORQUE = 0.05, 0.2


def shares(numbers: dict[str, float], span: float = SPAN) -> list[float]:
    """Return the share of the torque that the control asks for after each of CONTROLS, before a lag."""
    command, found = 0.0, []
    for control in CONTROLS:
        reach = span / numbers["ramp"] if "ramp" in numbers else math.inf
        command += float(np.clip(control - command, -reach, reach))
        target = command
        if quantum := numbers.get("control_quantum"):
            target = float(np.clip(quantum * np.rint(target / quantum), -1.0, 1.0))
        dead = numbers.get("dead_zone", 0.0)
        found.append(float(np.sign(target)) * max(0.0, abs(target) - dead) / (1.0 - dead))
    return found


@pytest.mark.parametrize("name", OPTIONS)
@pytest.mark.parametrize(("method", "hold"), [("rk4", 1), ("velocity_verlet", 3), ("ab3", 4)])
def test_a_free_bob_follows_the_prepared_control(name: str, method: str, hold: int) -> None:
    """Compare shares, velocity and work after every control step with sums over the control steps.

    With a lag the share solves lag share' = target - share, and the velocity is its integral, by SciPy.
    """
    numbers = OPTIONS[name]
    machine = Machine(scene_with(Motor(TORQUE, **numbers), gravity=0.0), method, backend="python", hold=hold)
    state, speed, share, lag = machine.state(0.1, 0.0), 0.0, 0.0, numbers.get("lag", 0.0)
    for control, target in zip(CONTROLS, shares(numbers), strict=True):
        assert machine.advance(state, control, SPAN / hold, hold) == 0
        if lag:
            run = solve_ivp(lambda t, y, target=target: [(target - y[0]) / lag, y[0]], (0.0, SPAN), [share, 0.0],
                            "DOP853", rtol=1e-12, atol=1e-14)
            share, mean = run.y[0, -1], run.y[1, -1] / SPAN
        else:
            share = mean = target
        speed += TORQUE / INERTIA * mean * SPAN
        names = ("motor_state", "motor_share")
        assert [state[machine.names.index(each)] for each in names] == pytest.approx([share, mean], abs=1e-11)
        assert state[VELOCITY] == pytest.approx(speed, abs=1e-10)


def test_levels_thresholds_and_a_ramp_in_numbers() -> None:
    """Check full control, both sides of a level and of a dead zone, and a ramp from rest to full control and back."""

    def found(controls: list[float], **numbers: float) -> list[float]:
        machine = Machine(scene_with(Motor(TORQUE, **numbers), gravity=0.0), "rk4", backend="python")
        state, rows = machine.state(0.0, 0.0), []
        for control in controls:
            machine.advance(state, control, 0.1, 1)
            rows.append(state[machine.names.index("motor_share")])
        return rows

    assert found([1.0, -1.0, 0.24, 0.26, -0.74, -0.76], control_quantum=0.5) == [1.0, -1.0, 0.0, 0.5, -0.5, -1.0]
    assert found([1.0, 0.31, 0.29, -0.9], control_quantum=0.6) == [1.0, 0.6, 0.0, -1.0]
    assert found([1.0, -1.0, 0.2, -0.1, 0.6], dead_zone=0.2) == pytest.approx([1.0, -1.0, 0.0, 0.0, 0.5], abs=1e-15)
    assert found([1.0] * 5 + [-1.0] * 3, ramp=0.4) == pytest.approx([0.25, 0.5, 0.75, 1, 1, 0.75, 0.5, 0.25])
    assert found([0.4, 1.0], ramp=0.01) == [0.4, 1.0]


PREPARED: dict[str, Any] = {"ramp": 0.3, "control_quantum": 0.125, "dead_zone": 0.1, "lag": 0.05}


@pytest.mark.parametrize("numbers", [*({name: value} for name, value in PREPARED.items()), PREPARED,
                                     {"no_load_speed": 8.0}, {"no_load_speed": 8.0, "control_sets": "voltage"}])
def test_an_option_that_is_off_is_not_in_the_program(numbers: dict[str, Any]) -> None:
    """Set options and take them back: the program of single runs and of batches is that of a motor without them."""
    plain, method, goal = SCENES["lab"], integrators.get("rk4"), TASKS["swing_up"].goal
    usual = {name: getattr(Motor(), name) for name in numbers}
    there = plain.replace(**numbers)
    back = there.replace(**usual)
    for scene, same in ((back, True), (there, False)):
        assert (program(scene, method).text == program(plain, method).text) is same
        texts = [batch_program(each, method, ("energy",), frozenset(), goal).text
                 for each in (scene, plain)]
        assert (texts[0] == texts[1]) is same
    assert "motor_command" not in program(plain.replace(lag=0.1), method).text


MOTORS: dict[str, Scene] = {
    "prepared": SCENES["lab"].replace(**PREPARED, no_load_speed=4.0),
    "supplied": SCENES["lab"].replace(no_load_speed=4.0, stall_torque=0.2),
    "voltage": SCENES["sticky_bearing"].replace(**PREPARED, no_load_speed=4.0, control_sets="voltage"),
}
"""Scenes whose motors have options of every kind."""


@pytest.mark.parametrize(("name", "method"), [
    ("prepared", "rk4"), ("supplied", "velocity_verlet"), ("voltage", "velocity_verlet"),
    *(pytest.param(name, method, marks=pytest.mark.slow) for name, method in (
        ("prepared", "yoshida6a"), ("supplied", "gauss4"), ("voltage", "rk4"))),
])
@pytest.mark.parametrize("backend", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
def test_a_batch_of_motors_has_the_bits_of_single_runs(name: str, method: str, backend: Any) -> None:
    options: dict[str, Any] = {"integrator": method, "duration": 0.6, "substeps": 2, "control": 0.83, "warn": False}
    one = rollout(MOTORS[name], angle=0.7, velocity=-3.0, backend="python", **options)
    alone = rollout(MOTORS[name], angle=0.7, velocity=-3.0, backend=backend, **options)
    several = rollout(MOTORS[name], angle=[0.1, 0.7], velocity=-3.0, backend=backend, **options)
    for quantity in ("angle", "velocity", "energy_residual"):
        assert np.array_equal(getattr(alone, quantity), getattr(one, quantity))
        assert np.array_equal(getattr(several, quantity)[1], getattr(one, quantity))


@pytest.mark.slow
@needs_node
def test_motors_have_the_same_bits_in_node(tmp_path: Path) -> None:
    cases = [Case(MOTORS["prepared"], "velocity_verlet"), Case(MOTORS["voltage"], "rk4"),
             Case(MOTORS["voltage"], "velocity_verlet", "compensated"), Case(MOTORS["supplied"], "gauss4"),
             Case(MOTORS["supplied"], "dopri5", "adaptive")]
    assert differing(cases, 100, tmp_path) == []


# --- batches --------------------------------------------------------------------------------------------------------

MIXED: dict[str, list[float]] = {
    "lag": [0.0, 0.05, 0.0, 0.2], "ramp": [0.0, 0.0, 0.3, 0.1], "control_quantum": [0.0, 0.25, 0.1, 0.0],
    "dead_zone": [0.0, 0.1, 0.0, 0.2],
}
"""Numbers of four environments, of which the first has the motor without options."""


@pytest.mark.quick("rk4-lag", "velocity_verlet-lag+ramp+control_quantum+dead_zone")
@pytest.mark.parametrize("names", [("lag",), ("ramp",), ("control_quantum", "dead_zone"), tuple(MIXED)], ids="+".join)
@pytest.mark.parametrize("method", ["rk4", "velocity_verlet"])
def test_0_and_more_may_stand_in_one_vector(names: tuple[str, ...], method: str) -> None:
    """Environment i of a vector has the bits of a single environment with its numbers, also where these are 0."""
    own = {name: MIXED[name] for name in names}
    rest: dict[str, Any] = {"integrator": method, "substeps": 2, "backend": "python", "task": "free"}
    vector = gym.make_vec("LabPendulum-v0", num_envs=4, **own, **rest)
    singles = [gym.make("LabPendulum-v0", **{name: values[i] for name, values in own.items()}, **rest)
               for i in range(4)]
    start = {"angle": 0.2, "velocity": 0.0}
    vector.reset(seed=0, options=start)
    for single in singles:
        single.reset(seed=0, options=start)
    for k in range(12):
        action = np.full((4, 1), round(math.sin(1.7 * k), 3), dtype=np.float32)
        info = vector.step(action)[-1]
        for i, single in enumerate(singles):
            alone = single.step(action[i])[-1]
            assert {name: info[name][i] for name in alone if name != "stop_reason"} == {
                name: value for name, value in alone.items() if name != "stop_reason"}
    assert len(set(info["velocity"].tolist())) > 1


def test_rollouts_of_many_lags_are_single_rollouts() -> None:
    options: dict[str, Any] = {"scene": "lab", "control": 0.9, "duration": 0.5, "backend": "python"}
    lags = [0.05, 0.0, 0.1]
    several = rollout(**options, lag=lags)
    for i, lag in enumerate(lags):
        alone = rollout(**options, lag=lag)
        assert np.array_equal(several.velocity[i], alone.velocity)
        assert np.array_equal(several.ledger.work[i], alone.ledger.work)


def test_a_vector_with_lags_of_0_has_the_program_of_a_motor_without() -> None:
    method = integrators.get("rk4")
    for lags, same in (([0.0] * 30, True), ([0.0] * 29 + [0.1], False)):
        each = Each("lab", "scene", None, {"lag": lags}, 30)
        assert (program(each.scene, method).text == program(SCENES["lab"], method).text) is same


def test_numbers_of_large_vectors_are_those_of_single_scenes() -> None:
    """Compute the numbers of 100 environments in groups, some with options of 0, and of each by itself."""
    draw, size = np.random.default_rng(3), 100
    given: dict[str, NDArray[np.float64]] = {
        "lag": draw.uniform(0.01, 0.1, size), "ramp": draw.uniform(0.1, 1.0, size),
        "dead_zone": draw.uniform(0.0, 0.3, size), "no_load_speed": draw.uniform(5.0, 9.0, size),
        "max_torque": draw.uniform(0.1, 0.2, size), "length": draw.uniform(0.3, 0.4, size),
    }
    given["lag"][::3], given["ramp"][::2], given["dead_zone"][5:50] = 0.0, 0.0, 0.0
    each = Each(SCENES["lab"].replace(no_load_speed=5.0), "scene", None, given, size)
    for i in range(size):
        scene = each.of(i)
        for name, value in scene.coefficients.items():
            assert np.broadcast_to(each.numbers[name], size)[i] == value
        motor = next(effect for effect in scene.effects if isinstance(effect, Motor))
        assert all(getattr(motor, name) == given[name][i] for name in ("lag", "ramp", "dead_zone", "max_torque"))
        assert each.numbers["motor_rise"][i] == (1.0 / given["ramp"][i] if given["ramp"][i] else 0.0)
        assert each.numbers["motor_decay"][i] == (1.0 / given["lag"][i] if given["lag"][i] else 0.0)


def test_a_mixed_scene_is_copied_and_reads_as_a_motor() -> None:
    scene = Each("lab", "scene", None, {"lag": [0.0, 0.1]}, 2).scene
    again = pickle.loads(pickle.dumps(scene))
    assert again == scene
    assert program(again, integrators.get("rk4")).text == program(scene, integrators.get("rk4")).text
    assert repr(scene) == repr(SCENES["lab"])
    assert scene.to_dict() == SCENES["lab"].to_dict()
    assert scene.equation() == SCENES["lab"].equation()


@pytest.mark.parametrize("integrator", ["rk4", "ab4"])
def test_an_episode_with_a_prepared_control_resumes_bit_for_bit(integrator: str) -> None:
    keywords: dict[str, Any] = {"scene": MOTORS["prepared"], "integrator": integrator, "substeps": 4,
                                "backend": "python"}
    env = gym.make("LabPendulum-v0", **keywords).unwrapped
    env.reset(seed=3)
    actions = [np.array([math.sin(1.7 * k)], dtype=np.float32) for k in range(9)]
    for action in actions[:3]:
        env.step(action)
    twin = gym.make("LabPendulum-v0", **keywords).unwrapped
    twin.set_state(pickle.loads(pickle.dumps(env.get_state())))
    for action in actions[3:]:
        one, other = env.step(action), twin.step(action)
        assert np.array_equal(one[0], other[0])
        assert one[1:] == other[1:]


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "dead zone of 1": ({"dead_zone": 1.0}, "dead_zone must be below 1, full control, not 1"),
    "quantum above 1": ({"control_quantum": 1.5}, "control_quantum must be at most 1"),
    "ramp below 0": ({"ramp": -0.1}, "ramp must be a finite number of at least 0"),
    "voltage alone": ({"control_sets": "voltage"}, "control_sets='voltage' needs a no_load_speed"),
    "stall alone": ({"stall_torque": 0.2}, "stall_torque needs a no_load_speed"),
    "stall below": ({"stall_torque": 0.01, "no_load_speed": 9.0}, "stall_torque must be at least max_torque, 0.05 N m"),
    "stall of a voltage": ({"stall_torque": 0.2, "no_load_speed": 9.0, "control_sets": "voltage"}, "goes with"),
    "unknown input": ({"control_sets": "voltages"}, "did you mean voltage?"),
    "no speed": ({"no_load_speed": 0.0}, "no_load_speed must be a finite number above 0"),
}


@pytest.mark.parametrize("case", WRONG)
def test_numbers_that_contradict_each_other_are_refused(case: str) -> None:
    changes, words = WRONG[case]
    with pytest.raises(SceneError) as error:
        gym.make("LabPendulum-v0", **changes)
    assert words in str(error.value)
    assert "\n" not in str(error.value)
