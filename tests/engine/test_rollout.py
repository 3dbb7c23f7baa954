"""Tests of rollout: recorded rows and their times, stops, and refused arguments."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from integrators import MethodError
from pendulum_env import SCENES, Scene, SceneError, rollout
from pendulum_env.engine.machine import Machine
from pendulum_env.engine.starts import checked_methods, checked_start, checked_steps
from pendulum_env.films.record import record
from pendulum_env.physics.effects import Gravity

pytestmark = pytest.mark.usefixtures("all_interpreted")

FREE = Scene("free", effects=(Gravity(),), gravity=0.0)
"""Scene of uniform rotation: angle = start + velocity * time."""

# --- rows and times -------------------------------------------------------------------------------------------------


def test_rows_of_a_batch_are_those_of_single_runs_and_nan_after_a_stop() -> None:
    """Check that rows of a batch equal those of single runs and are nan after a stop, here between two rows."""
    usual: dict[str, Any] = {"velocity": 0.0, "duration": 2, "dt": 0.01, "every": 50, "speed_limit": 4.0}
    batch = rollout("vacuum", angle=[2.0, 1.0], **usual)
    assert set(batch.stop_reason) == {"speed_limit", ""}
    assert isinstance(batch.stop_time, np.ndarray)
    for i, angle in enumerate([2.0, 1.0]):
        single = rollout("vacuum", angle=angle, **usual)
        assert batch.stop_time[i] == single.stop_time == single.time[-1]
        for k, time in enumerate(batch.time):
            (same,) = np.nonzero(single.time == time)
            for name in ("angle", "velocity", "energy", "energy_residual"):
                value = getattr(batch, name)[i, k]
                assert value == getattr(single, name)[same[0]] if len(same) else math.isnan(value)
    assert np.isnan(batch.angle[0]).any()


def test_a_batch_of_free_rotations_is_where_its_times_say() -> None:
    """Check free rotations in a batch: all follow angle = velocity * time; one beyond the speed limit stops at once."""
    batch = rollout(FREE, angle=0.0, velocity=[[1.0, 2.0], [3.0, 5.0]], duration=1.0, dt=0.01, every=7, speed_limit=4.0)
    expected = np.array([[1.0, 2.0], [3.0, 5.0]])[..., None] * batch.time
    expected[1, 1, 1:] = math.nan
    assert batch.angle == pytest.approx(expected, abs=1e-13, nan_ok=True)
    assert np.array_equal(batch.stop_time, [[1.0, 1.0], [1.0, 0.01]])


@pytest.mark.parametrize("every", [1, 3, 7, 49])
def test_batch_and_single_have_the_same_times_to_the_last_bit(every: int) -> None:
    usual: dict[str, Any] = {"velocity": 0.0, "duration": 10.0, "dt": 0.07, "every": every}
    batch, single = rollout("vacuum", angle=[1.0], **usual), rollout("vacuum", angle=1.0, **usual)
    assert batch.time.tolist() == single.time.tolist()
    assert batch.time.tolist() == [min(every * k, 143) * 0.07 for k in range(len(batch.time))]


@pytest.mark.quick("batch-python", "single-python")
@pytest.mark.parametrize("backend", ["python", "compiled"])
@pytest.mark.parametrize("angle", [1.0, [1.0, 2.0]], ids=["single", "batch"])
def test_the_duration_is_kept_whatever_is_recorded(angle: Any, backend: Any) -> None:
    usual: dict[str, Any] = {"angle": angle, "velocity": 0.0, "duration": 10.0, "dt": 0.01, "backend": backend}
    every = rollout("vacuum", every=1, **usual)
    sparse = rollout("vacuum", every=300, **usual)
    assert sparse.time.tolist() == [0.0, 300 * 0.01, 600 * 0.01, 900 * 0.01, 1000 * 0.01]
    assert sparse.angle.tolist() == every.angle[..., [0, 300, 600, 900, 1000]].tolist()
    assert sparse.stop_time == pytest.approx(10.0, abs=1e-14)


def test_a_run_may_stop_in_its_last_shorter_stride() -> None:
    whole = rollout("vacuum", angle=2.0, velocity=0.0, duration=0.47, dt=0.01, speed_limit=4.0)
    assert whole.stop_reason == "speed_limit"
    sparse = rollout("vacuum", angle=2.0, velocity=0.0, duration=0.47, dt=0.01, every=20, speed_limit=4.0)
    assert sparse.stop_reason == "speed_limit"
    assert sparse.time.tolist() == [0.0, 20 * 0.01, 40 * 0.01, float(whole.time[-1])]
    assert sparse.angle[-1] == whole.angle[-1]


def test_every_beyond_the_run_records_start_and_end() -> None:
    run = rollout("vacuum", duration=0.5, dt=0.01, every=10**20)
    assert run.time.tolist() == [0.0, 50 * 0.01]


@pytest.mark.parametrize(
    ("duration", "h", "steps"),
    [(10.0, 0.01, 1000), (10.0, 0.07, 143), (1e-12, 0.01, 1), (0.3, 0.1, 3), (1.0, 0.3, 4), (1e8, 0.01, 10**10),
     (1e6 * 0.0123, 0.0123, 10**6)],
)
def test_steps_are_rounded_up_but_for_rounding(duration: float, h: float, steps: int) -> None:
    assert checked_steps(duration, h) == steps


# --- damping and parameters -----------------------------------------------------------------------------------------


def test_parameters_change_what_the_damping_left() -> None:
    run = rollout("vacuum", damping="linear", gamma=0.5, duration=0.1)
    assert run.scene.coefficients["linear_drag_rate"] == 0.5
    with pytest.raises(SceneError, match="gamma belongs to linear_drag, which damping='quadratic' leaves out"):
        rollout("lab", damping="quadratic", gamma=0.5)


# --- what is refused ------------------------------------------------------------------------------------------------

REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "dt below all": ({"dt": 1e-320}, "takes inf steps, more than the 1e+10"),
    "dt tiny": ({"dt": 1e-300}, "more than the 1e"),
    "duration huge": ({"duration": 1e18}, "takes 1e+20 steps"),
    "rows": ({"duration": 1e7}, "1000000001 states are too many to record"),
    "rows of a batch": ({"duration": 1e5, "angle": [0.1] * 20}, "200000020 states"),
    "angle": ({"angle": 1.1e8}, "angle must be between -1e+08 and 1e+08 rad at the start, not 110000000.0"),
    "angle in a batch": ({"angle": [0.0, -1e300]}, "angle must be between"),
    "velocity": ({"velocity": -1.1e9}, "velocity must be between -1e+09 and 1e+09 rad/s"),
    "angle in no turns": ({"scene": "textbook", "angle": 1e300}, "angle must be between -1e+100 and 1e+100"),
    "energy": ({"velocity": 1e9, "mass": 1e300}, "energy of a start"),
    "angle text": ({"angle": "1.0"}, "angle must be a number or an array of numbers [rad], not '1.0'"),
    "angle true": ({"angle": True}, "angle must be a number or an array"),
    "angle beyond floats": ({"angle": 10**400}, "angle must be a number or an array"),
    "angle nan": ({"angle": math.nan}, "angle must hold at least one number, all of them finite [rad], not nan"),
    "angle none of it": ({"velocity": [None]}, "velocity must hold"),
    "angles none": ({"angle": []}, "at least one"),
    "angles nan": ({"angle": [0.0, math.nan]}, "all of them finite"),
    "angles ragged": ({"angle": [[0.0], [0.0, 1.0]]}, "angle must be a number or an array"),
    "angles text": ({"angle": ["a"]}, "an array of numbers"),
    "shapes": ({"angle": [1.0, 2.0], "velocity": [1.0, 2.0, 3.0]}, "one shape"),
    "control": ({"control": 5}, "control must be between -1 and 1, not 5.0"),
    "every": ({"every": 0}, "every must be a whole number"),
    "length huge": ({"length": 1e200}, "moment of inertia"),
    "length tiny": ({"length": 1e-200}, "moment of inertia"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_clear_sentence(case: str) -> None:
    arguments, words = REFUSED[case]
    with pytest.raises(SceneError) as error:
        rollout(**{"scene": "vacuum", "velocity": 0.0, **arguments})
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"control": 5}, "control must be between -1 and 1"),
        ({"angle": 1e300}, "angle must be between -1e"),
        ({"velocity": 1e300}, "velocity must be between -1e"),
        ({"angle": "a"}, "angle must be a number"),
        ({"angle": [0.1, 0.2]}, "shows one run"),
        ({"dt": 1e-320}, "takes inf steps"),
        ({"dt": 1e-9}, "more than the 1e"),
        ({"duration": 1e300}, "frames is too long"),
        ({"fps": 1e308, "slow": 1e308}, "fps times slow must be"),
    ],
)
def test_films_refuse_what_rollouts_refuse(arguments: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=words):
        record(Machine(SCENES["lab"], "rk4", backend="python"), tmp_path / "a.gif", **{"duration": 20.0, **arguments})
    assert not list(tmp_path.iterdir())


def test_starts_at_the_limits_run_and_stay_finite() -> None:
    batch = rollout("vacuum", angle=[1e8, -1e8], velocity=0.0, duration=0.1, dt=0.01, warn=False)
    assert batch.stop_reason == ("", "")
    assert np.isfinite(batch.energy).all()
    assert rollout("vacuum", angle=0.0, velocity=1e9, duration=0.1, dt=0.01).energy[0] == pytest.approx(5e17)


def test_checked_starts_have_one_shape() -> None:
    angle, velocity = checked_start(SCENES["lab"], 1, 2.0)
    assert (float(angle), float(velocity), angle.shape) == (1.0, 2.0, ())
    angle, velocity = checked_start(SCENES["lab"], [[1.0], [2.0]], [0, 1, 2])
    assert angle.shape == velocity.shape == (2, 3)


def test_methods_are_each_there_once() -> None:
    names = ["rk4", "leapfrog", "heun"]
    assert [method.name for method in checked_methods(names, SCENES["vacuum"])] == ["rk4", "velocity_verlet", "heun"]
    for twice, words in (([*names, "velocity_verlet"], "velocity_verlet is named twice"), ([], "At least one")):
        with pytest.raises(MethodError, match=words):
            checked_methods(twice, SCENES["vacuum"])


def test_times_never_go_back() -> None:
    for every in range(1, 12):
        time = rollout("vacuum", duration=0.1, dt=0.01, every=every, backend="python").time
        assert all(early < late for early, late in pairwise(time))
        assert time[-1] == 10 * 0.01
