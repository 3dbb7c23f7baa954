"""Plain programs: they run as they are, are short, and compute what a rollout computes, up to rounding.

Truths are rollouts, loops written here by hand, and scipy's DOP853 on an equation written here.
"""

from __future__ import annotations

import math
import subprocess
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from choice import familiar
from command_line import Here
from given_effects import Rub
from scipy.integrate import solve_ivp

from integrators import METHODS, MethodError, from_step
from pendulum_env import SCENES, Scene, SceneError, code, rollout
from pendulum_env.engine.code import is_linear_solve, is_plain
from pendulum_env.engine.machine import fitting
from pendulum_env.engine.source import constants_of, with_callees
from pendulum_env.physics.effects import (
    EFFECTS,
    BearingFriction,
    Effect,
    Gravity,
    LinearDrag,
    PeriodicTorque,
    QuadraticDrag,
)
from pendulum_env.physics.elementary import sin
from pendulum_env.physics.medium import air

pytestmark = pytest.mark.usefixtures("all_interpreted")
STEPS = 40
LINES = 55
"""Largest length of a program for up to four stages."""
SOLVED = [name for name, method in METHODS.items() if is_linear_solve(method)]
NAMES = [name for name, method in METHODS.items() if is_plain(method)]


def short(scene: str | Scene) -> Scene:
    """Return a scene whose usual run takes 40 steps."""
    place = SCENES[scene] if isinstance(scene, str) else scene
    return place.replace(run=replace(place.run, duration=STEPS * place.run.dt))


def executed(program: str) -> dict[str, Any]:
    """Return the names of a program after it has run, without a window."""
    import matplotlib.pyplot as plt

    names: dict[str, Any] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "FigureCanvasAgg is non-interactive")  # there is no window to show
        with np.errstate():  # a program may change it
            exec(compile(program, "<plain>", "exec"), names)
    plt.close("all")
    return names


def check(scene: str | Scene, method: Any) -> str:
    """Check that a program gives the angles and velocities of a rollout; return the program."""
    place = short(scene)
    program = code(place, method)
    found = executed(program)
    run = rollout(place, integrator=method, backend="python", warn=False)
    assert len(found["angles"]) == STEPS + 1
    np.testing.assert_allclose(found["angles"], run.angle, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(found["velocities"], run.velocity, rtol=1e-10, atol=1e-10)
    scale = float(np.max(np.abs(run.energy)))
    np.testing.assert_allclose(found["energies"], run.energy, rtol=1e-9, atol=1e-9 * scale)
    return program


@pytest.mark.parametrize("method", NAMES)
def test_every_explicit_one_step_method_has_a_plain_program(method: str) -> None:
    scene = "exercise_large" if method in fitting(SCENES["exercise_large"]) else "vacuum"
    program = check(scene, method)
    chosen = METHODS[method]
    head = "".join(line.removeprefix("#").strip() for line in program.split("import")[0].split("\n")).replace(" ", "")
    assert chosen.source.replace(" ", "") in head
    assert SCENES[scene].equation().replace(" ", "") in head
    assert "Leadingerror" in head


FEW_STAGES = [name for name in NAMES if METHODS[name].evaluations <= 4]


@pytest.mark.quick("lab", "vacuum")
@pytest.mark.parametrize("scene", familiar(SCENES))
def test_programs_of_up_to_four_stages_are_short(scene: str) -> None:
    """Check every scene; a splitting method with more than ten sub-flows, drags included, has as many lines more."""
    for name in FEW_STAGES:
        try:
            program = code(scene, name)
        except (MethodError, SceneError):
            continue
        assert program.count("\n") <= LINES + max(0, len(METHODS[name].sub_flows) - 10), name
        assert max(map(len, program.splitlines())) <= 120, name


@pytest.mark.quick("lab-rk4", "vacuum-symplectic_euler", "sticky_bearing-velocity_verlet")
@pytest.mark.parametrize("method", ["symplectic_euler", "velocity_verlet", "rk4"])
@pytest.mark.parametrize("scene", familiar(SCENES))
def test_every_scene_has_one(scene: str, method: str) -> None:
    place = SCENES[scene]
    fits = method in fitting(place)
    if fits and not any(effect.dry or effect.memory or effect.limit for effect in place.effects) and (
            scene != "driven" or method != "velocity_verlet"):
        check(scene, method)
        return
    with pytest.raises((MethodError, SceneError), match=r"no plain loop|does not offer|drag in moving air"):
        code(place, method)


def test_several_drags_are_composed_as_in_the_engine() -> None:
    place = Scene("two drags", medium=air(20.0), run=SCENES["exercise_large"].run, effects=(
        Gravity(), LinearDrag(gamma=0.3), QuadraticDrag(c=0.4), BearingFriction(bearing_viscosity=0.01)))
    for method in ("velocity_verlet", "forest_ruth", "yoshida6a"):
        assert "def quadratic_drag_flow" in check(place, method)


def test_a_tanh_is_numpys() -> None:
    program = check(SCENES["torsion"].with_effects((*SCENES["torsion"].effects, Rub())), "rk4")
    assert "*np.tanh(omega/rub_width)" in program


def test_a_step_of_one_s_own_has_one() -> None:
    own = from_step("omega = omega + acceleration(theta, omega)*dt\ntheta = theta + omega*dt")
    assert "    omega = omega + acceleration(theta, omega)*dt\n    theta = theta + omega*dt\n" in check("lab", own)


SHARE = 0.7
MOST = math.inf
NOTHING = math.nan
theta, a1, range = 0.2, 0.5, 0.3
"""Constants of the torques below; a plain program has a ``theta``, an ``a1`` and a ``range`` of its own."""


def with_constants(angle: float, mine_rate: float) -> float:
    if angle > MOST or angle < -MOST:
        return NOTHING
    return -mine_rate*(SHARE*sin(angle) if angle > 0.1 else sum([sin(angle*share) for share in (SHARE, 1.0)]))


def with_the_angle(angle: float, mine_rate: float) -> float:
    return -mine_rate*(theta if angle > 0.1 else 0.0)


def with_a_stage(angle: float, mine_rate: float) -> float:
    return -mine_rate*(a1 if angle > 0.1 else 0.0)


def with_a_builtin(angle: float, mine_rate: float) -> float:
    return -mine_rate*(range if angle > 0.1 else 0.0)


def scene_with(torque: Callable[..., float]) -> Scene:
    """Return the torsion pendulum with an effect of one's own that cannot be recorded, because it branches."""
    @dataclass(frozen=True)
    class Mine(Effect):
        """A drive of one's own."""

        name, kind, equation, source = "mine", "drive", "mine", "none"

        def coefficients(self, scene: Any) -> dict[str, float]:
            return {"mine_rate": 50.0}

    Mine.torque = staticmethod(torque)
    return SCENES["torsion"].with_effects((*SCENES["torsion"].effects, Mine()))


@pytest.mark.quick("with_constants")
@pytest.mark.parametrize("torque", [with_constants, with_the_angle, with_a_stage, with_a_builtin])
def test_a_copied_function_has_its_constants_as_numbers(torque: Callable[..., float]) -> None:
    program = check(scene_with(torque), "rk4")
    assert f"def {torque.__name__}(angle, mine_rate):" in program
    assert "SHARE" not in program


def test_no_effect_of_the_package_needs_a_constant_of_its_module() -> None:
    """A plain program would not have it."""
    functions = [getattr(effect, role) for effect in EFFECTS.values() for role in Effect.__annotations__]
    assert constants_of(with_callees(filter(callable, functions))) == {}


def test_the_program_of_symplectic_euler_is_the_lab_sheet_s() -> None:
    """omega += -(Omega**2 sin(theta) + gamma omega) dt, then theta += omega dt, written by hand."""
    place = short("exercise_large")
    found = executed(code(place, "symplectic_euler"))
    theta, omega, dt = place.run.angle, place.run.velocity, place.run.dt
    for angle, velocity in zip(found["angles"], found["velocities"], strict=True):
        assert (angle, velocity) == (pytest.approx(theta, abs=1e-14), pytest.approx(omega, abs=1e-14))
        omega += -(place.omega0**2 * math.sin(theta) + 0.02 * omega) * dt
        theta += omega * dt
    assert "    omega = omega + dt*acceleration(theta, omega)\n    theta = theta + dt*omega\n" in code(place,
                                                                                                     "symplectic_euler")


def pushed() -> Scene:
    """Return the torsion pendulum with a torque that swings with 3 rad/s: a linear scene with a drive."""
    scene = SCENES["torsion"]
    return scene.with_effects((*scene.effects, PeriodicTorque(drive_torque=2e-4, drive_rate=3.0)))


def test_the_methods_that_solve_two_linear_equations_are_those_of_one_stage_at_a_time() -> None:
    assert {"backward_euler", "implicit_midpoint", "trapezoid", "sdirk2", "sdirk4"} <= set(SOLVED)
    assert not {"gauss4", "radau5", "rk4", "discrete_gradient"} & set(SOLVED)


@pytest.mark.parametrize("scene", ["exercise", "torsion", "pushed"])
@pytest.mark.parametrize("method", SOLVED)
def test_implicit_methods_of_linear_scenes_solve_two_equations(method: str, scene: str) -> None:
    """Rollouts solve them by Newton's method."""
    assert "np.linalg.solve(system, (" in check(pushed() if scene == "pushed" else scene, method)


def test_backward_euler_is_the_two_equations_of_the_lab_sheet() -> None:
    """theta1 - dt omega1 = theta and omega1 + dt Omega**2 theta1 = omega, solved here by Cramer's rule."""
    place = short("exercise")
    program = code(place, "backward_euler")
    found = executed(program)
    theta, omega, dt, square = place.run.angle, place.run.velocity, place.run.dt, 9.8 / 0.353
    for angle, velocity in zip(found["angles"], found["velocities"], strict=True):
        assert (angle, velocity) == (pytest.approx(theta, abs=1e-14), pytest.approx(omega, abs=1e-14))
        shrink = 1.0 + square * dt * dt
        theta, omega = (theta + dt * omega) / shrink, (omega - dt * square * theta) / shrink
    assert "    theta, omega = np.linalg.solve(system, (theta, omega))\n" in program
    np.testing.assert_allclose(found["system"], [[1.0, -dt], [dt * square, 1.0]], rtol=1e-14)


def test_the_energy_of_a_program_is_that_of_the_textbook() -> None:
    """I omega**2/2 + m g L (1 - cos(theta)), with I = m L**2 + 2/5 m a**2 left at m L**2 as in the exercise."""
    found = executed(code(short("exercise_large"), "rk4"))
    angle, velocity = np.array(found["angles"]), np.array(found["velocities"])
    mass, length = 0.04, 0.353
    truth = 0.5 * mass * (length * velocity) ** 2 + mass * 9.8 * length * (1.0 - np.cos(angle))
    np.testing.assert_allclose(found["energies"], truth, rtol=1e-12)


def test_a_program_draws_angle_velocity_phase_plot_and_energy(monkeypatch: pytest.MonkeyPatch) -> None:
    import matplotlib.pyplot as plt

    drawn: list[list[Any]] = []
    monkeypatch.setattr(plt, "show", lambda: drawn.append([
        (at.get_xlabel(), at.get_ylabel(), *at.lines[0].get_data()) for at in plt.gcf().axes]))
    found = executed(code(short("exercise"), "symplectic_euler"))
    time, angle, velocity = 0.01 * np.arange(STEPS + 1), np.degrees(found["angles"]), found["velocities"]
    truth = [("time [s]", "angle [degrees]", time, angle), ("time [s]", "angular velocity [rad/s]", time, velocity),
             ("angle [degrees]", "angular velocity [rad/s]", angle, velocity),
             ("time [s]", "energy [J]", time, found["energies"])]
    for (below, left, x, y), (true_below, true_left, true_x, true_y) in zip(*drawn, truth, strict=True):
        assert (below, left) == (true_below, true_left)
        np.testing.assert_allclose(x, true_x)
        np.testing.assert_allclose(y, true_y)


def test_the_program_solves_the_equation_in_its_first_line() -> None:
    place = short("water")
    found = executed(code(place, "dopri5"))
    values = place.coefficients

    def slope(t: float, y: Any) -> list[float]:
        speed = abs(y[1])
        reynolds = values["sphere_reynolds_rate"] * speed
        number = reynolds + 1e-300
        drag = number / 24.0 * (24.0 / number * (1.0 + 0.152 * number**0.677) + 0.417 / (1.0 + 5070.0 / number**0.94))
        rates = values["sphere_stokes_rate"] * drag + values["wire_form_rate"] * speed
        rates += values["wire_skin_rate"] * speed ** (1.0 / 3.0)
        return [y[1], -values["gravity_rate"] * math.sin(y[0]) - rates * y[1]]

    end = STEPS * place.run.dt
    truth = solve_ivp(slope, (0.0, end), [place.run.angle, place.run.velocity], rtol=1e-11, atol=1e-13, method="DOP853")
    assert found["angles"][-1] == pytest.approx(truth.y[0, -1], abs=1e-7)


# --- refusals, and the command --------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["ab2", "gauss4", "taylor", "discrete_gradient", "exact"])
def test_other_methods_are_refused(method: str) -> None:
    assert not is_plain(METHODS[method])
    with pytest.raises(MethodError, match=rf"{method} has no plain loop, .* explicit one-step methods .* rk4"):
        code("vacuum", method)
    assert "def run(" in code("vacuum", method, "engine")


@pytest.mark.parametrize(("scene", "names"), [
    ("vacuum", "gravity"), ("lab", "gravity, quadratic_drag"), ("chaotic", "gravity")])
def test_implicit_methods_are_refused_in_scenes_that_are_not_linear(scene: str, names: str) -> None:
    with pytest.raises(MethodError, match=rf"only in linear scenes, .* and {names} of the scene '{scene}' is not"):
        code(scene, "backward_euler")
    with pytest.raises(MethodError, match="own_angle of the scene 'torsion' is not linear"):
        code(SCENES["torsion"].with_effects((*SCENES["torsion"].effects, Bent())), "trapezoid")
    assert "def run(" in code(scene, "backward_euler", "engine")


@dataclass(frozen=True)
class Bent(Effect):
    """A torque of one's own that branches, and so has no slope that is one number."""

    name, kind, equation, source = "own_angle", "drive", "bent", "none"

    def coefficients(self, scene: Any) -> dict[str, float]:
        return {"bent_rate": 1.0}

    @staticmethod
    def torque(angle: float, bent_rate: float) -> float:
        return bent_rate * angle if angle > 0.1 else 0.0

    @staticmethod
    def by_angle(angle: float, bent_rate: float) -> float:
        return bent_rate if angle > 0.1 else 0.0


def test_a_branch_of_one_s_own_and_moving_air_are_refused() -> None:
    wrapped = from_step("omega += acceleration(theta, omega)*dt\ntheta += omega*dt\nif theta > 3: theta -= 2*math.pi")
    with pytest.raises(MethodError, match="own_step has no plain loop"):
        code("vacuum", wrapped)
    with pytest.raises(SceneError, match="drag in moving air, where only methods that take drag as a force"):
        code("driven", "velocity_verlet")
    with pytest.raises(SceneError, match="its coulomb_friction has dry friction"):
        code("sticky_bearing", "rk4")
    with pytest.raises(SceneError, match="its gusts has a state of its own"):
        code("windy", "rk4")


def test_the_command_prints_it(run_here: Here) -> None:
    status, printed, said = run_here("code", "--integrators", "rk4", "--scene", "exercise_large", "--set", "length=0.5")
    assert (status, said) == (0, "")
    assert printed == code(SCENES["exercise_large"].replace(length=0.5), "rk4")
    assert run_here("code", "-i", "rk4", "--language", "engine")[1] == code("exercise_large", "rk4", "engine")
    status, _, said = run_here("code", "--integrators", "gauss4")
    assert status == 2
    assert "use language='engine' (--language engine)" in said
    assert "did you mean plain" in run_here("code", "--language", "plane")[2]


@pytest.mark.slow
def test_it_runs_as_it_is_in_a_process_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "loop.py").write_text(code(short("exercise_large"), "velocity_verlet"), encoding="utf-8")
    done = subprocess.run([sys.executable, "-I", "loop.py"], cwd=tmp_path, capture_output=True, text=True,
                          env={"MPLBACKEND": "svg", "PATH": "/usr/bin", "MPLCONFIGDIR": str(tmp_path)})
    assert done.returncode == 0, done.stderr
