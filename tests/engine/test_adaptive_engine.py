"""Tests of adaptive steps within a control step, against elliptic functions and against runs with very short steps."""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from choice import familiar
from given_effects import Blow

import integrators
import pendulum_env
from integrators import MethodError
from integrators.steps.estimates import order_of_estimate
from pendulum_env import SCENES, Scene, rollout
from pendulum_env.engine.layout import BLOCK
from pendulum_env.engine.machine import Machine
from pendulum_env.physics.effects import Effect
from pendulum_env.physics.exact import pendulum

NAMES = [method.name for method in integrators.PAIRS]
LAB: dict[str, Any] = {"scene": "lab", "angle": 2.0, "velocity": 0.0, "duration": 3.0, "dt": 0.3, "control": 0.5,
                       "backend": "python"}
VACUUM = {**LAB, "scene": "vacuum", "angle": 2.5, "duration": 5.0, "dt": 0.5, "control": 0.0}


def make(**options: Any) -> Any:
    return gym.make("LabPendulum-v0", **{"integrator": "dop853", "rtol": 1e-10, "backend": "python", **options})


@pytest.mark.parametrize("name", NAMES)
def test_the_angle_errs_in_proportion_to_the_tolerance(name: str) -> None:
    exponents = range(4, 12)
    errors, omega0 = [], SCENES["vacuum"].omega0
    for n in exponents:
        run = rollout(**VACUUM, integrator=name, rtol=10.0**-n)
        assert run.time.tolist() == pytest.approx([0.5 * i for i in range(11)], rel=1e-15)
        errors.append(np.max(np.abs(run.angle - pendulum(run.time, 2.5, 0.0, omega0)[0])))
    method = integrators.get(name)  # an error of order p, under a tolerance for an estimate of order q
    slope = -np.polyfit(exponents, np.log10(errors), 1)[0]
    assert slope == pytest.approx(method.order / order_of_estimate(method), abs=0.25)
    assert max(error * 10.0**n for n, error in zip(exponents, errors, strict=True)) < 1000


@pytest.mark.parametrize("name", NAMES)
def test_work_and_heat_ride_along(name: str) -> None:
    case = {**LAB, "damping": "none"} if "velocity_free" in integrators.get(name).needs else LAB
    run = rollout(**case, integrator=name, rtol=1e-9, diagnostics=("energy", "heat_by_effect"))
    truth = rollout(**{**case, "dt": 0.003}, integrator="verner9", diagnostics=("energy", "heat_by_effect"))
    assert run.angle[-1] == pytest.approx(truth.angle[-1], abs=1e-7)
    size = np.max(np.abs(truth.ledger.work))
    assert run.ledger.work[-1] == pytest.approx(truth.ledger.work[-1], abs=5e-7 * size)
    for effect, heat in run.heat_by_effect.items():
        assert heat[-1] == pytest.approx(truth.heat_by_effect[effect][-1], abs=5e-7 * size)
    assert np.max(np.abs(run.energy_residual)) < 2e-8 * run.energy[0]


def spring(time: float, angle: float, spring_rate: float) -> float:
    """Return the torque of a moving spring whose stiffness grows with time."""
    return spring_rate * (0.05 * time - angle * (1.0 + 30.0 * angle * angle))


def spring_by_angle(time: float, angle: float, spring_rate: float) -> float:
    return -spring_rate * (1.0 + 90.0 * angle * angle)


@dataclass(frozen=True)
class Spring(Effect):
    """An effect with a torque that depends on the time."""

    name = "spring"
    kind = "drive"
    equation = "{spring_rate} (t/20 - theta - 30 theta^3)"
    source = "made up"
    torque = staticmethod(spring)
    by_angle = staticmethod(spring_by_angle)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"spring_rate": 4.0}


@pytest.mark.parametrize("name", NAMES)
def test_steps_are_those_of_solve(name: str) -> None:
    """Check that the engine takes and rejects as many steps as integrators.solve, with equal states to rounding."""
    options: dict[str, Any] = {"angle": 0.3, "velocity": -1.0, "duration": 6.0, "dt": 1.0, "backend": "python"}
    run = rollout(Scene(effects=(Spring(),)), integrator=name, rtol=1e-7, diagnostics=(), **options)
    system = integrators.System(lambda t, q, v: spring(t, q, 4.0), velocity_free=True,
                                jacobian=lambda t, q, v: (spring_by_angle(t, q, 4.0), 0.0))
    alone = integrators.solve(system, 0.3, -1.0, run.time, method=name, rtol=1e-7, h=1.0)
    assert (run.steps, run.rejected) == (alone.steps, alone.rejected)
    assert run.rejected > 0
    assert run.angle == pytest.approx(alone.q, abs=1e-9)
    assert run.velocity == pytest.approx(alone.v, abs=1e-9)


def test_heavy_damping_does_not_shorten_the_steps_of_stiff_pairs() -> None:
    """theta'' + gamma theta' + omega0^2 theta = 0 with gamma = 1e4/s: its velocity settles within 1e-4 s.

    An explicit pair takes a step for each of the 5e4 times that the velocity could settle, or a few less.
    """
    gamma, square, end = 1e4, SCENES["exercise"].omega0**2, 5.0
    options: dict[str, Any] = {"damping": "linear", "gamma": gamma, "angle": 1.0, "velocity": 0.0, "duration": end,
                               "dt": 1.0, "rtol": 1e-6, "atol": 1e-9, "backend": "python"}
    fast = -0.5 * (gamma + math.sqrt(gamma * gamma - 4.0 * square))
    slow = square / fast
    truth = (fast * math.exp(slow * end) - slow * math.exp(fast * end)) / (fast - slow)
    for name in ("radau5", "sdirk4"):
        run = rollout("exercise", integrator=name, **options)
        assert run.angle[-1] == pytest.approx(truth, rel=1e-9)
        assert run.steps + run.rejected < 100
    assert rollout("exercise", integrator="dop853", **options).steps > 5_000


@pytest.mark.parametrize("name", ["dopri5", pytest.param("dop853", marks=pytest.mark.slow)])
def test_interpreted_and_compiled_give_the_same_bits(name: str) -> None:
    options = {**LAB, "integrator": name, "rtol": 1e-8}
    one, other = (rollout(**{**options, "backend": backend}) for backend in ("python", "compiled"))
    assert (one.steps, one.rejected) == (other.steps, other.rejected)
    assert one.rejected > 0
    for quantity in ("angle", "velocity", "energy_residual"):
        assert getattr(one, quantity).tolist() == getattr(other, quantity).tolist()


def test_the_step_is_carried_from_one_control_step_to_the_next() -> None:
    """Check that a control step starts with the step size at the end of the last one, so that fewer are rejected."""
    machine = Machine(SCENES["lab"], "dopri5", backend="python", rtol=1e-8)
    state = machine.state(2.0, 0.0)
    assert machine.advance(state, 0.5, 0.3, 1) == 0
    assert 0.0 < state[machine.kept["size"]] < 0.1
    assert state[machine.kept["rejected"]] > 1
    afresh = list(state)
    afresh[machine.kept["size"]] = 0.0
    for each in (state, afresh):
        machine.advance(each, 0.5, 0.3, 1)
    assert state[machine.kept["rejected"]] < afresh[machine.kept["rejected"]]
    assert state[machine.kept["taken"]] > 0.6 / 0.1


def test_the_environment_steps_and_resumes_bit_for_bit() -> None:
    env = make(task="free", dt=0.2)
    env.reset(seed=0, options={"angle": 3.0, "velocity": 0.0})
    action = np.array([0.7], dtype=np.float32)
    for _ in range(5):
        _, _, _, _, info = env.step(action)
    assert abs(info["energy_residual"]) < 1e-9
    assert info["time"] == pytest.approx(1.0)
    saved = env.unwrapped.get_state()
    ahead = [env.step(action)[4] for _ in range(5)]
    twin = make(task="free", dt=0.2)
    twin.reset(seed=1)
    twin.unwrapped.set_state(saved)
    assert [twin.step(action)[4] for _ in range(5)] == ahead
    with pytest.raises(pendulum_env.SceneError, match="another rtol"):
        make(task="free", dt=0.2, rtol=1e-9).unwrapped.set_state(saved)
    assert set(info) == set(make(rtol=None).reset()[1])


def test_a_machine_keeps_its_tolerance_through_pickling() -> None:
    machine = pickle.loads(pickle.dumps(Machine(SCENES["lab"], "bs3", backend="python", rtol=1e-5, atol=1e-7)))
    assert machine.tolerance == {"rtol": 1e-5, "atol": 1e-7}
    numbers = dict(zip(machine.numbers, machine.parameters, strict=True))
    assert (numbers["rtol"], numbers["atol"]) == (1e-5, 1e-7)


@pytest.mark.parametrize("name", ["bs3", "dop853", "verner9"])
def test_a_step_at_the_minimum_ends_the_run_with_its_reason(name: str) -> None:
    run = rollout(Scene(effects=(Blow(),)), integrator=name, angle=0.0, velocity=1.0, duration=2.0, dt=0.3,
                  rtol=1e-8, backend="python", diagnostics=(), warn=False)
    assert run.stop_reason == "step_too_short"
    assert run.stop_time == pytest.approx(0.9)
    assert run.velocity == pytest.approx(1 / np.sqrt(1 - run.time), rel=1e-5)


# --- batches --------------------------------------------------------------------------------------------------------

AMPLITUDES = np.radians([1.0, 179.0, 40.0, 120.0, 175.0])
"""Initial angles from which runs take very different numbers of adaptive steps [rad]."""
SMOOTH = [name for name, scene in SCENES.items() if not any(effect.dry for effect in scene.effects)]
RECORDED = ("angle", "velocity", "energy", "energy_residual", "error_estimate")


def check_alone(case: dict[str, Any], picked: Any = None, **own: Any) -> Any:
    """Check that the runs of a batch have the bits, step counts and stop reasons of single interpreted runs.

    ``own`` holds arguments that differ between runs. Return the Rollout of the batch.
    """
    many = rollout(**{**case, **own}, warn=False)
    seeds = {"seed": case.get("seed", 0)}
    for i in range(len(AMPLITUDES)) if picked is None else picked:
        each = {name: float(values[i]) for name, values in own.items()}
        alone = {**case, **each, "seed": seeds["seed"] + i, "backend": "python", "warn": False}
        one = rollout(**{name: value for name, value in alone.items() if name not in ("num_threads", "file")})
        count = len(one.time) - bool(one.stop_reason)  # a single run has one more record, at its stop
        for name in RECORDED:
            theirs, found = getattr(one, name), getattr(many, name)
            assert (found is None) == (theirs is None)
            if theirs is not None:
                assert found[i, :count].tolist() == theirs[:count].tolist(), (name, i)
        for name, heat in one.heat_by_effect.items():
            assert many.heat_by_effect[name][i, :count].tolist() == heat[:count].tolist()
        assert (many.steps[i], many.rejected[i], many.stop_reason[i]) == (one.steps, one.rejected, one.stop_reason), i
        assert many.stop_time[i] == one.stop_time
    return many


@pytest.mark.parametrize("name", NAMES)
def test_every_run_of_a_batch_takes_its_own_steps(name: str) -> None:
    lengths = np.array([1.0, 0.5, 2.0, 1.5, 0.3])
    many = check_alone({**VACUUM, "integrator": name, "rtol": 1e-7, "every": 3}, angle=AMPLITUDES, length=lengths)
    assert len({*many.steps.tolist()}) > 2
    assert many.rejected.any()
    assert many.tolerance == {"rtol": 1e-7, "atol": 1e-7}


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_compiled_runs_of_a_batch_take_their_own_steps(name: str) -> None:
    case = {**VACUUM, "integrator": name, "rtol": 1e-7, "every": 3, "backend": "compiled"}
    assert check_alone(case, angle=AMPLITUDES).rejected.any()


def options_of(scene: str) -> dict[str, Any]:
    """Return the arguments of a short adaptive run of a scene, with the pull on the suspension where it has a meaning.
    """
    usual, pull = SCENES[scene].run, () if "tension" in SCENES[scene].body.lacks else ("tension",)
    return {"scene": scene, "integrator": "dopri5", "rtol": 1e-6, "duration": 3.0 * usual.dt + usual.duration / 50.0,
            "dt": usual.duration / 70.0, "substeps": 2, "control": 0.4, "seed": 3,
            "diagnostics": ("energy", "heat_by_effect", *pull), "every": 2}


@pytest.mark.quick("python-lab")
@pytest.mark.parametrize("scene", familiar(SMOOTH))
@pytest.mark.parametrize("backend", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
def test_batches_of_every_scene(scene: str, backend: str) -> None:
    check_alone({**options_of(scene), "backend": backend}, angle=AMPLITUDES)


STOPS: dict[str, tuple[dict[str, Any], dict[str, Any], set[str]]] = {
    "step too short": ({"scene": Scene(effects=(Blow(),)), "angle": 0.0, "diagnostics": ()},
                       {"velocity": [0.1, 1.0, 0.9, 0.2, -1.0]}, {"step_too_short", ""}),
    "speed limit": ({"scene": "vacuum", "speed_limit": 4.0}, {"angle": AMPLITUDES}, {"speed_limit", ""}),
    "slack": ({"scene": "exercise_large", "angle": 0.0, "diagnostics": ("energy", "tension")},
              {"velocity": [0.5, 5.0, 9.0, -5.5, 2.0]}, {"slack", ""}),
    "slack at once": ({"scene": "exercise_large"}, {"angle": AMPLITUDES}, {"slack", ""}),
    "slack is a warning": ({"scene": SCENES["exercise_large"].replace(slack="warn"), "speed_limit": 6.0, "angle": 0.0},
                           {"velocity": [0.5, 5.0, 9.0, -5.5, 2.0]}, {"speed_limit", ""}),
    "diverged": ({"scene": "textbook", "rtol": 1e6, "dt": 3.0, "duration": 60.0},
                 {"angle": [1e-300, 0.1, 1.0, 1e-280, -0.5]}, {"diverged", ""}),
}


@pytest.mark.quick("step too short-python", "slack-python", "speed limit-python")
@pytest.mark.parametrize("backend", ["python", pytest.param("compiled", marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", STOPS)
@pytest.mark.filterwarnings("ignore:The wire of the scene")
def test_a_run_that_stops_leaves_the_others_alone(case: str, backend: str) -> None:
    options, own, reasons = STOPS[case]
    given = {"integrator": "dop853", "rtol": 1e-8, "duration": 2.0, "dt": 0.3, "backend": backend, **options}
    found = check_alone(given, **{name: np.array(values) for name, values in own.items()})
    assert {*found.stop_reason} == reasons


@pytest.mark.quick("change0", "change2")
@pytest.mark.parametrize("change", [
    {"every": 1, "dt": 2.5}, {"control": -0.3, "substeps": 3}, {"atol": 1e-3, "rtol": 1e-9}, {"estimate_error": True},
    {"scene": "windy", "substeps": 3, "seed": 7, "estimate_error": True, "diagnostics": ("energy",)}])
def test_batches_with_other_options(change: dict[str, Any]) -> None:
    case = {**LAB, "integrator": "bs3", "rtol": 1e-5, "diagnostics": ("energy", "heat_by_effect"), **change}
    del case["angle"]
    check_alone(case, angle=AMPLITUDES)


@pytest.mark.slow
def test_threads_blocks_and_files_do_not_touch_a_bit(tmp_path: Path) -> None:
    angles = np.random.default_rng(1).permutation(np.linspace(0.02, 3.12, 700))
    case = {**LAB, "integrator": "dopri5", "rtol": 1e-5, "backend": "compiled", "duration": 0.9}
    del case["angle"]
    one = check_alone({**case, "num_threads": 1}, [0, BLOCK - 1, BLOCK, 699], angle=angles)
    for options in ({"num_threads": 3}, {"file": tmp_path / "runs.npy"}):
        other = rollout(**case, angle=angles, warn=False, **options)
        for name in RECORDED[:-1]:
            assert getattr(one, name).tolist() == getattr(other, name).tolist()
        assert (one.steps.tolist(), one.rejected.tolist()) == (other.steps.tolist(), other.rejected.tolist())


def test_a_batch_warns_where_no_step_meets_the_tolerance() -> None:
    with pytest.warns(UserWarning, match="even the shortest step exceeds its tolerance"):
        rollout(Scene(effects=(Blow(),)), integrator="bs3", angle=0.0, velocity=[0.1, 1.0], duration=2.0, dt=0.3,
                rtol=1e-6, backend="python", diagnostics=())


def test_events_of_a_batch() -> None:
    case = {**VACUUM, "integrator": "dop853", "rtol": 1e-8, "events": ["bottom"]}
    many = rollout(**{**case, "angle": AMPLITUDES[1:3]})
    for i, angle in enumerate(AMPLITUDES[1:3]):
        assert many.t_events[0][i].tolist() == rollout(**{**case, "angle": float(angle)}).t_events[0].tolist()


# --- what cannot be -----------------------------------------------------------------------------------------------


def test_refusals() -> None:
    with pytest.raises(MethodError, match=r"rk4 does not estimate its error.*bs3, dopri5"):
        rollout("lab", rtol=1e-8)
    with pytest.raises(MethodError, match=r"rk4 does not estimate its error"):
        gym.make("LabPendulum-v0", rtol=1e-8)
    with pytest.raises(MethodError, match="atol goes with rtol"):
        make(rtol=None, atol=1e-8)
    with pytest.raises(MethodError, match="rtol must be a finite number above zero"):
        make(rtol=-1.0)
    with pytest.raises(MethodError, match="rtol must be at least"):
        make(rtol=1e-17)
    with pytest.raises(MethodError, match="dry friction, as in the scene 'sticky_bearing'"):
        make(scene="sticky_bearing")
    many: Any = {"angle": [0.1, 0.2], "rtol": 1e-8}
    with pytest.raises(MethodError, match="rk4 does not estimate its error"):
        rollout("lab", **many)
    with pytest.raises(MethodError, match="rk4 does not estimate its error"):
        gym.make_vec("LabPendulum-v0", num_envs=2, rtol=1e-8)
    with pytest.raises(MethodError, match="dry friction, as in the scene 'sticky_bearing'"):
        rollout("sticky_bearing", integrator="dop853", **many)
    with pytest.raises(MethodError, match="compensated"):
        rollout("vacuum", integrator="dop853", compensated=True, **many)
    with pytest.raises(MethodError, match="atol goes with rtol"):
        gym.make_vec("LabPendulum-v0", num_envs=2, integrator="dop853", atol=1e-8)
