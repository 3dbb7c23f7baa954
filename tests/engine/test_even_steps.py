"""Tests of adaptive steps of equal length within each ``dt``, against closed forms, fixed steps, and each other."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from integrators import MethodError
from pendulum_env import SCENES, rollout
from pendulum_env.engine.machine import Machine, fitting
from pendulum_env.engine.pieces import Pace
from pendulum_env.engine.spec import RunSpec
from pendulum_env.physics.units import SceneError

METHODS = ["dopri5", "dop853", "verner9", "taylor16"]
LOSS: Any = {"damping": {"linear": {"gamma": 0.05}}}


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rtol", [1e-5, 1e-9])
def test_errors_of_small_swings_stay_near_the_tolerance(method: str, rtol: float) -> None:
    """Every step has an error below the tolerance, and errors of an undamped swing add up at most with the time."""
    found = rollout("textbook", integrator=method, angle=1.0, velocity=0.0, duration=40.0, dt=2.0, rtol=rtol,
                    even_steps=True)
    omega = math.sqrt(SCENES["textbook"].coefficients["spring_rate"])
    error = np.abs(found.angle - np.cos(omega * found.time)).max()
    assert 0.0 < error < found.steps * rtol * (1.0 + omega)


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("method", METHODS)
def test_a_damped_swing_is_scipys(method: str) -> None:
    found = rollout("vacuum", integrator=method, angle=2.0, velocity=0.0, duration=30.0, dt=3.0, rtol=1e-10,
                    even_steps=True, **LOSS)
    rate = SCENES["vacuum"].coefficients["gravity_rate"]
    truth = solve_ivp(lambda _, y: [y[1], -rate * math.sin(y[0]) - 0.05 * y[1]], (0.0, 30.0), [2.0, 0.0],
                      method="DOP853", rtol=1e-13, atol=1e-13, t_eval=found.time)
    assert np.abs(found.angle - truth.y[0]).max() < 1e-7
    assert np.abs(found.ledger.residual).max() < 1e-6


@pytest.mark.usefixtures("interpreted")
@pytest.mark.parametrize("method", [*METHODS, "taylor8"])
def test_steps_of_a_dt_are_equal(method: str) -> None:
    """An interval has the bits of fixed steps of dt/n, with n the number of steps that it took in its last division."""
    given: Any = {"scene": "vacuum", "integrator": method, "angle": 1.0, "velocity": 0.0, "duration": 1.0}
    one = rollout(dt=1.0, rtol=1e-9, even_steps=True, **given)
    fixed = rollout(dt=1.0 / one.steps, every=one.steps, **given)
    assert one.steps > 3
    assert one.rejected > 0
    assert one.angle.tolist() == fixed.angle.tolist()
    assert one.velocity.tolist() == fixed.velocity.tolist()


@pytest.mark.usefixtures("interpreted")
def test_their_number_follows_the_swing() -> None:
    """As a swing decays, its steps grow: the second half of a run takes fewer. An undamped one takes about as many."""
    given: Any = {"integrator": "taylor14", "angle": 2.5, "velocity": 0.0, "dt": 4.0, "rtol": 1e-9,
                  "even_steps": True}
    half, whole = (rollout("vacuum", duration=span, **LOSS, **given) for span in (80.0, 160.0))
    assert whole.steps - half.steps < 0.7 * half.steps
    half, whole = (rollout("vacuum", duration=span, **given) for span in (80.0, 160.0))
    assert 0.9 * half.steps < whole.steps - half.steps < 1.1 * half.steps


@pytest.mark.usefixtures("interpreted")
def test_they_err_less_than_steps_chosen_one_by_one() -> None:
    """With the same tolerance and at most a tenth more attempts, over 40 s beside the closed form."""
    given: Any = {"integrator": "taylor12", "angle": 2.0, "velocity": 0.0, "duration": 40.0, "dt": 2.0, "rtol": 1e-8}
    even, each = (rollout("vacuum", even_steps=equal, **given) for equal in (True, False))
    truth = rollout("vacuum", integrator="exact", angle=2.0, velocity=0.0, duration=40.0, dt=2.0)
    errors = [np.abs(run.angle - truth.angle).max() for run in (even, each)]
    assert even.steps + even.rejected < 1.1 * (each.steps + each.rejected)
    assert errors[0] < 0.3 * errors[1]


@pytest.mark.quick("driven-taylor16")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scene", ["driven", *(
    pytest.param(name, marks=pytest.mark.slow) for name in ("vacuum", "torsion", "kapitza", "gymnasium"))])
def test_compiled_and_interpreted_give_the_same_bits(method: str, scene: str) -> None:
    if method not in fitting(SCENES[scene]):
        pytest.skip("the method does not fit the scene")
    found = [rollout(scene, integrator=method, angle=1.0, duration=2.0, dt=0.5, rtol=1e-7, even_steps=True,
                     diagnostics=("energy", "heat_by_effect"), backend=backend) for backend in ("compiled", "python")]
    assert found[0].angle.tolist() == found[1].angle.tolist()
    assert found[0].ledger.work.tolist() == found[1].ledger.work.tolist()
    assert found[0].ledger.heat.tolist() == found[1].ledger.heat.tolist()
    assert (found[0].steps, found[0].rejected) == (found[1].steps, found[1].rejected)


@pytest.mark.parametrize(("method", "backend"), [
    ("dopri5", "python"), ("taylor16", "python"),
    *(pytest.param(method, "compiled", marks=pytest.mark.slow) for method in ("dopri5", "taylor16"))])
def test_a_pause_within_a_step_changes_no_bit(method: str, backend: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Calls of at most five attempts, which Ctrl-C could end, pause within steps and in rejected ones."""
    scene = SCENES["lab"]
    given: Any = {"integrator": method, "angle": 2.0, "duration": 3.0, "dt": 1.0, "rtol": 1e-9, "even_steps": True,
                  "backend": backend}
    whole = rollout(scene, **given)
    monkeypatch.setattr(Pace, "__init__", lambda self: setattr(self, "units", 5))
    monkeypatch.setattr(Pace, "learn", lambda *_: None)
    parts = rollout(scene, **given)
    assert whole.rejected > 0
    assert parts.angle.tolist() == whole.angle.tolist()
    assert parts.ledger.heat.tolist() == whole.ledger.heat.tolist()
    assert (parts.steps, parts.rejected) == (whole.steps, whole.rejected)


@pytest.mark.usefixtures("interpreted")
def test_too_many_steps_end_the_run() -> None:
    found = rollout("vacuum", integrator="dopri5", angle=1.0, dt=1e9, duration=2e9, rtol=1e-9, even_steps=True,
                    warn=False)
    assert found.stop_reason == "step_too_short"
    assert found.angle.tolist() == [1.0]


@pytest.mark.parametrize(("options", "kind", "said"), [
    ({"rtol": None}, MethodError, "even_steps goes with rtol, which is missing"),
    ({"angle": [0.1, 0.2]}, SceneError, "even_steps is for single runs; leave it out"),
    ({"estimate_error": True}, SceneError, "even_steps cannot be combined with an error estimate"),
    ({"dense": True}, SceneError, "even_steps cannot be combined with dense"),
    ({"events": ["top"]}, SceneError, "even_steps cannot be combined with events"),
    ({"even_steps": 1}, SceneError, "even_steps must be True or False"),
    ({"integrator": "rk4"}, MethodError, "rk4 does not estimate its error"),
])
def test_what_does_not_go_together_is_refused(options: Any, kind: type[Exception], said: str) -> None:
    given: Any = {"integrator": "dopri5", "rtol": 1e-6, "even_steps": True, **options}
    with pytest.raises(kind, match=said):
        rollout("vacuum", **given)


@pytest.mark.usefixtures("interpreted")
def test_wires_that_may_go_slack_are_refused() -> None:
    with pytest.raises(MethodError, match="where a wire may go slack, as in the scene 'exercise_large'; leave it out"):
        rollout("exercise_large", integrator="dopri5", rtol=1e-6, even_steps=True)
    assert rollout(SCENES["exercise_large"].replace(suspension="rod"), integrator="dopri5", rtol=1e-6, duration=1.0,
                   even_steps=True).steps > 3


def test_a_machine_keeps_them() -> None:
    """Copies and descriptions of a machine have the same steps."""
    machine = Machine(SCENES["vacuum"], "dopri5", rtol=1e-6, even_steps=True)
    assert copy.copy(machine).even_steps
    assert RunSpec.of_machine(machine).machine().even_steps
    assert not Machine(SCENES["vacuum"], "dopri5", rtol=1e-6).even_steps
