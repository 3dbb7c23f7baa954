"""A student's step as a method: it computes what its own loop computes, and its likeness to known methods is named.

Truths are plain loops written here, closed forms of the oscillator, and scipy's quadrature.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import mpmath
import numpy as np
import pytest
from PIL import Image
from scipy.integrate import solve_ivp

from integrators import METHODS, MethodError, analysis, from_step, solve
from integrators.families.own_step import OwnStep
from pendulum_env import SCENES, Scene, compare, cost, film, rollout
from pendulum_env.engine.kernels import EngineError
from pendulum_env.physics.effects import Gravity, LinearDrag, PeriodicTorque

pytestmark = pytest.mark.usefixtures("all_interpreted")
Step = Callable[..., Any]
THREE_LINES = """
a = acceleration(theta, omega)
omega = omega + a*dt
theta = theta + omega*dt
"""


def velocity_first(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
    omega += acceleration(theta, omega) * dt
    theta += omega * dt
    return theta, omega


def angle_first(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
    theta += omega * dt
    omega += acceleration(theta, omega) * dt
    return theta, omega


def forward_euler(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
    """Not forward Euler: the angle moves with the new velocity, which a student may not notice."""
    omega = omega + acceleration(theta, omega) * dt
    return theta + omega * dt, omega


def both_old(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
    return theta + omega * dt, omega + acceleration(theta, omega) * dt


def verlet(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
    a = acceleration(theta)
    theta = theta + omega * dt + 0.5 * a * dt**2
    return theta, omega + 0.5 * (a + acceleration(theta)) * dt


def arrays(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
    def slope(y: Any, after: Any) -> Any:
        return np.array([y[1], acceleration(y[0], y[1], after)])

    y = np.array([theta, omega])
    k1 = slope(y, 0)
    k2 = slope(y + dt / 2 * k1, dt / 2)
    k3 = slope(y + dt / 2 * k2, dt / 2)
    k4 = slope(y + dt * k3, dt)
    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def iterated(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
    new, fast = theta, omega
    for _ in range(60):
        new, fast = theta + dt * fast, omega + dt * acceleration(new, fast, dt)
    return new, fast


def wrapped(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
    omega += acceleration(theta, omega) * dt
    theta += omega * dt
    if theta > math.pi:
        theta -= 2.0 * math.pi
    return theta, omega


KNOWN: dict[str, tuple[Step | str, int, str]] = {
    "velocity first": (velocity_first, 1, "equals symplectic_euler: velocity first"),
    "the three lines": (THREE_LINES, 1, "equals symplectic_euler: velocity first"),
    "angle first": (angle_first, 1, "equals symplectic_euler_position_first without damping and drive: angle first"),
    "not what it is called": (
        forward_euler, 1, "equals symplectic_euler, not forward_euler, although it is called so: velocity first"),
    "forward Euler": (both_old, 1, "equals forward_euler: slope at the start"),
    "Verlet": (verlet, 2, "equals velocity_verlet: half kick, drift, half kick"),
    "rk4 in arrays": (arrays, 4, "equals rk4: the classical four-stage method"),
    "backward Euler by iteration": (iterated, 1, "equals backward_euler: slope at the end"),
    "with a branch": (wrapped, 1, "equals symplectic_euler: velocity first"),
}


@pytest.mark.parametrize("name", KNOWN)
def test_the_known_method_that_a_step_equals_is_named(name: str) -> None:
    step, order, words = KNOWN[name]
    method = from_step(step)
    assert method.order == order
    assert method.summary.startswith(words)
    equal = METHODS[words.split()[1].rstrip(",:")]
    assert (method.symplectic, method.symmetric) == (equal.symplectic, equal.symmetric)
    assert method.name not in METHODS
    assert f"observed order {order}.0" in method.summary


def test_a_lower_order_with_damping_or_drive_is_told() -> None:
    def careless(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
        a = acceleration(theta, omega)
        theta = theta + omega * dt + 0.5 * a * dt**2
        return theta, omega + 0.5 * (a + acceleration(theta, omega)) * dt

    advice = "in every call of acceleration, give"
    assert f"observed order 2.00; only 1.00 with damping: {advice} the velocity" in from_step(careless).summary
    assert f"only 1.00 with a drive: {advice} as third argument the time" in from_step(verlet).summary
    assert "with a drive" not in from_step(arrays).summary


# --- what it computes -----------------------------------------------------------------------------------------------


def looped(step: Step, acceleration: Callable[..., float], theta: float, omega: float, dt: float, steps: int) -> Any:
    """Return the angles of a plain loop over a step function."""
    angles = [theta]
    for n in range(steps):
        theta, omega = step(theta, omega, dt, lambda q, v=omega, after=0.0, t=n * dt: acceleration(t + after, q, v))
        angles.append(theta)
    return np.array(angles)


@pytest.mark.parametrize(("step", "backend"), [
    *((step, "python") for step in (velocity_first, angle_first, arrays, iterated)),
    pytest.param(arrays, "compiled", marks=pytest.mark.slow),
])
def test_a_rollout_is_the_student_s_own_loop(step: Step, backend: Any) -> None:
    """Of the scene only two numbers are used: omega0**2 and gamma."""
    scene = SCENES["exercise_large"]
    square, gamma = scene.omega0**2, 0.02
    truth = looped(step, lambda t, q, v: -square * math.sin(q) - gamma * v, 0.5, 0.1, 0.01, 200)
    run = rollout(scene, integrator=from_step(step), angle=0.5, velocity=0.1, dt=0.01, duration=2.0, backend=backend)
    np.testing.assert_allclose(run.angle, truth, rtol=0.0, atol=1e-12)


def test_a_sum_that_begins_with_a_number_is_recorded() -> None:
    """A factor 1 + 0.02 omega dt**2 is used twice, so that it has a line of its own."""

    def scaled(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
        fast = (omega + acceleration(theta) * dt) * (1.0 + 0.02 * omega * dt * dt) / (1.0 + 0.02 * omega * dt * dt)
        return theta + fast * dt, fast

    method = from_step(scaled)
    assert method.recorded is not None
    run = rollout("vacuum", integrator=method, angle=0.5, velocity=0.1, dt=0.01, duration=1.0)
    truth = looped(scaled, lambda t, q, v: -9.81 * math.sin(q), 0.5, 0.1, 0.01, 100)
    np.testing.assert_allclose(run.angle, truth, rtol=0.0, atol=1e-13)


def test_a_branch_is_interpreted_and_not_compiled() -> None:
    method = from_step(wrapped)
    run = rollout("lab", integrator=method, duration=0.5)
    same = rollout("lab", integrator="symplectic_euler", duration=0.5, backend="python")
    np.testing.assert_array_equal(run.angle, same.angle)
    with pytest.raises(EngineError, match="cannot be compiled; use backend='python' or 'auto'"):
        rollout("lab", integrator=method, duration=0.5, backend="compiled")
    assert "Its steps are interpreted" in method.remark
    with pytest.raises(MethodError, match="depends on its numbers"):
        analysis.stability_limit(method)


def test_a_step_that_looks_at_the_kind_of_its_numbers_is_not_recorded() -> None:
    def particular(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
        return velocity_first(theta, omega if isinstance(theta, float) else 0.0, dt, acceleration)

    assert from_step(particular).recorded is None
    assert from_step(velocity_first).recorded == ("v_end = v + acceleration(t, q, v)*h", "q_end = q + v_end*h")


@pytest.mark.parametrize(("step", "order"), [(velocity_first, 1), (arrays, 4)], ids=["order 1", "order 4"])
def test_work_and_heat_are_integrals_along_the_motion(step: Step, order: int) -> None:
    """Work is the integral of drive times omega, heat that of gamma omega**2, both times I: by scipy's DOP853."""
    drive, rate, gamma, end = 0.3, 2.0, 0.1, 2.0
    scene = Scene("driven", effects=(Gravity(), PeriodicTorque(drive_torque=drive, drive_rate=rate), LinearDrag(gamma)))

    def slopes(t: float, y: Any) -> list[float]:
        push = drive / scene.inertia * math.cos(rate * t)
        return [y[1], push - scene.omega0**2 * math.sin(y[0]) - gamma * y[1], push * y[1], gamma * y[1] ** 2]

    truth = solve_ivp(slopes, (0.0, end), [0.5, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    runs = [rollout(scene, integrator=from_step(step), angle=0.5, velocity=0.0, dt=dt, duration=end)
            for dt in (0.02, 0.01)]
    long, short = ([abs(run.ledger.work[-1] - scene.inertia * truth[2]), abs(run.ledger.heat[-1]
                    - scene.inertia * truth[3]), np.max(np.abs(run.energy_residual))] for run in runs)
    assert max(short) < (0.02 if order == 1 else 5e-9)
    for before, after in zip(long[:2], short[:2], strict=True):
        assert math.log2(before / after) > order - 0.4, (long, short)


def test_numbers_of_forty_digits_go_through_it() -> None:
    """For x'' = -x the step matrix of rk4 is the truncated exponential (Hairer, Norsett & Wanner 1993, II.1)."""
    method = from_step(arrays)
    with mpmath.workdps(40):
        h = mpmath.mpf(1) / 8
        end = solve(lambda t, q, v: -q, mpmath.mpf(1), mpmath.mpf(0), [0, h], method=method, h=h)
        assert abs(end.q[-1] - (1 - h**2 / 2 + h**4 / 24)) < mpmath.mpf(10) ** -38
    assert analysis.observed_order(method) == pytest.approx(4.0, abs=0.1)
    assert analysis.stability_limit(method) == pytest.approx(2.0 * math.sqrt(2.0), rel=1e-12)
    assert analysis.leading_error(from_step(verlet)).text == analysis.leading_error("velocity_verlet").text


# --- beside our methods ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_compare_cost_and_environments_take_it() -> None:
    own = from_step(forward_euler)
    found = compare("exercise_large", integrators=[own, "symplectic_euler"], duration=2.0)
    mine, ours = found.drift
    assert [*compare("exercise_large", integrators=own, duration=0.5).runs] == [next(iter(found.runs))]
    assert mine.phase == ours.phase
    assert own.remark in found.text
    assert "Work and heat are computed by the trapezoidal rule from the ends of each step." in own.remark
    for step in (own, from_step(wrapped)):
        study = cost("exercise", integrators=[step], duration=1.0, steps=[0.02], repeats=1)
        assert [point.method for point in study.points] == [step.name]
        env = gym.make("LabPendulum-v0", integrator=step)
        env.reset(seed=0)
        assert math.isfinite(env.step(env.action_space.sample())[4]["energy"])
    assert pickle.loads(pickle.dumps(own)) == own
    with pytest.raises(MethodError, match="forces free of the velocity"):
        rollout("lab", integrator=from_step(verlet))


def test_a_step_may_be_given_as_the_text_of_a_function() -> None:
    text = """
    import math

    def slope(theta):
        return math.sin(theta)

    def step(theta, omega, dt, acceleration):
        omega = omega + dt*acceleration(theta, omega)
        return theta + dt*omega, omega
    """
    assert (from_step(text).equals, from_step(text).name) == ("symplectic_euler", "step")
    assert from_step(THREE_LINES).equals == "symplectic_euler"
    for wrong, words in (("def move(theta):\n    return theta", "no function called step; begin it with def step"),
                         ("def step(theta):\n    return theta", "must take the four arguments"),
                         ("import sys\nsys.exit(0)\ndef step(a, b, c, d):\n    return a, b", "failed with SystemExit"),
                         ("1/0\ndef step(a, b, c, d):\n    return a, b", "failed with ZeroDivisionError"),
                         ("def step(a, b, c, d) return a, b", "are not Python")):
        with pytest.raises(MethodError, match=words):
            from_step(wrong)


def test_steps_with_different_lines_have_different_digests() -> None:
    steps = [from_step(step) for step in (velocity_first, angle_first, wrapped)]
    assert len({step.digest for step in steps}) == 3
    assert all("\n" not in repr(step) for step in steps)


def test_the_same_text_has_the_same_digest_and_another_inner_function_another() -> None:
    text = """
    def step(theta, omega, dt, acceleration):
        pull = lambda angle: 1.0*acceleration(angle, omega)
        if theta > 3.0:
            theta = theta - 6.0
        omega = omega + dt*pull(theta)
        return theta + dt*omega, omega
    """
    other = text.replace("1.0*acceleration(angle, omega)", "acceleration(angle, omega)/1.0")
    digests = [from_step(one).digest for one in (text, text, other)]
    assert digests[0] == digests[1] != digests[2]


def test_the_new_angle_in_a_step_called_forward_euler_is_named() -> None:
    """Check the mistakes that leave a step of order 1: its name is that of another method than the one it equals."""

    def forward_euler(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
        theta = theta + omega * dt
        omega = omega + acceleration(theta) * dt
        return theta, omega

    def backward_euler(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
        omega = omega + acceleration(theta, omega) * dt
        return theta + omega * dt, omega

    assert "equals symplectic_euler_position_first, not forward_euler, although" in from_step(forward_euler).summary
    assert "equals symplectic_euler, not backward_euler, although it is called so" in from_step(backward_euler).summary


@pytest.mark.slow
def test_a_film_of_it_is_that_of_the_method_that_it_equals(tmp_path: Path) -> None:
    """Check the pictures below the line with the name, and that another method gives others."""
    found = {}
    for name, method in {"own": from_step(THREE_LINES), "its equal": "symplectic_euler", "another": "rk4"}.items():
        path = film("exercise_large", tmp_path / f"{name}.gif", method, dt=0.1, duration=1.0, fps=10.0, size=200,
                    panels=("apparatus",)).path
        with Image.open(path) as frames:
            found[name] = []
            for frame in range(frames.n_frames):
                frames.seek(frame)
                found[name].append(np.asarray(frames.convert("RGB"), dtype=int)[40:])
    assert len(found["own"]) == 10
    assert np.mean(np.abs(np.array(found["own"]) - found["its equal"]) > 40) < 1e-4
    assert np.mean(np.abs(np.array(found["own"]) - found["another"]) > 40) > 1e-3


# --- mistakes -------------------------------------------------------------------------------------------------------

MISTAKEN: dict[str, tuple[str, str]] = {
    "no dt at the velocity": ("omega += acceleration(theta, omega)\ntheta += omega*dt",
                              "acceleration instead of acceleration.dt.*equals symplectic_euler"),
    "no dt at the angle": ("omega += acceleration(theta, omega)*dt\ntheta += omega",
                           "omega instead of omega.dt.*equals symplectic_euler"),
    "no dt at all": ("theta, omega = theta + omega, omega + acceleration(theta, omega)",
                     "dt is missing in both lines.*equals forward_euler"),
    "sign": ("omega -= acceleration(theta, omega)*dt\ntheta += omega*dt",
             "already has its sign, so add it.*equals symplectic_euler"),
    "degrees to radians": ("omega += acceleration(np.radians(theta), omega)*dt\ntheta += omega*dt",
                           "in radians already.*equals symplectic_euler"),
    "radians to degrees": ("omega += acceleration(math.degrees(theta), omega)*dt\ntheta += omega*dt",
                           "from radians to degrees.*equals symplectic_euler"),
    "all in degrees": ("omega += np.degrees(acceleration(np.radians(theta), omega))*dt\ntheta += omega*dt",
                       "works in degrees.*equals symplectic_euler"),
    "velocity in degrees": ("omega += np.degrees(acceleration(theta, omega))*dt\ntheta += omega*dt",
                            "velocity is computed in degrees.*equals symplectic_euler"),
    "angle in degrees": ("theta_new = theta + omega*dt\nomega += acceleration(theta, omega)*dt\n"
                         "theta = np.degrees(theta_new)", "angle is computed in degrees.*equals forward_euler"),
    "change in degrees": ("omega += acceleration(theta, omega)*dt\ntheta += np.degrees(omega*dt)",
                          "change of the angle is converted to degrees.*equals symplectic_euler"),
    "dt twice": ("omega += acceleration(theta, omega)*dt*dt\ntheta += omega*dt",
                 "multiply by dt once.*equals symplectic_euler"),
    "minus for backward": ("theta, omega = theta - omega*dt, omega - acceleration(theta, omega)*dt",
                           "go back in time.*plus signs too.*equals forward_euler"),
    "changes alone": ("theta, omega = omega*dt, acceleration(theta, omega)*dt",
                      "returns the changes.*equals forward_euler"),
    "swapped": ("omega += acceleration(theta, omega)*dt\ntheta, omega = omega, theta + omega*dt",
                "return theta, omega. The step then equals symplectic_euler"),
    "something else": ("omega += 2*acceleration(theta, omega)*dt\ntheta += omega*dt",
                       r"omega by -1.363 dt instead of -0.6816 dt"),
    "no force": ("theta += omega*dt", "never calls acceleration"),
    "unknown name": ("omega += Omega*acceleration(theta)*dt", "NameError: name 'Omega' is not defined"),
    "not Python": ("omega += (", "are not Python"),
    "not numbers": ("theta = [theta, acceleration(theta)]", "must return two numbers"),
}


@pytest.mark.parametrize("name", MISTAKEN)
def test_usual_mistakes_are_named(name: str) -> None:
    lines, words = MISTAKEN[name]
    with pytest.raises(MethodError, match=words):
        from_step(lines)


def test_what_is_no_step_is_refused() -> None:
    with pytest.raises(MethodError, match=r"four arguments .*, not \(theta, omega, dt\)"):
        from_step(lambda theta, omega, dt: (theta, omega))
    with pytest.raises(MethodError, match="must be a function"):
        from_step(3)  # type: ignore[arg-type]
    with pytest.raises(MethodError, match=r"observed order 1\.00, not 2; it equals forward_euler"):
        from_step(both_old, order=2)
    with pytest.raises(MethodError, match="order must be a whole number from 1, or None, not 0"):
        from_step(both_old, order=0)
    past: list[Any] = [0.0]

    def remembering(theta: Any, omega: Any, dt: Any, acceleration: Any) -> Any:
        past.append(theta)
        return theta + len(past) * omega * dt, omega + acceleration(theta) * dt

    with pytest.raises(MethodError, match="two equal calls gave"):
        from_step(remembering)
    assert isinstance(from_step(both_old, order=1), OwnStep)
