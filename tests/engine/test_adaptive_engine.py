"""Tests of adaptive steps within a control step, against elliptic functions and against runs with very short steps."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from given_effects import Blow

import integrators
import pendulum_env
from integrators import MethodError
from pendulum_env import SCENES, Scene, rollout
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
    assert -np.polyfit(exponents, np.log10(errors), 1)[0] == pytest.approx(1.0, abs=0.25)
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


@dataclass(frozen=True)
class Spring(Effect):
    """An effect with a torque that depends on the time."""

    name = "spring"
    kind = "drive"
    equation = "{spring_rate} (t/20 - theta - 30 theta^3)"
    source = "made up"
    torque = staticmethod(spring)

    def coefficients(self, scene: Scene) -> dict[str, float]:
        return {"spring_rate": 4.0}


@pytest.mark.parametrize("name", NAMES)
def test_steps_are_those_of_solve(name: str) -> None:
    """Check that the engine takes and rejects as many steps as integrators.solve, with equal states to rounding."""
    options: dict[str, Any] = {"angle": 0.3, "velocity": -1.0, "duration": 6.0, "dt": 1.0, "backend": "python"}
    run = rollout(Scene(effects=(Spring(),)), integrator=name, rtol=1e-7, diagnostics=(), **options)
    system = integrators.System(lambda t, q, v: spring(t, q, 4.0), velocity_free=True)
    alone = integrators.solve(system, 0.3, -1.0, run.time, method=name, rtol=1e-7, h=1.0)
    assert (run.steps, run.rejected) == (alone.steps, alone.rejected)
    assert run.rejected > 0
    assert run.angle == pytest.approx(alone.q, abs=1e-9)
    assert run.velocity == pytest.approx(alone.v, abs=1e-9)


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
    with pytest.raises(MethodError, match="for single environments"):
        gym.make_vec("LabPendulum-v0", num_envs=2, integrator="dop853", rtol=1e-8)
    with pytest.raises(MethodError, match="for single runs"):
        rollout("lab", integrator="dop853", rtol=1e-8, angle=[0.1, 0.2])
